"""The page of `strapdown compare`: the answer as text, tables, figures and settings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...pages.parts import around, bullet_list, caption, fold, paragraphs, remarks
from ...pages.shell import Document, Page
from ...pages.verdict_block import verdict_block
from ...units.wording import count_text
from . import figures, tables
from .texts import answers, failures, headline, rank_filters, unlike

if TYPE_CHECKING:
    from .result import Comparison

FOOTER = (
    "Errors are true − estimate against the reference in its own geodetic frame, without any "
    "alignment of trajectories, at every row of the "
    "solution in an outage. RMSE: root mean square over an outage."
)
STYLE = """td.best{font-weight:700;background:color-mix(in srgb,var(--accent) 20%,var(--paper))!important}
.names thead th{white-space:normal;vertical-align:bottom;min-width:4.2rem}.names thead tr:first-child .split{text-align:center}
.tall{max-height:560px;overflow:auto}.tall thead,.tall tfoot{position:sticky;z-index:1}.tall thead{top:0}.tall tfoot{bottom:0}
.tall th,.tall tfoot td{background:var(--paper)}.tall thead tr + tr th:first-child{text-align:right;padding-left:10px}
.text td,.text th{white-space:normal;text-align:left;vertical-align:top;min-width:8rem}
.text td:first-child{white-space:nowrap}.text td:nth-child(3){min-width:11rem}
.narrow{max-width:1000px}.answer{font-size:16.5px;max-width:95ch}main a{color:var(--accent)}"""
RANKED = (
    "The filters are in the order of the mean logarithm of their horizontal RMSE. Which one is "
    "first was found on these same outages, so its "
    "lead flatters it a little; a comparison of two filters that were named beforehand does not "
    "suffer from this. Shaded: the smallest "
    "RMSE of a column, where it is significantly smaller than all others (95 %), of filters that were "
    "scored in equally many outages."
)
RATIOS = (
    "Geometric mean over the outages of the ratio of two RMSE on the same outage, left of 1 where "
    "the filter drifts less; with its 95 % "
    "interval (Student's t over blocks of outages that begin before the first of them stops, "
    "widened for what neighbouring blocks share). "
    "Where outages overlap the mean is that of the blocks. Filled: the interval excludes 1. "
    "Logarithmic axes."
)
LOGARITHMIC = "Logarithmic error axes."
GROWTH = "Median (line) and 10 to 90 % of the outages (shade). Logarithmic error axes."
COVERAGE = (
    "Of the errors of position in the outages. Dashed: a normal error with the claimed standard "
    "deviation, 68.3, 95.4 and 99.7 %. "
    "Left of them the filter trusts itself too much, right of them too little."
)
TRACK = "The reference, and the outages on it with the tracks that the filters estimated."
SWEPT = "The reference, and the outages on it: the colour of a mark is the error in the outage that begins there."
DRAWN_IN_FULL = 6
"""Most outages that are all drawn in full."""


def page(comparison: Comparison) -> Page:
    """The Page of a Comparison."""
    outages = count_text(len(comparison.windows), "outage")
    document = Document(
        f"{comparison.name or 'A recording'}: {count_text(len(comparison.filters), 'filter')} in {outages}",
        {
            "recording": comparison.name,
            "outages": comparison.words,
            "withheld": ", ".join(comparison.kinds),
            "IMU": comparison.settings.get("imu", ""),
        },
        FOOTER,
        headline(comparison),
        verdict_block(comparison.verdicts),
        STYLE,
        wide=True,
    )
    place = document.place
    each = [
        (length, f", outages of {length:g} s" if len(comparison.lengths) > 1 else "")
        for length in comparison.lengths
    ]
    every = [
        place(figures.outages(comparison, length), f"RMSE of each outage{of}", LOGARITHMIC)
        for length, of in each
    ]
    pairs = [_pairs(comparison, document, length, of) for length, of in each]
    growth = [
        place(figures.growth(comparison, length), f"Error over the time in the outage{of}", GROWTH)
        for length, of in each
    ]
    single = [
        place(figures.course(comparison, i), heading, "True − estimate.")
        for i, heading in _chosen_outages(comparison)
    ]
    covered = place(
        figures.coverage(comparison), "Errors within the claimed standard deviations", COVERAGE
    )
    seen = TRACK if figures.are_listed(comparison) else SWEPT
    track = place(figures.track(comparison), "Seen from above", seen)
    document.add("Track and growth", around("grid pair", track, *growth))
    document.add("Summary", _summary(comparison))
    document.add("Paired differences", *pairs)
    document.add(
        "Every outage", *every, fold("RMSE of every outage", tables.of_outages(comparison))
    )
    document.add("Single outages", around("grid", *single))
    document.add("Coverage", around("narrow", covered))
    document.add("How it was done", tables.how(comparison))
    document.add("Notes", bullet_list(comparison.notes))
    return document.page()


def _summary(comparison: Comparison) -> str:
    said = paragraphs(answers(comparison), "answer")
    said += remarks([*unlike(comparison), *failures(comparison)])
    return said + tables.summary(comparison) + caption(RANKED)


def _pairs(comparison: Comparison, document: Document, length: float, of: str) -> str:
    """The ratios to the best filter, and of all pairs."""
    best = rank_filters(comparison, length)[:1]
    drawn = figures.paired_ratios(comparison, best[0], length) if best else None
    if drawn is None:
        return ""
    every = fold(f"All pairs{of}", tables.pairs(comparison, length))
    return document.place(drawn, f"Ratio to {best[0]}{of}", RATIOS) + every


def _chosen_outages(comparison: Comparison) -> list[tuple[int, str]]:
    """[(index, heading)] of the outages that are drawn in full: all of a few, else a median and
    the worst one by the filters' mean log error."""

    def label(i: int) -> str:
        return "{:.10g} to {:.10g} s".format(*comparison.windows[i])

    if len(comparison.windows) <= DRAWN_IN_FULL:
        return [(i, f"Outage {i + 1}, {label(i)}") for i in range(len(comparison.windows))]
    own = comparison.of_length(comparison.lengths[-1])
    own = own[own["horizontal_rmse_m"] > 0]
    order = (
        own.assign(log=np.log(own["horizontal_rmse_m"]))
        .groupby("outage")["log"]
        .mean()
        .sort_values(kind="stable")
        .index
    )
    picked = [("A median", order[len(order) // 2]), ("The worst", order[-1])] if len(order) else []
    return [(number - 1, f"{what} outage, {label(number - 1)}") for what, number in picked]
