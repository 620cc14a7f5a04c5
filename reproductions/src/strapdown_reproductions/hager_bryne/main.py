"""Open against closed loop: the study of Hager & Bryne on eleven flights with three IMU grades, its
figures and its claims.

Source: A. Hager and T. H. Bryne, "Closed-loop vs. open-loop Kalman filter architectures in airborne
aided inertial navigation".
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sim.scenario import Scenario, scenario
from strapdown.typing import File

from ..common import markdown
from ..common.reproduction import USUAL, Asked, reproduction
from ..common.runner import campaigns
from ..common.study import Outcome, StudyWork, choices_table, write_study
from ..common.verdicts import BETTER, interval
from . import (
    ablations as ablation,
    claims as hager_bryne_claims,
    drift as hager_bryne_drift,
    printed_updates,
)
from .cells import tables
from .choices import CHOICES
from .figures import all_figures
from .rules import EXACT, TENTH, UPDATES, UPDATES_AND_STARTS, HagerBryneEvidence

FILTERS = (ablation.OPEN, ablation.CLOSED)
AS_PRINTED = tuple(
    ablation.variant(printed_updates.CLOSED_LOOP.name, reading=reading)
    for reading in printed_updates.READINGS
)
"""The closed loop by the readings UPDATES."""
STARTS = {"start-tenth": (TENTH, 0.1), "start-exact": (EXACT, 0.0)}
"""{study: (reading, factor on the start's attitude error)} of the last grade."""
IMUS = ("paper1-consumer", "paper1-tactical", "paper1-navigation")
FLIGHTS = tuple(f"paper1-{number:02d}" for number in range(1, 12))
OFFSET_FLIGHTS, OFFSET = FLIGHTS[:7], (0.5, 0.5, 0.5)
"""Flights with the constant accelerometer offset, m/s^2 on each body axis."""
START_FLIGHTS = (*FLIGHTS[:7], FLIGHTS[9])
"""Flights with other starts: all that a claim about short ones needs, and one of 90 minutes."""
RUNS, QUICK_RUNS = 50, 5
WORK = StudyWork(
    "Open or closed loop: the study of Hager & Bryne again",
    (
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
        f"How verdicts come about. Of two filters on a cell (a flight with a grade) {BETTER}. Each claim "
        "is of a kind - what is said to be always so falls with one cell that speaks against it, what is "
        "mostly so does not - and the rule of its kind stands beside it. Of a claim with parts that must "
        "all hold: reproduced where all are, not reproduced where none is, partly where one is.",
        "What the paper leaves open or prints in a way that cannot be meant is read in several ways: the "
        "abort rule, the accelerometer offset, the error of the start, the update (15) and the prediction "
        "(19) after a reset. Opposite verdicts by two readings mean that the verdict depends on the "
        "reading; otherwise the least favourable one counts. The row says what each reading gives.",
    ),
)


class Flown(NamedTuple):
    """The flights and grades of the studies; flights are Scenario values or names."""

    flights: Sequence[str | Scenario] = FLIGHTS
    with_offset: Sequence[str | Scenario] = OFFSET_FLIGHTS
    with_other_starts: Sequence[str | Scenario] = START_FLIGHTS
    # grades, the best of them last, which alone flies `with_other_starts`
    imus: tuple[str | ImuSpec, ...] = IMUS


OF_PAPER = Flown()


def studies(asked: Asked = USUAL, flown: Flown = OF_PAPER) -> dict[str, Study]:
    """{name: Study} of what is run. Raises DataError."""
    printed_updates.make_known()
    count, seed, imus = asked.wanted(RUNS, QUICK_RUNS), asked.seed, flown.imus
    moved = lambda ending, decays: tuple(
        s.replace(name=f"{s.name}-{ending}", accel_offset=OFFSET, offset_decays=decays)
        for s in map(scenario, flown.with_offset)
    )
    aligned = lambda factor: tuple(
        s.replace(
            start_sd=(*s.start_sd[:6], *(factor * sd for sd in s.start_sd[6:9]), *s.start_sd[9:])
        )
        for s in map(scenario, flown.with_other_starts)
    )
    found = {
        "flights": Study(
            tuple(map(scenario, flown.flights)), (*FILTERS, *AS_PRINTED), imus, count, seed
        ),
        "offset": Study(moved("offset", False), FILTERS, imus, count, seed),
        "initial": Study(moved("initial", True), FILTERS, imus, count, seed),
        **{
            name: Study(aligned(factor), (*FILTERS, AS_PRINTED[0]), imus[-1:], count, seed)
            for name, (_, factor) in STARTS.items()
        },
    }
    if asked.ablations:
        chosen = [f"paper1-{number}" for number in ablation.FLIGHTS]
        found |= {
            f"ablation-{name}": study
            for name, study in ablation.studies(chosen, count, seed).items()
        }
    return found


@reproduction(
    "quick", "ablations", "runs", "seed", "threads", "workers", "scheduler", "say", "progress"
)
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run what is missing of the study in DIR/campaign, write the page into the folder `out`, and
    return the claims.

    quick: 5 runs in place of 50; ablations: also the variants of ablations.py; threads, workers,
    scheduler, say: as in Study.run. An interrupted call goes on where it was. Raises DataError.
    """
    return made(out, studies(asked), asked)


def made(out: File, wanted: dict[str, Study], asked: Asked = USUAL) -> list[dict[str, Any]]:
    """As `reproduce`, of given studies: "flights", "offset", "initial" and STARTS, and perhaps
    those of the ablations."""
    out = Path(out)
    if asked.say:
        steps = {name: study.steps() / 1e6 for name, study in wanted.items()}
        each = ", ".join(f"{name} {million:.3g}" for name, million in steps.items())
        asked.say(
            f"{sum(steps.values()):.3g} million filter steps in {len(wanted)} studies: {each}"
        )
    found = campaigns(
        wanted,
        lambda name: out / "campaign" / name,
        asked.progress,
        threads=asked.threads,
        workers=asked.workers,
        scheduler=asked.scheduler,
        say=asked.say,
    )
    return write(out, found, asked.threads)


def write(
    out: File, campaigns: dict[str, Campaign], threads: int | None = None
) -> list[dict[str, Any]]:
    """Write page, tables and claims.json of finished campaigns into the folder `out`; return the
    claims."""
    flights = campaigns["flights"]
    (cells, *printed), (moved,), (initial,) = (
        tables(campaigns[name]) for name in ("flights", "offset", "initial")
    )
    readings = dict(zip(UPDATES, printed)) | of_starts(campaigns, cells, printed[0])
    drift, bins = hager_bryne_drift.measure(flights, threads)
    own = {
        name.removeprefix("ablation-"): campaign
        for name, campaign in campaigns.items()
        if name.startswith("ablation-")
    }
    ablated, resets = ablation.tables(own) if own else ({}, None)
    claims = hager_bryne_claims.claims(
        HagerBryneEvidence(cells, moved, drift, initial, resets, readings)
    )
    said = [
        f"- {name.removeprefix('ablation-')}: {markdown.plain(caption)}"
        for name, (caption, _) in ablated.items()
    ]
    outcome = Outcome(
        _size(campaigns),
        claims,
        choices_table(CHOICES),
        _tables(cells, moved, initial, drift, bins)
        | {"readings": (READ, in_readings(cells, readings)), "bound": _bound(flights)}
        | {f"readings-all-{i}": (None, own) for i, own in enumerate(readings.values(), 1)}
        | ablated,
        all_figures(campaigns, cells, readings, moved, initial, bins, flights.study.scenarios),
        listed=[
            ("Without offset", by_flight(cells)),
            ("With a constant accelerometer offset of 0.5 m/s² on each axis", by_flight(moved)),
            ("With 0.5 m/s² as initial value of the bias process", by_flight(initial)),
            (READ, in_readings(cells, readings)),
        ],
        between=["", "Ablations, on flights 01, 07 and 10:", "", *said] if said else (),
        runs=int(flights.manifest["runs"]),
    )
    return write_study(out, WORK, outcome)


def of_starts(
    campaigns: dict[str, Campaign], cells: pd.DataFrame, printed: pd.DataFrame
) -> dict[str, pd.DataFrame]:
    """{reading: table of cells} with the rows of the best grade from the studies STARTS, with the
    corrected loop and with the update as printed."""
    found = {}
    for (name, (start, _)), both in zip(STARTS.items(), UPDATES_AND_STARTS):
        for reading, whole, own in zip((start, both), (cells, printed), tables(campaigns[name])):
            others = whole[~whole["grade"].isin(own["grade"])]
            found[reading] = pd.concat([others, own], ignore_index=True)
    return found


LOOPS_READ = ("open", "closed", "(15) as printed", "(19) zero")
READ = (
    "By the readings of the closed loop and, at the best grade, of the start: "
    f"{', '.join(LOOPS_READ)}, separated by strokes; all runs, position RMSE by the 500 m rule alone, "
    "heading RMSE after 120 s while open and closed loop are within 500 m, typical NEES/15, share of "
    "runs that survive both abort rules and the 500 m rule alone"
)


def in_readings(cells: pd.DataFrame, readings: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """The open loop and the closed loop's readings side by side, as text: a row per grade, start
    and flight."""
    columns = (
        ("position RMSE, m", "censored_500_m", "{:.3g}"),
        ("heading RMSE, deg", "heading_500_deg", "{:.2g}"),
        ("NEES/15", "anees", "{:.3g}"),
        ("survived", "survived", "{:.0%}"),
        ("by the 500 m rule", "survived_500", "{:.0%}"),
    )
    starts = [("as chosen", cells, [readings[name] for name in UPDATES])] + [
        (start, readings[start], [readings[both]])
        for (start, _), both in zip(STARTS.values(), UPDATES_AND_STARTS)
    ]
    rows = []
    for start, corrected, printed in starts:
        best = corrected["grade"] == corrected["grade"].iloc[-1]
        for place in corrected.index[best | (start == "as chosen")]:
            row = corrected.loc[place]
            of_loops = [
                ("open", row),
                *(("closed", each.loc[place]) for each in (corrected, *printed)),
            ]
            rows.append(
                [row["grade"], start, row["flight"]]
                + [
                    " / ".join(form.format(own[f"{loop}_{name}"]) for loop, own in of_loops)
                    for _, name, form in columns
                ]
            )
    names = ["grade", "start's attitude", "flight", *(name for name, _, _ in columns)]
    return pd.DataFrame(rows, columns=names).sort_values("grade", kind="stable")


def _size(campaigns: dict[str, Campaign]) -> str:
    first = campaigns["flights"].manifest
    return (
        f"This page: {first['runs']} runs of each flight and grade, seed {first['seed']}, "
        f"{sum(c.study.steps() for c in campaigns.values()) / 1e6:.3g} million filter steps, "
        f"strapdown {first['versions']['strapdown']}; filters {', '.join(first['filters'])}."
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
    """The table of cells for docs/reference/evidence/open-or-closed-loop.md, as text: a row per grade and flight."""
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
