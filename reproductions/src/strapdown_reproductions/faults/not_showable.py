"""Faults that the data cannot show, with the reason."""

from typing import NamedTuple

from .worlds import ATTITUDE, HEAVE, NAVIGATION


class Hidden(NamedTuple):
    """Faults that families of filters cannot be shown."""

    faults: tuple[str, ...]
    families: tuple[str, ...]
    reason: str
    motions: tuple[str, ...] = ()  # empty: all


NOT_SHOWABLE: tuple[Hidden, ...] = (
    Hidden(
        ("height above the geoid",),
        (NAVIGATION,),
        "a constant offset of the one source of height",
    ),
    Hidden(
        ("position and velocity drift by 0.1 m/s",),
        (NAVIGATION,),
        "position and velocity agree with each other, and the IMU feels no constant velocity; the "
        "step of 0.1 m/s is one standard deviation of the velocity",
    ),
)
"""Written down with the reason."""


def hidden(fault: str, family: str, motion: str) -> Hidden | None:
    """Why a fault cannot be shown; None where it can."""
    for each in NOT_SHOWABLE:
        there = not each.motions or motion in each.motions
        if fault in each.faults and family in each.families and there:
            return each
    return None

