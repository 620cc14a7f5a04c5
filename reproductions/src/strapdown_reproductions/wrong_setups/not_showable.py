"""Mistakes that the data of a recording cannot show, with the reason, written down before the table
ran. Where such a mistake is harmful the verdict must name as not tested what was mistaken."""

from typing import NamedTuple

import numpy as np

from strapdown.data.verdict import CAUSES

from .mistakes import Mistake


class HiddenSetUp(NamedTuple):
    """Mistakes that some recordings cannot show."""

    groups: tuple[str, ...]
    recordings: tuple[str, ...]
    reason: str
    cause: str  # key of CAUSES: what the verdict must name as not tested
    below: float = np.inf  # s or m: only mistakes that are smaller


BROAD = ("BROAD 02", "BROAD 15", "BROAD 21")
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
NOT_SHOWABLE: tuple[HiddenSetUp, ...] = (
    HiddenSetUp(
        ("mounting",),
        UNCONSTRAINED,
        "no constraint says how the vehicle lies in the axes of the IMU, and the angle is within "
        "what slip, crab and angle of attack are between heading and course",
        "mounting",
    ),
    HiddenSetUp(
        ("height",),
        (
            "car",
            "car with odometer",
            "drive0708",
            "drive0708-vehicle",
            "ship",
            "hand-held",
            "thor75",
            "swisslog",
            *BROAD,
        ),
        "only one source measures the height",
        "height",
    ),
    HiddenSetUp(
        ("clock of GNSS", "clock of velocity"),
        ("ship",),
        "the ship accelerates so little that no estimate of the clock comes below 0.04 s (separate "
        "bias estimation, seeds 1001 and 1004), and a mistake must stand out by five of them",
        "clock",
        0.2,
    ),
    HiddenSetUp(
        ("clock of position",),
        ("ship",),
        "at 6 m/s and with 1 m of noise, once a second, no estimate of the position's clock comes "
        "below 0.08 s, and a mistake must stand out by five of them",
        "clock",
        0.4,
    ),
    HiddenSetUp(
        ("antenna arm, forward",),
        ("ship",),
        "one turn of 60 deg: no estimate of the arm's forward part comes below 0.5 m, and a mistake "
        "must stand out by five of them",
        "lever arm",
        2.5,
    ),
    HiddenSetUp(
        ("clock of GNSS",),
        ("BROAD 02",),
        "the body turns in its place: at 0.07 m/s rms it does not leave the noise of its fixes, "
        "and what it accelerates is within that of its accelerometers",
        "clock",
    ),
    HiddenSetUp(
        ("drift",),
        BROAD,
        "no velocity stands beside the positions, and an IMU feels no constant velocity",
        "lasting errors",
    ),
)
"""Mistakes that the data cannot show."""


def why_hidden(mistake: Mistake, recording: str) -> HiddenSetUp | None:
    """Why the recording cannot show the mistake; None where it can."""
    for each in NOT_SHOWABLE:
        small = abs(mistake.size) < each.below
        if mistake.group in each.groups and recording in each.recordings and small:
            return each
    return None


def names_untested(why: HiddenSetUp, untested: tuple[str, ...]) -> bool:
    """True where the verdict lists the mistaken quantity as not tested."""
    words = (why.cause, CAUSES[why.cause])
    return any(word in text for text in untested for word in words)
