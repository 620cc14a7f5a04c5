"""Open against closed loop: the study of Hager & Bryne on eleven flights with three IMU grades, its
figures and its claims.

Source: A. Hager and T. H. Bryne, "Closed-loop vs. open-loop Kalman filter architectures in airborne
aided inertial navigation".
"""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from strapdown.experiments.monte_carlo.campaign import Campaign
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sim.scenario import Scenario, scenario
from strapdown.typing import File

from ..common import markdown
from ..common.concordance import concordance
from ..common.reproduction import USUAL, Asked, reproduction
from ..common.runner import ENOUGH, campaigns
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
from .concordance import entries
from .figures import all_figures
from .imus import density_reading, starting_at_zero
from .readings import (
    BY_LETTER,
    CHOSEN,
    FACTORS,
    OF_WORLD,
    FlownWorld,
    votes_rows,
    votes_table,
)
from .rules import SMALL_DRIFT, CellTables, FlownReadings

FILTERS = (ablation.OPEN, ablation.CLOSED)
AS_PRINTED, ZERO = (
    ablation.variant(printed_updates.CLOSED_LOOP.name, reading=reading)
    for reading in printed_updates.READINGS
)
"""The closed loop with update (15) as printed, and with a prediction (19) of zero."""
STARTS = {"chosen": 1.0, "tenth": 0.1, "exact": 0.0}
"""{level of START: factor on the start's attitude error}."""
IMUS = ("paper1-consumer", "paper1-tactical", "paper1-navigation")
FLIGHTS = tuple(f"paper1-{number:02d}" for number in range(1, 12))
OFFSET_FLIGHTS, OFFSET = FLIGHTS[:7], (0.5, 0.5, 0.5)
"""Flights with the constant accelerometer offset, m/s^2 on each body axis."""
RUNS, QUICK_RUNS = 50, 5
CROSS_RUNS = 24
"""Runs of all readings but the chosen one: as many as are flown at a time, three times."""
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
        "What the paper leaves open, or prints so that it can be read in several ways, is read in all "
        f"of them together, each reading a vote: {'; '.join(f.about for f in FACTORS)}. "
        "Opposite verdicts by two readings mean that the verdict depends on the reading; otherwise the "
        "least favourable one counts. Each row says what the paper's letter gives, what its spirit, and "
        "which reading turns the verdict. The cross has "
        f"{CROSS_RUNS} runs of each cell, the chosen reading {RUNS}.",
    ),
)


class Flown(NamedTuple):
    """The flights and grades of the studies; flights are Scenario values or names."""

    flights: Sequence[str | Scenario] = FLIGHTS
    with_offset: Sequence[str | Scenario] = OFFSET_FLIGHTS
    # grades, the best of them last, which alone flies with other starts
    imus: tuple[str | ImuSpec, ...] = IMUS


OF_PAPER = Flown()


def studies(asked: Asked = USUAL, flown: Flown = OF_PAPER) -> dict[str, Study]:
    """{name: Study} of what is run: "flights", "offset", "initial" as chosen, one of each other
    FlownWorld by its name, and the ablations. A quick run has the world of the letter alone. Raises
    DataError."""
    printed_updates.make_known()
    count, seed, imus = asked.run_count(RUNS, QUICK_RUNS), asked.seed, flown.imus
    plain, constant, initial = scenarios(flown)
    filters = (*FILTERS, AS_PRINTED)
    found = {
        "flights": Study(plain, (*filters, ZERO), imus, count, seed),
        "offset": Study(constant, filters, imus, count, seed),
        "initial": Study(initial, filters, imus, count, seed),
    }
    for world in (BY_LETTER.world,) if asked.quick else worlds():
        own = tuple(read_so(s, world) for s in (*plain, *constant, *initial))
        grades = imus if world.start == CHOSEN.start else imus[-1:]
        found[world.name] = Study(
            own, filters, tuple(imu_of(imu, world) for imu in grades), min(count, CROSS_RUNS), seed
        )
    if asked.ablations:
        chosen = [f"paper1-{number}" for number in ablation.FLIGHTS]
        found |= {
            f"ablation-{name}": study
            for name, study in ablation.studies(chosen, count, seed).items()
        }
    return found


def worlds() -> list[FlownWorld]:
    """All worlds but the chosen one."""
    levels = product(*([level.key for level in factor.levels] for factor in OF_WORLD))
    return [world for world in (FlownWorld(*keys) for keys in levels) if world != CHOSEN.world]


def scenarios(flown: Flown) -> list[tuple[Scenario, ...]]:
    """The flights without offset, with a constant one, and with one that is the initial value of
    the bias process."""
    moved = lambda ending, decays: tuple(
        s.replace(name=f"{s.name}-{ending}", accel_offset=OFFSET, offset_decays=decays)
        for s in map(scenario, flown.with_offset)
    )
    return [tuple(map(scenario, flown.flights)), moved("offset", False), moved("initial", True)]


def read_so(s: Scenario, world: FlownWorld) -> Scenario:
    """A scenario whose filter starts as in a world."""
    position, attitude, accel, gyro = (
        s.start_std[:6],
        s.start_std[6:9],
        s.start_std[9:12],
        s.start_std[12:],
    )
    if world.p0 == "own":
        accel = (None, None, None)
    attitude = tuple(STARTS[world.start] * std for std in attitude)
    return s.replace(start_std=(*position, *attitude, *accel, *gyro))


def imu_of(name: str | ImuSpec, world: FlownWorld) -> str | ImuSpec:
    """An IMU as a world reads it."""
    if world.sigma == "density":
        name = density_reading(name)
    return starting_at_zero(name) if world.biases == "zero" else name


@reproduction(
    "quick", "ablations", "runs", "seed", "threads", "workers", "scheduler", "notify", "progress"
)
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run what is missing of the study in DIR/campaign, write the page into the folder `out`, and
    return the claims.

    quick: 5 runs in place of 50; ablations: also the variants of ablations.py; threads, workers,
    scheduler, say: as in Study.run. An interrupted call goes on where it was. Raises DataError.
    """
    return make_outputs(out, studies(asked), asked)


def make_outputs(out: File, wanted: dict[str, Study], asked: Asked = USUAL) -> list[dict[str, Any]]:
    """As `reproduce`, of given studies: "flights", "offset" and "initial", perhaps those of other
    worlds and of the ablations."""
    out = Path(out)
    if asked.notify:
        steps = {name: study.steps() / 1e6 for name, study in wanted.items()}
        each = ", ".join(f"{name} {million:.3g}" for name, million in steps.items())
        asked.notify(
            f"{sum(steps.values()):.3g} million filter steps in {len(wanted)} studies: {each}"
        )
    found = campaigns(
        wanted,
        lambda name: out / "campaign" / name,
        asked.progress,
        threads=asked.threads,
        workers=asked.workers,
        scheduler=asked.scheduler,
        notify=asked.notify,
    )
    return write(out, found, asked.threads)


def write(
    out: File, campaigns: dict[str, Campaign], threads: int | None = None
) -> list[dict[str, Any]]:
    """Write page, tables and claims.json of finished campaigns into the folder `out`; return the
    claims."""
    flights = campaigns["flights"]
    found, zero = read_cells(campaigns)
    cells, moved, initial = found[CHOSEN.world, CHOSEN.update]
    drifts = measured_drifts(campaigns, threads)
    drift = drifts[CHOSEN.world]
    ablated, resets, places = ablated_tables(campaigns)
    flown = FlownReadings(found, {w: d.runs for w, d in drifts.items()}, resets, places)
    claims, verdicts = hager_bryne_claims.claims(flown)
    read = list(hager_bryne_claims.CLAIMS.values())
    said = [
        f"- {name.removeprefix('ablation-')}: {markdown.plain(caption)}"
        for name, (caption, _) in ablated.items()
    ]
    printed = found[CHOSEN.world, "printed"]
    between = [zero_is_printed(printed.flights, zero)]
    count = int(flights.manifest["runs"])
    votes = [(VOTES, votes_table(read, verdicts))] * (count >= ENOUGH)
    outcome = Outcome(
        _size(campaigns),
        claims,
        choices_table(CHOICES),
        _tables(cells, moved, initial, drift)
        | {
            **(
                {"votes": votes[0], "votes-rows": (None, votes_rows(verdicts, read))}
                if votes
                else {}
            ),
            "worlds": (WORLDS, by_world(found)),
            "bound": _bound(flights),
        }
        | {f"cells-{'-'.join(world)}-{u}": (None, c.flights) for (world, u), c in found.items()}
        | ablated,
        all_figures(
            campaigns,
            found[CHOSEN.world, CHOSEN.update],
            {"(15) as printed": printed.flights, "(19) zero": zero},
            drift,
        ),
        listed=[
            *votes,
            ("Without offset", by_flight(cells)),
            ("With a constant accelerometer offset of 0.5 m/s² on each axis", by_flight(moved)),
            ("With 0.5 m/s² as initial value of the bias process", by_flight(initial)),
            (WORLDS, by_world(found)),
        ],
        between=[
            "",
            *between,
            *(["", "Ablations, on flights 01, 07 and 10:", "", *said] * bool(said)),
        ],
        runs=count,
        texts=lambda claims: {"concordance.md": concordance(entries(claims))},
    )
    return write_study(out, WORK, outcome)


def read_cells(
    campaigns: Mapping[str, Campaign],
) -> tuple[dict[tuple[FlownWorld, str], CellTables], pd.DataFrame]:
    """({(world, update): CellTables} of all worlds that were flown, flights of the chosen world
    with a prediction (19) of zero). A world with another start has the rows of other grades from
    the one without."""
    corrected, printed, zero = tables(campaigns["flights"])
    parts = [(corrected, printed), *(tables(campaigns[name]) for name in ("offset", "initial"))]
    found = {
        (CHOSEN.world, update): CellTables(*tables_of)
        for update, tables_of in zip(("prior", "printed"), zip(*parts))
    }
    for world in worlds():
        if world.name in campaigns:
            for update, own in zip(("prior", "printed"), tables(campaigns[world.name])):
                found[world, update] = complete_tables(_split(own), found, world, update)
    return found, zero


def _split(table: pd.DataFrame) -> CellTables:
    """The rows of the flights without offset, with a constant one, and with an initial one."""
    ending = table["scenario"].str.extract("-(offset|initial)$")[0].fillna("")
    return CellTables(
        *(table[ending == own].reset_index(drop=True) for own in ("", "offset", "initial"))
    )


def complete_tables(
    own: CellTables,
    found: Mapping[tuple[FlownWorld, str], CellTables],
    world: FlownWorld,
    update: str,
) -> CellTables:
    """Tables of a world with the rows of other grades of the same world with the chosen start."""
    other = found.get((world._replace(start=CHOSEN.start), update))
    if world.start == CHOSEN.start or other is None:
        return own
    return CellTables(*map(with_others, own, other))


def with_others(own: pd.DataFrame, whole: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of `own` after those rows of `whole` whose grade `own` lacks."""
    rest = whole[~whole["grade"].isin(own["grade"])]
    return pd.concat([rest, own], ignore_index=True)


def measured_drifts(
    campaigns: Mapping[str, Campaign], threads: int | None
) -> dict[FlownWorld, hager_bryne_drift.Drift]:
    """The drift of the raw INS in the chosen world, and in those whose P0 is the same, completed as
    in `read_cells`; in the first runs."""
    count = int(campaigns["flights"].manifest["runs"])
    runs = hager_bryne_drift.RUNS if count >= ENOUGH else hager_bryne_drift.QUICK_RUNS
    found = {CHOSEN.world: hager_bryne_drift.measure(campaigns["flights"], threads, runs)}
    for world in worlds():
        if world.p0 == CHOSEN.p0 and world.name in campaigns:
            own = hager_bryne_drift.measure(campaigns[world.name], threads, runs)
            other = found.get(world._replace(start=CHOSEN.start))
            if world.start != CHOSEN.start and other is not None:
                own = own._replace(runs=with_others(own.runs, other.runs))
            found[world] = own
    return found


def ablated_tables(
    campaigns: Mapping[str, Campaign],
) -> tuple[dict[str, tuple[str, pd.DataFrame]], pd.DataFrame | None, pd.DataFrame | None]:
    """`ablations.tables` of those campaigns that are ablations; nothing without any."""
    own = {
        name.removeprefix("ablation-"): campaign
        for name, campaign in campaigns.items()
        if name.startswith("ablation-")
    }
    return ablation.tables(own) if own else ({}, None, None)


def zero_is_printed(printed: pd.DataFrame, zero: pd.DataFrame) -> str:
    """Return a sentence on the difference between a prediction (19) of zero and (15) as printed."""
    most = (zero["closed_censored_500_m"] / printed["closed_censored_500_m"] - 1).abs().max()
    return (
        "With a prediction (19) of zero the position RMSE of the closed loop differs from that with "
        f"(15) as printed by at most {most:.2%} in a cell, so that the cross has the latter alone."
    )


VOTES = (
    "How each reading votes: for each claim by its number, in how many of the readings with this one it "
    "is reproduced"
)
WORLDS = (
    "By what is flown: medians over flights of the open loop, of the closed loop, and of the closed loop "
    "with (15) as printed, separated by strokes; position RMSE by the 500 m rule alone, heading RMSE "
    "after 120 s while both are within 500 m, typical NEES/15 and survival by both abort rules"
)


def by_world(found: Mapping[tuple[FlownWorld, str], CellTables]) -> pd.DataFrame:
    """A row per world and grade, as text."""
    columns = (
        ("position RMSE, m", "censored_500_m", "{:.3g}"),
        ("heading RMSE, deg", "heading_500_deg", "{:.2g}"),
        ("NEES/15", "anees", "{:.3g}"),
        ("survived", "survived", "{:.0%}"),
    )
    rows = []
    for world in dict.fromkeys(world for world, _ in found):
        corrected, printed = (found[world, update].flights for update in ("prior", "printed"))
        grades = list(dict.fromkeys(corrected["grade"]))
        for grade in grades if world.start == CHOSEN.start else grades[-1:]:
            loops = [("open", corrected), ("closed", corrected), ("closed", printed)]
            median = lambda table, name: table.loc[table["grade"] == grade, name].median()
            texts = [
                " / ".join(form.format(median(table, f"{loop}_{name}")) for loop, table in loops)
                for _, name, form in columns
            ]
            levels = [factor.name(key) for factor, key in zip(OF_WORLD, world)]
            rows.append([grade, *levels, *texts])
    names = [factor.about for factor in OF_WORLD]
    columns = ["grade", *names, *(name for name, _, _ in columns)]
    return pd.DataFrame(rows, columns=columns).sort_values("grade", kind="stable")


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
    drift: hager_bryne_drift.Drift,
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
        "offset-all": (None, moved),
        "initial-all": (None, initial),
        "drift": (
            "Open by closed loop against the drift of the raw INS, medians and quartiles over "
            "stored epochs",
            drift.bins,
        ),
        "turns": (
            "The same against the attitude error of the raw INS, while its position has drifted by "
            f"less than {SMALL_DRIFT:g} m",
            drift.turns,
        ),
        "drift-runs": (None, drift.runs),
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
                    ("tilt", "tilt_500"),
                    ("heading", "heading_500"),
                )
            },
        }
    )


def _intervals(cells: pd.DataFrame, name: str) -> list[str]:
    return [interval(row, name) for _, row in cells.iterrows()]


def by_flight(cells: pd.DataFrame) -> pd.DataFrame:
    """The table of cells for docs/reference/evidence/open-or-closed-loop.md, as text: a row per
    grade and flight."""
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
