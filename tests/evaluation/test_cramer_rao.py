"""The Cramer-Rao bound: against Tichavsky's information recursion, a closed form, and a filter
that attains it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import strapdown as sd
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState, Noise
from strapdown.core.mathematics.error_dynamics import dynamics
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.evaluation.cramer_rao import cramer_rao
from strapdown.geometry.geodesy import displace_lla
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion, increments, sample, static

RATE = 20
NOISE = Noise(
    gyro=1e-4, accel=1e-3, gyro_bias=1e-6, accel_bias=1e-4, gyro_decay=1 / 300, accel_decay=1 / 300
)
STD = np.r_[[2.0] * 3, [0.2] * 3, [5e-3, 5e-3, 2e-2], [2e-2] * 3, [1e-4] * 3]
FIX_STD = np.array([1.0, 1.5, 2.0])
PARKED = static((DEG * 47.0, DEG * 8.0, 500.0))
TURNING = Motion(
    "turning",
    (DEG * 47.0, DEG * 8.0, 500.0),
    lambda t: (20 * np.cos(0.2 * t), 20 * np.sin(0.2 * t), 0.3 * np.sin(t)),
    lambda t: (0.4 + 0 * t, 0.05 * np.sin(0.5 * t), 0.2 * t),
)


def ideal(motion, duration, fixes=True):
    """(recording without any error, its exact start): position fixes once per second."""
    t = np.arange(duration * RATE + 1) / RATE
    truth = sample(motion, t)
    at = slice(RATE, None, RATE)
    source = Source("position", t[at], truth.lla[at], np.tile(FIX_STD, (duration, 1)))
    heading, pitch, roll = truth.rotation[0].as_euler("ZYX")
    start = InitialState(
        0.0,
        tuple(truth.lla[0]),
        tuple(truth.v_n[0]),
        (roll, pitch, heading),
        (0.0,) * 3,
        (0.0,) * 3,
        tuple(STD),
    )
    return Recording(increments(motion, t), (source,) if fixes else (), truth), start


def van_loan(motion, start, stop):
    """Phi and Q_d (15, 15) of one second along the truth, from F at the middle of each sample
    and matrix exponentials. Van Loan (1978)."""
    edges = np.linspace(start, stop, round((stop - start) * RATE) + 1)
    truth = sample(motion, np.r_[0.0, edges[:-1] + 0.5 / RATE])
    lla, v, C = truth.lla[1:], truth.v_n[1:], truth.rotation[1:].as_matrix()
    force = increments(motion, edges).dv * RATE
    Phi, Q = np.eye(15), np.zeros((15, 15))
    for k in range(len(lla)):
        F, density = dynamics(lla[k], v[k], C[k], C[k] @ force[k], NOISE)
        both = expm(np.block([[-F, density], [np.zeros((15, 15)), F.T]]) / RATE)
        step = both[15:, 15:].T
        Phi, Q = step @ Phi, step @ Q @ step.T + step @ both[:15, 15:]
    return Phi, Q


def information(motion, duration):
    """(duration, 15, 15) bounds after each fix by J' = D22 - D21 (J + D11)^-1 D12; states in
    units of STD, so that Q can be inverted."""
    J, bounds = np.eye(15), []
    H = np.eye(3, 15) * STD
    for second in range(duration):
        Phi, Q = van_loan(motion, second, second + 1)
        Phi, precision = Phi * STD / STD[:, None], np.linalg.inv(Q / STD / STD[:, None])
        D11, D12, D22 = (
            Phi.T @ precision @ Phi,
            -Phi.T @ precision,
            precision + H.T @ np.diag(FIX_STD**-2) @ H,
        )
        J = D22 - D12.T @ np.linalg.solve(J + D11, D12)
        bounds.append(np.linalg.inv(J) * STD * STD[:, None])
    return np.array(bounds)


@pytest.mark.short
@pytest.mark.parametrize("motion", [PARKED, TURNING], ids=lambda motion: motion.name)
def test_bound_is_that_of_the_information_recursion(motion):
    recording, start = ideal(motion, 30)
    bound = cramer_rao(recording, start, NOISE, every=RATE)
    twin = information(motion, 30)
    np.testing.assert_allclose(bound.t, np.arange(1, 31))
    deviations = np.sqrt(np.diagonal(twin, axis1=1, axis2=2))
    np.testing.assert_allclose(bound.std, deviations, rtol=2e-4)  # of discretisation
    correlation = lambda P, s: P / s[:, None] / s[:, :, None]
    np.testing.assert_allclose(
        correlation(bound.covariance, bound.std), correlation(twin, deviations), atol=2e-4
    )


@pytest.mark.short
def test_bound_without_fixes_is_the_closed_form_of_the_down_channel():
    """At rest, constant bias: var = p0 + t^2 v0 + t^4/4 b0 + t^3/3 q_v; the gravity gradient
    adds 3e-6 t^2/2 of it within 20 s."""
    recording, start = ideal(PARKED, 20, fixes=False)
    quiet = NOISE._replace(accel_decay=0.0, accel_bias=0.0)
    bound = cramer_rao(recording, start, quiet, every=RATE)
    t = bound.t
    expected = (
        STD[2] ** 2 + (STD[5] * t) ** 2 + (STD[11] * t**2 / 2) ** 2 + quiet.accel**2 * t**3 / 3
    )
    np.testing.assert_allclose(bound.std[:, 2], np.sqrt(expected), rtol=5e-4)


@pytest.mark.short
def test_lengths_are_roots_of_traces():
    recording, start = ideal(PARKED, 5)
    bound = cramer_rao(recording, start, NOISE)
    assert bound.t.shape == (100,) and bound.covariance.shape == (100, 15, 15)
    for k, name in enumerate(("position", "velocity", "attitude", "accel_bias", "gyro_bias")):
        block = bound.covariance[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(getattr(bound, name), np.sqrt(np.trace(block, axis1=1, axis2=2)))


def ratios(told=1.0, runs=200, duration=60):
    """Mean square of the closed loop's position, velocity and attitude error over that of the bound
    at the last fix, and its std, (3,) each.

    `told`: the IMU's white noise in the bound and in the filter, in true ones.
    """
    perfect, start = ideal(TURNING, duration)
    truth, imu, rng = perfect.reference, perfect.imu, np.random.default_rng(11)
    noise = NOISE._replace(gyro=told * NOISE.gyro, accel=told * NOISE.accel)
    bound = cramer_rao(perfect, start, noise, every=RATE)
    squares = []
    for _ in range(runs):
        b_a, b_g = (
            markov(rng, len(imu.t), STD[k], decay, drive)
            for k, decay, drive in (
                (9, NOISE.accel_decay, NOISE.accel_bias),
                (12, NOISE.gyro_decay, NOISE.gyro_bias),
            )
        )
        white = rng.standard_normal((2, len(imu.t), 3)) / np.sqrt(RATE)
        noisy = imu._replace(
            dtheta=imu.dtheta + b_g / RATE + NOISE.gyro * white[0],
            dv=imu.dv + b_a / RATE + NOISE.accel * white[1],
        )
        position = perfect.sources[0]
        fixes = replace(
            position,
            y=displace_lla(position.y, FIX_STD * rng.standard_normal((duration, 3))),
            gate=np.inf,
        )
        solution = sd.fuse(
            Recording(noisy, (fixes,)),
            start=draw_start(truth, STD, rng),
            noise=noise,
            every=RATE * duration,
        )
        e = sd.errors(solution, truth)
        squares.append([np.square(part[-1]).sum() for part in (e.position, e.velocity, e.attitude)])
    least = np.array([bound.position[-1], bound.velocity[-1], bound.attitude[-1]]) ** 2
    # of a mean of Gaussian quadratic forms
    spread = [
        np.sqrt(2 * np.square(bound.covariance[-1, k : k + 3, k : k + 3]).sum() / runs)
        for k in (0, 3, 6)
    ]
    return np.mean(squares, axis=0) / least, spread / least


def markov(rng, rows, deviation, decay, drive):
    """Biases (rows, 3) that begin with `deviation` and follow db = -decay b dt + drive dw."""
    keep = np.exp(-decay / RATE)
    steps = drive * np.sqrt((1 - keep**2) / (2 * decay)) * rng.standard_normal((rows, 3))
    steps[0] = deviation * rng.standard_normal(3)
    for k in range(1, rows):
        steps[k] += keep * steps[k - 1]
    return steps


@pytest.mark.deep
def test_the_closed_loop_attains_the_bound_where_the_problem_is_nearly_linear():
    ratio, spread = ratios()
    assert np.all(np.abs(ratio - 1) < 4 * spread), (ratio, spread)


@pytest.mark.deep
def test_a_wrong_bound_is_seen():
    ratio, spread = ratios(told=3.0)
    assert np.any(np.abs(ratio - 1) > 5 * spread)


@pytest.mark.short
def test_what_is_not_ideal_is_refused():
    recording, start = ideal(TURNING, 10)
    with pytest.raises(DataError, match="needs the true trajectory"):
        cramer_rao(replace(recording, reference=None), start, NOISE)
    biased = recording.imu._replace(dv=recording.imu.dv + 0.05 / RATE)
    with pytest.raises(DataError, match="from the true position at .* give an ideal recording"):
        cramer_rao(replace(recording, imu=biased), start, NOISE)
    with pytest.raises(DataError, match="from the true attitude at 0.* s"):
        cramer_rao(
            recording.between(0.0, 1.0),
            start._replace(rph=(start.rph[0], start.rph[1], start.rph[2] + 0.01)),
            NOISE,
        )
    far = replace(recording.sources[0], y=recording.sources[0].y + [0, 0, 100.0])
    with pytest.raises(DataError, match="fixes of position were rejected"):
        cramer_rao(replace(recording, sources=(far,)), start, NOISE)
