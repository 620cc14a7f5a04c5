"""A simulated run with a wrong installation: what a filter finds of it, and its NEES."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.evaluation.consistency import nees_of
from strapdown.typing import Array
from strapdown.units.constants import NORMAL_95

from .cases import case

RUNS, EPOCHS, SCALES = "runs", "epochs", "scales"
"""Tables of the Evidence."""
FOUND = 0.5
"""A parameter is called found where its standard deviation at the end is at most this part of its
prior: the same half as of `diagnose`."""
SCALE_ROWS = 5.0
"""s between the rows of the scale over time."""


def runs(name: str, filter: str, start: str, seeds: Iterable[int]) -> dict[str, pd.DataFrame]:
    """The tables of runs with these seeds: a row per run and parameter (RUNS), per run and second
    (EPOCHS: NEES), per run and SCALE_ROWS (SCALES: the odometer's scale)."""
    each = [_run(name, filter, start, seed) for seed in seeds]
    return {table: pd.concat([one[table] for one in each]) for table in (RUNS, EPOCHS, SCALES)}


def _run(name: str, filter: str, start: str, seed: int) -> dict[str, pd.DataFrame]:
    """The tables of one run."""
    made = case(name, seed, start)
    of = {"motion": name, "filter": filter, "start": start, "seed": seed}
    every = round(1 / float(np.median(made.recording.imu.dt)))
    asked: dict[str, Any] = {"every": every, "covariance": True}
    solution = fuse(made.recording, filter, start=made.start, estimate=made.priors, **asked)
    right = fuse(made.right, filter, start=made.right_start, **asked)
    with_all = nees_of(solution, made.recording, made.true)
    of_right = np.interp(solution.t, right.t, nees_of(right, made.right), left=np.nan)
    epochs = {"t": solution.t.round(3), "nees": with_all, "nees_right": of_right}
    return {
        RUNS: pd.DataFrame([of | row for row in _parameters(solution, made.true)]),
        EPOCHS: pd.DataFrame(epochs).assign(**of, dof=15 + len(made.true)),
        SCALES: pd.DataFrame(_scales(solution, made.true)).assign(**of),
    }


def _parameters(solution: Solution, true: dict[str, float]) -> list[dict[str, Any]]:
    """A row per parameter: its error at the end, where filter and smoother are one."""
    rows = []
    for name, value in true.items():
        std, prior = solution.columns[f"std of {name}"], _prior(solution, name)
        error = value - solution.columns[name][-1]
        rows.append(
            {
                "parameter": name,
                "true": value,
                "error": error,
                "std": std[-1],
                "prior": prior,
                "found": bool(std[-1] <= FOUND * prior),
                "inside": bool(abs(error) <= NORMAL_95 * std[-1]),
                "stopped": "stopped" in solution.meta,
            }
        )
    return rows


def _prior(solution: Solution, name: str) -> float:
    from strapdown.engine.prepare import augmented_states

    assert solution.recording is not None
    states = augmented_states(solution.recording.sources, solution.recording.meta.get("estimate"))
    return next(each.std * each.factor for each in states if each.name == name)


def _scales(solution: Solution, true: dict[str, float]) -> dict[str, Array]:
    """Error and standard deviation of the odometer's scale over time."""
    for name, value in true.items():
        if name.startswith("scale"):
            late = solution.t % SCALE_ROWS
            rows = np.minimum(late, SCALE_ROWS - late) < 1e-3
            error, std = value - solution.columns[name], solution.columns[f"std of {name}"]
            return {"t": solution.t[rows].round(3), "error": error[rows], "std": std[rows]}
    return {"t": np.empty(0), "error": np.empty(0), "std": np.empty(0)}
