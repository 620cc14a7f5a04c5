"""Arrays to increments: conversion, gaps, order, repeats, refusals, rest."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.preprocessing.imu_samples import LATE, StreamIntervals, imu_from_arrays, increments
from strapdown.preprocessing.stationary import at_rest


def level(n, dt=0.01):
    t = 5 + dt * np.arange(n)
    rng = np.random.default_rng(1)
    return t, rng.normal(0, 0.01, (n, 3)), rng.normal(0, 0.02, (n, 3)) + [0, 0, -9.81]


def test_rates_are_multiplied_once_with_their_own_interval():
    t, gyro, accel = level(50)
    t[20] += 0.003
    imu, notes = imu_from_arrays(t, gyro, accel)
    dt = np.r_[np.median(np.diff(t)), np.diff(t)]
    np.testing.assert_allclose(imu.dt, dt, rtol=1e-12)
    np.testing.assert_allclose(imu.dtheta, gyro * dt[:, None], rtol=1e-12)
    np.testing.assert_allclose(imu.dv, accel * dt[:, None], rtol=1e-12)
    assert notes == []
    assert all(c.flags.c_contiguous and c.flags.writeable and c.dtype == float for c in imu)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.0075, 0.0125), min_size=3, max_size=40))
def test_increments_of_rates_are_the_increments_given_as_increments(steps):
    t = np.cumsum([1.0, *steps])
    _, gyro, accel = level(len(t))
    of_rates, _ = increments(t, gyro, accel, "rate")
    again, _ = increments(t, of_rates.dtheta, of_rates.dv, "increment")
    for first, second in zip(of_rates, again):
        np.testing.assert_array_equal(first, second)
    assert of_rates.dt.sum() == pytest.approx(t[-1] - t[0] + of_rates.dt[0])


def test_a_gap_is_seen_between_the_samples_and_not_in_one():
    t, gyro, accel = level(100)
    t[60:] += 0.5
    imu, notes = imu_from_arrays(t, gyro, accel)
    missing = imu.t[1:] - imu.dt[1:] - imu.t[:-1]
    assert np.flatnonzero(missing > 1e-6).tolist() == [59]
    assert missing[59] == pytest.approx(0.5)
    assert notes == ["IMU: 1 gap in time, the longest 0.500 s before row 60"]


def test_jitter_is_no_gap():
    t, gyro, accel = level(400, 0.0025)
    t = np.floor(t * 1000 + 1e-6) / 1000  # 400 Hz in whole milliseconds: intervals of 2 and 3 ms
    imu, notes = imu_from_arrays(t, gyro, accel)
    assert notes == [] and set((imu.dt * 1000).round(6)) == {2, 3}


def test_bad_samples_are_dropped_counted_and_leave_a_gap():
    t, gyro, accel = level(100)
    gyro[30, 1], accel[40:50, 2], t[70] = np.nan, np.inf, np.nan
    imu, notes = imu_from_arrays(t, gyro, accel)
    assert len(imu.t) == 88
    assert notes[0] == "IMU: 12 samples with NaN or infinite values dropped, the first in row 30"
    assert notes[1].startswith("IMU: 3 gaps in time, the longest 0.100 s before row 50")


def test_repeated_rows_are_dropped():
    t, gyro, accel = (np.repeat(column, 2, axis=0) for column in level(50))
    imu, notes = imu_from_arrays(t, gyro, accel)
    assert len(imu.t) == 50 and notes == ["IMU: 50 repeated times dropped, the first in row 1"]


def test_late_rows_are_sorted_and_keep_their_values():
    t, gyro, accel = level(100)
    order = np.arange(100)
    order[[40, 41, 42]] = [42, 40, 41]
    imu, notes = imu_from_arrays(t[order], gyro[order], accel[order])
    np.testing.assert_array_equal(imu.t, t)
    np.testing.assert_allclose(imu.dtheta, gyro * imu.dt[:, None])
    assert notes == ["IMU: 1 late row sorted by time, the first in row 41"]


@pytest.mark.parametrize("stray", [1e6, -1e6])
def test_a_stray_time_is_dropped(stray):
    t, gyro, accel = level(100)
    t[50] = stray
    imu, notes = imu_from_arrays(t, gyro, accel)
    assert (
        len(imu.t) == 99 and notes[0] == "IMU: 1 row with a stray time dropped, the first in row 50"
    )


def spoiled(change):
    return change(*level(400))


def coarse(t, gyro, accel):
    return np.floor(t * 50) / 50, gyro, accel


@pytest.mark.parametrize(
    "change, words",
    [
        (
            lambda t, g, a: (np.r_[t[:200], t[:200]], g, a),
            "row 200: time goes back from 6.990 to 5.000 s",
        ),
        (lambda t, g, a: (np.r_[t[:50], t[50:] + 1e9], g, a), "row 50: time jumps"),
        (lambda t, g, a: (t[:1], g[:1], a[:1]), "1 usable IMU sample; at least 2"),
        (lambda t, g, a: (t[:0], g[:0], a[:0]), "0 usable IMU samples"),
        (
            lambda t, g, a: (t * np.nan, g, a),
            "0 usable IMU samples; at least 2 are needed; IMU: 400 samples with NaN",
        ),
        (
            lambda t, g, a: (t * 1000, g, a),
            "IMU samples are 10 s apart, but",
        ),
        (lambda t, g, a: (t * 1e-3, g, a), "check the unit of time"),
        (lambda t, g, a: (t, g[:, :2], a), "they must be (n,), (n, 3) and (n, 3)"),
        (coarse, "the time stamps are too coarse"),
        (lambda t, g, a: (t, np.degrees(g + 0.02), a), "check the unit: deg/s read as rad/s?"),
        (lambda t, g, a: (t, g, a / 9.80665), "is the unit g?"),
        (lambda t, g, a: (t, g, a * 9.80665), "values in m/s^2 were read as g"),
        (lambda t, g, a: (t, g, -a), "must read -9.8 on z"),
        (lambda t, g, a: (t, g * 0.01, a * 0.01), "are these increments, not rates?"),
        (lambda t, g, a: (t, g, a * 0), "check unit, scale and columns"),
    ],
)
def test_refused_in_one_line(change, words):
    with pytest.raises(DataError) as error:
        Recording.from_arrays(*spoiled(change))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_hand_held_imu_in_deg_per_second_is_refused_though_it_is_never_steady():
    t = 0.01 * np.arange(3000)
    gyro = 3 * np.c_[np.sin(2 * t), np.cos(3 * t), np.sin(t)]
    accel = (
        np.c_[0 * t, 0 * t, 0 * t - 9.8] + 4 * np.c_[np.sin(5 * t), np.cos(4 * t), np.sin(3 * t)]
    )
    assert Recording.from_arrays(t, gyro, accel).meta["notes"] == []
    with pytest.raises(DataError, match=r"angular rate has rms \d+ rad/s .*deg/s read as rad/s"):
        Recording.from_arrays(t, np.degrees(gyro), accel)


@pytest.mark.parametrize("rows", [[200], [100, 200, 300, 400]])
def test_single_rates_that_no_gyro_measures_are_no_mistake_of_units(rows):
    t, gyro, accel = level(500)
    gyro[rows, 0] = 3000.0
    assert np.abs(Recording.from_arrays(t, gyro, accel).imu.dtheta).max() == pytest.approx(30.0)


def test_rates_given_as_increments_are_refused():
    with pytest.raises(DataError, match="are these rates, not increments"):
        imu_from_arrays(*level(200), kind="increment")
    with pytest.raises(DataError, match='"rate" or "increment"'):
        imu_from_arrays(*level(200), kind="rates")


def test_rest_is_found_between_motions_and_never_at_their_edges():
    t, gyro, accel = level(3000)
    moving = (t > 15) & (t < 25)
    accel[moving, 0] += 2 * np.sin(5 * t[moving])
    imu, _ = imu_from_arrays(t, gyro, accel)
    rest = at_rest(imu)
    assert not rest[(t > 14.5) & (t < 25.5)].any()
    assert rest[(t < 13.9) | (t > 26.1)].all()


@pytest.mark.parametrize("motion", ["turning", "shaking", "short"])
def test_no_rest(motion):
    t, gyro, accel = level(50 if motion == "short" else 1000)
    if motion == "turning":
        gyro[:, 2] += 0.15
    if motion == "shaking":
        accel[:, 1] += np.random.default_rng(0).normal(0, 0.3, len(t))
    assert not at_rest(increments(t, gyro, accel)[0]).any()


def test_late_bound_is_what_is_sorted():
    t, gyro, accel = level(200)
    order = np.r_[np.arange(50), np.arange(51, 51 + LATE), 50, np.arange(51 + LATE, 200)]
    _, notes = increments(t[order], gyro[order], accel[order])
    assert "sorted" in notes[0]
    order = np.r_[np.arange(50), np.arange(51, 52 + LATE), 50, np.arange(52 + LATE, 200)]
    _, notes = increments(t[order], gyro[order], accel[order])
    assert "stray" in notes[0]


def test_samples_one_at_a_time_have_the_intervals_of_arrays():
    """Those with an interval of their own bit for bit; after a gap the median of the last ones."""
    rng = np.random.default_rng(2)
    t = 28800 + np.cumsum(rng.uniform(0.0075, 0.0125, 200))
    t[[60, 61, 150]] = np.nan
    t = t[np.isfinite(t)]
    _, gyro, accel = level(len(t))
    imu, _ = increments(t, gyro, accel)
    intervals = StreamIntervals()
    found = [intervals.interval(each) for each in t.tolist()]
    gaps = np.flatnonzero(np.diff(t) > 1.75 * np.median(np.diff(t))) + 1
    own = np.setdiff1d(np.arange(1, len(t)), gaps)
    assert found[0] is None and len(gaps) >= 2
    np.testing.assert_array_equal(np.array(found, float)[own], imu.dt[own])
    np.testing.assert_allclose(np.array(found, float)[gaps], 0.01, rtol=0.1)


def test_one_time_that_goes_back_counts_over_the_median():
    intervals = StreamIntervals()
    found = [intervals.interval(t) for t in (0.0, 0.25, 0.5, 0.25, 0.75, 1.0)]
    assert found == [None, 0.25, 0.25, 0.25, 0.25, 0.25]
