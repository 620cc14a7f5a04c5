"""Figures of the separation of a filter from its smoother."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from ..data.solution import Solution
from .drawing import each, line, log_range, origin, panels, positive, time_axis

PARTS = (("position", "m", 1.0), ("velocity", "m/s", 1.0), ("attitude", "deg", np.degrees(1)))
"""Quantities that are compared: name, unit and its size."""


def separation(solutions: Solution | Mapping[str, Solution]) -> go.Figure | None:
    """Filter less smoother over time on logarithmic axes, with 3 standard deviations of their
    difference, of the smoothed ones of a Solution or {name: Solution}; None without any."""
    shown = [one for one in each(solutions) if one.solution.separation is not None]
    found = []
    for i, (name, unit, scale) in enumerate(PARTS):
        curves = [
            (one, scale * np.asarray(part, float)[:, i])
            for one in shown
            for part in one.solution.separation or ()
        ]
        known = positive(np.empty(0), *(values for _, values in curves))
        if len(known):
            found.append((f"{name} [{unit}]", unit, curves, known))
    if not found:
        return None
    figure, zero = panels([label for label, *_ in found], log=True), origin(shown[0].solution.t)
    for row, (_, unit, curves, known) in enumerate(found, start=1):
        for k, (one, values) in reversed(list(enumerate(curves))):
            t, label = one.solution.t - zero, one.label("separation")
            if k % 2:  # the standard deviations, after the differences
                name, first = "3σ" if one.alone else f"{label}, 3σ", row == 1 and one.alone
                line(figure, t, 3 * values, name, one.colour, row, first, unit=unit, dash="dot")
                figure.data[-1].legendgroup = label
            else:
                line(figure, t, values, label, one.colour, row, rank=k, unit=unit, dash=one.dash)
        low, high = float(np.quantile(known, 0.02)), float(3 * known.max())
        log_range(figure, max(low, high * 1e-6), high, row)
    return time_axis(figure, shown, zero)
