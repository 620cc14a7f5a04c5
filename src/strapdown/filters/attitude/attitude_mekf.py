"""Attitude and gyro bias from gyros, specific force and magnetic field: a multiplicative extended
Kalman filter with six error states.

Its vertical is the specific force, carried along by the gyros and low-passed, so that the body's
own accelerations, whose mean over seconds is small, average out in a frame that does not turn with
the body. Of the magnetic field only the horizontal direction is used. How far strength and dip of
the field are from what they were tells how large a disturbance is there, and the direction is
trusted accordingly.
"""

import math
from collections.abc import Mapping

import numpy as np

from ...checks import check_number
from ...core.contract import (
    ADJOINT_STEP,
    CORRECT,
    MAGNETIC_KIND,
    PREDICT,
    SAVE_STEP,
    Belief,
    Filter,
    Noise,
    Observe,
    Slots,
    Smoother,
    Start,
    first_event,
    helper,
    kernel,
    matrix,
)
from ...core.earth import GRAVITY_EQUATOR, RATE
from ...core.error_state import DX, ERROR_STATE, JACOBIAN, allocate, observed
from ...core.kalman import decay
from ...core.rotation import turned
from ...typing import Array
from .attitude_error_state import (
    DOWN,
    FREE_FALL_FORCE,
    INVERSE,
    KEEP,
    NORTH,
    RECORD,
    SIX,
    TRANSITION,
    TURNED,
    UNAIDED,
    inject,
    low_passed,
    measured,
    off_vertical,
    propagate,
    turn,
    unmeasured,
    unpropagated,
)

CALL = Slots()
"""What the smoother needs of the last call."""
LAST_CALL = CALL.number("LAST_CALL")  # PREDICTED or FIX
STEP = CALL.part("STEP", TRANSITION)
# the scalar measurements
FIRST_RECORD = CALL.part("FIRST_RECORD", RECORD)
SECOND_RECORD = CALL.part("SECOND_RECORD", RECORD)
ATTITUDE = Slots(after=ERROR_STATE)
"""Of every filter with this attitude."""
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
# of the field, running: T, rad
STRENGTH, DIP = ATTITUDE.numbers("STRENGTH", "DIP")
TOLD = ATTITUDE.number("TOLD")  # accelerometer noise while there are samples
# mean of the size of the specific force less gravity, m/s^2
EXCESS = ATTITUDE.number("EXCESS")
SLOTS = Slots(after=ATTITUDE)
FORCE_EXCESS = SLOTS.output("force_excess [m/s^2]")
PREDICTED, FIX = 0.0, 1.0
REFERENCE_TIME = 20.0
"""s: time constant of the running strength and dip while the field agrees with them."""
AGREES = 0.05
"""Disagreement of strength (relative) and dip (rad) beyond which they are followed more slowly."""
LASTING = 1.0
"""m/s^2: an excess of the mean size of the specific force (a bank of 25 deg has as much) that
the user must know of."""
SIZE_TIME = 2.0
"""s: time constant of the mean size of the specific force."""
SIZE_ERROR = 0.15
"""m/s^2: what the size of the specific force at rest may differ by from gravity at the equator:
an accelerometer's bias, the latitude."""


def start(
    start: Start,
    noise: Noise,
    low_pass: float = 2.0,
    acceleration: float = 0.2,
    rate_error: float = 0.002,
    heading: float = 1.7,
    timing: float = 0.03,
    disturbance: float = 10.0,
) -> Belief:
    """Belief at `start`. What the sensors are assumed to do besides their white noise:

    low_pass: time constant of the specific force, s; acceleration: density of what it leaves of the
    body's own, m/s^2 sqrt(s); rate_error: scale errors of the gyros, per rate, sqrt(s); heading:
    density of the magnetic direction, deg sqrt(s); timing: the same per angular rate, s sqrt(s),
    for a field that lags behind the gyros; disturbance: how long one of the field or of the
    specific force lasts, s. All 0: white noise alone.
    """
    return begin(
        SLOTS, start, noise, low_pass, acceleration, rate_error, heading, timing, disturbance
    )


def begin(
    slots: Slots,
    start: Start,
    noise: Noise,
    low_pass: float,
    acceleration: float,
    rate_error: float,
    heading: float = 1.7,
    timing: float = 0.03,
    disturbance: float = 10.0,
) -> Belief:
    """Belief at `start` of a filter with this attitude, whose slots continue ATTITUDE; the
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
    return belief


@kernel(PREDICT)
def predict(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """Turn the attitude with the bias-free gyros, grow P, and correct both by the vertical."""
    predict_attitude(belief, u, dt, noise)
    belief.workspace[FORCE_EXCESS] = belief.workspace[EXCESS]


@helper
def predict_attitude(belief: Belief, u: Array, dt: float, noise: Noise) -> None:
    """The step of `predict`, for every filter with this attitude."""
    workspace, bg = belief.workspace, belief.bg
    if dt <= 0:
        _write_nothing(workspace)
        return
    r0, r1, r2 = u[0] - bg[0] * dt, u[1] - bg[1] * dt, u[2] - bg[2] * dt
    w0, w2 = workspace[EARTH_N] * dt, workspace[EARTH_D] * dt
    keep = decay(noise.gyro_decay * dt)
    _write_step(workspace, belief.C, w0, w2, keep, dt)
    q = noise.gyro * noise.gyro * dt + workspace[RATE_ERROR] * (r0 * r0 + r1 * r1 + r2 * r2) / dt
    propagate(belief.P, belief.C, w0, w2, q, dt, noise)
    turn(belief, r0, r1, r2, w0, w2, dt)
    for i in range(3):
        bg[i] *= keep
    workspace[SINCE] += dt
    made_up = noise.accel > workspace[TOLD]  # the loop adds noise in a gap
    workspace[SECONDS] = low_passed(
        belief, u, r0, r1, r2, dt, workspace[LOW_PASS], workspace[SECONDS], made_up
    )
    if not made_up:
        _level(belief, dt)


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
def _level(belief: Belief, dt: float) -> None:
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
    north, east = off_vertical(belief.C, f)
    # a mean, because what shakes the body goes up and down
    workspace[EXCESS] += min(dt / SIZE_TIME, 1.0) * (size - GRAVITY_EQUATOR - workspace[EXCESS])
    excess = max(abs(workspace[EXCESS]) - SIZE_ERROR, 0.0)
    variance = (workspace[ACCELERATION] + workspace[DISTURBANCE] * excess * excess) / (
        GRAVITY_EQUATOR * GRAVITY_EQUATOR * dt
    )
    for i in range(6):
        dx[i] = 0.0
    measured(belief.P, 1.0, 0.0, 0.0, north, variance, math.inf, dx, last[FIRST_RECORD])
    measured(belief.P, 0.0, 1.0, 0.0, east, variance, math.inf, dx, last[SECOND_RECORD])
    inject(belief, dx)


@kernel(CORRECT)
def correct(
    belief: Belief,
    y: Array,
    sd: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct by the horizontal direction of a magnetic field, whose innovation is an angle
    (rad), or by a heading."""
    workspace, n = belief.workspace, belief.P.shape[0]
    if kind == MAGNETIC_KIND:
        return _field(belief, y, sd, parameters, gate, innovation)
    H = matrix(workspace, JACOBIAN, 3, n)
    observed(belief, y, observe, parameters, innovation, H)
    return _used(belief, H[0, 6], H[0, 7], H[0, 8], innovation[0], sd[0] * sd[0], gate)


@helper
def _used(
    belief: Belief, h0: float, h1: float, h2: float, e: float, variance: float, gate: float
) -> float:
    """Correct by one row. Returns its NIS, NaN where it was not measured."""
    dx, last = belief.workspace[DX], belief.workspace[LAST]
    last[LAST_CALL] = FIX
    for i in range(6):
        dx[i] = 0.0
    nis = measured(belief.P, h0, h1, h2, e, variance, gate, dx, last[FIRST_RECORD])
    inject(belief, dx)
    return nis


@helper
def _field(
    belief: Belief, y: Array, sd: Array, parameters: Array, gate: float, innovation: Array
) -> float:
    """Declination less the azimuth of the field y (T, body), turned to n; its derivative is
    exact in all three attitude errors."""
    C, workspace, omega = belief.C, belief.workspace, belief.omega
    north, east, down = turned(C, y[0], y[1], y[2])
    square = north * north + east * east
    innovation[0] = innovation[1] = innovation[2] = math.nan
    if not (square > 0 and parameters[0] * parameters[0] + parameters[1] * parameters[1] > 0):
        _write_nothing(workspace)
        return math.nan
    innovation[0] = math.atan2(
        parameters[1] * north - parameters[0] * east, parameters[0] * north + parameters[1] * east
    )
    # of two fields at one time the second is another magnetometer's
    seconds = min(workspace[SINCE], 1.0) if workspace[SINCE] > 0 else workspace[INTERVAL]
    if workspace[STRENGTH] == 0:
        horizontal = parameters[0] * parameters[0] + parameters[1] * parameters[1]
        workspace[STRENGTH], workspace[DIP] = (
            math.sqrt(horizontal + parameters[2] * parameters[2]),
            math.atan2(parameters[2], math.sqrt(horizontal)),
        )
    off, strength, dip = _departure(workspace[STRENGTH], workspace[DIP], square, down, seconds)
    density = workspace[HEADING] + workspace[DISTURBANCE] * off
    density += workspace[TIMING] * (omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2])
    variance = (sd[0] * sd[0] + sd[1] * sd[1] + sd[2] * sd[2]) / (3 * square) + (
        density / seconds if seconds > 0 else 0.0
    )
    nis = _used(
        belief, -north * down / square, -east * down / square, 1.0, innovation[0], variance, gate
    )
    if nis <= gate:
        workspace[SINCE], workspace[INTERVAL], workspace[STRENGTH], workspace[DIP] = (
            0.0,
            seconds,
            strength,
            dip,
        )
    return nis


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
def save_step(belief: Belief, record: Array) -> None:
    """What the last call left in workspace."""
    last = belief.workspace[LAST]
    for i in range(last.size):
        record[i] = last[i]


@kernel(ADJOINT_STEP)
def adjoint_step(call: Array, lam: Array, Lam: Array, work: Array) -> None:
    """The adjoint of `predict` or `correct`, from what it left in its record."""
    if call[LAST_CALL] == PREDICTED:
        unmeasured(call[SECOND_RECORD], lam, Lam, work)
        unmeasured(call[FIRST_RECORD], lam, Lam, work)
        unpropagated(call[STEP], lam, Lam, work)
    else:
        unmeasured(call[FIRST_RECORD], lam, Lam, work)


def leaning(t: Array, lla: Array, columns: Mapping[str, Array]) -> list[tuple[float, str]]:
    """[(t, text)] where the mean size of the specific force first leaves gravity as it does in a
    long turn, else []."""
    lasting = np.abs(columns[SLOTS.columns[FORCE_EXCESS]]) > LASTING
    return first_event(
        t,
        lasting,
        f"the mean specific force is off gravity by more than {LASTING:g} m/s^2, at "
        f"{np.mean(lasting) if len(t) else 0:.0%} of the times: the body turns or accelerates for "
        f"long, and the vertical errs by more than it says",
    )


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
    diagnose=leaning,
    smoother=Smoother(lambda n: CALL.size, save_step, adjoint_step),
)
