"""Position errors that last: what a filter claims that takes them for white, one that has them as
states, and one with the values that `tune` finds."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from strapdown.data.recording import Recording
from strapdown.data.solution import Correlated
from strapdown.engine.batch import fuse
from strapdown.sensor_models.gnss import Gnss
from strapdown.tuning.tune import tune

from .worlds import WORLDS, record_world, score

TIMES = (0.0, 30.0, 120.0)
"""s over which errors are correlated; 0: white."""
SIZE, WHITE = (1.5, 1.5, 2.5), (0.3, 0.3, 0.5)
"""m, north, east, down: standard deviations of what lasts, and of the white error beside it. Where
nothing lasts the white error has SIZE."""
AS_WHITE, STATES, TUNED = "as white", "states", "tuned"


def receiver(world: str, time: float) -> Gnss:
    """The receiver of a world with errors correlated over `time` s."""
    gnss = WORLDS[world].gnss
    if not time:
        return gnss._replace(position_std=SIZE)
    return gnss._replace(position_std=WHITE, position_correlated=Correlated(SIZE, time))


def as_white(recording: Recording) -> Recording:
    """The recording whose correlated errors are stated as white ones."""
    return replace(
        recording,
        sources=tuple(
            replace(a, std=np.hypot(a.std, a.correlated.std), correlated=None)
            if a.correlated
            else a
            for a in recording.sources
        ),
    )


def rows(world: str, time: float, seeds: Iterable[int], tuning: bool) -> Iterator[dict[str, Any]]:
    """A row per seed and way."""
    for seed in seeds:
        right = record_world(world, seed, receiver(world, time))
        white = as_white(right)
        ways = {AS_WHITE: fuse(white), STATES: fuse(right)}
        if tuning:
            found = tune(white)
            ways[TUNED] = fuse(found.tuned, imu=found.imu)
        for way, solution in ways.items():
            yield {"world": world, "time": time, "way": way, "seed": seed} | score(
                solution, right
            )._asdict()
