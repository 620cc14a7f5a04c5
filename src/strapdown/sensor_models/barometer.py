"""MeasurementModel equation of a barometer: pressure of the standard atmosphere at a height above its
zero, with weather, offset and noise.

    p = p_ISA(h - zero) + bias + weather + w,   or as a height, pressure_altitude(p)

h is the ellipsoidal height of the sensor; `zero` the ellipsoidal height at which the standard
atmosphere has its sea level, which takes up the geoid and the pressure of the day; weather is a
stationary first-order Gauss-Markov process. Fossen (2021), Handbook of Marine Craft, section 14.1;
the heights of the standard atmosphere are geopotential and are not told from geometric ones, which
differ by 0.16 m at 1 km.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_array, check_choice, check_number
from ..data.solution import Source, Trajectory
from ..typing import Array
from .atmosphere import (
    MAX_AIR,
    MIN_AIR,
    pressure_altitude,
    pressure_gradient,
    standard_pressure,
)
from .noise import gauss_markov
from .sampling import arm_in_navigation, interpolate_trajectory, sample_times
from .streams import RandomStream, SeedLike

KIND_OF_QUANTITY = {"pressure": "pressure", "height": "pressure-altitude"}
"""Kinds of measurement by the quantity that a barometer gives."""
MAX_ERROR = 10_000.0  # Pa: of weather, offset and noise; the weather of the Earth stays within
BOUNDS: dict[str, tuple[str, dict[str, Any]]] = {
    "std": ("Pa", {"above": 0, "most": MAX_ERROR}),
    "bias": ("Pa", {"least": -MAX_ERROR, "most": MAX_ERROR}),
    "drift": ("Pa", {"least": 0, "most": MAX_ERROR}),
    "drift_time": ("s", {"above": 0}),
    "zero": ("m", {}),
}
"""Units and bounds of the numbers of a barometer."""


@dataclass(frozen=True)
class Barometer:
    """A barometer, in SI. Raises DataError on what none can be."""

    rate: float | None = None  # samples per second; None: one with every IMU sample
    std: float = 5.0  # Pa, white noise of each sample: 0.4 m at sea level
    bias: float = 0.0  # Pa: what it reads too much
    drift: float = 0.0  # Pa: stationary standard deviation of the weather
    drift_time: float = 6 * 3600.0  # s: time constant of the weather
    zero: float = 0.0  # m: ellipsoidal height of the standard atmosphere's sea level
    lever_arm: tuple[float, ...] = (0.0, 0.0, 0.0)  # from the IMU to the sensor, m, body
    quantity: str = "pressure"  # what it gives: "pressure", or "height" by the standard atmosphere

    def __post_init__(self) -> None:
        if self.rate is not None:
            check_number(self.rate, "barometer: rate", "Hz", above=0)
        for name, (unit, bounds) in BOUNDS.items():
            check_number(getattr(self, name), f"barometer: {name}", unit, **bounds)
        lever_arm = check_array(
            self.lever_arm, "barometer: lever_arm", (3,), what="numbers: forward, right, down, m"
        )
        object.__setattr__(self, "lever_arm", tuple(lever_arm.tolist()))
        check_choice(self.quantity, "barometer: quantity", KIND_OF_QUANTITY)

    def measure(self, truth: Trajectory, seed: SeedLike) -> Source:
        """Source "pressure" (y in Pa) or "pressure-altitude" (y in m) of a flight, its std in m;
        `seed` as of `ImuSpec.corrupt`. Raises DataError."""
        return self.plan(truth).fixes(seed)

    def plan(self, truth: Trajectory, gate: float | None = None) -> "BarometerPlan":
        """Return the BarometerPlan that all runs over one trajectory share; `gate` is that of its
        source. Raises DataError."""
        t = sample_times(truth, self.rate)
        height = (
            interpolate_trajectory(truth, t).lla[:, 2]
            - arm_in_navigation(truth, t, self.lever_arm, "barometer")[:, 2]
        )
        above = height - self.zero
        if np.any((above < MIN_AIR) | (above > MAX_AIR)):
            raise DataError(
                f"barometer: it comes to {above[np.argmax(np.abs(above))]:.6g} m above its zero; "
                f"the standard atmosphere here goes from "
                f"{MIN_AIR:g} to {MAX_AIR:g} m"
            )
        std = self.std / -pressure_gradient(above)  # m, as the innovation of both kinds
        source = Source(
            KIND_OF_QUANTITY[self.quantity],
            t,
            np.empty((0, 1)),
            std[:, None],
            self.lever_arm,
            gate,
            "barometer",
        )
        return BarometerPlan(source, height, standard_pressure(above), self)


class BarometerPlan(NamedTuple):
    """Error-free measurements of a barometer; each run adds its own errors."""

    source: Source  # all but its y
    height: Array  # (n,) m, ellipsoidal, of the sensor
    pressure: Array  # (n,) Pa at it
    barometer: Barometer

    def fixes(self, seed: SeedLike) -> Source:
        """The source of one run."""
        return self.measure_with_bias(seed)[0]

    def measure_with_bias(self, seed: SeedLike) -> tuple[Source, Array]:
        """(source of one run, (n,) m by which its barometric heights exceed the ellipsoidal ones
        but for noise); noise and weather a stream each."""
        noise, weather = map(RandomStream.of(seed).child, ("noise", "weather"))
        wander = gauss_markov(np.diff(self.source.t) / self.barometer.drift_time, weather)[
            : len(self.height), 0
        ]
        error = self.barometer.bias + self.barometer.drift * wander
        bias = pressure_altitude(self.pressure + error) - self.height
        return self._with(
            self.pressure + error + self.barometer.std * noise.standard_normal(len(self.height))
        ), bias

    def exact(self) -> Source:
        """The source of a barometer without errors, which states the noise of the one with them."""
        return self._with(self.pressure)

    def notes(self, source: Source) -> list[str]:
        """Sentences for the notes of a recording: no sample at all."""
        return (
            []
            if len(source.t)
            else ["barometer: not one sample falls into the recording; its rate is too low"]
        )

    def _with(self, pressure: Array) -> Source:
        y = pressure if self.barometer.quantity == "pressure" else pressure_altitude(pressure)
        return replace(self.source, y=y[:, None].copy())
