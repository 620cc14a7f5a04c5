"""Whether the IMU of a device's log is fast enough.

Between point samples motion and vibration are lost, which no filter gets back; increments hold all
of the motion. docs/how-to/flight-controllers.md has what was measured.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...units import factor
from ..contract import Section
from ..tables.table_file import Table
from .schema_base import Time
from .source_files import Files

LEAST_RATES = {"rate": (20.0, 100.0), "increment": (10.0, 20.0)}
"""Hz by the kind of the samples below which a log is refused, and below which it is noted."""
ROUNDED = 0.98
"""Of a rate: it may be 99 for 100."""


def slow(section: Section, tables: Mapping[str, Table]) -> tuple[str, bool] | None:
    """(line on an IMU that is slow, whether it is refused); None where it is fast enough, or no
    IMU of a log."""
    if section.of != "imu":
        return None
    hz, kind = _rate(section, tables), section.keys.get("kind", "rate")
    least, safe = LEAST_RATES.get(kind, (0.0, 0.0))
    if hz >= safe * ROUNDED:
        return None
    samples = "increments" if kind == "increment" else "samples"
    refused = hz < least * ROUNDED
    line = (
        f"{hz:.3g} Hz is {'too ' if refused else ''}slow for {samples} of an IMU: {least:g} Hz are "
        f"needed, {safe:g} Hz are safe"
    )
    remedy = section.faster or "set the logger to a higher rate"
    return f"{line}; {remedy}", refused


def _rate(section: Section, tables: Mapping[str, Table]) -> float:
    """Hz of the slower of gyro and accelerometer: 1 / the median interval; infinite where the
    samples have no times in a log."""
    keys, found = section.keys, {}
    for signal in (keys.get(each, {}) for each in ("gyro", "accel")):
        time, name = signal.get("time", keys.get("time")), signal.get("table", keys.get("table"))
        if time is not None and name in tables and isinstance(time["column"], str):
            found[name, time["column"]] = time
    return min((_of(tables[name], time) for (name, _), time in found.items()), default=math.inf)


def _of(table: Table, time: Mapping[str, Any]) -> float:
    """Hz of the times of one table."""
    if "format" in time:
        t = Files("", 0.0).times(table, Time.model_validate(time))
    else:
        t = table.numbers(time["column"]) * factor(time["unit"], "time") * time.get("scale", 1.0)
    steps = np.diff(t)
    steps = steps[steps > 0]
    return 1 / float(np.median(steps)) if len(steps) else math.inf
