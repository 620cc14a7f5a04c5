"""Logs of Google's app GnssLogger on Android: a text file whose rows begin with their kind.

Columns follow LOGGING_FORMAT.md (github.com/google/gps-measurement-tools) and the header of each
file. All times are `elapsedRealtimeNanos`, the phone's clock since its start: the `utcTimeMillis`
of the sensors is the phone's own UTC, which was off by half a second in the test log. The fixes of
the satellite receiver give the UTC of the clock's zero.
"""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...typing import Array, Ints
from ..decoding.phones.csv_export import parse_cells
from ..decoding.phones.phone import (
    PhoneFixColumns,
    Piece,
    day,
    inertial,
    location,
    magnetometer_section,
    matching_column,
    no_imu,
    triple,
)
from ..reader import Log, Reader, Section
from ..tables.table_file import FileTable, head_of, packed_suffixes, read_bytes

CLOCK = "elapsedRealtimeNanos"
MAX_NS = 4e18
"""Largest time in ns, since 1970 or since the start of a phone, that fits an integer."""
UNIX = "POSIX ns"
"""Added column: the phone's clock in UTC."""
SENSORS = {
    "gyro": ("UncalGyro", "Gyro"),
    "accel": ("UncalAccel", "Accel"),
    "magnetometer": ("UncalMag", "Mag"),
}
"""Kinds of rows, the preferred one first: uncalibrated, because the filter estimates biases
itself."""
FIX = PhoneFixColumns(
    r"Latitude(Degrees)?",
    r"Longitude(Degrees)?",
    r"Altitude(Meters)?",
    r"Accuracy(Meters)?",
    r"VerticalAccuracyMeters",
    r"Speed(Mps)?",
    r"Bearing(Degrees)?",
    r"SpeedAccuracyMps",
    r"BearingAccuracyDegrees",
)
VECTOR = r"(Uncal)?(Gyro|Accel|Mag){axis}.*"
UTC = r"UnixTimeMillis|\(UTC\)TimeInMs"
Bytes = np.ndarray[tuple[int], np.dtype[np.uint8]]
WANTED = ("Fix", *(kind for kinds in SENSORS.values() for kind in kinds))
LEFT = {
    "OrientationDeg": "fused with inertial data by the phone",
    "Raw": "raw measurements of the satellites; its fixes are taken",
}
OFF = 0.1
"""s: difference of the phone's UTC from that of the satellites that causes a line."""
NEEDED = "latitude, longitude, altitude or accuracy"
RECORD = "switch Sensors on in GnssLogger when you record"
FASTER = "record at 100 Hz, and take the log as the app wrote it"


class Lines(NamedTuple):
    """The lines of a file, processed as arrays because an hour has two million of them."""

    content: Bytes  # (size,)
    starts: Ints  # (n,)
    ends: Ints  # (n,) positions of the line ends
    names: dict[str, list[str]]  # names of columns by kind, of the header lines

    @classmethod
    def of(cls, content: bytes) -> "Lines":
        """Lines of a file."""
        data = np.frombuffer(content + b"\n", np.uint8)
        ends = np.flatnonzero(data == ord("\n"))
        found = cls(data, np.r_[0, ends[:-1] + 1], ends, {})
        for line in found.lines_with_prefix(b"#"):
            text = content[found.starts[line] : found.ends[line]].decode("utf-8", "replace")
            names = [name.strip() for name in text.strip("# \r").split(",")]
            if names[0] in WANTED:
                found.names[names[0]] = names
        return found

    def lines_with_prefix(self, prefix: bytes) -> Ints:
        """Return the indices of the lines with this beginning."""
        lines = np.flatnonzero(self.ends - self.starts >= len(prefix))
        for k, byte in enumerate(prefix):
            lines = lines[self.content[self.starts[lines] + k] == byte]
        return lines

    def cells(self, lines: Ints) -> Ints:
        """Return the number of cells of each of these lines."""
        commas = np.flatnonzero(self.content == ord(","))
        until = np.searchsorted(commas, self.ends[lines])
        return until - np.searchsorted(commas, self.starts[lines]) + 1

    def text(self, lines: Ints) -> bytes:
        """Return these lines as one text."""
        use = np.zeros(len(self.starts), bool)
        use[lines] = True
        return self.content[np.repeat(use, self.ends + 1 - self.starts)].tobytes()


def sniff(path: Path) -> bool:
    """Return True where the file begins with the header lines of the app."""
    return bool(re.search(rb"^# ?(Fix|Raw|UncalAccel),", head_of(path, 8192), re.MULTILINE))


def open_log(path: Path) -> Log:
    """The Log of a file. Raises DataError."""
    file = Lines.of(read_bytes(path, lines=True))
    left: list[str] = []
    tables = {kind: _table(path, kind, file, left) for kind in WANTED if kind in file.names}
    tables = {kind: table for kind, table in tables.items() if len(table.lines)}
    facts = [f"{kind}: {len(table.lines)} rows" for kind, table in tables.items()]
    zero, said = _zero(tables)
    time: dict[str, Any] = {"column": CLOCK, "unit": "ns"}
    head: dict[str, Any] = {}
    if zero is not None:
        time = {"column": UNIX, "unit": "ns", "clock": "unix"}
        tables = {kind: _on_utc(table, zero) for kind, table in tables.items()}
        head = _date(tables)
    sections, more = _inertial(tables, time)
    facts += more
    left += _fixes(tables, time, sections)
    magnetometer = next((kind for kind in SENSORS["magnetometer"] if kind in tables), None)
    if magnetometer:
        columns = _triple(tables[magnetometer])
        if columns:
            sections.append(magnetometer_section(magnetometer, time, columns, head))
    left += [
        f"{kind}: {why}" for kind, why in LEFT.items() if len(file.lines_with_prefix(kind.encode()))
    ]
    return Log(tables, tuple(sections), tuple(facts + said), tuple(left), head=head)


def _table(path: Path, kind: str, file: Lines, left: list[str]) -> FileTable:
    """Return the FileTable of one kind, without rows whose number of cells differs from the
    header."""
    names, lines = file.names[kind], file.lines_with_prefix(kind.encode() + b",")
    text = file.text(lines)
    if text.count(b",") != (len(names) - 1) * len(lines):
        whole = file.cells(lines) == len(names)
        left.append(f"{kind}: {int((~whole).sum())} rows with more or fewer cells than the header")
        lines = lines[whole]
        text = file.text(lines)
    frame = parse_cells(
        text.replace(b"\r\n", b"\n"),
        f"{path} [{kind}]",
        header=None,
        names=names,
        quoting=3,
        lineterminator="\n",  # a lone carriage return does not end a line, as in `lines`
    )
    return FileTable(f"{path} [{kind}]", frame, lines[: len(frame)] + 1)


def _matching_title(table: FileTable, pattern: str) -> str:
    return matching_column(table.titles, pattern)


def _triple(table: FileTable) -> list[str]:
    """Names of the columns of x, y and z, as UncalGyroXRadPerSec; [] where one is missing."""
    found = triple(table.titles, VECTOR)
    return found if CLOCK in table.names else []


def _zero(tables: dict[str, FileTable]) -> tuple[float | None, list[str]]:
    """(POSIX seconds at the zero of the phone's clock or None, lines on it): the median over fixes
    of the satellite receiver, else the phone's own UTC."""
    by_fix: list[Array] = []
    by_phone: list[Array] = []
    for kind, table in tables.items():
        if CLOCK not in table.frame.columns:
            continue
        is_fix = kind == "Fix"
        utc = _matching_title(table, UTC if is_fix else "utcTimeMillis")
        if not utc or is_fix and "Provider" not in table.frame.columns:
            continue
        zero = table.numbers(utc) * 1e-3 - table.numbers(CLOCK) * 1e-9
        if is_fix:
            zero = zero[(table.frame["Provider"].astype(str) == "GPS").to_numpy()]
        (by_fix if is_fix else by_phone).append(zero[np.isfinite(zero) & (np.abs(zero) < 4e9)])
    fix, phone = (
        float(np.median(all_)) if len(all_) else None
        for all_ in (np.concatenate([*each, np.empty(0)]) for each in (by_fix, by_phone))
    )
    if fix is None:
        return phone, [] if phone is None else [
            "UTC: the phone's own, because there is no satellite fix"
        ]
    if phone is not None and abs(phone - fix) > OFF:
        return fix, [
            f"UTC: that of the satellite fixes; the phone's own is {phone - fix:+.3f} s off"
        ]
    return fix, ["UTC: that of the satellite fixes"]


def _on_utc(table: FileTable, zero: float) -> FileTable:
    """Return the table with the column UNIX, as integers where its clock has integers."""
    frame, utc = table.frame, _matching_title(table, UTC)
    if CLOCK in frame.columns:
        clock = table.cells(CLOCK)
        whole = clock.dtype.kind == "i" and np.all(np.abs(clock) < MAX_NS)
        unix = clock + round(zero * 1e9) if whole else table.numbers(CLOCK) + zero * 1e9
    elif utc:
        unix = table.numbers(utc) * 1e6
    else:
        return table
    return table._replace(content=frame.assign(**{UNIX: unix}))


def _date(tables: dict[str, FileTable]) -> dict[str, str]:
    """Return the key date from the earliest row of the tables."""
    every = [table.numbers(UNIX) for table in tables.values() if UNIX in table.frame.columns]
    firsts = [float(np.median(t[:9])) * 1e-9 for t in every if len(t)]
    return day(float(np.median(firsts))) if firsts else {}


def _inertial(
    tables: dict[str, FileTable], time: dict[str, Any]
) -> tuple[list[Section], list[str]]:
    """(sections of the IMU, facts)."""
    from ..description.logs import slow  # loads pydantic: 0.2 s

    pieces: dict[str, Piece] = {}
    for role, unit in (("gyro", "rad/s"), ("accel", "m/s^2")):
        kinds = (each for each in SENSORS[role] if each in tables and _triple(tables[each]))
        kind = next(kinds, None)
        if kind is None:
            return [no_imu(f"there are no rows of {' or '.join(SENSORS[role])}; {RECORD}")], []
        pieces[role] = Piece(kind, time, _triple(tables[kind]), unit)
    sections, facts = inertial(pieces["gyro"], pieces["accel"], tables, RECORD)
    sections = [each._replace(faster=FASTER) for each in sections]
    # the fixes of a thinned log are still usable with an IMU from another file
    found = slow(sections[0], tables) if not sections[0].left else None
    return ([no_imu(f"{sections[0].title}: {found[0]}")] if found and found[1] else sections), facts


def _fixes(
    tables: dict[str, FileTable], time: dict[str, Any], sections: list[Section]
) -> list[str]:
    """Append the sections of the fixes, and return lines on what is left out of them."""
    if "Fix" not in tables:
        return []
    table = tables["Fix"]
    provider = table.frame["Provider"].astype(str) if "Provider" in table.frame else None
    left = []
    if provider is not None:
        use = (provider.str.lower() == "gps").to_numpy()
        left += [
            f"Fix: {count} of the provider {str(name)[:20]}, which blends in other sources"
            for name, count in provider[~use].value_counts().items()
        ]
        table = table.take(use)
    if time["column"] not in table.frame.columns:
        return [*left, f"Fix: has neither {CLOCK} nor a UTC"]
    tables["Fix"], names = table, FIX.among(table.titles)
    of_fixes, more = location(tables, "Fix", names, time, True, NEEDED)
    sections += of_fixes
    return left + more


READER = Reader(
    "gnsslogger",
    packed_suffixes(".txt"),
    "log of Android's GnssLogger",
    sniff=sniff,
    open=open_log,
)
