"""The figures: errors, intervals, NEES, what is called found; their targets and tables."""

from typing import Any

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import band

from ..common.runner import StudyTables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables, group_rows, rms, with_rows
from ..common.targets import Target
from .cases import ALIGNED, KNOWN, MOTIONS, UNSEEN, simulation
from .drive import NOTHING, RIGHT
from .misses import BOUNDS, STATES, UNITS
from .simulated import EPOCHS, RUNS, SCALES

DRIVE, MISSES, COMMANDS = "drive", "misses", "commands"
"""Tables of the Evidence beside those of simulated.py."""
INTRODUCTION = (
    "Clocks, lever arms, mounting and odometer scale are given wrongly, and estimated as states of "
    "the filter. What is found is compared with what was done.",
    "Simulated runs draw the errors from the priors of the filter: clock 0.1 s, each component of "
    "the lever arm 0.5 m, mounting 2 deg in pitch and heading, scale 0.02. A parameter is called "
    "found where its standard deviation at the end is at most half of its prior.",
)
FILTER = "closed-loop"
METHOD = "calibrate installation"
"""By which the drive is judged; the tables have the others."""
SETTLED = 30.0
"""s after the start from which NEES counts."""
MIN_INSIDE, MAX_INSIDE, MANY = 0.90, 0.99, 100
"""Shares of runs whose 95 % interval holds the truth; the upper counts for so many runs at least,
for all of a few is no sign."""
FIVE_MINUTES = 300.0
DRIVEN = {"clock": 0.01, "lever-arm": 0.05, "mounting": 0.2}
ASIDE = "lever-arm down"
"""Parameter of the drive that its motion hardly shows."""


def _of_starts(name: str, text: str, *rest: Any) -> dict[str, Target]:
    return {f"{name}, {start}": Target(f"{text}, {start}", *rest) for start in (KNOWN, ALIGNED)}


TARGETS = {
    "drive clock": Target(
        "drive0708 from wrong set-ups: clock, the largest error", "<=", 0.01, "s"
    ),
    "drive lever-arm": Target(
        "drive0708 from wrong set-ups: lever arm, vertical aside, the largest error",
        "<=",
        0.05,
        "m",
    ),
    "drive mounting": Target(
        "drive0708 from wrong set-ups: mounting, the largest error", "<=", 0.2, "deg"
    ),
    "drive alone": Target(
        "drive0708 calibrated, GNSS alone: outages over those of the right set-up, the worst",
        "<=",
        1.1,
    ),
    "drive constrained": Target(
        "drive0708 calibrated, with constraints: outages over those of the right set-up, the worst",
        "<=",
        1.1,
    ),
    **_of_starts(
        "intervals",
        "simulated: parameters called found whose 95 % interval holds the truth in fewer than 90 or "
        "more than 99 of 100 runs",
        "<=",
        0.0,
    ),
    **_of_starts(
        "nees",
        "simulated: epochs with the NEES of all states in its 95 % band, the worst motion",
        ">=",
        90.0,
        "%",
    ),
    "commands": Target(
        "simulated: 95 % intervals of diagnose and calibrate installation that hold the truth, own "
        "alignment, the worst parameter",
        ">=",
        92.0,
        "%",
    ),
    "unseen": Target(
        "simulated: what the motion does not show, called found, the most often", "<=", 1.0, "%"
    ),
    "scale": Target(
        "odometer scale after five minutes, 95 % of the runs are within", "<=", 0.1, "%"
    ),
    **{
        name: Target(f"{name}, with clock and lever arm as states", "<=", bound, UNITS[name])
        for name, bound in BOUNDS.items()
    },
}
"""The targets, by name."""


def intervals(parameters: pd.DataFrame) -> pd.DataFrame:
    """A row per motion, filter, start and parameter: how often it is called found and its interval
    holds the truth then; bias and RMSE over all runs."""

    def measures(own: pd.DataFrame) -> dict[str, Any]:
        found = own[own["found"]]
        return {
            "runs": len(own),
            "stopped": int(own["stopped"].sum()),
            "found": len(found),
            "inside": float(found["inside"].mean()) if len(found) else np.nan,
            "bias": own["error"].mean(),
            "rmse": rms(own["error"]),
            "std": own["std"].mean(),
            "prior": own["prior"].iloc[0],
        }

    return group_rows(parameters, ["motion", "filter", "start", "parameter"], measures, COLUMNS)


def of_commands(table: pd.DataFrame) -> pd.DataFrame:
    """A row per motion, command and parameter: the share of its 95 % intervals that hold the truth, the
    RMSE and the mean standard deviation."""
    return group_rows(
        table,
        ["motion", "command", "parameter"],
        lambda own: {
            "known": len(own),
            "inside_%": 100 * float(own["inside"].mean()),
            "rmse": rms(own["error"]),
            "std": own["std"].mean(),
        },
        ("known", "inside_%", "rmse", "std"),
    )


COLUMNS = ("runs", "stopped", "found", "inside", "bias", "rmse", "std", "prior")


def is_hidden(table: pd.DataFrame) -> pd.Series:
    """Which rows are of a parameter that its motion does not show."""
    return pd.Series(
        [p.startswith(simulation(m).hidden) for m, p in zip(table["motion"], table["parameter"])],
        table.index,
        bool,
    )


NEES = ("_in_band_%", "/dof")


def consistency(epochs: pd.DataFrame) -> pd.DataFrame:
    """A row per motion, filter and start: the share of epochs, from SETTLED s after the start, whose
    NEES averaged over the runs is in its 95 % band, its mean by degree of freedom, and the same of
    the right set-up without the parameters."""

    def measures(own: pd.DataFrame) -> dict[str, Any]:
        own = own[own["t"] >= own.groupby("seed")["t"].min().max() + SETTLED]
        runs, dof = own["seed"].nunique(), int(own["dof"].iloc[0])
        by_t = own.groupby("t")[["nees", "nees_right"]].agg(["mean", "size"])
        by_t = by_t[by_t["nees", "size"] == runs]
        found: dict[str, Any] = {"runs": runs, "states": dof}
        for name, states in (("nees", dof), ("nees_right", 15)):
            low, high = band(states, runs)
            mean = by_t[name, "mean"]
            found[f"{name}_in_band_%"] = 100 * float(((mean >= low) & (mean <= high)).mean())
            found[f"{name}/dof"] = float(mean.mean() / states)
        return found

    columns = ("runs", "states", *(f"nees{of}{what}" for of in ("", "_right") for what in NEES))
    return group_rows(epochs, ["motion", "filter", "start"], measures, columns)


def scales(table: pd.DataFrame) -> pd.DataFrame:
    """A row per minute and start: median and 95 % quantile of the error of the odometer's scale, and
    the mean standard deviation, in %."""
    own = table[(table["filter"] == FILTER) & table["motion"].isin(list(MOTIONS))]
    own = own[(own["t"] % 30 == 0) & (own["t"] > 0)]
    return group_rows(
        own.rename(columns={"t": "t_s"}),
        ["start", "t_s"],
        lambda each: {
            "median_%": 100 * each["error"].abs().median(),
            "q95_%": 100 * each["error"].abs().quantile(0.95),
            "std_%": 100 * each["std"].mean(),
        },
        ("median_%", "q95_%", "std_%"),
    )


def summarise_drive(drive: pd.DataFrame) -> pd.DataFrame:
    """A row per wrong set-up and method: error of each parameter against what the same method
    estimates from the file as given, and the outages over those of the file as given."""
    rows = []
    right = drive[drive["wrong"] == RIGHT]
    base = right[right["method"] == NOTHING].iloc[0] if len(right) else None
    for (wrong, method), own in drive.groupby(["wrong", "method"], sort=False):
        of_right = right[right["method"] == method].set_index("parameter")["estimated"]
        row = {"wrong": wrong, "method": method}
        for _, each in own.iterrows():
            name = f"{each['parameter']}, {each['unit']}"
            known = each["estimated"] - of_right.get(each["parameter"], np.nan)
            row[name] = known - each["done"]
        row |= {"alone, m": own["alone_m"].iloc[0], "constrained, m": own["constrained_m"].iloc[0]}
        if base is not None:
            row["alone, ratio"] = row["alone, m"] / base["alone_m"]
            row["constrained, ratio"] = row["constrained, m"] / base["constrained_m"]
        rows.append(row)
    return pd.DataFrame(rows)


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}; NaN where the runs do not decide."""
    values: dict[str, float] = {}
    if len(found[DRIVE]):
        table = summarise_drive(found[DRIVE])
        own = table[(table["method"] == METHOD) & (table["wrong"] != RIGHT)]
        for name in DRIVEN:
            columns = [c for c in own if c.startswith(name) and not c.startswith(ASIDE)]
            values[f"drive {name}"] = float(own[columns].abs().max().max())
        values["drive alone"] = float(own["alone, ratio"].max())
        values["drive constrained"] = float(own["constrained, ratio"].max())
    told = intervals(found[RUNS])
    told = told[told["filter"] == FILTER]
    seen, unseen = (told[told["motion"].isin(list(which))] for which in (MOTIONS, UNSEEN))
    nees = consistency(found[EPOCHS])
    for start in (KNOWN, ALIGNED):
        own = seen[(seen["start"] == start) & (seen["found"] > 0)]
        off = (own["inside"] < MIN_INSIDE) | ((own["inside"] > MAX_INSIDE) & (own["found"] >= MANY))
        values[f"intervals, {start}"] = float(off.sum()) if len(own) else np.nan
        rows = nees[
            (nees["start"] == start)
            & (nees["filter"] == FILTER)
            & nees["motion"].isin(list(MOTIONS))
        ]
        values[f"nees, {start}"] = float(rows["nees_in_band_%"].min()) if len(rows) else np.nan
    told_by = of_commands(found[COMMANDS])
    values["commands"] = float(told_by["inside_%"].min()) if len(told_by) else np.nan
    cannot = unseen[is_hidden(unseen)]
    values["unseen"] = float((100 * cannot["found"] / cannot["runs"]).max())
    of_scale = scales(found[SCALES])
    late = of_scale[(of_scale["t_s"] == FIVE_MINUTES)]
    values["scale"] = float(late["q95_%"].max())
    for name in BOUNDS:
        own = found[MISSES][found[MISSES]["method"] == STATES] if len(found[MISSES]) else []
        values[name] = float(own[name].dropna().iloc[0]) if len(own) else np.nan
    return values


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)} of what was run."""
    told = intervals(found[RUNS])
    cannot = is_hidden(told)
    shown = {
        "drive": (
            "drive0708: errors against what the same method estimates from the file as given; "
            "median of the largest horizontal errors in nine outages",
            summarise_drive(found[DRIVE]) if len(found[DRIVE]) else found[DRIVE],
        ),
        "simulated": (
            "Simulated: errors at the end, and intervals where called found",
            told[~cannot & told["motion"].isin(list(MOTIONS))],
        ),
        "commands": (
            "Simulated, own alignment: intervals of the commands where they know the parameter",
            of_commands(found[COMMANDS]),
        ),
        "nees": ("NEES averaged over the runs", consistency(found[EPOCHS])),
        "not-shown": ("What the motion does not show", told[cannot]),
        "scale": ("The odometer's scale over time", scales(found[SCALES])),
        "misses": ("Missed figures of recorded data, with what is found", found[MISSES]),
    }
    return with_rows(shown)


STUDY = ReproducedStudy(
    "The installation, estimated",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(RUNS,),
)
