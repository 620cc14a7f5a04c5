"""Motions through the rows of a trajectory: exact at the rows, close to the motion they were
taken from, and analytic."""

import pickle

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.sim.splined import residual, spline_motion
from strapdown.sim.trajectory import demo_flight, increments, records, sample

T = np.arange(0.0, 20.0 + 1e-9, 0.05)
TRUTH = sample(demo_flight(), T)


def thinned(trajectory, every):
    return Trajectory(*(getattr(trajectory, name)[::every] for name in ("t", "lla", "v_n", "q_nb")))


@pytest.mark.short
def test_at_the_rows_velocity_and_attitude_are_those_of_the_trajectory():
    position, velocity, turn = residual(spline_motion(TRUTH), TRUTH)
    assert np.abs(velocity).max() < 1e-11 and np.abs(turn).max() < 1e-12
    assert np.abs(position).max() < 1e-6  # the spline's integral, not its rows


@pytest.mark.short
def test_between_the_rows_it_converges_to_the_motion_they_were_taken_from():
    """The sixth power of the row's length, by which halving gains a factor of 64."""
    errors = []
    for every in (8, 4):
        _, velocity, turn = residual(spline_motion(thinned(TRUTH, every)), thinned(TRUTH, 1))
        inside = slice(80, -80)  # the ends are one order poorer
        errors.append((np.abs(velocity[inside]).max(), np.abs(turn[inside]).max()))
    assert np.all(np.array(errors[1]) < np.array(errors[0]) / 25)
    assert errors[1][1] < 2e-5


@pytest.mark.short
def test_increments_are_those_of_the_motion_it_was_taken_from():
    t = np.arange(0.0, 15.0 + 1e-9, 0.01)
    right, made = increments(demo_flight(), t), increments(spline_motion(TRUTH), t)
    some = slice(100, None)  # past the spline's end condition
    assert np.abs((made.dtheta - right.dtheta)[some]).max() / 0.01 < 1e-5  # rad/s
    assert np.abs((made.dv - right.dv)[some]).max() / 0.01 < 1e-4  # m/s^2


@pytest.mark.short
def test_heading_may_go_through_north_and_time_may_begin_anywhere():
    turning = TRUTH.t * 0.5
    q = np.c_[np.cos(turning / 2), 0 * turning, 0 * turning, np.sin(turning / 2)]
    motion = spline_motion(Trajectory(TRUTH.t + 1000.0, TRUTH.lla, TRUTH.v_n, q))
    assert motion.end == pytest.approx(20.0)
    truth, imu = records(motion, np.arange(0.0, 20.0, 0.01))
    assert np.abs(imu.dtheta[:, 2] / 0.01 - 0.5).max() < 1e-3  # the Earth's rate remains


@pytest.mark.short
def test_real_times_and_complex_ones_agree_and_it_can_be_pickled():
    motion = pickle.loads(pickle.dumps(spline_motion(TRUTH)))
    t = np.array([[0.0, 0.03], [7.77, 20.0]])
    for function in (motion.velocity, motion.attitude):
        real, complex_ = np.array(function(t)), np.array(function(t + 1e-20j))
        assert real.shape == (3, 2, 2) and np.array_equal(real, complex_.real)
        slope = (np.array(function(t + 1e-5)) - np.array(function(t - 1e-5))) / 2e-5
        assert np.allclose(complex_.imag / 1e-20, slope, rtol=1e-6, atol=1e-7)


@pytest.mark.short
@pytest.mark.parametrize(
    "change, words",
    [
        ({"v_n": None}, "no velocity"),
        ({"q_nb": None}, "no attitude"),
        ({"t": TRUTH.t[::-1]}, "does not increase at row 1"),
        ({"lla": np.where(np.arange(len(T))[:, None] == 7, np.nan, TRUTH.lla)}, "row 7"),
    ],
)
def test_what_is_no_motion_is_refused(change, words):
    with pytest.raises(DataError, match=words):
        spline_motion(
            Trajectory(
                **{"t": TRUTH.t, "lla": TRUTH.lla, "v_n": TRUTH.v_n, "q_nb": TRUTH.q_nb, **change}
            )
        )


@pytest.mark.short
def test_a_loop_and_rows_too_far_apart_are_refused():
    t = TRUTH.t
    still = {"t": t, "lla": TRUTH.lla, "v_n": TRUTH.v_n}
    for rate, axis, words in (
        (0.3, 2, "pitch is 85.[0-9] deg at row 9[0-9] .* hold up to 85 deg"),
        (40.0, 1, "by more than 90 deg between rows 0 and 1 "),
    ):
        q = np.zeros((len(t), 4))
        q[:, 0], q[:, axis] = np.cos(rate * t / 2), np.sin(rate * t / 2)
        with pytest.raises(DataError, match=words):
            spline_motion(Trajectory(**still, q_nb=q))
    with pytest.raises(DataError, match="row 3 .* has no attitude"):
        spline_motion(
            Trajectory(**still, q_nb=np.where(np.arange(len(t))[:, None] == 3, 0.0, TRUTH.q_nb))
        )


@pytest.mark.short
def test_too_few_rows_and_too_long_a_flight_are_refused():
    with pytest.raises(DataError, match="5 rows"):
        spline_motion(Trajectory(TRUTH.t[:5], TRUTH.lla[:5], TRUTH.v_n[:5], TRUTH.q_nb[:5]))
    with pytest.raises(DataError, match="ends at 20 s"):
        sample(spline_motion(TRUTH), np.array([0.0, 21.0]))
