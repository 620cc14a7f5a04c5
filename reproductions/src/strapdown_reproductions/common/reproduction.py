"""Options of a reproduction, and the call that `strapdown reproduce NAME` makes."""

from collections.abc import Callable, Sequence
from functools import wraps
from inspect import Parameter, Signature
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from strapdown.checks import check_number
from strapdown.typing import File, Notify, Progress

from .signatures import keywords

SEED = 12
"""Seed of the studies of the papers: one that was used nowhere before their rules were written."""


class Asked(NamedTuple):
    """Options of a run of a reproduction; each reproduction takes some of them."""

    quick: bool = False  # less of it, in about a minute
    runs: int | None = None  # of each cell; None: as many as the study has, quick or not
    seed: int = SEED  # the first, or from which the seeds of the runs are made; 0 or more
    ablations: bool = False  # also what decides the result
    # folder of the recordings or of their descriptions; None: that of the source tree or of the data
    recordings: File | None = None
    filter: Sequence[str] = ()  # what alone runs; empty: all
    scenario: Sequence[str] = ()  # the same of scenarios
    workers: int = 0  # processes; 0: the processors
    threads: int | None = None  # None: the processors
    scheduler: str | None = None  # address of a Dask scheduler
    notify: Notify | None = None  # told what begins and what takes long
    progress: Progress | None = None  # called with the fraction done

    def run_count(self, full: int, few: int) -> int:
        """Return the number of runs of each cell: `runs` where given, else `full`, or `few` for a
        quick run."""
        if self.runs is None:
            return few if self.quick else full
        return self.runs

    def count(self, full: int, few: int, least: int = 1) -> int:
        """Return `wanted`. Raises DataError where it or the seed is out of range."""
        count = self.run_count(full, few)
        check_number(count, "runs", least=least, whole=True)
        check_number(self.seed, "seed", least=0, whole=True)
        return count

    def seeds(self, full: int, few: int) -> list[int]:
        """Return `count` seeds of runs, made from `seed`. Raises DataError."""
        return [1000 * self.seed + k for k in range(self.count(full, few))]

    def seeds_from(self, full: int, few: int) -> range:
        """Return `count` seeds, of which `seed` is the first. Raises DataError."""
        return range(self.seed, self.seed + self.count(full, few))


USUAL = Asked()
Reproduce: TypeAlias = Callable[..., list[dict[str, Any]]]


def reproduction(
    *options: str, usual: Asked = USUAL
) -> Callable[[Callable[[Path, Asked], list[dict[str, Any]]]], Reproduce]:
    """A decorator: makes of a function of the folder of the results and an Asked, which writes the
    page into it and returns the claims, one that takes the folder and these `options` of Asked as
    keywords.

    Its signature has them, because `strapdown reproduce` goes by it; usual: what they are where they
    are not given.
    """
    known = keywords({name: getattr(usual, name) for name in options})
    taken = Signature([Parameter("out", Parameter.POSITIONAL_OR_KEYWORD), *known])

    def with_options(run: Callable[[Path, Asked], list[dict[str, Any]]]) -> Reproduce:
        @wraps(run)
        def reproduce(*given: Any, **named: Any) -> list[dict[str, Any]]:
            bound = taken.bind(*given, **named).arguments
            out = Path(bound.pop("out"))
            return run(out, usual._replace(**bound))

        # the type of a function knows no __signature__
        reproduce.__signature__ = taken  # type: ignore[attr-defined]
        return reproduce

    return with_options
