"""The tables of the page of a comparison, as HTML: the summary, the RMSE of every outage, all
pairs, how it was done."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ...evaluation.metrics import NED_AXES
from ...pages.parts import (
    Html,
    Ruled,
    TableCell,
    around,
    caption,
    fold,
    paragraphs,
    split_cells,
    table,
)
from ...typing import Array
from ...units.constants import STANDARD_GRAVITY
from ...units.wording import number
from .texts import rank_filters, told_alike, unlike

if TYPE_CHECKING:
    from .result import Comparison

TESTED = ("horizontal", *NED_AXES)
"""Axes along which the RMSE of two filters are compared with an interval."""
SUMMARY = (
    ("RMSE north, mean [m]", "north_rmse_mean_m"),
    ("RMSE east, mean [m]", "east_rmse_mean_m"),
    ("RMSE down, mean [m]", "down_rmse_mean_m"),
    ("RMSE horizontal, median [m]", "horizontal_rmse_median_m"),
    ("horizontal at the end, median [m]", "horizontal_end_median_m"),
    ("at the end, 90 % [m]", "horizontal_end_p90_m"),
    ("horizontal, largest [m]", "horizontal_max_m"),
    ("at the end, median [% of the way]", "drift_median_percent"),
    ("RMSE velocity, median [m/s]", "velocity_rmse_median_m_s"),
    ("RMSE heading, median [deg]", "heading_rmse_median_deg"),
)
"""Headings and columns of the summary; a column that is nowhere known is left out."""
NOISE = (
    ("gyro", "deg/sqrt(h)", np.degrees(60)),
    ("accel", "m/s/sqrt(h)", 60.0),
    ("gyro_bias", "deg/h/sqrt(h)", np.degrees(3600) * 60),
    ("accel_bias", "mg/sqrt(h)", 60 / (STANDARD_GRAVITY * 1e-3)),
    ("gyro_decay", "1/h", 3600.0),
    ("accel_decay", "1/h", 3600.0),
)
"""Terms of a Noise, the units for people, and from SI to them."""


def in_order(comparison: Comparison) -> pd.DataFrame:
    """The summary, one length after the other, in each the filters as they are ranked and then
    those that are not."""
    order = {
        length: [*rank_filters(comparison, length), *comparison.filters]
        for length in comparison.lengths
    }
    place = [
        (length, order[length].index(name))
        for length, name in zip(comparison.summary["length_s"], comparison.summary["filter"])
    ]
    return comparison.summary.iloc[sorted(range(len(place)), key=place.__getitem__)]


def summary(comparison: Comparison) -> str:
    """The summary; of each length the smallest RMSE along an axis is marked, where that filter's is
    significantly smaller than those of all others, among the filters that were scored in most
    outages."""
    found, several = in_order(comparison), len(comparison.lengths) > 1
    shown = [(head, name) for head, name in SUMMARY if np.isfinite(found[name]).any()]
    head = ["filter", *(["length [s]"] if several else []), "scored", *(text for text, _ in shown)]
    body: list[list[object]] = []
    for length, own in found.groupby("length_s", sort=False):
        comparable = own["n"].to_numpy() == own["n"].max()
        names = list(own["filter"])
        marks = np.array(
            [
                _smallest(
                    comparison,
                    float(str(length)),
                    _axis(name),
                    names,
                    np.where(comparable, own[name], np.nan),
                )
                for _, name in shown
            ]
        ).reshape(len(shown), len(own))
        for i, (row, mark) in enumerate(zip(own.to_dict("records"), marks.T)):
            lead = [
                row["filter"],
                *([f"{row['length_s']:g}"] if several else []),
                f"{row['n']} of {row['n'] + row['failures']}",
            ]
            cells = [*lead, *_cells([row[name] for _, name in shown], mark)]
            body.append(cells if i or not body else Ruled(cells))
    return table(head, body, "names")


def _axis(column: str) -> str:
    """The axis whose RMSE is in a column of the summary; "" of all other columns."""
    axis, _, rest = column.partition("_")
    return axis if axis in TESTED and rest.startswith("rmse") else ""


def _smallest(
    comparison: Comparison, length: float, axis: str, names: Sequence[str], values: Array
) -> list[bool]:
    """[True for the smallest of the values of these filters]; none is True where it is not significantly
    smaller than all others along the axis, in the outages of that length."""
    known = [name for name, value in zip(names, values) if np.isfinite(value)]
    if not axis or len(known) < 2:
        return [False] * len(values)
    best = names[int(np.nanargmin(values))]
    others = [name for name in known if name != best]
    tied = told_alike(comparison, best, others, length, axis)
    return [name == best and not tied for name in names]


def _cells(values: Iterable[float], marks: Iterable[bool]) -> list[TableCell]:
    """Cells of numbers, some of them marked."""
    return [TableCell(number(value), "best" if mark else "") for value, mark in zip(values, marks)]


def of_outages(comparison: Comparison) -> str:
    """RMSE of every outage, axis by axis, as Table 1 of Alam, Whidborne & Millidere has it; the
    smallest of each outage and axis is marked, where that filter's is significantly smaller along that
    axis."""
    values, n = comparison.table().to_numpy(float), len(comparison.filters)
    above = [TableCell("outage", rows=2), TableCell("time [s]", rows=2)]
    above += [TableCell(f"{axis.capitalize()} [m]", "split", n) for axis in NED_AXES]
    head = split_cells([*map(_breakable, comparison.filters)] * len(NED_AXES), n)

    def cells(row: Array, length: float) -> list[TableCell]:
        marks = (
            _smallest(comparison, length, axis, comparison.filters, part)
            for axis, part in zip(NED_AXES, np.split(row, len(NED_AXES)))
        )
        return split_cells(_cells(row, chain.from_iterable(marks)), n)

    body = [
        [i, f"{start:.10g}–{stop:.10g}", *cells(row, _length_of(comparison, i))]
        for i, ((start, stop), row) in enumerate(zip(comparison.windows, values), 1)
    ]
    # NaN stays in these two: over other outages than the others' they would be no mean and median
    # to compare
    pooled = (
        [("mean", values.mean(axis=0)), ("median", np.median(values, axis=0))]
        if len(values) > 1 and len(comparison.lengths) == 1
        else []
    )
    foot = [
        [TableCell(what, columns=2), *cells(row, comparison.lengths[0])] for what, row in pooled
    ]
    said = (
        "RMSE of the position in each outage; shaded: the smallest of its row and axis, where that "
        "filter's is significantly smaller over all outages (<a href='table.csv'>CSV</a>)."
    )
    return caption(Html(said)) + table(head, body, "tall names", above, foot)


def _length_of(comparison: Comparison, outage: int) -> float:
    """The length, s, of the outage of that number."""
    scores = comparison.scores
    return float(scores["length_s"][scores["outage"] == outage].iloc[0])


def _breakable(name: str) -> Html:
    """A filter's label as HTML that may be broken behind its punctuation."""
    return Html(re.sub("([:,=])", r"\1<wbr>", escape(name)))


def pairs(comparison: Comparison, length: float) -> str:
    """The horizontal ratios of all pairs, of the outages of a length."""
    rows = comparison.paired
    rows = rows[(rows["length_s"] == length) & (rows["axis"] == "horizontal") & (rows["n"] > 0)]
    cells = [
        [
            r["a"],
            r["b"],
            number(r["ratio"]),
            f"{number(r['low'])} to {number(r['high'])}",
            r["wins_a"],
            r["wins_b"],
            r["n"],
            r["blocks"],
        ]
        for r in rows.to_dict("records")
    ]
    return table(
        [
            "A",
            "B",
            "horizontal RMSE of A / B",
            "95 %",
            "outages that A wins",
            "B wins",
            "outages",
            "blocks",
        ],
        cells,
    )


def how(comparison: Comparison) -> str:
    """Return the settings that all filters share, and the options and sources of each."""
    known = comparison.settings
    withheld = ", ".join(f"{count} of {name}" for name, count in known["withheld"].items() if count)
    common = [
        ("outages", f"{comparison.protocol}: {comparison.words}"),
        ("fixes withheld, in all windows together", withheld),
        ("start", _start(known["start"])),
        ("IMU", known["imu"]),
        ("noise", _noise(known["noise"])),
    ]
    own = [
        [
            name,
            _options(known["options"][name]),
            ", ".join(known["sources"][name]) or "–",
            known["reference"][name],
        ]
        for name in comparison.filters
    ]
    alike = (
        "All filters had the same start and the same noise, and were offered the same fixes, of "
        "which the same were withheld; the table says which sources each used."
    )
    said = " ".join([alike, *unlike(comparison)])
    shared = table(["of all filters", ""], [row for row in common if row[1]])
    of_each = table(["filter", "options", "sources", "reference"], own)
    return paragraphs([said]) + around(
        "text", shared, fold("Options and sources of each filter", of_each)
    )


def _options(options: dict[str, Any]) -> str:
    return (
        ", ".join(
            f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
            for name, value in options.items()
        )
        or "–"
    )


def _start(start: dict[str, Any]) -> str:
    (lat, lon), heading = np.degrees(start["lla"][:2]), np.degrees(start["rph"][2]) % 360
    place, std = (
        f"{lat:.5f} deg, {lon:.5f} deg, {start['lla'][2]:.1f} m",
        np.degrees(start["std"][8]),
    )
    return f"at {start['t']:.2f} s, {place}, heading {heading:.1f} deg (std {std:.2g} deg)" + (
        f"; {start['note']}" if start["note"] else ""
    )


def _noise(noise: dict[str, float]) -> str:
    return ", ".join(
        f"{name.replace('_', ' ')} {noise[name] * factor:.3g} {unit}"
        for name, unit, factor in NOISE
        if noise[name]
    )
