"""The clock of a sensor set to GPS time by the order of the messages in a file."""

from typing import NamedTuple

import numpy as np

from ....typing import Array, Ints

RESTART = 10_000
"""Ticks: a tag that goes back by more is a new beginning of the clock."""
LONG = 60.0
"""s: over a shorter file the rate of the sensor's clock is taken as stated."""
TICKS = (1e-3, 1 / 25600)
"""s: what a tag counts, of ESF-MEAS (u-blox F9R integration manual) and, seen in files, of the
ESF-RAW of an M8U."""
PPM = 500e-6
"""How far the rate of a clock may be from the stated one."""


class Line(NamedTuple):
    """GPS time = tick * (tag - tag0) + gps0, s."""

    tick: float
    tag0: float
    gps0: float
    scatter: float  # s, median of the distances of the epochs from the line

    def gps(self, tag: Ints) -> Array:
        """s"""
        return np.asarray(self.tick * (tag - self.tag0) + self.gps0, float)


def unwrapped(tag: Ints) -> tuple[Ints, Ints]:
    """(tags without the turns of their 32 bits (n,), piece that each is of (n,)); a clock that
    begins anew begins a piece."""
    step = np.diff(tag, prepend=tag[:1])
    step = (step + 2**31) % 2**32 - 2**31
    anew = (step < -RESTART) | (step > 2**30)
    return tag[0] + np.cumsum(np.where(anew, 0, step)), np.cumsum(anew)


def fit(tag: Array, gps: Array, ticks: tuple[float, ...] = TICKS) -> Line | None:
    """The line through epochs (n,): what the tag was, between samples, when each came. None where
    they fit none of the `ticks`.

    The offset is a median, and so is the rate over a long file, so that messages that came late move
    neither. A line keeps the steadiness of the sensor's own clock.
    """
    if not len(tag):
        return None
    tick = ticks[0] if len(ticks) == 1 else _tick(tag, gps, ticks)
    if tick is None:
        return None
    span = np.ptp(gps)
    if span > LONG:
        third = len(tag) // 3
        early, late = slice(None, third + 1), slice(-third - 1, None)
        rest = gps - tick * tag
        run = np.median(gps[late]) - np.median(gps[early])
        drift = (np.median(rest[late]) - np.median(rest[early])) / run if run > 0 else 0.0
        tick *= 1 + float(np.clip(drift, -PPM, PPM))
    middle = float(np.median(tag))
    rest = gps - tick * (tag - middle)
    offset = float(np.median(rest))
    return Line(tick, middle, offset, float(np.median(np.abs(rest - offset))))


def _tick(tag: Array, gps: Array, ticks: tuple[float, ...]) -> float | None:
    """The one of several that the epochs fit, to a fifth."""
    steps, dt = np.diff(tag), np.diff(gps)
    fair = (steps > 0) & (dt > 0)
    if not fair.any():
        return None
    rate = float(np.median(dt[fair] / steps[fair]))
    near = min(ticks, key=lambda each: abs(rate / each - 1))
    return near if abs(rate / near - 1) < 0.2 else None
