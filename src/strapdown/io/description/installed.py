"""The installation that a recording was read with, to be compared with its description before that
file is changed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...checks import is_number
from .schema import Description
from .schema_source import SourcePart

LOOK_THE_SAME = 1e-9
"""Largest difference of numbers that count as equal."""


def installation_numbers(description: Description) -> dict[str, list[float]]:
    """{"[section] key": numbers}: time offsets, s; lever arms, m; mounting, roll, pitch, heading,
    rad; scales; standard deviations, or the scales of their columns; correlated errors, std and
    time. A key that is not given has its default."""
    imu = description.imu
    found = {
        "[imu] time offset": [imu.time.offset],
        "[imu] mounting": list(imu.mounting.angles) if imu.mounting else [0.0] * 3,
        "[imu] lever_arm": list(imu.lever_arm),
    }
    for number, part in enumerate(description.source, 1):
        where = f"[[source]] {number} ({part.kind})"
        found[f"{where} lever_arm"] = list(part.lever_arm or [0.0] * 3)
        found[f"{where} std"] = [_size(entry) for entry, _, _ in part.deviations]
        found[f"{where} correlated"] = _correlated_numbers(part)
        if part.time is not None:
            found[f"{where} time offset"] = [part.time.offset]
            found[f"{where} scale"] = [float(scale) for scale in part.scales]
    return found


def _size(entry: Any) -> float:
    """Return a number of `std`, or the scale of its column."""
    if isinstance(entry, dict):
        entry = entry.get("scale", 1.0)
    return float(entry) if is_number(entry) else 1.0


def _correlated_numbers(part: SourcePart) -> list[float]:
    """Standard deviations and time of its correlated errors, SI; [] without any."""
    errors = part.correlated_errors
    return [] if errors is None else [*errors.std, errors.time]


def difference(there: dict[str, Any], read: dict[str, Any]) -> str:
    """Return the first key that differs between two installations, with both values; "" where none
    does."""
    for key in [*read, *there]:
        one, other = there.get(key), read.get(key)
        if one is None or other is None or len(one) != len(other) or not _same(one, other):
            return f"{key} is {_numbers_text(one)}, but the recording was read with {_numbers_text(other)}"
    return ""


def _same(one: Sequence[float], other: Sequence[float]) -> bool:
    return bool(np.allclose(one, other, 0.0, LOOK_THE_SAME))


def _numbers_text(numbers: Sequence[float] | None) -> str:
    if numbers is None:
        return "missing"
    text = ", ".join(f"{x:.10g}" for x in numbers)
    return text if len(numbers) == 1 else f"[{text}]"
