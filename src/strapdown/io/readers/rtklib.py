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
from ...geometry.geodesy import from_ecef, ned_axes, to_ecef
from ...typing import Array, Ints
from ...units.time_scales import DAY, GPS_ZERO, WEEK
from ..decoding.carrier_classes import by_class
from ..decoding.receivers.cyclic_times import in_order
from ..decoding.receivers.nmea_sentences import number
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable, head_of, packed_suffixes, read_bytes

START = 1 << 16
"""Bytes in which the line of column names must stand."""
NAMES = re.compile(r"^%\s*(GPST|UTC|JST)[\s,;]+(.*(?:latitude|x-ecef|e-baseline).*)$", re.MULTILINE)
REFERENCE = re.compile(r"^%\s*ref pos\s*:[ \t]*(.*)$", re.MULTILINE)
MIN_STD = 1e-4
"""m and m/s, the last digit that RTKLIB writes: a smaller standard deviation reads 0."""
QUALITIES = {1: "fixed", 2: "float", 3: "SBAS", 4: "DGPS", 5: "single", 6: "PPP"}
CARRIER = {"fixed": (1,), "float": (2,), "single": (3, 4, 5), "ppp": (6,)}
"""Carrier solutions by Q."""
DEGREES = np.array([np.pi / 180, np.pi / 180, 1.0])
JST_AHEAD = 9 * 3600
"""s"""


class Form(NamedTuple):
    """Names of the columns of a position and a velocity with their standard deviations, and the
    axes of both as a description has them."""

    position: tuple[str, ...]
    std: tuple[str, ...]
    velocity: tuple[str, ...]
    velocity_std: tuple[str, ...]
    axes: dict[str, str]
    velocity_axes: str


GEODETIC = Form(
    ("latitude", "longitude", "height"),
    ("sdn", "sde", "sdu"),
    ("vn", "ve", "vu"),
    ("sdvn", "sdve", "sdvu"),
    {},
    "+x +y -z",
)
ECEF = Form(
    ("x-ecef", "y-ecef", "z-ecef"),
    ("sdx", "sdy", "sdz", "sdxy", "sdyz", "sdzx"),
    ("vx", "vy", "vz"),
    ("sdvx", "sdvy", "sdvz", "sdvxy", "sdvyz", "sdvzx"),
    {"axes": "ECEF"},
    "ECEF",
)


class RtklibSolution(NamedTuple):
    """The columns of a file, and when."""

    scale: str  # GPST, UTC or JST
    ms: Ints  # (n,) of the calendar of `scale`, since 1970
    columns: dict[str, Array]  # by name without unit
    rows: Ints  # line numbers (n,)
    broken: int  # lines that are no row


def open_pos(path: Path) -> Log:
    """The Log of a file. Raises DataError where its header does not say what it holds."""
    text = read_bytes(path, lines=True).decode("utf-8", "replace")
    names = NAMES.search(text)
    if names is None:
        raise DataError(
            f"{path}: lacks RTKLIB's line of column names (% GPST latitude(deg) ...); write the "
            f"solution with the header switched on (out-outhead = on)"
        )
    found = _rows(path, text, names)
    columns, form = _form_columns(path, found.columns, text)
    quality = columns.get("Q", np.full(len(found.ms), 5.0))
    used = np.isin(quality, list(QUALITIES)) & np.isfinite(columns[form.position[0]])
    rows = np.flatnonzero(used)
    order, late, twice = in_order(found.ms[rows])
    rows = rows[order]
    there = set(columns)
    still = np.isnan(columns.get(form.velocity[0], np.zeros(len(found.ms)))[rows])
    if still.all():
        there -= set(form.velocity)
    counts = (
        (found.broken, "lines that are no row"),
        (int(np.sum(~used)), "rows without a fix"),
        (late, "rows out of order, which are sorted"),
        (twice, "rows that repeat a time"),
        (np.count_nonzero(still), "rows whose velocity has no standard deviation: it is not used"),
    )
    left = [f"{many} {what}" for many, what in counts if many]
    time, moment = _time(found)
    values = {time["column"]: moment[rows]} | {key: each[rows] for key, each in columns.items()}
    table = FileTable.of(str(path), values, found.rows[rows], "line")
    kinds = [f"{name} {n}" for q, name in QUALITIES.items() if (n := np.sum(quality[rows] == q))]
    title = f"RTKLIB, {len(rows)} fixes: {', '.join(kinds)}"
    above_sea = "=wgs84/geodetic" in text.lower() and "latitude" in form.position
    geoid = {"geoid": "EGM96"} if above_sea else {}
    told = quality[rows] if "Q" in columns else None
    sections = _sections(time, title, form, there, geoid, told) if len(rows) else []
    return Log({"solution": table}, tuple(sections), (f"{path}: {title}",), tuple(left))


def _rows(path: Path, text: str, header: re.Match[str]) -> RtklibSolution:
    """The rows of numbers. Raises DataError where there is none."""
    scale, names = header.group(1), header.group(2)
    dms = "d'" in names
    columns = [each for each in re.split(r"[\s,;]+", names) if each]
    words = [re.sub(r"\(.*", "", each) for each in columns]
    width = len(words) + 2 + (4 if dms else 0)
    cells, numbers = [], []
    broken = 0
    for row_number, line in enumerate(text.splitlines(), 1):
        if line.startswith("%") or not line.strip():
            continue
        row = re.split(r"[\s,;]+", line.strip()) if "," in line or ";" in line else line.split()
        if len(row) == width:
            cells.append(row)
            numbers.append(row_number)
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
    return RtklibSolution(scale, moments, named, np.array(numbers)[rows], broken)


def _numbers(cells: list[list[str]], many: int) -> Array:
    """The cells after the time (n, many); NaN where one is no number."""
    try:
        return np.array([row[2:] for row in cells], float).reshape(len(cells), many)
    except ValueError:
        return np.array([[number(each) for each in row[2:]] for row in cells])


def _moments(cells: list[list[str]]) -> Ints:
    """ms of the calendar since 1970 (n,), of a date and a time of day, or of a GPS week and the
    seconds of it; -1 where they are none."""
    moments = np.full(len(cells), -1, np.int64)
    for i, (first, second, *_) in enumerate(cells):
        try:
            if "/" in first:
                days = int(np.datetime64(first.replace("/", "-"), "D").astype(int))
                hours, minutes, seconds = second.split(":")
                t = float(DAY) * days + 3600 * int(hours) + 60 * int(minutes) + float(seconds)
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


def _time(found: RtklibSolution) -> tuple[dict[str, Any], Ints]:
    """(the key `time`, its column)."""
    if found.scale == "GPST":
        return {"column": "gps_ms", "unit": "ms", "clock": "gps"}, found.ms - 1000 * GPS_ZERO
    ahead = JST_AHEAD if found.scale == "JST" else 0
    return {"column": "unix_ms", "unit": "ms", "clock": "unix"}, found.ms - 1000 * ahead


def _form_columns(
    path: Path, columns: dict[str, Array], text: str
) -> tuple[dict[str, Array], Form]:
    """(columns, which of them are position and velocity): a baseline becomes latitude, longitude
    and height. A velocity whose standard deviations are all 0 was not worked out and becomes missing,
    other standard deviations of 0 become the last digit. Raises DataError."""
    form = ECEF if "x-ecef" in columns else GEODETIC
    if "e-baseline" in columns:
        columns = _from_baseline(path, columns, text)
    missing = [name for name in (*form.position, *form.std[:3]) if name not in columns]
    if missing:
        raise DataError(f"{path}: lacks the columns {', '.join(missing)}; write all of RTKLIB's")
    if {*form.velocity, *form.velocity_std[:3]} <= set(columns):
        untold = np.all([columns[name] == 0 for name in form.velocity_std[:3]], axis=0)
        columns |= {name: np.where(untold, np.nan, columns[name]) for name in form.velocity}
    for name in (*form.std[:3], *form.velocity_std[:3]):
        if name in columns:
            columns[name] = np.maximum(columns[name], MIN_STD)
    return columns, form


def _from_baseline(path: Path, columns: dict[str, Array], text: str) -> dict[str, Array]:
    """The columns with positions of the baseline from the base that the header names."""
    base = REFERENCE.search(text)
    words = re.split(r"[\s,;]+", base.group(1).strip()) if base else []
    numbers = np.array([number(each) for each in words])
    if len(numbers) == 7:
        numbers = np.array([*(_degrees(numbers[None, i : i + 3])[0] for i in (0, 3)), numbers[6]])
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise DataError(
            f"{path}: is a baseline (e/n/u) and its header names no base (% ref pos : lat lon "
            f"height, in degrees or degrees, minutes and seconds); write the solution as lat/lon/height (out-solformat = llh)"
        )
    # the base may be in ECEF, as solutions are
    lla = from_ecef(numbers) if np.abs(numbers).max() > 1e5 else numbers * DEGREES
    ned = np.stack([columns[f"{axis}-baseline"] for axis in "neu"], axis=1) * [1, 1, -1]
    place = from_ecef(to_ecef(lla) + ned @ ned_axes(lla)) / DEGREES
    return columns | dict(zip(GEODETIC.position, place.T))


def _sections(
    time: dict[str, Any],
    title: str,
    form: Form,
    there: set[str],
    geoid: dict[str, str],
    quality: Array | None,
) -> list[Section]:
    common = {"table": "solution", "time": time}
    where = {
        "columns": list(form.position),
        "unit": "m" if form.axes else ["deg", "deg", "m"],
        **form.axes,
        **geoid,
    }
    moved = {"columns": list(form.velocity), "unit": "m/s", "axes": form.velocity_axes}
    every = [{"kind": "position", **common, **where, "std": _all_or_three(form.std, there)}]
    reference = {**common, "position": where}
    if {*form.velocity, *form.velocity_std[:3]} <= there:
        std = _all_or_three(form.velocity_std, there)
        every.append({"kind": "velocity", **common, **moved, "std": std})
        reference["velocity"] = moved
    why = "the same fixes again; --take reference=0 scores outages against them"
    assumed = {"geoid": "heights are above the geoid (out-height = geodetic)"} if geoid else {}
    made = [
        Section("source", "gnss", keys, 0, title, assumed if "geoid" in keys else {})
        for keys in every
    ]
    if quality is not None:
        made[:1] = by_class(made[0], quality, "Q", CARRIER, "ns" if "ns" in there else "")
    return [
        *made,
        Section("reference", "reference", reference, 0, title, left=why),
    ]


def _all_or_three(names: tuple[str, ...], there: set[str]) -> list[str]:
    return list(names if set(names) <= there else names[:3])


def sniff(path: Path) -> bool:
    """Return True where the file has RTKLIB's line of column names."""
    return NAMES.search(head_of(path, START).decode("utf-8", "replace")) is not None


READER = Reader(
    "rtklib", packed_suffixes(".pos", ".txt"), "solution of RTKLIB", sniff=sniff, open=open_pos
)
