"""The numbers of the noise model that are sought, and what a run takes in their place."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..aiding import find
from ..core.loop.contract import Noise
from ..data.solution import Correlated, Source
from ..engine.options import RunOptions
from ..engine.prepare import Run, ready
from ..sensor_models.errors import Triad
from ..sensor_models.imu import ImuSpec
from ..typing import Array
from ..units import quantities
from ..units.conversion import SHEET, in_units
from .numbers import IMU, LASTING, OF_IMU, TIME, WHITE, NoiseNumber

WIDE = 100.0
"""Factor, up and down, within which a number is sought."""
WITHOUT_WALK = 0.01
"""1/s: where no bias walk is given, the search begins with this times the white noise."""
APART = ("position", "velocity")
"""Kinds whose vertical errors have numbers of their own."""


@dataclass(frozen=True)
class NoiseUnknown(NoiseNumber):
    """A number that is sought; its logarithm is what varies."""

    begin: float  # SI, where the search begins
    least: float  # SI
    most: float
    place: int = -1  # of the source among the sources
    rows: tuple[int, ...] = ()  # of its innovation


def of_imu(noise: Noise) -> list[NoiseUnknown]:
    """Those of the IMU."""
    found = []
    for what in OF_IMU:
        given = getattr(noise, what.field)
        begin = given or WITHOUT_WALK * getattr(noise, what.field.removesuffix("_bias"))
        of = (IMU, what, "", SHEET[what.si], in_units(1.0, what.si))
        found.append(NoiseUnknown(*of, given, begin, begin / WIDE, begin * WIDE))
    return found


def groups(a: Source) -> dict[str, tuple[int, ...]]:
    """{part of a source: rows of the innovation that share a number}."""
    rows = tuple(range(np.shape(a.std)[1]))
    return {"horizontal": rows[:2], "vertical": rows[2:]} if a.kind in APART else {"": rows}


def of_source(a: Source, index: int) -> list[NoiseUnknown]:
    """Those of a source's white errors, and of its correlated ones where it has some."""
    found = []
    for part, rows in groups(a).items():
        unit, factor = quantities.shown_unit(find(a.kind).quantities[rows[0]])
        given = typical_std(a, rows)
        of = (_name(a), WHITE, part, unit, factor)
        found.append(NoiseUnknown(*of, given, given, given / WIDE, given * WIDE, index, rows))
    return found + (
        correlation_unknowns(a, index, a.correlated, a.correlated) if a.correlated else []
    )


def correlation_unknowns(
    a: Source, index: int, begin: Correlated, given: Correlated | None = None
) -> list[NoiseUnknown]:
    """Those of a source's correlated errors."""
    found = []
    seconds = float(np.ptp(a.t))
    for part, rows in groups(a).items():
        unit, factor = quantities.shown_unit(find(a.kind).quantities[rows[0]])
        size, white = _rms(begin.std, rows), typical_std(a, rows)
        before = _rms(given.std, rows) if given else 0.0
        of = (_name(a), LASTING, part, unit, factor)
        bounds = (min(size, white) / WIDE, max(size, white) * WIDE)
        found.append(NoiseUnknown(*of, before, size or white / WIDE, *bounds, index, rows))
    before = given.time if given else 0.0
    least = min(float(np.median(np.diff(a.t))), begin.time)
    of = (_name(a), TIME, "", "s", 1.0)
    found.append(NoiseUnknown(*of, before, begin.time, least, max(seconds, begin.time), index))
    return found


def typical_std(a: Source, rows: Sequence[int]) -> float:
    """The stated standard deviation of these rows: rms over them, median over the fixes."""
    std = np.asarray(a.std, float).reshape(len(a.t), -1)[:, list(rows)]
    return float(np.median(np.sqrt(np.mean(std**2, axis=1))))


def _rms(std: Sequence[float], rows: Sequence[int]) -> float:
    return float(np.sqrt(np.mean([std[i] ** 2 for i in rows])))


def _name(a: Source) -> str:
    return a.name or a.kind


def noise_with(noise: Noise, unknowns: Iterable[NoiseUnknown], theta: Array) -> Noise:
    """The Noise with these logarithms in it."""
    values = {
        each.what.field: float(np.exp(x)) for each, x in zip(unknowns, theta) if each.source == IMU
    }
    return noise._replace(**values)


def sources_with(
    sources: Sequence[Source], unknowns: Sequence[NoiseUnknown], theta: Array
) -> tuple[Source, ...]:
    """The sources with these logarithms in them: stated standard deviations keep their shape."""
    changed = list(sources)
    values = list(zip(unknowns, np.exp(theta)))
    for index in {each.place for each in unknowns if each.place >= 0}:
        own = [(each, value) for each, value in values if each.place == index]
        changed[index] = _source_with(sources[index], own)
    return tuple(changed)


def _source_with(a: Source, own: Sequence[tuple[NoiseUnknown, float]]) -> Source:
    std = np.array(a.std, float).reshape(len(a.t), -1)
    lasts, time = np.zeros(std.shape[1]), 0.0
    for each, value in own:
        rows = list(each.rows)
        if each.what is WHITE:
            std[:, rows] *= value / each.given
        elif each.what is LASTING:
            lasts[rows] = value
        else:
            time = value
    correlated = Correlated(tuple(lasts.tolist()), float(time)) if time else a.correlated
    return replace(a, std=std, correlated=correlated)


def run_with(
    run: Run,
    asked: RunOptions,
    sources: Sequence[Source],
    unknowns: Sequence[NoiseUnknown],
    theta: Array,
) -> Run:
    """A Run as another, but with these sources and logarithms, before its first sample. Rows of its
    solution are not looked at."""
    recording = replace(run.recording, sources=sources_with(sources, unknowns, theta))
    noise = noise_with(run.noise, unknowns, theta)
    asked = {**asked, "every": len(run.samples.t), "covariance": False}
    return ready(recording, run.filter, run.start, noise, run.spec, asked)


def imu_with(spec: ImuSpec, noise: Noise, source: str) -> ImuSpec:
    """An ImuSpec whose `noise()` is this one; its initial bias, scale and misalignment stay.

    Where one bias state is not exactly what the description has, what wanders becomes a random
    walk of the bias. A bias that decays keeps its time constant. source: what to add to that of
    the spec.
    """
    before = spec.noise()
    triads = {
        sensor: _triad_with(
            spec,
            getattr(spec, sensor),
            (getattr(before, sensor), getattr(before, f"{sensor}_bias")),
            (getattr(noise, sensor), getattr(noise, f"{sensor}_bias")),
        )
        for sensor in ("gyro", "accel")
    }
    warm_up = spec.warm_up if any(each.temperature for each in triads.values()) else None
    said = f"{spec.source}; {source}" if spec.source else source
    return replace(spec, name=f"{spec.name}-tuned", source=said, warm_up=warm_up, **triads)


def _triad_with(
    spec: ImuSpec, triad: Triad, before: tuple[float, float], after: tuple[float, float]
) -> Triad:
    white, walk = after
    if after == before:
        return triad
    if triad.bias_model(spec.warm_up)[1]:  # a Gauss-Markov bias alone
        size = walk * float(np.sqrt(triad.time_constant / 2))
        return replace(triad, noise=white, gauss_markov=size)
    return replace(
        triad,
        noise=white,
        turn_on_bias=triad.bias_std(spec.warm_up),
        bias_walk=walk,
        gauss_markov=0.0,
        time_constant=0.0,
        flicker=0.0,
        temperature=(),
    )
