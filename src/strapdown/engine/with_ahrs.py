"""Attitude from an AHRS: an attitude filter runs first, and its solution becomes the `attitude`
source of another filter.

Its errors are correlated over seconds to minutes, but every filter treats the errors of fixes as
independent: at a high rate it becomes overconfident. `docs/how-to/fuse.md` describes the effect.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from numbers import Real

import numpy as np

from .. import filters
from ..alignment.initial import align
from ..checks import DataError
from ..core.loop.contract import ATT, VALID, Filter, Imu, InitialState
from ..data.recording import Recording
from ..data.solution import Source, Trajectory
from ..preprocessing.stationary import motionless
from ..sensor_models.imu import ImuSpec
from ..typing import Array
from .finish import solution as solution_of
from .installation import without_estimates
from .options import AHRS_RATE, RunOptions, run_options
from .prepare import assumed_noise, check_needs, has_position, ready

AHRS = "attitude-mekf"
"""Default AHRS, where a filter needs an attitude, the recording has none, and one of its sources
measures the heading."""
HEADING_KINDS = ("magnetic-field", "heading")
ASSUMED = np.radians([1.5, 1.5, 5.0])
"""rad: standard deviations forward, right and down where a filter claims none: the largest rms
inclination and heading error of `mahony` in the five BROAD trials
(docs/reference/evidence/attitude-broad.md), rounded up."""
SILENT = 5.0
"""s without an attitude that cause a note."""
UNUSABLE = "its samples are missing or implausible there; run it alone to see its events"
REMEDY = (
    f"add an attitude record or a magnetometer to the recording, or run an AHRS without one, whose "
    f"heading drifts: --ahrs {AHRS}, "
    f'in Python ahrs="{AHRS}"'
)


def with_ahrs(
    recording: Recording, filter: Filter, asked: RunOptions
) -> tuple[Recording, Source | None]:
    """(Recording for `filter`, Source of the AHRS that ran first, or None). The sources then
    contain the attitude that the filter needs.

    Sources of the heading go to the AHRS and not to the filter as well. A note names the AHRS.
    Raises DataError where the attitude is missing and cannot be computed, where the requested AHRS
    cannot be used, or where a rate other than `AHRS_RATE` is requested and no AHRS runs.
    """
    measured = {a.kind for a in recording.sources if len(a.t)}
    first = choose_ahrs(filter, measured, asked["ahrs"], asked["ahrs_rate"])
    if first is None:
        return recording, None
    made, notes = source(recording, first, asked)
    taken = taken_by(first, recording.sources)
    replaced = [a for a in recording.sources if a.kind == "attitude"]
    notes[0] += whose(taken, replaced)
    left = [a for a in recording.sources if not any(a is each for each in taken + replaced)]
    return replace(recording, sources=(*left, made)).with_notes(notes), made


def choose_ahrs(
    filter: Filter, measured: Collection[str], ahrs: str | Filter | None, rate: float
) -> Filter | None:
    """Return the AHRS that runs before `filter` where these kinds are measured, None where none
    runs; arguments and errors as in `with_ahrs`."""
    if isinstance(rate, bool) or not isinstance(rate, Real) or not 0 < rate < math.inf:
        raise DataError(f"ahrs_rate is {rate!r} Hz; it must be a number above 0")
    if ahrs is None:
        if "attitude" not in filter.needs or "attitude" in measured:
            if rate != AHRS_RATE:
                why = (
                    "the recording has its attitude"
                    if "attitude" in filter.needs
                    else f"{filter.name} runs without one"
                )
                raise DataError(
                    f"ahrs_rate is {rate:g} Hz, but no AHRS runs: {why}; leave it out, or name an "
                    f"AHRS (--ahrs {AHRS})"
                )
            return None
        if not measured.intersection(HEADING_KINDS):
            raise DataError(
                f"{filter.name} needs attitude aiding, and the recording has none: {REMEDY}"
            )
        ahrs = AHRS
    first = _find_ahrs(ahrs)
    _check(first, filter)
    return first


def whose(taken: Sequence[Source], replaced: Sequence[Source]) -> str:
    """Return the text of a note on the sources that only the AHRS uses, and those that it
    replaces."""
    text = f", which alone uses {_names(taken)}" if taken else ""
    return text + (f", in place of the recorded {_names(replaced)}" if replaced else "")


def notes_on(ahrs: Filter, rate: float, aided: bool) -> list[str]:
    """Return notes on attitudes at that rate (Hz); `aided` as in `attitudes`."""
    notes = [f"attitude from {ahrs.name} at {rate:.4g} Hz"]
    if not ahrs.states:
        notes.append(
            f"{ahrs.name} claims no standard deviations: {_degrees(ASSUMED)} deg of roll, pitch and "
            f"heading are assumed"
        )
    if not aided:
        notes.append(
            f"{ahrs.name}: {ahrs.unaided_note}"
            if ATT.stop - 1 in ahrs.states
            else f"{ahrs.name} gives roll and pitch and no heading"
        )
    return notes


def taken_by(ahrs: Filter, sources: Iterable[Source]) -> list[Source]:
    """Return the sources that only the AHRS uses: those of the heading."""
    return [
        a for a in sources if a.kind in HEADING_KINDS and a.kind in (ahrs.uses or HEADING_KINDS)
    ]


def attitudes(ahrs: Filter, path: Trajectory, aided: bool) -> tuple[Array, Array]:
    """(y, std) of the attitudes of an AHRS; `aided`: True where a source measures the heading. A
    heading that is not estimated, or drifts without a growing std, is NaN."""
    y = path.rph.copy()
    std = deviations(path) if ahrs.states else np.tile(ASSUMED, (len(y), 1))
    if not aided and ATT.stop - 1 not in ahrs.states:
        y[:, 2] = std[:, 2] = np.nan
    return y, std


def source(recording: Recording, ahrs: Filter, asked: RunOptions) -> tuple[Source, list[str]]:
    """(Source of kind `attitude`, notes): the solution of the attitude filter `ahrs` at every n-th
    IMU sample, with n the integer nearest to the requested rate.

    Rows that are not VALID are left out. If the requested start has a better heading than
    alignment, the AHRS begins with it. y: roll, pitch, heading, NaN where the filter does not
    estimate a heading; std: claimed by the filter, else `ASSUMED`. Raises DataError.
    """
    rate, imu, noise = asked["ahrs_rate"], asked["imu"], asked["noise"]
    own = 1 / float(np.median(recording.imu.dt))
    if rate > own * 1.001:
        raise DataError(f"ahrs_rate is {rate:g} Hz; it must be at most the IMU's {own:.4g} Hz")
    every = round(own / rate)
    seen = replace(
        recording,
        sources=without_estimates(a for a in recording.sources if a.kind != "attitude"),
    ).with_meta(notes=[], estimate={})
    assumed, spec = assumed_noise(
        seen.meta.get("grade") if imu is None else imu, noise, needed=True
    )
    assert spec is not None  # it was needed
    begin = _start(seen, spec, asked["start"])
    check_needs(ahrs, seen.sources)
    run = ready(seen, ahrs, begin, assumed, spec, run_options(every=every, notify=asked["notify"]))
    run.complete()
    solution = solution_of(run)
    keep = solution.status == VALID
    aided = bool(taken_by(ahrs, [a for a in seen.sources if len(a.t)]))
    path = solution.trajectory.take(keep)
    y, std = attitudes(ahrs, path, aided)
    notes = notes_on(ahrs, own / every, aided)
    said = [condition.text for condition in ahrs.conditions]
    notes += [f"{ahrs.name}: {text}" for _, text in solution.events if text in said]
    if ahrs.diagnose:
        notes += [
            f"{ahrs.name}: {text}"
            for _, text in ahrs.diagnose(solution.t, solution.trajectory.lla, solution.columns)
        ]
    notes += _silence(ahrs, path.t, solution.t, own / every)
    notes += _motion(ahrs, begin, recording.imu)
    notes += [f"{ahrs.name} {solution.meta['stopped']}"] if "stopped" in solution.meta else []
    return Source("attitude", path.t, y, std, name=ahrs.name), notes


def deviations(path: Trajectory) -> Array:
    """(n, 3) rad: the claimed standard deviations of the attitude, rotated from north, east, down
    to horizontal forward, right and down.

    The correlation of the errors about north and east is not available and left out; it has no
    effect where both are equal.
    """
    assert path.std is not None
    north, east, down = path.std[:, ATT].T
    heading = path.rph[:, 2]
    c, s = np.cos(heading), np.sin(heading)
    return np.c_[np.hypot(c * north, s * east), np.hypot(s * north, c * east), down]


def _silence(ahrs: Filter, given: Array, t: Array, rate: float) -> list[str]:
    """Return notes on an AHRS with rows at `t` and attitudes only at the times `given`."""
    edges = np.r_[t[:1], given, t[-1:]]
    gaps = np.diff(edges)
    long = gaps > SILENT + 1 / rate
    if not long.any():
        return []
    k = int(np.argmax(gaps))
    more = f", and {long.sum() - 1} times more for over {SILENT:g} s" if long.sum() > 1 else ""
    return [
        f"{ahrs.name} gave no attitude from {edges[k]:.1f} to {edges[k + 1]:.1f} s{more}: {UNUSABLE}"
    ]


def _motion(ahrs: Filter, start: InitialState, imu: Imu) -> list[str]:
    """Return notes on an AHRS whose InitialState is not at rest: from specific force alone, an
    acceleration looks like tilt."""
    if "level from specific force alone" not in start.note or motionless(imu, start.t):
        return []
    return [
        f"{ahrs.name} began in motion, at {start.t:.1f} s: its attitude may be off by tens of "
        f"degrees for minutes, more than its "
        "standard deviations; begin at a standstill"
    ]


def _alone() -> list[str]:
    return [name for name in filters.names() if not has_position(filters.find(name))]


def _find_ahrs(name: str | Filter) -> Filter:
    """Return the Filter of that name. Raises DataError, which lists the AHRSs, for an unknown
    one."""
    try:
        return filters.find(name)
    except ValueError:
        near = get_close_matches(str(name), _alone(), 1)
        raise DataError(
            f"no AHRS is called {name!r}; {f'did you mean {near[0]!r}? ' if near else ''}there are: "
            f"{', '.join(_alone())}"
        ) from None


def _check(ahrs: Filter, filter: Filter) -> None:
    """Raise DataError where `ahrs` is not an AHRS, or `filter` does not use an attitude."""
    if has_position(ahrs):
        raise DataError(
            f"{ahrs.name} is not an AHRS, because it needs positions; these are: {', '.join(_alone())}"
        )
    if filter.uses is not None and "attitude" not in filter.uses:
        raise DataError(
            f"{filter.name} does not use the attitude of an AHRS: leave out ahrs (--ahrs), or "
            "choose another filter"
        )


def _start(recording: Recording, spec: ImuSpec, given: InitialState | None) -> InitialState:
    """Return the InitialState of the AHRS: at the beginning of the record, or the `given` one of
    the other filter if its heading is better."""
    start = align(recording, spec, position=False)
    if (
        given is None
        or given.std[8] >= start.std[8]
        or not recording.span[0] <= given.t < recording.span[1]
    ):
        return start
    return align(
        recording, spec, heading=given.rph[2], heading_std=given.std[8], at=given.t, position=False
    )


def _names(sources: Iterable[Source]) -> str:
    return " and ".join(dict.fromkeys(a.name or a.kind for a in sources))


def _degrees(values: Sequence[float] | Array) -> str:
    return ", ".join(f"{value:g}" for value in np.degrees(values).round(3))
