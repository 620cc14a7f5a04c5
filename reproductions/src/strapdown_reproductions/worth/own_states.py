"""States that sensors bring along, and their errors as states: are they as sure as they say?

Each run draws all of them from the filter's priors, and those that walk do so as the filter takes it.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from strapdown.aiding import find
from strapdown.data.recording import Recording
from strapdown.engine.batch import fuse
from strapdown.evaluation.consistency import band, errors_beyond, nees, state_errors
from strapdown.experiments.monte_carlo.wrong_installation import (
    Installation,
    draw_installation,
    start_of,
)
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sim.scenario import scenario
from strapdown.typing import Array

from ..common.motions import ODOMETER, ON_MAST, ON_WING, StudyMotion, constraints, simulator
from ..common.tables import group_rows
from .sensors import BODY, COMPASS

BEACON = displace_lla(np.array(scenario("ship").motion.lla), np.array([1500.0, -900.0, 40.0]))
"""rad, rad, m: m north, east and down of where the ship begins."""
SETTLED = 30.0
"""s from which NEES counts."""
OF_MOTION, OF_ALL = "the filter's 15", "all"
"""Groups of states beside those of the sensors."""
UNIRON = replace(COMPASS, hard_iron=(0.0, 0.0, 0.0))
"""A magnetometer whose iron is drawn."""


class OwnStates(NamedTuple):
    """A motion with sensors that have states, and the parameters that are states too."""

    motion: StudyMotion
    sensors: tuple[Simulated, ...]
    estimated: Installation


MOTIONS = {
    "car": OwnStates(
        StudyMotion("car", 310.0, sensors=ODOMETER, magnetometer=UNIRON, constrained=True),
        (),
        {"hard-iron": None, "declination": None, "scale": None},
    ),
    "flight": OwnStates(
        StudyMotion("demo", 360.0, ON_WING, magnetometer=UNIRON),
        (
            Simulated("true-airspeed", 1.0, 5.0),
            Simulated("side-slip", float(np.radians(2.0)), 5.0),
            Simulated("pressure-altitude", 1.0, 5.0),
        ),
        {"hard-iron": None, "field": None, "true-airspeed scale": None},
    ),
    "ship": OwnStates(
        StudyMotion("ship", 560.0, ON_MAST, magnetometer=UNIRON),
        (
            BODY,
            Simulated("beam-velocity", 0.05, 5.0, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)),
            Simulated("range", 0.5, 1.0, (0.0, 0.0, 0.0, *map(float, BEACON))),
            Simulated("depth", 0.3, 1.0),
        ),
        {"hard-iron": None, "declination": None, "scale": None},
    ),
    "ship, mounting": OwnStates(
        StudyMotion("ship", 560.0, ON_MAST), (BODY,), {"scale": None, "mounting": None}
    ),
}
"""By name. A mounting turns the IMU alone, so it is no state beside sensors in its case."""


def rows(name: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, second and group of states: its NEES."""
    for seed in seeds:
        recording, start, true, estimated = draw_run(MOTIONS[name], seed)
        every = round(1 / float(np.median(recording.imu.dt)))
        asked: dict[str, Any] = {"every": every, "covariance": True}
        solution = fuse(recording, start=start, estimate=estimated, **asked)
        assert solution.covariance is not None
        of_rows = {column: path(solution.t) for column, path in true.items()}
        places, beyond = errors_beyond(solution, of_rows)
        errors = np.hstack([state_errors(solution, recording), beyond])
        states = [*range(15), *places]
        P = solution.covariance[:, states][:, :, states]
        for group, own in groups(list(true)).items():
            values = nees(errors[:, own], P[:, own][:, :, own])
            for t, value in zip(solution.t.round(3), values):
                yield {
                    "motion": name,
                    "states": group,
                    "dof": len(own),
                    "seed": seed,
                    "t": t,
                    "nees": value,
                }


def groups(columns: list[str]) -> dict[str, list[int]]:
    """{group: places among the 15 states and those of these columns}: one of each parameter of a
    source, without its component and unit."""
    found = {OF_ALL: list(range(15 + len(columns))), OF_MOTION: list(range(15))}
    for k, column in enumerate(columns):
        name = column.split(" [")[0]
        what, _, owner = name.partition(" error of ")
        words = " ".join(w for w in what.split() if w not in COMPONENTS) + (
            f" of {owner}" if owner else ""
        )
        found.setdefault(words, []).append(15 + k)
    return found


COMPONENTS = ("north", "east", "down", "forward", "right", "pitch", "heading")


def draw_run(
    case: OwnStates, seed: int
) -> tuple[Recording, Any, dict[str, Callable[[Array], Array]], Installation]:
    """(recording, InitialState, {column: true value at times}, what is estimated) of a run."""
    made = simulator(case.motion)
    right, start = made.run(case.motion.imu, np.random.SeedSequence(seed))
    rng = np.random.default_rng([seed, 1])
    if case.motion.constrained:
        right = replace(right, sources=(*right.sources, *constraints(right, rng)))
    paths: dict[str, Callable[[Array], Array]] = {}
    true: dict[str, Callable[[Array], Array]] = {}
    for sensor in case.sensors:
        kind, owner = sensor.measurement, sensor.measurement.shared or sensor.kind
        if kind.states and owner not in paths:
            paths[owner] = drawn_walk(sensor, right.span[1], rng)
            for k, state in enumerate(kind.states):
                true[f"{owner} {state}"] = lambda t, path=paths[owner], k=k: path(t)[:, k]
        plan = sensor.plan(made.truth, made.ideal, None, paths.get(owner))
        right = replace(right, sources=(*right.sources, plan.fixes(rng.integers(2**31))))
    installed = draw_installation(right, case.estimated, np.random.default_rng([seed, 2]))
    for column, value in installed.true.items():
        true[column] = lambda t, value=value: np.full(len(t), value)
    return installed.recording, start_of(installed, start), true, case.estimated


def drawn_walk(
    sensor: Simulated, stop: float, rng: np.random.Generator
) -> Callable[[Array], Array]:
    """The states of a sensor's kind over time: times (n,) -> (n, k)."""
    kind = find(sensor.kind)
    t = np.arange(0.0, stop + 1.0, 0.1)
    steps = kind.state_walk * np.sqrt(0.1) * rng.standard_normal((len(t), len(kind.states)))
    steps[0] = kind.state_std * rng.standard_normal(len(kind.states))
    values = np.cumsum(steps, axis=0)
    return lambda at: np.stack([np.interp(at, t, column) for column in values.T], axis=1)


def nees_table(table: pd.DataFrame) -> pd.DataFrame:
    """A row per motion and group: the share of epochs whose NEES averaged over the runs is in its 95 %
    band, and its mean by degree of freedom."""

    def measures(own: pd.DataFrame) -> dict[str, Any]:
        own, dof = own[own["t"] >= SETTLED], int(own["dof"].iloc[0])
        runs = own["seed"].nunique()
        mean = own.groupby("t")["nees"].mean()
        low, high = band(dof, runs)
        return {
            "of them": dof,
            "runs": runs,
            "in_band_%": 100 * float(((mean >= low) & (mean <= high)).mean()),
            "nees/dof": float(mean.mean() / dof),
        }

    return group_rows(
        table, ["motion", "states"], measures, ("of them", "runs", "in_band_%", "nees/dof")
    )
