"""Tasks of a reproduction on the processors of this machine."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Task = TypeVar("Task")
Made = TypeVar("Made")


def on_processes(
    run: Callable[[Task], Made], tasks: Sequence[Task], workers: int
) -> Iterator[Made]:
    """What `run` makes of each task, in their order, by so many processes; 0: the processors."""
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers == 1:
        yield from map(run, tasks)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        yield from pool.map(run, tasks)
