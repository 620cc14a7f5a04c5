"""Complete measurements of a recording for alignment, and velocities from them."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from ..data.solution import Source
from ..geometry.geodesy import displacement
from ..preprocessing.receiver_classes import join_classes
from ..typing import Array
from .location import has_location

UNKNOWN_SPEED = 10.0  # m/s: standard deviation of an unknown velocity
UNKNOWN_CHANGE = (
    0.5  # m/s: difference of the mean velocity between two fixes and that at the second
)
HORIZONTAL = slice(0, 2)


class Velocities(NamedTuple):
    """Velocities over ground, NED, one a row."""

    t: Array  # (n,) s
    v: Array  # (n, 3) m/s
    std: Array  # (n, 3) m/s


def source(recording: Recording, kind: str, needed: slice = slice(None)) -> Source | None:
    """Return the first source of that kind that has fixes within the IMU record with all `needed`
    components, reduced to these fixes; None without one."""
    for a in join_classes(recording.sources):
        usable = (
            np.isfinite(a.y[:, needed]).all(axis=1)
            & has_location(a)
            & (a.t >= recording.span[0])
            & (a.t < recording.span[1])
            if a.kind == kind
            else np.array([False])
        )
        if usable.any():
            return a._where(usable)
    return None


def position_and_velocity(recording: Recording) -> tuple[Source | None, Source | None]:
    """Return the `source` of positions and that of velocities from the first position on. Where the
    vertical velocity was not measured, the climb of the positions replaces it."""
    position, velocity = source(recording, "position"), source(recording, "velocity", HORIZONTAL)
    if velocity is not None and position is not None:
        later = velocity.t >= position.t[0] - 0.5
        velocity = velocity._where(later) if later.any() else None
    if velocity is None or (velocity.y.shape[1] == 3 and np.isfinite(velocity.y).all()):
        return position, velocity
    lacking = ((0, 0), (0, 3 - velocity.y.shape[1]))
    v, std = (np.pad(each, lacking, constant_values=np.nan) for each in (velocity.y, velocity.std))
    missing = ~np.isfinite(v[:, 2])
    v[missing, 2], std[missing, 2] = 0.0, UNKNOWN_SPEED
    if position is not None and len(position.t) > 1:
        climb = velocities(position, None)
        for column, of_climb in ((v, climb.v), (std, climb.std)):
            column[missing, 2] = np.interp(velocity.t[missing], climb.t, of_climb[:, 2])
    return position, replace(velocity, y=v, std=std)


def velocities(position: Source, velocity: Source | None) -> Velocities:
    """Return the velocities of the velocity source, or without one differences of positions."""
    if velocity is not None:
        return Velocities(velocity.t, velocity.y, velocity.std)
    _, first = np.unique(position.t, return_index=True)  # two fixes of one time have no velocity
    position = position._where(np.isin(np.arange(len(position.t)), first))
    if len(position.t) < 2:
        return Velocities(position.t, np.zeros((1, 3)), np.full((1, 3), UNKNOWN_SPEED))
    step = np.diff(position.t)[:, None]
    return Velocities(
        position.t[1:],
        displacement(position.y[1:], position.y[:-1]) / step,
        np.hypot(position.std[1:], position.std[:-1]) / step + UNKNOWN_CHANGE,
    )
