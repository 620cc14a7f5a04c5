"""The chapter's Euler-angle filters as printed: their Jacobians against the nonlinear model, the
covariance of the angles against that of rotations, and what becomes of it at a pitch of 90 deg."""

import numpy as np
import pytest
from recordings import flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown_reproductions.fossen import printed_filters
from strapdown_reproductions.fossen.printed_filters import DIRECT, INDIRECT, SLOTS

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
RATE, FORCE = np.array([0.3, -0.5, 0.4]), np.array([1.0, -2.0, -8.0])


def R(angles):
    return Rotation.from_euler("ZYX", angles[::-1]).as_matrix()


def T(angles):
    (s, _), (c, cp), t = np.sin(angles[:2]), np.cos(angles[:2]), np.tan(angles[1])
    return np.array([[1, s * t, c * t], [0, c, -s], [0, s / cp, c / cp]])


def model(x):
    """x' of the chapter on a flat Earth without gravity, which no derivative sees; in the order of
    the library."""
    p, v, angles, b_a, b_g = x.reshape(5, 3)
    return np.r_[
        v,
        R(angles) @ (FORCE - b_a),
        T(angles) @ (RATE - b_g),
        -NOISE.accel_decay * b_a,
        -NOISE.gyro_decay * b_g,
    ]


def jacobian(filter, angles, b_a, b_g, **options):
    """F that the kernel makes of the state."""
    compile_kernel(filter.predict)
    begin = InitialState(
        0.0, (1.1, 0.2, 0.0), (0.0,) * 3, tuple(angles), tuple(b_a), tuple(b_g), (1.0,) * 15
    )
    belief = filter.begin(begin, NOISE, **options)
    filter.predict(belief, 1e-9 * np.r_[RATE, FORCE], 1e-9, NOISE)
    return SLOTS.views(belief.workspace)["F"].reshape(15, 15)


@pytest.mark.short
@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.4, -0.7, 2.0), (-2.5, 1.2, -1.0)])
@pytest.mark.parametrize("filter, options", [(DIRECT, {}), (INDIRECT, {"errors": "corrected"})])
def test_F_is_the_derivative_of_the_model_by_the_angles(filter, options, angles):
    b_a, b_g, h = np.array([0.1, 0.3, -0.1]), np.array([0.05, 0.1, -0.05]), 1e-6
    x = np.r_[np.zeros(6), angles, b_a, b_g]
    slope = np.stack([(model(x + h * e) - model(x - h * e)) / (2 * h) for e in np.eye(15)], axis=1)
    options = options | {"bias": "decaying"}
    np.testing.assert_allclose(jacobian(filter, angles, b_a, b_g, **options), slope, atol=1e-7)


@pytest.mark.short
def test_the_printed_indirect_errors_are_those_of_a_rotation_in_the_body():
    """A = [.. -R, -R S(f); -I, -S(w)]: right for a rotation, but added to the angles."""
    S = lambda a: np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    angles, b_a, b_g = (0.4, -0.7, 2.0), np.array([0.1, 0.3, -0.1]), np.array([0.05, 0.1, -0.05])
    found = jacobian(INDIRECT, angles, b_a, b_g, bias="decaying")
    np.testing.assert_allclose(found[3:6, 6:9], -R(angles) @ S(FORCE - b_a), atol=1e-12)
    np.testing.assert_allclose(found[3:6, 9:12], -R(angles), atol=1e-12)
    np.testing.assert_allclose(found[6:9, 6:9], -S(RATE - b_g), atol=1e-12)
    np.testing.assert_allclose(found[6:9, 12:], -np.eye(3), atol=1e-12)


def test_far_from_the_vertical_it_is_the_closed_loop_to_first_order():
    """P of the angles, published as that of rotations."""
    recording = flight()
    own = [a for a in recording.sources if a.kind in printed_filters.KINDS]
    bare = sd.Recording(
        recording.imu,
        tuple(a.__class__(a.kind, a.t, a.y, a.std, gate=np.inf, name=a.name) for a in own),
        recording.reference,
        {},
    )
    begin = start(recording)
    both = [
        sd.fuse(bare, filter, start=begin, noise=NOISE, options={"bias": "decaying"})
        for filter in (DIRECT, "closed-loop")
    ]
    ours, theirs = (solution.trajectory for solution in both)
    assert np.abs(ours.std[-1] / theirs.std[-1] - 1).max() < 0.03
    apart = (ours.rotation * theirs.rotation.inv()).as_rotvec()
    assert np.abs(apart / theirs.std[:, 6:9]).max() < 0.3


@pytest.mark.short
@pytest.mark.parametrize("filter", [DIRECT, INDIRECT])
def test_it_comes_through_the_door_for_filters_from_outside(filter):
    filters.check(filter)
    with pytest.raises(DataError, match=f"filter '{filter.name}': .* lever arm, which its printed"):
        sd.fuse(sd.simulate("car", 5.0, seed=901), filter, imu="consumer")
    with pytest.raises(
        DataError, match="errors is 'wrong'.*; it must be one of corrected, printed"
    ):
        bare = sd.Recording(flight().imu, (), flight().reference, {})
        sd.fuse(bare, INDIRECT, start=start(flight()), noise=NOISE, options={"errors": "wrong"})
