"""Open against closed loop: the study of Hager & Bryne on eleven flights with three IMU grades, its
figures and its claims.

Source: A. Hager and T. H. Bryne, "Closed-loop vs. open-loop Kalman filter architectures in airborne
aided inertial navigation".
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sim.scenario import Scenario, scenario
from strapdown.typing import File, Progress, Say

from ..common import markdown
from ..common.study import part_of, write_study
from ..common.verdicts import BETTER, RULE, interval
from . import (
    ablations as ablation,
    choices,
    claims as hager_bryne_claims,
    drift as hager_bryne_drift,
)
from .cells import table
from .figures import all_figures

FILTERS = (ablation.OPEN, ablation.CLOSED)
IMUS = ("paper1-consumer", "paper1-tactical", "paper1-navigation")
FLIGHTS = tuple(f"paper1-{number:02d}" for number in range(1, 12))
OFFSET_FLIGHTS, OFFSET = FLIGHTS[:7], (0.5, 0.5, 0.5)
"""Flights with the constant accelerometer offset, m/s^2 on each body axis."""
RUNS, QUICK_RUNS = 50, 5
TITLE = "Open or closed loop: the study of Hager & Bryne again"
INTRODUCTION = (
    "Hager & Bryne compare an open-loop (feed-forward) and a closed-loop (feedback) error-state "
    "Kalman filter in simulation: eleven flights "
    "of 5 to 95 minutes, three IMU grades, "
    "IMU and 1 m position fixes at 20 Hz. Their paths, initial uncertainties and one of their two "
    "abort rules are not published; the last "
    "section lists what was chosen instead.",
    "Below, each claim of the paper with a verdict that code has taken from the numbers, by a rule "
    'that stands beside it. "Not '
    'reproduced" means: not under the assumptions stated here. '
    "All comparisons are between runs on the same data; intervals are of 95 %.",
    f"How verdicts come about. Of two filters on a cell (a flight with a grade) {BETTER}. Over the "
    f"cells that a claim is about: {RULE}. Of a claim with parts that must "
    f"all hold: reproduced where all are, not reproduced where none is, partly where one is. "
    f"Where the two readings of the abort rule "
    "give opposite verdicts, what the paper leaves open decides, and the claim is not decidable "
    "here; otherwise the less favourable reading "
    "counts. The rules were written beside "
    "a trial of five runs with another seed, before the full study was run, and none was changed "
    "for its verdict. "
    "The second reading of the accelerometer offset, as initial value of the bias process, was "
    "added after the first full study, when a check had shown that a "
    "constant offset contradicts the filters' model of a bias that decays.",
)


def studies(
    quick: bool = False,
    ablations: bool = False,
    runs: int | None = None,
    seed: int = 2,
    flights: Sequence[str | Scenario] = FLIGHTS,
    offset_flights: Sequence[str | Scenario] = OFFSET_FLIGHTS,
    imus: tuple[str | ImuSpec, ...] = IMUS,
) -> dict[str, Study]:
    """{name: Study} of what is run; `flights` and `offset_flights` are Scenario values or names.
    Raises DataError."""
    count = (QUICK_RUNS if quick else RUNS) if runs is None else runs
    moved = lambda ending, decays: tuple(
        s.replace(name=f"{s.name}-{ending}", accel_offset=OFFSET, offset_decays=decays)
        for s in map(scenario, offset_flights)
    )
    found = {
        "flights": Study(tuple(map(scenario, flights)), FILTERS, imus, count, seed),
        "offset": Study(moved("offset", False), FILTERS, imus, count, seed),
        "initial": Study(moved("initial", True), FILTERS, imus, count, seed),
    }
    if ablations:
        chosen = [f"paper1-{number}" for number in ablation.FLIGHTS]
        found |= {
            f"ablation-{name}": study
            for name, study in ablation.studies(chosen, count, seed).items()
        }
    return found


def reproduce(
    out: File,
    quick: bool = False,
    ablations: bool = False,
    runs: int | None = None,
    seed: int = 2,
    threads: int | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    say: Say | None = None,
    progress: Progress | None = None,
) -> list[dict[str, str]]:
    """Run what is missing of the study in DIR/campaign, write the page into the folder `out`, and
    return the claims.

    quick: 5 runs in place of 50; ablations: also the variants of ablations.py; threads,
    workers, scheduler, say, progress: as in Study.run, progress over all studies. An interrupted
    call goes on where it was. Raises DataError.
    """
    return made(
        out, studies(quick, ablations, runs, seed), threads, workers, scheduler, say, progress
    )


def made(
    out: File,
    wanted: dict[str, Study],
    threads: int | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    say: Say | None = None,
    progress: Progress | None = None,
) -> list[dict[str, str]]:
    """As `reproduce`, of given studies: "flights", "offset" and "initial", and perhaps those of
    the ablations."""
    out = Path(out)
    campaigns, done, total = {}, 0, sum(study.steps() for study in wanted.values())
    if say:
        say(
            f"{total / 1e6:.3g} million filter steps in {len(wanted)} studies: "
            f"{', '.join(f'{name} {study.steps() / 1e6:.3g}' for name, study in wanted.items())}"
        )
    for name, study in wanted.items():
        end = done + study.steps()
        part = part_of(progress, done / total, end / total)
        campaigns[name] = study.run(out / "campaign" / name, threads, workers, scheduler, say, part)
        done = end
    return write(out, campaigns, threads)


def write(
    out: File, campaigns: dict[str, Campaign], threads: int | None = None
) -> list[dict[str, str]]:
    """Write page, tables and claims.json of finished campaigns into the folder `out`; return the
    claims."""
    flights = campaigns["flights"]
    cells, moved, initial = (table(campaigns[name]) for name in ("flights", "offset", "initial"))
    drift, bins = hager_bryne_drift.measure(flights, threads)
    own = {
        name.removeprefix("ablation-"): campaign
        for name, campaign in campaigns.items()
        if name.startswith("ablation-")
    }
    ablated, resets = ablation.tables(own) if own else ({}, None)
    claims = hager_bryne_claims.claims(
        hager_bryne_claims.Evidence(cells, moved, drift, initial, resets)
    )
    said = [
        f"- {name.removeprefix('ablation-')}: {markdown.plain(caption)}"
        for name, (caption, _) in ablated.items()
    ]
    return write_study(
        out,
        TITLE,
        INTRODUCTION,
        _size(campaigns),
        claims,
        choices.table(),
        _tables(cells, moved, initial, drift, bins) | {"bound": _bound(flights)} | ablated,
        all_figures(campaigns, cells, moved, initial, bins, flights.study.scenarios),
        listed=[
            ("Without offset", by_flight(cells)),
            ("With a constant accelerometer offset of 0.5 m/s² on each axis", by_flight(moved)),
            ("With 0.5 m/s² as initial value of the bias process", by_flight(initial)),
        ],
        between=["", "Ablations, on flights 01, 07 and 10:", "", *said] if said else (),
        runs=int(flights.manifest["runs"]),
    )


def _size(campaigns: dict[str, Campaign]) -> str:
    first = campaigns["flights"].manifest
    return (
        f"This page: {first['runs']} runs of each flight and grade, seed {first['seed']}, "
        f"{sum(c.study.steps() for c in campaigns.values()) / 1e6:.3g} million filter steps, "
        f"strapdown {first['versions']['strapdown']}; filters {' and '.join(first['filters'])}."
    )


def _tables(
    cells: pd.DataFrame,
    moved: pd.DataFrame,
    initial: pd.DataFrame,
    drift: pd.DataFrame,
    bins: pd.DataFrame,
) -> dict[str, tuple[str | None, pd.DataFrame]]:
    about = (
        "{}, open and closed loop: share of runs that survive both abort rules, the same where a "
        "raw INS that left its model counts as "
        "lost, the 500 m rule alone; position RMSE of "
        "survivors and, with each epoch after an abort counted as 500 m, of all runs; typical "
        "NEES/15; and by how much RMSEs of the "
        "open loop differ from those of the closed one, by "
        "the 500 m rule"
    )
    return {
        "flights": (about.format("Without offset"), readable(cells)),
        "offset": (
            about.format("With a constant accelerometer offset of 0.5 m/s^2 on each axis"),
            readable(moved),
        ),
        "initial": (
            about.format(
                "With 0.5 m/s^2 on each axis as initial value of the accelerometers' bias process, "
                "which decays"
            ),
            readable(initial),
        ),
        "flights-all": (None, cells),
        "offset-all": (None, moved),
        "initial-all": (None, initial),
        "drift": (
            "Open by closed loop against the drift of the raw INS, medians and quartiles over "
            "stored epochs",
            bins,
        ),
        "drift-runs": (None, drift),
    }


def _bound(flights: Campaign) -> tuple[str, pd.DataFrame]:
    """The closed loop against the Cramer-Rao bound after 120 s, per flight and grade."""
    columns = {
        "scenario": "flight",
        "imu": "IMU",
        "survived": "survived",
        "settled_rmse_m": "position RMSE, m",
        "bound_m": "bound, m",
        "bound_ratio": "ratio",
    }
    rows = flights.summary[flights.summary["filter"] == ablation.CLOSED]
    return (
        "Closed loop against the Cramér-Rao bound of a filter told this P0: time-averaged "
        "position RMSE after 120 s",
        rows[list(columns)].rename(columns=columns),
    )


def readable(cells: pd.DataFrame) -> pd.DataFrame:
    """The table of cells for people: shares, RMSE and NEES of both filters side by side, and the
    ratios with their intervals."""
    columns = {
        "survived": "survived",
        "survived_in_model": "survived in model",
        "survived_500": "survived 500 m rule",
        "rmse_m": "RMSE of survivors, m",
        "censored_m": "RMSE of all, m",
        "censored_500_m": "RMSE of all by the 500 m rule, m",
        "anees": "NEES/15",
    }
    return pd.DataFrame(
        {
            "flight": cells["flight"],
            "grade": cells["grade"],
            **{
                f"{name}, {loop}": cells[f"{loop}_{column}"]
                for column, name in columns.items()
                for loop in ("open", "closed")
            },
            **{
                f"{name}, open against closed": _intervals(cells, column)
                for name, column in (
                    ("position", "position_500"),
                    ("tilt", "tilt"),
                    ("heading", "heading"),
                )
            },
        }
    )


def _intervals(cells: pd.DataFrame, name: str) -> list[str]:
    return [interval(row, name) for _, row in cells.iterrows()]


def by_flight(cells: pd.DataFrame) -> pd.DataFrame:
    """The table of cells for docs/open-or-closed-loop.md, as text: a row per grade and flight."""
    rows = cells.sort_values(["grade", "flight"])
    columns = (
        ("grade", "grade", "{}"),
        ("flight", "flight", "{}"),
        ("min", "minutes", "{:.0f}"),
        ("survived, open", "open_survived", "{:.0%}"),
        ("closed", "closed_survived", "{:.0%}"),
        ("by the 500 m rule, open", "open_survived_500", "{:.0%}"),
        ("closed", "closed_survived_500", "{:.0%}"),
        ("RMSE open, m", "open_censored_500_m", "{:.3g}"),
        ("closed, m", "closed_censored_500_m", "{:.3g}"),
        ("open against closed", "ratio", "{}"),
        ("NEES/15 open", "open_anees", "{:.3g}"),
        ("closed", "closed_anees", "{:.3g}"),
    )
    rows = rows.assign(ratio=_intervals(rows, "position_500"))
    return pd.DataFrame(
        [[form.format(row[column]) for _, column, form in columns] for _, row in rows.iterrows()],
        columns=[name for name, _, _ in columns],
    )
