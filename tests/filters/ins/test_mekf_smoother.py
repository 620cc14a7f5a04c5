"""The smoother of the multiplicative EKF: the adjoint of its correction against dense matrices,
and smoothed solutions against the closed loop's."""

import numpy as np
import pytest
from recordings import flight, start
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding
from strapdown.core.loop.contract import Noise, compile_kernel
from strapdown.core.mathematics.smoother import work_size
from strapdown.core.mathematics.source import new_source
from strapdown.filters.ins.mekf import MEKF
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)


def correlated(n, seed):
    root = np.random.default_rng(seed).standard_normal((n, n))
    return root @ root.T / n + np.eye(n)


def recorded(filter, n, y, gate=np.inf):
    """(record of a correction, its rotation vector) of a belief with n states and a full P, by a
    velocity y (m/s)."""
    sensor = aiding.find("velocity")
    for kernel in (
        filter.correct,
        filter.smoother.save_step,
        filter.smoother.adjoint_step,
        sensor.observe,
    ):
        compile_kernel(kernel)
    begin = start(flight())
    belief = filter.start(begin._replace(v_n=(0.0,) * 3, std=(1.0,) * n), NOISE)
    belief.P[...], before = correlated(n, 1), Rotation.from_matrix(belief.C_nb)
    filter.correct(
        belief,
        np.array(y),
        np.array([0.5, 0.7, 0.9]),
        aiding.number(sensor.name),
        sensor.observe,
        new_source(),
        gate,
        np.zeros(12),
    )
    record = np.full(filter.smoother.width(n), np.nan)
    filter.smoother.save_step(belief, record)
    return record, (Rotation.from_matrix(belief.C_nb) * before.inv()).as_matrix()


def undone(filter, record, n):
    lam, Lam = np.random.default_rng(2).standard_normal(n), correlated(n, 3)
    filter.smoother.adjoint_step(record, lam, Lam, np.full(work_size(n, n), np.nan))
    return lam, Lam


@pytest.mark.parametrize("n", [15, 17])
@pytest.mark.parametrize("y", [(2.0, -1.0, 3.0), (np.nan, 4.0, np.nan)])
def test_the_adjoint_of_a_correction_turns_back_first(n, y):
    """Turned back by half of the correction, then as without a turn."""
    record, R = recorded(MEKF, n, y)
    half = (Rotation.from_matrix(R) ** 0.5).as_matrix()
    A = block_diag(np.eye(6), half, np.eye(n - 9))
    assert np.degrees(Rotation.from_matrix(R).magnitude()) > 10
    plain = record.copy()
    plain[plain.size - 3 :] = 0.0  # the same correction without its turn
    lam, Lam = np.random.default_rng(2).standard_normal(n), correlated(n, 3)
    lam, Lam = A.T @ lam, A.T @ Lam @ A
    MEKF.smoother.adjoint_step(plain, lam, Lam, np.zeros(work_size(n, n)))
    for found, expected in zip(undone(MEKF, record, n), (lam, Lam)):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_what_was_not_used_turns_nothing():
    for y, gate in (((50.0, 60.0, 70.0), 1.0), ((np.nan,) * 3, np.inf)):
        record, _ = recorded(MEKF, 15, y, gate)
        lam, Lam = undone(MEKF, record, 15)
        assert np.array_equal(lam, np.random.default_rng(2).standard_normal(15)) and np.array_equal(
            Lam, correlated(15, 3)
        )


def test_smoothed_solutions_are_the_closed_loops_to_second_order_and_nearer_to_the_truth():
    recording = flight()
    begin = start(recording)
    ours, closed = (
        sd.smooth(recording, name, start=begin, noise=NOISE) for name in ("mekf", "closed-loop")
    )
    forward = sd.fuse(recording, "mekf", start=begin, noise=NOISE)
    apart = np.c_[
        displacement(ours.trajectory.lla, closed.trajectory.lla),
        ours.trajectory.v_n - closed.trajectory.v_n,
        (ours.trajectory.rotation * closed.trajectory.rotation.inv()).as_rotvec(),
        ours.b_a - closed.b_a,
        ours.b_g - closed.b_g,
    ]
    assert 0 < np.abs(apart / closed.trajectory.std).max() < 0.05
    np.testing.assert_allclose(ours.trajectory.std, closed.trajectory.std, rtol=0.02)
    late = slice(40, -1)
    smoothed, filtered = (sd.errors(s, recording.reference).position[late] for s in (ours, forward))
    assert np.sqrt(np.mean(smoothed**2)) < 0.8 * np.sqrt(np.mean(filtered**2))
    assert (ours.trajectory.std[late] < forward.trajectory.std[late]).all()
