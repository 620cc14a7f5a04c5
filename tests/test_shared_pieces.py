"""What several modules share: where a recording is, stretches of a mask, running products of
rotations, TOML read with complaints."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation as ScipyRotation, Slerp

from strapdown.alignment.location import GIVEN_STD, place_of
from strapdown.checks import DataError
from strapdown.data.solution import Source
from strapdown.fileio.files import read_toml
from strapdown.geometry.rotation_products import (
    running_matrices,
    slerp,
    turns_between,
    unit,
)
from strapdown.geometry.rotations import Rotation, running_products
from strapdown.preprocessing.stationary import stretches

pytestmark = pytest.mark.short
NAN = np.nan


def fixes(y, kind="position", std=2.0):
    y = np.array(y, float)
    return Source(kind, np.arange(len(y), dtype=float), y, np.full(y.shape, std))


def test_a_given_place_comes_first():
    place = place_of({"place": [0.5, 0.1, 20.0]}, (fixes([[0.7, 0.2, 30.0]]),), 3.0)
    assert (
        place.lla.tolist() == [0.5, 0.1, 20.0]
        and place.std.tolist() == [GIVEN_STD] * 3
        and "given" in place.note
    )
    assert place_of({"place": None}, (fixes([[0.7, 0.2, 30.0]]),)).lla.tolist() == [0.7, 0.2, 30.0]


def test_else_it_is_the_nearest_whole_fix_or_the_first():
    sources = (
        fixes([[1.0, 0.0, 0.0]], "velocity"),
        fixes([[NAN] * 3]),
        fixes(
            [
                [0.7, 0.2, NAN],
                [0.7, 0.2, 31.0],
                [0.7, NAN, 32.0],
                [0.7, 0.2, 33.0],
                [0.7, 0.2, 34.0],
            ],
            std=3.0,
        ),
    )
    heights = [place_of({}, sources, t).lla[2] for t in (-9.0, 0.0, 1.9, 2.1, 3.6, 9.0)]
    assert heights == [31.0, 31.0, 31.0, 33.0, 34.0, 34.0]
    assert place_of({}, sources).lla[2] == 31.0 and place_of({}, sources).std.tolist() == [3.0] * 3
    assert place_of({}, sources[:2]) is None and place_of({}, ()) is None


@given(st.lists(st.booleans(), max_size=30))
def test_stretches_are_the_runs_of_true(mask):
    found = stretches(np.array(mask, bool))
    again = np.zeros(len(mask), bool)
    for first, stop in found:
        assert first < stop and mask[first:stop] == [True] * (stop - first)
        again[first:stop] = True
    assert again.tolist() == mask and (found[1:, 0] > found[:-1, 1]).all()


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 8, 9, 100])
def test_running_products_are_those_one_by_one(n):
    turns = Rotation.from_rotvec(np.random.default_rng(n).standard_normal((n, 3)))
    found, expected = running_products(turns), np.eye(3)
    assert len(found) == n
    for k in range(n):
        expected = expected @ turns[k].as_matrix()
        np.testing.assert_allclose(found[k].as_matrix(), expected, atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 7, 100])
def test_running_matrices_are_the_running_products(n):
    rng = np.random.default_rng(n)  # from no turn at all to several whole ones
    vectors = rng.standard_normal((n, 3)) * 10.0 ** rng.integers(-9, 2, (n, 1))
    vectors[n // 2 :][:1] = 0.0
    expected = running_products(Rotation.from_rotvec(vectors)).as_matrix()
    np.testing.assert_allclose(running_matrices(vectors), expected, atol=1e-13)


@pytest.mark.parametrize(
    "content, message",
    [
        (b"a = ", r"x\.toml: is not TOML: Invalid value"),
        (b"a = '\xff'", r"x\.toml: is not UTF-8 text; save it as UTF-8"),
        (None, r"x\.toml: cannot be read \(No such file or directory\); look there"),
    ],
)
def test_toml_ends_in_a_line(tmp_path, content, message):
    if content is not None:
        (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(DataError, match=message) as caught:
        read_toml(tmp_path / "x.toml", "look there")
    assert "\n" not in str(caught.value)


def test_toml_is_read(tmp_path):
    (tmp_path / "x.toml").write_text("[a]\nb = 'ü'", encoding="utf-8")
    assert read_toml(str(tmp_path / "x.toml"), "") == {"a": {"b": "ü"}}


def random_quaternions(n, seed):
    """(n, 4), scalar first, of either sign."""
    q = ScipyRotation.random(n, random_state=seed).as_quat()[:, [3, 0, 1, 2]]
    return q * np.where(np.arange(n) % 2, -1, 1)[:, None]


def rotations(q):
    return ScipyRotation.from_quat(q[:, [1, 2, 3, 0]])


def test_turns_between_quaternions_are_those_of_scipy():
    p, q = random_quaternions(500, 1), random_quaternions(500, 2)
    p[0], p[1] = q[0], -q[1]  # no turn
    p[2] = [-q[2, 1], q[2, 0], -q[2, 3], q[2, 2]]  # half a turn, about x
    found, expected = turns_between(p, q), (rotations(p) * rotations(q).inv()).as_rotvec()
    assert np.abs(found[2]).tolist() == pytest.approx([np.pi, 0, 0], abs=1e-12)
    found[2] = expected[2]  # of either sign
    assert found == pytest.approx(expected, abs=1e-12)
    tiny = ScipyRotation.from_rotvec(np.full((1, 3), 1e-13)).as_quat()[:, [3, 0, 1, 2]]
    assert turns_between(tiny, np.array([[1.0, 0, 0, 0]])) == pytest.approx(1e-13, rel=1e-6)


def test_slerp_is_that_of_scipy():
    q, rng = random_quaternions(300, 3), np.random.default_rng(3)
    q[7] = q[6]  # nothing between them
    left, share = rng.integers(0, 299, 2000), rng.uniform(0, 1, 2000)
    left[:3], share[:2] = 6, [0.0, 1.0]
    found = slerp(q, left, share)
    away = rotations(found) * Slerp(np.arange(300), rotations(q))(left + share).inv()
    assert away.magnitude().max() < 1e-12
    assert np.linalg.norm(found, axis=1) == pytest.approx(1, abs=1e-12)


def test_a_quaternion_of_no_size_has_no_direction():
    assert unit(np.array([[0.0, 0, 3, 4], [0, 0, 0, 0], [NAN, 1, 0, 0]])) == pytest.approx(
        np.array([[0, 0, 0.6, 0.8], [NAN] * 4, [NAN] * 4]), nan_ok=True
    )
