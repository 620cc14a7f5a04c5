"""What a flight is checked for before it begins, and what it hands to its filter."""

import inspect
import math

import numpy as np

from ..core.contract import Noise
from ..data import Aiding, DataError
from ..engine import batch
from ..filters import find as find_filter
from ..filters import names as find_names
from ..sensor_models.barometer import QUANTITIES, Barometer
from ..sensor_models.datasheet_units import real
from ..sensor_models.gnss import Gnss
from .aircraft.parameters import Aircraft
from .aircraft.wind import LEVELS
from .sensor_errors import outage_windows

MOST_SAMPLES = 2_000_000


def handed(filter, seed, aircraft, rate, earth):
    """Those of a flight's own that the filter's start has options for, unless they are bound to
    it already (functools.partial); the seed is a number drawn from a numpy SeedSequence."""
    own = {
        "seed": int(seed.generate_state(1)[0]),
        "aircraft": aircraft if isinstance(aircraft, Aircraft) else str(aircraft),
        "rate": float(rate),
        "earth": earth,
    }
    known, bound = inspect.signature(filter.start).parameters, getattr(filter.start, "keywords", {})
    return {name: value for name, value in own.items() if name in known and name not in bound}


def check(seed, feedback, prediction, earth, turbulence, wind, told_wind, rate, model_noise):
    """Raise DataError, in one line, for arguments that no flight can have."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise DataError(f"seed is {seed!r}; it must be a whole number, 0 or more")
    for name, value, known in (
        ("feedback", feedback, ("estimate", "truth")),
        ("prediction", prediction, ("imu", "model")),
        ("earth", earth, ("geodetic", "flat")),
    ):
        if not isinstance(value, str) or value not in known:
            raise DataError(f"{name} is {value!r}; it must be {known[0]!r} or {known[1]!r}")
    if not isinstance(turbulence, str):
        raise DataError(f"turbulence is {turbulence!r}; it must be one of {', '.join(LEVELS)}")
    for name, value in (
        ("wind", wind),
        ("told_wind", (0.0, 0.0, 0.0) if told_wind is None else told_wind),
    ):
        if np.shape(value) != (3,) or not all(real(part) and math.isfinite(part) for part in value):
            raise DataError(
                f"{name} is {value!r}; it must be three numbers: north, east, down, m/s"
            )
    if not real(rate) or not 0 < rate < np.inf:
        raise DataError(f"rate is {rate!r} Hz; it must be above 0")
    if not isinstance(model_noise, Noise) or not all(
        real(value) and 0 <= value < np.inf for value in model_noise
    ):
        raise DataError(f"model_noise is {model_noise!r}; it must be a Noise of numbers, 0 or more")


def check_sensors(gnss, gate, barometer, rate):
    """Raise DataError for a receiver, a gate of its fixes or a barometer that cannot be flown
    with an IMU of `rate` (Hz)."""
    if not isinstance(gnss, Gnss):
        raise DataError(f"gnss is {gnss!r}; it must be a Gnss")
    gnss.check()
    if not np.ndim(gnss.interval) and gnss.interval * rate < 1 - 1e-9:
        raise DataError(
            f"fixes every {gnss.interval:g} s come faster than the IMU's samples, {rate:g} a second; give fixes less often"
        )
    if gate is not None and (not real(gate) or not gate > 0):
        raise DataError(f"gate is {gate!r}; it must be a NIS above 0, or None for the filter's own")
    if barometer is not None and not isinstance(barometer, Barometer):
        raise DataError(f"barometer is {barometer!r}; it must be a Barometer")
    if barometer is not None and (barometer.rate or 0.0) > rate * (1 + 1e-9):
        raise DataError(
            f"the barometer's {barometer.rate:g} samples a second come faster than the IMU's, {rate:g}; give it a lower rate"
        )


def checked_windows(outage, prediction, end):
    """The windows of `flight_sensors.outage_windows`; raises DataError where the model waits for
    one in vain."""
    windows = outage_windows(outage, end)
    if prediction == "model" and not windows:
        raise DataError(
            "prediction='model' takes over while the receiver is cut, and it never is; give an outage, such as \"15:\""
        )
    return windows


def _check_inputs(inputs, filter):
    """Raise DataError where a filter cannot be told the controls there."""
    if isinstance(inputs, bool) or not isinstance(inputs, (int, np.integer)) or inputs < 0:
        raise DataError(
            f"inputs is {inputs!r}; it must be the index of the filter's first input in its workspace"
        )
    if filter.name in find_names() and filter is find_filter(filter.name):
        raise DataError(f"{filter.name} does not compute with controls; leave inputs out")


def checked_filter(filter, feedback, prediction, barometer, inputs):
    """The Filter of that name; raises DataError where nothing can be flown on it."""
    filter = batch.found(find_filter, filter)
    if not batch.positioned(filter) and (feedback == "estimate" or prediction == "model"):
        raise DataError(
            f"{filter.name} estimates no position, and the autopilot flies by one; take feedback='truth', prediction='imu'"
        )
    kinds = ("position", "velocity", *([QUANTITIES[barometer.quantity]] if barometer else []))
    batch.check_needs(
        filter,
        [Aiding(kind, np.empty(0), np.empty((0, 3)), np.empty((0, 3))) for kind in kinds],
        "a flight has a receiver, a barometer where it is given one, and nothing else",
    )
    if inputs is not None:
        _check_inputs(inputs, filter)
    return filter


def times(duration, rate):
    """(ends of the samples, their lengths), s."""
    if not real(duration) or not 0 < duration * rate <= MOST_SAMPLES or round(duration * rate) < 2:
        raise DataError(
            f"cannot fly {duration!r} s at {rate:g} Hz; give two samples or more, and at most {MOST_SAMPLES / 1e6:g} million"
        )
    grid = np.arange(round(duration * rate) + 1) / rate
    return grid[1:].copy(), np.diff(grid)
