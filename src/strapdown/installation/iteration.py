"""Estimate, apply, run again: the constants of an installation from runs of the filter itself, until
the estimate stays where it is."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..data.calibration_parameters import CLOCK, LEVER_ARM, CalibrationParameter
from ..engine.prepare import Run
from ..engine.sensitivity import SensitivityFit, Sums
from ..typing import Array
from .model import Constant

MAX_RUNS = 15
RISE = 1.001
"""A step is taken unless the cost of a run rises by more than this factor. Linear steps may overshoot by
two: where they may cost 2 %, a ship's parameters go to and fro about the truth and never settle."""
HALVINGS = 3
SETTLED = 0.5
"""Standard deviations: a smaller step is none."""
NOTABLE = 3.0
"""Standard deviations: where no constant is further off, there is nothing to settle."""


class Unknown(NamedTuple):
    """A number to estimate: one constant, or several that share it."""

    of: CalibrationParameter
    sources: tuple[int, ...]  # of the recording
    axis: int
    direction: Array  # (m,) what it is in the constants


def receiver_clocks(constants: Sequence[Constant]) -> list[int]:
    """The constants that are clocks of sources with an antenna: one receiver stamps them all, as
    long as nothing shows otherwise."""
    antennas = {i for constant in constants if constant.of is LEVER_ARM for i in constant.sources}
    return [
        j
        for j, constant in enumerate(constants)
        if constant.of is CLOCK and antennas.issuperset(constant.sources)
    ]


def unknowns(constants: Sequence[Constant], split: bool = False) -> list[Unknown]:
    """One Unknown per constant; but all clocks of receivers as one, unless `split`."""
    rows = np.eye(len(constants))
    clocks = receiver_clocks(constants)
    found = [
        Unknown(*constant, rows[j])
        for j, constant in enumerate(constants)
        if split or j not in clocks
    ]
    if split or not clocks:
        return found
    sources = tuple(i for j in clocks for i in constants[j].sources)
    return [Unknown(CLOCK, sources, 0, rows[clocks].sum(axis=0)), *found]


def full_theta(some: Sequence[Unknown], values: Array) -> Array:
    """theta (m,) with these values of some unknowns and 0 of all others."""
    theta: Array = values @ np.stack([each.direction for each in some])
    return theta


def groups(constants: Sequence[Constant]) -> list[list[Unknown]]:
    """The unknowns that are looked at alone: all clocks of receivers as one, each clock, the arm of
    each antenna, the mounting, the scale."""
    together = unknowns(constants)
    alike: dict[tuple[str, tuple[int, ...]], list[Unknown]] = {}
    for each in together:
        alike.setdefault((each.of.name, each.sources), []).append(each)
    own = split_clocks(constants)
    return [*alike.values(), *([each] for each in own if len(own) > 1)]


def split_clocks(constants: Sequence[Constant]) -> list[Unknown]:
    """The clock of each source of a receiver."""
    rows = np.eye(len(constants))
    return [Unknown(*constants[j], rows[j]) for j in receiver_clocks(constants)]


class Trial(NamedTuple):
    """A run with a set-up that is changed by theta, and what it says of further change."""

    theta: Array  # (m,)
    fit: SensitivityFit
    sums: Sums
    made: Run


class Estimated(NamedTuple):
    """Values of q unknowns from one run."""

    value: Array  # (q,) change of what was given
    step: Array  # (q,) of it, what is not in the set-up of the run yet
    std: Array  # (q,) the larger of the model's and the scatter's over blocks of time
    model_std: Array  # (q,)
    halves: Array  # (q, 2, 2) value and std by each half of the blocks, all others as estimated

    @property
    def z(self) -> Array:
        """The values in standard deviations."""
        return np.abs(self.value) / self.std


def estimate_unknowns(trial: Trial, sought: Sequence[Unknown], centre: Array) -> Estimated:
    """The unknowns by least squares with a prior around `centre` (m,), all other constants being
    those of the trial."""
    basis = np.stack([each.direction for each in sought], axis=1)
    inverse = np.linalg.pinv(basis)
    now, mean = inverse @ trial.theta, inverse @ centre
    information, score = trial.sums.map_basis(basis)
    weight = np.array([each.of.given_std**-2.0 for each in sought])
    covariance = _inverse(information.sum(axis=0) + np.diag(weight))
    step = covariance @ (score.sum(axis=0) + weight * (mean - now))
    left = score - information @ step
    blocks = len(left)
    scatter = covariance @ (left.T @ left) @ covariance * (blocks / (blocks - 1))
    model_std = np.sqrt(np.diag(covariance))
    std = np.sqrt(np.maximum(np.diag(covariance), np.diag(scatter)))
    halves = np.stack(
        [
            _by_part(now + step, information[part], left[part])
            for part in (slice(0, blocks // 2), slice(blocks // 2, blocks))
        ],
        axis=1,
    )
    return Estimated(now + step, step, std, model_std, halves)


def _inverse(information: Array) -> Array:
    """The inverse of a positive definite matrix whose unknowns are known to very different standard
    deviations: that of the matrix with ones on its diagonal, scaled back."""
    scale = 1 / np.sqrt(np.diag(information))
    return (
        scale[:, None]
        * np.linalg.pinv(information * np.outer(scale, scale), hermitian=True)
        * scale
    )


def _by_part(value: Array, information: Array, left: Array) -> Array:
    """(q, 2) each value and its standard deviation by some blocks alone, all others being `value`
    (q,), of which the score `left` (blocks, q) remains; NaN where they do not show it."""
    own = np.diagonal(information, axis1=1, axis2=2)  # (blocks, q)
    total = own.sum(axis=0)
    total = np.where(total > 0, total, np.nan)
    more = left.sum(axis=0) / total
    still = left - own * more
    scatter = (still**2).sum(axis=0) * len(left) / (len(left) - 1)
    return np.stack([value + more, np.sqrt(np.maximum(1 / total, scatter / total**2))], axis=1)


def nis_decrease(trial: Trial, sought: Sequence[Unknown], step: Array) -> float:
    """By how much the sum of the NIS falls when the unknowns change by `step`, as far as it is
    quadratic."""
    basis = np.stack([each.direction for each in sought], axis=1)
    information, score = (part.sum(axis=0) for part in trial.sums.map_basis(basis))
    return float(2 * score @ step - step @ information @ step)


class Settling:
    """The way from what was given to what the runs say. `run` makes the Trial of a theta (m,)."""

    def __init__(self, run: Callable[[Array], Trial], centre: Array) -> None:
        self.run, self.centre, self.runs = run, centre, 0

    def run_trial(self, theta: Array) -> Trial:
        """A run with the set-up changed by theta."""
        self.runs += 1
        return self.run(theta)

    def iterate(self, trial: Trial, sought: Sequence[Unknown], keep: int = 1) -> Trial:
        """The trial from which the unknowns `sought` no longer move, or the last for which there
        are runs, `keep` of them left over."""
        while self.runs < MAX_RUNS - keep:
            found = estimate_unknowns(trial, sought, self.centre)
            if (np.abs(found.step) <= SETTLED * found.std).all():
                break
            if not trial.theta.any() and (found.z <= NOTABLE).all():
                break
            better = self._try_step(trial, full_theta(sought, found.step), keep)
            if better is None:
                break
            trial = better
        return trial

    def _try_step(self, trial: Trial, step: Array, keep: int) -> Trial | None:
        """The trial after that step, or half of it, ...; None where the cost rises with each."""
        for halving in range(HALVINGS + 1):
            if self.runs >= MAX_RUNS - keep:
                break
            new = self.run_trial(trial.theta + step / 2**halving)
            if new.fit.cost <= RISE * trial.fit.cost:
                return new
        return None
