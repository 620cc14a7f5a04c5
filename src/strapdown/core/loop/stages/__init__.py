"""Stages that only some runs need, a file each: a kernel with its equation and source, and which
runs need it. The loop calls it by its address, so that a run without it pays nothing.

A stage between a measurement and the filter is added as a file here and a line in PREPARE.
"""

from typing import Any, NamedTuple

import numpy as np

from ....typing import Ints
from ..cursor import Cursor
from ..kernels import Kernels
from ..tables import Fixes
from . import (
    adaptive,
    clock,
    contradicting,
    dead_reckoning,
    disturbed_field,
    heights,
    imu_errors,
    robust,
    side_slip,
    time_correlated,
)

PREPARE = (
    (disturbed_field.exclude_disturbed_field, disturbed_field.is_needed),
    (clock.look_back, clock.is_needed),
    (side_slip.inflate_side_slip, side_slip.is_needed),
    (time_correlated.fade_errors, time_correlated.is_needed),
    (adaptive.inflate_std, adaptive.is_needed),
    (heights.compare_heights, heights.is_needed),
    (contradicting.judge_beside_gnss, contradicting.is_needed),
    (dead_reckoning.alone, dead_reckoning.is_needed),
)
"""(kernel, whether a run with these sources and this cursor needs it) in the order in which a measurement goes through
them."""


class Needed(NamedTuple):
    """The stages of a run, as kernels."""

    prepare: tuple[Any, ...] = ()
    weigh: Any = None
    contradicted: Any = None
    correct_increments: Any = None
    uncorrect_increments: Any = None
    after_step: tuple[Any, ...] = ()

    @property
    def kernels(self) -> tuple[Any, ...]:
        """All of them."""
        single = (self.weigh, self.contradicted, self.correct_increments, self.uncorrect_increments)
        return (*self.prepare, *filter(None, single), *self.after_step)

    def addresses(self, predict: int, correct: int, observers: Ints) -> Kernels:
        """The kernels of a run with these stages; compiles what is not there."""

        def several(kernels: tuple[Any, ...]) -> Ints:
            return np.array([kernel.address for kernel in kernels], np.int64)

        def one(kernel: Any) -> int:
            return int(kernel.address) if kernel else 0

        return Kernels(
            predict,
            correct,
            observers,
            several(self.prepare),
            one(self.weigh),
            one(self.contradicted),
            one(self.correct_increments),
            one(self.uncorrect_increments),
            several(self.after_step),
        )


NONE = Needed()


def needed_stages(fixes: Fixes, cursor: Cursor) -> Needed:
    """The stages of a run with these sources."""
    sources, of_imu = fixes.sources, cursor.coupled.size > 0
    after = [imu_errors.couple_prediction] if of_imu else []
    return Needed(
        tuple(kernel for kernel, by in PREPARE if by(sources, cursor)),
        robust.weigh if robust.is_needed(sources, cursor) else None,
        heights.exclude_contradicting if heights.is_needed(sources, cursor) else None,
        imu_errors.remove_imu_errors if of_imu else None,
        imu_errors.add_imu_errors if of_imu else None,
        (*after, *([clock.keep] if clock.is_needed(sources, cursor) else [])),
    )
