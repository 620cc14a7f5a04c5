"""The option `bias` of all filters: what stays of an estimate and of its variance while nothing
measures, what the option does to a run however it is made, and who does not have it."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import ahrs, flight, same, start

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import BIAS_MODELS, Noise, compile_kernel
from strapdown.engine.stream import Measurement, Sample
from strapdown.filters.attitude import vru

pytestmark = pytest.mark.short
NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 10, accel_decay=1 / 20
)
WITH = [name for name in filters.own_names() if filters.find(name).bias]
SECONDS = 20.0


def test_all_but_those_with_fixed_gains_on_biases_have_the_option():
    assert {*filters.own_names()} - {*WITH} == {"nlo", "fixed-gain"}
    defaults = {name: filters.find(name).bias for name in WITH}
    assert {name for name, bias in defaults.items() if bias != "decaying"} == {
        "direct-ahrs",
        "direct-euler",
    }
    assert all(filters.find(name).options["bias"] == bias for name, bias in defaults.items())


def alone(name, options):
    """(biases, their standard deviations) after SECONDS at rest without any fix, by the prediction
    alone: two-stage filters and the VRU are kept from level and sea, which would tell of biases."""
    filter = filters.find(name)
    compile_kernel(filter.predict)
    noise = filter.with_bias_model(NOISE, options)
    begin = start(flight())._replace(
        v_n=(0.0,) * 3,
        b_a=(0.05, -0.03, 0.04),
        b_g=(1e-3, -2e-3, 1e-3),
        std=(1e-4,) * 9 + (1e-2,) * 6,
    )
    belief = filter.begin(begin, NOISE, **options)
    if name == "vru":
        belief.workspace[vru.MEASURED] = 1.0
    for _ in range(100):
        filter.predict(belief, np.zeros(6), SECONDS / 100, noise)
    return np.r_[belief.b_a, belief.b_g], np.sqrt(np.diag(belief.P)[9:15])


@pytest.mark.parametrize("name", WITH)
def test_without_fixes_an_estimate_decays_or_stays_and_its_variance_alike(name):
    runs = {bias: alone(name, {"bias": bias}) for bias in BIAS_MODELS}
    begun, estimated = np.r_[0.05, -0.03, 0.04, 1e-3, -2e-3, 1e-3], filters.find(name).estimates
    here = [state - 9 for state in estimated if state >= 9]
    fading = np.exp(-SECONDS * np.repeat([NOISE.accel_decay, NOISE.gyro_decay], 3))
    left = {bias: found[here] / begun[here] for bias, (found, _) in runs.items()}
    levelled = 0.35 if "two-stage" in name else 0.0  # stage 1 sees its gyro biases in each window
    np.testing.assert_allclose(left["decaying"], fading[here], rtol=1e-9 + levelled)
    np.testing.assert_allclose(left["held"], 1.0, rtol=1e-12 + levelled)
    np.testing.assert_allclose(left["random-walk"], 1.0, rtol=1e-12 + levelled)
    deviation = {bias: stds[here] for bias, (_, stds) in runs.items()}
    np.testing.assert_allclose(deviation["held"], deviation["decaying"], rtol=1e-2 + levelled)
    assert (deviation["random-walk"] > 1.5 * deviation["held"]).all()
    default, _ = alone(name, {})
    np.testing.assert_array_equal(default, runs[filters.find(name).bias][0])


def aided():
    recording = flight()
    return replace(recording, sources=(*recording.sources, ahrs(recording.reference)))


@pytest.mark.parametrize("name", ["mekf", "ukf", "indirect-ahrs-closed", "two-stage-ekf"])
def test_the_option_is_the_noise_that_holds_them(name):
    """And a run says so; without time constants there is nothing that could decay."""
    recording = aided()
    begin = start(recording)
    run = lambda noise, **options: sd.fuse(
        recording, name, start=begin, noise=noise, options=options
    )
    held = run(NOISE, bias="held")
    assert same(held, run(NOISE._replace(held=1.0)))
    assert not same(held, run(NOISE)) and held.meta["noise"]["held"] == 1
    assert run(NOISE._replace(held=1.0), bias="decaying").meta["noise"]["held"] == 0
    walking = run(NOISE, bias="random-walk")
    assert walking.meta["noise"]["gyro_decay"] == walking.meta["noise"]["accel_decay"] == 0
    lasting = NOISE._replace(gyro_decay=0.0, accel_decay=0.0)
    assert same(walking, run(lasting, bias="held")) and same(walking, run(lasting))


def test_a_stream_and_a_bridged_gap_hold_them_too():
    recording = flight()
    begin, t = start(recording), recording.imu.t
    gone = replace(
        recording, imu=type(recording.imu)(*(c[(t < 4) | (t > 4.6)] for c in recording.imu))
    )
    batch = sd.fuse(gone, "mekf", start=begin, noise=NOISE, options={"bias": "held"})
    stream = sd.Stream(
        "mekf", start=begin, noise=NOISE, sources=gone.sources, lag=0.2, options={"bias": "held"}
    )
    fixes = [
        Measurement(a.t[k], s, a.y[k], a.std[k])
        for s, a in enumerate(gone.sources)
        for k in range(len(a.t))
    ]
    samples = [Sample(*row) for row in zip(*gone.imu)]
    for event in sorted([*samples, *fixes], key=lambda event: event.t):
        stream.step(event)
    belief = stream.finish()
    assert np.array_equal(belief.b_a, batch.b_a[-1]) and np.array_equal(belief.b_g, batch.b_g[-1])
    alone = replace(gone, sources=())
    kept = sd.fuse(
        alone,
        "mekf",
        start=begin._replace(b_a=(0.1, 0.2, 0.3)),
        noise=NOISE,
        options={"bias": "held"},
    )
    np.testing.assert_array_equal(kept.b_a, np.broadcast_to([0.1, 0.2, 0.3], kept.b_a.shape))


@pytest.mark.parametrize("name", ["nlo", "fixed-gain"])
def test_a_filter_without_the_option_says_why(name):
    with pytest.raises(
        DataError, match=f"'{name}' has no option 'bias', as none of its estimates decays; it has"
    ):
        sd.fuse(aided(), name, imu="tactical", options={"bias": "held"})


@pytest.mark.parametrize("name", ["mekf", "direct-ahrs", "attitude-mekf"])
def test_an_unknown_bias_model_is_refused(name):
    with pytest.raises(
        DataError,
        match=f"filter '{name}': bias is 'hold'.*did you mean 'held'.*; it must be one of "
        "decaying, held, random-walk",
    ):
        sd.fuse(aided(), name, imu="tactical", options={"bias": "hold"})


def test_a_noise_holds_no_more_than_all():
    with pytest.raises(DataError, match="noise: held is 2; it is a fraction, at most 1"):
        sd.fuse(flight(), start=start(flight()), noise=NOISE._replace(held=2.0))
