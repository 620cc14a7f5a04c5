"""Noise stated five times wrong, of the IMU or of the receiver, and what `tune` makes of it."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from strapdown.engine.batch import fuse
from strapdown.tuning.tune import tune

from .worlds import WORLDS, fixes_stated, imu_stated, nis_over_expected, record_world, score

WRONG = {
    "IMU stated too noisy": (5.0, 1.0),
    "IMU stated too good": (0.2, 1.0),
    "GNSS stated too noisy": (1.0, 5.0),
    "GNSS stated too good": (1.0, 0.2),
}
"""Factors of the noise of the IMU and of the standard deviations of the fixes."""
RIGHT, STATED, TUNED = "right", "as stated", "tuned"


def rows(world: str, seeds: Iterable[int]) -> Iterator[dict[str, Any]]:
    """A row per seed, mistake and way."""
    for seed in seeds:
        right = record_world(world, seed)
        best = fuse(right, imu=WORLDS[world].grade)
        for mistake, (of_imu, of_fixes) in WRONG.items():
            stated, imu = fixes_stated(right, of_fixes), imu_stated(world, of_imu)
            found = tune(stated, imu=imu)
            ways = {
                RIGHT: best,
                STATED: fuse(stated, imu=imu),
                TUNED: fuse(found.tuned, imu=found.imu),
            }
            for way, solution in ways.items():
                yield {
                    "world": world,
                    "mistake": mistake,
                    "way": way,
                    "seed": seed,
                    "nis": float(np.median(nis_over_expected(solution))),
                } | score(solution, right)._asdict()
