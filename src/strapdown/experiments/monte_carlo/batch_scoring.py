"""Scores of a batch of runs at each scored epoch: errors, standard deviations and NEES, by one
kernel, so that neither rows nor covariances are stored."""

import math

import numpy as np

from ...core.loop.contract import STATES, FilterState, kernel, matrix
from ...core.loop.lane_loop import KEEP, KEEP_LANES
from ...core.mathematics.earth import radii
from ...core.mathematics.rotation import rotation_between, wrap
from ...data.solution import attitude_of
from ...evaluation.nees import normalised_error
from ...typing import Array
from .scoring import Epochs

ERROR, STD, NEES, RPH, NUMBERS = (
    slice(0, STATES),
    slice(STATES, 2 * STATES),
    2 * STATES,
    slice(2 * STATES + 1, 2 * STATES + 4),
    2 * STATES + 4,
)
"""Columns of what is kept: errors of the states, true - estimate, their standard deviations, the NEES
of all, and the errors of roll, pitch and heading, rad."""
TRUE_LLA, TRUE_V, TRUE_C, TRUE_RPH = slice(0, 3), slice(3, 6), slice(6, 15), slice(15, 18)
SCRATCH = (STATES + 2) * STATES


def truth_array(at: Epochs) -> Array:
    """(n, 18) the truth at the epochs as the kernel takes it."""
    truth = at.truth
    assert truth.v_n is not None
    C = attitude_of(truth).as_matrix().reshape(-1, 9)
    return np.c_[truth.lla, truth.v_n, C, truth.rph]


@kernel(KEEP)
def keep_errors(
    belief: FilterState, k: int, true: Array, biases: Array, work: Array, kept: Array
) -> None:
    """Row k of errors, standard deviations and NEES."""
    given, row, lla, C, P = true[k], kept[k], belief.lla, belief.C_nb, belief.P
    error, std, rph = row[ERROR], row[STD], row[RPH]
    lat, h = 0.5 * (given[0] + lla[0]), 0.5 * (given[2] + lla[2])
    R_M, R_N = radii(lat)
    error[0] = (given[0] - lla[0]) * (R_M + h)
    error[1] = wrap(given[1] - lla[1]) * (R_N + h) * math.cos(lat)
    error[2] = lla[2] - given[2]
    T = given[TRUE_C]
    error[6], error[7], error[8] = rotation_between(
        C, (T[0], T[1], T[2], T[3], T[4], T[5], T[6], T[7], T[8])
    )
    for i in range(3):
        error[3 + i] = given[TRUE_V][i] - belief.v_n[i]
        error[9 + i] = biases[k, i] - belief.b_a[i]
        error[12 + i] = biases[k, 3 + i] - belief.b_g[i]
    for i in range(STATES):
        std[i] = math.sqrt(max(P[i, i], 0.0))
    row[NEES] = normalised_error(error, P, matrix(work, 0, STATES + 2, STATES))
    horizontal = math.sqrt(C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0])
    rph[0] = wrap(given[TRUE_RPH][0] - math.atan2(C[2, 1], C[2, 2]))
    rph[1] = wrap(given[TRUE_RPH][1] - math.atan2(-C[2, 0], horizontal))
    rph[2] = wrap(given[TRUE_RPH][2] - math.atan2(C[1, 0], C[0, 0]))


keep_errors_in_lanes = keep_errors.for_runs(KEEP_LANES)  # type: ignore[attr-defined]
"""For eight runs at once."""
