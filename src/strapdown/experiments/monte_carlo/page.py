"""The page of a study: which filter errs least, errors and consistency over time in each cell, the
table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...pages.parts import around, caption, fold, table
from ...pages.shell import Document, Page
from ...units.wording import count_text, join_words, number
from . import figures
from .summaries import compare

if TYPE_CHECKING:
    import pandas as pd

    from .campaign import Campaign

FOOTER = (
    "Simulated runs. RMSE: root mean square over the runs that survived, in brackets its 95 % interval; "
    "runs that are lost or inconsistent are given up. summary.csv and runs.csv have more columns."
)
CELLS_DRAWN = 12
"""Cells whose figures the page has at most; the table has all."""
ERRORS = (
    "Root mean square over the runs that are alive (solid), what the filter claims (dashed), and the "
    "Cramer-Rao bound, which no filter undercuts on average."
)
CONSISTENT = (
    "Mean over the runs that are alive. A consistent filter is around 1, in the grey band at 95 % of the "
    "times; above it claims too little uncertainty, below too much."
)
COLUMNS = (
    ("within 1σ [%]", "within_1_sigma", 100.0),
    ("NEES per state", "anees", 1.0),
    ("heading RMSE [deg]", "rmse_heading_deg", 1.0),
    ("velocity RMSE [m/s]", "rmse_velocity_m/s", 1.0),
    ("RMSE over bound", "bound_ratio", 1.0),
)
"""Further columns of the table: heading, column of the summary, factor."""
GIVEN_UP = "lost", "inconsistent", "quarantined"
"""Columns of a summary that count the runs which did not survive."""


def page(campaign: Campaign) -> Page:
    """The Page of a Campaign whose runs are finished. Raises DataError."""
    filters, cells = campaign.manifest["filters"], campaign.cells
    document = Document(
        f"Study: {join_words(filters)}",
        {
            "cells": ", ".join(cells[:CELLS_DRAWN]),
            "runs": campaign.manifest["runs"],
            "seed": str(campaign.manifest["seed"]),
        },
        FOOTER,
        headline(campaign),
        wide=True,
    )
    curves = {cell: figures.curves_of(campaign, cell) for cell in cells[:CELLS_DRAWN]}
    sections = {
        "Position error": (("Position error", figures.position, ERRORS),),
        "Heading error": (("Heading error", figures.heading, ERRORS),),
        "Consistency": (
            ("NEES per state", figures.nees, CONSISTENT),
            ("Runs alive", figures.survival, "Share of the runs that are not given up yet."),
        ),
    }
    for heading, drawn in sections.items():
        shown = [
            document.place(draw(curves[cell]), f"{name}, {cell}", said)
            for cell in curves
            for name, draw, said in drawn
        ]
        document.add(heading, around("grid", *shown))
    left = len(cells) - len(curves)
    more = caption(f"{count_text(left, 'further cell')} in the table only.") if left else ""
    document.add("Summary", more, fold("All cells and filters", _table(campaign.summary)))
    return document.page()


def headline(campaign: Campaign) -> str:
    """The filter with the smallest position error and the number of runs that were given up, in a
    sentence."""
    summary, filters = campaign.summary, campaign.manifest["filters"]
    given_up = [
        f"{count_text(lost, 'run')} of {name} {'was' if lost == 1 else 'were'} given up"
        for name in filters
        if (lost := int(summary.loc[summary["filter"] == name, list(GIVEN_UP)].to_numpy().sum()))
    ]
    total = campaign.manifest["runs"] * len(campaign.cells)
    survived = "; ".join(given_up) or f"all {count_text(total, 'run')} of each filter survived"
    if len(filters) < 2:
        found = _of_one(summary)
    elif len(campaign.cells) == 1:
        found = _of_cell(campaign, campaign.cells[0])
    else:
        found = _of_cells(campaign)
    return f"{found}; {survived}."


def _of_one(summary: pd.DataFrame) -> str:
    """The position RMSE of the only filter."""
    values = summary["rmse_position_m"].to_numpy(float)
    values = values[np.isfinite(values)]
    if not len(values):
        return f"No run of {summary['filter'].iloc[0]} survived"
    low, high = number(float(values.min())), number(float(values.max()))
    span = f"{low} m" if low == high else f"{low} to {high} m, by cell"
    return f"Position RMSE of {summary['filter'].iloc[0]}: {span}"


def least(campaign: Campaign, cell: str) -> tuple[str, Sequence[str]]:
    """(the filter with the smallest position error in a cell, those that the runs do not separate from
    it)."""
    filters = campaign.manifest["filters"]
    ratios = {name: compare(campaign, cell, name, filters[0]).difference for name in filters[1:]}
    known = {filters[0]: 0.0} | {name: r for name, r in ratios.items() if np.isfinite(r)}
    best = min(known, key=known.__getitem__)
    tied = [
        name
        for name in filters
        if name != best and not compare(campaign, cell, best, name).high < 0
    ]
    return best, tied


def _of_cell(campaign: Campaign, cell: str) -> str:
    best, tied = least(campaign, cell)
    filters = campaign.manifest["filters"]
    runs = count_text(campaign.manifest["runs"], "run")
    if len(tied) == len(filters) - 1:
        return f"{runs} cannot separate the position errors of {join_words([best, *tied])}"
    if tied:
        return f"{join_words([best, *tied])} have the smallest position errors"
    next_best = min(
        (name for name in filters if name != best),
        key=lambda name: -compare(campaign, cell, best, name).difference,
    )
    found = compare(campaign, cell, best, next_best)
    ratio, low, high = (
        number(float(np.exp(value / 2))) for value in (found.difference, found.low, found.high)
    )
    return (
        f"{best} has the smallest position error, {ratio} times that of {next_best} "
        f"(95 %: {low} to {high})"
    )


def _of_cells(campaign: Campaign) -> str:
    """The number of cells in which each filter is alone the best."""
    found = {cell: least(campaign, cell) for cell in campaign.cells}
    clear = Counter(best for best, tied in found.values() if not tied)
    said = [f"{name} in {count} of {len(found)} cells" for name, count in clear.most_common()]
    open_cells = len(found) - sum(clear.values())
    if not said:
        return f"In none of {len(found)} cells do the runs separate the best filter from the others"
    rest = f", no clear best in {open_cells}" if open_cells else ""
    return f"Smallest position error: {join_words(said)}{rest}"


def _table(summary: pd.DataFrame) -> str:
    shown = [column for column in COLUMNS if column[1] in summary]
    head = ["scenario", "IMU", "filter", "survived", "position RMSE [m]"]
    head += [heading for heading, *_ in shown]
    rows: list[list[Any]] = []
    for row in summary.to_dict("records"):
        low, high = (number(row[f"rmse_position_m_{end}"]) for end in ("low", "high"))
        lost = sum(row[why] for why in GIVEN_UP)
        rows.append(
            [
                *(row[name] for name in ("scenario", "imu", "filter")),
                f"{row['runs'] - lost} of {row['runs']}",
                f"{number(row['rmse_position_m'])} ({low} to {high})",
                *(number(factor * row[name]) for _, name, factor in shown),
            ]
        )
    return table(head, rows)
