"""Sensor faults, one at a time: `strapdown reproduce faults`.

Each fault is made with simulated recordings; every filter that it concerns runs over them in batch,
some smoothed and live too, and what each says is held against how wrong it is.
"""

from collections.abc import Sequence
from typing import Any

from strapdown import filters
from strapdown.checks import DataError, check_choice
from strapdown.typing import File, Progress

from ..common import runner
from . import jumps
from .cells import Task, cells
from .runs import SLOW, SLOW_SEEDS, Subject, family, subjects
from .summary import CELLS, STUDY, TRIALS
from .worlds import GENTLE, MOTIONS

SEEDS, QUICK_SEEDS = 5, 1
QUICK = ("closed-loop", "closed-loop live", "closed-loop smoothed")
"""What runs in the reduced form, in the gentle motion alone."""
FLIGHTS, QUICK_FLIGHTS = 200, 4
"""Flights of `jumps` for each seed of the table."""


def reproduce(
    out: File,
    quick: bool = False,
    runs: int | None = None,
    seed: int = 1,
    workers: int = 0,
    filter: Sequence[str] = (),
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Run every cell and the jumps, write the page into the folder `out`, return the claims.

    quick: one seed, the gentle motion, few filters and jumps; runs: number of seeds; seed: the first
    of them; workers: processes, the processors by default; filter: what runs, as in the table
    ("closed-loop", "closed-loop live", ..., default: all); progress: called with the fraction done. Raises
    DataError.
    """
    count = runner.count_of(quick, runs, seed, SEEDS, QUICK_SEEDS)
    matrix = tasks(chosen(filter or (QUICK if quick else ())), seed, count, quick)
    if not matrix:
        raise DataError(
            f"{', '.join(filter)}: runs in no motion of the reduced form; leave out --quick"
        )
    flights = range(seed, seed + count * (QUICK_FLIGHTS if quick else FLIGHTS))
    wanted = [runner.Task(CELLS, cells, (task,)) for task in matrix]
    wanted += [runner.Task(TRIALS, jumps.trial, (flight,)) for flight in flights]
    return STUDY.write(out, runner.collected(wanted, workers, progress))


def chosen(names: Sequence[str]) -> list[Subject]:
    """The subjects of these names, without any all. Raises DataError."""
    known = {one.name: one for one in subjects()}
    for name in names:
        check_choice(name, "what runs", tuple(known))
    return [one for name, one in known.items() if not names or name in names]


def tasks(subjects: Sequence[Subject], seed: int, count: int, quick: bool = False) -> list[Task]:
    """Every motion that suits a filter, with `count` seeds from `seed` on; the slow ones with fewer."""
    return [
        Task(motion, subject, s)
        for s in range(seed, seed + count)
        for subject in subjects
        if subject.filter not in SLOW or s < seed + SLOW_SEEDS
        for motion, world in MOTIONS.items()
        if family(filters.find(subject.filter)) in world.families
        and (not quick or motion == GENTLE)
    ]
