"""Cells that are refused: a filter is not to be used there, and why.

At most MAX of a filter. They stay in the table with what was measured, and count for no target.
"""

from .worlds import WorldCell

MAX_SHOWN = 3
"""Refused cells of a filter."""
_RAW = (
    "Its INS keeps the turn-on bias of the accelerometers during the whole run: at the end it is "
    "{} km off (median of 6 runs), and its error is no longer linear. Use indirect-ahrs-closed, "
    "which is consistent there."
)
_STRAIGHT = (
    "The heading is not observable for ten minutes: at the end its error is 18.7 deg (rms of 60 "
    "runs) and the filter claims 8.2 deg, because it mistakes products of errors of heading, tilt "
    "and biases for information. Give a heading, or use direct-ahrs."
)
_CAR = (
    "It begins with 20 s at rest and a gyro bias known to 1.67 deg/s: at 18 s the heading error "
    "is 33 deg (rms of 60 runs) and the filter claims 29 deg. The first fixes in motion correct "
    "all of that at once, beyond the range of a linear model; 2 of 60 runs do not survive. Give a "
    "heading, or begin in motion."
)
_HAND = (
    "The hand turns at 3 rad/s, with a heading known to 5 deg and a gyro bias to 1.67 deg/s: "
    "ANEES is 1.20 during the whole minute, so errors are 10 % larger than claimed. Give a "
    "magnetometer or an AHRS."
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
