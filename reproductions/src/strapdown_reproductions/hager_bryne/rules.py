"""Rules that decide the claims of Hager & Bryne: how cells vote at a level of confidence, what is
counted, and how the readings of what the paper leaves open, or prints, decide together."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from scipy.stats import t as student

from strapdown.evaluation.consistency import paired_comparison, proportion

from ..common.claims import Claim, JudgedClaim, judge
from ..common.kinds import CONFIDENCE, Votes, mostly, of_all
from ..common.verdicts import (
    READINGS,
    SIZE,
    UNKNOWN,
    apart,
    better,
    decided,
    factors,
    over_readings,
    ratios,
    vote,
)

CONSUMER, TACTICAL, NAVIGATION = GRADES = ("consumer", "tactical", "navigation")
SHORT, LONG = tuple(f"{i:02d}" for i in range(1, 7)), tuple(f"{i:02d}" for i in range(7, 12))
STRAIGHT = "07"
TOO_SURE = 1.1
"""A filter is called inconsistent where the interval of its typical NEES/15 lies above this: too
sure of itself; below 1 it is too careful."""
SMALL_DRIFT = 100.0
"""m of raw INS drift, below which the linearisation should not matter."""
RARELY = 60.0
"""s: resets that are this far apart or further are occasional."""
SHARES = ("survived", "early", "diverged")
"""In the names of columns that are shares of the runs; all others are means over runs of something's
logarithm, or stand for one."""
PRINTED, ZERO = "(15) as printed", "(19) zero"
TENTH, EXACT = "a tenth of the start's attitude error", "no attitude error at the start"
AS_CHOSEN = "as chosen here"
UPDATES, STARTS = (PRINTED, ZERO), (TENTH, EXACT)
UPDATES_AND_STARTS = tuple(f"{PRINTED} with {start}" for start in STARTS)
"""Readings of the closed loop, of the start of navigation grade, and of both; see Evidence."""
Rule: TypeAlias = Callable[[Votes], JudgedClaim]


class HagerBryneEvidence(NamedTuple):
    """All numbers that the claims rest on."""

    flights: pd.DataFrame  # of cells.tables
    offset: pd.DataFrame  # the same of the flights with the accelerometer offset, constant
    drift: pd.DataFrame  # flight, grade, run, correlation, small_ratio; see drift.py
    # as `offset`, with the offset as initial value of the bias process; None: not flown
    initial: pd.DataFrame | None = None
    # of the ablation: flight, interval_s, survived(_low, _high), position(_low, _high) reset by
    # closed loop; None: not run
    resets: pd.DataFrame | None = None
    # {reading: as `flights`}, of UPDATES, STARTS and UPDATES_AND_STARTS
    readings: Mapping[str, pd.DataFrame] = {}


FLIGHTS, OFFSET, DRIFT, RESETS = map(attrgetter, ("flights", "offset", "drift", "resets"))
Reading: TypeAlias = tuple[str, Callable[[HagerBryneEvidence], HagerBryneEvidence | None]]
"""Its name, and the evidence read so; None where that was not run."""


def flown(flights: Sequence[str], *grades: str) -> Callable[[HagerBryneEvidence], pd.DataFrame]:
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


def better_side(rows: pd.DataFrame, name: str, side: str) -> JudgedClaim:
    """MOSTLY filter `side` is better by ratio `name`."""
    return mostly(for_side(rows, name, side))


def position(rows: pd.DataFrame, side: str, rule: Rule = mostly) -> JudgedClaim:
    """Filter `side` has the better position, by both readings of the abort rule."""
    found = [rule(for_side(rows, f"position{reading}", side)) for reading in READINGS]
    texts = [
        f"{name}: {one} ({ratios(rows, f'position{reading}')})"
        for name, one, reading in zip(
            ("Both abort rules, 500 m counted from the abort on", "500 m alone"), found, READINGS
        )
    ]
    return JudgedClaim(over_readings(*(one.verdict for one in found)), "; ".join(texts))


def runs_that(rows: pd.DataFrame, name: str, rule: Rule = mostly, more: bool = True) -> JudgedClaim:
    """More than half of the runs of a cell are `name`, or fewer."""
    return rule(above(rows, name, more=more))


def survival(rows: pd.DataFrame, loop: str, more: bool, rule: Rule = mostly) -> JudgedClaim:
    """More than half of the runs of a filter survive, or fewer, by both readings of the abort
    rule."""
    both, alone, strict = (
        runs_that(rows, f"{loop}_survived{reading}", rule, more)
        for reading in (*READINGS, "_500_in_model")
    )
    return JudgedClaim(
        over_readings(both.verdict, alone.verdict),
        f"Both abort rules: {both}; 500 m alone: {alone}; 500 m, and leaving the model counts as "
        f"lost: {strict}",
    )


def too_sure(rows: pd.DataFrame) -> JudgedClaim:
    """MOSTLY the closed loop's NEES/15 is above TOO_SURE."""
    return mostly(above(rows, "closed_anees", TOO_SURE))


def biases_better(rows: pd.DataFrame, side: str) -> JudgedClaim:
    """MOSTLY filter `side` has the better biases."""
    return mostly(of_all(*(for_side(rows, name, side) for name in ("accel_bias", "gyro_bias"))))


def told(rows: pd.DataFrame, column: str, how: str = "median") -> float:
    """Median, "min" or "max" of a column over the cells."""
    return float(rows[column].agg(how))


def change(rows: pd.DataFrame, name: str) -> str:
    """Text: by how much the open loop's RMSE differs from the closed one's, median of the cells."""
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
    """EXPLANATION: the rank correlation of drift and ratio of the NEES is above 0.5 on average, and
    while the drift is small the NEES of both filters differ by less than TOO_SURE - 1."""
    related = paired_comparison(drift["correlation"].to_numpy(float), np.zeros(len(drift)))
    small = paired_comparison(np.log(drift["small_ratio"].to_numpy(float)), np.zeros(len(drift)))
    value, low, high = np.exp([small.difference, small.low, small.high])
    return JudgedClaim(
        decided(
            related.low > 0.5 and low > 1 / TOO_SURE and high < TOO_SURE,
            low > TOO_SURE or high < 1 / TOO_SURE,
        ),
        f"Correlation {related.difference:.2f} ({related.low:.2f} to {related.high:.2f}) over "
        f"{related.count} runs; ratio of NEES at small drift {value:.3g} ({low:.3g} to {high:.3g})",
    )


def drift_by_grade(drift: pd.DataFrame) -> str:
    """Text: mean correlation and ratio at small drift of each grade."""
    return "; ".join(
        f"{grade} {part['correlation'].mean():.2f} and "
        f"{np.exp(np.log(part['small_ratio']).mean()):.3g}"
        for grade, part in drift.groupby("grade", sort=False)
    )


def amplified(flights: pd.DataFrame) -> JudgedClaim:
    """MOSTLY, over consumer and tactical grade: of the straight flights a shorter dynamic one
    exceeds the open-loop error (supports), or a longer one undercuts it (contradicts)."""
    by_cell = {(row["grade"], row["flight"]): row for _, row in flights.iterrows()}
    name, votes = "open_censored_500_m", []
    for grade in (CONSUMER, TACTICAL):
        for flown_as in (("06", STRAIGHT, "08"), ("09", "10", "11")):
            shorter, straight, longer = (by_cell.get((grade, flight)) for flight in flown_as)
            if straight is not None:
                supports = shorter is not None and apart(shorter, straight, name) > 0
                contradicts = longer is not None and apart(longer, straight, name) < 0
                votes.append(int(supports) - int(contradicts))
    return mostly(at_95(votes))


Beside: TypeAlias = list[tuple[pd.Series, pd.Series]]
"""[(a cell with offset, the one of its grade and flight without)]."""


def with_and_without(e: HagerBryneEvidence) -> Beside:
    """Chooses the cells with offset that were flown without, too."""
    without = {(row["grade"], row["flight"]): row for _, row in e.flights.iterrows()}
    rows = [(row, without.get((row["grade"], row["flight"]))) for _, row in e.offset.iterrows()]
    return [(row, other) for row, other in rows if other is not None]


def longer(first: pd.Series, second: pd.Series, name: str) -> int:
    """+1 where time `name`, a geometric mean over runs, is longer in row `first` than in `second`
    by the 95 % interval of their ratio, -1 where it is shorter, 0 where the interval holds 1."""
    halves = [0.5 * np.log(row[f"{name}_high"] / row[f"{name}_low"]) for row in (first, second)]
    ratio, half = np.log(first[name] / second[name]), float(np.hypot(*halves))
    return vote(ratio - half, ratio + half, 0.0)


def sooner(cells: Beside, name: str) -> JudgedClaim:
    """MOSTLY time `name` is shorter with offset; a flight that ends before both says nothing."""
    told = [
        (row, without)
        for row, without in cells
        if not (unfinished(row, name) and unfinished(without, name))
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
    """MOSTLY, over the dynamic flights, time `name` is longer (`sign` 1) or shorter (-1) than on the
    straight one of their grade; one that ends before it can tell says nothing."""
    votes = []
    for _, dynamic, straight in beside_straight(rows):
        for _, row in dynamic.iterrows():
            one = longer(row, straight.iloc[0], name)
            if one > 0 or not unfinished(row, name):
                votes.append(sign * one)
    return mostly(at_95(votes))


def times_beside_straight(rows: pd.DataFrame, name: str) -> str:
    """Text: the times of the dynamic flights and of the straight one, by grade."""
    return "; ".join(
        f"{grade}: {times(dynamic, name)}, straight {times(straight, name)}"
        for grade, dynamic, straight in beside_straight(rows)
    )


def unfinished(rows: pd.DataFrame | pd.Series, name: str) -> Any:
    """True, for a row or each of several, where the flight ends before the time is known: the true
    time is then longer than the value."""
    return rows[name] >= 0.99 * 60 * rows["minutes"]


def times(rows: pd.DataFrame, name: str) -> str:
    """Text: smallest and largest time of the rows that have one within the flight, and how many
    have not."""
    within = rows.loc[~unfinished(rows, name), name]
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
    return JudgedClaim(decided(bool(good.any()), bool(bad.all())), each(rows, form, "; "))


def rarest_that_holds(resets: pd.DataFrame) -> str:
    """Text: the longest interval of which more than half of the runs survive on the longest
    flight."""
    rows = resets[(resets["minutes"] == resets["minutes"].max()) & (resets["survived"] > 0.5)]
    return f"{rows['interval_s'].max():.0f} s" if len(rows) else "no interval that was tried"


def of_flights(name: str) -> Reading:
    """The reading `name` of Evidence.readings."""
    return name, lambda e: e._replace(flights=e.readings[name]) if name in e.readings else None


def in_readings(claim: Claim, about: str, readings: Sequence[Reading]) -> Claim:
    """A claim by several readings of what the paper says or leaves open, the first of which is
    always there; opposite verdicts mean that the reading decides. about: what is read how, for the
    rule."""

    def found(e: HagerBryneEvidence) -> dict[str, dict[str, str]]:
        read = {name: of(e) for name, of in readings}
        return {name: judge(claim, own) for name, own in read.items() if own is not None}

    def together(e: HagerBryneEvidence) -> JudgedClaim:
        judged = found(e)
        texts = [f"{name} ({one['verdict']}): {one['measured']}" for name, one in judged.items()]
        alone = next(iter(judged.values()))
        return JudgedClaim(
            over_readings(*(one["verdict"] for one in judged.values())),
            ". ".join(texts) if len(judged) > 1 else alone["measured"],
        )

    def answered(e: HagerBryneEvidence) -> str:
        judged = found(e)
        verdicts = {name: one["verdict"] for name, one in judged.items()}
        by_verdict = [
            f"{verdict}: {', '.join(name for name, own in verdicts.items() if own == verdict)}"
            for verdict in dict.fromkeys(verdicts.values())
        ]
        first = next(iter(judged.values()))["answer"]
        return f"{first} By reading - {'; '.join(by_verdict)}." if len(judged) > 1 else first

    def same(e: HagerBryneEvidence) -> str:
        texts = [one["identity"] for one in found(e).values()]
        return texts[0] if all(texts) else ""

    return claim._replace(
        rule=f"{claim.rule}; {about}",
        parts={"readings": together},
        measured="{readings}",
        shown={"answered": answered},
        answer="{answered}",
        identity=same,
    )


def updates_and_starts(claim: Claim, *names: str) -> Claim:
    """A claim also with the loop as printed, with other starts of navigation grade, or both: `names`
    are of UPDATES, STARTS and UPDATES_AND_STARTS."""
    return in_readings(
        claim,
        f"read {AS_CHOSEN}, and with {', '.join(names)}",
        [(AS_CHOSEN, lambda e: e), *map(of_flights, names)],
    )


def offset_twice(claim: Claim) -> Claim:
    """A claim about the offset by both readings of what it is."""
    return in_readings(
        claim,
        "with the offset read as constant, and as initial value of the bias process",
        [
            ("Constant", lambda e: e),
            (
                "Initial value",
                lambda e: None if e.initial is None else e._replace(offset=e.initial),
            ),
        ],
    )
