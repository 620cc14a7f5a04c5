"""Errors of three like axes: what they are (`Triad`), and what one bias state of a filter should
make of them.

A further error term is a field of `Triad` with its units, and some lines with a random stream of its
name in imu_errors.py.
"""

from collections.abc import Iterable, Sequence
from dataclasses import Field, dataclass, field, fields
from typing import Any

import numpy as np

from ..checks import DataError, check_number
from ..typing import Array
from ..units.conversion import SHEET
from .noise import FLICKER_FLOOR, FLICKER_TIMES, FLICKER_VARIANCE

MAX_NUMBER = 1e12
"""Bound on every number of a sensor (SI units): squares of larger ones overflow."""
MAX_TERMS = (
    ("scale_factor", 1.0, "1 (100 %)"),
    ("misalignment", np.pi / 4, "0.785 rad (45 deg)"),
)
"""Standard deviations of what a sensor may have at most."""


def _term(
    gyro: str, accel: str | None, gyro_sheet: str | None = None, accel_sheet: str | None = None
) -> Any:
    units = {
        "gyro": gyro,
        "accel": accel,
        "gyro_sheet": gyro_sheet or SHEET[gyro],
        "accel_sheet": accel_sheet or (SHEET[accel] if accel else None),
    }
    return field(default=0.0, metadata=units)


@dataclass(frozen=True)
class WarmUp:
    """Temperature of a run, degC: end + (start - end) exp(-t / time_constant), t in s since the
    run's first sample began."""

    start: float
    end: float
    time_constant: float

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            check_number(getattr(self, name), f"temperature {name}")
        check_number(self.time_constant, "temperature time_constant", least=0)
        if not self.time_constant:
            raise DataError("temperature time_constant is 0; it must be larger")

    def temperature(self, t: Array) -> Array:
        """degC (n,) at `t` (n,) s since the start."""
        return self.end + (self.start - self.end) * np.exp(-t / self.time_constant)


@dataclass(frozen=True)
class Triad:
    """Errors of three like axes, in SI; 0 means absent. Raises DataError on what no sensor can
    have."""

    noise: float = _term("rad/sqrt(s)", "m/s/sqrt(s)")  # white noise: angle or velocity random walk
    turn_on_bias: float = _term("rad/s", "m/s^2")  # std of a bias that is constant during a run
    # random walk of the bias: infinite time constant
    bias_walk: float = _term("rad/s/sqrt(s)", "m/s^2/sqrt(s)")
    # stationary std of a first-order Gauss-Markov bias
    gauss_markov: float = _term("rad/s", "m/s^2")
    time_constant: float = _term("s", "s")  # of the Gauss-Markov bias
    # bias instability B: a 1/f bias whose Allan deviation is flat at 0.664 B
    flicker: float = _term("rad/s", "m/s^2")
    # std of each axis's relative error of scale, constant during a run
    scale_factor: float = _term("1", "1")
    # std of the six angles between true and nominal axes, constant during a run
    misalignment: float = _term("rad", "rad", "mrad", "mrad")
    # std of the nine coefficients from specific force to a gyro's rate, as above
    g_sensitivity: float = _term("rad/s/(m/s^2)", None)
    # step of the counted increments; what is left is carried to the next
    quantisation: float = _term("rad", "m/s", "arcsec")
    # full scale: a larger increment reads as full scale
    saturation: float = _term("rad/s", "m/s^2", "deg/s", "g")
    temperature: tuple[
        tuple[float, ...], ...
    ] = ()  # rows (temperature degC, bias x, y, z): linear in between

    def __post_init__(self) -> None:
        for term in terms():
            check_number(getattr(self, term.name), term.name, least=0, most=MAX_NUMBER)
        for name, most, text in MAX_TERMS:
            if getattr(self, name) > most:
                raise DataError(
                    f"{name} is {getattr(self, name):g}; it must be at most {text}; is its unit "
                    f"right?"
                )
        if (self.gauss_markov > 0) != (self.time_constant > 0):
            present, absent = (
                ("gauss_markov", "time_constant")
                if self.gauss_markov
                else ("time_constant", "gauss_markov")
            )
            raise DataError(
                f"{present} is given without {absent}; a Gauss-Markov bias needs both, larger than "
                f"0"
            )
        object.__setattr__(self, "temperature", _rows(self.temperature))

    def bias_std(self, warm_up: WarmUp | None = None) -> float:
        """Standard deviation of the bias at the start of a run, rad/s or m/s^2; of the
        temperature bias the rms over the axes."""
        flickering = self.flicker * np.sqrt(FLICKER_VARIANCE * len(FLICKER_TIMES))
        start, _ = self._temperature_effect(warm_up)
        return float(
            np.hypot(np.hypot(self.turn_on_bias, self.gauss_markov), np.hypot(flickering, start))
        )

    def bias_model(self, warm_up: WarmUp | None = None) -> tuple[float, float]:
        """(driving noise, decay) of the one bias state of a filter: db/dt = -decay b + noise.

        A Gauss-Markov bias alone is represented exactly. Beside a bias that does not decay, one
        state cannot follow both: the decay is 0, which is right over times short against the time
        constant and cautious beyond it. Flicker is the random walk whose Allan deviation meets the
        floor 0.664 B where the white noise does: the bias can be averaged no better there. A change
        of D (rms over the axes) through the temperature is one of variance D^2 per time constant of
        the warm-up.
        """
        _, change = self._temperature_effect(warm_up)
        alone = (
            self.gauss_markov > 0
            and self.bias_std(warm_up) == self.gauss_markov
            and self.bias_walk == change == 0
        )
        driving = self.bias_walk**2 + (
            2 * self.gauss_markov**2 / self.time_constant if self.gauss_markov else 0.0
        )
        if self.flicker:
            floor = FLICKER_FLOOR * self.flicker
            driving += (
                3
                * floor**2
                / np.clip((self.noise / floor) ** 2, FLICKER_TIMES[0], FLICKER_TIMES[-1])
            )
        driving += change**2 / warm_up.time_constant if warm_up and change else 0.0
        return float(np.sqrt(driving)), 1 / self.time_constant if alone else 0.0

    def count_saturated(self, increments: Array, dt: Array) -> int:
        """Number of samples of which an axis stands at full scale, of `increments` (n, 3), rad or
        m/s, over the intervals `dt` (n,) s."""
        return (
            int(
                (np.abs(increments) >= self.saturation * (1 - 1e-12) * dt[:, None])
                .any(axis=1)
                .sum()
            )
            if self.saturation
            else 0
        )

    def temperature_bias(self, temperature: Array) -> Array:
        """(n, 3) bias at temperatures (n,) degC within the table."""
        table = np.array(self.temperature)
        return np.stack(
            [np.interp(temperature, table[:, 0], column) for column in table[:, 1:].T], axis=1
        )

    def _temperature_effect(self, warm_up: WarmUp | None) -> tuple[float, float]:
        """(rms over the axes of the bias at the start, of its range during the warm-up)."""
        if not self.temperature or warm_up is None:
            return 0.0, 0.0

        def rms(values: Array) -> float:
            return float(np.sqrt(np.mean(np.square(values))))

        corners = [
            row[0]
            for row in self.temperature
            if min(warm_up.start, warm_up.end) < row[0] < max(warm_up.start, warm_up.end)
        ]
        bias = self.temperature_bias(np.array([warm_up.start, warm_up.end, *corners]))
        return rms(bias[0]), rms(np.ptp(bias, axis=0))


def terms(sensor: str | None = None) -> list[Field[Any]]:
    """The fields of Triad that are numbers with units, of both sensors or of one ("gyro" or
    "accel")."""
    return [f for f in fields(Triad) if f.metadata and (sensor is None or f.metadata[sensor])]


def _rows(table: Iterable[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    """A temperature table as a tuple of tuples of floats, by rising temperature. Raises
    DataError."""
    rows = tuple(tuple(row) for row in table)
    for row in rows:
        if len(row) != 4:
            raise DataError(
                f"temperature row {row!r} needs four numbers: temperature in degC and the bias of "
                f"x, y and z"
            )
        for value in row:
            check_number(value, "a number of the temperature table")
    if len(rows) == 1:
        raise DataError(
            "the temperature table has one row; it needs two or more to interpolate between"
        )
    if any(later[0] <= earlier[0] for earlier, later in zip(rows, rows[1:])):
        raise DataError(
            "the temperatures of the temperature table do not rise from row to row; sort them, each "
            "once"
        )
    return tuple(tuple(float(value) for value in row) for row in rows)
