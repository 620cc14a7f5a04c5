"""Exports of the app phyphox: a zip or folder of CSV files.

Columns follow the app's source code (github.com/phyphox/phyphox-android, phyphox-ios), which gives
both platforms the same axes: x right, y to the top, z out of the screen. "Time (s)" counts from the
start of the experiment, without its pauses; `meta/time.csv` has the times of starts and pauses.
"Height (m)" is above the geoid of EGM84, from the app's own grid; "Vertical Accuracy (°)" is in m.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...typing import Array
from ..decoding.phones.csv_export import CSV, Export, export, heads
from ..decoding.phones.phone import (
    PhoneFixColumns,
    Piece,
    barometer_section,
    day,
    inertial,
    location,
    magnetometer_section,
    no_imu,
    triple,
)
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable

TIME_COLUMN = "Time (s)"
UNIX = "POSIX time (ns)"
"""Added column, where the start is known."""
TIMES = "meta/time"
DEVICE = "meta/device"
VECTOR = r".*?\b{axis} \((m/s\^2|rad/s|[µμ]T)\)"
"""Names of the columns of a vector, as "X (m/s^2)" or "Linear Acceleration x (m/s^2)"."""
FIX = PhoneFixColumns(
    r"latitude .*",
    r"longitude .*",
    r"(height|altitude)( wgs84)? \(m\)",
    r"horizontal accuracy \(m\)",
    r"vertical accuracy .*",
    r"(velocity|speed) \(m/s\)",
    r"direction .*",
)
GEOID = "phyphox subtracts a grid of EGM84, which agrees with EGM96 within a metre or two"
NEEDED = "longitude, height or horizontal accuracy"
RECORD = 'record Gyroscope and "Acceleration with g", which phyphox also calls Accelerometer'


class Starts(NamedTuple):
    """Starts of the experiment, (n,) each: its own time and POSIX time, s."""

    elapsed: Array
    system: Array


def sniff(path: Path) -> bool:
    """Return True where one of the files has the columns of a sensor of the app."""
    return any(kind(columns_of(head)) for head in heads(path).values())


def columns_of(head: str) -> list[str]:
    """Return the names in a header line, [] where it is not one of the app's."""
    names = [name.strip() for name in re.split(r"[,;\t]", head)]
    return names if names[0] == TIME_COLUMN else []


def kind(columns: list[str]) -> str:
    """Return the sensor of a file: accelerometer, linear accelerometer, gyro, magnetometer,
    barometer, location; "" where it is none of these."""
    if not columns:
        return ""
    if three := triple(columns, VECTOR):
        unit = three[0].rpartition("(")[2]
        linear = re.match(r"linear|.*without", three[0], re.I)
        return {"rad/s)": "gyro", "m/s^2)": f"{'linear ' if linear else ''}accelerometer"}.get(
            unit, "magnetometer"
        )
    if any(name.endswith("(hPa)") for name in columns):
        return "barometer"
    return "location" if FIX.among(columns).latitude else ""


def open_export(path: Path) -> Log:
    """The Log of an export. Raises DataError."""
    found = export(path)
    starts, facts = _clock(found)
    time: dict[str, Any] = {"column": TIME_COLUMN, "unit": "s"}
    head: dict[str, Any] = {}
    if starts is not None:
        time = {"column": UNIX, "unit": "ns", "clock": "unix"}
        head = day(float(starts.system[0]))
    tables: dict[str, FileTable] = {}
    kinds: dict[str, list[str]] = {}
    left: list[str] = []
    for name in found.files:
        columns = columns_of(found.head(name))
        of = kind(columns)
        if not of:
            left += [] if name.startswith("meta/") else [f"{name}: not a sensor that is read"]
            continue
        table = found.table(name)
        # blanks around quotes would become part of the column names
        is_whole = kind(table.titles) == of
        if of == "accelerometer" and re.search(r"linear|without", name, re.I):
            of = "linear accelerometer"
        if of == "linear accelerometer":
            left.append(f"{name}: acceleration without gravity")
        if len(table.lines) and is_whole:
            tables[name] = _on_clock(table, starts)
            kinds.setdefault(of, []).append(name)
        else:
            left.append(f"{name}: has no rows below its header")
    sections, more = _inertial(found, tables, kinds, time)
    facts += more
    left += _sources(tables, kinds, sections, head, time, _is_android(found))
    return Log(tables, tuple(sections), tuple(facts), tuple(left), head=head)


def _clock(found: Export) -> tuple[Starts | None, list[str]]:
    """(Starts, facts) of `meta/time.csv`, None where it is missing or not in order."""
    if TIMES not in found.files:
        return None, []
    table = found.table(TIMES)
    if not {"event", "experiment time", "system time"} <= set(table.frame.columns):
        return None, [f"{TIMES}.csv: its columns are not those of phyphox; no date"]
    event = table.frame["event"].astype(str).to_numpy()
    elapsed, system = table.numbers("experiment time"), table.numbers("system time")
    use = (event == "START") & np.isfinite(elapsed) & (np.abs(system) < 4e9)
    starts = Starts(elapsed[use], system[use])
    if not use.any() or any(np.any(np.diff(times) < 0) for times in starts):
        return None, [f"{TIMES}.csv: has no starts in time order; no date"]
    facts = [f"started at {np.datetime64(round(starts.system[0] * 1e3), 'ms')}Z ({TIMES}.csv)"]
    if use.sum() > 1:
        facts.append(f"{use.sum() - 1} pauses, during which the clock continues")
    return starts, facts


def _on_clock(table: FileTable, starts: Starts | None) -> FileTable:
    """Return the table with the column UNIX, whose clock continues through pauses."""
    if starts is None:
        return table
    t = table.numbers(TIME_COLUMN)
    use = np.abs(t) < 1e8  # s, longer than any experiment
    t, frame = t[use], table.frame[use]
    run = np.clip(np.searchsorted(starts.elapsed, t, side="right") - 1, 0, None)
    # integers: POSIX seconds as floats would add jitter to the intervals
    unix = np.round((t - starts.elapsed[run]) * 1e9).astype(np.int64)
    unix += np.round(starts.system * 1e9).astype(np.int64)[run]
    return table._replace(content=frame.assign(**{UNIX: unix}), lines=table.lines[use])


def _is_android(found: Export) -> bool:
    """Return True where `meta/device.csv` names a manufacturer other than Apple."""
    if DEVICE not in found.files:
        return False
    frame = found.table(DEVICE).frame
    if not {"property", "value"} <= set(frame.columns):
        return False
    makers = frame["value"][frame["property"] == "deviceManufacturer"].dropna().astype(str)
    return bool(len(makers)) and not makers.str.contains("apple", case=False).any()


def _inertial(
    found: Export,
    tables: dict[str, FileTable],
    kinds: dict[str, list[str]],
    time: dict[str, Any],
) -> tuple[list[Section], list[str]]:
    """(sections of the IMU, facts)."""
    pieces: dict[str, Piece] = {}
    for of, unit in (("gyro", "rad/s"), ("accelerometer", "m/s^2")):
        for name in kinds.get(of, [])[:1]:
            columns = triple(tables[name].titles, VECTOR)
            pieces[of] = Piece(name, time, columns, unit)
    if "accelerometer" not in pieces and "linear accelerometer" in kinds:
        return [
            no_imu(f"{kinds['linear accelerometer'][0]}: does not contain gravity; {RECORD}")
        ], []
    return inertial(pieces.get("gyro"), pieces.get("accelerometer"), tables, RECORD, found.alone)


def _sources(
    tables: dict[str, FileTable],
    kinds: dict[str, list[str]],
    sections: list[Section],
    head: dict[str, Any],
    time: dict[str, Any],
    android: bool,
) -> list[str]:
    """Append the sections of other sensors, and return lines on what is left out."""
    left: list[str] = []
    for name in kinds.get("location", [])[:1]:
        names = FIX.among(tables[name].titles)
        geoid = "" if "wgs84" in names.height.lower() else GEOID
        of_fixes, left = location(tables, name, names, time, android, NEEDED, geoid)
        sections += of_fixes
    for name in kinds.get("magnetometer", [])[:1]:
        columns = triple(tables[name].titles, VECTOR)
        sections.append(magnetometer_section(name, time, columns, head))
    for name in kinds.get("barometer", [])[:1]:
        column = next(each for each in tables[name].titles if each.endswith("(hPa)"))
        sections.append(barometer_section(name, time, column))
    return left


READER = Reader(
    "phyphox",
    (".zip", *CSV),
    "export of the app phyphox, a zip or folder",
    sniff=sniff,
    open=open_export,
)
