"""Common parts of phone logs: the axes, the columns of the location, and the attitude in which the
phone was held."""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ....typing import Array
from ...reader import Section
from ...tables.table_file import FileTable

AXES = "RFU"
"""x to the right and y to the top of the screen, z out of it: forward is the top of the phone."""
GRADE = "a phone's MEMS IMU"
FAR = 100.0
"""m: a fix with a worse accuracy comes from cell towers or an old position, not from satellites."""
RADIUS = 1.51
"""Ratio of Android's accuracy to the standard deviation along an axis, sqrt(-2 ln 0.32): Android
states the radius that contains 68 % of the positions (developer.android.com, Location.getAccuracy).
Apple documents no percentage; an iPhone's accuracy is taken as the standard deviation."""
SPEED_STD = 0.5
"""m/s: std of a velocity whose accuracy the phone does not state."""
VERTICAL = 1.5
"""Ratio of vertical standard deviation to horizontal accuracy, where the phone does not state
it."""
MAGNETIC_STD = 5.0
"""uT: distortion of the field by nearby objects indoors; the noise is far smaller."""
GRAVITY = (5.0, 15.0)
"""m/s^2: bounds of the median specific force of an accelerometer; without gravity it is nearly
0."""
DISTURBED = "nearby objects distort a phone's magnetometer; it is used if it is calibrated or you ask for it"
ADDED = ("north std (m)", "up std (m)", "speed (m/s)", "course (deg)", "speed std (m/s)")
"""Columns that `fixes` adds."""
NOTHING: Mapping[str, str] = MappingProxyType({})


class PhoneFixColumns(NamedTuple):
    """Names of the columns of a table of fixes; "" for a missing one."""

    latitude: str
    longitude: str
    height: str
    accuracy: str  # m, horizontal
    vertical_accuracy: str = ""  # m
    speed: str = ""  # m/s
    course: str = ""  # deg from north
    speed_accuracy: str = ""  # m/s
    course_accuracy: str = ""  # deg

    def among(self, columns: Sequence[str]) -> "PhoneFixColumns":
        """Return the columns of a table whose names match these patterns."""
        return PhoneFixColumns(*(matching_column(columns, pattern) for pattern in self))


class Piece(NamedTuple):
    """A gyro or an accelerometer: its table, its three columns and their unit."""

    table: str
    time: Mapping[str, Any]
    columns: list[str]
    unit: str
    scale: float = 1.0


def matching_column(columns: Sequence[str], pattern: str) -> str:
    """Return the column whose name matches the pattern, "" without one. Of several the longest name
    counts: of two heights, that is the one above the ellipsoid."""
    found = (each for each in columns if pattern and re.fullmatch(pattern, each, re.IGNORECASE))
    return max(found, key=len, default="")


def triple(columns: Sequence[str], pattern: str) -> list[str]:
    """Return the names of the columns of x, y and z, with "{axis}" in the pattern for the axis; []
    where one is missing."""
    found = [matching_column(columns, pattern.replace("{axis}", axis)) for axis in "xyz"]
    return found if all(found) else []


def fixes(table: FileTable, names: PhoneFixColumns, android: bool) -> tuple[FileTable, list[str]]:
    """(Table with the columns ADDED, lines on rows left out) of a phone's fixes; `android`: their
    accuracy follows Android's definition.

    Phones write -1 or nothing for unknown values. A speed of zero needs no course. Raises DataError
    where a cell is not a number.
    """

    def column(name: str) -> Array:
        return table.numbers(name) if name else np.full(len(table.lines), np.nan)

    def positive_or_nan(name: str) -> Array:
        values = column(name)
        return np.where(values > 0, values, np.nan)

    accuracy, vertical = positive_or_nan(names.accuracy), positive_or_nan(names.vertical_accuracy)
    vertical = np.where(np.isfinite(vertical), vertical, VERTICAL * accuracy)
    speed, course, std = (
        column(names.speed),
        column(names.course),
        positive_or_nan(names.speed_accuracy),
    )
    course = np.where(course >= 0, course, np.nan)
    speed = np.where((speed >= 0) & (np.isfinite(course) | (speed == 0)), speed, np.nan)
    std = np.where(np.isfinite(std), std, SPEED_STD)
    across = np.nan_to_num(speed * np.radians(positive_or_nan(names.course_accuracy)))
    north = accuracy / RADIUS if android else accuracy
    columns = (north, vertical, speed, course, np.maximum(std, across))
    added = dict(zip(ADDED, columns))
    use = accuracy <= FAR
    left = []
    if far := int((accuracy > FAR).sum()):
        left.append(f"{far} fixes with an accuracy worse than {FAR:g} m")
    if unknown := int(np.isnan(accuracy).sum()):
        left.append(f"{unknown} fixes without an accuracy")
    return table.with_columns(added).take(use), left


def location(
    tables: dict[str, FileTable],
    name: str,
    names: PhoneFixColumns,
    time: Mapping[str, Any],
    android: bool,
    needed: str,
    geoid: str = "",
    **more: Any,
) -> tuple[list[Section], list[str]]:
    """(sections, lines on what is left out) of the fixes in a table, which gets the columns ADDED;
    `needed` names the necessary columns in messages."""
    if not (names.latitude and names.longitude and names.height and names.accuracy):
        return [], [f"{name}: lacks {needed}"]
    tables[name], left = fixes(tables[name], names, android)
    sections = fix_sections(name, tables[name], names, time, android, geoid, **more)
    return sections, [f"{name}: {line}" for line in left]


def fix_sections(
    name: str,
    table: FileTable,
    names: PhoneFixColumns,
    time: Mapping[str, Any],
    android: bool,
    geoid: str = "",
    **more: Any,
) -> list[Section]:
    """Return the sections of the position and, where there is one, of the velocity in the table of
    `fixes`. With `geoid`, heights are above that geoid."""
    if not len(table.lines):
        return []
    title = f"{name}, {len(table.lines)} fixes"
    radius = f"; Android's horizontal one is a 68 % radius, {RADIUS:g} times the std along an axis"
    assumed = {"std": f"the accuracies that the phone states{radius if android else ''}"}
    position = {
        "kind": "position",
        "table": name,
        "time": dict(time),
        "columns": [names.latitude, names.longitude, names.height],
        "unit": ["deg", "deg", "m"],
        "std": ["north std (m)", "north std (m)", "up std (m)"],
    }
    if geoid:
        position["geoid"] = "EGM96"
        assumed = assumed | {"geoid": geoid}
    found = [Section("source", "gnss", position, title=title, assumed=assumed, **more)]
    if np.isfinite(table.numbers("speed (m/s)")).any():
        said = names.speed_accuracy or ""
        velocity = {
            "kind": "velocity",
            "table": name,
            "time": dict(time),
            "form": "speed, course",
            "columns": ["speed (m/s)", "course (deg)"],
            "unit": ["m/s", "deg"],
            "std": "speed std (m/s)",
        }
        why = "speed and course, " + (f"std of {said}" if said else f"std of {SPEED_STD:g} m/s")
        more = more | {"title": "speed and course", "assumed": {"std": why}}
        found.append(Section("source", "gnss", velocity, **more))
    return found


def day(unix: float) -> dict[str, str]:
    """Return the key date of a time in POSIX seconds; {} outside this century."""
    if not 946684800 <= unix < 4102444800:
        return {}
    return {"date": str(np.datetime64(int(unix), "s").astype("datetime64[D]"))}


def inertial(
    gyro: Piece | None,
    accel: Piece | None,
    tables: Mapping[str, FileTable],
    record: str,
    alone: bool = False,
    assumed: Mapping[str, str] = NOTHING,
) -> tuple[list[Section], list[str]]:
    """(sections, facts): [imu] of a gyro and an accelerometer, or of one of them where it is
    `alone` in its file. An unusable IMU becomes a section that is left out, with the reason and
    what to `record`.
    """
    facts = []
    if accel:
        norm, force = median_force(tables[accel.table], accel.columns)
        norm, force = norm * abs(accel.scale), force * accel.scale
        if not GRAVITY[0] <= norm <= GRAVITY[1]:
            why = f"{accel.table}: its median is {norm:.3g} m/s^2, but gravity is 9.8; {record}"
            return [no_imu(why)], []
        facts.append(holding_text(force))
    there = gyro or accel
    if there is None:
        return [], []
    if not alone and (gyro is None or accel is None):
        missing = "gyroscope" if gyro is None else "accelerometer"
        return [no_imu(f"there is no {missing} beside {there.table}; {record}")], facts
    return [imu_section(gyro, accel, assumed)], facts


def no_imu(why: str) -> Section:
    """Return an [imu] that cannot be used, with the reason."""
    return Section("imu", "imu", {}, left=why)


def imu_section(
    gyro: Piece | None, accel: Piece | None, assumed: Mapping[str, str] = NOTHING
) -> Section:
    """[imu] of a gyro and an accelerometer, or of the one that is there."""
    pieces = {"gyro": gyro, "accel": accel}
    there = {key: piece for key, piece in pieces.items() if piece is not None}
    first = next(iter(there.values()))
    keys: dict[str, Any] = {"table": first.table, "time": dict(first.time), "axes": AXES}
    for key, piece in there.items():
        keys[key] = {"columns": piece.columns, "unit": piece.unit}
        if piece.scale != 1:
            keys[key]["scale"] = piece.scale
        if piece is not first:
            keys[key] |= {"table": piece.table, "time": dict(piece.time)}
    title = " and ".join(piece.table for piece in there.values())
    return Section(
        "imu",
        "imu",
        keys | {"grade": "consumer"},
        title=title,
        assumed={"grade": GRADE, **assumed},
    )


def magnetometer_section(
    name: str, time: Mapping[str, Any], columns: list[str], head: Mapping[str, Any]
) -> Section:
    """A magnetometer in uT, left out until the user asks for it."""
    keys = {
        "kind": "magnetic-field",
        "table": name,
        "time": dict(time),
        "columns": columns,
        "unit": "uT",
        "axes": AXES,
        "std": MAGNETIC_STD,
        **({} if "date" in head else {"field": "record"}),
    }
    assumed = {"std": "uT, because objects near a phone distort the field for seconds"}
    return Section("source", "magnetometer", keys, title=name, assumed=assumed, left=DISTURBED)


def barometer_section(name: str, time: Mapping[str, Any], column: str) -> Section:
    """A barometer in hPa."""
    keys = {
        "kind": "pressure",
        "table": name,
        "time": dict(time),
        "columns": [column],
        "unit": "hPa",
        "std": 1.0,
    }
    return Section(
        "source", "barometer", keys, title=name, assumed={"std": "m, as MEMS barometers"}
    )


def median_force(table: FileTable, columns: list[str]) -> tuple[float, Array]:
    """(median magnitude, median vector (3,)) of three columns; NaN without a complete row."""
    force = np.stack([table.numbers(column) for column in columns], axis=1)
    force = force[np.isfinite(force).all(axis=1)]
    if not len(force):
        return np.nan, np.full(3, np.nan)
    with np.errstate(over="ignore"):
        return float(np.median(np.linalg.norm(force, axis=1))), np.median(force, axis=0)


def holding_text(force: Array) -> str:
    """The attitude in which the phone was held, by the median specific force in its axes (x right,
    y top, z out of the screen)."""
    axis = int(np.argmax(np.abs(force)))
    ways = (("right side up", "left side up"), ("upright", "upside down"))
    way = (*ways, ("screen up", "screen down"))[axis][int(force[axis] < 0)]
    with np.errstate(over="ignore", invalid="ignore"):
        tilt = np.degrees(np.arccos(min(1.0, abs(force[axis]) / np.linalg.norm(force))))
    return (
        f"held {way} within {tilt:.0f} deg, by the median of gravity; the heading is that of the top of "
        f"the phone, not of its carrier"
    )
