"""Rules that decide the claims of Hager & Bryne by one reading: how cells vote at a level of
confidence, and what is counted. How the readings decide together is in readings.py."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from scipy.stats import t as student

from strapdown.evaluation.consistency import paired_comparison, proportion

from ..common.claims import JudgedClaim
from ..common.kinds import CONFIDENCE, Votes, always, cluster_share, mostly, mostly_of, of_all
from ..common.verdicts import (
    NONE,
    SIZE,
    UNKNOWN,
    better,
    decide,
    factors,
    ratios,
    vote,
)
from .cells import COMPARED, STRAIGHT as STRAIGHTS
from .readings import CHOSEN, FlownWorld, WorldReading

CONSUMER, TACTICAL, NAVIGATION = GRADES = ("consumer", "tactical", "navigation")
SHORT, LONG = tuple(f"{i:02d}" for i in range(1, 7)), tuple(f"{i:02d}" for i in range(7, 12))
STRAIGHT = "07"
TOO_SURE = 1.1
"""A filter is called inconsistent where the interval of its typical NEES/15 lies above this: too
sure of itself; below 1 it is too careful."""
SMALL_DRIFT = 100.0
"""m of raw INS drift, below which the linearisation in position should not matter."""
SMALL_TURN, LARGE_TURN = 3.0, 10.0
"""deg of raw INS attitude error, below and beyond which the linearisation in attitude should not,
and should, matter: a linear model leaves out half the angle as a share of itself, 2.6 % and 8.7
%."""
RARELY = 60.0
"""s: resets that are this far apart or further are occasional."""
SHARES = ("survived", "early", "diverged", "grew", "contained")
"""In the names of columns that are shares of the runs; all others are means over runs of
something's logarithm, or stand for one."""
Rule: TypeAlias = Callable[[Votes], JudgedClaim]


class HagerBryneEvidence(NamedTuple):
    """All numbers that the claims rest on, by one reading."""

    flights: pd.DataFrame  # of cells.tables, as `select_reading`
    offset: pd.DataFrame  # the same of the flights with the accelerometer offset
    # flight, grade, run, correlation, small_ratio, turned_ratio, grew; see drift.py; None: not flown
    drift: pd.DataFrame | None = None
    # of the ablation: flight, interval_s, survived(_low, _high), position(_low, _high) reset by
    # closed loop; None: not run
    resets: pd.DataFrame | None = None
    # of the ablation: the bias in the INS against the one in the error state; None: not run
    places: pd.DataFrame | None = None


class CellTables(NamedTuple):
    """Tables of a FlownWorld with one update of the closed loop, see cells.tables."""

    flights: pd.DataFrame
    offset: pd.DataFrame  # constant
    initial: pd.DataFrame  # as initial value of the bias process


class FlownReadings(NamedTuple):
    """All that was flown."""

    cells: Mapping[tuple[FlownWorld, str], CellTables]  # by world and key of the update
    drift: Mapping[FlownWorld, pd.DataFrame]
    resets: pd.DataFrame | None = None
    places: pd.DataFrame | None = None

    def read(self, reading: WorldReading = CHOSEN) -> HagerBryneEvidence | None:
        """The evidence by a reading; None where that was not flown."""
        cells = self.cells.get((reading.world, reading.update))
        if cells is None:
            return None
        return HagerBryneEvidence(
            select_reading(cells.flights, reading),
            select_reading(
                cells.offset if reading.offset == "constant" else cells.initial, reading
            ),
            self.drift.get(reading.world),
            self.resets,
            self.places,
        )


def select_reading(cells: pd.DataFrame, reading: WorldReading) -> pd.DataFrame:
    """The table of cells with the columns of a reading under plain names: "position" of
    "position_both", "open_survived" of "open_survived_500"."""
    counts, alone = reading.abort == "both", reading.abort == "500"
    other = "500" if counts else reading.abort
    told = {"position": f"position_{reading.abort}"}
    told |= {name: f"{name}_{other}" for name in COMPARED if name != "position"}
    for loop in ("open", "closed"):
        told |= {f"{loop}_{name}": f"{loop}_{name}_500" for name in ("survived", "anees") if alone}
        told[f"{loop}_early"] = f"{loop}_{reading.diverges}_{reading.minutes}"
    told["open_begins_s"] = f"open_{reading.diverges}_s"
    ends = ("", "_low", "_high", "_count")
    columns = {f"{name}{end}": f"{own}{end}" for name, own in told.items() for end in ends}
    columns = {name: own for name, own in columns.items() if own in cells}
    plain = cells[list(columns.values())].set_axis(list(columns), axis=1)
    return pd.concat([cells.drop(columns=list(columns), errors="ignore"), plain], axis=1)


FLIGHTS, OFFSET, DRIFT, RESETS, PLACES = map(
    attrgetter, ("flights", "offset", "drift", "resets", "places")
)


def choose_flights(
    flights: Sequence[str], *grades: str
) -> Callable[[HagerBryneEvidence], pd.DataFrame]:
    """Chooses the cells of flights without offset, of some grades."""
    return lambda e: e.flights[e.flights["grade"].isin(grades) & e.flights["flight"].isin(flights)]


def ends(row: pd.Series, name: str, confidence: float) -> tuple[float, float]:
    """(low, high) of the interval of `name` in a row, at a level of confidence."""
    low, high, middle = row[f"{name}_low"], row[f"{name}_high"], row[name]
    if confidence == CONFIDENCE:
        return low, high
    if any(share in name for share in SHARES):
        return proportion(round(middle * row["runs"]), row["runs"], confidence)[1:]
    freedom = row.get(f"{name}_count", row["runs"]) - 1
    wider = student.isf(0.5 * (1 - confidence), freedom) / student.isf(
        0.5 * (1 - CONFIDENCE), freedom
    )
    return middle * (low / middle) ** wider, middle * (high / middle) ** wider


def for_side(rows: pd.DataFrame, name: str, side: str) -> Votes:
    """Votes of the rows for filter `side` being better by ratio `name`; the other one better or no
    difference contradicts."""

    def votes(confidence: float) -> list[int]:
        found = [
            better(pd.Series(ends(row, name, confidence), [f"{name}_low", f"{name}_high"]), name)
            for _, row in rows.iterrows()
        ]
        return [1 if each == side else -int(each != UNKNOWN) for each in found]

    return votes


def above(rows: pd.DataFrame, name: str, level: float = 0.5, more: bool = True) -> Votes:
    """Votes of the rows for `name` being above `level`, with more=False below."""
    sign = 1 if more else -1
    return lambda confidence: [
        sign * vote(*ends(row, name, confidence), level) for _, row in rows.iterrows()
    ]


def at_95(votes: Sequence[int]) -> Votes:
    """Votes that are known at 95 % alone, for rules that ask for no other level."""
    return lambda _: votes


def better_by(rows: pd.DataFrame, name: str, side: str, rule: Rule = mostly) -> JudgedClaim:
    """Filter `side` is better by ratio `name`."""
    found = rule(for_side(rows, name, side))
    return JudgedClaim(found.verdict, f"{found} ({ratios(rows, name)})")


def runs_that(rows: pd.DataFrame, name: str, rule: Rule = mostly, more: bool = True) -> JudgedClaim:
    """More than half of the runs of a cell are `name`, or fewer."""
    return rule(above(rows, name, more=more))


def too_sure(rows: pd.DataFrame) -> JudgedClaim:
    """MOSTLY the closed loop's NEES/15 is above TOO_SURE."""
    return mostly(above(rows, "closed_anees", TOO_SURE))


def biases_better(rows: pd.DataFrame, side: str) -> JudgedClaim:
    """MOSTLY filter `side` has the better biases."""
    return mostly(of_all(*(for_side(rows, name, side) for name in ("accel_bias", "gyro_bias"))))


def column_value(rows: pd.DataFrame, column: str, how: str = "median") -> float:
    """Median, "min" or "max" of a column over the cells."""
    return float(rows[column].agg(how))


def change(rows: pd.DataFrame, name: str) -> str:
    """Return the text of the difference between the open loop's RMSE and the closed one's, median
    of the cells."""
    values = rows[name].to_numpy(float)
    values = values[np.isfinite(values)]
    return factors([float(np.median(values))])[0] if len(values) else "nothing known"


def cells_above(rows: pd.DataFrame, name: str) -> str:
    """Text: in how many cells the share of runs is above one half."""
    return f"{int((rows[name] > 0.5).sum())} of {len(rows)}"


def each(rows: pd.DataFrame, form: str, between: str = ", ") -> str:
    """Text: the format string `form` filled with each row r."""
    return between.join(form.format(r=r) for r in rows.itertuples())


def one_filter(*names: str) -> Callable[[pd.DataFrame], str]:
    """A function of cells: the text that the two filters are one, where each of the ratios `names`
    is 1 in every run of every cell; else ""."""

    def same(rows: pd.DataFrame) -> str:
        bounds = rows[[f"{name}{end}" for name in names for end in ("_low", "_high")]]
        one = len(rows) > 0 and bool((bounds == 1.0).all(axis=None))
        return "both filters are one, every ratio is exactly 1" * one

    return same


def drift_explains(drift: pd.DataFrame) -> JudgedClaim:
    """EXPLANATION: the rank correlation of drift and ratio of the NEES is above 0.5 on average; at
    each grade the NEES of both filters differ by less than TOO_SURE - 1 while position and attitude
    of the INS have drifted little; and the open loop's is larger by more than that where the
    attitude alone has drifted far, if it does so in two runs."""
    related = paired_comparison(drift["correlation"].to_numpy(float), np.zeros(len(drift)))
    small = {
        str(grade): log_mean(part["small_ratio"])
        for grade, part in drift.groupby("grade", sort=False)
    }
    turned = log_mean(drift["turned_ratio"])
    alike = all(low > 1 / TOO_SURE and high < TOO_SURE for _, low, high in small.values())
    apart = any(low > TOO_SURE or high < 1 / TOO_SURE for _, low, high in small.values())
    grows = not np.isfinite(turned[1]) or turned[1] > TOO_SURE
    no_growth = bool(turned[2] < TOO_SURE)
    texts = [f"{grade} {told_mean(mean)}" for grade, mean in small.items()]
    return JudgedClaim(
        decide(related.low > 0.5 and alike and grows, apart or no_growth or related.high < 0.5),
        f"Correlation {related.difference:.2f} ({related.low:.2f} to {related.high:.2f}) over "
        f"{related.count} runs; NEES open by closed at small drift and turn {', '.join(texts)}; at "
        f"small drift and large turn {told_mean(turned)}",
    )


def log_mean(values: pd.Series) -> tuple[float, float, float]:
    """(geometric mean, its 95 % ends) of those that are known."""
    with np.errstate(all="ignore"):
        found = paired_comparison(np.log(values.to_numpy(float)), np.zeros(len(values)))
    value, low, high = np.exp([found.difference, found.low, found.high])
    return float(value), float(low), float(high)


def told_mean(mean: tuple[float, float, float]) -> str:
    """Text of `log_mean`."""
    value, low, high = mean
    return f"{value:.3g} ({low:.3g} to {high:.3g})" if np.isfinite(value) else "not met"


def drift_by_grade(drift: pd.DataFrame) -> str:
    """Text: NEES open by closed of each grade at small drift and turn."""
    return ", ".join(
        f"{log_mean(part['small_ratio'])[0]:.3g} at {grade} grade"
        for grade, part in drift.groupby("grade", sort=False)
    )


def ins_grows(drift: pd.DataFrame) -> JudgedClaim:
    """MOSTLY, by single runs: the raw INS has drifted farther in the last quarter of the flight
    than in the one before."""
    return mostly_of(cluster_share([(int(grew), 1) for grew in drift["grew"]]))


def judge_amplification(flights: pd.DataFrame, of: Sequence[str]) -> JudgedClaim:
    """MOSTLY, over the grades `of` and the dynamic flights: the open-loop RMSE is larger than that
    of the longest straight flight over the same time, by more than SIZE with the interval of their
    ratio; a smaller one or no difference contradicts."""
    name, votes = "open_censored_500_m", []
    for grade in of:
        part = flights[flights["grade"] == grade]
        straight = part[part["flight"].isin(STRAIGHTS)]
        for _, row in part[~part["flight"].isin(STRAIGHTS)].iterrows():
            over = f"open_by_{60 * row['minutes']:.0f}_s"
            known = straight[straight[over].notna()] if over in straight else straight[:0]
            if len(known):
                beside = known.loc[known["minutes"].idxmax()]
                votes.append(longer(row, rename_interval(beside, over, name), name, 1 + SIZE))
    return mostly(at_95(votes))


def rename_interval(row: pd.Series, name: str, other: str) -> pd.Series:
    """The interval `name` of a row under another name."""
    return pd.Series({f"{other}{end}": row[f"{name}{end}"] for end in ("", "_low", "_high")})


def stays_small_while_wrong(rows: pd.DataFrame) -> JudgedClaim:
    """MOSTLY the open loop is interrupted as inconsistent before its position errs by 10 m
    (interval of the ratio of the times); a cell in which neither happens says nothing."""
    votes = []
    for _, row in rows.iterrows():
        if not (is_unfinished(row, "open_given_up_s") and is_unfinished(row, "open_onset_s")):
            pair = (row, rename_interval(row, "open_given_up_s", "open_onset_s"))
            votes.append(longer(*pair, "open_onset_s"))
    return mostly(at_95(votes))


def one_result(rows: pd.DataFrame, names: Sequence[str]) -> JudgedClaim:
    """ALWAYS the two filters differ by less than SIZE in the ratios `names`."""
    votes = [
        {NONE: 1, UNKNOWN: 0}.get(better(row, name), -1)
        for _, row in rows.iterrows()
        for name in names
    ]
    return always(at_95(votes))


Beside: TypeAlias = list[tuple[pd.Series, pd.Series]]
"""[(a cell with offset, the one of its grade and flight without)]."""


def with_and_without(e: HagerBryneEvidence) -> Beside:
    """Chooses the cells with offset that were flown without, too."""
    without = {(row["grade"], row["flight"]): row for _, row in e.flights.iterrows()}
    rows = [(row, without.get((row["grade"], row["flight"]))) for _, row in e.offset.iterrows()]
    return [(row, other) for row, other in rows if other is not None]


def longer(first: pd.Series, second: pd.Series, name: str, factor: float = 1.0) -> int:
    """+1 where `name`, a time or an RMSE, is more than `factor` times as large in row `first` as in
    `second` by the 95 % interval of their ratio, -1 where it is less, 0 where the interval holds
    the factor, as where one of the two may be 0."""
    if not (first[f"{name}_low"] > 0 and second[f"{name}_low"] > 0):
        return 0
    halves = [0.5 * np.log(row[f"{name}_high"] / row[f"{name}_low"]) for row in (first, second)]
    ratio, half = np.log(first[name] / second[name]), float(np.hypot(*halves))
    return vote(ratio - half, ratio + half, float(np.log(factor)))


def sooner(cells: Beside, name: str) -> JudgedClaim:
    """MOSTLY time `name` is shorter with offset; a flight that ends before both says nothing."""
    told = [
        (row, without)
        for row, without in cells
        if not (is_unfinished(row, name) and is_unfinished(without, name))
    ]
    return mostly(at_95([-longer(row, without, name) for row, without in told]))


def as_small(cells: Beside, name: str, factor: float) -> JudgedClaim:
    """MOSTLY `name` is at most `factor` times that without offset."""
    return mostly(
        at_95(
            [
                int(row[f"{name}_high"] <= factor * without[name])
                - int(row[f"{name}_low"] > factor * without[name])
                for row, without in cells
            ]
        )
    )


def beside_straight(
    rows: pd.DataFrame,
) -> Iterator[tuple[str, pd.DataFrame, pd.DataFrame]]:
    """(grade, its dynamic flights, the straight one) of each grade that has one."""
    for grade, part in rows.groupby("grade", sort=False):
        straight, dynamic = (part[(part["flight"] == STRAIGHT) == which] for which in (True, False))
        if len(straight):
            yield str(grade), dynamic, straight


def against_straight(rows: pd.DataFrame, name: str, sign: int) -> JudgedClaim:
    """MOSTLY, over the dynamic flights, time `name` is longer (`sign` 1) or shorter (-1) than on
    the straight one of their grade; one that ends before it can tell says nothing."""
    votes = []
    for _, dynamic, straight in beside_straight(rows):
        for _, row in dynamic.iterrows():
            one = longer(row, straight.iloc[0], name)
            if one > 0 or not is_unfinished(row, name):
                votes.append(sign * one)
    return mostly(at_95(votes))


def times_beside_straight(rows: pd.DataFrame, name: str) -> str:
    """Text: the times of the dynamic flights and of the straight one, by grade."""
    return "; ".join(
        f"{grade}: {times(dynamic, name)}, straight {times(straight, name)}"
        for grade, dynamic, straight in beside_straight(rows)
    )


def is_unfinished(rows: pd.DataFrame | pd.Series, name: str) -> Any:
    """True, for a row or each of several, where the flight ends before the time is known: the true
    time is then longer than the value."""
    return rows[name] >= 0.99 * 60 * rows["minutes"]


def times(rows: pd.DataFrame, name: str) -> str:
    """Text: smallest and largest time of the rows that have one within the flight, and how many
    have not."""
    within = rows.loc[~is_unfinished(rows, name), name]
    ended, least = len(rows) - len(within), f"{within.min():.0f}"
    span = {0: "", 1: f"{least} s"}.get(len(within), f"{least} to {within.max():.0f} s")
    missing = f"{ended} not within the flight" if len(rows) > 1 else "not within the flight"
    return ", ".join(filter(None, (span, missing * bool(ended))))


def stable_by_resets(resets: pd.DataFrame) -> JudgedClaim:
    """One interval of RARELY or more on the longest flight with which runs survive and the
    position is not worse than the closed loop's is enough."""
    rows = resets[(resets["minutes"] == resets["minutes"].max()) & (resets["interval_s"] >= RARELY)]
    good = (rows["survived_low"] > 0.5) & (rows["position_high"] < 1 + SIZE)
    bad = (rows["survived_high"] < 0.5) | (rows["position_low"] > 1 + SIZE)
    form = (
        "every {r.interval_s:.0f} s: {r.survived:.0%} survive, position RMSE {r.position:.4g} times "
        "the closed loop's ({r.position_low:.4g} to {r.position_high:.4g})"
    )
    return JudgedClaim(decide(bool(good.any()), bool(bad.all())), each(rows, form, "; "))


def rarest_that_holds(resets: pd.DataFrame) -> str:
    """Text: the longest interval of which more than half of the runs survive on the longest
    flight."""
    rows = resets[(resets["minutes"] == resets["minutes"].max()) & (resets["survived"] > 0.5)]
    return f"{rows['interval_s'].max():.0f} s" if len(rows) else "no interval that was tried"
