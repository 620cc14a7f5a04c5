"""Errors against a reference: sign, units, interpolation, gaps, the antimeridian; oracles are
pymap3d, pyins and closed forms."""

from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation
from synthetic import flight

from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.evaluation import metrics
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short


def test_displacement_agrees_with_pyins_and_with_a_tangent_plane():
    from pyins.transform import compute_lla_difference

    rng = np.random.default_rng(1)
    a = np.c_[
        np.radians(rng.uniform(-85, 85, 200)),
        np.radians(rng.uniform(-180, 180, 200)),
        rng.uniform(-100, 9000, 200),
    ]
    b = a + np.c_[rng.uniform(-1e-5, 1e-5, (200, 2)), rng.uniform(-50, 50, 200)]
    found = displacement(a, b)
    degrees = lambda lla: np.c_[np.degrees(lla[:, :2]), lla[:, 2]]
    assert np.allclose(found, compute_lla_difference(degrees(a), degrees(b)), atol=1e-6)
    n, e, d = pymap3d.geodetic2ned(*degrees(a).T, *degrees(b).T)
    # 60 m apart: the curvature of parallels at 85 deg is below 1 mm/m
    assert np.allclose(found, np.c_[n, e, d], atol=0.02)


def test_error_is_true_minus_estimate_in_every_quantity():
    truth = flight(20)
    turn = np.array([0.001, -0.002, 0.003])
    off = Rotation.from_rotvec(-turn) * truth.rotation
    estimate = Trajectory(
        truth.t,
        truth.lla - [1e-6, 0, 5.0],
        truth.v_n - [0.1, 0.2, 0.3],
        off.as_quat()[:, [3, 0, 1, 2]],
    )
    e = metrics.errors(estimate, truth)
    assert e.position[:, 0] == pytest.approx(1e-6 * 6.37e6, rel=2e-3)
    assert e.position[:, 1] == pytest.approx(0, abs=1e-9) and e.position[:, 2] == pytest.approx(
        -5.0
    )
    assert np.allclose(e.velocity, [0.1, 0.2, 0.3]) and np.allclose(e.attitude, turn, atol=1e-12)
    assert e.horizontal == pytest.approx(np.abs(e.position[:, 0]))


def test_attitude_errors_wrap_and_euler_angles_agree_with_scipy():
    attitude = lambda heading: Rotation.from_euler(
        "ZYX", [[np.radians(heading), 0.3, 0.2]] * 2
    ).as_quat()[:, [3, 0, 1, 2]]
    t, lla = np.array([0.0, 1.0]), np.zeros((2, 3))
    e = metrics.errors(
        Trajectory(t, lla, None, attitude(359.0)), Trajectory(t, lla, None, attitude(1.0))
    )
    assert np.degrees(e.rph[:, 2]) == pytest.approx(2.0)
    assert np.isnan(e.velocity).all()
    q = Rotation.random(500, random_state=3).as_quat()[:, [3, 0, 1, 2]]
    rph = Trajectory(np.zeros(500), np.zeros((500, 3)), None, q).rph
    assert np.allclose(
        Rotation.from_euler("ZYX", rph[:, ::-1]).as_quat(canonical=True),
        Rotation.random(500, random_state=3).as_quat(canonical=True),
    )


@pytest.mark.parametrize("lon", [8.0, 179.9985])
def test_a_sparse_reference_is_interpolated_to_millimetres_also_across_the_antimeridian(lon):
    fine = flight(60, rate=50.0, lat=-45, lon=lon)
    coarse = Trajectory(fine.t[::50], fine.lla[::50], fine.v_n[::50], fine.q_nb[::50])
    e = metrics.errors(fine, coarse)
    assert len(e.t) == 59 * 50 + 1
    # 40 m/s round 800 m: v^4/r^3/384 = 13 mm, and the sphere of `flight`
    assert np.abs(e.position[:, :2]).max() < 0.05 and np.abs(e.position[:, 2]).max() < 1e-6
    assert np.abs(e.attitude).max() < 1e-6
    linear = metrics.errors(fine, replace(coarse, v_n=None))
    assert 0.2 < linear.horizontal.max() < 0.3  # a dt^2 / 8 = 0.25 m


def test_only_the_span_of_the_reference_counts_and_its_gaps_are_not_bridged():
    fine = flight(60, rate=10.0)
    keep = (fine.t >= 10) & (fine.t <= 50) & ~((fine.t > 20) & (fine.t < 25))
    e = metrics.errors(
        fine, Trajectory(fine.t[keep], fine.lla[keep], fine.v_n[keep], fine.q_nb[keep])
    )
    assert e.t[0] == 10 and e.t[-1] == pytest.approx(50) and e.rows == slice(100, 501)
    unknown = np.isnan(e.position).all(axis=1)
    assert np.array_equal(unknown, (e.t > 20) & (e.t < 25)) and np.array_equal(
        unknown, np.isnan(e.attitude).all(axis=1)
    )


def test_unknown_rows_of_the_reference_are_gaps_of_their_quantity_only():
    truth = flight(20, rate=10.0)
    q = truth.q_nb.copy()
    q[50:100] = np.nan
    e = metrics.errors(truth, replace(truth, q_nb=q))
    assert np.isfinite(e.position).all()
    assert np.array_equal(
        np.isnan(e.rph).all(axis=1), (np.arange(200) >= 50) & (np.arange(200) < 100)
    )
    assert np.isfinite(metrics.rms(e).rph).all() and np.isnan(metrics.rms(e, (6, 9)).rph).all()


def test_rms_over_a_window():
    t = np.arange(10.0)
    unknown = np.full((10, 3), np.nan)
    e = metrics.Errors(t, np.c_[t, 2 * t, 0 * t], *[unknown] * 3, None, slice(0, 10))
    assert metrics.rms(e).position == pytest.approx(np.sqrt([28.5, 114.0, 0.0]))
    assert metrics.rms(e, (3, 4)).position == pytest.approx(np.sqrt([12.5, 50.0, 0.0]))
    assert np.isnan(metrics.rms(e).velocity).all()


def test_no_overlap_is_refused_in_one_line():
    truth = flight(10)
    with pytest.raises(DataError, match="covers no time of the solution") as refusal:
        metrics.errors(truth, replace(truth, t=truth.t + 100))
    assert "\n" not in str(refusal.value)


def test_repeated_times_of_the_reference_do_no_harm():
    truth = flight(10)
    twice = Trajectory(
        *(np.repeat(part, 2, axis=0) for part in (truth.t, truth.lla, truth.v_n, truth.q_nb))
    )
    assert np.abs(metrics.errors(truth, twice).position).max() < 1e-8
