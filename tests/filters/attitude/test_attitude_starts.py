"""Attitude filters from far off: 170 deg about a random axis, seeds fixed beforehand,
noise-free; and options that no filter can begin with."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.core.loop.contract import InitialState, Noise
from strapdown.data.solution import Source
from strapdown.evaluation.metrics import attitude_angles
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.motions import hand_held
from strapdown.sim.scenario import Scenario
from strapdown.sim.synthesis import Simulator

NOISE = Noise(
    gyro=1e-3, accel=1e-2, gyro_bias=1e-5, accel_bias=0.0, gyro_decay=0.0, accel_decay=0.0
)
UNKNOWN = np.radians(104.0)  # what alignment gives for a heading that is not known


@lru_cache
def hand(turning, duration=61.0):
    """A Simulator of a hand that turns in its place; field at every sample, 65 deg of dip."""
    return Simulator(
        Scenario(
            "hand",
            hand_held((0.84, 0.2, 500.0), turning=turning, travel=0.0),
            duration,
            100.0,
            imu="consumer",
            gnss=Gnss(position_std=None, velocity_std=None),
            magnetometer=Magnetometer(field=(21e-6, 1.6e-6, 43.9e-6)),
        )
    )


def far_off(truth, seed, attitude_std, angle=170.0):
    """An InitialState that is `angle` (deg) off about a random axis."""
    axis = np.random.default_rng(seed).standard_normal(3)
    C = Rotation.from_rotvec(-np.radians(angle) * axis / np.linalg.norm(axis)) * truth.rotation[0]
    rph = tuple(map(float, C.as_euler("ZYX")[::-1]))
    return InitialState(
        0.0,
        tuple(map(float, truth.lla[0])),
        (0.0,) * 3,
        rph,
        (0.0,) * 3,
        (0.0,) * 3,
        (0.0,) * 6 + (attitude_std,) * 3 + (0.0,) * 3 + (1e-3,) * 3,
    )


def angles(turning, name, attitude_std=UNKNOWN, duration=61.0, **options):
    """(t, error angle in deg (100, t)) of the seeds 0 to 99."""
    simulator = hand(turning)
    recording = simulator.ideal_recording().between(0.0, duration)

    def one(seed):
        solution = sd.fuse(
            recording,
            name,
            start=far_off(simulator.truth, seed, attitude_std),
            noise=NOISE,
            every=10,
            options=options,
        )
        return solution.t, np.degrees(attitude_angles(sd.errors(solution, simulator.truth)).total)

    with ThreadPoolExecutor(2) as pool:
        t, found = zip(*pool.map(one, range(100)))
    return t[0], np.array(found)


@pytest.mark.parametrize("turning", [0.0, 1.0], ids=["at rest", "turning"])
@pytest.mark.parametrize("k", [0.5, 1.0])
def test_the_observer_comes_from_almost_anywhere(k, turning):
    """Below 10 deg within 10/k, and stays there to 20/k, in 97 of 100 starts at least; k1 = k2,
    the shipped ki and low-pass."""
    t, error = angles(turning, "mahony", duration=20 / k + 0.5, k1=k, k2=k)
    late = (t >= 10 / k) & (t <= 20 / k)
    assert late.sum() > 90 and (error[:, 0] > 120).all()
    assert (error[:, late] < 10).all(axis=1).sum() >= 97


@pytest.mark.parametrize("turning", [0.0, 1.0], ids=["at rest", "turning"])
@pytest.mark.parametrize("attitude_std", [UNKNOWN, np.radians(5.0)], ids=["told", "not told"])
def test_the_kalman_filter_comes_within_a_minute(attitude_std, turning):
    """Whether its start admits that nothing is known or claims 5 deg; then strength and dip of
    the field must not be judged by that attitude."""
    t, error = angles(turning, "attitude-mekf", attitude_std)
    assert (error[:, t >= 60.0] < 10).all(axis=1).sum() >= 97


@pytest.mark.short
@pytest.mark.parametrize("kind, gain", [("magnetic-field", "k2"), ("heading", "k3")])
@pytest.mark.parametrize("interval", [0.1, 0.5])
def test_a_pull_is_exponential_in_time_however_often_it_pulls(kind, gain, interval):
    """At rest a small heading error e decays as e' = -k e, whatever the interval of the fixes."""
    k, simulator = 0.4, hand(0.0)
    recording, truth = simulator.ideal_recording().between(0.0, 4.0), simulator.truth
    fields = recording.sources[0]
    fixes = fields._where(np.arange(1, len(fields.t) + 1) % round(100 * interval) == 0)
    if kind == "heading":
        y = np.full((len(fixes.t), 1), truth.rph[0, 2])
        fixes = Source("heading", fixes.t, y, np.full(y.shape, 0.01))
    begin = far_off(truth, 0, 0.1, angle=0.0)
    begin = begin._replace(rph=(*begin.rph[:2], begin.rph[2] + 0.05))
    solution = sd.fuse(
        replace(recording, sources=(fixes,)),
        "mahony",
        start=begin,
        noise=NOISE,
        options={"ki": 0.0, "k1": 0.5, gain: k},
    )
    error = np.unwrap(solution.trajectory.rph[:, 2]) - truth.rph[0, 2]
    first, last = (np.searchsorted(solution.t, t - 1e-6) for t in (1.0, 4.0))
    assert error[last] / error[first] == pytest.approx(np.exp(-3 * k), rel=0.01)


# ------------------------------------------------------------------ what is refused


@pytest.mark.short
@pytest.mark.parametrize(
    "name, options, text",
    [
        ("mahony", dict(k1=0.0, k2=0.0, k3=0.0), "k1, k2 and k3 are all zero"),
        ("mahony", dict(k1=-0.5), "k1 = -0.5.*not stable: poles .*1/s; give gains above zero"),
        ("mahony", dict(ki=-0.01), "not stable: poles"),
        ("mahony", dict(k1=0.5, ki=1.5), "k1 = 0.5, ki = 1.5, low_pass = 2 are not stable: poles"),
        (
            "mahony",
            dict(k1=0.0, k2=0.1, ki=1.5),
            "k2 = 0.1, ki = 1.5, low_pass = 2 are not stable: poles",
        ),
        (
            "mahony",
            dict(low_pass=-1.0),
            "low_pass is -1.0 s; it must be a finite number, 0 or more",
        ),
        ("mahony", dict(k2=float("nan")), "k2 is nan; it must be a finite number"),
        ("mahony", dict(k3=float("inf")), "k3 is inf; it must be a finite number"),
        ("mahony", dict(k4=1.0), "no option 'k4'; it has k1, k2, k3, ki, low_pass"),
        ("mahony", dict(k1="fast"), "k1 is 'fast'; it must be a number"),
        (
            "attitude-mekf",
            dict(low_pass=-1.0),
            "low_pass is -1.0 s; it must be a finite number, 0 or more",
        ),
        (
            "attitude-mekf",
            dict(heading=float("inf")),
            r"heading is inf deg sqrt\(s\); it must be a finite number, 0 or more",
        ),
        ("attitude-mekf", dict(disturbance=float("nan")), "disturbance is nan s; it must be"),
        ("attitude-mekf", dict(k1=1.0), "no option 'k1'"),
        ("attitude-mekf", dict(timing="late"), "timing is 'late'; it must be a number"),
    ],
    ids=str,
)
def test_options_that_cannot_be_are_refused_in_one_line(name, options, text):
    with pytest.raises(sd.DataError, match=text) as refused:
        sd.fuse(
            short_recording(),
            name,
            start=far_off(hand(1.0).truth, 0, 0.1),
            noise=NOISE,
            options=options,
        )
    assert "\n" not in str(refused.value)


def short_recording():
    return hand(1.0).ideal_recording().between(0.0, 0.5)


@pytest.mark.short
def test_unstable_gains_are_refused_with_their_poles():
    with pytest.raises(sd.DataError) as refused:
        sd.fuse(
            short_recording(),
            "mahony",
            start=far_off(hand(1.0).truth, 0, 0.1),
            noise=NOISE,
            options={"k1": 0.5, "ki": 2.0, "low_pass": 0.0, "k2": -0.2},
        )
    roots = np.roots([1.0, -0.2, -0.4])
    assert all(f"{root:.3g}" in str(refused.value) for root in roots)


@pytest.mark.short
@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_a_start_that_is_no_start_is_refused(name):
    start = far_off(hand(1.0).truth, 0, 0.1)
    for change, text in (
        (dict(rph=(0.0, float("nan"), 0.0)), "start: rph"),
        (dict(std=(-1.0,) * 15), "standard deviations must be 0 or more"),
        (dict(lla=(2.0, 0.0, 0.0)), "lla is .* is it in degrees"),
        (dict(lla=(1.56, 0.0, 0.0)), "latitude"),
    ):
        with pytest.raises(sd.DataError, match=text):
            sd.fuse(short_recording(), name, start=start._replace(**change), noise=NOISE)


@pytest.mark.short
@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_what_a_filter_does_not_estimate_is_no_number(name):
    solution = sd.fuse(short_recording(), name, start=far_off(hand(1.0).truth, 0, 0.1), noise=NOISE)
    assert (
        np.isnan(solution.trajectory.lla).all()
        and np.isnan(solution.trajectory.v_n).all()
        and np.isnan(solution.b_a).all()
    )
    assert np.isfinite(solution.b_g).all() and np.isfinite(solution.trajectory.q_nb).all()
    claimed = np.isfinite(solution.trajectory.std).all(axis=0)
    assert list(np.flatnonzero(claimed)) == [6, 7, 8, 12, 13, 14]
