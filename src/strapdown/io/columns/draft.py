"""A bare table as a Log: the columns are identified by names, units, magnitudes and content, with a
reason wherever the user must check."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..description.source_files import times_of
from ..reader import GUESS, ROLES, Log, Section
from ..tables.table_arrays import tables_of
from ..tables.table_file import FileTable
from .airspeed_columns import airspeed_section
from .column_names import ACCEL, GYRO, ColumnNames, plain
from .gnss_columns import fix_sections
from .imu_columns import attitude_section, imu_section, magnetometer_section
from .time_columns import find_clock


def open_table(path: Path) -> Log:
    """The Log of a file of bare tables. Raises DataError where it cannot be read."""
    tables: dict[str, FileTable] = {}
    sections: list[Section] = []
    facts: list[str] = []
    left: list[str] = []
    asked: list[str] = []
    found = tables_of(path)
    for name, table in found.items():
        log = _of_table(table, name if len(found) > 1 else None)
        made = any(section.keys.get("table") == MADE for section in log.sections)
        tables[MADE if made else name] = next(iter(log.tables.values()))
        instance = {role: 0 for role in ROLES}
        for section in sections:
            instance[section.role] = max(instance[section.role], section.instance + 1)
        sections += [
            section._replace(instance=instance[section.role] * (not _is_piece(section)))
            for section in log.sections
        ]
        facts += log.facts
        left += log.left
        asked += log.asked
    if sections and len(found) > 1:  # the other tables need no section
        asked = [line for line in asked if "gravity" in line or "height" in line]
    return Log(tables, tuple(sections), tuple(facts), tuple(left), tuple(asked))


def _is_piece(section: Section) -> bool:
    return section.of == "imu" and not {"gyro", "accel"} <= set(section.keys)


def _of_table(table: FileTable, name: str | None) -> Log:
    """The Log of one table; `name` is what its sections name it by, where the file has several."""
    columns = ColumnNames.of(table)
    if all(isinstance(name, int) for name in table.names):
        return _without_header(table)
    label = f"table {name}" if name else "table"
    facts = [f"{label}: {len(table.lines)} rows, columns {', '.join(columns.names)}", *table.notes]
    is_imu = bool(columns.triple(GYRO) or columns.triple(ACCEL))
    clock = find_clock(columns, is_imu)
    if clock is None:
        no_time = (
            f"no column has the name or the content of a time, among {', '.join(columns.names[:MAX_NAMES])}: "
            f"rename the time column to time, or name it in `time` of a recording.toml"
        )
        return Log({"": table}, (), tuple(facts), asked=(no_time,))
    facts.append(clock.fact + (f" (a guess: {clock.assumed})" if clock.assumed else ""))
    t = times_of(table, clock.keys)
    imu, more, asked = imu_section(columns, clock.keys, t)
    magnetometer, of_field = magnetometer_section(
        columns, clock.keys, imu.keys.get("axes", "FRD").removesuffix(GUESS) if imu else "FRD"
    )
    taken = [
        name for section in (imu, magnetometer) if section for name in column_names(section.keys)
    ]
    airspeed, of_airspeed = airspeed_section(columns.without(taken), clock.keys, t)
    taken += column_names(airspeed.keys) if airspeed else []
    fixes = fix_sections(columns.without(taken), clock.keys, t, is_imu)
    attitude, of_attitude = attitude_section(columns, clock.keys)
    sections = [
        _with_table(section, clock.assumed, name)
        for section in (imu, *fixes.sections, magnetometer, airspeed, attitude)
        if section is not None
    ]
    asked += fixes.asked
    if not sections and not asked:
        asked.append(
            f"none of its columns was recognised: {', '.join(columns.names[:20])}; describe them in a "
            f"recording.toml, or rename them, as gyro_x, acc_x, lat, lon, height"
        )
    if fixes.made:
        table = table.with_columns(fixes.made)
    facts += [*more, *fixes.facts, *of_field, *of_airspeed, *of_attitude]
    used = [
        *column_names([each.keys for each in sections]),
        *column_names(clock.keys),
        *fixes.sources,
    ]
    left = _not_taken(columns.without(used), label if name else "")
    return Log({"": table}, tuple(sections), tuple(facts), left, tuple(asked))


MAX_NAMES = 40
"""Largest number of columns that a line lists."""


def _not_taken(columns: ColumnNames, label: str) -> tuple[str, ...]:
    """Return a line on the unused columns, except empty ones."""
    names = [name for name in columns.names if columns.table.cells_filled(name).any()]
    if not names:
        return ()
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    of = f" of {label}" if label else ""
    text = f"columns{of} not recognised or not needed: {', '.join(names[:MAX_NAMES])}{more}"
    if {"vx", "vy", "vz"} <= {plain(name) for name in names}:
        text += "; the axes of vx, vy, vz are unknown: rename them vn, ve, vd or ve, vn, vu"
    return (text,)


NO_COLUMN = ("kind", "table", "unit", "axes", "form", "clock", "format", "equals", "field")
"""Keys whose text does not name a column."""


def column_names(keys: Any) -> list[str]:
    """The columns that a section names, or one of its values."""
    if isinstance(keys, Mapping):
        return [name for key in keys if key not in NO_COLUMN for name in column_names(keys[key])]
    if isinstance(keys, (list, tuple)):
        return [name for value in keys for name in column_names(value)]
    return [keys] if isinstance(keys, str) else []


def _with_table(section: Section, clock_assumed: str, table: str | None) -> Section:
    """Return the section with the name of its table and the assumption on its clock."""
    assumed = dict(section.assumed) | ({"time": clock_assumed} if clock_assumed else {})
    keys: dict[str, Any] = {key: section.keys[key] for key in section.keys if key != "table"}
    if "table" in section.keys:  # its columns are derived, not those of the file
        keys = {**keys, "table": table or MADE}
    elif table:
        keys = {**keys, "table": table}
    first = [key for key in ("kind", "table", "time") if key in keys]
    keys = {key: keys[key] for key in [*first, *(key for key in keys if key not in first)]}
    return section._replace(keys=keys, assumed=assumed)


MAX_KINDS = 20
"""Largest number of different texts in a column that name kinds of rows."""
MADE = "with degrees"
"""Name of the table with derived columns, of a file that has one table."""


def _without_header(table: FileTable) -> Log:
    columns = ColumnNames.of(table)
    values = [(name, columns.numbers(name)) for name in table.names]
    facts = [f"table: {len(table.lines)} rows without a header line"] + [
        f"column {name}: {np.nanmin(each):.6g} to {np.nanmax(each):.6g}, median "
        f"{np.nanmedian(each):.6g}"
        for name, each in values
        if np.isfinite(each).any()
    ]
    asked = "the table has no header line: give its columns by number in a recording.toml, the first is 1"
    for name, each in values:
        texts: list[str] = (
            list(dict.fromkeys(table.cells(name)[table.cells_filled(name)]))
            if np.isnan(each).all()
            else []
        )
        if 1 < len(texts) <= MAX_KINDS:
            asked = (
                f"column {name} holds {', '.join(map(repr, texts))}: the table mixes kinds of rows; "
                f"write each kind to a file of its own, for example with grep, and add a header line"
            )
    return Log({"": table}, (), tuple(facts), asked=(asked,))
