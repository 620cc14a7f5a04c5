"""The table as one picture: a grid for each filter, scenarios down, grades across."""

from html import escape

import numpy as np
import pandas as pd

from .verdicts import BY_CHANCE, CAUTIOUS, CONSISTENT, DIVERGING, SURE

REFUSED = "refused"
LOOKS = {
    CONSISTENT: ("✓", "#2e7d4f", "#ffffff", "90 % of the epochs or more in the band"),
    BY_CHANCE: ("≈", "#a9d8b8", "#10301c", "fewer, as some right filters"),
    CAUTIOUS: ("−", "#5b8fd0", "#ffffff", "errors smaller than stated"),
    SURE: ("+", "#eaa23b", "#2c1c00", "errors larger than stated"),
    DIVERGING: ("✕", "#b3261e", "#ffffff", "more than 2 % of the runs are lost"),
    REFUSED: ("R", "#d7d7d7", "#333333", "not to be used; the reason is given"),
}
"""{verdict: (sign, colour, colour of the text, meaning)}. The signs tell without colours."""
SIDE, HEIGHT, LEFT, TOP, GAP, ACROSS = 54, 30, 82, 52, 26, 3
"""px: of a cell, beside and above a grid, between grids; grids in a row."""
LINE, LEGEND = 24, 106
"""px: of the legend, of a line of it and of all."""
NUMBERS = "Numbers: % of the epochs in the band; where diverging, % of the runs that survive."


def draw_cells(rows: pd.DataFrame) -> str:
    """SVG of the cells: the sign of each verdict with the share of epochs in the band, of those
    that diverge the share of runs that survive, of refused ones nothing, all in %."""
    filters = list(dict.fromkeys(rows["filter"]))
    scenarios, grades = list(dict.fromkeys(rows["scenario"])), list(dict.fromkeys(rows["grade"]))
    wide = LEFT + SIDE * len(grades) + GAP
    high = TOP + HEIGHT * len(scenarios) + GAP
    across = min(ACROSS, len(filters))
    width = max(wide * across, 2 * wide)
    height = LEGEND + high * int(np.ceil(len(filters) / across))
    grids = [
        _grid(
            rows[rows["filter"] == name],
            name,
            scenarios,
            grades,
            wide * (i % across),
            LEGEND + high * (i // across),
        )
        for i, name in enumerate(filters)
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" font-family="system-ui,sans-serif" font-size="12">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>{_legend(width)}{"".join(grids)}</svg>\n'
    )


def _grid(
    rows: pd.DataFrame, name: str, scenarios: list[str], grades: list[str], x: int, y: int
) -> str:
    texts = [_text(x + 10, y + 20, name, size=15, weight=600)]
    texts += [
        _text(x + LEFT + SIDE * (i + 0.5), y + TOP - 7, grade, anchor="middle", size=10)
        for i, grade in enumerate(grades)
    ]
    for j, scenario in enumerate(scenarios):
        below = y + TOP + HEIGHT * j
        texts.append(_text(x + LEFT - 6, below + 20, scenario, anchor="end"))
        for i, grade in enumerate(grades):
            own = rows[(rows["scenario"] == scenario) & (rows["grade"] == grade)]
            if len(own):
                texts.append(_cell(own.iloc[0], x + LEFT + SIDE * i, below))
    return "".join(texts)


def _cell(row: pd.Series, x: int, y: int) -> str:
    looks = REFUSED if row["refused"] else row["verdict"]
    sign, fill, ink, _ = LOOKS[looks]
    share = row["survived_%"] if looks == DIVERGING else row["inside_%"]
    number = "" if looks == REFUSED else f" {share:.0f}"
    hint = (
        f"{row['filter']}, {row['scenario']}, {row['grade']}: {looks}; {row['inside_%']:.0f} % of "
        f"the epochs in the band, {row['survived_%']:.0f} % of {row['runs']} runs survive"
    )
    return (
        f'<g><title>{escape(hint)}</title><rect x="{x + 1}" y="{y + 1}" width="{SIDE - 2}" '
        f'height="{HEIGHT - 2}" rx="3" fill="{fill}"/>'
        + _text(x + SIDE / 2, y + 20, sign + number, anchor="middle", fill=ink, weight=600)
        + "</g>"
    )


def _legend(width: int) -> str:
    parts, column = [_text(10, LEGEND - 8, NUMBERS)], width // 2
    for k, (name, (sign, fill, ink, meaning)) in enumerate(LOOKS.items()):
        x, y = 10 + column * (k // 3), 10 + LINE * (k % 3)
        parts.append(f'<rect x="{x}" y="{y}" width="22" height="20" rx="3" fill="{fill}"/>')
        parts.append(_text(x + 11, y + 15, sign, anchor="middle", fill=ink, weight=600))
        parts.append(_text(x + 30, y + 15, f"{name}: {meaning}"))
    return "".join(parts)


def _text(
    x: float,
    y: float,
    text: str,
    anchor: str = "start",
    size: int = 12,
    fill: str = "#222222",
    weight: int = 400,
) -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size}" fill="{fill}" '
        f'font-weight="{weight}">{escape(text)}</text>'
    )
