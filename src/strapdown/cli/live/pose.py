"""The covariance of a pose in angles that people read."""

from math import cos, sin, tan

import numpy as np

from ...core.mathematics.belief import ATT, POS, FilterState
from ...core.mathematics.rotation import matrix_to_euler
from ...typing import Array


def pose_covariance(state: FilterState) -> Array:
    """Return the covariance (6, 6) of position NED (m) and roll, pitch, heading (rad)."""
    _, pitch, heading = matrix_to_euler(state.C_nb)
    turn = np.eye(6)
    along = np.array([cos(heading), sin(heading), 0.0])
    turn[3, 3:] = along / cos(pitch)
    turn[4, 3:] = -sin(heading), cos(heading), 0.0
    turn[5, 3:] = along * tan(pitch) + [0.0, 0.0, 1.0]
    rows = np.r_[POS, ATT]
    found: Array = turn @ state.P[np.ix_(rows, rows)] @ turn.T
    return found
