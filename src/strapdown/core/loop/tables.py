"""Tables that a run reads and writes: samples of the IMU, measurements with their sources, the
solution and the use of each measurement."""

from enum import IntEnum
from typing import Annotated, NamedTuple

from ...typing import Array, Ints
from ..compile.records import Table, rows_of
from ..compile.signatures import reals, record, wholes
from ..mathematics.source import SourceRow


class Status(IntEnum):
    """The status of a row of the solution."""

    VALID = 0  # computed from samples
    BRIDGED = 1  # over an IMU gap of at most 1 s
    INVALID = 2  # after a longer gap and before the next accepted position
    DOUBTFUL = 3  # not to be believed, because something contradicts it


VALID, BRIDGED, INVALID, DOUBTFUL = Status


class Use(IntEnum):
    """The use of a measurement."""

    NOT_ASKED = -2  # it cannot be true: the filter was not asked
    UNMEASURED = -1  # no component was measured
    REJECTED = 0  # by its gate
    ACCEPTED = 1
    REACQUIRED = 2  # with the gate of its source opened


class Imu(NamedTuple):
    """IMU samples as columns: row k is the integral over (t[k] - dt[k], t[k]].

    Attributes
    ----------
    t : array
        Ends of the intervals, s.
    dt : array
        Lengths of the intervals, s.
    dtheta : (n, 3) array
        Integral of the angular rate, body FRD, rad.
    dv : (n, 3) array
        Integral of the specific force, body FRD, m/s.
    """

    t: Array
    dt: Array
    dtheta: Array
    dv: Array


class Fixes(NamedTuple):
    """All measurements of a run, merged and sorted by time, and what each source of it is."""

    t: Array  # s
    source: Ints  # int64, row of `sources`
    y: Array  # (m, 3); what a sensor does not measure is NaN
    std: Array  # (m, 3) of the rows of the innovation
    sources: Table[SourceRow]


class FixRow:
    """The result of a measurement: its innovation, test and use."""

    t: float  # s
    source: int  # row of the sources
    innovation: Annotated[Array, 3]  # y - h(belief), SI; NaN where nothing was measured
    nis: float  # innovation squared over its covariance; NaN where the filter does not gate
    use: int  # a Use
    whitened: Annotated[Array, 3]  # L^-1 innovation, each N(0, 1) where the filter is right
    root: Annotated[Array, 6]  # L by rows (00, 10, 11, 20, 21, 22), L L' the covariance of it
    weight: float  # stated variance over that with which it was used; 0: not used
    factor: Annotated[Array, 3]  # an adaptive source's, on the stated standard deviations
    v: Annotated[Array, 3]  # velocity of the belief after it, NED, m/s


class Output(NamedTuple):
    """The output of a run: a row per kept IMU sample, a row per measurement."""

    nav: Array  # (rows, columns): core.mathematics.solution_row, then a filter's own
    covariance: Array  # (rows, n, n), or (0, n, n)
    fix: Table[FixRow]
    record: Array  # (calls, width) what each call of predict and correct left for the smoother, or (0, 0)
    mark: Ints  # int64 per row: calls before it; unused without a record


IMU = record(
    Imu, t=reals("samples"), dt=reals("samples"), dtheta=reals("samples", 3), dv=reals("samples", 3)
)
FIXES = record(
    Fixes,
    t=reals("fixes"),
    source=wholes("fixes"),
    y=reals("fixes", 3),
    std=reals("fixes", 3),
    sources=rows_of(SourceRow, "sources"),
)
OUTPUT = record(
    Output,
    nav=reals("rows", "columns"),
    covariance=reals("covariances", "states", "states"),
    fix=rows_of(FixRow, "fix_rows"),
    record=reals("calls", "width"),
    mark=wholes("marks"),
)
