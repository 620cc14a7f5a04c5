"""Bets on the verdict: `strapdown reproduce verdicts`."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..common.example_recordings import DESCRIPTIONS
from ..common.reproduction import Asked, reproduction
from ..common.runner import Task, collect_tables
from . import bets
from .subjects import SIMULATED, recorded_subjects, simulated_subjects
from .summary import ADVICE, BETS, STUDY

SEEDS, QUICK_SEEDS = 2, 1
QUICK = ("robot",)
RIGHT_SEEDS, RIGHT_FIRST = 4, 1001
"""Further seeds of right set-ups for each of SEEDS, and the first of them."""


@reproduction("quick", "runs", "seed", "recordings", "workers", "progress", usual=Asked(seed=501))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Make every bet, write the page into the folder `out`, return the claims; quick: one subject, one
    seed. Raises DataError."""
    seeds = asked.seeds_from(SEEDS, QUICK_SEEDS)
    if asked.quick:
        tasks = [
            *of_simulated(QUICK, seeds),
            *(Task(ADVICE, advice_on, (name, seeds.start)) for name in QUICK),
        ]
    else:
        tasks = all_tasks(Path(asked.recordings or DESCRIPTIONS), seeds)
    return STUDY.write(out, collect_tables(tasks, asked.workers, asked.progress))


def all_tasks(folder: Path, seeds: range) -> list[Task]:
    """Recorded subjects, simulated ones with each seed, and right set-ups with more seeds."""
    first = RIGHT_FIRST + RIGHT_SEEDS * (seeds.start - 1)
    more = range(first, first + RIGHT_SEEDS * len(seeds))
    return [
        *(Task(BETS, of_recorded, (folder, name)) for name in recorded_subjects(folder)),
        *of_simulated(tuple(SIMULATED), seeds),
        *(Task(BETS, rights_of, (name, seed)) for seed in more for name in SIMULATED),
        *(Task(ADVICE, advice_on, (name, seeds.start)) for name in SIMULATED),
    ]


def of_simulated(names: Sequence[str], seeds: range) -> Iterator[Task]:
    """Yields the tasks of simulated subjects."""
    for seed in seeds:
        for name in names:
            yield Task(BETS, with_mistakes, (name, seed))
            yield Task(BETS, with_variants, (name, seed))


def of_recorded(folder: Path, name: str) -> list[dict[str, Any]]:
    """Rows of a recorded subject."""
    return bets.bets(recorded_subjects(folder)[name], 0)


def with_mistakes(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of a simulated subject as it is and with each mistake."""
    return bets.bets(simulated_subjects()[name], seed)


def with_variants(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of a simulated subject with each variant."""
    return bets.of_variants(simulated_subjects()[name], seed)


def advice_on(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of what `follow` does with each mistake."""
    return bets.advice(simulated_subjects()[name], seed)


def rights_of(name: str, seed: int) -> list[dict[str, Any]]:
    """Rows of right set-ups alone."""
    subject = simulated_subjects()[name]
    return [
        *bets.bets(subject, seed, mistakes=False),
        *bets.of_variants(subject, seed, mistakes=False),
    ]
