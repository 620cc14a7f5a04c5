"""The loop of a flight, one kernel: air, aircraft, sensors, the filter by the house's own loop one
sample at a time, autopilot, log. The aircraft, its autopilot and the IMU take one or more steps in
a sample of the filter, which gets the sum of their increments.

The filter runs through `core.loop.run`, so that splitting, gates, gaps and rows are the rules of
every other run, and `fuse` on the flight's recording gives the flight's own solution bit for bit.
"""

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

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
from ..core.compile.jit import caller, helper, inline, kernel, matrix
from ..core.compile.records import Table, rows_of
from ..core.compile.signatures import WHOLE, reals, record, signature, wholes
from ..core.loop import loop
from ..core.loop.contract import (
    Cursor,
    FilterState,
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
from ..core.mathematics.rotation import matrix_to_quaternion, rotate_vector, wrap
from ..typing import Array, Ints
from . import inputs
from .aircraft_model.dynamics import (
    CONTROLS,
    EVALUATE,
    LLA,
    OMEGA,
    QUATERNION,
    STATE_SIZE,
    STEP,
    VELOCITY,
    Loads,
)
from .aircraft_model.parameters import Parameters
from .aircraft_model.wind import GUST, Turbulence
from .autopilot import STEERING, Steering, deviation, height_along, metres, steer

IMU_ERRORS = Slots()
"""Slots of what the IMU adds to its increments."""
# rotation to measured rotation, velocity increment to it, velocity increment to itself
DISTORTION = IMU_ERRORS.array("DISTORTION", 27)
# gyro, accelerometer; 0: none
STEP_SIZE = IMU_ERRORS.array("STEP_SIZE", 2)  # of counted increments
FULL_SCALE = IMU_ERRORS.array("FULL_SCALE", 2)
COUNTER = IMU_ERRORS.array("COUNTER", 6)  # before they are cut to whole steps
COUNTED = IMU_ERRORS.array("COUNTED", 6)  # and after


class Cause(IntEnum):
    """Why a flight ended."""

    FLYING = 0  # it goes on
    GROUND = 1
    STALL = 2
    ATTITUDE = 3
    NUMBER = 4
    FILTER = 5


class RouteProgress:
    """Where a flight stands, and how it is flown."""

    row: int  # next sample
    last: int  # where to stop
    cause: int  # a Cause
    filled: int  # fixes measured so far
    by_truth: int  # 1: the autopilot flies by the truth
    by_model: int  # 1: the aircraft's model predicts while the receiver is cut
    inputs: int  # first of the filter's inputs in workspace; -1: it takes none
    stalled: int  # samples in a row beyond the stall
    steps: int  # of the aircraft in a sample


class FlightLogRow:
    """Row of the log at the end of a sample. flight.LOG names its numbers."""

    commands: Annotated[Array, 4]
    controls: Annotated[Array, 4]  # positions
    # what `evaluate` tells
    force: Annotated[Array, 3]
    moment: Annotated[Array, 3]
    airspeed: float
    alpha: float
    beta: float
    propeller: float
    velocity: Annotated[Array, 3]  # over ground, body
    rates: Annotated[Array, 3]
    wind: Annotated[Array, 3]
    # what the autopilot asks for
    course: float
    roll: float
    pitch: float
    height: float
    asked_airspeed: float
    # how far the aircraft is off its route
    right: float
    above: float
    segment: float  # row of the route
    cut: float  # 1: the model predicts


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


class FlightVehicle(NamedTuple):
    """The aircraft in its air."""

    parameters: Table[Parameters]  # of the aircraft, one row
    state: Array  # (17,) see aircraft.dynamics
    commands: Array  # (4,)
    wind: Array  # (9,) steady (NED), gust velocity (body), gust rates
    model: Array  # (17,) the aircraft that predicts while the receiver is cut
    loads: Table[Loads]  # one row
    turbulence: Table[Turbulence]  # one row
    gusts: Array  # their state
    normals: Array  # (n, k) white normals, of each step
    limits: Array  # height of the ground, m; largest angle of attack, rad
    work: Array  # see WORK


class FlightErrors(NamedTuple):
    """Errors of the sensors."""

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
    """Results of the loop: the true motion, the log, and progress along the route."""

    lla: Array  # (n + 1, 3)
    v: Array  # (n + 1, 3)
    q: Array  # (n + 1, 4)
    log: Table[FlightLogRow]  # of the samples
    cut: Ints  # int64 (n,): 1 where the model may predict
    at: Table[RouteProgress]  # one row


CALLS = record(Calls, step=WHOLE, evaluate=WHOLE, gust=WHOLE, run=WHOLE)
VEHICLE = record(
    FlightVehicle,
    parameters=rows_of(Parameters, 1),
    state=reals(STATE_SIZE),
    commands=reals(4),
    wind=reals(9),
    model=reals(STATE_SIZE),
    loads=rows_of(Loads, 1),
    turbulence=rows_of(Turbulence, 1),
    gusts=reals("gusts"),
    normals=reals("draws", "normals"),
    limits=reals(2),
    work=reals("vehicle_work"),
)
ERRORS = record(
    FlightErrors,
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
    log=rows_of(FlightLogRow, "flown"),
    cut=wholes("flown"),
    at=rows_of(RouteProgress, 1),
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
    belief: FilterState,
    imu: Imu,
    fixes: Fixes,
    noise: Noise,
    model_noise: Noise,
    cursor: Cursor,
    out: Output,
    vehicle: FlightVehicle,
    steering: Steering,
    errors: FlightErrors,
    journal: Journal,
) -> None:
    """Fly the samples from `row` up to `last` of the progress; stops early, with its cause, where
    the flight ends. Commands must stand for the first sample."""
    at, state, work = journal.at[0], vehicle.state, vehicle.work
    C, steps = matrix(work, TRUE_C, 3, 3), at.steps
    for row in range(at.row, at.last):
        cut, h = journal.cut[row] * at.by_model, imu.dt[row] / steps
        imagined = cut == 1 and at.inputs < 0
        _begin_sample(vehicle, belief, imu.dtheta[row], imu.dv[row], imagined)
        for k in range(steps):
            moment = row * steps + k
            if k > 0:  # by the last estimate
                _steer(steering, vehicle, belief, at.by_truth, h)
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
        if at.by_truth == 1 or cursor.state[0].fault == 0:
            _steer(steering, vehicle, belief, at.by_truth, h)
        _write(journal, row, vehicle, steering, C, cut)
        at.cause = Cause.FILTER if cursor.state[0].fault else _cause(vehicle, C, at, imu.dt[row])
        at.row = row + 1
        if at.cause != Cause.FLYING:
            return


@helper
def _begin_sample(
    vehicle: FlightVehicle, belief: FilterState, dtheta: Array, dv: Array, imagined: bool
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
def _blow(gust: int, vehicle: FlightVehicle, moment: int, h: float) -> None:
    """Go on with the gusts, if any blow, in the aircraft's step of that number."""
    if vehicle.turbulence[0].std_u > 0:
        gust_at(gust)(
            vehicle.turbulence[0],
            vehicle.gusts,
            vehicle.normals[moment],
            vehicle.loads[0].airspeed,
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
def _imagine(step: int, vehicle: FlightVehicle, belief: FilterState, h: float) -> None:
    """Compute the increments that the IMU would measure aboard the model in a step, biases
    included."""
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
        measured[i] = imaginary[i] + belief.b_g[i] * h
        measured[3 + i] = imaginary[3 + i] + belief.b_a[i] * h


@helper
def _steer(
    steering: Steering, vehicle: FlightVehicle, belief: FilterState, by_truth: int, h: float
) -> None:
    """Commands for the next step, from the truth or the estimate."""
    state, commands = vehicle.state, vehicle.commands
    if by_truth == 1:
        C = matrix(vehicle.work, TRUE_C, 3, 3)
        steer(steering, state[LLA], state[VELOCITY], C, state[OMEGA], h, commands)
    else:
        steer(steering, belief.lla, belief.v_n, belief.C_nb, belief.omega, h, commands)


@inline
def _move(calls: Calls, vehicle: FlightVehicle, dt: float, C: Array) -> None:
    """Move the aircraft by a step; leaves its increments, mean rates of change and loads in `work`,
    what its controls were among their sums, its attitude in C."""
    state, work, slopes, sums = (
        vehicle.state,
        vehicle.work,
        vehicle.work[SLOPES],
        vehicle.work[CONTROL_SUMS],
    )
    v, omega, controls = state[VELOCITY], state[OMEGA], state[CONTROLS]
    for i in range(3):
        slopes[i], slopes[3 + i] = -v[i] / dt, -omega[i] / dt
    before = (controls[0], controls[1], controls[2], controls[3])
    step_at(calls.step)(
        vehicle.parameters[0], state, vehicle.commands, vehicle.wind, dt, work[INCREMENTS]
    )
    for i in range(3):
        slopes[i] += v[i] / dt
        slopes[3 + i] += omega[i] / dt
    for i in range(4):
        sums[i] += 0.5 * (before[i] + controls[i])
    _attitude(state[QUATERNION], C)
    evaluate_at(calls.evaluate)(
        vehicle.parameters[0], state, vehicle.wind, work[RATE_ROWS], vehicle.loads[0]
    )


@helper
def _attitude(q: Array, C: Array) -> None:
    """C_nb of a unit quaternion, scalar first."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    C[0, 0], C[0, 1], C[0, 2] = 1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)
    C[1, 0], C[1, 1], C[1, 2] = 2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)
    C[2, 0], C[2, 1], C[2, 2] = 2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)


@helper
def _set_model(model: Array, belief: FilterState) -> None:
    """Position, velocity and attitude of the model from the belief; its rates and its controls
    go on."""
    for i in range(3):
        model[LLA][i], model[VELOCITY][i] = belief.lla[i], belief.v_n[i]
    matrix_to_quaternion(belief.C_nb, model[QUATERNION])


@helper
def _learn(model: Array, state: Array, belief: FilterState) -> None:
    """Rates of the model from the belief, as long as gyros are used; controls from the commands,
    which the model follows as the aircraft does."""
    for i in range(3):
        model[OMEGA][i] = belief.omega[i]
    for i in range(4):
        model[CONTROLS][i] = state[CONTROLS][i]


@helper
def _measure(work: Array, errors: FlightErrors, moment: int, dt: float) -> None:
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
        measured[i] = _quantise(numbers, 0, i, dtheta, dt)
        measured[3 + i] = _quantise(numbers, 1, 3 + i, dv, dt)


@helper
def _quantise(numbers: Array, sensor: int, axis: int, increment: float, dt: float) -> float:
    """An increment in whole steps of the counter and within full scale."""
    size, full = numbers[STEP_SIZE][sensor], numbers[FULL_SCALE][sensor] * dt
    if size > 0:
        numbers[COUNTER][axis] += increment / size
        count = math.floor(numbers[COUNTER][axis])
        increment = (count - numbers[COUNTED][axis]) * size
        numbers[COUNTED][axis] = count
    return min(max(increment, -full), full) if full > 0 else increment


@helper
def _tell(
    workspace: Array, at: RouteProgress, cut: int, work: Array, wind: Array, dt: float
) -> None:
    """The filter's inputs, where it takes any, see inputs.py."""
    if at.inputs < 0:
        return
    own = workspace[at.inputs : at.inputs + inputs.TOLD_SIZE]
    controls, told = own[inputs.CONTROLS], own[inputs.WIND]
    own[inputs.BY_MODEL], own[inputs.SECONDS] = float(cut), dt
    for i in range(4):
        controls[i] = work[CONTROL_SUMS][i] / at.steps
    for i in range(3):
        told[i] = wind[i]


@helper
def _fill(
    errors: FlightErrors,
    fixes: Fixes,
    at: RouteProgress,
    state: Array,
    C: Array,
    t: float,
    slopes: Array,
) -> None:
    """Measure what is due by t: position and velocity of antennas, pressure, with errors, back
    from t at the sample's mean accelerations."""
    a0, a1, a2 = slopes[0], slopes[1], slopes[2]
    v, omega = state[VELOCITY], state[OMEGA]
    while (
        at.filled < fixes.t.size and errors.measured[errors.order[at.filled]] <= t + loop.SAME_TIME
    ):
        k = errors.order[at.filled]
        back, s, y, error = t - errors.measured[k], fixes.source[k], fixes.y[k], errors.fix[k]
        w0, w1, w2 = (
            omega[0] - back * slopes[3],
            omega[1] - back * slopes[4],
            omega[2] - back * slopes[5],
        )
        arm = fixes.sources[s].parameters
        l0, l1, l2 = arm[0], arm[1], arm[2]
        m0, m1, m2 = rotate_vector(C, w1 * l2 - w2 * l1, w2 * l0 - w0 * l2, w0 * l1 - w1 * l0)
        if fixes.sources[s].kind == Kind.POSITION:
            R_M, R_N = radii(state[0])
            l0, l1, l2 = rotate_vector(C, l0, l1, l2)
            north = l0 + error[0] - back * (v[0] + m0 - 0.5 * back * a0)
            east = l1 + error[1] - back * (v[1] + m1 - 0.5 * back * a1)
            down = l2 + error[2] - back * (v[2] + m2 - 0.5 * back * a2)
            y[0] = state[0] + north / (R_M + state[2])
            y[1] = wrap(state[1] + east / ((R_N + state[2]) * math.cos(state[0])))
            y[2] = state[2] - down
        elif (
            fixes.sources[s].kind == Kind.PRESSURE
            or fixes.sources[s].kind == Kind.PRESSURE_ALTITUDE
        ):
            _, _, down = rotate_vector(C, l0, l1, l2)
            height = state[2] - down + back * (v[2] + m2 - 0.5 * back * a2)
            y[0] = _pressure(height - error[1]) + error[0]
            if fixes.sources[s].kind == Kind.PRESSURE_ALTITUDE:
                y[0] = pressure_altitude(y[0])
        else:
            y[0] = v[0] + m0 - back * a0 + error[0]
            y[1] = v[1] + m1 - back * a1 + error[1]
            y[2] = v[2] + m2 - back * a2 + error[2]
        at.filled += 1


@helper
def _pressure(height: float) -> float:
    """Pressure of the standard atmosphere, Pa, at a height in it, m: `pressure_altitude`
    backwards."""
    if height > TROPOPAUSE:
        return P_TOP * math.exp((TROPOPAUSE - height) / SCALE_TOP)
    return P_0 * (1 - LAPSE * height / T_0) ** (1 / EXPONENT)


@helper
def _write(
    journal: Journal, row: int, vehicle: FlightVehicle, steering: Steering, C: Array, cut: int
) -> None:
    """The truth and the log after a sample."""
    state, log, loads = vehicle.state, journal.log[row], vehicle.loads[0]
    v = state[VELOCITY]
    g0, g1, g2 = rotate_vector(C, vehicle.wind[3], vehicle.wind[4], vehicle.wind[5])
    gust = (g0, g1, g2)
    for i in range(3):
        journal.lla[row + 1, i], journal.v[row + 1, i] = state[LLA][i], v[i]
        log.rates[i] = state[OMEGA][i]
        log.velocity[i] = C[0, i] * v[0] + C[1, i] * v[1] + C[2, i] * v[2]
        log.force[i], log.moment[i] = loads.force[i], loads.moment[i]
        log.wind[i] = vehicle.wind[i] + gust[i]
    for i in range(4):
        journal.q[row + 1, i] = state[QUATERNION][i]
        log.commands[i], log.controls[i] = vehicle.commands[i], state[CONTROLS][i]
    log.airspeed, log.alpha, log.beta = loads.airspeed, loads.alpha, loads.beta
    log.propeller, log.cut = loads.propeller, float(cut)
    _write_asked(log, steering, state[LLA])


@helper
def _write_asked(log: FlightLogRow, steering: Steering, lla: Array) -> None:
    """Write to the log the autopilot's set-points and the deviation of the aircraft from its
    route."""
    memory, pilot = steering.memory[0], steering.pilot[0]
    log.course, log.roll, log.pitch = memory.course, memory.roll, memory.pitch + pilot.trim_pitch
    log.height, log.asked_airspeed = memory.height, memory.airspeed
    segment = steering.route[memory.segment]
    north, east = metres(pilot, lla)
    right, along, _ = deviation(segment, north, east)
    log.right, log.above = right, lla[2] - height_along(segment, along)
    log.segment = float(memory.segment)


@inline
def _cause(vehicle: FlightVehicle, C: Array, at: RouteProgress, dt: float) -> int:
    """Why the flight cannot go on, or FLYING."""
    state, limits, alpha, total = vehicle.state, vehicle.limits, vehicle.loads[0].alpha, 0.0
    for i in range(CONTROLS.start):
        total += state[i]
    if not abs(total) < 1e12 or not abs(alpha) < 1e12:
        return Cause.NUMBER.value
    if state[2] < limits[0]:
        return Cause.GROUND.value
    if C[2, 2] < 0 or abs(C[2, 0]) > SINE_STEEPEST_PITCH:
        return Cause.ATTITUDE.value
    at.stalled = at.stalled + 1 if abs(alpha) > limits[1] else 0
    return Cause.STALL.value if at.stalled * dt > STALL_PATIENCE else Cause.FLYING.value
