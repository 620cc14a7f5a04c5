"""How far the raw INS of the open loop has drifted, beside what the filters lose by it: some
runs of a campaign once more, with the INS kept."""

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from strapdown.engine.batch import fuse
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study, parse_label, seeds, simulator
from strapdown.typing import Array

from ..common.runner import on_threads
from .cells import CellRows, numbers_of, rows_of
from .rules import SMALL_DRIFT

RUNS = 3
"""The first runs of each cell."""
EDGES = 10.0 ** np.arange(0, 7.5, 0.5)
"""m: bins of drift in the figure."""
INS = tuple(f"ins_error_{axis} [m]" for axis in ("north", "east", "down"))
MIN_EPOCHS = 20
"""Epochs that a rank correlation needs."""


def measure(
    campaign: Campaign, threads: int | None = None, runs: int = RUNS
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(DataFrame, DataFrame): per run the rank correlation of drift and NEES ratio and the ratio at
    small drift; per bin of drift the ratios.

    The campaign must know its study. Drift is the length of the INS error as the open loop
    estimates it, which is good to metres.
    """
    known = [numbers_of(campaign, cell.name) for cell in campaign.study.cells]
    jobs = [
        (number, int(run))
        for number, (_, ran) in enumerate(known)
        for run in np.flatnonzero(ran)[:runs]
    ]
    drifts = dict(zip(jobs, on_threads(lambda job: drift(campaign.study, *job), jobs, threads)))
    rows, points = [], []
    for number, cell in enumerate(campaign.study.cells):
        stored = rows_of(campaign, cell.name, *known[number])
        for row, run in enumerate(np.flatnonzero(known[number][1])[:runs]):
            own = _points(stored, row, *drifts[number, int(run)])
            small = own["nees"][own["drift"] < SMALL_DRIFT]
            rows.append(
                {
                    "flight": cell.scenario.name.removeprefix("paper1-"),
                    "grade": cell.imu.name.removeprefix("paper1-"),
                    "run": run,
                    "correlation": _rank_correlation(own["drift"], own["nees"]),
                    "small_ratio": float(np.exp(small.mean())),
                    "max_drift_m": float(own["drift"].max()) if len(own) else 0.0,
                    "epochs": len(own),
                }
            )
            points.append(own)
    return pd.DataFrame(rows), _binned(pd.concat(points))


def drift(study: Study, number: int, run: int) -> tuple[Array, Array]:
    """(t s, drift m) of the raw INS in a run of the cell of that number, at the scored epochs
    that the filter reached."""
    cell = study.cells[number]
    made = simulator(cell)
    recording, start = made.run(cell.imu, seeds(study, cell, run))
    filter, options, _ = parse_label(study.filters[0])
    solution = fuse(
        recording,
        filter,
        start=start,
        noise=cell.imu.noise(),
        every=max(1, round(study.epoch * cell.scenario.rate)),
        options=options,
    )
    return solution.t, np.sqrt(sum(np.square(solution.columns[name]) for name in INS))


def _points(stored: CellRows, run: int, t: Array, drifted: Array) -> pd.DataFrame:
    """A row per stored epoch with both filters within 500 m: drift, log NEES ratio and log ratio
    of squared position errors, open by closed."""
    at = np.searchsorted(t, stored.t - 1e-6)
    known = (at < len(t)) & stored.within[0, run] & stored.within[1, run]
    with np.errstate(all="ignore"):
        found = pd.DataFrame(
            {
                "drift": np.where(known, drifted[np.minimum(at, len(t) - 1)], np.nan),
                "nees": np.log(stored.nees[0, run].astype(float) / stored.nees[1, run]),
                "position": 2 * np.log(stored.distance[0, run] / stored.distance[1, run]),
            }
        )
    return found[np.isfinite(found).all(axis=1)]


def _rank_correlation(x: pd.Series, y: pd.Series) -> float:
    return float(spearmanr(x, y).statistic) if len(x) >= MIN_EPOCHS and np.ptp(y) > 0 else np.nan


def _binned(points: pd.DataFrame) -> pd.DataFrame:
    """Quartiles of the NEES ratio and the median position ratio per bin of drift, as a
    DataFrame; bins with fewer than MIN_EPOCHS epochs are left out."""
    found = []
    for k, own in points.groupby(np.digitize(points["drift"], EDGES)):
        if 0 < k < len(EDGES) and len(own) >= MIN_EPOCHS:
            low, middle, high = np.exp(np.quantile(own["nees"], (0.25, 0.5, 0.75)))
            position = float(np.exp(np.median(own["position"]) / 2))
            at = float(np.sqrt(EDGES[k - 1] * EDGES[k]))
            found.append((at, middle, low, high, position, len(own)))
    return pd.DataFrame(
        found,
        columns=[
            "drift, m",
            "NEES ratio",
            "lower quartile",
            "upper quartile",
            "position error ratio",
            "epochs",
        ],
    )
