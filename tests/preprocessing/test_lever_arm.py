"""Measurements at another point of a rigid body against motions whose truth is known at both
points: simulated ones and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import Imu
from strapdown.data.solution import Source, Trajectory
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.preprocessing.lever_arm import gnss_at, imu_at, specific_force_at
from strapdown.sim.trajectory import DEG, Motion, records

ARM = np.array([2.0, -1.0, 0.5])
RATES = np.array([0.4, -0.7, 1.1])  # rad/s, amplitudes of the wobble below


def wobble(dt, seconds=4.0, frequency=0.5):
    """Imu of a body that wobbles about three axes in free space, at its centre (no force) and at
    ARM, by closed forms and fine quadrature."""
    edges = np.arange(0, seconds + dt / 2, dt)
    w = 2 * np.pi * frequency * np.array([1.0, 0.7, 1.3])
    omega, omega_dot = (
        (lambda t: RATES * np.sin(w * t[:, None])),
        (lambda t: RATES * w * np.cos(w * t[:, None])),
    )
    nodes, weights = np.polynomial.legendre.leggauss(6)
    mean = lambda function: sum(
        0.5 * weight * function(edges[:-1] + dt * (0.5 + 0.5 * node))
        for node, weight in zip(nodes, weights)
    )
    force = lambda t: specific_force_at(np.zeros((len(t), 3)), omega(t), omega_dot(t), ARM)
    still = np.zeros((len(edges) - 1, 3))
    made = lambda dv: Imu(edges[1:], np.full(len(edges) - 1, dt), dt * mean(omega), dv)
    return made(still), made(dt * mean(force))


@pytest.mark.short
def test_specific_force_is_the_second_derivative_of_the_point():
    """A turntable that spins up: angle a t^2/2, the point's path differentiated twice by central
    differences."""
    a, t, step = 0.8, 1.3, 1e-3
    path = lambda t: np.array(
        [
            [np.cos(a * t * t / 2), -np.sin(a * t * t / 2), 0],
            [np.sin(a * t * t / 2), np.cos(a * t * t / 2), 0],
            [0, 0, 1],
        ]
    )
    second = (path(t + step) - 2 * path(t) + path(t - step)) @ ARM / step**2
    found = specific_force_at(np.zeros(3), [0, 0, a * t], [0, 0, a], ARM)
    np.testing.assert_allclose(path(t) @ found, second, atol=1e-5)


@pytest.mark.short
def test_imu_at_another_point_to_second_order():
    """Halving the interval quarters the error of specific force; away from the ends, where the
    rate goes on evenly, it is (w dt)^2/6 of the tangential part."""
    worst = []
    for dt in (0.02, 0.01):
        centre, point = wobble(dt)
        moved = imu_at(centre, ARM)
        np.testing.assert_array_equal(moved.dtheta, centre.dtheta)
        worst.append(np.abs(moved.dv - point.dv)[2:-2].max() / dt)
    assert worst[0] < 0.08 and worst[0] / worst[1] == pytest.approx(4, rel=0.05)
    largest = np.abs(point.dv).max() / 0.01
    assert (
        worst[1] < 0.01 * largest
        # (2 pi 0.65 Hz 0.01 s)^2/6 = 0.03 % of it, thirty times less, plus what the centripetal part
        # lacks
    )


@pytest.mark.short
def test_velocity_is_right_over_any_time_since_changes_of_rate_add_up():
    centre, point = wobble(0.02)
    off = np.cumsum(imu_at(centre, ARM).dv - point.dv, axis=0)
    assert np.abs(off).max() < 3e-3


@pytest.mark.short
def test_there_and_back_again():
    centre, _ = wobble(0.01)
    back = imu_at(imu_at(centre, ARM), -ARM)
    np.testing.assert_allclose(back.dv, centre.dv, atol=1e-15)


@pytest.mark.short
def test_noise_of_the_gyro_does_not_walk():
    """10 000 samples of white noise: the velocity error stays below ten N |l| / sqrt(dt), where a
    walk would reach a hundred.

    The rate at the first edge, which all later ones are compared with, has 1.6 N / sqrt(dt), the
    others 0.7: four deviations of each.
    """
    N, dt = 1e-4, 0.01
    dtheta = np.random.default_rng(5).normal(0, N * np.sqrt(dt), (10_000, 3))
    imu = Imu(dt * np.arange(1, 10_001), np.full(10_000, dt), dtheta, np.zeros((10_000, 3)))
    walked = np.cumsum(imu_at(imu, ARM).dv, axis=0)
    assert np.abs(walked).max() < 10 * N * np.linalg.norm(ARM) / np.sqrt(dt)


@pytest.mark.short
def test_gaps_and_single_samples():
    centre, point = wobble(0.01)
    keep = np.r_[0:100, 150:151, 200:400]
    moved = imu_at(Imu(*(column[keep] for column in centre)), ARM)
    assert np.isfinite(moved.dv).all()
    off = np.abs(moved.dv - point.dv[keep]).max(axis=1) / 0.01
    # beside the gap the rate goes on evenly
    assert off[[99, 101]].max() < 0.3 and off[1:98].max() < 0.05
    one = imu_at(Imu(*(column[:1] for column in centre)), ARM)
    assert one.dv.shape == (1, 3) and np.isfinite(one.dv).all()


def test_the_moved_imu_navigates_the_moved_point():
    """A simulated flight: two IMUs without errors a lever arm apart, on the way of the simulator
    and by transport, feel the same."""
    course = lambda t: 0.5 * np.sin(t)
    motion = Motion(
        "weave",
        (DEG * 50, 0.1, 500.0),
        lambda t: (30 + 0 * t, 5 * np.sin(0.5 * t), 0 * t),
        lambda t: (0.3 * np.sin(0.8 * t), 0.05 + 0 * t, course(t)),
    )
    truth, imu = records(motion, np.arange(0, 10.005, 0.01))
    moved = imu_at(imu, ARM)
    omega = np.vstack([imu.dtheta[:1], imu.dtheta]) / 0.01
    edges = np.vstack([omega[0], 0.5 * (omega[1:-1] + omega[2:]), omega[-1]])
    point = truth.displaced(ARM, edges)
    start = sd.InitialState(
        0.0,
        tuple(point.lla[0]),
        tuple(point.v_n[0]),
        tuple(point.rph[0]),
        (0.0,) * 3,
        (0.0,) * 3,
        (1e-6,) * 15,
    )
    run = sd.fuse(sd.Recording(moved), "open-loop", imu="navigation", start=start)
    off = displacement(run.trajectory.lla, point.lla[1:])
    assert np.abs(off).max() < 0.02 and np.abs(run.trajectory.v_n - point.v_n[1:])[:-1].max() < 0.01
    still = sd.fuse(sd.Recording(imu), "open-loop", imu="navigation", start=start)
    # what leaving the lever arm out would cost
    assert np.abs(displacement(still.trajectory.lla, point.lla[1:])).max() > 1


# ---- GNSS


def antenna(kind="position", std_=0.5, n=21, arm=ARM):
    """(fixes of an antenna at ARM, truth at the IMU, Imu) of a body that turns at 0.3 rad/s and
    rolls."""
    motion = Motion(
        "turning",
        (DEG * 60, DEG * 5, 20.0),
        lambda t: (5 + 0 * t, -2 + 0 * t, 0 * t),
        lambda t: (0.2 * np.sin(t), 0.1 + 0 * t, 0.3 * t),
    )
    truth, imu = records(motion, np.arange(0, 10.005, 0.02))
    rows = np.linspace(1, len(truth) - 2, n).astype(int)
    omega = 0.5 * (imu.dtheta[rows - 1] + imu.dtheta[rows]) / 0.02
    there = Trajectory(truth.t[rows], truth.lla[rows], truth.v_n[rows], truth.q_nb[rows]).displaced(
        arm, omega
    )
    y = there.lla if kind == "position" else there.v_n
    return Source(kind, truth.t[rows], y, np.full((n, 3), std_), tuple(arm)), truth, imu, rows


@pytest.mark.short
@pytest.mark.parametrize("form", ["trajectory", "angles", "between"])
def test_positions_move_from_the_antenna_to_the_imu(form):
    fixes, truth, _, rows = antenna()
    attitude = {
        "trajectory": truth,
        "angles": (truth.t, truth.rph),
        "between": (truth.t[::7], truth.rph[::7]),
    }[form]
    if form == "between":
        fixes = fixes.between(0, truth.t[::7][-1])
        rows = rows[: len(fixes.t)]
    moved = gnss_at(fixes, attitude)
    assert np.abs(displacement(moved.y, truth.lla[rows])).max() < (
        1e-6 if form != "between" else 0.01
    )
    assert (
        moved.parameters == (0.0, 0.0, 0.0)
        and moved.kind == "position"
        and np.array_equal(moved.std, fixes.std)
    )
    assert np.abs(displacement(fixes.y, truth.lla[rows])).max() > 1.5


@pytest.mark.short
def test_velocities_lose_what_the_lever_arm_swings():
    fixes, truth, imu, rows = antenna("velocity")
    moved = gnss_at(fixes, truth, imu)
    assert (
        np.abs(moved.y - truth.v_n[rows]).max() < 0.01
        and np.abs(fixes.y - truth.v_n[rows]).max() > 0.4
    )
    other = gnss_at(replace(fixes, parameters=()), truth, imu, lever_arm=ARM)
    np.testing.assert_array_equal(other.y, moved.y)


@pytest.mark.short
@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_standard_deviations_grow_with_the_attitude_error(kind):
    """4000 attitudes drawn around the truth: the scatter of the moved fix is the stated one; a
    deviation of 4000 has 1.1 %, so 6 % is over five of its own."""
    fixes, truth, imu, rows = antenna(kind, n=3)
    deviations, rng = np.array([0.02, 0.03, 0.06]), np.random.default_rng(2)
    moved = gnss_at(fixes, truth, imu, attitude_std=deviations, rate_std=0.1)
    from scipy.spatial.transform import Rotation

    arm = ARM if kind == "position" else np.cross(imu.dtheta[rows[1] - 1] / 0.02, ARM)
    turned = (
        Rotation.from_rotvec(rng.normal(0, deviations, (4000, 3))) * truth.rotation[rows[1]]
    ).apply(arm)
    grown = np.sqrt(
        moved.std[1] ** 2 - 0.25 - (0.1 * np.linalg.norm(ARM)) ** 2 * (kind == "velocity")
    )
    np.testing.assert_allclose(grown, turned.std(axis=0), rtol=0.06)
    stated = gnss_at(
        fixes,
        replace(truth, std=np.tile(np.r_[np.zeros(6), deviations], (len(truth), 1))),
        imu,
        rate_std=0.1,
    )
    np.testing.assert_allclose(stated.std, moved.std)


@pytest.mark.short
def test_what_is_not_measured_stays_so():
    fixes, truth, _, _ = antenna()
    fourth = np.arange(len(fixes.t))[:, None] == 3
    moved = gnss_at(replace(fixes, y=np.where(fourth, np.nan, fixes.y)), truth)
    assert np.isnan(moved.y[3]).all() and np.isfinite(np.delete(moved.y, 3, 0)).all()


def truth_backwards(truth):
    return Trajectory(truth.t[::-1], truth.lla[::-1], q_nb=truth.q_nb[::-1])


@pytest.mark.short
def test_what_cannot_be_moved_is_refused():
    fixes, truth, imu, _ = antenna()
    velocity = antenna("velocity")[0]
    for call, message in (
        (
            lambda: gnss_at(Source("heading", fixes.t, fixes.y[:, :1], fixes.std[:, :1]), truth),
            "fixes of kind 'heading' cannot",
        ),
        (
            lambda: gnss_at(fixes, (truth.t[:100], truth.rph[:100])),
            r"17 of 21 fixes are outside the attitude record \(0.000 to 1.980 s",
        ),
        (lambda: gnss_at(velocity, truth), "give imu="),
        (
            lambda: gnss_at(velocity, truth, Imu(*(column[:99] for column in imu))),
            "fixes are outside the IMU record",
        ),
        (lambda: gnss_at(fixes, truth, lever_arm=(1.0, np.nan, 0.0)), "3 finite numbers"),
        (lambda: imu_at(imu, (1.0, 2.0)), "3 finite numbers"),
        (lambda: gnss_at(fixes, Trajectory(truth.t, truth.lla)), "has no attitude"),
        (
            lambda: gnss_at(
                fixes, (np.r_[truth.t[:3], truth.t[2:]], truth.rph[np.r_[:3, 2 : len(truth)]])
            ),
            "do not increase: 0.04 s is followed by 0.04 s",
        ),
        (lambda: gnss_at(fixes, truth_backwards(truth)), "do not increase: .*sort its rows"),
        (lambda: gnss_at(fixes, (truth.t[:1], truth.rph[:1])), "fewer than two rows"),
    ):
        with pytest.raises(DataError, match=message):
            call()


@pytest.mark.short
def test_it_is_the_inverse_of_displaced():
    fixes, truth, _, rows = antenna()
    moved = gnss_at(fixes, truth)
    np.testing.assert_allclose(
        displace_lla(moved.y, truth.rotation[rows].apply(ARM))[:, :2], fixes.y[:, :2], atol=1e-12
    )
