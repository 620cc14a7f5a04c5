"""Options of a flight: the world, the sensors and the loop through the filter."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..checks import DataError
from ..core.loop.contract import InitialState, Noise
from ..sensor_models.barometer import Barometer
from ..sensor_models.gnss import Gnss
from ..sensor_models.imu import ImuSpec
from ..sim.scenario_model import START_STD
from ..typing import Array, File, Notify
from .aircraft_model.parameters import Aircraft
from .sensor_errors import Outage

MODEL_NOISE = Noise(0.04, 0.4, 1e-5, 1e-4, 0.0, 0.0)
"""Noise that a filter assumes of the increments of the aircraft's model by default: the air that the
model does not know, as random walks of 2.3 deg/sqrt(s) and 0.4 m/s/sqrt(s), which is what they
err by over a second of light turbulence (docs/how-to/flight.md has the measurement)."""
RECEIVER = Gnss(interval=0.2)
"""The receiver by default: five fixes a second."""


class World(NamedTuple):
    """The aircraft, the Earth and the air."""

    aircraft: Aircraft | File = "aerosonde"  # its name, its file or itself
    earth: str = "geodetic"  # "flat": for filters of a flat Earth
    wind: Sequence[float] | Array = (0.0, 0.0, 0.0)  # steady, NED, m/s
    # the wind that autopilot and model know; None: all of it
    told_wind: Sequence[float] | Array | None = None
    turbulence: str = "none"  # a level of aircraft.wind.TURBULENCE_LEVELS

    @property
    def told(self) -> tuple[float, ...]:
        """The wind that autopilot and model know, (3,) m/s NED."""
        return tuple(map(float, self.wind if self.told_wind is None else self.told_wind))


class Sensors(NamedTuple):
    """The sensors aboard, with their rates and errors."""

    imu: ImuSpec | File = "industrial"  # grade, file or ImuSpec
    rate: float = 100.0  # steps of aircraft, autopilot and IMU per second
    gnss: Gnss | File = RECEIVER  # a Gnss, or the name or file of a receiver
    gate: float | None = None  # of its fixes
    # when the receiver is cut: "15:" (s, to the end), "15:40,60:70" or a list of (start, stop)
    outage: Outage = None
    barometer: Barometer | None = None  # which no outage touches


class Loop(NamedTuple):
    """Options by which the filter is run, and what autopilot and filter get from each other."""

    feedback: str = "estimate"  # what the autopilot flies by: "estimate" or "truth"
    # who predicts while the receiver is cut: "imu", or "model": the filter gets the increments of
    # the same aircraft model, flown from its own belief with the commands and the told wind, and
    # assumes `model_noise`; "model-always" does so from the beginning, also between fixes
    prediction: str = "imu"
    model_noise: Noise = MODEL_NOISE
    # of a filter that computes with controls: before each sample workspace[inputs : inputs + 9]
    # gets 1 where the model is to predict, the controls (elevator, aileron, rudder, throttle), the
    # told wind and the sample's seconds; its samples stay the IMU's
    inputs: int | None = None
    # samples of the filter per second, which gets the increments of a whole number of steps as one
    # sample and whose last estimate the autopilot flies by; None: the rate of the sensors
    filter_rate: float | None = None
    start: InitialState | None = None  # at 0 s; None: drawn around the truth with `start_std`
    start_std: Sequence[float | None] = START_STD  # 15 numbers; None: the IMU's own biases
    noise: Noise | None = None  # in place of the IMU's
    covariance: bool = False  # whether the whole covariance is kept
    notify: Notify | None = None  # told of slow compilation


WORLD, SENSORS, LOOP = World(), Sensors(), Loop()
"""By default."""
RECORDS: dict[str, type[World] | type[Sensors] | type[Loop]] = {
    "world": World,
    "sensors": Sensors,
    "loop": Loop,
}
DECIDED = {field: name for name, record in RECORDS.items() for field in record._fields}
"""{what the flight decides: the record that has it}."""


def records(**fields: Any) -> dict[str, Any]:
    """{name: World, Sensors or Loop} as `fly` takes them, of their fields by name."""
    parts: dict[str, dict[str, Any]] = {name: {} for name in RECORDS}
    for field, value in fields.items():
        parts[DECIDED[field]][field] = value
    return {name: RECORDS[name](**part) for name, part in parts.items()}


def check_options(options: Mapping[str, Any]) -> None:
    """Raise DataError where an option of the filter is one that the flight decides."""
    for name in options:
        if name in DECIDED:
            record = DECIDED[name]
            raise DataError(
                f"fly has no option {name!r} of its own; give "
                f"{record}={RECORDS[record].__name__}({name}=...)"
            )
