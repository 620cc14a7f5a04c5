"""Faults of the IMU: what its samples say, and when."""

import numpy as np

from strapdown.typing import Array

from .fault import (
    IMU,
    LIVE,
    MISSING,
    NEGATED,
    ZERO,
    Change,
    Fault,
    FaultColumns,
    Rows,
    Values,
    add_drift,
    every,
    first,
    hold_first,
    on,
    over,
    plus,
    rows_of_fault,
    samples,
    set_to,
    some,
    swap_axes,
    times,
    without,
)
from .raw import BEGINS, Raw

G = 9.80665
DEG = np.pi / 180
GYRO, ACCEL, BOTH, TIME, ARRIVAL = (
    FaultColumns(samples, names)
    for names in (("gyro",), ("accel",), ("gyro", "accel"), ("t",), ("arrival",))
)
X, Y, Z = range(3)
OF_FIXES = FaultColumns(lambda raw: list(raw.sources.values()), ("arrival",))


def spikes(raw: Raw) -> None:
    """100 m/s^2 to either side in 1 % of the samples."""
    rows = raw.rng.random(len(raw.t)) < 0.01
    raw.accel[rows, Y] += raw.rng.choice([-100, 100], rows.sum())


def clip_values(values: Array) -> Array:
    """Values that end at 60 % of the largest of their axis."""
    most = 0.6 * np.abs(values).max(axis=0)
    return np.clip(values, -most, most)


def noisier(columns: FaultColumns, factor: float) -> Change:
    """Return a change that multiplies the noise of an axis by `factor`; its noise is estimated from
    the median of its second differences."""

    def change(raw: Raw) -> None:
        values = getattr(raw, columns.names[0])[:, columns.axes]
        rough = np.median(np.abs(np.diff(values, 2))) / 0.6745 / np.sqrt(6)
        rows = raw.from_fault()
        values[rows] += raw.rng.normal(0, rough * np.sqrt(factor**2 - 1), rows.sum())

    return change


def quantise(raw: Raw) -> None:
    """Counted in steps of 0.1 m/s^2 and 0.1 deg/s."""
    raw.accel = np.round(raw.accel / 0.1) * 0.1
    raw.gyro = np.round(raw.gyro / (0.1 * DEG)) * 0.1 * DEG


def vibration(raw: Raw) -> None:
    """20 m/s^2 at 15.3 Hz."""
    raw.accel += 20 * np.sin(2 * np.pi * 15.3 * raw.t)[:, None]


def add_aliasing(raw: Raw) -> None:
    """Vibration at nearly the rate of the samples."""
    rate = 1 / np.median(np.diff(raw.t))
    wave = np.sin(2 * np.pi * (rate - 0.1) * raw.t)
    raw.accel[:, Z] += 15 * wave
    raw.gyro[:, X] += 0.5 * wave


def yaw_axes(degrees: float) -> Values:
    """Axes turned about the vertical."""
    c, s = np.cos(degrees * DEG), np.sin(degrees * DEG)
    C = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return lambda values: values @ C


def repeat_samples(rows: Rows) -> Change:
    """Gives these samples twice."""

    def change(raw: Raw) -> None:
        again = np.flatnonzero(rows(raw, raw))
        raw.take(np.sort(np.r_[np.arange(len(raw.t)), again]))

    return change


def repeated_with_other_values(raw: Raw) -> None:
    """5 % of the stamps twice, the gyro another one the second time."""
    again = np.flatnonzero(raw.rng.random(len(raw.t)) < 0.05)
    rows = np.sort(np.r_[np.arange(len(raw.t)), again])
    raw.take(rows)
    second = np.r_[False, np.diff(rows) == 0]
    raw.gyro[second] += raw.rng.normal(0, 0.05, (second.sum(), 3))


def rounded_up(step: float) -> Values:
    """Values in whole steps, the next larger one."""
    return lambda values: np.ceil(values / step - 1e-9) * step


def reversed_in(raw: Raw, size: int) -> Array:
    """(n,) rows of which the first 100 of the fault are reversed in groups of `size`."""
    rows = np.arange(len(raw.t))
    begin = np.argmax(raw.from_fault())
    rows[begin : begin + 100] = rows[begin : begin + 100].reshape(-1, size)[:, ::-1].ravel()
    return rows


def shuffle_values(raw: Raw) -> None:
    """100 values in the wrong order under right stamps."""
    rows = reversed_in(raw, 5)
    raw.gyro, raw.accel = raw.gyro[rows], raw.accel[rows]


def jitter_stamps(raw: Raw) -> None:
    """Stamps off by up to 30 % of the interval."""
    step = np.median(np.diff(raw.t))
    raw.t = raw.t + raw.rng.uniform(-0.3 * step, 0.3 * step, len(raw.t))


OF_VALUES: tuple[tuple[str, Change], ...] = (
    ("gyro NaN in 1 % of the samples", on(GYRO.at(Y), MISSING, some(0.01))),
    ("accelerometer NaN for 3 s", on(ACCEL, MISSING, rows_of_fault(3))),
    ("accelerometer inf now and then", on(ACCEL.at(Z), set_to(np.inf), every(997))),
    # what is stuck
    ("gyro stuck for 5 s", on(GYRO, hold_first, rows_of_fault(5))),
    ("gyro z stuck for good", on(GYRO.at(Z), hold_first, rows_of_fault())),
    ("gyro x reads 0 for good", on(GYRO.at(X), ZERO, rows_of_fault())),
    ("accelerometer stuck for 5 s", on(ACCEL, hold_first, rows_of_fault(5))),
    ("accelerometer x stuck for good", on(ACCEL.at(X), hold_first, rows_of_fault())),
    ("accelerometer reads 0 for 5 s", on(ACCEL, ZERO, rows_of_fault(5))),
    *((f"IMU frozen for {s:g} s", on(BOTH, hold_first, rows_of_fault(s))) for s in (1, 10)),
    # what no such motion has
    *(
        (f"accelerometer: one sample of {size:.0e} m/s^2", on(ACCEL.at(X), set_to(size), first))
        for size in (1e3, 1e6)
    ),
    ("gyro: one sample of 50 rad/s", on(GYRO.at(Z), set_to(50), first)),
    ("accelerometer spikes of 100 m/s^2 in 1 %", spikes),
    ("gyro clips at 60 % of its largest rates", on(GYRO, clip_values)),
    ("accelerometer clips at 1 g", on(ACCEL, lambda f: np.clip(f, -G, G))),
    # bias, scale, noise
    ("gyro y bias steps by 0.5 deg/s", on(GYRO.at(Y), plus(0.5 * DEG), rows_of_fault())),
    ("gyro z bias steps by 2 deg/s", on(GYRO.at(Z), plus(2 * DEG), rows_of_fault())),
    ("gyro x bias runs away by 1 deg/s in 120 s", add_drift(GYRO.at(X), DEG, 120)),
    ("accelerometer x bias steps by 0.5 m/s^2", on(ACCEL.at(X), plus(0.5), rows_of_fault())),
    ("accelerometer x bias runs away by 0.5 m/s^2 in 120 s", add_drift(ACCEL.at(X), 0.5, 120)),
    ("gyro scale +5 %", on(GYRO, times(1.05))),
    ("accelerometer scale +2 %", on(ACCEL, times(1.02))),
    ("gyro dead band of 0.5 deg/s", on(GYRO, lambda w: np.where(np.abs(w) < 0.5 * DEG, 0, w))),
    ("gyro x 20 times as noisy from 90 s", noisier(GYRO.at(X), 20)),
    ("accelerometer z 20 times as noisy from 90 s", noisier(ACCEL.at(Z), 20)),
    ("quantised to 0.1 m/s^2 and 0.1 deg/s", quantise),
    ("vibration of 20 m/s^2 at 15.3 Hz", vibration),
    ("vibration aliased to 0.1 Hz", add_aliasing),
    # how it sits and what it counts in
    ("mounted 5 deg off in heading", on(BOTH, yaw_axes(5))),
    ("box slips by 10 deg in heading at 90 s", on(BOTH, yaw_axes(10), rows_of_fault())),
    ("gyro sign wrong", on(GYRO, NEGATED)),
    ("gyro z sign wrong", on(GYRO.at(Z), NEGATED)),
    ("gyro z sign flips at 90 s", on(GYRO.at(Z), NEGATED, rows_of_fault())),
    ("accelerometer sign wrong", on(ACCEL, NEGATED)),
    ("accelerometer x sign wrong", on(ACCEL.at(X), NEGATED)),
    ("x and y swapped", on(BOTH, swap_axes)),
    ("x and y of the gyro swapped", on(GYRO, swap_axes)),
    ("forward, left, up taken for forward, right, down", on(BOTH, lambda v: v * [1, -1, -1])),
    ("gyro in deg/s", on(GYRO, over(DEG))),
    ("gyro multiplied by pi/180 twice", on(GYRO, times(DEG))),
    ("accelerometer in g", on(ACCEL, over(G))),
    ("accelerometer without gravity", on(ACCEL.at(Z), plus(G))),
)
OF_TIME: tuple[tuple[str, Change], ...] = (
    ("time of the IMU NaN now and then", on(TIME, MISSING, every(997))),
    *(
        (f"clock of the IMU jumps by {s:+g} s", on(TIME, plus(s), rows_of_fault()))
        for s in (5, -5, -0.05, 86401)
    ),
    ("clock of the IMU stands still for 1 s", on(TIME, set_to(BEGINS), rows_of_fault(1))),
    ("5 % of the IMU rows twice", repeat_samples(some(0.05))),
    ("IMU stamps twice, with other values", repeated_with_other_values),
    *((f"IMU stamps rounded up to {s:g} s", on(TIME, rounded_up(s))) for s in (0.04, 0.1)),
    ("100 IMU rows swapped in pairs", lambda raw: raw.take(reversed_in(raw, 2))),
    ("100 IMU values shuffled in fives", shuffle_values),
    *((f"IMU missing for {s:g} s", without(samples, rows_of_fault(s))) for s in (0.5, 5, 60)),
    ("10 % of the IMU rows missing", without(samples, some(0.1))),
    ("IMU stamps jitter by 30 %", jitter_stamps),
    ("clock of the IMU 1000 ppm fast", on(TIME, times(1.001))),
    *((f"IMU late by {s:g} s", on(TIME, plus(s))) for s in (0.1, 1)),
    ("time in ms", on(TIME, times(1e3))),
)
OF_ARRIVAL: tuple[tuple[str, Change], ...] = (
    ("IMU samples arrive twice", repeat_samples(rows_of_fault())),
    ("IMU samples arrive 1 s late for 20 s", on(ARRIVAL, plus(1), rows_of_fault(20))),
    ("fixes arrive 2 s late", on(OF_FIXES, plus(2), rows_of_fault())),
    ("fixes never arrive again", on(OF_FIXES, set_to(np.inf), rows_of_fault())),
)
"""Faults that only a stream meets: correct stamps, wrong arrival."""
FAULTS = (
    *(Fault(name, IMU, change) for name, change in (*OF_VALUES, *OF_TIME)),
    *(Fault(name, LIVE, change) for name, change in OF_ARRIVAL),
)
