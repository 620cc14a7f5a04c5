"""Parts of figures that several reproductions draw."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.typing import Array, ArrayLike

BESIDE = {"rows": 1, "shared_yaxes": True, "horizontal_spacing": 0.03}
"""Of `make_subplots`: panels side by side over one axis."""


def side_by_side(titles: Sequence[str]) -> go.Figure:
    """A figure of panels side by side, which share their y axis."""
    return make_subplots(**BESIDE, cols=len(titles), subplot_titles=list(titles))


def quantile_lines(
    drawn: go.Figure,
    x: Array,
    quantiles: Sequence[Array],
    col: int,
    widths: tuple[float, float],
    **style: Any,
) -> None:
    """The median of something, and dotted two quantiles of it: `quantiles` (low, median, high) in
    the panel `col`, the first of which has the legend.

    widths: of the median and of the others; style: of the traces, with "color" for all lines.
    """
    low, middle, high = quantiles
    colour = style.pop("color")
    thin = {"width": widths[1], "dash": "dot"}
    for y, line, legend in (
        (middle, {"width": widths[0]}, col == 1),
        (low, thin, False),
        (high, thin, False),
    ):
        drawn.add_trace(
            go.Scatter(
                x=x,
                y=y,
                mode="lines",
                showlegend=legend,
                line={"color": colour, **line},
                **style,
            ),
            row=1,
            col=col,
        )


def ticks(values: Sequence[float], texts: Mapping[float, str] | None = None) -> dict[str, Any]:
    """Settings of an axis with ticks at the values alone, which may have `texts`."""
    return {
        "tickmode": "array",
        "tickvals": list(values),
        "ticktext": [(texts or {}).get(value, f"{value:g}") for value in values],
    }


def names_down(names: Sequence[str], margin: float = 0.5) -> dict[str, Any]:
    """Settings of a y axis with a row for each name, the first one on top."""
    return {
        **ticks(range(len(names)), dict(enumerate(names))),
        "range": [len(names) - 1 + margin, -margin],
    }


def marks(
    figure: go.Figure,
    x: ArrayLike,
    y: ArrayLike,
    name: str,
    colour: str,
    ends: tuple[ArrayLike, ArrayLike] | None = None,
    along: str = "y",
    row: int = 1,
    col: int = 1,
    legend: bool = True,
    hover: str = "%{y:.3g}",
    **marker: Any,
) -> None:
    """Marks at x (n,) and y (n,) in a panel; ends: (low (n,), high (n,)) of their intervals along
    "x" or "y"; marker: what Plotly knows of one, such as its size and symbol."""
    bars = {}
    if ends is not None:
        middle, low, high = (np.asarray(each, float) for each in (x if along == "x" else y, *ends))
        bars[f"error_{along}"] = {
            "type": "data",
            "array": np.nan_to_num(high - middle),
            "arrayminus": np.nan_to_num(middle - low),
            "thickness": 1.2,
            "width": 3,
        }
    figure.add_trace(
        go.Scatter(
            x=x,
            y=np.asarray(y, float),
            mode="markers",
            name=name,
            legendgroup=name,
            showlegend=legend,
            marker={"color": colour, "size": 8, **marker},
            hovertemplate=hover,
            **bars,
        ),
        row=row,
        col=col,
    )
