"""Solutions of RTKLIB (.pos): latitude, longitude and height, ECEF or the baseline from a known base,
with standard deviations and, in newer versions, velocity (RTKLIB 2.4.2 manual, appendix B.2;
solution.c of RTKLIB demo5).

Standard deviations of pairs, such as sdne, are signed square roots of covariances.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...geodesy import from_ecef, ned_axes, to_ecef
from ...time_scales import GPS_ZERO, WEEK
from ...typing import Array, Ints
from ..contract import Log, Reader, Section
from ..decoding.cyclic_times import in_order
from ..table_file import Table, packed, read_bytes

START = 1 << 16
"""Bytes in which the line of column names must stand."""
NAMES = re.compile(r"^%\s*(GPST|UTC|JST)[\s,;]+(.*(?:latitude|x-ecef|e-baseline).*)$", re.MULTILINE)
REFERENCE = re.compile(r"^%\s*ref pos\s*:\s*(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE)
LEAST_SD = 1e-3
"""m and m/s: a smaller standard deviation is rounded to 0 in some versions."""
QUALITIES = {1: "fixed", 2: "float", 3: "SBAS", 4: "DGPS", 5: "single", 6: "PPP"}
UP = np.array([[1.0], [1.0], [-1.0]])
"""Turns rows north, east, down to north, east, up."""
DEGREES = np.array([np.pi / 180, np.pi / 180, 1.0])
JST_AHEAD = 9 * 3600
"""s"""


class Solution(NamedTuple):
    """The columns of a file, and when."""

    scale: str  # GPST, UTC or JST
    ms: Ints  # (n,) of the calendar of `scale`, since 1970
    columns: dict[str, Array]  # by name without unit
    rows: Ints  # line numbers (n,)
    broken: int  # lines that are no row


def open_pos(path: Path) -> Log:
    """The Log of a file. Raises DataError where its header does not say what it holds."""
    text = read_bytes(path).decode("utf-8", "replace")
    names = NAMES.search(text)
    if names is None:
        raise DataError(
            f"{path}: lacks RTKLIB's line of column names (% GPST latitude(deg) ...); write the "
            f"solution with the header switched on (out-outhead = on)"
        )
    found = _rows(path, text, names)
    above_sea = "=wgs84/geodetic" in text.lower()
    place, left = _place(path, found, text), []
    quality = found.columns.get("Q", np.full(len(found.ms), 5.0))
    used = np.isin(quality, list(QUALITIES)) & np.isfinite(place["lat"])
    rows = np.flatnonzero(used)
    order, late, twice = in_order(found.ms[rows])
    rows = rows[order]
    if above_sea:
        place["height"] = np.full(len(found.ms), np.nan)
        left.append("heights: above the geoid (out-height = geodetic), not above the ellipsoid")
    counts = (
        (found.broken, "lines that are no row"),
        (int(np.sum(~used)), "rows without a fix"),
        (late, "rows out of order, which are sorted"),
        (twice, "rows that repeat a time"),
    )
    left += [f"{many} {what}" for many, what in counts if many]
    time, moment = _time(found)
    table = Table.of(
        f"{path}",
        {time["column"]: moment[rows], "Q": quality[rows].astype(int)}
        | {name: values[rows] for name, values in place.items()},
        found.rows[rows],
        "line",
    )
    many = [f"{name} {n}" for q, name in QUALITIES.items() if (n := np.sum(quality[rows] == q))]
    title = f"RTKLIB, {len(rows)} fixes: {', '.join(many)}"
    sections = _sections(time, title, "v_n" in place) if len(rows) else []
    return Log({"solution": table}, tuple(sections), (f"{path}: {title}",), tuple(left))


def _rows(path: Path, text: str, header: re.Match[str]) -> Solution:
    """The rows of numbers. Raises DataError where there is none."""
    scale, names = header.group(1), header.group(2)
    dms = "d'" in names
    columns = [each for each in re.split(r"[\s,;]+", names) if each]
    words = [re.sub(r"\(.*", "", each) for each in columns]
    width = len(words) + 2 + (4 if dms else 0)
    cells, numbers = [], []
    broken = 0
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("%") or not line.strip():
            continue
        row = re.split(r"[\s,;]+", line.strip()) if "," in line or ";" in line else line.split()
        if len(row) == width:
            cells.append(row)
            numbers.append(number)
        else:
            broken += 1
    values, moments = _numbers(cells, width - 2), _moments(cells)
    rows = np.flatnonzero((moments >= 0) & np.isfinite(values[:, :3]).all(axis=1))
    if not len(rows):
        raise DataError(f"{path}: holds no row of an RTKLIB solution with {width} columns")
    broken += len(cells) - len(rows)
    values, moments = values[rows], moments[rows]
    if dms:
        angles = [_degrees(values[:, 3 * i : 3 * i + 3]) for i in range(2)]
        values = np.column_stack([*angles, values[:, 6:]])
    named = dict(zip(words, values.T))
    return Solution(scale, moments, named, np.array(numbers)[rows], broken)


def _numbers(cells: list[list[str]], many: int) -> Array:
    """The cells after the time (n, many); NaN where one is no number."""
    try:
        return np.array([row[2:] for row in cells], float).reshape(len(cells), many)
    except ValueError:
        return np.array([[_number(each) for each in row[2:]] for row in cells])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _moments(cells: list[list[str]]) -> Ints:
    """ms of the calendar since 1970 (n,), of a date and a time of day, or of a GPS week and the
    seconds of it; -1 where they are none."""
    moments = np.full(len(cells), -1, np.int64)
    for i, (first, second, *_) in enumerate(cells):
        try:
            if "/" in first:
                days = int(np.datetime64(first.replace("/", "-"), "D").astype(int))
                hours, minutes, seconds = second.split(":")
                t = 86400.0 * days + 3600 * int(hours) + 60 * int(minutes) + float(seconds)
            else:
                t = GPS_ZERO + WEEK * int(first) + float(second)
            moments[i] = round(1000 * t) if 0 <= t < 4e9 else -1
        except (ValueError, OverflowError):
            continue
    return moments


def _degrees(dms: Array) -> Array:
    """Degrees, minutes and seconds (n, 3) as degrees; the sign stands at the degrees."""
    size = np.abs(dms) @ [1, 1 / 60, 1 / 3600]
    return np.where(np.signbit(dms[:, 0]), -size, size)


def _time(found: Solution) -> tuple[dict[str, Any], Ints]:
    """(the key `time`, its column)."""
    if found.scale == "GPST":
        return {"column": "gps_ms", "unit": "ms", "clock": "gps"}, found.ms - 1000 * GPS_ZERO
    ahead = JST_AHEAD if found.scale == "JST" else 0
    return {"column": "unix_ms", "unit": "ms", "clock": "unix"}, found.ms - 1000 * ahead


def _place(path: Path, found: Solution, text: str) -> dict[str, Array]:
    """Latitude and longitude in deg, ellipsoidal height, velocity where there is one, in m and
    m/s north, east, up, with standard deviations. Raises DataError."""
    columns = found.columns
    n = len(found.ms)
    if "latitude" in columns:
        names = dict(zip(("lat", "lon", "height"), ("latitude", "longitude", "height")))
        names |= {f"sd_{axis}": f"sd{axis}" for axis in "neu"}
        names |= {f"v_{axis}": f"v{axis}" for axis in "neu"}
        names |= {f"sd_v{axis}": f"sdv{axis}" for axis in "neu"}
        place = {name: columns[own] for name, own in names.items() if own in columns}
    elif "x-ecef" in columns:
        xyz = np.stack([columns[f"{axis}-ecef"] for axis in "xyz"], axis=1)
        lla = from_ecef(xyz)
        place, north_east_up = _degrees_of(lla), ned_axes(lla) * UP
        sd = _turned_deviations(columns, "sd", "xyz", north_east_up)
        place |= {f"sd_{axis}": sd[:, i] for i, axis in enumerate("neu")}
        if "vx" in columns:
            v = np.einsum("nij,nj->ni", north_east_up, _three(columns, "v", "xyz"))
            sd = _turned_deviations(columns, "sdv", "xyz", north_east_up)
            place |= {f"v_{axis}": v[:, i] for i, axis in enumerate("neu")}
            place |= {f"sd_v{axis}": sd[:, i] for i, axis in enumerate("neu")}
    else:
        place = _from_baseline(path, columns, text)
    for name in [each for each in place if each.startswith("sd_")]:
        place[name] = np.maximum(np.abs(place[name]), LEAST_SD)
    missing = [f"sd{axis}" for axis in "neu" if f"sd_{axis}" not in place]
    if missing or n == 0:
        raise DataError(f"{path}: lacks the columns {', '.join(missing)}; write all of RTKLIB's")
    if not {f"{name}{axis}" for name in ("v_", "sd_v") for axis in "neu"} <= set(place):
        place = {key: each for key, each in place.items() if not re.match("v_|sd_v", key)}
    return place


def _three(columns: dict[str, Array], prefix: str, axes: str) -> Array:
    return np.stack([columns[f"{prefix}{axis}"] for axis in axes], axis=1)


def _from_baseline(path: Path, columns: dict[str, Array], text: str) -> dict[str, Array]:
    """East, north, up from the base that the header names."""
    base = REFERENCE.search(text)
    numbers = np.array([_number(each) for each in base.groups()] if base else [np.nan])
    if not np.isfinite(numbers).all():
        raise DataError(
            f"{path}: is a baseline (e/n/u) and its header names no base (% ref pos : lat lon "
            f"height); write the solution as lat/lon/height (out-solformat = llh)"
        )
    # the base may be in ECEF, as solutions are
    lla = from_ecef(numbers) if np.abs(numbers).max() > 1e5 else numbers * DEGREES
    neu = np.stack([columns[f"{axis}-baseline"] for axis in "neu"], axis=1)
    place = _degrees_of(from_ecef(to_ecef(lla) + neu @ (ned_axes(lla) * UP)))
    return place | {f"sd_{axis}": columns[f"sd{axis}"] for axis in "neu"}


def _degrees_of(lla: Array) -> dict[str, Array]:
    """Columns in deg and m of positions (n, 3) in rad and m."""
    lat, lon, height = lla.T
    return {"lat": np.degrees(lat), "lon": np.degrees(lon), "height": height}


def _turned_deviations(columns: dict[str, Array], prefix: str, axes: str, C: Array) -> Array:
    """(n, 3) standard deviations along the rows of C, of signed square roots of a covariance."""
    P = np.zeros((len(C), 3, 3))
    for i, a in enumerate(axes):
        for j, b in enumerate(axes):
            name = prefix + (a if i == j else a + b)
            other = prefix + b + a
            root = columns.get(name, columns.get(other, np.zeros(len(C))))
            P[:, i, j] = root * np.abs(root)
    turned = np.einsum("nij,njk,nik->ni", C, P, C)
    return np.sqrt(np.maximum(turned, 0.0))


def _sections(time: dict[str, Any], title: str, moving: bool) -> list[Section]:
    common = {"table": "solution", "time": time}
    position = {
        "kind": "position",
        **common,
        "columns": ["lat", "lon", "height"],
        "unit": ["deg", "deg", "m"],
        "sd": ["sd_n", "sd_e", "sd_u"],
    }
    velocity = {
        "kind": "velocity",
        **common,
        "columns": ["v_n", "v_e", "v_u"],
        "unit": "m/s",
        "axes": "+x +y -z",
        "sd": ["sd_vn", "sd_ve", "sd_vu"],
    }
    reference = {
        **common,
        "position": {"columns": ["lat", "lon", "height"], "unit": ["deg", "deg", "m"]},
    }
    if moving:
        reference["velocity"] = {key: velocity[key] for key in ("columns", "unit", "axes")}
    every = [position, velocity] if moving else [position]
    why = "the same fixes again; --take reference=0 scores outages against them"
    return [
        *(Section("aiding", "gnss", keys, 0, title) for keys in every),
        Section("reference", "reference", reference, 0, title, left=why),
    ]


def sniff(path: Path) -> bool:
    """Whether the file has RTKLIB's line of column names."""
    try:
        return NAMES.search(read_bytes(path, START).decode("utf-8", "replace")) is not None
    except DataError:
        return False


READER = Reader("rtklib", packed(".pos", ".txt"), "solution of RTKLIB", sniff=sniff, open=open_pos)
