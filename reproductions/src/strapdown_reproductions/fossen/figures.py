"""Figures of the case studies of Fossen's chapter 14: signals, errors, biases, how long they
take to converge, and the introductory example."""

from collections.abc import Mapping
from itertools import product

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from strapdown.geometry.geodesy import displacement
from strapdown.pages.drawing import (
    COLOURS,
    GREY,
    RED,
    band,
    finish,
    frame,
    line,
    log_ticks,
    note,
    panels,
)
from strapdown.typing import Array

from ..common.figures import names_down, quantile_lines, side_by_side, ticks
from . import intro as fossen_intro, signals
from .cases import ACCEL_BELOW, CHAPTER, FADING, GYRO_BELOW, RIGHT, CaseRun
from .claims import MEKF
from .flight_picture import NAMES
from .intro import FORMS, Kept
from .runs import FossenResults
from .statements import flight_rms

NED, BODY, ANGLES = (
    ("north", "east", "down"),
    ("forward", "right", "down"),
    ("roll", "pitch", "heading"),
)
DEG = float(np.degrees(1.0))
SHOWN = MEKF[0]
"""The case of figures 2 and 3: the chapter's own rates."""
LABELS = {
    CHAPTER: "chapter's weights",
    FADING: "the same, decaying estimates",
    RIGHT: "true noises",
}
SENSORS = (
    ("accelerometer biases", "m/s²", ACCEL_BELOW, 1.0, (0.3, 400.0)),
    ("gyro biases", "deg/s", GYRO_BELOW, DEG, (0.08, 400.0)),
)
"""What, unit, bound, from SI to the unit, and range of time axes, s."""
STYLES = tuple(zip(FORMS, COLOURS, ("solid", "solid", "dash")))
"""Line styles of the filters of the introductory example."""
NEVER = 600.0
"""s: value for runs that have not converged."""


def all_figures(
    results: FossenResults, intro: Kept, flown: pd.DataFrame
) -> list[tuple[str, go.Figure, str]]:
    """[(heading, figure, caption)] of the page; intro: the second result of fossen_intro.study,
    flown: the table of statements.flight."""
    lettered = tuple(zip("ab", signals.SIGNALS))
    samples = {
        name: {tuning: results.samples.get((SHOWN, name, tuning)) for tuning in LABELS}
        for name in signals.SIGNALS
    }
    return [
        *(
            (
                f"Figure 1{letter}: {name}",
                signal(name),
                "What the accelerometers feel besides gravity, the rate, and the motion that "
                "follows from both.",
            )
            for letter, name in lettered
        ),
        *(
            (
                f"Figure 2{letter}: errors of position, velocity and attitude, {name}",
                states(samples[name][RIGHT]),
                f"{SHOWN}, true noises, first seed, whatever it looks like. True − estimate "
                f"along and about north, east, down.",
            )
            for letter, name in lettered
            if samples[name][RIGHT] is not None
        ),
        *(
            (
                f"Figure 3{letter}: biases and their estimates, {name}",
                estimates(samples[name]),
                f"{SHOWN}, first seed, with both tunings. Logarithmic time.",
            )
            for letter, name in lettered
            if None not in samples[name].values()
        ),
        (
            f"Figure 4: when biases have converged, {' and '.join(signals.SIGNALS)}",
            times(results.runs),
            "A mark per run. Right edge: not within the run. Shaded: what the chapter says of the "
            "MEKF, 1 to 2 minutes and less than 10 s.",
        ),
        *(
            (
                f"Figure 5{letter}: error of the {SENSORS[i][0]} over time, {name}",
                curves(results, {case: (case, name) for case in MEKF}, i),
                OVER_SEEDS,
            )
            for letter, (i, name) in zip("abcd", product((0, 1), signals.SIGNALS))
        ),
        *(
            (
                f"Figure 6{letter}: error of the accelerometer biases by excitation, {case}",
                curves(results, {name: (case, name) for name in signals.EXCITATIONS[:5]}, 0),
                OVER_SEEDS,
            )
            for letter, case in zip("ab", (MEKF[1], MEKF[4]))
        ),
        *introduction(intro),
        *([flight(flown)] if len(flown) else []),
    ]


OVER_SEEDS = (
    "Length of the error of the three biases: median over the seeds, and between dotted lines 80 % "
    "of them. Dashed: the bound below which "
    "it has converged. Logarithmic axes."
)


def signal(name: str) -> go.Figure:
    """Acceleration, rate, attitude, velocity and position of a signal over time."""
    truth = signals.ideal(name, 100.0, 300.0).truth
    t = truth.t
    rows = (
        ("acceleration<br>[m/s²]", BODY, signals.acceleration(name, t)),
        ("rate [deg/s]", BODY, signals.rate(name, t) * DEG),
        ("attitude [deg]", ANGLES, np.unwrap(truth.rph, axis=0) * DEG),
        ("velocity [m/s]", NED, truth.v_n),
        ("position [m]", NED, displacement(truth.lla, truth.lla[0])),
    )
    drawn = panels([label for label, _, _ in rows], height=130)
    for row, (_, names, values) in enumerate(rows, 1):
        for axis, (text, colour) in enumerate(
            zip(("forward, roll, north", "right, pitch, east", "down, heading, down"), COLOURS)
        ):
            line(
                drawn,
                t,
                values[:, axis] - (360 if names is ANGLES and values[0, axis] > 180 else 0),
                text,
                colour,
                row=row,
            )
    return _time(drawn, 5, t)


def states(run: CaseRun) -> go.Figure:
    """Errors of position, velocity and attitude of a run with its own 3 sigma."""
    scale = np.r_[np.ones(6), np.full(3, DEG)]
    labels = [
        f"{what} {axis}<br>[{unit}]"
        for what, unit in (("position", "m"), ("velocity", "m/s"), ("rotation", "deg"))
        for axis in NED
    ]
    drawn, outside = panels(labels, height=95), []
    for i in range(9):
        error, std = run.error[:, i] * scale[i], 3 * run.std[:, i] * scale[i]
        band(drawn, run.t, np.zeros(len(run.t)), std, row=i + 1)
        line(drawn, run.t, error, "true − estimate", COLOURS[0], row=i + 1)
        limit, largest = frame(run.t, error, std)
        drawn.update_yaxes(range=[-limit, limit], row=i + 1, col=1)
        if largest > 1.1 * limit:
            outside.append(
                f"{labels[i].split('<')[0]} {largest:.3g} {labels[i].split('[')[1][:-1]}"
            )
    if outside:
        note(drawn, f"At the start outside the frame, bands included: {', '.join(outside)}.")
    return _time(drawn, 9, run.t)


def estimates(runs: Mapping[str, CaseRun]) -> go.Figure:
    """True and estimated biases of runs {tuning: Run}, over the logarithm of time."""
    drawn = panels(
        [
            f"{what} {axis}<br>[{unit}]"
            for what, unit in (("accel.", "m/s²"), ("gyro", "deg/s"))
            for axis in BODY
        ],
        height=125,
    )
    for i, scale in enumerate((1.0, 1.0, 1.0, DEG, DEG, DEG)):
        late = [np.zeros(1)]
        for (tuning, run), colour in zip(runs.items(), COLOURS):
            estimate = (run.bias[:, i] - run.error[:, 9 + i]) * scale
            line(drawn, run.t, estimate, f"estimate, {LABELS[tuning]}", colour, row=i + 1)
            late.append(estimate[run.t > 2.0])
        true = run.bias[:, i] * scale
        line(drawn, run.t, true, "true", GREY, row=i + 1, dash="dash", width=1.8)
        framed = np.concatenate([*late, true])
        middle, half = 0.5 * (framed.min() + framed.max()), 0.58 * np.ptp(framed)
        drawn.update_yaxes(range=[middle - half, middle + half], row=i + 1, col=1)
    drawn.update_xaxes(
        type="log",
        range=[-1, np.log10(run.t[-1])],
        **ticks((0.1, 0.3, 1, 3, 10, 30, 100, 300)),
    )
    note(drawn, "Frames hold all estimates after the first 2 s.")
    return drawn.update_xaxes(title_text="time [s]", row=6, col=1)


def times(runs: pd.DataFrame) -> go.Figure:
    """Times of convergence of every run: a row per case, a panel per sensor."""
    own = runs[runs["excitation"].isin(signals.SIGNALS)]
    names = list(dict.fromkeys(own["case"]))
    drawn = side_by_side([sensor[0] for sensor in SENSORS])
    for col, ((_, _, _, _, ends), column, good) in enumerate(
        zip(SENSORS, ("accel_s", "gyro_s"), ((60.0, 120.0), (1e-3, 10.0))), 1
    ):
        drawn.add_shape(
            type="rect",
            x0=good[0],
            x1=good[1],
            y0=0,
            y1=1,
            yref="y domain",
            fillcolor="rgba(134,142,150,0.2)",
            line={"width": 0},
            layer="below",
            row=1,
            col=col,
        )
        for k, (tuning, signal) in enumerate(product(LABELS, signals.SIGNALS)):
            part = own[
                (own["tuning"] == tuning) & (own["excitation"] == signal) & own[column].notna()
            ]
            y = [names.index(case) + 0.17 * (k - 1.5) for case in part["case"]]
            drawn.add_trace(
                go.Scatter(
                    x=np.clip(part[column], ends[0], NEVER),
                    y=y,
                    mode="markers",
                    name=f"{LABELS[tuning]}, {signal}",
                    legendgroup=str(k),
                    showlegend=col == 1,
                    marker={
                        "color": COLOURS[k],
                        "size": 6,
                        "symbol": ("circle-open", "x-thin-open")[k % 2],
                    },
                    text=part["seed"],
                    hovertemplate="%{x:.3g} s, seed %{text}",
                ),
                row=1,
                col=col,
            )
        low, high = np.log10(ends[0]) - 0.05, np.log10(NEVER) + 0.1
        marked = (0.1, 1, 10, 60, 120, 300, NEVER)
        drawn.update_xaxes(
            type="log",
            range=[low, high],
            tickangle=0,
            row=1,
            col=col,
            title_text="time of convergence [s]",
            **ticks([each for each in marked if low <= np.log10(each) <= high], {NEVER: "never"}),
        )
    drawn.update_yaxes(**names_down(names, 0.6), row=1, col=1)
    drawn.update_yaxes(range=[len(names) - 0.4, -0.6], row=1, col=2)
    height = 170 + 34 * len(names)
    return finish(drawn, height).update_layout(
        hovermode="closest", margin={"t": 84}, legend={"y": 1 + 26 / (height - 130)}
    )


def curves(results: FossenResults, shown: Mapping[str, tuple[str, str]], sensor: int) -> go.Figure:
    """Error of the biases of a sensor (0 accelerometer, 1 gyro) over time for {name: (case,
    excitation)}, with both tunings side by side."""
    _, unit, below, scale, _ = SENSORS[sensor]
    drawn = side_by_side(list(LABELS.values()))
    lows, highs = [below * scale], [below * scale]
    for col, tuning in enumerate(LABELS, 1):
        for k, (name, key) in enumerate(shown.items()):
            if (found := results.curves.get((*key, tuning))) is None:
                continue
            own = np.nanquantile(found[sensor].astype(float) * scale, (0.1, 0.5, 0.9), axis=0)
            quantile_lines(
                drawn,
                results.t.astype(np.float32),
                own.astype(np.float32),
                col,
                (1.8, 0.7),
                name=name,
                legendgroup=name,
                color=COLOURS[k % len(COLOURS)],
                hovertemplate="%{y:.3g}",
            )
            lows.append(np.nanquantile(own[1], 0.02))
            highs.append(np.nanmax(own[1]))
        drawn.add_hline(
            y=below * scale, line={"color": RED, "width": 1.2, "dash": "dash"}, row=1, col=col
        )
    low, high = np.log10(min(lows)) - 0.1, np.log10(max(highs)) + 0.1
    drawn.update_yaxes(type="log", range=[low, high], **log_ticks(low, high))
    drawn.update_yaxes(title_text=f"error [{unit}]", row=1, col=1)
    drawn.update_xaxes(
        type="log",
        range=[np.log10(0.5), np.log10(results.t[-1])],
        title_text="time [s]",
        **ticks((1, 3, 10, 30, 60, 120, 300)),
    )
    return finish(drawn, 430).update_layout(margin={"t": 104}, legend={"y": 1.09})


def introduction(kept: Kept) -> list[tuple[str, go.Figure, str]]:
    """The figures of the introductory example."""
    drawn = panels(
        [
            "position error<br>of the INS [m]",
            "position error<br>[m]",
            "accel. bias<br>[m/s²]",
            "rate bias<br>[deg/s]",
        ],
        height=150,
    )
    record, feedforward = kept["constant", 0, "feedforward"]
    line(drawn, record.t, record.true[:, 0, 0] - feedforward.ins[:, 0, 0], "INS alone", RED, row=1)
    for form, colour, dash in STYLES:
        made = kept["constant", 0, form][1]
        line(
            drawn,
            record.t,
            record.true[:, 0, 0] - made.x[:, 0, 0],
            form,
            colour,
            row=2,
            legend=True,
            dash=dash,
        )
        for row, state, scale in ((3, 3, 1.0), (4, 4, DEG)):
            line(drawn, record.t, made.x[:, 0, state] * scale, form, colour, row=row, dash=dash)
    for row, state, scale in ((3, 3, 1.0), (4, 4, DEG)):
        line(
            drawn,
            record.t,
            record.true[:, 0, state] * scale,
            "true",
            GREY,
            row=row,
            legend=row == 3,
            dash="dot",
        )
        late = (
            np.concatenate(
                [kept["constant", 0, form][1].x[record.t > 20.0, 0, state] for form in FORMS]
                + [record.true[:, 0, state]]
            )
            * scale
        )
        drawn.update_yaxes(
            range=[late.min() - 0.1 * np.ptp(late), late.max() + 0.1 * np.ptp(late)], row=row, col=1
        )
    drawn.update_yaxes(range=[-0.6, 0.6], row=2, col=1)
    note(
        drawn,
        "Frames of the biases hold all estimates after the first 20 s, that of the position half a "
        "metre.",
    )
    return [
        (
            "Figure 7: the introductory example, constant biases, first run",
            _time(drawn, 4, record.t),
            "Five states: position, velocity, angle and two biases; fixes of position and angle "
            "each second. The INS of the feedforward "
            "filter drifts by "
            "kilometres, its estimate does not. Its biases decay between fixes and so stand off "
            "constant ones; feedback, which holds them "
            "as published, and "
            "direct nearly coincide.",
        ),
        (
            "Figure 8: dead reckoning in the introductory example, first run",
            _dead_reckoning(kept),
            f"No fixes from {fossen_intro.OUTAGE[0]:g} to {fossen_intro.OUTAGE[1]:g} s. "
            f"Feedforward: the estimated bias decays with its "
            f"time constant. Feedback, as published, and direct: it is held.",
        ),
    ]


def _dead_reckoning(kept: Kept) -> go.Figure:
    drawn = panels(
        [
            f"{biases}: {what}"
            for biases in ("constant", "decaying")
            for what in ("accel.<br>bias [m/s²]", "position<br>error [m]")
        ],
        height=150,
    )
    shown = fossen_intro.OUTAGE[0] - 30.0, fossen_intro.OUTAGE[1] + 40.0
    for first, biases in ((1, "constant"), (3, "decaying")):
        record = kept[biases, 1, FORMS[0]][0]
        for form, colour, dash in STYLES:
            made = kept[biases, 1, form][1]
            line(drawn, record.t, made.x[:, 0, 3], form, colour, row=first, dash=dash)
            line(
                drawn,
                record.t,
                record.true[:, 0, 0] - made.x[:, 0, 0],
                form,
                colour,
                row=first + 1,
                dash=dash,
            )
        line(drawn, record.t, record.true[:, 0, 3], "true", GREY, row=first, dash="dot")
        near = record.true[(record.t > shown[0]) & (record.t < shown[1]), 0, 3]
        drawn.update_yaxes(range=[near.min() - 0.09, near.max() + 0.04], row=first, col=1)
    _time(drawn, 4, record.t)
    drawn.update_xaxes(range=list(shown))
    drawn.add_vrect(
        *fossen_intro.OUTAGE, fillcolor="rgba(134,142,150,0.16)", line_width=0, layer="below"
    )
    return drawn


def _time(drawn: go.Figure, rows: int, t: Array) -> go.Figure:
    drawn.update_xaxes(title_text="time [s]", row=rows, col=1)
    return drawn.update_xaxes(range=[0.0, float(t[-1])])


def flight(flown: pd.DataFrame) -> tuple[str, go.Figure, str]:
    """The tilt error of the attitude observer over a recorded flight, by reference vector."""
    drawn, rms = panels(["tilt error<br>[deg]"], height=320), flight_rms(flown)
    for (name, text), colour in zip(NAMES.items(), COLOURS):
        said = f"reference by {text}, rms {rms[name]:.2g} deg"
        line(
            drawn,
            flown["second"].to_numpy(float),
            flown[f"{name}_deg"].to_numpy(),
            said,
            colour,
            row=1,
        )
    drawn.update_xaxes(title_text="time [s]")
    return (
        "Figure 9: the attitude observer on a recorded flight",
        drawn,
        "thor75, a small fixed-wing aircraft, against the attitude computed on board; default gains, the "
        "same magnetometer. The specific force is compared with gravity alone, or with GNSS velocity "
        "differences less gravity.",
    )
