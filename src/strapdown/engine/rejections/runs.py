"""Runs of rejected fixes of each source, from the rows of the loop.

Rejections less than FOLD s apart belong together, unless consecutive ones stand out from the
others. Single outliers are collected over the whole recording. They count as chance where the gate
would reject as many correct fixes.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ...core.loop.log import FOLD
from ...data.solution import Source
from ...typing import Ints, Mask
from ...units.constants import SETTLING
from . import causes
from .causes import CauseFound
from .chance import as_many, farther
from .contradictions import CHAIN, RejectedRun, assign_blame, merge_runs
from .windows import WindowFixes, window

FEW = 3  # rejections: fewer are single outliers
AT_ONCE = 4  # rejections in a row that can stand out
STANDS_OUT = 1e-3  # largest expected number of such rows, given the share of the others
UNLIKELY = 1e-3  # probability of as many single rejections by chance, or of one as far off
INEXACT = 2.0  # times the number expected by chance, because no model fits its distribution exactly
MAX_RUNS = 10  # separate runs of a source; the last includes all that follow
WHOLE = (*causes.LASTING, causes.NOISE, causes.ALWAYS)
"""Causes that can explain rejections with accepted fixes between them."""


def find(fixes: WindowFixes, sources: Sequence[Source]) -> list[RejectedRun]:
    """Return the runs of all sources in order of their beginning, without those by chance."""
    runs: list[RejectedRun] = []
    for s in np.unique(fixes.rows["source"][fixes.rejected].astype(int)).tolist():
        found = _of_source(s, fixes.of(s), fixes, sources[s].kind)
        runs += [run._replace(receiver=sources[s].receiver) for run in found]
    return assign_blame(sorted(runs, key=lambda run: (run.start, run.source)))


def join_runs(before: Sequence[RejectedRun], now: Sequence[RejectedRun]) -> list[RejectedRun]:
    """Join earlier runs and later ones: single outliers of a source are one run, and so are all
    runs after its MAX_RUNS-th."""
    found: dict[int, list[RejectedRun]] = {}
    for run in (*before, *now):
        own = found.setdefault(run.source, [])
        single = run.found.shape == causes.OUTLIERS
        alike = [k for k, each in enumerate(own) if single and each.found.shape == causes.OUTLIERS]
        if alike or len(own) > MAX_RUNS:
            k = alike[0] if alike else len(own) - 1
            own[k] = merge_runs([own[k], run])
        else:
            own.append(run)
    return sorted((run for own in found.values() for run in own), key=lambda r: (r.start, r.source))


def _of_source(s: int, own: WindowFixes, every: WindowFixes, kind: str) -> list[RejectedRun]:
    found, single = list[RejectedRun](), list[int]()
    chains = _distant_rejections(own, np.flatnonzero(own.rejected), CHAIN)
    whole = _together(own, every, kind, chains)
    if whole is not None:
        return [_run(s, own, np.concatenate(chains), whole)]
    for bad in chains:
        if len(found) >= MAX_RUNS:
            found[-1] = merge_runs([found[-1], _run(s, own, bad, found[-1].found)])
            continue
        for part, cause in _explain_chain(own, every, kind, bad):
            if cause is None or cause.shape == causes.OUTLIERS:
                single += part.tolist()
            else:
                found.append(_mark_start_error(_run(s, own, part, cause), own.began))
    if single and not _by_chance(own, np.array(single)):
        nothing = CauseFound(
            causes.OUTLIERS, np.empty(0), float(own.t[single[0]]), np.inf, np.nan, 0.0
        )
        found.append(_run(s, own, np.array(single), nothing))
    return found


def _together(
    own: WindowFixes, every: WindowFixes, kind: str, chains: list[Ints]
) -> CauseFound | None:
    """Find one lasting cause of all chains of rejections; None where there is none."""
    long = [chain for chain in chains if len(chain) >= FEW]
    if len(long) < 2:
        return None
    found = _without_onset(causes.find(window(own, every, kind, long)), own)
    return found if found.shape in WHOLE else None


def _explain_chain(
    own: WindowFixes, every: WindowFixes, kind: str, bad: Ints
) -> Iterator[tuple[Ints, CauseFound | None]]:
    """Yield a chain of rejections, or each of its parts, with its cause; None for few
    rejections."""
    if len(bad) < FEW:
        yield bad, None
        return
    parts = list(_parts(own, bad))
    found = _without_onset(causes.find(window(own, every, kind, parts)), own)
    if len(parts) == 1 or found.shape in WHOLE:
        yield bad, found
        return
    before = 0
    if len(parts) > MAX_RUNS:
        parts[MAX_RUNS - 1 :] = [np.concatenate(parts[MAX_RUNS - 1 :])]
    for part in parts:
        cause = None
        if len(part) >= FEW:
            cause = causes.find(window(own, every, kind, [part], before))
            before = int(part[-1]) + 1
        yield part, cause


def _without_onset(found: CauseFound, own: WindowFixes) -> CauseFound:
    """Change the cause of a drift from the beginning, which may as well be that of the other
    sources."""
    early = found.shape == causes.DRIFT and found.since < own.began + CHAIN
    return found._replace(shape=causes.ALWAYS) if early else found


def _mark_start_error(run: RejectedRun, begin: float) -> RejectedRun:
    """Mark a run that ends soon after the filter began: it may come from an error of the start or
    of the fixes."""
    if run.found.shape == causes.NOISE or run.stop > begin + SETTLING:
        return run
    return run._replace(found=run.found._replace(shape=causes.START))


def _distant_rejections(own: WindowFixes, bad: Ints, seconds: float) -> list[Ints]:
    """Return groups of rejections that are more than `seconds` apart."""
    return np.split(bad, np.flatnonzero(np.diff(own.t[bad]) > seconds) + 1)


def _parts(own: WindowFixes, bad: Ints) -> Iterator[Ints]:
    """Yield groups of rejections that belong together."""
    rejected = own.rejected
    for part in _distant_rejections(own, bad, FOLD):
        for first, last in _split(rejected, int(part[0]), int(part[-1])):
            yield bad[(bad >= first) & (bad <= last)]


def _split(rejected: Mask, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Yield the parts of [first, last] where its longest row of rejections stands out from the
    others."""
    inside = rejected[first : last + 1]
    edges = np.flatnonzero(np.diff(np.r_[0, inside.astype(int), 0]))
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    begin, end = int(starts[longest]), int(ends[longest])
    length, others = end - begin, len(inside) - (end - begin)
    share = (inside.sum() - length + 1) / (others + 2)
    if length < AT_ONCE or not others or others * share**length > STANDS_OUT:
        yield first, last
        return
    if begin:
        yield from _split(rejected, first, first + int(ends[longest - 1]) - 1)
    yield first + begin, first + end - 1
    if end < len(inside):
        yield from _split(rejected, first + int(starts[longest + 1]), last)


def _run(s: int, own: WindowFixes, bad: Ints, found: CauseFound) -> RejectedRun:
    first, last = int(bad[0]), int(bad[-1])
    off = float(np.sqrt((own.nis[bad] / np.maximum(own.measured[bad], 1)).max()))
    start, stop = float(own.t[first]), float(own.t[last])
    begin = int(np.searchsorted(own.t, found.since))
    silent = float(own.t[begin] - own.t[begin - 1]) if 0 < begin < len(own.t) else np.inf
    return RejectedRun(s, start, stop, len(bad), last - first + 1, off, found, silent=silent)


def _by_chance(own: WindowFixes, bad: Ints) -> bool:
    """True where correct measurements would be rejected as often, and as far off, by the
    distribution of the NIS."""
    rows, nearest = own.measured, float(own.nis[own.rejected].min())
    expected = sum(
        count * farther(k, nearest) for k, count in enumerate(np.bincount(rows).tolist())
    )
    farthest = min(map(farther, rows[bad].tolist(), own.nis[bad].tolist())) * len(rows)
    many = as_many(len(bad), INEXACT * expected)
    return many > UNLIKELY and farthest > UNLIKELY
