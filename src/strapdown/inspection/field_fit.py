"""Clock, mounting and scale of the IMU against a magnetometer, by how the field turns: a window's turn of
the gyro, late, misaligned and off in scale as it may be, takes the field at its beginning to that at its
end, but for a hard iron, which does not turn. All are estimated together, and the bias of the gyro."""

from typing import NamedTuple

import numpy as np

from ..core.mathematics.rotation_vectors import exponentials
from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array, Ints
from .finding import label
from .motion import Felt

MISALIGNED, LAG, SCALE, IRON, BIAS = slice(0, 3), 3, 4, slice(5, 8), slice(8, 11)
"""Places of the unknowns: a small rotation in rad, s by which the IMU is later than the field, share of
the rates, T, rad/s of what `Felt` leaves of the bias: it takes slow motion for rest."""
PRIOR = np.array([*[np.radians(20.0)] * 3, 0.5, 0.2, *[50e-6] * 3, *[np.radians(1.0)] * 3])
"""Standard deviations that are assumed before the data."""
LAGS = np.arange(-1.5, 1.51, 0.1)
"""s that are tried first: about a lag that is far off nothing is linear."""
ITERATIONS = 4
BLOCK, MIN_BLOCKS = 15.0, 14
"""s within which errors may last, such as those of iron that is passed; how many of them a fit needs."""
MAX_PAIRS = 3000
OUTLIER = 3.0
SURE, SURE_OF_AXES = 5.0, 3.0
"""Standard deviations from which a clock or a scale, and a mounting, is a reason."""
MIN_LAG, MIN_ANGLE, MIN_SCALE = 0.05, np.radians(3.0), 0.03
"""s, rad and share from which they are one: what a good calibration leaves is less."""
MAX_STD = np.array([np.radians(2.5), 0.1, 0.005])
"""rad, s, share: what is known no better says nothing."""


class FieldPairs(NamedTuple):
    """Fields at the beginnings and ends of windows."""

    begin: Array  # (n,) s
    end: Array  # (n,) s
    first: Array  # (n, 3) T
    last: Array  # (n, 3) T
    noise: float  # claimed std of a component, T

    def take(self, rows: Array | Ints | slice) -> "FieldPairs":
        """Some of them."""
        begin, end, first, last, noise = self
        return FieldPairs(begin[rows], end[rows], first[rows], last[rows], noise)

    def turn(self, felt: Felt, late: float = 0.0) -> Array:
        """(n, 3) rotation vectors of the gyro, whose stamps are `late` by so many s."""
        return felt.rotation_vectors(self.begin + late, self.end + late)


class FieldFit(NamedTuple):
    """Estimates of all unknowns."""

    value: Array  # (11,)
    std: Array  # (11,)


def predicted_field(pairs: FieldPairs, felt: Felt, x: Array) -> Array:
    """(n, 3) fields at the ends of windows with the unknowns x (11,), T."""
    turn = (1 + x[SCALE]) * pairs.turn(felt, x[LAG])
    turn = turn + x[BIAS] * (pairs.end - pairs.begin)[:, None]
    turn = turn + np.cross(x[MISALIGNED], turn)
    return turned_field(pairs, turn, x[IRON])


def turned_field(pairs: FieldPairs, turn: Array, iron: Array | float = 0.0) -> Array:
    """(n, 3) T: the fields at the beginnings after the body turned by `turn` (n, 3), rad, beside a hard
    iron."""
    return np.einsum("nij,nj->ni", exponentials(-turn), pairs.first - iron) + iron


NOTHING = np.zeros(len(PRIOR))


def fit_field(pairs: FieldPairs, felt: Felt) -> FieldFit | None:
    """Return the least squares estimate of the unknowns (Gauss-Newton), with standard deviations that rest
    on how blocks of time disagree (Liang & Zeger 1986); None where there are too few blocks."""
    pairs = thin_pairs(pairs)
    block = np.unique(np.floor(np.repeat(pairs.begin, 3) / BLOCK), return_inverse=True)[1]
    blocks = int(block.max(initial=-1)) + 1
    if blocks < MIN_BLOCKS:
        return None
    x = NOTHING.copy()
    x[LAG] = min(LAGS, key=lambda lag: _squares(pairs, felt, lag))
    for _ in range(ITERATIONS):
        J, left = linearize(pairs, felt, x)
        variance = max(pairs.noise**2, float((left**2).mean()))
        N = np.linalg.inv(J.T @ J + variance * np.eye(len(x)))
        x = x + PRIOR * (N @ (J.T @ left - variance * x / PRIOR))
    score = J * left[:, None]
    summed = np.stack([np.bincount(block, column, blocks) for column in score.T], axis=1)
    meat = summed.T @ summed * blocks / max(blocks - len(x), 1) + variance**2 * np.eye(len(x))
    return FieldFit(x, PRIOR * np.sqrt(np.diag(N @ meat @ N)))


def thin_pairs(pairs: FieldPairs) -> FieldPairs:
    """At most MAX_PAIRS of them, evenly."""
    return pairs.take(slice(None, None, 1 + len(pairs.begin) // MAX_PAIRS))


def _squares(pairs: FieldPairs, felt: Felt, lag: float) -> float:
    x = NOTHING.copy()
    x[LAG] = lag
    return float(((pairs.last - predicted_field(pairs, felt, x)) ** 2).sum())


def linearize(pairs: FieldPairs, felt: Felt, x: Array) -> tuple[Array, Array]:
    """Return ((3n, 11) derivatives for each PRIOR, (3n,) T that is left), both with the square roots of
    weights that fall where more than OUTLIER medians are left (Huber 1964): windows across a step of the
    field, or beside passing iron."""
    steps = 0.02 * np.diag(PRIOR)
    columns = [
        (predicted_field(pairs, felt, x + step) - predicted_field(pairs, felt, x - step)).ravel()
        for step in steps
    ]
    left = pairs.last - predicted_field(pairs, felt, x)
    size = np.linalg.norm(left, axis=1)
    weight = np.minimum(1.0, OUTLIER * np.median(size) / np.maximum(size, 1e-15))
    root = np.repeat(np.sqrt(weight), 3)
    return np.stack(columns, axis=1) / 0.04 * root[:, None], left.ravel() * root


def reasons_of_fit(fit: FieldFit, source: Source) -> list[Reason]:
    """Reasons that an estimate gives to doubt the set-up."""
    name, found = label(source), []
    lag, std = fit.value[LAG], fit.std[LAG]
    if std < MAX_STD[1] and abs(lag) > max(MIN_LAG, SURE * std):
        late = "later" if lag > 0 else "earlier"
        found.append(
            Reason(
                "clock",
                f"the IMU turns {abs(lag):.2f} +- {std:.2f} s {late} than the field of {name}",
                "set `offset` of one of them, so that both have one clock",
                name,
                float(abs(lag) / MIN_LAG),
            )
        )
    angle, size = fit.value[MISALIGNED], fit.std[MISALIGNED]
    sure = (size < MAX_STD[0]) & (np.abs(angle) > np.maximum(MIN_ANGLE, SURE_OF_AXES * size))
    for axis in np.flatnonzero(sure):
        degrees = np.degrees([angle[axis], size[axis]])
        found.append(
            Reason(
                "mounting",
                f"the axes of the IMU are {degrees[0]:+.1f} +- {degrees[1]:.1f} deg from those of "
                f"{name} about {'xyz'[axis]}",
                "correct the mounting of one of them, or check whether one moved during the "
                "recording",
                name,
                float(abs(angle[axis]) / MIN_ANGLE),
            )
        )
    scale, std = fit.value[SCALE], fit.std[SCALE]
    if std < MAX_STD[2] and abs(scale) > max(MIN_SCALE, SURE * std):
        more = "less" if scale > 0 else "more"
        found.append(
            Reason(
                "gyro",
                f"the gyro turns {100 * abs(scale):.2g} +- {100 * std:.2g} % {more} than the field of "
                f"{name}",
                "calibrate the gyro scale, and the magnetometer for iron beside it",
                name,
                float(abs(scale) / MIN_SCALE),
            )
        )
    return found
