"""Table 1 of Alam et al. recomputed, and counts from the published one.

A case is one outage of the simulated flight over all seeds, or all windows of a recording.
"""

import numpy as np
import pandas as pd

from ..common.paired_ratios import by_case, ratio
from .readings import EKF, NLO, XKF
from .runs import AXES, MEASURES

PUBLISHED = {
    ("north", EKF): (7.9, 7.5, 6.7, 31.5, 38.2),
    ("north", NLO): (15.8, 14.9, 23.5, 15.1, 11.3),
    ("north", XKF): (14.1, 14.9, 23.6, 14.3, 11.2),
    ("east", EKF): (16.6, 10.4, 28.8, 129.1, 18.4),
    ("east", NLO): (12.4, 9.4, 13.1, 22.2, 12.6),
    ("east", XKF): (11.4, 9.4, 13.3, 21.4, 11.8),
    ("down", EKF): (1.8, 12.1, 31.8, 50.0, 5.4),
    ("down", NLO): (25.7, 4.9, 27.6, 18.9, 12.5),
    ("down", XKF): (24.7, 4.3, 25.6, 18.2, 12.0),
}
"""Table 1: RMSE in m of the five outages by axis and filter."""
OUTAGES = 5
THREE = (EKF, NLO, XKF)


def wide(scores: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """{case: table} of the scores, as paired_ratios.by_case."""
    return by_case(scores, "case", MEASURES, "filter") if len(scores) else {}


def redraw_table1(scores: pd.DataFrame, names: tuple[str, ...] = THREE) -> pd.DataFrame:
    """DataFrame shaped as Table 1: a row per case, for each axis and filter the published RMSE
    and ours, its mean over runs and standard deviation."""
    return pd.DataFrame(
        [
            {
                "outage": case.removeprefix("outage "),
                **{
                    f"{axis}, {name}, m": _redraw_cell(own, case, axis, name)
                    for axis in AXES
                    for name in names
                },
            }
            for case, own in scores.groupby("case", sort=False)
        ]
    )


def _redraw_cell(own: pd.DataFrame, case: str, axis: str, name: str) -> str:
    values = own.loc[own["filter"] == name, f"{axis}_rmse_m"]
    text = f"{values.mean():.3g} ± {values.std():.2g}" if len(values) else "–"
    if name not in THREE or not case.startswith("outage "):
        return text
    return f"{PUBLISHED[axis, name][int(case.split()[1]) - 1]:g} / {text}"


def published_wins(axis: str, first: str = XKF, second: str = EKF) -> str:
    """Text: in how many rows of the published Table 1 the first filter's RMSE is smaller."""
    return f"{sum(a < b for a, b in zip(PUBLISHED[axis, first], PUBLISHED[axis, second]))} of {OUTAGES}"


def published_times(first: str, second: str, factor: float) -> int:
    """In how many outages of the published Table 1 the first filter's horizontal RMSE is at least
    `factor` times the second's."""
    a, b = (np.hypot(PUBLISHED["north", name], PUBLISHED["east", name]) for name in (first, second))
    return int((a >= factor * b).sum())


def published_least(*axes: str) -> int:
    """In how many cells of these axes in the published Table 1 the XKF's RMSE is the smallest."""
    return sum(
        xkf < min(ekf, nlo)
        for axis in axes
        for ekf, nlo, xkf in zip(*(PUBLISHED[axis, name] for name in THREE))
    )


def list_ratios(tables: dict[str, pd.DataFrame], measure: str, first: str, second: str) -> str:
    """Text: what over what, and the ratio of every case; empty without cases."""
    return f"{first} / {second}: " * bool(tables) + "; ".join(
        f"{case} {ratio(table, measure, first, second)}" for case, table in tables.items()
    )
