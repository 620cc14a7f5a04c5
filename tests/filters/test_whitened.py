"""Whitened innovations, which the loop tests, and the root of their covariance: in every filter they
are of one innovation and one NIS, and where the filter is right each is N(0, 1)."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import strapdown as sd
from strapdown import filters
from strapdown.sensor_models.ahrs import Ahrs
from strapdown.sensor_models.barometer import Barometer
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
    "name", ["closed-loop", "ekf", "mekf", "open-loop", "iekf", "ukf", "ckf", "xkf", "direct-ahrs"]
)
def test_squares_of_whitened_innovations_add_up_to_the_nis(name):
    found = sd.fuse(recording(), name, imu="tactical").innovations
    measured = np.isfinite(found.nis)
    assert measured.sum() > 3 * SECONDS
    squares = np.nansum(found.whitened**2, axis=1)
    np.testing.assert_allclose(squares[measured], found.nis[measured], rtol=1e-9, atol=1e-12)
    assert (np.isfinite(found.whitened) == np.isfinite(found.innovation))[measured].all()
    # 500 of them at least: each is N(0, 1), so that their variance has a std of 0.06
    assert abs(np.nanstd(found.whitened) ** 2 - 1) < 0.3


@cache
def with_missing_components():
    """Also with a height, and of every third position and velocity one component is missing."""
    whole = sd.simulate(
        demo_flight(),
        20.0,
        "tactical",
        5,
        rate=20.0,
        magnetometer=Magnetometer(rate=1.0),
        attitude=Ahrs(rate=1.0),
        barometer=Barometer(),
        date="2025-06-01",
    )
    sources = []
    for a in whole.sources:
        y = np.array(a.y, float)
        if y.ndim == 2 and a.kind in ("position", "velocity"):
            y[::3, 1] = np.nan
        sources.append(replace(a, y=y))
    return replace(whole, sources=tuple(sources))


@pytest.mark.parametrize("name", filters.own_names())
def test_root_gives_the_nis_and_the_whitened_innovation(name):
    found = sd.fuse(with_missing_components(), name, imu="tactical").innovations
    seen = 0
    for e, whitened, root, nis in zip(found.innovation, found.whitened, found.root, found.nis):
        measured = np.flatnonzero(np.isfinite(e))
        L = np.zeros((3, 3))
        L[np.tril_indices(3)] = root
        assert (np.isnan(L[np.tril_indices(3)]) == np.isnan(root)).all()
        if not measured.size or np.isnan(whitened[measured]).all():
            assert np.isnan(root).all()
            continue
        missing = np.setdiff1d(range(3), measured)
        assert np.isnan(np.tril(L)[missing, missing]).all()
        assert not L[np.ix_(measured, missing)].any()
        L = L[np.ix_(measured, measured)]
        np.testing.assert_allclose(np.linalg.solve(L, e[measured]), whitened[measured], rtol=1e-6)
        if np.isfinite(nis):  # e, the whitened and the NIS of a particle filter are of its mixture
            of_root = e[measured] @ np.linalg.solve(L @ L.T, e[measured])
            np.testing.assert_allclose(of_root, nis, rtol=1e-6, atol=1e-9)
        seen += 1
    assert seen > 15
