"""The case studies of Fossen's chapter 14 on inertial navigation systems: its signals through its
filters, over seeds, and the verdicts on its claims.

Source: T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control" (2021), chapter
14, and its lecture slides; the numbers of the case study are those of the published scripts of the
Marine Systems Simulator.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from strapdown import __version__
from strapdown.fileio.files import replacing
from strapdown.typing import File

from ..common.concordance import concordance
from ..common.markdown import number
from ..common.reproduction import Asked, reproduction
from ..common.study import Outcome, StudyWork, choices_table, write_study
from . import (
    claims as fossen_claims,
    intro as fossen_intro,
    readings as fossen_readings,
    runs as fossen_runs,
    statements,
)
from .cases import CASES, FAST, LAST, FilterCase
from .choices import CHOICES
from .concordance import entries
from .figures import all_figures
from .flight_picture import PICTURE, draw_flight
from .runs import KEYS, FossenResults

SEEDS, QUICK_SEEDS = 50, 5
WORK = StudyWork(
    "Filters for aided inertial navigation: the case studies of Fossen's chapter 14 again",
    (
        "Chapter 14 of Fossen's Handbook of Marine Craft Hydrodynamics and Motion Control derives "
        "direct and indirect filters for aided "
        "inertial navigation, with "
        "an AHRS or with attitude among the states, and shows the multiplicative EKF on simulated "
        "signals. Its two published test signals are "
        "run here through "
        "all of these filters, with the published biases of 0.1, 0.3, -0.1 m/s² and 2.9, 5.7, -2.9 "
        "deg/s, over many seeds, besides a body at "
        "rest, in steady "
        "motion, one that swings its heading alone, and one that pitches through the vertical. The last "
        "section lists what the chapter leaves open.",
        "Each claim has a verdict that code has taken from the numbers, by the rule of its kind, which "
        'stands beside it. "Not reproduced" means: not under the assumptions stated here. A cell is a '
        "filter with its sensors, an excitation and a tuning; it supports a claim where more than half of "
        "its runs do, and contradicts it where fewer do (95 % intervals of Wilson's score). Of a claim "
        "with parts that must all hold: reproduced where all are, not reproduced where none is, partly "
        "where one is. What the chapter or its code leaves open, or prints in two ways, is read in every "
        "way: where one reading supports a claim and another contradicts it, the claim depends on the "
        "reading. The rules were written beside trials of seeds that are not in the study; none was "
        "changed for its verdict.",
    ),
    kind="chapter",
)
INTRO_COLUMNS = {
    "position_m": "position error, m",
    "ins_m": "of the INS, m",
    "bias_before": "accelerometer bias error before, m/s²",
    "bias_after": "after, m/s²",
}
"""Measures of the introductory example as they are called on the page."""
DROPOUT_COLUMNS = (
    "accel_before",
    "accel_after",
    "accel_left",
    "accel_model",
    "gyro_before",
    "gyro_after",
    "position_before_m",
    "position_after_m",
)
DROPOUT_LISTED = {
    "case": "filter",
    "excitation": "signal",
    "tuning": "tuning",
    "accel_before": "biases before, m/s²",
    "accel_after": "after, m/s²",
    "position_before_m": "position before, m",
    "position_after_m": "after, m",
}
"""Columns of the dropouts as they are called in findings.md."""


@reproduction("quick", "runs", "seed", "threads", "progress")
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run everything, write page, tables and claims.json into the folder `out`, and return the
    claims; quick: 5 seeds in place of 50, without the cases FAST. Raises DataError."""
    return make_outputs(out, asked, CASES + (() if asked.quick else FAST))


def make_outputs(
    out: File, asked: Asked, studied: Sequence[FilterCase], duration: float = fossen_runs.DURATION
) -> list[dict[str, Any]]:
    """As `reproduce`, with the Cases `studied`, each of `duration`, s."""
    seeds = asked.seeds(SEEDS, QUICK_SEEDS)
    results = fossen_runs.run_all(seeds, studied, duration, asked.progress, asked.threads)
    return write(out, results, len(seeds), asked.seed)


def write(out: File, results: FossenResults, count: int, seed: int) -> list[dict[str, Any]]:
    """Write the page of finished Results into the folder `out`; return the claims."""
    intro, kept = fossen_intro.study(count, seed)
    cells = fossen_runs.table(results.runs)
    beside = statements.all_tables(range(1000 * seed, 1000 * seed + count))
    evidence = fossen_claims.FossenEvidence(results.runs, results.dropouts, intro, beside)
    claims, readings = fossen_claims.claims(evidence), fossen_claims.by_reading(evidence)
    size = (
        f"This page: {count} seeds of each case, {len(results.runs) + len(results.dropouts)} runs "
        f"of {results.t[-1]:.0f} s at 100 Hz and more, "
        f"seed {seed}, strapdown {__version__}."
    )
    outcome = Outcome(
        size,
        claims,
        choices_table(CHOICES, "in the chapter and its code"),
        _tables(results, cells, intro) | _beside(beside, readings),
        all_figures(results, kept, beside[statements.FLIGHT]),
        notes=[("Readings, and one word for each", fossen_readings.points_table())],
        listed=[*listed_readings(readings), *list_tables(cells, results.dropouts)],
        between=["", "Concordance of the chapter:", "", concordance(entries(claims))],
        runs=count,
    )
    written = write_study(out, WORK, outcome)
    if len(beside[statements.FLIGHT]):
        with replacing(Path(out) / PICTURE) as part:
            part.write_text(draw_flight(beside[statements.FLIGHT]), encoding="utf-8")
    return written


def _tables(
    results: FossenResults, cells: pd.DataFrame, intro: pd.DataFrame
) -> dict[str, tuple[str | None, pd.DataFrame]]:
    about = (
        f"Times after which the biases have converged, median and 80 % of the runs; medians of rms "
        f"errors over the last "
        f"{LAST:g} s; and what is left at "
        "the end of the initial standard deviations of the biases along x, y, z"
    )
    found = {
        "cells": (about, fossen_runs.readable(cells)),
        "cells-all": (None, cells),
        "runs": (None, results.runs),
        "introduction": (
            "The introductory example: medians over the seeds",
            medians(intro, ["biases", "outage", "form"], INTRO_COLUMNS).rename(
                columns=INTRO_COLUMNS | {"outage": "dropout of 60 s"}
            ),
        ),
        "introduction-runs": (None, intro),
    }
    if len(results.dropouts):
        text = (
            f"Dropout of all fixes from {fossen_runs.DROPOUT[0]:g} s to the end, medians: "
            f"errors of the biases (m/s², "
            f"rad/s) before and after, what is left of "
            "the estimate of the accelerometers and what the model says, position errors"
        )
        found |= {
            "dropouts": (text, medians(results.dropouts, KEYS, DROPOUT_COLUMNS)),
            "dropouts-runs": (None, results.dropouts),
        }
    return found


def _beside(
    beside: statements.Tables, readings: pd.DataFrame
) -> dict[str, tuple[str | None, pd.DataFrame]]:
    """The readings of the claims, and the statements that no case study decides."""
    shown = {
        statements.STATIC: "The static attitude by an ideal accelerometer",
        statements.COST: "Time for a sample of MEKF and attitude observer, in pairs of runs",
    }
    said = {
        "readings": (
            "The claims in every reading; the word is that of the point furthest from the letter",
            readings,
        )
    }
    return said | {name: (shown.get(name), table) for name, table in beside.items()}


def listed_readings(readings: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """[(heading, DataFrame of text)] for findings.md: what is read how, and each claim in every
    reading."""
    return [
        ("Readings of what is left open, and one word for each", fossen_readings.points_table()),
        ("The claims in every reading", readings),
    ]


def medians(rows: pd.DataFrame, keys: Sequence[str], columns: Collection[str]) -> pd.DataFrame:
    """A row for each value of `keys`: medians of the `columns`."""
    return rows.groupby(list(keys), sort=False)[list(columns)].median().reset_index()


def list_tables(cells: pd.DataFrame, dropouts: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """[(heading, DataFrame of text)] for findings.md: a table per excitation, and the dropouts."""
    shown = fossen_runs.readable(cells)
    numbers = ["position, m", "velocity, m/s", "attitude, deg"]
    text = shown[
        ["case", "tuning", "accelerometer biases, s", "gyro biases, s", *numbers, "stopped"]
    ].rename(columns={"case": "filter and sensors", "stopped": "runs that stop"})
    text[numbers] = text[numbers].map(number)
    found = [
        (f"{excitation[0].upper()}{excitation[1:]}", part)
        for excitation, part in text.groupby(shown["excitation"], sort=False)
    ]
    if len(dropouts):
        own = medians(dropouts, KEYS, list(DROPOUT_LISTED)[len(KEYS) :])
        after = own["position_after_m"].map(lambda metres: number(metres, 3))
        text = own.set_index(list(KEYS)).map(number).reset_index().assign(position_after_m=after)
        found.append(
            (
                "Dropouts of all fixes, medians; errors of the accelerometer biases and of the "
                "position before and after",
                text.rename(columns=DROPOUT_LISTED),
            )
        )
    return found
