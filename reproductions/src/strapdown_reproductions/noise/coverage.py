"""Fixes hidden in outages of the recorded drive and flight: how many lie within one and three of the
standard deviations that the filter predicts for them.

A hidden fix keeps its place with a standard deviation of HIDDEN, so that the filter says of it what
it would and takes nothing from it; its own standard deviation is put back afterwards.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapdown import io
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine.batch import fuse
from strapdown.engine.heading_hypotheses import align_start
from strapdown.sensor_models.imu import ImuSpec, imu as imu_spec
from strapdown.tuning.tune import tune
from strapdown.typing import Array

from ..common.example_recordings import FLIGHT

HIDDEN = 1e4
"""m: no fix of that standard deviation moves anything."""
LENGTHS = (10.0, 30.0)
"""s of the outages."""
BETWEEN, SHIFTS = 30.0, 3
"""s of fixes between two outages of a run, and runs, in each of which the outages lie elsewhere."""
DRIVE = (60.0, 545.0)
"""s of drive0708 that are scored: it stands before."""
SCORED = {"drive0708": DRIVE, "thor75": FLIGHT}
DEFAULT, TUNED, OTHER_HALF = "as described", "tuned", "tuned on the other half"


class CoverageWay(NamedTuple):
    """Sources and IMU of a run, and the seconds that are scored with them."""

    name: str
    recording: Recording
    imu: ImuSpec | None
    span: tuple[float, float]


def rows(folder: Path, name: str) -> Iterator[dict[str, Any]]:
    """A row per hidden fix, axis, length of outage and way."""
    recording = io.read(folder / f"{name}.toml")
    for way in ways(recording, SCORED[name]):
        for length in LENGTHS:
            for shift in range(SHIFTS):
                own = {"recording": name, "way": way.name, "length": length}
                for row in errors_in_windows(way, outages(way.span, length, shift)):
                    yield own | row


def ways(recording: Recording, span: tuple[float, float]) -> list[CoverageWay]:
    """As described, tuned on all of it, and each half tuned on the other one."""
    whole = tune(recording)
    middle = (span[0] + span[1]) / 2
    halves = ((span[0], middle), (middle, span[1]))
    found = [
        CoverageWay(DEFAULT, recording, None, span),
        CoverageWay(TUNED, whole.tuned, whole.imu, span),
    ]
    for own, other in (halves, halves[::-1]):
        part = tune(recording, start_s=other[0], stop_s=other[1])
        found.append(CoverageWay(OTHER_HALF, part.tuned, part.imu, own))
    return found


def outages(span: tuple[float, float], length: float, shift: int) -> list[tuple[float, float]]:
    """(start, stop) of outages of `length` within the span, BETWEEN apart."""
    period = length + BETWEEN
    first = span[0] + shift * period / SHIFTS
    return [(t, t + length) for t in np.arange(first, span[1] - length, period)]


def errors_in_windows(
    way: CoverageWay, windows: Sequence[tuple[float, float]]
) -> Iterator[dict[str, Any]]:
    """Yield the error and standard deviation, north and east, m, of each position fix within the
    windows."""
    places = [a for a in way.recording.sources if a.kind == "position"]
    others = [a.without(windows) for a in way.recording.sources if a.kind == "velocity"]
    rest = [a for a in way.recording.sources if a.kind not in ("position", "velocity")]
    sources = [*(_without_weight(a, windows) for a in places), *others, *rest]
    start = align_start(way.recording, imu_spec(way.imu or way.recording.meta["grade"]))
    solution = fuse(replace(way.recording, sources=tuple(sources)), imu=way.imu, start=start)
    i = solution.innovations
    assert i.root is not None
    for s, a in enumerate(places):
        own = i.source == s
        t, e, L = i.t[own], i.innovation[own], i.root[own]
        at = np.searchsorted(a.t, t - 1e-6)
        inside = _inside(t, windows) & np.isfinite(e[:, :2]).all(axis=1)
        square = (
            np.c_[L[:, 0] ** 2, L[:, 1] ** 2 + L[:, 2] ** 2] - HIDDEN**2 + a.std[at][:, :2] ** 2
        )
        for k in np.flatnonzero(inside):
            since = t[k] - max(start for start, _ in windows if start <= t[k])
            for axis, name in enumerate(("north", "east")):
                yield {
                    "axis": name,
                    "t": float(t[k]),
                    "since": float(since),
                    "error": float(e[k, axis]),
                    "std": float(np.sqrt(max(square[k, axis], 0.0))),
                }


def _without_weight(a: Source, windows: Sequence[tuple[float, float]]) -> Source:
    std = np.where(_inside(a.t, windows)[:, None], HIDDEN, a.std)
    return replace(a, std=std, robust=False, adaptive=0.0)


def _inside(t: Array, windows: Sequence[tuple[float, float]]) -> Array:
    return np.logical_or.reduce([(t >= start) & (t < stop) for start, stop in windows])
