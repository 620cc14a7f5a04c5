"""The scores of an outage: the scored rows, which are the same for every filter, and the scores of
one filter.

Errors are true - estimate at the solution's own rows against the reference in its own geodetic
frame, without any alignment of the two. An outage is scored from its first row to the last one
before a fix of the withheld kinds is used again.
"""

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...checks import DataError
from ...core.loop.contract import InitialState
from ...core.loop.loop import SAME_TIME
from ...data.recording import Recording
from ...data.solution import Solution, Trajectory
from ...evaluation.consistency import coverage
from ...evaluation.metrics import EULER, NED_AXES, interpolate_reference
from ...geometry.geodesy import displacement, wrap
from ...typing import Array, Mask
from .protocols import Protocol, Window, window_text

HARDLY = 10.0
"""m: over a shorter distance the drift is not given in percent."""
MOSTLY = 0.95
"""Share of rows with a known reference above which there is no note."""
NEAR_END = 0.02
"""Share of the length of an outage: so far before its end, or one IMU sample, the reference must be
known for errors at the end."""
COARSE = 5, 1.0
"""A reference of fewer rows in an outage, or of longer steps (s), is noted."""
NAMED = 10
"""Largest number of outages that a note lists."""
DRAWN = 301
"""Rows of an outage that are kept for drawing."""


class ScoredOutage(NamedTuple):
    """A window, the IMU rows that are scored in it and where a run of it branches off, and what
    the reference says of it."""

    start: float
    stop: float
    branch: int  # IMU row before which no withheld fix of the window was used yet
    first: int  # scored IMU rows
    last: int  # and the one after them
    truth: Trajectory  # the reference at its scored rows, NaN where it is not known
    distance: float  # m, horizontal way of the reference in it
    known: float  # share of its rows at which the reference is known
    reaches_end: bool  # whether the reference is known to its end
    coarse: bool  # whether the reference has few rows in it

    @property
    def length(self) -> float:
        """s."""
        return self.stop - self.start


class ErrorTrack(NamedTuple):
    """Errors of one filter in one outage, thinned for drawing."""

    since: Array  # (k,) s since its start
    error: Array  # (k, 3) true - estimate, m NED
    std: Array | None  # (k, 3) claimed standard deviations, m; None where the filter claims none


def known_reference(recording: Recording) -> Trajectory:
    """The rows of the recording's reference, which it has, whose position is known. Raises
    DataError where there are none."""
    reference = recording.reference
    assert reference is not None
    known: Mask = np.all(np.isfinite(reference.lla), axis=1)
    if known.sum() < 2:
        raise DataError(
            "the reference has no position, but outages are scored by position: add one to it"
        )
    (first, last), (begin, end) = reference.t[known][[0, -1]], recording.span
    if last < begin or first > end:
        raise DataError(
            f"the reference covers {first:.10g} to {last:.10g} s, but the recording {begin:.10g} to "
            f"{end:.10g} s; check its clock"
        )
    return replace(reference.take(known), std=None)


class _Scene(NamedTuple):
    """The data that outages are found from."""

    t: Array  # s of the IMU rows
    used: Array  # s up to which each row uses fixes
    least: int  # first row after the start
    truth: Trajectory  # the reference at all rows in any window
    times: Array  # s of the fixes of the kinds withheld, in order
    kinds: str  # named
    sample: float  # s, the usual step of the IMU
    step: float  # s, of the reference


def outages_of(
    made: Protocol,
    recording: Recording,
    reference: Trajectory,
    kinds: Collection[str],
    start: InitialState,
) -> tuple[list[ScoredOutage], list[str]]:
    """([Outage] of a Protocol, notes). `kinds` are withheld, `start` is the InitialState of the
    filters.

    A window of a sweep in which nothing is withheld or nothing known of the reference is left out
    and noted. Raises DataError where all are, or in another protocol one is; and where two outages
    of one run have no withheld fix between them.
    """
    scene = _scene(made, recording, reference, kinds, start)
    found: list[ScoredOutage] = []
    left_out: dict[str, list[Window]] = {}
    for window in made.windows:
        try:
            found.append(_outage(window, scene))
        except DataError as error:
            if not made.sweep:
                raise
            left_out.setdefault(str(error).partition(": ")[2], []).append(window)
            refused = error
    if not found:
        raise refused
    for one, other in zip(found, found[1:] if not made.sweep else ()):
        if not ((scene.times >= one.stop) & (scene.times < other.start)).any():
            raise DataError(
                f"outages {window_text(one[:2])} and {window_text(other[:2])} have no fix of {scene.kinds} "
                f"between them: give one window"
            )
    notes = [
        f"{len(windows)} of {len(made.windows)} windows left out, such as {window_text(windows[0])}: "
        f"{why}"
        for why, windows in left_out.items()
    ]
    return found, notes + _poor_references(found, scene.step)


def _scene(
    made: Protocol,
    recording: Recording,
    reference: Trajectory,
    kinds: Collection[str],
    start: InitialState,
) -> _Scene:
    t, inside = recording.imu.t, np.zeros(len(recording.imu.t), bool)
    for begin, stop in made.windows:
        inside[
            np.searchsorted(t, begin - SAME_TIME) : np.searchsorted(
                t, stop + SAME_TIME, side="right"
            )
        ] = True
    times = np.sort(
        np.concatenate([a.t for a in recording.sources if a.kind in kinds] or [np.empty(0)])
    )
    least = int(np.searchsorted(t, start.t + SAME_TIME, side="right"))
    steps = float(np.median(recording.imu.dt)), float(np.median(np.diff(reference.t)))
    truth = interpolate_reference(reference, t[inside])
    if reference.std is not None:  # of fixes that stand for a reference
        nearest = np.clip(np.searchsorted(reference.t, truth.t), 0, len(reference.t) - 1)
        truth = replace(truth, std=reference.std[nearest])
    return _Scene(
        t,
        t + SAME_TIME,
        least,
        truth,
        times,
        " or ".join(kinds),
        *steps,
    )


def _outage(window: Window, scene: _Scene) -> ScoredOutage:
    begin, stop = window
    # the first withheld fix, and the first one that is no longer withheld
    missing, again = (int(np.searchsorted(scene.times, edge)) for edge in window)
    if missing >= again:
        raise DataError(
            f"outage {window_text(window)}: there is no fix of {scene.kinds} in it to withhold; give "
            f"another window or other kinds"
        )
    if stop - begin < 2 * scene.sample - SAME_TIME:
        raise DataError(
            f"outage {window_text(window)}: it is shorter than two IMU samples of {scene.sample:.3g} s; "
            f"give a longer window"
        )
    first = int(np.searchsorted(scene.t, begin - SAME_TIME))
    last = int(np.searchsorted(scene.t, stop + SAME_TIME, side="right"))
    branch = min(first, int(np.searchsorted(scene.used, scene.times[missing])))
    if again < len(scene.times):
        last = min(last, int(np.searchsorted(scene.used, scene.times[again])))
    branch, first, last = (max(row, scene.least) for row in (branch, first, last))
    if last - first < 2:
        raise DataError(
            f"outage {window_text(window)}: there are fewer than two IMU samples in it; give another "
            f"window"
        )
    at = int(np.searchsorted(scene.truth.t, scene.t[first]))
    truth = scene.truth.take(slice(at, at + last - first))
    known = np.isfinite(truth.lla).all(axis=1)
    if not known.any():
        raise DataError(
            f"outage {window_text(window)}: the reference covers no time of it; give another window"
        )
    path = truth.lla[known]
    way = float(np.hypot(*displacement(path[1:], path[:-1])[:, :2].T).sum())
    reaches_end = bool(
        stop - truth.t[known][-1] <= max(NEAR_END * (stop - begin), scene.sample) + SAME_TIME
    )
    coarse = scene.step > COARSE[1] or COARSE[0] * scene.step > stop - begin + SAME_TIME
    return ScoredOutage(
        float(begin),
        float(stop),
        branch,
        first,
        last,
        truth,
        way,
        float(known.mean()),
        reaches_end,
        coarse,
    )


def _poor_references(found: list[ScoredOutage], step: float) -> list[str]:
    """Notes on the outages that the reference covers in part, not to the end, or at few rows,
    `step` s apart."""
    poor = (
        (
            lambda o: o.known < MOSTLY,
            f"the reference is known at less than {100 * MOSTLY:g} % of the rows of {{}}; only these "
            f"rows are scored",
        ),
        (
            lambda o: not o.reaches_end,
            "the reference is not known to the end of {}: no errors at the end",
        ),
        (
            lambda o: o.coarse,
            f"the reference has a row every {step:.3g} s, which is coarse for {{}}: motion between "
            f"its rows counts as error",
        ),
    )
    numbers = [([i for i, o in enumerate(found, 1) if has(o)], text) for has, text in poor]
    return [text.format(_outages(own)) for own, text in numbers if own]


def _outages(numbers: list[int]) -> str:
    text = ", ".join(map(str, numbers[:NAMED])) + (
        f" and {len(numbers) - NAMED} more" if len(numbers) > NAMED else ""
    )
    return f"outage{'s' * (len(numbers) > 1)} {text}"


def score_outage(solution: Solution, outage: ScoredOutage) -> tuple[dict[str, float], ErrorTrack]:
    """({column: value}, Track) of a Solution of the rows of an ScoredOutage. Raises DataError where
    its position is no number."""
    estimate, truth = solution.trajectory, outage.truth
    if not np.isfinite(estimate.lla).all():
        raise DataError("diverged: its position is not a number")
    known = np.isfinite(truth.lla).all(axis=1)
    p = displacement(truth.lla[known], estimate.lla[known])
    std = np.full_like(p, np.nan) if estimate.std is None else estimate.std[known, :3]
    if truth.std is not None:
        std = np.hypot(std, truth.std[known, :3])
    row = (
        _position_scores(p, outage)
        | _velocity_scores(estimate, outage)
        | _attitude_scores(estimate, truth)
        | _coverage(p, std)
    )
    at = np.unique(np.linspace(0, len(p) - 1, min(len(p), DRAWN)).round().astype(int))
    claimed = estimate.std is not None and np.isfinite(estimate.std[:, :3]).any()
    return row, ErrorTrack(truth.t[known][at] - outage.start, p[at], std[at] if claimed else None)


def _rms(values: Array) -> float:
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _position_scores(p: Array, outage: ScoredOutage) -> dict[str, float]:
    horizontal, end = (
        np.hypot(p[:, 0], p[:, 1]),
        p[-1] if outage.reaches_end else np.full(3, np.nan),
    )
    far = float(np.hypot(end[0], end[1]))
    row = {f"{axis}_rmse_m": _rms(p[:, i]) for i, axis in enumerate(NED_AXES)} | {
        f"{axis}_end_m": float(end[i]) for i, axis in enumerate(NED_AXES)
    }
    return row | {
        "horizontal_rmse_m": _rms(horizontal),
        "horizontal_max_m": float(horizontal.max()),
        "horizontal_end_m": far,
        "drift_percent": 100 * far / outage.distance if outage.distance >= HARDLY else np.nan,
    }


def _velocity_scores(estimate: Trajectory, outage: ScoredOutage) -> dict[str, float]:
    v = (
        np.full((1, 3), np.nan)
        if outage.truth.v_n is None or estimate.v_n is None
        else outage.truth.v_n - estimate.v_n
    )
    size = np.linalg.norm(v, axis=1)
    known = np.flatnonzero(np.isfinite(size))
    end = float(size[known[-1]]) if len(known) and outage.reaches_end else np.nan
    return {f"velocity_{axis}_rmse_m_s": _rms(v[:, i]) for i, axis in enumerate(NED_AXES)} | {
        "velocity_rmse_m_s": _rms(size),
        "velocity_end_m_s": end,
    }


def _attitude_scores(estimate: Trajectory, truth: Trajectory) -> dict[str, float]:
    rph = (
        np.full((1, 3), np.nan)
        if truth.q_nb is None or estimate.q_nb is None
        else wrap(truth.rph - estimate.rph)
    )
    return {f"{name}_rmse_deg": float(np.degrees(_rms(rph[:, i]))) for i, name in enumerate(EULER)}


def _coverage(p: Array, std: Array) -> dict[str, float]:
    """Share of the errors within 1, 2 and 3 claimed standard deviations: north and east
    together, and down."""
    share = coverage(p, std)
    return {f"coverage_{k}": float(share[k - 1, :2].mean()) for k in (1, 2, 3)} | {
        f"down_coverage_{k}": float(share[k - 1, 2]) for k in (1, 2, 3)
    }
