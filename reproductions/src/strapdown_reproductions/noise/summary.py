"""The figures, their targets and tables."""

import numpy as np
import pandas as pd

from ..common.runner import StudyTables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables, group_rows, rms
from ..common.targets import Target
from . import correlated, coverage, misstated, outliers

CORRELATED, MISSTATED, OUTLIERS, COVERAGE = "correlated", "misstated", "outliers", "coverage"
"""Tables of the StudyTables, each of the rows of its file, and of the page."""
INTRODUCTION = (
    "Effect of time-correlated errors, wrongly stated noise and gross errors on a filter, and the "
    "gain from states, `tune`, robust and adaptive sources. Simulated runs are scored "
    "horizontally, a row a second from the 60th on, all seeds together; in the recorded ones "
    "fixes are hidden.",
)
WITHIN = {1.0: 0.683, 3.0: 0.997}
"""{standard deviations: share of a normal distribution}."""


TARGETS = {
    "correlated low, states": Target(
        "errors correlated over 0, 30, 120 s, states: rms error over claimed std, lowest", ">=", 0.9
    ),
    "correlated high, states": Target(
        "errors correlated over 0, 30, 120 s, states: rms error over claimed std, highest",
        "<=",
        1.1,
    ),
    "correlated low, tuned": Target(
        "errors correlated over 0, 30, 120 s, tuned: rms error over claimed std, lowest", ">=", 0.9
    ),
    "correlated high, tuned": Target(
        "errors correlated over 0, 30, 120 s, tuned: rms error over claimed std, highest", "<=", 1.1
    ),
    "white, tuned": Target(
        "white errors: rms error with tuned values over that with the true ones", "<=", 1.02
    ),
    "misstated rms": Target(
        "noise stated five times wrong: rms error after tune over that with the true noise, worst",
        "<=",
        1.1,
    ),
    "misstated NIS low": Target(
        "noise stated five times wrong: median NIS after tune over its expectation, lowest",
        ">=",
        0.8,
    ),
    "misstated NIS high": Target(
        "noise stated five times wrong: median NIS after tune over its expectation, highest",
        "<=",
        1.25,
    ),
    "robust outliers": Target(
        "a tenth of the fixes off by 20 std: rms error of robust over that of clean fixes, worst",
        "<=",
        1.1,
    ),
    "robust clean": Target(
        "clean fixes: rms error of robust over that of the gate, worst", "<=", 1.02
    ),
    "adaptive clean": Target(
        "clean fixes: rms error of adaptive over that of the gate, worst", "<=", 1.02
    ),
    "coverage 1": Target(
        "hidden fixes of drive0708 and thor75 within one std, tuned: off 68.3 %, worst",
        "<=",
        10,
        "%",
    ),
    "coverage 3": Target(
        "hidden fixes of drive0708 and thor75 within three std, tuned: off 99.7 %, worst",
        "<=",
        10,
        "%",
    ),
}
"""The targets, by name."""


def pool_cells(table: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """A row per cell: seeds, rms error and rms claimed std, m, of all its runs together."""
    of_runs = lambda own, column: float(np.sqrt(own[column].sum() / own["rows"].sum()))
    found = group_rows(
        table,
        keys,
        lambda own: {
            "seeds": own["seed"].nunique(),
            "rms, m": of_runs(own, "error"),
            "claimed, m": of_runs(own, "claimed"),
        },
        ("seeds", "rms, m", "claimed, m"),
    )
    return found.assign(**{"rms/claimed": found["rms, m"] / found["claimed, m"]})


def of_correlated(table: pd.DataFrame) -> pd.DataFrame:
    """A row per world, correlation time and way."""
    return pool_cells(table, ["world", "time", "way"])


def of_misstated(table: pd.DataFrame) -> pd.DataFrame:
    """A row per world, mistake and way: rms error over that of the right noise, and the median over
    the runs of the median NIS over its expectation."""
    keys = ["world", "mistake", "way"]
    found = pool_cells(table, keys)
    right = found[found["way"] == misstated.RIGHT].set_index(["world", "mistake"])["rms, m"]
    index = pd.MultiIndex.from_frame(found[["world", "mistake"]])
    found["over right"] = found["rms, m"].to_numpy() / right.reindex(index).to_numpy()
    nis = table.groupby(keys, sort=False)["nis"].median()
    found["NIS/expected"] = nis.reindex(pd.MultiIndex.from_frame(found[keys])).to_numpy()
    return found


def of_outliers(table: pd.DataFrame) -> pd.DataFrame:
    """A row per world, fixes and way: rms error over that of clean fixes with the gate."""
    found = pool_cells(table, ["world", "fixes", "way"])
    base = found[(found["fixes"] == outliers.CLEAN) & (found["way"] == "gate")]
    base = base.set_index("world")["rms, m"]
    found["over clean gate"] = found["rms, m"] / found["world"].map(base)
    return found


def of_coverage(table: pd.DataFrame) -> pd.DataFrame:
    """A row per recording, length of outage and way: shares of hidden fixes within one and three
    standard deviations, north and east together, and their rms error and std, m."""
    within = lambda own, k: float((own["error"].abs() / own["std"] <= k).mean())
    return group_rows(
        table,
        ["recording", "length", "way"],
        lambda own: (
            {"fixes": len(own) // 2}
            | {f"within {k:g} std": within(own, k) for k in WITHIN}
            | {"rms, m": rms(own["error"]), "std, m": rms(own["std"])}
        ),
    )


def figures(found: StudyTables) -> dict[str, float]:
    """{name of a target: figure}; NaN where the runs do not decide."""
    values: dict[str, float] = {}
    if len(found[CORRELATED]):
        table = of_correlated(found[CORRELATED])
        for name in (correlated.STATES, correlated.TUNED):
            own = table.loc[table["way"] == name, "rms/claimed"]
            values[f"correlated low, {name}"] = float(own.min())
            values[f"correlated high, {name}"] = float(own.max())
        values["white, tuned"] = _white_tuned(found[CORRELATED])
    if len(found[MISSTATED]):
        table = of_misstated(found[MISSTATED])
        own = table[table["way"] == misstated.TUNED]
        values["misstated rms"] = float(own["over right"].max())
        values["misstated NIS low"] = float(own["NIS/expected"].min())
        values["misstated NIS high"] = float(own["NIS/expected"].max())
    if len(found[OUTLIERS]):
        ratio = of_outliers(found[OUTLIERS]).set_index(["fixes", "way"])["over clean gate"]
        values["robust outliers"] = float(ratio[outliers.DIRTY, "robust"].max())
        values["robust clean"] = float(ratio[outliers.CLEAN, "robust"].max())
        values["adaptive clean"] = float(ratio[outliers.CLEAN, "adaptive"].max())
    if len(found[COVERAGE]):
        table = of_coverage(found[COVERAGE])
        own = table[table["way"] == coverage.TUNED]
        for k, share in WITHIN.items():
            off = (own[f"within {k:g} std"] - share).abs()
            values[f"coverage {k:g}"] = 100 * float(off.max())
    return values


def _white_tuned(table: pd.DataFrame) -> float:
    """rms error of white errors with tuned values over that with the right ones, on the same seeds,
    the worst world; NaN without such runs."""
    white = table[table["time"] == 0]
    tuned = white[white["way"] == correlated.TUNED]
    plain = white[(white["way"] == correlated.AS_WHITE) & white["seed"].isin(tuned["seed"])]
    both = [
        pool_cells(own, ["world", "way"]).set_index("world")["rms, m"]
        for own in (tuned, plain)
        if len(tuned)
    ]
    return float((both[0] / both[1]).max()) if both else np.nan


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)} of what was run."""
    of = {
        CORRELATED: ("Time-correlated position errors, by correlation time in s", of_correlated),
        MISSTATED: ("Noise stated five times wrong", of_misstated),
        OUTLIERS: ("A tenth of the fixes off by 20 std, and none", of_outliers),
        COVERAGE: ("Fixes hidden in outages, s", of_coverage),
    }
    return {
        name: (caption, make(found[name]))
        for name, (caption, make) in of.items()
        if len(found[name])
    }


STUDY = ReproducedStudy(
    "Noise, estimated from the data", INTRODUCTION, held_against(TARGETS, figures), tables
)
