"""From a Recording and a filter to a Solution: `prepare` compiles what a run needs, `fuse` runs
a recording."""

import inspect
from dataclasses import replace
from numbers import Real
from typing import NamedTuple

import numpy as np

from .. import aiding, filters
from ..core import loop
from ..core.contract import (
    BA,
    BG,
    COMPILED,
    FIRST,
    PARAMETERS,
    POS,
    STATES,
    VEL,
    WALK,
    Belief,
    Cursor,
    Fixes,
    Imu,
    Noise,
    Output,
    Start,
    address,
    compile_kernel,
    is_cached,
)
from ..core.earth import LATITUDE_LIMIT
from ..data import DataError, Innovations, Solution, Trajectory
from ..recording import Recording

CHUNK = 65536 if COMPILED else 500
"""IMU rows between two looks at the keyboard and the progress bar."""
GATES = {1: 10.828, 2: 13.816, 3: 16.266}
"""Bound on the NIS by number of rows: 0.1 % of right fixes are rejected (chi-square quantiles)."""
LARGEST = {"rph": 4 * np.pi, "bg": 35.0}
"""rad and rad/s that a start can have; 35 rad/s is the range of the common MEMS gyros."""
LONGEST_GAP = 86400.0
"""s without IMU samples; more is a mistaken clock and no pause."""


class Prepared(NamedTuple):
    """A filter and the addresses of its compiled kernels."""

    filter: filters.Filter
    predict: int
    correct: int
    observers: np.ndarray  # by kind; 0 where the run has no such source


def prepare(filter, kinds, say=None):
    """Compile (or load from the cache) the kernels of `filter` and of the aiding `kinds`. `say`
    is told once where that takes seconds."""
    filter = found(filters.find, filter)
    sensors = [found(aiding.find, kind) for kind in dict.fromkeys(kinds)]
    slow = [filter.predict, filter.correct, loop.run]
    if say and not all(map(is_cached, slow)):
        say(f"compiling {filter.name} for the first time on this machine, about 15 s ...")
    for kernel in [*slow, *(sensor.observe for sensor in sensors)]:
        compile_kernel(kernel)
    observers = np.zeros(len(aiding.measurements()), np.int64)
    for sensor in sensors:
        observers[sensor.kind] = address(sensor.observe)
    return Prepared(filter, address(filter.predict), address(filter.correct), observers)


def found(find, name):
    """What `find` has of that name; what it has not is bad input."""
    try:
        return find(name)
    except ValueError as error:
        raise DataError(str(error)) from None


def merge(aidings, after=-np.inf):
    """All fixes later than `after` (s) in time order (Fixes), simultaneous ones in the order of
    `aidings`."""
    sensors = [aiding.find(a.kind) for a in aidings]
    count = len(aidings)
    t = np.concatenate([np.asarray(a.t, float) for a in aidings] or [np.empty(0)])
    source = np.repeat(np.arange(count), [len(a.t) for a in aidings])
    order = np.argsort(t, kind="stable")
    order = order[t[order] > after]
    y, sd = (
        np.concatenate([_three_columns(getattr(a, part)) for a in aidings] or [np.empty((0, 3))])[
            order
        ]
        for part in ("y", "sd")
    )
    parameters, gate, states = np.zeros((count, PARAMETERS)), np.empty(count), STATES
    for s, (a, sensor) in enumerate(zip(aidings, sensors)):
        parameters[s, : len(a.parameters)] = a.parameters
        if sensor.states:
            parameters[s, WALK], parameters[s, FIRST] = sensor.state_walk, states
            states += len(sensor.states)
        gate[s] = GATES[len(sensor.quantities)] if a.gate is None else a.gate
    return Fixes(
        t[order],
        source[order].astype(np.int64),
        y,
        sd,
        np.array([s.kind for s in sensors], np.int64),
        parameters,
        gate,
    )


def brought(aidings):
    """[(name with unit, initial standard deviation)] of the states that these sources bring
    along, in the order of the states. Raises DataError."""
    states = [
        (f"{a.name or a.kind} {name}", sensor.state_sd)
        for a in aidings
        for sensor in [found(aiding.find, a.kind)]
        for name in sensor.states
    ]
    if len(states) > STATES:
        raise DataError(
            f"the sources bring {len(states)} states along, the last is {states[-1][0]!r}; "
            f"at most {STATES} can be estimated: leave sources out"
        )
    return states


def usable(filter, aidings):
    """(the sources that `filter` can use, notes about the others and about having none)."""
    fits = [filter.uses is None or a.kind in filter.uses for a in aidings]
    others = dict.fromkeys(a.name or a.kind for a, fit in zip(aidings, fits) if not fit)
    notes = [f"{filter.name} has no use for {', '.join(others)}"] if others else []
    return tuple(a for a, fit in zip(aidings, fits) if fit), notes + (
        [f"{filter.name}: {filter.unaided_note}"] if filter.unaided_note and not any(fits) else []
    )


def check_needs(filter, aidings, remedy="add a source of that kind"):
    """Raise DataError where `filter` needs a kind of aiding that none of these sources is;
    `remedy` is what to do then."""
    kinds = {a.kind for a in aidings}
    if missing := [kind for kind in filter.needs if kind not in kinds]:
        raise DataError(
            f"{filter.name} needs {' and '.join(missing)} aiding, and there is none: {remedy}"
        )


def _three_columns(values):
    values = np.asarray(values, float)
    values = values[:, None] if values.ndim == 1 else values
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])), constant_values=np.nan)


def new_cursor(filter, t, sources):
    """A Cursor at time `t` before the first sample, for that many sources."""
    count = lambda: np.zeros(sources, np.int64)
    cursor = Cursor(
        np.zeros(loop.CURSOR_SIZE, np.int64),
        np.array([float(t)]),
        np.zeros(7),
        np.zeros(15),
        count(),
        count(),
        count(),
        np.zeros(sources),
        count(),
        np.full(sources, float(t)),
    )
    cursor.at[loop.EVERY], cursor.at[loop.POSITIONED] = 1, positioned(filter)
    return cursor


def positioned(filter):
    """Whether `filter` estimates a position, and so must start from one."""
    return POS.start in filter.estimates


class Run(NamedTuple):
    """A filter on its way through a recording, which holds the sources that it uses and no
    other."""

    recording: Recording
    samples: Imu
    filter: filters.Filter
    kernels: tuple  # addresses of predict, correct and the observers
    start: Start
    noise: Noise
    spec: object  # ImuSpec, or None where a Noise was given
    belief: Belief
    fixes: Fixes
    cursor: Cursor
    out: Output
    first: int  # row of the samples that it begins with
    options: dict  # the filter's own, with those that its sources decided

    def advance(self, rows, out=None, run=loop.run):
        """Go on to the end of the sample before row `rows`; writes into `out`, or its own; `run`
        is `loop.run_recorded` where that has a record."""
        self.cursor.at[loop.STOP] = rows
        run(
            *self.kernels,
            self.belief,
            self.samples,
            self.fixes,
            self.noise,
            self.cursor,
            out or self.out,
        )

    def chunks(self, rows):
        """Rows to stop at: every `rows` samples and the last. Ends early where the filter does."""
        at = self.cursor.at
        while at[loop.ROW] < len(self.samples.t) and not at[loop.FAULT]:
            yield min(int(at[loop.ROW]) + rows, len(self.samples.t))

    @property
    def done(self):
        """Fraction of the samples."""
        return (self.cursor.at[loop.ROW] - self.first) / (len(self.samples.t) - self.first)


def fuse(
    recording,
    filter="closed-loop",
    imu=None,
    start=None,
    noise=None,
    every=1,
    covariance=False,
    say=None,
    progress=None,
    ahrs=None,
    ahrs_rate=10.0,
    **options,
):
    """Run `filter` over `recording` and return the Solution.

    imu: grade, file or ImuSpec (default: what the recording names); start: a Start (default:
    `alignment.align`), to which fixes at its time belong: they are not used again; noise: a Noise
    in place of the IMU's; every: keep each n-th row (the last one always); covariance: keep the
    whole covariance of these rows too; say: told of slow compilation; progress: called with the
    fraction done; ahrs: a filter of attitude alone that runs first and whose output at `ahrs_rate`
    Hz is the `attitude` aiding (default: `attitude-mekf` where `filter` needs attitude, the
    recording has none and something in it measures the heading); options: the filter's own. Raises
    DataError.
    """
    run = begin(
        recording, filter, imu, start, noise, every, covariance, say, options, ahrs, ahrs_rate
    )
    for rows in run.chunks(CHUNK):
        run.advance(rows)
        if progress:
            progress(run.done)
    return solution(run)


def begin(
    recording, filter, imu, start, noise, every, covariance, say, options, ahrs=None, ahrs_rate=10.0
):
    """The Run of `fuse` before its first sample. Raises DataError."""
    if not isinstance(every, (int, np.integer)) or every < 1:
        raise DataError(f"every is {every}; it must be a whole number, at least 1")
    given, (noise, spec) = (
        noise,
        assumed_noise(
            recording.meta.get("grade") if imu is None else imu, noise, needed=start is None
        ),
    )
    filter = found(filters.find, filter)
    if start is not None:
        _checked(start, noise)  # before an AHRS or anything else takes it for one
    from .ahrs import fed

    recording, made = fed(
        recording, filter, ahrs, ahrs_rate, spec, noise if given else None, start, say
    )
    check_needs(filter, recording.aidings)
    if start is None:
        from ..alignment.initial import align

        start = align(recording, spec, position=positioned(filter))
    aidings, notes = usable(
        filter,
        tuple(
            a._where(a.t > start.t + loop.SAME_TIME) if a is made else a for a in recording.aidings
        ),
    )
    options, said = fitted(filter, options, aidings)
    notes += said
    belief = new_belief(filter, start, noise, options, aidings)
    prepared = prepare(filter, [a.kind for a in aidings], say)
    samples = Imu(*(np.require(column, float, "CW") for column in recording.imu))
    first, rows = (
        int(np.searchsorted(samples.t, start.t + loop.SAME_TIME, side="right")),
        len(samples.t),
    )
    if first == rows:
        raise DataError(
            f"the start at {start.t:g} s is not before the last IMU sample at {samples.t[-1]:g} s; give an earlier start"
        )
    if samples.t[first] - start.t > LONGEST_GAP:
        raise DataError(
            f"the start at {start.t:g} s is {samples.t[first] - start.t:.0f} s before the first IMU sample; "
            f"the longest gap is {LONGEST_GAP:.0f} s"
        )
    fixes = merge(aidings, start.t + loop.SAME_TIME)
    cursor = new_cursor(filter, start.t, len(fixes.kind))
    cursor.at[loop.ROW], cursor.at[loop.FIXES], cursor.at[loop.EVERY] = first, len(fixes.t), every
    cursor.at[loop.PHASE] = (rows - 1) % every
    kept = -(-(rows - first) // every)
    used = replace(
        recording,
        aidings=aidings,
        meta=recording.meta | {"notes": [*recording.meta.get("notes", []), *notes]},
    )
    out = new_output(filter, belief, kept, covariance, len(fixes.t))
    return Run(
        used,
        samples,
        filter,
        prepared[1:],
        start,
        noise,
        spec,
        belief,
        fixes,
        cursor,
        out,
        first,
        options,
    )


def new_output(filter, belief, rows, covariance=False, fixes=0, record=0):
    """An Output of so many rows, with their covariances or not, and of so many fixes; with a
    record of so many calls for the smoother."""
    width = loop.NAV_WIDTH + len(filter.columns) + 2 * belief.extra_states.size
    return Output(
        np.empty((rows, width)),
        np.empty((rows if covariance else 0, *belief.P.shape)),
        np.empty((fixes, loop.FIX_WIDTH)),
        np.empty((record, filter.smoother.width(len(belief.P))) if record else 0),
        np.zeros(rows if record else 0, np.int64),
    )


def assumed_noise(imu, noise, needed):
    """The Noise to assume and the ImuSpec it comes from; None where the caller gave a noise and
    the spec is not `needed`."""
    from ..sensor_models.imu import grade, grades

    if imu is None and (noise is None or needed):
        raise DataError(
            f"the recording does not name its IMU: give imu=, one of {', '.join(grades())}, or a file that describes it"
        )
    spec = None if imu is None else grade(imu)
    try:
        return spec.noise() if noise is None else Noise(
            *map(float, noise if isinstance(noise, Noise) else None)
        ), spec
    except (TypeError, ValueError):
        raise DataError(
            f"noise is {noise!r}; it must be a Noise of numbers, such as an ImuSpec gives"
        ) from None


def _checked(start, noise):
    """Raise DataError naming the first field of a Start or a Noise that no filter can begin
    with."""
    if not isinstance(start, Start):
        raise DataError(f"start is {start!r}; it must be a Start, such as `align` gives")
    for name, size in (
        ("t", 1),
        ("lla", 3),
        ("v", 3),
        ("rph", 3),
        ("ba", 3),
        ("bg", 3),
        ("sd", STATES),
    ):
        try:
            values = np.atleast_1d(np.asarray(getattr(start, name), float))
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != (size,) or not np.isfinite(values).all():
            raise DataError(
                f"start: {name} is {getattr(start, name)!r}; it must be {size} finite number{'s' * (size > 1)}"
            )
        if np.abs(values).max() > LARGEST.get(name, np.inf):
            raise DataError(f"start: {name} is {getattr(start, name)}, in rad; is it in degrees?")
    if min(start.sd) < 0:
        raise DataError(f"start: sd has {min(start.sd):g}; standard deviations must be 0 or more")
    if abs(start.lla[0]) > LATITUDE_LIMIT:
        raise DataError(
            f"start: latitude is {np.degrees(start.lla[0]):.6g} deg; results hold up to {np.degrees(LATITUDE_LIMIT):.0f} deg"
        )
    for name, value in noise._asdict().items():
        if not 0 <= value < np.inf:
            raise DataError(f"noise: {name} is {value:g}; it must be a finite number, 0 or more")


def new_belief(filter, start, noise, options, aidings):
    """The belief that `filter` begins with on these sources; raises DataError for a start, a
    noise or an option that it cannot use."""
    _checked(start, noise)
    check_options(filter, options)
    start = start._replace(sd=(*start.sd, *(sd for _, sd in brought(aidings))))
    try:
        return filter.start(start, noise, **options)
    except (TypeError, ValueError) as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None


def fitted(filter, options, aidings):
    """(options of `filter` with those that these sources decide, notes on them). Raises
    DataError where it has no such option or cannot run on them."""
    check_options(filter, options)
    try:
        return filter.configure(options, aidings) if filter.configure else (options, [])
    except ValueError as error:
        raise DataError(f"filter {filter.name!r}: {error}") from None


def check_options(filter, options):
    """Raise DataError where `filter` has no such option, or a value is not of the type of the
    default: a number, or text (or what bears a name)."""
    known = {
        name: option.default
        for name, option in list(inspect.signature(filter.start).parameters.items())[2:]
    }
    for name, value in options.items():
        if name not in known:
            raise DataError(
                f"filter {filter.name!r} has no option {name!r}; it has {', '.join(known) or 'none'}"
            )
        if isinstance(known[name], str) and not isinstance(getattr(value, "name", value), str):
            raise DataError(
                f"filter {filter.name!r}: {name} is {value!r}; it must be text, such as {known[name]!r}"
            )
        if (
            not isinstance(known[name], str)
            and (isinstance(value, bool) or not isinstance(value, Real))
            and not (value is None and known[name] is None)
        ):
            raise DataError(f"filter {filter.name!r}: {name} is {value!r}; it must be a number")


def solution(run):
    """The Solution from what `run` wrote; a run that stopped early keeps what it has and says
    why."""
    recording, samples, filter, _, start, noise, spec, _, fixes, cursor, out, *_ = run
    nav, used = out.nav[: cursor.at[loop.OUT]], out.fix[: cursor.at[loop.FIX]]
    names = [a.name or a.kind for a in recording.aidings]
    events = _events(
        samples,
        cursor.at[loop.ROW],
        start,
        used,
        names,
        "velocity and attitude held, invalid until the next position fix"
        if positioned(filter)
        else "attitude held",
    )
    meta = {
        "filter": filter.name,
        "recording": recording.meta.get("name", ""),
        "notes": list(recording.meta.get("notes", [])),
        "imu": spec.name if spec else "",
        "start": start._asdict(),
        "noise": noise._asdict(),
        "fixes_outside": sum(len(a.t) for a in recording.aidings) - len(used),
        "kinds": {a.name or a.kind: a.kind for a in recording.aidings},
        "date": recording.meta.get("date"),
        "point": recording.meta.get("point", "imu"),
    }
    if cursor.at[loop.FAULT]:
        t = samples.t[cursor.at[loop.ROW]]
        meta["stopped"] = (
            f"stopped at {t:.2f} s: the latitude left the +-89 deg where results hold, or the filter diverged"
        )
        events.append((float(t), meta["stopped"]))
        if not len(nav):
            raise DataError(f"{filter.name} {meta['stopped']}")
    for columns_of, states in (
        (loop.LLA, POS),
        (loop.V, VEL),
        (loop.BIASES, BA),
        (loop.BIASES + 3, BG),
    ):  # what is not estimated is no number
        nav[:, [columns_of + i for i in range(3) if states.start + i not in filter.estimates]] = (
            np.nan
        )
    sd = nav[:, loop.SD : loop.ROW_STATUS]
    sd[:, [i for i in range(STATES) if i not in filter.states]] = np.nan
    trajectory = Trajectory(
        nav[:, loop.T],
        nav[:, loop.LLA : loop.V],
        nav[:, loop.V : loop.Q],
        nav[:, loop.Q : loop.BIASES],
        sd,
    )
    if recording.meta.get("point") == "reference":
        rows = np.searchsorted(samples.t, trajectory.t)
        omega = samples.dtheta[rows] / samples.dt[rows, None] - nav[:, loop.BIASES + 3 : loop.SD]
        trajectory = trajectory.displaced(-np.asarray(recording.meta["imu_lever_arm"]), omega)
    own = [name for name, _ in brought(recording.aidings)]
    columns = {
        name: nav[:, loop.NAV_WIDTH + i]
        for i, name in enumerate((*filter.columns, *own, *(f"sd of {name}" for name in own)))
    }
    if filter.diagnose:
        events += filter.diagnose(nav[:, loop.T], nav[:, loop.LLA : loop.V], columns)
    return Solution(
        trajectory,
        nav[:, loop.BIASES : loop.BIASES + 3],
        nav[:, loop.BIASES + 3 : loop.SD],
        nav[:, loop.ROW_STATUS].astype(np.int8),
        innovations(used, recording.aidings, fixes.gate),
        tuple(sorted(events)),
        columns,
        out.covariance[: len(nav)] if len(out.covariance) else None,
        meta,
    )


def innovations(used, aidings, gates):
    """Innovations from the fix rows that `run` wrote."""
    return Innovations(
        used[:, loop.F_T],
        used[:, loop.F_SOURCE].astype(int),
        used[:, loop.F_INNOVATION : loop.F_NIS],
        used[:, loop.F_NIS],
        used[:, loop.F_USE] > 0,
        tuple(a.name or a.kind for a in aidings),
        tuple(float(gate) for gate in gates),
    )


def _events(samples, rows, start, used, names, long_gap):
    """Gaps in the first `rows` samples and re-acquisitions of a source, as (t, text); `long_gap`
    is what happens in one beyond a second."""
    events = []
    for first in range(
        0, rows, CHUNK
    ):  # in pieces: a day of samples is too long for temporary columns
        t, dt = (column[first : min(first + CHUNK, rows)] for column in samples[:2])
        before = np.r_[samples.t[first - 1] if first else start.t, t[:-1]]
        gap = t - dt - np.maximum(before, start.t)
        for k in np.flatnonzero((gap > 0.5 * dt + loop.SAME_TIME) & (t > start.t)):
            rule = "bridged" if gap[k] <= loop.BRIDGE else long_gap
            events.append((float(before[k]), f"IMU gap of {gap[k]:.3g} s: {rule}"))
    for s, name in enumerate(names):
        events += _lifted(used[used[:, loop.F_SOURCE] == s], name)
    return events


def _lifted(own, name):
    """[(t, text)] of the fixes of one source: where its gate was lifted, and where that did not
    help."""
    t, use = own[:, loop.F_T], own[:, loop.F_USE]
    series = np.cumsum(use == loop.ACCEPTED)  # from one fix that passes to the next
    lifted = np.flatnonzero(use == loop.REACQUIRED)
    _, first, count = np.unique(series[lifted], return_index=True, return_counts=True)
    text = f"{name}: gate lifted after {loop.REJECTED} or more rejections in a row over {loop.PATIENCE:g} s"
    events = [(float(at), text) for at in t[lifted[first]]]
    passed, rejected = (
        np.r_[np.flatnonzero(use == loop.ACCEPTED), len(use)],
        np.r_[0, np.cumsum(use == loop.REJECTED_FIX)],
    )
    last = lifted[first + count - 1][count >= loop.LIFTS]
    in_vain = last[
        rejected[passed[np.searchsorted(passed, last)]] - rejected[last] >= loop.REJECTED
    ]
    text = f"{name}: left out from here until one of its fixes passes the gate: lifting it {loop.LIFTS} times did not help"
    return events + [(float(at), text) for at in t[in_vain]]
