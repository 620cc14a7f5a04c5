"""The nonlinear observer against a plain one in ECEF coordinates, its projection and its
monitor, and what the printed equations would do instead."""

from dataclasses import replace
from functools import cache

import numpy as np
import pymap3d
import pytest
from recordings import start, turning
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import filters
from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown.filters.observer import covariance, equations
from strapdown.filters.observer.gains import begin, implant
from strapdown.filters.observer.translation_gains import SPREAD
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss

pytestmark = pytest.mark.short
NOISE = Noise(3e-4, 3e-3, 2e-5, 2e-4, 0.0, 0.0)
RATE = 7.292115e-5
K1, K2, KI, ADAPTATION = 0.8, 0.5, 0.1, 0.3
CONSTANT = dict(
    bias_law="norm",
    start_time=1e-3,
    k1=K1,
    k2=K2,
    ki=KI,
    k1_start=K1,
    k2_start=K2,
    ki_start=KI,
    adaptation=ADAPTATION,
    kpp=0.4,
    kvp=0.05,
    kxp=0.01,
    kpv=0.2,
    kvv=0.5,
    kxv=0.15,
)
OFF = Rotation.from_rotvec([0.25, -0.3, 0.5])


@cache
def noiseless(seconds=15.0, rate=100.0):
    """A turning flight with the errors of an IMU and fixes of a millimetre."""
    return sd.simulate(
        turning(),
        seconds,
        "tactical",
        3,
        rate,
        Gnss(position_std=(1e-3,) * 3, velocity_std=(1e-3,) * 3),
    )


def off(recording):
    """An InitialState whose attitude is off by 37 deg and whose biases are off too."""
    truth = start(recording)
    rph = (OFF * recording.reference.rotation[0]).as_euler("ZYX")[::-1]
    return truth._replace(rph=tuple(rph), b_a=(0.02, -0.01, 0.03), b_g=(0.004, -0.003, 0.002))


def gravity(lla):
    """Normal gravity (m/s^2, downwards) by Somigliana and the second-order height term, written
    out."""
    a, f, gm = 6378137.0, 1 / 298.257223563, 3.986004418e14
    s2, e2 = np.sin(lla[0]) ** 2, f * (2 - f)
    surface = 9.7803253359 * (1 + 0.00193185265241 * s2) / np.sqrt(1 - e2 * s2)
    m = RATE**2 * a**3 * (1 - f) / gm
    return surface * (1 - 2 / a * (1 + f + m - 2 * f * s2) * lla[2] + 3 / a**2 * lla[2] ** 2)


def ned_axes(lla):
    """Rows north, east, down in e."""
    (sp, sl), (cp, cl) = np.sin(lla[:2]), np.cos(lla[:2])
    return np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0], [-cp * cl, -cp * sl, -sp]])


def plain_observer(recording, begin_at, parts=4):
    """Equations (1)-(3) of the paper, corrected, in ECEF, in small Euler steps; fixes and course as
    docs/explanation/observer.md has them.

    Returns the final (lla, v, C, b_a, b_g, xi).
    """
    lla = np.array(begin_at.lla)
    axes = ned_axes(lla)
    p = np.array(pymap3d.geodetic2ecef(*lla, deg=False))
    v, R = (
        axes.T @ begin_at.v_n,
        axes.T @ Rotation.from_euler("ZYX", begin_at.rph[::-1]).as_matrix(),
    )
    b_a, b_g, xi, square = (
        np.array(begin_at.b_a),
        np.array(begin_at.b_g),
        np.zeros(3),
        float(np.dot(begin_at.b_a, begin_at.b_a)),
    )
    spin, since, gains = (
        np.array([0, 0, RATE]),
        0.0,
        np.array([[0.4, 0.05, 0.01], [0.2, 0.5, 0.15]]),
    )
    position, velocity = recording.sources
    for k, t in enumerate(recording.imu.t):
        w, f = (
            recording.imu.dtheta[k] / recording.imu.dt[k],
            recording.imu.dv[k] / recording.imu.dt[k],
        )
        h = recording.imu.dt[k] / parts
        for _ in range(parts):
            force = R @ (f - b_a) + xi
            sigma = K1 * np.cross(
                (f - b_a) / np.linalg.norm(f - b_a), R.T @ force / np.linalg.norm(force)
            )
            lla = np.array(pymap3d.ecef2geodetic(*p, deg=False))
            phi, theta = np.r_[1.0, -2 * f], np.r_[square, b_a]
            scale = np.array([1.0, 1, 1, 1])
            slope = (
                ADAPTATION
                * scale
                * phi
                * (force @ force - f @ f - phi @ theta)
                / (phi @ (scale * phi))
            )
            p, v_next = (
                p + h * v,
                v + h * (-2 * np.cross(spin, v) + force + ned_axes(lla).T @ [0, 0, gravity(lla)]),
            )
            p, v = p + 0.5 * h * (v_next - v), v_next
            xi = xi - h * R @ np.cross(sigma, f - b_a)
            R = (
                Rotation.from_rotvec(-h * spin).as_matrix()
                @ R
                @ Rotation.from_rotvec(h * (w - b_g + sigma)).as_matrix()
            )
            b_a, square, b_g = (
                b_a + h * slope[1:],
                max(square + h * slope[0], 0),
                b_g - h * KI * sigma,
            )
        since += recording.imu.dt[k]
        for row in np.flatnonzero(np.abs(position.t - t) < 1e-6):
            e = np.array(pymap3d.geodetic2ecef(*position.y[row], deg=False)) - p
            p, v, xi = p + gains[0, 0] * e, v + gains[0, 1] * e, xi + gains[0, 2] * e
            axes = ned_axes(np.array(pymap3d.ecef2geodetic(*p, deg=False)))
            e, C = axes.T @ velocity.y[row] - v, axes @ R
            angle = np.arctan2(velocity.y[row, 1], velocity.y[row, 0]) - np.arctan2(
                C[1, 0], C[0, 0]
            )
            angle = (angle + np.pi) % (2 * np.pi) - np.pi
            turn = (angle - 2 * np.arctan(np.tan(angle / 2) * np.exp(-K2 * min(since, 1.0)))) * C[2]
            since, before = 0.0, R
            R = R @ Rotation.from_rotvec(turn).as_matrix()
            xi, b_g = xi + (before - R) @ (f - b_a), b_g - KI * turn
            p, v, xi = p + gains[1, 0] * e, v + gains[1, 1] * e, xi + gains[1, 2] * e
    lla = np.array(pymap3d.ecef2geodetic(*p, deg=False))
    axes = ned_axes(lla)
    return lla, axes @ v, axes @ R, b_a, b_g, axes @ xi


def distance(rate):
    """Differences between the library's observer and the plain one at that IMU rate (SI), and
    the library's solution."""
    recording = noiseless(rate=rate)
    # as published: every fix is used
    ungated = replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))
    ours = sd.fuse(ungated, "nlo", start=off(recording), noise=NOISE, options=CONSTANT)
    lla, v, C, b_a, b_g, xi = plain_observer(recording, off(recording), round(400 / rate))
    end, own = (
        ours.trajectory,
        [ours.columns[f"xi_{axis} [m/s^2]"][-1] for axis in ("north", "east", "down")],
    )
    return np.array(
        [
            np.linalg.norm(displacement(lla, end.lla[-1])),
            np.linalg.norm(v - end.v_n[-1]),
            (Rotation.from_matrix(C) * end.rotation[-1].inv()).magnitude(),
            np.linalg.norm(b_g - ours.b_g[-1]),
            np.linalg.norm(b_a - ours.b_a[-1]),
            np.linalg.norm(xi - own),
        ]
    ), ours


@pytest.mark.deep
def test_it_is_the_observer_in_ecef_coordinates_to_first_order_in_the_sample():
    coarse, _ = distance(50.0)
    fine, ours = distance(100.0)
    assert (fine < [5e-4, 1e-3, 3e-4, 5e-5, 2e-4, 2e-3]).all()
    assert (coarse[3:] / fine[3:] > 1.6).all()
    assert (
        np.abs(ours.b_g[-1] - (0.004, -0.003, 0.002)).max() > 0.01
        and np.abs(ours.b_a[-1] - (0.02, -0.01, 0.03)).max() > 0.05
    )


@pytest.fixture(scope="module")
def predict():
    """The compiled kernel of a prediction, as Python calls it."""
    nlo = filters.find("nlo")
    compile_kernel(nlo.predict)
    return nlo.predict


def belief(at=None, **options):
    """A belief at `at` (an InitialState) or level and at rest."""
    at = at or InitialState(
        0.0, (0.8, 0.1, 300.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15
    )
    made = at.belief(covariance.SLOTS.zeros())
    begin(
        made.workspace[: equations.OBSERVER.size],
        at,
        NOISE,
        **{"start_time": 1e-3, "outage_after": 10.0, **options},
    )
    return made


def force_of_observer(b):
    return b.C_nb @ b.f + b.workspace[equations.XI]


def test_a_turn_by_sigma_leaves_the_force_where_it_was_with_the_bias_taken_off_and_not_without():
    """Row g: xi' = - R S(sigma) (f - b). Both terms of f_n must hold the same f; with f_IMU in
    one of them f_n moves by sigma x R b."""
    b, s = belief(), np.array([0.2, -0.3, 0.5])
    b.f[:], b.workspace[equations.XI] = (1.0, -2.0, -9.0), (0.3, 0.1, -0.2)
    before, C = force_of_observer(b), b.C_nb.copy()
    equations.turn(b, *s)
    assert np.abs(force_of_observer(b) - before).max() < 1e-14 and np.abs(b.C_nb - C).max() > 0.1
    assert np.abs(b.C_nb - C @ Rotation.from_rotvec(s).as_matrix()).max() < 1e-14
    bias, sigma, xi_rate = np.array([0.1, 0.2, -0.1]), s, lambda f: -C @ np.cross(s, f)
    rate_of_rotated = C @ np.cross(sigma, b.f)
    assert (
        np.abs(rate_of_rotated + xi_rate(b.f)).max()
        < 1e-14
        < 0.01
        < np.abs(rate_of_rotated + xi_rate(b.f + bias)).max()
    )


def test_the_projection_keeps_the_bound_and_does_nothing_inside():
    """Row a: Proj acts on the estimate; inside the ball it is the identity, beyond it fades, and
    what leads inwards always passes."""
    rng, bound, b = np.random.default_rng(1), 0.1, np.zeros(3)
    for _ in range(3000):
        inside, before, d = (
            np.linalg.norm(b) <= bound,
            b.copy(),
            rng.normal(0, 0.01, 3) + [0.004, 0, 0],
        )
        equations.add_projected(b, *d, bound)
        assert np.linalg.norm(b) <= equations.OUTER * bound * (1 + 1e-12)
        if (
            inside
            and np.linalg.norm(before + d) <= bound
            or before @ d <= 0
            and np.linalg.norm(before + d) <= bound
        ):
            assert np.array_equal(b, before + d)
    assert np.linalg.norm(b) > 0.9 * bound


def test_adaptation_uses_what_is_measured_and_the_square_of_the_bias():
    """Rows c and d: |f - b|^2 = |f|^2 - 2 f b + |b|^2 is linear in [|b|^2, b], not in [|b|, b];
    with the printed y_f the error is zero at once."""
    f, b, guess = (
        np.array([1.0, -2.0, -9.0]),
        np.array([0.2, -0.1, 0.3]),
        np.array([0.1, 0.0, 0.05]),
    )
    phi = np.r_[1.0, -2 * f]
    measured = (f - b) @ (f - b) - f @ f
    assert (
        abs(measured - phi @ np.r_[b @ b, b])
        < 1e-12
        < 0.1
        < abs(measured - phi @ np.r_[np.linalg.norm(b), b])
    )
    printed = np.linalg.norm(guess) - 2 * f @ guess
    assert (
        abs(printed - phi @ np.r_[np.linalg.norm(guess), guess]) < 1e-12
        and abs(measured - phi @ np.r_[guess @ guess, guess]) > 0.5
    )


def test_adaptation_finds_a_bias_that_is_excited_and_survives_an_impact(predict):
    """The IMU turns about all axes at rest in n, with a bias; xi is what f_n lacks. An impact of
    16 g for one sample moves little."""
    rng, true, dt = np.random.default_rng(2), np.array([0.05, -0.08, 0.1]), 0.1
    b = belief(bias_law="norm", k1=1e-9, ki=0.0, k1_start=1e-9, ki_start=0.0, adaptation=1.0)
    b.workspace[equations.FADE] = 0.0  # the start is over
    for _ in range(1500):
        C = Rotation.random(random_state=rng).as_matrix()
        f = C.T @ [0, 0, -9.8]
        b.C_nb[:], b.v_n[:], b.lla[:], b.workspace[equations.SINCE_FIX] = (
            C,
            0.0,
            (0.8, 0.1, 300.0),
            0.0,
        )
        b.workspace[equations.XI] = C @ (f - (f + true - b.b_a))
        predict(b, np.r_[0.0, 0, 0, (f + true) * dt], dt, NOISE)
    assert (
        np.abs(b.b_a - true).max() < 2e-3
        and abs(b.workspace[equations.SQUARE] - true @ true) < 2e-2
    )
    assert equations.smallest(b.workspace) > 0.05
    before = b.b_a.copy()
    predict(b, np.r_[0.0, 0, 0, 157.0 * dt, 0, 0], dt, NOISE)
    # along an impact the step is that of any other sample
    assert np.linalg.norm(b.b_a - before) < 1e-4


def test_the_monitor_is_the_smallest_eigenvalue(predict):
    b, rng = belief(), np.random.default_rng(3)
    for _ in range(5):
        A = rng.normal(size=(4, 4))
        A = A @ A.T
        b.workspace[equations.MOMENT] = A[np.triu_indices(4)]
        assert abs(equations.smallest(b.workspace) - np.linalg.eigvalsh(A)[0]) < 1e-8 * np.trace(A)
    still = belief()
    for _ in range(500):
        predict(still, np.r_[0.0, 0, 0, 0, 0, -0.98], 0.1, NOISE)
    # nothing but gravity along one axis: never excited
    assert equations.smallest(still.workspace) < 1e-9


def test_in_an_outage_biases_are_held_bit_for_bit_and_xi_stands_still_in_e(predict):
    at = InitialState(
        0.0,
        (0.8, 0.1, 300.0),
        (200.0, 150.0, 0.0),
        (0.1, 0.2, 0.3),
        (0.01, 0.02, 0.03),
        (1e-3, 2e-3, 3e-3),
        (1.0,) * 15,
    )
    b = belief(at, outage_after=1.0)
    b.workspace[equations.XI], b.workspace[equations.SINCE_FIX] = (
        (0.3, -0.4, 0.2),
        5.0,
    )
    in_e = ned_axes(b.lla).T @ b.workspace[equations.XI]
    for _ in range(600):
        b.workspace[equations.SINCE_HEADING] = 0.0  # a heading is there, and not injected
        predict(b, np.r_[0.0, 0, 0, 0.1, 0, -0.98], 0.1, NOISE)
    assert (
        np.array_equal(b.b_a, at.b_a)
        and np.array_equal(b.b_g, at.b_g)
        and b.workspace[equations.FADE] == equations.FADE_AT_START
    )
    xi = b.workspace[equations.XI]
    assert (
        np.abs(ned_axes(b.lla).T @ xi - in_e).max()
        < 1e-7
        < 1e-4
        < np.abs(xi - (0.3, -0.4, 0.2)).max()
    )


def test_printed_course_turns_a_right_attitude_and_the_tilt_compensated_does_not():
    """Row b: at the truth, 28 deg of bank and no crab, the printed vector is not that of north."""
    recording, truth = noiseless(), start(noiseless())
    exact = truth._replace(
        rph=tuple(recording.reference.rph[0]),
        v_n=tuple(recording.reference.v_n[0]),
        lla=tuple(recording.reference.lla[0]),
    )
    errors = {
        course: sd.errors(
            sd.fuse(recording, "nlo", start=exact, noise=NOISE, options={"course": course}),
            recording.reference,
        ).attitude
        for course in ("tilt-compensated", "printed")
    }
    worst = {
        course: np.degrees(np.linalg.norm(error, axis=1).max()) for course, error in errors.items()
    }
    assert worst["tilt-compensated"] < 0.5 and worst["printed"] > 3


def test_a_block_inside_another_filter_is_the_same_observer():
    at = off(noiseless())
    workspace = np.zeros(40 + equations.EMBEDDED.size)
    implant(workspace[40:], at, NOISE)
    own = at.belief(covariance.SLOTS.zeros())
    begin(own.workspace[: equations.OBSERVER.size], at, NOISE)
    state = np.r_[
        own.lla,
        own.v_n,
        own.C_nb.ravel(),
        own.b_a,
        own.b_g,
        own.omega,
        own.f,
        own.workspace[: equations.OBSERVER.size],
    ]
    assert np.array_equal(workspace[40:], state, equal_nan=True) and not workspace[:40].any()


def with_xi(**options):
    """A belief at rest with fixes just now, an xi across the specific force and biases."""
    b = belief(**options)
    b.workspace[equations.XI], b.b_a[:], b.b_g[:] = (
        (0.6, -0.4, 0.2),
        (0.05, -0.03, 0.02),
        (1e-3, 2e-3, -1e-3),
    )
    b.workspace[equations.FADE] = 0.0
    return b


SAMPLE = np.r_[0.02, -0.03, 0.05, 0.03, -0.02, -0.98]


def test_xi_accelerates_in_n_however_the_body_turns_within_a_sample(predict):
    """The velocity that xi brings is xi dt to second order in the 0.06 rad turned; kept still in
    the body it would be half a turn off, 3 %."""
    b, without, dt = with_xi(), with_xi(), 0.1
    xi = b.workspace[equations.XI].copy()
    without.workspace[equations.XI] = 0.0
    for one in (b, without):
        one.workspace[equations.SINCE_FIX] = 1e3  # in an outage nothing else acts
        predict(one, SAMPLE, dt, NOISE)
    assert np.abs(b.v_n - without.v_n - xi * dt).max() < 1e-3 * np.linalg.norm(xi) * dt


@pytest.mark.parametrize("since", [0.0, 1e3])
def test_over_samples_made_up_in_a_gap_nothing_is_injected(predict, since):
    """Not even towards a frozen course: attitude by the gyros alone, xi and biases as they were."""
    ends = {}
    for name, noise in (("made up", NOISE._replace(accel=1.0)), ("measured", NOISE)):
        b = ends[name] = with_xi(course="frozen", k1=0.3, k2=0.03)
        b.workspace[equations.COURSE], b.workspace[equations.SINCE_FIX] = 1.0, since
        begun = b.b_g.copy(), b.b_a.copy(), b.workspace[equations.XI].copy()
        predict(b, SAMPLE, 0.1, noise)
    gap = ends["made up"]
    assert (
        np.array_equal(gap.b_g, begun[0])
        and np.array_equal(gap.b_a, begun[1])
        and np.array_equal(gap.workspace[equations.XI], begun[2])
    )
    # but for the Earth's turn
    assert (
        np.abs(gap.C_nb - Rotation.from_rotvec(SAMPLE[:3] - 0.1 * begun[0]).as_matrix()).max()
        < 1e-4
    )
    assert np.abs(ends["measured"].C_nb - gap.C_nb).max() > 1e-3


@pytest.mark.parametrize(
    "fade, share", [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0), (equations.FADE_AT_START, 0.0)]
)
def test_adaptation_comes_in_as_the_start_fades_out(predict, fade, share):
    """Its step in closed form, docs/explanation/observer.md, times what the start leaves of it."""
    b, dt = (
        with_xi(bias_law="norm", k1=1e-9, k1_start=1e-9, ki=0.0, ki_start=0.0, adaptation=1.0),
        0.1,
    )
    b.workspace[equations.FADE], b.workspace[equations.SQUARE], b_a, xi = (
        fade,
        0.01,
        b.b_a.copy(),
        b.workspace[equations.XI].copy(),
    )
    m = SAMPLE[3:] / dt
    e = (m - b_a + xi) @ (m - b_a + xi) - m @ m - 0.01 + 2 * m @ b_a
    step = share * dt * e / (1 + 4 * m @ m) * -2 * m  # accel_bound is 1 m/s^2
    predict(b, SAMPLE, dt, NOISE)
    assert np.abs(b.b_a - b_a - step).max() < 1e-9 and (share == 0 or np.abs(step).max() > 1e-3)


def test_gaps_add_the_velocity_they_spread_to_what_a_fix_may_correct(predict):
    """(a^2 - a0^2) seconds, of the noise a made-up sample has and the IMU's a0; the samples that
    are there add nothing."""
    b, own = belief(), equations.MOTION
    for noise in (NOISE, NOISE._replace(accel=1.0), NOISE._replace(accel=1.0), NOISE):
        predict(b, np.r_[0.0, 0, 0, 0, 0, -0.98], 0.1, noise)
    assert b.workspace[own][SPREAD] == pytest.approx(0.2 * (1.0 - NOISE.accel**2), rel=1e-12)
