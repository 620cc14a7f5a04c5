"""The tables of a campaign, from the numbers in the chunk files: one row per cell and filter, and
one row per run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...checks import check_choice
from ...core.loop.contract import POS, STATES
from ...evaluation.consistency import (
    SURVIVED,
    Paired,
    mean_of_known,
    paired_comparison,
    proportion,
    rmse,
)
from ...typing import Array
from ...units.constants import NORMAL_95
from .scoring import ERROR_GROUPS, RUN_REASONS

if TYPE_CHECKING:
    from .campaign import Campaign
    from .chunks import Arrays

SETTLED_AFTER = 120.0
"""s: the Cramer-Rao ratio excludes earlier times, where the start dominates."""
GROUP_SCALES = {
    "roll": np.degrees(1),
    "pitch": np.degrees(1),
    "heading": np.degrees(1),
    "attitude": np.degrees(1),
    "gyro_bias": np.degrees(1) * 3600,
}
GROUP_UNITS = {
    "position": "m",
    "velocity": "m/s",
    "attitude": "deg",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
    "accel_bias": "m/s^2",
    "gyro_bias": "deg/h",
}
"""Units of the root mean squares in tables."""


def summary_row(campaign: Campaign, number: int, place: int) -> dict[str, Any]:
    """A dict for the filter at `place` on cell `number`.

    rmse_X: root of the mean over surviving runs of X's mean squared error, with the ends of a 95 %
    interval (_low, _high) for position; until_abort_X: over all runs, each until it was given up;
    censored: position, over all runs, every epoch counted with at most the limit's distance and
    those after an abort with just that; std: of the runs' position RMSE; bound: Cramer-Rao, both
    over t >= SETTLED_AFTER.
    """
    cell = campaign.manifest["cells"][number]
    numbers = {name: values[place] for name, values in campaign.numbers(cell["name"]).items()}
    ran = numbers["reason"] != RUN_REASONS.index("quarantined")
    alive = numbers["reason"] == SURVIVED
    survived = proportion(int(alive.sum()), int(ran.sum()))
    row = {
        "scenario": cell["scenario"]["name"],
        "imu": cell["imu"]["name"],
        "filter": campaign.manifest["filters"][place],
        "runs": len(ran),
        "survived": survived.value,
        "survived_low": survived.low,
        "survived_high": survived.high,
        **{
            reason: int((numbers["reason"] == code).sum())
            for code, reason in enumerate(RUN_REASONS)
            if code
        },
        "left_model": int(np.isfinite(numbers["left_model"]).sum()),
        "lasted_median_s": float(np.median(numbers["lasted"][ran])) if ran.any() else np.nan,
    }
    squares = numbers["mean_square"]
    for name, values in (
        ("rmse_position_m", squares[alive, 0]),
        ("censored_position_m", numbers["censored"][ran]),
        ("until_abort_position_m", squares[ran, 0]),
    ):
        row |= dict(zip((name, name + "_low", name + "_high"), rmse(values)))
    roots = np.sqrt(squares[alive, 0])
    row["std_position_m"] = float(roots.std(ddof=1)) if len(roots) > 1 else np.nan
    for which, prefix in ((alive, "rmse"), (ran, "until_abort")):
        row |= {
            f"{prefix}_{group}_{GROUP_UNITS[group]}": rmse(squares[which, i]).value
            * GROUP_SCALES.get(group, 1.0)
            for i, group in enumerate(ERROR_GROUPS)
            if i
        }
    return row | {
        "anees": mean_of_known(numbers["nees"][ran]) / STATES,
        "nees_inside": mean_of_known(numbers["nees_inside"][ran]),
        "nis": mean_of_known(numbers["nis"][ran]),
        "innovation_correlation": mean_of_known(numbers["correlation"][ran]),
        **{
            f"within_{sigma}_sigma": mean_of_known(numbers["coverage"][ran, i])
            for i, sigma in enumerate((1, 2, 3))
        },
        **_of_parameters(numbers, campaign.parameters(cell["name"]), ran),
        "accepted": int(np.nansum(numbers["accepted"])),
        "rejected": int(np.nansum(numbers["rejected"])),
        **bound_ratio(campaign.curves(cell["name"]), place),
    }


def _of_parameters(numbers: Arrays, names: list[str], ran: NDArray[np.bool_]) -> dict[str, float]:
    """Summarise runs with a wrong installation: NEES of all states and of its parameters by degree
    of freedom, and of each parameter RMSE and bias at the end, and the share of runs whose 95 %
    interval holds the truth."""
    if not names:
        return {}
    row = {
        "anees_all": mean_of_known(numbers["nees_all"][ran]),
        "nees_all_inside": mean_of_known(numbers["nees_all_inside"][ran]),
        "anees_parameters": mean_of_known(numbers["nees_parameters"][ran]),
    }
    for k, name in enumerate(names):
        error, std = numbers["parameter_error"][ran, k], numbers["parameter_std"][ran, k]
        held = (np.abs(error) <= NORMAL_95 * std)[np.isfinite(std)]
        row |= {
            f"rmse {name}": float(np.sqrt(mean_of_known(error**2))),
            f"bias {name}": mean_of_known(error),
            f"within 95 % {name}": mean_of_known(held.astype(float)),
        }
    return row


def bound_ratio(curves: Arrays, place: int) -> dict[str, float]:
    """Time-averaged position RMSE of the runs alive and its Cramer-Rao bound, m, and their
    ratio, over t >= SETTLED_AFTER."""
    late = (curves["t"] >= SETTLED_AFTER) & (curves["alive"][place] > 0)
    if not late.any():
        return {"settled_rmse_m": np.nan, "bound_m": np.nan, "bound_ratio": np.nan}

    def total(values: Array) -> float:
        return float(np.sqrt((values[late][:, POS] ** 2).sum(axis=1).mean()))

    found, bound = total(curves["rmse"][place]), total(curves["bound"])
    return {"settled_rmse_m": found, "bound_m": bound, "bound_ratio": found / bound}


def _parameters_of_runs(own: Arrays, names: list[str]) -> dict[str, Array]:
    columns = {name: own["parameter_error"][:, k] for k, name in enumerate(names)}
    columns |= {f"std of {name}": own["parameter_std"][:, k] for k, name in enumerate(names)}
    more = {"anees_all": "nees_all", "anees_parameters": "nees_parameters"}
    return columns | {column: own[name] for column, name in more.items() if name in own}


def run_rows(campaign: Campaign, number: int) -> pd.DataFrame:
    """pandas DataFrame of the runs of a cell: reason, times, mean squares as roots, consistency."""
    cell = campaign.manifest["cells"][number]
    numbers, frames = campaign.numbers(cell["name"]), []
    parameters = campaign.parameters(cell["name"])
    for place, name in enumerate(campaign.manifest["filters"]):
        own = {key: values[place] for key, values in numbers.items()}
        roots = np.sqrt(own["mean_square"])
        frames.append(
            pd.DataFrame(
                {
                    "scenario": cell["scenario"]["name"],
                    "imu": cell["imu"]["name"],
                    "filter": name,
                    "run": np.arange(len(own["reason"])),
                    "end": [RUN_REASONS[int(code)] for code in own["reason"]],
                    "lasted_s": own["lasted"],
                    "left_model_s": own["left_model"],
                    **{
                        f"rmse_{group}_{GROUP_UNITS[group]}": roots[:, i]
                        * GROUP_SCALES.get(group, 1.0)
                        for i, group in enumerate(ERROR_GROUPS)
                    },
                    "censored_position_m": np.sqrt(own["censored"]),
                    "anees": own["nees"] / STATES,
                    "nees_inside": own["nees_inside"],
                    "nis": own["nis"],
                    "innovation_correlation": own["correlation"],
                    "rejected": own["rejected"],
                    **_parameters_of_runs(own, parameters),
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def compare(campaign: Campaign, cell: str, first: str, second: str) -> Paired:
    """Paired of two filters on the runs of a cell: the logarithm of the censored mean squared
    position error of `first` less that of `second`.

    Below 0 the first is better; half of it is the logarithm of the ratio of RMSEs. Raises DataError
    for a filter that is not in the campaign.
    """
    filters = campaign.manifest["filters"]
    for name in (first, second):
        check_choice(name, "filter of the campaign", filters)
    censored = np.log(campaign.numbers(cell)["censored"])
    return paired_comparison(censored[filters.index(first)], censored[filters.index(second)])
