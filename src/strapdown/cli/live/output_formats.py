"""Lines of the newest state: JSON, and NMEA 0183 (GGA, RMC, HDT and PASHR)."""

import json
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from math import degrees, sqrt
from typing import NamedTuple

import numpy as np

from ...core.loop.contract import DOUBTFUL, INVALID, VALID, FilterState, Status
from ...sensor_models.geoid import undulation
from ...units.time_scales import unix_from_gps
from .pose import angles

KNOT = 1852.0 / 3600.0
"""m/s"""
TALKER = "IN"
"""Integrated navigation."""
QUALITY: dict[int, int] = {VALID: 1}
"""Quality of GGA; that of every other status is 6, estimated."""
MODE: dict[int, str] = {VALID: "A"}
"""Mode of RMC; that of every other status is E, estimated."""


class Shown(NamedTuple):
    """A state that goes out."""

    t: float  # s
    moment: datetime | None  # UTC, where the clock is absolute
    status: int
    state: FilterState
    alignments: int = 0  # number of times that the filter began to align anew


def state_at(
    t: float, epoch: float | None, status: int, state: FilterState, alignments: int = 0
) -> Shown:
    """Return a state at t s since `epoch`, in s of GPS time since its zero, or None. Its moment is
    None, too, where no calendar has it."""
    moment = None
    if epoch is not None:
        unix = round(float(unix_from_gps(epoch + t)), 3)
        with suppress(OverflowError):
            moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=unix)
    return Shown(t, moment, status, state, alignments)


def json_line(it: Shown) -> str:
    """Return the state as a JSON object on one line: angles in deg, the rest in SI."""
    # without numpy, whose calls take longer than the numbers
    lat, lon, height = it.state.lla.tolist()
    variances = it.state.P.diagonal()[:9].tolist()
    table = {
        "t": it.t,
        "utc": it.moment and it.moment.isoformat(timespec="milliseconds"),
        "status": Status(it.status).name.lower(),
        "lat": _number_or_null(degrees(lat)),
        "lon": _number_or_null(degrees(lon)),
        "height": _number_or_null(height),
        "v_n": [*map(_number_or_null, it.state.v_n.tolist())],
        "rph": [*map(_number_or_null, angles(it.state))],
        "std": [sqrt(variance) if variance >= 0 else None for variance in variances],
    }
    return json.dumps(table) + "\n"


def _number_or_null(value: float) -> float | None:
    """Return a number, None for NaN, which JSON lacks."""
    return value if value == value else None


def nmea_lines(it: Shown) -> str:
    """Return GGA, RMC, HDT and PASHR of the state. Without an absolute clock the time of day is
    that of t."""
    seconds = it.t % 86400.0
    clock = it.moment or datetime(2000, 1, 1) + timedelta(seconds=round(seconds, 3))
    hour = f"{clock:%H%M%S}.{clock.microsecond // 1000:03d}"
    day = f"{it.moment:%d%m%y}" if it.moment else ""
    bodies = [_gga(it, hour), _rmc(it, hour, day), *_heading(it, hour)]
    return "".join(f"${body}*{_checksum(body):02X}\r\n" for body in bodies)


def _checksum(body: str) -> int:
    found = 0
    for byte in body.encode():
        found ^= byte
    return found


def _is_known(it: Shown) -> bool:
    return bool(np.isfinite(it.state.lla).all()) and it.status != INVALID


def _place(it: Shown) -> str:
    """Latitude and longitude as ddmm.mmmmmmm,N,dddmm.mmmmmmm,E."""
    parts = []
    for value, width, marks in zip(np.degrees(it.state.lla[:2]).tolist(), (2, 3), ("NS", "EW")):
        minutes = round(abs(value) * 60.0, 7)
        whole = f"{int(minutes // 60):0{width}d}{minutes % 60:010.7f}"
        parts.append(f"{whole},{marks[value < 0]}")
    return ",".join(parts)


def _gga(it: Shown, hour: str) -> str:
    if not _is_known(it):
        return f"{TALKER}GGA,{hour},,,,,0,,,,M,,M,,"
    above = float(undulation(it.state.lla[:1], it.state.lla[1:2])[0])
    height, quality = it.state.lla[2] - above, QUALITY.get(it.status, 6)
    return f"{TALKER}GGA,{hour},{_place(it)},{quality},,,{height:.3f},M,{above:.3f},M,,"


def _rmc(it: Shown, hour: str, day: str) -> str:
    if not _is_known(it):
        return f"{TALKER}RMC,{hour},V,,,,,,,{day},,,N"
    north, east = it.state.v_n[:2].tolist()
    course = np.degrees(np.arctan2(east, north)) % 360.0
    knots = np.hypot(north, east) / KNOT
    good = "V" if it.status == DOUBTFUL else "A"
    mode = MODE.get(it.status, "E")
    return f"{TALKER}RMC,{hour},{good},{_place(it)},{knots:.3f},{course:.2f},{day},,,{mode}"


def _heading(it: Shown, hour: str) -> list[str]:
    """HDT and PASHR; nothing where the attitude is unknown."""
    if not np.isfinite(it.state.C_nb).all():
        return []
    roll, pitch, heading = angles(it.state)
    std = np.degrees(np.sqrt(np.diag(it.state.P)[6:9]))
    level = float(np.hypot(*std[:2]) / np.sqrt(2))
    aided = int(it.status == VALID)
    accuracy = f"{level:.3f},{level:.3f},{std[2]:.3f},{aided},1"
    return [
        f"{TALKER}HDT,{heading:.2f},T",
        f"PASHR,{hour},{heading:.2f},T,{roll:+.2f},{pitch:+.2f},,{accuracy}",
    ]


LINES = {"json": json_line, "nmea": nmea_lines}
"""{format: function of a Shown}."""
