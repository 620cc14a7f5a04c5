"""Sensor faults, one at a time: `strapdown reproduce faults`.

Each fault is made with simulated recordings; every filter that it concerns runs over them in batch,
some smoothed and live too, and what each says is held against how wrong it is.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from strapdown import filters
from strapdown.checks import DataError, check_choice

from ..common import runner
from ..common.reproduction import Asked, reproduction
from . import jumps
from .cells import CellTask, cells
from .runs import SLOW, SLOW_SEEDS, FaultSubject, family, subjects
from .summary import CELLS, STUDY, TRIALS
from .worlds import GENTLE, MOTIONS, SEEDS

QUICK_SEEDS = 1
QUICK = ("closed-loop", "closed-loop live", "closed-loop smoothed")
"""Subjects of the reduced form, in the gentle motion alone."""
FLIGHTS, QUICK_FLIGHTS = 200, 4
"""Flights of `jumps` for each seed of the table."""


@reproduction("quick", "runs", "seed", "workers", "filter", "progress", usual=Asked(seed=1))
def reproduce(out: Path, asked: Asked) -> list[dict[str, Any]]:
    """Run every cell and the jumps, write the page into the folder `out`, return the claims.

    quick: one seed, the gentle motion, few filters and jumps; filter: what runs, as in the table
    ("closed-loop", "closed-loop live", ...). Raises DataError.
    """
    seeds, quick = asked.seeds_from(SEEDS, QUICK_SEEDS), asked.quick
    matrix = tasks(choose_subjects(asked.filter or (QUICK if quick else ())), seeds, quick)
    if not matrix:
        raise DataError(
            f"{', '.join(asked.filter)}: runs in no motion of the reduced form; leave out --quick"
        )
    of_seed = QUICK_FLIGHTS if quick else FLIGHTS
    flights = range(seeds.start, seeds.start + len(seeds) * of_seed)
    wanted = [runner.Task(CELLS, cells, (task,)) for task in matrix]
    wanted += [runner.Task(TRIALS, jumps.trial, (flight,)) for flight in flights]
    return STUDY.write(out, runner.collect_tables(wanted, asked.workers, asked.progress))


def choose_subjects(names: Sequence[str]) -> list[FaultSubject]:
    """The subjects of these names, without any all. Raises DataError."""
    known = {one.name: one for one in subjects()}
    for name in names:
        check_choice(name, "what runs", tuple(known))
    return [one for name, one in known.items() if not names or name in names]


def tasks(subjects: Sequence[FaultSubject], seeds: range, quick: bool = False) -> list[CellTask]:
    """Every motion that suits a filter, with each of the seeds; the slow ones with fewer."""
    return [
        CellTask(motion, subject, s)
        for s in seeds
        for subject in subjects
        if subject.filter not in SLOW or s < seeds.start + SLOW_SEEDS
        for motion, world in MOTIONS.items()
        if family(filters.find(subject.filter)) in world.families
        and s < seeds.start + world.seeds
        and (not quick or motion == GENTLE)
    ]
