"""Exports of the app phyphox: a zip or folder of CSV files.

Columns by the app's sources (github.com/phyphox/phyphox-android, phyphox-ios), which give both
platforms the same axes: x right, y to the top, z out of the screen. "Time (s)" counts from the start
of the experiment, without its pauses; `meta/time.csv` says when it was started and paused.
"Height (m)" is the phone's less the geoid of EGM84; "Vertical Accuracy (°)" is in m.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ...typing import Array
from ..contract import Log, Reader, Section
from ..decoding.csv_export import CSV, Export, export, heads
from ..decoding.phone import (
    GRAVITY,
    FixColumns,
    Piece,
    barometer_section,
    fix_sections,
    fixes,
    held,
    imu_section,
    magnetometer_section,
    median_force,
)
from ..table_file import Table

TIME_COLUMN = "Time (s)"
TIME = {"column": TIME_COLUMN, "unit": "s"}
TIMES = "meta/time"
VECTOR = r"(?P<of>.*?)\b{axis} \((?P<unit>m/s\^2|rad/s|[µμ]T)\)"
"""Names of the columns of a vector, as "X (m/s^2)" or "Linear Acceleration x (m/s^2)"."""
FIX = FixColumns(
    r"latitude .*",
    r"longitude .*",
    r"(height|altitude) \(m\)",
    r"horizontal accuracy \(m\)",
    r"vertical accuracy .*",
    r"(velocity|speed) \(m/s\)",
    r"direction .*",
)
RECORD = 'record "Acceleration with g", which phyphox also calls Accelerometer'


def sniff(path: Path) -> bool:
    """Whether one of the files has the columns of a sensor of the app."""
    return any(kind(columns_of(head)) for head in heads(path).values())


def columns_of(head: str) -> list[str]:
    """Names in a header line, [] where it is none of the app's."""
    names = [name.strip().strip('"') for name in re.split(r"[,;\t]", head)]
    return names if names[0] == TIME_COLUMN else []


def vector(columns: list[str]) -> list[str]:
    """Names of the columns of x, y and z, [] where there are none."""
    found = [
        next((name for name in columns if re.fullmatch(VECTOR.format(axis=axis), name, re.I)), "")
        for axis in "xyz"
    ]
    return found if all(found) else []


def kind(columns: list[str]) -> str:
    """What a file is: accelerometer, linear accelerometer, gyro, magnetometer, barometer, location;
    "" where it is none of these."""
    if not columns:
        return ""
    if three := vector(columns):
        unit = three[0].rpartition("(")[2]
        linear = re.match(r"linear|.*without", three[0], re.I)
        return {"rad/s)": "gyro", "m/s^2)": f"{'linear ' if linear else ''}accelerometer"}.get(
            unit, "magnetometer"
        )
    if any(name.endswith("(hPa)") for name in columns):
        return "barometer"
    return "location" if fix_columns(columns).latitude else ""


def fix_columns(columns: list[str]) -> FixColumns:
    """The names of the columns of a fix."""
    return FixColumns(
        *(
            next((name for name in columns if pattern and re.fullmatch(pattern, name, re.I)), "")
            for pattern in FIX
        )
    )


def open_export(path: Path) -> Log:
    """The Log of an export. Raises DataError."""
    found = export(path)
    head, starts, facts = _clock(found)
    tables: dict[str, Table] = {}
    kinds: dict[str, list[str]] = {}
    left: list[str] = []
    for name in found.files:
        columns = columns_of(found.head(name))
        of = kind(columns)
        if not of:
            left += [] if name.startswith("meta/") else [f"{name}: not a sensor that is read"]
            continue
        if of == "accelerometer" and re.search(r"linear|without", name, re.I):
            of = "linear accelerometer"
        if of == "linear accelerometer":
            left.append(f"{name}: acceleration without gravity")
        table = found.table(name)
        if len(table.lines) and len(columns) <= table.frame.shape[1]:
            tables[name] = _on_clock(table, starts)
            kinds.setdefault(of, []).append(name)
        else:
            left.append(f"{name}: has no rows")
    sections: list[Section] = []
    asked = _inertial(found, tables, kinds, sections, facts)
    left += _aidings(tables, kinds, sections, head)
    return Log(tables, tuple(sections), tuple(facts), tuple(left), tuple(asked), head)


def _clock(found: Export) -> tuple[dict[str, Any], tuple[Array, Array] | None, list[str]]:
    """(keys at the top, (times of the experiment, seconds since the first start) of each start,
    facts) of `meta/time.csv`."""
    if TIMES not in found.files:
        return {}, None, []
    table = found.table(TIMES)
    if not {"event", "experiment time", "system time"} <= set(table.frame.columns):
        return {}, None, [f"{TIMES}.csv: its columns are not those of phyphox; no date"]
    event = table.frame["event"].astype(str).to_numpy()
    elapsed, system = table.numbers("experiment time"), table.numbers("system time")
    use = (event == "START") & np.isfinite(elapsed) & (np.abs(system) < 4e9)
    if not use.any() or np.any(np.diff(elapsed[use]) < 0) or np.any(np.diff(system[use]) < 0):
        return {}, None, [f"{TIMES}.csv: has no start in order of time; no date"]
    elapsed, system = elapsed[use], system[use]
    zero = np.datetime64(0, "us") + np.timedelta64(round((system[0] - elapsed[0]) * 1e6), "us")
    epoch = f"{zero}Z"
    facts = [f"started at {epoch}, as {TIMES}.csv says"]
    if len(elapsed) > 1:
        facts.append(f"{len(elapsed) - 1} pauses, which the times of the tables now have")
    return (
        {"epoch": epoch, "date": epoch[:10]},
        (elapsed, system - system[0] + elapsed[0]),
        facts,
    )


def _on_clock(table: Table, starts: tuple[Array, Array] | None) -> Table:
    """The table on a clock that runs on through pauses."""
    if starts is None or len(starts[0]) < 2:
        return table
    elapsed, system = starts
    t = table.numbers(TIME_COLUMN)
    run = np.clip(np.searchsorted(elapsed, t, side="right") - 1, 0, len(elapsed) - 1)
    return table._replace(
        frame=table.frame.assign(**{TIME_COLUMN: t + system[run] - elapsed[run]})
    )


def _inertial(
    found: Export,
    tables: dict[str, Table],
    kinds: dict[str, list[str]],
    sections: list[Section],
    facts: list[str],
) -> list[str]:
    """Lines on what must be known of the IMU, whose section is appended."""
    pieces: dict[str, Piece] = {}
    for of, unit in (("gyro", "rad/s"), ("accelerometer", "m/s^2")):
        for name in kinds.get(of, [])[:1]:
            columns = vector([str(column) for column in tables[name].frame.columns])
            pieces[of] = Piece(name, TIME, columns, unit)
    gyro, accel = pieces.get("gyro"), pieces.get("accelerometer")
    if accel:
        norm, force = median_force(tables[accel.table], accel.columns)
        if not GRAVITY[0] <= norm <= GRAVITY[1]:
            return [f"{accel.table}: its median is {norm:.3g} m/s^2 and gravity is 9.8; {RECORD}"]
        facts.append(held(force))
    elif "linear accelerometer" in kinds:
        return [f"{kinds['linear accelerometer'][0]}: is without gravity; {RECORD}"]
    if gyro or accel:
        sections.append(imu_section(gyro, accel))
    if found.path.is_file() and len(found.files) == 1 or bool(gyro) == bool(accel):
        return []
    return [f"there is no {'accelerometer' if gyro else 'gyroscope'}; record it too"]


def _aidings(
    tables: dict[str, Table],
    kinds: dict[str, list[str]],
    sections: list[Section],
    head: dict[str, Any],
) -> list[str]:
    """Lines on what is left; the sections of other sensors are appended."""
    left = []
    for name in kinds.get("location", [])[:1]:
        names = fix_columns([str(column) for column in tables[name].frame.columns])
        if not (names.longitude and names.height and names.accuracy):
            left.append(f"{name}: lacks longitude, height or horizontal accuracy")
            continue
        tables[name], lines = fixes(tables[name], names)
        left += [f"{name}: {line}" for line in lines]
        sections += fix_sections(name, tables[name], names, TIME)
    for name in kinds.get("magnetometer", [])[:1]:
        columns = vector([str(column) for column in tables[name].frame.columns])
        sections.append(magnetometer_section(name, TIME, columns, head))
    for name in kinds.get("barometer", [])[:1]:
        column = next(each for each in tables[name].frame.columns if each.endswith("(hPa)"))
        sections.append(barometer_section(name, TIME, column))
    return left


READER = Reader(
    "phyphox",
    (".zip", *CSV),
    "export of the app phyphox, a zip or folder",
    sniff=sniff,
    open=open_export,
)
