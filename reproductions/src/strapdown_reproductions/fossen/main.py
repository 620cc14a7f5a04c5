"""The case studies of Fossen's chapter 14 on inertial navigation systems: its signals through its
filters, over seeds, and what becomes of its claims.

Source: T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control" (2021), chapter
14, and its lecture slides; the numbers of the case study are those of the published scripts of the
Marine Systems Simulator.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from strapdown import __version__
from strapdown.checks import DataError
from strapdown.files import replacing
from strapdown.typing import File, Progress

from ..common.pages import write_page
from . import (
    choices,
    claims as fossen_claims,
    intro as fossen_intro,
    runs as fossen_runs,
    write_docs,
)
from .cases import CASES, FAST, LAST, Case
from .figures import all_figures
from .runs import Results

SEEDS, QUICK_SEEDS = 50, 5
TITLE = "Filters for aided inertial navigation: the case studies of Fossen's chapter 14 again"
INTRODUCTION = (
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
    "Each claim has a verdict that code has taken from the numbers, by a rule that stands beside "
    'it. "Not reproduced" means: not under '
    "the assumptions stated "
    "here. A cell is a filter with its sensors, an excitation and a tuning; it supports a claim "
    "where more than half of its runs do, and "
    "contradicts it where fewer do "
    "(95 % intervals of Wilson's score). Over the cells of a claim: reproduced where 75 % or more "
    "support it, not reproduced where not "
    "even with all "
    "undecided ones more than 25 % would, partly where more than 25 % do, else not decidable. Of a "
    "claim with parts that must all hold: "
    "reproduced where all are, not "
    "reproduced where none is, partly where one is. The rules were written beside trials of seeds "
    "that are not in the study; none was "
    "changed for its verdict.",
)


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 2,
    threads: int | None = None,
    progress: Progress | None = None,
    studied: Sequence[Case] | None = None,
    duration: float = fossen_runs.DURATION,
) -> list[dict[str, str]]:
    """Run everything, write page, tables and claims.json into the folder `out`, and return the
    claims.

    quick: 5 seeds in place of 50; runs: another number; seed: from which theirs are made, 0 or
    more; threads: the processors by default; progress: called with the fraction done; studied:
    Cases in place of all; duration: s. Raises DataError.
    """
    count = (QUICK_SEEDS if quick else SEEDS) if runs is None else runs
    if count < 1 or seed < 0:
        raise DataError(f"runs is {count} and seed {seed}; give one run or more, and a seed from 0")
    fast = () if quick else FAST
    seeds = [1000 * seed + k for k in range(count)]
    results = fossen_runs.run_all(
        seeds, CASES + fast if studied is None else studied, duration, progress, threads
    )
    return write(out, results, count, seed)


def write(out: File, results: Results, count: int, seed: int) -> list[dict[str, str]]:
    """Write the page of finished Results into the folder `out`; return the claims."""
    intro, kept = fossen_intro.study(count, seed)
    cells = fossen_runs.table(results.runs)
    claims = fossen_claims.claims(fossen_claims.Evidence(results.runs, results.dropouts, intro))
    size = (
        f"This page: {count} seeds of each case, {len(results.runs) + len(results.dropouts)} runs "
        f"of {results.t[-1]:.0f} s at 100 Hz and more, "
        f"seed {seed}, strapdown {__version__}."
    )
    out = Path(out)
    write_page(
        out,
        TITLE,
        (*INTRODUCTION, size),
        claims,
        _tables(results, cells, intro),
        figures=all_figures(results, kept),
        notes=[("What the chapter leaves open, and what was chosen", choices.table())],
    )
    with replacing(out / "findings.md") as part:
        part.write_text(
            write_docs.findings(size, claims, cells, results.dropouts), encoding="utf-8"
        )
    return claims


def _tables(
    results: Results, cells: pd.DataFrame, intro: pd.DataFrame
) -> dict[str, tuple[str | None, pd.DataFrame]]:
    about = (
        f"Times after which the biases have converged, median and 80 % of the runs; medians of rms "
        f"errors over the last "
        f"{LAST:g} s; and what is left at "
        "the end of the initial standard deviations of the biases along x, y, z"
    )
    means = ["position_m", "ins_m", "bias_before", "bias_after"]
    short = (
        intro.groupby(["biases", "outage", "form"], sort=False)[means]
        .median()
        .reset_index()
        .rename(
            columns={
                "outage": "dropout of 60 s",
                "position_m": "position error, m",
                "ins_m": "of the INS, m",
                "bias_before": "accelerometer bias error before, m/s²",
                "bias_after": "after, m/s²",
            }
        )
    )
    found = {
        "cells": (about, fossen_runs.readable(cells)),
        "cells-all": (None, cells),
        "runs": (None, results.runs),
        "introduction": ("The introductory example: medians over the seeds", short),
        "introduction-runs": (None, intro),
    }
    if len(results.dropouts):
        keys = ["case", "excitation", "tuning"]
        shown = (
            results.dropouts.groupby(keys, sort=False)[
                [
                    "accel_before",
                    "accel_after",
                    "accel_left",
                    "accel_model",
                    "gyro_before",
                    "gyro_after",
                    "position_before_m",
                    "position_after_m",
                ]
            ]
            .median()
            .reset_index()
        )
        found |= {
            "dropouts": (
                f"Dropout of all fixes from {fossen_runs.DROPOUT[0]:g} s to the end, medians: "
                f"errors of the biases (m/s², "
                f"rad/s) before and after, what is left of "
                "the estimate of the accelerometers and what the model says, position errors",
                shown,
            ),
            "dropouts-runs": (None, results.dropouts),
        }
    return found
