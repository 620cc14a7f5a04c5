"""The length of a vector between two antennas: which fixes are left out, and where that is said."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.engine.prepare import usable
from strapdown.preprocessing.baseline_length import length_errors, wrong_lengths
from strapdown.sensor_models.any_sensor import Simulated

pytestmark = pytest.mark.short
GIVEN = (1.2, -0.1, 0.05)


def test_the_noise_of_a_length_is_that_of_random_vectors():
    """Of 20 000 vectors with stated noise, as many lengths differ by k standard deviations as of a
    normal variable, with the tape's centimetre in the length of each."""
    rng = np.random.default_rng(1)
    std = np.array([0.02, 0.03, 0.01])
    y = np.array([0.9, 0.7, -0.4]) + std * rng.standard_normal((20_000, 3))
    given = np.linalg.norm([0.9, 0.7, -0.4]) * np.array([1.0, 0.0, 0.0])
    error, noise = length_errors(y, np.tile(std, (len(y), 1)), given)
    true = np.sqrt(noise**2 - 0.01**2)
    assert 0.98 < (error / true).std() < 1.02
    assert wrong_lengths(y, np.tile(std, (len(y), 1)), given).mean() < 1.5e-3


def recorded(sensor=None):
    sensor = sensor or Simulated("baseline", 0.005, 5.0, GIVEN)
    return sd.simulate("car", duration=60.0, seed=3, sensors=[sensor])


def with_spoilt(recording, rows, by):
    spoilt = []
    for a in recording.sources:
        if a.kind == "baseline":
            y = a.y.copy()
            y[rows] *= by
            a = replace(a, y=y)
        spoilt.append(a)
    return replace(recording, sources=tuple(spoilt))


def test_a_fix_of_another_length_is_left_out_and_told():
    recording = with_spoilt(recorded(), slice(10, 15), 1.1)
    solution = sd.fuse(recording, "closed-loop")
    (note,) = (line for line in solution.meta["notes"] if line.startswith("baseline"))
    assert "5 fixes of 300 left out" in note and "up to 0.1" in note


@pytest.mark.parametrize("name", ["nlo", "two-stage-ekf", "attitude-mekf"])
def test_a_filter_without_it_says_what_to_do(name):
    _, notes = usable(filters.find(name), recorded().sources)
    (note,) = (line for line in notes if "does not use" in line)
    assert "baseline; run closed-loop, or give the angle" in note and "kind heading" in note


def test_a_stream_leaves_out_what_a_batch_does():
    recording = with_spoilt(recorded(), slice(200, 205), 1.1)
    batch = sd.fuse(recording, "closed-loop", covariance=True)
    stream = sd.Stream(
        "closed-loop",
        imu=recording.meta["grade"],
        start=sd.align(recording, recording.meta["grade"]),
        sources=[a._where(np.zeros(len(a.t), bool)) for a in recording.sources],
    )
    fixes = sorted(
        (float(t), k, tuple(y), tuple(std))
        for k, a in enumerate(recording.sources)
        for t, y, std in zip(a.t, a.y, a.std)
    )
    imu = recording.imu
    for k, t in enumerate(imu.t):
        while fixes and fixes[0][0] <= t:
            stream.step(sd.Measurement(*fixes.pop(0)))
        stream.step(sd.Sample(float(t), float(imu.dt[k]), tuple(imu.dtheta[k]), tuple(imu.dv[k])))
    assert stream.dropped_by["wrong length"] == 5
    assert any("dropped, whose length differs" in event for _, event in stream.events)
    assert np.array_equal(stream.finish().P, batch.covariance[-1])


def test_parameters_that_are_no_baseline_are_refused():
    source = replace(recorded().sources[-1], parameters=())
    imu = recorded().imu
    with pytest.raises(DataError, match="vector from the first to the second antenna"):
        sd.Recording.from_arrays(imu.t, imu.dtheta, imu.dv, sources=[source], kind="increment")


@pytest.mark.parametrize("scenario, seconds", [("static", 60.0), ("car", 60.0), ("demo", 90.0)])
def test_attitudes_err_as_they_say(scenario, seconds):
    """Over ten seeds, mean NEES of the attitude at the end between the 0.1 and 99.9 % points of
    chi-square with 30 degrees of freedom over 10; without a course the heading is known too."""
    nees, std = [], []
    for seed in range(10):
        sensor = Simulated("baseline", 0.005, 2.0, GIVEN)
        recording = sd.simulate(scenario, duration=seconds, seed=seed, sensors=[sensor])
        solution = sd.fuse(recording, "closed-loop", covariance=True)
        errors = solution.errors(recording.reference)
        e, P = errors.attitude[-1], solution.covariance[-1][6:9, 6:9]
        nees.append(e @ np.linalg.solve(P, e))
        std.append(np.sqrt(P[2, 2]))
    assert 11.6 / 10 < np.mean(nees) < 59.7 / 10
    assert np.max(std) < np.radians(0.2)
