"""Many flights with the simulator's receiver of 1 m: whether the first position after a jump is
refused, how soon a small one that lasts is said, and what flights without a fault say."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from strapdown import filters
from strapdown.core.loop.contract import DOUBTFUL
from strapdown.data.recording import Recording
from strapdown.data.solution import Solution
from strapdown.engine.batch import fuse
from strapdown.geometry.geodesy import displace_lla

from .judging import news, plain
from .runs import OPTIONS, kinds
from .worlds import GENTLE, HARD, IN_HAND, MOTIONS, simulate_world

SIZES, LASTING = (50.0, 20.0, 10.0), 5.0
"""m of jumps whose first fix must be refused, and of one that must be said."""
EARLIEST, LATEST = 70.0, 170.0
"""s between which jumps happen."""
ONE, FOR_GOOD, NONE = "one fix", "for good", "no fault"
NOMINALS = (
    ("closed-loop", GENTLE),
    ("closed-loop", HARD),
    ("open-loop", GENTLE),
    ("mekf", GENTLE),
    ("nlo", GENTLE),
    ("attitude-mekf", IN_HAND),
)
"""(filter, motion) of the runs without a fault."""
NO_ALARMS = ("accelerometer bias not excited",)
"""Beginnings of events that are no alarms: a recording without a fault gives them too."""
COLUMNS = (
    "what",
    "size",
    "filter",
    "motion",
    "seed",
    "refused",
    "said_after",
    "doubtful_s",
    "says",
)


def trial(seed: int) -> list[dict[str, Any]]:
    """Rows of one seed: all jumps of the closed loop, and every run without a fault."""
    recording = _recording("closed-loop", GENTLE, seed)
    right = fuse(recording, "closed-loop", every=MOTIONS[GENTLE].every)
    rows = [_run_jump(seed, recording, right, size, what) for size, what in _jumps()]
    return rows + [_nominal(seed, name, motion) for name, motion in NOMINALS]


def _jumps() -> Iterator[tuple[float, str]]:
    for size in SIZES:
        yield size, ONE
        yield size, FOR_GOOD
    yield LASTING, FOR_GOOD


def _recording(name: str, motion: str, seed: int) -> Recording:
    """Return the simulated recording without faults, with the sources that the filter uses."""
    whole = simulate_world(MOTIONS[motion], seed)
    own = kinds(filters.find(name))
    return replace(whole, sources=tuple(a for a in whole.sources if a.kind in own))


def _run_jump(
    seed: int, recording: Recording, right: Solution, size: float, what: str
) -> dict[str, Any]:
    """The row of a jump to some side at some time."""
    rng = np.random.default_rng([seed, round(size)])
    where, side = rng.uniform(EARLIEST, LATEST), rng.uniform(0, 2 * np.pi)
    position, *others = recording.sources
    wrong = np.flatnonzero(position.t >= where)
    first = float(position.t[wrong[0]])
    wrong = wrong[:1] if what == ONE else wrong
    y = position.y.copy()
    y[wrong] = displace_lla(
        y[wrong], np.tile([size * np.cos(side), size * np.sin(side), 0.0], (len(wrong), 1))
    )
    faulted = replace(recording, sources=(replace(position, y=y), *others))
    solution = fuse(faulted, "closed-loop", every=MOTIONS[GENTLE].every)
    fixes = solution.innovations
    at = (np.abs(fixes.t - first) < 1e-6) & (fixes.source == 0)
    known = frozenset(plain(text) for _, text in right.events)
    said = [t for t, text in solution.events if t >= first - 1e-6 and news([text], known)]
    said += solution.t[(solution.status == DOUBTFUL) & (solution.t >= first)].tolist()[:1]
    return _row(
        (what, size, "closed-loop", GENTLE, seed),
        solution,
        refused=not fixes.accepted[at].any(),
        said_after=min(said, default=np.inf) - first,
    )


def _nominal(seed: int, name: str, motion: str) -> dict[str, Any]:
    solution = fuse(
        _recording(name, motion, seed),
        name,
        every=MOTIONS[motion].every,
        options=OPTIONS.get(name, {}),
    )
    return _row((NONE, 0.0, name, motion, seed), solution, refused=False, said_after=np.inf)


def _row(
    of: tuple[str, float, str, str, int], solution: Solution, refused: bool, said_after: float
) -> dict[str, Any]:
    doubtful = float((solution.status == DOUBTFUL).sum() * np.median(np.diff(solution.t)))
    said = [text for _, text in solution.events if not text.startswith(NO_ALARMS)]
    values = (*of, refused, said_after, doubtful, " | ".join(said))
    return dict(zip(COLUMNS, values))
