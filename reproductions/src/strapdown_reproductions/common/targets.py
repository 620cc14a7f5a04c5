"""Figures against what was asked for, and their tables in docs/."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from . import markdown
from .tables import Tables, with_rows


class Target(NamedTuple):
    """A target: the bound that a measured figure must meet."""

    text: str
    comparison: str  # <= or >=
    bound: float
    unit: str = ""

    def judge(self, figure: float, digits: int = 3) -> dict[str, Any]:
        """A claim: what was asked for, what was measured, whether it holds."""
        return {
            "claim": self.text,
            "target": f"{self.comparison} {self.bound:g} {self.unit}".rstrip(),
            "figure": f"{figure:.{digits}g} {self.unit}".rstrip(),
            "value": float(figure),
            "bound": self.bound,
            "holds": bool(
                figure >= self.bound if self.comparison == ">=" else figure <= self.bound
            ),
        }


def claim(text: str, figure: float, bound: float, unit: str) -> dict[str, Any]:
    """The claim that a figure is at most `bound`."""
    return Target(text, "<=", float(bound), unit).judge(figure)


def judge_targets(
    figures: Mapping[str, float], targets: Mapping[str, Target], digits: int = 3
) -> list[dict[str, Any]]:
    """The claims that the figures {name of a target: figure} decide; NaN decides nothing."""
    return [
        targets[name].judge(figure, digits)
        for name, figure in figures.items()
        if np.isfinite(figure)
    ]


def table(claims: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """A row per claim of `judge_targets`, as text for docs/."""
    rows = [
        (c["claim"], c["target"], c["figure"], "holds" if c["holds"] else "does not hold")
        for c in claims
    ]
    return pd.DataFrame(rows, columns=["figure", "target", "measured", ""])


def in_docs(
    claims: Sequence[Mapping[str, Any]],
    tables: Tables,
    cell: Callable[[object], str] = markdown.short,
) -> str:
    """Markdown of the claims and of those of the tables {name: (caption, DataFrame)} that have
    rows, for a page of docs/; cell: how a value is written."""
    headed = [(f"### {caption}", own) for caption, own in with_rows(tables).values()]
    return markdown.tables([("### Figures", table(claims)), *headed], cell)
