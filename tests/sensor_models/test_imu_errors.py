"""The kernel of IMU errors: the same bits in blocks, without the compiler and beside other threads;
its recursions against scipy's on the same numbers."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from strapdown.core.loop.contract import Imu
from strapdown.sensor_models.errors import Triad, WarmUp
from strapdown.sensor_models.imu import ImuSpec
from strapdown.sensor_models.imu_errors import RATES, simulate_errors
from strapdown.sensor_models.noise import FLICKER_TIMES, FLICKER_VARIANCE
from strapdown.sensor_models.streams import RandomStream

N, DT = 301, 0.01
LASTING = {"noise": 0.01, "turn_on_bias": 0.2, "bias_walk": 0.3, "flicker": 0.4}
ACCEL = Triad(
    **LASTING,
    gauss_markov=0.5,
    time_constant=0.7,
    scale_factor=0.01,
    misalignment=0.02,
    quantisation=1e-3,
    saturation=11.0,
    temperature=((0, 0, 1, 0), (40, 2, 1, -4)),
)
GYRO = replace(ACCEL, g_sensitivity=0.03, time_constant=0.2, quantisation=2e-4)
SPEC = ImuSpec("all", GYRO, ACCEL, warm_up=WarmUp(10.0, 30.0, 1.0))
UNEVEN = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.02, N))
EVEN = DT * np.arange(1, N + 1)


def moving(t, seed=1):
    """Error-free samples at times t of some motion."""
    rng, dt = np.random.default_rng(seed), np.diff(np.r_[0.0, t])
    return Imu(
        t,
        dt,
        rng.uniform(-3, 3, (len(t), 3)) * dt[:, None],
        rng.uniform(-9, 9, (len(t), 3)) * dt[:, None],
    )


def simulated(spec, imu, seed=3, ends=(), kernel=simulate_errors):
    """(measured, biases), (n, 6) each, in blocks that end there."""
    shared, own, rates = (
        spec.shared_errors(imu),
        spec.draw_constants(RandomStream.of(seed)),
        np.zeros(RATES),
    )
    u, bias = np.full((2, len(imu.t), 6), np.nan)
    for rows in zip((0, *ends), (*ends, len(imu.t))):
        block = slice(*rows)
        kernel(np.array(rows), shared, own, rates, u[block], bias[block])
    return u, bias


@pytest.mark.short
@pytest.mark.parametrize("t", [EVEN, UNEVEN], ids=["even", "uneven"])
def test_blocks_of_any_length_give_the_bits_of_one(t):
    imu = moving(t)
    whole = simulated(SPEC, imu)
    for ends in ((1,), (1, 2, 3, 50, 51, 300), (128, 256), tuple(range(7, N, 7))):
        assert np.array_equal(simulated(SPEC, imu, ends=ends), whole)
    made, b_a, b_g = SPEC.corrupt(imu, 3)
    assert np.array_equal(np.c_[made.dtheta, made.dv], whole[0])
    assert np.array_equal(np.c_[b_g, b_a], whole[1])


def test_compiled_code_and_plain_python_give_the_same_bits():
    imu = moving(UNEVEN[:40])
    plain = simulated(SPEC, imu, kernel=simulate_errors.py_func)
    assert np.array_equal(simulated(SPEC, imu), plain)


def test_threads_simulate_the_same():
    imu = moving(EVEN)
    alone = [simulated(SPEC, imu, seed) for seed in range(16)]
    with ThreadPoolExecutor(4) as pool:
        beside = list(pool.map(lambda seed: simulated(SPEC, imu, seed), range(16)))
    assert np.array_equal(alone, beside)


def by_scipy(triad, name, t, seed):
    """Biases (n, 3) and white noise of one triad on the same random numbers."""
    of, dt = RandomStream.of(seed).child(name).child, DT

    def markov(white, time):
        keep = np.exp(-dt / time)
        white[1:] *= np.sqrt(-np.expm1(-2 * dt / time))
        return lfilter([1.0], [1.0, -keep], white, axis=0)

    bias = triad.turn_on_bias * of("turn_on_bias").standard_normal(3)
    walk = of("bias_walk").standard_normal((len(t), 3))
    walk[0] = 0
    bias = bias + triad.bias_walk * np.sqrt(dt) * np.cumsum(walk, axis=0)
    if triad.gauss_markov:
        white = of("gauss_markov").standard_normal((len(t), 3))
        bias += triad.gauss_markov * markov(white, triad.time_constant)
    white = of("flicker").standard_normal((len(t), 22))
    for k, time in enumerate(FLICKER_TIMES):
        part = markov(white[:, 3 * k : 3 * k + 3].copy(), time)
        bias += triad.flicker * np.sqrt(FLICKER_VARIANCE) * part
    return bias, triad.noise * np.sqrt(dt) * of("noise").standard_normal((len(t), 3))


def test_noise_and_biases_are_those_of_their_recursions():
    spec = ImuSpec(
        "lasting", Triad(**LASTING), Triad(**LASTING, gauss_markov=0.5, time_constant=0.7)
    )
    imu = Imu(EVEN, np.full(N, DT), np.zeros((N, 3)), np.zeros((N, 3)))
    made, b_a, b_g = spec.corrupt(imu, 8)
    for triad, name, bias, samples in (
        (spec.gyro, "gyro", b_g, made.dtheta),
        (spec.accel, "accel", b_a, made.dv),
    ):
        expected, white = by_scipy(triad, name, EVEN, 8)
        np.testing.assert_allclose(bias, expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(samples, expected * DT + white, rtol=0, atol=1e-11)


def test_terms_come_in_their_order():
    """Distortion of what is true, then bias, then whole steps, then full scale; by hand."""
    terms = {"turn_on_bias": 0.2, "scale_factor": 0.01, "misalignment": 0.02}
    gyro = Triad(**terms, g_sensitivity=0.03, quantisation=2e-4, saturation=2.5)
    spec, imu = ImuSpec("by hand", gyro, Triad()), moving(EVEN)
    of = RandomStream.of(4).child("gyro").child
    angles = 0.02 * of("misalignment").standard_normal((3, 3)) * (1 - np.eye(3))
    matrix = np.eye(3) + np.diag(0.01 * of("scale_factor").standard_normal(3)) + angles
    felt = 0.03 * of("g_sensitivity").standard_normal((3, 3))
    x = imu.dtheta @ matrix.T + imu.dv @ felt.T
    x += 0.2 * of("turn_on_bias").standard_normal(3) * imu.dt[:, None]
    counted = np.floor(np.cumsum(np.vstack([of("quantisation").random(3), x / 2e-4]), axis=0))
    full = 2.5 * imu.dt[:, None]
    expected = np.clip(np.diff(counted, axis=0) * 2e-4, -full, full)
    made = spec.corrupt(imu, 4)[0]
    np.testing.assert_allclose(made.dtheta, expected, rtol=0, atol=1e-12)
    assert np.abs(expected).max() == full.max() and np.array_equal(made.dv, imu.dv)


def test_the_two_triads_draw_apart():
    same = Triad(noise=0.1)
    made = ImuSpec("white", same, same).corrupt(
        Imu(EVEN, np.full(N, DT), np.zeros((N, 3)), np.zeros((N, 3))), 1
    )[0]
    assert not np.isclose(made.dtheta, made.dv).any()
