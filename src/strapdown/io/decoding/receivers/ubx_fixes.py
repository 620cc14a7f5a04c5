"""Positions and velocities of a u-blox receiver in m, m/s and deg, from any of its messages."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....typing import Array, Ints
from .cyclic_times import CyclicClock, in_order, same_time
from .ubx_frames import FIRST_RELATIVE, LAYOUTS, UbxFrames, UbxMessage

Columns = dict[str, NDArray[Any]]
TIME_VALID = 0x03
"""Flags of NAV-PVT: date and time of day are valid."""
RELATIVE = 0x25
"""Flags of NAV-RELPOSNED: the fix is right, its components are valid, and the base moves."""
AGES = np.array([np.nan, 1, 2, 5, 10, 15, 20, 30, 45, 60, 90, 120] + [np.inf] * 4)
"""s: upper bounds of the ages of corrections that flags3 of NAV-PVT has as a number; NaN without any."""
MIN_STD = 1e-3
"""m and m/s, the resolution of NAV-PVT: a smaller standard deviation appears as 0."""


def solutions(frames: UbxFrames, clock: CyclicClock) -> tuple[str, Columns]:
    """(name of the message, its columns) of all epochs with a valid time, in file order: `t` in ms,
    `fixType`, `ok` (within the receiver's own limits), positions, velocities and their accuracies.
    Empty without a position."""
    for key, read in (
        (UbxMessage.NAV_PVT, _pvt),
        (UbxMessage.NAV_HPPOSLLH, _of_older),
        (UbxMessage.NAV_POSLLH, _of_older),
    ):
        place, records = frames.records(key, LAYOUTS[key])
        if len(records):
            found = read(frames, clock, place, records)
            if key == UbxMessage.NAV_PVT:
                found = _high_precision(frames, clock, found) | _protection(frames, clock, found)
            return key.title, found
    return "", {}


def vehicle(frames: UbxFrames, clock: CyclicClock) -> Columns:
    """NAV-PVAT: position, velocity and attitude from the receiver's own fusion."""
    place, records = frames.records(UbxMessage.NAV_PVAT, LAYOUTS[UbxMessage.NAV_PVAT])
    found = _pvt(frames, clock, place, records)
    valid = records["valid"] & TIME_VALID == TIME_VALID
    flags = records["flags"][valid]
    for bit, name in ((3, "vehRoll"), (4, "vehPitch"), (5, "vehHeading")):
        found[name] = np.where(flags >> bit & 1, records[name][valid] / 1e5, np.nan)
    return found


def baselines(frames: UbxFrames, clock: CyclicClock) -> Columns:
    """NAV-RELPOSNED of a base that moves with the vehicle, in m: vectors from its antenna to that of
    this receiver, in the order of time. Rows without a carrier solution are left out."""
    row, place, records = _relative(frames)
    flags = records["flags"]
    good = (flags & RELATIVE == RELATIVE) & (carrier_of(flags) > 0)
    row, place, records = row[good], place[good], records[good]
    found: Columns = {
        "row": row,
        "t": clock.ms(place, records["iTOW"]),
        "carrier": carrier_of(records["flags"]),
    }
    for axis in "NED":
        centimetres = records[f"relPos{axis}"] + records[f"relPosHP{axis}"] / 100
        found[f"relPos{axis}"] = centimetres / 100
        found[f"acc{axis}"] = np.maximum(records[f"acc{axis}"] / 1e4, MIN_STD)
    order, _, _ = in_order(found["t"])
    return {name: values[order] for name, values in found.items()}


def _relative(frames: UbxFrames) -> tuple[Ints, Ints, NDArray[Any]]:
    """(rows among all of them, places, records) of NAV-RELPOSNED of either version; a file has one."""
    key = UbxMessage.NAV_RELPOSNED
    for version, layout in enumerate((FIRST_RELATIVE, LAYOUTS[key])):
        place, records = frames.records(key, layout)
        row = np.flatnonzero(records["version"] == version)
        if len(row) or version:
            break
    return row, place[row], records[row]


def carrier_of(flags: NDArray[Any]) -> NDArray[Any]:
    """Carrier solutions (n,) of flags of NAV-RELPOSNED: 0 none, 1 float, 2 fixed."""
    return flags >> 3 & 3


def untimed_message_lines(frames: UbxFrames) -> list[str]:
    """Return lines on the messages before the receiver knew date and time; they are not used."""
    lines = []
    for key in (UbxMessage.NAV_PVT, UbxMessage.NAV_PVAT):
        _, records = frames.records(key, LAYOUTS[key])
        many = int(np.count_nonzero(records["valid"] & TIME_VALID != TIME_VALID))
        if many:
            lines.append(f"{many} {key.title} without a valid date and time")
    return lines


def _pvt(frames: UbxFrames, clock: CyclicClock, place: Ints, records: NDArray[Any]) -> Columns:
    valid = records["valid"] & TIME_VALID == TIME_VALID
    place, records = place[valid], records[valid]
    found = {
        "row": np.flatnonzero(valid),
        "place": place,
        "t": clock.ms(place, records["iTOW"]),
        "fixType": records["fixType"],
        "ok": (records["flags"] & 1).astype(bool),
        "carrSoln": records["flags"] >> 6,
        "lat": records["lat"] / 1e7,
        "lon": records["lon"] / 1e7,
    }
    names = ("height", "hAcc", "vAcc", "velN", "velE", "velD", "sAcc")
    found |= {name: records[name] / 1e3 for name in names}
    if records.dtype == LAYOUTS[UbxMessage.NAV_PVT]:
        found["ok"] &= records["flags3"] & 1 == 0
        found["numSV"] = records["numSV"]
        found["correctionAge"] = AGES[records["flags3"] >> 1 & 15]
    return found


def _of_older(frames: UbxFrames, clock: CyclicClock, place: Ints, records: NDArray[Any]) -> Columns:
    """Complete a position-only message with the velocity and the fix state at its times."""
    t = clock.ms(place, records["iTOW"])
    found = {"row": np.arange(len(t)), "place": place, "t": t, **_position(records)}
    velocity = _at(frames, clock, UbxMessage.NAV_VELNED, t, ("velN", "velE", "velD", "sAcc"))
    found |= {name: values / 100 for name, values in velocity.items()}
    state = UbxMessage.NAV_SOL if frames.count(UbxMessage.NAV_SOL) else UbxMessage.NAV_STATUS
    told = _at(frames, clock, state, t, ("fixType", "flags"))
    known = np.isfinite(told["fixType"])
    # a receiver that does not report the state of its fixes reports their accuracy
    known_or_none = known | (frames.count(state) == 0)
    found["fixType"] = np.where(known, np.nan_to_num(told["fixType"]), 3).astype(int)
    right = np.nan_to_num(told["flags"]).astype(int) & 0x09 == 0x09  # fix and time of week
    found["ok"] = np.where(known, right, known_or_none & (found["hAcc"] < 100))
    return found


def _position(records: NDArray[Any]) -> Columns:
    if records.dtype != LAYOUTS[UbxMessage.NAV_HPPOSLLH]:
        found = {name: records[name] / 1e7 for name in ("lat", "lon")}
        return found | {name: records[name] / 1e3 for name in ("height", "hAcc", "vAcc")}
    found = {
        name: (records[name] * np.int64(100) + records[f"{name}Hp"]) / 1e9
        for name in ("lat", "lon")
    }
    found["height"] = (records["height"] * np.int64(10) + records["heightHp"]) / 1e4
    invalid = records["invalid"] & 1 == 1
    found |= {name: records[name] / 1e4 for name in ("hAcc", "vAcc")}
    return {name: np.where(invalid, np.nan, values) for name, values in found.items()}


def _high_precision(frames: UbxFrames, clock: CyclicClock, found: Columns) -> Columns:
    """Replace positions by those of NAV-HPPOSLLH, 0.1 mm, at the epochs that have one."""
    place, records = frames.records(UbxMessage.NAV_HPPOSLLH, LAYOUTS[UbxMessage.NAV_HPPOSLLH])
    if not len(records):
        return found
    t, finer = clock.ms(place, records["iTOW"]), _position(records)
    for name, values in finer.items():
        at = same_time(found["t"], t, values)
        found[name] = np.where(np.isfinite(at), at, found[name])
    return found


def _protection(frames: UbxFrames, clock: CyclicClock, found: Columns) -> Columns:
    """The protection levels of NAV-PL at the epochs, m: plPos1 to plPos3, of which the third is vertical;
    {} without the message, NaN where the receiver holds them for invalid."""
    place, records = frames.records(UbxMessage.NAV_PL, LAYOUTS[UbxMessage.NAV_PL])
    valid = records["plPosValid"] == 1
    t = clock.ms(place, records["iTOW"])
    return {
        name: same_time(found["t"], t, np.where(valid, records[name] / 1e3, np.nan))
        for name in ("plPos1", "plPos2", "plPos3")
        if len(records)
    }


def _at(
    frames: UbxFrames, clock: CyclicClock, key: UbxMessage, t: Ints, names: tuple[str, ...]
) -> dict[str, Array]:
    """Return fields of the messages of one kind at the epochs t; NaN without a message."""
    place, records = frames.records(key, LAYOUTS[key])
    there = clock.ms(place, records["iTOW"])
    return {name: same_time(t, there, records[name].astype(float)) for name in names}


def usable(found: Columns, kinds: tuple[int, ...]) -> tuple[Columns, int, int]:
    """(columns of the fixes of these types that the receiver marks as valid, in time order; number
    out of order; number that repeat a time). A two-dimensional fix has no height and vertical
    velocity, because the receiver held them."""
    keep = np.isin(found["fixType"], kinds) & found["ok"]
    columns = {name: values[keep] for name, values in found.items() if name != "ok"}
    order, late, twice = in_order(columns["t"])
    columns = {name: values[order] for name, values in columns.items()}
    flat = columns["fixType"] == 2
    for name in ("height", "vAcc", "velD"):
        if name in columns:
            columns[name] = np.where(flat, np.nan, columns[name])
    for name in ("hAcc", "vAcc", "sAcc"):
        if name in columns:
            columns[name] = np.maximum(columns[name], MIN_STD)
    return columns, late, twice
