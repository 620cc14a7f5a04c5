"""From an Allan analysis to a description of the IMU: the grade that ships with the package and
comes nearest, and an ImuSpec of the fitted coefficients."""

from typing import NamedTuple

import numpy as np

from ..sensor_models.errors import Triad
from ..sensor_models.imu import ImuSpec, imu as imu_spec, imus
from ..sensor_models.noise import FLICKER_FLOOR, gauss_markov_variance
from ..typing import Array, ArrayLike
from .deviation import Allan, Sensor

MISFIT = 0.1
"""A fitted curve that misses the estimates by more than this share (rms) has coefficients of
something else than the sensor's noise."""


class Suggestion(NamedTuple):
    """Result of `suggest` for an Allan analysis."""

    grade: str  # the nearest one
    # {grade: factor between its expected and the estimated deviations, geometric mean over sensors
    # and cluster times}
    factors: dict[str, float]
    # from the coefficients of the triads; its turn-on bias is the nearest grade's, since one record
    # cannot show it
    spec: ImuSpec


def expected_deviation(triad: Triad, tau: ArrayLike) -> Array:
    """Allan deviation (k,) of an IMU whose errors are those of `triad` at cluster times `tau`,
    s; constant errors do not show in it."""
    tau = np.asarray(tau, float)
    variance = (
        triad.noise**2 / tau
        + triad.bias_walk**2 * tau / 3
        + (FLICKER_FLOOR * triad.flicker) ** 2
        + triad.quantisation**2 / 4 / tau**2
    )
    if triad.gauss_markov:
        variance = variance + triad.gauss_markov**2 * gauss_markov_variance(
            tau, triad.time_constant
        )
    return np.sqrt(variance)


def suggest(result: Allan) -> Suggestion:
    """The Suggestion that follows from an `Allan` result."""
    factors = {name: _factor(imu_spec(name), result) for name in imus(others=False)}
    best = min(factors, key=lambda name: factors[name])
    nearest = imu_spec(best)
    text = (
        f"Allan deviation of {result.duration:.0f} s at rest, mean of three axes; turn-on bias of "
        f"the nearest grade, {best}, "
        "since one record cannot show it"
    )
    spec = ImuSpec(
        "allan", _triad(result.gyro, nearest.gyro), _triad(result.accel, nearest.accel), text
    )
    return Suggestion(best, factors, spec)


def _factor(spec: ImuSpec, result: Allan) -> float:
    ratios = [
        np.log(expected_deviation(triad, sensor.triad.tau) / sensor.triad.deviation)
        for triad, sensor in ((spec.gyro, result.gyro), (spec.accel, result.accel))
    ]
    return float(np.exp(np.mean(np.abs(ratios))))


def _triad(sensor: Sensor, nearest: Triad) -> Triad:
    """The Triad of fitted coefficients; white noise that was not seen is at most what each
    cluster time allows."""
    fit, curve = sensor.triad.fit, sensor.triad

    def value_of(name: str) -> float:
        return float(np.nan_to_num(fit.value.get(name, 0.0)))

    noise = value_of("white noise") or float((curve.high * np.sqrt(curve.tau)).min())
    return Triad(
        noise=noise,
        turn_on_bias=nearest.turn_on_bias,
        bias_walk=value_of("rate random walk"),
        gauss_markov=value_of("gauss-markov"),
        time_constant=value_of("time constant"),
        flicker=value_of("bias instability"),
        quantisation=np.sqrt(12) * value_of("quantisation"),
    )
