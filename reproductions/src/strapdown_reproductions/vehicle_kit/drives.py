"""Drives to test the vehicle kit on: a simulated car in town and on main roads with stops, an engine
that shakes the IMU, and wheel speed that spins or locks."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import strapdown as sd
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.motions import car
from strapdown.typing import Array

PLACE = (np.radians(47.0), np.radians(8.0), 450.0)
RATE, WHEEL_RATE, WHEEL_STD = 100.0, 10.0, 0.05  # Hz, Hz, m/s
ENGINE = 0.15
"""m/s^2 rms, three axes together, of an engine that idles; three times that at speed. drive0708
reads 0.08 to 0.23 at rest."""
IDLE, FASTER = 27.0, 2.5  # Hz at idle, Hz per m/s
GYRO_SHARE = 0.15  # rad/s per m/s^2: 0.02 rad/s at idle, as drive0708 has it


def drive(
    seed: int,
    seconds: float = 600.0,
    grade: str = "consumer",
    roughness: float = 1.0,
    engine: float = ENGINE,
    gnss: Gnss | None = None,
) -> Recording:
    """A simulated drive with wheel speed, and GNSS where it is given. It stops, creeps, turns and
    brakes as the seed has it; the last leg is cut off."""
    rng = np.random.default_rng([seed, 20])
    motion = car(PLACE, rng.uniform(0, 2 * np.pi), _legs(rng, seconds), roughness=roughness)
    wheel = Simulated("speed", WHEEL_STD, WHEEL_RATE, name="wheel")
    made = sd.simulate(motion, seconds, grade, seed, RATE, gnss, sensors=[wheel])
    return replace(made, imu=_add_vibration(made, rng, engine))


def _legs(rng: np.random.Generator, seconds: float) -> list[dict[str, Any]]:
    """Legs of a drive: it stands, goes to a speed, turns once or more, and stops again; one stop in
    four creeps on first."""
    legs, now, total = [{"duration": 10.0}], 0.0, 10.0

    def add(duration: float, **more: float) -> None:
        nonlocal total
        legs.append({"duration": duration, **more})
        total += duration

    while total < seconds:
        for _ in range(rng.integers(1, 4)):
            speed = rng.uniform(4.0, 20.0)
            gradient = rng.uniform(-0.05, 0.05)
            add(max(abs(speed - now) / rng.uniform(0.8, 2.5), 2.0), speed=speed, gradient=gradient)
            now = speed
            add(rng.uniform(8.0, 40.0), gradient=gradient)
            turn = rng.uniform(-1.6, 1.6)
            add(max(abs(turn) * now / 2.5, 3.0), turn=turn, gradient=gradient)
        if rng.random() < 0.25:
            add(max(now / 2.0, 2.0), speed=rng.uniform(0.4, 1.0))
            add(rng.uniform(5.0, 15.0))
            now = 1.0
        add(max(now / rng.uniform(1.0, 3.0), 1.5), speed=0.0)
        add(rng.uniform(4.0, 25.0))
        now = 0.0
    return legs


def _add_vibration(made: Recording, rng: np.random.Generator, engine: float) -> Any:
    """Its samples with the vibration of an engine, whose phase wanders; it turns faster with the
    speed."""
    imu, truth = made.imu, made.reference
    speed = np.interp(imu.t, truth.t, np.linalg.norm(truth.v_n, axis=1))
    turns = (IDLE + FASTER * speed) * imu.dt + rng.normal(0, 0.3, len(speed)) * np.sqrt(imu.dt)
    middle = 2 * np.pi * (np.cumsum(turns) - 0.5 * turns)
    size = engine * (1 + np.minimum(speed / 5.0, 2.0))

    def along(share: float) -> Array:
        axes = rng.uniform(0, 2 * np.pi, 3)
        # over a sample, as a sensor integrates: sampled at instants it would alias to a bias
        wave = sum(
            np.sin(k * middle[:, None] + axes) * np.sinc(k * turns)[:, None] / k for k in (1, 2)
        )
        return share * size[:, None] * wave * np.sqrt(2 / 3 / 1.25) * imu.dt[:, None]

    return imu._replace(dtheta=imu.dtheta + along(GYRO_SHARE), dv=imu.dv + along(1.0))


class Slip(NamedTuple):
    """Wheel speed that is wrong for a while."""

    start: float  # s
    stop: float
    share: float  # of the speed, by which it reads too much; -1 is a locked wheel


def add_slips(
    recording: Recording, seed: int, size: float, every: float = 30.0
) -> tuple[Recording, list[Slip]]:
    """The recording with spin and lock by the share `size`, one in each `every` seconds that
    begins above 3 m/s, and these."""
    rng = np.random.default_rng([seed, 21])
    wheel = next(a for a in recording.sources if a.kind == "speed")
    y, slips = wheel.y.copy(), []
    for begin in np.arange(recording.span[0] + every, recording.span[1] - every, every):
        start = begin + rng.uniform(0, 0.5 * every)
        length = np.exp(rng.uniform(np.log(0.5), np.log(5.0)))
        rows = (wheel.t >= start) & (wheel.t < start + length)
        if not rows.any() or wheel.y[rows].min() < 3.0:
            continue
        share = size * rng.choice([-1.0, 1.0])
        y[rows] *= 1 + share
        slips.append(Slip(start, start + length, share))
    changed = replace(wheel, y=y)
    others = tuple(changed if a is wheel else a for a in recording.sources)
    return replace(recording, sources=others), slips


def wheel_of(recording: Recording) -> Source:
    """Its wheel speed."""
    return next(a for a in recording.sources if a.kind == "speed")
