"""Airspeeds against velocities over ground: unit, sign, scale and clock, where the course goes round the
compass so that a steady wind parts from them; values that are frozen; what they read at rest.

    V(t) = k |v - w| (t - lag)

Source: the wind triangle of Cho et al. (2011), "Wind estimation and airspeed calibration using a UAV
with a single-antenna GPS receiver and pitot tube", IEEE Trans. Aerospace and Electronic Systems 47(1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..aiding.air_data import THINNING
from ..aiding.pressure import LAPSE, T_0
from ..data.solution import Source
from ..data.verdict import Reason
from ..typing import Array, Mask
from ..units.constants import FROZEN_ROWS, FROZEN_TIME, LIVELY
from .finding import MIN_FIXES, Checked, clustered_least_squares, label
from .motion import InspectedRecording, Moved, source_velocity
from .position_velocity import FACTORS

AIRSPEEDS = ("true-airspeed", "indicated-airspeed")
FLYING, SHARE = 5.0, 0.5
"""m/s over ground from which a vehicle moves; the share of the median speed and reading from which it flies."""
AT_REST, MIN_REST = 1.0, 10
"""m/s over ground below which it stands; fixes that tell what a pitot tube reads then."""
BLOCK = 30.0
"""s within which gusts hang together."""
STEPS, SETTLED = 20, 1e-6
"""Steps of the fit at most, and the last one, as a share."""
SURE, MAX_SCALE, MAX_LAG = 5.0, 0.06, 0.15
"""Standard deviations, share and s from which a scale and a clock are reasons."""
WITHIN = 3.0
"""Prior standard deviations within which a scale that the filter estimates is no reason."""
BLOCKED = 0.1
"""Share of the median speed over ground below which a pitot tube reads nothing."""
UNIT = 0.15
"""Share within which a factor is that of a unit."""
FROZEN_CHANGE = 3.0
"""m/s by which a reading should change meanwhile that is frozen although it seldom changes."""


LAGS, LASTING = 8.0, 2.0
"""s within which errors are followed, and rows that they outlast before it is said."""
FIRST = 1.0
"""s of the first readings."""


class Fit(NamedTuple):
    """Airspeed at the fixes of a velocity, and the fit of both."""

    t: Array  # (n,) s
    measured: Array  # (n,) m/s, mean about each fix
    moves: Mask  # (n,) over ground
    flies: Mask  # (n,)
    thinning: Array  # (n,) what it indicates over the true airspeed
    expected: Array  # (n,) m/s, of a true unit and scale
    scale: float
    scale_std: float
    lag: float  # s that the airspeed is late
    lag_std: float
    wind: Array  # (2,) m/s
    scatter: float  # m/s rms


def check(subject: InspectedRecording) -> Checked:
    """All airspeeds, against the first velocity or else position."""
    found = Checked.empty()
    ground = subject.sources("velocity", "position")
    fixes = source_velocity(ground[0]) if ground else None
    for source in subject.sources(*AIRSPEEDS):
        what = f"{label(source)} against the speed over ground"
        if fixes is None:
            found.add(Checked.with_unknown(what, "too few fixes of position or velocity"))
            continue
        found.facts.extend(_at_rest(source, fixes))
        found.reasons.extend(_silence(source, fixes))
        fit = _fit(source, _indicated_share(subject, source, fixes), fixes)
        if fit is None:
            found.add(Checked.with_unknown(what, "it hardly turns in flight, or flies too little"))
            continue
        found.facts.append(_fact(what, fit) + _words_on_lasting_errors(source, fixes, fit))
        found.reasons.extend(_reasons(source, fit))
        found.reasons.extend(_frozen_reasons(source, fit))
    return found


def _indicated_share(subject: InspectedRecording, source: Source, fixes: Moved) -> Array:
    """(n,) what an airspeed indicates over the true one, at the heights of the first position."""
    positions = subject.sources("position")
    if source.kind != "indicated-airspeed" or not positions:
        return np.ones(len(fixes.t))
    known = np.isfinite(positions[0].y[:, 2])
    if not known.any():
        return np.ones(len(fixes.t))
    height = np.interp(fixes.t, positions[0].t[known], positions[0].y[known, 2])
    return np.asarray(np.maximum(1 - LAPSE * height / T_0, 0.1) ** (0.5 * THINNING))


def _mean_about(source: Source, t: Array, half: float) -> Array:
    """(n,) the mean reading over +- `half` s about times `t`; NaN without any."""
    known = np.isfinite(source.y[:, 0])
    at, y = source.t[known], source.y[known, 0]
    total = np.r_[0.0, np.cumsum(y)]
    first, last = np.searchsorted(at, t - half), np.searchsorted(at, t + half)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (total[last] - total[first]) / np.where(last > first, last - first, np.nan)
        )


def _at_rest(source: Source, fixes: Moved) -> list[str]:
    """A fact on what it reads at rest: an error there shrinks with the speed, as a pitot tube measures a
    pressure."""
    speed = np.linalg.norm(fixes.v, axis=1)
    reading = _mean_about(source, fixes.t, 0.5 * fixes.interval)
    stands = (speed < AT_REST) & np.isfinite(reading)
    if stands.sum() < MIN_REST or stands.all():
        return []
    zero, moving = float(np.median(reading[stands])), speed[speed > FLYING]
    low, high = np.percentile(reading[stands], [1, 99])
    said = f"{label(source)} at rest: {zero:.1f} m/s ({low:.1f} to {high:.1f})"
    said += _before_zero(source, fixes.t[stands][0], zero, high - low)
    if not len(moving):
        return [said]
    usual = float(np.median(moving))
    error = abs(zero) * zero / (2 * usual)
    return [f"{said}, an error of {error:.2g} m/s at {usual:.0f} m/s"]


def _before_zero(source: Source, until: float, zero: float, spread: float) -> str:
    """Words on first readings unlike those at rest, of a tube whose zero is taken at its start; `until` is
    the first fix at rest."""
    early = source.t < until
    t, y = source.t[early], source.y[early, 0]
    if not len(t) or spread <= 0:
        return ""
    first = float(np.median(y[t < t[0] + FIRST]))
    if not abs(first - zero) > spread:
        return ""
    near = np.flatnonzero(np.abs(y - zero) < 0.5 * spread)
    seconds = t[near[0] if len(near) else -1] - t[0]
    return f", {first:.1f} m/s before its zero, for {seconds:.0f} s"


def _silence(source: Source, fixes: Moved) -> list[Reason]:
    """A reason where it reads nothing while the vehicle moves."""
    speed = np.linalg.norm(fixes.v, axis=1)
    reading = _mean_about(source, fixes.t, 0.5 * fixes.interval)
    moves = (speed > FLYING) & np.isfinite(reading)
    if moves.sum() < MIN_FIXES:
        return []
    usual, read = float(np.median(speed[moves])), float(np.median(reading[moves]))
    if abs(read) > BLOCKED * usual:
        return []
    seen = f"it reads {read:.1f} m/s at {usual:.0f} m/s over ground"
    remedy = "leave it out: its tube is blocked, or it is not connected"
    return [Reason("unknown", seen, remedy, label(source), 10.0)]


def _fit(source: Source, thinning: Array, fixes: Moved) -> Fit | None:
    """The Fit of an airspeed; None where wind and scale do not part."""
    reading = _mean_about(source, fixes.t, 0.5 * fixes.interval) / thinning
    speed = np.linalg.norm(fixes.v, axis=1)
    moves = (speed > FLYING) & np.isfinite(reading)
    if moves.sum() < MIN_FIXES:
        return None
    usual, read = np.median(speed[moves]), np.median(np.abs(reading[moves]))
    flies = moves & (speed > SHARE * usual) & (np.abs(reading) > SHARE * read)
    if flies.sum() < MIN_FIXES or not read > BLOCKED * usual:
        return None
    t, v, V = fixes.t[flies], fixes.v[flies], reading[flies]
    block = np.unique(np.floor(t / BLOCK), return_inverse=True)[1]
    x = np.array([float(np.median(V)) / usual, 0.0, 0.0])
    for _ in range(STEPS):
        air = v - np.r_[x[1:], 0.0]
        size = np.maximum(np.linalg.norm(air, axis=1), 1.0)
        A = np.c_[size, -x[0] * air[:, :2] / size[:, None], -x[0] * np.gradient(size, t)]
        step, std, left = clustered_least_squares(A, V - x[0] * size, block)
        if not np.isfinite(std).all():
            return None
        x += step[:3]
        if np.abs(step[:3]).max() < SETTLED * max(usual, 1.0):
            break
    else:
        return None
    expected = np.linalg.norm(fixes.v - np.r_[x[1:], 0.0], axis=1)
    scatter = float(np.sqrt(np.mean(left**2)))
    return Fit(
        fixes.t,
        reading,
        moves,
        flies,
        thinning,
        expected,
        x[0],
        std[0],
        step[3],
        std[3],
        x[1:],
        scatter,
    )


def _words_on_lasting_errors(source: Source, fixes: Moved, fit: Fit) -> str:
    """Words on errors that outlast several rows, such as gusts: how large they are and until when their
    correlation falls below 1 / e; "" where they do not."""
    t, error = _errors(source, fixes, fit)
    step = float(np.median(np.diff(t))) if len(t) > MIN_FIXES else LAGS
    for lag in range(1, int(LAGS / step) + 1):
        follows = t[lag:] - t[:-lag] < (lag + 0.5) * step
        if np.mean((error[lag:] * error[:-lag])[follows]) < np.exp(-1.0) * np.var(error):
            break
    else:
        return ""
    if lag <= LASTING:
        return ""
    rows = max(2 * lag, 1)
    return (
        f"; its errors of {error.std():.2g} m/s are correlated over {lag * step:.2g} s, so {rows} rows have "
        "the weight of one"
    )


def _errors(source: Source, fixes: Moved, fit: Fit) -> tuple[Array, Array]:
    """(times (n,), s, errors (n,), m/s about their mean) of the rows in flight, against the fit."""
    known = np.isfinite(source.y[:, 0])
    t, y = source.t[known], source.y[known, 0]
    size = np.linalg.norm(fixes.at(t) - np.r_[fit.wind, 0.0], axis=1)
    error = y - fit.scale * np.interp(t, fixes.t, fit.thinning) * size
    flies = (np.interp(t, fixes.t, fit.flies) == 1) & np.isfinite(error)
    return t[flies], error[flies] - error[flies].mean()


def _fact(what: str, fit: Fit) -> str:
    blows = float(np.hypot(*fit.wind))
    out_of = float(np.degrees(np.arctan2(-fit.wind[1], -fit.wind[0])) % 360)
    return (
        f"{what}: factor {fit.scale:.3f} +- {fit.scale_std:.3f}, later by {fit.lag:+.2f} +- "
        f"{fit.lag_std:.2f} s, scatter {fit.scatter:.2g} m/s, with a steady wind of {blows:.1f} m/s "
        f"out of {out_of:.0f} deg"
    )


def _reasons(source: Source, fit: Fit) -> list[Reason]:
    """Reasons of a wrong sign, unit or scale, or else of a clock."""
    name, off = label(source), abs(fit.scale - 1)
    if fit.scale < 0:
        seen = f"it reads {np.median(fit.measured[fit.flies]):.1f} m/s in flight, less than zero"
        remedy = "exchange the tubes of the pitot, or give it `scale = -1`"
        return [Reason("unit", seen, remedy, name, 10.0)]
    near = min(FACTORS, key=lambda known: abs(np.log(fit.scale / known)))
    known = WITHIN * source.estimate["scale"][0] if "scale" in source.estimate else MAX_SCALE
    least = max(known, SURE * fit.scale_std)
    if off > least:
        of_unit = abs(np.log(fit.scale / near)) < UNIT
        seen = f"it reads {fit.scale:.3g} +- {fit.scale_std:.1g} times the speed through the air"
        seen += f": {FACTORS[near]}" if of_unit else ""
        remedy = (
            "correct its `unit`"
            if of_unit
            else f"set its `scale` to {1 / fit.scale:.3g}, or let the filter estimate it"
        )
        return [Reason("unit", seen, remedy, name, float(min(off / least, 10.0)))]
    least = max(MAX_LAG, SURE * fit.lag_std)
    if abs(fit.lag) > least:
        seen = f"it is {fit.lag:+.2f} +- {fit.lag_std:.2f} s late against the speed over ground"
        remedy = f"set its `time.offset` {-fit.lag:+.2f} s further"
        return [Reason("clock", seen, remedy, name, float(abs(fit.lag) / least))]
    return []


def _frozen_reasons(source: Source, fit: Fit) -> list[Reason]:
    """A reason where a reading holds its value in flight."""
    y = source.y[:, 0]
    new = np.flatnonzero(np.r_[True, y[1:] != y[:-1]])
    last = np.r_[new[1:], len(y)] - 1
    long = (source.t[last] - source.t[new] > FROZEN_TIME) & (last - new >= FROZEN_ROWS)
    others = max(len(y) - int((last - new)[long].sum()), 1)
    lively = len(new) / others > LIVELY
    worst, when = 0.0, (0.0, 0.0)
    for first, end in zip(source.t[new[long]], source.t[last[long]]):
        within = (fit.t >= first) & (fit.t <= end) & (fit.expected > FLYING) & fit.moves
        change = float(np.ptp(fit.expected[within])) if within.any() else 0.0
        if within.any() and (lively or change > FROZEN_CHANGE) and end - first > when[1] - when[0]:
            worst, when = change, (first, end)
    if when[1] == when[0]:
        return []
    seen = (
        f"it reads one value from {when[0]:.1f} to {when[1]:.1f} s, while the speed through the air "
        f"changes by {worst:.1f} m/s"
    )
    remedy = "leave those rows out: the pitot tube was blocked, or its driver stopped"
    weight = min(float(when[1] - when[0]) / FROZEN_TIME, 10.0)
    return [Reason("repeated", seen, remedy, label(source), weight)]
