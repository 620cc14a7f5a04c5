"""Heading hypotheses: where nothing observes the heading at the start, the closed loop runs from
headings all around the circle until its fixes decide between them.

With a known heading psi at the start, the normalised innovations squared (NIS) of a run sum to -2
log likelihood of psi plus a constant; the filter integrates out all other states. Sources: Magill
(1965) for the bank of filters; Groves (2013) section 16.3 on hypotheses.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import filters
from ..alignment.course_heading import MOVING
from ..alignment.first_fixes import source
from ..alignment.initial import align, starts_around
from ..alignment.initial_heading import UNKNOWN_STD, HeadingFound
from ..alignment.rest import rests
from ..core.loop.contract import InitialState, Noise
from ..data.calibration_parameters import HARD_IRON
from ..data.recording import Recording
from ..data.solution import GNSS, Source
from ..data.vehicle import find as find_vehicle
from ..geometry.geodesy import wrap
from ..sensor_models.imu import ImuSpec
from ..typing import Array, Notify
from .options import run_options
from .prepare import Run, ready

DOUBTFUL = np.radians(20.0)  # std of a course above which headings are tried
HEADINGS = 12
SPACING = 2 * np.pi / HEADINGS
LOOKS = (5.0, 10.0, 20.0, 40.0, 60.0)  # s after which the sums are compared
BEFORE = 60.0  # s: a rest within them gives level and gyro bias
REUSE = 4.0
"""Factor that reduces the weight of the sums: the filter uses the same fixes again later, so that
the standard deviation from the first use is doubled, and the level at the start depends on some of
them."""
LOST = 12.0  # a heading is dropped when its scaled sum exceeds the smallest by so much
LIKELIEST = np.radians(60.0)  # spread of all headings below which the likeliest one is reported
TOGETHER = np.radians(20.0)  # spread of the remaining headings below which they count as one
DECIDED = np.radians(20.0)  # std below which the heading counts as found
MAX_ROUNDS = 5
OUTLIER = 100.0  # NIS above which a fix is an outlier, if it is so for every heading
BACKWARDS_SPEED, BACKWARDS = 0.5, 0.9  # m/s, and share of the time
MIN_STD = np.radians(1.0)
FIXED_STD = np.radians(0.1)  # of a heading that is held as known


def align_start(
    recording: Recording,
    imu: ImuSpec,
    position: bool = True,
    noise: Noise | None = None,
    notify: Notify | None = None,
) -> InitialState:
    """Return the InitialState that `align` finds. For a filter with positions, if its heading is
    unknown or from a slow course, the fixes decide between heading hypotheses.

    During a rest, headings are tried from its end on. Raises DataError.
    """
    start = align(recording, imu, position=position)
    if not (position and _doubtful(start)):
        return start
    begin = rests(recording, start.t).until(recording.imu, start.t)
    fresh = (recording.imu.t > begin) & (recording.imu.t <= begin + LOOKS[-1])
    if fresh.sum() < 2:
        return start
    part = recording.between(begin - BEFORE, begin + LOOKS[-1])
    fixes = source(part, "position")
    if fixes is None or fixes.t[-1] <= begin:
        return start
    ahead = find_vehicle(recording.meta.get("vehicle")).points_ahead
    used = [
        a
        for a in part.sources
        if HARD_IRON.name not in a.estimate and not (ahead and _is_backwards(a))
    ]
    part = replace(part, sources=tuple(replace(a, gate=OUTLIER) for a in used))
    trials = _Trials(part, begin, imu, noise or imu.noise(), notify)
    found, likeliest = _decide_heading(trials, start)
    if wrong := _contradicting_sources(likeliest):
        left = tuple(a for a in part.sources if (a.kind, a.name) not in wrong)
        found, _ = _decide_heading(trials._replace(recording=replace(part, sources=left)), start)
    return starts_around(recording, imu, start.t, [found])[0]


def _contradicting_sources(run: Run) -> set[tuple[str, str]]:
    """Kinds and names of sources beside GNSS that contradict it from the likeliest heading too: their unit, sign or scale is
    wrong, and what they say of the heading as well."""
    books = run.cursor.books
    return {
        (a.kind, a.name)
        for s, a in enumerate(run.recording.sources)
        if a.kind not in GNSS and (books[s].exclusions > 0 or books[s].fails.any())
    }


def _doubtful(start: InitialState) -> bool:
    """True where the heading is unknown, or from the course of a slow vehicle, which may be a
    device carried by hand."""
    if "heading from the course" not in start.note:
        return not start.std[8] < UNKNOWN_STD
    return bool(start.std[8] > DOUBTFUL or np.hypot(start.v_n[0], start.v_n[1]) < MOVING)


def _is_backwards(source: Source) -> bool:
    """True for a speed or velocity in the body that has a vehicle go backwards nearly all the time: rather
    its sign is wrong, and it would decide for the opposite heading."""
    if source.kind == "beam-velocity":
        ahead = source.y[:, 0] * np.sign(source.parameters[3])
    elif source.kind in ("speed", "body-velocity"):
        ahead = source.y[:, 0]
    else:
        return False
    moves = ahead[np.abs(ahead) > BACKWARDS_SPEED]
    return len(moves) > 0 and bool(np.mean(moves < 0) > BACKWARDS)


class _Trials(NamedTuple):
    """The common inputs of the runs of all headings."""

    recording: Recording
    begin: float  # s
    imu: ImuSpec
    noise: Noise
    notify: Notify | None

    def runs(self, headings: NDArray[np.floating[Any]]) -> list[Run]:
        """Return runs from these headings (rad), treated as known: with a large heading error, a
        linearised filter would gain false information."""
        founds = [HeadingFound(float(wrap(heading)), FIXED_STD, "") for heading in headings]
        every = len(self.recording.imu.t)
        closed_loop = filters.find("closed-loop")
        return [
            ready(
                self.recording,
                closed_loop,
                start,
                self.noise,
                self.imu,
                run_options(every=every, notify=self.notify),
            )
            for start in starts_around(self.recording, self.imu, self.begin, founds)
        ]

    @property
    def seconds(self) -> float:
        """Longest duration of the runs, s."""
        return float(self.recording.imu.t[-1] - self.begin)

    def row(self, seconds: float) -> int:
        """Return the row of the samples after so many seconds."""
        return int(np.searchsorted(self.recording.imu.t, self.begin + seconds))


class _Peak(NamedTuple):
    """Heading and its standard deviation, rad."""

    heading: float
    std: float


def _decide_heading(trials: _Trials, start: InitialState) -> tuple[HeadingFound, Run]:
    """Return the heading that the innovations select, else the mean over all headings, and the run from the
    likeliest one. A priori, the heading of `start` is as likely as all others together."""
    headings = SPACING * np.arange(HEADINGS)
    runs, sums = trials.runs(headings), np.zeros(HEADINGS)
    alive = np.ones(HEADINGS, bool)
    end = len(trials.recording.imu.t)
    for seconds in LOOKS:
        row = trials.row(seconds)
        sums[alive], scale = _sums([run for run, kept in zip(runs, alive) if kept], row)
        alive &= sums < sums[alive].min() + LOST * scale
        if not alive.any():
            break
        weights: Array = np.where(alive, np.exp(-0.5 * (sums - sums[alive].min()) / scale), 0.0)
        mean, spread = _mean(headings, weights)
        peak = _refine_peak(trials, mean, row) if spread < TOGETHER else None
        if peak and peak.std < DECIDED:
            note = f"found by trying {HEADINGS} headings over {seconds:.0f} s"
            words = f"heading {_degrees(peak.heading)} deg {note}"
            likeliest = runs[int(np.argmin(np.where(alive, sums, np.inf)))]
            return HeadingFound(peak.heading, peak.std, words), likeliest
        if row == end:
            break
    likeliest = runs[int(np.argmin(np.where(alive, sums, np.inf) if alive.any() else sums))]
    tried = f"of {HEADINGS} headings tried over {min(seconds, trials.seconds):.0f} s"
    if not alive.any():
        words = f"heading unknown, {tried} the filter converged from none"
        return HeadingFound(0.0, UNKNOWN_STD, words), likeliest
    from_start: Array = np.exp(-0.5 * (wrap(headings - start.rph[2]) / start.std[8]) ** 2)
    mean, spread = _mean(headings, weights * (from_start / from_start.sum() + 1 / HEADINGS))
    std = min(np.hypot(spread, SPACING / np.sqrt(12)), UNKNOWN_STD)
    words = (
        f"heading {_degrees(mean)} deg is the likeliest"
        if std < LIKELIEST
        else (
            f"heading {_degrees(mean)} deg is a guess, none is clearly the likeliest"
            if std < UNKNOWN_STD
            else "heading unknown, none is clearly the likeliest"
        )
    )
    return HeadingFound(mean, std, f"{words} {tried}"), likeliest


def _mean(headings: NDArray[np.floating[Any]], weights: Array) -> tuple[float, float]:
    """Circular mean and standard deviation (rad) of weighted headings."""
    mean = np.sum(weights * np.exp(1j * headings)) / weights.sum()
    return float(np.angle(mean)), float(np.sqrt(-2 * np.log(np.clip(abs(mean), 1e-9, 1.0))))


def _degrees(heading: float) -> str:
    return f"{np.degrees(heading) % 360:.0f}"


def _refine_peak(trials: _Trials, heading: float, row: int) -> _Peak | None:
    """Return the _Peak of the likelihood around a heading, from a parabola through the sums of runs
    with fixed headings, as wide as the peak; None where there is no peak."""
    width = np.radians(10.0)
    for _ in range(MAX_ROUNDS):
        offsets = width * np.arange(-2.0, 3.0)
        sums, scale = _sums(trials.runs(heading + offsets), row)
        least = int(np.argmin(sums))
        if not np.isfinite(sums).all():
            return None
        if least in (0, len(sums) - 1):
            heading += offsets[least]
            continue
        near = slice(least - 1, least + 2)
        curvature, slope, _ = np.polyfit(offsets[near], sums[near] / scale, 2)
        best, std = -0.5 * slope / curvature, 1 / np.sqrt(curvature)
        heading += best
        if std > 0.5 * width:
            return _Peak(float(wrap(heading)), max(float(std), MIN_STD))
        width = std
    return None


def _sums(runs: list[Run], row: int) -> tuple[Array, float]:
    """Sums of NIS of these runs up to a row, inf where one failed, and the scale of them:
    `REUSE`, or more where the innovations of the best run are larger than they should be."""
    sums = np.empty(len(runs))
    rows = np.empty(len(runs))
    for i, run in enumerate(runs):
        if not run.cursor.state[0].fault:
            run.advance(row)
        used = run.out.fix[: run.cursor.state[0].fix]
        rows[i] = np.isfinite(used["innovation"]).sum()
        sums[i] = (
            np.inf
            if run.cursor.state[0].fault
            else np.minimum(np.nan_to_num(used["nis"]), OUTLIER).sum()
        )
    best = int(np.argmin(sums))
    return sums, REUSE * max(1.0, sums[best] / max(1.0, rows[best]))
