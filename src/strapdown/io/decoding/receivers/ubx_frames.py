"""Messages of a u-blox receiver among other data of the same port, such as NMEA, RTCM or text.

A frame is B5 62, class, identifier, length of the payload (2 bytes, little-endian), payload, and
two bytes of Fletcher's checksum over all but the first two (u-blox M8 and F9 interface
descriptions, "UBX frame structure"). `LAYOUTS` has the fields of the messages that make a
recording; `clock` converts their times of week to GPS time, using the weeks and dates in some of
them.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....typing import Array, Ints
from ....units.time_scales import DAY, days_of, gps_from_unix
from ..record_walk import Bytes, structured_records
from .cyclic_times import WEEK_MS, CyclicClock, clock_of, moments


class UbxMessage(IntEnum):
    """The messages that are read: 256 times class plus identifier."""

    NAV_POSLLH = 0x0102
    NAV_STATUS = 0x0103
    NAV_SOL = 0x0106
    NAV_PVT = 0x0107
    NAV_VELNED = 0x0112
    NAV_HPPOSLLH = 0x0114
    NAV_PVAT = 0x0117
    NAV_TIMEGPS = 0x0120
    NAV_RELPOSNED = 0x013C
    NAV_PL = 0x0162
    ESF_MEAS = 0x1002
    ESF_RAW = 0x1003
    ESF_ALG = 0x1014

    @property
    def title(self) -> str:
        """The name in the interface descriptions."""
        return self.name.replace("_", "-")


class UbxFrames(NamedTuple):
    """Frames with correct checksums in file order, without overlap."""

    content: Bytes
    start: Ints  # of the payloads
    length: Ints  # of the payloads
    key: Ints  # number of the `UbxMessage`
    rejected: int  # places that begin like a frame and fail the checksum
    cut: int  # frames that would continue beyond the end

    def count(self, key: int) -> int:
        """Number of frames of this kind."""
        return int(np.count_nonzero(self.key == key))

    def records(self, key: UbxMessage, layout: np.dtype[Any]) -> tuple[Ints, NDArray[Any]]:
        """(start (n,), records (n,)) of the frames of one kind that are long enough."""
        start = self.start[(self.key == key) & (self.length >= layout.itemsize)]
        return start, structured_records(self.content, start, layout)


def find_frames(data: bytes) -> UbxFrames:
    """The frames in these bytes."""
    content = np.frombuffer(data, np.uint8)
    sync = np.flatnonzero((content[:-1] == 0xB5) & (content[1:] == 0x62))
    whole = sync[sync + 8 <= len(content)]
    length = content[whole + 4].astype(int) + 256 * content[whole + 5].astype(int)
    inside = whole + 8 + length <= len(content)
    cut, whole, length = whole[~inside], whole[inside], length[inside]
    right = _checksums_right(content, whole, length)
    start, size = whole[right], length[right]
    apart = _without_overlap(start, start + 8 + size)
    start, size = start[apart], size[apart]
    wrong = np.r_[whole[~right], cut, sync[sync + 8 > len(content)]]
    # a payload may hold the first two bytes of a frame by chance
    before = np.searchsorted(start, wrong, side="right") - 1
    ends = np.r_[0, start + 8 + size]
    free = wrong >= ends[before + 1]
    beyond = np.arange(len(wrong)) >= np.count_nonzero(~right)
    key = 256 * content[start + 2].astype(int) + content[start + 3]
    return UbxFrames(
        content,
        start + 6,
        size,
        key,
        int(np.count_nonzero(free & ~beyond)),
        int(np.count_nonzero(free & beyond)),
    )


def _checksums_right(content: Bytes, start: Ints, length: Ints) -> NDArray[np.bool_]:
    """Return True where the checksum of a candidate is correct (n,). Cumulative sums of all bytes
    give the first byte of the checksum; cumulative sums of these give the second."""
    if not len(start):
        return np.zeros(0, bool)
    once = np.cumsum(content, dtype=np.uint8)
    twice = np.cumsum(once, dtype=np.uint8)
    first, last = start + 1, start + 5 + length
    many = (length + 4).astype(np.uint8)
    a = once[last] - once[first]
    b = twice[last] - twice[first] - many * once[first]
    return (a == content[last + 1]) & (b == content[last + 2])


def _without_overlap(start: Ints, end: Ints) -> NDArray[np.bool_]:
    """Return True for the frames (n,) that do not begin inside an earlier accepted frame."""
    keep = np.ones(len(start), bool)
    if (start[1:] >= end[:-1]).all():
        return keep
    free = 0
    for i, (begin, stop) in enumerate(zip(start.tolist(), end.tolist())):
        keep[i] = begin >= free
        free = max(free, stop) if keep[i] else free
    return keep


# ---- layouts


def _layout(**fields: tuple[int, str]) -> np.dtype[Any]:
    """The type of a record with these fields: (offset in the payload, format)."""
    return np.dtype(
        {
            "names": list(fields),
            "offsets": [offset for offset, _ in fields.values()],
            "formats": [f"<{kind}" for _, kind in fields.values()],
        }
    )


DATE = dict(year=(0, "u2"), month=(2, "u1"), day=(3, "u1"), hour=(4, "u1"), minute=(5, "u1"))


def _date(at: int) -> dict[str, tuple[int, str]]:
    """Year to second, UTC, from an offset on."""
    fields = {name: (at + offset, kind) for name, (offset, kind) in DATE.items()}
    return fields | {"second": (at + 6, "u1")}


def _solution(at: int) -> dict[str, tuple[int, str]]:
    """Return {name: (offset, type)} of the common fields of NAV-PVT and NAV-PVAT, which begin with
    the longitude at offset `at`."""
    names = ("lon", "lat", "height", "hMSL", "hAcc", "vAcc", "velN", "velE", "velD")
    unsigned = {"hAcc", "vAcc"}
    return {name: (at + 4 * i, "u4" if name in unsigned else "i4") for i, name in enumerate(names)}


def _relative(finer: int, accuracy: int, flags: int) -> dict[str, tuple[int, str]]:
    """The fields of a NAV-RELPOSNED whose high-precision parts, accuracies and flags begin at these
    offsets."""
    found = {"version": (0, "u1"), "iTOW": (4, "u4"), "flags": (flags, "u4")}
    for i, axis in enumerate("NED"):
        found |= {
            f"relPos{axis}": (8 + 4 * i, "i4"),
            f"relPosHP{axis}": (finer + i, "i1"),
            f"acc{axis}": (accuracy + 4 * i, "u4"),
        }
    return found


LAYOUTS: dict[UbxMessage, np.dtype[Any]] = {
    UbxMessage.NAV_PVT: _layout(
        iTOW=(0, "u4"),
        **_date(4),
        valid=(11, "u1"),
        fixType=(20, "u1"),
        flags=(21, "u1"),
        numSV=(23, "u1"),
        **_solution(24),
        sAcc=(68, "u4"),
        flags3=(78, "u2"),
    ),
    UbxMessage.NAV_PVAT: _layout(
        iTOW=(0, "u4"),
        valid=(5, "u1"),
        **_date(6),
        fixType=(24, "u1"),
        flags=(25, "u1"),
        **_solution(28),
        sAcc=(68, "u4"),
        vehRoll=(72, "i4"),
        vehPitch=(76, "i4"),
        vehHeading=(80, "i4"),
    ),
    UbxMessage.NAV_POSLLH: _layout(
        iTOW=(0, "u4"),
        lon=(4, "i4"),
        lat=(8, "i4"),
        height=(12, "i4"),
        hAcc=(20, "u4"),
        vAcc=(24, "u4"),
    ),
    UbxMessage.NAV_HPPOSLLH: _layout(
        invalid=(3, "u1"),
        iTOW=(4, "u4"),
        lon=(8, "i4"),
        lat=(12, "i4"),
        height=(16, "i4"),
        lonHp=(24, "i1"),
        latHp=(25, "i1"),
        heightHp=(26, "i1"),
        hAcc=(28, "u4"),
        vAcc=(32, "u4"),
    ),
    UbxMessage.NAV_VELNED: _layout(
        iTOW=(0, "u4"), velN=(4, "i4"), velE=(8, "i4"), velD=(12, "i4"), sAcc=(28, "u4")
    ),
    UbxMessage.NAV_SOL: _layout(
        iTOW=(0, "u4"), week=(8, "i2"), fixType=(10, "u1"), flags=(11, "u1")
    ),
    UbxMessage.NAV_STATUS: _layout(iTOW=(0, "u4"), fixType=(4, "u1"), flags=(5, "u1")),
    UbxMessage.NAV_TIMEGPS: _layout(iTOW=(0, "u4"), week=(8, "i2"), valid=(11, "u1")),
    UbxMessage.NAV_RELPOSNED: _layout(**_relative(32, 36, 60)),
    UbxMessage.NAV_PL: _layout(
        plPosValid=(3, "u1"),
        iTOW=(12, "u4"),
        plPos1=(16, "u4"),
        plPos2=(20, "u4"),
        plPos3=(24, "u4"),
    ),
    UbxMessage.ESF_ALG: _layout(
        flags=(5, "u1"), error=(6, "u1"), yaw=(8, "u4"), pitch=(12, "i2"), roll=(14, "i2")
    ),
}
"""From the interface descriptions of u-blox 6, M8 and F9 (UBX-NAV, UBX-ESF). A layout ends with the
last necessary field, because newer receivers append fields."""
FIRST_RELATIVE = _layout(**_relative(20, 24, 36))
"""NAV-RELPOSNED of version 0, of the M8P."""


# ---- moments

EPOCHS = (UbxMessage.NAV_PVT, UbxMessage.NAV_SOL, UbxMessage.NAV_TIMEGPS, UbxMessage.NAV_PVAT)
"""Messages with a date or a week."""
WEEKLESS = (UbxMessage.NAV_POSLLH, UbxMessage.NAV_HPPOSLLH)
"""Position messages without a week."""
VALID = {
    UbxMessage.NAV_PVT: 0x03,
    UbxMessage.NAV_PVAT: 0x03,
    UbxMessage.NAV_TIMEGPS: 0x03,
    UbxMessage.NAV_SOL: 0x0C,
}
"""Bits that are all set where date (or week) and time are valid."""


GPS = {"column": "gps_ms", "unit": "ms", "clock": "gps"}
OF_WEEK = {"column": "tow_ms", "unit": "ms", "clock": "gps", "week": None}
"""The key `time` of a description, with and without a known week."""


def clock(frames: UbxFrames) -> CyclicClock:
    """The clock of a file."""
    dated, timed = [], []
    for key in EPOCHS:
        place, records = frames.records(key, LAYOUTS[key])
        valid = (
            records["flags" if key == UbxMessage.NAV_SOL else "valid"] & VALID[key] == VALID[key]
        )
        tow = records["iTOW"].astype(int)
        timed.append((place, tow))
        if key in (UbxMessage.NAV_PVT, UbxMessage.NAV_PVAT):
            gps = np.round(1e3 * gps_from_unix(_unix(records)))
            valid &= np.isfinite(gps)
            moment = moments(place, tow, place, np.nan_to_num(gps).astype(int), WEEK_MS)
        else:
            moment = records["week"].astype(int) * WEEK_MS + tow
        valid &= moment > 0
        dated.append((place[valid], moment[valid]))
    for key in WEEKLESS:
        place, records = frames.records(key, LAYOUTS[key])
        timed.append((place, records["iTOW"].astype(int)))
    return clock_of(dated, timed, WEEK_MS, GPS, OF_WEEK)


def _unix(records: NDArray[Any]) -> Array:
    """Return POSIX seconds from the fields year to second; NaN where they are not a date."""
    days = days_of(*(records[name].astype(float) for name in ("year", "month", "day")))
    seconds = records["hour"] * 3600.0 + records["minute"] * 60.0 + records["second"]
    return days * DAY + seconds
