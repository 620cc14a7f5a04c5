"""The page of a calibration: strength before and after, directions on a map of the sphere,
misfits."""

import numpy as np
import plotly.graph_objects as go

from ..pages.drawing import (
    COLOURS,
    GREY,
    even_indices,
    finish,
    line,
    note,
    origin,
    panels,
    time_label,
)
from ..pages.parts import remarks, table
from ..pages.shell import Document, Page
from ..units.wording import join_words
from .findings import Result
from .methods import BANDS, DETAIL, SECTORS, coverage

DIRECTIONS_DRAWN = 2000
FOOTER = "calibrated = matrix (measured − bias), axes of the body: forward, right, down. The file is in the axes of the recording's columns."
FORMS = {
    "rests": "strength of specific force in rests is gravity",
    "ellipsoid": "strength is the same in every direction",
    "turning": "the field turns against the gyros",
}


def strength_figure(found: Result) -> go.Figure:
    """Strength of the samples before and after calibration over time, and what it should be."""
    _, factor, unit = DETAIL[found.sensor]
    drawn, zero = panels([f"strength [{unit}]"], 300), origin(found.t)
    for name, vectors, colour in (
        ("before", found.measured, GREY),
        ("after", found.calibrated, COLOURS[0]),
    ):
        values = np.linalg.norm(vectors, axis=1) * factor
        if len(found.t) < 100:
            drawn.add_trace(
                go.Scatter(
                    x=found.t - zero,
                    y=values,
                    name=name,
                    mode="markers",
                    marker={"color": colour},
                    hovertemplate="%{y:.5g}",
                )
            )
        else:
            line(drawn, found.t - zero, values, name, colour)
    drawn.add_hline(
        y=found.strength * factor, line={"color": COLOURS[1], "width": 1, "dash": "dash"}
    )
    drawn.update_xaxes(title_text=time_label(zero))
    note(drawn, f"Dashed: {found.strength * factor:.5g} {unit}, to which the strength was fitted.")
    return drawn


def directions_figure(found: Result) -> go.Figure:
    """The directions of the calibrated samples in body axes, on an equal-area map; cells without
    any are grey."""
    vectors = found.calibrated[np.isfinite(found.calibrated).all(axis=1)]
    share, counts, _ = coverage(vectors)
    unit = vectors[even_indices(len(vectors), DIRECTIONS_DRAWN)]
    unit = unit / np.linalg.norm(unit, axis=1)[:, None]
    drawn = finish(go.Figure(), 380)
    drawn.add_trace(
        go.Scatter(
            x=np.degrees(np.arctan2(unit[:, 1], unit[:, 0])),
            y=-unit[:, 2],
            mode="markers",
            name="directions",
            marker={"size": 4, "color": COLOURS[0]},
            hovertemplate="%{x:.0f} deg<extra></extra>",
        )
    )
    for band, sector in zip(*np.nonzero(counts == 0)):
        x, y = -180 + sector * 360 / SECTORS, 1 - 2 * band / BANDS
        drawn.add_shape(
            type="rect",
            x0=x,
            x1=x + 360 / SECTORS,
            y0=y,
            y1=y - 2 / BANDS,
            fillcolor=GREY,
            opacity=0.25,
            line={"width": 0},
            layer="below",
        )
    for x, y, text in (
        (0, 0, "+x"),
        (90, 0, "+y"),
        (-90, 0, "−y"),
        (180, 0, "−x"),
        (0, -0.97, "+z"),
        (0, 0.97, "−z"),
    ):
        drawn.add_annotation(x=x, y=y, text=text, showarrow=False, font={"size": 13})
    drawn.update_layout(hovermode="closest", showlegend=False)
    drawn.update_xaxes(title_text="azimuth from x towards y [deg]", range=[-182, 182], dtick=45)
    drawn.update_yaxes(title_text="sine of elevation (−z)", range=[-1.02, 1.02])
    note(
        drawn,
        f"Shaded: cells without a direction. {share:.0%} of {BANDS * SECTORS} cells of equal area "
        f"hold one.",
    )
    return drawn


def misfit_figure(found: Result) -> go.Figure:
    """Misfits of the three axes over time."""
    _, factor, unit = DETAIL[found.sensor]
    drawn, zero = panels([f"misfit [{unit}]"], 280), origin(found.t)
    used = np.isfinite(found.residuals).all(axis=1)
    for axis, colour, values in zip("xyz", COLOURS, found.residuals[used].T * factor):
        line(drawn, found.t[used] - zero, values, axis, colour)
    drawn.update_xaxes(title_text=time_label(zero))
    note(
        drawn,
        "Noise without a pattern is what is left of a good calibration; steps are iron or currents "
        "that came and went.",
    )
    return drawn


def _headline(found: Result) -> str:
    """The error before and after, and the directions covered, in a sentence."""
    _, factor, unit = DETAIL[found.sensor]
    before, after = found.before * factor, found.after * factor
    lack = f", none near {join_words(found.lacking)}" if found.lacking else ""
    return (
        f"Calibration takes the {found.sensor}'s error of strength from {before:.3g} to {after:.3g} "
        f"{unit} rms, of {found.strength * factor:.4g} {unit}; directions cover {found.coverage:.0%} "
        f"of the sphere{lack}."
    )


def page(found: Result) -> Page:
    """The Page of a Calibration."""
    document = Document(
        f"Calibration of the {found.sensor}",
        {
            "recording": found.name,
            "time": f"{found.t[0]:.1f} to {found.t[-1]:.1f} s",
            "samples": str(len(found.t)),
            "form": f"{found.form}: {FORMS[found.form]}",
            "coverage": f"{found.coverage:.0%}",
        },
        FOOTER,
        _headline(found),
        remarks(found.notes),
    )
    document.add(
        "Curves",
        document.place(strength_figure(found), "Strength"),
        document.place(directions_figure(found), "Directions"),
        document.place(misfit_figure(found), "Misfits"),
    )
    document.add("Parameters", table(found.header, found.rows))
    return document.page()
