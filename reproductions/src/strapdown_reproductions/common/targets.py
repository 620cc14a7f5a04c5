"""Figures against what was asked for, and their tables in docs/."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from . import markdown


class Target(NamedTuple):
    """What is asked for."""

    text: str
    comparison: str  # <= or >=
    bound: float
    unit: str = ""


def judged(figures: Mapping[str, float], targets: Mapping[str, Target]) -> list[dict[str, Any]]:
    """The claims that the figures {name of a target: figure} decide: what was asked for, what was
    measured, whether it holds. NaN decides nothing."""
    return [
        {
            "claim": target.text,
            "target": f"{target.comparison} {target.bound:g} {target.unit}".rstrip(),
            "figure": f"{figure:.3g} {target.unit}".rstrip(),
            "value": figure,
            "bound": target.bound,
            "holds": bool(
                figure >= target.bound if target.comparison == ">=" else figure <= target.bound
            ),
        }
        for name, figure in figures.items()
        for target in [targets[name]]
        if np.isfinite(figure)
    ]


def in_docs(
    claims: Sequence[Mapping[str, Any]], tables: Mapping[str, tuple[str | None, pd.DataFrame]]
) -> str:
    """Markdown of the claims and of {name: (caption, DataFrame)}, for a page of docs/."""
    head = pd.DataFrame(
        [
            (c["claim"], c["target"], c["figure"], "holds" if c["holds"] else "does not hold")
            for c in claims
        ],
        columns=["figure", "target", "measured", ""],
    )
    headed = [(f"### {caption}", table.map(_rounded)) for caption, table in tables.values()]
    return markdown.tables([("### Figures", head), *headed])


def _rounded(value: object) -> object:
    if not isinstance(value, (float, np.floating)):
        return value
    return "–" if np.isnan(value) else f"{value:.3g}"
