"""Descriptions of the fields of the exported struct: units, frames, meaning of the numbers of a
table. A test checks that each field and each name has its text."""

from collections.abc import Mapping
from typing import NamedTuple

from ...core.loop import contract
from ...core.loop.body_motion import BodyMotion
from ...core.loop.cursor import Axis, Books, Limits, LoopState, Work
from ...core.loop.log import Code, LogRow
from ...core.loop.tables import FixRow
from ...core.mathematics import solution_row
from ...core.mathematics.coupling import Coupling
from ...core.mathematics.source import SourceRow

FIELDS: Mapping[str, Mapping[str, str]] = {
    "belief": {
        "lla": "latitude rad, longitude rad, height above the ellipsoid m, of the IMU",
        "v_n": "velocity north, east, down, m/s",
        "C_nb": "rotation matrix, body to navigation frame",
        "b_a": "accelerometer bias, body, m/s^2: what it reads too much",
        "b_g": "gyro bias, body, rad/s: what it reads too much",
        "P": "covariance of the errors true - estimate: position m NED, velocity m/s NED, "
        "attitude rad (a rotation in the navigation frame), accelerometer bias, gyro bias, "
        "then the augmented states of sources",
        "omega": "last angular rate without bias, body against inertial space, rad/s",
        "f": "last specific force without bias, body, m/s^2",
        "workspace": "the filter's own memory; its own output columns come first",
        "augmented": "the augmented states of sources",
    },
    "imu": {
        "t": "end of the sample, s",
        "dt": "its length, s",
        "dtheta": "integral of the angular rate over it, body, rad",
        "dv": "integral of the specific force over it, body, m/s",
    },
    "fixes": {
        "t": "when the fix holds, s; the fixes that wait, in the order of time",
        "source": "its source",
        "y": "what was measured; NaN where nothing was",
        "std": "standard deviations of its innovation",
        "sources": "description of each source",
    },
    "noise": {
        "gyro": "angle random walk, rad/sqrt(s)",
        "accel": "velocity random walk, m/s/sqrt(s)",
        "gyro_bias": "driving noise of the gyro bias, rad/s/sqrt(s)",
        "accel_bias": "driving noise of the accelerometer bias, m/s^2/sqrt(s)",
        "gyro_decay": "1 / time constant of the gyro bias, 1/s; 0 is a random walk",
        "accel_decay": "1 / time constant of the accelerometer bias, 1/s",
        "held": "share of these decays that estimates take no part in: 0, or 1 to hold them, at most 1",
    },
    "cursor": {
        "state": "state of the loop",
        "work": "scratch memory of the loop",
        "limits": "limits of samples, fixes and the filter state",
        "axes": "repeated values of each axis, gyro then accelerometer",
        "books": "records of each source",
        "log": "events; read them with strapdown_next_event",
        "recent": "motion of the last seconds; not used",
        "coupled": "scales and misalignments of the IMU; not used",
    },
    "out": {
        "nav": "the row of the last sample, see strapdown_row",
        "covariance": "not used: belief.P has it",
        "fix": "the fixes that were used or rejected in the last sample",
        "record": "not used",
        "mark": "not used",
    },
}
"""{name in layout.RECORDS: {field: text}}."""

SIZES = {
    "n": ("STATES", "error states; see belief.P"),
    "sources": ("SOURCES", "sources of fixes"),
    "fixes": ("WAITING", "fixes that can wait until the sample that reaches them"),
    "columns": ("COLUMNS", "of a row of the solution"),
    "log_rows": ("LOG_ROWS", "events that can be stored"),
    "workspace": ("WORKSPACE", "numbers of the filter's own memory"),
}
"""{name of a size: (its name in C, what it counts)}; other sizes are numbers there."""


class Name(NamedTuple):
    """A constant."""

    name: str
    value: int
    text: str


class ExportNames(NamedTuple):
    """An enum."""

    name: str
    prefix: str
    text: str
    constants: tuple[Name, ...]


def _name_codes(module: object, texts: Mapping[str, str]) -> tuple[Name, ...]:
    return tuple(Name(name, int(getattr(module, name)), text) for name, text in texts.items())


STATUS = ExportNames(
    "strapdown_status",
    "",
    "Status of a row; the result of strapdown_sample.",
    _name_codes(
        contract.Status,
        {
            "VALID": "computed from samples",
            "BRIDGED": "over a gap of the IMU of at most 1 s, with the last rates",
            "INVALID": "after a longer gap, until a position fix is accepted",
            "DOUBTFUL": "contradicted by rejected fixes or impossible samples",
        },
    ),
)
USE = ExportNames(
    "strapdown_use",
    "",
    "Result of a fix.",
    _name_codes(
        contract.Use,
        {
            "NOT_ASKED": "impossible, or beyond the limits of the vehicle; not used",
            "UNMEASURED": "nothing was measured",
            "REJECTED": "its innovation is beyond the gate; not used",
            "ACCEPTED": "used",
            "REACQUIRED": "used although beyond the gate, because its source was rejected for a long time",
        },
    ),
)
ROW = ExportNames(
    "strapdown_row",
    "ROW_",
    "Columns of out.nav[0], the solution after a sample.",
    _name_codes(
        solution_row,
        {
            "T": "time, s",
            "LLA": "latitude rad, longitude rad, height above the ellipsoid m",
            "V": "velocity north, east, down, m/s",
            "Q": "quaternion, body to navigation frame, scalar first",
            "BIASES": "accelerometer bias (3) m/s^2, gyro bias (3) rad/s",
            "STD": "15 standard deviations: position m NED, velocity m/s NED, attitude rad, "
            "accelerometer bias, gyro bias",
            "ROW_STATUS": "status",
        },
    ),
)
CODE = ExportNames(
    "strapdown_code",
    "",
    "Kinds of events.",
    _name_codes(
        Code,
        {
            "BRIDGED_GAP": "gap of the IMU of value s, bridged with the last rates",
            "HELD_GAP": "longer gap of value s: velocity and attitude held",
            "LIFTED": "gate of source `which` opened after long rejection of its fixes; value: distance",
            "LEFT_OUT": "source `which` left out until one of its fixes passes",
            "HEIGHT_APART": "height of one source left out, because another's contradicts it; "
            "which / 2 is left out * sources + other; value: difference in m",
            "HEIGHT_AGAIN": "height of source `which` agrees again and is used",
            "DISTURBED": "magnetic field of source `which` left out, because its strength or dip is not the "
            "Earth's; value: its strength, T",
            "IRON_WAITS": "magnetic field of source `which` left out until the heading is known well enough "
            "to estimate its hard iron; value: standard deviation of the heading, rad",
            "FROZEN": "measurement through the air of source `which` left out, because it holds one value; "
            "value: for how long, s",
            "UNCHECKED": "measurement of source `which` left out, because it contradicted position and velocity "
            "shortly before they went missing; value: s without them",
            "CONTRADICTS": "source `which` left out, because it contradicts position and velocity",
            "AGREES_AGAIN": "source `which` agrees with position and velocity again and is used",
            "TOO_FAR": "position of source `which` farther away than the vehicle can have moved",
            "OUT_OF_RANGE": "axis `which` (gyro 0-2, accelerometer 3-5) read value, beyond its range",
            "FULL_SCALE": "axis `which` at full scale",
            "STUCK": "axis `which` repeats its value",
            "COARSE": "samples too far apart for this motion; value m/s^2",
            "JITTERED": "intervals of samples are uneven; value: mean difference over their length",
            "FLOORED": "a standard deviation of source `which` was raised to the smallest possible one",
            "NO_FIX": "source `which` reported latitude and longitude 0",
            "TOO_FAST": "source `which` reported a speed beyond the vehicle's limit; value m/s",
            "TOO_HIGH": "source `which` reported a height beyond the vehicle's limits; value m",
            "MEAN_OFF": "mean of the innovations of source which / 3, component which % 3, is off",
            "NIS_OFF": "innovations of source `which` are larger than stated; value: ratio of variances",
            "BELIEF_TOO_FAST": "the solution is faster than the vehicle can be",
            "BELIEF_TOO_HIGH": "the solution is higher or lower than the vehicle can be",
            "IN_CONDITION": "a condition of the filter; `which` is its number",
        },
    ),
)
RESULTS = ExportNames(
    "strapdown_result",
    "",
    "Results of functions. Below 0 the call had no effect, except that the filter may have stopped.",
    (
        Name("OK", 0, "done"),
        Name("BAD_NUMBER", -1, "a number is not finite, or impossible"),
        Name("LATE", -2, "not later than the data already used"),
        Name("FULL", -3, "too many fixes wait"),
        Name("JUMP", -4, "the sample is more than a day after the last one"),
        Name("NO_SOURCE", -5, "there is no such source"),
        Name("STOPPED", -6, "the filter stopped: start it again"),
        Name("FIXED", -7, "a part of the start that is fixed in this export differs"),
        Name("NOT_SAVED", -8, "what was saved is damaged, or of another export"),
    ),
)
ENUMS = (RESULTS, STATUS, USE, ROW, CODE)
CLASSES = {
    one.__name__: one
    for one in (
        SourceRow,
        FixRow,
        LoopState,
        Work,
        Limits,
        Axis,
        Books,
        LogRow,
        BodyMotion,
        Coupling,
    )
}
"""The classes of tables, by name."""
