"""What published formulas for attitude get wrong (docs/static-attitude.md, "What differs from print"), and that strapdown does not; a test per finding.

The printed forms are those of the Marine Systems Simulator's acc2rollpitch.m, staticRollPitchYaw.m, ins_mekf_psi.m and gravity vector, which stand
for the equations of Fossen (2021) chapter 14.
"""
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import aiding
from strapdown.core.contract import PARAMETERS, Belief, compile_kernel
from strapdown.core.rotation import matrix_to_quaternion, rotate_left
from strapdown.data import Trajectory
from strapdown.statics import level, static_attitude

pytestmark = pytest.mark.short
DEG = np.pi / 180
FIELD = np.array([13559e-9, 921e-9, 50209e-9])      # T, NED, Trondheim
G = 9.81


def matrix(roll, pitch, heading):
    """C_nb of angles in deg."""
    return Rotation.from_euler("ZYX", [heading, pitch, roll], degrees=True).as_matrix()


def observed(kind, C, y, f=np.zeros(3)):
    """(innovation, H) of the observer of `kind` for a belief with that attitude and specific force."""
    sensor = aiding.find(kind)
    compile_kernel(sensor.observe)
    b = Belief(np.array([1.1, 0.2, 0.0]), np.zeros(3), np.ascontiguousarray(C), np.zeros(3), np.zeros(3), np.eye(15), np.zeros(3), f, np.zeros(4), np.zeros(0))
    innovation, H = np.zeros(3), np.zeros((3, 15))
    rows = sensor.observe(b, np.atleast_1d(np.array(y, float)), np.zeros(PARAMETERS), innovation, H)
    return innovation[:rows], H[:rows]


# ---- b: Jacobian of the compass

def gibbs_row(C):
    """The printed row for level flight: derivative of heading by twice the *total* Gibbs vector, by central differences."""
    x, y, z, w = Rotation.from_matrix(C).as_quat()
    total = 2 * np.array([x, y, z]) / w

    def heading(a):
        x, y, z, w = np.array([*a, 2.0]) / np.sqrt(4 + a @ a)
        return np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))

    step = 1e-6 * max(1.0, np.abs(total).max())
    return np.array([(heading(total + step * e) - heading(total - step * e)) / (2 * step) for e in np.eye(3)])


@pytest.mark.parametrize("heading, printed", [(0, 1.0), (60, 0.75), (90, 0.5), (150, 0.067), (179.9, 0.0)])
def test_b_the_printed_compass_row_fades_with_heading(heading, printed):
    C = matrix(0, 0, heading)
    assert gibbs_row(C)[2] == pytest.approx(printed, abs=1e-3) == pytest.approx(np.cos(heading * DEG / 2) ** 2, abs=1e-3)
    assert observed("heading", C, heading * DEG)[1][0, 6:9] == pytest.approx([0, 0, 1])


@pytest.mark.parametrize("roll, pitch", [(0, 0), (20, -35), (-100, 60)])
@pytest.mark.parametrize("heading", [0, 90, 179.999, 180, -90])
def test_b_ours_is_the_derivative_of_heading_at_every_heading(roll, pitch, heading):
    C = matrix(roll, pitch, heading)
    row = observed("heading", C, heading * DEG)[1][0, 6:9]
    assert row == pytest.approx([np.cos(heading * DEG) * np.tan(pitch * DEG), np.sin(heading * DEG) * np.tan(pitch * DEG), 1], abs=1e-12)
    turned = lambda theta: Rotation.from_rotvec(theta).as_matrix() @ C
    slope = [(observed("heading", C, np.arctan2(*turned(h * e)[[1, 0], 0]))[0][0] - observed("heading", C, np.arctan2(*turned(-h * e)[[1, 0], 0]))[0][0]) / (2 * h)
             for h in [1e-6] for e in np.eye(3)]
    assert row == pytest.approx(slope, abs=1e-4)
    body = C.T @ row        # of an error in body axes, as the book has it: [0, sin(roll), cos(roll)] / cos(pitch)
    assert body == pytest.approx([0, np.sin(roll * DEG) / np.cos(pitch * DEG), np.cos(roll * DEG) / np.cos(pitch * DEG)], abs=1e-9)


# ---- g: static roll, pitch and heading

@pytest.mark.parametrize("roll", [-170, -100, 100, 170])
def test_g_one_argument_arctangents_turn_the_body_upright(roll):
    f = matrix(roll, 10, 0).T @ [0, 0, -G]
    printed = np.degrees(np.arctan(f[1] / f[2]))
    assert abs(printed) < 90 and abs(abs(printed - roll) - 180) < 1e-9      # half a turn off
    assert np.degrees(static_attitude(f)[0]) == pytest.approx(roll) and np.degrees(level(f)[0]) == pytest.approx(roll)


def test_g_they_are_right_within_a_quarter_turn():
    f = matrix(-70, 25, 0).T @ [0, 0, -G]
    assert np.degrees([np.arctan(f[1] / f[2]), np.arctan(f[0] / np.hypot(f[1], f[2]))]) == pytest.approx(np.degrees(static_attitude(f)[:2]))


@pytest.mark.parametrize("heading", [10, 90, 200, 300])
def test_g_the_sign_of_the_magnetic_heading(heading):
    m = matrix(0, 0, heading).T @ [FIELD[0], 0, FIELD[2]]
    printed = np.degrees(np.arctan2(m[1], m[0])) % 360
    assert printed == pytest.approx(360 - heading)                          # counted the other way round
    assert np.degrees(static_attitude([0, 0, -G], m)[2]) == pytest.approx(heading)


# ---- h: Gibbs vector

@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8)])
def test_h_the_gibbs_vector_ends_at_half_a_turn_and_the_attitude_here_does_not(axis):
    C = Rotation.from_rotvec(np.pi * np.array(axis)).as_matrix()
    q = np.zeros(4)
    matrix_to_quaternion(np.ascontiguousarray(C), q)
    assert abs(q[0]) < 1e-8 and np.linalg.norm(q) == pytest.approx(1)
    with np.errstate(divide="ignore"):
        assert np.abs(2 * q[1:]).max() / np.abs(q[0]) > 1e7                 # the Gibbs vector of the attitude
    np.testing.assert_allclose(Trajectory(np.zeros(1), np.zeros((1, 3)), q_nb=q[None]).rotation.as_matrix()[0], C, atol=1e-7)
    error = np.array([0.01, -0.02, 0.03])
    turned = np.array(C, order="C")
    rotate_left(*error, turned)                                             # an error, which stays small, corrects it as anywhere else
    np.testing.assert_allclose(turned, Rotation.from_rotvec(error).as_matrix() @ C, atol=1e-12)


# ---- i: gravity as a reference vector

@pytest.mark.parametrize("a", [-3.0, 0.5, 3.0])
def test_i_an_acceleration_is_taken_for_a_tilt(a):
    """Forwards it lifts the nose by atan(a/g); to the right it rolls to the left by as much: the gravity observer corrects a right attitude by that."""
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
    assert level(f, (0.0, speed * rate, 0.0))[0] == pytest.approx(bank, rel=5e-3)       # who knows the acceleration finds it
