"""Cells that are refused: a filter is not to be used there, and why.

At most MAX of a filter. They stay in the table with what was measured, and count for no target.
"""

from .worlds import WorldCell

MAX_SHOWN = 3
"""Refused cells of a filter."""
_RAW = (
    "Its INS keeps the turn-on bias of the accelerometers for all of the run: at the end it is {} km "
    "off (median of 6 runs), where its error is no longer linear. Use indirect-ahrs-closed, which "
    "is consistent there."
)
_STRAIGHT = (
    "Nothing shows the heading for ten minutes: at the end it errs by 18.7 deg (rms of 60 runs) and "
    "8.2 deg are stated, because products of its error with those of tilt and biases pass for "
    "information. Give a heading, or take direct-ahrs."
)
_CAR = (
    "It begins with 20 s at rest and a gyro bias known to 1.67 deg/s: at 18 s the heading errs by 33 "
    "deg (rms of 60 runs), 29 deg are stated, and the first fixes in motion correct all of that at "
    "once, further than a linear model reaches; 2 of 60 runs do not survive. Give a heading, or begin "
    "in motion."
)
_HAND = (
    "A hand that turns at 3 rad/s, with a heading known to 5 deg and a gyro bias to 1.67 deg/s: ANEES "
    "1.20 for all of the minute, so that errors are 10 % larger than stated. Give a magnetometer or an "
    "AHRS."
)
_LINEAR = ("closed-loop", "mekf", "ekf")
REFUSED: dict[WorldCell, str] = {
    WorldCell("indirect-ahrs-open", "straight", "consumer"): _RAW.format(59),
    WorldCell("indirect-ahrs-open", "ship", "consumer"): _RAW.format(386),
    WorldCell("indirect-ahrs-open", "ship", "industrial"): _RAW.format(69),
    **{WorldCell(name, "straight", "consumer"): _STRAIGHT for name in _LINEAR},
    **{WorldCell(name, "car", "consumer"): _CAR for name in (*_LINEAR, "xkf")},
    **{WorldCell(name, "hand-held", "consumer"): _HAND for name in (*_LINEAR, "xkf")},
}
"""{cell: the measurement that shows why}."""
