"""Faults that the data cannot show, with the reason. It is written down from what the sensors are,
not from what a run has found."""

from typing import NamedTuple

from .worlds import (
    AFLOAT,
    ATTITUDE,
    GENTLE,
    HARD,
    HEAVE,
    HOVERING,
    MOORED,
    NAVIGATION,
    WALKING,
)

IN_FLIGHT = (GENTLE, HARD)
OF_POSITION = (*IN_FLIGHT, WALKING, HOVERING, MOORED)
"""Motions of filters of position."""


class HiddenFault(NamedTuple):
    """Faults that filters of these families cannot be shown in these motions."""

    faults: tuple[str, ...]
    families: tuple[str, ...]
    motions: tuple[str, ...]
    reason: str
    shown_by: str = ""  # a kind of source with which the data does show it


NOT_SHOWABLE: tuple[HiddenFault, ...] = (
    HiddenFault(
        ("height above the geoid",),
        (NAVIGATION,),
        OF_POSITION,
        "only one source measures the height, and its offset is constant",
    ),
    HiddenFault(
        ("second height above the geoid",),
        (HEAVE,),
        (AFLOAT,),
        "only one source measures the height, and its offset is constant",
    ),
    HiddenFault(
        ("height is a depth",),
        (NAVIGATION,),
        (WALKING, HOVERING),
        "the height changes by less than its noise, so that its sign does not show",
    ),
    HiddenFault(
        (
            "longitude sign wrong",
            "latitude and longitude swapped",
            "position stuck, velocity right",
        ),
        (NAVIGATION,),
        (HOVERING,),
        "it stays within a metre, and the noise of a position is as large",
    ),
    HiddenFault(
        ("gyro sign wrong", "gyro z sign wrong", "gyro z sign flips at 90 s"),
        (NAVIGATION,),
        (HOVERING,),
        "rolls and pitches of the other sign are those of axes turned by 180 deg, of which the heading "
        "at the start knows nothing, and it yaws by less than accelerations tell of the heading",
    ),
    HiddenFault(
        ("declination 10 deg off", "AHRS heading 10 deg off"),
        (NAVIGATION,),
        (HOVERING, MOORED),
        "accelerations tell the heading to some 8 deg, so that it comes from the magnetometer or AHRS",
    ),
    HiddenFault(
        ("position and velocity drift by 0.1 m/s",),
        (NAVIGATION,),
        OF_POSITION,
        "position and velocity agree with each other, the IMU feels no constant velocity, and the "
        "step into it is one standard deviation of the velocity",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading",),
        (NAVIGATION,),
        OF_POSITION,
        "nothing but the IMU knows where the body's axes point: what accelerates tells the heading "
        "of the IMU, and the angle is within what wind makes of heading and course",
        shown_by="attitude",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading", "declination 10 deg off"),
        (ATTITUDE,),
        IN_FLIGHT,
        "the magnetometer alone tells the heading, and in level flight its error and that of the "
        "mounting are one constant",
    ),
    HiddenFault(
        ("declination 10 deg off",),
        (ATTITUDE,),
        ("in a hand",),
        "where north is comes from the reference field alone",
    ),
    HiddenFault(
        (
            "accelerometer x bias steps by 0.5 m/s^2",
            "accelerometer x bias runs away by 0.5 m/s^2 in 120 s",
        ),
        (ATTITUDE, HEAVE),
        (*IN_FLIGHT, AFLOAT),
        "without position and velocity a bias of the accelerometer is a tilt of 3 deg, and the body "
        "does not turn over, which would tell them apart",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading", "box slips by 10 deg in heading at 90 s"),
        (HEAVE,),
        (AFLOAT,),
        "nothing but the IMU knows where the body's axes point",
    ),
)
"""Faults that the data cannot show."""


def why_hidden(fault: str, family: str, motion: str, kinds: tuple[str, ...]) -> HiddenFault | None:
    """Why a fault cannot be shown to a filter of that family with these sources; None where it
    can."""
    for each in NOT_SHOWABLE:
        meant = fault in each.faults and family in each.families and motion in each.motions
        if meant and each.shown_by not in kinds:
            return each
    return None
