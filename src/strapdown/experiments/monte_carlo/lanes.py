"""Runs of a study side by side: eight records at a time through one filter, scored on the way."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core import lane_loop
from ...core.c_calls import aligned
from ...core.contract import Start
from ...core.signatures import LANES
from ...engine.batch import begin
from ...engine.prepare import Asked
from ...engine.side_by_side import SideBySide, why_alone
from ...evaluation.consistency import Limits
from ...filters.ins.open_loop import LEFT_MODEL
from ...recording import Recording
from ..filter_label import Labelled
from . import lane_scoring
from .scoring import Epochs, FixRows, Rows, Scored, scored

SAMPLES = 512
"""Samples that are simulated at once: they stay in the second cache of a core."""


class Record(NamedTuple):
    """A simulated run."""

    recording: Recording
    start: Start


def run_side_by_side(
    wanted: Labelled, imu: Any, records: Sequence[Record], at: Epochs, limits: Limits
) -> list[Scored | None] | None:
    """Scored of each of at most LANES records, None of those that must be run alone; None where all
    must."""
    label, options, _ = wanted
    asked = Asked(options, imu, records[0].start, every=at.every)
    first = begin(records[0].recording, label, asked)
    if why_alone(first):
        return None
    full = [*records, *[records[-1]] * (LANES - len(records))]
    biases = aligned(len(at.rows), 6, LANES)
    for lane, (recording, _) in enumerate(full):
        meta = recording.meta
        biases[..., lane] = np.c_[meta["b_a"][at.rows], meta["b_g"][at.rows]]
    lanes = SideBySide(
        first,
        [start for _, start in full],
        [recording for recording, _ in full],
        lane_scoring.keep_errors,
        lane_scoring.known(at),
        biases,
        lane_scoring.SCRATCH,
        lane_scoring.NUMBERS,
    )
    count = len(first.samples.t)
    t, dt, increments = np.empty(SAMPLES), np.empty(SAMPLES), aligned(SAMPLES, 6, LANES)
    advance = lanes.calls(t, dt, increments)
    for row in range(first.first, count, SAMPLES):
        part = slice(row, min(row + SAMPLES, count))
        size = part.stop - part.start
        t[:size], dt[:size] = first.samples.t[part], first.samples.dt[part]
        for lane, (recording, _) in enumerate(full):
            increments[:size, :3, lane] = recording.imu.dtheta[part]
            increments[:size, 3:, lane] = recording.imu.dv[part]
        advance(row, size)
    return [
        None if np.isfinite(lanes.left[lane]) else scored_lane(lanes, lane, at, limits)
        for lane in range(len(records))
    ]


def scored_lane(lanes: SideBySide, lane: int, at: Epochs, limits: Limits) -> Scored:
    """Scored of one of the runs."""
    kept, fix, cursor = lanes.out.kept[..., lane], lanes.out.fix[..., lane], lanes.cursor
    rows = Rows(
        kept[:, lane_scoring.ERROR],
        kept[:, lane_scoring.RPH],
        kept[:, lane_scoring.SD],
        kept[:, lane_scoring.NEES],
    )
    used = int(cursor.at[lane_loop.FIX])
    fixes = FixRows(
        lanes.fixes.t[:used],
        lanes.fixes.source[:used],
        fix[:used, lane_loop.INNOVATION :],
        fix[:used, lane_loop.NIS],
        fix[:used, lane_loop.USED] > 0,
    )
    held = [
        float(t)
        for condition, t in zip(lanes.filter.conditions, cursor.conditions[:, lane])
        if condition.text.startswith(LEFT_MODEL) and np.isfinite(t)
    ]
    return scored(rows, fixes, min(held, default=np.nan), at, limits)
