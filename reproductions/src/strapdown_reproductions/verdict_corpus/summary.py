"""The table of bets: the verdict's word against the truth."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from strapdown.data.verdict import RISK, TRUSTED

from ..common.runner import StudyTables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables, group_rows
from ..common.targets import Target
from ..wrong_setups.cells import RIGHT
from .combination import compare_rules
from .subjects import CHOSEN, COUNTED, PLAIN

BETS, ADVICE = "bets", "advice"
"""Tables of the StudyTables: rows of bets.py, and of its advice."""
MINUTES = 5.0
INTRODUCTION = (
    "Each recording is fused as it is, and with every mistake of the wrong set-ups. A result is "
    "wrong if an error exceeds three claimed standard deviations for more than 5 % of the time. "
    "The reference is the truth of a simulation or an independent one; otherwise it is the "
    "smoother of the correct set-up, whose standard deviations also count, and attitude is not "
    "scored.",
    f"Thresholds were chosen on the half called {CHOSEN!r}, and all figures are of the half called "
    f"{COUNTED!r}; no vehicle, motion or recording is in both.",
    "Announced: the verdict lists the wrong quantity, or what it depends on, as not tested. "
    "Intervals are for 95 %, as if results were independent; those of one recording are not.",
)
TARGETS = {
    "results": Target("results in the corpus", ">=", 1000.0),
    "wrong": Target(
        "trusted and wrong, of all that are trusted, without announced ones", "<=", 1.0, "%"
    ),
    "right": Target(
        "correct set-ups with correct results: doubted, without guessed axes", "<=", 3.0, "%"
    ),
    "harmless": Target("all correct results, harmless mistakes included: doubted", "<=", 3.0, "%"),
    "named": Target("wrong and doubted: the true cause named first", ">=", 90.0, "%"),
    "found": Target("wrong results, without announced ones: doubted", ">=", 98.0, "%"),
    "misleading": Target(
        "trusted: time in which an error is larger than its protection level", "<=", 100 * RISK, "%"
    ),
    "advice": Target("results that following the advice made trusted and wrong", "<=", 0.0),
    "cost": Target(
        "the verdict's time over the filter's, runs beyond 5 minutes, median", "<=", 10.0, "%"
    ),
}
"""The targets, by name."""


def of_half(rows: pd.DataFrame, half: str) -> pd.DataFrame:
    """The rows of a half that were judged, with what is wrong and vouched for."""
    own = rows[(rows["half"] == half) & rows["judged"]]
    return own.assign(vouched_wrong=own["wrong"] & ~(own["said_apart"] & own["trusted"]))


def percent(part: pd.Series) -> float:
    """Share in %; NaN of nothing."""
    return 100.0 * float(part.mean()) if len(part) else np.nan


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}; NaN where the bets do not decide."""
    rows = found[BETS]
    own = of_half(rows, COUNTED)
    right = own[~own["wrong"] & ~own["untested_axes"]]
    wrong = own[own["vouched_wrong"]]
    caught = wrong[wrong["doubted"] & (wrong["mistake"] != RIGHT)]
    long = rows[rows["seconds"] > 60 * MINUTES]
    return {
        "results": float(len(rows)),
        "wrong": percent(own.loc[own["trusted"], "vouched_wrong"]),
        "right": percent(right.loc[right["mistake"] == RIGHT, "doubted"]),
        "harmless": percent(right["doubted"]),
        "named": percent(caught["named"]),
        "found": percent(wrong["doubted"]),
        "misleading": max(
            (percent(own[column].dropna()) for column in own if column.startswith(BEYOND)),
            default=np.nan,
        ),
        "advice": float(len(spoilt(found[ADVICE]))),
        "cost": float(100 * (long["verdict_s"] / long["fuse_s"]).median()),
    }


BEYOND = "beyond level of "


def spoilt(advised: pd.DataFrame) -> pd.DataFrame:
    """Rows in which what was applied has made a wrong solution trusted."""
    if advised.empty:
        return advised
    now = advised["applied"] & (advised["after"] == TRUSTED) & advised["wrong_after"]
    return advised[now & ~advised["said_apart"] & (advised["before"] != TRUSTED)]


def levels(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per quantity and half: results with protection levels, and the share of their time beyond."""
    made = [
        {
            "half of the corpus": half,
            "quantity": column.removeprefix(BEYOND),
            "results": int(rows.loc[rows["half"] == half, column].notna().sum()),
            "beyond, % of the time": percent(rows.loc[rows["half"] == half, column].dropna()),
            "results with any": int((rows.loc[rows["half"] == half, column] > 0).sum()),
        }
        for half in (COUNTED, CHOSEN)
        for column in rows
        if column.startswith(BEYOND)
    ]
    return pd.DataFrame(made)


def advice(advised: pd.DataFrame) -> pd.DataFrame:
    """A row per subject: results that were followed, applied, and what came of them."""
    if advised.empty:
        return advised
    return group_rows(
        advised,
        ["subject"],
        lambda own: {
            "results": len(own),
            "wrong before": int(own["wrong_before"].sum()),
            "applied": int(own["applied"].sum()),
            "of them correct after": int((own["applied"] & ~own["wrong_after"]).sum()),
            "trusted and wrong after": len(spoilt(own)),
        },
    )


def counts(own: pd.DataFrame) -> dict[str, str | int]:
    """Columns of a group of bets: results, trusted and wrong, doubted and right, cause named."""
    trusted, right = own[own["trusted"]], own[~own["wrong"] & (own["mistake"] == RIGHT)]
    caught = own[own["vouched_wrong"] & own["doubted"] & (own["mistake"] != RIGHT)]
    harmless = own[~own["wrong"] & (own["mistake"] != RIGHT)]
    return {
        "results": len(own),
        "trusted and wrong": share(trusted["vouched_wrong"]),
        "announced": int((trusted["wrong"] & trusted["said_apart"]).sum()),
        "correct set-up doubted": share(right["doubted"] & ~right["untested_axes"]),
        "axes untested": int(right["untested_axes"].sum()),
        "harmless mistake doubted": share(harmless["doubted"]),
        "cause named first": share(caught["named"]),
    }


def share(part: pd.Series) -> str:
    """Text: how many of how many, and the 95 % interval (Wilson) in %."""
    if not len(part):
        return "–"
    count = int(part.sum())
    low, high = binomtest(count, len(part)).proportion_ci(method="wilson")
    return f"{count} of {len(part)} ({100 * low:.1f} to {100 * high:.1f} %)"


LENGTH_EDGES = (0.0, 120.0, 300.0, np.inf)
LENGTH_NAMES = ("below 2 min", "2 to 5 min", "above 5 min")


def with_length(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with a column of how long their recording is."""
    return rows.assign(
        length=pd.cut(rows["seconds"], LENGTH_EDGES, labels=LENGTH_NAMES).astype(str)
    )


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    rows = with_length(found[BETS])
    halves = {half: of_half(rows, half) for half in (COUNTED, CHOSEN)}
    own = halves[COUNTED]
    by: Callable[[str], pd.DataFrame] = lambda key: group_rows(own, [key], counts)
    whole = pd.concat(halves.values()).rename(columns={"half": "half of the corpus"})
    trusted_wrong = own[own["trusted"] & own["vouched_wrong"]]
    doubted = own[own["doubted"] & ~own["wrong"] & (own["mistake"] == RIGHT)]
    return {
        "halves": ("Both halves", group_rows(whole, ["half of the corpus"], counts)),
        "vehicle": ("By vehicle", by("vehicle")),
        "subject": ("By motion or recording", by("subject")),
        "variant": (f"By what was added ({PLAIN}: nothing)", by("variant")),
        "length": ("By length", by("length")),
        "wrong": ("Trusted and wrong", list_results(trusted_wrong, "which")),
        "doubted": ("Correct set-ups that are doubted", list_results(doubted, "cause")),
        "levels": (f"Protection levels at a risk of {RISK:g}", levels(rows)),
        "followed": ("`strapdown fuse --follow`", advice(found[ADVICE])),
        "rules": (
            "Rules that combine evidence",
            compare_rules(halves[CHOSEN], own) if len(halves[CHOSEN]) else pd.DataFrame(),
        ),
    }


def list_results(own: pd.DataFrame, what: str) -> pd.DataFrame:
    """A row per subject, variant and mistake: how many seeds, and what of them."""
    if own.empty:
        return pd.DataFrame(columns=["subject", "variant", "mistake", "results", what])
    return group_rows(
        own,
        ["subject", "variant", "mistake"],
        lambda part: {"results": len(part), what: part[what].mode().iloc[0]},
    )


STUDY = ReproducedStudy(
    "The verdict against the truth",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(BETS, ADVICE),
)
