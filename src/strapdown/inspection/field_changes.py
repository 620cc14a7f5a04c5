"""Changes of clock, mounting, scale or iron during a recording: an estimate of `field_fit` that is not the
same throughout. For each block of time, each unknown may step there, or drift from the first block to the
last; all that is needed are the normal equations of the blocks."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array, Ints
from .field_fit import BLOCK, MIN_BLOCKS, PRIOR, FieldPairs, linearize, thin_pairs
from .finding import label
from .motion import Felt

EDGE = 3
"""Blocks that are needed to either side of a step."""
SURE = 4.0
"""Standard deviations from which a change counts: of 180 simulated recordings without one the largest
is 3.4; a recorded aircraft reaches 4.8 as it touches down, by an iron of 4 uT, which is too small."""


class _Unknown(NamedTuple):
    """An unknown of `field_fit` whose change is a reason."""

    smallest: float  # change that is one
    cause: str
    what: str
    scale: float  # to the unit that is shown
    unit: str
    remedy: str


_MOUNTING, _IRON = (
    "check whether the IMU or the magnetometer moved on its mount; fuse the parts before and after "
    "separately (`--from`, `--to`)",
    "look for iron, magnets or currents that came near the magnetometer; fuse the parts before and "
    "after separately (`--from`, `--to`)",
)
UNKNOWNS = (
    *(
        _Unknown(
            np.radians(3.0),
            "mounting",
            f"the angle about {axis} between the axes of the IMU and those of",
            float(np.degrees(1)),
            "deg",
            _MOUNTING,
        )
        for axis in "xyz"
    ),
    _Unknown(
        0.03,
        "clock",
        "the time by which the IMU is later than",
        1.0,
        "s",
        "give both sensors one clock, or remove what made it jump",
    ),
    _Unknown(
        0.03,
        "gyro",
        "the scale of the gyro against",
        100.0,
        "%",
        "check range and temperature of the gyro, and iron near the magnetometer",
    ),
    *(
        _Unknown(6e-6, "calibration", f"the hard iron along {axis} of", 1e6, "uT", _IRON)
        for axis in "xyz"
    ),
    *(
        _Unknown(
            np.radians(0.5),
            "gyro",
            f"the bias of gyro {axis} against",
            float(np.degrees(1)),
            "deg/s",
            "check the gyro and its temperature; let it warm up",
        )
        for axis in "xyz"
    ),
)
"""In the order of `field_fit`."""


class FieldChange(NamedTuple):
    """Change of one unknown."""

    which: int  # its place in UNKNOWNS
    value: float  # after less before
    std: float
    t: float  # s, of a step; NaN of a drift


class _Blocks(NamedTuple):
    """Normal equations of each block of time, about the estimate."""

    t: Array  # (n,) s, their middles
    normal: Array  # (n, k, k)
    right: Array  # (n, k)
    squares: Array  # (n,)
    numbers: Ints  # (n,), of residuals

    def take(self, rows: Array) -> "_Blocks":
        """Some of them."""
        return _Blocks(*(column[rows] for column in self))


def find_change(pairs: FieldPairs, felt: Felt, x: Array) -> FieldChange | None:
    """Return the surest change about the estimate x (11,); None where it is not sure, or too small to
    matter: others are its shadows."""
    blocks = _blocks(thin_pairs(pairs), felt, x)
    n = len(blocks.t)
    if n < MIN_BLOCKS:
        return None
    found = list(_changes(blocks, blocks.t / np.ptp(blocks.t), pairs.noise, np.nan))
    place = np.arange(n)
    for k in range(
        EDGE, n - EDGE
    ):  # pairs across the step, in its own block, belong to neither side
        rest = place != k
        found += _changes(
            blocks.take(rest), (place[rest] > k).astype(float), pairs.noise, blocks.t[k]
        )
    surest = max(found, key=lambda c: abs(c.value) / c.std)
    size = abs(surest.value)
    return surest if size > max(UNKNOWNS[surest.which].smallest, SURE * surest.std) else None


def _blocks(pairs: FieldPairs, felt: Felt, x: Array) -> _Blocks:
    J, left = linearize(pairs, felt, x)
    numbers, of = np.unique(np.floor(np.repeat(pairs.begin, 3) / BLOCK), return_inverse=True)
    rows = [np.flatnonzero(of == b) for b in range(len(numbers))]
    return _Blocks(
        (numbers + 0.5) * BLOCK,
        np.stack([J[r].T @ J[r] for r in rows]),
        np.stack([J[r].T @ left[r] for r in rows]),
        np.array([(left[r] ** 2).sum() for r in rows]),
        np.array([len(r) for r in rows]),
    )


def _changes(blocks: _Blocks, shape: Array, noise: float, t: float) -> Iterator[FieldChange]:
    """Yield the change of each unknown by `shape` (n,), one at a time while all are estimated as
    constants. Standard deviations rest on how the blocks disagree, and are no smaller than those of
    residuals without correlation."""
    n, k = blocks.right.shape
    variance = max(noise**2, float(blocks.squares.sum() / blocks.numbers.sum()))
    s = (shape - shape.mean())[:, None]
    inverse = np.linalg.inv(blocks.normal.sum(axis=0) + variance * np.eye(k))
    right = blocks.right - blocks.normal @ (inverse @ blocks.right.sum(axis=0))
    # column j of `others`: what the constants explain of the change of unknown j
    others = inverse @ (blocks.normal * s[:, :, None]).sum(axis=0)
    crossed = blocks.normal @ others
    own = (
        s**2 * np.einsum("bjj->bj", blocks.normal)
        - 2 * s * np.einsum("bjj->bj", crossed)
        + np.einsum("ij,bij->bj", others, crossed)
    )
    score, total = s * right - right @ others, own.sum(axis=0) + variance
    value = score.sum(axis=0) / total
    scatter = ((score - own * value) ** 2).sum(axis=0) * n / max(n - k - 1, 1)
    std = np.sqrt(np.maximum(scatter / total**2, variance / total))
    for j in range(k):
        yield FieldChange(j, float(PRIOR[j] * value[j]), float(PRIOR[j] * std[j]), t)


def reason_of_change(change: FieldChange, source: Source) -> Reason:
    """The Reason that a change of an unknown gives."""
    of, name = UNKNOWNS[change.which], label(source)
    size = f"{of.scale * change.value:+.2g} +- {of.scale * change.std:.1g} {of.unit}"
    drifts = np.isnan(change.t)
    when = "from beginning to end" if drifts else f"at about {change.t:.0f} s"
    return Reason(
        of.cause,
        f"{of.what} {name} {'drifts' if drifts else 'steps'} by {size} {when}",
        of.remedy,
        name,
        float(abs(change.value) / of.smallest),
    )
