"""Recordings made of a motion, and starts drawn around its truth."""

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown.checks import DataError
from strapdown.core.loop.contract import ATT, BA, BG, POS, VEL
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.synthesis import draw_start, simulate
from strapdown.sim.trajectory import demo_flight, increments

FLIGHT = demo_flight()
STD = np.repeat([2.0, 0.2, 0.02, 0.1, 1e-3], 3) * np.tile([1.0, 0.5, 2.0], 5)


def test_a_recording_is_the_ideal_one_plus_the_errors_it_reports():
    made = simulate(FLIGHT, 20, "tactical", seed=3, rate=50.0)
    ideal = increments(FLIGHT, np.arange(1001) / 50)
    assert len(made.imu.t) == 1000 and made.span == (0.0, 20.0) and len(made.reference) == 1001
    residual = np.c_[
        made.imu.dtheta - ideal.dtheta - made.meta["b_g"] * 0.02,
        made.imu.dv - ideal.dv - made.meta["b_a"] * 0.02,
    ]
    spec = imu_spec("tactical")
    assert residual.std(axis=0) == pytest.approx(
        np.repeat([spec.gyro.noise, spec.accel.noise], 3) * np.sqrt(0.02), rel=0.1
    )
    assert [len(fixes.t) for fixes in made.sources] == [20, 20]
    assert (
        made.meta["grade"] == "tactical"
        and made.meta["seed"] == 3
        and made.meta["name"] == "demo flight"
    )


def test_a_seed_repeats_and_fixes_do_not_depend_on_the_grade():
    one, same, other = (
        simulate(FLIGHT, 10, name, seed=3) for name in ("tactical", "tactical", "consumer")
    )
    np.testing.assert_array_equal(one.imu.dv, same.imu.dv)
    np.testing.assert_array_equal(one.sources[0].y, other.sources[0].y)
    assert not np.array_equal(
        one.sources[0].y, simulate(FLIGHT, 10, "tactical", seed=4).sources[0].y
    )


@pytest.mark.short
@pytest.mark.parametrize("seed", [-1, 1.5, "x", None, True])
def test_a_seed_that_is_none_is_named(seed):
    with pytest.raises(DataError, match=f"seed is {seed!r}; it must be a whole number, 0 or more"):
        simulate(FLIGHT, 10, "tactical", seed=seed)


@pytest.mark.short
@pytest.mark.parametrize(
    "change", [{"outages": ((0.0, 100.0),)}, {"interval": 11.0}, {"latency": 20.0}]
)
def test_a_receiver_that_gives_no_fix_is_noted(change):
    made = simulate(FLIGHT, 10, "tactical", gnss=Gnss(velocity_std=None)._replace(**change))
    assert made.meta["notes"] == [
        "GNSS position: not one fix falls into the recording; outages, interval and latency leave none"
    ]
    assert (
        simulate(FLIGHT, 10, "tactical", gnss=Gnss(position_std=None, velocity_std=None)).meta[
            "notes"
        ]
        == []
    )


def test_the_receiver_is_the_one_asked_for():
    made = simulate(
        FLIGHT, 10, "tactical", seed=1, rate=20.0, gnss=Gnss(0.5, (3, 3, 3), None, (1, 0, -1))
    )
    (fixes,) = made.sources
    assert (
        len(fixes.t) == 20
        and fixes.parameters == (1.0, 0.0, -1.0)
        and set(fixes.std.ravel()) == {3.0}
    )


@pytest.mark.parametrize(
    "change", [{"duration": 0}, {"duration": np.nan}, {"rate": -1.0}, {"duration": 0.01}]
)
def test_impossible_durations_are_refused(change):
    with pytest.raises(DataError, match="cannot simulate|it must be a finite number above 0"):
        simulate(**{"motion": FLIGHT, "duration": 10, "imu": "tactical", "seed": 1, **change})


def test_what_is_no_sensor_of_a_simulation_is_refused():
    with pytest.raises(TypeError, match="unexpected keyword argument 'start_std'"):
        simulate(FLIGHT, 10, "tactical", start_std=(0.0,) * 15)


@pytest.mark.parametrize("t", [None, 12.5])
def test_a_start_is_the_truth_less_the_error_drawn(t):
    made = simulate(FLIGHT, 20, "tactical", seed=3, rate=50.0)
    row = 0 if t is None else 625
    biases = made.meta["b_a"][row - 1], made.meta["b_g"][row - 1]
    start = draw_start(made.reference, STD, 8, t, biases)
    error = STD * RandomStream.of(8).standard_normal(15)
    truth = made.reference
    assert start.t == truth.t[row] and start.std == tuple(STD)
    np.testing.assert_allclose(
        pymap3d.geodetic2ned(*truth.lla[row], *start.lla, deg=False), error[POS], atol=1e-4
    )
    np.testing.assert_allclose(truth.v_n[row] - start.v_n, error[VEL], atol=1e-12)
    estimate = Rotation.from_euler("ZYX", start.rph[::-1])
    np.testing.assert_allclose(
        (truth.rotation[row] * estimate.inv()).as_rotvec(), error[ATT], atol=1e-12
    )
    np.testing.assert_allclose(biases[0] - start.b_a, error[BA], atol=1e-12)
    np.testing.assert_allclose(biases[1] - start.b_g, error[BG], atol=1e-12)
    assert all(type(value) is float for part in start[1:7] for value in part)


def test_without_biases_the_estimates_are_zero():
    made = simulate(FLIGHT, 2, "tactical", seed=3)
    start = draw_start(made.reference, STD, 8)
    assert start.b_a == start.b_g == (0.0, 0.0, 0.0)


def test_impossible_starts_are_refused():
    truth = simulate(FLIGHT, 2, "tactical", seed=3).reference
    for std, t, words in (
        (STD[:9], None, "15 finite standard deviations"),
        (-STD, None, "15 finite standard deviations"),
        (STD, 50.0, "no row at 50 s"),
    ):
        with pytest.raises(DataError, match=words):
            draw_start(truth, std, np.random.default_rng(8), t)
