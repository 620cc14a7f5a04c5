"""Claims of Alam et al. on NLO, two-stage EKF and XKF, each decided by the rule of its kind from
the tables of runs.

A claim about the filters is judged for every reading of the points that the paper leaves open
(readings.py). Where verdicts contradict each other, the claim depends on the reading. The rules
were written before any run of the seeds that they judge.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import Interval, Paired, paired_comparison, proportion
from strapdown.experiments.outages.summaries import over_blocks

from ..common import kinds
from ..common.claims import Claim, JudgedClaim, findings, over
from ..common.kinds import Share, cluster_share
from ..common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from ..common.paired_ratios import better, difference, ratio, stronger
from ..common.verdicts import both, count_votes, decide, over_readings
from .convergence import BELOW, WITHIN
from .readings import EKF, NLO, PRINTED, READINGS, WORDS, XKF, AlamReading, label_of
from .runs import (
    AXES,
    CONSTANT,
    EKF_NO_COURSE,
    FULL,
    FULL_PRINTED,
    POSITION_ALONE,
    STABILISED,
    TURN_ON,
    XKF_NO_COURSE,
)
from .table1 import OUTAGES, list_ratios, published_least, published_times, published_wins

RMSE = tuple(f"{axis}_rmse_m" for axis in AXES)
TWICE = 2.0
"""\"Diverges rapidly\", \"varies significantly more\": smallest ratio of errors, and of
variation."""
STEADY = {sensor: 0.2 * size for sensor, size in TURN_ON.items()}
"""m/s^2 and rad/s: a fifth of the turn-on biases of the IMU; a bias estimate that wanders less
over the last ten minutes is stabilised."""
LOST = "a run that stops or diverges counts with 100 times the turn-on biases"
ENOUGH = 2
"""Smallest number of cells with the EKF better in the north for a judgement of its explanation; a
single one may be chance."""
NEAR = 2.0
"""m: largest difference of XKF and NLO in the published Table 1."""
SURE = 0.97
"""Share of starts from which a stable filter converges."""
DEGREES = float(np.degrees(1.0))
SHOWN = (EKF, NLO, XKF, FULL)
CELLS = (
    "a cell is an axis in one of the five simulated outages over all seeds, in thor75 or in "
    "drive0708; a filter is better where the interval of the ratio of RMSEs lies below 1 by more "
    "than 1 %"
)
BY_READING = "for each reading of the filters"


Tables: TypeAlias = dict[str, pd.DataFrame]
"""{case: table} of table1.wide: the simulated outages and the recordings."""


class AlamEvidence(NamedTuple):
    """The evidence for the claims."""

    tables: Tables
    biases: pd.DataFrame
    converged: pd.DataFrame  # of convergence.study
    costs: pd.DataFrame  # of costs.measure_costs


TABLES, BIASES, CONVERGED, COSTS = map(attrgetter, AlamEvidence._fields)


def over_all(evidence: object, judge: Callable[..., JudgedClaim], *args: object) -> JudgedClaim:
    """Apply `judge(evidence, reading, *args)` to every reading, and combine the verdicts. The text
    has the numbers of the literal reading and the counts of verdicts by kind of reading; the table
    of readings has all."""
    found = [(reading, judge(evidence, reading, *args)) for reading in READINGS]
    (letter, first), *others = found
    texts = [f"{letter.name}: {first} ({first.verdict})"]
    for word in WORDS:
        own = Counter(each.verdict for reading, each in others if reading.word == word)
        if own:
            texts.append(f"{word}: " + ", ".join(f"{own[verdict]} {verdict}" for verdict in own))
    return JudgedClaim(over_readings(*(each.verdict for _, each in found)), "; ".join(texts))


def simulated_outages(tables: Tables) -> Tables:
    """The outages of the simulated flight."""
    return {case: table for case, table in tables.items() if case.startswith("outage ")}


def win_share(tables: Tables, measure: str, first: str, *others: str) -> Share:
    """Return the share of the single simulated outages in which filter `first` has a smaller
    measure than each of `others`."""
    by_seed: dict[int, list[bool]] = {}
    for table in simulated_outages(tables).values():
        if not {(measure, name) for name in (first, *others)} <= set(table.columns):
            continue
        own = table[measure]
        smaller = np.all([own[first] < own[other] for other in others], axis=0)
        for block, wins in zip(table.index.get_level_values("block"), smaller):
            by_seed.setdefault(block, []).append(bool(wins))
    return cluster_share((sum(each), len(each)) for each in by_seed.values())


def first_of(reading: AlamReading) -> tuple[str, str, str]:
    """Return the XKF and the two filters that it is compared with."""
    return reading.xkf, reading.ekf, reading.nlo


def in_some(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """In some outages the XKF is better than EKF and NLO."""
    return kinds.sometimes(
        win_share(tables, "horizontal_rmse_m", reading.xkf, reading.ekf, reading.nlo)
    )


def no_benefit(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """Not mostly better than both."""
    mostly = kinds.mostly(better(tables, ("horizontal_rmse_m", "down_rmse_m"), *first_of(reading)))
    opposite = {REPRODUCED: NOT_REPRODUCED, NOT_REPRODUCED: REPRODUCED}
    return mostly._replace(verdict=opposite.get(mostly.verdict, mostly.verdict))


def farther(tables: Tables, reading: AlamReading, measure: str) -> JudgedClaim:
    """At the end of a simulated outage the EKF is more than TWICE as far off as the XKF."""
    value, low, high = times_as_far(tables, reading.ekf, reading.xkf, measure)
    return kinds.more_than(low, high, TWICE, f"{value:.3g} ({low:.3g} to {high:.3g})")


def times_as_far(
    tables: Tables, first: str, second: str, measure: str
) -> tuple[float, float, float]:
    """Geometric mean over the seeds of the ratio of a measure of two filters in all simulated
    outages, with its 95 % interval; NaN without any."""
    by_case = [
        np.log(table[measure][first] / table[measure][second]).groupby("block").mean()
        for table in simulated_outages(tables).values()
        if {(measure, first), (measure, second)} <= set(table.columns)
    ]
    if not by_case:
        return np.nan, np.nan, np.nan
    by_seed = pd.concat(by_case, axis=1).mean(axis=1)
    found = over_blocks(by_seed.to_numpy(), by_seed.index.to_numpy())
    value, low, high = map(float, np.exp(found[:3]))
    return value, low, high


def always_better(tables: Tables, reading: AlamReading, measure: str) -> JudgedClaim:
    """The XKF is better than the EKF in every cell."""
    return kinds.always(better(tables, [measure], reading.xkf, reading.ekf))


def each_sometimes(tables: Tables, reading: AlamReading, measure: str) -> JudgedClaim:
    """Sometimes the XKF and sometimes the EKF is better."""
    return kinds.one_or_the_other(win_share(tables, measure, reading.xkf, reading.ekf))


def overall(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """Over all cells the XKF is better than the EKF, and than the NLO."""
    found = [
        kinds.mostly(better(tables, RMSE, reading.xkf, other))
        for other in (reading.ekf, reading.nlo)
    ]
    text = f"against the EKF {found[0]}, against the NLO {found[1]}"
    return JudgedClaim(both(*(each.verdict for each in found)), text)


def least(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """In most east and down cells the XKF is better than both."""
    return kinds.mostly(better(tables, ("east_rmse_m", "down_rmse_m"), *first_of(reading)))


def like_the_observer(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """In most cells the XKF is within NEAR of the NLO."""
    found = from_the_observer(tables, reading.xkf, reading.nlo)
    votes = [
        int(-NEAR <= each.low and each.high <= NEAR) - int(each.low > NEAR or each.high < -NEAR)
        for each in found
    ]
    return kinds.mostly(lambda confidence: votes)


def explained_by_course(tables: Tables) -> JudgedClaim:
    """The EKF's course explains where it is better in the north."""
    wins = {
        case: table
        for case, table in tables.items()
        if ratio(table, "north_rmse_m", EKF, XKF).side == 1
    }
    judged = kinds.mostly(lambda confidence: [_course_vote(table) for table in wins.values()])
    return JudgedClaim(
        judged.verdict if len(wins) >= ENOUGH else UNDECIDED,
        f"EKF better in the north in {len(wins)} of {len(tables)} cases "
        f"({', '.join(wins) or 'none'}); its course explains that: {judged}",
    )


def _course_vote(table: pd.DataFrame) -> int:
    """Return 1 where the course explains that the EKF is better in the north, -1 where the EKF is
    better without it, 0 where that is undecided."""
    side = ratio(table, "north_rmse_m", EKF_NO_COURSE, XKF_NO_COURSE).side
    lost = stronger(table, "north_rmse_m", "east_rmse_m", EKF_NO_COURSE, XKF_NO_COURSE, EKF, XKF)
    return -1 if side == 1 else int(side == -1 and lost.low > 0)


def from_the_observer(tables: Tables, name: str, observer: str) -> list[Paired]:
    """Mean differences of RMSE between a filter and an NLO, of all cells."""
    return [
        difference(table, measure, name, observer) for table in tables.values() for measure in RMSE
    ]


def median_difference(tables: Tables, name: str, observer: str) -> float:
    """Median of the mean differences from the NLO, m."""
    found = [abs(each.difference) for each in from_the_observer(tables, name, observer)]
    return float(np.median(found or [np.nan]))


def wanders_twice_as_much(biases: pd.DataFrame, reading: AlamReading, column: str) -> JudgedClaim:
    """A column of the biases is on average more than TWICE as large with the EKF as with an XKF."""
    table = biases.pivot_table(index="seed", columns="filter", values=column, sort=False)
    pair = (reading.ekf, reading.xkf)
    known = set(pair) <= set(table.columns)
    found = paired_comparison(*(np.log(table[name]) if known else [] for name in pair))
    value, low, high = np.exp([found.difference, found.low, found.high])
    return kinds.more_than(low, high, TWICE, f"{value:.3g} ({low:.3g} to {high:.3g})")


def unsteady(biases: pd.DataFrame, reading: AlamReading, sensor: str) -> JudgedClaim:
    """At the end, the bias estimates of the EKF vary by more than STEADY in most seeds."""
    return kinds.mostly_of(_unsteady(biases, reading.ekf, sensor))


def steady(biases: pd.DataFrame, reading: AlamReading, sensor: str) -> JudgedClaim:
    """Those of the XKF do not."""
    return kinds.mostly_of(_unsteady(biases, reading.xkf, sensor).opposite)


def _unsteady(biases: pd.DataFrame, name: str, sensor: str) -> Share:
    values = biases.loc[biases["filter"] == name, f"{sensor}_wander_late"]
    return cluster_share((int(value > STEADY[sensor]), 1) for value in values)


def medians(biases: pd.DataFrame, column: str, scale: float = 1.0) -> str:
    """Text: medians over the seeds of a column of the biases, by filter."""
    middle = biases.groupby("filter")[column].median() * scale
    return ", ".join(f"{name} {middle.get(name, np.nan):.2g}" for name in SHOWN)


def median(biases: pd.DataFrame, column: str, scale: float = 1.0) -> float:
    """Median of a column over all runs."""
    return float(biases[column].median()) * scale


def lost_runs(biases: pd.DataFrame) -> str:
    """Text: how many runs there are and how many of each filter were lost."""
    lost = biases["said"].ne("").groupby(biases["filter"]).sum()
    by_filter = ", ".join(f"{name} {int(lost.get(name, 0))}" for name in SHOWN)
    return f"{biases['seed'].nunique()} seeds, lost {by_filter}"


def starts(converged: pd.DataFrame, label: str) -> tuple[Interval, str]:
    """Return the interval of the share of starts of a case of convergence.py that converge, and the
    text of its count."""
    own = converged[converged["case"] == label]
    good = int(np.isfinite(own["since_s"]).sum())
    return proportion(good, len(own)), f"{label} {good} of {len(own)}"


def as_stable_as(converged: pd.DataFrame, reading: AlamReading) -> JudgedClaim:
    """The XKF converges from nearly all starts, as the observer does."""
    return comes_home(converged, reading.xkf, reading.nlo)


def comes_home(converged: pd.DataFrame, name: str, observer: str) -> JudgedClaim:
    """A filter converges from nearly all starts, as its observer does."""
    (bound, text), (own, also) = (starts(converged, label) for label in (observer, name))
    verdict = decide(min(own.value, bound.value) >= SURE, own.high < bound.low)
    return JudgedClaim(verdict, f"{text}; {also}")


def of_fifteen(converged: pd.DataFrame) -> JudgedClaim:
    """Both forms of the XKF with fifteen states, around the library's observer, do so."""
    found = [comes_home(converged, name, "NLO, library's law") for name in (FULL, FULL_PRINTED)]
    text = "; ".join(str(each) for each in found)
    return JudgedClaim(over_readings(*(each.verdict for each in found)), text)


def fails(converged: pd.DataFrame, reading: AlamReading) -> JudgedClaim:
    """From some starts the EKF does not converge."""
    own = converged[converged["case"] == reading.ekf]
    return kinds.sometimes(cluster_share((int(~np.isfinite(since)), 1) for since in own["since_s"]))


def constant_suffices(converged: pd.DataFrame) -> JudgedClaim:
    """With constant gains the observer converges from nearly all starts."""
    share, text = starts(converged, CONSTANT)
    return JudgedClaim(decide(share.value >= SURE, share.high < SURE), text)


def explained_by_bias(tables: Tables, reading: AlamReading) -> JudgedClaim:
    """The EKF is more than TWICE as far off as the XKF, and more than TWICE as far as itself with
    the accelerometer bias stabilised."""
    ratios = [
        times_as_far(tables, reading.ekf, other, "horizontal_end_m")
        for other in (reading.xkf, label_of(reading.ekf, STABILISED))
    ]
    there, because = ratios
    yes = min(there[1], because[1]) > TWICE
    texts = [f"{value:.3g} ({low:.3g} to {high:.3g})" for value, low, high in ratios]
    text = f"{texts[0]} of the XKF's, {texts[1]} of its own with the bias stabilised"
    return JudgedClaim(decide(yes, because[2] < TWICE or there[2] < 1), text)


def injection_helps(tables: Tables) -> JudgedClaim:
    """In most simulated cells the observer with constant gains is better with velocities injected
    than with positions alone."""
    return kinds.mostly(better(simulated_outages(tables), RMSE, CONSTANT, POSITION_ALONE))


def cheaper(costs: pd.DataFrame) -> JudgedClaim:
    """Every repetition of the observer takes less time than every one of the EKF."""
    by = costs.groupby("filter")["seconds"] if len(costs) else None
    if by is None or not {NLO, EKF} <= set(by.groups):
        return JudgedClaim(UNDECIDED, "not timed")
    least, most, middle = by.min(), by.max(), by.median()
    shares = ", ".join(f"{name} {middle[name] / middle[EKF]:.2f}" for name in middle.index)
    text = f"time over the EKF's, medians: {shares}"
    return JudgedClaim(decide(most[NLO] < least[EKF], least[NLO] > most[EKF]), text)


def votes(evidence: AlamEvidence) -> pd.DataFrame:
    """A row per reading: its word, and its verdict on each claim that is judged by reading."""
    rows = []
    for reading in READINGS:
        row = {"reading": reading.name, "word": reading.word}
        for title, (part, judge, *args) in BY_READINGS.items():
            row[title] = judge(part(evidence), reading, *args).verdict
        rows.append(row)
    return pd.DataFrame(rows)


BY_READINGS: dict[str, tuple[Any, ...]] = {
    "1 some cases": (TABLES, in_some),
    "2 no clear benefit": (TABLES, no_benefit),
    "3 position": (TABLES, farther, "horizontal_end_m"),
    "3 velocity": (TABLES, farther, "velocity_end_m_s"),
    "4 accelerometers": (BIASES, wanders_twice_as_much, "accel_wander"),
    "4 gyros": (BIASES, wanders_twice_as_much, "gyro_wander"),
    "5 EKF, accelerometers": (BIASES, unsteady, "accel"),
    "5 XKF, accelerometers": (BIASES, steady, "accel"),
    "5 EKF, gyros": (BIASES, unsteady, "gyro"),
    "5 XKF, gyros": (BIASES, steady, "gyro"),
    "6 east": (TABLES, always_better, "east_rmse_m"),
    "7 down": (TABLES, always_better, "down_rmse_m"),
    "8 north": (TABLES, each_sometimes, "north_rmse_m"),
    "9 overall": (TABLES, overall),
    "11 least": (TABLES, least),
    "12 as the NLO": (TABLES, like_the_observer),
    "13 stability": (CONVERGED, as_stable_as),
    "14 no guarantee": (CONVERGED, fails),
    "15 bias": (TABLES, explained_by_bias),
}
"""{number and claim: (part of the evidence, judge of a reading, its arguments)}."""


def by_reading(title: str) -> Callable[[AlamEvidence], JudgedClaim]:
    """The part of a claim that every reading votes on."""
    part, judge, *args = BY_READINGS[title]
    return over(part, over_all, judge, *args)


def shown_share(tables: Tables, measure: str) -> str:
    """Text: in which share of the single simulated outages the XKF as printed is better than the
    EKF."""
    return str(win_share(tables, measure, XKF, EKF))


def share_of(tables: Tables, measure: str, *others: str) -> str:
    """Text: the same in per cent alone, better than all `others`."""
    share = win_share(tables, measure, XKF, *others)
    return f"{share.value:.0%} of {share.trials}"


def number_of(tables: Tables, measures: Sequence[str], first: str, *others: str) -> str:
    """Text: in how many cells the first filter is better than all `others`."""
    votes = better(tables, measures, first, *others)(kinds.CONFIDENCE)
    return f"{votes.count(1)} of {len(votes)}"


def shown_full(tables: Tables, measures: Sequence[str], *others: str) -> str:
    """Text: count of the cells in which the XKF with 15 states is better."""
    return str(count_votes(better(tables, measures, FULL, *others)(kinds.CONFIDENCE)))


ON_AXIS = (
    "{xkf}. As printed {ratios}; XKF smaller in {won} of the single outages. With 15 states: {full}"
)


def on_axis(measure: str) -> dict[str, Callable[[AlamEvidence], object]]:
    """Return the values that ON_AXIS shows beside the readings of XKF against EKF."""
    return {
        "ratios": over(TABLES, list_ratios, measure, XKF, EKF),
        "won": over(TABLES, shown_share, measure),
        "full": over(TABLES, shown_full, [measure], EKF),
        "cells": over(TABLES, number_of, [measure], XKF, EKF),
    }


CLAIMS = {
    "some_cases": Claim(
        "During the outage of GNSS, in some cases the divergence of position estimates using XKF is "
        "lower than with EKF and NLO.",
        "Abstract",
        f"single simulated outages in which the XKF's horizontal RMSE is smaller than both others', "
        f"{BY_READING}",
        {"xkf": by_reading("1 some cases")},
        "{xkf}. Cells of all axes with 15 states: {full}",
        "figure 6",
        {
            "full": over(TABLES, shown_full, RMSE, EKF, NLO),
            "share": over(TABLES, share_of, "horizontal_rmse_m", EKF, NLO),
        },
        kind=kinds.SOMETIMES,
        answer="In {share} simulated outages the XKF, as printed, is horizontally better than both "
        "EKF and NLO.",
    ),
    "no_clear_benefit": Claim(
        "No clear benefit is achieved: there is no clear evidence that XKF globally improves the "
        "estimates.",
        "Abstract; 4",
        f"a clear benefit would be an XKF better than both EKF and NLO, horizontally and down, in "
        f"more than half of the cells: that decides, the other way round, {BY_READING}\n{CELLS}",
        {"xkf": by_reading("2 no clear benefit")},
        "Better than both: {xkf}",
        "figure 6",
        {"cells": over(TABLES, number_of, ("horizontal_rmse_m", "down_rmse_m"), XKF, EKF, NLO)},
        kind=kinds.OVERALL,
        answer="The XKF, as printed, is better than both others in {cells} cells.",
    ),
    "diverges_rapidly": Claim(
        "Without GNSS the position and velocity estimates of the EKF diverge rapidly, those of the "
        "XKF slowly.",
        "4",
        f"at the end of a simulated outage the EKF is more than {TWICE:g} times as far off as the "
        f"XKF, horizontally and in velocity (geometric mean, over the seeds), {BY_READING}; both "
        "parts must hold",
        {
            "position": by_reading("3 position"),
            "velocity": by_reading("3 velocity"),
        },
        "Position: {position}. As printed {ratios}. Velocity: {velocity}. "
        f"In the published table the horizontal RMSE is {TWICE:g} times as large in "
        f"{published_times(EKF, XKF, TWICE)} of {OUTAGES} outages",
        "figures 5, 4",
        {
            "ratios": over(TABLES, list_ratios, "horizontal_end_m", EKF, XKF),
            "printed": over(TABLES, farther, PRINTED, "horizontal_end_m"),
        },
        kind=kinds.MORE_THAN,
        answer="At the end of an outage the EKF is {printed} times as far off as the XKF as printed.",
    ),
    "biases_vary": Claim(
        "The bias estimates of accelerometers and gyros vary significantly more with the EKF than "
        "with the XKF.",
        "4",
        f"the standard deviation over time of the estimates, from 600 s to the touchdown, is more "
        f"than {TWICE:g} times the XKF's (geometric mean over the seeds), {BY_READING}; {LOST}; "
        f"both sensors must hold",
        {
            "accel": by_reading("4 accelerometers"),
            "gyro": by_reading("4 gyros"),
        },
        f"accelerometers: {EKF} / {XKF} {{accel}}; {{accels}} m/s², the true biases "
        f"{{true_accel:.2g}}; gyros: {EKF} / {XKF} {{gyro}}; {{gyros}} deg/s, the true biases "
        f"{{true_gyro:.2g}}; {{runs}}",
        'figures 4b, 4e; table "Wander of the bias estimates"',
        {
            "accels": over(BIASES, medians, "accel_wander"),
            "true_accel": over(BIASES, median, "accel_true"),
            "gyros": over(BIASES, medians, "gyro_wander", DEGREES),
            "true_gyro": over(BIASES, median, "gyro_true", DEGREES),
            "runs": over(BIASES, lost_runs),
            "one": over(BIASES, wanders_twice_as_much, PRINTED, "accel_wander"),
            "two": over(BIASES, wanders_twice_as_much, PRINTED, "gyro_wander"),
        },
        kind=kinds.MORE_THAN,
        answer="The EKF's estimates vary {one} times as much as those of the XKF as printed for "
        "accelerometers, {two} times for gyros.",
    ),
    "biases_stabilised": Claim(
        "Biases do not vary as fast as the EKF estimates them: its bias estimation is not "
        "stabilised, the XKF's is.",
        "4; 5",
        "the estimates' standard deviation over the last ten minutes of the flight is above a fifth "
        f"of the turn-on biases with the EKF and below it with the XKF, {BY_READING}, in most "
        f"seeds, for both sensors; all four parts must hold\n{LOST}",
        {
            "ekf_accel": by_reading("5 EKF, accelerometers"),
            "xkf_accel": by_reading("5 XKF, accelerometers"),
            "ekf_gyro": by_reading("5 EKF, gyros"),
            "xkf_gyro": by_reading("5 XKF, gyros"),
        },
        "EKF, accelerometers: {ekf_accel}; XKF, accelerometers: {xkf_accel}; EKF, gyros: {ekf_gyro}; "
        "XKF, gyros: {xkf_gyro}. "
        f"Accelerometers, bound {STEADY['accel']:.2g} m/s²: {{accels}}; "
        f"gyros, bound {np.degrees(STEADY['gyro']):.2g} deg/s: {{gyros}}; {{runs}}",
        'figures 4b, 4e; table "Wander of the bias estimates"',
        {
            "accels": over(BIASES, medians, "accel_wander_late"),
            "gyros": over(BIASES, medians, "gyro_wander_late", DEGREES),
            "runs": over(BIASES, lost_runs),
            "one": over(BIASES, unsteady, PRINTED, "accel"),
            "two": over(BIASES, unsteady, PRINTED, "gyro"),
        },
        kind=kinds.MOSTLY,
        answer="As printed the EKF's estimates are not steady in {one} seeds for accelerometers and in "
        "{two} for gyros.",
    ),
    "east": Claim(
        "In the easterly direction the XKF is always better than the EKF.",
        "4; Table 1",
        f"{CELLS}; {BY_READING}",
        {"xkf": by_reading("6 east")},
        f"{ON_AXIS}. Published: {published_wins('east')} outages",
        "figure 6",
        on_axis("east_rmse_m"),
        kind=kinds.ALWAYS,
        answer="In the east the XKF as printed is better than the EKF in {cells} cells, and in {won} "
        "single outages.",
    ),
    "down": Claim(
        "In the downward direction the XKF is always better than the EKF.",
        "4; its Table 1 contradicts it in outages 1 and 5",
        f"{CELLS}; {BY_READING}",
        {"xkf": by_reading("7 down")},
        f"{ON_AXIS}. Published: {published_wins('down')} outages",
        "figure 6",
        on_axis("down_rmse_m"),
        kind=kinds.ALWAYS,
        answer="Downwards the XKF as printed is better than the EKF in {cells} cells, and in {won} "
        "single outages.",
    ),
    "north": Claim(
        "In the north direction sometimes the EKF and sometimes the XKF is better.",
        "4; 5",
        f"single simulated outages in which the XKF's north RMSE is smaller than the EKF's, "
        f"{BY_READING}",
        {"xkf": by_reading("8 north")},
        f"{ON_AXIS}. Published: XKF {published_wins('north')} outages",
        "figure 6",
        on_axis("north_rmse_m"),
        kind=kinds.ONE_OR_THE_OTHER,
        answer="In the north the XKF as printed is better than the EKF in {won} single outages.",
    ),
    "overall": Claim(
        "Overall the XKF performs better in GNSS outages than EKF and NLO alone.",
        "4; the paper also says that there is no clear evidence",
        f"all axes, against the EKF and against the NLO; {CELLS}; {BY_READING}; both parts must "
        "hold",
        {"xkf": by_reading("9 overall")},
        "{xkf}",
        "figure 6",
        {
            "ekf": over(TABLES, number_of, RMSE, XKF, EKF),
            "nlo": over(TABLES, number_of, RMSE, XKF, NLO),
        },
        kind=kinds.OVERALL,
        answer="The XKF as printed is better than the EKF in {ekf} cells, and than the NLO in {nlo}.",
    ),
    "heading_correction": Claim(
        "The north results might be due to the heading correction of the EKF from the GNSS "
        "velocity.",
        "4 (a guess of the authors)",
        f"where the EKF is better than the XKF as printed in the north, it surely no longer is when "
        f"neither has a course measurement, and it loses more against the XKF in the north than in "
        f"the east (whole interval of the difference of log ratios): supports\nstill better without: "
        f"contradicts; not decidable where it is better in fewer than {ENOUGH} cells; most of these "
        "cells decide",
        {"course": over(TABLES, explained_by_course)},
        "{course}. The ratios of both without course are in the table",
        'table "Ablations"',
        kind=kinds.EXPLANATION,
        answer="{course}.",
    ),
    "least": Claim(
        "The XKF diverges the least in east and down position of EKF, NLO and XKF.",
        "5",
        f"east and down cells in which the XKF is better than both; {CELLS}; {BY_READING}",
        {"xkf": by_reading("11 least")},
        f"{{xkf}}. Published: {published_least('east', 'down')} of 10 cells",
        "figure 6",
        {"cells": over(TABLES, number_of, ("east_rmse_m", "down_rmse_m"), XKF, EKF, NLO)},
        kind=kinds.MOSTLY,
        answer="The XKF as printed drifts least of the three in {cells} east and down cells.",
    ),
    "like_the_observer": Claim(
        "(Read off Table 1, not said:) the XKF is within 2 m of the NLO in all 15 cells; its Kalman "
        "filter adds little to the observer.",
        "Table 1",
        f"the mean difference of RMSE is within {NEAR:g} m (whole 95 % interval) of the NLO of the "
        f"same reading; {BY_READING}",
        {"xkf": by_reading("12 as the NLO")},
        "{xkf}. Median of the mean differences {own:.2g} m; RMSE in the north, {ratios}. "
        "With 15 states the differences are {full:.2g} m",
        "Table 1 redrawn",
        {
            "own": over(TABLES, median_difference, XKF, NLO),
            "ratios": over(TABLES, list_ratios, "north_rmse_m", XKF, NLO),
            "full": over(TABLES, median_difference, FULL, NLO),
        },
        kind=kinds.MOSTLY,
        answer="As printed the mean difference between XKF and NLO has a median of {own:.2g} m over "
        "the cells.",
    ),
    "inherits_stability": Claim(
        "The XKF inherits the global stability of the observer.",
        "1, after Johansen & Fossen (2017)",
        f"from 170 deg of attitude error about a random axis and 0.05 rad/s of gyro bias, below "
        f"{BELOW:g} deg within {WITHIN:g} s and to their end\nreproduced where NLO and XKF converge "
        f"from {SURE:.0%} of the starts or more, not reproduced where the XKF does from fewer than "
        f"the NLO (Wilson's intervals apart), else not decidable; {BY_READING}, and for both forms "
        "with 15 states",
        {"forms": by_reading("13 stability"), "fifteen": over(CONVERGED, of_fifteen)},
        "{forms}; with 15 states: {fifteen}",
        'table "Starts 170 deg off"',
        {"shown": over(CONVERGED, as_stable_as, PRINTED)},
        answer="Of starts from 170 deg come home: {shown}; with 15 states {fifteen}.",
    ),
    "no_guarantee": Claim(
        "The EKF has no guarantee of stability.",
        "Abstract; 1",
        "the same starts: those from which the two-stage EKF does not converge. That it always did "
        "would be no proof of the contrary",
        {"ekf": by_reading("14 no guarantee")},
        "does not come home: {ekf}",
        'table "Starts 170 deg off"',
        {"one": over(CONVERGED, fails, PRINTED)},
        kind=kinds.SOMETIMES,
        answer="The two-stage EKF as printed does not come home from {one} starts.",
    ),
    "because_of_bias": Claim(
        "The EKF diverges because its estimate of the accelerometer bias is not stabilised.",
        "4",
        f"at the end of a simulated outage the EKF is more than {TWICE:g} times as far off "
        f"horizontally as the XKF, and as itself with its accelerometer bias stabilised, a constant to "
        f"be estimated: reproduced; not reproduced where that surely gains less, or the EKF is surely nearer; {BY_READING}",
        {"bias": by_reading("15 bias")},
        "The EKF's horizontal error: {bias}",
        'table "All filters"',
        {"one": over(TABLES, explained_by_bias, PRINTED)},
        kind=kinds.EXPLANATION,
        answer="As printed the EKF's error is {one}.",
    ),
    "velocity_injected": Claim(
        "Injecting the velocity is not essential to stability, but increases the performance.",
        "2.1.4",
        "simulated cells in which the observer with constant gains is better with velocities "
        "injected than with gains designed for positions alone; both have the course",
        {"cells": over(TABLES, injection_helps)},
        "{cells}",
        'table "Ablations"',
        kind=kinds.MOSTLY,
        answer="With the velocity injected the observer is better: {cells}.",
    ),
    "constant_gains": Claim(
        "The gains can be chosen constant without issue to the stability of the observer.",
        "2.1.4",
        f"the starts of claim 13, with the gains that the design settles to held from the first fix: "
        f"reproduced where {SURE:.0%} or more come home, not reproduced where surely fewer do",
        {"starts": over(CONVERGED, constant_suffices)},
        "{starts}",
        'table "Starts 170 deg off"',
        answer="{starts} starts from 170 deg come home.",
    ),
    "cheaper": Claim(
        "An observer costs less computation than a Kalman filter.",
        "1",
        "the observer's equations alone, without our covariance, and the two-stage EKF on the same "
        "samples and fixes, in turns: reproduced where its slowest repetition is faster than the "
        "EKF's fastest, not reproduced the other way round",
        {"times": over(COSTS, cheaper)},
        "{times}",
        'table "Seconds"',
        answer="{times}.",
    ),
}
"""In the order of the paper."""


def claims(evidence: AlamEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
