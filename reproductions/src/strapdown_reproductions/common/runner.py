"""The runs of a study over processes or threads, and the tables that they fill."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import pandas as pd

from strapdown.typing import Progress

if TYPE_CHECKING:  # half of what a process needs to begin
    from strapdown.experiments.monte_carlo.campaign import Campaign
    from strapdown.experiments.monte_carlo.study import Study

Key, Of, Result = TypeVar("Key"), TypeVar("Of"), TypeVar("Result")
ENOUGH = 10
"""Runs of each cell; with fewer a study shows how it works, and decides nothing."""


class StudyTables(dict[str, pd.DataFrame]):
    """{name: table} of finished runs; a table that no run has filled is empty."""

    def __missing__(self, name: str) -> pd.DataFrame:
        return pd.DataFrame()


class Task(NamedTuple):
    """A call that fills a table, which a process can make by itself."""

    table: str
    # of `given`: the rows, a DataFrame of them, or {table: DataFrame} where a run fills several
    make: Callable[..., Any]
    given: tuple[Any, ...] = ()


def part_of(progress: Progress | None, begin: float, end: float) -> Progress | None:
    """Return the Progress of a part that spans the fractions `begin` to `end` of the whole; None
    without `progress`."""
    return (lambda done: progress(begin + done * (end - begin))) if progress else None


def on_threads(
    work: Callable[[Of], Result],
    tasks: Sequence[Of],
    threads: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Result]:
    """Yields what `work` makes of each task, in their order; threads: the processors by default;
    progress: called with the fraction done."""
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        yield from _report_results(pool.map(work, tasks), len(tasks), progress)


def collect_tables(
    tasks: Sequence[Task], workers: int = 0, progress: Progress | None = None
) -> StudyTables:
    """The tables that the tasks fill, rows in their order; workers: processes, 0 for the
    processors; progress: called with the fraction done."""
    parts: dict[str, list[pd.DataFrame]] = {}
    for made in _report_results(_on_processes(tasks, workers), len(tasks), progress):
        for name, rows in made.items():
            parts.setdefault(name, []).append(rows)
    return StudyTables({name: pd.concat(own, ignore_index=True) for name, own in parts.items()})


def campaigns(
    studies: Mapping[Key, "Study"],
    folder: Callable[[Key], Path],
    progress: Progress | None = None,
    **given: Any,
) -> dict[Key, "Campaign"]:
    """Runs what is missing of the studies, each in a folder of its own, where it can be resumed;
    given: as in Study.run."""
    steps = {key: study.steps() for key, study in studies.items()}
    total, done, found = sum(steps.values()), 0, {}
    for key, study in studies.items():
        part = part_of(progress, done / total, (done + steps[key]) / total)
        found[key] = study.run(folder(key), progress=part, **given)
        done += steps[key]
    return found


def _on_processes(tasks: Sequence[Task], workers: int) -> Iterator[Mapping[str, pd.DataFrame]]:
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers == 1:
        yield from map(_make_table, tasks)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        yield from pool.map(_make_table, tasks)


def _make_table(task: Task) -> Mapping[str, pd.DataFrame]:
    made = task.make(*task.given)
    if isinstance(made, dict):
        return made
    return {task.table: made if isinstance(made, pd.DataFrame) else pd.DataFrame(list(made))}


def _report_results(
    results: Iterator[Result], count: int, progress: Progress | None
) -> Iterator[Result]:
    """Yield the results, and report the fraction done before each."""
    for done, result in enumerate(results, 1):
        if progress:  # before it is handed out: nobody may come for another one
            progress(done / count)
        yield result
