"""Missing samples: increments that stand for them, and the noise that they bring.

A gap of at most BRIDGE seconds is bridged with the last sample's rates and added noise. Over a longer
one velocity and attitude are held, and the covariance grows at the HOLD densities for MAX_HOLD
seconds at most.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from ..mathematics.belief import FilterState, Noise
from ..mathematics.mechanization import stationary_increments
from .cursor import Cursor
from .kernels import Kernels, step_at

BRIDGE = 1.0  # s
MAX_STEP = 0.1  # s: longest prediction inside a gap
BRIDGE_GYRO, BRIDGE_ACCEL = 0.05, 1.0  # rad/sqrt(s), m/s/sqrt(s): added in a bridged gap
HOLD_GYRO, HOLD_ACCEL = 0.1, 3.0  # the same in a longer one
MAX_HOLD = 300.0
"""s: how long P grows in a gap; beyond, the unstable height alone would let it explode."""


@helper
def wider(noise: Noise, gyro: float, accel: float) -> Noise:
    """The noise with so much added to its densities."""
    return Noise(
        math.hypot(noise.gyro, gyro),
        math.hypot(noise.accel, accel),
        noise.gyro_bias,
        noise.accel_bias,
        noise.gyro_decay,
        noise.accel_decay,
        noise.held,
    )


@helper
def rates_held(
    kernels: Kernels, belief: FilterState, dt: float, cursor: Cursor, long: bool, u: Array
) -> None:
    """Increments over dt at the rates of the last sample; without one, or where they are missing for
    `long`, those that hold velocity and attitude."""
    last = cursor.state[0].previous
    if last[6] > 0 and not long:
        for i in range(6):
            u[i] = last[i] * (dt / last[6])
    else:
        _motion_held(kernels, belief, dt, cursor, u)


@helper
def _motion_held(
    kernels: Kernels, belief: FilterState, step: float, cursor: Cursor, u: Array
) -> None:
    """Increments over `step` s, as the IMU would read them, that hold velocity and attitude."""
    stationary_increments(belief.lla, belief.v_n, belief.C_nb, step, u)
    for i in range(3):
        u[i] += belief.b_g[i] * step
        u[3 + i] += belief.b_a[i] * step
    if kernels.uncorrect_increments != 0:
        step_at(kernels.uncorrect_increments)(belief, u, step, cursor, u[0:0])
