"""Drift of the raw INS of the open loop, in position and attitude, beside the filters' loss of
accuracy by it: some runs of a campaign once more, by an INS alone."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from strapdown.engine.batch import fuse
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study, seeds, simulator
from strapdown.geometry.geodesy import displacement
from strapdown.geometry.rotation_products import turns_between
from strapdown.typing import Array

from ..common.runner import on_threads
from .cells import CellRows, grade_of, numbers_of, rows_of
from .rules import LARGE_TURN, SMALL_DRIFT, SMALL_TURN

RUNS, QUICK_RUNS = 8, 2
"""The first runs of each cell."""
EDGES = 10.0 ** np.arange(0, 7.5, 0.5)
"""m: bins of drift in the figure."""
TURNS = np.array([0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 180.0])
"""deg: bins of the raw INS's attitude error while its position has drifted by less than
SMALL_DRIFT."""
MIN_EPOCHS = 20
"""Epochs that a rank correlation needs."""
ALONE = "closed-loop"
"""The filter that is an INS where it gets no fix."""


class Drift(NamedTuple):
    """Return tables of the raw INS's drift and of related quantities."""

    runs: pd.DataFrame  # a row per run, see `_row`
    bins: pd.DataFrame  # NEES and position error, open by closed, by drift
    turns: pd.DataFrame  # the same by attitude error, while the drift is small


def measure(campaign: Campaign, threads: int | None = None, runs: int = RUNS) -> Drift:
    """The Drift of the first `runs` of each cell without offset.

    The campaign must know its study.
    """
    cells = [
        (number, cell)
        for number, cell in enumerate(campaign.study.cells)
        if not any(cell.scenario.accel_offset)
    ]
    known = {number: numbers_of(campaign, cell.name) for number, cell in cells}
    jobs = [
        (number, int(run))
        for number, (_, ran) in known.items()
        for run in np.flatnonzero(ran)[:runs]
    ]
    drifts = dict(zip(jobs, on_threads(lambda job: drift(campaign.study, *job), jobs, threads)))
    rows, points = [], []
    for number, cell in cells:
        stored = rows_of(campaign, cell.name, *known[number])
        for row, run in enumerate(np.flatnonzero(known[number][1])[:runs]):
            own = _points(stored, row, *drifts[number, int(run)])
            named = {
                "flight": cell.scenario.name.removeprefix("paper1-"),
                "grade": grade_of(cell.imu.name),
                "run": run,
            }
            rows.append(named | _row(own, drifts[number, int(run)][1]))
            points.append(own)
    each = pd.concat(points)
    near = each[each["drift"] < SMALL_DRIFT]
    return Drift(
        pd.DataFrame(rows),
        _bin_points(each, "drift", EDGES)
        .rename(columns={"middle": "drift, m"})
        .drop(columns="end"),
        _bin_points(near, "turn", TURNS)
        .rename(columns={"end": "attitude error below, deg"})
        .drop(columns="middle"),
    )


def drift(study: Study, number: int, run: int) -> tuple[Array, Array, Array]:
    """(t s, drift m, attitude error deg) of the raw INS in a run of the cell of that number, at the
    scored epochs that it reached."""
    cell = study.cells[number]
    recording, start = simulator(cell).run(cell.imu, seeds(study, cell, run))
    every = max(1, round(study.epoch * cell.scenario.rate))
    alone = recording.hidden([(-np.inf, np.inf)])
    solution = fuse(alone, ALONE, start=start, noise=cell.imu.noise(), every=every)
    truth, own = recording.reference, solution.trajectory
    rows = np.searchsorted(truth.t, solution.t - 1e-6)
    away = np.linalg.norm(displacement(truth.lla[rows], own.lla), axis=1)
    turn = np.degrees(np.linalg.norm(turns_between(truth.q_nb[rows], own.q_nb), axis=1))
    return solution.t, away, turn


def _row(own: pd.DataFrame, drifted: Array) -> dict[str, float]:
    """Numbers of a run: rank correlation of the drift with the NEES of the open by the closed loop;
    that ratio while position and attitude have drifted little, and while the attitude alone has
    drifted far; whether the drift grew, in the last quarter against the one before."""
    near = own["drift"] < SMALL_DRIFT
    mean = lambda rows: float(np.exp(own["nees"][rows].mean()))
    quarter = len(drifted) // 4
    before, last = drifted[-2 * quarter : -quarter], drifted[-quarter:]
    return {
        "correlation": _rank_correlation(own["drift"], own["nees"]),
        "small_ratio": mean(near & (own["turn"] < SMALL_TURN)),
        "turned_ratio": mean(near & (own["turn"] > LARGE_TURN)),
        "grew": float(np.mean(np.square(last)) > np.mean(np.square(before))),
        "max_drift_m": float(own["drift"].max()) if len(own) else 0.0,
        "epochs": len(own),
    }


def _points(stored: CellRows, run: int, t: Array, drifted: Array, turned: Array) -> pd.DataFrame:
    """A row per stored epoch with both filters within 500 m: drift and turn of the INS, log NEES
    ratio and log ratio of squared position errors, open by closed."""
    at = np.searchsorted(t, stored.t - 1e-6)
    known = (at < len(t)) & stored.within[0, run] & stored.within[1, run]
    at = np.minimum(at, len(t) - 1)
    with np.errstate(all="ignore"):
        found = pd.DataFrame(
            {
                "drift": np.where(known, drifted[at], np.nan),
                "turn": turned[at],
                "nees": np.log(stored.nees[0, run].astype(float) / stored.nees[1, run]),
                "position": 2 * np.log(stored.distance[0, run] / stored.distance[1, run]),
            }
        )
    return found[np.isfinite(found).all(axis=1)]


def _rank_correlation(x: pd.Series, y: pd.Series) -> float:
    return float(spearmanr(x, y).statistic) if len(x) >= MIN_EPOCHS and np.ptp(y) > 0 else np.nan


def _bin_points(points: pd.DataFrame, by: str, edges: Array) -> pd.DataFrame:
    """Quartiles of the NEES ratio and the median position ratio per bin of a column, as a
    DataFrame; bins with fewer than MIN_EPOCHS epochs are left out."""
    found = []
    for k, own in points.groupby(np.digitize(points[by], edges)):
        if 0 < k < len(edges) and len(own) >= MIN_EPOCHS:
            low, middle, high = np.exp(np.quantile(own["nees"], (0.25, 0.5, 0.75)))
            position = float(np.exp(np.median(own["position"]) / 2))
            at = float(np.sqrt(edges[k - 1] * edges[k]))
            found.append((at, edges[k], middle, low, high, position, len(own)))
    columns = ["NEES ratio", "lower quartile", "upper quartile", "position error ratio", "epochs"]
    return pd.DataFrame(found, columns=["middle", "end", *columns])
