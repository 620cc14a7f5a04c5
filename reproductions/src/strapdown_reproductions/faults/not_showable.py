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
        "the height changes by less than its noise, which hides its sign",
    ),
    HiddenFault(
        (
            "longitude sign wrong",
            "latitude and longitude swapped",
            "position stuck, velocity right",
        ),
        (NAVIGATION,),
        (HOVERING,),
        "the body stays within a metre, and the noise of a position is as large",
    ),
    HiddenFault(
        ("gyro sign wrong", "gyro z sign wrong", "gyro z sign flips at 90 s"),
        (NAVIGATION,),
        (HOVERING,),
        "roll and pitch with the other sign equal those of axes rotated by 180 deg, which the "
        "initial heading cannot show, and the body yaws by less than the accuracy of a heading "
        "from accelerations",
    ),
    HiddenFault(
        ("declination 10 deg off", "AHRS heading 10 deg off"),
        (NAVIGATION,),
        (HOVERING, MOORED),
        "accelerations give the heading only to some 8 deg, so it comes from the magnetometer or "
        "AHRS",
    ),
    HiddenFault(
        ("position and velocity drift by 0.1 m/s",),
        (NAVIGATION,),
        OF_POSITION,
        "position and velocity agree with each other, an IMU cannot measure a constant velocity, "
        "and its onset is one standard deviation of the velocity",
    ),
    HiddenFault(
        ("spoofed: position and velocity accelerate by 0.02 m/s^2",),
        (NAVIGATION,),
        (WALKING,),
        "an industrial accelerometer has a bias of 0.03 m/s^2 that a walk around corners does not separate "
        "from the acceleration within two minutes",
    ),
    HiddenFault(
        ("100 IMU values shuffled in fives",),
        (NAVIGATION, ATTITUDE),
        OF_POSITION,
        "five neighbours add up to the same rotation and velocity in any order, but for products of two of "
        "them",
    ),
    HiddenFault(
        ("accelerometer clips at 1 g",),
        (NAVIGATION,),
        (WALKING,),
        "a walk's specific force exceeds 1 g by the noise of the sensor and the little that steps add",
    ),
    HiddenFault(
        ("gyro x bias runs away by 1 deg/s in 120 s",),
        (ATTITUDE,),
        ("in a hand",),
        "a consumer gyro's bias is known to 1.7 deg/s and wanders by itself, gravity shows it only while "
        "the hand is still, and the hand moves",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading",),
        (NAVIGATION,),
        OF_POSITION,
        "only the IMU shows where the body's axes point: accelerations show the heading of the "
        "IMU, and the angle is no larger than the effect of wind on heading and course",
        shown_by="attitude",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading", "declination 10 deg off"),
        (ATTITUDE,),
        IN_FLIGHT,
        "only the magnetometer shows the heading, and in level flight its error and that of the "
        "mounting are one constant",
    ),
    HiddenFault(
        ("declination 10 deg off",),
        (ATTITUDE,),
        ("in a hand",),
        "only the reference field defines north",
    ),
    HiddenFault(
        (
            "accelerometer x bias steps by 0.5 m/s^2",
            "accelerometer x bias runs away by 0.5 m/s^2 in 120 s",
        ),
        (ATTITUDE, HEAVE),
        (*IN_FLIGHT, AFLOAT),
        "without position and velocity a bias of the accelerometer equals a tilt of 3 deg, and "
        "only a body that turns over would separate them",
    ),
    HiddenFault(
        ("IMU late by 0.1 s", "IMU late by 1 s", "clock of the IMU 1000 ppm fast"),
        (HEAVE,),
        (AFLOAT,),
        "heights of 2 m once a second show a clock to 0.25 s only, since the swell heaves by 0.8 m: an "
        "offset shows from 1.3 s on",
    ),
    HiddenFault(
        ("second height drifts by 0.2 m/s",),
        (HEAVE,),
        (AFLOAT,),
        "only one source measures the height, an IMU cannot measure a constant velocity, and what its "
        "onset shows is hidden by heights of 2 m",
    ),
    HiddenFault(
        ("mounted 5 deg off in heading", "box slips by 10 deg in heading at 90 s"),
        (HEAVE,),
        (AFLOAT,),
        "only the IMU shows where the body's axes point",
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
