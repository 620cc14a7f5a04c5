"""Scale and misalignment of the IMU as states: their columns of the transition against numeric
differentiation of the mechanization, their adjoint against dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from flat_flight import NOISE, flight

import strapdown as sd
from strapdown.core.mathematics.coupling import COUPLED, ROW, uncouple
from strapdown.engine.installation import coupling_rows, parameters, with_estimates
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
EXACT = NOISE._replace(gyro=0.0, accel=0.0)
NAMES = {
    "gyro-scale": [(0, 0), (1, 1), (2, 2)],
    "accel-scale": [(3, 3), (4, 4), (5, 5)],
    "gyro-misalignment": [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)],
    "accel-misalignment": [(3, 4), (3, 5), (4, 5)],
}


def read_wrong(recording, into, of, value):
    """The recording of an IMU whose component `into` reads `value` of component `of` too much."""
    u = np.hstack([recording.imu.dtheta, recording.imu.dv])
    u[:, into] += value * np.hstack([recording.imu.dtheta, recording.imu.dv])[:, of]
    return replace(recording, imu=recording.imu._replace(dtheta=u[:, :3], dv=u[:, 3:]))


@pytest.mark.parametrize("name", NAMES)
def test_the_table_says_which_axis_reads_which(name):
    recording, _, _ = flight(1.0, 10.0)
    of_imu = with_estimates(recording, [name]).meta["estimate"]
    table = coupling_rows(parameters((), of_imu), 15)
    assert [row[1:] for row in table.tolist()] == NAMES[name]
    assert table.state.tolist() == list(range(15, 15 + len(table)))


@pytest.mark.parametrize("name", NAMES)
def test_columns_of_the_transition_are_those_of_the_mechanization(name):
    """P that begins with one uncertain state ends as its derivative times its variance; the
    derivative is the difference of two runs."""
    recording, start, _ = flight(2.0, 50.0, noisy=False)
    recording = replace(recording, sources=())
    start = start._replace(std=(0.0,) * 15)
    options = dict(start=start, noise=EXACT)
    whole = sd.fuse(recording, estimate=[name], covariance=True, **options)
    P, prior = whole.covariance[-1], whole.covariance[0, 15, 15]
    for k, (into, of) in enumerate(NAMES[name]):
        step = 1e-4
        ends = [
            sd.fuse(read_wrong(recording, into, of, sign * step), **options).trajectory
            for sign in (1, -1)
        ]
        # a state is what the sensor reads too much: the truth is less by it
        position = displacement(ends[1].lla[-1:], ends[0].lla[-1:])[0]
        turned = (ends[1].rotation[-1] * ends[0].rotation[-1].inv()).as_rotvec()
        moved = np.r_[position, ends[1].v_n[-1] - ends[0].v_n[-1], turned] / (2 * step)
        column = P[:9, 15 + k] / P[15 + k, 15 + k]
        assert P[15 + k, 15 + k] == pytest.approx(prior)
        for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
            size = np.abs(moved[part]).max()
            np.testing.assert_allclose(column[part], moved[part], atol=0.02 * size + 1e-3)


def test_a_gap_holds_velocity_whatever_the_scale():
    """What stands in for samples is what the IMU would read."""
    recording, start, _ = flight(6.0, 20.0, noisy=False)
    t, sources = recording.imu.t, recording.sources
    kept = (t < 1.0) | (t > 5.5)
    recording = replace(recording, imu=type(recording.imu)(*(x[kept] for x in recording.imu)))
    recording = replace(recording, sources=tuple(a._where(a.t < 0.99) for a in sources))
    told = sd.fuse(
        read_wrong(recording, 5, 5, 0.05),
        start=start,
        noise=EXACT,
        estimate={"accel-scale": (0.0, 0.0, 0.05)},
    )
    before, after = np.searchsorted(told.t, [1.0, 5.5]) + [-1, 0]
    scale = told.columns["accel scale down error of imu"][before]
    assert scale > 0.02
    assert abs(told.trajectory.v_n[after, 2] - told.trajectory.v_n[before, 2]) < 0.7


def test_the_adjoint_is_that_of_the_dense_matrix():
    rng, n = np.random.default_rng(1), 18
    record, T = np.full(2 + 2 * ROW, np.nan), np.eye(n)
    record[:2] = COUPLED, 2
    for row, (state, first) in enumerate(((15, 3), (17, 6))):
        G = rng.standard_normal(3)
        record[2 + ROW * row : 2 + ROW * row + ROW] = state, first, *G
        T[first : first + 3, state] = G
    A, lam = rng.standard_normal((n, n)), rng.standard_normal(n)
    Lam = A @ A.T
    found, Found = lam.copy(), Lam.copy()
    uncouple(record, found, Found)
    np.testing.assert_allclose(found, T.T @ lam, rtol=1e-12)
    np.testing.assert_allclose(Found, T.T @ Lam @ T, rtol=1e-12, atol=1e-12)
