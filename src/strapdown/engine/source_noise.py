"""Error models of sources in a run: correlated, robust, adaptive. Checks of their values, fallbacks
for filters without them, and the numbers for the loop."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..checks import DataError, brief, check_array, check_flag, check_number
from ..core.loop.contract import (
    Filter,
    SourceRow,
)
from ..data.solution import Correlated, Source
from ..units.constants import MAX_TIME_CONSTANT


def place_noise(source: SourceRow, a: Source, first: int) -> int:
    """Write the error model of a source into its row; the states of its correlated errors begin at
    `first`. Return the number of these states."""
    source.robust, source.memory, source.kept = a.robust, a.adaptive, 1.0
    if a.correlated is None:
        return 0
    std = np.asarray(a.correlated.std)
    source.correlation_time, source.correlated_std[: len(std)] = a.correlated.time, std
    rows = correlated_rows(a)
    for k, i in enumerate(rows):
        source.correlated_state[i] = first + k
    return len(rows)


def correlated_rows(a: Source) -> list[int]:
    """Return the rows of a source whose correlated errors are states."""
    if a.correlated is None or not a.correlated.states:
        return []
    return [i for i, std in enumerate(a.correlated.std) if std > 0]


def checked_noise(a: Source) -> Source:
    """Return a source with checked `correlated`, `robust` and `adaptive`. Raises DataError."""
    what, many = a.name or a.kind, np.shape(a.std)[1] if np.ndim(a.std) == 2 else 1
    check_flag(a.robust, f"{what}: robust")
    check_number(a.adaptive, f"{what}: adaptive", "s", least=0, most=MAX_TIME_CONSTANT)
    if a.correlated is not None:
        if not isinstance(a.correlated, Correlated):
            raise DataError(
                f"{what}: correlated is {brief(a.correlated)}; it must be a Correlated, std and time"
            )
        std, time, states = a.correlated
        check_number(time, f"{what}: time of its correlated errors", "s", above=0, most=1e6)
        check_flag(states, f"{what}: states of its correlated errors")
        errors = f"{what}: std of its correlated errors"
        check_array(std, errors, (many,), least=0, most=1e6, what="numbers, SI, by row")
        if not any(std):
            raise DataError(f"{errors} is {tuple(std)}; one must be above 0")
    return a


def weighable(filter: Filter, sources: Sequence[Source]) -> tuple[Sequence[Source], list[str]]:
    """Return these sources, without robust or adaptive models where `filter` cannot use them, and a
    note on that."""
    names = dict.fromkeys(a.name or a.kind for a in sources if a.robust or a.adaptive)
    if filter.weighs or not names:
        return sources, []
    return [replace(a, robust=False, adaptive=0.0) for a in sources], [
        f"{filter.name} has gains that do not depend on the noise of a fix: it ignores robust and "
        f"adaptive of {', '.join(names)} and keeps the gate"
    ]


def with_correlated_errors(
    filter: Filter, sources: Iterable[Source]
) -> tuple[tuple[Source, ...], list[str]]:
    """(these sources with their correlated errors as states only where `filter` can have them,
    notes about the others). Raises DataError for such that cannot be."""
    found, changed = [checked_noise(a) for a in sources], dict[str, None]()
    for k, a in enumerate(found):
        used = filter.uses is None or a.kind in filter.uses
        if used and not filter.installation and a.correlated is not None and a.correlated.states:
            changed[a.name or a.kind] = None
            found[k] = replace(a, correlated=a.correlated._replace(states=False))
    return tuple(found), [
        f"{filter.name} does not estimate the correlated errors of {name}: it adds them to the "
        "standard deviations, and the time-correlated errors are larger than it claims"
        for name in changed
    ]
