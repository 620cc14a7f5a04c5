"""What published formulas for attitude get wrong (docs/how-to/static-attitude.md, "What differs from
print"), and that strapdown does not; a test per finding.

The printed forms are those of the Marine Systems Simulator's acc2rollpitch.m, staticRollPitchYaw.m,
ins_mekf.m, ins_mekf_psi.m and ins_euler.m, which stand for the equations of Fossen (2021) chapter
14.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding
from strapdown.alignment.static_attitude import level, static_attitude
from strapdown.core.loop.contract import FilterState, InitialState, Noise, compile_kernel
from strapdown.core.mathematics.rotation import matrix_to_quaternion, rotate_left
from strapdown.core.mathematics.source import new_source
from strapdown.data.recording import Recording
from strapdown.data.solution import Source, Trajectory

pytestmark = pytest.mark.short
DEG = np.pi / 180
FIELD = np.array([13559e-9, 921e-9, 50209e-9])  # T, NED, Trondheim
G = 9.81


def matrix(roll, pitch, heading):
    """C_nb of angles in deg."""
    return Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True).as_matrix()


def observed(kind, C, y, f=np.zeros(3)):
    """(innovation, H) of the observer of `kind` for a belief with that attitude and specific
    force."""
    sensor = aiding.find(kind)
    compile_kernel(sensor.observe)
    b = FilterState(
        np.array([1.1, 0.2, 0.0]),
        np.zeros(3),
        np.ascontiguousarray(C),
        np.zeros(3),
        np.zeros(3),
        np.eye(15),
        np.zeros(3),
        f,
        np.zeros(4),
        np.zeros(0),
    )
    innovation, H = np.zeros(3), np.zeros((3, 15))
    y = np.r_[np.atleast_1d(np.array(y, float)), np.full(3, np.nan)][:3]
    rows = sensor.observe(b, y, new_source(), innovation, H)
    return innovation[:rows], H[:rows]


# ---- b: Jacobian of the compass


def gibbs_row(C):
    """The printed row for level flight: derivative of heading by twice the *total* Gibbs vector,
    by central differences."""
    x, y, z, w = Rotation.from_matrix(C).as_quat()
    total = 2 * np.array([x, y, z]) / w

    def heading(a):
        x, y, z, w = np.array([*a, 2.0]) / np.sqrt(4 + a @ a)
        return np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))

    step = 1e-6 * max(1.0, np.abs(total).max())
    return np.array(
        [(heading(total + step * e) - heading(total - step * e)) / (2 * step) for e in np.eye(3)]
    )


@pytest.mark.parametrize(
    "heading, printed", [(0, 1.0), (60, 0.75), (90, 0.5), (150, 0.067), (179.9, 0.0)]
)
def test_b_the_printed_compass_row_fades_with_heading(heading, printed):
    C = matrix(0, 0, heading)
    assert (
        gibbs_row(C)[2]
        == pytest.approx(printed, abs=1e-3)
        == pytest.approx(np.cos(heading * DEG / 2) ** 2, abs=1e-3)
    )
    assert observed("heading", C, heading * DEG)[1][0, 6:9] == pytest.approx([0, 0, 1])


@pytest.mark.parametrize("roll, pitch", [(0, 0), (20, -35), (-100, 60)])
@pytest.mark.parametrize("heading", [0, 90, 179.999, 180, -90])
def test_b_ours_is_the_derivative_of_heading_at_every_heading(roll, pitch, heading):
    C = matrix(roll, pitch, heading)
    row = observed("heading", C, heading * DEG)[1][0, 6:9]
    assert row == pytest.approx(
        [
            np.cos(heading * DEG) * np.tan(pitch * DEG),
            np.sin(heading * DEG) * np.tan(pitch * DEG),
            1,
        ],
        abs=1e-12,
    )
    turned = lambda theta: Rotation.from_rotvec(theta).as_matrix() @ C
    slope = [
        (
            observed("heading", C, np.arctan2(*turned(h * e)[[1, 0], 0]))[0][0]
            - observed("heading", C, np.arctan2(*turned(-h * e)[[1, 0], 0]))[0][0]
        )
        / (2 * h)
        for h in [1e-6]
        for e in np.eye(3)
    ]
    assert row == pytest.approx(slope, abs=1e-4)
    # of an error in body axes, as the book has it: [0, sin(roll), cos(roll)] / cos(pitch)
    body = C.T @ row
    assert body == pytest.approx(
        [0, np.sin(roll * DEG) / np.cos(pitch * DEG), np.cos(roll * DEG) / np.cos(pitch * DEG)],
        abs=1e-9,
    )


def compass_errors(start, heading, row):
    """Sizes of the heading errors (deg) after each of 50 fixes of a compass of 1 deg and the
    standard deviation (deg) that a multiplicative EKF claims at the end, of a level body whose
    heading it knows to 30 deg; `row` gives its derivative of heading by the error in body axes, at
    C.
    """
    C, P, left = matrix(0, 0, start), np.diag(np.array([1.0, 1.0, 30.0]) * DEG) ** 2, []
    off = lambda C: (heading - np.degrees(np.arctan2(C[1, 0], C[0, 0])) + 180) % 360 - 180
    for _ in range(50):
        h = row(C)
        gain = P @ h / (h @ P @ h + DEG**2)
        P, a = P - np.outer(gain, h @ P), gain * off(C) * DEG
        C = C @ Rotation.from_quat([*a / 2, 1.0]).as_matrix()
        left.append(abs(off(C)))
    return np.array(left), np.degrees(np.sqrt(P[2, 2]))


@pytest.mark.parametrize("off", [20.0, -20.0])
def test_b_southward_the_printed_row_does_not_converge_and_ours_does(off):
    exact = lambda C: observed("heading", C, 0.0)[1][0, 6:9] @ C
    north, south = (compass_errors(heading + off, heading, exact) for heading in (0.0, 180.0))
    assert north[0][-1] < 0.005 and north[1] == pytest.approx(1 / np.sqrt(50), rel=1e-2)
    np.testing.assert_allclose(south[0], north[0], atol=1e-9)
    northward, southward = (
        compass_errors(heading + off, heading, gibbs_row) for heading in (0.0, 180.0)
    )
    assert northward[0][-1] < 0.01
    # thrown half around, and then sure of what is wrong
    assert southward[0][0] > 100 and southward[0][-1] > 4 * southward[1] > 5
    stuck, claimed = compass_errors(180.0, 180.0 + off, gibbs_row)
    # estimated south: no compass is heard
    assert stuck[-1] == pytest.approx(20) and claimed == pytest.approx(30)


# ---- c: measurements between the position fixes


@pytest.mark.parametrize("name", ["closed-loop", "mekf"])
def test_c_a_field_between_position_fixes_is_used(name):
    """The printed routine corrects only in a call with a position, so that the field between is
    lost; it is emulated by leaving those samples out."""
    t = np.arange(1, 201) / 20.0
    still = Recording.from_arrays(t, np.zeros((200, 3)), np.tile([0.0, 0.0, -9.8188], (200, 1)))
    fixes = Source("position", t[19::20], np.tile([1.1, 0.2, 0.0], (10, 1)), np.ones((10, 3)))
    field = Source(
        "magnetic-field", t[1::2], np.tile(FIELD, (100, 1)), np.full((100, 3), 2e-6), tuple(FIELD)
    )
    start = InitialState(
        0.0,
        (1.1, 0.2, 0.0),
        (0.0,) * 3,
        (0.0,) * 3,
        (0.0,) * 3,
        (0.0,) * 3,
        (1.0,) * 3 + (0.1,) * 3 + (0.01, 0.01, 0.5) + (1e-3,) * 6,
        "",
    )
    at_fixes = np.isin(field.t, fixes.t)
    printed = field._where(at_fixes)
    ours, theirs = (
        sd.fuse(replace(still, sources=(fixes, source)), name, imu="consumer", start=start)
        for source in (field, printed)
    )
    assert ours.counts()["magnetic-field"] == (100, 0) and theirs.counts()["magnetic-field"] == (
        10,
        0,
    )
    between = ours.innovations.t[ours.innovations.source == 1]
    assert (~np.isin(between, fixes.t)).sum() == 90
    heading = lambda solution, at: solution.trajectory.std[np.argmin(np.abs(solution.t - at)), 8]
    assert heading(ours, 0.9) < 0.1 < 0.45 < heading(theirs, 0.9)  # before the first position fix
    assert heading(ours, 10.0) < 0.6 * heading(theirs, 10.0)


# ---- d: weights in place of spectral densities


def printed_covariance(h, weight):
    """Covariance of velocity, attitude and the two biases (12) of a level body after 1 s by P <-
    Ad P Ad' + Ed Qd Ed', Ad = I + h A, Ed = h E."""
    A, E = np.zeros((12, 12)), np.eye(12)
    A[0:3, 3:6] = [[0, G, 0], [-G, 0, 0], [0, 0, 0]]  # a tilt turns specific force
    A[0:3, 6:9] = A[3:6, 9:12] = -np.eye(3)
    P, step = np.zeros((12, 12)), np.eye(12) + h * A
    for _ in range(round(1 / h)):
        P = step @ P @ step.T + (h * E) @ np.diag(weight) @ (h * E).T
    return P


def our_covariance(h, noise):
    """The same block from the closed loop."""
    t = h * np.arange(1, round(1 / h) + 1)
    still = Recording.from_arrays(
        t, np.zeros((len(t), 3)), np.tile([0.0, 0.0, -9.8188], (len(t), 1))
    )
    start = InitialState(
        0.0, (1.1, 0.2, 0.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1e-9,) * 15, ""
    )
    keep = [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14]
    return sd.fuse(still, noise=noise, start=start, covariance=True).covariance[-1][
        np.ix_(keep, keep)
    ]


def test_d_printed_weights_tie_the_tuning_to_the_step_and_densities_do_not():
    # roots of the densities: rad/sqrt(s), m/s/sqrt(s), rad/s/sqrt(s), m/s^2/sqrt(s)
    noise = Noise(2e-3, 3e-2, 1e-4, 1e-3, 0.0, 0.0)
    q = np.repeat([noise.accel, noise.gyro, noise.accel_bias, noise.gyro_bias], 3) ** 2
    whole, half = printed_covariance(0.01, q / 0.01), printed_covariance(0.005, q / 0.01)
    # halve the step: half the covariance
    assert np.diag(half) == pytest.approx(0.5 * np.diag(whole), rel=0.02)
    ours = our_covariance(0.01, noise)
    np.testing.assert_allclose(np.diag(our_covariance(0.005, noise)), np.diag(ours), rtol=0.02)
    for h in (0.01, 0.005):  # weights of a density q: Qd = q/h
        np.testing.assert_allclose(np.diag(printed_covariance(h, q / h)), np.diag(ours), rtol=0.03)


# ---- f: a rotation is no difference of Euler angles


@pytest.mark.parametrize(
    "roll, pitch, wrong", [(0, 0, 0.0), (30, 0, 0.5), (0, 40, 0.3), (-50, 35, 0.3), (20, -60, 0.9)]
)
def test_f_a_rotation_error_added_to_euler_angles_is_wrong_at_tilt(roll, pitch, wrong):
    """The error in body axes of the Euler-angle filter: printed derivative of the angles I,
    printed compass row [0 0 1]; against central differences."""
    C, h = matrix(roll, pitch, 70), 1e-6
    angles = lambda error: Rotation.from_matrix(
        C @ Rotation.from_rotvec(error).as_matrix()
    ).as_euler("ZYX")[::-1]
    slope = np.stack([(angles(h * e) - angles(-h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    assert np.abs(slope - np.eye(3)).max() >= wrong and (
        wrong > 0 or np.allclose(slope, np.eye(3), atol=1e-8)
    )
    # our row, its error in n, in body axes
    assert (observed("heading", C, 70 * DEG)[1][0, 6:9] @ C) == pytest.approx(slope[2], abs=1e-7)
    error = np.array([0.02, 0.03, -0.02])
    true = C @ Rotation.from_rotvec(error).as_matrix()
    printed = Rotation.from_euler("ZYX", (angles(np.zeros(3)) + error)[::-1]).as_matrix()
    ours = np.array(C, order="C")
    rotate_left(*(C @ error), ours)
    left = lambda estimate: Rotation.from_matrix(true.T @ estimate).magnitude()
    assert left(ours) < 1e-12 and left(printed) > 0.1 * wrong * np.linalg.norm(error)


@pytest.mark.parametrize("roll, pitch", [(30, 0), (0, 40), (-50, 35)])
def test_f_the_printed_dynamics_are_those_of_a_rotation_and_not_of_euler_angles(roll, pitch):
    """Printed: error' = -S(w) error - bias. So an error in body axes moves, by differences of a
    turn of 1 ms; that of the angles, T(angles) w, does not."""
    C, w, h, dt = matrix(roll, pitch, 70), np.array([0.3, -0.5, 0.4]), 1e-5, 1e-3
    turn = lambda C, bias: C @ Rotation.from_rotvec((w - bias) * dt).as_matrix()
    angles = lambda C: Rotation.from_matrix(C).as_euler("ZYX")[::-1]
    rotation = lambda true, estimate: Rotation.from_matrix(estimate.T @ true).as_rotvec()
    tilted = lambda x: Rotation.from_euler("ZYX", (angles(C) + x)[::-1]).as_matrix()
    tipped = lambda x: C @ Rotation.from_rotvec(x).as_matrix()
    none, e = np.zeros(3), h * np.eye(3)
    slope = lambda after, before: np.stack(
        [(after(x) - before(x) - after(-x) + before(-x)) / (2 * h * dt) for x in e], axis=1
    )
    body = slope(
        lambda x: rotation(turn(tipped(x), none), turn(C, none)), lambda x: rotation(tipped(x), C)
    )
    euler = slope(lambda x: angles(turn(tilted(x), none)), lambda x: angles(tilted(x)))
    S = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    np.testing.assert_allclose(body, -S, atol=1e-3)
    assert np.abs(euler + S).max() > 0.2
    by_bias = [
        slope(lambda x: f(turn(C, x)), lambda x: 0 * x)
        for f in (lambda M: rotation(M, turn(C, none)), lambda M: angles(M))
    ]
    np.testing.assert_allclose(by_bias[0], -np.eye(3), atol=1e-3)
    assert np.abs(by_bias[1] + np.eye(3)).max() > 0.2


# ---- g: static roll, pitch and heading


@pytest.mark.parametrize("roll", [-170, -100, 100, 170])
def test_g_one_argument_arctangents_turn_the_body_upright(roll):
    f = matrix(roll, 10, 0).T @ [0, 0, -G]
    printed = np.degrees(np.arctan(f[1] / f[2]))
    assert abs(printed) < 90 and abs(abs(printed - roll) - 180) < 1e-9  # half a turn off
    assert np.degrees(static_attitude(f)[0]) == pytest.approx(roll) and np.degrees(
        level(f)[0]
    ) == pytest.approx(roll)


def test_g_they_are_right_within_a_quarter_turn():
    f = matrix(-70, 25, 0).T @ [0, 0, -G]
    assert np.degrees(
        [np.arctan(f[1] / f[2]), np.arctan(f[0] / np.hypot(f[1], f[2]))]
    ) == pytest.approx(np.degrees(static_attitude(f)[:2]))


@pytest.mark.parametrize("heading", [10, 90, 200, 300])
def test_g_the_sign_of_the_magnetic_heading(heading):
    m = matrix(0, 0, heading).T @ [FIELD[0], 0, FIELD[2]]
    printed = np.degrees(np.arctan2(m[1], m[0])) % 360
    assert printed == pytest.approx(360 - heading)  # counted the other way round
    assert np.degrees(static_attitude([0, 0, -G], m)[2]) == pytest.approx(heading)


# ---- h: Gibbs vector


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8)])
def test_h_the_gibbs_vector_ends_at_half_a_turn_and_the_attitude_here_does_not(axis):
    C = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    q = np.zeros(4)
    matrix_to_quaternion(np.ascontiguousarray(C), q)
    assert abs(q[0]) < 1e-8 and np.linalg.norm(q) == pytest.approx(1)
    with np.errstate(divide="ignore"):
        assert np.abs(2 * q[1:]).max() / np.abs(q[0]) > 1e7  # the Gibbs vector of the attitude
    np.testing.assert_allclose(
        Trajectory(np.zeros(1), np.zeros((1, 3)), q_nb=q[None]).rotation.as_matrix()[0],
        C,
        atol=1e-7,
    )
    error = np.array([0.01, -0.02, 0.03])
    turned = np.array(C, order="C")
    rotate_left(*error, turned)  # an error, which stays small, corrects it as anywhere else
    np.testing.assert_allclose(turned, Rotation.from_rotvec(error).as_matrix() @ C, atol=1e-12)


# ---- i: gravity as a reference vector


@pytest.mark.parametrize("a", [-3.0, 0.5, 3.0])
def test_i_an_acceleration_is_taken_for_a_tilt(a):
    """Forwards it lifts the nose by atan(a/g); to the right it rolls to the left by as much: the
    gravity observer corrects a right attitude by that."""
    forwards, rightwards = np.array([a, 0, -G]), np.array([0, a, -G])
    assert static_attitude(forwards)[1] == pytest.approx(np.arctan(a / G))
    assert static_attitude(rightwards)[0] == pytest.approx(-np.arctan(a / G))
    for f, component, sign in ((forwards, 7, 1), (rightwards, 6, -1)):
        innovation, H = observed("gravity", np.eye(3), np.zeros(3), f)
        theta = np.linalg.lstsq(H[:2, 6:8], innovation[:2], rcond=None)[0]
        assert theta[component - 6] == pytest.approx(sign * a / G, rel=1e-9)


def test_i_in_a_coordinated_turn_the_bank_is_not_seen():
    speed, rate = 30.0, 0.2
    bank = np.arctan(speed * rate / G)
    f = matrix(np.degrees(bank), 0, 0).T @ [0, speed * rate, -G]
    assert abs(static_attitude(f)[0]) < 1e-12 and bank > 0.5
    # who knows the acceleration finds it
    assert level(f, (0.0, speed * rate, 0.0))[0] == pytest.approx(bank, rel=5e-3)
