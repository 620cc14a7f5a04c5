"""Sources in the axes of the IMU, after a change of these axes."""

from dataclasses import replace

import numpy as np

from ..aiding import find
from ..data.solution import Source
from ..geometry.rotations import Rotation
from ..units.constants import STANDARD_GRAVITY


def is_of_the_imu(a: Source) -> bool:
    """True where a source is in the axes of the IMU: a filter compares it with the attitude of the
    IMU, so a mounting does not change its innovations."""
    return a.kind in ("attitude", "magnetic-field") or bool(find(a.kind).mean_of)


def with_the_imu(a: Source, turn: Rotation) -> Source:
    """A source in axes to which `turn` leads, where it is in those of the IMU."""
    if not is_of_the_imu(a):
        return a
    if (
        find(a.kind).mean_of == "accel"
    ):  # two of three components: rotors carry the weight along the third
        weight = np.full(len(a.y), -STANDARD_GRAVITY)
        return replace(a, y=turn.apply(np.c_[a.y, weight])[:, :2])
    if a.kind != "attitude":
        return replace(a, y=turn.apply(a.y))
    # roll, pitch, heading; the first two know no heading
    angles = np.nan_to_num(a.y)
    turned = (Rotation.from_rph(angles) * turn.inv()).as_rph()
    turned[:, 2] = np.where(np.isnan(a.y[:, 2]), np.nan, turned[:, 2] % (2 * np.pi))
    return replace(a, y=turned)
