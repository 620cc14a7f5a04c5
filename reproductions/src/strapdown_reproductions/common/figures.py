"""Parts of figures that several reproductions draw."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from strapdown.typing import Array, ArrayLike

BESIDE = {"rows": 1, "shared_yaxes": True, "horizontal_spacing": 0.03}
"""Options of `make_subplots`: panels side by side over one axis."""


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


class Marks(NamedTuple):
    """Marks of one kind at x (n,) and y (n,)."""

    x: ArrayLike
    y: ArrayLike
    name: str  # in the legend
    colour: str
    # (low (n,), high (n,)) of their intervals along "x" or "y"
    ends: tuple[ArrayLike, ArrayLike] | None = None
    along: str = "y"
    hover: str = "%{y:.3g}"

    def intervals(self) -> dict[str, Any]:
        """Return the Plotly error bars of the points; empty where they have no intervals."""
        if self.ends is None:
            return {}
        of = (self.x if self.along == "x" else self.y, *self.ends)
        middle, low, high = (np.asarray(each, float) for each in of)
        bars = {
            "type": "data",
            "array": np.nan_to_num(high - middle),
            "arrayminus": np.nan_to_num(middle - low),
            "thickness": 1.2,
            "width": 3,
        }
        return {f"error_{self.along}": bars}

    def draw(
        self, figure: go.Figure, row: int = 1, col: int = 1, legend: bool = True, **marker: Any
    ) -> None:
        """Draw them in a panel; marker: what Plotly knows of one, such as its size and symbol."""
        scatter = go.Scatter(
            x=self.x,
            y=np.asarray(self.y, float),
            mode="markers",
            name=self.name,
            legendgroup=self.name,
            showlegend=legend,
            marker={"color": self.colour, "size": 8, **marker},
            hovertemplate=self.hover,
            **self.intervals(),
        )
        figure.add_trace(scatter, row=row, col=col)
