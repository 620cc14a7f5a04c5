"""The runs: a campaign for each cell, which can be resumed, and the cell's row."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from strapdown.core.loop.contract import STATES
from strapdown.evaluation.consistency import INCONSISTENT, POSITION_LOST, SURVIVED
from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sensor_models.streams import RandomStream
from strapdown.typing import Array

from ..common.gnss_alone import EPOCH, keep
from . import verdicts
from .refused import REFUSED
from .twin import Right
from .worlds import WorldCell, is_fed, world

CAMPAIGNS = "campaigns"
"""Folder of the campaigns in that of the results."""


def study(cell: WorldCell, runs: int, seed: int) -> Study:
    """The runs of a cell, with random numbers of their own."""
    own, stream = world(cell.scenario, is_fed(cell.filter)), RandomStream.of(seed)
    for name in cell:
        stream = stream.child(name)
    return Study((own,), (cell.filter,), (cell.grade,), runs, stream.key[0], EPOCH, keep(own))


def folder(out: Path, cell: WorldCell) -> Path:
    """Where the campaign of a cell is, below `out`."""
    return out / CAMPAIGNS / cell.filter.replace(":", "-") / cell.scenario / cell.grade


def row(campaign: Campaign, cell: WorldCell, right: Right) -> dict[str, Any]:
    """Return the figures of a cell, and a consistent filter's."""
    (name,) = campaign.cells
    numbers = campaign.numbers(name)
    parts = campaign.read(name, ("nees_rows",))
    nees = np.concatenate([part["nees_rows"][0] for part in parts]).astype(float)
    reasons, runs = numbers["reason"][0], len(nees)
    survived = float((reasons == SURVIVED).mean())
    found = verdicts.shares(nees, STATES)
    p = verdicts.chance(found.inside, right.inside)
    mean, error = anees(nees / STATES)
    return {
        **cell._asdict(),
        "runs": runs,
        "verdict": verdicts.verdict(found, survived, p),
        "refused": REFUSED.get(cell, ""),
        "inside_%": 100 * found.inside,
        "above_%": 100 * found.above,
        "below_%": 100 * found.below,
        "right_median_%": 100 * float(np.median(right.inside)),
        "right_1_in_100_%": 100 * float(np.quantile(right.inside, verdicts.CHANCE)),
        "p": p,
        "survived_%": 100 * survived,
        "lost": int((reasons == POSITION_LOST).sum()),
        "inconsistent": int((reasons == INCONSISTENT).sum()),
        "anees": mean,
        "anees_error": error,
        "anees_median": float(np.median(infinite_where_nan(nees / STATES).mean(axis=1))),
        "anees_right_std": float(right.anees.std(ddof=1)) if len(right.anees) > 1 else np.nan,
        "anees_alive": float(np.nanmean(numbers["nees"][0])) / STATES,
    }


def infinite_where_nan(nees: Array) -> Array:
    """NEES with infinity where it is no number: a filter that stopped, or whose P is none."""
    return np.where(np.isfinite(nees), nees, np.inf)


def anees(nees: Array) -> tuple[float, float]:
    """Mean of NEES by degree of freedom (runs, epochs), and its standard error over the runs; all
    runs count to their end."""
    means = infinite_where_nan(nees).mean(axis=1)
    if not np.isfinite(means).all() or len(means) < 2:
        return float(means.mean()), np.nan
    return float(means.mean()), float(means.std(ddof=1) / np.sqrt(len(means)))


def cells(
    filters: Iterable[str], scenarios: Iterable[str], grades: Iterable[str]
) -> list[WorldCell]:
    """All combinations."""
    grades, scenarios = tuple(grades), tuple(scenarios)
    return [WorldCell(f, s, g) for f in filters for s in scenarios for g in grades]
