"""EKF, UKF and particle Kalman filter in the loop of an aircraft that loses GPS: the study of
Mollaei, Shafieirad & Moradi, and its claims.

Source: M. Mollaei, M. Shafieirad and E. Moradi, "Enhanced Navigation Accuracy Using Nonlinear
Kalman Filters in INS/GPS Integration", Majlesi Journal of Electrical Engineering, 2025.
"""

from pathlib import Path
from typing import Any

import pandas as pd

from strapdown import __version__
from strapdown.typing import File

from ..common.concordance import concordance
from ..common.pages import TOO_FEW
from ..common.reproduction import Asked, reproduction
from ..common.runner import ENOUGH
from ..common.study import Outcome, StudyWork, choices_table, write_study
from . import (
    cells,
    claims as mollaei_claims,
    rules,
    runs as mollaei_runs,
)
from .cells import E0, E1, E2, FULL, IMU, PKF, SIX, UKF, FlightCase
from .choices import CHOICES, WORDS
from .concordance import entries
from .contradictions import contradictions
from .figures import all_figures
from .metrics import FINAL
from .runs import MollaeiResults

SEEDS, QUICK_SEEDS = 200, 2
COMPONENTS, QUICK_COMPONENTS = 500, 25
"""Components of the particle Kalman filter."""
WORK = StudyWork(
    "EKF, UKF and particle Kalman filter when GPS is lost: the study of Mollaei et al. again",
    (
        "Mollaei, Shafieirad and Moradi fly a model of a fixed-wing aircraft on the estimates of an "
        "EKF, a UKF and a particle Kalman filter (PKF), with "
        "GPS, with GPS lost at 15 s of 25 s, and lost for five minutes; one flight each, without a "
        "number of the aircraft, its autopilot, its GPS or its "
        "path. Here an Aerosonde flies the same experiments over many seeds, and others beside them. "
        "All modes of a seed have the same sensor errors.",
        "Who predicts while there is no GPS is not said, and decides everything. Two readings stand "
        "side by side. IMU-driven: the accelerometers, turned "
        "by an attitude that is true at the start and then integrated from the gyros; with position and "
        "velocity as its states the filter is then "
        "linear, and EKF and UKF are one and the same. Model-driven: the forces of the aircraft's own "
        "model from the controls, with that same attitude; "
        "with 15 states its moments too, and no gyros. The model has the very parameters of the "
        "aircraft that is flown, which no real flight has.",
        "What the paper leaves open else is read in every way that might favour it, and a claim that "
        "turns with the reading says so. "
        + "; ".join(f"{name}: {text}" for name, text in cells.EKFS.items())
        + f". {cells.POINTS}: components predicted by the sigma points (37) to (39). Other conditions: "
        + ", ".join(cells.CONDITIONS)
        + ".",
        "; ".join(f"{name}: {text}" for name, text in cells.EXPERIMENTS.items())
        + '. In tables "published / ours" ours is the median over the '
        "seeds, in brackets their 10 and 90 % quantiles; NEES is the mean over the flights that were "
        "not lost, with the band that it keeps in 95 % of "
        "studies where a filter is as good as it says.",
        "Each claim of the paper has a verdict that code has taken from the numbers, by a rule that "
        "stands beside it. "
        "Cells in which filters are one by algebra are no evidence: they are counted apart. "
        '"Not reproduced" means: not under the assumptions stated here. A flight that stops counts with '
        "the most of each measure.",
    ),
)


@reproduction("quick", "runs", "seed", "threads", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write page, tables and claims.json into the folder `out`, and return the
    claims; quick: 2 seeds in place of 200, PKF of 25 components in place of 500. Raises DataError."""
    of_flights = asked.seeds(SEEDS, QUICK_SEEDS)
    components = QUICK_COMPONENTS if asked.quick else COMPONENTS
    results = mollaei_runs.run_all(
        of_flights, components, threads=asked.threads, progress=asked.progress
    )
    return write(out, results, components, asked.seed)


def write(out: File, results: MollaeiResults, components: int, seed: int) -> list[dict[str, Any]]:
    """Write the page of finished Results into the folder `out`; return the claims."""
    scores = results.scores
    tables = cells.wide(scores)
    linear = scores[
        (scores["form"] == SIX) & (scores["prediction"] == IMU) & scores["mode"].isin((UKF, PKF))
    ]
    claims = mollaei_claims.claims(
        rules.MollaeiEvidence(tables, linear[["seed", "mode", "apart_m"]])
    )
    runs = int(scores.groupby(["experiment", "form"])["seed"].nunique().max())
    known = claims if runs >= ENOUGH else [{**claim, "verdict": TOO_FEW} for claim in claims]
    outcome = Outcome(
        sentence(scores, components, seed),
        claims,
        choices_table(CHOICES, seeds=flights(scores), final=FINAL, **mollaei_runs.texts()),
        {"flights": (None, scores)},
        all_figures(results, tables),
        table_texts(tables, results),
        between=["", "Concordance of the paper:", "", concordance(entries(known))],
        runs=runs,
    )
    return write_study(out, WORK, outcome)


def sentence(scores: pd.DataFrame, components: int, seed: int) -> str:
    """The size of the study, in words."""
    return f"This page: {flights(scores)}; a PKF of {components} components, seed {seed}, strapdown {__version__}."


def flights(scores: pd.DataFrame) -> str:
    """Text: seeds by experiment and form."""
    counts = scores.groupby(["experiment", "form"], sort=False)["seed"].nunique()
    of = lambda form: ", ".join(
        f"{own} seed{'s' * (own != 1)} of {experiment}"
        for (experiment, each), own in counts.items()
        if each == form
    )
    return "; ".join(f"{form}: {of(form)}" for form in dict.fromkeys(scores["form"]))


def table_texts(
    tables: dict[FlightCase, pd.DataFrame], results: MollaeiResults
) -> list[tuple[str, str, pd.DataFrame]]:
    """[(name, heading, DataFrame of text)] of the tables for people."""
    left_out = {
        (f"left-out-{experiment.lower()}", f"Left out: {experiment}"): [
            *cells.of(tables, experiment)
        ]
        for experiment in cells.EXPERIMENTS
    }
    left_out[("full", "Filters with 15 states")] = [c for c in tables if c.form == FULL]
    left_out[("conditions", "Other conditions")] = [c for c in tables if c.condition]
    time = pd.DataFrame(
        [
            (mode, driven, f"{seconds:.2g}", "5400" if mode in (UKF, PKF) else "–")
            for (mode, driven), seconds in results.seconds.items()
        ],
        columns=["six states", "prediction", "s", "the paper, s"],
    )
    return [
        *(
            (
                f"redrawn-{experiment.lower()}",
                f"{cells.TABLE_OF[experiment]} redrawn ({experiment})",
                cells.redraw_table(tables, experiment),
            )
            for experiment in (E0, E1, E2)
        ),
        *((*named, cells.left_out(tables, own)) for named, own in left_out.items() if own),
        (
            "readings",
            "Readings of the EKF, of the PKF and of what is flown: ratios",
            rules.readings(tables),
        ),
        (
            "words",
            "Readings in a word: the paper's letter, its spirit, or charity",
            pd.DataFrame(WORDS, columns=["what is open", "reading", "in a word", "in the paper"]),
        ),
        (
            "contradictions",
            "Contradictions inside the published tables",
            contradictions(),
        ),
        (
            "not-judged",
            "Sentences without a rule, and why",
            pd.DataFrame(
                mollaei_claims.NOT_JUDGED, columns=["the paper says", "where", "why no rule"]
            ),
        ),
        ("time", "Time of one flight (E2)", time),
    ]
