"""The IMU noise that filters assume, checked against the stretches of the recorded data in which
the IMU is at rest.

White noise is the coefficient of the Allan deviation where its curve is one of sensor noise, and
else at most what any cluster time shows: a vibrating or coarsely counted record has no line of
slope -1/2. What bias instability and random walk come to is read without a fit, as the Allan
deviation at the longest cluster that the record has enough of, beside the one that a filter with
that `Noise` believes. At rest an IMU has the noise of the sensor; in motion vibration, scale and
time stamps add to it, and a grade for motion is above its rest on purpose.
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from strapdown.allan.deviation import Allan, Curve, Sensor, allan
from strapdown.allan.page import longest
from strapdown.allan.suggested_grade import MISFIT, expected_deviation, suggest
from strapdown.core.loop.contract import Imu, Noise
from strapdown.data.recording import Recording
from strapdown.io import read
from strapdown.io.locate import data_folder
from strapdown.sensor_models.errors import Triad
from strapdown.sensor_models.imu import ImuSpec, imu as imu_spec
from strapdown.units.conversion import in_units

from ..common.example_recordings import DESCRIPTIONS

FEWEST_FREEDOMS = 20.0
"""Degrees of freedom of the longest cluster that is compared: a deviation then is known to 16 %."""
UNITS = {"gyro": ("deg/sqrt(h)", "deg/h"), "accel": ("m/s/sqrt(h)", "mg")}
"""Units of white noise and deviation, for each sensor."""
SI = {"gyro": ("rad/sqrt(s)", "rad/s"), "accel": ("m/s/sqrt(s)", "m/s^2")}


class Rest(NamedTuple):
    """A stretch in which the IMU of a recording is at rest."""

    name: str
    file: str  # in the folder of descriptions, or of recorded data
    start: float = -np.inf  # s of the recording
    stop: float = np.inf
    # what a filter is told where the recording does not say; "": what comes nearest
    grade: str = ""


RESTS = (
    Rest("lasergyro", "lasergyro/lasergyro.imu.xz", grade="navigation"),
    Rest("drive0708, before", "drive0708.toml", 4.0, 22.5),
    Rest("drive0708, after", "drive0708.toml", 533.0, 552.0),
    Rest("thor75, switched on", "thor75-full.toml", 1.0, 73.0),
    Rest("thor75, before launch", "thor75-full.toml", 110.0, 175.5),
    Rest("thor75, landed", "thor75-full.toml", 628.0, 687.5),
    Rest("broad 02", "broad/02_undisturbed_slow_rotation_B.npz", 1.0, 33.0),
    Rest("broad 15", "broad/15_undisturbed_fast_translation_A.npz", 1.0, 33.0),
    Rest("broad 21", "broad/21_undisturbed_fast_combined.npz", 1.0, 33.0),
    Rest("broad 24", "broad/24_disturbed_tapping_A.npz", 1.0, 33.0),
    Rest("broad 33", "broad/33_disturbed_attached_magnet_2cm.npz", 1.0, 33.0),
    Rest("gnss_imu_txt", "native/gnss_imu_txt/IMU.txt.xz"),
    Rest("px4_small", "native/px4_small.ulg.xz"),
)
"""Those of the recorded data that last for 5 s and more without a gap. No phone, camera or copter
in it rests that long."""


class AllanRow(NamedTuple):
    """One figure of one sensor on one stretch, the mean of its axes, in `unit`."""

    recording: str
    seconds: float
    sensor: str  # "gyro" or "accel"
    quantity: str  # "white noise", "white noise, at most", or "deviation at ... s"
    measured: float
    low: float  # bounds that hold the true value with a probability of 68 %
    high: float
    unit: str
    grade: str
    assumed: float  # by a filter that is told the grade

    @property
    def ratio(self) -> float:
        """Measured over assumed: above 1 the filter assumes too little."""
        return self.measured / self.assumed


def rows(rests: tuple[Rest, ...] = RESTS, folder: Path | None = None) -> list[AllanRow]:
    """The Rows of these stretches, of recordings in `folder` (the data folder). Raises DataError
    where one cannot be read, or is not at a constant rate."""
    return [row for rest in rests for row in _of_rest(rest, str(folder or data_folder()))]


def frame(found: Iterable[AllanRow]) -> pd.DataFrame:
    """The Rows as texts for a page: bounds of 68 % in brackets, the unit once."""
    return pd.DataFrame(
        [
            (
                row.recording,
                f"{row.seconds:.0f}",
                row.sensor,
                row.quantity,
                f"{row.measured:.3g} ({row.low:.3g} to {row.high:.3g}) {row.unit}",
                row.grade,
                f"{row.assumed:.3g}",
                _short(row.ratio),
            )
            for row in found
        ],
        columns=(
            "at rest",
            "s",
            "sensor",
            "figure",
            "measured",
            "grade",
            "assumed",
            "measured over assumed",
        ),
    )


def _of_rest(rest: Rest, folder: str) -> Iterator[AllanRow]:
    recording = _read(rest.file, folder)
    result = allan(even_stamps(longest(recording.between(rest.start, rest.stop).imu)[0]))
    spec = _assumed_grade(rest, recording, result)
    noise = spec.noise()
    for sensor, triad in zip((result.gyro, result.accel), _believed_noise(noise)):
        for quantity, kind, measured, low, high, assumed in _figures(sensor, triad):
            numbers = [
                in_units(value, SI[sensor.name][kind], UNITS[sensor.name][kind])
                for value in (measured, low, high, assumed)
            ]
            yield AllanRow(
                rest.name,
                result.duration,
                sensor.name,
                quantity,
                *numbers[:3],
                UNITS[sensor.name][kind],
                spec.name,
                numbers[3],
            )


@lru_cache(maxsize=2)
def _read(file: str, folder: str) -> Recording:
    description = DESCRIPTIONS / file
    return read(description if description.suffix == ".toml" else Path(folder) / file)


def even_stamps(imu: Imu) -> Imu:
    """The samples at a constant rate: what varies at rest are the stamps that a logger gave them,
    not the sensor's own clock, so the rates stand and the intervals are their mean."""
    dt = np.full(len(imu.t), (imu.t[-1] - imu.t[0]) / (len(imu.t) - 1))
    scale = (dt / imu.dt)[:, None]
    return Imu(imu.t[0] + dt * np.arange(len(dt)), dt, imu.dtheta * scale, imu.dv * scale)


def _assumed_grade(rest: Rest, recording: Recording, result: Allan) -> ImuSpec:
    """Return the grade that a filter assumes for a recording."""
    return imu_spec(rest.grade or recording.meta.get("grade") or suggest(result).grade)


def _believed_noise(noise: Noise) -> tuple[Triad, Triad]:
    """Gyro and accelerometer as a filter with that Noise believes them to be."""

    def triad(white: float, drive: float, decay: float) -> Triad:
        if decay:
            return Triad(white, gauss_markov=drive / np.sqrt(2 * decay), time_constant=1 / decay)
        return Triad(white, bias_walk=drive)

    return (
        triad(noise.gyro, noise.gyro_bias, noise.gyro_decay),
        triad(noise.accel, noise.accel_bias, noise.accel_decay),
    )


def _figures(
    sensor: Sensor, believed: Triad
) -> Iterator[tuple[str, int, float, float, float, float]]:
    """(quantity, 0 or 1 for its unit, measured, low, high, assumed) in SI."""
    curve = sensor.triad
    white, std = curve.fit.value["white noise"], curve.fit.std["white noise"]
    if max(each.fit.misfit for each in (*sensor.axes, curve)) <= MISFIT and np.isfinite(white):
        yield "white noise", 0, white, white - std, white + std, believed.noise
    else:
        most = curve.deviation * np.sqrt(curve.tau)
        k = int(np.argmin(most))
        root = np.sqrt(curve.tau[k])
        yield (
            "white noise, at most",
            0,
            float(most[k]),
            float(curve.low[k] * root),
            float(curve.high[k] * root),
            believed.noise,
        )
    k = _longest(curve)
    yield (
        f"deviation at {_short(curve.tau[k])} s",
        1,
        float(curve.deviation[k]),
        float(curve.low[k]),
        float(curve.high[k]),
        float(expected_deviation(believed, curve.tau[k])),
    )


def _short(value: float) -> str:
    """Two digits, never as a power of ten."""
    return f"{float(f'{value:.2g}'):g}"


def _longest(curve: Curve) -> int:
    """Row of the longest cluster time that is known well enough."""
    return int(np.flatnonzero(curve.edf >= FEWEST_FREEDOMS)[-1])
