"""The standard atmosphere against its table and its differential equation, and the barometer in
it."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from strapdown.aiding import pressure as aiding_kernel
from strapdown.checks import DataError
from strapdown.sensor_models.atmosphere import (
    MAX_AIR,
    MIN_AIR,
    pressure_altitude,
    pressure_gradient,
    standard_pressure,
)
from strapdown.sensor_models.barometer import Barometer
from strapdown.sim.motions import hand_held, moored_vessel
from strapdown.sim.trajectory import DEG, sample, static

pytestmark = pytest.mark.short
PLACE = (48 * DEG, 11 * DEG, 500.0)
SEA = sample(moored_vessel((60 * DEG, 5 * DEG, 45.0)), np.arange(6001) / 20)
# ISO 2533:1975, table 1: geopotential height m, pressure Pa
TABLE = [
    (-1000, 113929),
    (0, 101325),
    (500, 95460.8),
    (1000, 89874.6),
    (2000, 79495.2),
    (5000, 54019.9),
    (8000, 35599.8),
    (11000, 22632.0),
    (15000, 12044.6),
    (20000, 5474.88),
]


def read(truth=SEA, seed=0, **changes):
    return Barometer(**{"std": 1e-9, **changes}).measure(truth, np.random.default_rng(seed))


@pytest.mark.parametrize("height, pressure", TABLE)
def test_the_atmosphere_is_that_of_the_standard(height, pressure):
    assert standard_pressure(height) == pytest.approx(pressure, rel=1e-5)
    assert pressure_altitude(pressure) == pytest.approx(height, abs=0.1)


def test_height_and_pressure_undo_each_other():
    heights = np.linspace(MIN_AIR, MAX_AIR, 2501)
    np.testing.assert_allclose(pressure_altitude(standard_pressure(heights)), heights, atol=1e-7)
    assert np.all(np.diff(standard_pressure(heights)) < 0)


def test_the_pressure_is_the_weight_of_the_air_above():
    """dp/dh = -rho g with the ideal gas's density, differentiated numerically; at the tropopause
    from both sides."""
    heights = np.r_[-4000.0, 0, 3000, 10990, 10999, 11001, 18000]
    numeric = standard_pressure(heights + 0.5) - standard_pressure(heights - 0.5)
    temperature = np.where(heights < 11000, 288.15 - 0.0065 * heights, 216.65)
    np.testing.assert_allclose(
        numeric, -standard_pressure(heights) / (287.05287 * temperature) * 9.80665, rtol=1e-7
    )
    np.testing.assert_allclose(pressure_gradient(heights), numeric, rtol=1e-7)


def test_the_compiled_kernel_of_the_aiding_has_the_same_atmosphere():
    heights = np.linspace(-4900, 19900, 311)
    kernel = [aiding_kernel.pressure_altitude(p) for p in standard_pressure(heights)]
    np.testing.assert_allclose(kernel, heights, atol=1e-6)


@pytest.mark.parametrize(
    "call, words",
    [
        (
            lambda: standard_pressure(20001.0),
            "height 20001 m; the standard atmosphere here goes from -5000 to 20000 m",
        ),
        (lambda: standard_pressure([0, np.nan]), "height nan m"),
        (lambda: standard_pressure(-6000.0), "height -6000 m"),
        (
            lambda: pressure_altitude([101325, 1013.25]),
            "pressure 1013.25 Pa; .*5475 to 177687 Pa: is the unit right",
        ),
        (lambda: pressure_altitude(0.0), "pressure 0 Pa"),
        (lambda: pressure_gradient(2e4 + 1), "height 20001 m"),
    ],
)
def test_outside_of_the_layers_is_refused(call, words):
    with pytest.raises(DataError, match=words):
        call()


def test_a_barometer_at_rest_reads_the_pressure_above_its_zero():
    truth = sample(static(PLACE), [0.0, 1.0, 2.0])
    source = read(truth, zero=-500.0)
    assert (source.kind, source.name, source.parameters) == (
        "pressure",
        "barometer",
        (0.0, 0.0, 0.0),
    )
    assert source.y == pytest.approx(np.full((2, 1), 89874.6), abs=0.05) and np.array_equal(
        source.t, [1, 2]
    )
    height = read(truth, zero=-500.0, quantity="height")
    assert height.kind == "pressure-altitude" and height.y == pytest.approx(
        np.full((2, 1), 1000.0), abs=1e-6
    )
    assert read(truth, bias=100.0).y - read(truth).y == pytest.approx(
        np.full((2, 1), 100.0), abs=1e-6
    )
    # more pressure is less height
    shift = read(truth, bias=100.0, quantity="height").y[0, 0] - 500.0
    assert shift == pytest.approx(100 / pressure_gradient(496.0), rel=1e-3) and shift < 0


def test_the_standard_deviation_is_in_metres_for_both_kinds():
    truth = sample(static((48 * DEG, 11 * DEG, 0.0)), np.arange(5))
    for quantity in ("pressure", "height"):
        assert read(truth, std=12.0, quantity=quantity).std == pytest.approx(
            np.full((4, 1), 12 / 12.0131), rel=1e-5
        )


def test_the_sensor_is_where_its_lever_arm_says():
    truth = sample(hand_held(PLACE), np.arange(501) / 100)
    arm = np.array([0.4, -0.3, 0.7])
    source = read(truth, lever_arm=tuple(arm), quantity="height")
    expected = truth.lla[:, 2] - truth.rotation.apply(arm)[:, 2]
    np.testing.assert_allclose(source.y[:, 0], expected[1:], atol=1e-6)
    assert source.parameters == tuple(arm) and np.ptp(expected - truth.lla[:, 2]) > 0.5


def test_the_noise_is_white_and_as_stated():
    """Chi-square of the variance, normal of mean and of neighbours' correlation, of both
    quantities: six checks, together 0.1 % false alarms."""
    side = 0.001 / 6 / 2
    for quantity in ("pressure", "height"):
        noisy, quiet = read(std=8.0, seed=5, quantity=quantity), read(quantity=quantity)
        noise = ((noisy.y - quiet.y) / (8.0 if quantity == "pressure" else noisy.std))[:, 0]
        n = len(noise)
        low, high = chi2.ppf([side, 1 - side], n)
        assert low < (noise**2).sum() < high
        assert max(abs(noise.mean()), abs((noise[1:] * noise[:-1]).mean())) < norm.ppf(
            1 - side
        ) / np.sqrt(n)


def test_the_weather_is_a_gauss_markov_process():
    """Variance at the start and correlation over one time constant in 2000 runs, each within its
    99.9 % band (0.2 % false alarms)."""
    truth = sample(static(PLACE), np.arange(0, 101, 10.0))
    plan = Barometer(std=1e-9, drift=300.0, drift_time=90.0).plan(truth)
    runs = (
        np.array([plan.fixes(np.random.default_rng([7, run])).y[:, 0] for run in range(2000)])
        - plan.pressure
    )
    low, high = chi2.ppf([0.0005, 0.9995], 2000) / 2000
    assert low < (runs[:, 0] ** 2).mean() / 300**2 < high
    # 90 s apart: exp(-1), with variance (1 + exp(-2))/n
    kept = np.mean(runs[:, 0] * runs[:, 9]) / 300**2
    assert abs(kept - np.exp(-1)) < norm.ppf(0.9995) * np.sqrt((1 + np.exp(-2)) / 2000)


def test_the_reported_bias_is_what_the_heights_exceed_the_truth_by():
    plan = Barometer(
        rate=2.0, std=1e-9, bias=-150.0, drift=200.0, drift_time=60.0, zero=20.0, quantity="height"
    ).plan(SEA)
    source, bias = plan.measure_with_bias(np.random.default_rng(9))
    np.testing.assert_allclose(source.y[:, 0] - SEA.lla[10::10, 2], bias, atol=1e-6)
    assert np.ptp(bias) > 5 and len(bias) == 600
    np.testing.assert_allclose(plan.exact().y[:, 0], SEA.lla[10::10, 2] - 20, atol=1e-6)


def test_weather_and_noise_have_streams_of_their_own():
    calm, windy = read(std=8.0, seed=5), read(std=8.0, seed=5, drift=1e-9)
    np.testing.assert_allclose(calm.y, windy.y, atol=1e-7)


def test_a_rate_that_leaves_no_sample_is_noted():
    plan = Barometer(rate=0.001).plan(SEA)
    source, bias = plan.measure_with_bias(np.random.default_rng(0))
    assert len(bias) == 0 and plan.notes(source) == [
        "barometer: not one sample falls into the recording; its rate is too low"
    ]
    assert read(rate=0.004).y.shape == (1, 1)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"rate": -1}, "rate is -1 Hz; it must be a finite number above 0"),
        ({"std": 0}, "std is 0 Pa; it must be a finite number above 0"),
        ({"std": "5"}, "std is '5' Pa; it must be a finite number"),
        ({"drift": -1.0}, "drift is -1.0 Pa; it must be a finite number, 0 or more"),
        ({"bias": 101325.0}, "bias is 101325.0 Pa; .* at most 10000"),
        ({"drift_time": 0.0}, "drift_time is 0.0"),
        ({"zero": np.inf}, "zero is inf"),
        ({"lever_arm": (1, 2)}, "3 finite numbers: forward, right, down"),
        ({"lever_arm": ("a", 0, 0)}, "3 finite numbers"),
        ({"quantity": "altitude"}, "it must be one of pressure, height"),
    ],
)
def test_what_no_barometer_is_is_refused_in_one_line(change, words):
    with pytest.raises(DataError, match=words) as error:
        Barometer(**change)
    assert str(error.value).startswith("barometer: ") and "\n" not in str(error.value)


def test_a_flight_above_the_atmosphere_is_refused():
    with pytest.raises(DataError, match="it comes to 30000 m above its zero"):
        read(sample(static((48 * DEG, 11 * DEG, 30e3)), [0.0, 1.0]))
