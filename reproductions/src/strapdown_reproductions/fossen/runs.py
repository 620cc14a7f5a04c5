"""All runs of the case studies: seeds on threads, a table with a row per run, curves for the
figures, and the dead reckoning of dropouts."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from strapdown.core.loop.contract import BA, BG, DECAYING
from strapdown.data.recording import Recording
from strapdown.typing import Array, Progress

from ..common.runner import on_threads
from . import cases, signals

Key: TypeAlias = tuple[str, str, str]
"""Case, excitation, tuning."""
KEYS = ("case", "excitation", "tuning")
"""Columns of a Key in the tables."""
DURATION = 300.0
FAST_SEEDS = 10
"""Seeds of the runs at 1 kHz, at most."""
DROPOUT = (180.0, 300.0)
"""s without any fix, to the end, in the runs of dead reckoning."""
DROPPED = (
    "mekf, position + field",
    "mekf as printed, position + gravity + field",
    "direct-ahrs, white-driven biases",
    "ahrs-indirect as printed",
    "indirect-ahrs-closed",
    "indirect-ahrs-open",
)
CURVE = 5
"""Every so many rows of a run are kept for the curves: 2 Hz."""
STEEP = (
    "mekf, position + compass",
    "mekf as printed, position + gravity + compass",
    "direct-euler, position + compass",
    *(case.name for case in cases.CASES if case.filter.startswith("euler-")),
)
"""Cases that also run through the vertical."""


MEDIANS = (*cases.RMS, "ins_m", "growth", "ins_growth")
"""Columns of a run, besides the times, of which a cell has the median."""


class FossenResults(NamedTuple):
    """Results of all runs."""

    runs: pd.DataFrame  # a row per run: case, excitation, tuning, seed, and fossen_cases.numbers
    # a row per run: case, excitation, tuning, seed, accel and gyro error before and after, share of
    # the estimate left
    dropouts: pd.DataFrame
    t: Array  # (m,) s, of the curves
    # (case, excitation, tuning) -> (2, seeds, m) lengths of the errors of accelerometer and gyro
    # bias; NaN where a run ended
    curves: dict[Key, NDArray[np.float32]]
    samples: dict[Key, cases.CaseRun]  # (case, excitation, tuning) -> Run of the first seed


def tasks(
    seeds: Sequence[int], studied: Sequence[cases.FilterCase] = cases.CASES + cases.FAST
) -> list[tuple[int, str, list[cases.FilterCase]]]:
    """[(seed, excitation, [cases])] in order: the cases with one truth."""
    found = []
    for seed, excitation in product(seeds, signals.EXCITATIONS):
        own = [
            case
            for case in studied
            if (excitation != "steep" or case.name in STEEP)
            and (case.rate <= 100 or (excitation in signals.SIGNALS and seed in seeds[:FAST_SEEDS]))
        ]
        if own:
            found.append((seed, excitation, own))
    return found


def run_all(
    seeds: Sequence[int],
    studied: Sequence[cases.FilterCase] = cases.CASES + cases.FAST,
    duration: float = DURATION,
    progress: Progress | None = None,
    threads: int | None = None,
) -> FossenResults:
    """Results over `seeds` (whole numbers). progress: called with the fraction done; threads: as
    many as there are processors by default."""
    wanted, rows, dropped, curves, samples = tasks(list(seeds), studied), [], [], {}, {}
    t = np.arange(round(duration * cases.ROWS / CURVE)) * CURVE / cases.ROWS + CURVE / cases.ROWS
    for excitation in signals.EXCITATIONS:  # before the threads, which would each compute it
        signals.ideal(excitation, 100.0, float(duration))
    of_task = lambda task: _seed(*task, duration)
    for task, (found, lost) in zip(wanted, on_threads(of_task, wanted, threads, progress)):
        for key, run in found:
            about = {**dict(zip(KEYS, key)), "seed": task[0]}
            rows.append(about | cases.numbers(run, duration))
            curves.setdefault(key, []).append(_curve(run, t))
            if task[0] == seeds[0]:
                samples[key] = run
        dropped += lost
    return FossenResults(
        pd.DataFrame(rows),
        pd.DataFrame(dropped),
        t,
        {key: np.stack(found, axis=1) for key, found in curves.items()},
        samples,
    )


def _seed(
    seed: int, excitation: str, studied: Sequence[cases.FilterCase], duration: float
) -> tuple[list[tuple[Key, cases.CaseRun]], list[dict[str, Any]]]:
    """([((case, excitation, tuning), Run)], rows of dropouts) of one seed on one excitation."""
    found, dropped, known = [], [], {}
    for case in studied:
        key = case.rate, case.interval
        if key not in known:
            known[key] = signals.recording(excitation, seed, case.rate, duration, case.interval)
        for tuning in case.tunings:
            found.append(
                (
                    (case.name, excitation, tuning),
                    cases.run(known[key], case, tuning, excitation, seed),
                )
            )
            if case.name in DROPPED and excitation in signals.MOVED and duration >= DROPOUT[1]:
                dropped.append(_dropout(known[key], case, tuning, excitation, seed))
    return found, dropped


def _dropout(
    recording: Recording, case: cases.FilterCase, tuning: str, excitation: str, seed: int
) -> dict[str, Any]:
    """Row of a run whose fixes all end where the dropout begins: errors and estimates of the
    biases there and at its end."""
    run = cases.run(
        recording.hidden([(DROPOUT[0], np.inf)], case.kinds), case, tuning, excitation, seed
    )
    about = dict(zip(KEYS, (case.name, excitation, tuning)))
    row = about | {"seed": seed, "stopped": bool(run.stopped)}
    if run.stopped or not len(run.t):
        return row
    before, after = (int(np.argmin(np.abs(run.t - at))) for at in DROPOUT)
    noise = cases.noise(case, tuning, excitation)
    decays = case.bias(tuning) == DECAYING
    for name, states, column, decay in (
        ("accel", BA, slice(0, 3), noise.accel_decay),
        ("gyro", BG, slice(3, 6), noise.gyro_decay),
    ):
        estimate = run.bias[:, column] - run.error[:, states]
        size = lambda k: float(np.linalg.norm(estimate[k]))
        row |= {
            f"{name}_before": float(run.size(states)[before]),
            f"{name}_after": float(run.size(states)[after]),
            f"{name}_left": size(after) / size(before),
            f"{name}_model": float(np.exp(-decays * decay * (run.t[after] - run.t[before]))),
        }
    return row | {
        "position_before_m": float(run.size(slice(0, 3))[before]),
        "position_after_m": float(run.size(slice(0, 3))[after]),
    }


def _curve(run: cases.CaseRun, t: Array) -> NDArray[np.float32]:
    """(2, m) lengths of the bias errors at times t."""
    curve = np.full((2, len(t)), np.nan, np.float32)
    rows = np.round(run.t * cases.ROWS / CURVE).astype(int)
    kept = np.abs(rows * CURVE / cases.ROWS - run.t) < 1e-6
    for i, states in enumerate((BA, BG)):
        place = rows[kept] - 1
        curve[i, place[place >= 0]] = run.size(states)[kept][place >= 0]
    return curve


def table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row per case, excitation and tuning: runs, share that stopped, quantiles of the times of
    convergence, medians of errors and shares."""
    cells = runs.groupby(list(KEYS), sort=False)
    times = {
        f"{name}{end}": cells[name].agg(lambda own, k=k: quantiles(own)[k])
        for name in ("accel_s", "gyro_s")
        for k, end in enumerate(("_low", "", "_high"))
    }
    middle = [*MEDIANS, *(name for name in runs if "_left_" in name)]
    medians = {name: cells[name].median() for name in middle}
    shares = {"runs": cells.size(), "stopped": cells["stopped"].mean()}
    return pd.DataFrame(shares | times | medians).reset_index()


def quantiles(values: pd.Series | Array) -> tuple[float, ...]:
    """10, 50 and 90 % of times of convergence: each is one of them, so that "never" stays what
    it is."""
    return tuple(
        float(value) for value in np.quantile(values, (0.1, 0.5, 0.9), method="inverted_cdf")
    )


def readable(cells: pd.DataFrame) -> pd.DataFrame:
    """The table of cells for people."""
    left = lambda row, name: " ".join(f"{row[f'{name}_left_{axis}']:.2g}" for axis in "xyz")
    each = lambda text, name: [text(row, name) for _, row in cells.iterrows()]
    return cells[list(KEYS)].assign(
        **{
            "stopped": cells["stopped"].map("{:.0%}".format),
            "accelerometer biases, s": each(span, "accel_s"),
            "gyro biases, s": each(span, "gyro_s"),
            "position, m": cells["position_m"],
            "velocity, m/s": cells["velocity_m_s"],
            "attitude, deg": np.degrees(cells["attitude_rad"]),
            "accelerometer bias, m/s²": cells["accel_m_s2"],
            "gyro bias, deg/s": np.degrees(cells["gyro_rad_s"]),
            "left of the accelerometers' deviations, x y z": each(left, "accel"),
            "left of the gyros', x y z": each(left, "gyro"),
        }
    )


def span(row: pd.Series, name: str) -> str:
    """Text of the median of a time of convergence and, where they differ, of the 10 and 90 %
    quantiles."""
    low, middle, high = (seconds(row[f"{name}{end}"]) for end in ("_low", "", "_high"))
    return middle if low == middle == high else f"{middle} ({low} to {high})"


def seconds(value: float) -> str:
    """Text of a time of convergence; a dash where nothing is estimated."""
    return (
        "–"
        if np.isnan(value)
        else "never"
        if not np.isfinite(value)
        else f"{value:.0f}"
        if value >= 10
        else f"{value:.1f}"
    )
