"""Whitened innovations, which the loop tests: their squares add up to the NIS in every filter that
gates, and where the filter is right each is N(0, 1)."""

from functools import cache

import numpy as np
import pytest

import strapdown as sd
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.trajectory import demo_flight

SECONDS = 60.0


@cache
def recording():
    return sd.simulate(
        demo_flight(),
        SECONDS,
        "tactical",
        5,
        rate=20.0,
        magnetometer=Magnetometer(rate=1.0),
        attitude=Ahrs(rate=1.0),
        date="2025-06-01",
    )


@pytest.mark.parametrize(
    "name", ["closed-loop", "ekf", "mekf", "open-loop", "ukf", "ckf", "xkf", "direct-ahrs"]
)
def test_squares_of_whitened_innovations_add_up_to_the_nis(name):
    found = sd.fuse(recording(), name, imu="tactical").innovations
    measured = np.isfinite(found.nis)
    assert measured.sum() > 3 * SECONDS
    squares = np.nansum(found.whitened**2, axis=1)
    np.testing.assert_allclose(squares[measured], found.nis[measured], rtol=1e-9, atol=1e-12)
    assert (np.isfinite(found.whitened) == np.isfinite(found.innovation))[measured].all()
    # 500 of them at least: each is N(0, 1), so that their variance has a sd of 0.06
    assert abs(np.nanstd(found.whitened) ** 2 - 1) < 0.3
