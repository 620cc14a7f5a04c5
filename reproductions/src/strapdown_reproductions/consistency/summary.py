"""The figures of the table of consistency, their targets, and the tables."""

import numpy as np
import pandas as pd

from ..common import markdown
from ..common.runner import StudyTables
from ..common.study import Claims, ReproducedStudy, held_against
from ..common.tables import Tables, outcomes, with_rows
from ..common.targets import Target, table
from . import figure
from .refused import MAX_SHOWN
from .verdicts import BY_CHANCE, CONSISTENT, INSIDE, SURVIVED, VERDICTS

CELLS = "cells"
"""The table of the Evidence: a row per cell."""
PICTURE = "consistency.svg"
INTRODUCTION = (
    "Every cell is a filter in a scenario with a grade of IMU. At each epoch the NEES of the 15 "
    "states is averaged over all runs, to their end, diverged or not; a consistent filter keeps "
    "that mean inside a chi-square band at 95 of 100 epochs.",
    "The errors of neighbouring epochs are correlated. So `p` is the fraction of consistent "
    "filters with no more epochs inside the band, from simulations of a linear twin. A run "
    "survives if it is never 500 m off, nor for more than 10 s beyond the bound that 1 in 1 000 "
    "000 consistent filters exceeds.",
)


TARGETS = {
    "inside": Target(
        "epochs in the band, of the worst cell that is not refused", ">=", 100 * INSIDE, "%"
    ),
    "survived": Target(
        "runs that survive, of the worst cell that is not refused", ">=", 100 * SURVIVED, "%"
    ),
    "refused": Target(
        "refused cells, of the filter with the most", "<=", float(MAX_SHOWN), "cells"
    ),
    "missed": Target("cells, not refused, that miss 90 % or 98 %", "<=", 0.0, "cells"),
    "wrong": Target("of these, cells that chance does not explain", "<=", 0.0, "cells"),
}
"""The targets, by name: the first three are asked for as they stand, the others count cells by
the same rule, and by the rule that allows for chance."""


def select_counted(rows: pd.DataFrame) -> pd.DataFrame:
    """The cells that are not refused."""
    return rows[rows["refused"] == ""]


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}."""
    rows = found[CELLS]
    own = select_counted(rows)
    refused = (rows["refused"] != "").groupby(rows["filter"]).sum()
    return {
        "inside": float(own["inside_%"].min()),
        "survived": float(own["survived_%"].min()),
        "refused": float(refused.max()),
        "missed": float((own["verdict"] != CONSISTENT).sum()),
        "wrong": float((~own["verdict"].isin((CONSISTENT, BY_CHANCE))).sum()),
    }


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
            "consistent: median, 1 in 100": [
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


def select_refused(rows: pd.DataFrame) -> pd.DataFrame:
    """The cells that are refused, with the reason."""
    own = rows[rows["refused"] != ""].rename(columns={"refused": "reason", "filter": "filters"})
    cells = own.groupby(["scenario", "grade", "reason"], sort=False)["filters"].agg(", ".join)
    return cells.reset_index()[["filters", "scenario", "grade", "reason"]]


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)} of those that have rows."""
    rows = found[CELLS]
    of = {
        "holding": ("Scenarios in which each filter is consistent", list_holding(rows)),
        "by-filter": ("Cells of each filter", by_filter(rows)),
        "refused": ("Refused cells", select_refused(rows)),
        "each": ("Every cell", each(rows)),
    }
    return with_rows(of)


def size(rows: pd.DataFrame) -> str:
    """The size of the table, in words."""
    filters, scenarios, grades = (rows[c].nunique() for c in ("filter", "scenario", "grade"))
    return (
        f"{rows['runs'].min()} runs a cell, of {len(rows)} cells: {filters} filters, {scenarios} "
        f"scenarios, {grades} grades."
    )


def list_holding(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per filter, a column per grade: in which scenarios what the filter says may be
    believed, which is where it is consistent or misses the target by chance."""
    holds = rows.assign(
        holds=rows["verdict"].isin((CONSISTENT, BY_CHANCE)) & (rows["refused"] == "")
    )
    said = {
        name: {grade: _name_scenarios(cells) for grade, cells in own.groupby("grade", sort=False)}
        for name, own in holds.groupby("filter", sort=False)
    }
    return pd.DataFrame(said).T.reset_index(names="filter")


def _name_scenarios(cells: pd.DataFrame) -> str:
    """In which of the scenarios of these cells it holds, in few words."""
    yes, no = (cells.loc[cells["holds"] == which, "scenario"] for which in (True, False))
    if len(no) == 0:
        return "all"
    if len(yes) == 0:
        return "none"
    return f"not {', '.join(no)}" if len(no) < len(yes) else ", ".join(yes)


def texts(found: StudyTables, claims: Claims, tables: Tables) -> dict[str, str]:
    """{name: text} of two files for docs/, targets and a table per filter in the second, and of the
    picture."""
    rows = found[CELLS]
    headed = [(f"Scenarios in which each filter is consistent. {size(rows)}", list_holding(rows))]
    if len(select_refused(rows)):
        headed.append(("Refused cells:", select_refused(rows)))
    of_filters = [
        (f"## {name}", own.drop(columns="filter"))
        for name, own in each(rows).groupby("filter", sort=False)
    ]
    of_all = [("## Targets", table(claims)), ("## Cells of each filter", by_filter(rows))]
    return {
        "table.md": markdown.tables(headed),
        "each.md": markdown.tables([*of_all, *of_filters]),
        PICTURE: figure.draw_cells(rows),
    }


STUDY = ReproducedStudy(
    "Consistency: do the errors agree with the claimed covariance",
    INTRODUCTION,
    held_against(TARGETS, figures, digits=4),
    tables,
    stored=(CELLS,),
    texts=texts,
)
