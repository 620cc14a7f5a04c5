"""Values that are held: fixes that repeat the one before, sources and channels that are stuck,
IMU samples that are written more than once."""

from collections.abc import Iterator

import numpy as np

from ..aiding import find
from ..core.loop.contract import Imu
from ..core.mathematics.earth import A
from ..data.recording import Recording
from ..data.solution import Source
from ..data.verdict import Reason
from ..preprocessing.stationary import at_rest
from ..typing import Array, Mask
from ..units.constants import FROZEN_ROWS, FROZEN_TIME
from .finding import Checked, label
from .motion import InspectedRecording

AROUND = 5
"""A fix moves where it and so many before and after it take two values or more."""
EVEN, MAX_EVEN = 0.25, 0.6
"""Values are held however long where so many of them last as long as is usual, within a share:
those of a vehicle that stands last as long as chance has it."""
MIN_FIXES, SHARE, COARSE_SHARE = 11, 0.15, 0.5
"""Fixes that must move, and the share of repeated ones from which they are a reason: of positions
and velocities, and of others, which may be coarse."""
IMU_SHARE = 0.3
"""The same of IMU samples, which are often written twice and do little harm."""
HEIGHTS = ("altitude", "pressure", "pressure-altitude")
"""Kinds that change with each fix, if they are not rounded."""
UNLIKELY, SELDOM = 25.0, 0.05
"""-ln of the chance of so many repeated values at the end from which a source is stuck, where so small a
share of values was repeated before."""
JUMP = 5.0
"""A source is stuck where a value lasts for FROZEN_TIME and FROZEN_ROWS and ends in a jump of so many
usual ones."""


def check(subject: InspectedRecording) -> Checked:
    """All recorded sources, and the IMU."""
    found = Checked.empty()
    found.reasons.extend(check_repeats(subject.recording))
    for source in subject.recording.sources:
        if source.kind in ("position", "velocity"):
            found.reasons.extend(_check_stuck(source))
        elif source.kind in HEIGHTS:
            found.reasons.extend(_check_stuck_at_end(source))
    found.reasons.extend(_imu(subject.recording.imu))
    return found


def check_repeats(recording: Recording) -> Iterator[Reason]:
    """Reasons against recorded sources that repeat their fixes, which makes any filter too sure."""
    for source in recording.sources:
        if find(source.kind).recorded:
            yield from _check_source_repeats(source)


def _same(y: Array) -> Mask:
    """(m,) whether a row (k,) is the one before."""
    with np.errstate(invalid="ignore"):
        same = (y[1:] == y[:-1]) | (np.isnan(y[1:]) & np.isnan(y[:-1]))
    return np.r_[False, same.all(axis=1)]


def _check_source_repeats(source: Source) -> Iterator[Reason]:
    """Fixes that repeat the one before while those around them change."""
    same = _same(source.y)
    if len(same) < MIN_FIXES:
        return
    # of 2 AROUND fixes, how many are new ones: none while a vehicle stands and its fixes are round
    total = np.r_[0, np.cumsum(~same)]
    k = np.arange(len(same))
    first, last = np.maximum(k - AROUND, 0), np.minimum(k + AROUND, len(same))
    alive = total[last] - total[first] >= 2
    count = int(alive.sum())
    share = float(same[alive].mean()) if count >= MIN_FIXES else 0.0
    share = max(share, _held_share(same))
    most = SHARE if source.kind in ("position", "velocity") else COARSE_SHARE
    if share > most:
        yield Reason(
            "repeated",
            f"{100 * share:.0f} % of the fixes repeat the one before while the vehicle moves: a "
            "filter that counts held values as new ones becomes overconfident",
            "keep only the rows where a fix arrived, for example with `where = { column = ..., "
            "changes = true }`",
            label(source),
            share / most,
        )


def _held_share(same: Mask) -> float:
    """The share of repeated fixes where all are held equally long, else 0."""
    lasts = np.diff(np.flatnonzero(~same))
    if len(lasts) < MIN_FIXES:
        return 0.0
    usual = float(np.median(lasts))
    even = np.abs(lasts - usual) <= EVEN * usual
    return 1.0 - 1.0 / usual if even.mean() > MAX_EVEN else 0.0


def _check_stuck(source: Source) -> Iterator[Reason]:
    """The longest time for which a value is held before a jump that is none of its usual ones."""
    new = np.flatnonzero(~_same(source.y))
    if len(new) < 3:
        return
    last = np.r_[new[1:], len(source.t)] - 1
    seconds, fixes = source.t[last] - source.t[new], last - new
    metres = [A, A, 1.0] if source.kind == "position" else 1.0
    # what is not measured does not jump
    change = np.nan_to_num(np.abs(np.diff(source.y[new] * metres, axis=0)))
    jumps = np.r_[change.max(axis=1), 0.0]
    stuck = (seconds > FROZEN_TIME) & (fixes >= FROZEN_ROWS) & (jumps > JUMP * np.median(jumps))
    if not stuck.any():
        return
    k = int(np.argmax(np.where(stuck, seconds, 0)))
    yield Reason(
        "repeated",
        f"the source is stuck at one value from {source.t[new[k]]:.1f} to {source.t[last[k]]:.1f} "
        f"s and then jumps (in all {int(stuck.sum())} times)",
        "leave those rows out",
        label(source),
        float(min(seconds[k] / FROZEN_TIME, 10.0)),
    )


def _check_stuck_at_end(source: Source) -> Iterator[Reason]:
    """A height that repeats one value to the end and hardly ever did before: noise repeats none, at rest
    either, and a rounded height repeats many."""
    same = _same(source.y)
    begin = int(np.flatnonzero(~same)[-1]) if len(same) else 0
    stuck = len(same) - 1 - begin
    if stuck < FROZEN_ROWS or source.t[-1] - source.t[begin] < FROZEN_TIME:
        return
    usual = (same[:begin].sum() + 1) / (begin + 2)
    if usual < SELDOM and -stuck * np.log(usual) > UNLIKELY:
        yield Reason(
            "repeated",
            f"the source is stuck at one value from {source.t[begin]:.1f} s to its end",
            "leave those rows out, and check the sensor",
            label(source),
            float(stuck / FROZEN_ROWS),
        )


def _imu(imu: Imu) -> Iterator[Reason]:
    """IMU samples in motion that read the same as the one before."""
    moving = ~at_rest(imu)
    values = np.c_[imu.dtheta, imu.dv] / imu.dt[:, None]
    same = np.r_[False, (np.abs(np.diff(values, axis=0)) < 1e-9).all(axis=1)] & moving
    share = same.sum() / max(int(moving.sum()), 1)
    if moving.sum() > MIN_FIXES and share > IMU_SHARE:
        yield Reason(
            "repeated",
            f"{100 * share:.0f} % of the IMU samples in motion equal the one before: the log has "
            "more rows than the IMU measured",
            "keep only the rows where the IMU measured",
            weight=float(share / IMU_SHARE),
        )
