"""A solution at any instants and points of the body: against truth, and the Jacobian against finite
differences of the transport itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.recordings import flight, start

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.evaluation import other_instants
from strapdown.geometry.geodesy import displace_lla, displacement

pytestmark = pytest.mark.short
ARM = np.array([1.5, -0.7, 2.0])


@pytest.fixture(scope="module")
def solution():
    recording = flight()
    return sd.fuse(recording, start=start(recording), imu="tactical", covariance=True, estimate=[])


def test_at_its_own_times_it_is_the_solution(solution):
    there = solution.at(solution.t)
    np.testing.assert_allclose(there.trajectory.lla, solution.trajectory.lla, rtol=0, atol=1e-14)
    np.testing.assert_allclose(there.trajectory.v_n, solution.trajectory.v_n, rtol=0, atol=1e-12)
    np.testing.assert_allclose(there.covariance, solution.covariance[:, :9, :9], rtol=1e-12)
    np.testing.assert_allclose(
        there.trajectory.std, solution.trajectory.std[:, :9], rtol=1e-9, atol=1e-15
    )


def test_between_rows_it_follows_the_motion(solution):
    """Of every fourth row, what lies between them is that of all rows."""
    few = replace(
        solution,
        trajectory=solution.trajectory.take(slice(None, None, 4)),
        covariance=solution.covariance[::4],
        b_g=solution.b_g[::4],
    )
    inside = (solution.t > 12.0) & (solution.t < 12.9)  # no fix, 20 Hz against 5 Hz
    found = few.at(solution.t[inside]).trajectory
    off = displacement(solution.trajectory.lla[inside], found.lla)
    assert np.abs(off).max() < 0.02
    assert np.abs(solution.trajectory.v_n[inside] - found.v_n).max() < 0.1


def test_the_errors_of_another_point_are_those_of_the_transport(solution):
    """The covariance is J P J' with J by finite differences of position and velocity of the point."""
    k = 300
    moved, own = solution.at([solution.t[k]], ARM), solution.at([solution.t[k]])
    imu, path = solution.recording.imu, own.trajectory
    sample = np.searchsorted(imu.t, solution.t[k])
    omega = imu.dtheta[sample] / imu.dt[sample] - solution.b_g[k]

    def point(x):
        turn = Rotation.from_rotvec(x[6:9]) * path.rotation[0]
        lla = displace_lla(path.lla, (x[:3] + turn.apply(ARM))[None])
        v = path.v_n[0] + x[3:6] + turn.apply(np.cross(omega - x[12:15], ARM))
        return np.r_[displacement(lla, path.lla)[0], v, x[6:9]]

    step = 1e-3
    J = np.array([(point(step * e) - point(-step * e)) / (2 * step) for e in np.eye(15)]).T
    P = J @ solution.covariance[k] @ J.T
    density = solution.meta["noise"]["gyro"]
    S = path.rotation.as_matrix()[0] @ other_instants.cross_matrix(ARM)
    P[3:6, 3:6] += S @ S.T * density**2 / imu.dt[sample]
    size = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert (np.abs(moved.covariance[0] - P) < 1e-5 * size).all()
    np.testing.assert_allclose(
        displacement(moved.trajectory.lla, path.lla)[0],
        path.rotation.apply(ARM)[0],
        atol=1e-6,
    )


def test_the_other_point_is_where_the_truth_has_it(solution):
    """Errors of the moved solution against the moved truth are as large as claimed: NEES of 6 within
    the 99.9 % band of 19 instants a second apart, were they independent (false alarms: 0.1 %)."""
    truth = flight().reference
    t = np.arange(2.0, 20.0)
    rows = np.searchsorted(truth.t, t - 1e-6)
    rate = np.gradient(truth.rotation.as_rotvec(), truth.t, axis=0)  # its size alone is used
    assert np.linalg.norm(rate, axis=1).max() < 5
    before, after = truth.rotation[rows - 1], truth.rotation[rows + 1]
    omega = (before.inv() * after).as_rotvec() / (truth.t[rows + 1] - truth.t[rows - 1])[:, None]
    there = truth.take(rows).displaced(ARM, omega)
    found = solution.at(truth.t[rows], ARM)
    error = np.c_[displacement(there.lla, found.trajectory.lla), there.v_n - found.trajectory.v_n]
    P = found.covariance[:, :6, :6]
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error)
    assert 0.2 < nees.mean() / 6 < 2.5


def test_what_cannot_be_told_is_refused_in_one_line(solution, tmp_path):
    with pytest.raises(DataError, match="times: 21 s is outside the solution, which covers"):
        solution.at([5.0, 21.0])
    with pytest.raises(DataError, match="times: '2024-05-01' is a date, and the clock"):
        solution.at(["2024-05-01"])
    with pytest.raises(DataError, match="lever_arm is .*; it must be 3 finite numbers"):
        solution.at([5.0], [1.0, 2.0])
    solution.save(tmp_path / "a.nc")
    read = sd.read_solution(tmp_path / "a.nc")
    assert len(read.at([5.0]).covariance) == 1
    with pytest.raises(DataError, match="no recording, so its angular rate is not known"):
        read.at([5.0], ARM)


def test_dates_where_the_clock_is_absolute(solution):
    dated = replace(solution, meta={**solution.meta, "epoch": "2024-05-01T12:00:00Z"})
    for when in ("2024-05-01T12:00:05Z", np.datetime64("2024-05-01T12:00:05", "ns")):
        np.testing.assert_array_equal(
            dated.at([when]).trajectory.lla, solution.at([5.0]).trajectory.lla
        )
    assert len(dated.between("2024-05-01T12:00:05Z", 6.0)) == len(solution.between(5.0, 6.0))


def test_without_a_covariance_it_is_that_of_the_standard_deviations(solution):
    found = replace(solution, covariance=None).at([5.0])
    np.testing.assert_allclose(
        found.covariance[0], np.diag(found.trajectory.std[0] ** 2), atol=1e-18
    )


def test_errors_rms_and_files(solution, tmp_path):
    reference = flight().reference
    by_method = solution.errors(reference).rms((5.0, 20.0))
    by_function = sd.rms(sd.errors(solution, reference), (5.0, 20.0))
    np.testing.assert_array_equal(by_method.position, by_function.position)
    np.testing.assert_array_equal(solution.errors().position, solution.errors(reference).position)
    bare = replace(solution, recording=None)
    with pytest.raises(DataError, match="errors: the recording has no reference; give one"):
        bare.errors()
    solution.save(tmp_path / "s.csv")
    assert len(sd.read_solution(tmp_path / "s.csv")) == len(solution)
    flight().save(tmp_path / "r.nc")
    assert len(sd.read(tmp_path / "r.nc")) == len(flight())


def test_a_trajectory_says_what_it_is(solution):
    assert isinstance(solution.at([5.0]).trajectory, Trajectory)


def test_what_is_no_trajectory_is_named(solution):
    with pytest.raises(DataError, match="^errors: reference is .*; it must be a Trajectory"):
        sd.errors(solution, flight())
    with pytest.raises(DataError, match="^errors: trajectory is 'x'; it must be a Trajectory or"):
        sd.errors("x", flight().reference)


def test_what_depends_on_an_unclaimed_state_is_not_claimed(solution):
    """Without a claim on gyro biases the position of another point is still claimed, as with a bias that
    is known; its velocity is not."""
    std_ = solution.trajectory.std.copy()
    known = replace(solution.trajectory, std=np.where(np.arange(15) >= 12, 0.0, std_))
    std_[:, 12:] = np.nan
    bare = replace(solution, covariance=None, trajectory=replace(solution.trajectory, std=std_))
    found = bare.at([5.0], ARM)
    wanted = replace(bare, trajectory=known).at([5.0], ARM)
    np.testing.assert_allclose(found.covariance[0, :3, :3], wanted.covariance[0, :3, :3])
    assert np.isnan(found.trajectory.std[0, 3:6]).all()
    assert np.isfinite(found.trajectory.std[0, [0, 1, 2, 6, 7, 8]]).all()


def test_in_a_gap_nothing_is_claimed(solution):
    keep = (solution.t < 8.0) | (solution.t > 14.0)
    gap = solution.take(keep).at([5.0, 11.0])
    assert np.isfinite(gap.covariance[0]).all() and np.isnan(gap.covariance[1]).all()
    assert np.isnan(gap.trajectory.lla[1]).all()
    with pytest.raises(DataError, match="the solution has one row"):
        solution.take(slice(3, 4)).at([solution.t[3]])
