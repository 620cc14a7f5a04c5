"""One run of a study scored against its truth: errors of the 15 states, NEES, abort, and what a
summary needs of them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.loop.contract import ATT, BA, BG, POS, STATES, VEL
from ...data.solution import STD_COLUMNS, Solution, Trajectory
from ...evaluation import consistency
from ...evaluation.nees import normalised_rows
from ...filters.ins.open_loop import LEFT_MODEL
from ...geometry.geodesy import displacement, wrap
from ...geometry.rotation_products import turns_between
from ...typing import Array, Ints, Mask

ERROR_STATE_NAMES = tuple(name.removeprefix("std_") for name in STD_COLUMNS)
"""Names of the 15 error states: position m NED, velocity m/s NED, rotation rad NED, biases m/s^2
and rad/s body."""
ERROR_GROUPS = (
    "position",
    "velocity",
    "attitude",
    "roll",
    "pitch",
    "heading",
    "accel_bias",
    "gyro_bias",
)
"""Quantities whose mean square is kept: the squared lengths of vectors, and three angles."""
QUARANTINED = len(consistency.REASONS)
"""Reason code of a run that killed its worker."""
RUN_REASONS = (*consistency.REASONS, "quarantined")


PARAMETER_SCALARS = ("nees_all", "nees_all_inside", "nees_parameters")
"""Numbers of a run whose installation was wrong: NEES of the 15 states and the parameters that are
states, by degree of freedom, and its share within the 95 % band; that of the parameters at the
end, by degree of freedom."""


class Scored(NamedTuple):
    """A run at the scored epochs and in numbers; NaN from where the filter stopped."""

    error: Array  # (n, 15) true - estimate, SI, radians
    std: Array  # (n, 15) as the filter states them
    nees: Array  # (n,) of all 15 states
    rows: int  # epochs before the abort; n where there was none
    numbers: dict[str, float | Array]  # scalars of the run, and "mean_square" (len(ERROR_GROUPS),)


class Epochs(NamedTuple):
    """The truth at the scored epochs of a scenario."""

    truth: Trajectory
    every: int  # IMU samples from one epoch to the next
    rows: Ints  # of the IMU samples


def epochs(truth: Trajectory, every: int) -> Epochs:
    """Epochs at each `every`-th IMU sample, the last sample among them, of a truth that has one
    row before the first sample."""
    samples = len(truth) - 1
    rows = np.arange((samples - 1) % every, samples, every)

    return Epochs(truth.take(rows + 1), every, rows)


class ScoredRows(NamedTuple):
    """Runs at the scored epochs before evaluation; NaN after the filter stopped."""

    error: Array  # (runs, n, 15) true - estimate, SI, radians
    rph: Array  # (runs, n, 3) errors of roll, pitch and heading, rad
    std: Array  # (runs, n, 15) as the filter states them
    nees: Array  # (runs, n) of all 15 states


class FixRows(NamedTuple):
    """The fixes of runs."""

    t: Array  # (m,) s
    source: Ints  # (m,)
    innovation: Array  # (runs, m, 3)
    nis: Array  # (runs, m)
    accepted: Mask  # (runs, m)
    reached: Ints  # (runs,) how many of them a run came to


def score(
    solution: Solution, at: Epochs, b_a: Array, b_g: Array, limits: consistency.LossLimits
) -> Scored:
    """Scored of a Solution kept at the epochs `at` with its covariance; b_a and b_g (n, 3) are
    the true biases there."""
    n, kept = len(at.rows), len(solution.t)
    rows = ScoredRows(*(np.full((1, n, *of), np.nan) for of in ((STATES,), (3,), (STATES,), ())))
    error, rph, std, nees = (part[0, :kept] for part in rows)
    with np.errstate(all="ignore"):  # a filter that diverged may have any number
        error[:], rph[:] = _errors(solution, at, b_a, b_g)
        assert solution.trajectory.std is not None and solution.covariance is not None
        std[:] = solution.trajectory.std
        normalised_rows(error, solution.covariance, np.zeros((STATES + 2, STATES)), nees)
    seen = solution.innovations
    each = (seen.innovation[None], seen.nis[None], seen.accepted[None])
    fixes = FixRows(seen.t, seen.source, *each, np.array([len(seen.t)]))
    return score_runs(rows, fixes, [_left_model(solution)], at, limits)[0]


def score_runs(
    rows: ScoredRows,
    fixes: FixRows,
    left_model: Sequence[float],
    at: Epochs,
    limits: consistency.LossLimits,
) -> list[Scored]:
    """Return Scored of each run from its rows; left_model: time when the raw INS of an open loop
    left its model, s, NaN where it did not."""
    t, n = at.truth.t, len(at.rows)
    with np.errstate(all="ignore"):
        distance = np.sqrt(_square(rows.error[..., POS]))
        ends = [consistency.survival(d, nees, t, limits) for d, nees in zip(distance, rows.nees)]
        alive: Mask = np.arange(n) < np.array([end for end, _ in ends])[:, None]
        most = np.where(alive, np.minimum(distance, limits.distance), limits.distance) ** 2
        means = _means(rows, alive)
        found = []
        for run, (end, reason) in enumerate(ends):
            numbers: dict[str, float | Array] = {
                "rows": end,
                "reason": reason,
                "lasted": float(t[end - 1]) if end else 0.0,
                "left_model": left_model[run],
                "censored": float(most[run].mean()),
                **{name: values[run] for name, values in means.items()},
                **_fixes(fixes, run, t[end - 1] if end else -np.inf),
            }
            parts = rows.error[run], rows.std[run], rows.nees[run]
            found.append(Scored(*parts, end, numbers))
    return found


def score_parameters(
    solution: Solution, scored: Scored, true: Mapping[str, float]
) -> dict[str, float | Array]:
    """Score the parameters of the installation, {column of a Solution: true error of the given
    value}: "parameter_error" (m,) true - estimate at the end, or as given where it is no state,
    "parameter_std" (m,), NaN there, both in the units of the columns, and PARAMETER_SCALARS."""
    left, std = np.array(list(true.values())), np.full(len(true), np.nan)
    numbers: dict[str, float | Array] = {
        "parameter_error": left,
        "parameter_std": std,
        **dict.fromkeys(PARAMETER_SCALARS, np.nan),
    }
    states = {name: value for name, value in true.items() if name in solution.columns}
    if not states or not scored.rows:
        return numbers
    for k, name in enumerate(true):
        if name in states:
            left[k] -= solution.columns[name][-1]
            std[k] = solution.columns[f"std of {name}"][-1]
    P = solution.covariance
    assert P is not None
    places, errors = consistency.errors_beyond(solution, states)
    rows = slice(0, min(scored.rows, len(P)))
    all_states = [*range(STATES), *places]
    of_all = consistency.nees(
        np.hstack([scored.error[: len(P)], errors])[rows], P[rows][:, all_states][:, :, all_states]
    )
    low, high = consistency.band(len(all_states))
    return numbers | {
        "nees_all": consistency.mean_of_known(of_all) / len(all_states),
        "nees_all_inside": float(((of_all >= low) & (of_all <= high)).mean()),
        "nees_parameters": float(
            consistency.nees(errors[-1], P[-1][places][:, places]) / len(places)
        ),
    }


def _errors(solution: Solution, at: Epochs, b_a: Array, b_g: Array) -> tuple[Array, Array]:
    """Errors (kept, 15) and those of roll, pitch and heading (kept, 3) at the rows that the
    solution has."""
    trajectory, truth, kept = solution.trajectory, at.truth, len(solution.t)
    assert truth.v_n is not None and truth.q_nb is not None
    assert trajectory.v_n is not None and trajectory.q_nb is not None
    error = np.empty((kept, STATES))
    error[:, POS] = displacement(truth.lla[:kept], trajectory.lla)
    error[:, VEL] = truth.v_n[:kept] - trajectory.v_n
    error[:, ATT] = turns_between(truth.q_nb[:kept], trajectory.q_nb)
    error[:, BA], error[:, BG] = b_a[:kept] - solution.b_a, b_g[:kept] - solution.b_g
    return error, wrap(truth.rph[:kept] - trajectory.rph)


def _left_model(solution: Solution) -> float:
    """When the raw INS of an open loop left its model, s; NaN where it did not, or there is
    none."""
    return next((t for t, text in solution.events if text.startswith(LEFT_MODEL)), np.nan)


def _means(rows: ScoredRows, alive: Mask) -> dict[str, Array]:
    """{name: (runs, ...)} over the epochs `alive` (runs, n) before the abort; NaN where there is
    none."""
    error, rph, std, nees = rows

    def mean(values: NDArray[Any], which: Mask) -> Array:
        """(runs, k) of values (runs, n, k)."""
        chosen = np.where(which[..., None], values, 0.0)
        return chosen.sum(axis=1) / which.sum(axis=1)[:, None]

    vectors = (error[..., POS], error[..., VEL], error[..., ATT])
    squares = [_square(each)[..., None] for each in vectors]
    biases = [_square(error[..., each])[..., None] for each in (BA, BG)]
    low, high = consistency.band(STATES)
    inside = (nees >= low) & (nees <= high)
    normal = np.abs(error[..., POS]) / std[..., POS]
    within = np.stack([(normal <= sigma).mean(axis=-1) for sigma in (1, 2, 3)], axis=-1)
    return {
        "mean_square": mean(np.concatenate([*squares, rph**2, *biases], axis=-1), alive),
        "nees": mean(nees[..., None], alive & np.isfinite(nees))[:, 0],
        "nees_inside": mean(inside[..., None], alive)[:, 0],
        "coverage": mean(within, alive),
    }


def _square(vectors: Array) -> Array:
    return np.einsum("...i,...i->...", vectors, vectors)


def _fixes(fixes: FixRows, run: int, end: float) -> dict[str, float]:
    """Return the fix statistics of a run until the abort at `end` s: mean NIS by degree of freedom
    over the measured rows, lag-1 correlation of the innovations; and, over the whole run, counts of
    accepted and rejected."""
    count = int(fixes.reached[run])
    until = min(int(np.searchsorted(fixes.t, end, side="right")), count)
    nis, y = fixes.nis[run, :until], fixes.innovation[run, :until]
    measured, first = np.isfinite(nis), fixes.source[:until] == 0
    rows = np.isfinite(y).sum(axis=1)[measured].sum()
    if not (measured & first).all():
        y = y[measured & first]
    moved = np.nansum(y[1:] * y[:-1]) / np.nansum(y**2) if len(y) > 2 else np.nan
    used = int(fixes.accepted[run, :count].sum())
    return {
        "nis": float(nis[measured].sum() / rows) if rows else np.nan,
        "correlation": float(moved),
        "accepted": used,
        "rejected": count - used,
    }
