"""All checks of a recording against itself."""

from collections.abc import Callable

from ..recording import Recording
from . import clock, heights, plane, position_velocity, repeats, turns
from .checked import Checked
from .motion import Subject

CHECKS: tuple[Callable[[Subject], Checked], ...] = (
    position_velocity.check,
    turns.check,
    plane.check,
    clock.check,
    heights.check,
    repeats.check,
)
"""In the order in which they are told."""


def check(recording: Recording) -> Checked:
    """What all checks say of a Recording, the weightiest reason first."""
    found, subject = Checked.nothing(), Subject(recording)
    for each in CHECKS:
        found.add(each(subject))
    found.reasons.sort(key=lambda reason: -reason.weight)
    return found
