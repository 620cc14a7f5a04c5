"""Every block of F, and G Q G', against the differentiated nonlinear equations of the INS."""

import numpy as np
import pytest
from ins_equations import DEG, cross_matrix, error_dynamics
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import cross_matrix as S, dynamics

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=1e-3, accel=2e-3, gyro_bias=3e-5, accel_bias=4e-4, gyro_decay=1 / 300, accel_decay=1 / 1000
)

# latitude, longitude (deg), height m; velocity NED m/s; roll, pitch, heading (deg); specific force
# in the body m/s^2
POINTS = {
    "slow": ((47.0, 8.0, 400.0), (1.0, -2.0, 0.1), (1.0, -2.0, 30.0), (0.1, 0.2, -9.8)),
    "fast north": ((10.0, -70.0, 9000.0), (200.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.5, 0.0, -9.7)),
    "fast east": (
        (-35.0, 150.0, 9000.0),
        (0.0, 200.0, 0.0),
        (-60.0, 3.0, 90.0),
        (1.0, -3.0, -19.0),
    ),
    "fast south, steep climb": (
        (60.0, 25.0, 5000.0),
        (-120.0, 40.0, -150.0),
        (10.0, 85.0, 180.0),
        (12.0, 0.0, -4.0),
    ),
    "fast west, dive": (
        (-20.0, -45.0, 3000.0),
        (30.0, -180.0, 80.0),
        (170.0, -80.0, 270.0),
        (-5.0, 2.0, 8.0),
    ),
    "lat 80": ((80.0, 10.0, 9000.0), (150.0, 130.0, 5.0), (20.0, 10.0, 225.0), (1.0, 1.0, -11.0)),
    "lat 85": (
        (85.0, -179.0, 9000.0),
        (-140.0, 140.0, -10.0),
        (-30.0, 20.0, 315.0),
        (2.0, -1.0, -12.0),
    ),
    "lat -85": (
        (-85.0, 100.0, 2000.0),
        (100.0, -170.0, 20.0),
        (5.0, -60.0, 135.0),
        (-9.0, 1.0, -3.0),
    ),
    "equator": ((0.0, 0.0, 0.0), (70.0, 70.0, -3.0), (0.0, 0.0, 45.0), (0.0, 0.0, -9.78)),
    "below the sea": (
        (31.5, 35.5, -430.0),
        (-20.0, 15.0, 1.0),
        (90.0, 0.0, -60.0),
        (0.0, -9.8, 0.3),
    ),
}


def at(point):
    """Arguments of the two models: lla, v_n, C_nb, rate and specific force in the body."""
    lla, v, rph, f = POINTS[point]
    C = Rotation.from_euler("ZYX", rph[::-1], degrees=True).as_matrix()
    return np.array(lla) * (DEG, DEG, 1), np.array(v), C, np.array([0.3, -0.7, 3.5]), np.array(f)


# rows, columns, radii held fixed in the differentiation, relative tolerance (algorithms, D.1);
# entries that vanish must be below 1e-3 of it
BLOCKS = {
    "pp": (slice(0, 3), slice(0, 3), False, 1e-6),
    "pv": (slice(0, 3), slice(3, 6), False, 1e-6),
    "vp": (slice(3, 6), slice(0, 3), True, 1e-6),
    "theta p": (slice(6, 9), slice(0, 3), True, 1e-6),
    "vv": (slice(3, 6), slice(3, 6), False, 1e-8),
    "theta v": (slice(6, 9), slice(3, 6), False, 1e-8),
    "v theta": (slice(3, 6), slice(6, 9), False, 1e-8),
    "theta theta": (slice(6, 9), slice(6, 9), False, 1e-8),
    "biases": (slice(0, 9), slice(9, 15), False, 1e-8),
    "of biases": (slice(9, 15), slice(0, 15), False, 1e-8),
    "p by attitude": (slice(0, 3), slice(6, 9), False, 1e-8),
}


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("point", POINTS)
def test_block_of_F_is_the_derivative(point, block):
    rows, columns, fixed_radii, tolerance = BLOCKS[block]
    lla, v, C, omega, f = at(point)
    F, _ = dynamics(lla, v, C, C @ f, NOISE)
    expected, _ = error_dynamics(
        lla, v, C, omega, f, (NOISE.accel_decay, NOISE.gyro_decay), fixed_radii
    )
    F, expected = F[rows, columns], expected[rows, columns]
    np.testing.assert_allclose(
        F, expected, rtol=tolerance, atol=1e-3 * tolerance * max(np.abs(expected).max(), 1e-18)
    )


@pytest.mark.parametrize("point", POINTS)
def test_radii_held_fixed_leave_out_little(point):
    """F_vp and F_theta_p ignore how the radii change with latitude: 2e-3 of the block; the page
    says so."""
    lla, v, C, omega, f = at(point)
    F, _ = dynamics(lla, v, C, C @ f, NOISE)
    expected, _ = error_dynamics(lla, v, C, omega, f, (NOISE.accel_decay, NOISE.gyro_decay))
    for rows in (slice(3, 6), slice(6, 9)):
        np.testing.assert_allclose(
            F[rows, 0:3], expected[rows, 0:3], rtol=0, atol=3e-3 * np.abs(expected[rows, 0:3]).max()
        )


@pytest.mark.parametrize("point", POINTS)
def test_spectral_density_is_that_of_the_noise_inputs(point):
    lla, v, C, omega, f = at(point)
    _, G = error_dynamics(lla, v, C, omega, f)
    Q = np.diag(np.repeat([NOISE.accel, NOISE.gyro, NOISE.accel_bias, NOISE.gyro_bias], 3) ** 2)
    np.testing.assert_allclose(dynamics(lla, v, C, C @ f, NOISE)[1], G @ Q @ G.T, atol=1e-20)


def test_cross_matrix():
    a, b = np.array([1.0, -2, 3]), np.array([0.3, 5, -1])
    np.testing.assert_allclose(S(a) @ b, np.cross(a, b))
    np.testing.assert_array_equal(S(a), cross_matrix(a))
