"""The exogenous Kalman filter while its observer agrees with it: the closed loop, at the heading of
the observer where its own is uncertain, and what makes it follow the observer altogether."""

from dataclasses import replace

import numpy as np
import pytest
from affine_filter import Dense, copied, minus, moved, plus
from recordings import flight, start
from scipy.spatial.transform import Rotation
from test_xkf import NOISE, begun, fix, put, world

import strapdown as sd
from strapdown.data.solution import Source
from strapdown.evaluation import consistency
from strapdown.experiments.monte_carlo.study import Study
from strapdown.filters.observer import xkf
from strapdown.filters.observer.equations import SINCE_COURSE
from strapdown.filters.observer.own_estimate import DOUBT, TURN
from strapdown.filters.observer.xkf import XKF
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.trajectory import DEG, Motion

ALL = ("lla", "v_n", "C_nb", "b_a", "b_g")


def about_vertical(z):
    """Rotation matrix of z (rad) about down."""
    return Rotation.from_rotvec([0.0, 0.0, z]).as_matrix()


def tilted(P, z):
    """P whose tilts are turned by z (rad) about the vertical."""
    T = np.eye(15)
    T[6:9, 6:9] = about_vertical(z)
    return T @ P @ T.T


def uncertain(off):
    """(belief whose heading is uncertain by 30 deg, `off` (rad) from that of an observer that has a
    course)."""
    belief = begun(near=np.inf, jacobian="estimate")
    belief.P[8, 8] = (30 * DEG) ** 2
    put(belief, copied(belief)._replace(C_nb=about_vertical(-off) @ belief.C_nb))
    belief.workspace[xkf.INSIDE][xkf.BLOCK.start + SINCE_COURSE] = 0.0
    u, dt, _, _ = world()
    XKF.predict(belief, u[0], dt, NOISE)
    return belief


def own(belief):
    """What it keeps of its own, as a view."""
    return belief.workspace[xkf.MINE]


@pytest.mark.short
def test_with_a_sure_heading_it_is_the_closed_loop():
    recording = flight()
    run = lambda name, **options: sd.fuse(
        recording, name, start=start(recording), noise=NOISE, covariance=True, options=options
    )
    closed, mine = run("closed-loop"), run("xkf")
    off = displacement(mine.trajectory.lla, closed.trajectory.lla)
    assert np.abs(off).max() < 1e-6
    np.testing.assert_allclose(mine.trajectory.std, closed.trajectory.std, rtol=1e-8)
    turn = (mine.trajectory.rotation * closed.trajectory.rotation.inv()).magnitude()
    assert turn.max() < 1e-9


@pytest.mark.short
def test_with_an_unsure_one_it_is_the_linear_filter_about_the_observers_heading():
    """Prediction and a fix, against dense matrices about the estimate turned back to there."""
    belief = uncertain(0.6)
    u, dt, _, fixes = world()
    z = own(belief)[TURN]
    assert abs(z) == pytest.approx(0.6, abs=0.1)
    turned = copied(belief)._replace(C_nb=about_vertical(-z) @ belief.C_nb)
    oracle = Dense(belief, turned, tilted(belief.P, -0.5 * z))
    oracle.predict(turned, moved(turned, u[1], dt), u[1], dt)
    end = plus(moved(turned, u[1], dt), oracle.x - np.eye(15)[8] * z)
    XKF.predict(belief, u[1], dt, NOISE)
    assert np.abs(minus(belief, end._replace(C_nb=about_vertical(z) @ end.C_nb))).max() < 1e-7
    z = own(belief)[TURN]
    scale = np.sqrt(np.diag(belief.P))
    off = np.abs(tilted(oracle.P, 0.5 * z) - belief.P) / np.outer(scale, scale)
    assert off.max() < 1e-9
    kind, y = next(one for one in fixes[10] if one[0] == "velocity")
    turned = copied(belief)._replace(C_nb=about_vertical(-z) @ belief.C_nb)
    oracle.x = minus(belief, turned)
    oracle.P = tilted(belief.P, -0.5 * z)
    expected = oracle.correct(turned, kind, y)
    nis, _ = fix(belief, kind, y)
    assert nis == pytest.approx(expected, rel=1e-9)
    end = plus(turned, oracle.x - np.eye(15)[8] * z)
    assert np.abs(minus(belief, end._replace(C_nb=about_vertical(z) @ end.C_nb))).max() < 1e-7
    off = np.abs(tilted(oracle.P, 0.5 * (oracle.x[8])) - belief.P) / np.outer(scale, scale)
    assert off.max() < 1e-9


@pytest.mark.short
def test_a_rejected_fix_leaves_belief_and_covariance_bit_for_bit():
    belief = uncertain(0.6)
    before, P, z = copied(belief), belief.P.copy(), own(belief)[TURN]
    nis, _ = fix(belief, "position", displace_lla(belief.lla, [3000.0, 0.0, 0.0]), gate=16.0)
    assert nis > 16 and z != 0
    assert all(np.array_equal(a, b) for a, b in zip(before, copied(belief)))
    assert np.array_equal(P, belief.P)


@pytest.mark.short
@pytest.mark.parametrize("std_deg, off", [(1.0, 0.02), (30.0, 1.7)])
def test_an_observer_that_is_less_sure_or_contradicts_tells_no_heading(std_deg, off):
    belief = uncertain(0.3)
    assert own(belief)[TURN] != 0
    belief.P[8, :8] = belief.P[:8, 8] = belief.P[8, 9:] = belief.P[9:, 8] = 0.0
    belief.P[8, 8] = (std_deg * DEG) ** 2
    put(belief, copied(belief)._replace(C_nb=about_vertical(-off) @ belief.C_nb))
    XKF.predict(belief, world()[0][0], world()[1], NOISE)
    assert own(belief)[TURN] == 0


@pytest.mark.short
def test_it_follows_the_observer_when_the_fixes_speak_against_the_estimate():
    """And not before, however far off the observer is."""
    belief = begun(near=0.5, jacobian="estimate")
    u, dt, _, _ = world()
    here = copied(belief)
    put(belief, here._replace(C_nb=about_vertical(1.0) @ belief.C_nb))
    XKF.predict(belief, u[0], dt, NOISE)
    assert belief.workspace[xkf.CLOSE] == 1
    followed = []
    for _ in range(6):
        far = displace_lla(belief.lla, [500.0, 0.0, 0.0])
        fix(belief, "position", far, gate=16.0)
        followed.append(belief.workspace[xkf.CLOSE] == 0)
    assert not followed[1] and followed[-1]  # two outliers are none of the estimate's fault
    put(belief, copied(belief))  # the observer comes back
    assert belief.workspace[xkf.CLOSE] == 1 and own(belief)[DOUBT] == 1


@pytest.mark.short
def test_a_start_without_a_level_follows_the_observer():
    lost = start(flight())._replace(std=(*start(flight()).std[:6], 1.0, 1.0, 1.0, *[0.01] * 6))
    belief = XKF.start(lost, NOISE)
    assert belief.workspace[xkf.CLOSE] == 0
    assert begun(near=0.5).workspace[xkf.CLOSE] == 1


def test_a_heading_that_the_gyro_turned_away_is_corrected_without_harm():
    """A minute straight and level, in which the gyro's bias turns the estimated heading by 34 deg,
    until a heading fix at 45 s: tilt and accelerometer bias then still agree. Without its turn of P
    a closed loop is above 10."""
    motion = Motion(
        "level",
        (DEG * 47.0, DEG * 8.0, 500.0),
        lambda t: (40 + 0 * t, 0 * t, 0 * t),
        lambda t: (0.05 * np.sin(t), 0.05 * np.cos(0.7 * t), 0 * t),
    )
    recording = sd.simulate(motion, 60.0, "consumer", 5, 20.0, Gnss())
    compass = Source("heading", np.array([45.0]), np.zeros((1, 1)), np.full((1, 1), 0.02))
    recording = replace(recording, sources=(*recording.sources, compass))
    accel, gyro = sd.imu("consumer").bias_std()
    unknown = (2.0,) * 3 + (0.1,) * 3 + (0.002, 0.002, 0.02) + (accel,) * 3 + (gyro,) * 3
    begin = start(recording)._replace(
        rph=tuple(recording.reference.rph[0]), b_a=(0.0,) * 3, b_g=(0.0,) * 3, std=unknown
    )
    late = {}
    for name in ("xkf", "closed-loop"):
        solution = sd.fuse(recording, name, start=begin, covariance=True)
        nees = consistency.nees_of(solution, recording)
        late[name] = nees[solution.t > 45.5].mean() / 15
    assert late["xkf"] < 3 and late["closed-loop"] < 3


@pytest.mark.deep
@pytest.mark.parametrize("imu, scenario", [("consumer", "straight"), ("navigation", "straight")])
def test_it_is_consistent_where_the_heading_is_not_observed(imu, scenario):
    """Seeds that no figure of the documentation uses."""
    runs = 20
    campaign = Study(scenario, ("xkf",), imu, runs=runs, keep=1, seed=9).run()
    (cell,) = campaign.cells
    nees = campaign.curves(cell)["nees"][0] * 15
    low, high = consistency.band(15, runs)
    assert np.mean((nees > low) & (nees < high)) > 0.85
    assert np.mean(campaign.numbers(cell)["reason"][0] == 0) > 0.94
