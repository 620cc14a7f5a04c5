"""Estimates of biases that decay against those that are held, over the length of an outage and the
true time constant of the biases: `strapdown reproduce bias-decay`."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from strapdown.core.loop.contract import DECAYING, HELD
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.evaluation.metrics import errors
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sim.synthesis import draw_start, simulate
from strapdown.typing import Array

from ..common.reproduction import Asked, reproduction
from ..common.runner import StudyTables, Task, collect_tables
from ..common.study import ReproducedStudy, held_against
from ..common.tables import Tables, group_rows
from ..common.targets import Target, in_docs
from .law import boundary, held_is_better

SEEDS, QUICK_SEEDS = 40, 3
ASSUMED = 100.0
"""s: time constant that the filter assumes; what counts is the ratio to it."""
LARGE = 6.0
TRUE = (*((time, 1.0) for time in (25.0, 50.0, 100.0, 200.0, 400.0, np.inf)), (np.inf, LARGE))
"""Time constants of the simulated biases, s (inf: constant), and their standard deviations over those
that the filter assumes; LARGE is about that of Fossen's case study."""
Cell: TypeAlias = tuple[float, float, float]
"""True time constant (s), size, length of the outage (s)."""
LENGTHS = (10.0, 30.0, 100.0, 300.0)
"""s of the outages."""
AIDED = 200.0
"""s with fixes before."""
RATE = 50.0
"""Hz of the IMU."""
ACCEL, GYRO = 0.05, 2e-5
"""m/s^2 and rad/s: standard deviations of the biases. That of the gyros is small, so that the law, which
is one of accelerometers, is what is measured."""
FILTER = "closed-loop"
RESAMPLED, FEWEST = 2000, 10
"""Draws of seeds with replacement behind an interval, and seeds below which there is none."""
RUNS = "runs"
"""The table of the Evidence."""
INTRODUCTION = (
    "A filter that takes a bias for a Gauss-Markov process can let its estimate decay between fixes, "
    "as the mean of such a process does, or hold it and let the covariance alone go back to that of "
    "the process (`bias=decaying` and `bias=held`). Decaying is optimal where the time constant is "
    "right. Here it is stated wrong.",
    f"Each run is {AIDED:g} s with a position and a velocity a second and then an outage. The filter, "
    f"{FILTER}, assumes {ASSUMED:g} s and the right standard deviation of the biases, but for the last row, "
    f"whose biases are {LARGE:g} times as large. Ratios are of rms "
    "horizontal errors at the end of the outage over all runs, held over decaying: below 1 held "
    "estimates are better.",
)
TARGETS = {
    "agree": Target(
        "cells with a 95 % interval off 1 in which the closed form names the better one", ">=", 0.9
    ),
    "right": Target(
        "cells with the right time constant in which held estimates are better for sure", "<=", 0.0
    ),
}


def spec(time: float, size: float = 1.0) -> ImuSpec:
    """An IMU whose biases have that time constant, s (inf: constant ones), and `size` times ACCEL and
    GYRO."""

    def triad(noise: float, one: float) -> Triad:
        if np.isinf(time):
            return Triad(noise=noise, turn_on_bias=size * one)
        return Triad(noise=noise, gauss_markov=size * one, time_constant=time)

    return ImuSpec(f"biases of {time:g} s", triad(1e-5, GYRO), triad(1e-3, ACCEL))


def record_flight(cell: Cell, seed: int) -> Recording:
    """The flight of a cell, whose fixes end with the beginning of the outage."""
    time, size, length = cell
    made = simulate(
        "demo",
        AIDED + length,
        spec(time, size),
        seed,
        RATE,
        Gnss(1.0, (0.5,) * 3, (0.05,) * 3),
    )
    return made.hidden([(AIDED, np.inf)], ("position", "velocity"))


def off(solution: Solution, recording: Recording) -> float:
    """Horizontal error at the end, m."""
    found = errors(solution, recording.reference)
    return float(np.hypot(*found.position[-1, :2]))


def rows(cell: Cell, seeds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """A row per seed of a cell; the start has the right standard deviations."""
    time, size, length = cell
    biases = [size * ACCEL] * 3 + [size * GYRO] * 3
    std = np.r_[[0.5] * 3, [0.05] * 3, np.radians([0.1, 0.1, 0.3]), biases]
    for seed in seeds:
        recording = record_flight(cell, seed)
        start = draw_start(recording.reference, std, np.random.default_rng([seed, 5]))
        run = partial(fuse, recording, FILTER, noise=spec(ASSUMED).noise(), start=start, every=50)
        yield {
            "true_s": time,
            "size": size,
            "outage_s": length,
            "seed": seed,
            "decaying_m": off(run(options={"bias": DECAYING}), recording),
            "held_m": off(run(options={"bias": HELD}), recording),
        }


def table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per cell: rms errors, their ratio with its 95 % interval over the seeds, what the closed
    form predicts."""
    cells = group_rows(runs, ["true_s", "size", "outage_s"], measures)
    better = map(held_is_better, cells["true_s"], [ASSUMED] * len(cells), cells["outage_s"])
    return cells.assign(predicted=[HELD if held else DECAYING for held in better])


def measures(runs: pd.DataFrame) -> dict[str, float]:
    """rms errors of the runs of a cell, and their ratio with its interval."""
    squares = runs[["decaying_m", "held_m"]].to_numpy() ** 2
    decaying, held = np.sqrt(squares.mean(axis=0))
    low, high = interval(squares)
    return {
        "decaying_m": decaying,
        "held_m": held,
        "ratio": held / decaying,
        "ratio_low": low,
        "ratio_high": high,
    }


def interval(squares: Array) -> tuple[float, float]:
    """95 % interval of the ratio of rms errors, the second over the first; squares (n, 2) of the seeds;
    NaN of less than FEWEST."""
    n = len(squares)
    if n < FEWEST:
        return np.nan, np.nan
    drawn = np.random.default_rng(1).integers(n, size=(RESAMPLED, n))
    sums = squares[drawn].sum(axis=1)
    low, high = np.quantile(np.sqrt(sums[:, 1] / sums[:, 0]), (0.025, 0.975))
    return float(low), float(high)


def readable(cells: pd.DataFrame) -> pd.DataFrame:
    """Ratios: a row per true time constant, over the assumed one, a column per length."""
    shown = cells.assign(
        **{
            "true over assumed": [_cell_label(*row) for row in zip(cells["true_s"], cells["size"])],
            "outage": [f"outage of {length / ASSUMED:g}" for length in cells["outage_s"]],
        }
    )
    wide = shown.pivot(index="true over assumed", columns="outage", values="ratio")
    return wide.loc[
        list(dict.fromkeys(shown["true over assumed"])), list(dict.fromkeys(shown["outage"]))
    ].reset_index()


def _cell_label(time: float, size: float) -> str:
    named = "constant" if np.isinf(time) else f"{time / ASSUMED:g}"
    return named if size == 1 else f"{named}, {size:g} deviations"


def boundaries() -> pd.DataFrame:
    """From which true time constant on held estimates are better, by the closed form."""
    lengths = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
    return pd.DataFrame(
        {
            "outage over assumed": [f"{length:g}" for length in lengths],
            "held from true over assumed": [boundary(length) for length in lengths],
            "held from true over outage": [boundary(length) / length for length in lengths],
        }
    )


def figures(found: StudyTables) -> dict[str, float]:
    """The figures of TARGETS; NaN where no cell has an interval."""
    cells = table(found[RUNS])
    if cells["ratio_low"].isna().all():
        return dict.fromkeys(TARGETS, np.nan)
    held, decaying = cells["ratio_high"] < 1, cells["ratio_low"] > 1
    agree = held[held | decaying] == (cells["predicted"] == HELD)[held | decaying]
    return {
        "agree": float(agree.mean()),
        "right": float((held & (cells["true_s"] == ASSUMED)).sum()),
    }


def tables(found: StudyTables) -> Tables:
    """{name: (caption, DataFrame)}."""
    cells = table(found[RUNS])
    return {
        "ratios": ("Error of held over that of decaying estimates", readable(cells)),
        "boundaries": ("From where on to hold, by the closed form", boundaries()),
        "cells": ("All cells", cells),
    }


STUDY = ReproducedStudy(
    "When the estimate of a bias should decay",
    INTRODUCTION,
    held_against(TARGETS, figures),
    tables,
    stored=(RUNS,),
    texts=lambda found, claims, tables: {
        "table.md": in_docs(claims, {name: tables[name] for name in ("ratios", "boundaries")})
    },
)


@reproduction("quick", "runs", "seed", "workers", "progress", usual=Asked(seed=3))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run all cells, write the page into the folder `out`, return the claims; quick: 3 seeds in place
    of 40. Raises DataError."""
    seeds = asked.seeds(SEEDS, QUICK_SEEDS)
    tasks = [Task(RUNS, rows, ((*true, length), seeds)) for true in TRUE for length in LENGTHS]
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))
