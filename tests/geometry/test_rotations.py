"""Rotations against those of scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation, Slerp

from strapdown.geometry.rotations import Rotation, RotationPath

pytestmark = pytest.mark.short
LAST = [1, 2, 3, 0]
HALF = np.pi / 2
STEEP = [[0.0, HALF, 0.5], [0.3, -HALF, 0.5], [0.3, HALF - 1e-6, -3.0], [-3.1, 1e-6 - HALF, 3.1]]


def vectors(n, seed):
    """From no turn at all to several whole ones."""
    rng = np.random.default_rng(seed)
    found = rng.standard_normal((n, 3)) * 10.0 ** rng.integers(-9, 2, (n, 1))
    found[:1] = 0.0
    return found


def of_scipy(rotation):
    return ScipyRotation.from_quat(rotation.as_wxyz()[..., LAST])


def test_each_form_is_made_and_told_as_scipy_does():
    r = vectors(400, 1)
    ours, theirs = Rotation.from_rotvec(r), ScipyRotation.from_rotvec(r)
    assert (of_scipy(ours) * theirs.inv()).magnitude() == pytest.approx(0, abs=1e-14)
    matrices = theirs.as_matrix()
    assert ours.as_matrix() == pytest.approx(matrices, abs=1e-14)
    off = of_scipy(Rotation.from_matrix(matrices)) * theirs.inv()
    assert off.magnitude() == pytest.approx(0, abs=1e-14)
    assert ours.as_rotvec() == pytest.approx(theirs.as_rotvec(), abs=1e-12)
    assert ours.as_rph() == pytest.approx(theirs.as_euler("ZYX")[:, ::-1], abs=1e-12)
    angles = np.random.default_rng(2).uniform(-7, 7, (400, 3))
    off = (
        of_scipy(Rotation.from_rph(angles)) * ScipyRotation.from_euler("ZYX", angles[:, ::-1]).inv()
    )
    assert off.magnitude() == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize(
    "turn", [[0, 0, 0], [np.pi, 0, 0], [0, np.pi, 0], [0, 0, np.pi], [2, 2, -1]]
)
def test_a_matrix_tells_its_rotation_whatever_the_largest_component(turn):
    expected = ScipyRotation.from_rotvec(turn)
    found = Rotation.from_matrix(expected.as_matrix())
    assert found.as_wxyz().shape == (4,)
    assert (of_scipy(found) * expected.inv()).magnitude() == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize("rph", STEEP)
def test_angles_tell_the_rotation_also_near_the_vertical(rph):
    turn = Rotation.from_rph(rph)
    again = Rotation.from_rph(turn.as_rph())
    assert (turn * again.inv()).as_rotvec() == pytest.approx(0, abs=1e-9)
    assert np.abs(turn.as_rph()).max() <= np.pi


def test_products_inverses_and_vectors_are_those_of_scipy():
    p, q = Rotation.from_rotvec(vectors(50, 3)), Rotation.from_rotvec(vectors(50, 4))
    assert (p * q.inv()).as_matrix() == pytest.approx(
        p.as_matrix() @ np.swapaxes(q.as_matrix(), 1, 2), abs=1e-14
    )
    one, v = p[7], np.random.default_rng(5).standard_normal((50, 3))
    assert (one * q).as_matrix() == pytest.approx(one.as_matrix() @ q.as_matrix(), abs=1e-14)
    assert p.apply(v) == pytest.approx(of_scipy(p).apply(v), abs=1e-13)
    assert p.apply([1, 0, 2]) == pytest.approx(of_scipy(p).apply([1, 0, 2]), abs=1e-13)
    assert one.apply(v) == pytest.approx(of_scipy(one).apply(v), abs=1e-13)
    assert one.apply([1, 0, 2]).shape == (3,)


def test_a_quaternion_of_any_length_counts_and_zero_gives_nan():
    assert Rotation.from_wxyz([2.0, 0, 0, 0]).as_wxyz().tolist() == [1, 0, 0, 0]
    assert np.isnan(Rotation.from_wxyz(np.zeros((1, 4))).as_wxyz()).all()
    assert len(Rotation.from_wxyz(np.empty((0, 4))).as_matrix()) == 0


def test_a_path_turns_as_that_of_scipy_and_ends_where_it_ends():
    t, rng = np.cumsum(np.random.default_rng(6).uniform(0.1, 1, 60)), np.random.default_rng(7)
    turns = Rotation.from_rotvec(rng.standard_normal((60, 3)))
    at = np.r_[t[0], t[-1], t[5], rng.uniform(t[0], t[-1], 200)]
    path = RotationPath(t, turns)
    off = of_scipy(path(at)) * Slerp(t, of_scipy(turns))(at).inv()
    assert off.magnitude() == pytest.approx(0, abs=1e-13)
    assert len(path(np.empty(0))) == 0
    with pytest.raises(ValueError, match="times must be within"):
        path(at + 0.1)
