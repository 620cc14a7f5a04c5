"""The figures of the study: shares of mistakes found and named, false alarms, costs; their targets
and tables."""

import numpy as np
import pandas as pd

from strapdown.data.verdict import DOUBTFUL

from ..common import markdown
from ..common.runner import StudyTables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables
from ..common.targets import Target, in_docs
from . import diagnosed
from .cases import MOTIONS
from .cells import RIGHT
from .not_showable import NOT_SHOWABLE

CELLS, DIAGNOSES = "cells", "diagnoses"
"""Tables of the StudyTables: rows of cells.py and of diagnosed.py."""
INTRODUCTION = (
    "The study makes each mistake in each recording. It is harmful if the rms of an error "
    "(horizontal position, height, velocity, roll and pitch, heading) is at least twice that of "
    "the correct set-up, or if an error exceeds three claimed standard deviations for more than 5 "
    "% of the time and does not with the correct set-up. Without truth, it is harmful if the "
    "solution differs from that of the correct set-up by more than three of its claimed standard "
    "deviations for more than 5 % of the time. A mistake is found if `inspect` reports a problem "
    "or the verdict is not `trusted`; it is named if the first reason has the true cause.",
    "The mistakes that the data of a recording cannot show were written down before the table "
    "ran; for these the verdict must list the mistaken quantity as not tested.",
)


def harmful(rows: pd.DataFrame, showable: bool = True) -> pd.DataFrame:
    """The harmful cells that the data can show, or cannot."""
    return rows[(rows["mistake"] != RIGHT) & rows["harmful"] & (rows["showable"] == showable)]


def rights(rows: pd.DataFrame, recorded: bool = False) -> pd.DataFrame:
    """The right set-ups of simulated or of recorded data."""
    own = rows[rows["mistake"] == RIGHT]
    return own[own["recording"].isin(list(MOTIONS)) != recorded]


def percent(held: pd.Series) -> float:
    """Share in %; NaN of nothing."""
    return 100.0 * float(held.mean()) if len(held) else np.nan


TARGETS = {
    "found": Target("harmful mistakes that the data can show: found", ">=", 95.0, "%"),
    "named": Target("of them: the true cause named first", ">=", 80.0, "%"),
    "untested": Target(
        "harmful mistakes that the data cannot show: named as not tested", ">=", 100.0, "%"
    ),
    "alarms": Target("simulated correct set-ups: not trusted", "<=", 2.0, "%"),
    "recorded": Target("recorded correct set-ups, without thor75: not trusted", "<=", 0.0, "%"),
    "as logged": Target("swisslog as logged: the true cause named first", ">=", 100.0, "%"),
    "cost": Target("the verdict's time over the filter's, median", "<=", 10.0, "%"),
    "runs": Target("runs of the filter that diagnose takes, largest number", "<=", 15.0, "runs"),
}
"""The targets, by name."""


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}; NaN where the cells do not decide."""
    rows, diagnoses = found[CELLS], found[DIAGNOSES]
    own, unseen, right = harmful(rows), harmful(rows, showable=False), rights(rows)
    known = rights(rows, recorded=True)
    # its clock is off by 0.05 s: a doubt is right, more would be an alarm
    doubted = known["found"] & ~((known["recording"] == "thor75") & (known["word"] == DOUBTFUL))
    return {
        "found": percent(own["found"]),
        "named": percent(own["named"]),
        "untested": percent(unseen["named_untested"]),
        "alarms": percent(right["found"]),
        "recorded": percent(doubted),
        "as logged": percent(rows.loc[rows["group"] == "as logged", "named"]),
        "cost": float(100 * (right["verdict_s"] / right["fuse_s"]).median()),
        "runs": float(diagnoses["runs"].max()) if len(diagnoses) else np.nan,
    }


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}: by mistake, by recording, what was missed, right set-ups that
    were not trusted, diagnoses, what cannot be shown."""
    rows = found[CELLS]
    own = harmful(rows)
    return {
        "by-mistake": (
            "Harmful cells that the data can show, by mistake",
            count_harmful(own, "mistake"),
        ),
        "by-recording": ("The same by recording", count_harmful(own, "recording")),
        "missed": ("Harmful cells that were not found", list_missed(own[~own["found"]])),
        "misnamed": (
            "Found, but another cause is named first",
            list_missed(own[own["found"] & ~own["named"]]),
        ),
        "alarms": ("Correct set-ups that are not trusted", alarms(rows)),
        "hidden": (
            "Harmful cells that the data cannot show",
            count_unshown(harmful(rows, showable=False)),
        ),
        "diagnoses": (
            "What diagnose finds, on one seed of each motion",
            found[DIAGNOSES].reindex(columns=diagnosed.COLUMNS),
        ),
        "not-showable": ("What the data cannot show, and why", not_showable()),
    }


def count_harmful(own: pd.DataFrame, by: str) -> pd.DataFrame:
    """A row per mistake or recording: harmful cells, of them found, found by each, named."""
    groups = own.groupby(by, sort=False)
    return pd.DataFrame(
        {
            "harmful": groups.size(),
            "found": groups["found"].sum(),
            "by inspect": groups["by_inspect"].sum(),
            "by the verdict": groups["by_verdict"].sum(),
            "named": groups["named"].sum(),
        }
    ).reset_index()


def count_unshown(own: pd.DataFrame) -> pd.DataFrame:
    """A row per group and recording: harmful cells, and in how many the verdict names as not
    tested what was mistaken."""
    groups = own.groupby(["group", "recording"], sort=False)
    return pd.DataFrame(
        {"harmful": groups.size(), "named as not tested": groups["named_untested"].sum()}
    ).reset_index()


def list_missed(own: pd.DataFrame) -> pd.DataFrame:
    """A row per mistake and recording: in how many seeds, which errors, how large, and what was
    said first."""
    groups = own.assign(
        said=own["inspect_cause"].where(own["inspect_cause"] != "", own["verdict_cause"])
    ).groupby(["mistake", "recording"], sort=False)
    often = lambda texts: texts.mode().iloc[0]
    return groups.agg(
        cells=("seed", "size"),
        errors=("which", often),
        worse=("worse", "median"),
        beyond=("beyond", "median"),
        said_first=("said", often),
    ).reset_index()


def alarms(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per right set-up that is called anything but trusted, and what was said."""
    own = rows[(rows["mistake"] == RIGHT) & rows["found"]]
    return own[["recording", "seed", "word", "inspect_says", "verdict_says"]]


def not_showable() -> pd.DataFrame:
    """The table of not_showable, as text."""
    return pd.DataFrame(
        [(", ".join(h.groups), ", ".join(h.recordings), h.reason) for h in NOT_SHOWABLE],
        columns=["mistakes", "recordings", "reason"],
    )


STUDY = ReproducedStudy(
    "Wrong set-ups: which are found, and which cause is named",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(CELLS,),
    texts=lambda found, claims, tables: {"table.md": in_docs(claims, tables, markdown.cell)},
)
