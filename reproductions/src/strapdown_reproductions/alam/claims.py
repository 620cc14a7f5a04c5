"""Claims of Alam et al. on NLO, two-stage EKF and XKF, each decided by the rule of its kind from
the tables of runs.

A claim about NLO or XKF is judged for every reading of what the paper leaves open (runs.READINGS);
where they contradict each other the reading decides. The rules were written before any run of the
seeds that they judge.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import Interval, Paired, paired_comparison, proportion
from strapdown.experiments.outages.summaries import over_blocks

from ..common import kinds
from ..common.claims import Claim, JudgedClaim, findings, over
from ..common.kinds import Share, clustered
from ..common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from ..common.paired_ratios import better, difference, ratio, stronger
from ..common.verdicts import both, counted, decided, over_readings
from .convergence import BELOW, WITHIN
from .runs import (
    AXES,
    EKF,
    EKF_NO_COURSE,
    FULL,
    NLO,
    READINGS,
    TURN_ON,
    XKF,
    XKF_NO_COURSE,
)
from .table1 import OUTAGES, listed, published_least, published_times, published_wins

RMSE = tuple(f"{axis}_rmse_m" for axis in AXES)
TWICE = 2.0
"""\"Diverges rapidly\", \"varies significantly more\": at least this many times as far, this many
times as much."""
STEADY = {sensor: 0.2 * size for sensor, size in TURN_ON.items()}
"""m/s^2 and rad/s: a fifth of the turn-on biases of the IMU; a bias estimate that wanders less
over the last ten minutes is stabilised."""
LOST = "a run that stops or diverges counts with 100 times the turn-on biases"
ENOUGH = 2
"""Cells in which the EKF is better in the north that its explanation is judged with: one alone
may be chance."""
NEAR = 2.0
"""m: by how much XKF and NLO differ at most in the published Table 1."""
SURE = 0.97
"""Share of the starts from which a filter converges that is stable."""
DEGREES = float(np.degrees(1.0))
SHOWN = (EKF, NLO, XKF, FULL)
CELLS = (
    "a cell is an axis in one of the five simulated outages over all seeds, in thor75 or in "
    "drive0708; a filter is better where the interval of the ratio of RMSEs lies below 1 by more "
    "than 1 %"
)
BY_READING = "for each reading of the XKF"


Tables: TypeAlias = dict[str, pd.DataFrame]
"""{case: table} of table1.wide: the simulated outages and the recordings."""


class AlamEvidence(NamedTuple):
    """All that the claims rest on."""

    tables: Tables
    biases: pd.DataFrame
    converged: pd.DataFrame  # of convergence.study


TABLES, BIASES, CONVERGED = map(attrgetter, AlamEvidence._fields)


def over_all(tables: Tables, judge: Callable[..., JudgedClaim], *args: object) -> JudgedClaim:
    """`judge(tables, nlo, xkf, *args)` of every reading, and their verdict together."""
    found = {name: judge(tables, *pair, *args) for name, pair in READINGS.items()}
    text = "; ".join(f"{name}: {each} ({each.verdict})" for name, each in found.items())
    return JudgedClaim(over_readings(*(each.verdict for each in found.values())), text)


def simulated(tables: Tables) -> Tables:
    """The outages of the simulated flight."""
    return {case: table for case, table in tables.items() if case.startswith("outage ")}


def won(tables: Tables, measure: str, first: str, *others: str) -> Share:
    """Share of the single simulated outages in which the measure of filter `first` is smaller than
    that of every one of `others`."""
    by_seed: dict[int, list[bool]] = {}
    for table in simulated(tables).values():
        if not {(measure, name) for name in (first, *others)} <= set(table.columns):
            continue
        own = table[measure]
        smaller = np.all([own[first] < own[other] for other in others], axis=0)
        for block, wins in zip(table.index.get_level_values("block"), smaller):
            by_seed.setdefault(block, []).append(bool(wins))
    return clustered((sum(each), len(each)) for each in by_seed.values())


def in_some(tables: Tables, nlo: str, xkf: str) -> JudgedClaim:
    """In some outages the XKF is better than EKF and NLO."""
    return kinds.sometimes(won(tables, "horizontal_rmse_m", xkf, EKF, nlo))


def no_benefit(tables: Tables, nlo: str, xkf: str) -> JudgedClaim:
    """Not mostly better than both."""
    mostly = kinds.mostly(better(tables, ("horizontal_rmse_m", "down_rmse_m"), xkf, EKF, nlo))
    opposite = {REPRODUCED: NOT_REPRODUCED, NOT_REPRODUCED: REPRODUCED}
    return mostly._replace(verdict=opposite.get(mostly.verdict, mostly.verdict))


def farther(tables: Tables, nlo: str, xkf: str, measure: str) -> JudgedClaim:
    """At the end of a simulated outage the EKF is more than TWICE as far off as the XKF."""
    by_case = [
        np.log(table[measure][EKF] / table[measure][xkf]).groupby("block").mean()
        for table in simulated(tables).values()
        if {(measure, EKF), (measure, xkf)} <= set(table.columns)
    ]
    if not by_case:
        return JudgedClaim(UNDECIDED, "no outage")
    by_seed = pd.concat(by_case, axis=1).mean(axis=1)
    found = over_blocks(by_seed.to_numpy(), by_seed.index.to_numpy())
    value, low, high = np.exp(found[:3])
    return kinds.more_than(low, high, TWICE, f"{value:.3g} ({low:.3g} to {high:.3g})")


def always_better(tables: Tables, nlo: str, xkf: str, measure: str) -> JudgedClaim:
    """The XKF is better than the EKF in every cell."""
    return kinds.always(better(tables, [measure], xkf, EKF))


def each_sometimes(tables: Tables, nlo: str, xkf: str, measure: str) -> JudgedClaim:
    """Sometimes the XKF and sometimes the EKF is better."""
    return kinds.one_or_the_other(won(tables, measure, xkf, EKF))


def overall(tables: Tables, nlo: str, xkf: str) -> JudgedClaim:
    """Over all cells the XKF is better than the EKF, and than the NLO."""
    found = [kinds.mostly(better(tables, RMSE, xkf, other)) for other in (EKF, nlo)]
    text = f"against the EKF {found[0]}, against the NLO {found[1]}"
    return JudgedClaim(both(*(each.verdict for each in found)), text)


def least(tables: Tables, nlo: str, xkf: str) -> JudgedClaim:
    """In most east and down cells the XKF is better than both."""
    return kinds.mostly(better(tables, ("east_rmse_m", "down_rmse_m"), xkf, EKF, nlo))


def like_the_observer(tables: Tables, nlo: str, xkf: str) -> JudgedClaim:
    """In most cells the XKF is within NEAR of the NLO."""
    found = from_the_observer(tables, xkf, nlo)
    votes = [
        int(-NEAR <= each.low and each.high <= NEAR) - int(each.low > NEAR or each.high < -NEAR)
        for each in found
    ]
    return kinds.mostly(lambda confidence: votes)


def explained_by_course(tables: Tables) -> JudgedClaim:
    """Where the EKF is better in the north its course explains that."""
    wins = {
        case: table
        for case, table in tables.items()
        if ratio(table, "north_rmse_m", EKF, XKF).side == 1
    }
    judged = kinds.mostly(lambda confidence: [_explained(table) for table in wins.values()])
    return JudgedClaim(
        judged.verdict if len(wins) >= ENOUGH else UNDECIDED,
        f"EKF better in the north in {len(wins)} of {len(tables)} cases "
        f"({', '.join(wins) or 'none'}); its course explains that: {judged}",
    )


def _explained(table: pd.DataFrame) -> int:
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


def of_readings(
    biases: pd.DataFrame, judge: Callable[..., JudgedClaim], column: str
) -> JudgedClaim:
    """`judge(biases, xkf, column)` of the XKF of every reading, and their verdict together."""
    found = [judge(biases, xkf, column) for _, xkf in READINGS.values()]
    text = "; ".join(f"{name}: {each}" for name, each in zip(READINGS, found))
    return JudgedClaim(over_readings(*(each.verdict for each in found)), text)


def wanders_twice_as_much(biases: pd.DataFrame, xkf: str, column: str) -> JudgedClaim:
    """A column of the biases is on average more than TWICE as large with the EKF as with an
    XKF."""
    table = biases.pivot_table(index="seed", columns="filter", values=column, sort=False)
    known = {EKF, xkf} <= set(table.columns)
    found = paired_comparison(*(np.log(table[name]) if known else [] for name in (EKF, xkf)))
    value, low, high = np.exp([found.difference, found.low, found.high])
    return kinds.more_than(low, high, TWICE, f"{value:.3g} ({low:.3g} to {high:.3g})")


def unsteady(biases: pd.DataFrame, name: str, sensor: str) -> JudgedClaim:
    """The bias estimates of a filter wander more than STEADY at last in most seeds."""
    return kinds.mostly_of(_unsteady(biases, name, sensor))


def steady(biases: pd.DataFrame, name: str, sensor: str) -> JudgedClaim:
    """The contrary of `unsteady`."""
    return kinds.mostly_of(_unsteady(biases, name, sensor).opposite)


def _unsteady(biases: pd.DataFrame, name: str, sensor: str) -> Share:
    values = biases.loc[biases["filter"] == name, f"{sensor}_wander_late"]
    return clustered((int(value > STEADY[sensor]), 1) for value in values)


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
    """Interval of the share of starts of a case of convergence.py that converge, and the Text
    of its count."""
    own = converged[converged["case"] == label]
    good = int(np.isfinite(own["since_s"]).sum())
    return proportion(good, len(own)), f"{label} {good} of {len(own)}"


def as_stable_as(converged: pd.DataFrame, observer: str) -> JudgedClaim:
    """Both forms of the XKF converge from nearly all starts, as the observer does."""
    bound, text = starts(converged, observer)
    forms = [label for label in dict.fromkeys(converged["case"]) if label.startswith("XKF")]
    shares, texts = zip(*(starts(converged, label) for label in forms)) if forms else ((), ())
    verdicts = (
        decided(min(own.value, bound.value) >= SURE, own.high < bound.low) for own in shares
    )
    return JudgedClaim(both(*verdicts), "; ".join((text, *texts)))


def fails(converged: pd.DataFrame, label: str) -> JudgedClaim:
    """From some starts a filter does not converge."""
    own = converged[converged["case"] == label]
    return kinds.sometimes(clustered((int(~np.isfinite(since)), 1) for since in own["since_s"]))


def shown_share(tables: Tables, measure: str) -> str:
    """Text: in which share of the single simulated outages the XKF as printed is better than the
    EKF."""
    return str(won(tables, measure, XKF, EKF))


def share_of(tables: Tables, measure: str, *others: str) -> str:
    """Text: the same in per cent alone, better than all `others`."""
    share = won(tables, measure, XKF, *others)
    return f"{share.value:.0%} of {share.trials}"


def number_of(tables: Tables, measures: Sequence[str], first: str, *others: str) -> str:
    """Text: in how many cells the first filter is better than all `others`."""
    votes = better(tables, measures, first, *others)(kinds.CONFIDENCE)
    return f"{votes.count(1)} of {len(votes)}"


def shown_full(tables: Tables, measures: Sequence[str], *others: str) -> str:
    """Text: count of the cells in which the XKF with 15 states is better."""
    return str(counted(better(tables, measures, FULL, *others)(kinds.CONFIDENCE)))


ON_AXIS = (
    "{xkf}. As printed {ratios}; XKF smaller in {won} of the single outages. With 15 states: {full}"
)


def on_axis(measure: str) -> dict[str, Callable[[AlamEvidence], object]]:
    """Return the values that ON_AXIS shows beside the readings of XKF against EKF."""
    return {
        "ratios": over(TABLES, listed, measure, XKF, EKF),
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
        {"xkf": over(TABLES, over_all, in_some)},
        "{xkf}. Cells of all axes with 15 states: {full}",
        "figure 3",
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
        f"more than half of the cells: that decides, the other way round, {BY_READING}; {CELLS}",
        {"xkf": over(TABLES, over_all, no_benefit)},
        "Better than both: {xkf}",
        "figure 3",
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
            "position": over(TABLES, over_all, farther, "horizontal_end_m"),
            "velocity": over(TABLES, over_all, farther, "velocity_end_m_s"),
        },
        "Position: {position}. As printed {ratios}. Velocity: {velocity}. "
        f"In the published table the horizontal RMSE is {TWICE:g} times as large in "
        f"{published_times(EKF, XKF, TWICE)} of {OUTAGES} outages",
        "figures 2, 4",
        {
            "ratios": over(TABLES, listed, "horizontal_end_m", EKF, XKF),
            "printed": over(TABLES, farther, NLO, XKF, "horizontal_end_m"),
        },
        kind=kinds.MORE_THAN,
        answer="At the end of an outage the EKF is {printed} times as far off as the XKF as printed.",
    ),
    "biases_vary": Claim(
        "The bias estimates of accelerometers and gyros vary significantly more with the EKF than "
        "with the XKF.",
        "4",
        f"the standard deviation over time of the estimates, from 600 s to the touchdown, is more "
        f"than {TWICE:g} times the XKF's (geometric mean over the seeds), for every XKF with two "
        f"stages; {LOST}; both sensors must hold",
        {
            "accel": over(BIASES, of_readings, wanders_twice_as_much, "accel_wander"),
            "gyro": over(BIASES, of_readings, wanders_twice_as_much, "gyro_wander"),
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
            "one": over(BIASES, wanders_twice_as_much, XKF, "accel_wander"),
            "two": over(BIASES, wanders_twice_as_much, XKF, "gyro_wander"),
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
        "of the turn-on biases with the EKF and below it with every XKF with two stages, in most "
        f"seeds, for both sensors; {LOST}; all four parts must hold",
        {
            "ekf_accel": over(BIASES, unsteady, EKF, "accel"),
            "xkf_accel": over(BIASES, of_readings, steady, "accel"),
            "ekf_gyro": over(BIASES, unsteady, EKF, "gyro"),
            "xkf_gyro": over(BIASES, of_readings, steady, "gyro"),
        },
        f"accelerometers, bound {STEADY['accel']:.2g} m/s²: {{accels}}; "
        f"gyros, bound {np.degrees(STEADY['gyro']):.2g} deg/s: {{gyros}}; {{runs}}",
        'figures 4b, 4e; table "Wander of the bias estimates"',
        {
            "accels": over(BIASES, medians, "accel_wander_late"),
            "gyros": over(BIASES, medians, "gyro_wander_late", DEGREES),
            "runs": over(BIASES, lost_runs),
        },
        kind=kinds.MOSTLY,
        answer="The EKF's estimates are not steady in {ekf_accel} seeds for accelerometers and in "
        "{ekf_gyro} for gyros.",
    ),
    "east": Claim(
        "In the easterly direction the XKF is always better than the EKF.",
        "4; Table 1",
        f"{CELLS}; {BY_READING}",
        {"xkf": over(TABLES, over_all, always_better, "east_rmse_m")},
        f"{ON_AXIS}. Published: {published_wins('east')} outages",
        "figure 3",
        on_axis("east_rmse_m"),
        kind=kinds.ALWAYS,
        answer="In the east the XKF as printed is better than the EKF in {cells} cells, and in {won} "
        "single outages.",
    ),
    "down": Claim(
        "In the downward direction the XKF is always better than the EKF.",
        "4; its Table 1 contradicts it in outages 1 and 5",
        f"{CELLS}; {BY_READING}",
        {"xkf": over(TABLES, over_all, always_better, "down_rmse_m")},
        f"{ON_AXIS}. Published: {published_wins('down')} outages",
        "figure 3",
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
        {"xkf": over(TABLES, over_all, each_sometimes, "north_rmse_m")},
        f"{ON_AXIS}. Published: XKF {published_wins('north')} outages",
        "figure 3",
        on_axis("north_rmse_m"),
        kind=kinds.ONE_OR_THE_OTHER,
        answer="In the north the XKF as printed is better than the EKF in {won} single outages.",
    ),
    "overall": Claim(
        "Overall the XKF performs better in GNSS outages than EKF and NLO alone.",
        "4; the paper also says that there is no clear evidence",
        f"all axes, against the EKF and against the NLO; {CELLS}; {BY_READING}; both parts must "
        "hold",
        {"xkf": over(TABLES, over_all, overall)},
        "{xkf}",
        "figure 3",
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
        f"the east (whole interval of the difference of log ratios): supports; still better without: "
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
        {"xkf": over(TABLES, over_all, least)},
        f"{{xkf}}. Published: {published_least('east', 'down')} of 10 cells",
        "figure 3",
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
        {"xkf": over(TABLES, over_all, like_the_observer)},
        "{xkf}. Median of the mean differences {own:.2g} m; RMSE in the north, {ratios}. "
        "With 15 states the differences are {full:.2g} m",
        "Table 1 redrawn",
        {
            "own": over(TABLES, median_difference, XKF, NLO),
            "ratios": over(TABLES, listed, "north_rmse_m", XKF, NLO),
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
        f"{BELOW:g} deg within {WITHIN:g} s and to their end: reproduced where NLO and XKF converge "
        f"from {SURE:.0%} of the starts or more, not reproduced where the XKF does from fewer than "
        f"the NLO (Wilson's intervals apart), else not decidable; every form of the XKF must hold",
        {"forms": over(CONVERGED, as_stable_as, "NLO, tilt-compensated course")},
        "{forms}",
        'table "Starts 170 deg off"',
        answer="{forms} starts from 170 deg come home.",
    ),
    "no_guarantee": Claim(
        "The EKF has no guarantee of stability.",
        "Abstract; 1",
        "the same starts: those from which the two-stage EKF does not converge. That it always did "
        "would be no proof of the contrary",
        {"ekf": over(CONVERGED, fails, "two-stage EKF")},
        "does not come home: {ekf}",
        'table "Starts 170 deg off"',
        kind=kinds.SOMETIMES,
        answer="The two-stage EKF does not come home from {ekf} starts.",
    ),
}
"""In the order of the paper."""


def claims(evidence: AlamEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
