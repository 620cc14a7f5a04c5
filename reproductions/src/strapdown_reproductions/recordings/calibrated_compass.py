"""The magnetometer of thor75, calibrated by `sd.calibrate` from its own flight, against the
attitude computed on board, which it does not see.

And what attitude filters make of that flight: in a turn the specific force points along the wing's
normal, not up, and no gyro tells for long.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from strapdown import io
from strapdown.alignment.static_attitude import level_vector
from strapdown.calibration.fitting import calibrate
from strapdown.data.recording import Recording
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors, rms
from strapdown.typing import Notify

from ..common.targets import claim

GAUSS = 1e4
"""Gauss in a tesla."""
FILTERS = ("attitude-mekf", "mahony")
INTRODUCTION = (
    "The magnetometer of thor75 is calibrated by `strapdown calibrate` from the flight itself, 240 "
    "to 575 s: field, gyros, and the strength of the "
    "geomagnetic model at date and place. The residual is what it differs by from that model's "
    "field turned by the attitude on board; the heading "
    "is tilt-compensated with the roll and pitch on board and compared with the heading on board. "
    "Attitude filters on the same flight: an aircraft "
    "in a turn feels no gravity across its wings, so a filter without velocity leans into the turn; "
    "the 15-state filters above do not.",
)


def magnetometer(
    folder: Path, window: tuple[float, float], notify: Notify | None = None
) -> tuple[dict[str, tuple[str, pd.DataFrame]], list[dict[str, Any]]]:
    """(tables by name, claims) of the description thor75-attitude.toml in `folder`, scored over
    window = (start, stop) in s. Raises DataError."""
    recording = io.read(folder / "thor75-attitude.toml")
    source = next(a for a in recording.sources if a.kind == "magnetic-field")
    found = calibrate(recording, "magnetometer", *window)
    near = recording.reference.rotation[
        np.clip(np.searchsorted(recording.reference.t, found.t), 0, len(recording.reference.t) - 1)
    ]
    heading, pitch, roll = near.as_euler("ZYX").T
    residual = (
        np.sqrt(np.mean((found.calibrated - near.inv().apply(source.parameters)) ** 2, axis=0))
        * GAUSS
    )
    seen = level_vector(found.calibrated, roll, pitch)
    off = (
        np.arctan2(-seen[:, 1], seen[:, 0])
        + np.arctan2(source.parameters[1], source.parameters[0])
        - heading
    )
    off = np.degrees(np.sqrt(np.mean(((off + np.pi) % (2 * np.pi) - np.pi) ** 2)))
    table = pd.DataFrame(
        [
            ("rms against the field of the model", *residual),
            ("misfit that the calibration states", *(found.residual * GAUSS)),
        ],
        columns=["thor75 magnetometer", "x, gauss", "y, gauss", "z, gauss"],
    )
    claims = [
        claim(
            "thor75 magnetometer, calibrated from its flight: largest residual of an axis, rms",
            residual.max(),
            0.015,
            "gauss",
        ),
        claim("thor75 heading by that magnetometer, rms", off, 4.0, "deg"),
    ]
    return {
        "thor75-magnetometer": ("thor75: magnetometer after calibration", table),
        "thor75-attitude": (
            "thor75: attitude filters on the same flight, rms difference from the attitude on board",
            _filters(recording, window, notify),
        ),
    }, claims


def _filters(
    recording: Recording, window: tuple[float, float], notify: Notify | None
) -> pd.DataFrame:
    rows = []
    for name in FILTERS:
        r = rms(errors(fuse(recording, name, notify=notify), recording.reference), window)
        rows.append((name, *np.degrees(r.rph), np.degrees(r.angles[1])))
    return pd.DataFrame(
        rows, columns=["filter", "roll, deg", "pitch, deg", "heading, deg", "inclination, deg"]
    )
