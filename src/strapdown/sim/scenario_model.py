"""A scenario: a motion, its sensors and the start of a filter, everything that a simulated run
needs except its seed and its IMU."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np

from ..checks import DataError, check_array, check_choice, check_number, locate_errors
from ..core.loop.contract import STATES
from ..core.mathematics.earth import LATITUDE_LIMIT
from ..data.solution import Trajectory
from ..sensor_models.ahrs import Ahrs
from ..sensor_models.any_sensor import Simulated
from ..sensor_models.barometer import Barometer
from ..sensor_models.geomagnetism import geomagnetic_field
from ..sensor_models.gnss import Gnss
from ..sensor_models.imu import ImuSpec, imu as imu_spec
from ..sensor_models.magnetometer import Magnetometer
from ..sensor_models.sampling import check_rate
from ..typing import Array, File
from .trajectory import DEG, Motion, sample

START_STD: tuple[float | None, ...] = (1.0, 1.0, 1.5, 0.1, 0.1, 0.1, 2e-3, 2e-3, 10e-3, *[None] * 6)
"""Default std of a start: m, m/s, rad, and None for biases, which takes those of the IMU."""
FASTEST_MOTION, MIN_MOTION, MAX_MOTION = 3000.0, -1000.0, 100e3
"""Bounds of the models: m/s, m, m."""
STEEPEST_PITCH = 89 * DEG
"""Largest pitch, rad; beyond it roll and heading cannot be separated."""
MAX_IMU_SAMPLES, MAX_SCENARIO = 50_000_000, 10 * 86400.0
"""Largest numbers of IMU samples and of seconds of a scenario, which is simulated in memory."""
MAX_OFFSET = 1000.0  # m/s^2
GRAVITIES = ("height", "latitude")
OTHER_SENSORS = {"magnetometer": Magnetometer, "barometer": Barometer, "attitude": Ahrs}
"""Sensors that a scenario may have beside IMU and GNSS, by its fields, in the order of their
random streams."""
KINDS: dict[str, tuple[type, ...]] = {
    "motion": (Motion,),
    "gnss": (Gnss,),
    **{name: (kind, type(None)) for name, kind in OTHER_SENSORS.items()},
}
"""Types of the fields of a scenario."""
_GLANCE = 0.5  # s: pieces of the position integral behind checks and fingerprint
_ROWS = 50  # samples of the truth in a fingerprint
# of latitude, longitude (rad), height (m), velocity (m/s), quaternion in a fingerprint
_DECIMALS = (10, 10, 3, *[6] * 3, *[9] * 4)


@dataclass(frozen=True)
class Scenario:
    """Specification of a simulated run, except for its seed; a study may replace its IMU. SI and
    radians. Raises DataError where it is impossible.

    Attributes
    ----------
    name : str
        Name of the scenario.
    motion : Motion
        Motion of the vehicle.
    duration : float
        Length, s.
    rate : float
        IMU samples per second.
    gnss : Gnss
        GNSS receiver.
    imu : ImuSpec or File
        IMU; a study may take another.
    start_std : tuple[float or None, ...]
        Standard deviations of a start's errors, 15 in the order of the error states, SI;
        None: a bias as the IMU's own.
    accel_offset : tuple of float
        Accelerometer offset in addition to the IMU's errors, m/s^2, body; the filter does not know
        it.
    offset_decays : bool
        True: the offset is an initial value of the IMU's Gauss-Markov bias; else it is
        constant.
    biases_known : bool
        True: a start's biases err by start_std from the true ones; else they are 0.
    gate : float or None
        Bound on the NIS of the fixes; None: 0.1 % false alarms; inf: no gate.
    gravity : str
        "height", or "latitude": the true gravity does not depend on height.
    about : str
        A descriptive sentence.
    magnetometer : Magnetometer or None
        Magnetometer, if any.
    barometer : Barometer or None
        Barometer, if any.
    date : str or None
        Date of the geomagnetic model, ISO 8601.
    attitude : Ahrs or None
        AHRS, if any.
    sensors : tuple of Simulated
        Further sensors of any kind, each with a name of its own.
    """

    name: str
    motion: Motion
    duration: float
    rate: float = 100.0
    gnss: Gnss = field(default_factory=Gnss)
    imu: ImuSpec | File = "tactical"
    start_std: tuple[float | None, ...] = START_STD
    accel_offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    offset_decays: bool = False
    biases_known: bool = False
    gate: float | None = None
    gravity: str = "height"
    about: str = ""
    magnetometer: Magnetometer | None = None
    barometer: Barometer | None = None
    date: str | None = None
    attitude: Ahrs | None = None
    sensors: tuple[Simulated, ...] = ()

    def __post_init__(self) -> None:
        for name in ("start_std", "accel_offset", "sensors"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        with locate_errors(f"scenario {self.name!r}"):
            self._check()

    def _check(self) -> None:
        """Raise DataError where the scenario is impossible."""
        for name, kinds in KINDS.items():
            if not isinstance(getattr(self, name), kinds):
                raise DataError(
                    f"{name} must be a "
                    f"{' or '.join(kind.__name__.removesuffix('Type') for kind in kinds)}, not "
                    f"{type(getattr(self, name)).__name__}"
                )
        check_number(self.rate, "rate", "Hz", above=0)
        check_number(self.duration, "duration", "s", above=0)
        if self.duration * self.rate < 1.5:
            raise DataError(
                f"cannot simulate {self.duration!r} s at {self.rate!r} Hz; both must be larger than "
                f"0 and give two samples or more"
            )
        if self.duration * self.rate > MAX_IMU_SAMPLES or self.duration > MAX_SCENARIO:
            raise DataError(
                f"{self.duration:g} s at {self.rate:g} Hz are "
                f"{self.duration * self.rate:.3g} IMU samples; "
                f"at most {MAX_IMU_SAMPLES / 1e6:g} million in {MAX_SCENARIO / 86400:g} days "
                f"are simulated (a day at 100 Hz has 8.6 million)"
            )
        check_choice(self.gravity, "gravity", GRAVITIES)
        if self.gate is not None:
            check_number(self.gate, "gate", above=0, infinite=True)
        check_array(
            self.accel_offset,
            "accel_offset",
            (3,),
            what="numbers in m/s^2",
            least=-MAX_OFFSET,
            most=MAX_OFFSET,
        )
        _check_start(self.start_std)
        self.gnss.check(self.rate)
        self._check_others()
        imu_spec(self.imu)
        self._check_truth()

    def _check_others(self) -> None:
        """Raise DataError where the sensors beside IMU and GNSS are impossible, or the date is."""
        names = [sensor.name for sensor in self.sensors if isinstance(sensor, Simulated)]
        if len(set(names)) < len(self.sensors):
            raise DataError(
                f"sensors are {self.sensors!r}; each must be a Simulated with a name of its own"
            )
        others = [(name, getattr(self, name)) for name in OTHER_SENSORS]
        for name, other in others + list(zip(names, self.sensors)):
            if other is not None:
                check_rate(other.rate, self.rate, name)
        try:
            datetime.fromisoformat("2025-06-01" if self.date is None else self.date)
        except (TypeError, ValueError):
            raise DataError(f"date is {self.date!r}; write it as 2025-06-01") from None
        if self.magnetometer is not None and self.magnetometer.field is None and self.date is None:
            raise DataError(
                "a magnetometer needs the Earth's field: give it as the magnetometer's field, or a "
                "date for the geomagnetic model"
            )

    def magnetic_field(self) -> Array:
        """The Earth's field of all the scenario, (3,) T NED: the magnetometer's own, or that of the
        geomagnetic model where the motion begins.

        Raises DataError where the model does not cover the date.
        """
        if self.magnetometer is not None and self.magnetometer.field is not None:
            return np.array(self.magnetometer.field, float)
        if self.date is None:
            raise DataError(f"scenario {self.name!r}: the geomagnetic model needs a date")
        lat, lon, height = map(float, self.motion.lla)
        return np.array(geomagnetic_field(self.date, lat, lon, height).field, float)

    def _check_truth(self) -> None:
        """Raise DataError where the motion leaves the limits of the models, checked at some
        hundreds of times, once a second in a long motion."""
        truth = self.glance(max(200, min(20_000, int(self.duration))))
        assert truth.v_n is not None and truth.q_nb is not None  # `sample` sets them
        columns = {"position": truth.lla, "velocity": truth.v_n, "attitude": truth.q_nb}
        for name, values in columns.items():
            if not np.all(np.isfinite(values)):
                raise DataError(
                    f"the motion's {name} is not finite at "
                    f"{truth.t[~np.isfinite(values).all(axis=1)][0]:g} s"
                )
        w, x, y, z = truth.q_nb.T
        pitch = np.arcsin(np.clip(2 * (w * y - x * z), -1, 1))
        speed, lat, alt = (
            np.linalg.norm(truth.v_n, axis=1),
            np.abs(truth.lla[:, 0]),
            truth.lla[:, 2],
        )
        for bad, text in (
            (speed > FASTEST_MOTION, f"is faster than {FASTEST_MOTION:g} m/s"),
            (lat > LATITUDE_LIMIT, f"is beyond {LATITUDE_LIMIT / DEG:g} deg of latitude"),
            (
                np.abs(pitch) >= STEEPEST_PITCH,
                f"has a pitch of {STEEPEST_PITCH / DEG:g} deg or more",
            ),
            (alt < MIN_MOTION, f"is lower than {MIN_MOTION:g} m"),
            (alt > MAX_MOTION, f"is higher than {MAX_MOTION / 1e3:g} km"),
        ):
            if bad.any():
                raise DataError(
                    f"the motion {text} at {truth.t[bad][0]:g} s; the models are not valid there"
                )

    def glance(self, rows: int) -> Trajectory:
        """Return the truth at `rows` times from start to end, as data.Trajectory, with a coarse
        integral."""
        return sample(
            self.motion,
            np.linspace(0.0, round(self.duration * self.rate) / self.rate, rows),
            _GLANCE,
        )

    def start_deviations(self, spec: ImuSpec) -> Array:
        """The 15 standard deviations of a start with the IMU `spec` (ImuSpec): `start_std`, its
        None those of the IMU's biases."""
        return start_deviations(self.start_std, spec)

    def replace(self, **changes: Any) -> "Scenario":
        """The same scenario with some fields changed."""
        return replace(self, **changes)

    def describe(self) -> dict[str, Any]:
        """Return a dict of JSON values that identifies the scenario, for a manifest; `fingerprint`
        changes when anything of it does."""
        values = {
            "name": self.name,
            "motion": self.motion.name,
            "duration_s": float(self.duration),
            "rate_hz": float(self.rate),
            "gnss": self.gnss.describe(),
            "imu": asdict(self.imu) if isinstance(self.imu, ImuSpec) else str(self.imu),
            "start_std": list(self.start_std),
            "accel_offset_m_s2": list(self.accel_offset),
            "offset_decays": bool(self.offset_decays),
            "biases_known": bool(self.biases_known),
            "gate": None if self.gate is None else str(float(self.gate)),
            "gravity": self.gravity,
            "about": self.about,
        }
        values |= {
            name: asdict(other)
            for name in OTHER_SENSORS
            if (other := getattr(self, name)) is not None
        }
        values |= {"sensors": list(map(_fields_of, self.sensors))} if self.sensors else {}
        values |= {"date": self.date} if self.date is not None else {}
        values = json.loads(json.dumps(values, default=lambda value: np.asarray(value).tolist()))
        identity = {
            key: value for key, value in values.items() if key not in ("name", "about", "motion")
        } | {"imu": asdict(imu_spec(self.imu))}
        digest = hashlib.sha256(json.dumps(identity, sort_keys=True).encode())
        digest.update(self._truth_bytes())
        return values | {"fingerprint": digest.hexdigest()}

    def _truth_bytes(self) -> bytes:
        """Return the truth at some times, rounded far below relevant changes and far above the
        rounding differences of other machines."""
        truth = self.glance(_ROWS)
        rows = np.c_[truth.lla, truth.v_n, truth.q_nb]
        return (
            np.stack(
                [
                    np.round(column * 10.0**decimals) + 0.0
                    for column, decimals in zip(rows.T, _DECIMALS)
                ]
            )
            .astype("<i8")
            .tobytes()
        )


def _fields_of(sensor: Simulated) -> dict[str, Any]:
    """The fields of a sensor; without states where it has none, so that its fingerprint is that of
    before there were any."""
    return {key: value for key, value in asdict(sensor).items() if key != "states" or value}


def start_deviations(std: Sequence[float | None], spec: ImuSpec) -> Array:
    """`std`, the 15 standard deviations of a start, with those of the biases of the IMU `spec`
    where one of its last six is None. Raises DataError."""
    _check_start(std)
    own = [None] * 9 + np.repeat(spec.bias_std(), 3).tolist()
    return np.array([own[i] if value is None else value for i, value in enumerate(std)], float)


def _check_start(std: Sequence[float | None]) -> None:
    own = [0.0 if value is None and row >= 9 else value for row, value in enumerate(std)]
    what = "numbers; of the last six, None is the IMU's own"
    attitude = check_array(own, "start_std", (STATES,), what=what, least=0)[6:9].max()
    if attitude > np.pi:
        raise DataError(
            f"the attitude's start_std is {attitude / DEG:g} deg; it must be at most 180"
        )
