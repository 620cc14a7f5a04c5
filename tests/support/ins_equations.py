"""The continuous INS equations written plainly, and the derivatives of their error: the oracle of
the error dynamics.

Nothing here comes from the library. The error is true - estimate (position in metres NED, attitude
in n); it is differentiated by complex step, so the derivatives are exact to rounding.
"""

import numpy as np

DEG = np.pi / 180
A, FLATTENING, RATE, GM = 6378137.0, 1 / 298.257223563, 7.292115e-5, 3.986004418e14
E2 = FLATTENING * (2 - FLATTENING)
STEP = 1e-30


def radii(lat):
    """Meridian and normal radius of curvature, m; Groves (2013) eq. 2.105, 2.106."""
    x = 1 - E2 * np.sin(lat) ** 2
    return A * (1 - E2) / x**1.5, A / x**0.5


def gravity(lat, h):
    """Somigliana with the second-order height term, m/s^2; Groves (2013) eq. 2.134, 2.139."""
    b, g_e, g_p = A * (1 - FLATTENING), 9.7803253359, 9.8321849378
    surface = (A * g_e * np.cos(lat) ** 2 + b * g_p * np.sin(lat) ** 2) / np.sqrt(
        (A * np.cos(lat)) ** 2 + (b * np.sin(lat)) ** 2
    )
    m = RATE**2 * A**2 * b / GM
    return surface * (
        1 - 2 / A * (1 + FLATTENING * (1 - 2 * np.sin(lat) ** 2) + m) * h + 3 * h**2 / A**2
    )


def gravity_north(lat, h):
    """-h/R_M dg/dlat of the ellipsoid, both with the values of the equator but for sin 2 lat,
    m/s^2: the form of Groves (2013) eq. 2.140."""
    b, g_e, g_p = A * (1 - FLATTENING), 9.7803253359, 9.8321849378
    slope = b * g_p / A - g_e + g_e * E2 / 2  # of gravity, over sin 2 lat
    return -h * slope / radii(0.0)[0] * np.sin(2 * lat)


def cross_matrix(a):
    """S(a) with S(a) b = a x b."""
    return np.array([[0 * a[0], -a[2], a[1]], [a[2], 0 * a[0], -a[0]], [-a[1], a[0], 0 * a[0]]])


def rates_of_frame(lat, v, M, N):
    """omega_ie_n and omega_en_n, rad/s."""
    return RATE * np.array([np.cos(lat), 0 * lat, -np.sin(lat)]), np.array(
        [v[1] / N, -v[0] / M, -v[1] * np.tan(lat) / N]
    )


def derivatives(lla, v, C, omega, f, radii_at=None):
    """Time derivatives of lla, v_n and C_nb. `radii_at`: latitude of the radii of curvature
    where they are to be held fixed."""
    lat, _, h = lla
    M, N = (R + h for R in radii(lat if radii_at is None else radii_at))
    ie, en = rates_of_frame(lat, v, M, N)
    lla_rate = np.array([v[0] / M, v[1] / (N * np.cos(lat)), -v[2]])
    v_rate = (
        C @ f + np.array([gravity_north(lat, h), 0, gravity(lat, h)]) - np.cross(2 * ie + en, v)
    )
    return lla_rate, v_rate, C @ cross_matrix(omega) - cross_matrix(ie + en) @ C


def error_rate(error, noise, lla, v, C, omega, f, decay, fixed_radii):
    """d/dt of the 15 errors, to first order in them: position, velocity, attitude, accelerometer
    bias, gyro bias.

    omega and f are what the estimate believes; the truth is the estimate moved by `error`, and
    `noise` (12) drives velocity, attitude and the biases. decay = 1/time constants of accelerometer
    and gyro bias, 1/s.
    """
    p, dv, theta, b_a, b_g = error.reshape(5, 3)
    M, N = (R + lla[2] for R in radii(lla[0]))
    scale = np.array([M, N * np.cos(lla[0]), -1.0])
    held = lla[0] if fixed_radii else None
    lla_rate, v_rate, C_rate = derivatives(lla, v, C, omega, f, held)
    true_lla_rate, true_v_rate, true_C_rate = derivatives(
        lla + p / scale,
        v + dv,
        (np.eye(3) + cross_matrix(theta)) @ C,
        omega - b_g + noise[3:6],
        f - b_a + noise[0:3],
        held,
    )
    ahead = lla + 1j * STEP * lla_rate  # how the metres per radian change on the way
    M, N = (R + ahead[2] for R in radii(lla[0] if fixed_radii else ahead[0]))
    scale_rate = np.array([M, N * np.cos(ahead[0]), -1.0]).imag / STEP
    # d/dt of (true C) C'
    turn = true_C_rate @ C.T + (np.eye(3) + cross_matrix(theta)) @ C @ C_rate.T
    return np.concatenate(
        [
            scale * (true_lla_rate - lla_rate) + scale_rate * p / scale,
            true_v_rate - v_rate,
            np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
            / 2,
            -decay[0] * b_a + noise[6:9],
            -decay[1] * b_g + noise[9:12],
        ]
    )


def error_dynamics(lla, v, C, omega, f, decay=(0.0, 0.0), fixed_radii=False):
    """F (15, 15) and G (15, 12): derivatives of `error_rate` by error and by noise, at zero."""
    column = lambda e, w: error_rate(e, w, lla, v, C, omega, f, decay, fixed_radii).imag / STEP
    F = np.column_stack([column(1j * STEP * unit, np.zeros(12)) for unit in np.eye(15)])
    return F, np.column_stack([column(np.zeros(15), 1j * STEP * unit) for unit in np.eye(12)])
