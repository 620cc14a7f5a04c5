"""How flights become verdicts on the claims of Mollaei et al.: the measures, the bounds, and the
counting of cells."""

from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import proportion

from ..common.pages import finding
from ..common.paired_ratios import ratio, sides
from ..common.verdicts import RULE, Count, both, over_readings
from .cells import EKF, MODES, NO_FILTER, PKF, PUBLISHED, UKF, Case, known, of

DEVIATIONS = ("fx_n", "fz_n", "gx_n", "gz_n", "mx_nm", "my_nm", "mz_nm")
"""Fx and Fz; Gx and Gz as weight; and all three as moments."""
OVERSHOOTS = ("over_x_pct", "over_z_pct")
SETTLING = ("settle_elevator_s", "settle_engine_s", "settle_alpha_s")
TWICE = 2.0
"""\"Diverges\", \"negligible\", \"not suitable\": a factor of so much."""
AWAY, NEAR = 500.0, 100.0
"""m: a flight has diverged when it stopped, or estimate or aircraft were further off; \"much less
than 500 m\" is less than a fifth of it."""
NEARLY_ALL = 0.9
"""Share of the flights that must not diverge, or stay near."""
SAME = 1e-6
"""m: filters whose estimates and flights differ by no more are one filter."""
ZERO = 5e-5
"""N: what the tables print as 0.0000."""
REAL_TIME = 315.0
"""s: the duration of E2."""
CELLS = (
    "a cell is a measure in one reading (IMU- or model-driven prediction, Q and R from the sensors "
    "or as printed); "
    "a filter is better where the 95 % interval of the ratio over the seeds lies below 1 by more "
    "than 1 %"
)
TWO_FINALS = (
    "judged with the final value of the flight itself and with that of the reference flight: "
    "opposite verdicts leave it undecided, else the less favourable"
)
TWO_OVERSHOOTS = "judged as share of the final value and as share of the step: opposite verdicts leave it undecided, else the less favourable"
BOTH = ((UKF, EKF), (PKF, EKF))
PRINTED_DEVIATIONS, PRINTED_ALL = (
    ("fx_n", "fz_n", "gx", "gz"),
    ("fx_n", "fz_n", "gx", "gz", *OVERSHOOTS),
)
"""Rows of the published tables."""


class Evidence(NamedTuple):
    """All that the claims rest on."""

    tables: dict[Case, pd.DataFrame]  # of cells.wide
    # a row per IMU-driven flight: mode and apart_m, largest distance of estimate or aircraft from
    # the EKF's
    apart: pd.DataFrame
    # {(mode, prediction): wall time of one flight of E2 in the six-state form, s}
    seconds: dict[tuple[str, str], float]


Pair: TypeAlias = tuple[str, str]
"""(first, second): two modes, of which the first is to be better."""


class Question(NamedTuple):
    """Whether the first mode of each pair is better, in all measures in which it is asked."""

    experiments: tuple[str, ...]
    measures: tuple[str, ...]
    pairs: tuple[Pair, ...]
    others: tuple[str, ...] = ()  # measures of a second reading, which is judged too
    how: str = ""  # text: what the two readings are


def better(
    e: Evidence, experiments: tuple[str, ...], measures: tuple[str, ...], pairs: tuple[Pair, ...]
) -> dict[Pair, Count]:
    """{(first, second): Count} of the cells of `experiments` in which the first of each pair is
    better."""
    tables = {
        case: table
        for experiment in experiments
        for case, table in of(e.tables, experiment).items()
    }
    return {pair: sides(tables, measures, *pair) for pair in pairs}


def compared(
    e: Evidence, text: str, source: str, question: Question, decided_by: str, extra: str = ""
) -> dict[str, str]:
    """A finding that the first of each pair is better over the cells of a Question; `extra` is
    said after what was measured."""
    experiments, measures, pairs, others, how = question
    counts = better(e, experiments, measures, pairs)
    verdicts, text_of = [both(*(count.verdict for count in counts.values()))], said(counts)
    if others:
        second = better(e, experiments, others, pairs)
        verdicts.append(both(*(count.verdict for count in second.values())))
        text_of += f". By the other reading: {said(second)}"
    rule = f"{CELLS}; {RULE}; all pairs must hold" + f"; {how}" * bool(how)
    return finding(
        text,
        source,
        rule,
        f"{text_of}; {by_case(e, experiments, measures, pairs)}{extra}",
        over_readings(*verdicts),
        decided_by,
    )


def said(counts: dict[Pair, Count]) -> str:
    """Text: the Count of each pair (first, second)."""
    return ". ".join(
        f"{first} better than {second}: {count}" for (first, second), count in counts.items()
    )


def against(counts: dict[str, Count]) -> str:
    """Text: the Count against each mode."""
    return ". ".join(f"Against {mode}: {count}" for mode, count in counts.items())


def by_case(
    e: Evidence, experiments: tuple[str, ...], measures: tuple[str, ...], pairs: tuple[Pair, ...]
) -> str:
    """Text: for each reading how many measures go to the first of each pair, and the median
    ratio."""
    parts = []
    for experiment in experiments:
        for case, table in of(e.tables, experiment).items():
            texts = []
            for first, second in pairs:
                found = [ratio(table, measure, first, second) for measure in measures]
                values = [each.value for each in found if np.isfinite(each.value)]
                texts.append(
                    f"{first} / {second} {np.median(values):.3g}"
                    if values
                    else f"{first} / {second} –"
                )
            parts.append(f"{case}: {', '.join(texts)}")
    return "median ratios, " + "; ".join(parts) if parts else "not flown"


def factor(
    tables: dict[Case, pd.DataFrame], measures: tuple[str, ...], first: str, second: str
) -> Count:
    """Count of the cells in which the first mode's measure is at least TWICE the second's (whole
    interval); whole below that contradicts."""
    found = [
        ratio(table, measure, first, second) for table in tables.values() for measure in measures
    ]
    return Count(
        sum(each.low >= TWICE for each in found),
        sum(each.high < TWICE for each in found),
        len(found),
    )


def printed(table: str, measures: tuple[str, ...], first: str, second: str) -> str:
    """Text: in how many rows of a published table, of those that are not 0, the first mode's
    number is smaller."""
    a, b = (
        np.array([PUBLISHED[table][name][MODES.index(mode)] for name in measures], float)
        for mode in (first, second)
    )
    real = ~((a == 0) & (b == 0)) & np.isfinite(a) & (~np.isnan(b))
    return f"{int((a < b)[real].sum())} of {int(real.sum())}"


def rows_smaller(table: str, measures: tuple[str, ...], second: str) -> str:
    """Text: in how many rows of a published table UKF and PKF have smaller numbers than the mode
    `second`."""
    return (
        ", ".join(f"{first} {printed(table, measures, first, second)}" for first in (UKF, PKF))
        + " rows smaller"
    )


def away(table: pd.DataFrame, mode: str, experiment: str = "") -> tuple[int, int]:
    """(diverged, flights) of a mode: stopped, or estimate or aircraft further than AWAY off;
    without a filter only the aircraft counts."""
    names = ("off_max_m",) if mode == NO_FILTER else ("off_max_m", "worst_m")
    values = [known(table, name, mode) for name in names]
    return (
        (int((np.max(values, axis=0) > AWAY).sum()), len(values[0])) if len(values[0]) else (0, 0)
    )


def near(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """(flights whose estimate and aircraft stay within NEAR, flights)."""
    values = [known(table, name, mode) for name in ("off_max_m", "worst_m")]
    return (
        (int((np.max(values, axis=0) < NEAR).sum()), len(values[0])) if len(values[0]) else (0, 0)
    )


def share(found: tuple[int, int], level: float, above: bool = True) -> Count:
    """Count of one cell: Wilson's interval of the share found = (successes, flights) is above
    `level`, or below it, which contradicts."""
    interval = proportion(*found)
    sides_ = int(interval.low > level), int(interval.high < level)
    return Count(*(sides_ if above else sides_[::-1]), 1)


def enough(flights: int) -> str:
    """Text: of how many `flights` Wilson's interval lies above NEARLY_ALL, and where it begins
    with those and with one fewer."""
    begins = [proportion(count, flights).low for count in range(flights + 1)]
    least = int(np.searchsorted(begins, NEARLY_ALL, side="right"))
    return (
        f"of {flights} flights {least} are enough (the interval begins at {begins[least]:.3f}), "
        f"{least - 1} are not "
        f"({begins[least - 1]:.3f})"
    )


def kept(found: tuple[int, int]) -> tuple[int, int]:
    """(flights that did not, all) of (flights that did, all)."""
    return found[1] - found[0], found[1]


def median(table: pd.DataFrame, measure: str, mode: str) -> str:
    """Text: the median of a measure, "–" where the mode was not flown."""
    values = known(table, measure, mode)
    return f"{np.median(values):.3g}" if len(values) else "–"
