"""Dryden gusts against MIL-F-8785C's closed forms: intensities and lengths by height, variance,
correlation and spectra."""

import numpy as np
import pytest
from scipy.signal import welch

from strapdown.checks import DataError
from strapdown.core.compile.records import rows
from strapdown.flight.aircraft_model.wind import NORMALS, Turbulence, begin, gust, turbulence

V, DT, SPAN = 25.0, 0.02, 2.8956
FOOT, KNOT = 0.3048, 0.514444


@pytest.fixture(scope="module")
def record():
    """An hour of moderate gusts at 80 m: (Turbulence, winds (n, 9))."""
    blowing, rng = turbulence("moderate", 80.0, SPAN), np.random.default_rng(8)
    n, advance, state = (
        180_000,
        gust,
        begin(turbulence("moderate", 80.0, SPAN), rng.standard_normal(6)),
    )
    normals, winds = rng.standard_normal((n, NORMALS)), np.zeros((n, 9))
    for k in range(n):
        advance(blowing, state, normals[k], V, DT, winds[k])
    return blowing, winds


@pytest.mark.short
def test_intensities_and_lengths_by_height():
    """At 200 ft by hand from 3.7.2.1; above 1000 ft and below 10 ft the values there."""
    light = turbulence("light", 200 * FOOT, SPAN)
    shape = 0.177 + 0.000823 * 200
    assert light.tolist() == pytest.approx(
        [
            1.5 * KNOT / shape**0.4,
            1.5 * KNOT / shape**0.4,
            1.5 * KNOT,
            200 * FOOT / shape**1.2,
            200 * FOOT / shape**1.2,
            200 * FOOT,
            SPAN,
        ],
        rel=1e-5,
    )
    high = turbulence("severe", 1000 * FOOT)
    assert high.tolist()[:3] == pytest.approx([4.5 * KNOT] * 3, rel=1e-5)
    assert high.tolist()[3:6] == pytest.approx([1000 * FOOT] * 3, rel=1e-6)
    assert turbulence("severe", 5e3) == high
    assert turbulence("light", -5.0) == turbulence("light", 1.0)
    assert turbulence("none", 50.0).tolist()[:3] == (0.0, 0.0, 0.0)


def test_variances_and_correlations_are_those_of_the_closed_forms(record):
    """Bands of 4 standard deviations, from the number of correlation times in the record."""
    (su, sv, sw, Lu, Lv, Lw, b), winds = record
    seconds = len(winds) * DT
    for gusts, std, L in ((winds[:, 3], su, Lu), (winds[:, 4], sv, Lv), (winds[:, 5], sw, Lw)):
        band = 4 * np.sqrt(2 * (L / V) / seconds)
        assert abs(gusts.var() / std**2 - 1) < band, (gusts.var(), std**2, band)
    for gusts, std, L, form in (
        (winds[:, 3], su, Lu, lambda x: np.exp(-x)),
        (winds[:, 4], sv, Lv, lambda x: np.exp(-x) * (1 - x / 2)),
        (winds[:, 5], sw, Lw, lambda x: np.exp(-x) * (1 - x / 2)),
    ):
        for share in (0.1, 0.5, 1.0, 2.5):
            lag = round(share * L / V / DT)
            got = (gusts[lag:] * gusts[:-lag]).mean() / std**2
            assert abs(got - form(lag * DT * V / L)) < 4 * np.sqrt(2 * (L / V) / seconds)
    # integral of the standard's spectrum
    roll = (
        sw**2 * 0.8 * (np.pi * Lw / (4 * b)) ** (1 / 3) / (V * Lw) * np.pi / 2 * np.pi * V / (4 * b)
    )
    assert winds[:, 6].var() == pytest.approx(
        roll, rel=4 * np.sqrt(2 * (4 * b / (np.pi * V)) / seconds)
    )
    assert not winds[:, :3].any()


def test_spectra_are_those_of_the_standard(record):
    """One-sided in rad/s, from 0.3 to 25 rad/s in bands of a third of a decade: within 4 standard
    deviations and 2 % for sampling.

    The signs of pitch and yaw are those of the air's own turning.
    """
    (su, sv, sw, Lu, Lv, Lw, b), winds = record
    hertz, density = welch(winds[:, 3:], 1 / DT, nperseg=8192, axis=0)
    w = 2 * np.pi * hertz
    space = w / V
    along = lambda std, L: std**2 * 2 * L / (np.pi * V) / (1 + (L * space) ** 2)
    across = lambda std, L: (
        std**2 * L / (np.pi * V) * (1 + 3 * (L * space) ** 2) / (1 + (L * space) ** 2) ** 2
    )
    low = lambda span: 1 / (1 + (span * space / np.pi) ** 2)
    want = [
        along(su, Lu),
        across(sv, Lv),
        across(sw, Lw),
        sw**2 / (V * Lw) * 0.8 * (np.pi * Lw / (4 * b)) ** (1 / 3) * low(4 * b),
        space**2 * low(4 * b) * across(sw, Lw),
        space**2 * low(3 * b) * across(sv, Lv),
    ]
    edges = 0.3 * 10 ** (np.arange(7) / 3)
    for column, form in enumerate(want):
        for first, last in zip(edges[:-1], np.minimum(edges[1:], 25.0)):
            band = (w >= first) & (w < last)
            ratio = (density[band, column] / (2 * np.pi) / form[band]).mean()
            assert abs(ratio - 1) < 0.02 + 4 / np.sqrt(1.5 * band.sum() * len(winds) / 8192), (
                column,
                first,
                ratio,
            )
    slower = lambda gusts: (gusts[15:] - gusts[:-15]) / (15 * DT * V)
    assert (
        np.corrcoef(winds[15:, 7], slower(winds[:, 5]))[0, 1] < -0.7
        and np.corrcoef(winds[15:, 8], slower(winds[:, 4]))[0, 1] > 0.7
    )


def test_steps_as_long_as_the_gusts_are_exact_too():
    """Steps of L/V: variances, and neighbours' correlations exp(-1) along and exp(-1)/2 across,
    within 4 standard deviations of 40000 samples."""
    (blowing,), rng, n = rows(Turbulence, 1), np.random.default_rng(5), 40_000
    blowing.std_u = blowing.std_v = blowing.std_w = 1.0
    blowing.length_u = blowing.length_v = blowing.length_w = 100.0
    blowing.span = SPAN
    state, normals, winds = (
        begin(blowing, rng.standard_normal(6)),
        rng.standard_normal((n, NORMALS)),
        np.zeros((n, 9)),
    )
    for k in range(n):
        gust(blowing, state, normals[k], V, 100 / V, winds[k])
    for column, neighbours in ((3, np.exp(-1)), (4, np.exp(-1) / 2), (5, np.exp(-1) / 2)):
        gusts = winds[:, column]
        assert gusts.var() == pytest.approx(1, abs=4 * np.sqrt(2.6 / n))
        assert (gusts[1:] * gusts[:-1]).mean() == pytest.approx(
            neighbours, abs=4 * np.sqrt(1.5 / n)
        )


@pytest.mark.short
def test_steps_of_any_length_and_no_airspeed_stay_finite_and_unknown_levels_are_named():
    blowing, state, wind, rng = (
        turbulence("severe", 30.0),
        np.zeros(8),
        np.zeros(9),
        np.random.default_rng(1),
    )
    for airspeed, dt in ((0.0, 0.01), (25.0, 1e-5), (25.0, 100.0)):
        for _ in range(20):
            gust(blowing, state, rng.standard_normal(NORMALS), airspeed, dt, wind)
        assert np.isfinite(wind).all() and np.abs(wind).max() < 30
    with pytest.raises(
        DataError,
        match="turbulence is 'ligt' .did you mean 'light'..; it must be one of none, light, moderate, severe",
    ):
        turbulence("ligt")
    with pytest.raises(
        DataError,
        match="height above ground is nan m; it must be a finite number|span in turbulence is",
    ):
        turbulence("light", np.nan)
