"""Attitude and gyro bias from gyros, specific force and magnetic field: a multiplicative extended
Kalman filter with six error states.

Its vertical is the specific force, carried along by the gyros and low-passed, so that the body's
own accelerations, whose mean over seconds is small, average out in a frame that does not turn with
the body. Of the magnetic field only the horizontal direction is used. How far strength and dip of
the field are from what they were tells how large a disturbance is there, and the direction is
trusted accordingly.
"""

import math

import numpy as np

from ...checks import check_number
from ...core.loop.contract import (
    ADJOINT_STEP,
    CORRECT,
    DECAYING,
    PREDICT,
    SAVE_STEP,
    STATES,
    Condition,
    Filter,
    FilterState,
    InitialState,
    Kind,
    Noise,
    Observe,
    Slots,
    Smoother,
    SourceRow,
    helper,
    kernel,
    matrix,
)
from ...core.mathematics.disturbed_field import DIP_ALLOWED, STRENGTH_ALLOWED, SURELY
from ...core.mathematics.earth import GRAVITY_EQUATOR, RATE, gravity
from ...core.mathematics.error_state import DX, ERROR_STATE, JACOBIAN, allocate, observe_innovation
from ...core.mathematics.kalman import MIN_NOISE, decay, of_estimates
from ...core.mathematics.rotation import rotate_vector
from ...typing import Array
from .attitude_error_state import (
    DOWN,
    FREE_FALL_FORCE,
    GAIN,
    INVERSE,
    KEEP,
    NORTH,
    RECORD,
    SIX,
    TRANSITION,
    TURNED,
    UNAIDED,
    absorb_bias,
    adjoint_propagate_attitude,
    adjoint_scalar_update,
    carry_bias,
    count_bias,
    inject,
    low_passed,
    off_vertical,
    propagate,
    scalar_update,
    turn,
)

CALL = Slots()
"""Slots of the last call that the smoother needs."""
LAST_CALL = CALL.number("LAST_CALL")  # PREDICTED or FIX
STEP = CALL.part("STEP", TRANSITION)
# (6, 6): what accelerometer biases make of P after it
CONSIDERED = CALL.matrix("CONSIDERED", 6, 6)
# the scalar measurements
FIRST_RECORD = CALL.part("FIRST_RECORD", RECORD)
SECOND_RECORD = CALL.part("SECOND_RECORD", RECORD)
ATTITUDE = Slots(after=ERROR_STATE)
"""Slots of every filter with this attitude."""
LAST = ATTITUDE.part("LAST", CALL)
EARTH_N, EARTH_D = ATTITUDE.numbers("EARTH_N", "EARTH_D")  # Earth rate, rad/s
# the options, as numbers
LOW_PASS = ATTITUDE.number("LOW_PASS")  # s
ACCELERATION = ATTITUDE.number("ACCELERATION")  # m^2/s^3
RATE_ERROR = ATTITUDE.number("RATE_ERROR")  # s
HEADING = ATTITUDE.number("HEADING")  # rad^2 s
TIMING = ATTITUDE.number("TIMING")  # s^3
DISTURBANCE = ATTITUDE.number("DISTURBANCE")  # s
# s: the specific force is a mean over; since the last field; between the last two
SECONDS, SINCE, INTERVAL = ATTITUDE.numbers("SECONDS", "SINCE", "INTERVAL")
TOLD = ATTITUDE.number("TOLD")  # accelerometer noise while there are samples
GRAVITY = ATTITUDE.number("GRAVITY")  # at the start, m/s^2
# m/s^2: mean of the size of the specific force less gravity, and of its part along the vertical
EXCESS, RISE = ATTITUDE.numbers("EXCESS", "RISE")
# mean angle from the vertical to the specific force, rad: the body's own acceleration over gravity
LEAN_N, LEAN_E = ATTITUDE.numbers("LEAN_N", "LEAN_E")
# s since the start; mean square of the angular rate, rad^2/s^2; 1 once the body was at rest
ELAPSED, SPIN, RESTED = ATTITUDE.numbers("ELAPSED", "SPIN", "RESTED")
CLOCK = ATTITUDE.number("CLOCK")  # s, from GONE on
HEADED = ATTITUDE.number("HEADED")  # when a heading was used last
# running mean of the innovations of headings and fields, rad, and when it moved last
OFF, OFF_AT = ATTITUDE.numbers("OFF", "OFF_AT")
TURN = ATTITUDE.array("TURN", 3)  # rad, in n: what the body has turned
MAGNETOMETERS = 4
"""Which are told apart, each with its books; the fifth would share those of the fourth."""
# of the field, running: T, rad
STRENGTH, DIP = (ATTITUDE.array(name, MAGNETOMETERS) for name in ("STRENGTH", "DIP"))
# when the last one was seen; when one was used
SEEN_AT, USED_AT = (ATTITUDE.array(name, MAGNETOMETERS) for name in ("SEEN_AT", "USED_AT"))
# s: how long fields were refused, less how long they were not; why the last one was
REFUSED, REASON = (ATTITUDE.array(name, MAGNETOMETERS) for name in ("REFUSED", "REASON"))
FIELD = ATTITUDE.matrix("FIELD", MAGNETOMETERS, 3)  # the last one, T
TURN_AT = ATTITUDE.matrix("TURN_AT", MAGNETOMETERS, 3)  # TURN when it was another
# of the six states to the accelerometer biases, 6 x 3; their variances, (m/s^2)^2
SENSITIVITY = ATTITUDE.matrix("SENSITIVITY", 6, 3)
BIAS_VARIANCE = ATTITUDE.array("BIAS_VARIANCE", 3)
HOLDS = ATTITUDE.number("HOLDS")  # 1 + index of the one of CONDITIONS that holds, else 0
SLOTS = Slots(after=ATTITUDE)
FORCE_EXCESS = SLOTS.output("force_excess [m/s^2]")
PREDICTED, FIX = 0.0, 1.0
STUCK, STRONG, DIPPING, CONTRADICTED = 1.0, 2.0, 3.0, 4.0
ASIDE, LASTS = 4.0, 8.0
"""Places in CONDITIONS, from 1; how much further on what is refused while another source measures
the heading; of headings that stay off."""
OFF_TIME, OFF_ALLOWED, OFF_SDS = 4.0, math.radians(5.0), 3.0
"""s over which innovations of the heading are averaged; how far they may be off, rad, besides so
many standard deviations of the heading."""
REFERENCE_TIME = 20.0
"""s: time constant of the running strength and dip while the field agrees with them."""
AGREES = 0.05
"""Disagreement of strength (relative) and dip (rad) beyond which they are followed more slowly."""
STUCK_TURN = 0.5
"""rad: a body cannot turn so far while its field stays the same number by number."""
REFUSED_FOR, REFUSED_MAX = 1.0, 5.0
"""s: refused fields that count; and at most, so that the count is over as soon again."""
GONE = 10.0
"""s: a source of which nothing came for so long is gone."""
LASTING, RISE_TIME = 1.0, 20.0
"""m/s^2: mean vertical acceleration over RISE_TIME (s) that no body keeps up: the attitude is wrong
(by 26 deg where the specific force is as large as gravity, by 30 deg in a turn of that bank)."""
LEAN_TIME = 5.0
"""s: time constant of the mean angle from the vertical to the specific force."""
SPIN_TIME, STILL = 1.0, 0.01
"""s, rad/s: a body that turned less than that, rms over that time, was at rest or in steady
motion."""
UNSEEN = 10.0
"""m/s: change of velocity of a body that moved from the start on, which neither its specific force
nor its gyros show."""
SIZE_TIME = 2.0
"""s: time constant of the mean size of the specific force."""
SIZE_ERROR = 0.15
"""m/s^2: what the size of the specific force at rest may differ by from gravity: an accelerometer's
bias, an unknown place."""


def start(
    start: InitialState,
    noise: Noise,
    low_pass: float = 2.0,
    acceleration: float = 0.2,
    rate_error: float = 0.002,
    heading: float = 1.7,
    timing: float = 0.03,
    disturbance: float = 10.0,
) -> FilterState:
    """The filter state at `start`. What the sensors are assumed to do besides their white noise:

    low_pass: time constant of the specific force, s; acceleration: density of the remaining
    acceleration of the body, m/s^2 sqrt(s); rate_error: scale errors of the gyros, per rate,
    sqrt(s); heading: density of the magnetic direction, deg sqrt(s); timing: the same per angular
    rate, s sqrt(s), for a field delayed against the gyros; disturbance: time constant of
    disturbances of the field or the specific force, s. All 0: white noise alone.
    """
    return begin(
        SLOTS, start, noise, low_pass, acceleration, rate_error, heading, timing, disturbance
    )


def begin(
    slots: Slots,
    start: InitialState,
    noise: Noise,
    low_pass: float,
    acceleration: float,
    rate_error: float,
    heading: float = 1.7,
    timing: float = 0.03,
    disturbance: float = 10.0,
) -> FilterState:
    """The filter state at `start` of a filter with this attitude, whose slots continue ATTITUDE; the
    options are those of `attitude-mekf`."""
    for name, value, unit in (
        ("low_pass", low_pass, "s"),
        ("acceleration", acceleration, "m/s^2 sqrt(s)"),
        ("rate_error", rate_error, "sqrt(s)"),
        ("heading", heading, "deg sqrt(s)"),
        ("timing", timing, "s sqrt(s)"),
        ("disturbance", disturbance, "s"),
    ):
        check_number(value, name, unit, least=0)
    belief = start.belief(allocate(slots))
    for i in range(15):
        belief.P[i, i] *= i in SIX
    workspace, lat = belief.workspace, belief.lla[0]
    workspace[EARTH_N], workspace[EARTH_D] = RATE * math.cos(lat), -RATE * math.sin(lat)
    workspace[LOW_PASS], workspace[ACCELERATION], workspace[RATE_ERROR] = (
        low_pass,
        acceleration**2 + noise.accel**2,
        rate_error**2,
    )
    workspace[HEADING], workspace[TIMING], workspace[DISTURBANCE], workspace[TOLD] = (
        math.radians(heading) ** 2,
        timing**2,
        disturbance,
        noise.accel,
    )
    workspace[GRAVITY] = gravity(math.sin(lat), belief.lla[2])
    if disturbance > 0:
        workspace[BIAS_VARIANCE] = np.square(start.std[9:12])
    workspace[SPIN] = (4 * STILL) ** 2  # not at rest until it is seen
    workspace[CLOCK] = workspace[SEEN_AT] = GONE  # so that at 0 nothing is used
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Turn the attitude with the bias-free gyros, grow P, and correct both by the vertical."""
    predict_attitude(belief, u, dt, noise)
    belief.workspace[FORCE_EXCESS] = belief.workspace[EXCESS]


@helper
def predict_attitude(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """The step of `predict`, for every filter with this attitude."""
    workspace, b_g = belief.workspace, belief.b_g
    if dt <= 0:
        _write_nothing(workspace)
        return
    sensitivity = matrix(workspace, SENSITIVITY, 6, 3)
    count_bias(belief.P, sensitivity, workspace[BIAS_VARIANCE], -1.0)
    r0, r1, r2 = u[0] - b_g[0] * dt, u[1] - b_g[1] * dt, u[2] - b_g[2] * dt
    w0, w2 = workspace[EARTH_N] * dt, workspace[EARTH_D] * dt
    keep = decay(noise.gyro_decay * dt)
    _write_step(workspace, belief.C_nb, w0, w2, keep, dt)
    turned_square = r0 * r0 + r1 * r1 + r2 * r2
    q = noise.gyro * noise.gyro * dt + workspace[RATE_ERROR] * turned_square / dt
    q += attitude_noise_growth(workspace) * dt
    propagate(belief.P, belief.C_nb, w0, w2, q, dt, noise)
    keep = decay(of_estimates(noise).gyro_decay * dt)
    carry_bias(sensitivity, belief.C_nb, w0, w2, keep, dt)
    count_time(belief, r0, r1, r2, dt)
    turn(belief, r0, r1, r2, w0, w2, dt)
    for i in range(3):
        b_g[i] *= keep
    workspace[SINCE] += dt
    made_up = noise.accel > workspace[TOLD]  # the loop adds noise in a gap
    workspace[SECONDS] = low_passed(
        belief, u, r0, r1, r2, dt, workspace[LOW_PASS], workspace[SECONDS], made_up
    )
    if made_up:
        workspace[ELAPSED] = 0.0  # what the body did meanwhile is as unknown as before the start
    else:
        _level(belief, dt, noise.gyro * noise.gyro / dt)
    count_bias(belief.P, sensitivity, workspace[BIAS_VARIANCE], 1.0)
    workspace[HOLDS] = active_condition(belief)


@helper
def count_time(belief: FilterState, r0: float, r1: float, r2: float, dt: float) -> None:
    """Count the time and what the body turns in it, the rotation vector r (body, rad). The sum is
    taken in n, where noise and swings to and fro cancel; corrections of the attitude are no
    turns."""
    belief.workspace[CLOCK] += dt
    total, part = belief.workspace[TURN], rotate_vector(belief.C_nb, r0, r1, r2)
    for i in range(3):
        total[i] += part[i]


@helper
def _write_step(workspace: Array, C: Array, w0: float, w2: float, keep: float, dt: float) -> None:
    """Leave the transition of this step for the smoother, and the records of its two level rows
    empty."""
    last = workspace[LAST]
    step, first, second = last[STEP], last[FIRST_RECORD], last[SECOND_RECORD]
    for i in range(3):
        for j in range(3):
            step[TURNED + 3 * i + j] = dt * C[i, j]
    step[NORTH], step[DOWN], step[KEEP] = w0, w2, keep
    last[LAST_CALL] = PREDICTED
    for i in range(first.size):
        first[i] = second[i] = 0.0


@helper
def _write_nothing(workspace: Array) -> None:
    """Leave word for the smoother that the call changed nothing."""
    last = workspace[LAST]
    last[LAST_CALL], last[FIRST_RECORD][INVERSE] = FIX, 0.0


@helper
def _level(belief: FilterState, dt: float, q: float) -> None:
    """Correct by the carried specific force, which points up but for the body's own
    acceleration; its size tells how large a lasting one is."""
    f, dx, workspace, last = (
        belief.f,
        belief.workspace[DX],
        belief.workspace,
        belief.workspace[LAST],
    )
    size = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    if size < FREE_FALL_FORCE:
        return
    north, east = off_vertical(belief.C_nb, f)
    density = level_density(belief, size, north, east, dt, q)
    variance = density / (GRAVITY_EQUATOR * GRAVITY_EQUATOR * dt)
    for i in range(6):
        dx[i] = 0.0
    scalar_update(belief.P, 1.0, 0.0, 0.0, north, variance, math.inf, dx, last[FIRST_RECORD])
    scalar_update(belief.P, 0.0, 1.0, 0.0, east, variance, math.inf, dx, last[SECOND_RECORD])
    level_bias(belief, last[FIRST_RECORD][GAIN], last[SECOND_RECORD][GAIN])
    workspace[LEAN_N] -= dx[0]
    workspace[LEAN_E] -= dx[1]
    inject(belief, dx)


@helper
def level_bias(belief: FilterState, K_north: Array, K_east: Array) -> None:
    """Update the sensitivity to accelerometer biases for a levelling with these gains (6,)."""
    C, g = belief.C_nb, GRAVITY_EQUATOR
    sensitivity = matrix(belief.workspace, SENSITIVITY, 6, 3)
    about_north = (-C[1, 0] / g, -C[1, 1] / g, -C[1, 2] / g)
    about_east = (C[0, 0] / g, C[0, 1] / g, C[0, 2] / g)
    absorb_bias(sensitivity, K_north, 1.0, 0.0, 0.0, about_north)
    absorb_bias(sensitivity, K_east, 0.0, 1.0, 0.0, about_east)


@helper
def level_density(
    belief: FilterState, size: float, north: float, east: float, dt: float, q: float
) -> float:
    """Density (m^2/s^3) of what the carried specific force holds besides gravity. The body's own
    acceleration a lasts: with a correlation time tau it has the density 2 a^2 tau.

    a^2 is what the attitude shows beyond its own uncertainty, within what the size of the specific
    force allows: a horizontal acceleration makes it sqrt(g^2 + a^2).

    size: of the carried specific force, m/s^2; north, east: rotation that takes it to the vertical,
    rad; q: variance of the gyros' rate over dt, rad^2/s^2.
    """
    workspace, P, omega = belief.workspace, belief.P, belief.omega
    # means, because what shakes the body goes up and down
    g, share = workspace[GRAVITY], min(dt / LEAN_TIME, 1.0)
    workspace[EXCESS] += min(dt / SIZE_TIME, 1.0) * (size - g - workspace[EXCESS])
    rise = g - size * math.cos(math.sqrt(north * north + east * east))
    workspace[RISE] += min(dt / RISE_TIME, 1.0) * (rise - workspace[RISE])
    workspace[LEAN_N] += share * (north - workspace[LEAN_N])
    workspace[LEAN_E] += share * (east - workspace[LEAN_E])
    spin = omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]
    workspace[SPIN] += min(dt / SPIN_TIME, 1.0) * (spin - workspace[SPIN])
    workspace[ELAPSED] += dt
    n, e = workspace[LEAN_N], workspace[LEAN_E]
    white = workspace[ACCELERATION] / LEAN_TIME  # of both means
    shown = g * g * (n * n + e * e - P[6, 6] - P[7, 7]) - white
    excess = abs(workspace[EXCESS])
    least = max(2 * g * (excess - SIZE_ERROR), _hidden_acceleration(workspace, q))
    square = min(max(shown, least), 2 * g * (excess + SIZE_ERROR))
    return workspace[ACCELERATION] + 2 * workspace[DISTURBANCE] * square


@helper
def _hidden_acceleration(workspace: Array, q: float) -> float:
    """Square of the acceleration that a body may have had since the start without showing it,
    (m/s^2)^2; 0 once it was at rest, when its level was seen.

    The mean acceleration over a time t is a change of velocity over t: information on the vertical
    grows as (t/UNSEEN)^2, as that of a white density of UNSEEN^2/2t does.
    """
    if workspace[SPIN] < STILL * STILL + 3 * q:
        workspace[RESTED] = 1.0
    if workspace[RESTED] > 0 or workspace[DISTURBANCE] == 0:
        return 0.0
    return UNSEEN * UNSEEN / (4 * workspace[ELAPSED] * workspace[DISTURBANCE])


@helper
def attitude_noise_growth(workspace: Array) -> float:
    """Growth of the attitude's variance, rad^2/s, while the specific force contradicts it: within
    RISE_TIME by the tilt that would explain the contradiction."""
    rise = abs(workspace[RISE])
    return 2 * rise / (GRAVITY_EQUATOR * RISE_TIME) if rise > LASTING else 0.0


@helper
def active_condition(belief: FilterState) -> float:
    """Which of CONDITIONS holds, counted from 1; 0 for none."""
    workspace = belief.workspace
    clock, reason = workspace[CLOCK], 0.0
    headed = clock - workspace[HEADED] < GONE
    for s in range(MAGNETOMETERS):
        if workspace[REFUSED][s] > REFUSED_FOR and clock - workspace[SEEN_AT][s] < GONE:
            reason = workspace[REASON][s]
        elif clock - workspace[USED_AT][s] < GONE:
            headed = True
    if reason > 0 and not headed:
        return reason
    if abs(workspace[RISE]) > LASTING:
        return CONTRADICTED
    off = abs(workspace[OFF]) - OFF_ALLOWED
    if off > 0 and off * off > OFF_SDS * OFF_SDS * belief.P[8, 8]:
        if clock - workspace[OFF_AT] < GONE:
            return LASTS
    return reason + ASIDE if reason > 0 else 0.0


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
    """Correct by the horizontal direction of a magnetic field, whose innovation is an angle
    (rad), or by a heading."""
    workspace, n = belief.workspace, belief.P.shape[0]
    if kind == Kind.MAGNETIC_FIELD:
        return _field(belief, y, std, source, gate, innovation)
    H = matrix(workspace, JACOBIAN, 3, n)
    observe_innovation(belief, y, observe, source, innovation, H)
    nis = _update_row(belief, H[0, 6], H[0, 7], H[0, 8], innovation, std[0] * std[0], gate)
    if nis <= gate:
        workspace[HEADED] = workspace[CLOCK]
    return nis


@helper
def _update_row(
    belief: FilterState,
    h0: float,
    h1: float,
    h2: float,
    innovation: Array,
    variance: float,
    gate: float,
) -> float:
    """Correct by one row and whiten its innovation. Returns its NIS, NaN where it was not
    measured."""
    workspace, P = belief.workspace, belief.P
    dx, last, e = workspace[DX], workspace[LAST], innovation[0]
    last[LAST_CALL] = FIX
    seconds = workspace[CLOCK] - workspace[OFF_AT]
    workspace[OFF] += min(seconds / OFF_TIME, 1.0) * (e - workspace[OFF])
    workspace[OFF_AT] = workspace[CLOCK]
    sensitivity, biases = matrix(workspace, SENSITIVITY, 6, 3), workspace[BIAS_VARIANCE]
    for i in range(6):
        dx[i] = 0.0
    count_bias(P, sensitivity, biases, -1.0)
    by_bias, known = 0.0, variance
    for k in range(3):
        along = h0 * sensitivity[0, k] + h1 * sensitivity[1, k] + h2 * sensitivity[2, k]
        by_bias += along * along * biases[k]
        row = h0 * P[6, 6 + k] + h1 * P[7, 6 + k] + h2 * P[8, 6 + k]
        known += row * (h0 if k == 0 else (h1 if k == 1 else h2))
    # the biases widen what is expected of the innovation, but make no gains
    wider, record = 1 + (by_bias / known if known > 0 else 0.0), last[FIRST_RECORD]
    nis = scalar_update(P, h0, h1, h2, e, variance, gate * wider, dx, record) / wider
    if record[INVERSE] > 0:
        absorb_bias(sensitivity, record[GAIN], h0, h1, h2, (0.0, 0.0, 0.0))
    count_bias(P, sensitivity, biases, 1.0)
    if innovation.size > 3:
        innovation[3] = math.copysign(math.sqrt(nis), e)
    if innovation.size > 6:
        prior = known - variance
        innovation[6] = math.sqrt((prior + max(variance, MIN_NOISE * prior)) * wider)
    inject(belief, dx)
    return nis


@helper
def _field(
    belief: FilterState, y: Array, std: Array, source: SourceRow, gate: float, innovation: Array
) -> float:
    """Declination less the azimuth of the field y (T, body), turned to n; its derivative is
    exact in all three attitude errors."""
    C, workspace = belief.C_nb, belief.workspace
    north, east, down = rotate_vector(C, y[0], y[1], y[2])
    square = north * north + east * east
    for i in range(innovation.size):
        innovation[i] = math.nan
    if not (
        square > 0
        and source.parameters[0] * source.parameters[0]
        + source.parameters[1] * source.parameters[1]
        > 0
    ):
        _write_nothing(workspace)
        return math.nan
    # of two fields at one time the second is another magnetometer's
    seconds = min(workspace[SINCE], 1.0) if workspace[SINCE] > 0 else workspace[INTERVAL]
    if is_field_rejected(belief, y, std, source, square, down):
        workspace[SINCE] = 0.0
        _write_nothing(workspace)
        return math.nan
    innovation[0] = math.atan2(
        source.parameters[1] * north - source.parameters[0] * east,
        source.parameters[0] * north + source.parameters[1] * east,
    )
    density, strength, dip = field_density(belief, source, square, down, seconds)
    variance = (std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / (3 * square) + (
        density / seconds if seconds > 0 else 0.0
    )
    nis = _update_row(
        belief, -north * down / square, -east * down / square, 1.0, innovation, variance, gate
    )
    if nis <= gate:
        workspace[SINCE], workspace[INTERVAL] = 0.0, seconds
        field_used(workspace, source, strength, dip)
    return nis


@helper
def field_used(workspace: Array, source: SourceRow, strength: float, dip: float) -> None:
    """Book a used field: when, and what `field_density` followed."""
    s = _magnetometer(source)
    workspace[USED_AT][s], workspace[STRENGTH][s] = workspace[CLOCK], strength
    workspace[DIP][s] = dip


@helper
def _magnetometer(source: SourceRow) -> int:
    """Whose books are those of a source."""
    return min(source.of_kind, MAGNETOMETERS - 1)


@helper
def _reference_field(source: SourceRow) -> tuple[float, float]:
    """Strength (T) and dip (rad) of the reference field."""
    horizontal = math.sqrt(
        source.parameters[0] * source.parameters[0] + source.parameters[1] * source.parameters[1]
    )
    return math.hypot(horizontal, source.parameters[2]), math.atan2(
        source.parameters[2], horizontal
    )


@helper
def is_field_rejected(
    belief: FilterState, y: Array, std: Array, source: SourceRow, square: float, down: float
) -> bool:
    """True where a field y (T) of that horizontal square (T^2) and downward part (T) is rejected as
    disturbed; updates the counts of its magnetometer."""
    workspace, P, s = belief.workspace, belief.P, _magnetometer(source)
    turn = _turn_since(workspace, s, y)
    strength, dip = _reference_field(source)
    noise = SURELY * math.sqrt((std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / 3)
    tilt = SURELY * math.sqrt(P[6, 6] + P[7, 7])
    size = math.sqrt(square + down * down)
    looks, reason = workspace[DISTURBANCE] > 0, 0.0
    if (
        looks
        and abs(math.atan2(down, math.sqrt(square)) - dip) > DIP_ALLOWED + noise / strength + tilt
    ):
        reason = DIPPING
    if looks and abs(size - strength) > STRENGTH_ALLOWED * strength + noise:
        reason = STRONG
    if turn > STUCK_TURN:
        reason = STUCK
    seconds, count = workspace[CLOCK] - workspace[SEEN_AT][s], workspace[REFUSED][s]
    if seconds >= GONE:
        count = 0.0
    seconds = min(seconds, 1.0)
    if reason > 0:
        workspace[REASON][s] = reason
    count += seconds if reason > 0 else -seconds
    workspace[REFUSED][s], workspace[SEEN_AT][s] = (
        min(max(count, 0.0), REFUSED_MAX),
        workspace[CLOCK],
    )
    return reason > 0


@helper
def _turn_since(workspace: Array, s: int, y: Array) -> float:
    """Angle (rad) by which the body has turned since magnetometer s gave another field than y."""
    last, now = matrix(workspace, FIELD, MAGNETOMETERS, 3), workspace[TURN]
    begin = matrix(workspace, TURN_AT, MAGNETOMETERS, 3)
    same, square = y[0] == last[s, 0] and y[1] == last[s, 1] and y[2] == last[s, 2], 0.0
    for i in range(3):
        last[s, i] = y[i]
        if not same:
            begin[s, i] = now[i]
        square += (now[i] - begin[s, i]) ** 2
    return math.sqrt(square)


@helper
def field_density(
    belief: FilterState, source: SourceRow, square: float, down: float, seconds: float
) -> tuple[float, float, float]:
    """Density (rad^2 s) of the azimuth of a field of that horizontal square (T^2) and downward
    part (T); its running strength (T) and dip (rad), followed."""
    workspace, omega, s = belief.workspace, belief.omega, _magnetometer(source)
    strength, dip = workspace[STRENGTH][s], workspace[DIP][s]
    if strength == 0:
        strength, dip = _reference_field(source)
    off, strength, dip = _departure(strength, dip, square, down, seconds)
    density = workspace[HEADING] + workspace[DISTURBANCE] * off
    density += workspace[TIMING] * (omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2])
    return density, strength, dip


@helper
def _departure(
    strength: float, dip: float, square: float, down: float, seconds: float
) -> tuple[float, float, float]:
    """Variance (rad^2) of the azimuth under a disturbance as large as the field is off the running
    strength (T) and dip (rad); and those, followed.

    Strength and dip see two of the three components of a disturbance; the third, across, turns the
    azimuth by it over the horizontal field.
    """
    size = math.sqrt(square + down * down)
    a, b = size / strength - 1, math.atan2(down, math.sqrt(square)) - dip
    off = a * a + b * b
    share = min(seconds / REFERENCE_TIME, 1.0) / max(1.0, off / (AGREES * AGREES))
    return off * size * size / square, strength * (1 + share * a), dip + share * b


@kernel(SAVE_STEP)
def save_step(belief: FilterState, record: Array) -> None:
    """Save the last call from workspace, and the part of P due to accelerometer biases: the gains
    do not use it, so that the smoother goes back with P without it."""
    workspace, last = belief.workspace, belief.workspace[LAST]
    sensitivity, variance = matrix(workspace, SENSITIVITY, 6, 3), workspace[BIAS_VARIANCE]
    for i in range(last.size):
        record[i] = last[i]
    considered = matrix(record, CONSIDERED, 6, 6)
    for i in range(6):
        for j in range(6):
            for k in range(3):
                considered[i, j] += variance[k] * sensitivity[i, k] * sensitivity[j, k]


def considered_covariance(record: Array) -> Array:
    """(calls, 15, 15): what of P is the accelerometer biases' in a record of `save_step`."""
    P = np.zeros((len(record), STATES, STATES))
    P[:, np.array(SIX)[:, None], SIX] = record[:, CONSIDERED : CONSIDERED + 36].reshape(-1, 6, 6)
    return P


@kernel(ADJOINT_STEP)
def adjoint_step(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `predict` or `correct`, from what it left in its record."""
    if call[LAST_CALL] == PREDICTED:
        adjoint_scalar_update(call[SECOND_RECORD], lam, Lam, work)
        adjoint_scalar_update(call[FIRST_RECORD], lam, Lam, work)
        adjoint_propagate_attitude(call[STEP], lam, Lam, work)
    else:
        adjoint_scalar_update(call[FIRST_RECORD], lam, Lam, work)


CONTRADICTION = Condition(
    f"the mean specific force along the vertical is off gravity by more than {LASTING:g} m/s^2, "
    f"which no body keeps up for {RISE_TIME:g} s: roll and pitch are wrong, by a start in a turn or "
    f"by the gyros; start at rest, check the gyros' axes, signs and unit"
)
REFUSALS = (
    (
        f"the magnetic field stays the same number by number while the body turns by "
        f"{math.degrees(STUCK_TURN):.0f} deg",
        "check the magnetometer",
    ),
    (
        f"the magnetic field is off the known strength by more than {STRENGTH_ALLOWED:.0%}",
        "check the unit and iron near the magnetometer, and calibrate it",
    ),
    (
        f"the dip of the magnetic field is off the known one by more than "
        f"{math.degrees(DIP_ALLOWED):.0f} deg",
        "check signs and axes of the magnetometer and iron near it, or the attitude is wrong",
    ),
)
"""Reasons for a refusal, each with its remedy."""
CONDITIONS = (
    *(
        Condition(f"{seen}: not used, the heading drifts with the gyros; {remedy}")
        for seen, remedy in REFUSALS
    ),
    CONTRADICTION,
    *(
        Condition(f"{seen}: not used, another source measures the heading; {remedy}", False)
        for seen, remedy in REFUSALS
    ),
    Condition(
        "headings measured stay more than 5 deg off the filter's: the gyros, the field or the start "
        "are wrong; check unit, sign and bias of the gyros, and iron beside the magnetometer"
    ),
)
"""In the order of STUCK, STRONG, DIPPING, CONTRADICTED; then ASIDE."""


ATTITUDE_MEKF = Filter(
    "attitude-mekf",
    "Markley (2003), J. Guidance 26(2); Fossen (2021) section 14.4.3; vertical after Laidig & Seel "
    "(2023), VQF",
    start,
    predict,
    correct,
    states=SIX,
    estimates=SIX,
    uses=("magnetic-field", "heading"),
    unaided_note=UNAIDED,
    slots=SLOTS,
    conditions=CONDITIONS,
    condition=HOLDS,
    smoother=Smoother(lambda n: CALL.size, save_step, adjoint_step, considered_covariance),
    bias=DECAYING,
    good_for="attitude without GNSS, from a 6- or 9-axis IMU",
    poor_for="aircraft in long turns: it has no velocity",
)
