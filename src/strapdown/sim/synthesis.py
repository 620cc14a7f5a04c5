"""Simulate Recordings with their truth from a scenario and an IMU's errors, and draw a filter's
start around the truth."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np

from ..checks import DataError, check_array, check_number, check_type
from ..core.loop.contract import ATT, BA, BG, POS, STATES, VEL, Imu, InitialState
from ..data.recording import Recording, RecordingMeta, SimulatedRecording
from ..data.solution import Source, Trajectory
from ..geometry.geodesy import displace_lla
from ..geometry.rotations import Rotation
from ..sensor_models.ahrs import Ahrs
from ..sensor_models.any_sensor import Simulated
from ..sensor_models.barometer import Barometer
from ..sensor_models.gnss import Gnss, without_fixes
from ..sensor_models.imu import ImuSpec, imu as imu_spec, saturation_notes
from ..sensor_models.magnetometer import Magnetometer
from ..sensor_models.receiver import receiver
from ..sensor_models.streams import RandomStream, SeedLike
from ..typing import Array, ArrayLike, File
from .scenario import scenario as find
from .scenario_model import Scenario
from .trajectory import Motion, normal_gravity, records

KEPT = 200_000
"""Largest number of samples of a flight whose truth is kept for the next scenario with the same
motion: at most 30 MB each."""


@lru_cache(maxsize=12)
def _known_records(
    motion: Motion, count: int, rate: float, gravity_of: str
) -> tuple[Trajectory, Imu]:
    """(truth, ideal IMU) of a motion; scenarios that differ only in sensors or start share them."""
    return records(
        motion,
        np.arange(count + 1) / rate,
        _gravity_at_the_ellipsoid if gravity_of == "latitude" else normal_gravity,
    )


OF_IMU, OF_START = "imu", "start"
"""Names of the streams of a run; each sensor has one of its own name too."""


class Simulator:
    """A scenario and the common data of its runs, computed once: the truth and the records of an
    ideal IMU and an exact receiver.

    It does not change afterwards, so threads may share it. The `seed` determines all random numbers
    of a run: a number, several, a numpy Generator or SeedSequence, or a
    sensor_models.streams.Stream. A Generator makes another run each time, all others the same one.
    """

    def __init__(self, scenario: Scenario) -> None:
        """`scenario`: a Scenario. Raises DataError."""
        self.scenario = scenario
        count = round(scenario.duration * scenario.rate)
        known = _known_records if count <= KEPT else _known_records.__wrapped__
        self.truth, self.ideal = known(scenario.motion, count, scenario.rate, scenario.gravity)
        """The true trajectory at 0, 1/rate, ... s, and the increments of an ideal IMU
        (core.loop.contract.Imu) from row to row of it."""
        self._offset = np.asarray(scenario.accel_offset, float)
        self.plan = scenario.gnss.plan(self.truth, scenario.gate)
        self.magnetic = (
            None
            if scenario.magnetometer is None
            else scenario.magnetometer.plan(self.truth, scenario.magnetic_field(), scenario.gate)
        )
        self.barometric = (
            None
            if scenario.barometer is None
            else scenario.barometer.plan(self.truth, scenario.gate)
        )
        self.attitude = (
            None if scenario.attitude is None else scenario.attitude.plan(self.truth, scenario.gate)
        )
        self.sensors = tuple(
            sensor.plan(self.truth, self.ideal, scenario.gate) for sensor in scenario.sensors
        )

    def recording(self, imu: ImuSpec | dict[str, Any] | File, seed: SeedLike) -> SimulatedRecording:
        """A Recording with the errors of `imu` (ImuSpec, grade or file) and fixes, each sensor with
        its own stream of `seed`.

        meta holds the true biases "b_a" (m/s^2, the scenario's offset included) and "b_g" (rad/s),
        (n, 3) at the IMU samples. For a barometer it has "b_baro" (m): its height error without
        noise, (n,) at its samples; for an IMU that warms up, its "temperature" (m, 2), s and degC.
        """
        spec = imu_spec(imu)
        stream = RandomStream.of(seed)
        samples, b_a, b_g = spec.corrupt(self.ideal_samples(spec), stream.child(OF_IMU))
        sources = self.sources(imu, stream, b_a + self.offset(spec), b_g)
        notes = saturation_notes(spec, samples) + sources.meta["notes"]
        made = replace(sources, imu=samples).with_meta(notes=notes)
        if spec.warm_up is None:
            return made
        since, last = samples.t[0] - samples.dt[0], samples.t[-1]
        t = np.append(np.arange(since, last), last)
        return made.with_meta(temperature=np.c_[t, spec.warm_up.temperature(t - since)])

    def ideal_samples(self, spec: ImuSpec) -> Imu:
        """Return the samples of an IMU without errors in the scenario: the ideal increments with
        its accelerometer offset."""
        if not self._offset.any():
            return self.ideal
        return self.ideal._replace(dv=self.ideal.dv + self.offset(spec) * self.ideal.dt[:, None])

    def sources(
        self, imu: ImuSpec | dict[str, Any] | File, seed: SeedLike, b_a: Array, b_g: Array
    ) -> SimulatedRecording:
        """Return `recording` with these biases and an IMU without errors, to be replaced by another
        one."""
        stream = RandomStream.of(seed)
        sources: list[Source] = [*self.plan.fixes(stream.child("gnss"))]
        notes = without_fixes(sources)
        meta = self._meta(imu, imu_spec(imu), b_a, b_g)
        if self.magnetic is not None:
            sources.append(self.magnetic.fixes(stream.child("magnetometer")))
            notes += self.magnetic.notes(sources[-1])
        if self.barometric is not None:
            source, meta["b_baro"] = self.barometric.measure_with_bias(stream.child("barometer"))
            sources.append(source)
            notes += self.barometric.notes(source)
        if self.attitude is not None:
            sources.append(self.attitude.fixes(stream.child("attitude")))
            notes += self.attitude.notes(sources[-1])
        for plan in self.sensors:
            sources.append(plan.fixes(stream.child("sensors").child(plan.source.name)))
            notes += plan.notes(sources[-1])
        return self._make_recording(tuple(sources), {**meta, "notes": notes})

    def _make_recording(
        self, sources: tuple[Source, ...], meta: RecordingMeta
    ) -> SimulatedRecording:
        return SimulatedRecording(self.ideal, sources, reference=self.truth, meta=meta)

    def offset(self, spec: ImuSpec) -> Array:
        """The scenario's accelerometer offset at the samples, (n, 3) or (3,) m/s^2."""
        if not (self.scenario.offset_decays and spec.accel.time_constant):
            return self._offset
        return (
            self._offset
            * np.exp(-(self.ideal.t - self.ideal.t[0]) / spec.accel.time_constant)[:, None]
        )

    def start(
        self, seed: SeedLike, imu: ImuSpec | dict[str, Any] | File, recording: Recording
    ) -> InitialState:
        """An InitialState at 0 s: the truth less an error drawn from the scenario's `start_std`,
        biases 0 or, where they are known, those of `recording`."""
        biases = (
            (recording.meta["b_a"][0], recording.meta["b_g"][0])
            if self.scenario.biases_known
            else None
        )
        return draw_start(
            self.truth, self.scenario.start_deviations(imu_spec(imu)), seed, biases=biases
        )

    def run(
        self, imu: ImuSpec | dict[str, Any] | File, seed: SeedLike
    ) -> tuple[SimulatedRecording, InitialState]:
        """(SimulatedRecording, InitialState) of one seed."""
        stream = RandomStream.of(seed)
        recording = self.recording(imu, stream)
        return recording, self.start(stream.child(OF_START), imu, recording)

    def ideal_recording(self) -> SimulatedRecording:
        """Return the Recording of an IMU without errors and exact fixes, with the standard
        deviations of the noisy ones."""
        zeros = np.zeros((len(self.ideal.t), 3))
        others = tuple(
            plan.exact()
            for plan in (self.magnetic, self.barometric, self.attitude, *self.sensors)
            if plan is not None
        )
        exact = self.plan.exact() + others
        return self._make_recording(exact, self._meta(None, None, zeros, zeros.copy()))

    def exact_start(self, imu: ImuSpec | dict[str, Any] | File) -> InitialState:
        """The InitialState at the truth with the standard deviations that `start` has with
        `imu`."""
        return _start(
            self.truth,
            0,
            self.scenario.start_deviations(imu_spec(imu)),
            np.zeros(STATES),
            None,
            "the truth",
        )

    def _meta(
        self,
        imu: ImuSpec | dict[str, Any] | File | None,
        spec: ImuSpec | None,
        b_a: Array,
        b_g: Array,
    ) -> RecordingMeta:
        meta: RecordingMeta = {
            "name": self.scenario.name,
            "grade": str(imu) if isinstance(imu, (str, Path)) else spec,
            "notes": [],
            "b_a": b_a,
            "b_g": b_g,
            "place": [float(value) for value in self.truth.lla[0]],
        }
        return meta if self.scenario.date is None else meta | {"date": self.scenario.date}


class OtherSensors(TypedDict, total=False):
    """Sensors of a simulation beside IMU and GNSS; None is the scenario's own."""

    # which needs a field of its own, or a date
    magnetometer: Magnetometer | None
    barometer: Barometer | None
    date: str | None  # ISO, of the geomagnetic model
    attitude: Ahrs | None
    sensors: Sequence[Simulated] | None  # of any kind of measurement


def simulate(
    motion: Motion | Scenario | File,
    duration: float | None = None,
    imu: ImuSpec | dict[str, Any] | File | None = None,
    seed: int = 0,
    rate: float | None = None,
    gnss: Gnss | File | None = None,
    **others: Unpack[OtherSensors],
) -> SimulatedRecording:
    """Return a simulated recording: IMU samples with errors, fixes of GNSS, magnetometer,
    barometer, AHRS and other sensors, and the truth as reference.

    Each sensor has its own random stream: the fixes of a seed are the same for every grade.

    Parameters
    ----------
    motion : Scenario, str, path or Motion
        A scenario, its name or TOML file, whose values are the defaults; or a Motion, which needs
        `duration` and `imu`.
    duration : float, optional
        s.
    imu : str, path, dict or ImuSpec, optional
        A grade, a file or the errors themselves.
    seed : int
        Seed of all random numbers.
    rate : float, optional
        IMU samples per second; of a Motion 100.
    gnss : str, path or Gnss, optional
        A receiver, in place of the scenario's.
    **others
        Sensors beside these: fields of `OtherSensors`.

    Returns
    -------
    Recording
        Its meta has the grade, the seed, the place where it begins ([rad, rad, m]), the date, and
        the true biases "b_a" (m/s^2) and "b_g" (rad/s), (n, 3) at the IMU samples.

    Raises
    ------
    DataError
        Where anything given is out of range.

    Examples
    --------
    >>> import strapdown as sd
    >>> len(sd.simulate("car", 10.0, imu="tactical", seed=1))
    1000
    """
    check_number(seed, "seed", least=0, whole=True)
    if unknown := sorted(others.keys() - OtherSensors.__annotations__.keys()):
        raise TypeError(f"simulate() got an unexpected keyword argument {unknown[0]!r}")
    fitting = (Motion, Scenario, str, PathLike)
    check_type(motion, "motion", fitting, "a Motion, a Scenario, its name or the path of its file")
    known = None if isinstance(motion, Motion) else find(motion)
    carried = Gnss() if known is None else known.gnss
    given: dict[str, Any] = {
        "duration": duration,
        "imu": imu,
        "rate": rate,
        "gnss": None if gnss is None else receiver(gnss, carried),
        **others,
    }
    given = {key: value for key, value in given.items() if value is not None}
    if known is None:
        assert isinstance(motion, Motion)
        if duration is None or imu is None:
            raise DataError(
                "to simulate a Motion, give its duration in s and an imu; only a scenario has its "
                "own"
            )
        scenario = Scenario(motion.name, motion, **given)
    else:
        scenario = known.replace(**given)
    recording = Simulator(scenario).recording(scenario.imu, seed)
    recording.meta["seed"] = seed
    return recording


def draw_start(
    truth: Trajectory,
    std: ArrayLike,
    seed: SeedLike,
    t: float | None = None,
    biases: tuple[ArrayLike, ArrayLike] | None = None,
) -> InitialState:
    """An InitialState at the truth's row at `t` (its first by default) less an error drawn from the
    15 standard deviations `std` (SI, radians); `seed` as of Simulator.

    Errors are true - estimate, the attitude's in the navigation frame: q_true = dq (x) q_est.
    `biases` are the true (b_a, b_g) there; without them the estimated biases are 0, which is
    consistent if the sensor's biases were drawn from the same standard deviations.
    """
    std = check_array(std, "std of a start", (STATES,), what="standard deviations", least=0)
    row = 0 if t is None else int(np.argmin(np.abs(truth.t - t)))
    if t is not None and abs(truth.t[row] - t) > 1e-6:
        raise DataError(f"the truth has no row at {t:g} s; the nearest is at {truth.t[row]:g} s")
    return _start(
        truth,
        row,
        std,
        std * RandomStream.of(seed).standard_normal(STATES),
        biases,
        "truth less an error drawn from std",
    )


def _start(
    truth: Trajectory,
    row: int,
    std: Array,
    error: Array,
    biases: tuple[ArrayLike, ArrayLike] | None,
    note: str,
) -> InitialState:
    assert truth.v_n is not None and truth.q_nb is not None
    attitude = Rotation.from_wxyz(truth.q_nb[row])
    roll, pitch, heading = (Rotation.from_rotvec(-error[ATT]) * attitude).as_rph()
    b_a, b_g = (
        (np.zeros(3), np.zeros(3))
        if biases is None
        else (np.asarray(biases[0]) - error[BA], np.asarray(biases[1]) - error[BG])
    )

    def numbers(values: Iterable[float]) -> tuple[float, ...]:
        return tuple(float(value) for value in values)

    return InitialState(
        float(truth.t[row]),
        numbers(displace_lla(truth.lla[row], -error[POS])),
        numbers(truth.v_n[row] - error[VEL]),
        numbers((roll, pitch, heading % (2 * np.pi))),
        numbers(b_a),
        numbers(b_g),
        numbers(std),
        note,
    )


def _gravity_at_the_ellipsoid(lat: Array, alt: Array) -> tuple[float | Array, float | Array]:
    """Return normal gravity on the ellipsoid (north, down), m/s^2, for any height."""
    return normal_gravity(lat, 0 * alt)
