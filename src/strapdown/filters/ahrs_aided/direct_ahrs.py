"""Direct Kalman filter with the attitude of an AHRS: the 15 states themselves, Euler angles among
them, as one linear time-varying system.

The angles change by T(known attitude) times the bias-free rate, so that their model is linear; the
price is an error of its own while the body turns.
"""

import math

from ...core.compile.jit import flatten, matrix
from ...core.loop.contract import (
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
from ...core.mathematics.error_state import DV, MID, allocate
from ...core.mathematics.rotation import rotate_right
from ...typing import Array
from .known_attitude import (
    BEYOND,
    CORRELATION,
    SINCE_TILT,
    STEEP_PITCH,
    WITH_ANGLES,
    add_angles,
    correct_angles,
    euler_rates,
    fade_shared,
    gentle,
    inflate_attitude_noise,
    know,
    learn_from_fix,
    predict_fed,
    rate_of_body,
    read_angles,
    steep,
    tilt_variances,
    with_angles,
)

MIN_COSINE = math.cos(STEEP_PITCH)


def start(
    start: InitialState,
    noise: Noise,
    correlation: float = 0.0,
    attitude_error: str = "considered",
) -> FilterState:
    """The filter state at `start`. correlation: time constant (s) of the errors of the AHRS;
    attitude_error: considered or neglected in the velocity."""
    return with_angles(
        know(start.belief(allocate(WITH_ANGLES)), correlation, attitude_error), start
    )


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance P, position and velocity with the known attitude, and the Euler angles with its
    transformation of rates."""
    r0, r1, r2 = predict_fed(belief, u, dt, noise)
    r0, r1, r2 = rate_of_body(belief, r0, r1, r2)
    mid = flatten(matrix(belief.workspace, MID, 3, 3))
    cosine = math.sqrt(mid[7] * mid[7] + mid[8] * mid[8])
    if cosine > MIN_COSINE and gentle(belief, math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)):
        roll, pitch, heading = euler_rates(
            mid[7] / cosine, mid[8] / cosine, -mid[6] / cosine, cosine, r0, r1, r2
        )
        _doubt_rates(belief, pitch, heading, mid, cosine, dt)
        add_angles(belief, roll, pitch, heading)
    else:
        rotate_right(belief.C_nb, r0, r1, r2)
        read_angles(belief)
        belief.workspace[BEYOND] += dt


@helper
def _doubt_rates(
    belief: FilterState, pitch: float, heading: float, mid: Array, cosine: float, dt: float
) -> None:
    """Add to P the error of the angle rates, which are those at the known attitude, mid (9,) of
    that cosine of pitch.

    Its tilt off the estimated one, x forward and y right, counts as long as it is held: the angles
    change by `pitch` and `heading` (rad), and err by (pitch tan(pitch angle) x + heading y,
    -heading x, pitch x) forward, right and down, from differentiating T. Of independent records
    that distance is the residual of the last one, with the variance that the record has more than
    the estimate; of correlated ones it may be all of the record's.
    """
    workspace, P = belief.workspace, belief.P
    ch, sh, climb = mid[0] / cosine, mid[3] / cosine, -mid[6] / cosine * pitch
    share = 1.0 if workspace[CORRELATION] == 0 else 0.0
    a, b, c = along(ch, sh, *tilt_variances(belief.workspace))
    a0, b0, c0 = along(ch, sh, P[6, 6], P[6, 7], P[7, 7])
    a, c = max(a - share * a0, 0.0), max(c - share * c0, 0.0)
    b = max(-math.sqrt(a * c), min(b - share * b0, math.sqrt(a * c)))
    growth = (2 * max(workspace[SINCE_TILT] - dt, workspace[CORRELATION]) + dt) / dt
    forward, right, down = climb * a + heading * b, -heading * a, pitch * a  # covariances with x
    ff, fr, rr = (
        climb * forward + heading * (climb * b + heading * c),
        -heading * forward,
        -heading * right,
    )
    fd, rd = pitch * forward, -heading * down
    nn, ne, ee = along(ch, -sh, ff, fr, rr)
    for i, j, value in (
        (6, 6, nn),
        (6, 7, ne),
        (7, 7, ee),
        (6, 8, ch * fd - sh * rd),
        (7, 8, sh * fd + ch * rd),
        (8, 8, pitch * down),
    ):
        P[i, j] += growth * value
        if i != j:
            P[j, i] += growth * value


@helper
def along(c: float, s: float, xx: float, xy: float, yy: float) -> tuple[float, float, float]:
    """Covariance xx, xy, yy of two components along axes turned by the angle of cosine c and
    sine s."""
    return (
        c * c * xx + 2 * c * s * xy + s * s * yy,
        c * s * (yy - xx) + (c * c - s * s) * xy,
        s * s * xx - 2 * c * s * xy + c * c * yy,
    )


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
    """Correct P and the states. A measured attitude also is the known one from now on."""
    fade_shared(belief, source)
    inflate_attitude_noise(belief, std, kind)
    nis = correct_angles(belief, y, belief.workspace[DV], observe, source, gate, innovation)
    if nis <= gate:
        learn_from_fix(belief, y, std, kind)
    return nis


DIRECT_AHRS = Filter(
    "direct-ahrs",
    "Fossen (2021) section 14.3.2",
    start,
    predict,
    correct,
    needs=("attitude",),
    slots=WITH_ANGLES,
    diagnose=steep,
    bias=RANDOM_WALK,
    installation=True,
    good_for="an AHRS in a disturbed field, with any IMU",
    poor_for="circling aircraft: it takes over the tilt error of the AHRS",
)
