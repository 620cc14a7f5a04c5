"""Where the fields of those u-blox messages are that a recording is made of, by the interface
descriptions of u-blox 6, M8 and F9 (UBX-NAV, UBX-ESF). A layout ends with the last field that is
needed, because newer receivers append fields."""

from typing import Any

import numpy as np


def _layout(**fields: tuple[int, str]) -> np.dtype[Any]:
    """The type of a record with these fields: (offset in the payload, format)."""
    return np.dtype(
        {
            "names": list(fields),
            "offsets": [offset for offset, _ in fields.values()],
            "formats": [f"<{kind}" for _, kind in fields.values()],
        }
    )


NAV_POSLLH, NAV_STATUS, NAV_SOL, NAV_PVT = 0x0102, 0x0103, 0x0106, 0x0107
NAV_VELNED, NAV_HPPOSLLH, NAV_PVAT, NAV_TIMEGPS = 0x0112, 0x0114, 0x0117, 0x0120
ESF_MEAS, ESF_RAW, ESF_ALG = 0x1002, 0x1003, 0x1014

DATE = dict(year=(0, "u2"), month=(2, "u1"), day=(3, "u1"), hour=(4, "u1"), minute=(5, "u1"))


def _date(at: int) -> dict[str, tuple[int, str]]:
    """Year to second, UTC, from an offset on."""
    fields = {name: (at + offset, kind) for name, (offset, kind) in DATE.items()}
    return fields | {"second": (at + 6, "u1")}


def _solution(at: int) -> dict[str, tuple[int, str]]:
    """Of NAV-PVT and NAV-PVAT, from the longitude on: what both have alike."""
    names = ("lon", "lat", "height", "hMSL", "hAcc", "vAcc", "velN", "velE", "velD")
    unsigned = {"hAcc", "vAcc"}
    return {name: (at + 4 * i, "u4" if name in unsigned else "i4") for i, name in enumerate(names)}


LAYOUTS: dict[int, np.dtype[Any]] = {
    NAV_PVT: _layout(
        iTOW=(0, "u4"),
        **_date(4),
        valid=(11, "u1"),
        fixType=(20, "u1"),
        flags=(21, "u1"),
        **_solution(24),
        sAcc=(68, "u4"),
        flags3=(78, "u2"),
    ),
    NAV_PVAT: _layout(
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
    NAV_POSLLH: _layout(
        iTOW=(0, "u4"),
        lon=(4, "i4"),
        lat=(8, "i4"),
        height=(12, "i4"),
        hAcc=(20, "u4"),
        vAcc=(24, "u4"),
    ),
    NAV_HPPOSLLH: _layout(
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
    NAV_VELNED: _layout(
        iTOW=(0, "u4"), velN=(4, "i4"), velE=(8, "i4"), velD=(12, "i4"), sAcc=(28, "u4")
    ),
    NAV_SOL: _layout(iTOW=(0, "u4"), week=(8, "i2"), fixType=(10, "u1"), flags=(11, "u1")),
    NAV_STATUS: _layout(iTOW=(0, "u4"), fixType=(4, "u1"), flags=(5, "u1")),
    NAV_TIMEGPS: _layout(iTOW=(0, "u4"), week=(8, "i2"), valid=(11, "u1")),
    ESF_ALG: _layout(
        flags=(5, "u1"), error=(6, "u1"), yaw=(8, "u4"), pitch=(12, "i2"), roll=(14, "i2")
    ),
}
