"""Roll, pitch and heading of a state, and the covariance of its pose in them."""

import math
from math import cos, nan, sin, tan

import numpy as np

from ...core.mathematics.belief import ATT, POS, FilterState
from ...typing import Array


def angles(state: FilterState) -> tuple[float, float, float]:
    """Roll, pitch and heading in [0, 360), deg."""
    # as `matrix_to_euler`, which takes ten times as long where it is not compiled
    (north, _, _), (east, _, _), (down, roll_y, roll_z) = state.C_nb.tolist()
    pitch = math.asin(min(1.0, max(-1.0, -down))) if down == down else nan
    roll, heading = math.atan2(roll_y, roll_z), math.atan2(east, north)
    return math.degrees(roll), math.degrees(pitch), math.degrees(heading) % 360.0


def pose_covariance(state: FilterState) -> Array:
    """Return the covariance (6, 6) of position NED (m) and roll, pitch, heading (rad)."""
    _, pitch, heading = map(math.radians, angles(state))
    turn = np.eye(6)
    along = np.array([cos(heading), sin(heading), 0.0])
    turn[3, 3:] = along / cos(pitch)
    turn[4, 3:] = -sin(heading), cos(heading), 0.0
    turn[5, 3:] = along * tan(pitch) + [0.0, 0.0, 1.0]
    rows = np.r_[POS, ATT]
    found: Array = turn @ state.P[np.ix_(rows, rows)] @ turn.T
    return found
