"""All checks of a recording against itself."""

from collections.abc import Callable

from ..recording import Recording
from . import clock, position_velocity, turns
from .checked import Checked

CHECKS: tuple[Callable[[Recording], Checked], ...] = (
    position_velocity.check,
    clock.check,
    turns.check,
)
"""In the order in which they are told."""


def check(recording: Recording) -> Checked:
    """What all checks say of a Recording, the weightiest reason first."""
    found = Checked.nothing()
    for each in CHECKS:
        found.add(each(recording))
    found.reasons.sort(key=lambda reason: -reason.weight)
    return found
