"""Allan deviation of IMU samples at rest: overlapping estimates with confidence bounds, and the
noise coefficients behind them, per axis and triad.

Estimates: W. J. Riley, NIST SP 1065 (2008), section 5.2.2. Bounds: chi-square with the equivalent
degrees of freedom of its section 5.4.1. Coefficients: IEEE Std 952-1997, annex C; the fit is in
fit.py.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.value import Value
from ..typing import Array, Ints
from ..units.conversion import SHEET, in_units
from .fit import COEFFICIENTS, AllanFit, edf, fit

if TYPE_CHECKING:
    import pandas as pd

AXIS_NAMES = ("x", "y", "z")
PER_DECADE = 12
"""Cluster times per decade."""
CONFIDENCE = 0.683
"""Probability of the confidence bounds: one standard deviation of a normal estimate."""
MIN_CLUSTERS = 4
"""The longest cluster is a quarter of the record: beyond, an estimate has hardly a degree of
freedom."""
FEWEST = 100
"""Samples needed."""
JITTER = 0.01
"""Largest departure of an interval from the median that still counts as a constant rate, in
medians."""


def oadev(increments: Array, dt: float, sizes: Ints) -> Array:
    """Overlapping Allan deviations (k,) of the rate behind `increments` (n,) of constant interval
    `dt` s, at clusters of `sizes` (k,) samples.

    With theta the integral, sigma^2(m dt) = mean over k of (theta[k + 2m] - 2 theta[k + m] +
    theta[k])^2 / (2 (m dt)^2); NIST SP 1065, eq. 11. A constant rate drops out, so its removal
    first only keeps digits.
    """
    theta = np.concatenate([[0.0], np.cumsum(increments - np.mean(increments))])
    found = np.empty(len(sizes))
    for i, m in enumerate(sizes):
        second = theta[2 * m :] - 2 * theta[m:-m] + theta[: -2 * m]
        found[i] = np.sqrt(second @ second / (2 * len(second))) / (m * dt)
    return found


def cluster_sizes(n: int) -> Ints:
    """Cluster sizes of n samples: log-spaced, each once, from 1 to n / MIN_CLUSTERS."""
    most = n // MIN_CLUSTERS
    return np.unique(
        np.round(10 ** np.linspace(0, np.log10(most), int(PER_DECADE * np.log10(most)) + 1)).astype(
            int
        )
    )


class Curve(NamedTuple):
    """Allan deviation of one axis, or of a triad (the root of the mean of its three variances),
    in rad/s or m/s^2."""

    tau: Array  # (k,) cluster times, s
    deviation: Array  # (k,)
    low: Array  # (k,) bounds that hold the true value with probability CONFIDENCE
    high: Array  # (k,)
    edf: Array  # (k,) equivalent degrees of freedom
    fit: AllanFit


class Sensor(NamedTuple):
    """Curves of one triad; `name` is "gyro" or "accel"."""

    name: str
    axes: tuple[Curve, ...]  # of x, y, z
    triad: Curve


@dataclass(frozen=True, eq=False)
class Allan(Value):
    """Result of `allan`: what the samples of a stationary IMU say of its noise."""

    gyro: Sensor
    accel: Sensor
    dt: float  # s
    duration: float  # s
    notes: tuple[str, ...] = ()

    def table(self) -> "pd.DataFrame":
        """pandas DataFrame: a row per sensor, axis and coefficient with value and standard error in
        units of datasheets and in SI.

        A coefficient that cannot be told from zero has NaN as its value, and as its limit what it
        would have to exceed to be seen.
        """
        import pandas as pd

        rows = []
        for sensor in (self.gyro, self.accel):
            for axis, curve in (*zip(AXIS_NAMES, sensor.axes), ("triad", sensor.triad)):
                for name in curve.fit.names:
                    si = COEFFICIENTS[name].units[sensor.name]
                    value, std, limit = (
                        curve.fit.value[name],
                        curve.fit.std[name],
                        curve.fit.limit[name],
                    )
                    rows.append(
                        (
                            sensor.name,
                            axis,
                            name,
                            in_units(value, si),
                            in_units(std, si),
                            in_units(limit, si),
                            SHEET[si],
                            value,
                            std,
                            limit,
                            si,
                        )
                    )
        columns = (
            "sensor",
            "axis",
            "coefficient",
            "value",
            "std",
            "limit",
            "unit",
            "value_si",
            "std_si",
            "limit_si",
            "unit_si",
        )
        return pd.DataFrame(rows, columns=columns)

    def deviations(self) -> "pd.DataFrame":
        """pandas DataFrame indexed by tau (s): deviation, bounds and fitted curve of every axis
        and triad, gyros in deg/h, accelerometers in mg."""
        import pandas as pd

        columns = {}
        for sensor in (self.gyro, self.accel):
            si = "rad/s" if sensor.name == "gyro" else "m/s^2"
            for axis, curve in (*zip(AXIS_NAMES, sensor.axes), ("triad", sensor.triad)):
                for name, values in (
                    ("", curve.deviation),
                    ("_low", curve.low),
                    ("_high", curve.high),
                    ("_fit", curve.fit.deviation(curve.tau)),
                ):
                    columns[f"{sensor.name}_{axis}{name} [{SHEET[si]}]"] = in_units(values, si)
        return pd.DataFrame(columns, index=pd.Index(self.gyro.triad.tau, name="tau [s]"))

    def _repr_html_(self) -> str:
        from ..pages.notebook.cards import card, frame, lines

        table = self.table()
        found = table.loc[
            table["axis"] == "triad", ["sensor", "coefficient", "value", "std", "unit"]
        ]
        return card(f"Allan analysis of {self.duration:.0f} s", {}, frame(found), lines(self.notes))

    def __repr__(self) -> str:
        def show(sensor: Sensor) -> str:
            return ", ".join(
                f"{name} {in_units(sensor.triad.fit.value[name], si):.3g} {SHEET[si]}"
                for name in sensor.triad.fit.present
                for si in [COEFFICIENTS[name].units[sensor.name]]
            )

        return f"Allan({self.duration:.0f} s; gyro: {show(self.gyro) or 'no noise'}; accel: {show(self.accel) or 'no noise'})"


def allan(imu: Imu, gauss_markov: bool = False) -> Allan:
    """The Allan analysis of an `Imu` (core.loop.contract) that does not move, at a constant rate without
    gaps.

    gauss_markov: fit a first-order Gauss-Markov bias (its standard deviation and time constant) in
    the place of flicker. Raises DataError on gaps, an uneven rate, fewer than FEWEST samples, or
    samples that never change.
    """
    n, dt = len(imu.t), float(np.median(imu.dt)) if len(imu.t) else 0.0
    if n < FEWEST:
        raise DataError(
            f"{n} IMU samples are too few for an Allan deviation; it needs {FEWEST}, and some "
            "minutes to show more than white noise"
        )
    if gap := first_gap(imu):
        raise DataError(
            f"the IMU samples have a gap after {imu.t[gap - 1]:.3f} s; choose a stretch without one "
            f"(--from, --to)"
        )
    if np.abs(imu.dt - dt).max() > JITTER * dt:
        raise DataError(
            f"the IMU intervals vary from {imu.dt.min():.6g} to {imu.dt.max():.6g} s; an Allan "
            f"deviation needs a constant rate"
        )
    dt = float((imu.t[-1] - imu.t[0]) / (n - 1))
    sizes = cluster_sizes(n)
    gyro, accel = (
        _sensor(name, increments, dt, sizes, gauss_markov)
        for name, increments in (("gyro", imu.dtheta), ("accel", imu.dv))
    )
    return Allan(gyro, accel, dt, n * dt)


def first_gap(imu: Imu) -> int:
    """Row of the first sample that does not begin where the one before it ends (within half its
    interval), 0 where there is none."""
    missing = np.abs(imu.t[1:] - imu.dt[1:] - imu.t[:-1]) > 0.5 * imu.dt[1:]
    return int(np.argmax(missing)) + 1 if missing.any() else 0


def _sensor(name: str, increments: Array, dt: float, sizes: Ints, gauss_markov: bool) -> Sensor:
    still = [axis for axis, column in zip(AXIS_NAMES, increments.T) if np.ptp(column) == 0]
    if still:
        raise DataError(
            f"the {name} samples of axis {still[0]} never change: there is no noise to analyse"
        )
    n, tau = len(increments), np.asarray(sizes * dt, float)
    variances = np.stack([oadev(column, dt, sizes) ** 2 for column in increments.T])
    curves = [_curve(tau, variance, n, sizes, dt, 1, gauss_markov) for variance in (*variances,)]
    return Sensor(
        name, tuple(curves), _curve(tau, variances.mean(axis=0), n, sizes, dt, 3, gauss_markov)
    )


def _curve(
    tau: Array, variance: Array, n: int, sizes: Ints, dt: float, axes: int, gauss_markov: bool
) -> Curve:
    """A Curve of the mean of `axes` equal and independent variances: their degrees of freedom
    add up."""
    from scipy.stats import chi2

    found = fit(tau, variance, n, sizes, dt, axes, gauss_markov)
    degrees = axes * edf(found.dominant(tau), n, sizes)
    low, high = (
        np.sqrt(variance * degrees / chi2.ppf(p, degrees))
        for p in (0.5 + CONFIDENCE / 2, 0.5 - CONFIDENCE / 2)
    )
    return Curve(tau, np.sqrt(variance), low, high, degrees, found)
