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

from ..common.concordance import concordance
from ..common.markdown import number
from ..common.paired_ratios import ratio
from ..common.reproduction import Asked, reproduction
from ..common.runner import ENOUGH, part_of
from ..common.study import Outcome, StudyWork, choices_table, write_study
from . import claims as alam_claims, convergence, costs, on_recordings, runs as alam_runs, table1
from .choices import CHOICES
from .concordance import entries
from .figures import all_figures
from .on_recordings import Recorded
from .readings import VARIANTS
from .runs import (
    ABLATIONS,
    AXES,
    EKF_NO_COURSE,
    FILTERS,
    SIMULATED_ALONE,
    XKF_NO_COURSE,
    AlamResults,
)

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
        "claim about the filters is judged for each reading of what the paper leaves open or prints "
        "twice: the two-stage model, the form of the XKF, the law of the accelerometer bias and the "
        "gains. Where one reading supports it and another contradicts it, the reading decides. The rules were written "
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


@reproduction("quick", "runs", "seed", "recordings", "threads", "notify", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write page, tables and claims.json into the folder `out`, and return the
    claims; quick: 3 seeds in place of 50, 20 starts in place of 100; recordings that are not in the
    source tree are left out. Raises DataError."""
    of_flight = asked.seeds(SEEDS, QUICK_SEEDS)
    starts = range(QUICK_STARTS) if asked.quick else convergence.SEEDS
    variants, threads, notify = FILTERS | ABLATIONS, asked.threads, asked.notify
    before, later = part_of(asked.progress, 0.0, 0.15), part_of(asked.progress, 0.2, 1.0)
    anywhere = {label: each for label, each in variants.items() if label not in SIMULATED_ALONE}
    timed = costs.measure_costs()
    recorded = on_recordings.run(anywhere, asked.recordings, threads, notify, before)
    converged = convergence.study(seeds=starts, threads=threads)
    results = alam_runs.run_all(of_flight, variants, later, threads, notify)
    return write(out, results, recorded, (converged, timed), asked.seed)


def write(
    out: File,
    results: AlamResults,
    recorded: Recorded,
    beside: tuple[pd.DataFrame, pd.DataFrame],
    seed: int,
) -> list[dict[str, Any]]:
    """Write the page of finished Results, Recorded, and the tables of the convergence study and of the
    costs into the folder `out`; return the claims."""
    converged, timed = beside
    scores = pd.concat([results.scores, recorded.scores], ignore_index=True)
    wide = table1.wide(scores)
    evidence = alam_claims.AlamEvidence(wide, results.biases, converged, timed)
    claims = alam_claims.claims(evidence)
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
            "seconds": (None, timed),
        },
        all_figures(results, recorded.growth, wide),
        table_texts(scores, evidence),
        [("Notes on the recordings", said)] if recorded.notes else (),
        runs=count,
        texts=lambda claims: {"concordance.md": concordance(entries(claims))},
    )
    return write_study(out, WORK, outcome)


def choices(count: int) -> pd.DataFrame:
    """Return the table of the points that the paper leaves open, for a study with `count` seeds."""
    return choices_table(CHOICES, seeds=f"{count} seed{'s' * (count > 1)}")


def table_texts(
    scores: pd.DataFrame, evidence: alam_claims.AlamEvidence
) -> list[tuple[str, str, pd.DataFrame]]:
    """[(name, heading, DataFrame of text)] of the tables for people; of few runs without verdicts."""
    heading = "Readings: letter, spirit or charity, and the verdict of each on each claim"
    enough = scores["block"].nunique() >= ENOUGH
    voted = [("readings", heading, alam_claims.votes(evidence))] if enough else []
    return [
        (
            "redrawn",
            "Table 1 redrawn, all three as printed: RMSE in m, published / ours as mean ± standard "
            "deviation over the runs",
            table1.redraw_table1(scores),
        ),
        *voted,
        (
            "filters",
            "All filters, readings and ablations: medians over the outages",
            filters(scores),
        ),
        (
            "ablations",
            "Ablations: ratio of RMSE to the same filter as printed, and of EKF to XKF both "
            "without course",
            ablations(evidence.tables),
        ),
        (
            "biases",
            "Wander of the bias estimates from 600 s to the touchdown, medians over the seeds",
            bias_table(evidence.biases),
        ),
        (
            "convergence",
            "Starts 170 deg off: below 10 deg within 60 s, staying there or not",
            convergence_table(evidence.converged),
        ),
        (
            "costs",
            "Seconds of one core for four minutes of the flight: median, smallest, largest",
            cost_table(evidence.costs),
        ),
    ]


def cost_table(costs: pd.DataFrame) -> pd.DataFrame:
    """A row per filter that was timed."""
    seconds = costs.groupby("filter", sort=False)["seconds"].agg(["median", "min", "max"])
    return seconds.map("{:.3g}".format).reset_index()


def of_all(held: pd.Series) -> str:
    """Text: in how many of the runs something held."""
    return f"{int(held.sum())} of {len(held)}"


def count_lost(rows: pd.DataFrame) -> pd.Series:
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
    """The columns {heading: texts by filter} and `count_lost`, in the order of the filters in `rows`."""
    names = dict.fromkeys(rows["filter"])
    return (
        pd.DataFrame(columns | {"lost": count_lost(rows)})
        .loc[list(names)]
        .reset_index(names="filter")
    )


def ablations(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """A row per ablation, which is no reading, and axis: the ratio of RMSE to the filter that it is a variant of, and of
    EKF to XKF both without course, by case.

    tables: of table1.wide.
    """
    own = [name for name in ABLATIONS if name not in VARIANTS]
    pairs = [*((name, name.split(",")[0]) for name in own), (EKF_NO_COURSE, XKF_NO_COURSE)]
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
            "epochs below 10 deg from 30 s on": ("late_share", lambda share: f"{share.mean():.0%}"),
            "said": ("said", said),
        }
    ).reset_index(names="filter")
