"""The parameters of a source of measurements, as a filter and an observation read them."""

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Annotated, Any, TypeAlias

from ...typing import Array, Ints
from ..compile.records import row_of, rows
from ..compile.signatures import WHOLE, reals, signature
from .belief import BELIEF, FilterState

PARAMETERS = 6
"""Numbers of its own that a source can have."""


class Kind(IntEnum):
    """Kinds of measurements that are more than rows of H to someone: a position makes a solution
    valid again after a long gap, attitude filters treat directions their way, a heave filter the
    waves about mean sea level, filters with an AHRS take its attitude as known, gains belong to what
    they act on, the loop of an aircraft makes pressures itself. `aiding.number` gives out the
    numbers of all others, from len(Kind) on."""

    POSITION = 0
    VELOCITY = 1
    HEADING = 2
    ALTITUDE = 3
    GRAVITY = 4
    MAGNETIC_FIELD = 5
    ZERO_SEA_LEVEL = 6
    ATTITUDE = 7
    PRESSURE = 8
    PRESSURE_ALTITUDE = 9
    COURSE = 10


NAMED_KINDS = len(Kind)
"""As many kinds kernels know by their number."""


POSE_AXES = ("", "n", "b")
"""Names of the axes in which a measurement is a function of the pose alone, at their numbers."""
IN_N, IN_BODY = POSE_AXES.index("n"), POSE_AXES.index("b")


class SourceRow:
    """A source of measurements. A state is an index into the error states, 0 where there is none.

    Constant over a run but for what the loop writes before each measurement of a source whose clock
    is a state (`age` to `bent_velocity`, see core/loop/stages/clock.py) or whose errors are
    time-correlated (`kept`).
    """

    kind: int  # a Kind, or the number of another kind
    gate: float  # bound on the NIS; inf switches gating off
    # the source's own, as its MeasurementModel says: a lever arm, m, body
    parameters: Annotated[Array, PARAMETERS]
    pose_axes: int  # IN_N, IN_BODY, or 0 for neither
    of_kind: int  # which of the sources of its kind it is, from 0

    first_state: int  # of the states that it brings along
    states: int  # how many these are
    state_std: float  # their initial standard deviation, unit
    walk: float  # their random walk, unit/sqrt(s)

    # parameters of the installation that are states: the error of the clock, s, of the lever arm, m,
    # of the mounting, rad, and of the scale
    estimated: int  # 1 where any of them is a state
    clock_state: int
    arm_state: Annotated[Ints, 3]
    mounting_state: Annotated[Ints, 3]
    scale_state: int
    # of a magnetometer: hard iron, T, body, soft iron, the field's model, T, NED, and declination, rad
    iron_state: Annotated[Ints, 3]
    soft_state: Annotated[Ints, 6]
    field_state: Annotated[Ints, 3]
    declination_state: int

    delay: float  # s that a measurement waits, so that what the filter looks back at is there
    age: float  # s by which the belief is ahead of the measurement, with the clock as estimated
    clock: float  # that estimate, s
    force: Annotated[Array, 3]  # m/s, body: integral of the specific force over the age
    lag: Annotated[Array, 3]  # m, body: what is left of its double integral
    force_then: Annotated[Array, 3]  # m/s^2, body: mean about the instant of the measurement
    bias_then: Annotated[Array, 3]  # m/s^2: accelerometer bias that these three are free of
    gravity: Annotated[Array, 3]  # m/s^2, NED, less the Coriolis term
    rate: Annotated[Array, 3]  # rad/s, body: angular rate then less that of now
    spin: Annotated[Array, 3]  # rad/s^2, body: angular acceleration then
    turn: Annotated[Array, 3, 3]  # from body axes then to body axes now
    bent_position: Annotated[Array, 3]  # m: standard deviations of what is not linear in the clock
    bent_velocity: Annotated[Array, 3]  # m/s: the same of a velocity

    slip: float  # side slip of a constraint, rad per m/s^2
    correlation_time: float  # s, of first-order Gauss-Markov errors of its rows; 0: none
    correlated_std: Annotated[Array, 3]  # their stationary standard deviations, SI
    correlated_state: Annotated[Ints, 3]  # those that are states
    kept: float  # share of them left of the measurement before: exp(-dt / correlation_time)
    robust: int  # 1: a heavy-tailed likelihood stands in place of the gate
    memory: float  # s over which the measurement noise is followed; 0: it is as given
    beside_gnss: int  # 1: a sensor that is left out while it contradicts positions and velocities


SOURCE = row_of(SourceRow)

OBSERVE = signature(
    "observe",
    WHOLE,
    belief=BELIEF,
    y=reals(3),
    source=SOURCE,
    innovation=reals(3),
    H=reals(3, "n"),
)
Observe: TypeAlias = Callable[[FilterState, Array, SourceRow, Array, Array], int]
"""(belief, y, source, innovation, H) -> rows, at most 3 of y - h(belief), SI and radians."""


def new_source(**fields: Any) -> Any:
    """A source with these fields, the others 0, and without a gate unless one is given."""
    (source,) = rows(SourceRow, 1)
    source.gate = math.inf
    for name, value in fields.items():
        source[name] = value
    return source
