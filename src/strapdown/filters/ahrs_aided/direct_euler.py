"""Direct extended Kalman filter whose attitude states are Euler angles: they are integrated as
such, and corrected by adding to them.

P is kept in the library's error states: that of the angles follows from it by their Jacobian, and
its prediction is the same to first order.
"""

import math

from ...core.loop.contract import (
    ATT,
    CORRECT,
    PREDICT,
    RANDOM_WALK,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceRow,
    helper,
    kernel,
)
from ...core.mathematics.error_state import (
    DX,
    HEIGHT,
    allocate,
    bias_free,
    linearised_step,
    turn_half,
)
from ...core.mathematics.mechanization import mechanize
from ...typing import Array
from .known_attitude import (
    ANGLES,
    BEYOND,
    WITH_ANGLES,
    add_angles,
    correct_angles,
    euler_rates,
    gentle,
    rate_of_body,
    read_angles,
    steep,
    with_angles,
)


def start(start: InitialState, noise: Noise) -> FilterState:
    """The filter state at `start`."""
    return with_angles(start.belief(allocate(WITH_ANGLES)), start)


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P and position, velocity and Euler angles with bias-corrected increments."""
    workspace = belief.workspace
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    linearised_step(belief, belief.C_nb, 1.0, u, dt, noise, False)
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, workspace[DX], workspace[HEIGHT])
    r0, r1, r2 = rate_of_body(belief, r[0], r[1], r[2])
    if gentle(belief, math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)):
        integrate_angles(belief, r0, r1, r2)
    else:
        read_angles(belief)
        workspace[BEYOND] += dt


@helper
def integrate_angles(belief: FilterState, r0: float, r1: float, r2: float) -> None:
    """Advance the Euler angles while the body turns by r (rad) at a constant rate: Runge-Kutta
    of fourth order."""
    angles = belief.workspace[ANGLES]
    d0 = d1 = d2 = x = y = 0.0
    for weight, share in ((1 / 6, 0.5), (1 / 3, 0.5), (1 / 3, 1.0), (1 / 6, 0.0)):
        roll, pitch = angles[0] + x, angles[1] + y
        cosine = math.cos(pitch)
        k0, k1, k2 = euler_rates(
            math.sin(roll), math.cos(roll), math.sin(pitch) / cosine, cosine, r0, r1, r2
        )
        d0, d1, d2 = d0 + weight * k0, d1 + weight * k1, d2 + weight * k2
        x, y = share * k0, share * k1
    add_angles(belief, d0, d1, d2)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and the states; P is turned by half of the correction, as in a closed loop."""
    nis = correct_angles(belief, y, std, observe, source, gate, innovation)
    if nis <= gate:
        theta = belief.workspace[DX][ATT]
        turn_half(belief.P, theta[0], theta[1], theta[2])
    return nis


DIRECT_EULER = Filter(
    "direct-euler",
    "Fossen (2021) section 14.3.3",
    start,
    predict,
    correct,
    slots=WITH_ANGLES,
    diagnose=steep,
    bias=RANDOM_WALK,
    installation=True,
    good_for="an AHRS as a source among others; consumer IMUs",
    poor_for="pitch near +-90 deg; otherwise similar to closed-loop",
)
