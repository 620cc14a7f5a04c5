"""The figures of the fault matrix, their targets and tables."""

import numpy as np
import pandas as pd

from strapdown import filters

from ..common import markdown
from ..common.runner import StudyTables
from ..common.study import Claims, ReproducedStudy, held_against
from ..common.tables import Tables, outcomes
from ..common.targets import Target, in_docs
from .judging import CRASH, ORDER, SILENT
from .jumps import FOR_GOOD, LASTING, NONE, SIZES
from .not_showable import NOT_SHOWABLE, HiddenFault
from .runs import BATCH, SMOOTHED, STREAM, family

CELLS, TRIALS = "cells", "trials"
"""Tables of the StudyTables: rows of cells.py and of jumps.py."""
INTRODUCTION = (
    "The study makes each fault in the same simulated recordings. A run is wrong if, from 60 s "
    "on, the error of a component of position, velocity or attitude exceeds five of its own "
    "standard deviations for a second in all, or, if the filter claims none, twice the largest "
    "error of the run without a fault. It is silent if that second lies in rows whose status is "
    "valid or bridged, and no event or note reports more than in the run without the fault.",
    "A cell shows the worst result of the motions and seeds, with the number of runs that had it. "
    "The faults that the data cannot show are listed with the reason.",
)
SOON = 30.0
"""s within which a lasting jump must be said."""


TARGETS = {
    "silent": Target(
        "runs that are silently wrong, of faults that the data can show", "<=", 0, "runs"
    ),
    "silent classes": Target("classes of faults among them", "<=", 0, "classes"),
    "crashes": Target("runs that end in anything but a refusal", "<=", 0, "runs"),
    "live": Target("runs that are silent live and not in batch", "<=", 0, "runs"),
    "smoothed": Target("runs that are silent smoothed and not in batch", "<=", 0, "runs"),
    **{
        f"{size:g} m": Target(
            f"jumps of {size:g} m: first wrong fix refused, of 1000", ">=", 999, "jumps"
        )
        for size in SIZES
    },
    "lasting": Target(
        f"lasting jump of {LASTING:g} m said within {SOON:g} s, of 100", ">=", 95, "jumps"
    ),
    "alarms": Target("flights without a fault that are doubted, of 200", "<=", 1, "flights"),
}
"""The targets, by name."""


def showable(rows: pd.DataFrame) -> pd.DataFrame:
    """The cells with a fault that the data can show."""
    return rows[rows["showable"]]


def silent(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the silently wrong cells among those with a fault that the data can show."""
    own = showable(rows)
    return own[own["verdict"] == SILENT]


def silent_only(rows: pd.DataFrame, way: str) -> pd.DataFrame:
    """Cells that are silent in that way of running though the same filter in batch is not."""
    keys = ["fault", "filter", "motion", "seed"]
    own = silent(rows)
    batch = rows[rows["way"] == BATCH].set_index(keys)["verdict"]
    mine = own[own["way"] == way]
    beside = mine.set_index(keys).index.map(batch.to_dict())
    return mine[np.asarray(beside != SILENT) & np.asarray(pd.notna(beside))]


def of_thousand(trials: pd.DataFrame, held: pd.Series, of: float) -> float:
    """Return the number of trials that held, per `of` trials; NaN without trials."""
    return of * float(held.mean()) if len(trials) else np.nan


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}; NaN where the cells do not decide."""
    rows, trials = found[CELLS], found[TRIALS]
    jumped = trials[trials["what"] != NONE]
    lasting = jumped[(jumped["size"] == LASTING) & (jumped["what"] == FOR_GOOD)]
    right = trials[trials["what"] == NONE]
    there = lambda way: (rows["way"] == way).any()
    count = lambda way: float(len(silent_only(rows, way))) if there(way) else np.nan
    first = {
        f"{size:g} m": of_thousand(own, own["refused"], 1000)
        for size in SIZES
        for own in [jumped[jumped["size"] == size]]
    }
    return {
        "silent": float(len(silent(rows))),
        "silent classes": float(silent(rows)["fault"].nunique()),
        "crashes": float((rows["verdict"] == CRASH).sum()),
        "live": count(STREAM),
        "smoothed": count(SMOOTHED),
        **first,
        "lasting": of_thousand(lasting, lasting["said_after"] <= SOON, 100),
        "alarms": of_thousand(right, alarm(right), 200),
    }


def alarm(trials: pd.DataFrame) -> pd.Series:
    """Which runs say that something is wrong."""
    return (trials["doubtful_s"] > 0) | (trials["says"].fillna("") != "")


def name_subjects(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with what ran in one column: "closed-loop live"."""
    way = rows["way"].where(rows["way"] != BATCH, "")
    return rows.assign(runs=(rows["filter"] + " " + way).str.strip())


def worst(verdicts: pd.Series) -> str:
    """The worst of these verdicts, with how many are so bad; in brackets where the data cannot show
    the fault."""
    counts = verdicts.value_counts()
    last = max(counts.index, key=ORDER.index)
    many = f" {counts[last]}" if last in (SILENT, CRASH) and len(verdicts) > 1 else ""
    return f"{last}{many}"


def matrix(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per fault, a column per filter and way: the worst that came of it."""
    own = name_subjects(rows)
    table = own.pivot_table(
        index=["fault"], columns="runs", values="verdict", aggfunc=worst, sort=False
    )
    return table.fillna("").reset_index()


def by_fault(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per fault: what it is of, and how many runs came to what."""
    keys = ["of", "fault"]
    hidden = rows.groupby(keys, sort=False)["showable"].agg(lambda s: int((~s).sum()))
    counts = outcomes(rows, keys, "verdict", ORDER)
    return counts.assign(**{"cannot be shown": hidden}).reset_index()


def by_filter(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per filter, way and motion: how many runs with a fault that can be shown came to
    what."""
    return outcomes(
        name_subjects(showable(rows)), ["runs", "motion"], "verdict", ORDER
    ).reset_index()


def silences(rows: pd.DataFrame) -> pd.DataFrame:
    """A row per fault and motion that some filter is silent about: which, and how wrong."""
    own = name_subjects(silent(rows))
    if own.empty:
        return pd.DataFrame(columns=["fault", "motion", "runs", "seconds", "error / std"])
    return (
        own.groupby(["fault", "motion"], sort=False)
        .agg(
            runs=("runs", lambda names: ", ".join(sorted(set(names)))),
            seconds=("believed_s", "median"),
            largest=("largest", "median"),
        )
        .rename(columns={"largest": "error / std"})
        .reset_index()
    )


def count_doubted(trials: pd.DataFrame) -> pd.DataFrame:
    """A row per filter and motion without a fault: flights, doubted ones, and what was said."""
    right = trials[trials["what"] == NONE]
    groups = right.assign(alarm=alarm(right)).groupby(["filter", "motion"], sort=False)
    first = lambda texts: next((text for text in texts.fillna("") if text), "")
    return groups.agg(
        flights=("seed", "size"), doubted=("alarm", "sum"), for_instance=("says", first)
    ).reset_index()


def count_jumps(trials: pd.DataFrame) -> pd.DataFrame:
    """A row per kind of jump: how many had their first fix refused, how many were said in time."""
    own = trials[trials["what"] != NONE]
    groups = own.assign(soon=own["said_after"] <= SOON).groupby(["what", "size"], sort=False)
    return groups.agg(
        flights=("seed", "size"), first_refused=("refused", "sum"), said_within_30_s=("soon", "sum")
    ).reset_index()


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    rows, trials = found[CELLS], found[TRIALS]
    return {
        "silent": ("Silently wrong, though the data can show it", silences(rows)),
        "by-filter": ("Results of the runs whose fault the data can show", by_filter(rows)),
        "by-fault": ("Results by fault", by_fault(rows)),
        "jumps": ("Jumps of the position, closed loop", count_jumps(trials)),
        "without-fault": ("Flights without a fault", count_doubted(trials)),
        "matrix": ("Every fault and filter: the worst of all motions and seeds", matrix(rows)),
        "not-showable": ("What the data cannot show, and why", not_showable(rows)),
    }


def not_showable(rows: pd.DataFrame) -> pd.DataFrame:
    """The table of not_showable, as text, with the median of what innovations of the filters show."""
    return pd.DataFrame(
        [
            (
                "; ".join(h.faults),
                ", ".join(h.families),
                ", ".join(h.motions) or "all",
                _median_deflections(rows, h),
                h.reason,
            )
            for h in NOT_SHOWABLE
        ],
        columns=["faults", "filters of", "motions", "std shown", "reason"],
    )


def _median_deflections(rows: pd.DataFrame, hidden: HiddenFault) -> str:
    """The median `deflection` of each fault that is hidden from some filters; empty without a run."""
    families = rows["filter"].map(lambda name: family(filters.find(name)))
    own = rows[families.isin(hidden.families) & rows["motion"].isin(hidden.motions)]
    own = own[~own["showable"]]
    each = [own.loc[own["fault"] == fault, "shown_std"].median() for fault in hidden.faults]
    return "; ".join(f"{value:.1f}" for value in each if np.isfinite(value))


IN_DOCS = ("silent", "by-filter", "jumps", "without-fault", "not-showable")
"""Tables that are small enough for docs/reference/evidence/faults.md."""


def texts(found: StudyTables, claims: Claims, tables: Tables) -> dict[str, str]:
    """{name: text} of two files for docs/."""
    few = {name: tables[name] for name in IN_DOCS}
    return {
        "table.md": in_docs(claims, few, markdown.cell),
        "each.md": markdown.tables([("### Each fault", tables["by-fault"][1])]),
    }


STUDY = ReproducedStudy(
    "Sensor faults: does a wrong filter report it",
    INTRODUCTION,
    held_against(TARGETS, figures, digits=4),
    tables,
    stored=(CELLS, TRIALS),
    texts=texts,
)
