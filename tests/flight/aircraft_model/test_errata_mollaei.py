"""What the aircraft model of Mollaei, Shafieirad & Moradi (2025) gets wrong in print, and that the
flown one does not: a test per finding.

Printed equations (1) to (18) are evaluated beside the compiled model, whose accelerations follow
from forces in body axes and Newton's and Euler's laws; it stores none of these forms.
"""

import math

import numpy as np
import pytest
from textbook_aircraft import gammas, matrix, wind_axes

import strapdown as sd
from strapdown.core.compile.records import rows
from strapdown.flight.aircraft_model.dynamics import Loads, evaluate
from strapdown.flight.aircraft_model.trim import quaternion

pytestmark = pytest.mark.short
A = sd.flight.aircraft("aerosonde").replace(C_l_0=0.002)
ORIGIN = (0.6, 0.2, 300.0)
RNG = np.random.default_rng(11)
sin, cos, tan = math.sin, math.cos, math.tan


class Flown:
    """A flight state drawn at random, its forces in the paper's symbols, and its rates as the
    compiled model has them."""

    def __init__(self):
        velocity = RNG.normal([25, 0, 2], [3, 4, 2])
        self.u, self.v, self.w = velocity
        self.phi, self.theta, self.psi = RNG.uniform(-0.7, 0.7, 2).tolist() + [RNG.uniform(-3, 3)]
        self.p, self.q, self.r = RNG.normal(0, 0.5, 3)
        self.controls = np.r_[RNG.uniform(-0.3, 0.3, 3), 0.7]
        self.C = matrix(self.phi, self.theta, self.psi)
        state = np.r_[
            ORIGIN,
            self.C @ velocity,
            quaternion(self.phi, self.theta, self.psi),
            self.p,
            self.q,
            self.r,
            self.controls,
        ]
        rates, (out,), parameters = np.zeros(19), rows(Loads, 1), A.parameters("flat", ORIGIN)
        evaluate(parameters, state, np.zeros(9), rates, out)
        # without the propeller's reaction
        self.g, self.m, self.rolling = (
            parameters.gravity,
            A["mass"],
            out.moment[0] + out.torque,
        )
        self.ground = rates[:3] / [parameters.latitude_rate, parameters.longitude_rate, -1]
        self.du, self.dv, self.dw = self.C.T @ rates[3:6] - np.cross(
            [self.p, self.q, self.r], velocity
        )
        self.dp, self.dq, self.dr = rates[10:13]
        self.V, self.alpha, self.beta = out.airspeed, out.alpha, out.beta
        self.lift, self.drag, self.side, self.T, self.L, self.M, self.N = wind_axes(
            A, self.V, self.alpha, self.beta, self.p, self.q, self.r, self.controls, A["density"]
        )
        self.dV = (self.u * self.du + self.v * self.dv + self.w * self.dw) / self.V
        self.dalpha = (self.u * self.dw - self.w * self.du) / (self.u**2 + self.w**2)
        self.dbeta = (self.dv - sin(self.beta) * self.dV) / (self.V * cos(self.beta))
        # C' = C [omega x]
        self.dC = self.C @ np.array(
            [[0, -self.r, self.q], [self.r, 0, -self.p], [-self.q, self.p, 0]]
        )
        self.q_rates = rates[6:10]


FLIGHTS = [Flown() for _ in range(20)]


def holds(printed, true):
    """Whether a printed form gives the true rate in every one of the flights."""
    return bool(
        np.allclose(
            [printed(f) for f in FLIGHTS], [true(f) for f in FLIGHTS], rtol=1e-9, atol=1e-10
        )
    )


def apart(printed, true):
    """The median share of the true rate by which a printed form is wrong."""
    return float(np.median([abs(printed(f) / true(f) - 1) for f in FLIGHTS]))


def test_forces_1_to_3_are_right():
    """(1) and (2) stand in the order v, u."""
    lift_x = lambda f: f.lift * sin(f.alpha) - f.drag * cos(f.alpha)
    lift_z = lambda f: -f.lift * cos(f.alpha) - f.drag * sin(f.alpha)
    assert holds(
        lambda f: f.w * f.p - f.u * f.r + f.g * sin(f.phi) * cos(f.theta) + f.side / f.m,
        lambda f: f.dv,
    )
    assert holds(
        lambda f: f.v * f.r - f.w * f.q - f.g * sin(f.theta) + (lift_x(f) + f.T) / f.m,
        lambda f: f.du,
    )
    assert holds(
        lambda f: f.u * f.q - f.v * f.p + f.g * cos(f.phi) * cos(f.theta) + lift_z(f) / f.m,
        lambda f: f.dw,
    )


def test_a_the_roll_acceleration_4_lacks_p_q():
    x, y, z, xz = (A[name] for name in ("J_x", "J_y", "J_z", "J_xz"))
    G = x * z - xz**2
    rest = lambda f: (z * f.L + xz * f.N) / G + (z * (y - z) - xz**2) * f.q * f.r / G
    assert not holds(lambda f: rest(f) + xz * (x - y + z) / G, lambda f: f.dp)
    assert holds(lambda f: rest(f) + xz * (x - y + z) / G * f.p * f.q, lambda f: f.dp)
    # print adds it, rad/s^2, even at rest
    assert xz * (x - y + z) / G == pytest.approx(gammas(A)[1]) == pytest.approx(0.1215, abs=1e-4)


def test_pitch_and_yaw_accelerations_5_and_6_are_right():
    x, y, z, xz = (A[name] for name in ("J_x", "J_y", "J_z", "J_xz"))
    G = x * z - xz**2
    assert holds(lambda f: (f.M + f.p * f.r * (z - x) + xz * (f.r**2 - f.p**2)) / y, lambda f: f.dq)
    assert holds(
        lambda f: (
            (xz * f.L + x * f.N) / G
            + ((x * (x - y) + xz**2) * f.p * f.q - xz * (x - y + z) * f.q * f.r) / G
        ),
        lambda f: f.dr,
    )


def test_e_the_rolling_moment_7_lacks_c_lr_and_c_l0():
    pressure = lambda f: 0.5 * A["density"] * f.V**2 * A["area"] * A["span"]
    printed = lambda f: (
        pressure(f)
        * (
            A["C_l_beta"] * f.beta
            + A["C_l_p"] * f.p * A["span"] / (2 * f.V)
            + A["C_l_aileron"] * f.controls[1]
            + A["C_l_rudder"] * f.controls[2]
        )
    )
    assert not holds(printed, lambda f: f.rolling) and apart(printed, lambda f: f.rolling) > 0.02
    assert holds(
        lambda f: (
            printed(f) + pressure(f) * (A["C_l_r"] * f.r * A["span"] / (2 * f.V) + A["C_l_0"])
        ),
        lambda f: f.rolling,
    )


def test_the_angle_of_attack_10_is_right():
    assert holds(
        lambda f: (
            f.q
            - (f.p * cos(f.alpha) + f.r * sin(f.alpha)) * tan(f.beta)
            - f.lift / (f.m * f.V * cos(f.beta))
            + f.g
            / (f.V * cos(f.beta))
            * (cos(f.phi) * cos(f.theta) * cos(f.alpha) + sin(f.theta) * sin(f.alpha))
            - f.T * sin(f.alpha) / (f.m * f.V * cos(f.beta))
        ),
        lambda f: f.dalpha,
    )


def test_d_the_sideslip_11_lacks_drag():
    printed = lambda f: (
        f.p * sin(f.alpha)
        - f.r * cos(f.alpha)
        + f.side * cos(f.beta) / (f.m * f.V)
        + f.g / f.V * cos(f.beta) * sin(f.phi) * cos(f.theta)
        + sin(f.beta)
        / f.V
        * (
            f.g * cos(f.alpha) * sin(f.theta)
            - f.g * sin(f.alpha) * cos(f.phi) * cos(f.theta)
            - f.T * cos(f.alpha) / f.m
        )
    )
    assert not holds(printed, lambda f: f.dbeta)
    assert holds(lambda f: printed(f) + f.drag * sin(f.beta) / (f.m * f.V), lambda f: f.dbeta)
    # the side force in wind axes: then without its cosine
    across = lambda f: f.side * cos(f.beta) + f.drag * sin(f.beta)
    assert holds(
        lambda f: printed(f) + (across(f) - f.side * cos(f.beta)) / (f.m * f.V), lambda f: f.dbeta
    )


def test_d_the_airspeed_12_is_right_with_drag_in_wind_axes():
    rest = lambda f: (
        f.g
        * (
            cos(f.phi) * cos(f.theta) * sin(f.alpha) * cos(f.beta)
            + sin(f.phi) * cos(f.theta) * sin(f.beta)
            - sin(f.theta) * cos(f.alpha) * cos(f.beta)
        )
        + f.T * cos(f.beta) * cos(f.alpha) / f.m
    )
    assert not holds(lambda f: rest(f) - f.drag / f.m, lambda f: f.dV)
    assert holds(
        lambda f: rest(f) - (f.drag * cos(f.beta) - f.side * sin(f.beta)) / f.m, lambda f: f.dV
    )


def euler_rates(f):
    """Rates of roll, pitch and heading from C' = C [omega x], by the derivatives of the angles
    with respect to the matrix."""
    C, D = f.C, f.dC
    return (
        (D[2, 1] * C[2, 2] - C[2, 1] * D[2, 2]) / (C[2, 1] ** 2 + C[2, 2] ** 2),
        -D[2, 0] / math.sqrt(1 - C[2, 0] ** 2),
        (D[1, 0] * C[0, 0] - C[1, 0] * D[0, 0]) / (C[0, 0] ** 2 + C[1, 0] ** 2),
    )


def test_roll_and_pitch_rates_13_and_14_are_right():
    assert holds(
        lambda f: f.p + f.q * sin(f.phi) * tan(f.theta) + f.r * cos(f.phi) * tan(f.theta),
        lambda f: euler_rates(f)[0],
    )
    assert holds(lambda f: f.q * cos(f.phi) - f.r * sin(f.phi), lambda f: euler_rates(f)[1])


def test_b_the_heading_rate_15_has_a_minus_for_a_plus():
    assert not holds(
        lambda f: (f.q * sin(f.phi) - f.r * cos(f.phi)) / cos(f.theta), lambda f: euler_rates(f)[2]
    )
    assert holds(
        lambda f: (f.q * sin(f.phi) + f.r * cos(f.phi)) / cos(f.theta), lambda f: euler_rates(f)[2]
    )
    state = [
        0.5 * (-x * f.p - y * f.q - z * f.r)
        for f in FLIGHTS
        for w, x, y, z in [quaternion(f.phi, f.theta, f.psi)]
    ]
    # the model's quaternion turns by the same rates
    assert [f.q_rates[0] for f in FLIGHTS] == pytest.approx(state, abs=1e-12)


def test_c_the_east_velocity_17_has_two_signs_wrong():
    sines = lambda f: (sin(f.phi), cos(f.phi), sin(f.theta), cos(f.theta), sin(f.psi), cos(f.psi))

    def rows(f, sign):
        sr, cr, sp, cp, sh, ch = sines(f)
        return np.array(
            [
                [cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh],
                [cp * sh, sr * sp * sh + sign * cr * ch, cr * sp * sh - sign * sr * ch],
                [-sp, sr * cp, cr * cp],
            ]
        )

    for f in FLIGHTS:
        right, printed, body = rows(f, 1), rows(f, -1), np.array([f.u, f.v, f.w])
        assert right @ body == pytest.approx(f.ground, rel=1e-9)
        assert right @ right.T == pytest.approx(np.eye(3), abs=1e-12)
        assert (printed @ body)[[0, 2]] == pytest.approx((right @ body)[[0, 2]], rel=1e-12)
    # not a rotation
    assert max(np.abs(rows(f, -1) @ rows(f, -1).T - np.eye(3)).max() for f in FLIGHTS) > 0.5
    # m/s to the east
    assert (
        np.median([abs(((rows(f, -1) - rows(f, 1)) @ [f.u, f.v, f.w])[1]) for f in FLIGHTS]) > 1.0
    )
