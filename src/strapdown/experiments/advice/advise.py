"""Which loop for my IMU on my mission: a paired study of open loop, resets and closed loop, a
stated rule, and the answer with its reasons.

This is the framework announced in the conclusion of Hager & Bryne, for any IMU and motion: the
studies, the crossover map and the folder. The rule is in `verdicts`, texts and figures in `page`
and `figures`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Unpack

import numpy as np
import pandas as pd

from ...checks import DataError, check_choice, check_number
from ...core.compile.side_by_side import seconds_to_compile
from ...data.value import Value
from ...engine.options import takes
from ...evaluation.consistency import Interval
from ...fileio.files import make_folder, replacing, together, write_table
from ...progress import listener, with_bar
from ...sensor_models.imu import ImuSpec, imu as imu_spec
from ...sim.scenario import Scenario
from ...typing import Array, File, Progress
from ...units.wording import count_text, duration_text
from ..monte_carlo.campaign import Campaign
from ..monte_carlo.chunks import kernels_for
from ..monte_carlo.study import CAMPAIGN_OPTIONS, CampaignOptions, Study
from .mission import CIRCUIT, MISSION_RATE, aligned_in_motion, mission, seconds
from .page import page, sentences, summary_table
from .verdicts import (
    CLOSED,
    DEFAULT_RULES,
    OPEN,
    RESET,
    Decision,
    FilterEvidence,
    FilterVerdict,
    Rules,
    Runs,
    decide,
    evidence,
    guess,
    judge,
    variants,
)

INTERVALS = (10, 60, 300, 1200)
"""s between resets: the compared intervals, where two or more fit into the mission."""
QUICK_INTERVALS = (60, 600)
RUNS, QUICK_RUNS, MAP_RUNS = 40, 36, 10
"""35 runs without a loss are the fewest that show a survival of 90 % (Wilson's interval)."""
GRADES = ("consumer", "industrial", "tactical", "navigation")
"""Grades of the map, beside the user's own."""
MAP_FILTERS = (CLOSED, OPEN, f"{RESET}60")
STORED_ROWS = 400
"""Stored rows of a run, about."""
STEP_TIME, CELL_TIME = 1.2e-6, 0.3
"""s of one core per filter step, and beside that per scenario and IMU, about: measured, see
docs/how-to/advise.md."""
GIVEN, MOVING = "given", "moving"
"""Sources of the initial attitude: the scenario, or an alignment in motion."""


@dataclass(frozen=True, eq=False)
class Advice(Value):
    """The answer for an IMU and a mission with its evidence; `print` shows it in a few lines,
    `save` writes the folder."""

    scenario: Scenario
    imu: ImuSpec
    rules: Rules
    found: dict[str, FilterEvidence]  # {filter: Evidence}
    decision: Decision
    others: dict[str, Decision]  # {changed threshold: Decision}
    # [(duration s, Decision)] for shortened missions, from the estimates
    through: list[tuple[float, Decision]]
    campaign: Campaign
    map: list[dict[str, Any]]  # dicts: motion, imu, duration_s, answer, filter, sure
    map_campaign: Campaign | None
    seed: int
    alignment: str = GIVEN

    @property
    def answer(self) -> str:
        """ "open", "reset", "closed", "none" or "undecided"."""
        return self.decision.answer

    def save(self, folder: Path) -> None:
        """Write advice.json, summary.csv, map.csv (where there is a map) and index.html into a
        folder, all or none. Raises DataError."""
        make_folder(folder)
        tables = {"summary": summary_table(self)} | (
            {"map": pd.DataFrame(self.map)} if self.map else {}
        )
        with together():
            for name, table in tables.items():
                write_table(table, folder / f"{name}.csv", 6)
            with replacing(folder / "advice.json") as part:
                text = json.dumps(self.as_dict(), indent=1, ensure_ascii=False)
                part.write_text(text + "\n", encoding="utf-8")
            page(self).save(folder / "index.html")

    def as_dict(self) -> dict[str, Any]:
        """Return everything except the campaigns as JSON values; NaN is null."""

        def decision(d: Decision) -> dict[str, Any]:
            return {
                "answer": d.answer,
                "filter": d.filter,
                "doubtful": d.doubtful,
                "runs_needed": d.runs,
            }

        def interval(i: Interval) -> list[float | None]:
            return [None if not np.isfinite(value) else float(value) for value in i]

        filters = [
            {
                "filter": e.filter,
                "runs": e.count,
                "survived": e.lived,
                "survival": interval(e.survived),
                "worst_nees_per_state": interval(e.nees),
                "rmse_ratio_to_closed_loop": interval(e.ratio),
                "runs_ahead_of_closed_loop": e.ahead,
                "censored_rmse_m": e.rmse,
                "verdict": self.decision.verdicts[e.filter]._asdict(),
            }
            for e in self.found.values()
        ]
        return {
            "imu": self.imu.name,
            "mission": self.scenario.name,
            "duration_s": self.scenario.duration,
            "imu_rate_hz": self.scenario.rate,
            "alignment": self.alignment,
            "start_attitude_std_deg": np.degrees(
                np.array(self.scenario.start_std[6:9], float)
            ).tolist(),
            "seed": self.seed,
            **decision(self.decision),
            "text": sentences(self),
            "rules": self.rules._asdict(),
            "filters": filters,
            "with_other_thresholds": {name: decision(other) for name, other in self.others.items()},
            "cut_short": [{"duration_s": t} | decision(d) for t, d in self.through],
            "map": self.map,
        }

    def __str__(self) -> str:
        return "\n".join(sentences(self))

    def __repr__(self) -> str:
        return f"Advice({self.answer}: {self.imu.name}, {self.scenario.name})"

    def _repr_html_(self) -> str:
        from ...pages.notebook.cards import card, lines

        return card("Advice", {}, lines(sentences(self)))


@takes(CampaignOptions, CAMPAIGN_OPTIONS)
@with_bar("advise")
def advise(
    imu: File | ImuSpec,
    flight: File | Scenario,
    duration: str | float,
    *,
    runs: int | None = None,
    seed: int = 0,
    out: File | None = None,
    map: bool | None = None,
    quick: bool = False,
    rules: Rules = DEFAULT_RULES,
    rate: float = MISSION_RATE,
    alignment: str = GIVEN,
    progress: Progress | bool | None = None,
    **how: Unpack[CampaignOptions],
) -> Advice:
    """Advise on open loop, resets or closed loop for an IMU on a mission.

    Parameters
    ----------
    imu : str, path or ImuSpec
        Grade, file or description of the IMU.
    flight : str, path or Scenario
        A name of `advice.mission`, a file of a scenario, or the Scenario itself.
    duration : str or float
        Of the mission: s, or text with its unit such as "5min".
    runs : int
        Of the study; default 40, quick 36.
    seed : int
        Of the random errors.
    out : path
        Folder for all results; an interrupted command resumes from it.
    map : bool
        Also make the crossover map of grades, durations and dynamics; default: unless quick.
    quick : bool
        No map, and two reset intervals only.
    rules : Rules
        Thresholds of the decision.
    rate : float
        Hz of the IMU.
    alignment : str
        Initial attitude: "given", with the std of the scenario, or "moving", with that of an
        alignment in motion.
    progress : bool or callable
        Called with the fraction done; True shows a bar.

    Raises
    ------
    DataError
        Where anything given is out of range.
    """
    with_map = _wants_map(quick, map)
    check_choice(alignment, "alignment", (GIVEN, MOVING))
    spec, length = imu_spec(imu), seconds(duration)
    scenario = mission(flight, length, rate)
    if alignment == MOVING:
        scenario = aligned_in_motion(scenario, spec)
    runs = runs if runs is not None else QUICK_RUNS if quick else RUNS
    study = _study((scenario,), (spec,), _candidates(length, quick), runs, seed)
    maps = _map_study(scenario, spec, study.runs, seed) if with_map else None
    parts = {"mission": study} | ({"map": maps} if maps else {})
    steps = sum(part.steps() for part in parts.values())
    folder = Path(out) if out is not None else None
    check_number(how.get("workers", 0), "workers", least=0, whole=True)
    # all checks come before any message
    begun = [Campaign.begin(parts[name], folder / "runs" / name) for name in parts if folder]
    how["notify"] = notify = how.get("notify") or (lambda text: None)
    compiling = seconds_to_compile(kernels_for(study) + (kernels_for(maps) if maps else []))
    notify(_cost(study, maps, _missing_steps(begun) if folder else steps, compiling))
    clocks, tell = (perf_counter(), process_time()), listener(progress)

    def run(part: Study, name: str, first: int) -> Campaign:
        def report(done: float) -> None:
            tell((first + done * part.steps()) / steps)

        return part.run(folder and folder / "runs" / name, progress=report, **how)

    campaign = run(study, "mission", 0)
    map_campaign = run(maps, "map", study.steps()) if maps else None
    made = _advice(scenario, spec, rules, campaign, map_campaign, int(seed), alignment)
    if folder:
        made.save(folder)
    notify(_time_taken(*clocks))
    return made


def _wants_map(quick: bool, map: bool | None) -> bool:
    """Return True where a map is to be made. Raises DataError."""
    if quick and map:
        raise DataError("quick makes no map (--quick, --map): leave out one of the two")
    return not quick if map is None else map


def _time_taken(begun: float, processor: float) -> str:
    """A sentence on the time since these values of the two clocks, s."""
    return (
        f"it took {perf_counter() - begun:.3g} s, with {process_time() - processor:.3g} s of "
        f"processor time in this process"
    )


def _map_study(scenario: Scenario, spec: ImuSpec, runs: int, seed: int) -> Study:
    """The study of the crossover map."""
    scenarios, imus = _map_scenarios(scenario), _map_imus(spec)
    return _study(scenarios, imus, MAP_FILTERS, min(runs, MAP_RUNS), seed)


def _cost(study: Study, maps: Study | None, steps: int, compiling: float) -> str:
    """Describe in a line the runs that a command is about to do, their processor time, and the
    time (s) that compiling takes before."""
    cells = len(study.cells) + (len(maps.cells) if maps else 0)
    work = steps * STEP_TIME + cells * CELL_TIME
    total = study.steps() + (maps.steps() if maps else 0)
    left = f" to do of {total / 1e6:.3g}" if steps < total else ""
    return (
        f"{count_text(study.runs, 'run')} of {count_text(len(study.filters), 'filter')}"
        + (f", and a map of {len(maps.cells)} cells" if maps else "")
        + f": {steps / 1e6:.3g}{left} million filter steps, about {work:.2g} s of processor time"
        + (
            f", after about {duration_text(max(round(compiling), 1))} of compiling, this time alone"
            if compiling
            else ""
        )
    )


def _missing_steps(campaigns: list[Campaign]) -> int:
    """Filter steps that are still to be done, as the folders say."""
    found = 0
    for campaign in campaigns:
        assert campaign.study is not None  # it began this campaign
        found += sum(map(campaign.study.steps, campaign.missing_chunks()))
    return found


def _advice(
    scenario: Scenario,
    spec: ImuSpec,
    rules: Rules,
    campaign: Campaign,
    map_campaign: Campaign | None,
    seed: int,
    alignment: str,
) -> Advice:
    own = Runs.of(campaign, campaign.cells[0])
    found = evidence(own)
    through = [
        (float(t), decide(evidence(own.until(t)), rules, guess))
        for t in durations(scenario.duration)
    ]
    others = {name: decide(found, other) for name, other in variants(rules).items()}
    seen = crossover(map_campaign, scenario.duration, rules) if map_campaign else []
    return Advice(
        scenario,
        spec,
        rules,
        found,
        decide(found, rules),
        others,
        through,
        campaign,
        seen,
        map_campaign,
        seed,
        alignment,
    )


def crossover(
    campaign: Campaign, duration: float, rules: Rules = DEFAULT_RULES
) -> list[dict[str, Any]]:
    """Return the map from the campaign of the map's study: a dict per motion, IMU and duration;
    `sure` is False where an interval allows another answer."""
    rows = []
    for number, cell in enumerate(campaign.cells):
        about, runs = campaign.manifest["cells"][number], Runs.of(campaign, cell)
        for t in durations(duration):
            found = evidence(runs.until(t))
            best = decide(found, rules, guess)
            rows.append(
                {
                    "motion": about["scenario"]["name"].removeprefix("map-"),
                    "imu": about["imu"]["name"],
                    "duration_s": float(t),
                    "answer": best.answer,
                    "filter": best.filter,
                    "sure": decide(found, rules, _certain).answer == best.answer,
                    "runs": runs.lasted.shape[1],
                }
            )
    return rows


def _certain(found: FilterEvidence, rules: Rules) -> FilterVerdict:
    """Judge as `judge`, but survival by its estimate, because few runs cannot prove it."""
    return judge(found._replace(survived=found.survived.alone), rules)


def durations(duration: float) -> Array:
    """Return a geometric grid of at most nine durations up to `duration`, s, from a hundredth of it
    or a minute on; all but the last have two digits."""
    first = max(60.0, duration / 100)
    count = (
        min(9, 1 + int(np.ceil(np.log(duration / first) / np.log(1.75))))
        if duration > 1.3 * first
        else 1
    )
    return np.r_[[float(f"{t:.2g}") for t in np.geomspace(first, duration, count)[:-1]], duration]


def _candidates(duration: float, quick: bool) -> tuple[str, ...]:
    """Labels of the filters that are compared."""
    fitting = [
        seconds for seconds in (QUICK_INTERVALS if quick else INTERVALS) if 2 * seconds <= duration
    ]
    return (CLOSED, *(f"{RESET}{seconds}" for seconds in fitting), OPEN)


def _study(
    scenarios: tuple[Scenario, ...],
    imus: tuple[ImuSpec, ...],
    filters: tuple[str, ...],
    runs: int,
    seed: int,
) -> Study:
    return Study(
        scenarios,
        filters,
        imus,
        runs,
        seed,
        keep=max(1, int(np.ceil(scenarios[0].duration / STORED_ROWS))),
    )


def _map_scenarios(scenario: Scenario) -> tuple[Scenario, ...]:
    """A straight and a dynamic flight with the receiver and the start of the mission."""
    own = {
        name: getattr(scenario, name)
        for name in (
            "gnss",
            "start_std",
            "accel_offset",
            "offset_decays",
            "biases_known",
            "gate",
            "gravity",
            "magnetometer",
            "barometer",
            "attitude",
            "date",
        )
    }
    return tuple(
        mission(kind, scenario.duration, scenario.rate).replace(name=f"map-{kind}", **own)
        for kind in ("straight", CIRCUIT["name"])
    )


def _map_imus(spec: ImuSpec) -> tuple[ImuSpec, ...]:
    """The grades and the user's own IMU, which is not shown twice."""
    shipped = tuple(imu_spec(name) for name in GRADES)
    if spec in shipped:
        return shipped
    return (*shipped, replace(spec, name=f"own {spec.name}") if spec.name in GRADES else spec)
