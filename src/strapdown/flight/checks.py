"""What a flight is checked for before it begins, and what it hands to its filter."""

import inspect
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, is_number
from ..core.contract import Filter, Noise
from ..data import Aiding
from ..engine.prepare import check_needs, found, positioned
from ..filters import find as find_filter, names as find_names
from ..sensor_models.barometer import KIND_OF_QUANTITY, Barometer
from ..sensor_models.gnss import Gnss
from ..typing import Array, File
from .aircraft.parameters import Aircraft
from .aircraft.wind import TURBULENCE_LEVELS
from .sensor_errors import Outage, Windows, outage_windows

MOST_FLIGHT_SAMPLES = 2_000_000
"""Of the IMU, in one flight."""


def handed(
    filter: Filter, seed: np.random.SeedSequence, aircraft: Aircraft | File, rate: float, earth: str
) -> dict[str, Any]:
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


class Request(NamedTuple):
    """What `fly` was asked for, as far as it can be judged without anything else."""

    seed: int
    feedback: str
    prediction: str
    earth: str
    turbulence: str
    wind: Sequence[float] | Array  # (3,) m/s NED
    told_wind: Sequence[float] | Array | None  # the same
    rate: float  # 1/s
    model_noise: Noise


def check(asked: Request) -> None:
    """Raise DataError, in one line, for arguments that no flight can have."""
    if (
        isinstance(asked.seed, bool)
        or not isinstance(asked.seed, (int, np.integer))
        or asked.seed < 0
    ):
        raise DataError(f"seed is {asked.seed!r}; it must be a whole number, 0 or more")
    for name, value, known in (
        ("feedback", asked.feedback, ("estimate", "truth")),
        ("prediction", asked.prediction, ("imu", "model")),
        ("earth", asked.earth, ("geodetic", "flat")),
    ):
        if not isinstance(value, str) or value not in known:
            raise DataError(f"{name} is {value!r}; it must be {known[0]!r} or {known[1]!r}")
    if not isinstance(asked.turbulence, str):
        raise DataError(
            f"turbulence is {asked.turbulence!r}; it must be one of {', '.join(TURBULENCE_LEVELS)}"
        )
    for name, vector in (
        ("wind", asked.wind),
        ("told_wind", (0.0, 0.0, 0.0) if asked.told_wind is None else asked.told_wind),
    ):
        if np.shape(vector) != (3,) or not all(
            is_number(part) and math.isfinite(part) for part in vector
        ):
            raise DataError(
                f"{name} is {vector!r}; it must be three numbers: north, east, down, m/s"
            )
    if not is_number(asked.rate) or not 0 < asked.rate < np.inf:
        raise DataError(f"rate is {asked.rate!r} Hz; it must be above 0")
    if not isinstance(asked.model_noise, Noise) or not all(
        is_number(value) and 0 <= value < np.inf for value in asked.model_noise
    ):
        raise DataError(
            f"model_noise is {asked.model_noise!r}; it must be a Noise of numbers, 0 or more"
        )


def check_sensors(gnss: Gnss, gate: float | None, barometer: Barometer | None, rate: float) -> None:
    """Raise DataError for a receiver, a gate of its fixes or a barometer that cannot be flown
    with an IMU of `rate` (Hz)."""
    if not isinstance(gnss, Gnss):
        raise DataError(f"gnss is {gnss!r}; it must be a Gnss")
    gnss.check()
    if not np.ndim(gnss.interval) and gnss.interval * rate < 1 - 1e-9:
        raise DataError(
            f"fixes every {gnss.interval:g} s come faster than the IMU's samples, {rate:g} a "
            f"second; give fixes less often"
        )
    if gate is not None and (not is_number(gate) or not gate > 0):
        raise DataError(f"gate is {gate!r}; it must be a NIS above 0, or None for the filter's own")
    if barometer is not None and not isinstance(barometer, Barometer):
        raise DataError(f"barometer is {barometer!r}; it must be a Barometer")
    if barometer is not None and (barometer.rate or 0.0) > rate * (1 + 1e-9):
        raise DataError(
            f"the barometer's {barometer.rate:g} samples a second come faster than the IMU's, "
            f"{rate:g}; give it a lower rate"
        )


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
    if isinstance(inputs, bool) or not isinstance(inputs, (int, np.integer)) or inputs < 0:
        raise DataError(
            f"inputs is {inputs!r}; it must be the index of the filter's first input in its "
            f"workspace"
        )
    if filter.name in find_names() and filter is find_filter(filter.name):
        raise DataError(f"{filter.name} does not compute with controls; leave inputs out")


def checked_filter(
    filter: Filter | str,
    feedback: str,
    prediction: str,
    barometer: Barometer | None,
    inputs: int | None,
) -> Filter:
    """The Filter of that name; raises DataError where nothing can be flown on it."""
    chosen = found(find_filter, filter)
    if not positioned(chosen) and (feedback == "estimate" or prediction == "model"):
        raise DataError(
            f"{chosen.name} estimates no position, and the autopilot flies by one; take "
            f"feedback='truth', prediction='imu'"
        )
    kinds = ("position", "velocity", *([KIND_OF_QUANTITY[barometer.quantity]] if barometer else []))
    check_needs(
        chosen,
        [Aiding(kind, np.empty(0), np.empty((0, 3)), np.empty((0, 3))) for kind in kinds],
        "a flight has a receiver, a barometer where it is given one, and nothing else",
    )
    if inputs is not None:
        _check_inputs(inputs, chosen)
    return chosen


def times(duration: float, rate: float) -> tuple[Array, Array]:
    """(ends of the samples, their lengths), s."""
    if (
        not is_number(duration)
        or not 0 < duration * rate <= MOST_FLIGHT_SAMPLES
        or round(duration * rate) < 2
    ):
        raise DataError(
            f"cannot fly {duration!r} s at {rate:g} Hz; give two samples or more, and at most "
            f"{MOST_FLIGHT_SAMPLES / 1e6:g} million"
        )
    grid = np.arange(round(duration * rate) + 1) / rate
    return grid[1:].copy(), np.diff(grid)
