"""The clock of the fixes against that of the IMU, over a minute either way.

Two quantities are compared first that no mounting changes: the size of the specific force,
|dv/dt - g|, and the rate of turn about the vertical, that of the course over ground. Their
correlation is taken over all lags. What it shows is believed where it is far likelier than any lag
farther off. Near there the whole vectors are compared, dv/dt - g in NED and the specific force in
axes that the gyros hold still: for each stretch of time and lag the rotation is taken that fits
them best (Wahba's problem, by singular values; Markley 1988), and the lag where least is left over.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array, Ints, Mask
from ..units.constants import STANDARD_GRAVITY
from .finding import MIN_FIXES, Checked, label
from .motion import Felt, InspectedRecording, Moved, course_rate, source_velocity

REACH, COARSE, FINE = 60.0, 0.1, 0.02
"""Lags that are looked at, and their steps in the first and the second search, s."""
SPACING = 0.4
"""Seconds between the fixes that the first search uses."""
HALF = 1.0
"""Half the window over which accelerations and rates are taken, s; of positions twice that."""
FAR, EVIDENCE = 3.0, 10.0
"""A lag is believed where the logarithm of its likelihood over that of any other more than FAR (s)
off is above EVIDENCE."""
SYSTEMATIC = {"acceleration": 0.02, "turns": 0.08, "vectors": 0.01}
"""Systematic errors that no scatter shows, s: the course of an antenna ahead of the rear axle leads
the turn of the vehicle, that of an aircraft lags its own."""
ALONE = 0.1 * HALF
"""The same of one quantity that no other confirms, s: a tenth of half its window. What else changes
the size of the specific force, such as a mounting that is off, shifts where it fits best."""
STRETCH = 30.0
"""Seconds over which the gyros hold axes still."""
BLOCKS, MIN_BLOCKS = 10, 4
SURE, MIN_OFFSET = 5.0, 0.08
"""Standard deviations and seconds from which a lag is a reason."""
LEAPS = {
    18.0: "the leap seconds between GPS time and UTC",
    37.0: "the leap seconds between TAI and UTC",
    19.0: "TAI against GPS time",
}
"""Meanings of offsets by whole seconds, since 2017."""


class Lag(NamedTuple):
    """The clock of a source of fixes against the IMU's."""

    source: str
    seconds: float  # that must be added to the time stamps of the fixes
    std: float  # s
    correlation: float  # there
    evidence: float  # logarithm of the likelihood ratio to the best lag farther off
    by: str  # what was compared

    @property
    def believed(self) -> bool:
        """True where this lag is far likelier than any other."""
        return self.evidence > EVIDENCE and self.std < 1.0


class Series(NamedTuple):
    """One quantity as the fixes tell it and as the IMU feels it."""

    by: str
    t: Array  # (n,) s, of the fixes' clock
    theirs: Array  # (n,)
    at: Array  # (m,) s, of the IMU's clock, evenly
    ours: Array  # (m,); NaN where it is not known
    independent: float  # how many of the n count

    def imu_motion(self, lags: Array, every: int = 1) -> Array:
        """(k, n / every) what the IMU felt at the times of the fixes, each lag (s) a row."""
        if len(self.at) < 2:
            return np.full((len(lags), len(self.t[::every])), np.nan)
        # `at` is even: an index is found without a search, which is what costs in np.interp
        step = self.at[1] - self.at[0]
        x = (self.t[::every] - self.at[0] + lags[:, None]) / step
        k = np.clip(x.astype(int), 0, len(self.at) - 2)
        found = self.ours[k] + (x - k) * (self.ours[k + 1] - self.ours[k])
        found[(x < 0) | (x > len(self.at) - 1)] = np.nan
        return np.asarray(found)


def check(subject: InspectedRecording) -> Checked:
    """The clock of each source of velocity and position against the IMU's."""
    found, lags = Checked.empty(), []
    sources = subject.sources("position", "velocity")
    for source in sources:
        lag = coarse_lag(subject, source)
        if lag is None or not lag.believed:
            why = "too few fixes within the IMU record" if lag is None else _unclear(lag)
            found.add(Checked.with_unknown(f"clock of {label(source)} against the IMU", why))
        else:
            lags.append(lag)
            found.facts.append(
                f"clock of {lag.source} against the IMU: add {lag.seconds:+.2f} +- {lag.std:.2f} "
                f"s, from its {lag.by} (correlation {lag.correlation:.2f})"
            )
    found.reasons.extend(_reasons(lags, len(sources), subject.apart))
    return found


def coarse_lag(subject: InspectedRecording, source: Source) -> Lag | None:
    """The Lag of one source of velocities or positions, within REACH; None where there are too few
    fixes."""
    fixes = source_velocity(source)
    if fixes is None:
        return None
    series = _series(fixes, source.kind, subject.felt)
    lags = [lag for each in series if (lag := _lag(each, fixes.name))]
    if not lags:
        return None
    best = max(lags, key=lambda lag: lag.evidence)
    sure = [lag for lag in lags if lag.evidence > EVIDENCE] or [best]
    vectors = _by_vectors(fixes, source.kind, subject.felt, best.seconds)
    confirmed = len(sure) > 1 or np.isfinite(vectors[1])
    known = [(lag.seconds, float(np.hypot(lag.std, 0.0 if confirmed else ALONE))) for lag in sure]
    known = [(lag, std) for lag, std in (*known, vectors) if np.isfinite(std)]
    if not known:
        return best._replace(std=np.inf)
    seconds, weight = np.array([(lag, std**-2) for lag, std in known]).T
    mean = float(np.average(seconds, weights=weight))
    # quantities that disagree are not better known than that
    spread = float(np.sqrt(max(1.0, (weight * (seconds - mean) ** 2).sum())))
    return best._replace(seconds=mean, std=spread * float(weight.sum() ** -0.5))


def _half(fixes: Moved, kind: str) -> float:
    """Half the window of an acceleration, s: positions are the noisier."""
    return max(HALF, fixes.interval) * (2 if kind == "position" else 1)


def _by_vectors(fixes: Moved, kind: str, motion: Felt, near: float) -> tuple[float, float]:
    """(lag, std) in s within a second of `near`, by whole vectors; std is infinite where there are
    too few."""
    half = _half(fixes, kind)
    a = (fixes.at(fixes.t + half) - fixes.at(fixes.t - half)) / (2 * half)
    a -= [0.0, 0.0, STANDARD_GRAVITY]
    lags = near + np.arange(-1.0, 1.0 + COARSE / 4, COARSE / 2)
    inside = (fixes.t + lags[0] - half > motion.t[0]) & (fixes.t + lags[-1] + half < motion.t[-1])
    use = np.isfinite(a).all(axis=1) & inside
    t, a = fixes.t[use], a[use]
    _, edges = np.unique(np.floor(t / STRETCH), return_index=True)
    if len(edges) < MIN_BLOCKS or len(t) < MIN_FIXES:
        return near, np.inf
    integral = motion.at_antenna(fixes.arm)
    left = np.stack([left_over(a, motion.mean(integral, t + lag, half), edges) for lag in lags])
    total = left.sum(axis=1)
    independent = 3 * len(t) * fixes.interval / (2 * half)
    # the least of a misfit that has none inside, as of few fixes, is an end of the search: it moves
    # with no part of the record, so that leaving parts out would call it certain
    others = min(total[0], total[-1], float(np.median(total)))
    if not independent / 2 * np.log(others / max(total.min(), 1e-12)) > EVIDENCE:
        return near, np.inf
    # leaving out one part of the record after the other (jackknife)
    parts = np.array_split(np.arange(len(edges)), min(BLOCKS, len(edges)))
    without = np.array([_top(lags, left[:, part].sum(axis=1) - total) for part in parts])
    return _top(lags, -total), float(np.hypot(_jackknife(without), SYSTEMATIC["vectors"]))


def left_over(a: Array, f: Array, edges: Ints) -> Array:
    """(k,) sum of squares that is left of vectors `a` (n, 3) less `f` (n, 3), rotated as fits best
    in each stretch that begins at a row of `edges` (k,)."""
    u, s, v = np.linalg.svd(np.add.reduceat(a[:, :, None] * f[:, None, :], edges, axis=0))
    s[:, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(v))
    squares = np.add.reduceat((a * a + f * f).sum(axis=1), edges)
    return np.asarray(squares - 2 * s.sum(axis=1))


def _series(fixes: Moved, kind: str, motion: Felt) -> Iterator[Series]:
    """The quantities to compare."""
    half = _half(fixes, kind)
    first, last = fixes.at(fixes.t - half), fixes.at(fixes.t + half)
    a = (last - first) / (2 * half)
    force = np.linalg.norm(a - [0, 0, STANDARD_GRAVITY], axis=1)
    turn = course_rate(fixes, half)
    f = motion.mean(motion.at_antenna(fixes.arm), motion.t, half)
    size = np.maximum(np.linalg.norm(f, axis=1), 1e-9)
    rate = -(motion.mean(motion.turn, motion.t, half) * f).sum(axis=1) / size
    for by, theirs, ours in (("acceleration", force, size), ("turns", turn, rate)):
        use = np.isfinite(theirs)
        count = float(use.sum() * fixes.interval / (2 * half))
        yield Series(by, fixes.t[use], theirs[use], motion.t, ours, count)


def _lag(series: Series, name: str) -> Lag | None:
    """The Lag by one quantity; None where nothing varies or too few fixes are left."""
    if len(series.t) < MIN_FIXES:
        return None
    every = max(1, int(SPACING / float(np.median(np.diff(series.t)))))
    lags = np.arange(-REACH, REACH + COARSE, 2 * COARSE)
    r = correlations(series.theirs[::every], series.imu_motion(lags, every))
    if not np.isfinite(r).any():
        return None
    top = _smallest_top(lags, r, series.independent)
    # what fits as well with the opposite sign is no clock
    far = np.nan_to_num(np.abs(r[np.abs(lags - lags[top]) > FAR]))
    other = min(float(far.max(initial=0.0)), 0.999)
    lag, std = _refine_lag(series, float(lags[top]))
    best = min(max(float(r[top]), 0.0), 0.9999)
    evidence = series.independent / 2 * np.log((1 - other**2) / (1 - best**2))
    std = float(np.hypot(std, SYSTEMATIC[series.by]))
    return Lag(name, lag, std, best, float(evidence), series.by)


def _smallest_top(lags: Array, r: Array, independent: float) -> int:
    """Which lag fits best; of several that fit about as well, as where the motion repeats itself, the
    smallest."""
    best = np.clip(np.nan_to_num(r, nan=-1.0), 0.0, 0.9999)
    behind = independent / 2 * np.log((1 - best**2) / (1 - best.max() ** 2))
    before, after = np.r_[-1.0, best[:-1]], np.r_[best[1:], -1.0]
    tops = (best >= before) & (best >= after) & (behind < EVIDENCE)
    return int(np.flatnonzero(tops)[np.argmin(np.abs(lags[tops]))])


def correlations(theirs: Array, ours: Array) -> Array:
    """(k,) correlation of `theirs` (n,) with each row of `ours` (k, n), where that is known for
    half of the fixes at least; NaN elsewhere."""
    (found,) = _correlations_without(theirs, ours, np.array([0]))[:1]
    return found


def _correlations_without(theirs: Array, ours: Array, edges: Ints) -> list[Array]:
    """The same of all fixes, then without each of the parts that begin at a row of `edges`."""
    known = np.isfinite(ours)
    enough = known.sum(axis=1) >= max(MIN_FIXES, 0.5 * len(theirs))
    x = np.where(known, ours, 0.0)
    y = known * theirs
    parts = np.stack(
        [np.add.reduceat(each, edges, axis=1) for each in (known * 1.0, x, y, x * x, y * y, x * y)]
    )
    whole = parts.sum(axis=2)
    without = [whole - parts[:, :, i] for i in range(len(edges))]
    return [_correlation(each, enough) for each in (whole, *without)]


def _correlation(sums: Array, enough: Mask) -> Array:
    """(k,) correlation from sums (6, k) of 1, x, y, x^2, y^2 and x y; NaN where not enough is known."""
    total = np.maximum(sums[0], 1e-9)
    mx, my, xx, yy, xy = sums[1:] / total
    xx, yy, xy = xx - mx**2, yy - my**2, xy - mx * my
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(enough & (xx > 1e-12) & (yy > 1e-12), xy / np.sqrt(xx * yy), np.nan)


def _refine_lag(series: Series, lag: float) -> tuple[float, float]:
    """(lag, std) in s near a lag: the top of the correlation, and by leaving out one tenth of the
    record after the other (jackknife); std is infinite where the top is an end of the search."""
    lags = lag + np.arange(-1.0, 1.0 + FINE / 2, FINE)
    edges = np.array([part[0] for part in np.array_split(np.arange(len(series.t)), BLOCKS)])
    found = _correlations_without(series.theirs, series.imu_motion(lags), edges)
    top, *others = (_top(lags, r) for r in found)
    return top, _jackknife(np.array(others)) if lags[0] < top < lags[-1] else np.inf


def _jackknife(others: Array) -> float:
    """Standard deviation of a value from those (k,) that are left without one part after the
    other."""
    return float(np.sqrt((len(others) - 1) * others.var()))


def _top(lags: Array, r: Array) -> float:
    """Where the correlation is largest, s; between lags by a parabola."""
    if not np.isfinite(r).any():
        return float(lags[len(lags) // 2])
    k = int(np.nanargmax(r))
    if 0 < k < len(r) - 1:
        left, middle, right = r[k - 1 : k + 2]
        bend = left - 2 * middle + right
        if bend < 0:
            return float(lags[k] + 0.5 * (left - right) / bend * (lags[1] - lags[0]))
    return float(lags[k])


def _unclear(lag: Lag) -> str:
    """Why a Lag is not believed."""
    if lag.evidence <= EVIDENCE:
        return "the motion changes too little to show a delay"
    if not np.isfinite(lag.std):
        return "the correlation has no clear peak within 1 s of the best lag"
    return f"acceleration and turns disagree by {2 * lag.std:.1f} s"


def _reasons(lags: list[Lag], sources: int, apart: bool) -> Iterator[Reason]:
    """Reasons from lags that are believed: one for all sources, unless they are known to be `apart`
    or their lags disagree."""
    wrong = [lag for lag in lags if _weight(lag) > 1]
    if not wrong:
        return
    sure = min(wrong, key=lambda lag: lag.std)
    together = all(
        abs(lag.seconds - sure.seconds) < max(SURE * np.hypot(lag.std, sure.std), MIN_OFFSET)
        for lag in lags
    )
    if together and sources > 1 and not apart:
        yield _reason(sure, f"the fixes fit the IMU best with {sure.seconds:+.2f}", "")
        return
    for lag in wrong:
        yield _reason(
            lag, f"the source fits the IMU best with {lag.seconds:+.2f}", lag.source, sources == 1
        )


def _reason(lag: Lag, seen: str, source: str, alone: bool = True) -> Reason:
    """The Reason of a lag; `alone`: the clock of the IMU may as well be the one that is off."""
    near = min(LEAPS, key=lambda leap: abs(abs(lag.seconds) - leap))
    leap = abs(abs(lag.seconds) - near) < max(SURE * lag.std, 0.3)
    whose = f"the `time` of {source}" if source else "the `time` of every source of fixes"
    add = np.copysign(near, lag.seconds) if leap else lag.seconds
    return Reason(
        "clock",
        f"{seen} +- {lag.std:.2f} s added to its time, from {lag.by}"
        + (f": {LEAPS[near]}" if leap else ""),
        f"add {add:+.3g} s to `offset` of {whose}"
        + (f", or {-add:+.3g} s to that of the IMU" if alone else ""),
        source,
        _weight(lag),
    )


def _weight(lag: Lag) -> float:
    return abs(lag.seconds) / max(SURE * lag.std, MIN_OFFSET)
