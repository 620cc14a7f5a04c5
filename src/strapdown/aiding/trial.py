"""A trial of an observation that comes from outside, before anything is computed with it.

Compiled kernels look at no bounds, and what is written beside an array shows nowhere. So it is
called at two beliefs, in arrays with a margin around them, and its H is compared with the change of
its innovation.
"""

import math

import numpy as np

from ..checks import DataError
from ..core.loop.contract import STATES, FilterState, MeasurementModel, Observe
from ..core.mathematics.rotation import euler_terms
from ..core.mathematics.rotation_vectors import exponentials
from ..core.mathematics.source import new_source
from ..typing import Array

TYPICAL = {
    "latitude": 0.8,
    "longitude": 0.2,
    "length": 400.0,
    "angle": 0.3,
    "acceleration": -9.0,
    "magnetic field": 2e-5,
    "pressure": 97e3,
    "water pressure": 6e5,
}
"""A value of each quantity, SI; 1 of any other."""
PARAMETERS = {"field": (2e-5, 1e-6, 4e-5), "drag": (0.3, 0.35, 0.0)}
"""Those of a source by their meaning; others are a lever arm."""
MORE = {
    "": (0.0, 0.0, 0.0),
    "direction": (0.48, -0.6, 0.64),
    "beacon": (0.80005, 0.2001, 250.0),
    "atmosphere": (95e3, 290.0, 300.0),
}
"""Values of source.parameters[3:6], by their meaning."""
PARTS = (
    ("position", "m", 10.0),
    ("velocity", "m/s", 1.0),
    ("attitude", "rad", 0.1),
    ("accelerometer bias", "m/s^2", 0.1),
    ("gyro bias", "rad/s", 0.01),
)
"""Parts of the error state, with errors that count."""
STEP, MIN_STEP = 1e-3, 0.1
"""Part of such an error by which the belief is moved; part of the largest term of a row from which on
a difference is told of."""
MARGIN, UNTOUCHED = 4096, 12345.678
"""Numbers around an array, and what they are."""
EARTH_RADIUS = 6.37e6  # m: near enough for a comparison to a tenth


def derivative_complaints(sensor: MeasurementModel, observe: Observe) -> list[str]:
    """Sentences on derivatives in H that differ from the change of the innovation. Raises DataError
    where the observation returns another number of rows than it has quantities, writes beside its
    arrays or fails."""
    said = []
    for turn in ((0.1, -0.2, 0.7), (-0.3, 0.4, 2.5)):
        try:
            said += _differences(sensor, observe, turn)
        except DataError:
            raise
        except Exception as error:
            raise DataError(f"observe fails at a trial: {type(error).__name__}: {error}") from error
    return list(dict.fromkeys(said))


def _belief(turn: tuple[float, float, float], extra: int, dx: Array | None = None) -> FilterState:
    """A belief at an attitude, moved by the error dx (15 + extra,), SI."""
    dx = np.zeros(STATES + extra) if dx is None else dx
    lat = 0.8
    C = exponentials(dx[None, 6:9])[0] @ np.reshape(euler_terms(*turn), (3, 3))
    return FilterState(
        np.array([lat, 0.2, 400.0]) + dx[:3] / (EARTH_RADIUS, EARTH_RADIUS * math.cos(lat), -1.0),
        np.array([12.0, -7.0, 1.5]) + dx[3:6],
        C,
        dx[9:12].copy(),
        dx[12:15].copy(),
        np.eye(STATES + extra),
        np.array([0.02, -0.1, 0.2]) - dx[12:15],
        np.array([0.5, -0.4, -9.7]) - dx[9:12],
        np.zeros(1),
        dx[15:].copy(),
    )


def _call_observation(
    sensor: MeasurementModel, observe: Observe, belief: FilterState, measured: Array
) -> tuple[Array, Array]:
    """(H, innovation) of its rows, of which there may be none. Raises DataError."""
    n, rows = len(belief.P), len(sensor.quantities)
    rooms = [np.full(2 * MARGIN + size, UNTOUCHED) for size in (3, 3 * n)]
    innovation, flat = (room[MARGIN:-MARGIN] for room in rooms)
    H = flat.reshape(3, n)
    innovation[:], H[:] = 0.0, 0.0
    y = np.r_[measured, np.full(3 - rows, np.nan)]
    source = new_source()
    source.parameters[:3] = PARAMETERS.get(sensor.parameters, (1.0, -0.5, 0.3))
    source.parameters[3:6] = MORE[sensor.more_parameters]
    source.first_state = STATES if sensor.states else 0.0
    before = [part.copy() for part in belief]
    found = observe(belief, y, source, innovation, H)
    if found is None or int(found) not in (0, rows):
        raise DataError(
            f"observe returns {found}; it must return the number of its rows, {rows}, one for each "
            f"quantity"
        )
    margins = np.concatenate([np.r_[room[:MARGIN], room[-MARGIN:]] for room in rooms])
    if (margins != UNTOUCHED).any() or H[rows:].any():
        raise DataError(
            f"observe writes beside its arrays; innovation has {rows} numbers and H {rows} rows of "
            f"{n}"
        )
    if any((part != old).any() for part, old in zip(belief, before)):
        raise DataError("observe changes the belief; it may only read it")
    return H[: int(found)].copy(), innovation[: int(found)].copy()


def _nearest(sensor: MeasurementModel, observe: Observe, belief: FilterState) -> Array:
    """Measured values whose innovation is as good as 0, by Newton's method: H belongs to small
    ones."""
    y = np.array([TYPICAL.get(quantity, 1.0) for quantity in sensor.quantities])
    for _ in range(10):
        _, e = _call_observation(sensor, observe, belief, y)
        steps = np.diag(1e-6 * np.maximum(np.abs(y), 1e-6))
        slopes = [
            (_call_observation(sensor, observe, belief, y + step)[1] - e) / step.sum()
            for step in steps
        ]
        if not len(e) or not np.isfinite(slopes).all():
            break
        y = y - np.linalg.lstsq(np.stack(slopes, axis=1), e, rcond=None)[0]
    return y


def _differences(
    sensor: MeasurementModel, observe: Observe, turn: tuple[float, float, float]
) -> list[str]:
    """Sentences on the derivatives of H that are not those of the innovation."""
    extra = len(sensor.states)
    y = _nearest(sensor, observe, _belief(turn, extra))
    H, e = _call_observation(sensor, observe, _belief(turn, extra), y)
    count = np.concatenate([np.full(3, error) for _, _, error in PARTS] + [np.ones(extra)])
    change = np.empty(H.shape)
    for i, error in enumerate(count):
        sides = []
        for step in (STEP * error, -STEP * error):
            dx = np.zeros(len(count))
            dx[i] = step
            _, moved = _call_observation(sensor, observe, _belief(turn, extra, dx), y)
            sides.append(moved if moved.shape == e.shape else np.full(e.shape, np.nan))
        change[:, i] = -(sides[0] - sides[1]) / (2 * STEP * error)
    weight = np.maximum(np.abs(H), np.abs(change)) * count
    wrong = np.abs(H - change) * count > MIN_STEP * weight.max(axis=1, initial=1e-12, keepdims=True)
    return [
        f"H[{row}, {i}] is {H[row, i]:.4g} ({_state(sensor, i)}), and the innovation changes by "
        f"{change[row, i]:.4g} for each unit of that error: check sign and derivative"
        for row, i in zip(*np.nonzero(wrong))
    ]


def _state(sensor: MeasurementModel, i: int) -> str:
    if i >= STATES:
        return sensor.states[i - STATES]
    part, unit, _ = PARTS[i // 3]
    axes = ("north", "east", "down") if i < 9 else ("forward", "right", "down")
    return f"{part} {axes[i % 3]}, {unit}"
