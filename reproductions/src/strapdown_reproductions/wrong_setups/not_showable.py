"""Mistakes that the data of a recording cannot show, with the reason, written down before the table
ran. Where such a mistake is harmful the verdict must name as not tested what was mistaken."""

from typing import NamedTuple

from strapdown.verdict import CAUSES

from .mistakes import Mistake


class Hidden(NamedTuple):
    """Mistakes that some recordings cannot show."""

    groups: tuple[str, ...]
    recordings: tuple[str, ...]
    reason: str
    cause: str  # key of CAUSES: what the verdict must name as not tested


BROAD = ("BROAD 02", "BROAD 15", "BROAD 21")
ON_WHEELS = ("car", "car with odometer", "drive0708", "drive0708-vehicle")
UNCONSTRAINED = (
    "car",
    "flight",
    "ship",
    "hand-held",
    "thor75",
    "drive0708",
    "swisslog",
    *BROAD,
)
NOT_SHOWABLE: tuple[Hidden, ...] = (
    Hidden(
        ("mounting",),
        UNCONSTRAINED,
        "no constraint says how the vehicle lies in the axes of the IMU, and the angle is within "
        "what slip, crab and angle of attack are between heading and course",
        "mounting",
    ),
    Hidden(
        ("height",),
        (*ON_WHEELS, "ship", "hand-held", "thor75", "swisslog", *BROAD),
        "there is one source of height alone",
        "height",
    ),
    Hidden(
        ("antenna arm, up",),
        ON_WHEELS,
        "a car tilts by a few degrees at most, so that the arm's vertical part is an offset of the "
        "height, and there is one source of height alone",
        "lever arm",
    ),
    Hidden(
        ("clock of GNSS",),
        ("BROAD 02",),
        "the body turns in its place: at 0.07 m/s rms it does not leave the noise of its fixes, "
        "and what it accelerates is within that of its accelerometers",
        "clock",
    ),
    Hidden(
        ("drift",),
        BROAD,
        "no velocity stands beside the positions, and an IMU feels no constant velocity",
        "lasting errors",
    ),
)
"""What the data cannot show."""


def hidden(mistake: Mistake, recording: str) -> Hidden | None:
    """Why the recording cannot show the mistake; None where it can."""
    for each in NOT_SHOWABLE:
        if mistake.group in each.groups and recording in each.recordings:
            return each
    return None


def named(why: Hidden, untested: tuple[str, ...]) -> bool:
    """Whether what was mistaken is named as not tested."""
    words = (why.cause, CAUSES[why.cause])
    return any(word in text for text in untested for word in words)
