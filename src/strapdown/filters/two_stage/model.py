"""The two-stage model: Euler angles and gyro bias first, then position, velocity in the body and
accelerometer bias with that attitude as known.

Stage 1 is driven by the gyros and corrected by the direction of gravity, the course of a velocity
fix, a heading or a magnetic field. Stage 2 is driven by f - b_a - omega x v_b + C_bn [0 0 g] and
corrected by what measures position or velocity. Source: Alam, Whidborne & Millidere (2023),
equations (4)-(10) as corrected in docs/explanation/two-stage.md; Rohac et al. (2017).

The model is linearised at `bar`, which holds lla, v, C, b_a, b_g and omega as a FilterState does: the
estimate itself, or one that comes from elsewhere. The estimate less `bar` is kept in
workspace[ERROR]. That and P are in the library's coordinates, which with the Jacobian J of the
Euler angles (n x d C = J d Theta) and C are those of the model: F of the Euler angles is J^-1 F J,
velocity in the body is C' times that in n. So what `bar` moves at other than by its own motion must
be told to `turn_attitude` and `turn_velocity`. P has no covariance between the stages.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

from ...checks import check_choice, check_number
from ...core.compile.jit import helper, inline
from ...core.loop.contract import STATES, Condition, FilterState, Noise, Slots, SourceLike
from ...core.loop.stages.disturbed_field import KNOWN_HEADING
from ...core.mathematics.error_state import ERROR_STATE
from ...core.mathematics.kalman import decay, of_estimates
from ...core.mathematics.rotation import rotate_vector
from ...typing import Array
from ..ahrs_aided.known_attitude import BEYOND_COLUMN
from ..attitude import attitude_error_state

HELD_COLUMN = "course_held [s]"
TWO_STAGE = Slots(after=ERROR_STATE)
"""Slots of every filter of this model."""
# the estimate less `bar`; zero where it is injected at once
ERROR = TWO_STAGE.array("ERROR", STATES)
# means since the window began, m/s^2; its s
FORCE = TWO_STAGE.array("FORCE", 3)
CENTRIFUGAL = TWO_STAGE.array("CENTRIFUGAL", 3)
SECONDS = TWO_STAGE.number("SECONDS")
# of the velocity fix (at the IMU, n) that the window began with; 1 where it did
VELOCITY_THEN = TWO_STAGE.array("VELOCITY_THEN", 3)
KNOWN = TWO_STAGE.number("KNOWN")
# s since the last velocity fix, and since the last heading or magnetic field
SINCE_VELOCITY, SINCE_HEADING = TWO_STAGE.numbers("SINCE_VELOCITY", "SINCE_HEADING")
# options as numbers: whether only the downward component of v_b is measured, whether the course is
DOWN, COURSE = TWO_STAGE.numbers("DOWN", "COURSE")
MIN_SPEED = TWO_STAGE.number("MIN_SPEED")  # of a course, m/s; 0: as its std says
SLOW = TWO_STAGE.number("SLOW")  # s in a row of velocities without a course
CONDITION = TWO_STAGE.number("CONDITION")  # 1: SLOW for long
MAX_BANK = TWO_STAGE.number("MAX_BANK")  # rad
CRAB = TWO_STAGE.number("CRAB")  # its std, rad
CORRELATION = TWO_STAGE.number("CORRELATION")  # s for which it and attitude errors are alike
WINDOW = TWO_STAGE.number("WINDOW")  # s
ACCELERATION = TWO_STAGE.number("ACCELERATION")  # density of unknown accelerations, m^2/s^3
TOLD = TWO_STAGE.number("TOLD")  # accelerometer noise while there are samples
# 1: the attitude that stage 2 has as known is that of stage 1, where `bar` has another
OWN_ATTITUDE = TWO_STAGE.number("OWN_ATTITUDE")
RAW = TWO_STAGE.number("RAW")  # whether the accelerometer bias stays in the force that levels
BEFORE = TWO_STAGE.matrix("BEFORE", 3, 3)  # an attitude that is left
# of the rows that stage 1 makes itself
INNOVATION = TWO_STAGE.array("INNOVATION", 3)
DEVIATION = TWO_STAGE.array("DEVIATION", 3)
UNUSED = TWO_STAGE.array("UNUSED", 3)  # innovation that is discarded
MOVED = TWO_STAGE.array("MOVED", 3)  # change of v, see `inflate_velocity`
# K (15, 3) of the last correction by a fix, by gravity and by a course (its first column)
FIX_GAIN = TWO_STAGE.matrix("FIX_GAIN", STATES, 3)
LEVEL_GAIN = TWO_STAGE.matrix("LEVEL_GAIN", STATES, 3)
COURSE_GAIN = TWO_STAGE.matrix("COURSE_GAIN", STATES, 3)
INVERSE = TWO_STAGE.matrix("INVERSE", 3, 3)  # L^-1 of a correction
LEVEL_SECONDS = TWO_STAGE.number("LEVEL_SECONDS")  # its window; negative: without velocity fixes
# gravity vectors, and courses, in a row that were far off
FAR_VECTORS, FAR_COURSES = TWO_STAGE.numbers("FAR_VECTORS", "FAR_COURSES")
BEYOND = TWO_STAGE.output(BEYOND_COLUMN)  # with the pitch there
HELD = TWO_STAGE.output(HELD_COLUMN)  # with velocity fixes but without a course
MIN_COSINE = math.cos(math.radians(85.0))
"""Least cosine of the pitch in Jacobians: beyond 85 deg roll and heading are not separate."""
TRUSTED = 5.0
"""s after a heading or magnetic field during which the course is left alone."""
MAX_WITHOUT_VELOCITY = 3.0
"""s without a velocity fix after which the specific force is taken for gravity but for the
anti-centrifugal acceleration."""


USES = (
    "position",
    "velocity",
    "altitude",
    "heading",
    "magnetic-field",
    "speed",
    "zero-lateral-velocity",
    "zero-vertical-velocity",
    "zero-velocity",
)
"""Kinds of measurement; heading and magnetic field belong to stage 1, the others to stage 2."""
Columns: TypeAlias = tuple[
    tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]
]
"""The three columns of a matrix (3, 3)."""
SLOW_OR_BANKED = Condition(
    "too slow or banked for a course: the gyros alone carry the heading, ever less certain; a heading "
    "or a magnetic field would hold it",
    doubtful=False,
)
CRAB_DEG = 5.0
"""Standard deviation of the angle between course and heading where none is given, deg."""
NO_HEADING = "nothing measures the heading: it drifts with the gyro bias"


class StageOptions(NamedTuple):
    """Options of the filters of this model; `start` of `two-stage-ekf` explains them."""

    velocity: str  # "full" or "down"
    course: str  # "gnss" or "none"
    level: str  # "bias-free" or "raw"
    min_speed: float  # m/s
    max_bank: float  # deg
    crab: float  # deg
    correlation: float  # s
    window: float  # s
    acceleration: float  # m/s^2 sqrt(s)


def set_options(belief: FilterState, noise: Noise, options: StageOptions) -> None:
    """Put the options into workspace. Raises ValueError naming a bad one."""
    for name, known in (
        ("velocity", ("full", "down")),
        ("course", ("gnss", "none")),
        ("level", ("bias-free", "raw")),
    ):
        check_choice(getattr(options, name), name, known)
    for name, unit in (
        ("min_speed", "m/s"),
        ("crab", "deg"),
        ("correlation", "s"),
        ("acceleration", "m/s^2 sqrt(s)"),
    ):
        check_number(getattr(options, name), name, unit, least=0)
    check_number(options.window, "window", "s", above=0, below=MAX_WITHOUT_VELOCITY)
    check_number(options.max_bank, "max_bank", "deg", above=0, most=90)
    workspace = belief.workspace
    workspace[DOWN], workspace[COURSE], workspace[MIN_SPEED], workspace[MAX_BANK] = (
        options.velocity == "down",
        options.course == "gnss",
        options.min_speed,
        math.radians(options.max_bank),
    )
    workspace[CRAB], workspace[CORRELATION], workspace[WINDOW], workspace[ACCELERATION] = (
        math.radians(options.crab),
        options.correlation,
        options.window,
        options.acceleration**2,
    )
    workspace[TOLD], workspace[SINCE_VELOCITY], workspace[SINCE_HEADING], workspace[RAW] = (
        noise.accel,
        MAX_WITHOUT_VELOCITY,
        TRUSTED,
        options.level == "raw",
    )


def configure(
    options: dict[str, Any], sources: Sequence[SourceLike]
) -> tuple[dict[str, Any], list[str]]:
    """(options, notes) for Filter.configure. Raises ValueError where nothing gives a heading."""
    kinds = {a.kind for a in sources}
    _check_iron(options, sources)
    better = kinds & {"heading", "magnetic-field"}
    if better or options.get("course") != "none" and "velocity" in kinds:
        return options, []
    if options.get("course") != "none":
        raise ValueError(
            "nothing gives a heading: add velocity, heading or magnetic-field aiding (course='none' "
            "runs without)"
        )
    return options, [NO_HEADING]


def _check_iron(options: dict[str, Any], sources: Sequence[SourceLike]) -> None:
    """Raise ValueError where a hard iron would wait for ever, because a course alone tells the heading and is
    said to be further off it."""
    crab, most = options.get("crab", CRAB_DEG), math.degrees(KNOWN_HEADING)
    if crab < most or any(a.kind == "heading" for a in sources):
        return
    for a in sources:
        if "hard-iron" in a.estimate:
            raise ValueError(
                f"{a.name or a.kind}: its hard iron is estimated once the heading is known to {most:.1f} "
                f"deg, and a course is said to be {crab:g} deg off it; set crab to 2 deg or less, or use "
                "closed-loop"
            )


@helper
def to_angles(
    pitch: float, heading: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """J^-1: changes of roll, pitch and heading (rad) by a small rotation (x, y, z) in n, to
    first order."""
    ch, sh = math.cos(heading), math.sin(heading)
    forward = (ch * x + sh * y) / max(math.cos(pitch), MIN_COSINE)
    return forward, ch * y - sh * x, z + math.sin(pitch) * forward


@helper
def from_angles(
    pitch: float, heading: float, roll_change: float, pitch_change: float, heading_change: float
) -> tuple[float, float, float]:
    """J: the small rotation in n that changes of the Euler angles are (rad)."""
    ch, sh, forward = (
        math.cos(heading),
        math.sin(heading),
        max(math.cos(pitch), MIN_COSINE) * roll_change,
    )
    return (
        ch * forward - sh * pitch_change,
        sh * forward + ch * pitch_change,
        heading_change - math.sin(pitch) * roll_change,
    )


@inline
def propagate(
    belief: FilterState, C: Array, f0: float, f1: float, f2: float, dt: float, noise: Noise
) -> None:
    """P and workspace[ERROR] over dt by the Jacobian of the model; C (3, 3) at mid-interval, f
    the velocity increment by the specific force in n (m/s)."""
    P, workspace, keep = belief.P, belief.workspace, decay(noise.accel_decay * dt)
    attitude_error_state.propagate(P, C, 0.0, 0.0, noise.gyro * noise.gyro * dt, dt, noise)
    _drift(P, 0.5 * dt)
    _accelerate(P, C, dt)
    for i in range(3):
        P[3 + i, 3 + i] += noise.accel * noise.accel * dt
        for j in range(3):
            P[i, 9 + j] *= keep
            P[3 + i, 9 + j] *= keep
            P[9 + j, i], P[9 + j, 3 + i] = P[i, 9 + j], P[3 + i, 9 + j]
            P[9 + i, 9 + j] *= keep * keep
        P[9 + i, 9 + i] += noise.accel_bias * noise.accel_bias * dt
    # without velocities nothing tells that the known attitude, that of `bar`, is not the estimate's
    told, own = workspace[SINCE_VELOCITY] < MAX_WITHOUT_VELOCITY, workspace[OWN_ATTITUDE]
    x, known = workspace[ERROR], 0.0 if told or own > 0 else 1.0
    d = (known * x[6], known * x[7], known * x[8])
    _add_tilt_noise(P, d, f0, f1, f2, 2 * workspace[CORRELATION] / dt)
    _drift(P, 0.5 * dt)
    mean = of_estimates(noise)
    keep_a, keep_g = decay(mean.accel_decay * dt), decay(mean.gyro_decay * dt)
    force = (own * f0, own * f1, own * f2)
    _propagate_error(workspace[ERROR], C, force, dt, keep_a, keep_g)


@helper
def _drift(P: Array, dt: float) -> None:
    """p <- p + v dt in P."""
    for i in range(3):
        for j in range(i + 1):
            P[i, j] += dt * (P[i, 3 + j] + P[j, 3 + i] + dt * P[3 + i, 3 + j])
            P[j, i] = P[i, j]
    for i in range(3):
        for j in range(3):
            P[i, 3 + j] += dt * P[3 + i, 3 + j]
            P[i, 9 + j] += dt * P[3 + i, 9 + j]
            P[3 + j, i], P[9 + j, i] = P[i, 3 + j], P[i, 9 + j]


@helper
def _accelerate(P: Array, C: Array, dt: float) -> None:
    """v <- v - C b_a dt in P; the covariance of v with b_a before it waits below the diagonal."""
    for i in range(3):
        u0, u1, u2 = dt * C[i, 0], dt * C[i, 1], dt * C[i, 2]
        for j in range(3):
            P[3 + i, 9 + j] -= u0 * P[9, 9 + j] + u1 * P[10, 9 + j] + u2 * P[11, 9 + j]
            P[j, 3 + i] -= u0 * P[j, 9] + u1 * P[j, 10] + u2 * P[j, 11]
            P[3 + i, j] = P[j, 3 + i]
    for i in range(3):
        for j in range(i, 3):
            P[3 + i, 3 + j] -= dt * (
                C[i, 0] * P[9, 3 + j]
                + C[i, 1] * P[10, 3 + j]
                + C[i, 2] * P[11, 3 + j]
                + P[3 + i, 9] * C[j, 0]
                + P[3 + i, 10] * C[j, 1]
                + P[3 + i, 11] * C[j, 2]
            )
            P[3 + j, 3 + i] = P[3 + i, 3 + j]
    for i in range(3):
        for j in range(3):
            P[9 + j, 3 + i] = P[3 + i, 9 + j]


@helper
def _add_tilt_noise(
    P: Array, d: tuple[float, float, float], f0: float, f1: float, f2: float, scale: float
) -> None:
    """Add to the variance of v what errors theta of the known attitude, which the estimate has d
    more than, do to the specific force f: `scale` times [f x] (P_theta + d d') [f x]'."""
    for j in range(3):
        # column j of [f x]'
        g0, g1, g2 = (0.0, -f2, f1) if j == 0 else ((f2, 0.0, -f0) if j == 1 else (-f1, f0, 0.0))
        along = d[0] * g0 + d[1] * g1 + d[2] * g2
        x, y, z = (
            P[6, 6] * g0 + P[6, 7] * g1 + P[6, 8] * g2 + along * d[0],
            P[7, 6] * g0 + P[7, 7] * g1 + P[7, 8] * g2 + along * d[1],
            P[8, 6] * g0 + P[8, 7] * g1 + P[8, 8] * g2 + along * d[2],
        )
        column = (f1 * z - f2 * y, f2 * x - f0 * z, f0 * y - f1 * x)
        for i in range(j, 3):
            P[3 + i, 3 + j] += scale * column[i]
            P[3 + j, 3 + i] = P[3 + i, 3 + j]


@helper
def _propagate_error(
    x: Array, C: Array, f: tuple[float, float, float], dt: float, keep_a: float, keep_g: float
) -> None:
    """workspace[ERROR] over dt, as P; f: the velocity increment (m/s, n) that turns with the
    attitude of stage 1, zero where another one is known."""
    turned_force = (
        x[7] * f[2] - x[8] * f[1],
        x[8] * f[0] - x[6] * f[2],
        x[6] * f[1] - x[7] * f[0],
    )
    for i in range(3):
        change = turned_force[i] - dt * (C[i, 0] * x[9] + C[i, 1] * x[10] + C[i, 2] * x[11])
        x[i] += dt * (x[3 + i] + 0.5 * change)
        x[3 + i] += change
        x[6 + i] -= dt * (C[i, 0] * x[12] + C[i, 1] * x[13] + C[i, 2] * x[14])
    for i in range(3):
        x[9 + i] *= keep_a
        x[12 + i] *= keep_g


@helper
def middle(C: Array, r0: float, r1: float, r2: float, mid: Array) -> None:
    """The attitude halfway through a rotation r (rad) of the body, into mid (3, 3)."""
    r0, r1, r2 = 0.5 * r0, 0.5 * r1, 0.5 * r2
    for i in range(3):
        mid[i, 0] = C[i, 0] + C[i, 1] * r2 - C[i, 2] * r1
        mid[i, 1] = C[i, 1] + C[i, 2] * r0 - C[i, 0] * r2
        mid[i, 2] = C[i, 2] + C[i, 0] * r1 - C[i, 1] * r0


@helper
def to_body(C: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """C' times the vector (x, y, z)."""
    return (
        C[0, 0] * x + C[1, 0] * y + C[2, 0] * z,
        C[0, 1] * x + C[1, 1] * y + C[2, 1] * z,
        C[0, 2] * x + C[1, 2] * y + C[2, 2] * z,
    )


@helper
def turn_attitude(
    P: Array, pitch: float, heading: float, new_pitch: float, new_heading: float
) -> None:
    """Carry P to Euler angles at which the model is linearised from now on: J_new J^-1 on the
    attitude errors."""
    N = (
        from_angles(new_pitch, new_heading, *to_angles(pitch, heading, 1.0, 0.0, 0.0)),
        from_angles(new_pitch, new_heading, *to_angles(pitch, heading, 0.0, 1.0, 0.0)),
        from_angles(new_pitch, new_heading, *to_angles(pitch, heading, 0.0, 0.0, 1.0)),
    )
    _turn(P, 6, 12, N)
    _turn_block(P, 6, N)


@helper
def inflate_velocity(P: Array, moved: Array) -> None:
    """The velocity was turned by `moved` (m/s, n) along with the attitude, since v_b stays; but v_b
    was found with the attitude as it was.

    So that makes it as uncertain as it was moved. `moved` becomes zero.
    """
    for i in range(3):
        for j in range(3):
            P[3 + i, 3 + j] += moved[i] * moved[j]
    moved[0] = moved[1] = moved[2] = 0.0


@helper
def turn_velocity(P: Array, before: Array, C: Array) -> None:
    """Carry P to another attitude C of the body, which moves at the same velocity along its axes
    as with the attitude `before`: C before' on v."""
    N = _relative(before, C)
    _turn(P, 3, 0, N)
    _turn(P, 3, 9, N)
    _turn_block(P, 3, N)


@helper
def _relative(before: Array, C: Array) -> Columns:
    """C before' as three columns."""
    return _column(C, before, 0), _column(C, before, 1), _column(C, before, 2)


@helper
def _column(C: Array, before: Array, j: int) -> tuple[float, float, float]:
    """Column j of C before'."""
    x, y, z = before[j, 0], before[j, 1], before[j, 2]
    return rotate_vector(C, x, y, z)


@helper
def _turn(P: Array, first: int, other: int, N: Columns) -> None:
    """N, given as three columns, on the covariance of the states from `first` with those from
    `other`."""
    for j in range(other, other + 3):
        x, y, z = _times(N, P[first, j], P[first + 1, j], P[first + 2, j])
        P[first, j] = P[j, first] = x
        P[first + 1, j] = P[j, first + 1] = y
        P[first + 2, j] = P[j, first + 2] = z


@helper
def _turn_block(P: Array, first: int, N: Columns) -> None:
    """N P N' on the block of the states from `first`."""
    for j in range(first, first + 3):  # N P
        P[first, j], P[first + 1, j], P[first + 2, j] = _times(
            N, P[first, j], P[first + 1, j], P[first + 2, j]
        )
    for i in range(first, first + 3):  # (N P) N', of which the lower triangle counts
        P[i, first], P[i, first + 1], P[i, first + 2] = _times(
            N, P[i, first], P[i, first + 1], P[i, first + 2]
        )
    for i in range(first, first + 3):
        for j in range(first, i):
            P[j, i] = P[i, j]


@helper
def _times(N: Columns, x: float, y: float, z: float) -> tuple[float, float, float]:
    """N, given as three columns, times a vector."""
    a, b, c = N
    return (
        a[0] * x + b[0] * y + c[0] * z,
        a[1] * x + b[1] * y + c[1] * z,
        a[2] * x + b[2] * y + c[2] * z,
    )
