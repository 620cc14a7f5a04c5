"""The mean side slip of an aircraft whose run estimates the wind: an asymmetric airframe or an IMU that is not
mounted straight flies with one, and the constraint of no side slip takes it for wind or heading."""

from collections.abc import Iterator

import numpy as np

from ..aiding.air_data import LATERAL, MIN_AIRSPEED, SIDE_SLIP, WIND
from ..core.loop.contract import ATT
from ..data.solution import Solution
from ..data.verdict import Reason
from ..geometry.rotations import Rotation
from ..typing import Array
from ..units.constants import SETTLING

BLOCK, BLOCKS = 30.0, 5
"""s within which slips hang together; the fewest such stretches."""
SURE, MIN_SLIP = 2.0, 1.0
"""Standard deviations and deg from which a mean is one."""
LARGE = 10.0
"""deg from which it makes a solution doubtful: the side slip that ArduPilot's constraint allows for."""


def mean_slip(solution: Solution) -> Iterator[Reason]:
    """The mean side slip in flight, of a run with a constraint or a vane.

    Parameters
    ----------
    solution : Solution
        Of `fuse` or `smooth`.

    Yields
    ------
    Reason
        A remark, or from 10 deg on a reason for doubt.
    """
    assert solution.recording is not None
    used = [a for a in solution.recording.sources if a.kind in (LATERAL.name, SIDE_SLIP.name)]
    slip, t, known = _slips(solution)
    block = np.unique(np.floor(t / BLOCK), return_inverse=True)[1]
    if not used or len(np.unique(block)) < BLOCKS:
        return
    means = np.bincount(block, slip) / np.bincount(block)
    mean, std = float(means.mean()), float(np.hypot(means.std() / len(means) ** 0.5, known))
    if abs(mean) < max(MIN_SLIP, SURE * std):
        return
    yield Reason(
        "mounting",
        f"in flight the air comes on average from {abs(mean):.1f} +- {std:.1f} deg "
        f"{'right' if mean > 0 else 'left'} of the nose, or more, since the filter takes a part for wind",
        f"add {-mean:+.1f} deg to `heading` of [imu] mounting and run again, if the IMU may be turned by "
        "that: an airframe that is not symmetric flies so too",
        used[0].name or used[0].kind,
        abs(mean) / LARGE,
    )


def _slips(solution: Solution) -> tuple[Array, Array, float]:
    """(side slips (n,), deg, in flight after the start, their times (n,), s, the standard deviation, deg,
    that heading and wind give their mean); empty without wind or attitude."""
    made, columns = solution.trajectory, solution.columns
    names = [f"{WIND['shared']} {each}" for each in WIND["states"][:2]]
    nothing = np.empty(0), np.empty(0), np.nan
    if made.v_n is None or made.q_nb is None or made.std is None or names[0] not in columns:
        return nothing
    level = np.stack([columns[name] for name in names], axis=1)
    air = made.v_n - np.c_[level, np.zeros(len(level))]
    u, v, _ = Rotation.from_wxyz(made.q_nb).inv().apply(air).T
    flies = (u > MIN_AIRSPEED) & (solution.t > solution.t[0] + SETTLING)
    if not flies.any():
        return nothing
    slip = np.degrees(np.arctan2(v[flies], u[flies]))
    # an error of the wind comes from all sides where the course goes round the compass
    steady = abs(np.mean(np.exp(1j * np.arctan2(made.v_n[flies, 1], made.v_n[flies, 0]))))
    of_wind = np.hypot(*(columns[f"std of {name}"][flies] for name in names)) / u[flies]
    known = np.hypot(made.std[flies, ATT.stop - 1], steady * of_wind / np.sqrt(2))
    return slip, solution.t[flies], float(np.degrees(np.median(known)))
