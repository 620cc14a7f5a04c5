"""Errata of Hager & Bryne on open- and closed-loop error-state Kalman filters: for each finding the
printed form disagrees with the differentiated nonlinear equations and the corrected one agrees.
Letters are those of the project's list of findings.

The error model `literal` is Table II as printed (in metres); the bias sign of equation (12) is not
part of it.
"""

import numpy as np
import pytest
from ins_equations import (
    DEG,
    E2,
    FLATTENING,
    RATE,
    A,
    cross_matrix,
    error_dynamics,
    gravity,
    gravity_north,
    radii,
)
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics import earth
from strapdown.core.mathematics.error_dynamics import (
    CORRECTED,
    LATITUDE_GRAVITY,
    LITERAL,
    NO_GRADIENT,
    PRINTED_SIGNS,
    dynamics,
)
from strapdown.core.mathematics.mechanization import mechanize, stationary_increments

pytestmark = pytest.mark.short
LLA, V = np.array([48 * DEG, 0.2, 3000.0]), np.array([150.0, -120.0, 12.0])
C, OMEGA, FORCE = (
    Rotation.from_euler("ZYX", [2.0, 0.3, -0.4]).as_matrix(),
    np.array([0.1, 0.2, -0.3]),
    np.array([1.0, -2.0, -9.5]),
)
NOISE = Noise(0.0, 0.0, 0.0, 0.0, 1 / 300, 1 / 200)


def table_ii(lla, v):
    """Table II as printed: blocks against latitude, longitude (rad) and height (m), true -
    estimate."""
    (mu, _, h), (v_n, v_e, v_d) = lla, v
    R_M, R_N = radii(mu)
    M, N, s, c, t = R_M + h, R_N + h, np.sin(mu), np.cos(mu), np.tan(mu)
    vp = [
        [-v_e * (2 * RATE * c + v_e / (N * c**2)), 0, (v_e**2 * t - v_n * v_d) / M**2],
        [2 * RATE * (v_n * c - v_d * s) + v_n * v_e / (N * c**2), 0, -v_e * (v_n * t + v_d) / N**2],
        [2 * RATE * v_e * s, 0, v_n**2 / M**2 + v_e**2 / N**2],
    ]
    tp = [
        [-RATE * s, 0, -(v_e**2) / N**2],
        [0, 0, v_n**2 / M**2],
        [-RATE * c - v_e / (N * c**2), 0, v_e * t / N**2],
    ]
    vv = [
        [v_d / M, -2 * (RATE * s + v_e * t / N), v_n / M],
        [2 * RATE * s + v_e * t / N, (v_n * t + v_d) / N, 2 * RATE * c + v_e / N],
        [-2 * v_n / M, -2 * (RATE * c + v_e / N), 0],
    ]
    tv = [[0, 1 / M, 0], [-1 / M, 0, 0], [0, -t / N, 0]]
    pp = [[0, 0, -v_n / M**2], [v_e * t / (N * c), 0, -v_e / (N**2 * c)], [0, 0, 0]]
    tt = [
        [0, -RATE * s - v_e * t / N, v_n / M],
        [RATE * s + v_e * t / N, 0, RATE * c + v_e / N],
        [-v_n / M, -RATE * c - v_e / N, 0],
    ]
    return {
        name: np.array(block)
        for name, block in dict(vp=vp, tp=tp, vv=vv, tv=tv, pp=pp, tt=tt).items()
    }


# metres NED per (rad, rad, m)
SCALE = np.array([radii(LLA[0])[0] + LLA[2], (radii(LLA[0])[1] + LLA[2]) * np.cos(LLA[0]), -1.0])
ROWS = {"p": slice(0, 3), "v": slice(3, 6), "t": slice(6, 9)}
PRINTED = table_ii(LLA, V)
TRUE, _ = error_dynamics(
    LLA, V, C, OMEGA, FORCE, (NOISE.accel_decay, NOISE.gyro_decay), fixed_radii=True
)


def block_of(F, name):
    """A block of F in the units of Table II, without gravity's north component, which the paper
    leaves out whole: the findings are about the rest."""
    block = F[ROWS[name[0]], ROWS[name[1]]]
    return (block * SCALE if name[1] == "p" else block) - (NORTH if name == "vp" else 0)


def true_block(name):
    return block_of(TRUE, name)


M, N = (R + LLA[2] for R in radii(LLA[0]))
TAN, (V_N, V_E, V_D) = np.tan(LLA[0]), V
G_LAT = gravity(LLA[0] + 1e-30j, LLA[2]).imag / 1e-30
G_H = gravity(LLA[0], LLA[2] + 1e-30j).imag / 1e-30
NORTH_LAT = gravity_north(LLA[0] + 1e-30j, LLA[2]).imag / 1e-30
NORTH_H = gravity_north(LLA[0], LLA[2] + 1e-30j).imag / 1e-30
NORTH = np.array([[NORTH_LAT, 0, NORTH_H], [0, 0, 0], [0, 0, 0]])
FINDINGS = {  # block, entry, corrected value, how far the printed one is off at least (relative)
    "a: sign of F_theta_v(2,1)": ("tv", (1, 0), 1 / M, 1.9),
    "a: sign of F_theta_v(3,2)": ("tv", (2, 1), TAN / N, 1.9),
    "a: sign of F_theta_p(1,1)": ("tp", (0, 0), RATE * np.sin(LLA[0]), 1.9),
    "a: sign of F_theta_p(3,1)": (
        "tp",
        (2, 0),
        RATE * np.cos(LLA[0]) + V_E / (N * np.cos(LLA[0]) ** 2),
        1.9,
    ),
    "c: F_theta_p(1,3), a speed squared": ("tp", (0, 2), V_E / N**2, 100),
    "c: F_theta_p(2,3), a speed squared": ("tp", (1, 2), -V_N / M**2, 100),
    "c: F_theta_p(3,3), its sign": ("tp", (2, 2), -V_E * TAN / N**2, 1.9),
    "d: F_theta_v(1,2), sign and radius": ("tv", (0, 1), -1 / N, 1.9),
    "e: F_vp(1,3), denominators": ("vp", (0, 2), V_E**2 * TAN / N**2 - V_N * V_D / M**2, 1e-3),
    "f: F_vp(3,1), gravity by latitude": (
        "vp",
        (2, 0),
        2 * RATE * V_E * np.sin(LLA[0]) + G_LAT,
        0.9,
    ),
    "f: F_vp(3,3), gravity by height": ("vp", (2, 2), V_N**2 / M**2 + V_E**2 / N**2 + G_H, 0.9),
}


@pytest.mark.parametrize("finding", FINDINGS)
def test_finding(finding):
    name, entry, corrected, off = FINDINGS[finding]
    true = true_block(name)[entry]
    assert corrected == pytest.approx(true, rel=1e-8)
    assert abs(PRINTED[name][entry] - true) > off * abs(true)
    F, _ = dynamics(LLA, V, C, C @ FORCE, NOISE, CORRECTED)
    assert block_of(F, name)[entry] == pytest.approx(true, rel=1e-6)


def test_what_the_findings_do_not_name_is_printed_right():
    for name, printed in PRINTED.items():
        named = [entry for block, entry, *_ in FINDINGS.values() if block == name]
        right = np.array([[(i, j) not in named for j in range(3)] for i in range(3)])
        if name != "pp":  # compared in metres below
            np.testing.assert_allclose(
                printed[right], true_block(name)[right], rtol=1e-8, atol=1e-17
            )


def test_finding_d_alone_is_a_radius_and_not_only_a_sign():
    assert abs(-PRINTED["tv"][0, 1] / true_block("tv")[0, 1] - 1) == pytest.approx(
        abs(N / M - 1), rel=1e-6
    )
    assert abs(N / M - 1) > 2e-3


def test_finding_a_shows_when_two_solutions_are_integrated():
    """Two INS, velocities 5 and -8 m/s apart, 2 s: the attitude error is that of the corrected
    F_theta_v, not of the printed one."""
    lla, v = np.array([48 * DEG, 0.0, 0.0]), np.array([30.0, 20.0, 0.0])
    estimate, truth = (
        [lla.copy(), v.copy(), np.eye(3)],
        [lla.copy(), v + [5.0, -8.0, 0.0], np.eye(3)],
    )
    u, dv_n, dt = np.zeros(6), np.zeros(3), 0.02
    for _ in range(100):
        stationary_increments(*estimate, dt, u)
        for state in (estimate, truth):
            mechanize(*state, u[:3], u[3:], dt, dv_n)
    theta = Rotation.from_matrix(truth[2] @ estimate[2].T).as_rotvec()
    np.testing.assert_allclose(theta, [2.503e-6, 1.569e-6, -2.780e-6], atol=4e-9)
    printed = table_ii(lla, v)["tv"] @ [5.0, -8.0, 0.0] * 2
    np.testing.assert_allclose(theta, -printed, rtol=5e-3)


def test_finding_h_the_first_eccentricity_is_squared():
    """e = f(2 - f) is the square already: taken literally the radii are off by kilometres, in
    simulator and filter alike."""
    literal = FLATTENING * (2 - FLATTENING)
    x = 1 - literal**2 * np.sin(48 * DEG) ** 2
    assert (A * (1 - literal**2) / x**1.5, A / x**0.5) == pytest.approx((6378088, 6378216), abs=1)
    assert earth.radii(48 * DEG) == pytest.approx((6370736, 6389960), abs=1)
    assert literal == pytest.approx(E2) and np.sqrt(literal) == pytest.approx(0.0818191908)


@pytest.mark.parametrize("model", [CORRECTED, LITERAL])
def test_blocks_that_both_models_share(model):
    F, _ = dynamics(LLA, V, C, C @ FORCE, NOISE, model)
    np.testing.assert_allclose(
        F[3:6, 6:15], np.c_[-cross_matrix(C @ FORCE), -C, np.zeros((3, 3))], atol=1e-15
    )
    np.testing.assert_allclose(F[6:9, 6:15], np.c_[PRINTED["tt"], np.zeros((3, 3)), -C], atol=1e-15)
    np.testing.assert_allclose(F[0:3, 3:6], np.eye(3))
    # radii vary in F_pp: exact there
    np.testing.assert_allclose(
        F[0:3, 0:3], TRUE[0:3, 0:3], atol=6e-3 * np.abs(TRUE[0:3, 0:3]).max()
    )


@pytest.mark.parametrize("name", ["vp", "tp", "vv", "tv"])
def test_the_literal_model_is_table_ii(name):
    F, _ = dynamics(LLA, V, C, C @ FORCE, NOISE, LITERAL)
    printed = PRINTED[name] / SCALE if name[1] == "p" else PRINTED[name]
    np.testing.assert_allclose(F[ROWS[name[0]], ROWS[name[1]]], printed, rtol=1e-12, atol=1e-25)


@pytest.mark.parametrize("model, blocks", [(PRINTED_SIGNS, {"tp", "tv"}), (NO_GRADIENT, set())])
def test_a_partial_model_is_printed_in_its_part_and_corrected_in_the_rest(model, blocks):
    part, corrected, literal = (
        dynamics(LLA, V, C, C @ FORCE, NOISE, m)[0] for m in (model, CORRECTED, LITERAL)
    )
    if model == NO_GRADIENT:  # what the gradient brings, and nothing else
        corrected[5, 0] -= G_LAT / M
        corrected[5, 2] += G_H
        corrected[3, 0] -= NORTH_LAT / M
        corrected[3, 2] += NORTH_H
    for name in ("vp", "tp", "vv", "tv"):
        rows, columns = ROWS[name[0]], ROWS[name[1]]
        np.testing.assert_allclose(
            part[rows, columns],
            (literal if name in blocks else corrected)[rows, columns],
            rtol=1e-9,
            atol=1e-16,
        )


def test_gravity_of_latitude_alone_leaves_the_mechanization_and_its_derivative_without_height():
    """Specific force zero: after dt the velocity is g dt straight down, whatever the height, and F
    has dg/dlat at the ellipsoid, no dg/dh and nothing of a north component."""
    down = {}
    for height in (0.0, 3000.0):
        lla, v, attitude = np.array([LLA[0], 0.0, height]), np.zeros(3), np.eye(3)
        mechanize(lla, v, attitude, np.zeros(3), np.zeros(3), 1e-3, np.zeros(3), 0.0)
        down[height] = v[2] / 1e-3
        assert abs(v[0]) / 1e-3 < 1e-9
    assert down[0.0] == down[3000.0] == pytest.approx(gravity(LLA[0], 0.0), rel=1e-8)
    F, corrected = (
        dynamics(LLA, V, C, C @ FORCE, NOISE, model)[0] for model in (LATITUDE_GRAVITY, CORRECTED)
    )
    assert corrected[5, 2] - F[5, 2] == pytest.approx(-G_H, rel=1e-9)
    assert corrected[5, 0] - F[5, 0] == pytest.approx(
        (G_LAT - gravity(LLA[0] + 1e-30j, 0.0).imag / 1e-30) / M, rel=1e-6
    )
    corrected[3, 0] -= NORTH_LAT / M
    corrected[3, 2] += NORTH_H
    np.testing.assert_allclose(
        np.delete(F, 5, axis=0), np.delete(corrected, 5, axis=0), rtol=1e-7, atol=1e-16
    )
