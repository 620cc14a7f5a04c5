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
(rad, in n), accelerometer bias (m/s^2), gyro bias (rad/s). States that a source brings along
follow them."""


class FilterState(NamedTuple):
    """The state of a filter at one instant, at the IMU: estimate, covariance and workspace; arrays
    updated in place.

    Attributes
    ----------
    lla : array
        Latitude rad, longitude rad, ellipsoidal height m.
    v_n : array
        Velocity NED, m/s.
    C_nb : array
        Rotation matrix, body to navigation frame.
    b_a : array
        Accelerometer bias, m/s^2.
    b_g : array
        Gyro bias, rad/s.
    P : array
        Error covariance (n, n).
    omega : array
        Last bias-free angular rate omega_ib_b, rad/s.
    f : array
        Last bias-free specific force f_ib_b, m/s^2.
    workspace : array
        Data that one architecture alone needs: its `slots`, beginning with the output columns.
    augmented : array
        The augmented states, error states 15.
    """

    lla: Array
    v_n: Array
    C_nb: Array
    b_a: Array
    b_g: Array
    P: Array
    omega: Array
    f: Array
    workspace: Array
    augmented: Array


class Noise(NamedTuple):
    """The noise that a filter assumes of the IMU, per axis, in root densities.

    Attributes
    ----------
    gyro : float
        Angle random walk, rad/sqrt(s).
    accel : float
        Velocity random walk, m/s/sqrt(s).
    gyro_bias : float
        Driving noise of the gyro bias, rad/s/sqrt(s).
    accel_bias : float
        Driving noise of the accelerometer bias, m/s^2/sqrt(s).
    gyro_decay : float
        1/time constant of the gyro bias, 1/s; 0 is a random walk.
    accel_decay : float
        1/time constant of the accelerometer bias, 1/s.
    held : float
        Share of these decays that P has but the bias estimates do not: 0 if the estimates decay
        like the biases, 1 if they are held from fix to fix.
    """

    gyro: float
    accel: float
    gyro_bias: float
    accel_bias: float
    gyro_decay: float
    accel_decay: float
    held: float = 0.0


BELIEF = record(
    FilterState,
    lla=reals(3),
    v_n=reals(3),
    C_nb=reals(3, 3),
    b_a=reals(3),
    b_g=reals(3),
    P=reals("n", "n"),
    omega=reals(3),
    f=reals(3),
    workspace=reals("workspace"),
    augmented=reals("augmented"),
)
NOISE = record(Noise, **dict.fromkeys(Noise._fields, REAL))
