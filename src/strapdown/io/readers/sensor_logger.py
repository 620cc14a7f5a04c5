"""Recordings of the app Sensor Logger on Android and iOS: a zip or folder of CSV files.

Columns and units follow the app's pages UNITS.md, COORDINATES.md and CROSSPLATFORM.md
(github.com/tszheichoi/awesome-sensor-logger). Times are POSIX nanoseconds; x points right, y to the
top and z out of the screen. An iPhone's accelerations have the opposite sign unless "Standardise
Units & Frames" is on. Altitudes are above the ellipsoid.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...units.conversion import G
from ..decoding.phones.csv_export import CSV, Export, export, heads
from ..decoding.phones.phone import (
    GRAVITY,
    PhoneFixColumns,
    Piece,
    barometer_section,
    day,
    inertial,
    location,
    magnetometer_section,
    median_force,
    no_imu,
)
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable

TIME = {"column": "time", "unit": "ns", "clock": "unix"}
XYZ = ["x", "y", "z"]
FIX = PhoneFixColumns(
    "latitude",
    "longitude",
    "altitude",
    "horizontalAccuracy",
    "verticalAccuracy",
    "speed",
    "bearing",
    "speedAccuracy",
    "bearingAccuracy",
)
LOCATIONS = ("LocationGps", "Location")
"""Tables of fixes, those from satellites only first."""
ANDROID = ("TotalAcceleration", "LocationGps", "LocationNetwork")
"""Files that only Android writes, from UNITS.md and FUSEDLOCATION.md."""
FUSED = (
    " of Android's fused provider (FLP), which blends in network positions; "
    '"Additional Location Data" of the app records LocationGps, from satellites only'
)
NEEDED = "latitude, longitude, altitude or horizontalAccuracy"
SUM = "Accelerometer and Gravity"
UNUSED = {
    "Orientation": "fused with inertial data by the phone",
    "LocationNetwork": "from cell towers and wireless networks",
    "GyroscopeUncalibrated": "the calibrated gyro is taken",
    "MagnetometerUncalibrated": "the calibrated magnetometer is offered",
}
RECORD = (
    "record Gravity or Total Acceleration too (Sensor Logger has a switch for each), or Accelerometer "
    "Uncalibrated"
)


class Platform(NamedTuple):
    """The platform of the app, and the evidence for it."""

    name: str  # "android" or "ios"; "" where it is unknown
    standard: bool  # True where an iPhone's signs and units were converted to Android's
    why: str


class Signs(NamedTuple):
    """The factor from accelerations to specific force in m/s^2, and the evidence for it."""

    scale: float
    why: str
    sure: bool


def sniff(path: Path) -> bool:
    """Return True where one of the files begins with the common columns of the app's sensors."""
    return any(head.startswith("time,seconds_elapsed,") for head in heads(path).values())


def open_recording(path: Path) -> Log:
    """The Log of a recording. Raises DataError."""
    found = export(path)
    names = [name for name in found.files if found.head(name).startswith("time,")]
    wanted = {"Accelerometer", "Gravity", "TotalAcceleration", "AccelerometerUncalibrated"}
    wanted |= {"Gyroscope", "Magnetometer", "Barometer", *LOCATIONS}
    if "Gyroscope" not in names:
        wanted.add("GyroscopeUncalibrated")
    tables = {name: found.table(name) for name in names if name in wanted}
    left = [f"{name}: has no rows" for name, table in tables.items() if not len(table.lines)]
    tables = {name: table for name, table in tables.items() if len(table.lines)}
    head = _head(tables)
    platform = _platform(found, tables)
    sections, facts = _inertial(found, tables, platform)
    left += _sources(tables, sections, head, platform.name == "android")
    for name in names:
        if name not in wanted:
            left.append(f"{name}: {UNUSED.get(name, 'not a sensor that is read')}")
    return Log(tables, tuple(sections), tuple(facts), tuple(left), head=head)


def _head(tables: dict[str, FileTable]) -> dict[str, str]:
    """The date of the first sample."""
    firsts = [table.numbers("time")[:1] * 1e-9 for table in tables.values()]
    return day(float(np.median(np.concatenate(firsts)))) if firsts else {}


def _inertial(
    found: Export, tables: dict[str, FileTable], platform: Platform
) -> tuple[list[Section], list[str]]:
    """(sections of the IMU, facts)."""
    gyro = next((each for each in ("Gyroscope", "GyroscopeUncalibrated") if each in tables), None)
    name = _force_table(tables)
    if name is None and "Accelerometer" in tables:
        norm = median_force(tables["Accelerometer"], XYZ)[0]
        why = f"Accelerometer.csv does not contain gravity (its median is {norm:.2g} m/s^2), as the app writes it; {RECORD}"
        return [no_imu(why)], []
    accel, facts, assumed = None, [], {}
    if name:
        signs = _signs(platform, name, median_force(tables[name], XYZ)[0])
        accel = Piece(name, TIME, XYZ, "m/s^2", signs.scale)
        facts = [f"specific force: {name}, {signs.why}"]
        assumed = {} if signs.sure else {"accel": signs.why}
    turned = Piece(gyro, TIME, XYZ, "rad/s") if gyro else None
    sections, more = inertial(turned, accel, tables, RECORD, found.alone, assumed)
    return sections, facts + more


def _force_table(tables: dict[str, FileTable]) -> str | None:
    """Return the table of specific force, the sum of acceleration and gravity where no table has
    both; None where gravity was not recorded."""
    if "TotalAcceleration" in tables:
        return "TotalAcceleration"
    if {"Accelerometer", "Gravity"} <= set(tables):
        accel, gravity = tables["Accelerometer"], tables["Gravity"]
        t, there = accel.numbers("time"), gravity.numbers("time")
        order = np.argsort(there, kind="stable")
        columns = {
            axis: accel.numbers(axis)
            + np.interp(t, there[order], gravity.numbers(axis)[order], np.nan, np.nan)
            for axis in XYZ
        }
        rows = {"time": accel.cells("time"), **columns}
        tables[SUM] = FileTable.of(accel.name, rows, accel.lines, accel.word)
        return SUM
    if "AccelerometerUncalibrated" in tables:
        return "AccelerometerUncalibrated"
    return None


def _platform(found: Export, tables: dict[str, FileTable]) -> Platform:
    """Return the platform from the metadata file, else from files that only one platform writes."""
    metadata = next((each for each in found.files if each.lower() == "metadata"), None)
    if metadata:
        table = found.table(metadata).frame
        asked = [column for column in ("platform", "standardisation") if column in table]
        said = {column: str(table[column].iloc[0]).lower() for column in asked if len(table)}
        if "platform" in said:
            standard = said.get("standardisation", "false") == "true"
            name = "ios" if "ios" in said["platform"] else "android"
            return Platform(name, standard, "from Metadata.csv")
    for name in ANDROID:
        if name in found.files:
            return Platform("android", False, f"because only it writes {name}.csv")
    location = tables.get("Location")
    if location is not None and "altitudeAboveMeanSeaLevel" in location.frame.columns:
        return Platform("ios", False, "because only it writes heights above mean sea level")
    return Platform("", False, "")


def _signs(platform: Platform, name: str, norm: float) -> Signs:
    """Return the factor from the accelerations of a table to specific force; `norm` is their
    median."""
    g = G
    in_g = name == "AccelerometerUncalibrated" and norm < 0.5 * GRAVITY[0]
    if in_g:
        return Signs(-g, "in g, as an iPhone writes it, so with the opposite sign", True)
    if not platform.name:
        why = "Android's signs; an iPhone's are opposite, but no Metadata.csv names the platform"
        return Signs(1.0, why, False)
    bare = platform.name == "ios" and not platform.standard
    kind = "an iPhone's opposite" if bare else "Android's"
    return Signs(-1.0 if bare else 1.0, f"{kind} signs, {platform.why}", True)


def _sources(
    tables: dict[str, FileTable], sections: list[Section], head: dict[str, Any], android: bool
) -> list[str]:
    """Append the sections of other sensors, and return lines on what is left out."""
    left: list[str] = []
    locations = [name for name in LOCATIONS if name in tables]
    for instance, name in enumerate(locations):
        names = FIX.among(tables[name].titles)
        found, lines = location(tables, name, names, TIME, android, NEEDED, instance=instance)
        left += lines
        if android and found and name == "Location":
            found[0] = found[0]._replace(title=found[0].title + FUSED)
        sections += found
    if "Magnetometer" in tables:
        sections.append(magnetometer_section("Magnetometer", TIME, XYZ, head))
    if "Barometer" in tables and "pressure" in tables["Barometer"].frame.columns:
        sections.append(barometer_section("Barometer", TIME, "pressure"))
    return left


READER = Reader(
    "sensor-logger",
    (".zip", *CSV),
    "recording of the app Sensor Logger, a zip or folder",
    sniff=sniff,
    open=open_recording,
)
