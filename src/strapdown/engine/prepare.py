"""Preparation of a run before its first sample: checked arguments, compiled kernels, and its state,
measurements, cursor and output, all held in a `Run`."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import aiding, filters
from ..aiding.more_parameters import check_more_parameters
from ..alignment.missing_fields import MAX_HEADING, PARTS
from ..checks import DataError, brief, check_number, one_line_repr
from ..core.compile import records
from ..core.compile.records import Table
from ..core.loop import loop, stages
from ..core.loop.contract import (
    BIAS,
    COMPILED,
    MAX_STATES,
    POS,
    STATES,
    VEL,
    Cursor,
    Filter,
    FilterState,
    Fixes,
    Imu,
    InitialState,
    Kernels,
    MeasurementModel,
    Noise,
    Output,
    SourceRow,
    address,
    compile_together,
)
from ..core.loop.cursor import Axis, Books, Limits, LoopState, Work
from ..core.loop.log import LOG_ROWS, LogRow
from ..core.loop.stages.clock import new_recent
from ..core.loop.tables import FixRow
from ..core.mathematics import solution_row
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..core.mathematics.source import POSE_AXES
from ..data.calibration_parameters import VERTICAL_WIND
from ..data.recording import Recording
from ..data.solution import Source
from ..data.vehicle import find as find_vehicle
from ..plugins import one_line
from ..preprocessing.baseline_length import without_wrong_lengths
from ..preprocessing.receiver_classes import join_classes
from ..sensor_models.imu import GivenImu, ImuSpec, required_imu
from ..typing import Array, ArrayLike, Notify, Progress
from ..units import quantities
from ..units.constants import MAX_PAUSE
from . import installation
from .events import Events
from .installation import OfImu
from .options import RunOptions
from .plausible_limits import floors, limits
from .source_noise import correlated_rows, place_noise, weighable, with_correlated_errors

ROWS_AT_ONCE = 65536 if COMPILED else 500
"""IMU rows between two looks at the keyboard and the progress bar."""
GATES = {1: 10.828, 2: 13.816, 3: 16.266}
"""Bound on the NIS by number of rows: 0.1 % of right fixes are rejected (chi-square quantiles)."""
MAX_ANGLES = {"lla": np.array([np.pi / 2, 2 * np.pi]), "rph": np.full(3, MAX_HEADING)}
"""rad: latitude and longitude; roll, pitch and heading."""
MAX_OF_START = {
    "v_n": (1e4, "m/s: is it in mm/s?"),
    "b_a": (5.0, "m/s^2: does it include gravity, or is it in mg?"),
    "b_g": (1.0, "rad/s: is it in deg/s or deg/h?"),
}
"""Generous bounds on the components of a start, and what is probably wrong beyond them."""
HEIGHTS = ("position", "altitude")
"""Kinds that measure the height above the ellipsoid; that of pressures is a state beside."""
REMEDIES = {
    "baseline": "run closed-loop, or give the angle between the antennas as a source of kind heading"
}
"""Remedy where a filter does not use a kind that shows what nothing else of the recording may show."""
OF_STATES = ("states", "more_states", "state_std", "state_walk")
"""Fields of a MeasurementModel in which kinds that share states agree."""
MAX_SLIP = 0.1
"""rad per m/s^2: tyres on ice have less."""


def kernels_of(
    filter: Filter, kinds: Iterable[str], needed: stages.Needed = stages.NONE
) -> list[Any]:
    """The kernels that `prepare` compiles."""
    return [
        *_own_kernels(filter),
        *needed.kernels,
        *(aiding.find(kind).observe for kind in dict.fromkeys(kinds)),
    ]


def _own_kernels(filter: Filter) -> list[Any]:
    return [filter.predict, filter.correct, loop.run, *filter.start_kernels]


def prepare(
    filter: str | Filter,
    kinds: Iterable[str],
    notify: Notify | None = None,
    needed: stages.Needed = stages.NONE,
) -> Kernels:
    """Compile (or load from the cache) the kernels of `filter`, of the `kinds` of measurements and of
    the stages that they need. Calls `notify` where that takes seconds."""
    filter, kinds = filters.find(filter), [*dict.fromkeys(kinds)]
    sensors = [aiding.find(kind) for kind in kinds]
    compile_together(kernels_of(filter, kinds, needed), filter.name, notify)
    for kernel in _own_kernels(filter):
        filters.compile_filter_kernel(filter, kernel)
    for sensor in sensors:
        aiding.compile_observation(sensor.name)
    numbers = [aiding.number(sensor.name) for sensor in sensors]
    table = np.zeros(max(numbers, default=0) + 1, np.int64)
    table[numbers] = [address(sensor.observe) for sensor in sensors]
    return needed.addresses(address(filter.predict), address(filter.correct), table)


def stages_of(
    filter: Filter, sources: Sequence[Source], of_imu: OfImu | None = None
) -> stages.Needed:
    """The stages of any run of `filter` on these sources. of_imu: what of the IMU is estimated."""
    none = records.rows(Limits, 1)
    cursor = new_cursor(filter, 0.0, sources, none, of_imu)
    return stages.needed_stages(merge(sources, of_imu=of_imu), cursor)


@contextmanager
def blamed_at_run(filter: Filter, sources: Sequence[Source]) -> Iterator[None]:
    """Where a kernel of a plugin raises: a DataError of one line that names the plugins in use."""
    try:
        yield
    except Exception as error:
        blame(error, filter, sources)
        raise


def blame(error: Exception, filter: Filter, sources: Sequence[Source]) -> None:
    """Raise what a kernel raised as a DataError that names the plugins in use; nothing without
    any."""
    used = [filters.REGISTRY.brought_by(filter.name)]
    used += [aiding.REGISTRY.brought_by(a.kind) for a in sources]
    if names := dict.fromkeys(plugin.name for plugin in used if plugin):
        raise DataError(
            f"plugin {', '.join(names)}: a kernel fails while it runs ({one_line(error)})"
        ) from error


def merge(sources: Sequence[Source], after: float = -np.inf, of_imu: OfImu | None = None) -> Fixes:
    """All fixes later than `after` (s) in the order in which they are used (Fixes), simultaneous
    ones in the order of `sources`. of_imu: what of the IMU is estimated."""
    count, states = len(sources), STATES
    table, kinds = records.rows(SourceRow, count), [a.kind for a in sources]
    shared: dict[str | int, int] = {}
    for s, a in enumerate(sources):
        sensor, row = aiding.find(a.kind), table[s]
        check_more_parameters(sensor, a.parameters, a.name or a.kind)
        row.kind, row.of_kind = aiding.number(a.kind), kinds[:s].count(a.kind)
        row.pose_axes = POSE_AXES.index(sensor.pose_axes)
        row.parameters[: len(a.parameters)] = a.parameters
        row.gate = GATES[len(sensor.quantities)] if a.gate is None else a.gate
        if sensor.states:
            row.states = len(_own_states(sensor, sources))
            row.state_std, row.walk = sensor.state_std, sensor.state_walk
            row.first_state = shared.setdefault(sensor.shared or s, states)
            states += row.states if row.first_state == states else 0
        row.slip = checked_slip(a, sensor)
        # without a gate all fixes are used
        row.beside_gnss = row.gate < np.inf and is_beside_gnss(sensor)
        states += place_noise(row, a, states)
    installation.place(table, installation.parameters(sources, of_imu or {}), states)
    t, order = used_in_order(sources, after, table["delay"])
    source_of_fix = np.repeat(np.arange(count), [len(a.t) for a in sources])
    return Fixes(
        t,
        source_of_fix[order].astype(np.int64),
        rows_of(sources, "y")[order],
        rows_of(sources, "std")[order],
        table,
    )


def is_beside_gnss(sensor: MeasurementModel) -> bool:
    """True for a sensor that GNSS can judge. What states of its own take up is no contradiction, but what it
    makes of states that others share is; two heights contradict each other (core/loop/stages/heights.py),
    and an attitude is another filter's."""
    others = ("position", "velocity", "altitude", "attitude")
    alone = sensor.recorded and not sensor.states and sensor.name not in others
    return alone or bool(sensor.shared)


def used_in_order(
    sources: Sequence[Source], after: float, delay: Array
) -> tuple[Array, NDArray[np.intp]]:
    """(times (m,) s at which the fixes later than `after` are used, their places among all fixes of
    all sources, one source behind the other); `delay` (s) of each source."""
    t = np.concatenate([np.asarray(a.t, float) for a in sources] or [np.empty(0)])
    later = t > after
    t += np.repeat(delay, [len(a.t) for a in sources])
    order = np.argsort(t, kind="stable")
    order = order[later[order]]
    return t[order], order


def rows_of(sources: Sequence[Source], part: str) -> Array:
    """ "y" or "std" of all fixes (m, 3), one source behind the other."""
    return np.concatenate([_three_columns(getattr(a, part)) for a in sources] or [np.empty((0, 3))])


def checked_slip(a: Source, sensor: MeasurementModel) -> float:
    """Its side slip. Raises DataError for none that tyres have, or where its kind takes none."""
    what = f"{a.name or a.kind}: slip"
    if a.slip and not sensor.slips:
        raise DataError(f"{what}: {a.kind} takes none; a constraint across the wheels does")
    return check_number(a.slip, what, "rad per m/s^2", least=0, most=MAX_SLIP)


def axes_of_rows(sensor: MeasurementModel) -> tuple[str, ...]:
    """Names of the three rows of an innovation."""
    body = sensor.vector == "b" or sensor.name == "attitude"
    return ("forward", "right", "down") if body else ("north", "east", "down")


class AugmentedState(NamedTuple):
    """A state beyond the fifteenth."""

    name: str  # with its unit
    std: float  # initial standard deviation, SI
    factor: float = 1.0  # from SI to its unit


def augmented_states(
    sources: Sequence[Source], of_imu: OfImu | None = None
) -> list[AugmentedState]:
    """Return the augmented states, in their order: those of these sources, then the estimated
    parameters of the installation. Raises DataError."""
    states: list[AugmentedState] = []
    shared: dict[str | int, MeasurementModel] = {}
    for s, a in enumerate(sources):
        sensor, name = aiding.find(a.kind), a.name or a.kind
        if (sensor.shared or s) not in shared:
            owner = sensor.shared or name
            states += [
                AugmentedState(f"{owner} {each}", std) for each, std in _own_states(sensor, sources)
            ]
        _check_shared(sensor, shared.setdefault(sensor.shared or s, sensor))
        states += [
            AugmentedState(f"{name} correlated error{axis} [{unit}]", a.correlated.std[i], shown)
            for i in correlated_rows(a)
            if a.correlated is not None
            for unit, shown in [quantities.shown_unit(sensor.quantities[i])]
            for axis in [f" {axes_of_rows(sensor)[i]}" if np.shape(a.std)[1] > 1 else ""]
        ]
    states += [
        AugmentedState(each.name, each.std, each.of.factor)
        for each in installation.parameters(sources, of_imu or {})
    ]
    if len(states) > MAX_STATES - STATES:
        raise DataError(
            f"there are {len(states)} states in addition to the filter's own, the last is "
            f"{states[-1].name!r}; at most {MAX_STATES - STATES} can be estimated: leave sources "
            "out, or estimate less"
        )
    return states


def _own_states(sensor: MeasurementModel, sources: Sequence[Source]) -> list[tuple[str, float]]:
    """Names and initial standard deviations of the states that sources of a kind bring along. A vertical
    wind is one of all, with the largest prior, where one of them asks for it."""
    states = [(each, sensor.state_std) for each in sensor.states]
    asked = [a.estimate[VERTICAL_WIND.name] for a in sources if VERTICAL_WIND.name in a.estimate]
    return states + [
        (each, max(max(prior) for prior in asked)) for each in sensor.more_states if asked
    ]


def _check_shared(sensor: MeasurementModel, first: MeasurementModel) -> None:
    """Raise DataError where two kinds have states in common and say different things of them."""
    if any(getattr(sensor, each) != getattr(first, each) for each in OF_STATES):
        raise DataError(
            f"kinds {first.name} and {sensor.name} share the states {sensor.shared!r} and differ in "
            f"{', '.join(OF_STATES)}; give both the same"
        )


def usable(filter: Filter, sources: Sequence[Source]) -> tuple[tuple[Source, ...], list[str]]:
    """(the sources that `filter` can use, notes about the others and about having none)."""
    sources, widened = with_correlated_errors(filter, sources)
    fits = [filter.uses is None or a.kind in filter.uses for a in sources]
    notes = _of_unused(filter, [a for a, fit in zip(sources, fits) if not fit])
    sources, said = weighable(filter, sources)
    notes += widened + said
    checked = [without_wrong_lengths(a) for a in sources]
    sources = [a for a, _ in checked]
    notes += [note for _, said in checked for note in said]
    return tuple(a for a, fit in zip(sources, fits) if fit), notes + (
        [f"{filter.name}: {filter.unaided_note}"] if filter.unaided_note and not any(fits) else []
    )


def _of_unused(filter: Filter, sources: Sequence[Source]) -> list[str]:
    """A note on the sources that `filter` cannot use, with the remedy where there is one; [] without
    any."""
    names = dict.fromkeys(a.name or a.kind for a in sources)
    remedies = dict.fromkeys(REMEDIES[a.kind] for a in sources if a.kind in REMEDIES)
    said = "; ".join([f"{filter.name} does not use {', '.join(names)}", *remedies])
    return [said] if sources else []


def check_needs(
    filter: Filter, sources: Iterable[Source], remedy: str = "add a source of that kind"
) -> None:
    """Raise DataError where `filter` needs a kind of measurement that none of these sources is;
    `remedy` is what to do then."""
    kinds = {a.kind for a in sources}
    if missing := [kind for kind in filter.needs if kind not in kinds]:
        raise DataError(
            f"{filter.name} needs {' and '.join(missing)} aiding, and the recording has none: "
            f"{remedy}"
        )


def _three_columns(values: ArrayLike) -> Array:
    columns = np.asarray(values, float)
    columns = columns[:, None] if columns.ndim == 1 else columns
    if columns.shape[1] == 3:
        return columns
    return np.pad(columns, ((0, 0), (0, 3 - columns.shape[1])), constant_values=np.nan)


def new_cursor(
    filter: Filter,
    t: float,
    sources: Sequence[Source],
    limits: Table[Limits],
    of_imu: OfImu | None = None,
) -> Cursor:
    """A Cursor at time `t` before the first sample, for these sources; `limits` as
    `engine.limits.limits` gives them. of_imu: what of the IMU is estimated."""
    count, parameters = len(sources), installation.parameters(sources, of_imu or {})
    first = STATES + len(augmented_states(sources, of_imu)) - len(parameters)

    cursor = Cursor(
        records.rows(LoopState, 1),
        records.rows(Work, 1),
        limits,
        records.rows(Axis, 6),
        records.rows(Books, count),
        records.rows(LogRow, LOG_ROWS),
        new_recent(t, any("clock" in a.estimate for a in sources)),
        installation.coupling_rows(parameters, first),
    )
    state, books = cursor.state[0], cursor.books
    state.t, state.cause, state.climb_at, state.latest = float(t), -np.inf, -np.inf, 1
    if has_position(filter):
        state.heights = sum(a.kind in HEIGHTS for a in join_classes(sources))
    state.every, state.positioned = 1, has_position(filter)
    state.condition = -1 if filter.condition is None else filter.condition
    doubtful = [k for k, condition in enumerate(filter.conditions) if condition.doubtful]
    state.doubtful_conditions = sum(1 << k for k in doubtful)
    cursor.axes["step"] = np.inf
    books["floor"] = floors(sources)
    for name in ("last", "last_used", "walked", "followed_at"):
        books[name] = float(t)
    books["tested"] = books["level_at"] = books["proven"] = -np.inf
    books["factor"] = 1.0
    books["power"] = 1.0
    return cursor


def has_position(filter: Filter) -> bool:
    """True where `filter` estimates a position, and so must start from one."""
    return POS.start in filter.estimates


class Run(NamedTuple):
    """A filter on its way through a recording, which holds the sources that it uses and no
    other."""

    recording: Recording
    samples: Imu
    filter: Filter
    kernels: Kernels
    start: InitialState
    noise: Noise
    spec: ImuSpec | None  # None where a Noise was given
    belief: FilterState
    fixes: Fixes
    cursor: Cursor
    out: Output
    first: int  # row of the samples that it begins with
    options: dict[str, Any]  # the filter's own, with those that its sources decided
    events: Events  # what the loop said so far

    def advance(self, rows: int, out: Output | None = None) -> None:
        """Go on to the end of the sample before row `rows`; writes into `out`, or its own."""
        state = self.cursor.state[0]
        with blamed_at_run(self.filter, self.recording.sources):
            while state.row < rows and not state.fault:
                state.stop = rows  # the loop stops earlier where its log is full
                loop.run(
                    self.kernels,
                    self.belief,
                    self.samples,
                    self.fixes,
                    self.noise,
                    self.cursor,
                    out or self.out,
                )
                self.events.take(self.cursor)

    def chunks(self, rows: int) -> Iterator[int]:
        """Rows to stop at: every `rows` samples and the last. Ends early where the filter does."""
        state = self.cursor.state[0]
        while state.row < len(self.samples.t) and not state.fault:
            yield min(int(state.row) + rows, len(self.samples.t))

    def complete(self, progress: Progress | None = None) -> None:
        """Go on to the end of the samples; `progress` is called with the fraction done."""
        for rows in self.chunks(ROWS_AT_ONCE):
            self.advance(rows)
            if progress:
                progress(self.done)

    @property
    def done(self) -> float:
        """Fraction of the samples."""
        return (self.cursor.state[0].row - self.first) / (len(self.samples.t) - self.first)


def ready(
    recording: Recording,
    filter: Filter,
    start: InitialState,
    noise: Noise,
    spec: ImuSpec | None,
    asked: RunOptions,
    made: Source | None = None,
) -> Run:
    """The Run of `filter` before its first sample; `made` is the one of the recording's sources
    that an AHRS made, whose rows up to the start are left out. Raises DataError."""
    sources, notes = usable(
        filter,
        tuple(
            a._where(a.t > start.t + loop.SAME_TIME) if a is made else a for a in recording.sources
        ),
    )
    options, said = configure_options(filter, asked["options"] or {}, sources)
    notes += said
    of_imu = recording.meta.get("estimate")
    belief = new_belief(filter, start, noise, options, sources, of_imu)
    noise = filter.with_bias_model(noise, options)
    samples = Imu(*(np.require(column, float, "C") for column in recording.imu))
    first, rows = (
        int(np.searchsorted(samples.t, start.t + loop.SAME_TIME, side="right")),
        len(samples.t),
    )
    if first == rows:
        raise DataError(
            f"the start at {start.t:g} s is not before the last IMU sample at {samples.t[-1]:g} s; "
            f"give an earlier start"
        )
    if samples.t[first] - start.t > MAX_PAUSE:
        raise DataError(
            f"the start at {start.t:g} s is {samples.t[first] - start.t:.0f} s before the first IMU "
            f"sample; "
            f"the longest gap is {MAX_PAUSE:.0f} s"
        )
    fixes = merge(sources, start.t + loop.SAME_TIME, of_imu)
    vehicle = find_vehicle(asked["vehicle"] or recording.meta.get("vehicle"))
    if "undecided_gyro" in recording.meta and not vehicle.by_thrust:
        raise DataError(recording.meta["undecided_gyro"])
    cursor = new_cursor(filter, start.t, sources, limits(spec, noise, vehicle), of_imu)
    kernels = prepare(
        filter, [a.kind for a in sources], asked["notify"], stages.needed_stages(fixes, cursor)
    )
    state, every = cursor.state[0], asked["every"]
    state.row, state.fixes, state.every = first, len(fixes.t), every
    state.phase = (rows - 1) % every
    kept = -(-(rows - first) // every)
    used = replace(recording, sources=sources).with_notes(notes)
    out = new_output(filter, belief, kept, asked["covariance"], len(fixes.t))
    return Run(
        used,
        samples,
        filter,
        kernels,
        start,
        noise,
        spec,
        belief,
        fixes,
        cursor,
        out,
        first,
        options,
        Events(filter, sources, vehicle),
    )


def new_output(
    filter: Filter,
    belief: FilterState,
    rows: int,
    covariance: bool = False,
    fixes: int = 0,
    record: int = 0,
) -> Output:
    """Return an empty Output for these numbers of rows and fixes, with covariances or without, and
    with a record of that number of calls for the smoother."""
    width = solution_row.NAV_WIDTH + len(filter.columns) + 2 * belief.augmented.size
    recorded = filter.smoother.width(len(belief.P)) if record and filter.smoother else 0
    return Output(
        np.empty((rows, width)),
        np.empty((rows if covariance else 0, *belief.P.shape)),
        records.rows(FixRow, fixes),
        np.empty((record if recorded else 0, recorded)),
        np.zeros(rows if record else 0, np.int64),
    )


def assumed_noise(
    imu: GivenImu | None,
    noise: Noise | None,
    needed: bool,
    without: str = "the recording does not name its IMU: ",
) -> tuple[Noise, ImuSpec | None]:
    """The Noise to assume and the ImuSpec it comes from; None where the caller gave a noise and
    the spec is not `needed`. `without`: what to say first where there is none."""
    left_out = imu is None and noise is not None and not needed
    spec = None if left_out else required_imu(imu, without)
    try:
        if noise is None:
            assert spec is not None  # required above
            return spec.noise(), spec
        if not isinstance(noise, Noise):
            raise TypeError
        return Noise(*map(float, noise)), spec
    except (TypeError, ValueError):
        raise DataError(
            f"noise is {noise!r}; it must be a Noise of numbers, such as an ImuSpec gives"
        ) from None


def _check_part(name: str, value: object, size: int) -> None:
    """Raise DataError where a field of an InitialState has not `size` numbers or is out of range."""
    try:
        values = np.atleast_1d(np.asarray(value))
        values = values.astype(float) if values.dtype.kind in "iuf" else np.empty(0)
    except (TypeError, ValueError):
        values = np.empty(0)
    what = f"start: {name} is {one_line_repr(value)}"
    if name == "rph" and np.isnan(values[:2]).all() and (np.abs(values[2:]) > MAX_HEADING).any():
        raise DataError(f"start: heading is {values[2]:g} rad; is it in degrees?")
    if values.shape != (size,) or not np.isfinite(values).all():
        raise DataError(f"{what}; it must be {size} finite number{'s' * (size > 1)}")
    angles = MAX_ANGLES.get(name, np.empty(0))
    if (np.abs(values[: len(angles)]) > angles).any():
        raise DataError(f"{what}, in rad; is it in degrees?")
    most, hint = MAX_OF_START.get(name, (np.inf, ""))
    if np.abs(values).max() > most:
        raise DataError(f"{what}; each number is at most {most:g} {hint}")


def check_start(start: InitialState, noise: Noise, missing: Collection[str] = ()) -> None:
    """Raise DataError naming the first field of an InitialState or a Noise that no filter can begin
    with; `missing` are those that are to be found."""
    if not isinstance(start, InitialState):
        raise DataError(
            f"start is {brief(start)}; it must be an InitialState, such as `align` gives"
        )
    for name, size in {"t": 1, **PARTS}.items():
        if name in missing:
            continue
        _check_part(name, getattr(start, name), size)
    if "std" not in missing and min(start.std) < 0:
        raise DataError(f"start: std has {min(start.std):g}; standard deviations must be 0 or more")
    if "lla" not in missing and abs(start.lla[0]) > LATITUDE_LIMIT:
        raise DataError(
            f"start: latitude is {np.degrees(start.lla[0]):.6g} deg; results hold up to "
            f"{np.degrees(LATITUDE_LIMIT):.0f} deg"
        )
    for name, value in noise._asdict().items():
        if not 0 <= value < np.inf:
            raise DataError(f"noise: {name} is {value:g}; it must be a finite number, 0 or more")
    if noise.held > 1:
        raise DataError(f"noise: held is {noise.held:g}; it is a fraction, at most 1")


def new_belief(
    filter: Filter,
    start: InitialState,
    noise: Noise,
    options: dict[str, Any],
    sources: Sequence[Source],
    of_imu: OfImu | None = None,
) -> FilterState:
    """The FilterState that `filter` begins with on these sources; raises DataError for a start, a
    noise or an option that it cannot use."""
    check_start(start, noise)
    check_options(filter, options)
    found = installation.parameters(sources, of_imu or {})
    installation.check_estimates(filter, found)
    start = start._replace(
        std=(*start.std, *(each.std for each in augmented_states(sources, of_imu)))
    )
    try:
        belief = filter.begin(start, noise, **options)
    except (TypeError, ValueError) as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None
    except Exception as error:
        if plugin := filters.REGISTRY.brought_by(filter.name):
            raise DataError(
                f"plugin {plugin.name}: start of the Filter {filter.name!r} fails ({error})"
            ) from error
        raise
    installation.correlate(belief.P, start, found, [a.kind for a in sources])
    if start.motion:
        _correlate_start(belief.P, sources, start.t)
    return belief


def _correlate_start(P: Array, sources: Sequence[Source], t: float) -> None:
    """Add to P at a start at `t` s that was made of the first fixes what these err by with the correlated
    errors of their source: true - estimate has these less."""
    table = merge(sources).sources
    for kind, first in (("position", POS.start), ("velocity", VEL.start)):
        alike = [s for s, a in enumerate(sources) if a.kind == kind]
        s = _class_in_use(sources, alike, t)
        for i in range(3 if s is not None else 0):
            row = table[s or 0]
            variance, state = row.correlated_std[i] ** 2, row.correlated_state[i]
            P[first + i, first + i] += variance
            if state > 0:
                P[first + i, state] -= variance
                P[state, first + i] -= variance


def _class_in_use(sources: Sequence[Source], alike: Sequence[int], t: float) -> int | None:
    """The first source of these indices, or that class of its receiver whose fix is nearest to `t`
    s; None of none."""
    if not alike:
        return None
    first = sources[alike[0]]
    classes = [s for s in alike if first.receiver and sources[s].receiver == first.receiver]
    away = {s: np.abs(sources[s].t - t).min() for s in classes if len(sources[s].t)}
    return min(away, key=lambda s: away[s]) if away else alike[0]


def configure_options(
    filter: Filter, options: dict[str, Any], sources: Sequence[Source]
) -> tuple[dict[str, Any], list[str]]:
    """(options of `filter` with those that these sources decide, notes on them). Raises
    DataError where it has no such option or cannot run on them."""
    check_options(filter, options)
    try:
        return filter.configure(options, sources) if filter.configure else (options, [])
    except ValueError as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None


def check_options(filter: Filter, options: dict[str, Any]) -> None:
    """Raise DataError where `filter` has no such option, or a value is not of the type of the
    default: a number, or text (or what bears a name)."""
    known = filter.options
    for name, value in options.items():
        if name not in known:
            raise DataError(
                f"filter {filter.name!r} has no option {name!r}"
                f"{', as none of its estimates decays' * (name == BIAS)}; it has "
                f"{', '.join(known) or 'none'}"
            )
        if isinstance(known[name], str) and not isinstance(getattr(value, "name", value), str):
            raise DataError(
                f"filter {filter.name!r}: {name} is {value!r}; it must be text, such as "
                f"{known[name]!r}"
            )
        if (
            not isinstance(known[name], str)
            and (isinstance(value, bool) or not isinstance(value, Real))
            and not (value is None and known[name] is None)
        ):
            raise DataError(f"filter {filter.name!r}: {name} is {value!r}; it must be a number")
