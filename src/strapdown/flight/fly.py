"""A flight: an aircraft flown by an autopilot on the estimates of a filter, so that estimation
error moves the aircraft."""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core import loop
from ..core.contract import STATES, Imu, Noise, Start
from ..core.jit import address, compile_kernel, entry_point
from ..data import DataError, Solution, Trajectory
from ..engine import batch
from ..filters import names as filter_names
from ..recording import Recording
from ..sensor_models.datasheet_units import real
from ..sensor_models.gnss import Gnss, without_fixes
from ..sensor_models.imu import grade, saturated
from ..sim.scenario import START_SD
from ..sim.synthesis import draw_start
from . import flight_loop as kernels
from .aircraft.dynamics import evaluate, step
from .aircraft.modes import check_step, linearise
from .aircraft.parameters import GRAVITY, LATITUDE_RATE, LONGITUDE_RATE, Aircraft
from .aircraft.parameters import aircraft as find_aircraft
from .aircraft.trim import Trim, trim
from .aircraft.wind import NORMALS, begin, gust
from .aircraft.wind import turbulence as gusts
from .autopilot import KIND, LINE_KIND, MEMORY_SIZE, RISE, SPEED
from .autopilot_gains import Gains, gains, pilot_array
from .checks import check, check_sensors, checked_filter, checked_windows, handed, times
from .plan import FlightPlan, flight_plan, route
from .sensor_errors import barometer_errors, fix_errors, generator, imu_errors, in_loop_order

LOG = (
    "elevator command, rad",
    "aileron command, rad",
    "rudder command, rad",
    "throttle command",
    "elevator, rad",
    "aileron, rad",
    "rudder, rad",
    "throttle",
    "Fx, N",
    "Fy, N",
    "Fz, N",
    "Gx, N m",
    "Gy, N m",
    "Gz, N m",
    "airspeed, m/s",
    "angle of attack, rad",
    "sideslip, rad",
    "propeller speed, rad/s",
    "u, m/s",
    "v, m/s",
    "w, m/s",
    "p, rad/s",
    "q, rad/s",
    "r, rad/s",
    "wind north, m/s",
    "wind east, m/s",
    "wind down, m/s",
    "commanded course, rad",
    "commanded roll, rad",
    "commanded pitch, rad",
    "commanded height, m",
    "commanded airspeed, m/s",
    "right of route, m",
    "above route, m",
    "segment",
    "model predicts",
)
"""Columns of a flight's log, at the ends of the IMU samples: commands; positions of the
controls; force and moment of air and propeller in body axes; airspeed and flow angles; velocity
over ground and omega_ib in body axes; wind with its gusts; what the autopilot asks for; how far
the aircraft, not its estimate, is off its route; row of the route; 1 where the aircraft's model
stands in for the IMU."""
MODEL_NOISE = Noise(0.04, 0.4, 1e-5, 1e-4, 0.0, 0.0)
"""What a filter assumes of the increments of the aircraft's model by default: the air that the
model does not know, as random walks of 2.3 deg/sqrt(s) and 0.4 m/s/sqrt(s), which is what they
err by over a second of light turbulence (docs/flight.md has the measurement)."""
ENDINGS = {
    kernels.GROUND: "the aircraft hit the ground",
    kernels.STALL: f"the aircraft was stalled for {kernels.STALL_PATIENCE:g} s",
    kernels.ATTITUDE: "the aircraft was upside down or within 5 deg of the vertical",
    kernels.NUMBER: "the aircraft's state is not finite",
    kernels.FILTER: "the filter diverged or left the latitudes where results hold",
}


class Stop(NamedTuple):
    """Why and where a flight ended before its time."""

    t: float  # s
    cause: str
    state: np.ndarray  # (17,) of the aircraft, see aircraft.dynamics

    def __str__(self):
        return f"the flight stopped at {self.t:.2f} s: {self.cause}"


@dataclass(frozen=True, repr=False)
class Flight:
    """What became of a flight; all of it up to where it stopped."""

    recording: Recording  # what the sensors measured, the truth as reference
    solution: Solution  # what the filter made of it on the way
    log: dict  # columns of LOG and "t, s" -> (n,)
    stopped: Stop | None  # None: it was flown to its end
    start: Start  # of the filter
    plan: FlightPlan
    trim: Trim
    gains: Gains
    route: np.ndarray = field(
        compare=False
    )  # segments as the autopilot flies them, see autopilot.py

    def __repr__(self):
        end = (
            str(self.stopped)
            if self.stopped
            else f"{self.recording.imu.t[-1]:.1f} s flown to the end"
        )
        return f"Flight({self.plan.name} on {self.solution.meta.get('filter', '')}: {end})"


def fly(
    plan="straight",
    filter="closed-loop",
    imu="industrial",
    seed=0,
    outage=None,
    feedback="estimate",
    prediction="imu",
    aircraft="aerosonde",
    earth="geodetic",
    turbulence="none",
    wind=(0.0, 0.0, 0.0),
    told_wind=None,
    gnss=Gnss(interval=0.2),
    gate=None,
    rate=100.0,
    duration=None,
    start=None,
    start_sd=START_SD,
    noise=None,
    model_noise=MODEL_NOISE,
    inputs=None,
    barometer=None,
    covariance=False,
    say=None,
    progress=None,
    **options,
):
    """The Flight of `aircraft` (name, file or Aircraft) along `plan` (a name, see PLANS, a TOML
    file or a FlightPlan) on the estimates of `filter`.

    imu: grade, file or ImuSpec; gnss: a Gnss, `gate` that of its fixes; rate: IMU samples per
    second; outage: when the receiver is cut, "15:" (s, to the end), "15:40,60:70" or a list of
    (start, stop); wind: steady, NED, m/s; told_wind: what autopilot and model are told of it (None:
    all); turbulence: a level of aircraft.wind.LEVELS; earth: "geodetic", or "flat" for filters of a
    flat Earth; start: a Start at 0 s (None: drawn around the truth with `start_sd`, 15 numbers,
    None: the IMU's own biases); noise: a Noise in place of the IMU's; barometer: a Barometer, which
    no outage touches; options: the filter's own. A filter that has options called `seed`,
    `aircraft`, `rate` or `earth` gets the flight's: a seed drawn from `seed`, the aircraft that is
    flown, the IMU's rate, the Earth. recording.meta["filter_options"] has all options of the
    filter, so that fuse(flight.recording, filter, start=flight.start,
    **flight.recording.meta["filter_options"]) repeats the solution (prediction="imu").

    feedback: what the autopilot flies by, "estimate" or "truth". prediction: who predicts while the
    receiver is cut: "imu", or "model": the filter gets the increments of the same aircraft model,
    flown from its own belief with the commands and the told wind, and assumes `model_noise`.
    inputs: of a filter that computes with controls: before each sample workspace[inputs : inputs +
    9] gets 1 where the model is to predict, the controls (elevator, aileron, rudder, throttle), the
    told wind and the sample's seconds; its samples stay the IMU's. Sensor errors depend on the seed
    alone: two filters with one seed have the same. Raises DataError for what cannot be flown; a
    flight that diverges is no error, see Flight.stopped.
    """
    check(seed, feedback, prediction, earth, turbulence, wind, told_wind, rate, model_noise)
    check_sensors(gnss, gate, barometer, rate)
    filter = checked_filter(filter, feedback, prediction, barometer, inputs)
    plan, spec, craft = flight_plan(plan), grade(imu), find_aircraft(aircraft)
    told = tuple(map(float, wind if told_wind is None else told_wind))
    known = _known(
        plan,
        craft.name,
        tuple(craft.values.items()),
        craft.source,
        earth,
        tuple(map(float, wind)),
        told,
        1 / rate,
    )
    t, dt = times(plan.duration or known.seconds if duration is None else duration, rate)
    of_imu, of_gnss, of_start, of_air, of_filter, of_barometer = np.random.SeedSequence(seed).spawn(
        6
    )
    options |= handed(filter, of_filter, aircraft, rate, earth)
    windows = checked_windows(outage, prediction, float(t[-1]))
    errors, made = (
        imu_errors(spec, t, dt, of_imu),
        fix_errors(gnss._replace(outages=(*gnss.outages, *windows)), t, of_gnss, gate),
    )
    made = (
        made
        if barometer is None
        else made.with_those(barometer_errors(barometer, t, plan.place[2], of_barometer))
    )
    journal = _journal(known.trim, t, dt, windows, feedback, prediction, inputs)
    blank = _blank(
        t,
        dt,
        made.aidings,
        journal,
        name=plan.name,
        grade=str(imu) if isinstance(imu, (str, Path)) else spec,
        seed=seed,
        place=list(plan.place),
        outages=[[first, min(stop, float(t[-1]))] for first, stop in windows],
        aircraft=craft.name,
        feedback=feedback,
        prediction=prediction,
        earth=earth,
        turbulence=turbulence,
        wind=list(map(float, wind)),
        told_wind=list(told),
        filter_options=dict(options),
    )
    start = _started(start, start_sd, spec, blank.reference, of_start)
    run = batch.begin(blank, filter, spec, start, noise, 1, covariance, say, options)
    vehicle = _vehicle(known, plan, wind, told, turbulence, len(t), generator(of_air))
    steering = kernels.Steering(known.pilot, np.zeros(MEMORY_SIZE), known.route, np.array(told))
    _run(run, model_noise, vehicle, steering, errors, made, journal, progress)
    return _flight(run, blank, errors, spec, journal, vehicle, known, plan)


class _Known(NamedTuple):
    """What all flights of one plan, aircraft and wind share; nothing in it is written to, and a
    Flight has copies."""

    array: np.ndarray
    trim: Trim
    gains: Gains
    route: np.ndarray
    pilot: np.ndarray
    seconds: float


@lru_cache(maxsize=32)
def _known(plan, name, values, source, earth, wind, told, dt):
    craft = Aircraft(name, dict(values), source)
    array = craft.array(earth, plan.place)
    gravity, scales = float(array[GRAVITY]), (1 / array[LATITUDE_RATE], 1 / array[LONGITUDE_RATE])
    segments, seconds = route(plan, told, gravity)
    across = wind[1] * math.cos(plan.course) - wind[0] * math.sin(plan.course)
    if math.hypot(*wind) >= 0.9 * plan.begin_airspeed:
        raise DataError(
            f"a wind of {math.hypot(*wind):.3g} m/s is too fast for an airspeed of {plan.begin_airspeed:g} m/s; "
            "give less wind or fly faster"
        )
    heading = plan.course - math.asin(across / plan.begin_airspeed)
    begun = trim(
        craft, plan.begin_airspeed, origin=plan.place, course=heading, wind=wind, earth=earth
    )
    check_step(begun, dt)
    for speed, slope in {
        (float(row[SPEED]), float(row[RISE])) for row in segments if row[KIND] == LINE_KIND
    }:
        try:
            trim(craft, speed, climb=math.atan(slope), origin=plan.place)
        except DataError as error:
            raise DataError(
                f"plan {plan.name!r}: a leg that rises by {slope:.3g} m per m at {speed:g} m/s cannot be flown: {error}"
            ) from None
    found = gains(craft, begun, linearise(craft, begun), gravity)
    return _Known(
        array,
        begun,
        found,
        segments,
        pilot_array(found, craft, begun, plan.place, scales, gravity),
        seconds,
    )


def _blank(t, dt, aidings, journal, **meta):
    """The Recording of a flight before its first sample."""
    truth = Trajectory(np.zeros(1), journal.lla[:1], journal.v[:1], journal.q[:1])
    return Recording(
        Imu(t, dt, np.zeros((len(t), 3)), np.zeros((len(t), 3))),
        aidings,
        truth,
        {"notes": without_fixes(aidings), **meta},
    )


def _journal(trimmed, t, dt, windows, feedback, prediction, inputs):
    cut, at = np.zeros(len(t), np.int64), np.zeros(kernels.AT_SIZE, np.int64)
    for first, stop in windows:
        cut[(t - dt >= first - loop.SAME_TIME) & (t - dt < stop - loop.SAME_TIME)] = 1
    at[kernels.BY_TRUTH], at[kernels.BY_MODEL], at[kernels.INPUTS] = (
        feedback == "truth",
        prediction == "model",
        -1 if inputs is None else inputs,
    )
    rows = len(t) + 1
    journal = kernels.Journal(
        np.empty((rows, 3)),
        np.empty((rows, 3)),
        np.empty((rows, 4)),
        np.empty((len(t), kernels.LOG_WIDTH)),
        cut,
        at,
    )
    journal.lla[0], journal.v[0], journal.q[0] = (
        trimmed.state[0:3],
        trimmed.state[3:6],
        trimmed.state[6:10],
    )
    return journal


def _started(start, sd, spec, truth, of_start):
    """The filter's Start: as given, or drawn around the truth."""
    if start is not None:
        if isinstance(start, Start) and start.t != 0:
            raise DataError(f"the start is at {start.t:g} s; a flight begins at 0 s")
        return start
    if (
        np.ndim(sd) != 1
        or len(sd) != STATES
        or not all(value is None or real(value) for value in sd)
    ):
        raise DataError(
            f"start_sd must be {STATES} standard deviations; of the last six, None is the IMU's own"
        )
    accel, gyro = spec.bias_sd()
    own = [0.0] * 9 + [accel] * 3 + [gyro] * 3
    return draw_start(
        truth,
        [own[i] if value is None else value for i, value in enumerate(sd)],
        generator(of_start),
    )


def _vehicle(known, plan, wind, told, level, rows, rng):
    craft, work = known.trim.aircraft, np.zeros(kernels.WORK_SIZE)
    work[kernels.TOLD : kernels.TOLD + 3] = told
    work[kernels.LOADS + kernels.AIR_SPEED] = known.trim.airspeed
    numbers = gusts(level, plan.clearance, craft["span"])
    blowing = numbers[kernels.SD_U] > 0
    state = known.trim.state.copy()
    return kernels.Vehicle(
        known.array,
        state,
        known.trim.commands.copy(),
        np.r_[np.asarray(wind, float), np.zeros(6)],
        state.copy(),
        numbers,
        begin(numbers, rng.standard_normal(NORMALS)),
        rng.standard_normal((rows if blowing else 1, NORMALS)),
        np.array([plan.place[2] - plan.clearance, craft["stall_alpha"]]),
        work,
    )


def _run(run, model_noise, vehicle, steering, errors, made, journal, progress):
    """Fly to the end, in chunks that let a keyboard and a progress bar in."""
    model_noise, first, room = (
        Noise(*map(float, model_noise)),
        int(journal.at[kernels.INPUTS]),
        run.belief.workspace.size,
    )
    if first >= 0 and first + 9 > room:
        raise DataError(
            f"inputs {first} to {first + 8} do not fit into the {room} numbers of workspace of {run.filter.name}"
        )
    errors = kernels.Errors(
        errors.dtheta,
        errors.dv,
        errors.numbers,
        *in_loop_order(run.fixes, run.recording.aidings, made),
    )
    for each in (step, evaluate, gust, kernels.fly):
        compile_kernel(each)
    go, at, rows = entry_point(kernels.fly), journal.at, len(run.samples.t)
    addresses = [address(each) for each in (step, evaluate, gust, loop.run)]
    while at[kernels.ROW] < rows and at[kernels.CAUSE] == kernels.FLYING:
        at[kernels.LAST] = min(int(at[kernels.ROW]) + batch.CHUNK, rows)
        go(
            *addresses,
            *run.kernels,
            run.belief,
            run.samples,
            run.fixes,
            run.noise,
            model_noise,
            run.cursor,
            run.out,
            vehicle,
            steering,
            errors,
            journal,
        )
        if progress:
            progress(at[kernels.ROW] / rows)


def _flight(run, blank, errors, spec, journal, vehicle, known, plan):
    """The Flight of what was flown."""
    rows, cause = int(journal.at[kernels.ROW]), int(journal.at[kernels.CAUSE])
    samples = Imu(*(column[:rows] for column in run.samples))
    truth = Trajectory(
        np.r_[0.0, samples.t], journal.lla[: rows + 1], journal.v[: rows + 1], journal.q[: rows + 1]
    )
    aidings = tuple(
        _measured(a, s, run.fixes, samples.t[-1]) for s, a in enumerate(run.recording.aidings)
    )
    notes = saturated(spec, samples)
    if journal.at[kernels.BY_MODEL] and journal.at[kernels.INPUTS] < 0:
        notes.append(
            f"{int(journal.cut[:rows].sum())} IMU samples are those of the aircraft's model, not measured"
        )
    stopped = None
    if cause != kernels.FLYING:
        stopped = Stop(float(samples.t[-1]), ENDINGS[cause], vehicle.state.copy())
        notes.append(str(stopped))
    more = {
        "b_a": errors.b_a[:rows],
        "b_g": errors.b_g[:rows],
        "notes": [*blank.meta["notes"], *notes],
    }
    recording = replace(
        blank, imu=samples, aidings=aidings, reference=truth, meta=blank.meta | more
    )
    filters = run.recording.meta["notes"][len(blank.meta["notes"]) :]
    if (
        blank.meta["earth"] == "flat"
        and run.filter.name in filter_names()
        and batch.positioned(run.filter)
    ):
        filters.append(
            f"{run.filter.name} navigates on the rotating Earth, and this flight's is flat and still: it errs by the difference"
        )
    used = replace(recording, meta=recording.meta | {"notes": more["notes"] + filters})
    solution = batch.solution(run._replace(recording=used, samples=samples))
    solution.meta["filter_options"] = dict(blank.meta["filter_options"])
    if stopped:
        solution.meta.setdefault("stopped", str(stopped))
        solution = replace(
            solution, events=tuple(sorted({*solution.events, (stopped.t, str(stopped))}))
        )
    log = {"t, s": samples.t, **{name: journal.log[:rows, i] for i, name in enumerate(LOG)}}
    trimmed = replace(
        known.trim,
        **{name: getattr(known.trim, name).copy() for name in ("state", "commands", "outputs")},
    )
    return Flight(
        recording, solution, log, stopped, run.start, plan, trimmed, known.gains, known.route.copy()
    )


def _measured(aiding, source, fixes, end):
    """The Aiding with what was measured until `end` (s)."""
    y = fixes.y[fixes.source == source]
    return replace(aiding, y=y[:, : aiding.y.shape[1]].copy())._where(
        aiding.t <= end + loop.SAME_TIME
    )
