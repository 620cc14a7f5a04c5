"""The exogenous Kalman filter of Alam et al. by the letter of section 2.3: the two-stage EKF whose
transition matrix is taken at the estimate of the nonlinear observer.

    mean            x <- f(x),  x <- x + K (y - h(x))                 that of `two-stage-ekf`
    covariance      P <- F(xbar) P F(xbar)' + Q,  K by H(x)           xbar: the observer, as in
    `nlo`

F is that of the model's own coordinates, Euler angles and velocity in the body. The library's
`xkf-two-stage` is the affine filter of Johansen & Fossen (2017), which the section refers to: its
mean is propagated by f(xbar) + F(xbar) (x - xbar). Nothing pulls the estimate of this filter back
to the observer.
"""

from typing import Any

from strapdown.core.compile.jit import helper, inline, matrix
from strapdown.core.loop.contract import (
    CORRECT,
    DECAYING,
    PREDICT,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    SourceRow,
    kernel,
)
from strapdown.core.mathematics.embedded import NAVIGATION, copy_motion, navigation
from strapdown.core.mathematics.error_state import DX, MID, bias_free
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.core.mathematics.rotation import matrix_to_euler
from strapdown.filters.ahrs_aided.known_attitude import steep
from strapdown.filters.observer.equations import EMBEDDED, advance, embedded_observer, inject
from strapdown.filters.observer.gains import implant, takes_options
from strapdown.filters.observer.repeated_fix import FORGOTTEN, KIND, MEMORY, is_repeated
from strapdown.filters.two_stage import two_stage_ekf, xkf_two_stage
from strapdown.filters.two_stage.corrections import gather
from strapdown.filters.two_stage.model import (
    CONDITION,
    SLOW_OR_BANKED,
    TOLD,
    TWO_STAGE,
    UNUSED,
    USES,
    middle,
    propagate,
    turn_attitude,
    turn_velocity,
)
from strapdown.registration import register
from strapdown.typing import Array

SLOTS = Slots(after=TWO_STAGE)
LEFT = SLOTS.part("LEFT", NAVIGATION)  # the observer a sample later, without its injections
RECENT = SLOTS.part("RECENT", MEMORY)
INSIDE = SLOTS.part("INSIDE", EMBEDDED)  # the observer


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    velocity: str = "full",
    level: str = "bias-free",
    max_bank: float = 45.0,
    crab: float = 5.0,
    correlation: float = 10.0,
    window: float = 1.0,
    acceleration: float = 0.2,
    **observer: Any,
) -> FilterState:
    """The filter state at `start`, where the observer begins too. The options named here are those
    of `two-stage-ekf`, the rest those of `nlo`."""
    belief = start.belief(SLOTS.zeros())
    belief.workspace[RECENT][KIND] = FORGOTTEN
    implant(belief.workspace[INSIDE], start, noise, **observer)
    own = (velocity, level, max_bank, crab, correlation, window, acceleration)
    xkf_two_stage.set_both(belief, noise, own, observer)
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Advance both stages by a sample at the estimate, P by the transition at the observer, then
    the observer."""
    if dt <= 0:
        return
    workspace, bar = belief.workspace, embedded_observer(belief, INSIDE.start)
    r, a = bias_free(u, belief.b_a, belief.b_g, dt)
    gather(belief, belief, belief.b_a, u, r[0], r[1], r[2], dt, noise.accel > workspace[TOLD])
    express(belief.P, belief.C_nb, bar.C_nb)
    left = _transit(belief, bar, u, dt, noise)
    mechanize(belief.lla, belief.v_n, belief.C_nb, r, a, dt, workspace[DX])
    express(belief.P, left.C_nb, belief.C_nb)
    two_stage_ekf.arrive(belief, r, a, dt, noise)
    advance(bar, u, dt, noise)
    workspace[RECENT][KIND] = FORGOTTEN


@inline
def _transit(
    belief: FilterState, bar: FilterState, u: Array, dt: float, noise: Noise
) -> FilterState:
    """P over dt by F at the observer. Returns where the model takes that."""
    workspace = belief.workspace
    mid, f_n = matrix(workspace, MID, 3, 3), workspace[DX]
    left = navigation(workspace[LEFT], belief.P, workspace, belief.augmented)
    copy_motion(left, bar)
    r, a = bias_free(u, bar.b_a, bar.b_g, dt)
    middle(bar.C_nb, r[0], r[1], r[2], mid)
    mechanize(left.lla, left.v_n, left.C_nb, r, a, dt, f_n)
    propagate(belief, mid, f_n[0], f_n[1], f_n[2], dt, noise)
    return left


@helper
def express(P: Array, before: Array, C: Array) -> None:
    """P of the errors of Euler angles and velocity in the body, in the library's coordinates at the
    attitude C instead of `before`."""
    _, pitch, heading = matrix_to_euler(before)
    _, new_pitch, new_heading = matrix_to_euler(C)
    turn_attitude(P, pitch, heading, new_pitch, new_heading)
    turn_velocity(P, before, C)


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
    """Correct as `two-stage-ekf` does, then apply the fix to the observer, whatever the gate
    decides."""
    workspace, bar = belief.workspace, embedded_observer(belief, INSIDE.start)
    nis = two_stage_ekf.correct_estimate(belief, y, std, kind, observe, source, gate, innovation)
    if (
        kind == Kind.POSITION
        or kind == Kind.VELOCITY
        or kind == Kind.ALTITUDE
        or kind == Kind.HEADING
        or kind == Kind.MAGNETIC_FIELD
    ):
        if not is_repeated(workspace[RECENT], y, kind, gate, nis):
            inject(bar, y, std, kind, observe, source, workspace[UNUSED])
    return nis


XKF_AS_PRINTED = Filter(
    "xkf-two-stage-as-printed",
    "Alam, Whidborne & Millidere (2023) section 2.3, by its letter",
    start,
    predict,
    correct,
    slots=SLOTS,
    uses=USES,
    configure=xkf_two_stage.configure,
    diagnose=steep,
    conditions=(SLOW_OR_BANKED,),
    condition=CONDITION,
    bias=DECAYING,
)


def make_known() -> None:
    """Register it, so that studies, comparisons and `fuse` find it by its name."""
    register(XKF_AS_PRINTED)
