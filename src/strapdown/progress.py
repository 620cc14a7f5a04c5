"""Progress of a long call: a bar with the time left in a notebook or on a terminal, where it is asked
for by `progress=True`."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

from .checks import DataError, brief
from .typing import Progress

P = ParamSpec("P")
R = TypeVar("R")
STEP = 0.2
"""s between two looks of a bar in a notebook."""
EARLY = 0.02
"""Fraction done below which nothing is said of the time left."""


def listener(progress: Progress | bool | None) -> Progress:
    """A function of the fraction done, 0 to 1: what was given as `progress`, or where that is None or
    False one that does nothing. Raises DataError where it is something else."""
    if callable(progress):
        return progress
    if progress not in (None, False):
        raise DataError(
            f"progress is {brief(progress)}; it must be True, or a function of the fraction done"
        )
    return lambda done: None


def with_bar(name: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function that has the keyword `progress` show a `bar` of that name where it is True."""

    def wrap(call: Callable[P, R]) -> Callable[P, R]:
        @wraps(call)
        def call_with_bar(*args: P.args, **options: P.kwargs) -> R:
            if options.get("progress") is not True:
                return call(*args, **options)
            with bar(name) as tell:
                options["progress"] = tell
                return call(*args, **options)

        return call_with_bar

    return wrap


@contextmanager
def bar(name: str) -> Iterator[Progress]:
    """A function of the fraction done that shows it with the time left: in a cell of a notebook, or
    on standard error where that is a terminal; else nowhere. The bar goes when the block ends."""
    if _in_notebook():
        with _cell(name) as tell:
            yield tell
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import Progress

        with Progress(console=Console(stderr=True), transient=True) as shown:
            task = shown.add_task(name, total=1.0)
            yield lambda done: shown.update(task, completed=float(done))
    else:
        yield listener(None)


def _in_notebook() -> bool:
    """Return True where this process is the kernel of a notebook."""
    ipython: Any = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


@contextmanager
def _cell(name: str) -> Iterator[Progress]:
    """As `bar`, in the output of a cell; plain HTML, for rich wants widgets there."""
    ipython: Any = import_module("IPython.display")
    begun = perf_counter()
    shown = ipython.display(ipython.HTML(bar_html(name, 0.0, 0.0)), display_id=True)
    last = begun

    def tell(done: float) -> None:
        nonlocal last
        if (now := perf_counter()) - last > STEP:
            shown.update(ipython.HTML(bar_html(name, float(done), now - begun)))
            last = now

    try:
        yield tell
    finally:
        shown.update(ipython.HTML(""))


def bar_html(name: str, done: float, elapsed: float) -> str:
    """HTML of a bar: fraction done, and the time left by the time of the part that is done, s."""
    left = ""
    if done > EARLY:
        minutes, seconds = divmod(round(elapsed * (1 - done) / done), 60)
        left = f", {minutes}:{seconds:02} min left"
    return f"<progress max=1 value={done:.3f}></progress> {name}: {100 * done:.0f} %{left}"
