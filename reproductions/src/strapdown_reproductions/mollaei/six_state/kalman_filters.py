"""The extended Kalman filter of the six states, equations (19)-(22) of Mollaei et al., and the
mode without a filter."""

import math
from typing import Any

from strapdown.core.compile.jit import matrix
from strapdown.core.loop.contract import (
    CORRECT,
    PREDICT,
    FilterState,
    InitialState,
    Noise,
    Observe,
    kernel,
)
from strapdown.flight.aircraft_model.parameters import aircraft as find_aircraft
from strapdown.typing import Array

from .model import (
    CRAFT,
    DV,
    INPUTS,
    POINT,
    SINCE,
    SIX,
    TRIAL,
    TRIAL_P,
    TURNED,
    Options,
    X,
    begin,
    copy,
    correct_gaussian,
    craft_in,
    innovation_at,
    propagate_linearised,
    publish,
    takes_options,
    turn,
)
from .operating_point import ESTIMATE, READING, point_of, sample_model

HELD = 1.0
"""s that the last fix is held without a filter; after that position and velocity are told as
zero, as in Figure 5 of the paper."""


@takes_options
def start(
    start: InitialState,
    noise: Noise,
    linearised: str = "estimate",
    airspeed: float | None = None,
    **shared: Any,
) -> FilterState:
    """The filter state at `start`. linearised: where the process is, one of
    operating_point.READINGS; airspeed: of the trim that "trim" and "once" are about, m/s; shared:
    Options."""
    options = Options(**shared)
    belief = begin(start, SIX, options)
    point = point_of(find_aircraft(options.aircraft), start, linearised, airspeed)
    belief.workspace[POINT : POINT + len(point)] = point
    return belief


@kernel(PREDICT)
def predict(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """Attitude by the gyros; state and covariance by the IMU or the aircraft's model, linearised
    at the estimate or at an operating point."""
    turn(belief, u, dt)
    workspace = belief.workspace
    if workspace[POINT + READING] != ESTIMATE:
        attitude, gravity = matrix(workspace, TURNED, 3, 3), craft_in(workspace, CRAFT).gravity
        told, own = workspace[INPUTS:], workspace[POINT:]
        sample_model(own, told, attitude, belief, gravity, dt, workspace[DV])
    propagate_linearised(belief, belief.workspace[X], belief.P, dt, noise)
    publish(belief)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """Correct state and covariance by a fix within the gate."""
    workspace, x, P = belief.workspace, belief.workspace[X], belief.P
    first = innovation_at(workspace, y, kind, x, innovation)
    trial, spread = workspace[TRIAL], matrix(workspace, TRIAL_P, 6, 6)
    copy(x, P, trial, spread)
    nis, _ = correct_gaussian(workspace, trial, spread, first, innovation, std)
    if nis <= gate:
        copy(trial, spread, x, P)
        publish(belief)
    return nis


def start_raw(start: InitialState, noise: Noise, earth: str = "flat") -> FilterState:
    """The filter state at `start` for the mode without a filter."""
    return begin(start, SIX, Options(0.0, 0.0, 0.0, 1.0, "aerosonde", earth))


@kernel(PREDICT)
def hold(belief: FilterState, u: Array, dt: float, noise: Noise) -> None:
    """No filter: attitude by the gyros, position and velocity of the last fix, zero once there
    was none for longer than HELD."""
    turn(belief, u, dt)
    if belief.workspace[SINCE] > HELD + 1e-6:
        x = belief.workspace[X]
        for i in range(6):
            x[i] = 0.0
    publish(belief)


@kernel(CORRECT)
def take(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    parameters: Array,
    gate: float,
    innovation: Array,
) -> float:
    """No filter: the fix is used directly as the state."""
    workspace, x = belief.workspace, belief.workspace[X]
    first = innovation_at(workspace, y, kind, x, innovation)
    for i in range(3):
        if innovation[i] == innovation[i]:
            x[first + i] += innovation[i]
            workspace[SINCE] = 0.0
    publish(belief)
    return math.nan
