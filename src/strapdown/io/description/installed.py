"""The installation as a description gives it: what a recording was read with, to be compared with the
file before that is changed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .schema import Description

INSTALLED = "installed"
"""Where the meta of a Recording has it; not of one whose set-up was changed after reading."""
LOOK_THE_SAME = 1e-9
"""By which numbers may differ that are the same."""


def installed(description: Description) -> dict[str, list[float]]:
    """{"[section] key": numbers}: offsets of time, s; lever arms, m; mounting, roll, pitch, heading,
    rad; scales. In plain values, each as it is or, where it is not given, as it is taken."""
    imu = description.imu
    found = {
        "[imu] time offset": [imu.time.offset],
        "[imu] mounting": list(imu.mounting.angles) if imu.mounting else [0.0] * 3,
        "[imu] lever_arm": list(imu.lever_arm),
    }
    for number, part in enumerate(description.aiding, 1):
        where = f"[[aiding]] {number} ({part.kind})"
        found[f"{where} lever_arm"] = list(part.lever_arm or [0.0] * 3)
        if part.time is not None:
            found[f"{where} time offset"] = [part.time.offset]
            found[f"{where} scale"] = [float(scale) for scale in part.scales]
    return found


def difference(there: dict[str, Any], read: dict[str, Any]) -> str:
    """The first key of two installations that differs, with both values; "" where none does."""
    for key in [*read, *there]:
        one, other = there.get(key), read.get(key)
        if one is None or other is None or not np.allclose(one, other, 0.0, LOOK_THE_SAME):
            return f"{key} is {_shown(one)}, and {_shown(other)} where the recording was read"
    return ""


def _shown(numbers: Sequence[float] | None) -> str:
    if numbers is None:
        return "missing"
    text = ", ".join(f"{x:.10g}" for x in numbers)
    return text if len(numbers) == 1 else f"[{text}]"
