"""The loop of a flight, one kernel: air, aircraft, sensors, the filter by the house's own loop one
sample at a time, autopilot, log. The aircraft, its autopilot and the IMU take one or more steps in
a sample of the filter, which gets the sum of their increments.

The filter runs through `core.loop.run`, so that splitting, gates, gaps and rows are the rules of
every other run, and `fuse` on the flight's recording gives the flight's own solution bit for bit.
"""

import math
from typing import NamedTuple

from ..aiding.pressure import (
    EXPONENT,
    LAPSE,
    P_0,
    P_TOP,
    SCALE_TOP,
    T_0,
    TROPOPAUSE,
    pressure_altitude,
)
from ..core.compile.jit import caller, helper, inlined, kernel, matrix
from ..core.compile.records import Table, rows_of
from ..core.compile.signatures import WHOLE, reals, record, signature, wholes
from ..core.loop import loop
from ..core.loop.contract import (
    Belief,
    Cursor,
    Fixes,
    Imu,
    Kernels,
    Kind,
    Noise,
    Output,
    Slots,
)
from ..core.loop.cursor import CURSOR
from ..core.loop.kernels import KERNELS
from ..core.loop.loop import RUN
from ..core.loop.tables import FIXES, IMU, OUTPUT
from ..core.mathematics.belief import BELIEF, NOISE
from ..core.mathematics.earth import radii
from ..core.mathematics.rotation import matrix_to_quaternion, turned, wrap
from ..typing import Array, Ints
from . import inputs
from .aircraft.dynamics import (
    AIRSPEED as AIR_SPEED,
    ALPHA,
    CONTROLS,
    EVALUATE,
    OMEGA,
    OUTPUTS,
    PROPELLER,
    QUATERNION,
    STATE_SIZE,
    STEP,
    VELOCITY,
)
from .aircraft.parameters import Parameters
from .aircraft.wind import GUST, SD_U
from .autopilot import (
    AIRSPEED,
    COURSE,
    PITCH,
    SEGMENT,
    TRIM_PITCH,
    deviation,
    height_along,
    metres,
    steer,
)

IMU_ERRORS = Slots()
"""What the IMU adds to its increments."""
# rotation to measured rotation, velocity increment to it, velocity increment to itself
DISTORTION = IMU_ERRORS.array("DISTORTION", 27)
# gyro, accelerometer; 0: none
STEP_SIZE = IMU_ERRORS.array("STEP_SIZE", 2)  # of counted increments
FULL_SCALE = IMU_ERRORS.array("FULL_SCALE", 2)
COUNTER = IMU_ERRORS.array("COUNTER", 6)  # before they are cut to whole steps
COUNTED = IMU_ERRORS.array("COUNTED", 6)  # and after
ROW, LAST, CAUSE, FILLED, BY_TRUTH, BY_MODEL, INPUTS, STALLED, STEPS, AT_SIZE = range(10)
"""Journal.at: next row, where to stop, why the flight ended, fixes measured so far, 1: the
autopilot flies by the truth, 1: the aircraft's model predicts while the receiver is cut, first
of the filter's inputs in workspace (-1: it takes none), samples in a row beyond the stall, steps
of the aircraft in a sample."""
FLYING, GROUND, STALL, ATTITUDE, NUMBER, FILTER = range(6)
COMMANDED, ACTUAL, OUTPUT_COLUMNS, BODY_VELOCITY, RATES, WIND, ASKED, OFF, LEG, CUT, LOG_WIDTH = (
    0,
    4,
    8,
    18,
    21,
    24,
    27,
    32,
    34,
    35,
    36,
)
"""Columns of the log: commands, positions of the controls, what `evaluate` tells up to the
propeller's speed, velocity over ground and rates in body axes, wind, what the autopilot asks
for, how far the aircraft is off its route, row of the route, whether the model predicts.
flight.LOG names them."""
WORK = Slots()
"""Vehicle.work."""
INCREMENTS = WORK.array("INCREMENTS", 6)
MODEL_INCREMENTS = WORK.array("MODEL_INCREMENTS", 6)
STEP_INCREMENTS = WORK.array("STEP_INCREMENTS", 6)  # as measured in the aircraft's last step
# of the steps of a sample so far: sums of the controls at mid-step
CONTROL_SUMS = WORK.array("CONTROL_SUMS", 4)
TRUE_C = WORK.matrix("TRUE_C", 3, 3)  # C_nb
RATE_ROWS = WORK.array("RATE_ROWS", 19)  # rates
TOLD = WORK.array("TOLD", 9)  # the wind that is told
LOADS = WORK.array("LOADS", OUTPUTS)  # what `evaluate` tells
# mean rates of change of velocity and body rates over the sample
SLOPES = WORK.array("SLOPES", 6)
STALL_PATIENCE = 1.0  # s
# of the pitch, beyond which the attitude counts as lost
SINE_STEEPEST_PITCH = math.sin(math.radians(85.0))


class Calls(NamedTuple):
    """Addresses of the kernels that a flight calls."""

    step: int
    evaluate: int
    gust: int
    run: int


class Vehicle(NamedTuple):
    """The aircraft in its air."""

    parameters: Table[Parameters]  # of the aircraft, one row
    state: Array  # (17,) see aircraft.dynamics
    commands: Array  # (4,)
    wind: Array  # (9,) steady (NED), gust velocity (body), gust rates
    model: Array  # (17,) the aircraft that predicts while the receiver is cut
    turbulence: Array  # numbers of the gusts
    gusts: Array  # their state
    normals: Array  # (n, k) white normals, of each step
    limits: Array  # height of the ground, m; largest angle of attack, rad
    work: Array  # see WORK


class Steering(NamedTuple):
    """The autopilot, see autopilot.py."""

    pilot: Array
    memory: Array
    route: Array
    wind: Array  # (3,) m/s NED: the steady wind it is told


class Errors(NamedTuple):
    """What the sensors add."""

    dtheta: Array  # (n, 3) rad, of each step of the aircraft
    dv: Array  # (n, 3) m/s
    numbers: Array  # see IMU_ERRORS
    # (m, 3) in the order of the fixes: m or m/s, NED; of a barometer Pa, and the ellipsoidal height
    # of its zero, m
    fix: Array
    # (m,) s: when each is measured; the receiver's are stamped later by its latency
    measured: Array
    order: Ints  # int64 (m,): the fixes in the order in which they are measured


class Journal(NamedTuple):
    """What happened."""

    lla: Array  # (n + 1, 3)
    v: Array  # (n + 1, 3)
    q: Array  # (n + 1, 4)
    log: Array  # (n, LOG_WIDTH)
    cut: Ints  # int64 (n,): 1 where the model may predict
    at: Ints  # int64


CALLS = record(Calls, step=WHOLE, evaluate=WHOLE, gust=WHOLE, run=WHOLE)
VEHICLE = record(
    Vehicle,
    parameters=rows_of(Parameters, 1),
    state=reals(STATE_SIZE),
    commands=reals(4),
    wind=reals(9),
    model=reals(STATE_SIZE),
    turbulence=reals("turbulence"),
    gusts=reals("gusts"),
    normals=reals("draws", "normals"),
    limits=reals(2),
    work=reals("vehicle_work"),
)
STEERING = record(
    Steering,
    pilot=reals("pilot"),
    memory=reals("memory"),
    route=reals("legs", "leg"),
    wind=reals(3),
)
ERRORS = record(
    Errors,
    dtheta=reals("steps", 3),
    dv=reals("steps", 3),
    numbers=reals("imu_errors"),
    fix=reals("measured", 3),
    measured=reals("measured"),
    order=wholes("measured"),
)
JOURNAL = record(
    Journal,
    lla=reals("moments_flown", 3),
    v=reals("moments_flown", 3),
    q=reals("moments_flown", 4),
    log=reals("flown", LOG_WIDTH),
    cut=wholes("flown"),
    at=wholes(AT_SIZE),
)
FLY = signature(
    "fly",
    calls=CALLS,
    kernels=KERNELS,
    belief=BELIEF,
    imu=IMU,
    fixes=FIXES,
    noise=NOISE,
    model_noise=NOISE,
    cursor=CURSOR,
    out=OUTPUT,
    vehicle=VEHICLE,
    steering=STEERING,
    errors=ERRORS,
    journal=JOURNAL,
)
run_at, step_at, evaluate_at, gust_at = (
    caller(RUN),
    caller(STEP),
    caller(EVALUATE),
    caller(GUST),
)


@kernel(FLY)
def fly(
    calls: Calls,
    kernels: Kernels,
    belief: Belief,
    imu: Imu,
    fixes: Fixes,
    noise: Noise,
    model_noise: Noise,
    cursor: Cursor,
    out: Output,
    vehicle: Vehicle,
    steering: Steering,
    errors: Errors,
    journal: Journal,
) -> None:
    """Fly the samples at[ROW] to at[LAST]; stops early, with at[CAUSE], where the flight ends.
    Commands must stand for the first sample."""
    at, state, work = journal.at, vehicle.state, vehicle.work
    C, steps = matrix(work, TRUE_C, 3, 3), at[STEPS]
    for row in range(at[ROW], at[LAST]):
        cut, h = journal.cut[row] * at[BY_MODEL], imu.dt[row] / steps
        imagined = cut == 1 and at[INPUTS] < 0
        _begin_sample(vehicle, belief, imu.dtheta[row], imu.dv[row], imagined)
        for k in range(steps):
            moment = row * steps + k
            if k > 0:  # by the last estimate
                _steer(steering, vehicle, belief, at[BY_TRUTH], h)
            _blow(calls.gust, vehicle, moment, h)
            _move(calls, vehicle, h, C)
            if imagined:
                _imagine(calls.step, vehicle, belief, h)
            else:
                _measure(work, errors, moment, h)
            _add(work[STEP_INCREMENTS], imu.dtheta[row], imu.dv[row])
            _fill(errors, fixes, at, state, C, imu.t[row] - (steps - 1 - k) * h, work[SLOPES])
        _tell(belief.workspace, at, cut, work, steering.wind, imu.dt[row])
        cursor.state[0].stop = row + 1
        assumed = model_noise if imagined else noise
        run_at(calls.run)(kernels, belief, imu, fixes, assumed, cursor, out)
        if not imagined:
            _learn(vehicle.model, state, belief)
        if at[BY_TRUTH] == 1 or cursor.state[0].fault == 0:
            _steer(steering, vehicle, belief, at[BY_TRUTH], h)
        _write(journal, row, vehicle, steering, C, cut)
        at[CAUSE] = (
            FILTER
            if cursor.state[0].fault
            else _cause(state, C, vehicle.limits, work[LOADS][ALPHA], at, imu.dt[row])
        )
        at[ROW] = row + 1
        if at[CAUSE] != FLYING:
            return


@helper
def _begin_sample(
    vehicle: Vehicle, belief: Belief, dtheta: Array, dv: Array, imagined: bool
) -> None:
    """Nothing is measured of a sample before its first step; the model, where it predicts, begins
    at the belief."""
    controls = vehicle.work[CONTROL_SUMS]
    for i in range(3):
        dtheta[i] = dv[i] = controls[i] = 0.0
    controls[3] = 0.0
    if imagined:
        _set_model(vehicle.model, belief)


@helper
def _blow(gust: int, vehicle: Vehicle, moment: int, h: float) -> None:
    """Go on with the gusts, if any blow, in the aircraft's step of that number."""
    if vehicle.turbulence[SD_U] > 0:
        gust_at(gust)(
            vehicle.turbulence,
            vehicle.gusts,
            vehicle.normals[moment],
            vehicle.work[LOADS][AIR_SPEED],
            h,
            vehicle.wind,
        )


@helper
def _add(measured: Array, dtheta: Array, dv: Array) -> None:
    """Add the increments of a step to those of its sample."""
    for i in range(3):
        dtheta[i] += measured[i]
        dv[i] += measured[3 + i]


@helper
def _imagine(step: int, vehicle: Vehicle, belief: Belief, h: float) -> None:
    """What the IMU would measure aboard the model in a step, biases included."""
    imaginary, measured = vehicle.work[MODEL_INCREMENTS], vehicle.work[STEP_INCREMENTS]
    step_at(step)(
        vehicle.parameters[0],
        vehicle.model,
        vehicle.commands,
        vehicle.work[TOLD],
        h,
        imaginary,
    )
    for i in range(3):
        measured[i] = imaginary[i] + belief.bg[i] * h
        measured[3 + i] = imaginary[3 + i] + belief.ba[i] * h


@helper
def _steer(steering: Steering, vehicle: Vehicle, belief: Belief, by_truth: int, h: float) -> None:
    """Commands for the next step, from the truth or the estimate."""
    state, work = vehicle.state, vehicle.work
    if by_truth == 1:
        steer(
            steering.pilot,
            steering.memory,
            steering.route,
            state[0:3],
            state[VELOCITY:QUATERNION],
            matrix(work, TRUE_C, 3, 3),
            state[OMEGA:CONTROLS],
            steering.wind,
            h,
            vehicle.commands,
        )
    else:
        steer(
            steering.pilot,
            steering.memory,
            steering.route,
            belief.lla,
            belief.v,
            belief.C,
            belief.omega,
            steering.wind,
            h,
            vehicle.commands,
        )


@inlined
def _move(calls: Calls, vehicle: Vehicle, dt: float, C: Array) -> None:
    """Move the aircraft by a step; leaves its increments, mean rates of change and loads in `work`,
    what its controls were among their sums, its attitude in C."""
    state, work, slopes, controls = (
        vehicle.state,
        vehicle.work,
        vehicle.work[SLOPES],
        vehicle.work[CONTROL_SUMS],
    )
    for i in range(3):
        slopes[i], slopes[3 + i] = -state[VELOCITY + i] / dt, -state[OMEGA + i] / dt
    before = (state[CONTROLS], state[CONTROLS + 1], state[CONTROLS + 2], state[CONTROLS + 3])
    step_at(calls.step)(
        vehicle.parameters[0], state, vehicle.commands, vehicle.wind, dt, work[INCREMENTS]
    )
    for i in range(3):
        slopes[i] += state[VELOCITY + i] / dt
        slopes[3 + i] += state[OMEGA + i] / dt
    for i in range(4):
        controls[i] += 0.5 * (before[i] + state[CONTROLS + i])
    _attitude(state[QUATERNION:CONTROLS], C)
    evaluate_at(calls.evaluate)(
        vehicle.parameters[0], state, vehicle.wind, work[RATE_ROWS], work[LOADS]
    )


@helper
def _attitude(q: Array, C: Array) -> None:
    """C_nb of a unit quaternion, scalar first."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    C[0, 0], C[0, 1], C[0, 2] = 1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)
    C[1, 0], C[1, 1], C[1, 2] = 2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)
    C[2, 0], C[2, 1], C[2, 2] = 2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)


@helper
def _set_model(model: Array, belief: Belief) -> None:
    """Position, velocity and attitude of the model from the belief; its rates and its controls
    go on."""
    for i in range(3):
        model[i], model[VELOCITY + i] = belief.lla[i], belief.v[i]
    matrix_to_quaternion(belief.C, model[QUATERNION:OMEGA])


@helper
def _learn(model: Array, state: Array, belief: Belief) -> None:
    """Rates of the model from the belief, as long as gyros are used; controls from the commands,
    which the model follows as the aircraft does."""
    for i in range(3):
        model[OMEGA + i] = belief.omega[i]
    for i in range(4):
        model[CONTROLS + i] = state[CONTROLS + i]


@helper
def _measure(work: Array, errors: Errors, moment: int, dt: float) -> None:
    """The increments of the aircraft's step of that number as the IMU measures them: distortion,
    bias and noise, counting, full scale."""
    true, measured, numbers = work[INCREMENTS], work[STEP_INCREMENTS], errors.numbers
    distortion = numbers[DISTORTION]
    for i in range(3):
        g, m, a = 3 * i, 9 + 3 * i, 18 + 3 * i
        dtheta = (
            errors.dtheta[moment, i]
            + distortion[g] * true[0]
            + distortion[g + 1] * true[1]
            + distortion[g + 2] * true[2]
            + distortion[m] * true[3]
            + distortion[m + 1] * true[4]
            + distortion[m + 2] * true[5]
            + true[i]
        )
        dv = (
            errors.dv[moment, i]
            + distortion[a] * true[3]
            + distortion[a + 1] * true[4]
            + distortion[a + 2] * true[5]
            + true[3 + i]
        )
        measured[i] = _read(numbers, 0, i, dtheta, dt)
        measured[3 + i] = _read(numbers, 1, 3 + i, dv, dt)


@helper
def _read(numbers: Array, sensor: int, axis: int, increment: float, dt: float) -> float:
    """An increment in whole steps of the counter and within full scale."""
    size, full = numbers[STEP_SIZE][sensor], numbers[FULL_SCALE][sensor] * dt
    if size > 0:
        numbers[COUNTER][axis] += increment / size
        count = math.floor(numbers[COUNTER][axis])
        increment = (count - numbers[COUNTED][axis]) * size
        numbers[COUNTED][axis] = count
    return min(max(increment, -full), full) if full > 0 else increment


@helper
def _tell(workspace: Array, at: Ints, cut: int, work: Array, wind: Array, dt: float) -> None:
    """The filter's inputs, where it takes any, see inputs.py."""
    if at[INPUTS] < 0:
        return
    own = workspace[at[INPUTS] : at[INPUTS] + inputs.TOLD_SIZE]
    controls, told = own[inputs.CONTROLS], own[inputs.WIND]
    own[inputs.BY_MODEL], own[inputs.SECONDS] = float(cut), dt
    for i in range(4):
        controls[i] = work[CONTROL_SUMS][i] / at[STEPS]
    for i in range(3):
        told[i] = wind[i]


@helper
def _fill(
    errors: Errors, fixes: Fixes, at: Ints, state: Array, C: Array, t: float, slopes: Array
) -> None:
    """Measure what is due by t: position and velocity of antennas, pressure, with errors, back
    from t at the sample's mean accelerations."""
    a0, a1, a2 = slopes[0], slopes[1], slopes[2]
    while (
        at[FILLED] < fixes.t.size
        and errors.measured[errors.order[at[FILLED]]] <= t + loop.SAME_TIME
    ):
        k = errors.order[at[FILLED]]
        back, s, y, error = t - errors.measured[k], fixes.source[k], fixes.y[k], errors.fix[k]
        w0, w1, w2 = (
            state[OMEGA] - back * slopes[3],
            state[OMEGA + 1] - back * slopes[4],
            state[OMEGA + 2] - back * slopes[5],
        )
        arm = fixes.sources[s].parameters
        l0, l1, l2 = arm[0], arm[1], arm[2]
        m0, m1, m2 = turned(C, w1 * l2 - w2 * l1, w2 * l0 - w0 * l2, w0 * l1 - w1 * l0)
        if fixes.sources[s].kind == Kind.POSITION:
            R_M, R_N = radii(state[0])
            l0, l1, l2 = turned(C, l0, l1, l2)
            north = l0 + error[0] - back * (state[VELOCITY] + m0 - 0.5 * back * a0)
            east = l1 + error[1] - back * (state[VELOCITY + 1] + m1 - 0.5 * back * a1)
            down = l2 + error[2] - back * (state[VELOCITY + 2] + m2 - 0.5 * back * a2)
            y[0] = state[0] + north / (R_M + state[2])
            y[1] = wrap(state[1] + east / ((R_N + state[2]) * math.cos(state[0])))
            y[2] = state[2] - down
        elif (
            fixes.sources[s].kind == Kind.PRESSURE
            or fixes.sources[s].kind == Kind.PRESSURE_ALTITUDE
        ):
            _, _, down = turned(C, l0, l1, l2)
            height = state[2] - down + back * (state[VELOCITY + 2] + m2 - 0.5 * back * a2)
            y[0] = _pressure(height - error[1]) + error[0]
            if fixes.sources[s].kind == Kind.PRESSURE_ALTITUDE:
                y[0] = pressure_altitude(y[0])
        else:
            y[0] = state[VELOCITY] + m0 - back * a0 + error[0]
            y[1] = state[VELOCITY + 1] + m1 - back * a1 + error[1]
            y[2] = state[VELOCITY + 2] + m2 - back * a2 + error[2]
        at[FILLED] += 1


@helper
def _pressure(height: float) -> float:
    """Pressure of the standard atmosphere, Pa, at a height in it, m: `pressure_altitude`
    backwards."""
    if height > TROPOPAUSE:
        return P_TOP * math.exp((TROPOPAUSE - height) / SCALE_TOP)
    return P_0 * (1 - LAPSE * height / T_0) ** (1 / EXPONENT)


@helper
def _write(
    journal: Journal, row: int, vehicle: Vehicle, steering: Steering, C: Array, cut: int
) -> None:
    """The truth and the log after a sample."""
    state, work, memory, log = vehicle.state, vehicle.work, steering.memory, journal.log[row]
    for i in range(3):
        journal.lla[row + 1, i], journal.v[row + 1, i] = state[i], state[VELOCITY + i]
        log[RATES + i] = state[OMEGA + i]
        log[BODY_VELOCITY + i] = (
            C[0, i] * state[VELOCITY]
            + C[1, i] * state[VELOCITY + 1]
            + C[2, i] * state[VELOCITY + 2]
        )
    for i in range(4):
        journal.q[row + 1, i] = state[QUATERNION + i]
        log[COMMANDED + i], log[ACTUAL + i] = vehicle.commands[i], state[CONTROLS + i]
    for i in range(PROPELLER + 1):
        log[OUTPUT_COLUMNS + i] = work[LOADS][i]
    g0, g1, g2 = turned(C, vehicle.wind[3], vehicle.wind[4], vehicle.wind[5])
    log[WIND], log[WIND + 1], log[WIND + 2] = (
        vehicle.wind[0] + g0,
        vehicle.wind[1] + g1,
        vehicle.wind[2] + g2,
    )
    for i in range(COURSE, AIRSPEED + 1):
        log[ASKED + i - COURSE] = memory[i]
    log[ASKED + PITCH - COURSE] += steering.pilot[TRIM_PITCH]
    segment = steering.route[int(memory[SEGMENT])]
    north, east = metres(steering.pilot, state[0:3])
    right, along, _ = deviation(segment, north, east)
    log[OFF], log[OFF + 1] = right, state[2] - height_along(segment, along)
    log[LEG], log[CUT] = memory[SEGMENT], float(cut)


@inlined
def _cause(state: Array, C: Array, limits: Array, alpha: float, at: Ints, dt: float) -> int:
    """Why the flight cannot go on, or FLYING."""
    total = 0.0
    for i in range(CONTROLS):
        total += state[i]
    if not abs(total) < 1e12 or not abs(alpha) < 1e12:
        return NUMBER
    if state[2] < limits[0]:
        return GROUND
    if C[2, 2] < 0 or abs(C[2, 0]) > SINE_STEEPEST_PITCH:
        return ATTITUDE
    at[STALLED] = at[STALLED] + 1 if abs(alpha) > limits[1] else 0
    return STALL if at[STALLED] * dt > STALL_PATIENCE else FLYING
