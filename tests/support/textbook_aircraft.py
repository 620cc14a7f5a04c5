"""The aircraft once more, from the equations of textbooks: u, v, w and Euler angles over a flat
Earth, in plain numpy. The oracle of its tests."""

import numpy as np

CONTROLS = ("elevator", "aileron", "rudder", "throttle")


def polar(a, alpha):
    """C_L (with the stall's blending written as printed by Beard & McLain, 4.9 and 4.10) and
    C_D."""
    M, stall = a["stall_blend"], a["stall_alpha"]
    one, two = np.exp(-M * (alpha - stall)), np.exp(M * (alpha + stall))
    sigma = (1 + one + two) / ((1 + one) * (1 + two))
    linear = a["C_L_0"] + a["C_L_alpha"] * alpha
    plate = 2 * np.sign(alpha) * np.sin(alpha) ** 2 * np.cos(alpha)
    ratio = a["span"] ** 2 / a["area"]
    return (1 - sigma) * linear + sigma * plate, a["C_D_p"] + linear**2 / (
        np.pi * a["oswald"] * ratio
    )


def propeller(a, V, throttle, rho):
    """Thrust and torque from the advance ratio, at the speed where motor and propeller have the
    same torque (a quadratic equation)."""
    D, K, R = a["diameter"], a["motor_constant"], a["resistance"]
    turn = 2 * np.pi
    motor = np.array([0.0, -K * K / R, K * (throttle * a["voltage"] / R - a["idle_current"])])
    air = (
        rho
        * D**5
        * np.array([a["C_Q_0"] / turn**2, a["C_Q_1"] * V / (turn * D), a["C_Q_2"] * (V / D) ** 2])
    )
    two, one, none = air - motor
    n = (-one + np.sqrt(one**2 - 4 * two * none)) / (2 * two) / turn
    J = V / (n * D)
    return (
        rho * n**2 * D**4 * (a["C_T_0"] + a["C_T_1"] * J + a["C_T_2"] * J**2),
        rho * n**2 * D**5 * (a["C_Q_0"] + a["C_Q_1"] * J + a["C_Q_2"] * J**2),
        turn * n,
    )


def wind_axes(a, V, alpha, beta, p, q, r, controls, rho):
    """Lift, drag, body side force (N), thrust (N), and moments L, M, N (N m) with the
    propeller's reaction."""
    e, da, dr, throttle = controls
    S, b, c = a["area"], a["span"], a["chord"]
    qS, x, y, z = 0.5 * rho * V**2 * S, p * b / (2 * V), q * c / (2 * V), r * b / (2 * V)
    C_L, C_D = polar(a, alpha)
    lift = qS * (C_L + a["C_L_q"] * y + a["C_L_elevator"] * e)
    drag = qS * (C_D + a["C_D_q"] * y + a["C_D_elevator"] * e)
    side, roll, yaw = (
        qS
        * (
            a[f"C_{axis}_0"]
            + a[f"C_{axis}_beta"] * beta
            + a[f"C_{axis}_p"] * x
            + a[f"C_{axis}_r"] * z
            + a[f"C_{axis}_aileron"] * da
            + a[f"C_{axis}_rudder"] * dr
        )
        for axis in "Yln"
    )
    pitch = qS * c * (a["C_m_0"] + a["C_m_alpha"] * alpha + a["C_m_q"] * y + a["C_m_elevator"] * e)
    T, Q, _ = propeller(a, V, throttle, rho)
    return lift, drag, side, T, b * roll - Q, pitch, b * yaw


def forces(a, velocity, rates, controls, rho):
    """Force and moment in body axes without gravity."""
    u, v, w = velocity
    V, alpha = np.sqrt(u * u + v * v + w * w), np.arctan2(w, u)
    lift, drag, side, T, L, M, N = wind_axes(a, V, alpha, np.arcsin(v / V), *rates, controls, rho)
    return np.array(
        [
            T - drag * np.cos(alpha) + lift * np.sin(alpha),
            side,
            -drag * np.sin(alpha) - lift * np.cos(alpha),
        ]
    ), np.array([L, M, N])


def gammas(a):
    """Gamma and Gamma_1 to Gamma_8 of the inertia (Beard & McLain, 3.13)."""
    x, y, z, xz = a["J_x"], a["J_y"], a["J_z"], a["J_xz"]
    G = x * z - xz**2
    return (
        G,
        xz * (x - y + z) / G,
        (z * (z - y) + xz**2) / G,
        z / G,
        xz / G,
        (z - x) / y,
        xz / y,
        ((x - y) * x + xz**2) / G,
        x / G,
    )


def matrix(phi, theta, psi):
    """C_nb as a product of three rotations."""
    c, s = np.cos, np.sin
    about_z = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    about_y = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    return about_z @ about_y @ np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])


def motion(a, x, controls, g, rho, wind=np.zeros(3)):
    """x' of x = (north, east, down, u, v, w, phi, theta, psi, p, q, r), velocities against the
    ground; `wind` steady NED."""
    (u, v, w), (phi, theta, psi), (p, q, r) = x[3:6], x[6:9], x[9:12]
    C = matrix(phi, theta, psi)
    (F_x, F_y, F_z), (L, M, N) = forces(
        a, np.array([u, v, w]) - C.T @ wind, (p, q, r), controls, rho
    )
    _, G1, G2, G3, G4, G5, G6, G7, G8 = gammas(a)
    m, c, s = a["mass"], np.cos, np.sin
    return np.r_[
        C @ x[3:6],
        r * v - q * w - g * s(theta) + F_x / m,
        p * w - r * u + g * c(theta) * s(phi) + F_y / m,
        q * u - p * v + g * c(theta) * c(phi) + F_z / m,
        p + (q * s(phi) + r * c(phi)) * np.tan(theta),
        q * c(phi) - r * s(phi),
        (q * s(phi) + r * c(phi)) / c(theta),
        G1 * p * q - G2 * q * r + G3 * L + G4 * N,
        G5 * p * r - G6 * (p**2 - r**2) + M / a["J_y"],
        G7 * p * q - G1 * q * r + G4 * L + G8 * N,
    ]


def actuators(a, positions, commands):
    """Rates of the actuators' positions."""
    rates = np.empty(4)
    for i, name in enumerate(CONTROLS):
        wanted = np.clip(commands[i], a[f"{name}_min"], a[f"{name}_max"])
        rates[i] = np.clip(
            (wanted - positions[i]) / a[f"{name}_lag"], -a[f"{name}_rate"], a[f"{name}_rate"]
        )
    return rates
