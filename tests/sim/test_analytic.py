"""Profiles and lifted functions against their definitions: sums of ramps, integrals, complex
functions."""

import numpy as np
import pytest

from strapdown.sim.analytic import MotionProfile, arctangent, cosine, sine, waves
from strapdown.sim.trajectory import ramp, ramp_rate

PROFILE = MotionProfile.of(3.0, [4.0, 10.0, 5.0, np.inf], [0.0, 2.0, -1.0, 0.5], 0.5)
T = np.linspace(0, 30, 601)


def test_a_profile_is_the_integral_of_its_ramps():
    kinks = [(4.0, 2.0), (14.0, -3.0), (19.0, 1.5)]
    slope = sum(jump * ramp(T, at, 0.5) for at, jump in kinks)
    np.testing.assert_allclose(PROFILE.rate(T), slope, atol=1e-13)
    softplus = sum(jump * (0.25 * np.logaddexp(0, 4 * (T - at))) for at, jump in kinks)
    np.testing.assert_allclose(PROFILE(T), 3.0 + softplus, atol=1e-12)


def test_slopes_of_complex_times_are_exact():
    z = T + 1e-20j
    bend = sum(jump * ramp_rate(T, at, 0.5) for at, jump in [(4.0, 2.0), (14.0, -3.0), (19.0, 1.5)])
    np.testing.assert_allclose(PROFILE(z).imag / 1e-20, PROFILE.rate(T), atol=1e-13)
    np.testing.assert_allclose(PROFILE.rate(z).imag / 1e-20, bend, atol=1e-12)
    for ours, numpys in ((sine, np.sin), (cosine, np.cos), (arctangent, np.arctan)):
        np.testing.assert_allclose(ours(z), numpys(z), rtol=1e-14)
        np.testing.assert_allclose(ours(T), numpys(T), rtol=1e-15)


def test_any_shape_and_order_of_times_gives_the_same():
    mixed = np.random.default_rng(1).permutation(T)[:600].reshape(20, 30)
    flat = MotionProfile.of(1.0, [5.0], [2.0], 1.0)
    assert (
        PROFILE(4.2) == pytest.approx(float(PROFILE(np.array([4.2]))[0]), abs=0)
        and flat(2.0) == 5.0
    )
    for function in (PROFILE, PROFILE.rate):
        np.testing.assert_allclose(function(mixed), np.interp(mixed, T, function(T)), atol=1e-12)
        assert np.iscomplexobj(function(mixed + 1e-20j)) and not np.iscomplexobj(function(mixed))


def test_corners_of_short_lines_are_rounded_less():
    profile = MotionProfile.of(0.0, [1.0, 10.0, 10.0, np.inf], [0.0, 1.0, 2.0, 2.0], 2.0)
    np.testing.assert_allclose(profile.widths, [0.2, 2.0])  # a line that goes on has no kink
    assert profile.at.tolist() == [1.0, 11.0]


def test_waves_are_sums_of_sines():
    np.testing.assert_allclose(
        waves(T, ((2.0, 7.0, 0.3), (1.0, 3.0, 0.0))),
        2 * np.sin(2 * np.pi * T / 7 + 0.3) + np.sin(2 * np.pi * T / 3),
        atol=1e-14,
    )
