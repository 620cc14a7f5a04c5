"""Is a filter as good as it says: NEES and its bands, coverage, whiteness, survival of a run, and
intervals over runs.

Functions of arrays; errors are true - estimate. Sources: Bar-Shalom, Li & Kirubarajan (2001),
section 5.4 (NEES, NIS, whiteness); Wilson (1927) for proportions; Ljung & Box (1978).
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..checks import DataError, check_choice
from ..core.loop.contract import ATT, BA, BG, POS, STATES, VEL
from ..data.recording import Recording
from ..data.solution import Solution
from ..engine.prepare import AugmentedState, augmented_states
from ..typing import Array, ArrayLike
from ..units.constants import NORMAL_95
from . import metrics

SURVIVED, POSITION_LOST, INCONSISTENT = 0, 1, 2
REASONS = ("survived", "lost", "inconsistent")
"""Names of the three ends of a run, by code."""
SAME_TIME = 1e-6
"""s: durations are compared with this much room for rounding."""


class LossLimits(NamedTuple):
    """When a run is given up: lost beyond `distance`, or NEES beyond the chi-square bound of
    `alarm` at every epoch for more than `seconds`."""

    distance: float = 500.0  # m, of the three-dimensional position error
    alarm: float = 1e-6  # probability that a right filter exceeds the bound at one epoch
    seconds: float = 10.0  # s


DEFAULT_LIMITS = LossLimits()


class Interval(NamedTuple):
    """An estimate with the two ends of its confidence interval, in its own unit; NaN where there
    is too little to tell."""

    value: float
    low: float
    high: float

    @property
    def alone(self) -> "Interval":
        """The estimate as if it were sure."""
        return Interval(self.value, self.value, self.value)


class Paired(NamedTuple):
    """Mean of a - b over `count` common runs with its confidence interval, and in how many of
    them a < b."""

    difference: float
    low: float
    high: float
    wins: int
    count: int  # type: ignore[assignment]  # hides the method of tuples, which nobody needs here


class Whiteness(NamedTuple):
    """Autocorrelation of normalised innovations, the bound that 95 % of those of a white
    sequence keep, and the Ljung-Box p-values."""

    autocorrelation: Array  # (lags, k), of lag 1 first
    bound: float  # 1.96 / sqrt(m)
    p_value: Array  # (k,)


def nees(error: ArrayLike, covariance: ArrayLike) -> Array:
    """Normalised estimation error squared e' P^-1 e: error (..., k), covariance (..., k, k) ->
    (...).

    P is scaled to a unit diagonal first: states range from 1e-8 rad/s to 1e3 m. NaN where error or
    P is not finite, or where P is not positive definite (to rounding: a state whose variance given
    those before it is below k eps of its own).
    """
    error, covariance = np.asarray(error, float), np.asarray(covariance, float)
    k = error.shape[-1]
    with np.errstate(all="ignore"):
        variance = np.diagonal(covariance, axis1=-2, axis2=-1)
        known = np.isfinite(covariance).all(axis=(-2, -1)) & (variance > 0).all(axis=-1)
        scale = 1 / np.sqrt(np.where(known[..., None], variance, np.nan))
        rows = _whiten_errors(
            error * scale,
            covariance * scale[..., :, None] * scale[..., None, :],
            k * np.finfo(float).eps,
        )
        return np.square(rows).sum(axis=-1)


def _whiten_errors(error: Array, P: Array, least: float) -> Array:
    """L^-1 error with L L' = P (unit diagonal), NaN where a pivot is not above `least`; by
    columns over the whole stack."""
    k = error.shape[-1]
    L, white = np.zeros(P.shape), np.empty(np.broadcast_shapes(error.shape, P.shape[:-1]))
    for j in range(k):
        row = L[..., j, :j]
        pivot = P[..., j, j] - np.square(row).sum(axis=-1)
        pivot = np.sqrt(np.where(pivot > least, pivot, np.nan))
        L[..., j:, j] = (
            P[..., j:, j] - np.einsum("...ij,...j->...i", L[..., j:, :j], row)
        ) / pivot[..., None]
        white[..., j] = (error[..., j] - (row * white[..., :j]).sum(axis=-1)) / pivot
    return white


@lru_cache(maxsize=64)
def band(dof: int, count: int = 1, probability: float = 0.95) -> tuple[float, float]:
    """(low, high) that the mean of `count` independent NEES or NIS values of `dof` components
    each keeps with `probability`, two-sided."""
    from scipy.stats import chi2

    tail = 0.5 * (1 - probability)
    return float(chi2.ppf(tail, dof * count) / count), float(chi2.isf(tail, dof * count) / count)


@lru_cache(maxsize=64)
def chi_square_bound(dof: int, alarm: float) -> float:
    """The bound that one NEES or NIS value of `dof` components exceeds with probability `alarm`."""
    from scipy.stats import chi2

    return float(chi2.isf(alarm, dof))


def survival(
    distance: ArrayLike, nees: ArrayLike, t: ArrayLike, limits: LossLimits = DEFAULT_LIMITS
) -> tuple[int, int]:
    """(rows, reason) of one run: how many of its scored epochs come before it is given up, and the
    code of the reason (REASONS).

    distance (n,) m, 3-D position error; nees (n,) of the 15 states; t (n,) s, increasing. A
    distance that is not finite is POSITION_LOST, a NaN NEES is beyond the bound. INCONSISTENT takes
    effect at the epoch at which the NEES has been beyond it for more than `limits.seconds`.
    """
    distance, nees, t = (np.asarray(values, float) for values in (distance, nees, t))
    lost = ~(distance <= limits.distance)
    beyond = ~(nees <= chi_square_bound(STATES, limits.alarm))
    # last epoch within the bound, -1 for none
    inside_before = np.maximum.accumulate(np.where(beyond, -1, np.arange(len(t))))
    began = t[np.minimum(inside_before + 1, len(t) - 1)]
    inconsistent = beyond & (t - began > limits.seconds + SAME_TIME)
    ends = [int(np.argmax(end)) if end.any() else len(t) for end in (lost, inconsistent)]
    if min(ends) == len(t):
        return len(t), SURVIVED
    return min(ends), POSITION_LOST if ends[0] <= ends[1] else INCONSISTENT


def rmse(mean_square: ArrayLike, probability: float = 0.95) -> Interval:
    """Interval of the RMSE pooled over runs, from their mean squared errors (runs,); every run
    counts alike, NaN ones are left out.

    Student's t on the mean square, its lower end cut at 0, then the root; one run gives NaN ends.
    """
    mean, low, high = _mean(mean_square, probability)
    return Interval(
        *(float(np.sqrt(value)) for value in (mean, low if np.isnan(low) else max(low, 0.0), high))
    )


def _mean(values: ArrayLike, probability: float) -> tuple[float, float, float]:
    """Mean of the finite values with Student's interval: (mean, low, high)."""
    from scipy.stats import t

    known = np.asarray(values, float).ravel()
    known = known[np.isfinite(known)]
    count, mean = len(known), float(known.mean()) if len(known) else np.nan
    if count < 2:
        return mean, np.nan, np.nan
    half = float(t.isf(0.5 * (1 - probability), count - 1) * known.std(ddof=1) / np.sqrt(count))
    return mean, mean - half, mean + half


def mean_of_known(values: Array) -> float:
    """Mean of what is finite, NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


def proportion(successes: float, count: float, probability: float = 0.95) -> Interval:
    """Interval of a proportion by Wilson's score; without any trial its value is NaN and its
    ends are 0 and 1. Trials that depend on each other count as an effective number, not whole."""
    from scipy.stats import norm

    if not 0 <= successes <= count:
        raise DataError(
            f"{successes} successes of {count}; there must be 0 or more, and no more than trials"
        )
    if count == 0:
        return Interval(np.nan, 0.0, 1.0)
    share, z2 = successes / count, float(norm.isf(0.5 * (1 - probability))) ** 2
    centre = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = np.sqrt(z2 * (share * (1 - share) / count + z2 / (4 * count**2))) / (1 + z2 / count)
    return Interval(
        share,
        0.0 if successes == 0 else float(centre - half),
        1.0 if successes == count else float(centre + half),
    )


def paired_comparison(a: ArrayLike, b: ArrayLike, probability: float = 0.95) -> Paired:
    """Compare two filters on the same runs: a and b (runs,), one figure of each run; Paired of a -
    b, with Student's t over the runs.

    Runs where either is not finite are left out. For errors take logarithms (of the mean squares,
    say): ratios then count alike in good and bad runs.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    both = np.isfinite(a) & np.isfinite(b)
    return Paired(*_mean(a[both] - b[both], probability), int((a < b)[both].sum()), int(both.sum()))


def coverage(error: ArrayLike, std: ArrayLike, sigmas: Sequence[float] = (1, 2, 3)) -> Array:
    """Return the share (len(sigmas), k) of the errors (..., k) within these multiples of their
    standard deviations (..., k); NaN are left out.

    Of a Gaussian error 0.683, 0.954 and 0.997 are within 1, 2 and 3.
    """
    error, std = np.broadcast_arrays(np.abs(np.asarray(error, float)), np.asarray(std, float))
    error, std = (values.reshape(-1, values.shape[-1]) for values in (error, std))
    known = ~np.isnan(error) & ~np.isnan(std)
    count = known.sum(axis=0)
    return np.array(
        [
            ((error <= sigma * std) & known).sum(axis=0) / np.where(count, count, np.nan)
            for sigma in sigmas
        ]
    )


def autocorrelation(innovation: ArrayLike, lags: int = 20) -> tuple[Array, float]:
    """(lags, k) autocorrelation of the normalised innovations (m, k) of one source in time order at
    the lags 1, 2, ..., and the bound that 95 % of the lags of a white sequence keep.

    The mean is not taken off: it belongs to the hypothesis that it is zero, so that a constant
    innovation is not white. Rows with a missing component are left out, components that are never
    measured give NaN. Raises DataError where m <= lags.
    """
    z = _complete(innovation)
    m = len(z)
    if not 1 <= lags < m:
        raise DataError(f"{m} innovations are too few for {lags} lags; give fewer lags, at least 1")
    power = np.square(z).sum(axis=0)
    power[power == 0] = np.nan  # an innovation that is always 0 tells nothing
    products = np.array([(z[lag:] * z[:-lag]).sum(axis=0) for lag in range(1, lags + 1)])
    return products / power, float(NORMAL_95 / np.sqrt(m))


def _complete(innovation: ArrayLike) -> Array:
    """The rows of (m, k) that miss no component that is ever measured."""
    innovation = np.asarray(innovation, float)
    z = innovation.reshape(len(innovation), -1)
    measured = np.isfinite(z).any(axis=0)
    return z[np.isfinite(z[:, measured]).all(axis=1)]


def whiteness(innovation: ArrayLike, lags: int = 20) -> Whiteness:
    """Whiteness of the normalised innovations (m, k) of one source in time order, by their
    `autocorrelation`. Ljung & Box (1978). Raises DataError where m <= lags."""
    from scipy.special import gammaincc

    found, bound = autocorrelation(innovation, lags)
    m = len(_complete(innovation))
    left = m - np.arange(1, lags + 1)
    statistic = m * (m + 2) * (np.square(found) / left[:, None]).sum(axis=0)
    return Whiteness(found, bound, gammaincc(lags / 2, statistic / 2))


def normalised_innovations(solution: Solution, source: str | int, window: int = 101) -> Array:
    """Innovations (m, k) of one source (name or index) of a Solution, accepted fixes in time order,
    for `whiteness`.

    A Solution keeps the NIS but not the innovation covariance S. With one component, innovation /
    sqrt(S) follows from the NIS and is given. With more, each component is divided by its own rms
    over `window` fixes around it, *not* by what the filter predicted: this serves whiteness, where
    only signs and order matter, and says nothing on the size of innovations, which the NIS tells.
    Raises DataError.
    """
    i = solution.innovations
    s = (
        source
        if isinstance(source, (int, np.integer))
        else i.names.index(source)
        if source in i.names
        else -1
    )
    if not 0 <= s < len(i.names):
        raise DataError(
            f"the solution has no source {source!r}; it has {', '.join(i.names) or 'none'}"
        )
    rows = (i.source == s) & i.accepted & ~np.isnan(i.innovation).all(axis=1)
    innovation, nis = i.innovation[rows], i.nis[rows]
    innovation = innovation[:, ~np.isnan(innovation).all(axis=0)]
    if innovation.shape[1] == 1 and np.isfinite(nis).all():
        return np.sign(innovation) * np.sqrt(nis)[:, None]
    return innovation / _rms_around(innovation, window)


def _rms_around(values: Array, window: int) -> Array:
    """Root mean square of the known values in the `window` rows around each, (m, k)."""
    known = np.isfinite(values)
    sums = [
        np.vstack([np.zeros(values.shape[1]), np.cumsum(part, axis=0)])
        for part in (np.where(known, values, 0.0) ** 2, known)
    ]
    at = np.arange(len(values))
    first, last = np.maximum(at - window // 2, 0), np.minimum(at + window // 2 + 1, len(values))
    squares, count = (total[last] - total[first] for total in sums)
    return np.sqrt(squares / np.where(count, count, np.nan))


def state_errors(solution: Solution, recording: Recording) -> Array:
    """(n, 15) true - estimate of all states at the rows of a Solution, against the simulated
    recording's truth: m, m/s, rad, m/s^2, rad/s.

    Rows outside the reference are NaN. Raises DataError where the recording does not know attitude
    and biases.
    """
    b_a, b_g = recording.meta.get("b_a"), recording.meta.get("b_g")
    t_imu, t = recording.imu.t, solution.t
    if (
        recording.reference is None
        or b_a is None
        or b_g is None
        or len(b_a) != len(t_imu)
        or len(b_g) != len(t_imu)
    ):
        raise DataError(
            "the recording's true states are not known at each IMU sample; use a whole simulated "
            "recording"
        )
    e = metrics.errors(solution, recording.reference)
    if not (metrics.any_known(e.velocity) and metrics.any_known(e.attitude)):
        raise DataError(
            "the recording's reference has no velocity or attitude; use a simulated recording"
        )
    rows = np.clip(np.searchsorted(t_imu, t - SAME_TIME), 0, len(t_imu) - 1)
    if np.abs(t_imu[rows] - t).max(initial=0.0) > SAME_TIME:
        raise DataError(
            "rows of the solution are not at the recording's IMU samples; give the recording that "
            "was fused"
        )
    error = np.full((len(t), STATES), np.nan)
    for states, values in ((POS, e.position), (VEL, e.velocity), (ATT, e.attitude)):
        error[e.rows, states] = values
    error[e.rows, BA], error[e.rows, BG] = (
        (b_a[rows] - solution.b_a)[e.rows],
        (b_g[rows] - solution.b_g)[e.rows],
    )
    return error


def errors_beyond(solution: Solution, true: Mapping[str, ArrayLike]) -> tuple[list[int], Array]:
    """(places (m,) in the covariance, (n, m) true - estimate in SI) of states beyond the fifteenth
    at the rows of a Solution: true {column: value in its unit, one or one per row}. Raises
    DataError."""
    own = _augmented_states(solution)
    names, places = [each.name for each in own], []
    errors = np.empty((len(solution.t), len(true)))
    for k, (name, value) in enumerate(true.items()):
        check_choice(name, "state beyond the fifteenth", names)
        places.append(names.index(name))
        values = np.asarray(value, float)
        if values.shape not in ((), (len(solution.t),)):
            raise DataError(
                f"true {name!r} has shape {values.shape}; it must be one number, or one for each of "
                f"the {len(solution.t)} rows"
            )
        errors[:, k] = (values - solution.columns[name]) / own[places[-1]].factor
    return [STATES + place for place in places], errors


def _augmented_states(solution: Solution) -> list[AugmentedState]:
    """The states beyond the fifteenth of a Solution. Raises DataError."""
    if solution.recording is None:
        raise DataError(
            "the solution comes from a file and does not know its states beyond the fifteenth; "
            "fuse the recording again"
        )
    return augmented_states(solution.recording.sources, solution.recording.meta.get("estimate"))


def nees_of(
    solution: Solution, recording: Recording, beyond: Mapping[str, ArrayLike] | None = None
) -> Array:
    """(n,) NEES at the rows of a Solution with covariance, against a simulated recording, of the 15
    states and of those `beyond` them whose truth is given, as in `errors_beyond`; NaN outside its
    reference.

    The truth of the error of a parameter of the installation is what was done to the recording.
    Raises DataError where the solution has no covariance or the recording does not know its true
    states.
    """
    if solution.covariance is None:
        raise DataError("the solution has no covariance; fuse with covariance=True")
    places, errors = errors_beyond(solution, beyond) if beyond else ([], np.empty((0, 0)))
    states = [*range(STATES), *places]
    own = state_errors(solution, recording)
    return nees(
        np.hstack([own, errors]) if places else own,
        solution.covariance[:, states][:, :, states],
    )
