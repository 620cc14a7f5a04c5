"""The figures of the table of consistency, their targets, and the tables."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ..common import markdown, targets
from ..common.tables import Tables, outcomes, with_rows
from ..common.targets import Target
from .refused import MOST
from .verdicts import BY_CHANCE, CONSISTENT, INSIDE, SURVIVED, VERDICTS

TITLE = "Consistency: is the error as large as the filter says"
INTRODUCTION = (
    "Every cell is a filter in a scenario with a grade of IMU. At each epoch the NEES of the 15 "
    "states is averaged over all runs, to their end, whatever became of them; a right filter keeps "
    "that mean inside a chi-square band at 95 of 100 epochs.",
    "The errors of neighbouring epochs are alike. So `p` has the share of right filters that come to "
    "no more epochs inside the band, by simulation of a linear twin. A run survives that never is "
    "500 m off, nor for more than 10 s beyond what 1 in 1 000 000 right filters come to.",
)


TARGETS = {
    "inside": Target(
        "epochs in the band, of the worst cell that is not refused", ">=", 100 * INSIDE, "%"
    ),
    "survived": Target(
        "runs that survive, of the worst cell that is not refused", ">=", 100 * SURVIVED, "%"
    ),
    "refused": Target("refused cells, of the filter with the most", "<=", float(MOST), "cells"),
    "missed": Target("cells, not refused, that miss 90 % or 98 %", "<=", 0.0, "cells"),
    "wrong": Target("of these, cells that chance does not explain", "<=", 0.0, "cells"),
}
"""The targets, by name: the first three are asked for as they stand, the others count cells by
the same rule, and by the rule that allows for chance."""


def counted(rows: pd.DataFrame) -> pd.DataFrame:
    """The cells that are not refused."""
    return rows[rows["refused"] == ""]


def figures(rows: pd.DataFrame) -> dict[str, float]:
    """{name of a target: figure}."""
    own = counted(rows)
    refused = (rows["refused"] != "").groupby(rows["filter"]).sum()
    return {
        "inside": float(own["inside_%"].min()),
        "survived": float(own["survived_%"].min()),
        "refused": float(refused.max()),
        "missed": float((own["verdict"] != CONSISTENT).sum()),
        "wrong": float((~own["verdict"].isin((CONSISTENT, BY_CHANCE))).sum()),
    }


def claims(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """What was asked for, what was measured, whether it holds."""
    return targets.judged(figures(rows), TARGETS, digits=4)


def by_filter(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per filter: how many of its cells are called what, and how many are refused."""
    called = rows.assign(verdict=rows["verdict"].where(rows["refused"] == "", "refused"))
    return outcomes(called, ["filter"], "verdict", (*VERDICTS, "refused")).reset_index()


def each(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per cell, as text for a page."""
    p = [f"{value:.2f}" if value >= 0.005 else "< 0.01" for value in rows["p"]]
    error = [f" ± {large(value)}" if np.isfinite(value) else "" for value in rows["anees_error"]]
    anees = [f"{large(value)}{plus}" for value, plus in zip(rows["anees"], error)]
    return pd.DataFrame(
        {
            "filter": rows["filter"],
            "scenario": rows["scenario"],
            "grade": rows["grade"],
            "verdict": rows["verdict"].where(rows["refused"] == "", "refused"),
            "inside, %": [f"{value:.0f}" for value in rows["inside_%"]],
            "right: median, 1 in 100": [
                f"{a:.0f}, {b:.0f}"
                for a, b in zip(rows["right_median_%"], rows["right_1_in_100_%"])
            ],
            "p": p,
            "survived, %": [f"{value:.0f}" for value in rows["survived_%"]],
            "ANEES": anees,
            "median": [large(value) for value in rows["anees_median"]],
        }
    )


def large(value: float) -> str:
    """Two decimals, or the power of ten of what diverged."""
    return f"{value:.2f}" if value < 100 else f"{value:.0e}" if np.isfinite(value) else "∞"


def refused(rows: pd.DataFrame) -> pd.DataFrame:
    """The cells that are refused, with the reason."""
    own = rows[rows["refused"] != ""].rename(columns={"refused": "reason", "filter": "filters"})
    cells = own.groupby(["scenario", "grade", "reason"], sort=False)["filters"].agg(", ".join)
    return cells.reset_index()[["filters", "scenario", "grade", "reason"]]


def tables(rows: pd.DataFrame) -> Tables:
    """{name: (caption, DataFrame)}."""
    found = {
        "holding": ("In which scenarios each filter may be believed", holding(rows)),
        "by-filter": ("Cells of each filter", by_filter(rows)),
        "refused": ("Refused cells", refused(rows)),
        "each": ("Every cell", each(rows)),
    }
    return with_rows(found)


def size(rows: pd.DataFrame) -> str:
    """How large the table is."""
    filters, scenarios, grades = (rows[c].nunique() for c in ("filter", "scenario", "grade"))
    return (
        f"{rows['runs'].min()} runs a cell, of {len(rows)} cells: {filters} filters, {scenarios} "
        f"scenarios, {grades} grades."
    )


def holding(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per filter, a column per grade: in which scenarios what the filter says may be
    believed, which is where it is consistent or misses the target by chance."""
    holds = rows.assign(
        holds=rows["verdict"].isin((CONSISTENT, BY_CHANCE)) & (rows["refused"] == "")
    )
    table = {
        name: {grade: _said(cells) for grade, cells in own.groupby("grade", sort=False)}
        for name, own in holds.groupby("filter", sort=False)
    }
    return pd.DataFrame(table).T.reset_index(names="filter")


def _said(cells: pd.DataFrame) -> str:
    """In which of the scenarios of these cells it holds, in few words."""
    yes, no = (cells.loc[cells["holds"] == which, "scenario"] for which in (True, False))
    if len(no) == 0:
        return "all"
    if len(yes) == 0:
        return "none"
    return f"not {', '.join(no)}" if len(no) < len(yes) else ", ".join(yes)


def in_docs(rows: pd.DataFrame) -> str:
    """Markdown for docs/reference/evidence/consistency.md."""
    headed = [(f"In which scenarios each filter may be believed. {size(rows)}", holding(rows))]
    if len(refused(rows)):
        headed.append(("Refused cells:", refused(rows)))
    return markdown.tables(headed)


def each_in_docs(claims: Sequence[Mapping[str, Any]], rows: pd.DataFrame) -> str:
    """Markdown for docs/reference/evidence/consistency-each.md: the targets, and a table per filter."""
    of_filters = [
        (f"## {name}", own.drop(columns="filter"))
        for name, own in each(rows).groupby("filter", sort=False)
    ]
    return markdown.tables(
        [
            ("## Targets", targets.table(claims)),
            ("## Cells of each filter", by_filter(rows)),
            *of_filters,
        ]
    )
