"""The Allan page of a recording at rest: curves of gyros and accelerometers, coefficients, the
grade they suggest; also as CSV and TOML."""

from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from ..checks import DataError
from ..core.loop.contract import Imu
from ..data.recording import Recording
from ..data.value import Value
from ..fileio.files import together, write_table
from ..pages.drawing import COLOURS, GREY, finish, log_ticks, note, ribbon
from ..pages.parts import caption, paragraphs, remarks, table
from ..pages.shell import Document, Page
from ..preprocessing.stationary import REST_ACCEL, REST_MEAN, REST_RATE, at_rest, stretches
from ..sensor_models.errors import Triad
from ..sensor_models.imu import imu as imu_spec
from ..typing import Array
from ..units.conversion import SHEET, in_units
from ..units.wording import capitalise, join_words, short
from .deviation import AXIS_NAMES, Allan, Sensor, allan, first_gap
from .fit import COEFFICIENTS, AllanFit
from .suggested_grade import MISFIT, Suggestion, expected_deviation, suggest

AXIS_LABELS = ("x (forward)", "y (right)", "z (down)")
AVERAGING_TIME = 0.25
"""Rest is judged on samples averaged to about this time, s: the noise of single counts is no
motion."""
SLOW_STRETCH_TIME = 30.0
"""Smooth driving is as still as a rest over a second: what turns or accelerates slowly is judged
on stretches of about this time, s."""
FOOTER = "Overlapping estimates (NIST SP 1065); coefficients as in IEEE Std 952-1997; axes of the body: forward, right, down."
NOISE_SLOPES = {
    "quantisation": "-1",
    "white noise": "-1/2",
    "bias instability": "0",
    "rate random walk": "+1/2",
    "rate ramp": "+1",
}
"""Slope of each term in the logarithmic plot."""


@dataclass(frozen=True, eq=False)
class Analysis(Value):
    """Result of `analyse` for a recording."""

    recording: Recording  # the stretch that was used
    result: Allan
    suggestion: Suggestion
    notes: tuple[str, ...]  # sentences for the user

    @property
    def header(self) -> tuple[str, ...]:
        """Header of `rows`."""
        return "sensor", "coefficient", "slope", "triad", "std", *AXIS_NAMES, "unit"

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Coefficients in units of datasheets as text, a row each; "<" and a limit stand where
        one cannot be told from zero."""
        rows = []
        for sensor in (self.result.gyro, self.result.accel):
            for name in sensor.triad.fit.names:
                si = COEFFICIENTS[name].units[sensor.name]
                cells = [
                    _coefficient_text(curve.fit, name, si) for curve in (sensor.triad, *sensor.axes)
                ]
                std = sensor.triad.fit.std[name]
                rows.append(
                    (
                        sensor.name,
                        name,
                        NOISE_SLOPES.get(name, ""),
                        cells[0],
                        short(in_units(std, si)) if np.isfinite(std) else "",
                        *cells[1:],
                        SHEET[si],
                    )
                )
        return rows

    @property
    def disturbed(self) -> bool:
        """True where the record holds more than noise: the fitted terms miss the estimates of an
        axis."""
        return any(
            curve.fit.misfit > MISFIT
            for sensor in (self.result.gyro, self.result.accel)
            for curve in sensor.axes
        )

    @property
    def verdict(self) -> str:
        """One sentence: the nearest grade and how far its deviations are from those of the
        record; none where the record is disturbed."""
        name = self.suggestion.grade
        near = f"{name} (its Allan deviations differ by a factor of {self.suggestion.factors[name]:.2g} on average)"
        if self.disturbed:
            return (
                "no grade: the record contains more than noise, so the sensor may be better than "
                f"these figures; the nearest to them is {near}"
            )
        return f"nearest grade: {near}"

    def write(self, folder: Path) -> None:
        """Write allan.csv, allan-imu.toml and allan.html into `folder`, all or none. Raises
        DataError where that cannot be done."""
        with together():
            write_table(self.result.deviations().reset_index(), folder / "allan.csv", 6)
            self.suggestion.spec.to_toml(folder / "allan-imu.toml")
            page(self).save(folder / "allan.html")


def analyse(
    recording: Recording,
    start: float | None = None,
    stop: float | None = None,
    gauss_markov: bool = False,
) -> Analysis:
    """The Analysis of a Recording at rest, or of its part from `start` to `stop`, s.

    Where the part has gaps, its longest stretch without one is used and a note says so. Raises
    DataError where the IMU moves most of the time.
    """
    part = recording.between(start, stop)
    imu, notes = longest(part.imu)
    notes += _motion(imu)
    result = allan(imu, gauss_markov)
    suggestion = suggest(result)
    notes += [text for sensor in (result.gyro, result.accel) for text in _misfit(sensor)]
    source = f"{recording.meta.get('name', 'recording')}, {imu.t[0] - imu.dt[0]:.1f} to {imu.t[-1]:.1f} s: {suggestion.spec.source}"
    suggestion = suggestion._replace(
        spec=replace(
            suggestion.spec, name=f"{recording.meta.get('name', 'recording')}-allan", source=source
        )
    )
    return Analysis(replace(part, imu=imu), result, suggestion, tuple(notes))


def longest(imu: Imu) -> tuple[Imu, list[str]]:
    """(the longest stretch of an Imu without gaps, notes)."""
    edges, rest = [0], imu
    while gap := first_gap(rest):
        edges.append(edges[-1] + gap)
        rest = Imu(*(column[gap:] for column in rest))
    edges.append(len(imu.t))
    if len(edges) == 2:
        return imu, []
    best = int(np.argmax(np.diff(edges)))
    found = Imu(*(column[edges[best] : edges[best + 1]] for column in imu))
    return found, [
        f"{len(edges) - 2} gaps: the longest stretch without one is used, "
        f"{found.t[0] - found.dt[0]:.2f} to {found.t[-1]:.2f} s"
    ]


def _motion(imu: Imu) -> list[str]:
    """A note where the IMU moves for more than a hundredth of the time. Raises DataError where
    it moves for more than half of it."""
    width = max(1, round(AVERAGING_TIME / float(np.median(imu.dt))))
    n = len(imu.t) // width
    if n < 8:
        return []
    sums = [column[: n * width].reshape(n, width, -1).sum(axis=1) for column in imu[1:]]
    coarse = Imu(imu.t[width - 1 : n * width : width], sums[0][:, 0], sums[1], sums[2])
    still, slow = at_rest(coarse, window=4 * AVERAGING_TIME), _slow_motion(coarse)
    if still.mean() >= 0.5 and slow >= 0.5:
        raise DataError(
            f"the IMU turns or accelerates in {100 * slow:.0f} % of its stretches of "
            f"{_slow_stretch(n) * width * np.median(imu.dt):.0f} s: an Allan deviation needs an "
            "IMU at rest; choose a stretch with --from and --to"
        )
    if still.mean() >= 0.99:
        return []
    rests = [
        (coarse.t[first] - coarse.dt[first], coarse.t[last - 1]) for first, last in stretches(still)
    ]
    begin, end = max(rests, key=lambda s: s[1] - s[0], default=(0.0, 0.0))
    moves = f"the IMU moves for {100 * (1 - still.mean()):.0f} % of the time" + (
        f"; its longest rest is {begin:.1f} to {end:.1f} s" if rests else ""
    )
    if still.mean() < 0.5:
        raise DataError(
            f"{moves}: an Allan deviation needs an IMU at rest; choose a stretch with --from and "
            "--to"
        )
    return [
        f"{moves}, and the Allan deviation shows the motion too; choose a stretch with --from and "
        f"--to"
    ]


def _slow_stretch(n: int) -> int:
    """Samples of AVERAGING_TIME seconds in a stretch: SLOW_STRETCH_TIME seconds, or an eighth of
    n."""
    return max(4, min(round(SLOW_STRETCH_TIME / AVERAGING_TIME), n // 8))


def _slow_motion(coarse: Imu) -> float:
    """Share of the stretches in which the samples of a `coarse` Imu vary or turn as at no rest."""
    size = _slow_stretch(len(coarse.t))
    count = len(coarse.t) // size
    force, rate = (
        (column / coarse.dt[:, None])[: count * size].reshape(count, size, 3)
        for column in (coarse.dv, coarse.dtheta)
    )

    def spread(values: Array) -> Array:
        return values.var(axis=1).sum(axis=1)

    quiet = (
        (spread(force) < REST_ACCEL**2)
        & (spread(rate) < REST_RATE**2)
        & (np.square(rate.mean(axis=1)).sum(axis=1) < REST_MEAN**2)
    )
    return 1 - quiet.mean()


def _misfit(sensor: Sensor) -> list[str]:
    """A note on the axes whose curve the model does not follow, and what their white noise is at
    most: no cluster time shows less than the sensor has."""
    poor = [
        (axis, curve) for axis, curve in zip(AXIS_NAMES, sensor.axes) if curve.fit.misfit > MISFIT
    ]
    if not poor:
        return []
    si = COEFFICIENTS["white noise"].units[sensor.name]
    most = ", ".join(
        f"{axis} {in_units((curve.high * np.sqrt(curve.tau)).min(), si):.2g}"
        for axis, curve in poor
    )
    missed = ", ".join(f"{axis} {100 * curve.fit.misfit:.0f} %" for axis, curve in poor)
    return [
        f"{sensor.name}: the fitted curves miss the estimates ({missed} rms): the record contains "
        "more than the terms of the model, such as vibration or rocking, and the coefficients are "
        f"not those of the sensor. Its white noise is at most {most} {SHEET[si]}"
    ]


def _coefficient_text(fit: AllanFit, name: str, si: str) -> str:
    if np.isfinite(fit.value[name]):
        return short(in_units(fit.value[name], si))
    return f"< {short(in_units(fit.limit[name], si))}" if np.isfinite(fit.limit[name]) else "-"


def figure(sensor: Sensor, suggested: tuple[str, Triad] | None = None) -> go.Figure:
    """Allan deviations of three axes with bands, fitted curves and the slopes of the triad's
    terms, on logarithmic axes."""
    si = "rad/s" if sensor.name == "gyro" else "m/s^2"
    drawn = finish(go.Figure(), 560)

    def to_units(values: Array) -> Array:
        return in_units(values, si)

    for axis, colour, curve in zip(AXIS_LABELS, COLOURS, sensor.axes):
        ribbon(drawn, curve.tau, to_units(curve.low), to_units(curve.high), colour, 0.18, axis)
        drawn.add_trace(
            go.Scatter(
                x=curve.tau,
                y=to_units(curve.deviation),
                name=axis,
                legendgroup=axis,
                mode="lines+markers",
                marker={"size": 4},
                line={"color": colour, "width": 1.8},
                hovertemplate="%{y:.4g} " + SHEET[si],
            )
        )
        drawn.add_trace(
            go.Scatter(
                x=curve.tau,
                y=to_units(curve.fit.deviation(curve.tau)),
                name=f"{axis[0]} fitted",
                legendgroup=axis,
                mode="lines",
                line={"color": colour, "width": 1.2, "dash": "dash"},
                hoverinfo="skip",
            )
        )
    if suggested is not None:
        name, triad = suggested
        drawn.add_trace(
            go.Scatter(
                x=sensor.triad.tau,
                y=to_units(expected_deviation(triad, sensor.triad.tau)),
                name=f"grade {escape(name)}",
                mode="lines",
                line={"color": GREY, "width": 1.6, "dash": "dashdot"},
                hovertemplate="%{y:.4g} " + SHEET[si],
            )
        )
    everything = to_units(np.concatenate([np.r_[curve.low, curve.high] for curve in sensor.axes]))
    low, high = np.log10(everything.min()) - 0.15, np.log10(everything.max()) + 0.15
    _slopes(drawn, sensor, si, low, high)
    taus = np.log10(np.concatenate([curve.tau for curve in sensor.axes]))
    drawn.update_xaxes(
        type="log",
        title_text="cluster time [s]",
        range=[taus.min() - 0.1, taus.max() + 0.1],  # labels would widen it
        exponentformat="power",
        dtick=1,
    )
    drawn.update_yaxes(
        type="log",
        title_text=f"Allan deviation [{SHEET[si]}]",
        range=[low, high],
        **log_ticks(low, high),
    )
    note(
        drawn,
        "Shaded: bounds that hold the true deviation with 68 % probability. Dotted: the terms found "
        "in the mean of the three axes.",
    )
    return drawn


def _slopes(drawn: go.Figure, sensor: Sensor, si: str, low: float, high: float) -> None:
    """A dotted line with a label for each term of the triad, where it lies within the frame."""
    tau = np.geomspace(sensor.triad.tau[0], sensor.triad.tau[-1], 60)
    for place, (name, variance) in zip(
        (0.06, 0.3, 0.94, 0.7, 0.82), sensor.triad.fit.parts(tau).items()
    ):
        y = in_units(np.sqrt(variance), si)
        inside = np.flatnonzero((np.log10(y) > low) & (np.log10(y) < high))
        if not len(inside):
            continue
        unit = COEFFICIENTS[name].units[sensor.name]
        drawn.add_trace(
            go.Scatter(
                x=tau[inside],
                y=y[inside],
                mode="lines",
                line={"color": GREY, "width": 1, "dash": "dot"},
                hoverinfo="skip",
                showlegend=False,
            )
        )
        at = inside[int(place * (len(inside) - 1))]
        slope = f", slope {NOISE_SLOPES[name].replace('-', '−')}" if name in NOISE_SLOPES else ""
        drawn.add_annotation(
            x=np.log10(tau[at]),
            y=np.log10(y[at]),
            text=f"{name} {short(in_units(sensor.triad.fit.value[name], unit))} "
            f"{SHEET[unit]}{slope}",
            showarrow=False,
            yshift=2,
            xanchor="left" if tau[at] < np.sqrt(tau[0] * tau[-1]) else "right",
            yanchor="bottom",
            font={"size": 11, "color": GREY},
        )


def page(analysis: Analysis) -> Page:
    """The Page of an Analysis."""
    imu = analysis.recording.imu
    document = Document(
        f"Allan deviation of {analysis.recording.meta.get('name', 'recording')}",
        {
            "recording": analysis.recording.meta.get("name", ""),
            "time": f"{imu.t[0] - imu.dt[0]:.1f} to {imu.t[-1]:.1f} s",
            "samples": f"{len(imu.t)} at {1 / analysis.result.dt:.6g} Hz",
            "nearest grade": "none: disturbed" if analysis.disturbed else analysis.suggestion.grade,
        },
        FOOTER,
        _headline(analysis),
        remarks(analysis.notes),
    )
    nearest = imu_spec(analysis.suggestion.grade)
    gyros = figure(analysis.result.gyro, (nearest.name, nearest.gyro))
    accelerometers = figure(analysis.result.accel, (nearest.name, nearest.accel))
    document.add(
        "Curves",
        document.place(gyros, "Gyros"),
        document.place(accelerometers, "Accelerometers"),
    )
    said = f"{capitalise(analysis.verdict)}. {_others(analysis)}"
    document.add("Coefficients", _table(analysis), paragraphs([said]))
    return document.page()


def _headline(analysis: Analysis) -> str:
    """The white noise of the record and the nearest grade, in a sentence or two."""
    rows = {row[0]: row for row in analysis.rows if row[1] == "white noise"}
    noise = [f"{sensor} {row[3]} {row[-1]}" for sensor, row in rows.items()]
    nearest = f"Nearest grade: {analysis.suggestion.grade}."
    if analysis.disturbed:
        nearest = "No grade: the record holds more than noise."
    return f"White noise: {join_words(noise)}. {nearest}"


def _others(analysis: Analysis) -> str:
    ranked = sorted(analysis.suggestion.factors.items(), key=lambda item: item[1])
    return (
        f"Factors of all grades: {', '.join(f'{name} {short(factor)}' for name, factor in ranked)}."
    )


def _table(analysis: Analysis) -> str:
    rows = ([*row[:2], row[2].replace("-1", "−1"), *row[3:]] for row in analysis.rows)
    return table(analysis.header, rows) + caption(
        "Units of datasheets; “triad” is fitted to the mean variance of the three axes and “std” "
        "its standard error. “<” precedes the smallest value that would differ significantly from "
        "zero."
    )
