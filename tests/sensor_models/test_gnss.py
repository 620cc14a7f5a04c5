"""GNSS fixes: noise, antenna position and velocity against pymap3d and differentiation."""

import numpy as np
import pymap3d
import pytest

from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.geometry.geodesy import displace_lla
from strapdown.sensor_models.gnss import Gnss, position_fixes, velocity_fixes
from strapdown.sim.trajectory import DEG, demo_flight, sample

TRUTH = sample(demo_flight(), np.arange(0, 120.001, 0.01) + 60)
ARM = (0.8, -0.3, -1.2)
ROWS = np.arange(100, 12001, 100)


def north_east_down(lla, origin):
    return np.stack(pymap3d.geodetic2ned(*lla.T, *origin.T, deg=False), axis=1)


@pytest.mark.parametrize("lat, lon", [(47, 9), (-78, 179.99999), (0, -180)])
def test_displaced_moves_by_metres(lat, lon):
    origin, move = np.array([[lat * DEG, lon * DEG, 900.0]]), np.array([[3.0, -5.0, 2.0]])
    np.testing.assert_allclose(north_east_down(displace_lla(origin, move), origin), move, atol=2e-5)
    assert -np.pi <= displace_lla(origin, -move)[0, 1] < np.pi


def test_fixes_come_at_the_interval_and_carry_their_noise():
    fixes = position_fixes(TRUTH, 1.0, (1.0, 2.0, 3.0), np.random.default_rng(4))
    # exactly the samples' times: no sliver of an increment to split off
    np.testing.assert_array_equal(fixes.t, TRUTH.t[ROWS])
    assert (
        fixes.kind == "position"
        and fixes.parameters == (0.0, 0.0, 0.0)
        and fixes.std.shape == fixes.y.shape == (120, 3)
    )
    many = position_fixes(TRUTH, TRUTH.t, (1.0, 2.0, 3.0), np.random.default_rng(4))
    error = north_east_down(many.y, TRUTH.lla)
    assert (
        error.std(axis=0) == pytest.approx([1, 2, 3], rel=0.03)
        and np.abs(error.mean(axis=0) / [1, 2, 3]).max() < 0.04
    )
    velocities = velocity_fixes(TRUTH, TRUTH.t, 0.1, np.random.default_rng(4))
    assert (velocities.y - TRUTH.v_n).std(axis=0) == pytest.approx([0.1] * 3, rel=0.03)


def test_antenna_position_and_velocity():
    fixes = position_fixes(TRUTH, 1.0, 1e-9, np.random.default_rng(0), ARM)
    expected = TRUTH.rotation[ROWS].apply(ARM)
    np.testing.assert_allclose(north_east_down(fixes.y, TRUTH.lla[ROWS]), expected, atol=1e-6)
    assert fixes.parameters == ARM
    antenna = np.stack(
        pymap3d.geodetic2ecef(*displace_lla(TRUTH.lla, TRUTH.rotation.apply(ARM)).T, deg=False),
        axis=1,
    )
    inner = ROWS[:-1]
    moved = (antenna[inner + 1] - antenna[inner - 1]) / 0.02
    velocity = np.stack(pymap3d.ecef2enuv(*moved.T, *np.degrees(TRUTH.lla[inner, :2].T)), axis=1)[
        :, [1, 0, 2]
    ] * [1, 1, -1]
    measured = velocity_fixes(TRUTH, 1.0, 1e-9, np.random.default_rng(0), ARM).y[:-1]
    np.testing.assert_allclose(measured, velocity, atol=2e-4)
    assert np.abs(measured - TRUTH.v_n[inner]).max() > 0.05  # the lever arm matters here


def test_times_between_samples_are_interpolated():
    t = TRUTH.t[ROWS] - 0.004
    direct = sample(demo_flight(), t)
    fixes = position_fixes(TRUTH, t, 1e-9, np.random.default_rng(0))
    np.testing.assert_allclose(north_east_down(fixes.y, direct.lla), 0, atol=1e-6)
    np.testing.assert_allclose(
        velocity_fixes(TRUTH, t, 1e-9, np.random.default_rng(0)).y, direct.v_n, atol=1e-6
    )


def test_a_receiver_gives_what_it_measures_from_separate_streams():
    both = Gnss(interval=2.0, lever_arm=ARM).fixes(TRUTH, np.random.default_rng(9))
    assert [fix.kind for fix in both] == ["position", "velocity"] and all(
        len(fix.t) == 60 and fix.parameters == ARM for fix in both
    )
    (alone,) = Gnss(interval=2.0, lever_arm=ARM, position_std=None).fixes(
        TRUTH, np.random.default_rng(9)
    )
    np.testing.assert_array_equal(alone.y, both[1].y)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"interval": 0.0}, "interval between fixes"),
        ({"position_std": (1, 1, 0)}, "each above 0"),
        ({"velocity_std": (1, np.nan, 1)}, "3 finite numbers"),
        ({"lever_arm": (1.0, 2.0)}, "lever arm"),
        ({"interval": np.array([10.0])}, "outside the trajectory"),
    ],
)
def test_impossible_receivers_are_refused(change, words):
    with pytest.raises(DataError, match=words):
        Gnss()._replace(**change).fixes(TRUTH, np.random.default_rng(0))


def test_what_the_trajectory_lacks_is_named():
    bare = Trajectory(TRUTH.t, TRUTH.lla)
    with pytest.raises(DataError, match="no velocity"):
        velocity_fixes(bare, 1.0, 0.1, np.random.default_rng(0))
    with pytest.raises(DataError, match="needs the trajectory's attitude"):
        position_fixes(bare, 1.0, 0.1, np.random.default_rng(0), ARM)


def test_outages_leave_the_other_fixes_as_they_were():
    whole = Gnss().fixes(TRUTH, np.random.default_rng(9))
    holed = Gnss(outages=((70.0, 75.0), (170.0, 200.0))).fixes(TRUTH, np.random.default_rng(9))
    for all_of, left in zip(whole, holed, strict=True):
        keep = ((all_of.t < 69.9999) | (all_of.t >= 74.9999)) & (all_of.t < 169.9999)
        assert len(left.t) == len(left.std) == 120 - 5 - 11
        np.testing.assert_array_equal(left.t, all_of.t[keep])
        np.testing.assert_array_equal(left.y, all_of.y[keep])


def test_late_fixes_are_stamped_late():
    prompt = Gnss(0.5, lever_arm=ARM).fixes(TRUTH, np.random.default_rng(9))
    late = Gnss(0.5, lever_arm=ARM, latency=0.2, outages=((70.0, 75.0),)).fixes(
        TRUTH, np.random.default_rng(9)
    )
    for one, other in zip(prompt, late, strict=True):
        # an outage is one of measuring; the last stamp would be after the end
        keep = ((one.t < 69.9999) | (one.t >= 74.9999)) & (one.t <= 179.801)
        np.testing.assert_allclose(other.t, one.t[keep] + 0.2, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(other.y, one.y[keep])
    error = north_east_down(
        late[0].y, displace_lla(sample(demo_flight(), late[0].t).lla, np.zeros(3))
    )
    # 45 m/s for 0.2 s, which a filter without knowledge of it takes for error
    assert np.linalg.norm(error, axis=1).mean() > 7


def test_a_plan_serves_any_number_of_runs():
    receiver = Gnss(0.1, lever_arm=ARM)
    plan = receiver.plan(TRUTH, gate=np.inf)
    for seed in (1, 2, 1):
        for mine, other in zip(
            plan.fixes(np.random.default_rng(seed)),
            receiver.fixes(TRUTH, np.random.default_rng(seed)),
            strict=True,
        ):
            np.testing.assert_array_equal(mine.y, other.y)
            assert mine.gate == np.inf and other.gate is None
    for mine, noisy in zip(plan.exact(), plan.fixes(np.random.default_rng(1)), strict=True):
        assert (mine.y - noisy.y).std(axis=0).min() > 0 and np.array_equal(mine.std, noisy.std)
    np.testing.assert_array_equal(plan.exact()[1].y, plan.exact()[1].y)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"latency": -0.1}, "latency"),
        ({"latency": np.nan}, "latency"),
        ({"outages": ((5.0, 5.0),)}, "start before the stop"),
        ({"outages": ((5.0,),)}, "it must be 2 times .start, stop."),
        ({"position_std": (1.0, 2.0)}, "it must be 3 finite numbers: north, east, down"),
        ({"outages": (("a", "b"),)}, "it must be 2 times .start, stop."),
        ({"latency": "x"}, "latency"),
        ({"interval": np.array([1.0, np.nan])}, "n finite numbers"),
    ],
)
def test_impossible_outages_and_delays_are_refused(change, words):
    with pytest.raises(DataError, match=words):
        Gnss(**change).plan(TRUTH)
