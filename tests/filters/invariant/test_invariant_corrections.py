"""One correction of the filters on the group against 5x5 matrices, and its adjoint against dense ones."""

import numpy as np
import pytest
from recordings import flight, start
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation
from test_group_errors import algebra, pose, skew

from strapdown import aiding
from strapdown.core.loop.contract import Noise, compile_kernel
from strapdown.core.mathematics.smoother import work_size
from strapdown.core.mathematics.source import IN_BODY, IN_N, new_source
from strapdown.filters.invariant.adjoint_change import SMOOTHER
from strapdown.filters.invariant.composed import CHANGE
from strapdown.filters.invariant.eqf import EQF
from strapdown.filters.invariant.iekf import IEKF, NOT_OF_THE_POSE
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
STD = np.array([0.5, 0.7, 0.9])
LEFT, RIGHT = "left", "right"


def correlated(n, seed):
    root = np.random.default_rng(seed).standard_normal((n, n))
    return root @ root.T / n + np.eye(n)


def begun(filter, n=15, **options):
    """A belief with n states and a full P, biases among them."""
    begin = start(flight())._replace(
        v_n=(30.0, -4.0, 2.0), b_a=(0.1, -0.2, 0.3), b_g=(0.02, 0.01, -0.03), std=(1.0,) * n
    )
    belief = filter.start(begin, NOISE, **options)
    belief.P[...] = 0.1 * correlated(n, 1)
    return belief


def corrected(filter, belief, kind, y, axes):
    """The NIS of a fix of that kind."""
    sensor = aiding.find(kind)
    for kernel in (filter.correct, sensor.observe):
        compile_kernel(kernel)
    source = new_source(pose_axes=axes)
    number, innovation = aiding.number(kind), np.zeros(12)
    return filter.correct(
        belief, np.array(y), STD, number, sensor.observe, source, np.inf, innovation
    )


def copied(belief):
    return belief._replace(**{name: np.copy(value) for name, value in belief._asdict().items()})


def gain(P, H, e, R):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return K @ e, (np.eye(len(P)) - K @ H) @ P


def left_out(A, B):
    """The covariance of theta x e / 2, independent of each other: its trace, over two directions."""
    return np.eye(3) * (np.trace(A) * np.trace(B) - np.trace(A @ B)) / 8


def row_matrix(side, C, v, p, b_a, b_g, biases):
    """T, (15, 15)."""
    T = np.eye(15)
    if side == LEFT:
        T[:9, :9] = block_diag(C.T, C.T, C.T)
        if biases:
            T[9:12, 6:9], T[12:, 6:9] = -skew(b_a) @ C.T, -skew(b_g) @ C.T
        return T
    T[:3, 6:9], T[3:6, 6:9] = skew(p), skew(v)
    if biases:
        T[9:12, 9:12], T[12:, 12:], T[9:12, 12:] = C, C, skew(v) @ C
    return T


def ad(c):
    """ad(c) of SE_2(3), c = (p, v, theta)."""
    p, v, theta = skew(c[:3]), skew(c[3:6]), skew(c[6:9])
    M = block_diag(theta, theta, theta)
    M[:3, 6:9], M[3:6, 6:9] = p, v
    return M


def reset(side, c):
    """The Jacobian of what is left of c + e after exp(c), by scipy: the block of exp [[A, 1], [0, 0]]."""
    A = ad(c) if side == RIGHT else -ad(c)
    J = expm(np.block([[A, np.eye(9)], [np.zeros((9, 18))]]))[:9, 9:]
    return block_diag(J, np.eye(6))


CASES = [
    (IEKF, "velocity", IN_N, LEFT, {}),
    (IEKF, "velocity", IN_N, LEFT, {"form": "published"}),
    (IEKF, "velocity", IN_N, LEFT, {"form": "published", "biases": "two-frame"}),
    (IEKF, "body-velocity", IN_BODY, RIGHT, {}),
    (IEKF, "body-velocity", IN_BODY, RIGHT, {"form": "published", "biases": "two-frame"}),
    (EQF, "velocity", IN_N, RIGHT, {}),
    (EQF, "velocity", IN_N, RIGHT, {"form": "published"}),
    (EQF, "body-velocity", IN_BODY, RIGHT, {"form": "published"}),
]


@pytest.mark.parametrize("filter, kind, axes, side, options", CASES)
@pytest.mark.parametrize("n", [15, 17])
def test_a_correction_is_that_of_the_textbook(filter, kind, axes, side, options, n):
    belief = begun(filter, n, **options)
    C, v, b_a, b_g, P = (
        np.copy(a) for a in (belief.C_nb, belief.v_n, belief.b_a, belief.b_g, belief.P)
    )
    lla, first = belief.lla.copy(), options.get("form") == "published"
    in_group = first and (filter is EQF or "biases" in options)
    y = np.array([27.0, -1.0, 3.5]) if axes == IN_N else C.T @ v + [1.0, -2.0, 0.5]
    H, e = np.zeros((3, n)), y - v if axes == IN_N else y - C.T @ v
    H[:, 3:6] = np.eye(3) if axes == IN_N else C.T
    H[:, 6:9] = 0 if axes == IN_N else C.T @ skew(v)
    R = np.diag(STD**2)
    if not first:
        to_axes = np.eye(3) if axes == IN_N else C.T
        R = R + left_out(to_axes @ P[6:9, 6:9] @ to_axes.T, H[:, :9] @ P[:9, :9] @ H[:, :9].T)
    if not first or filter is EQF:
        told = e if first else H[:, :9] @ gain(P, H, e, R)[0][:9]
        H[:, 6:9] += -skew(told) / 2 if axes == IN_N else skew(told) @ C.T / 2
    dx, P = gain(P, H, e, R)
    T = row_matrix(side, C, v, np.zeros(3), b_a, b_g, in_group)
    c = T @ dx[:15]
    step = expm(algebra(c[:9]))
    chi = pose(C, v, np.zeros(3)) @ step if side == LEFT else step @ pose(C, v, np.zeros(3))
    if in_group and side == LEFT:
        back = Rotation.from_rotvec(-c[6:9]).as_matrix()
        b_a, b_g = back @ b_a + c[9:12], back @ b_g + c[12:]
    else:
        b_a, b_g = b_a + dx[9:12], b_g + dx[12:15]
    now = row_matrix(side, chi[:3, :3], chi[:3, 3], chi[:3, 4], b_a, b_g, in_group)
    M = np.linalg.inv(now) @ (np.eye(15) if first else reset(side, c)) @ T
    A = block_diag(M, np.eye(n - 15))

    assert corrected(filter, belief, kind, y, axes) > 0.1
    assert np.degrees(np.linalg.norm(dx[6:9])) > 1
    np.testing.assert_allclose(belief.C_nb, chi[:3, :3], atol=1e-9)
    np.testing.assert_allclose(belief.v_n, chi[:3, 3], atol=1e-9)
    np.testing.assert_allclose(displacement(belief.lla[None], lla[None])[0], chi[:3, 4], atol=1e-4)
    np.testing.assert_allclose([belief.b_a, belief.b_g], [b_a, b_g], atol=1e-9)
    np.testing.assert_allclose(belief.augmented, dx[15:], atol=1e-9)
    np.testing.assert_allclose(belief.P, A @ P @ A.T, atol=1e-5)
    assert np.array_equal(belief.P, belief.P.T)


@pytest.mark.parametrize("filter", [IEKF, EQF])
def test_a_fix_beyond_its_gate_leaves_the_estimate(filter):
    belief = begun(filter)
    before, sensor = copied(belief), aiding.find("velocity")
    compile_kernel(filter.correct)
    nis = filter.correct(
        belief,
        np.array([90.0, 0.0, 0.0]),
        STD,
        aiding.number("velocity"),
        sensor.observe,
        new_source(pose_axes=IN_N),
        10.0,
        np.zeros(12),
    )
    assert nis > 10
    for name in ("lla", "v_n", "C_nb", "b_a", "b_g", "P"):
        assert np.array_equal(getattr(belief, name), getattr(before, name)), name


@pytest.mark.parametrize("axes", [IN_N, IN_BODY])
def test_half_way_what_a_linear_model_leaves_out_is_of_third_order(axes):
    """y of the moved pose less h and H c, with H half way: an eighth where c is half as large; a
    quarter without."""
    rng = np.random.default_rng(3)
    C = Rotation.random(random_state=1).as_matrix()
    v, direction = 10 * rng.normal(size=3), rng.normal(size=6)
    left_out = []
    for size in (0.1, 0.05):
        c = size * np.concatenate([np.zeros(3), direction])
        chi = pose(C, v, np.zeros(3))
        moved = chi @ expm(algebra(c)) if axes == IN_N else expm(algebra(c)) @ chi
        if axes == IN_N:
            delta = np.concatenate([C @ c[3:6], C @ c[6:9]])
            e, H = moved[:3, 3] - v, np.hstack([np.eye(3), np.zeros((3, 3))])
            more = -skew(e) / 2
        else:
            delta = np.concatenate([c[3:6] - np.cross(v, c[6:9]), c[6:9]])
            e = moved[:3, :3].T @ moved[:3, 3] - C.T @ v
            H, more = np.hstack([C.T, C.T @ skew(v)]), skew(e) @ C.T / 2
        plain = np.linalg.norm(e - H @ delta)
        H[:, 3:] += more
        left_out.append((plain, np.linalg.norm(e - H @ delta)))
    (first, third), (half_first, half_third) = left_out
    assert half_first == pytest.approx(first / 4, rel=0.15)
    assert half_third == pytest.approx(third / 8, rel=0.15)
    assert third < 0.1 * first


def test_what_is_left_out_is_a_variance():
    """Of 200 000 draws of theta and e, to 2 %."""
    rng, A, B = np.random.default_rng(6), correlated(3, 7), correlated(3, 8)
    theta, e = (rng.multivariate_normal(np.zeros(3), each, 200_000) for each in (A, B))
    drawn = np.square(0.5 * np.cross(theta, e)).sum(axis=1).mean()
    assert 2 * left_out(A, B)[0, 0] == pytest.approx(drawn, rel=0.02)


@pytest.mark.parametrize("missing", [(), (2,), (0, 1)])
def test_both_sides_are_one_filter(missing):
    """To second order it does not matter on which side the error stands, also where components are
    missing, after a correction by some ten degrees."""
    y = np.array([27.0, -1.0, 3.5])
    y[list(missing)] = np.nan
    found = [begun(filter) for filter in (IEKF, EQF)]
    for filter, belief in zip((IEKF, EQF), found):
        corrected(filter, belief, "velocity", y, IN_N)
    one, two = found
    turned = Rotation.from_matrix(one.C_nb @ begun(IEKF).C_nb.T).magnitude()
    assert np.degrees(turned) > 1
    for name in ("lla", "v_n", "C_nb", "b_a", "b_g", "P"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), atol=2e-3, err_msg=name)


def test_it_does_not_depend_on_where_north_is():
    """The same world turned by 45 deg about the vertical: the same correction, turned."""
    turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 4]).as_matrix()
    y, found = np.array([27.0, -1.0, 3.5]), []
    for R in (np.eye(3), turn):
        belief = begun(IEKF)
        A = block_diag(R, R, R, np.eye(6))
        belief.C_nb[...], belief.v_n[...] = R @ belief.C_nb, R @ belief.v_n
        belief.P[...] = A @ belief.P @ A.T
        sensor = aiding.find("velocity")
        source, number = new_source(pose_axes=IN_N), aiding.number("velocity")
        same = np.full(3, 0.7)
        IEKF.correct(belief, R @ y, same, number, sensor.observe, source, np.inf, np.zeros(12))
        found.append((R.T @ belief.C_nb, R.T @ belief.v_n, A.T @ belief.P @ A))
    for one, two in zip(*found):
        np.testing.assert_allclose(one, two, atol=1e-6)


@pytest.mark.parametrize("n", [15, 17])
def test_the_adjoint_of_a_correction_undoes_its_change_first(n):
    for kernel in (SMOOTHER.save_step, SMOOTHER.adjoint_step):
        compile_kernel(kernel)
    belief = begun(IEKF, n)
    corrected(IEKF, belief, "velocity", [27.0, -1.0, 3.5], IN_N)
    record = np.full(SMOOTHER.width(n), np.nan)
    SMOOTHER.save_step(belief, record)
    M = np.array(belief.workspace[CHANGE : CHANGE + 225]).reshape(15, 15)
    assert np.abs(M - np.eye(15)).max() > 0.01
    plain = record.copy()
    plain[-225:] = np.eye(15).ravel()  # the same correction without its change
    lam, Lam = np.random.default_rng(2).standard_normal(n), correlated(n, 3)
    A = block_diag(M, np.eye(n - 15))
    found = lam.copy(), Lam.copy()
    expected = A.T @ lam, A.T @ Lam @ A
    SMOOTHER.adjoint_step(record, *found, np.full(work_size(n, n), np.nan))
    SMOOTHER.adjoint_step(plain, *expected, np.zeros(work_size(n, n)))
    for one, two in zip(found, expected):
        np.testing.assert_allclose(one, two, atol=1e-11)


def test_each_kind_says_in_which_axes_it_is_of_the_pose():
    """What is there in n, in the body, and neither."""
    in_n = {"position", "velocity", "zero-velocity", "altitude", "baseline", "gravity", "depth"}
    in_body = {"magnetic-field", "body-velocity", "speed", "true-airspeed", "beam-velocity"}
    neither = {*NOT_OF_THE_POSE, "zero-angular-rate"}
    assert neither == {kind for kind in aiding.own_names() if not aiding.find(kind).pose_axes}
    for kinds, axes in ((in_n, "n"), (in_body, "b"), (neither, "")):
        assert {aiding.find(kind).pose_axes for kind in kinds} == {axes}
