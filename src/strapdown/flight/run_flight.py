"""A flight: an aircraft flown by an autopilot on the estimates of a filter, so that estimation
error moves the aircraft."""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from ..checks import DataError
from ..core.compile.jit import address, bind_kernel
from ..core.compile.records import Table, rows
from ..core.loop.contract import Filter, Fixes, Imu, InitialState, Noise
from ..core.loop.loop import SAME_TIME, run as run_samples
from ..data.recording import RecordingMeta, SimulatedRecording
from ..data.solution import Solution, Source, Trajectory
from ..data.value import Value
from ..engine.batch import begin as begin_run
from ..engine.finish import solution as solution_of
from ..engine.options import run_options
from ..engine.prepare import ROWS_AT_ONCE, Run, has_position
from ..filters import names as filter_names
from ..progress import listener, with_bar
from ..sensor_models.gnss import Gnss, without_fixes
from ..sensor_models.imu import ImuSpec, imu as imu_spec, saturation_notes
from ..sensor_models.receiver import receiver
from ..sensor_models.streams import RandomStream
from ..sim.scenario_model import start_deviations
from ..sim.synthesis import draw_start
from ..typing import Array, File, Progress
from . import flight_loop as kernels
from .aircraft_model.dynamics import Loads, evaluate, step
from .aircraft_model.modes import check_step, linearise
from .aircraft_model.parameters import Aircraft, Parameters, aircraft as find_aircraft
from .aircraft_model.trim import Trim, trim
from .aircraft_model.wind import NORMALS, Turbulence, begin, gust, turbulence as gusts
from .asked import LOOP, SENSORS, WORLD, Loop, Sensors, World, check_options
from .autopilot import Gains, Segment, Steering
from .autopilot_gains import gains, make_steering
from .inputs import TOLD_SIZE
from .plan import FlightPlan, flight_plan, route
from .refusals import (
    check,
    check_sensors,
    checked_filter,
    checked_windows,
    handed_options,
    steps_of,
    times,
)
from .sensor_errors import (
    FixErrors,
    ImuErrors,
    Windows,
    barometer_errors,
    fix_errors,
    imu_errors,
    in_loop_order,
)

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
ENDINGS = {
    kernels.Cause.GROUND: "the aircraft hit the ground",
    kernels.Cause.STALL: f"the aircraft was stalled for {kernels.STALL_PATIENCE:g} s",
    kernels.Cause.ATTITUDE: "the aircraft was upside down or within 5 deg of the vertical",
    kernels.Cause.NUMBER: "the aircraft's state is not finite",
    kernels.Cause.FILTER: "the filter diverged or left the latitudes where results hold",
}


class Stop(NamedTuple):
    """Why and where a flight ended before its time."""

    t: float  # s
    cause: str
    state: Array  # (17,) of the aircraft, see aircraft.dynamics

    def __str__(self) -> str:
        return f"the flight stopped at {self.t:.2f} s: {self.cause}"


@dataclass(frozen=True, eq=False, repr=False)
class Flight(Value):
    """Result of a flight, up to where it stopped.

    Attributes
    ----------
    recording : SimulatedRecording
        What the sensors measured, the truth as reference.
    solution : Solution
        What the filter made of it on the way.
    log : dict[str, Array]
        Columns of LOG and of time, s, (n,) each.
    stopped : Stop or None
        Why the flight ended early; None: it was flown to its end.
    start : InitialState
        InitialState of the filter.
    plan : FlightPlan
        What was to be flown.
    trim : Trim
        State in which it began.
    gains : Gains
        Gains of the autopilot.
    route : array
        Segments as the autopilot flies them, see autopilot.py.
    """

    recording: SimulatedRecording
    solution: Solution
    log: dict[str, Array]
    stopped: Stop | None
    start: InitialState
    plan: FlightPlan
    trim: Trim
    gains: Gains
    route: Table[Segment] = field(compare=False)

    def _repr_html_(self) -> str:
        from ..pages.notebook.cards import card

        return card(repr(self), {}, self.solution._repr_html_())

    def __repr__(self) -> str:
        end = (
            str(self.stopped)
            if self.stopped
            else f"{self.recording.imu.t[-1]:.1f} s flown to the end"
        )
        return f"Flight({self.plan.name} on {self.solution.meta.get('filter', '')}: {end})"


@with_bar("fly")
def fly(
    plan: FlightPlan | File = "straight",
    filter: Filter | str = "closed-loop",
    *,
    seed: int = 0,
    duration: float | None = None,
    world: World = WORLD,
    sensors: Sensors = SENSORS,
    loop: Loop = LOOP,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Flight:
    """Fly an aircraft along a plan on the estimates of a filter.

    A filter that has options called `seed`, `aircraft`, `rate` or `earth` gets the flight's: a seed
    drawn from `seed`, the aircraft that is flown, the rate of its samples, the Earth.
    recording.meta["filter_options"] has all options of the filter, so that fuse(flight.recording,
    filter, start=flight.start, options=flight.recording.meta["filter_options"]) repeats the solution
    (prediction="imu"). Sensor errors depend on the seed alone: two filters with one seed have the same.

    Parameters
    ----------
    plan : str, path or FlightPlan
        A name, see PLANS, a TOML file or the plan itself.
    filter : str or Filter
        Name of one of the filters, or one of your own.
    seed : int
        Of all random numbers.
    duration : float, optional
        s; by default the plan's.
    world : World
        Aircraft, Earth and air.
    sensors : Sensors
        IMU, receiver and barometer, and when the receiver is cut.
    loop : Loop
        Options by which the filter is run, and by what the autopilot flies.
    progress : bool or callable
        Called with the fraction done; True shows a bar with the time left.
    **options
        The filter's own.

    Returns
    -------
    Flight
        Recording, solution and log, up to where it stopped: a flight that diverges is no error, see
        `Flight.stopped`.

    Raises
    ------
    DataError
        For what cannot be flown.

    References
    ----------
    Beard & McLain (2012), "Small Unmanned Aircraft": aircraft and autopilot.
    """
    check(seed, world, sensors, loop)
    check_options(options)
    gnss = receiver(sensors.gnss)
    check_sensors(gnss, sensors)
    filter = checked_filter(filter, loop, sensors.barometer)
    plan, spec, craft = (
        flight_plan(plan),
        imu_spec(sensors.imu),
        find_aircraft(world.aircraft),
    )
    wind = tuple(map(float, world.wind))
    known = _known_flight(_Case(plan, craft, world.earth, wind, world.told, 1 / sensors.rate))
    steps = steps_of(sensors.rate, loop.filter_rate)
    seconds = plan.duration or known.seconds if duration is None else duration
    t, dt, flown, each = times(seconds, sensors.rate / steps, steps)
    stream = RandomStream.of(seed)
    options |= handed_options(filter, stream.child("filter"), world, sensors.rate / steps)
    windows = checked_windows(sensors.outage, loop.prediction, float(t[-1]))
    cut = gnss._replace(outages=(*gnss.outages, *windows))
    errors = imu_errors(spec, flown, each, stream.child("imu"))
    made = _fixes(cut, sensors, flown, plan.place[2], stream)
    journal = _journal(known.trim, t, dt, windows, loop)
    journal.at[0].steps = steps
    truth = Trajectory(np.zeros(1), journal.lla[:1], journal.v[:1], journal.q[:1])
    blank = _blank(
        t,
        dt,
        made.sources,
        truth,
        name=plan.name,
        grade=str(sensors.imu) if isinstance(sensors.imu, (str, Path)) else spec,
        seed=seed,
        place=list(plan.place),
        outages=[(first, min(stop, float(t[-1]))) for first, stop in windows],
        aircraft=craft.name,
        feedback=loop.feedback,
        prediction=loop.prediction,
        earth=world.earth,
        turbulence=world.turbulence,
        wind=list(wind),
        told_wind=list(world.told),
        filter_options=dict(options),
    )
    start = _draw_start(loop, spec, truth, stream.child("start"))
    asked = run_options(
        options=options,
        imu=spec,
        start=start,
        noise=loop.noise,
        covariance=loop.covariance,
        notify=loop.notify,
    )
    run = begin_run(blank, filter, asked)
    run = run._replace(samples=Imu(*(column.copy() for column in run.samples)))  # to be filled
    vehicle = _vehicle(known, plan, world, len(flown), stream.child("air"))
    underway = _Underway(run, blank, plan, known, spec, errors, made, vehicle, journal)
    _run(underway, loop.model_noise, listener(progress))
    return _flight(underway)


class _Case(NamedTuple):
    """Inputs that determine a flight's route, trim and gains."""

    plan: FlightPlan
    craft: Aircraft
    earth: str
    wind: tuple[float, ...]  # (3,) m/s NED
    told: tuple[float, ...]  # the part that the autopilot knows
    dt: float  # s, of a sample


class _Known(NamedTuple):
    """Values that all flights of one plan, aircraft and wind share; nothing in it is written to."""

    parameters: Parameters
    trim: Trim
    gains: Gains
    steering: Steering
    seconds: float


class _Underway(NamedTuple):
    """A flight on its way: what it flies with, and what it writes to."""

    run: Run
    blank: SimulatedRecording  # of the flight before its first sample
    plan: FlightPlan
    known: _Known
    spec: ImuSpec
    errors: ImuErrors
    made: FixErrors
    vehicle: kernels.FlightVehicle
    journal: kernels.Journal


@lru_cache(maxsize=32)
def _known_flight(case: _Case) -> _Known:
    plan, craft, earth, wind, told, dt = case
    parameters = craft.parameters(earth, plan.place)
    gravity = float(parameters.gravity)
    segments, seconds = route(plan, told, gravity)
    across = wind[1] * math.cos(plan.course) - wind[0] * math.sin(plan.course)
    if math.hypot(*wind) >= 0.9 * plan.begin_airspeed:
        raise DataError(
            f"a wind of {math.hypot(*wind):.3g} m/s is too fast for an airspeed of "
            f"{plan.begin_airspeed:g} m/s; "
            "give less wind or fly faster"
        )
    heading = plan.course - math.asin(across / plan.begin_airspeed)
    begun = trim(
        craft, plan.begin_airspeed, origin=plan.place, course=heading, wind=wind, earth=earth
    )
    check_step(begun, dt)
    for speed, slope in {
        (float(each.airspeed), float(each.rise)) for each in segments if not each.is_arc
    }:
        try:
            trim(craft, speed, climb=math.atan(slope), origin=plan.place)
        except DataError as error:
            raise DataError(
                f"plan {plan.name!r}: a leg that rises by {slope:.3g} m per m at {speed:g} m/s "
                f"cannot be flown: {error}"
            ) from None
    found = gains(craft, begun, linearise(craft, begun), gravity)
    return _Known(
        parameters,
        begun,
        found,
        make_steering(found, begun, parameters, segments, told),
        seconds,
    )


def _fixes(
    gnss: Gnss, sensors: Sensors, flown: Array, height: float, stream: RandomStream
) -> FixErrors:
    """The FixErrors of a receiver, and of a barometer about a height (m) where there is one."""
    made = fix_errors(gnss, flown, stream.child("gnss"), sensors.gate)
    if sensors.barometer is None:
        return made
    of_barometer = stream.child("barometer")
    return made.with_those(barometer_errors(sensors.barometer, flown, height, of_barometer))


def _blank(
    t: Array,
    dt: Array,
    sources: tuple[Source, ...],
    truth: Trajectory,
    **meta: Unpack[RecordingMeta],
) -> SimulatedRecording:
    """The Recording of a flight before its first sample."""
    return SimulatedRecording(
        Imu(t, dt, np.zeros((len(t), 3)), np.zeros((len(t), 3))),
        sources,
        reference=truth,
        meta={"notes": without_fixes(sources), **meta},
    )


def _journal(
    trimmed: Trim,
    t: Array,
    dt: Array,
    windows: Windows,
    asked: Loop,
) -> kernels.Journal:
    cut, at = np.zeros(len(t), np.int64), rows(kernels.RouteProgress, 1)
    cut[:] = asked.prediction == "model-always"
    for first, stop in windows:
        cut[(t - dt >= first - SAME_TIME) & (t - dt < stop - SAME_TIME)] = 1
    at[0].by_truth, at[0].by_model = asked.feedback == "truth", asked.prediction != "imu"
    at[0].inputs = -1 if asked.inputs is None else asked.inputs
    moments = len(t) + 1
    journal = kernels.Journal(
        np.empty((moments, 3)),
        np.empty((moments, 3)),
        np.empty((moments, 4)),
        rows(kernels.FlightLogRow, len(t)),
        cut,
        at,
    )
    journal.lla[0], journal.v[0], journal.q[0] = (
        trimmed.state[0:3],
        trimmed.state[3:6],
        trimmed.state[6:10],
    )
    return journal


def _draw_start(
    asked: Loop, spec: ImuSpec, truth: Trajectory, of_start: RandomStream
) -> InitialState:
    """The filter's InitialState: as given, or drawn around the truth."""
    if asked.start is not None:
        if isinstance(asked.start, InitialState) and asked.start.t != 0:
            raise DataError(f"the start is at {asked.start.t:g} s; a flight begins at 0 s")
        return asked.start
    return draw_start(truth, start_deviations(asked.start_std, spec), of_start)


def _vehicle(
    known: _Known,
    plan: FlightPlan,
    world: World,
    steps: int,
    of_air: RandomStream,
) -> kernels.FlightVehicle:
    craft, work, loads = known.trim.aircraft, kernels.WORK.zeros(), rows(Loads, 1)
    work[kernels.TOLD][:3] = world.told
    loads[0].airspeed = known.trim.airspeed
    turbulence, parameters = rows(Turbulence, 1), rows(Parameters, 1)
    turbulence[0] = blowing = gusts(world.turbulence, plan.clearance, craft["span"])
    parameters[0] = known.parameters
    state = known.trim.state.copy()
    return kernels.FlightVehicle(
        parameters,
        state,
        known.trim.commands.copy(),
        np.r_[np.asarray(world.wind, float), np.zeros(6)],
        state.copy(),
        loads,
        turbulence,
        begin(blowing, of_air.child("begin").standard_normal(NORMALS)),
        of_air.standard_normal((steps if blowing.std_u > 0 else 1, NORMALS)),
        np.array([plan.place[2] - plan.clearance, craft["stall_alpha"]]),
        work,
    )


def _run(underway: _Underway, model_noise: Noise, progress: Progress) -> None:
    """Fly to the end, in chunks that let a keyboard and a progress bar in."""
    run, journal = underway.run, underway.journal
    model_noise, first, room = (
        Noise(*map(float, model_noise)),
        int(journal.at[0].inputs),
        run.belief.workspace.size,
    )
    if first >= 0 and first + TOLD_SIZE > room:
        raise DataError(
            f"inputs {first} to {first + TOLD_SIZE - 1} do not fit into the {room} numbers of workspace of "
            f"{run.filter.name}"
        )
    errors = kernels.FlightErrors(
        underway.errors.dtheta,
        underway.errors.dv,
        underway.errors.numbers,
        *in_loop_order(run.fixes, run.recording.sources, underway.made),
    )
    at, count = journal.at[0], len(run.samples.t)
    known = underway.known.steering
    steered = known._replace(memory=known.memory.copy())
    go = bind_kernel(
        kernels.fly,
        kernels.Calls(*map(address, (step, evaluate, gust, run_samples))),
        run.kernels,
        run.belief,
        run.samples,
        run.fixes,
        run.noise,
        model_noise,
        run.cursor,
        run.out,
        underway.vehicle,
        steered,
        errors,
        journal,
    )
    while at.row < count and at.cause == kernels.Cause.FLYING:
        at.last = min(int(at.row) + ROWS_AT_ONCE, count)
        go()
        run.events.take(run.cursor)
        progress(at.row / count)


def _flight(underway: _Underway) -> Flight:
    """The Flight of what was flown."""
    run, blank, known, journal = underway.run, underway.blank, underway.known, underway.journal
    at = journal.at[0]
    count, cause = int(at.row), int(at.cause)
    samples = Imu(*(column[:count] for column in run.samples))
    truth = Trajectory(
        np.r_[0.0, samples.t],
        journal.lla[: count + 1],
        journal.v[: count + 1],
        journal.q[: count + 1],
    )
    sources = tuple(
        _with_measured(a, s, run.fixes, samples.t[-1]) for s, a in enumerate(run.recording.sources)
    )
    notes = saturation_notes(underway.spec, samples)
    if at.by_model and at.inputs < 0:
        notes.append(
            f"{int(journal.cut[:count].sum())} IMU samples are those of the aircraft's model, not "
            f"measured"
        )
    stopped = None
    if cause != kernels.Cause.FLYING:
        stopped = Stop(
            float(samples.t[-1]), ENDINGS[kernels.Cause(cause)], underway.vehicle.state.copy()
        )
        notes.append(str(stopped))
    steps = int(at.steps)
    made = replace(blank, imu=samples, sources=sources, reference=truth).with_notes(notes)
    recording = made.with_meta(
        b_a=underway.errors.b_a[steps - 1 :: steps][:count],
        b_g=underway.errors.b_g[steps - 1 :: steps][:count],
    )
    filters = run.recording.meta["notes"][len(blank.meta["notes"]) :]
    if (
        blank.meta["earth"] == "flat"
        and run.filter.name in filter_names()
        and has_position(run.filter)
    ):
        filters.append(
            f"{run.filter.name} navigates on the rotating Earth, and this flight's is flat and "
            f"still: it errs by the difference"
        )
    used = recording.with_notes(filters)
    solution = solution_of(run._replace(recording=used, samples=samples))
    solution.meta["filter_options"] = dict(blank.meta["filter_options"])
    if stopped:
        solution.meta.setdefault("stopped", str(stopped))
        solution = replace(
            solution, events=tuple(sorted({*solution.events, (stopped.t, str(stopped))}))
        )
    numbers = journal.log[:count].view(float).reshape(count, len(LOG))
    log = {"t, s": samples.t, **{name: numbers[:, i] for i, name in enumerate(LOG)}}
    return Flight(
        recording,
        solution,
        log,
        stopped,
        run.start,
        underway.plan,
        known.trim,
        known.gains,
        known.steering.route.copy(),
    )


def _with_measured(source: Source, place: int, fixes: Fixes, end: float) -> Source:
    """The Source with what was measured until `end` (s)."""
    y = fixes.y[fixes.source == place]
    return replace(source, y=y[:, : source.y.shape[1]].copy())._where(source.t <= end + SAME_TIME)
