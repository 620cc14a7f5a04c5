"""The state of every filter: estimate and covariance, the order of the error states, and the
assumed noise of the IMU.

Everything is SI and radians, navigation frame NED, body frame forward-right-down; errors are true -
estimate.
"""

from typing import NamedTuple

from ...typing import Array
from ..compile.signatures import REAL, reals, record

POS, VEL, ATT, BA, BG = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)
STATES = 15
"""The library's error states, in this order: position (m, NED), velocity (m/s, NED), attitude
(rad, in n), accelerometer bias (m/s^2), gyro bias (rad/s). States that an aiding brings along
follow them."""


class FilterState(NamedTuple):
    """The state of a filter at one instant, at the IMU: estimate, covariance and workspace; arrays
    updated in place."""

    lla: Array  # latitude rad, longitude rad, ellipsoidal height m
    v: Array  # velocity NED, m/s
    C: Array  # C_nb, body to navigation frame
    ba: Array  # accelerometer bias, m/s^2
    bg: Array  # gyro bias, rad/s
    P: Array  # error covariance (n, n)
    omega: Array  # last bias-free angular rate omega_ib_b, rad/s
    f: Array  # last bias-free specific force f_ib_b, m/s^2
    # what one architecture alone needs: its `slots`, of which the output columns are the first
    workspace: Array
    extra_states: Array  # the augmented states, error states 15 ...


class Noise(NamedTuple):
    """The noise that a filter assumes of the IMU, per axis, in root densities."""

    gyro: float  # angle random walk, rad/sqrt(s)
    accel: float  # velocity random walk, m/s/sqrt(s)
    gyro_bias: float  # driving noise of the gyro bias, rad/s/sqrt(s)
    accel_bias: float  # driving noise of the accelerometer bias, m/s^2/sqrt(s)
    gyro_decay: float  # 1/time constant of the gyro bias, 1/s; 0 is a random walk
    accel_decay: float  # 1/time constant of the accelerometer bias, 1/s
    # share of these decays that the estimates of the biases take no part in, while P does: 0 where
    # they decay like the biases themselves, 1 where they are held from fix to fix
    held: float = 0.0


BELIEF = record(
    FilterState,
    lla=reals(3),
    v=reals(3),
    C=reals(3, 3),
    ba=reals(3),
    bg=reals(3),
    P=reals("n", "n"),
    omega=reals(3),
    f=reals(3),
    workspace=reals("workspace"),
    extra_states=reals("extra_states"),
)
NOISE = record(Noise, **dict.fromkeys(Noise._fields, REAL))
