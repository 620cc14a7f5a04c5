"""Exogenous Kalman filter of the two-stage model: the affine Kalman filter around the trajectory of
a nonlinear observer.

filters/two_stage/model.py has the model, filters/observer/equations.py the observer,
docs/explanation/two-stage.md what their cascade is. The observer runs by itself, as in `nlo`. Between fixes
estimate = f(observer) + F (estimate - observer), F and f at the observer; at a fix the innovation
is y - h(observer) - H (estimate - observer). Wherever the observer moves otherwise, by its
injections, jumps and bounds, the estimate stays: Euler angles, velocity in the body and biases as
they are.
"""

import math
from collections.abc import Sequence
from typing import Any

from ...checks import check_choice
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
    Slots,
    SourceLike,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.earth import displace, place
from ...core.mathematics.embedded import NAVIGATION, copy_motion, navigation
from ...core.mathematics.error_state import DV, DX, MID, allocate, bias_free, decay_biases
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import (
    Three,
    euler_to_matrix,
    matrix_to_euler,
    rotate_left,
    rotate_vector,
    wrap,
)
from ...typing import Array
from ..ahrs_aided.known_attitude import STEEP_PITCH, steep
from ..observer.equations import (
    EMBEDDED,
    EXCITATION,
    OBSERVER,
    XI,
    advance,
    embedded_observer,
    inject,
)
from ..observer.gains import DEFAULTS, configure as configure_observer, implant, takes_options
from ..observer.repeated_fix import FORGOTTEN, KIND, MEMORY, is_repeated
from .corrections import FAR_VECTOR, correct_rows, gather, level_alone, note_fix_used, see, steer
from .joseph_covariance import (
    IN_JOSEPH_FORM,
    SEEN,
    SHIFT as KNOWN_SHIFT,
    SLOTS as COVARIANCE,
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
    BEYOND,
    CONDITION,
    CRAB_DEG,
    DEVIATION,
    ERROR,
    INNOVATION,
    MOVED,
    OWN_ATTITUDE,
    SLOW_OR_BANKED,
    TOLD,
    UNUSED,
    USES,
    StageOptions,
    configure as configure_model,
    from_angles,
    inflate_velocity,
    middle,
    propagate,
    set_options,
    to_angles,
    to_body,
    turn_attitude,
    turn_velocity,
)

SLOTS = Slots(after=COVARIANCE)
# estimate - observer
SHIFT = SLOTS.outputs(
    "observer_error_north [m]", "observer_error_east [m]", "observer_error_down [m]"
)
# what the observer says of itself
SAID = SLOTS.output(OBSERVER.columns[EXCITATION])
SAID_XI = SLOTS.outputs(*OBSERVER.columns[XI])
LEFT = SLOTS.part("LEFT", NAVIGATION)  # the state that the observer leaves
ANGLES = SLOTS.array("ANGLES", 3)  # its Euler angles, rad
RECENT = SLOTS.part("RECENT", MEMORY)
INSIDE = SLOTS.part("INSIDE", EMBEDDED)  # the observer
ATTITUDES = {"observer": 0.0, "stage-1": 1.0}
SINE_STEEP = math.sin(STEEP_PITCH)


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    velocity: str = "full",
    level: str = "bias-free",
    max_bank: float = 45.0,
    crab: float = CRAB_DEG,
    correlation: float = 10.0,
    window: float = 1.0,
    acceleration: float = 0.2,
    attitude: str = "observer",
    covariance: str = "joseph",
    **observer: Any,
) -> FilterState:
    """The filter state at `start`, where the observer begins too. attitude: the attitude that stage
    2 uses, that of the "observer" or of "stage-1" of this filter. The other options named here are
    those of `two-stage-ekf`, the rest those of `nlo`.

    `course` and `min_speed` count for both; any `course` but "none" is one for the two-stage
    model.
    """
    check_choice(attitude, "attitude", ATTITUDES)
    belief = start.belief(allocate(SLOTS))
    belief.workspace[OWN_ATTITUDE] = ATTITUDES[attitude]
    belief.workspace[RECENT][KIND], belief.workspace[ANGLES] = FORGOTTEN, start.rph
    implant(belief.workspace[INSIDE], start, noise, **observer)
    own = (velocity, level, max_bank, crab, correlation, window, acceleration)
    set_both(belief, noise, own, observer)
    begin(belief, covariance, attitude == "stage-1")
    return belief


def set_both(
    belief: FilterState,
    noise: Noise,
    own: tuple[str, str, float, float, float, float, float],
    observer: dict[str, Any],
) -> None:
    """Put the options of the model into workspace: its own, of StageOptions without `course` and
    `min_speed`, and those that count for the observer too."""
    velocity, level, *numbers = own
    both = {**DEFAULTS, **observer}
    course = "none" if both["course"] == "none" else "gnss"
    chosen = StageOptions(velocity, course, level, both["min_speed"], *numbers)
    set_options(belief, noise, chosen)


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """Return the options with the observer's gains for these sources, and the notes of both;
    refuses sources that either cannot use."""
    _, notes = configure_model(options, sources)
    options, said = configure_observer(options, sources)
    return options, [*notes, *said]


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Carry P and the estimate on, linearised at the observer, then the observer."""
    if dt > 0:
        bar, stages = embedded_observer(belief, INSIDE.start), of_stages(belief)
        grow_along(belief)
        carry(stages, bar, u, dt, noise)
        advance(bar, u, dt, noise)
        arrive(stages, bar, dt, noise)
        after_sample(belief, dt, noise)
        note_variances(belief)
        belief.workspace[RECENT][KIND] = FORGOTTEN


@inline
def carry(belief: FilterState, bar: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """P and workspace[ERROR] over dt, and the observer's state at LEFT by the model, without
    injections; the observer is left where it is."""
    workspace = belief.workspace
    r, a = bias_free(u, bar.b_a, bar.b_g, dt)
    mid, f_n = matrix(workspace, MID, 3, 3), workspace[DX]
    middle(bar.C_nb, r[0], r[1], r[2], mid)
    # around the observer all is linearised there; an attitude of its own is levelled by its own bias
    levelling = bar.b_a if workspace[OWN_ATTITUDE] == 0 else belief.b_a
    gather(belief, bar, levelling, u, r[0], r[1], r[2], dt, noise.accel > workspace[TOLD])
    leave(belief, bar)
    left = navigation(workspace[LEFT], belief.P, workspace, belief.augmented)
    mechanize(
        left.lla,
        left.v_n,
        left.C_nb,
        r,
        a,
        dt,
        f_n,
    )
    decay_biases(left.b_a, left.b_g, dt, noise)
    _note_shift(workspace, (f_n[0], f_n[1], f_n[2]))
    propagate(belief, mid, f_n[0], f_n[1], f_n[2], dt, noise)


@helper
def _note_shift(workspace: Array, f: Three) -> None:
    """The velocity goes on with the observer's attitude, not the estimate's: for the covariance; f,
    the velocity increment (m/s, n)."""
    x, shift = workspace[ERROR], workspace[KNOWN_SHIFT]
    if workspace[OWN_ATTITUDE] == 0:
        shift[0] += x[7] * f[2] - x[8] * f[1]
        shift[1] += x[8] * f[0] - x[6] * f[2]
        shift[2] += x[6] * f[1] - x[7] * f[0]


@inline
def arrive(belief: FilterState, bar: FilterState, dt: float, noise: Noise) -> None:
    """After the observer has moved: the estimate relative to it; the correction by the specific
    force alone, where one is due."""
    relate(belief, bar)
    if abs(bar.C_nb[2, 0]) > SINE_STEEP:
        belief.workspace[BEYOND] += dt
    x = belief.workspace[ERROR]
    before = (x[6], x[7], x[8])
    if level_alone(belief, bar, noise) > 0:
        correct_rows(
            belief.P,
            belief.workspace,
            belief.workspace[INNOVATION],
            belief.workspace[DEVIATION],
            3,
            math.inf,
            FAR_VECTOR,
        )
        swing(belief, bar, before)
    compose(belief, bar)


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
    """Correct P and the estimate around the observer, then let that take the fix, whatever the
    gate. The gate is that of P."""
    workspace, bar = belief.workspace, embedded_observer(belief, INSIDE.start)
    stages = of_stages(belief)
    grow_along(belief)
    if workspace[IN_JOSEPH_FORM] > 0:
        nis = foresee(belief, y, std, kind, observe, source, innovation)
        if nis <= gate:
            learn_installation(belief)
            correct_around(stages, bar, y, std, kind, observe, source, math.inf, workspace[SEEN])
            after_corrections(belief, kind)
    else:
        nis = correct_around(stages, bar, y, std, kind, observe, source, gate, innovation)
    if (
        kind == Kind.POSITION
        or kind == Kind.VELOCITY
        or kind == Kind.ALTITUDE
        or kind == Kind.HEADING
        or kind == Kind.MAGNETIC_FIELD
    ):
        if not is_repeated(workspace[RECENT], y, kind, gate, nis):
            leave(belief, bar)
            inject(bar, y, std, kind, observe, source, workspace[UNUSED])
            relate(stages, bar)
    compose(belief, bar)
    publish(belief)
    note_variances(belief)
    return nis


@inline
def correct_around(
    belief: FilterState,
    bar: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P and workspace[ERROR] by one fix in its stage, linearised at the observer. A
    velocity corrects stage 1 first. Returns the NIS."""
    P, workspace, x = belief.P, belief.workspace, belief.workspace[ERROR]
    before = (x[6], x[7], x[8])
    inflate_velocity(P, workspace[MOVED])
    rows = see(belief, bar, y, std, kind, observe, source, innovation)
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
        steer(belief, bar, y, std, observe, source, workspace[UNUSED])
        swing(belief, bar, before)
        before = (x[6], x[7], x[8])
        rows = see(belief, bar, y, std, kind, observe, source, workspace[UNUSED])
        correct_rows(P, workspace, workspace[UNUSED], workspace[DV], rows, math.inf, math.inf)
    if nis <= gate:
        note_fix_used(workspace, kind)
        swing(belief, bar, before)
    return nis


@inline
def swing(belief: FilterState, bar: FilterState, before: tuple[float, float, float]) -> None:
    """Where the known attitude is that of stage 1, the velocity turns with what that was corrected
    by since `before`, velocity in the body staying."""
    workspace, x, v = belief.workspace, belief.workspace[ERROR], bar.v_n
    d0, d1, d2 = x[6] - before[0], x[7] - before[1], x[8] - before[2]
    if workspace[OWN_ATTITUDE] == 0 or d0 == 0 and d1 == 0 and d2 == 0:
        return
    moved, v0, v1, v2 = workspace[MOVED], v[0] + x[3], v[1] + x[4], v[2] + x[5]
    c0, c1, c2 = d1 * v2 - d2 * v1, d2 * v0 - d0 * v2, d0 * v1 - d1 * v0
    x[3], x[4], x[5] = x[3] + c0, x[4] + c1, x[5] + c2
    moved[0], moved[1], moved[2] = moved[0] + c0, moved[1] + c1, moved[2] + c2


@inline
def leave(belief: FilterState, bar: FilterState) -> None:
    """Keep the observer's state before it moves."""
    left = navigation(belief.workspace[LEFT], belief.P, belief.workspace, belief.augmented)
    copy_motion(left, bar)


@inline
def relate(belief: FilterState, bar: FilterState) -> None:
    """workspace[ERROR] and P are from now on those at the observer instead of those at LEFT:
    Euler angles, v_b and biases of the estimate stay."""
    workspace, x, lla = belief.workspace, belief.workspace[ERROR], bar.lla
    left = navigation(workspace[LEFT], belief.P, workspace, belief.augmented)
    _, cosine, M, N = place(lla[0], lla[2])
    x[0] += (left.lla[0] - lla[0]) * M
    x[1] += wrap(left.lla[1] - lla[1]) * N * cosine
    x[2] += lla[2] - left.lla[2]
    _relate_turned(
        belief.P,
        x,
        workspace[MOVED],
        workspace[KNOWN_SHIFT],
        workspace[ANGLES],
        left.v_n,
        left.C_nb,
        bar.v_n,
        bar.C_nb,
        workspace[OWN_ATTITUDE] > 0,
    )
    for i in range(3):
        x[9 + i] += left.b_a[i] - bar.b_a[i]
        x[12 + i] += left.b_g[i] - bar.b_g[i]


@helper
def _relate_turned(
    P: Array,
    x: Array,
    moved: Array,
    shift: Array,
    angles: Array,
    v: Array,
    before: Array,
    new_v: Array,
    C: Array,
    own: bool,
) -> None:
    """`relate` of velocity and attitude. The velocity in the body is that in the known attitude:
    where it is the `own` one, no turn of the observer moves the velocity over ground."""
    v0, v1, v2 = v[0] + x[3], v[1] + x[4], v[2] + x[5]
    n0, n1, n2 = v0, v1, v2
    if not own:
        n0, n1, n2 = rotate_vector(C, *to_body(before, v0, v1, v2))
        turn_velocity(P, before, C)
    moved[0], moved[1], moved[2] = moved[0] + n0 - v0, moved[1] + n1 - v1, moved[2] + n2 - v2
    shift[0], shift[1], shift[2] = shift[0] - n0 + v0, shift[1] - n1 + v1, shift[2] - n2 + v2
    x[3], x[4], x[5] = n0 - new_v[0], n1 - new_v[1], n2 - new_v[2]
    roll, pitch, heading = matrix_to_euler(before)
    new_roll, new_pitch, new_heading = matrix_to_euler(C)
    angles[0], angles[1], angles[2] = new_roll, new_pitch, new_heading
    d0, d1, d2 = to_angles(pitch, heading, x[6], x[7], x[8])
    x[6], x[7], x[8] = from_angles(
        new_pitch,
        new_heading,
        d0 + wrap(roll - new_roll),
        d1 + pitch - new_pitch,
        d2 + wrap(heading - new_heading),
    )
    turn_attitude(P, pitch, heading, new_pitch, new_heading)


@inline
def compose(belief: FilterState, bar: FilterState) -> None:
    """The belief is the observer and workspace[ERROR] together; near the singularity of the
    Euler angles by a rotation."""
    workspace, x, C = belief.workspace, belief.workspace[ERROR], belief.C_nb
    shift, angles, xi, said = (
        workspace[SHIFT],
        workspace[ANGLES],
        bar.workspace[XI],
        workspace[SAID_XI],
    )
    for i in range(3):
        belief.lla[i], belief.v_n[i], belief.b_a[i], belief.b_g[i] = (
            bar.lla[i],
            bar.v_n[i] + x[3 + i],
            bar.b_a[i] + x[9 + i],
            bar.b_g[i] + x[12 + i],
        )
        belief.omega[i], belief.f[i] = bar.omega[i] - x[12 + i], bar.f[i] - x[9 + i]
        shift[i], said[i] = x[i], xi[i]
    workspace[SAID] = bar.workspace[EXCITATION]
    displace(belief.lla, x[0], x[1], x[2])
    roll, pitch, heading = angles[0], angles[1], angles[2]
    d0, d1, d2 = to_angles(pitch, heading, x[6], x[7], x[8])
    if abs(pitch) < STEEP_PITCH:
        euler_to_matrix(roll + d0, pitch + d1, heading + d2, C)
    else:
        for i in range(3):
            for j in range(3):
                C[i, j] = bar.C_nb[i, j]
        rotate_left(x[6], x[7], x[8], C)


XKF_TWO_STAGE = Filter(
    "xkf-two-stage",
    "Alam, Whidborne & Millidere (2023) section 2.3; Johansen & Fossen (2017), IJC 90(2)",
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
    good_for="large initial errors, with the two-stage model",
    poor_for="straight legs and ships: it is overconfident there",
)
