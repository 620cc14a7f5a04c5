"""Whether the IMU of a device's log is fast enough.

Between point samples motion and vibration are lost, which no filter gets back; increments hold all
of the motion. docs/flight-controllers.md has what was measured.
"""

import math
from collections.abc import Mapping

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
    line = f"{hz:.3g} Hz is slow for {samples} of an IMU: {least:g} Hz are needed, {safe:g} Hz are safe"
    return line + (f"; {section.faster}" if section.faster else ""), hz < least * ROUNDED


def _rate(section: Section, tables: Mapping[str, Table]) -> float:
    """Hz: 1 / the median interval; infinite where the samples have no times in a log."""
    keys = section.keys
    signal = keys.get("gyro") or keys.get("accel") or {}
    time, name = signal.get("time", keys.get("time")), str(signal.get("table", keys.get("table")))
    if time is None or name not in tables or not isinstance(time["column"], str):
        return math.inf
    if "format" in time:
        t = Files("", 0.0).times(tables[name], Time.model_validate(time))
    else:
        seconds = factor(time["unit"], "time") * time.get("scale", 1.0)
        t = tables[name].numbers(time["column"]) * seconds
    steps = np.diff(t)
    steps = steps[steps > 0]
    return 1 / float(np.median(steps)) if len(steps) else math.inf
