"""The findings as Markdown, for docs/open-or-closed-loop.md: what stands there between its two
marks is this file's output."""

from pathlib import Path

import pandas as pd

from ..common import markdown
from ..common.verdicts import interval

BEGIN, END = markdown.begin("findings.md", "hager-bryne"), markdown.END


def findings(
    size: str,
    claims: list[dict[str, str]],
    cells: pd.DataFrame,
    offset: pd.DataFrame,
    initial: pd.DataFrame,
    ablated: dict[str, tuple[str, pd.DataFrame]],
) -> str:
    """Text: one sentence on the size of the study, the claims with their verdicts, what the
    ablations {name: (caption, table)} say, and a row per grade and flight without offset and by
    the two readings of it."""
    rows = [
        f"| {i} | {markdown.plain(c['claim'])} | **{c['verdict']}** | "
        f"{markdown.plain(c['measured'])} |"
        for i, c in enumerate(claims, 1)
    ]
    parts = [size, "", "| | the paper says | verdict | measured |", "|---|---|---|---|", *rows]
    if ablated:
        parts += [
            "",
            "Ablations, on flights 01, 07 and 10:",
            "",
            *(
                f"- {name.removeprefix('ablation-')}: {markdown.plain(caption)}"
                for name, (caption, _) in ablated.items()
            ),
        ]
    for heading, table in (
        ("Without offset", cells),
        ("With a constant accelerometer offset of 0.5 m/s² on each axis", offset),
        ("With 0.5 m/s² as initial value of the bias process", initial),
    ):
        parts += [
            "",
            f"{heading}:",
            "",
            "| grade | flight | min | survived, open | closed | by the 500 m rule, open | closed | "
            "RMSE open, "
            "m | closed, m | open against closed | NEES/15 open | closed |",
            "|---|---|---|---|---|---|---|---|---|---|---|---|",
            *(_row(row) for _, row in table.sort_values(["grade", "flight"]).iterrows()),
        ]
    return "\n".join(parts) + "\n"


def _row(row: pd.Series) -> str:
    share = lambda name: f"{row[name]:.0%}"
    return (
        f"| {row['grade']} | {row['flight']} | {row['minutes']:.0f} | {share('open_survived')} | "
        f"{share('closed_survived')} | "
        f"{share('open_survived_500')} | "
        f"{share('closed_survived_500')} | {row['open_censored_500_m']:.3g} | "
        f"{row['closed_censored_500_m']:.3g} | "
        f"{interval(row, 'position_500')} | "
        f"{row['open_anees']:.3g} | {row['closed_anees']:.3g} |"
    )


def insert(path: Path, text: str) -> None:
    """Put `text` between the marks of the Markdown file `path`."""
    markdown.insert(path, text, BEGIN)
