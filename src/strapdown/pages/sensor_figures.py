"""Figures of the sensors of a recording: rates, jitter and gaps, what they read, vibration, and how
often they stood at the end of their range.

Each figure takes a Recording and, for their events and shades, the solutions made of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go

from ..aiding import find
from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.recording import Recording
from ..data.solution import Solution
from ..engine.plausible_limits import AT_FULL_SCALE
from ..io.magnetic_record import MIN_LEVELS, PILE, TIMES
from ..preprocessing.imu_samples import GAP_MEDIANS
from ..sensor_models.imu import ImuSpec, imu as imu_spec
from ..typing import Array
from ..units.wording import number
from .drawing import (
    COLOURS,
    level,
    line,
    log_frame,
    log_ticks,
    note,
    origin,
    panels,
    peak,
    time_axis,
)
from .parts import caption, table
from .spectra import power_spectrum, segments

MAX_SAMPLES = 2**20
"""Samples at most in a spectrum: that of a longer stretch is from its middle."""
SEGMENT, SEGMENTS, MIN_SEGMENT = 20.0, 8, 64
"""s of the segments of Welch's method, the least number of segments, and their least samples."""
SPECTRUM_POINTS = 250
"""Points of a spectrum that are drawn: means over bins of like width on a logarithmic axis."""
MAX_SOURCES = 6
"""Sources at most whose intervals are drawn; the table has all."""


class TriadFigure(NamedTuple):
    """Readings of a triad of the IMU, for a figure."""

    name: str
    quantity: str
    unit: str
    values: Array  # (n, 3) in `unit`, body axes
    full_scale: float  # in `unit`, 0 where it is not described
    noise: float  # white noise, `unit`/sqrt(Hz), 0 where it is not described


def triads(recording: Recording) -> list[TriadFigure]:
    """The gyro in deg/s and the accelerometer in m/s^2, over each sample."""
    imu, spec = recording.imu, _known_grade(recording)
    found = []
    for name, quantity, unit, scale, increments, described in (
        ("gyro", "angular rate", "deg/s", np.degrees(1), imu.dtheta, spec and spec.gyro),
        ("accelerometer", "specific force", "m/s²", 1.0, imu.dv, spec and spec.accel),
    ):
        full, noise = (described.saturation, described.noise) if described else (0.0, 0.0)
        values = scale * increments / imu.dt[:, None]
        found.append(TriadFigure(name, quantity, unit, values, scale * full, scale * noise))
    return found


def _known_grade(recording: Recording) -> ImuSpec | None:
    """The IMU as its grade has it, None where none is named or it is not known here."""
    named = recording.meta.get("grade")
    try:
        return None if named is None else imu_spec(named)
    except DataError:
        return None


def at_limit(triad: TriadFigure) -> float:
    """Share of the samples that have an axis at its full scale; where that is not described, at its
    largest or smallest value, if far more samples stand there than at the next one."""
    if triad.full_scale:
        reached = np.abs(triad.values) >= AT_FULL_SCALE * triad.full_scale
        return float(reached.any(axis=1).mean())
    full = np.zeros(len(triad.values), bool)
    for column in triad.values.T:
        close = 1e-6 * (peak(column) or 1.0)
        few = np.unique(np.rint(column[:: max(len(column) // 2000, 1)] / close))
        for away in (column.max() - column, column - column.min()) if len(few) > MIN_LEVELS else ():
            there = away <= close
            following = away[~there].min() if not there.all() else np.inf
            beside = np.count_nonzero(np.abs(away - following) <= close)
            if there.sum() > max(20, PILE * len(column), TIMES * beside):
                full |= there
    return float(full.mean())


def _sources(recording: Recording) -> Iterator[tuple[str, Array]]:
    """(name, times) of the sources that were recorded and have an interval."""
    for source in recording.sources:
        if len(source.t) > 1 and _is_recorded(source.kind):
            yield source.name or source.kind, source.t


def _is_recorded(kind: str) -> bool:
    """Return True where fixes of this kind come from a sensor; an unknown kind, of a plugin that is
    gone, counts as one."""
    try:
        return find(kind).recorded
    except ValueError:
        return True


def sensor_table(recording: Recording | None) -> str:
    """HTML of rates, jitter and gaps of the IMU and of every source, and of the samples of the IMU
    that repeat the one before or stand at the end of the range; "" without samples."""
    if recording is None or len(recording.imu.t) < 2:
        return ""
    t, rows = recording.imu.t, []
    for triad in triads(recording):
        held = float((np.diff(triad.values, axis=0) == 0).all(axis=1).mean())
        shares = [f"{100 * share:.3g}" for share in (held, at_limit(triad))]
        rows.append([triad.name, *_pace(t), *shares])
    rows += [[name, *_pace(times), "–", "–"] for name, times in _sources(recording)]
    head = [
        "sensor",
        "samples",
        "rate [Hz]",
        "jitter [ms]",
        "gaps",
        "missing [s]",
        "longest interval [s]",
        "repeated [%]",
        "at full scale [%]",
    ]
    said = (
        f"Jitter: standard deviation of the intervals that are no gaps. A gap: longer than "
        f"{GAP_MEDIANS} usual intervals. Repeated: samples that read the same as the one before."
    )
    return table(head, rows) + caption(said)


def _pace(t: Array) -> list[str]:
    """Samples, rate, jitter, gaps, what is missing and the longest interval, as text."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    gaps = steps > GAP_MEDIANS * usual
    return [
        str(len(t)),
        number(1 / usual if usual else np.inf),
        number(round(1e3 * float(steps[~gaps].std()), 6)),
        str(int(gaps.sum())),
        number(float((steps[gaps] - usual).sum())),
        number(float(steps.max())),
    ]


def intervals(
    recording: Recording | None, solutions: Mapping[str, Solution] | None = None
) -> go.Figure | None:
    """Time from sample to sample of the IMU and of the sources, on logarithmic axes."""
    if recording is None or len(recording.imu.t) < 2:
        return None
    shown = [("IMU", "ms", 1e3, recording.imu.t)]
    shown += [(name, "s", 1.0, t) for name, t in _sources(recording)][:MAX_SOURCES]
    figure = panels([_break_label(name, unit) for name, unit, *_ in shown], 110, log=True)
    zero = origin(recording.imu.t)
    for row, (name, unit, scale, t) in enumerate(shown, start=1):
        steps = scale * np.diff(t)
        line(figure, t[1:] - zero, steps, name, COLOURS[0], row, legend=False, unit=unit)
        log_frame(figure, steps, row, 1.5)
    return time_axis(figure, solutions or recording, zero)


def readings(
    recording: Recording | None, solutions: Mapping[str, Solution] | None = None
) -> go.Figure | None:
    """Specific force and angular rate over time in body axes, with the full scale where it is
    described and near."""
    if recording is None or len(recording.imu.t) < 2:
        return None
    both = triads(recording)
    figure = panels([f"{triad.quantity} [{triad.unit}]" for triad in both], 200)
    t, zero = recording.imu.t, origin(recording.imu.t)
    for row, triad in enumerate(both, start=1):
        for i, axis in enumerate("xyz"):
            line(figure, t - zero, triad.values[:, i], axis, COLOURS[i], row, unit=triad.unit)
        if 0 < triad.full_scale < 2 * peak(triad.values):
            for end in (triad.full_scale, -triad.full_scale):
                level(figure, t - zero, end, "full scale", row)
    return time_axis(figure, solutions or recording, zero)


def _break_label(name: str, unit: str) -> str:
    """The label of a low panel, whose words stand below one another where they are many."""
    *before, last = name.rsplit(" ", 1)
    return "<br>".join(map(escape, [*before, f"{last} [{unit}]"]))


def temperature(
    recording: Recording | None, solutions: Mapping[str, Solution] | None = None
) -> go.Figure | None:
    """Temperature of the IMU over time, degC, where it was measured."""
    if recording is None or "temperature" not in recording.meta:
        return None
    t, degrees = np.asarray(recording.meta["temperature"], float).T
    zero = origin(recording.imu.t)
    figure = panels(["temperature of the IMU [°C]"], 200)
    line(figure, t - zero, degrees, "temperature", COLOURS[0], legend=False, unit="°C")
    return time_axis(figure, solutions or recording, zero)


def spectra(recording: Recording | None) -> go.Figure | None:
    """Power spectral densities (one-sided, Welch's method) of angular rate and specific force in
    body axes, of the longest stretch without a gap, with the white noise that is described; None
    where that is too short."""
    if recording is None or len(recording.imu.t) < 2:
        return None
    rows, rate = _longest_stretch(recording.imu)
    segment = int(min(SEGMENT * rate, (rows.stop - rows.start) // SEGMENTS))
    if segment < MIN_SEGMENT:
        return None
    both = triads(recording)
    figure = panels([f"{each.quantity} [({each.unit})²/Hz]" for each in both], 230, log=True)
    for row, triad in enumerate(both, start=1):
        parts = segments(triad.values[rows], segment)
        f, density = power_spectrum(parts - parts.mean(axis=2, keepdims=True), rate)
        f, density = _bin_spectrum(f[1:], density[1:])
        unit, white = f"({triad.unit})²/Hz", 2 * triad.noise**2  # one-sided
        for i, axis in enumerate("xyz"):
            line(figure, f, density[:, i], axis, COLOURS[i], row, unit=unit)
        if white:
            level(figure, f, white, "white noise", row, unit)
        log_frame(figure, np.append(density, white), row, 1.5)
    ends = np.log10(f[[0, -1]])
    figure.update_xaxes(
        type="log",
        range=list(ends),
        unifiedhovertitle={"text": "%{x:.3g} Hz"},
        **log_ticks(*ends),
    )
    figure.update_xaxes(title_text="frequency [Hz]", row=len(both), col=1)
    t = recording.imu.t[rows]
    if len(t) < len(recording.imu.t):
        note(figure, f"Of {t[0]:.1f} to {t[-1]:.1f} s, which has no gap.")
    return figure


def _longest_stretch(imu: Imu) -> tuple[slice, float]:
    """Rows of the longest stretch without a gap, MAX_SAMPLES of its middle, and their rate, Hz."""
    steps = np.diff(imu.t)
    usual = float(np.median(steps))
    edges = np.r_[0, np.flatnonzero(steps > GAP_MEDIANS * usual) + 1, len(imu.t)]
    longest = int(np.argmax(np.diff(edges)))
    first, last = int(edges[longest]), int(edges[longest + 1])
    if last - first > MAX_SAMPLES:
        first = (first + last - MAX_SAMPLES) // 2
        last = first + MAX_SAMPLES
    span = float(imu.t[last - 1] - imu.t[first])
    return slice(first, last), (last - first - 1) / span if span else 1 / usual


def _bin_spectrum(f: Array, density: Array) -> tuple[Array, Array]:
    """Means of (k,) frequencies and (k, 3) densities over SPECTRUM_POINTS bins of like width on a
    logarithmic axis."""
    edges = np.geomspace(f[0], f[-1], SPECTRUM_POINTS + 1)
    bins = np.minimum(np.searchsorted(edges, f, side="right"), SPECTRUM_POINTS)
    first = np.flatnonzero(np.diff(bins, prepend=-1))
    count = np.diff(np.r_[first, len(f)])
    return np.add.reduceat(f, first) / count, np.add.reduceat(density, first) / count[:, None]
