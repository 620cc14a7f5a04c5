"""The runs: starts far off, a vehicle at rest, and the flights of Hager & Bryne."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import ATT, STATES
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.evaluation.consistency import SURVIVED
from strapdown.evaluation.metrics import errors
from strapdown.experiments.monte_carlo.scoring import ERROR_GROUPS
from strapdown.experiments.monte_carlo.study import Study
from strapdown.sim import motions
from strapdown.sim.synthesis import simulate
from strapdown.sim.trajectory import DEG
from strapdown.typing import Array

from ..common.gnss_alone import EPOCH, KEPT, gnss_alone, keep
from .worlds import (
    FILTERS,
    NO_GATE,
    RATE,
    UNGATED,
    FarSetting,
    begin,
    record,
    starts,
    true_attitude,
)

LAST = 10
"""s at the end over which an attitude must be right."""
RESTING, REST_RATE, KNOWN = 600.0, 20.0, 30.0
"""s at rest, Hz of the IMU there, deg to which the heading is known at the start."""
AT_REST = ("closed-loop", "ukf", "iekf", "iekf, published", "eqf", "eqf, published")
FLOWN = ("closed-loop", "iekf", "eqf")
PAPER_GRADE = "paper1-consumer"
PAIR = ("closed-loop", "iekf")
"""The filters of the cells; `eqf` is the same filter as `iekf` there."""


def attitude_errors(solution: Solution, recording: Recording) -> Array:
    """Rotation vectors (n, 3), rad."""
    return np.asarray(errors(solution, recording.reference).attitude)


def far_off(setting: FarSetting, seed: int) -> Iterator[dict[str, Any]]:
    """A row per filter and start: the largest attitude error of the last LAST s, and how far it is
    beyond its claim."""
    recording = record(setting, seed)
    free = replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))
    wanted = [(label, recording, FILTERS[label]) for label in FILTERS]
    wanted += [(label + NO_GATE, free, FILTERS[label]) for label in UNGATED]
    for heading, tilt, start in starts(recording, setting.grade, seed):
        for label, given, (name, options) in wanted:
            solution = fuse(given, name, start=start, every=int(RATE), options=options)
            found = attitude_errors(solution, recording)
            yield {
                **setting._asdict(),
                "seed": seed,
                "heading_deg": heading,
                "tilt_deg": tilt,
                "filter": label,
                "end_deg": float(np.linalg.norm(found[-LAST:], axis=1).max() / DEG),
                "claims": float(np.abs(found[-LAST:] / solution.std[-LAST:, ATT]).max()),
            }


def at_rest(grade: str, seed: int) -> Iterator[dict[str, Any]]:
    """A row per filter: error and claim of the heading after RESTING s, from a heading drawn from what
    the filter is told."""
    still = motions.car((59 * DEG, 10 * DEG, 100.0), 30 * DEG, [{"duration": RESTING}], name="rest")
    recording = simulate(still, RESTING, grade, seed, rate=REST_RATE)
    spread = np.array([2.0, 2.0, KNOWN]) * DEG
    off = Rotation.from_rotvec(spread * np.random.default_rng([seed, 2]).standard_normal(3))
    start = begin(recording, grade, off * true_attitude(recording), spread)
    for label in AT_REST:
        name, options = FILTERS[label]
        solution = fuse(recording, name, start=start, every=int(REST_RATE), options=options)
        yield {
            "grade": grade,
            "seed": seed,
            "filter": label,
            "error_deg": float(attitude_errors(solution, recording)[-1, 2] / DEG),
            "claim_deg": float(solution.std[-1, 8] / DEG),
        }


def flights(scenario: str, runs: int, seed: int) -> Iterator[dict[str, Any]]:
    """A row per filter: what became of its runs in a flight of the paper."""
    study = Study((scenario,), FLOWN, (PAPER_GRADE,), runs, seed, EPOCH, KEPT)
    campaign = study.run(threads=1)
    (cell,) = campaign.cells
    numbers = campaign.numbers(cell)
    for place, label in enumerate(FLOWN):
        square = dict(zip(ERROR_GROUPS, numbers["mean_square"][place].T))
        yield {
            "flight": scenario.removeprefix("paper1-"),
            "filter": label,
            "runs": runs,
            "survived": int((numbers["reason"][place] == SURVIVED).sum()),
            "anees": float(np.median(numbers["nees"][place]) / STATES),
            "position_m": float(np.sqrt(np.median(square["position"]))),
            "attitude_deg": float(np.sqrt(np.median(square["attitude"])) / DEG),
        }


def cell(scenario: str, grade: str, runs: int, seed: int) -> Iterator[dict[str, Any]]:
    """A row of a scenario with GNSS alone and an IMU: how many runs of each of PAIR survive, and ANEES over
    those that survive in both, which have the same random numbers."""
    world = gnss_alone(scenario)
    study = Study((world,), PAIR, (grade,), runs, seed, EPOCH, keep(world))
    campaign = study.run(threads=1)
    (name,) = campaign.cells
    numbers = campaign.numbers(name)
    survived = numbers["reason"] == SURVIVED
    nees = numbers["nees"][:, survived.all(axis=0)] / STATES
    anees = nees.mean(axis=1)
    ratio = anees[1] / anees[0]
    # of the ratio of two means of pairs, to first order
    spread = (nees[1] / anees[1] - nees[0] / anees[0]).std(ddof=1)
    yield {
        "scenario": scenario,
        "grade": grade,
        "runs": runs,
        **{f"survived, {label}": int(alive.sum()) for label, alive in zip(PAIR, survived)},
        **{f"ANEES, {label}": float(value) for label, value in zip(PAIR, anees)},
        "ratio": float(ratio),
        "std": float(ratio * spread / np.sqrt(nees.shape[1])),
    }
