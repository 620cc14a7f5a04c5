"""How flights become verdicts on the claims of Mollaei et al.: the bounds, the measures, and the
kinds of rules of the table in claims.py.

Tables are those of cells.wide, {Case: table}.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import paired, proportion
from strapdown.typing import Array

from ..common.claims import Judged
from ..common.pages import PARTLY
from ..common.paired_ratios import LEAST, ratio, sides
from ..common.verdicts import Count, both, counted, decided, over_readings, share_of_runs, vote
from .cells import MODES, NO_FILTER, PKF, PUBLISHED, SIX, UKF, Case, known

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
CLAIMED = 5400.0
"""s that it takes in the paper."""
PRINTED_DEVIATIONS, PRINTED_ALL = (
    ("fx_n", "fz_n", "gx", "gz"),
    ("fx_n", "fz_n", "gx", "gz", *OVERSHOOTS),
)
"""Rows of the published tables."""
Tables: TypeAlias = dict[Case, pd.DataFrame]
Pair: TypeAlias = tuple[str, str]
"""(first, second): two modes, of which the first is to be better."""
Counting: TypeAlias = Callable[[pd.DataFrame, str], tuple[int, int]]
"""(flights of a mode of which something is so, its flights) of the table of a case."""


class Evidence(NamedTuple):
    """All that the claims rest on."""

    tables: Tables
    # a row per IMU-driven flight: mode and apart_m, largest distance of estimate or aircraft from
    # the EKF's
    apart: pd.DataFrame
    # {(mode, prediction): wall time of one flight of E2 in the six-state form, s}
    seconds: dict[tuple[str, str], float]


def flown(*experiments: str, prediction: str | None = None) -> Callable[[Evidence], Tables]:
    """Chooses the six-state tables of experiments, of all readings or of one prediction."""
    return lambda evidence: {
        case: table
        for experiment in experiments
        for case, table in evidence.tables.items()
        if (case.experiment, case.form) == (experiment, SIX)
        and prediction in (None, case.prediction)
    }


def better(
    tables: Tables, measures: Sequence[str], pairs: Sequence[Pair], others: Sequence[str] = ()
) -> Judged:
    """The first of each pair is better, over the cells of all tables and `measures`; and by a
    second reading, the measures `others`, if there is one."""
    readings = [
        {pair: sides(tables, each, *pair) for pair in pairs} for each in (measures, others) if each
    ]
    return Judged(
        over_readings(*(both(*(count.verdict for count in each.values())) for each in readings)),
        ". By the other reading: ".join(
            ". ".join(f"{first} better than {second}: {count}" for (first, second), count in each)
            for each in (counts.items() for counts in readings)
        ),
    )


def median_of(values: Array | Sequence[float]) -> str:
    """Text: the median, "–" of nothing."""
    return f"{np.median(values):.3g}" if len(values) else "–"


def median_ratios(tables: Tables, measures: Sequence[str], pairs: Sequence[Pair]) -> str:
    """Text: for each reading the median over the measures of the ratio of each pair."""
    values = lambda table, pair: np.array([ratio(table, each, *pair).value for each in measures])
    known_of = lambda table, pair: [v for v in values(table, pair) if np.isfinite(v)]
    parts = [
        f"{case}: "
        + ", ".join(f"{' / '.join(pair)} {median_of(known_of(table, pair))}" for pair in pairs)
        for case, table in tables.items()
    ]
    return "median ratios, " + "; ".join(parts) if parts else "not flown"


def listed(values: dict[str, Array], unit: str) -> str:
    """Text: the median of each mode that was flown."""
    return ", ".join(
        f"{mode} {np.median(own):.2g} {unit}" for mode, own in values.items() if len(own)
    )


def medians(tables: Tables, measure: str, unit: str) -> str:
    """Text: the medians of a measure of all modes, by case."""
    return "; ".join(
        f"{case}: {listed({mode: known(table, measure, mode) for mode in MODES}, unit)}"
        for case, table in tables.items()
    )


def printed(table: str, measures: Sequence[str], first: str, second: str) -> str:
    """Text: in how many rows of a published table, of those that are not 0, the first mode's
    number is smaller."""
    a, b = (
        np.array([PUBLISHED[table][name][MODES.index(mode)] for name in measures], float)
        for mode in (first, second)
    )
    real = ~((a == 0) & (b == 0)) & np.isfinite(a) & (~np.isnan(b))
    return f"{int((a < b)[real].sum())} of {int(real.sum())}"


def rows_smaller(table: str, measures: Sequence[str], second: str) -> str:
    """Text: in how many rows of a published table UKF and PKF have smaller numbers than the mode
    `second`."""
    texts = (f"{first} {printed(table, measures, first, second)}" for first in (UKF, PKF))
    return f". Published: {', '.join(texts)} rows smaller"


def furthest(table: pd.DataFrame, mode: str) -> Array:
    """(flights,) m: how far aircraft or estimate were off at most; without a filter only the
    aircraft counts."""
    names = ("off_max_m",) if mode == NO_FILTER else ("off_max_m", "worst_m")
    return np.max([known(table, name, mode) for name in names], axis=0)


def away(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of the flights that diverged: stopped, or were further than AWAY off."""
    off = furthest(table, mode)
    return int((off > AWAY).sum()), len(off)


def kept(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of those that did not."""
    diverged, flights = away(table, mode)
    return flights - diverged, flights


def near(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of the flights whose estimate and aircraft stay within NEAR."""
    off = furthest(table, mode)
    return int((off < NEAR).sum()), len(off)


def most_flights(
    tables: Tables, counting: Counting, modes: Sequence[str], level: float = 0.5
) -> Count:
    """Count of the cases and modes in which something is so in more than a share `level` of the
    flights (Wilson); surely fewer contradicts."""
    cells = [counting(table, mode) for table in tables.values() for mode in modes]
    return share_of_runs(cells, level)


def by_case(tables: Tables, counting: Counting, modes: Sequence[str]) -> str:
    """Text: in how many flights it is so, by mode, where there are several, and case."""
    return "; ".join(
        f"{mode}, " * (len(modes) > 1) + f"{case} " + "{} of {}".format(*counting(table, mode))
        for case, table in tables.items()
        for mode in modes
    )


def lost_once(tables: Tables, mode: str) -> str:
    """Text: flights that diverged, of a mode that is the same in all readings."""
    return "".join("{} of {}".format(*away(table, mode)) for table in list(tables.values())[:1])


def ends(tables: Tables, measure: str, modes: Sequence[str]) -> str:
    """Text: the median of a measure, m, by case and mode."""
    return "; ".join(
        f"{mode}, {case} {median_of(known(table, measure, mode))} m"
        for case, table in tables.items()
        for mode in modes
    )


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


def symmetric(tables: Tables) -> Judged:
    """Fy and the lateral weight are ZERO in all flights; not reproduced where in none."""
    larger = {
        mode: np.concatenate(
            [
                np.empty(0),
                *(
                    np.maximum(known(table, "fy_n", mode), known(table, "gy_n", mode))
                    for table in tables.values()
                ),
            ]
        )
        for mode in MODES
    }
    values = np.concatenate(list(larger.values()))
    zero, count = int((values < ZERO).sum()), len(values)
    verdict = PARTLY if 0 < zero < count else decided(zero > 0, count > 0)
    return Judged(
        verdict, f"{zero} of {count} flights; medians of the larger: {listed(larger, 'N')}"
    )


def no_larger(tables: Tables, measure: str, other: str, modes: Sequence[str]) -> Judged:
    """Over the flights of a case `measure` is less than TWICE the measure `other` (geometric mean,
    whole interval)."""
    votes, texts = [], []
    for mode in modes:
        for case, table in tables.items():
            a, b = (
                np.log(np.maximum(known(table, each, mode), LEAST)) for each in (measure, other)
            )
            found = paired(a, b) if len(a) == len(b) else paired([], [])
            votes.append(-vote(found.low, found.high, np.log(TWICE)))
            texts.append(f"{mode}, {case} x{np.exp(found.difference):.3g}")
    count = counted(votes)
    return Judged(count.verdict, f"{count}. {'; '.join(texts)}")


def slower_than_real_time(seconds: dict[tuple[str, str], float], modes: Sequence[str]) -> Judged:
    """A flight takes longer than it lasts."""
    slowest = max(seconds.values(), default=np.nan)
    taken = "; ".join(
        f"{mode}, {driven}-driven {each:.2g} s"
        for (mode, driven), each in seconds.items()
        if mode in modes
    )
    return Judged(
        decided(slowest > REAL_TIME, slowest <= REAL_TIME),
        f"{taken}; the paper: {CLAIMED:.0f} s, {CLAIMED / max(slowest, 1e-9):.0f} times as long as "
        f"the slowest",
    )


def one_filter(apart: pd.DataFrame) -> Judged:
    """Estimate and aircraft of the UKF are within SAME of those of the EKF."""
    ukf, pkf = (apart.loc[apart["mode"] == mode, "apart_m"].to_numpy(float) for mode in (UKF, PKF))
    most, ended = float(np.max(ukf, initial=0.0)), int(np.isinf(pkf).sum())
    text = (
        f"UKF: at most {most if len(ukf) else np.nan:.2g} m in {len(ukf)} flights; PKF: at most "
        f"{pkf[np.isfinite(pkf)].max(initial=0.0):.2g} m"
    )
    text += f", and {ended} flights stopped at another time" * bool(ended)
    return Judged(decided(0 < len(ukf) and most <= SAME, most > SAME), text)
