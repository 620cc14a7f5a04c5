"""What Alam et al. claim of NLO, two-stage EKF and XKF, each claim decided by a rule from the
tables of runs.

The rules were written before any of the filters had run on the simulated flight. Corrected after a
review, before the full study: some_cases, north (Bonferroni's level) and heading_correction (both
filters without course, north against east). Tightened after runs with few seeds: heading_correction
needs two cells. None was changed for its verdict.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import Interval, Paired, paired, proportion

from ..common.claims import Claim, Judged, findings, over
from ..common.pages import UNDECIDED
from ..common.paired_ratios import (
    against,
    any_better,
    difference,
    many_times,
    ratio,
    sides,
    stronger,
)
from ..common.verdicts import MOST, RULE, Count, both, counted, decided, share_of_runs
from .convergence import BELOW, WITHIN
from .runs import AXES, EKF, EKF_NO_COURSE, FULL, NLO, TURN_ON, XKF, XKF_NO_COURSE
from .table1 import OUTAGES, listed, published_least, published_times, published_wins, won

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
BY_CHOICE = (
    "Largely a consequence of a choice made here: stage 2 of xkf-two-stage is driven by the "
    "observer's attitude, so that in an outage its "
    "position drifts with the observer's; it is no independent evidence on what a Kalman filter "
    "adds"
)
DEGREES = float(np.degrees(1.0))
SHOWN = (EKF, NLO, XKF, FULL)
CELLS = (
    "A cell is an axis in one of the five simulated outages over all seeds, in thor75 or in "
    "drive0708; a filter is better where the 95 % "
    "interval of the ratio of RMSEs lies below 1 by more than 1 %"
)
ONE_OF_MANY = "where one cell is enough, that it is better is decided at Bonferroni's level of all these cells, 1 - 0.05 / cells"


Tables: TypeAlias = dict[str, pd.DataFrame]
"""{case: table} of table1.wide: the simulated outages and the recordings."""


class Evidence(NamedTuple):
    """All that the claims rest on."""

    tables: Tables
    biases: pd.DataFrame
    converged: pd.DataFrame  # of convergence.study


TABLES, BIASES, CONVERGED = map(attrgetter, Evidence._fields)


def once(tables: Tables, measures: Sequence[str], first: str, others: Sequence[str]) -> Judged:
    """One cell in which filter `first` is better than every one of `others` is enough."""
    count = any_better(tables, measures, first, others)
    return Judged(decided(count.supports > 0, 0 < count.total == count.contradicts), str(count))


def no_clear_benefit(
    tables: Tables, measures: Sequence[str], first: str, others: Sequence[str]
) -> Judged:
    """Filter `first` cannot be better than every one of `others` in MOST of the cells."""
    count = against(tables, measures, first, others)
    low, high = count.shares
    known = count.total > 0
    return Judged(decided(known and high < MOST, known and low >= MOST), str(count))


def each_sometimes(tables: Tables, measures: Sequence[str], first: str, second: str) -> Judged:
    """Sometimes one filter and sometimes the other is better; the text is of the first."""
    pairs = (first, [second]), (second, [first])
    own, other = (against(tables, measures, *pair) for pair in pairs)
    mixed = all(any_better(tables, measures, *pair).supports > 0 for pair in pairs)
    never = any(
        one.supports == 0 and two.contradicts == two.total
        for one, two in ((own, other), (other, own))
    )
    few, many = sorted((own.supports, other.supports))
    one_sided = never or (few == 0 and many >= MOST * own.total)
    return Judged(decided(mixed, own.total > 0 and one_sided), str(own))


def explained_by_course(tables: Tables) -> Judged:
    """Where the EKF is better in the north its course explains that."""
    wins = {
        case: table
        for case, table in tables.items()
        if ratio(table, "north_rmse_m", EKF, XKF).side == 1
    }
    count = counted(map(_explained, wins.values()))
    return Judged(
        count.verdict if count.total >= ENOUGH else UNDECIDED,
        f"EKF better in the north in {len(wins)} of {len(tables)} cases "
        f"({', '.join(wins) or 'none'}); its course explains that: {count}",
    )


def _explained(table: pd.DataFrame) -> int:
    """Of a case in which the EKF is better in the north: 1 where its course explains that, -1
    where it is so without it, 0 where that is open."""
    side = ratio(table, "north_rmse_m", EKF_NO_COURSE, XKF_NO_COURSE).side
    lost = stronger(table, "north_rmse_m", "east_rmse_m", EKF_NO_COURSE, XKF_NO_COURSE, EKF, XKF)
    return -1 if side == 1 else int(side == -1 and lost.low > 0)


def from_the_observer(tables: Tables, name: str) -> list[Paired]:
    """Mean differences of RMSE between a filter and the NLO, of all cells."""
    return [difference(table, measure, name, NLO) for table in tables.values() for measure in RMSE]


def near_the_observer(tables: Tables, name: str) -> Count:
    """Count of the cells in which a filter is within NEAR of the NLO."""
    return counted(
        int(-NEAR <= each.low and each.high <= NEAR) - int(each.low > NEAR or each.high < -NEAR)
        for each in from_the_observer(tables, name)
    )


def median_difference(tables: Tables, name: str) -> float:
    """Median of the mean differences from the NLO, m."""
    found = [abs(each.difference) for each in from_the_observer(tables, name)]
    return float(np.median(found or [np.nan]))


def wanders_twice_as_much(biases: pd.DataFrame, column: str) -> Judged:
    """A column of the biases is on average more than TWICE as large with the EKF as with the
    XKF."""
    table = biases.pivot_table(index="seed", columns="filter", values=column, sort=False)
    known = {EKF, XKF} <= set(table.columns)
    found = paired(*(np.log(table[name]) if known else [] for name in (EKF, XKF)))
    value, low, high = np.exp([found.difference, found.low, found.high])
    return Judged(decided(low > TWICE, high < TWICE), f"{value:.3g} ({low:.3g} to {high:.3g})")


def unsteady(biases: pd.DataFrame, name: str, sensor: str) -> Count:
    """The bias estimates of a filter wander more than STEADY at last, in more than half of the
    seeds, which are one cell."""
    values = biases.loc[biases["filter"] == name, f"{sensor}_wander_late"]
    return share_of_runs([(int((values > STEADY[sensor]).sum()), len(values))])


def steady(biases: pd.DataFrame, name: str, sensor: str) -> Count:
    """The contrary of `unsteady`."""
    return unsteady(biases, name, sensor).opposite


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


def as_stable_as(converged: pd.DataFrame, observer: str) -> Judged:
    """Both forms of the XKF converge from nearly all starts, as the observer does."""
    bound, text = starts(converged, observer)
    forms = [label for label in dict.fromkeys(converged["case"]) if label.startswith("XKF")]
    shares, texts = zip(*(starts(converged, label) for label in forms)) if forms else ((), ())
    verdicts = (
        decided(min(own.value, bound.value) >= SURE, own.high < bound.low) for own in shares
    )
    return Judged(both(*verdicts), "; ".join((text, *texts)))


def not_stable(converged: pd.DataFrame, label: str) -> Judged:
    """A filter does not converge from nearly all starts."""
    share, text = starts(converged, label)
    return Judged(decided(share.high < SURE, share.value >= SURE), text)


ON_AXIS = "{xkf}; {ratios}; {won}. With 15 states: {full}"


def on_axis(measure: str) -> dict[str, Callable[[Evidence], object]]:
    """What ON_AXIS shows beside the cells of XKF against EKF."""
    return {
        "ratios": over(TABLES, listed, measure, XKF, EKF),
        "won": over(TABLES, won, measure, XKF, EKF),
        "full": over(TABLES, sides, [measure], FULL, EKF),
    }


CLAIMS = {
    "some_cases": Claim(
        "During the outage of GNSS, in some cases the divergence of position estimates using XKF is "
        "lower than with EKF and NLO.",
        "Abstract",
        f"in one cell or more the XKF is better than both; {CELLS}; {ONE_OF_MANY}",
        {"xkf": over(TABLES, once, RMSE, XKF, (EKF, NLO))},
        "{xkf}. With 15 states: {full}",
        "figure 3",
        {"full": over(TABLES, once, RMSE, FULL, (EKF, NLO))},
    ),
    "no_clear_benefit": Claim(
        "No clear benefit is achieved: there is no clear evidence that XKF globally improves the "
        "estimates.",
        "Abstract; 4",
        f"a clear benefit would be an XKF better than both EKF and NLO, horizontally and down, in "
        f"{MOST:.0%} of the cells or more; "
        f"reproduced where it cannot be that many, not reproduced where it is",
        {
            "xkf": over(
                TABLES, no_clear_benefit, ("horizontal_rmse_m", "down_rmse_m"), XKF, (EKF, NLO)
            )
        },
        "Better than both: {xkf}",
        "figure 3",
    ),
    "diverges_rapidly": Claim(
        "Without GNSS the position and velocity estimates of the EKF diverge rapidly, those of the "
        "XKF slowly.",
        "4",
        f"at the end of the outage the EKF is at least {TWICE:g} times as far off as the XKF (whole "
        f"95 % interval), horizontally and "
        f"in velocity; {RULE}; both parts must hold",
        {
            "position": over(TABLES, many_times, ["horizontal_end_m"], EKF, XKF, TWICE),
            "velocity": over(TABLES, many_times, ["velocity_end_m_s"], EKF, XKF, TWICE),
        },
        "Position: {position}; {ratios}. Velocity: {velocity}. "
        f"In the published table the horizontal RMSE is {TWICE:g} times as large in "
        f"{published_times(EKF, XKF, TWICE)} of {OUTAGES} outages",
        "figures 2, 4",
        {"ratios": over(TABLES, listed, "horizontal_end_m", EKF, XKF)},
    ),
    "biases_vary": Claim(
        "The bias estimates of accelerometers and gyros vary significantly more with the EKF than "
        "with the XKF.",
        "4",
        f"the standard deviation over time of the estimates, from 600 s to the touchdown, is more "
        f"than {TWICE:g} times the XKF's "
        f"(geometric mean over the seeds, whole 95 % interval); {LOST}; both sensors must hold",
        {
            "accel": over(BIASES, wanders_twice_as_much, "accel_wander"),
            "gyro": over(BIASES, wanders_twice_as_much, "gyro_wander"),
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
        },
    ),
    "biases_stabilised": Claim(
        "Biases do not vary as fast as the EKF estimates them: its bias estimation is not "
        "stabilised, the XKF's is.",
        "4; 5",
        "the estimates' standard deviation over the last ten minutes of the flight is above a fifth "
        "of the turn-on biases with the "
        f"EKF and below it with the XKF, in more than half of the seeds (Wilson), for both sensors; "
        f"{LOST}; all four parts must hold",
        {
            "ekf_accel": over(BIASES, unsteady, EKF, "accel"),
            "xkf_accel": over(BIASES, steady, XKF, "accel"),
            "ekf_gyro": over(BIASES, unsteady, EKF, "gyro"),
            "xkf_gyro": over(BIASES, steady, XKF, "gyro"),
        },
        f"accelerometers, bound {STEADY['accel']:.2g} m/s²: {{accels}}; "
        f"gyros, bound {np.degrees(STEADY['gyro']):.2g} deg/s: {{gyros}}; {{runs}}",
        'figures 4b, 4e; table "Wander of the bias estimates"',
        {
            "accels": over(BIASES, medians, "accel_wander_late"),
            "gyros": over(BIASES, medians, "gyro_wander_late", DEGREES),
            "runs": over(BIASES, lost_runs),
        },
    ),
    "east": Claim(
        "In the easterly direction the XKF is always better than the EKF.",
        "4; Table 1",
        f"{CELLS}; {RULE}",
        {"xkf": over(TABLES, sides, ["east_rmse_m"], XKF, EKF)},
        f"{ON_AXIS}. Published: {published_wins('east')} outages",
        "figure 3",
        on_axis("east_rmse_m"),
    ),
    "down": Claim(
        "In the downward direction the XKF is always better than the EKF.",
        "4; its Table 1 contradicts it in outages 1 and 5",
        f"{CELLS}; {RULE}",
        {"xkf": over(TABLES, sides, ["down_rmse_m"], XKF, EKF)},
        f"{ON_AXIS}. Published: {published_wins('down')} outages",
        "figure 3",
        on_axis("down_rmse_m"),
    ),
    "north": Claim(
        "In the north direction sometimes the EKF and sometimes the XKF is better.",
        "4; 5",
        f"one cell or more in which the XKF is better and one in which the EKF is; not reproduced "
        f"where one of them never is, or "
        f"three quarters of the cells go to one and none to the other; {CELLS}; {ONE_OF_MANY}",
        {"xkf": over(TABLES, each_sometimes, ["north_rmse_m"], XKF, EKF)},
        f"{ON_AXIS}. EKF better: {{ekf.supports}} of {{ekf.total}}. "
        f"Published: XKF {published_wins('north')} outages",
        "figure 3",
        on_axis("north_rmse_m") | {"ekf": over(TABLES, sides, ["north_rmse_m"], EKF, XKF)},
    ),
    "overall": Claim(
        "Overall the XKF performs better in GNSS outages than EKF and NLO alone.",
        "4; the paper also says that there is no clear evidence",
        f"all axes, against the EKF and against the NLO; {CELLS}; {RULE}; both parts must hold",
        {"ekf": over(TABLES, sides, RMSE, XKF, EKF), "nlo": over(TABLES, sides, RMSE, XKF, NLO)},
        "Against the EKF: {ekf}. Against the NLO: {nlo}",
        "figure 3",
    ),
    "heading_correction": Claim(
        "The north results might be due to the heading correction of the EKF from the GNSS "
        "velocity.",
        "4 (a guess of the authors)",
        f"where the EKF is better than the XKF in the north, it surely no longer is when neither "
        f"has a course measurement, and "
        f"it loses more against the XKF in the north than in the east (whole 95 % interval of the "
        f"difference of log ratios): supports; "
        f"still better without: contradicts; else open; not decidable where it is better in fewer "
        f"than {ENOUGH} cells; {RULE}",
        {"course": over(TABLES, explained_by_course)},
        "{course}. The ratios of both without course are in the table",
        'table "Ablations"',
    ),
    "least": Claim(
        "The XKF diverges the least in east and down position of EKF, NLO and XKF.",
        "5",
        f"east and down cells in which the XKF is better than both; {CELLS}; {RULE}",
        {"xkf": over(TABLES, against, ("east_rmse_m", "down_rmse_m"), XKF, (EKF, NLO))},
        f"{{xkf}}. Published: {published_least('east', 'down')} of 10 cells",
        "figure 3",
    ),
    "like_the_observer": Claim(
        "(Read off Table 1, not said:) the XKF is within 2 m of the NLO in all 15 cells; its Kalman "
        "filter adds little to the observer.",
        "Table 1",
        f"the mean difference of RMSE is within {NEAR:g} m (whole 95 % interval); {RULE}",
        {"xkf": over(TABLES, near_the_observer, XKF)},
        "{xkf}. Median of the mean differences {own:.2g} m; RMSE in the north, {ratios}. "
        f"With 15 states the differences are {{full:.2g}} m. {BY_CHOICE}",
        "Table 1 redrawn",
        {
            "own": over(TABLES, median_difference, XKF),
            "ratios": over(TABLES, listed, "north_rmse_m", XKF, NLO),
            "full": over(TABLES, median_difference, FULL),
        },
    ),
    "inherits_stability": Claim(
        "The XKF inherits the global stability of the observer.",
        "1, after Johansen & Fossen (2017)",
        f"from 170 deg of attitude error about a random axis and 0.05 rad/s of gyro bias, below "
        f"{BELOW:g} deg within {WITHIN:g} s "
        f"and to their end: reproduced where NLO and XKF converge from 97 % of the starts or more, "
        f"not reproduced where the XKF does "
        f"from fewer than the NLO (Wilson's intervals apart); both forms of the XKF must hold",
        {"forms": over(CONVERGED, as_stable_as, "NLO, tilt-compensated course")},
        "{forms}",
        'table "Starts 170 deg off"',
    ),
    "no_guarantee": Claim(
        "The EKF has no guarantee of stability.",
        "Abstract; 1",
        "the same starts: reproduced where the two-stage EKF converges from fewer than 97 % "
        "(Wilson's interval below); not reproduced "
        "where it does from that many, which is no proof of the contrary",
        {"ekf": over(CONVERGED, not_stable, "two-stage EKF")},
        "{ekf}",
        'table "Starts 170 deg off"',
    ),
}
"""In the order of the paper."""


def claims(evidence: Evidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
