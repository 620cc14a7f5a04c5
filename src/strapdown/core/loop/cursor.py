"""The loop's own state, by name, so that a run can stop and go on at any sample."""

from typing import Annotated, NamedTuple

from ...typing import Array
from ..compile.records import Table, rows_of
from ..compile.signatures import record
from ..compile.workspace import MAX_STATES
from ..mathematics.coupling import Coupling
from .body_motion import BodyMotion
from .log import LogRow

CHANNELS = 7
"""Tests of a source's innovations: whitened ones above and below what is allowed, by component, and
the NIS."""


class LoopState:
    """Where the loop stands."""

    row: int  # next IMU sample
    stop: int  # where to stop
    fix: int  # next measurement
    fixes: int  # how many there are
    out: int  # next row of the output
    every: int  # rows with row % every == phase are kept
    phase: int  # of the rows that are kept
    status: int  # a Status, by gaps alone
    shown: int  # that of the last row
    fault: int  # 1: the belief left the latitudes where results hold, or is no number
    positioned: int  # 1: the filter estimates a position
    recorded: int  # calls of predict and correct so far
    save_step: int  # address of the kernel that records a call
    samples: int  # so far
    repeating: int  # axes that repeat their value
    unconfirmed: int  # measurements that must still confirm the belief
    condition: int  # place of the filter's condition in its workspace, or -1
    doubtful_conditions: int  # bits of those that make rows doubtful
    logged: int  # rows of the log
    latest: int  # row of the recent motion that is now
    heights: int  # sources that measure the height above the ellipsoid
    t: float  # time of the belief, s
    cause: float  # of the last cause of doubt, s
    broken: float  # s for which samples could not be
    previous: Annotated[Array, 7]  # the last sample: increments (6), seconds
    # of core/loop/stages/heights.py: sum of the corrections of the height, m; integral of the innovations of
    # vertical velocity, m; the last of them and its standard deviation, m/s; its time, and since when
    # there is no gap in them, s
    corrected: float
    climb: float
    climb_off: float
    climb_std: float
    climb_at: float
    climb_since: float


class Limits:
    """Limits of samples, measurements and states; a value beyond them is out of range."""

    gyro_range: float  # rad/s
    accel_range: float  # m/s^2
    gyro_full_scale: float  # rad/s, where the described sensor is at full scale; inf: not described
    accel_full_scale: float  # m/s^2
    gyro_noise: float  # rad/sqrt(s)
    accel_noise: float  # m/s/sqrt(s)
    speed: float  # m/s, of the vehicle
    lowest: float  # m, ellipsoidal height
    highest: float  # m


class Axis:
    """Repeated values and changes of an axis of gyro or accelerometer."""

    length: float  # samples at the present value
    repeats: float  # samples that repeated the one before
    step: float  # smallest change seen, rad/s or m/s^2
    lately: float  # share of repeats among the last samples in which any axis repeated its value
    change: float  # at the last look
    jitter: float  # mean square of what samples do not tell of the motion inside, rad^2, (m/s)^2
    # of the first axis alone: mean difference of an interval and the one before, over its length
    uneven: float


class Books:
    """Counts, times and innovation tests of a source."""

    accepted: int  # measurements
    rejected: int  # measurements
    in_a_row: int  # rejections since the last accepted one
    since: float  # s, the first of them, or the last that was used with the gate opened
    lifts: int  # how many of them were used so, positions and velocities apart
    last: float  # s, the last measurement that could be true
    walked: float  # s, up to when its own states have walked
    last_used: float  # s
    used_since: float  # s, the first of those that follow each other within HEARD
    floor: Annotated[Array, 3]  # least standard deviations
    rejecting: int  # 1: rejected so long that the gate was or must be lifted; -1: left out
    lifted_at: int  # rejections in a row when the gate was opened last, 0 since one passed
    # of a sensor beside GNSS: 1 while it is left out, because it contradicts positions and velocities
    # in use; how often that was; until when it is left out at least, and without GNSS, s
    contradicts: int
    exclusions: int
    barred: float
    proven: float
    # of the same where it has states: its value, since when it is held, s, and for how many more
    # measurements; all of them, and those with a new value
    value: float
    held_since: float
    held: int
    values: int
    changes: int
    # tests of its innovations: cumulative sum, its terms, 1 where it fails; sums and counts of the
    # present second and when the last one ended, s
    sums: Annotated[Array, 7]
    terms: Annotated[Array, 7]
    fails: Annotated[Array, 7]
    whitened: Annotated[Array, 3]
    whitened_count: Annotated[Array, 3]
    nis_sum: float
    nis_count: float
    tested: float
    # of an adaptive source: factors on the variances of its rows, the whitened innovation before,
    # mean products of one with that before and with itself, time of the last one, s
    factor: Annotated[Array, 3]
    whitened_before: Annotated[Array, 3]
    alike: float
    power: float
    followed_at: float
    # of a source of height: its level, what that has moved lately and its standard deviation, m; time
    # of the last one, and since when they are averaged, s; above 0 while its height is left out: 1 +
    # what the log says of which
    level: float
    moved: float
    level_std: float
    level_at: float
    level_since: float
    suspended: int


class Work:
    """Numbers that stages write for each other while a sample or a measurement is used."""

    increments: Annotated[Array, 6]  # in use
    part: Annotated[Array, 6]  # of them
    raw: Annotated[Array, 6]  # as they were read
    # of the measurement that is used
    stds: Annotated[Array, 3]  # standard deviations, with what stages add
    factor: Annotated[Array, 3]  # of an adaptive source, on the stated ones
    gate: float  # bound on the NIS
    innovation: Annotated[Array, 12]  # of the contract
    nis: float
    weight: float  # of a robust source: stated variance over that which was used
    believable: int  # 1: it can be true
    alone: int  # 1: it is the filter's only aid
    lifted: int  # 1: used with the gate of its source opened
    withheld: int  # the row of y that is withheld from the filter, or -1
    height: float  # what stood there
    other: Annotated[Array, 12]  # the same by other standard deviations
    covariance: Annotated[Array, 6]  # S and R of a measurement, lower triangles by rows
    noise: Annotated[Array, 6]
    widened: Annotated[Array, 3]  # standard deviations
    jacobian: Annotated[Array, 3 * MAX_STATES]  # H (3, n) by rows


class Cursor(NamedTuple):
    """The loop's own state."""

    state: Table[LoopState]  # one row
    work: Table[Work]  # one row
    limits: Table[Limits]  # one row
    axes: Table[Axis]  # six rows
    books: Table[Books]  # a row per source
    log: Table[LogRow]  # what a user must know
    recent: Table[BodyMotion]  # of the last seconds; no rows where nobody looks back
    coupled: Table[Coupling]  # states of the IMU that act on the increments


CURSOR = record(
    Cursor,
    state=rows_of(LoopState, 1),
    work=rows_of(Work, 1),
    limits=rows_of(Limits, 1),
    axes=rows_of(Axis, 6),
    books=rows_of(Books, "sources"),
    log=rows_of(LogRow, "log_rows"),
    recent=rows_of(BodyMotion, "recent_rows"),
    coupled=rows_of(Coupling, "couplings"),
)
