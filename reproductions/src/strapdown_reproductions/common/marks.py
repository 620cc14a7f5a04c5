"""Marks with error bars, which the figures of several reproductions are made of."""

from typing import Any

import numpy as np
import plotly.graph_objects as go

from strapdown.typing import ArrayLike


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
