"""The exogenous Kalman filter in GNSS outages: the study of Alam, Whidborne & Millidere on a
simulated flight and on recordings, and its claims.

Source: M. Alam, J. Whidborne and M. Millidere, "Performance Analysis of eXogenous Kalman Filter for
INS/GNSS Navigation Solutions", IFAC-PapersOnLine 56(2), 2023.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from strapdown import __version__
from strapdown.typing import File

from ..common.markdown import number
from ..common.paired_ratios import ratio
from ..common.reproduction import Asked, reproduction
from ..common.runner import part_of
from ..common.study import Outcome, StudyWork, choices_table, write_study
from . import claims as alam_claims, convergence, on_recordings, runs as alam_runs, table1
from .choices import CHOICES
from .figures import all_figures
from .on_recordings import Recorded
from .runs import ABLATIONS, AXES, EKF_NO_COURSE, FILTERS, XKF_NO_COURSE, AlamResults

SEEDS, QUICK_SEEDS = 50, 3
QUICK_STARTS = 20
"""Starts of the convergence study with --quick; else those of convergence.SEEDS."""
WORK = StudyWork(
    "EKF, nonlinear observer and exogenous Kalman filter in GNSS outages: the study of Alam et al. again",
    (
        "Alam, Whidborne and Millidere compare a two-stage EKF, a nonlinear observer (NLO) and their "
        "cascade, the exogenous Kalman filter (XKF), on "
        "one flight of 33 minutes with the GNSS cut for 30 s in every five minutes. The flight is not "
        "public. Here the same protocol runs on a "
        "simulated flight of the stated envelope over many seeds, and on two public recordings. All "
        "filters have the same start, noise, fixes and "
        "outages; the closed loop of this library is the anchor, and a second XKF stands around the "
        "library's 15-state error model.",
        "Each claim of the paper has a verdict that code has taken from the numbers, by the rule of its "
        'kind, which stands beside it. "Not reproduced" means: not under the assumptions stated here. A '
        "claim about NLO or XKF is judged for each reading of two things that the paper leaves open: "
        "which attitude drives stage 2 of the XKF, and how the accelerometer bias is found. Where one "
        "reading supports it and another contradicts it, the reading decides. The rules were written "
        "before any run of the seeds that they judge. Runs that diverge or stop are counted: with 10 km "
        "and 1 km/s, and the wander of their bias estimates with a hundred times the turn-on biases.",
    ),
)
SHOWN = {
    "horizontal_rmse_m": ("horizontal RMSE, m", 3),
    "down_rmse_m": ("down RMSE, m", 3),
    "horizontal_end_m": ("horizontal at the end, m", 3),
    "velocity_end_m_s": ("velocity at the end, m/s", 2),
}
"""Measures of an outage: heading, digits."""
WANDERS = {
    "wander": "wander",
    "wander_late": "wander, last 10 min",
    "rms": "rms error",
    "true": "wander of the true one",
}
"""Columns of the bias estimates of a sensor, and what they are called."""
DEGREES = float(np.degrees(1.0))


@reproduction("quick", "runs", "seed", "recordings", "threads", "say", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write page, tables and claims.json into the folder `out`, and return the
    claims; quick: 3 seeds in place of 50, 20 starts in place of 100; recordings that are not in the
    source tree are left out. Raises DataError."""
    of_flight = asked.seeds(SEEDS, QUICK_SEEDS)
    starts = range(QUICK_STARTS) if asked.quick else convergence.SEEDS
    variants, threads, say = FILTERS | ABLATIONS, asked.threads, asked.say
    before, later = part_of(asked.progress, 0.0, 0.15), part_of(asked.progress, 0.2, 1.0)
    recorded = on_recordings.run(variants, asked.recordings, threads, say, before)
    converged = convergence.study(seeds=starts, threads=threads)
    results = alam_runs.run_all(of_flight, variants, later, threads, say)
    return write(out, results, recorded, converged, asked.seed)


def write(
    out: File, results: AlamResults, recorded: Recorded, converged: pd.DataFrame, seed: int
) -> list[dict[str, Any]]:
    """Write the page of finished Results, Recorded and convergence study into the folder `out`;
    return the claims."""
    scores = pd.concat([results.scores, recorded.scores], ignore_index=True)
    wide = table1.wide(scores)
    claims = alam_claims.claims(alam_claims.AlamEvidence(wide, results.biases, converged))
    count = results.scores["block"].nunique()
    size = (
        f"This page: {count} seeds of the simulated flight with {len(alam_runs.windows())} outages "
        f"each, {converged['seed'].nunique()} "
        f"starts 170 deg off, recordings "
        f"{', '.join(dict.fromkeys(recorded.scores['case'])) if len(recorded.scores) else 'none'}, "
        f"seed "
        f"{seed}, strapdown {__version__}."
    )
    said = pd.DataFrame(list(dict.fromkeys(recorded.notes)), columns=["recording", "note"])
    outcome = Outcome(
        size,
        claims,
        choices(count),
        {
            "outages": (None, scores),
            "biases-runs": (None, results.biases),
            "convergence-runs": (None, converged),
        },
        all_figures(results, recorded.growth, wide),
        shown(scores, results.biases, converged),
        [("Notes on the recordings", said)] if recorded.notes else (),
        runs=count,
    )
    return write_study(out, WORK, outcome)


def choices(count: int) -> pd.DataFrame:
    """Return the table of the points that the paper leaves open, for a study with `count` seeds."""
    return choices_table(CHOICES, seeds=f"{count} seed{'s' * (count > 1)}")


def shown(
    scores: pd.DataFrame, biases: pd.DataFrame, converged: pd.DataFrame
) -> list[tuple[str, str, pd.DataFrame]]:
    """[(name, heading, DataFrame of text)] of the tables for people."""
    return [
        (
            "redrawn",
            "Table 1 redrawn: RMSE in m, published / ours as mean ± standard deviation over the "
            "runs",
            table1.redrawn(scores),
        ),
        ("filters", "All filters and ablations: medians over the outages", filters(scores)),
        (
            "ablations",
            "Ablations: ratio of RMSE to the same filter with its defaults, and of EKF to XKF both "
            "without course",
            ablations(table1.wide(scores)),
        ),
        (
            "biases",
            "Wander of the bias estimates from 600 s to the touchdown, medians over the seeds",
            bias_table(biases),
        ),
        (
            "convergence",
            "Starts 170 deg off: below 10 deg within 60 s, staying there or not",
            convergence_table(converged),
        ),
    ]


def of_all(held: pd.Series) -> str:
    """Text: in how many of the runs something held."""
    return f"{int(held.sum())} of {len(held)}"


def lost(rows: pd.DataFrame) -> pd.Series:
    """Texts by filter: how many of its rows were lost."""
    return rows["said"].ne("").groupby(rows["filter"], sort=False).agg(of_all)


def filters(scores: pd.DataFrame) -> pd.DataFrame:
    """A row per filter: median errors over the simulated outages and in each recording, and how
    many outages it did not get through."""
    place = scores["case"].str.replace(r"outage \d+", "simulated", regex=True).rename("place")
    middle = scores.groupby(["filter", place])[list(SHOWN)].median().unstack("place")
    columns = {
        f"{each}: {title}": middle[measure, each].map(
            lambda value, digits=digits: number(value, digits)
        )
        for each in ("simulated", *on_recordings.RECORDINGS)
        if (place == each).any()
        for measure, (title, digits) in SHOWN.items()
    }
    return by_filter(columns, scores)


def by_filter(columns: dict[str, pd.Series], rows: pd.DataFrame) -> pd.DataFrame:
    """The columns {heading: texts by filter} and `lost`, in the order of the filters in `rows`."""
    names = dict.fromkeys(rows["filter"])
    return pd.DataFrame(columns | {"lost": lost(rows)}).loc[list(names)].reset_index(names="filter")


def ablations(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """A row per ablation and axis: the ratio of RMSE to the filter that it is a variant of, and of
    EKF to XKF both without course, by case.

    tables: of table1.wide.
    """
    pairs = [*((name, name.split(",")[0]) for name in ABLATIONS), (EKF_NO_COURSE, XKF_NO_COURSE)]
    return pd.DataFrame(
        [
            {
                "ablation": f"{name} / {base}",
                "axis": axis,
                **{
                    case: str(ratio(table, f"{axis}_rmse_m", name, base))
                    for case, table in tables.items()
                },
            }
            for name, base in pairs
            for axis in AXES
        ]
    )


def bias_table(biases: pd.DataFrame) -> pd.DataFrame:
    """A row per filter: standard deviation over time and rms error of its bias estimates, and of
    the true biases, medians over the seeds.

    Lost runs are in the medians, with runs.ASTRAY.
    """
    middle = biases.groupby("filter").median(numeric_only=True)
    columns = {
        f"{sensor}: {title}, {unit}": (middle[f"{sensor}_{column}"] * factor).map("{:.2g}".format)
        for sensor, unit, factor in (("accel", "m/s²", 1.0), ("gyro", "deg/s", DEGREES))
        for column, title in WANDERS.items()
    }
    return by_filter(columns, biases)


def convergence_table(converged: pd.DataFrame) -> pd.DataFrame:
    """A row per case: converged of all, their median time, and what was said of those that
    stopped or cannot run."""
    finite = np.isfinite(converged[["since_s", "first_s"]])
    cases = converged.assign(since=finite["since_s"], first=finite["first_s"]).groupby(
        "case", sort=False
    )
    said = lambda texts: "; ".join(dict.fromkeys(text for text in texts if text))
    time = lambda since: f"{since[np.isfinite(since)].median():.1f}".replace("nan", "–")
    return cases.agg(
        **{
            "below 10 deg from some time to 60 s": ("since", of_all),
            "below 10 deg at some time": ("first", of_all),
            "median time, s": ("since_s", time),
            "said": ("said", said),
        }
    ).reset_index(names="filter")
