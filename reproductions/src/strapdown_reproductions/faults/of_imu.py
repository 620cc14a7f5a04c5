"""Faults of the IMU: what its samples say, and when."""

import numpy as np

from strapdown.typing import Array, Mask

from .fault import IMU, LIVE, fault
from .raw import BEGINS, Raw, hold

G = 9.80665
DEG = np.pi / 180


@fault("gyro NaN in 1 % of the samples", IMU)
def _(raw: Raw):
    raw.gyro[raw.some(0.01), 1] = np.nan


@fault("accelerometer NaN for 3 s", IMU)
def _(raw: Raw):
    raw.accel[raw.from_fault(3)] = np.nan


@fault("accelerometer inf now and then", IMU)
def _(raw: Raw):
    raw.accel[::997, 2] = np.inf


# what is stuck


@fault("gyro stuck for 5 s", IMU)
def _(raw: Raw):
    hold(raw.gyro, raw.from_fault(5))


@fault("gyro z stuck for good", IMU)
def _(raw: Raw):
    hold(raw.gyro[:, 2], raw.from_fault())


@fault("gyro x reads 0 for good", IMU)
def _(raw: Raw):
    raw.gyro[raw.from_fault(), 0] = 0


@fault("accelerometer stuck for 5 s", IMU)
def _(raw: Raw):
    hold(raw.accel, raw.from_fault(5))


@fault("accelerometer x stuck for good", IMU)
def _(raw: Raw):
    hold(raw.accel[:, 0], raw.from_fault())


@fault("accelerometer reads 0 for 5 s", IMU)
def _(raw: Raw):
    raw.accel[raw.from_fault(5)] = 0


def _frozen(seconds: float) -> None:
    @fault(f"IMU frozen for {seconds:g} s", IMU)
    def _(raw: Raw):
        hold(raw.gyro, raw.from_fault(seconds))
        hold(raw.accel, raw.from_fault(seconds))


for _seconds in (1, 10):
    _frozen(_seconds)


# what no such motion has


def _spike(size: float) -> None:
    @fault(f"accelerometer: one sample of {size:.0e} m/s^2", IMU)
    def _(raw: Raw):
        raw.accel[np.argmax(raw.from_fault()), 0] = size


for _size in (1e3, 1e6):
    _spike(_size)


@fault("gyro: one sample of 50 rad/s", IMU)
def _(raw: Raw):
    raw.gyro[np.argmax(raw.from_fault()), 2] = 50


@fault("accelerometer spikes of 100 m/s^2 in 1 %", IMU)
def _(raw: Raw):
    rows = raw.some(0.01)
    raw.accel[rows, 1] += raw.rng.choice([-100, 100], rows.sum())


@fault("gyro clips at 60 % of its largest rates", IMU)
def _(raw: Raw):
    most = 0.6 * np.abs(raw.gyro).max(axis=0)
    raw.gyro = np.clip(raw.gyro, -most, most)


@fault("accelerometer clips at 1 g", IMU)
def _(raw: Raw):
    raw.accel = np.clip(raw.accel, -G, G)


# bias, scale, noise


def _gyro_step(axis: int, size: float) -> None:
    @fault(f"gyro {'xyz'[axis]} bias steps by {size:g} deg/s", IMU)
    def _(raw: Raw):
        raw.gyro[raw.from_fault(), axis] += size * DEG


_gyro_step(1, 0.5)
_gyro_step(2, 2)


@fault("gyro x bias runs away by 1 deg/s in 120 s", IMU)
def _(raw: Raw):
    raw.gyro[:, 0] += DEG * raw.since_fault() / 120


@fault("accelerometer x bias steps by 0.5 m/s^2", IMU)
def _(raw: Raw):
    raw.accel[raw.from_fault(), 0] += 0.5


@fault("accelerometer x bias runs away by 0.5 m/s^2 in 120 s", IMU)
def _(raw: Raw):
    raw.accel[:, 0] += 0.5 * raw.since_fault() / 120


@fault("gyro scale +5 %", IMU)
def _(raw: Raw):
    raw.gyro *= 1.05


@fault("accelerometer scale +2 %", IMU)
def _(raw: Raw):
    raw.accel *= 1.02


@fault("gyro dead band of 0.5 deg/s", IMU)
def _(raw: Raw):
    raw.gyro[np.abs(raw.gyro) < 0.5 * DEG] = 0


@fault("gyro x 20 times as noisy from 90 s", IMU)
def _(raw: Raw):
    _noisier(raw, raw.gyro[:, 0], 20)


@fault("accelerometer z 20 times as noisy from 90 s", IMU)
def _(raw: Raw):
    _noisier(raw, raw.accel[:, 2], 20)


def _noisier(raw: Raw, values: Array, times: float) -> None:
    """Add to an axis what makes its noise so many times as large; the noise is what of its second
    differences is common."""
    rough = np.median(np.abs(np.diff(values, 2))) / 0.6745 / np.sqrt(6)
    rows = raw.from_fault()
    values[rows] += raw.rng.normal(0, rough * np.sqrt(times**2 - 1), rows.sum())


@fault("quantised to 0.1 m/s^2 and 0.1 deg/s", IMU)
def _(raw: Raw):
    raw.accel = np.round(raw.accel / 0.1) * 0.1
    raw.gyro = np.round(raw.gyro / (0.1 * DEG)) * 0.1 * DEG


@fault("vibration of 20 m/s^2 at 15.3 Hz", IMU)
def _(raw: Raw):
    raw.accel += 20 * np.sin(2 * np.pi * 15.3 * raw.t)[:, None]


@fault("vibration aliased to 0.1 Hz", IMU)
def _(raw: Raw):
    rate = 1 / np.median(np.diff(raw.t))
    wave = np.sin(2 * np.pi * (rate - 0.1) * raw.t)
    raw.accel[:, 2] += 15 * wave
    raw.gyro[:, 0] += 0.5 * wave


# how it sits and what it counts in


def _turn(raw: Raw, C: Array, rows: Mask | slice = slice(None)) -> None:
    raw.gyro[rows], raw.accel[rows] = raw.gyro[rows] @ C, raw.accel[rows] @ C


def _yaw(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@fault("mounted 5 deg off in heading", IMU)
def _(raw: Raw):
    _turn(raw, _yaw(5 * DEG))


@fault("box slips by 10 deg in heading at 90 s", IMU)
def _(raw: Raw):
    _turn(raw, _yaw(10 * DEG), raw.from_fault())


@fault("gyro sign wrong", IMU)
def _(raw: Raw):
    raw.gyro *= -1


@fault("gyro z sign wrong", IMU)
def _(raw: Raw):
    raw.gyro[:, 2] *= -1


@fault("gyro z sign flips at 90 s", IMU)
def _(raw: Raw):
    raw.gyro[raw.from_fault(), 2] *= -1


@fault("accelerometer sign wrong", IMU)
def _(raw: Raw):
    raw.accel *= -1


@fault("accelerometer x sign wrong", IMU)
def _(raw: Raw):
    raw.accel[:, 0] *= -1


@fault("x and y swapped", IMU)
def _(raw: Raw):
    raw.gyro, raw.accel = raw.gyro[:, [1, 0, 2]], raw.accel[:, [1, 0, 2]]


@fault("x and y of the gyro swapped", IMU)
def _(raw: Raw):
    raw.gyro = raw.gyro[:, [1, 0, 2]]


@fault("forward, left, up taken for forward, right, down", IMU)
def _(raw: Raw):
    raw.gyro, raw.accel = raw.gyro * [1, -1, -1], raw.accel * [1, -1, -1]


@fault("gyro in deg/s", IMU)
def _(raw: Raw):
    raw.gyro /= DEG


@fault("gyro multiplied by pi/180 twice", IMU)
def _(raw: Raw):
    raw.gyro *= DEG


@fault("accelerometer in g", IMU)
def _(raw: Raw):
    raw.accel /= G


@fault("accelerometer without gravity", IMU)
def _(raw: Raw):
    raw.accel[:, 2] += G


# time stamps


@fault("time of the IMU NaN now and then", IMU)
def _(raw: Raw):
    raw.t[::997] = np.nan


def _clock_jump(seconds: float) -> None:
    @fault(f"clock of the IMU jumps by {seconds:+g} s", IMU)
    def _(raw: Raw):
        raw.t[raw.from_fault()] += seconds


for _seconds in (5, -5, -0.05, 86401):
    _clock_jump(_seconds)


@fault("clock of the IMU stands still for 1 s", IMU)
def _(raw: Raw):
    raw.t[raw.from_fault(1)] = BEGINS


@fault("5 % of the IMU rows twice", IMU)
def _(raw: Raw):
    raw.take(np.sort(np.r_[np.arange(len(raw.t)), np.flatnonzero(raw.some(0.05))]))


@fault("IMU stamps twice, with other values", IMU)
def _(raw: Raw):
    again = np.flatnonzero(raw.some(0.05))
    rows = np.sort(np.r_[np.arange(len(raw.t)), again])
    raw.take(rows)
    second = np.r_[False, np.diff(rows) == 0]
    raw.gyro[second] += raw.rng.normal(0, 0.05, (second.sum(), 3))


def _rounded(to: float) -> None:
    @fault(f"IMU stamps rounded up to {to:g} s", IMU)
    def _(raw: Raw):
        raw.t = np.ceil(raw.t / to - 1e-9) * to


for _to in (0.04, 0.1):
    _rounded(_to)


@fault("100 IMU rows swapped in pairs", IMU)
def _(raw: Raw):
    rows = np.arange(len(raw.t))
    first = np.argmax(raw.from_fault())
    rows[first : first + 100] = rows[first : first + 100].reshape(-1, 2)[:, ::-1].ravel()
    raw.take(rows)


@fault("100 IMU values shuffled in fives", IMU)
def _(raw: Raw):
    rows = np.arange(len(raw.t))
    first = np.argmax(raw.from_fault())
    rows[first : first + 100] = rows[first : first + 100].reshape(-1, 5)[:, ::-1].ravel()
    raw.gyro, raw.accel = raw.gyro[rows], raw.accel[rows]


def _missing(seconds: float) -> None:
    @fault(f"IMU missing for {seconds:g} s", IMU)
    def _(raw: Raw):
        raw.take(~raw.from_fault(seconds))


for _seconds in (0.5, 5, 60):
    _missing(_seconds)


@fault("10 % of the IMU rows missing", IMU)
def _(raw: Raw):
    raw.take(~raw.some(0.1))


@fault("IMU stamps jitter by 30 %", IMU)
def _(raw: Raw):
    step = np.median(np.diff(raw.t))
    raw.t = raw.t + raw.rng.uniform(-0.3 * step, 0.3 * step, len(raw.t))


@fault("clock of the IMU 1000 ppm fast", IMU)
def _(raw: Raw):
    raw.t = raw.t * 1.001


def _late(seconds: float) -> None:
    @fault(f"IMU late by {seconds:g} s", IMU)
    def _(raw: Raw):
        raw.t = raw.t + seconds


for _seconds in (0.1, 1):
    _late(_seconds)


@fault("time in ms", IMU)
def _(raw: Raw):
    raw.t = raw.t * 1e3


# what only a stream meets: right stamps, wrong arrival


@fault("IMU samples arrive twice", LIVE)
def _(raw: Raw):
    raw.take(np.sort(np.r_[np.arange(len(raw.t)), np.flatnonzero(raw.from_fault())]))


@fault("IMU samples arrive 1 s late for 20 s", LIVE)
def _(raw: Raw):
    raw.arrival[raw.from_fault(20)] += 1


@fault("fixes arrive 2 s late", LIVE)
def _(raw: Raw):
    for source in raw.sources.values():
        source.arrival[source.from_fault()] += 2


@fault("fixes never arrive again", LIVE)
def _(raw: Raw):
    for source in raw.sources.values():
        source.arrival[source.from_fault()] = np.inf
