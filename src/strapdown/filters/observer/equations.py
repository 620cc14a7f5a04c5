"""The nonlinear observer of Grip et al. as Alam et al. use it: attitude by two directions, a
translational motion observer, bounded biases.

Equations (1)-(3) of Alam, Whidborne & Millidere (2023), written in n instead of e, with the
corrections of docs/explanation/observer.md. With sigma a rate in the body, x = C' xi, f the bias-free specific
force:
    C' = C [w - b_g + sigma] - ..., b_g' = Proj(-ki sigma), sigma = k1 f x (f + x) / (|f| |f + x|) +
    sigma of a heading or field, v' = C f + xi + g + ..., xi' = - C [sigma] (f - b_a) + jumps at the
    fixes, b_a' = Proj(adaptation).
A turn by sigma therefore leaves C (f - b_a) + xi where it was, and here it does so exactly, however
large it is.

Helpers act on a FilterState whose `workspace` is the observer's own, of OBSERVER: that of the filter, or
the view that `embedded_observer` gives.
"""

import math

from ...core.compile.jit import helper, inline, matrix
from ...core.compile.selection import any_of, where
from ...core.loop.contract import MAX_STATES, FilterState, Kind, Noise, Observe, Slots, SourceRow
from ...core.mathematics.earth import displace, place
from ...core.mathematics.elementary import arctangent, arctangent2, tangent
from ...core.mathematics.embedded import NAVIGATION, navigation
from ...core.mathematics.error_state import bias_free, observe_innovation, publish_rates
from ...core.mathematics.kalman import decay
from ...core.mathematics.mechanization import mechanize
from ...core.mathematics.rotation import (
    orthonormalise,
    rotate_left,
    rotate_right,
    rotate_vector,
    wrap,
)
from ...typing import Array
from . import adaptive_law
from .translation_gains import AGE, SPREAD, TRANSLATION, VELOCITY_AGE, fix_gains

OBSERVER = Slots()
EXCITATION = OBSERVER.output("excitation")  # smallest eigenvalue of MOMENT
HELD = OBSERVER.output("course_held [s]")  # s without a course
XI = OBSERVER.outputs("xi_north [m/s^2]", "xi_east [m/s^2]", "xi_down [m/s^2]")
SQUARE = OBSERVER.number("SQUARE")  # theta0: squared length of the accelerometer bias, m^2/s^4
# s; SINCE_FIX of position or velocity
SINCE_FIX, SINCE_COURSE, SINCE_HEADING, SINCE_FIELD = OBSERVER.numbers(
    "SINCE_FIX", "SINCE_COURSE", "SINCE_HEADING", "SINCE_FIELD"
)
# from FADE_AT_START down: 1 and above, the gains are those of the start
FADE = OBSERVER.number("FADE")
COURSE = OBSERVER.number("COURSE")  # the last one, rad; NaN before
# gains, 1/s, and density of the force, m/s^2/sqrt(s); of the start
K1, K2, KI, WANDER = OBSERVER.numbers("K1", "K2", "KI", "WANDER")
K1_START, K2_START, KI_START, WANDER_START = OBSERVER.numbers(
    "K1_START", "K2_START", "KI_START", "WANDER_START"
)
START_TIME = OBSERVER.number("START_TIME")  # s
GYRO_BOUND = OBSERVER.number("GYRO_BOUND")  # rad/s
ACCEL_BOUND = OBSERVER.number("ACCEL_BOUND")  # m/s^2
ADAPTATION = OBSERVER.number("ADAPTATION")  # 1/s
MODE, FIELD = OBSERVER.numbers("MODE", "FIELD")  # of the course, of the field
MIN_SPEED = OBSERVER.number("MIN_SPEED")  # of a course, m/s; 0: as its std says
SLOW = OBSERVER.number("SLOW")  # s in a row of velocities without a course
# s since the start without excitation, - inf once there was some
UNEXCITED = OBSERVER.number("UNEXCITED")
CONDITION = OBSERVER.number("CONDITION")  # 1: SLOW for long; 2: UNEXCITED for long
OUTAGE_AFTER = OBSERVER.number("OUTAGE_AFTER")  # s
TOLD = OBSERVER.number("TOLD")  # accelerometer noise while there are samples
# what the last fix changed, for a covariance: gains (p, v, xi) of three rows, which axis the first
# is of; the share of its angle that an attitude was turned by, and of that what went to the gyro
# bias, 1/s; the standard deviation of a course, rad
GAIN = OBSERVER.array("GAIN", 9)
SHARE, LEARNT, COURSE_STD = OBSERVER.numbers("SHARE", "LEARNT", "COURSE_STD")
MOMENT = OBSERVER.array("MOMENT", 10)  # forgetting mean of phi phi', its upper triangle
WORK = OBSERVER.array("WORK", 9)
EIGEN = OBSERVER.matrix("EIGEN", 4, 4)  # MOMENT as it is made diagonal
MOTION = OBSERVER.part("MOTION", TRANSLATION)  # the translational motion observer
LAW = OBSERVER.number("LAW")  # of the accelerometer bias
ADAPTIVE = OBSERVER.part("ADAPTIVE", adaptive_law.ADAPTIVE)
JACOBIAN = OBSERVER.matrix("JACOBIAN", 3, MAX_STATES)  # H of a fix, which is not used
EMBEDDED = Slots()
"""Slots of an observer inside another filter."""
STATE = EMBEDDED.part("STATE", NAVIGATION)
BLOCK = EMBEDDED.part("BLOCK", OBSERVER)
EMBEDDED_SIZE = EMBEDDED.size
NONE, TILT_COMPENSATED, PRINTED, FROZEN = range(4)
COURSES = {"tilt-compensated": TILT_COMPENSATED, "printed": PRINTED, "frozen": FROZEN, "none": NONE}
VECTOR, ACROSS = range(2)
FIELDS = {"across": ACROSS, "vector": VECTOR}
BY_XI, BY_NORM = range(2)
LAWS = {"xi": BY_XI, "norm": BY_NORM}
MAX_GAP = 1.0  # s: a direction not measured for longer counts as if it were for so long
MAX_COURSE_STD = math.radians(5.0)
"""Standard deviation of a course, that of the velocity across over the speed, beyond which it is
none: as large as the angle between course and heading commonly is. A receiver at rest does not reach
it: its velocity would have to be 11 of its own standard deviations."""
LONG_HELD = 10.0  # s without a course that are worth saying
TRUSTED = 5.0  # s after a heading or field during which the course is left alone
FORGETTING = 60.0  # s, of MOMENT
EXCITED = 1e-3  # of EXCITATION, in which 1 is a specific force of 1 g
KNOWN_ENOUGH = 0.5  # of EXCITATION, in which 1 is a bias without error
NOMINAL_GRAVITY = 9.81  # m/s^2, scale of MOMENT
FADE_AT_START = math.exp(2.0)  # falls to 1 in twice its time constant
OUTER = 1.1  # the biases never pass this times their bound
MIN_SINE = 0.1  # between specific force and field: below it the field tells no heading
FREE_FALL_FORCE = 0.5  # m/s^2: a specific force below it has no direction


@inline
def embedded_observer(belief: FilterState, first: int) -> FilterState:
    """The observer whose numbers (EMBEDDED) begin at belief.workspace[first], as a FilterState of its
    own; P and tail are those of `belief` and none of its business."""
    own = belief.workspace[first : first + EMBEDDED_SIZE]
    return navigation(own[STATE], belief.P, own[BLOCK], belief.augmented)


@inline
def advance(bar: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """One IMU sample u (rotation, rad, and velocity increment, m/s): INS with xi, turn towards the
    specific force that the fixes tell, biases.

    In an outage, and over samples that the loop makes up in a gap, sigma is zero and biases and xi
    are held; FROZEN goes on turning to the last course.
    """
    if dt <= 0:
        return
    workspace, C, xi = bar.workspace, bar.C_nb, bar.workspace[XI]
    r, a = bias_free(u, bar.b_a, bar.b_g, dt)
    x0 = C[0, 0] * xi[0] + C[1, 0] * xi[1] + C[2, 0] * xi[2]
    x1 = C[0, 1] * xi[0] + C[1, 1] * xi[1] + C[2, 1] * xi[2]
    x2 = C[0, 2] * xi[0] + C[1, 2] * xi[1] + C[2, 2] * xi[2]
    _turn_with_n(bar, xi, dt)
    mechanize(
        bar.lla,
        bar.v_n,
        C,
        r,
        (
            a[0] + dt * (x0 - 0.5 * (r[1] * x2 - r[2] * x1)),
            a[1] + dt * (x1 - 0.5 * (r[2] * x0 - r[0] * x2)),
            a[2] + dt * (x2 - 0.5 * (r[0] * x1 - r[1] * x0)),
        ),
        dt,
        workspace[WORK],
    )  # half a turn back: xi stands still in n, not in the body
    publish_rates(bar, r, a, dt)
    told, course = float(workspace[TOLD]), workspace[COURSE]
    made_up = noise.accel > told
    _clocks(workspace, dt, noise.accel * noise.accel - told * told if made_up else 0.0)
    by_xi = int(workspace[LAW]) == BY_XI
    if made_up:
        if by_xi:
            _answer_sample(bar, 0.0, dt, False)
        return
    free, k = not outage(workspace), 0.0
    if any_of(free):
        k = _towards_force(bar, x0, x1, x2, dt, free)
        if not by_xi:
            _adapt(bar, x0, x1, x2, dt, free)
    if by_xi:
        _answer_sample(bar, k, dt, free)
    if int(workspace[MODE]) == FROZEN:
        _towards_heading(bar, course, dt, (not free) & (course == course))


@inline
def _answer_sample(bar: FilterState, k: float, dt: float, free: bool) -> None:
    """Update the adaptive law for a sample in which the attitude was turned by k f x xi."""
    C, workspace, f, own = bar.C_nb, bar.workspace, bar.f, bar.workspace[ADAPTIVE]
    f0, f1, f2 = rotate_vector(C, f[0], f[1], f[2])
    ki = where(free, gain(workspace, KI), 0.0)
    adaptive_law.sample(own, C, f0, f1, f2, where(free, k, 0.0), ki, dt)
    own[adaptive_law.SINCE] += where(free, dt, 0.0)


@helper
def outage(workspace: Array) -> bool:
    """True where position and velocity have been missing for so long that nothing else is injected
    either."""
    return workspace[SINCE_FIX] > workspace[OUTAGE_AFTER]


@inline
def _turn_with_n(bar: FilterState, xi: Array, dt: float) -> None:
    """xi stands still in e: in n it turns against the transport rate."""
    sine, cosine, M, N = place(bar.lla[0], bar.lla[2])
    w0, w1, w2 = dt * bar.v_n[1] / N, -dt * bar.v_n[0] / M, -dt * bar.v_n[1] * sine / (cosine * N)
    x0, x1, x2 = xi[0], xi[1], xi[2]
    xi[0], xi[1], xi[2] = x0 - w1 * x2 + w2 * x1, x1 - w2 * x0 + w0 * x2, x2 - w0 * x1 + w1 * x0


@helper
def _clocks(workspace: Array, dt: float, spread: float) -> None:
    """Time goes on; `spread` (m^2/s^3) is the density of velocity that made-up samples add to
    what the fixes may correct."""
    for i in range(SINCE_FIX, SINCE_FIELD + 1):
        workspace[i] += dt
    workspace[UNEXCITED] += dt
    _assess(workspace)
    own = workspace[MOTION]
    for i in range(3):
        own[AGE][i] += dt
        own[VELOCITY_AGE][i] += dt
    own[SPREAD] += spread * dt
    since = min(workspace[SINCE_COURSE], min(workspace[SINCE_HEADING], workspace[SINCE_FIELD]))
    # a start that heading is not part of is none
    started = (since < TRUSTED) | (int(workspace[MODE]) == NONE)
    fades = (workspace[FADE] > 1e-3) & started & (not outage(workspace))
    if any_of(fades):
        left = decay(2 * dt / float(workspace[START_TIME]))
        workspace[FADE] *= where(fades, left, 1.0)


@helper
def _assess(workspace: Array) -> None:
    """Which condition holds now; that of the heading comes first."""
    even = where(workspace[UNEXCITED] > FORGETTING, 2.0, 0.0)
    workspace[CONDITION] = where(workspace[SLOW] >= LONG_HELD, 1.0, even)


@helper
def gain(workspace: Array, name: int) -> float:
    """One of K1 ... WANDER now: for START_TIME that of the start, from then on itself more and
    more, with half of that time for a time constant."""
    return workspace[name] + (workspace[name + K1_START - K1] - workspace[name]) * min(
        workspace[FADE], 1.0
    )


@inline
def turn(bar: FilterState, s0: float, s1: float, s2: float) -> None:
    """Turn the attitude by the rotation vector s (rad, body), f_n = C f + xi staying, and
    outside an outage the gyro bias by - ki s, bounded. Zeros turn nothing."""
    C, f, xi, workspace = bar.C_nb, bar.f, bar.workspace[XI], bar.workspace
    b0, b1, b2 = rotate_vector(C, f[0], f[1], f[2])
    rotate_right(C, s0, s1, s2)
    n0, n1, n2 = rotate_vector(C, f[0], f[1], f[2])
    xi[0] += b0 - n0
    xi[1] += b1 - n1
    xi[2] += b2 - n2
    ki = workspace[LEARNT] = where(outage(workspace), 0.0, gain(workspace, KI))
    add_projected(bar.b_g, -ki * s0, -ki * s1, -ki * s2, workspace[GYRO_BOUND])


@helper
def add_projected(b: Array, d0: float, d1: float, d2: float, bound: float) -> None:
    """b += Proj(d): what leads out of the ball of radius `bound` fades away up to OUTER times
    it, smoothly (Grip et al. 2015)."""
    along, square, limit = (
        b[0] * d0 + b[1] * d1 + b[2] * d2,
        b[0] * b[0] + b[1] * b[1] + b[2] * b[2],
        bound * bound,
    )
    out = (along > 0) & (square > limit)
    if any_of(out):
        less = min(1.0, (square - limit) / (limit * (OUTER * OUTER - 1))) * along
        less = where(out, less / max(square, limit), 0.0)
        d0, d1, d2 = d0 - less * b[0], d1 - less * b[1], d2 - less * b[2]
    b[0] += d0
    b[1] += d1
    b[2] += d2
    square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    most = OUTER * OUTER * limit
    beyond = square > most
    if any_of(beyond):  # a step is no derivative
        scale = where(beyond, OUTER * bound / math.sqrt(max(square, most)), 1.0)
        b[0], b[1], b[2] = b[0] * scale, b[1] * scale, b[2] * scale


@inline
def _towards_force(
    bar: FilterState, x0: float, x1: float, x2: float, dt: float, wanted: bool
) -> float:
    """sigma of the first direction: the specific force as measured against that of the
    translational motion observer. Returns the gain of f x."""
    f, workspace = bar.f, bar.workspace
    h0, h1, h2 = f[0] + x0, f[1] + x1, f[2] + x2
    size = math.sqrt((f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) * (h0 * h0 + h1 * h1 + h2 * h2))
    least = FREE_FALL_FORCE * FREE_FALL_FORCE
    k = (1 - decay(gain(workspace, K1) * dt)) / max(size, least)
    k = where(wanted & (size >= least), k, 0.0)
    turn(bar, k * (f[1] * x2 - f[2] * x1), k * (f[2] * x0 - f[0] * x2), k * (f[0] * x1 - f[1] * x0))
    return k


@inline
def _adapt(bar: FilterState, x0: float, x1: float, x2: float, dt: float, wanted: bool) -> None:
    """theta' = Proj(adaptation G phi (y_f - phi' theta) / (phi' G phi)), G = diag(bound^2, 1, 1,
    1): it cannot blow up, however large the force.

    With f bias-free and f_n = C f + xi the error y_f - phi' theta = |f_n|^2 - |f_IMU|^2 - theta0 +
    2 f_IMU b is 2 f_IMU x + |x - b|^2 - theta0.
    """
    workspace, b_a, f = bar.workspace, bar.b_a, bar.f
    b0, b1, b2 = b_a[0], b_a[1], b_a[2]
    m0, m1, m2 = f[0] + b0, f[1] + b1, f[2] + b2
    e = (
        2 * (m0 * x0 + m1 * x1 + m2 * x2)
        + (x0 - b0) * (x0 - b0)
        + (x1 - b1) * (x1 - b1)
        + (x2 - b2) * (x2 - b2)
        - workspace[SQUARE]
    )
    limit = workspace[ACCEL_BOUND] * workspace[ACCEL_BOUND]
    rate = where(wanted, workspace[ADAPTATION], 0.0)
    rate = (
        rate
        * (1 - min(workspace[FADE], 1.0))
        * dt
        * e
        / (limit + 4 * (m0 * m0 + m1 * m1 + m2 * m2))
    )
    workspace[SQUARE] = min(max(workspace[SQUARE] + rate * limit, 0.0), OUTER * OUTER * limit)
    add_projected(b_a, -2 * rate * m0, -2 * rate * m1, -2 * rate * m2, workspace[ACCEL_BOUND])
    share = where(wanted, dt / FORGETTING, 0.0)
    moment, phi, k = workspace[MOMENT], workspace[WORK], 0
    phi[0], phi[1] = 1.0, m0 / NOMINAL_GRAVITY
    phi[2], phi[3] = m1 / NOMINAL_GRAVITY, m2 / NOMINAL_GRAVITY
    for i in range(4):
        for j in range(i, 4):
            moment[k] += share * (phi[i] * phi[j] - moment[k])
            k += 1


@inline
def inject(
    bar: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    innovation: Array,
    wanted: bool = True,
) -> None:
    """Inject a measurement where it is wanted, without a gate."""
    H = matrix(bar.workspace, JACOBIAN, 3, bar.P.shape[0])
    observe_innovation(bar, y, observe, source, innovation, H)
    take(bar, y, std, kind, source, innovation, wanted)


@inline
def take(
    bar: FilterState,
    y: Array,
    std: Array,
    kind: int,
    source: SourceRow,
    innovation: Array,
    wanted: bool = True,
) -> None:
    """Inject a measurement by its innovation where it is wanted: position, velocity and xi by the
    gains of the translational motion observer, the attitude by a direction.

    In an outage only position and velocity, which end it; a heading or field is only remembered as
    one that is there, so that no course takes its place.
    """
    workspace, e = bar.workspace, innovation
    free = (not outage(workspace)) | (kind == Kind.POSITION or kind == Kind.VELOCITY)
    free = free & wanted
    _clear_gains(workspace)
    if kind == Kind.HEADING:
        measured = (e[0] == e[0]) & wanted
        since = min(workspace[SINCE_HEADING], MAX_GAP)
        _towards_heading(bar, y[0], since, measured & free)
        workspace[SINCE_HEADING] = where(measured, 0.0, workspace[SINCE_HEADING])
        workspace[SLOW] = where(measured & free, 0.0, workspace[SLOW])
    elif kind == Kind.MAGNETIC_FIELD:
        total = e[0] + e[1] + e[2]
        _towards_field(bar, y, source, e, (total == total) & free)
        there = (e[0] == e[0]) & wanted & (not free)
        workspace[SINCE_FIELD] = where(there, 0.0, workspace[SINCE_FIELD])
    elif kind == Kind.POSITION or kind == Kind.VELOCITY or kind == Kind.ALTITUDE:
        if kind == Kind.VELOCITY:
            std_v = math.sqrt(0.5 * (std[0] * std[0] + std[1] * std[1]))
            _course(bar, e[0] + bar.v_n[0], e[1] + bar.v_n[1], std_v, free)
        _translate(bar, kind, e, std, free)
        if int(workspace[LAW]) == BY_NORM:
            _assess_excitation(workspace, smallest(workspace), EXCITED, free)
        elif kind != Kind.ALTITUDE:
            _learn(bar, free)
    if int(workspace[LAW]) == BY_XI and (kind == Kind.HEADING or kind == Kind.MAGNETIC_FIELD):
        _answer_heading(bar, 0.0)
    _assess(workspace)
    orthonormalise(bar.C_nb, free)


@inline
def _clear_gains(workspace: Array) -> None:
    """Forget the gains of the measurement before."""
    workspace[SHARE] = workspace[ADAPTIVE][adaptive_law.WEIGHT] = 0.0
    for i in range(9):
        workspace[GAIN][i] = 0.0
    for i in range(adaptive_law.COUNT):
        workspace[ADAPTIVE][adaptive_law.COURSE][i] = 0.0


@inline
def _translate(bar: FilterState, kind: int, innovation: Array, std: Array, wanted: bool) -> None:
    """Position, velocity and xi by the gains at this fix."""
    workspace = bar.workspace
    change, xi, K = workspace[WORK], workspace[XI], workspace[GAIN]
    for i in range(9):
        change[i] = 0.0
    since = workspace[SINCE_FIX]
    for row in range(1 if kind == Kind.ALTITUDE else 3):
        axis, e = 2 if kind == Kind.ALTITUDE else row, innovation[row]
        measured = (e == e) & wanted
        if any_of(measured):
            fix_gains(
                workspace[MOTION],
                axis,
                kind == Kind.VELOCITY,
                std[row],
                workspace[TOLD],
                gain(workspace, WANDER),
                K[3 * row : 3 * row + 3],
                measured,
            )
            if int(workspace[LAW]) == BY_XI:
                each = K[3 * row : 3 * row + 3]
                adaptive_law.fix(workspace[ADAPTIVE], axis, kind == Kind.VELOCITY, each)
            since = where(measured, 0.0, since)
            e = where(measured, e, 0.0)
            for i in range(3):
                change[3 * axis + i] = K[3 * row + i] * e
    displace(bar.lla, change[0], change[3], change[6])
    for i in range(3):
        bar.v_n[i] += change[3 * i + 1]
        xi[i] += change[3 * i + 2]
    if kind != Kind.ALTITUDE:
        workspace[SINCE_FIX] = since


@helper
def _assess_excitation(workspace: Array, value: float, enough: float, wanted: bool) -> None:
    """EXCITATION is now that, where it is wanted."""
    workspace[EXCITATION] = where(wanted, value, workspace[EXCITATION])
    excited = wanted & (workspace[EXCITATION] >= enough)
    workspace[UNEXCITED] = where(excited, -math.inf, workspace[UNEXCITED])


@inline
def _answer_heading(bar: FilterState, by_wind: float) -> None:
    """Update the adaptive law for the last turn about the vertical."""
    C, workspace, f = bar.C_nb, bar.workspace, bar.f
    f0, f1, f2 = rotate_vector(C, f[0], f[1], f[2])
    share, ki = workspace[SHARE], workspace[LEARNT]
    adaptive_law.heading(workspace[ADAPTIVE], C, f0, f1, f2, share, ki, by_wind)


@inline
def _learn(bar: FilterState, wanted: bool) -> None:
    """Biases and wind by xi and what the course has told, and the observer by what it answers."""
    workspace, own, b_a, xi = bar.workspace, bar.workspace[ADAPTIVE], bar.b_a, bar.workspace[XI]
    adaptive_law.begin(own, wanted & (workspace[FADE] < 1) & (own[adaptive_law.BEGUN] == 0))
    noise, T = own[adaptive_law.XI_NOISE], min(own[adaptive_law.SINCE], MAX_GAP)
    weight = (1 - min(workspace[FADE], 1.0)) * T / (noise * noise)
    adaptive_law.see_force(own, xi, where(wanted, weight, 0.0))
    adaptive_law.forget(own, wanted)
    known = adaptive_law.factor(own)
    change, scale, wind = own[adaptive_law.CHANGE], own[adaptive_law.SCALE], own[adaptive_law.WIND]
    for i in range(adaptive_law.COUNT):
        change[i] = own[adaptive_law.SUM][i]
        own[adaptive_law.SUM][i] = 0.0
    adaptive_law.solve(own, change)
    add_projected(
        b_a,
        scale[0] * change[0],
        scale[1] * change[1],
        scale[2] * change[2],
        workspace[ACCEL_BOUND],
    )
    displace(
        bar.lla,
        adaptive_law.answer(own, adaptive_law.U_P, 0),
        adaptive_law.answer(own, adaptive_law.U_P, 1),
        adaptive_law.answer(own, adaptive_law.U_P, 2),
    )
    rotate_left(
        adaptive_law.answer(own, adaptive_law.U_TILT, 0),
        adaptive_law.answer(own, adaptive_law.U_TILT, 1),
        adaptive_law.answer(own, adaptive_law.U_TILT, 2),
        bar.C_nb,
    )
    for i in range(3):
        bar.v_n[i] += adaptive_law.answer(own, adaptive_law.U_V, i)
        xi[i] -= adaptive_law.answer(own, adaptive_law.U_XI, i)
    add_projected(
        bar.b_g,
        adaptive_law.answer(own, adaptive_law.U_GYRO, 0),
        adaptive_law.answer(own, adaptive_law.U_GYRO, 1),
        adaptive_law.answer(own, adaptive_law.U_GYRO, 2),
        workspace[GYRO_BOUND],
    )
    for i in range(2):
        wind[i] += scale[6 + i] * change[6 + i]
    _assess_excitation(workspace, known, KNOWN_ENOUGH, wanted)


@inline
def _course(bar: FilterState, north: float, east: float, std: float, wanted: bool) -> None:
    """The direction of the velocity (m/s, each with that std) as a heading, where it is wanted, fast
    enough and nothing better is there."""
    workspace = bar.workspace
    mode, by_xi = int(workspace[MODE]), int(workspace[LAW]) == BY_XI
    if by_xi:
        wind = workspace[ADAPTIVE][adaptive_law.WIND]
        north, east = north - wind[0], east - wind[1]
    speed = math.sqrt(north * north + east * east)
    told = min(workspace[SINCE_HEADING], workspace[SINCE_FIELD]) <= TRUSTED
    wanted = wanted & (not told) & (speed == speed)
    if mode == NONE or not any_of(wanted):
        return
    slow = too_slow(speed, std, float(workspace[MIN_SPEED]))
    held = where(wanted & slow, min(workspace[MOTION][VELOCITY_AGE][0], MAX_GAP), 0.0)
    fast = wanted & (not slow)
    workspace[HELD] += held
    workspace[SLOW] = where(fast, 0.0, workspace[SLOW] + held)
    if not any_of(fast):
        return
    course, since = arctangent2(east, north), workspace[SINCE_COURSE]
    own_std = where(speed > 0, std / where(speed > 0, speed, 1.0), math.inf)
    _keep_course(workspace, course, own_std, fast)
    seconds = min(since, MAX_GAP)
    by_wind = 1 / where(fast, speed, 1.0)
    if by_xi:
        _see_course(bar, course, own_std, seconds, by_wind, fast)
    if mode == PRINTED:
        C, speed = bar.C_nb, where(speed > 0, speed, 1.0)
        _towards(bar, north / speed, -east / speed, 0.0, C[0, 0], C[0, 1], C[0, 2], seconds, fast)
    else:
        _towards_heading(bar, course, seconds, fast)
    if by_xi:
        _answer_heading(bar, by_wind)


@helper
def _keep_course(workspace: Array, course: float, std: float, fast: bool) -> None:
    """Keep a course (rad) with its std for later, where it is `fast` enough."""
    workspace[COURSE_STD] = where(fast, std, workspace[COURSE_STD])
    workspace[COURSE] = where(fast, course, workspace[COURSE])
    workspace[SINCE_COURSE] = where(fast, 0.0, workspace[SINCE_COURSE])


@helper
def _see_course(
    bar: FilterState, course: float, std: float, seconds: float, by_wind: float, fast: bool
) -> None:
    """Give the adaptive law what a course (rad) differs from the heading, where it is `fast` enough."""
    own, slip = bar.workspace[ADAPTIVE], bar.workspace[ADAPTIVE][adaptive_law.SLIP]
    z = wrap(course - arctangent2(bar.C_nb[1, 0], bar.C_nb[0, 0]))
    weight = (1 - min(bar.workspace[FADE], 1.0)) * seconds / (slip * slip + std * std * seconds)
    fast_z = where(fast, z, 0.0)
    adaptive_law.see_course(own, bar.C_nb, fast_z, by_wind, where(fast, weight, 0.0))


@helper
def too_slow(speed: float, std: float, least: float) -> bool:
    """True where a velocity of that speed, each component with that std (m/s), gives no course: its
    speed is below `least`, or, where that is 0, the standard deviation of the course is too
    large."""
    if least > 0:
        return speed < least
    return not speed * MAX_COURSE_STD >= std


@inline
def _towards_heading(bar: FilterState, heading: float, seconds: float, wanted: bool) -> None:
    """sigma of a heading (rad) at the roll and pitch of the belief, over that time, where it is
    wanted: a turn about the vertical, exact for any angle."""
    if not any_of(wanted):
        return
    C, workspace = bar.C_nb, bar.workspace
    angle = where(wanted, wrap(heading - arctangent2(C[1, 0], C[0, 0])), 0.0)
    left = _remaining_angle(angle, gain(workspace, K2) * seconds)
    workspace[SHARE] = where(angle != 0, 1 - left / where(angle != 0, angle, 1.0), 0.0)
    angle -= left
    turn(bar, angle * C[2, 0], angle * C[2, 1], angle * C[2, 2])


@helper
def has_estimated_errors(bar: FilterState, source: SourceRow) -> bool:
    """True where errors of a source are states of the filter."""
    return bar.augmented.size > 0 and source.estimated > 0


@helper
def _remaining_angle(angle: float, time: float) -> float:
    """Return the remainder of an angle (rad) whose rate is - sin(angle), after that (scaled)
    time."""
    return 2 * arctangent(tangent(0.5 * angle) * decay(time))


@inline
def _towards_field(
    bar: FilterState, y: Array, source: SourceRow, innovation: Array, wanted: bool
) -> None:
    """sigma of a magnetic field y (T, body) against the one in `parameters` (T, n), over the time
    since the last, where it is wanted. Where its errors are states, y is that field and what the
    innovation leaves, without iron.

    Of both what is across the specific force counts, f x m: a field that dips steeply is almost
    parallel to it and alone holds the heading badly.
    """
    C, workspace, f = bar.C_nb, bar.workspace, bar.f
    xi, m0, m1, m2 = workspace[XI], source.parameters[0], source.parameters[1], source.parameters[2]
    e0, e1, e2 = (
        C[0, 0] * m0 + C[1, 0] * m1 + C[2, 0] * m2,
        C[0, 1] * m0 + C[1, 1] * m1 + C[2, 1] * m2,
        C[0, 2] * m0 + C[1, 2] * m1 + C[2, 2] * m2,
    )
    b0, b1, b2 = y[0], y[1], y[2]
    if has_estimated_errors(bar, source):
        b0, b1, b2 = e0 + innovation[0], e1 + innovation[1], e2 + innovation[2]
    if int(workspace[FIELD]) == ACROSS:
        f0, f1, f2 = f[0], f[1], f[2]
        h0 = f0 + C[0, 0] * xi[0] + C[1, 0] * xi[1] + C[2, 0] * xi[2]
        h1 = f1 + C[0, 1] * xi[0] + C[1, 1] * xi[1] + C[2, 1] * xi[2]
        h2 = f2 + C[0, 2] * xi[0] + C[1, 2] * xi[1] + C[2, 2] * xi[2]
        large = MIN_SINE * MIN_SINE * (e0 * e0 + e1 * e1 + e2 * e2) * (h0 * h0 + h1 * h1 + h2 * h2)
        e0, e1, e2 = h1 * e2 - h2 * e1, h2 * e0 - h0 * e2, h0 * e1 - h1 * e0
        wanted = wanted & (e0 * e0 + e1 * e1 + e2 * e2 >= large)
        b0, b1, b2 = f1 * b2 - f2 * b1, f2 * b0 - f0 * b2, f0 * b1 - f1 * b0
    size, known = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2), math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    wanted = wanted & (size > 0) & (known > 0)
    size, known = where(wanted, size, 1.0), where(wanted, known, 1.0)
    _towards(
        bar,
        b0 / size,
        b1 / size,
        b2 / size,
        e0 / known,
        e1 / known,
        e2 / known,
        min(workspace[SINCE_FIELD], MAX_GAP),
        wanted,
    )
    workspace[SINCE_FIELD] = where(wanted, 0.0, workspace[SINCE_FIELD])
    workspace[SLOW] = where(wanted, 0.0, workspace[SLOW])


@inline
def _towards(
    bar: FilterState,
    b0: float,
    b1: float,
    b2: float,
    e0: float,
    e1: float,
    e2: float,
    seconds: float,
    wanted: bool,
) -> None:
    """sigma of a direction measured as b and expected as e, unit vectors in the body, over that
    time, where it is wanted."""
    c0, c1, c2 = b1 * e2 - b2 * e1, b2 * e0 - b0 * e2, b0 * e1 - b1 * e0
    sine, cosine = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2), b0 * e0 + b1 * e1 + b2 * e2
    wanted = wanted & (sine >= 1e-12)
    if not any_of(wanted):
        return
    sine = where(wanted, sine, 1.0)
    angle = arctangent2(sine, cosine)
    share = (angle - _remaining_angle(angle, gain(bar.workspace, K2) * seconds)) / sine
    bar.workspace[SHARE] = where(wanted, share * sine / angle, 0.0)
    share = where(wanted, share, 0.0)
    c0, c1, c2 = where(wanted, c0, 0.0), where(wanted, c1, 0.0), where(wanted, c2, 0.0)
    turn(bar, share * c0, share * c1, share * c2)


@inline
def follow(bar: FilterState, belief: FilterState) -> None:
    """Without a course for long, of itself holding no heading: heading and gyro bias become those
    of a filter that has them by other means, f_n = C f + xi staying."""
    C, workspace = bar.C_nb, bar.workspace
    lost = workspace[SLOW] >= LONG_HELD
    if not any_of(lost):
        return
    angle = wrap(arctangent2(belief.C_nb[1, 0], belief.C_nb[0, 0]) - arctangent2(C[1, 0], C[0, 0]))
    angle = where(lost, angle, 0.0)
    turn(bar, angle * C[2, 0], angle * C[2, 1], angle * C[2, 2])
    b, own = belief.b_g, bar.b_g
    for i in range(3):
        own[i] = where(lost, 0.0, own[i])
    b0, b1, b2 = where(lost, b[0], 0.0), where(lost, b[1], 0.0), where(lost, b[2], 0.0)
    add_projected(own, b0, b1, b2, workspace[GYRO_BOUND])


@helper
def smallest(workspace: Array) -> float:
    """Smallest eigenvalue of the 4 x 4 matrix MOMENT, by Jacobi rotations."""
    A = matrix(workspace, EIGEN, 4, 4)
    moment, k = workspace[MOMENT], 0
    for i in range(4):
        for j in range(i, 4):
            A[i, j] = A[j, i] = moment[k]
            k += 1
    for _ in range(4):
        for p in range(3):
            for q in range(p + 1, 4):
                _annihilate(A, p, q)
    return max(min(min(A[0, 0], A[1, 1]), min(A[2, 2], A[3, 3])), 0.0)


@helper
def _annihilate(A: Array, p: int, q: int) -> None:
    """One Jacobi rotation that makes A[p, q] of a symmetric matrix zero."""
    there = abs(A[p, q]) >= 1e-15
    if not any_of(there):
        return
    ratio = (A[q, q] - A[p, p]) / where(there, 2 * A[p, q], 1.0)
    t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1))
    t = where(there, t, 0.0)
    c = 1 / math.sqrt(t * t + 1)
    s = t * c
    for k in range(4):
        x, y = A[k, p], A[k, q]
        A[k, p], A[k, q] = c * x - s * y, s * x + c * y
    for k in range(4):
        x, y = A[p, k], A[q, k]
        A[p, k], A[q, k] = c * x - s * y, s * x + c * y
