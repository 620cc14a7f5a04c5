"""The covariance of the errors that the two stages leave: what their kernels do to small errors, by
running them; what of it is shared between corrections; the published one as an option."""

import numpy as np
import pytest
from recordings import flight, start as begin_at
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding, filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState, Kind, Noise, compile_kernel
from strapdown.core.mathematics.source import new_source
from strapdown.filters.two_stage.joseph_covariance import AUXILIARY, step
from strapdown.geometry.geodesy import displace_lla, displacement

EKF = filters.find("two-stage-ekf")
QUIET = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
STD = np.repeat([1.0, 0.3, 0.02, 0.05, 1e-3], 3)
SMALL = np.repeat([1e-2, 1e-3, 1e-5, 1e-4, 1e-6], 3)
SAMPLE = np.array(
    [0.0, 0.0, 6e-4, 0.0, 0.02343, -0.19616]
)  # a flat turn, whose course is the heading
KINDS = {Kind.POSITION: "position", Kind.VELOCITY: "velocity", Kind.HEADING: "heading"}


def begun(error):
    """A filter whose errors against that without any are `error` (15,), its gains the same."""
    p, v, theta, b_a, b_g = error.reshape(5, 3)
    C = Rotation.from_euler("ZYX", [0.6947, 0.0, 0.0])
    lla = displace_lla(np.array([0.8, 0.1, 500.0]), -p)
    rph = (Rotation.from_rotvec(-theta) * C).as_euler("ZYX")[::-1]
    v_n = np.array([30.0, 25.0, 0.0]) - v
    at = InitialState(0.0, tuple(lla), tuple(v_n), tuple(rph), tuple(-b_a), tuple(-b_g), tuple(STD))
    return EKF.start(at, QUIET, crab=2.0)


def fly(belief, truth, kinds, seconds=4):
    """A turn at 50 Hz with fixes at the end of each second, exactly as the belief `truth` has them,
    which flies along; velocities fail from the third second on, so that gravity levels alone."""
    for second in range(seconds):
        for _ in range(50):
            for each in (truth, belief):
                EKF.predict(each, SAMPLE, 0.02, QUIET)
        for kind in kinds:
            if kind != Kind.VELOCITY or second < 2:
                y = {
                    Kind.POSITION: truth.lla,
                    Kind.VELOCITY: truth.v_n,
                    Kind.HEADING: np.r_[np.arctan2(truth.C_nb[1, 0], truth.C_nb[0, 0]), 0, 0],
                }[kind].copy()
                for each in (truth, belief):
                    correct(each, kind, y)
    step(belief)


def correct(belief, kind, y):
    source = new_source()
    source["kind"] = kind
    observe = aiding.find(KINDS[kind]).observe
    std = np.full(3, 0.02 if kind == Kind.HEADING else 0.5)
    EKF.correct(belief, y, std, kind, observe, source, np.inf, np.zeros(12))


def error_of(belief, truth):
    turned = Rotation.from_matrix(truth.C_nb) * Rotation.from_matrix(belief.C_nb).inv()
    parts = (
        truth.v_n - belief.v_n,
        turned.as_rotvec(),
        truth.b_a - belief.b_a,
        truth.b_g - belief.b_g,
    )
    return np.concatenate([displacement(truth.lla, belief.lla), *parts])


@pytest.mark.short
@pytest.mark.parametrize(
    "kinds",
    [(Kind.POSITION, Kind.VELOCITY), (Kind.POSITION, Kind.HEADING)],
    ids=["course", "heading"],
)
def test_it_is_what_the_kernels_do_to_small_errors(kinds):
    """P of a start P0 minus that of a start without errors is Phi P0 Phi', Phi by runs of which each
    has one error more, under gains that are the same."""
    for kernel in (EKF.predict, EKF.correct, *(aiding.find(KINDS[k]).observe for k in kinds)):
        compile_kernel(kernel)
    moved = []
    for error in np.diag(SMALL):
        both = []
        for sign in (1, -1):
            belief, truth = begun(sign * error), begun(np.zeros(15))
            fly(belief, truth, kinds)
            both.append(error_of(belief, truth))
        moved.append((both[0] - both[1]) / 2)
    Phi = np.array(moved).T / SMALL
    P = []
    for size in (0.0, 1.0):
        belief, truth = begun(np.zeros(15)), begun(np.zeros(15))
        belief.P[:] = size * np.diag(STD**2)
        fly(belief, truth, kinds)
        P.append(belief.P.copy())
    expected = Phi @ np.diag(STD**2) @ Phi.T
    scale = np.sqrt(np.diag(expected))
    worst = np.abs((P[1] - P[0] - expected) / np.outer(scale, scale)).max()
    assert worst < 0.05, worst


@pytest.mark.parametrize("name", ["two-stage-ekf", "xkf-two-stage"])
def test_it_changes_no_estimate_while_no_fix_is_refused(name):
    """Gains are those of the published covariance: P of the errors only says what they leave."""
    recording = flight(20.0, 20.0)
    own, published = (
        sd.fuse(
            recording,
            name,
            start=begin_at(recording),
            covariance=True,
            options={"covariance": which},
        )
        for which in ("joseph", "published")
    )
    assert own.counts() == published.counts() and not any(n for _, n in own.counts().values())
    np.testing.assert_array_equal(own.trajectory.lla, published.trajectory.lla)
    np.testing.assert_array_equal(own.trajectory.rph, published.trajectory.rph)
    across = np.ix_(range(6, 9), range(3, 6))
    assert (
        np.abs(own.covariance[-1][across]).max() > 0 and not published.covariance[-1][across].any()
    )


def test_scale_factors_of_the_grade_are_states_and_are_learnt():
    recording = sd.simulate(sd.scenario("demo"), 120.0, "dmu10", seed=3)
    solution = sd.fuse(recording, "two-stage-ekf", covariance=True)
    assert solution.covariance.shape[1] > 15
    first, last = solution.covariance[0], solution.covariance[-1]
    assert (np.diag(last)[15:] < np.diag(first)[15:]).sum() >= 6
    assert np.linalg.eigvalsh(last)[0] > 0


def test_bad_options_and_too_many_states():
    recording = flight()
    with pytest.raises(DataError, match="covariance.*joseph"):
        sd.fuse(recording, "two-stage-ekf", options={"covariance": "exact"})
    std = (0.1,) * (46 - AUXILIARY)
    at = InitialState(0.0, (0.8, 0.1, 0.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, std)
    with pytest.raises(ValueError, match="too many"):
        EKF.start(at, QUIET)
