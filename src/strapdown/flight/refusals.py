"""Checks of a flight before it begins, and the inputs of its filter."""

import inspect
from typing import Any

import numpy as np

from ..checks import DataError, brief, check_array, check_choice, check_number
from ..core.loop.contract import Filter, Noise
from ..data.solution import Source
from ..engine.prepare import check_needs, has_position
from ..filters import find as find_filter, names as find_names
from ..sensor_models.barometer import KIND_OF_QUANTITY, Barometer
from ..sensor_models.gnss import Gnss
from ..sensor_models.sampling import check_rate
from ..sensor_models.streams import RandomStream
from ..typing import Array
from .aircraft_model.parameters import Aircraft
from .aircraft_model.wind import TURBULENCE_LEVELS
from .asked import RECORDS, Loop, Sensors, World
from .sensor_errors import Outage, Windows, outage_windows

MAX_FLIGHT_SAMPLES = 2_000_000
"""Samples of the IMU in one flight at most."""


def handed_options(
    filter: Filter, stream: RandomStream, world: World, rate: float
) -> dict[str, Any]:
    """Those of a flight's own that the filter's start has options for, unless they are bound to
    it already (functools.partial); the seed is a number of the stream."""
    own = {
        "seed": stream.key[0],
        "aircraft": (
            world.aircraft if isinstance(world.aircraft, Aircraft) else str(world.aircraft)
        ),
        "rate": float(rate),
        "earth": world.earth,
    }
    known, bound = inspect.signature(filter.start).parameters, getattr(filter.start, "keywords", {})
    return {name: value for name, value in own.items() if name in known and name not in bound}


def check(seed: int, world: World, sensors: Sensors, loop: Loop) -> None:
    """Raise DataError, in one line, for arguments that no flight can have."""
    for given, (name, record) in zip((world, sensors, loop), RECORDS.items()):
        if not isinstance(given, record):
            raise DataError(f"{name} is {brief(given)}; it must be a {record.__name__}")
    check_number(seed, "seed", least=0, whole=True)
    check_choice(loop.feedback, "feedback", ("estimate", "truth"))
    check_choice(loop.prediction, "prediction", ("imu", "model", "model-always"))
    check_choice(world.earth, "earth", ("geodetic", "flat"))
    check_choice(world.turbulence, "turbulence", TURBULENCE_LEVELS)
    axes = "numbers: north, east, down, m/s"
    check_array(world.wind, "wind", (3,), what=axes)
    told = (0.0,) * 3 if world.told_wind is None else world.told_wind
    check_array(told, "told_wind", (3,), what=axes)
    check_number(sensors.rate, "rate", "Hz", above=0)
    if not isinstance(loop.model_noise, Noise):
        raise DataError(f"model_noise is {loop.model_noise!r}; it must be a Noise")
    check_array(loop.model_noise, "model_noise", (len(Noise._fields),), least=0)


def check_sensors(gnss: Gnss, sensors: Sensors) -> None:
    """Raise DataError for a receiver, a gate of its fixes or a barometer that cannot be flown
    with the IMU."""
    gnss.check(sensors.rate)
    if sensors.gate is not None:
        check_number(sensors.gate, "gate", above=0, infinite=True)
    barometer = sensors.barometer
    if barometer is not None:
        if not isinstance(barometer, Barometer):
            raise DataError(f"barometer is {barometer!r}; it must be a Barometer")
        check_rate(barometer.rate, sensors.rate, "barometer")


def checked_windows(outage: Outage, prediction: str, end: float) -> Windows:
    """The windows of `flight_sensors.outage_windows`; raises DataError where the model waits for
    one in vain."""
    windows = outage_windows(outage, end)
    if prediction == "model" and not windows:
        raise DataError(
            "prediction='model' takes over while the receiver is cut, and it never is; give an "
            'outage, such as "15:"'
        )
    return windows


def _check_inputs(inputs: int, filter: Filter) -> None:
    """Raise DataError where a filter cannot be told the controls there."""
    check_number(inputs, "inputs (index in the filter's workspace)", least=0, whole=True)
    if filter.name in find_names() and filter is find_filter(filter.name):
        raise DataError(f"{filter.name} does not compute with controls; leave inputs out")


def checked_filter(filter: Filter | str, loop: Loop, barometer: Barometer | None) -> Filter:
    """The Filter of that name; raises DataError where nothing can be flown on it."""
    chosen = find_filter(filter)
    by_estimate = loop.feedback == "estimate" or loop.prediction != "imu"
    if not has_position(chosen) and by_estimate:
        raise DataError(
            f"{chosen.name} estimates no position, and the autopilot flies by one; take "
            f"feedback='truth', prediction='imu'"
        )
    kinds = ("position", "velocity", *([KIND_OF_QUANTITY[barometer.quantity]] if barometer else []))
    check_needs(
        chosen,
        [Source(kind, np.empty(0), np.empty((0, 3)), np.empty((0, 3))) for kind in kinds],
        "a flight has a receiver, a barometer where it is given one, and nothing else",
    )
    if loop.inputs is not None:
        _check_inputs(loop.inputs, chosen)
    return chosen


def steps_of(rate: float, filter_rate: float | None) -> int:
    """Steps of the aircraft (`rate`, 1/s) in a sample of the filter. Raises DataError where they
    are no whole number."""
    if filter_rate is None:
        return 1
    check_number(filter_rate, "filter_rate", "Hz", above=0)
    steps = round(rate / filter_rate)
    if steps < 1 or abs(steps * filter_rate - rate) > 1e-9 * rate:
        raise DataError(
            f"filter_rate is {filter_rate:g} Hz; it must be the rate of the flight, {rate:g} Hz, "
            f"divided by a whole number: give one such as {rate / max(steps, 1):g} Hz"
        )
    return steps


def times(duration: float, rate: float, steps: int = 1) -> tuple[Array, Array, Array, Array]:
    """(ends of the samples, their lengths, ends of the steps, their lengths), s: of samples at
    `rate` (1/s) of `steps` steps each."""
    count = check_number(duration, "duration", "s", above=0) * rate
    if round(count) < 2 or count * steps > MAX_FLIGHT_SAMPLES:
        raise DataError(
            f"cannot fly {duration!r} s at {rate * steps:g} Hz; give two samples or more, and at "
            f"most {MAX_FLIGHT_SAMPLES / 1e6:g} million"
        )
    grid = np.arange(round(count) * steps + 1) / (rate * steps)
    samples = grid[::steps]
    return samples[1:].copy(), np.diff(samples), grid[1:].copy(), np.diff(grid)
