"""Two-stage extended Kalman filter: attitude and gyro bias, then position, velocity in the body and
accelerometer bias with that attitude as known.

filters/two_stage/model.py has the model, docs/explanation/two-stage.md its equations; here it is linearised at
the estimate itself. Gains come of the published covariance, which has none between the stages; P is
that of the errors which they leave, filters/two_stage/joseph_covariance.py.
"""

import math

from ...core.compile.jit import inline
from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.earth import displace
from ...core.mathematics.error_state import (
    DV,
    DX,
    MID,
    allocate,
    bias_free,
    decay_biases,
    publish_rates,
)
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import (
    Three,
    euler_to_matrix,
    matrix_to_euler,
    orthonormalise,
    rotate_left,
    rotate_vector,
    wrap,
)
from ...typing import Array
from ..ahrs_aided.known_attitude import STEEP_PITCH, steep
from .corrections import FAR_VECTOR, correct_rows, gather, level_alone, note_fix_used, see, steer
from .joseph_covariance import (
    IN_JOSEPH_FORM,
    SEEN,
    SLOTS,
    after_corrections,
    after_sample,
    begin,
    foresee,
    grow_along,
    learn_installation,
    note_variances,
    of_stages,
    publish,
)
from .model import (
    BEFORE,
    BEYOND,
    CONDITION,
    CRAB_DEG,
    DEVIATION,
    ERROR,
    INNOVATION,
    MOVED,
    SLOW_OR_BANKED,
    TOLD,
    UNUSED,
    USES,
    StageOptions,
    configure,
    inflate_velocity,
    middle,
    propagate,
    set_options,
    to_angles,
    to_body,
    turn_attitude,
    turn_velocity,
)

SINE_STEEP = math.sin(STEEP_PITCH)


def start(
    start: InitialState,
    noise: Noise,
    velocity: str = "full",
    course: str = "gnss",
    level: str = "bias-free",
    min_speed: float = 0.0,
    max_bank: float = 45.0,
    crab: float = CRAB_DEG,
    correlation: float = 10.0,
    window: float = 1.0,
    acceleration: float = 0.2,
    covariance: str = "joseph",
) -> FilterState:
    """The filter state at `start`. velocity: "full", or "down", only the component along the body's
    z axis. course: "gnss", the heading comes from velocity fixes above min_speed (m/s) and below
    max_bank (deg), or "none". level: the specific force that levels stage 1, "bias-free", without
    the accelerometer bias of stage 2, or "raw", as measured.

    crab: standard deviation of the angle between course and heading, deg. correlation: time
    constant of that angle and of the attitude errors, which stage 2 treats as white noise, s.
    window: averaging time of the specific force, s; acceleration: density of the remaining
    acceleration in it, m/s^2 sqrt(s). covariance: P of the errors under the gains, in "joseph"
    form, or the "published" P, from which the gains come.
    """
    belief = start.belief(allocate(SLOTS))
    chosen = StageOptions(
        velocity,
        course,
        level,
        min_speed,
        max_bank,
        crab,
        correlation,
        window,
        acceleration,
    )
    set_options(belief, noise, chosen)
    begin(belief, covariance)
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance both stages by a sample, and P."""
    if dt > 0:
        grow_along(belief)
        advance(of_stages(belief), u, dt, noise)
        after_sample(belief, dt, noise)
        note_variances(belief)


@inline
def advance(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance both stages by a sample; where no velocity fix tells the change of v_b, correct
    stage 1 by the specific force, once a window."""
    workspace = belief.workspace
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    mid, f_n = matrix(workspace, MID, 3, 3), workspace[DX]
    middle(belief.C_nb, r[0], r[1], r[2], mid)
    gather(belief, belief, belief.b_a, u, r[0], r[1], r[2], dt, noise.accel > workspace[TOLD])
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, f_n)
    propagate(belief, mid, f_n[0], f_n[1], f_n[2], dt, noise)
    arrive(belief, r, a, dt, noise)


@inline
def arrive(belief: FilterState, r: Three, a: Three, dt: float, noise: Noise) -> None:
    """Finish a prediction, whose bias-free increments are r and a: rates, biases, and the correction
    by the specific force alone, where one is due."""
    workspace = belief.workspace
    publish_rates(belief, r, a, dt)
    decay_biases(belief.b_a, belief.b_g, dt, noise)
    if abs(belief.C_nb[2, 0]) > SINE_STEEP:
        workspace[BEYOND] += dt
    if level_alone(belief, belief, noise) > 0:
        correct_rows(
            belief.P,
            workspace,
            workspace[INNOVATION],
            workspace[DEVIATION],
            3,
            math.inf,
            FAR_VECTOR,
        )
        _inject(belief)


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
    """Correct the stage that a fix belongs to. A velocity that passes the gate corrects stage 1
    first, by its change and its course. The gate is that of P."""
    stages, workspace = of_stages(belief), belief.workspace
    grow_along(belief)
    if workspace[IN_JOSEPH_FORM] > 0:
        nis = foresee(belief, y, std, kind, observe, source, innovation)
        if nis <= gate:
            learn_installation(belief)
            correct_estimate(stages, y, std, kind, observe, source, math.inf, workspace[SEEN])
            after_corrections(belief, kind)
    else:
        nis = correct_estimate(stages, y, std, kind, observe, source, gate, innovation)
    publish(belief)
    note_variances(belief)
    return nis


@inline
def correct_estimate(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Return the NIS of a fix and correct both stages by it, linearised at the estimate."""
    P, workspace = belief.P, belief.workspace
    rows = see(belief, belief, y, std, kind, observe, source, innovation)
    nis = correct_rows(
        P,
        workspace,
        innovation,
        workspace[DV],
        rows,
        -1.0 if kind == Kind.VELOCITY else gate,
        math.inf,
    )
    if nis <= gate and kind == Kind.VELOCITY:
        steer(belief, belief, y, std, observe, source, workspace[UNUSED])
        _inject(belief)
        rows = see(belief, belief, y, std, kind, observe, source, workspace[UNUSED])
        correct_rows(P, workspace, workspace[UNUSED], workspace[DV], rows, math.inf, math.inf)
    if nis <= gate:
        _inject(belief)
        note_fix_used(workspace, kind)
    return nis


@helper
def _inject(belief: FilterState) -> None:
    """Add workspace[ERROR] to the belief, Euler angles to Euler angles and v_b to v_b, and make
    it zero."""
    x, v = belief.workspace[ERROR], belief.v_n
    displace(belief.lla, x[0], x[1], x[2])
    for i in range(3):
        v[i] += x[3 + i]
        belief.b_a[i] += x[9 + i]
        belief.b_g[i] += x[12 + i]
    if x[6] != 0 or x[7] != 0 or x[8] != 0:
        _inject_attitude(belief, x[6], x[7], x[8])
    for i in range(15):
        x[i] = 0.0


@helper
def _inject_attitude(belief: FilterState, x: float, y: float, z: float) -> None:
    """Add to the Euler angles what the small rotation (x, y, z) in n (rad) means to first order;
    near their singularity turn by it instead.

    v_b stays, so that the velocity turns along.
    """
    C, v, P, before = belief.C_nb, belief.v_n, belief.P, matrix(belief.workspace, BEFORE, 3, 3)
    for i in range(3):
        for j in range(3):
            before[i, j] = C[i, j]
    v0, v1, v2 = to_body(C, v[0], v[1], v[2])
    roll, pitch, heading = matrix_to_euler(C)
    d0, d1, d2 = to_angles(pitch, heading, x, y, z)
    if max(abs(pitch), abs(pitch + d1)) < STEEP_PITCH:
        euler_to_matrix(wrap(roll + d0), pitch + d1, wrap(heading + d2), C)
        turn_attitude(P, pitch, heading, pitch + d1, heading + d2)
    else:
        rotate_left(x, y, z, C)
        orthonormalise(C)
    turn_velocity(P, before, C)
    v0, v1, v2 = rotate_vector(C, v0, v1, v2)
    moved = belief.workspace[MOVED]
    moved[0], moved[1], moved[2] = v0 - v[0], v1 - v[1], v2 - v[2]
    inflate_velocity(P, moved)
    v[0], v[1], v[2] = v0, v1, v2


TWO_STAGE_EKF = Filter(
    "two-stage-ekf",
    "Alam, Whidborne & Millidere (2023) section 2.2, corrected; Rohac et al. (2017)",
    start,
    predict,
    correct,
    slots=SLOTS,
    uses=USES,
    configure=configure,
    diagnose=steep,
    conditions=(SLOW_OR_BANKED,),
    condition=CONDITION,
    installation=True,
    bias=DECAYING,
    good_for="the comparison of Alam et al.; heading from the course",
    poor_for="outages: it drifts twice as far as closed-loop",
)
