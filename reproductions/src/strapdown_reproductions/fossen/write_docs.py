"""The findings as Markdown, for docs/fossen.md: what stands there between its two marks is this
file's output."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..common import markdown
from .runs import span

BEGIN, END = markdown.begin("findings.md", "fossen"), markdown.END
COLUMNS = (
    "filter and sensors",
    "tuning",
    "accelerometer biases, s",
    "gyro biases, s",
    "position, m",
    "velocity, m/s",
    "attitude, deg",
    "runs that stop",
)


def findings(
    size: str, claims: Sequence[Mapping[str, str]], cells: pd.DataFrame, dropouts: pd.DataFrame
) -> str:
    """Text: one sentence on the size of the study, the claims with their verdicts, a table per
    excitation, and the dropouts."""
    rows = [
        f"| {i} | {markdown.plain(c['claim'])} | **{c['verdict']}** | "
        f"{markdown.plain(c['measured'])} |"
        for i, c in enumerate(claims, 1)
    ]
    parts = [size, "", "| | the chapter says | verdict | measured |", "|---|---|---|---|", *rows]
    for excitation, part in cells.groupby("excitation", sort=False):
        parts += [
            "",
            f"{excitation[0].upper()}{excitation[1:]}:",
            "",
            f"| {' | '.join(COLUMNS)} |",
            "|---" * len(COLUMNS) + "|",
            *(_row(row) for _, row in part.iterrows()),
        ]
    if len(dropouts):
        parts += [
            "",
            "Dropouts of all fixes, medians; errors of the accelerometer biases and of the position "
            "before and after:",
            "",
            "| filter | signal | tuning | biases before, m/s² | after, m/s² | position before, m | "
            "after, m |",
            "|---|---|---|---|---|---|---|",
            *(
                f"| {case} | {signal} | {tuning} | {part['accel_before'].median():.2g} | "
                f"{part['accel_after'].median():.2g} | "
                f"{part['position_before_m'].median():.2g} | "
                f"{part['position_after_m'].median():.3g} |"
                for (case, signal, tuning), part in dropouts.groupby(
                    ["case", "excitation", "tuning"], sort=False
                )
            ),
        ]
    return "\n".join(parts) + "\n"


def _row(row: pd.Series) -> str:
    number = lambda value: "–" if np.isnan(value) else f"{value:.2g}"
    return (
        f"| {row['case']} | {row['tuning']} | {span(row, 'accel_s')} | {span(row, 'gyro_s')} | "
        f"{number(row['position_m'])} | "
        f"{number(row['velocity_m_s'])} | "
        f"{number(np.degrees(row['attitude_rad']))} | {row['stopped']:.0%} |"
    )


def insert(path: Path, text: str) -> None:
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
