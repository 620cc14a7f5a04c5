"""What Hager & Bryne claim, each claim decided by a rule from the tables of cells.py;
nothing here runs a filter."""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import paired

from ..common.claims import Claim, Judged, findings, judge, over
from ..common.verdicts import (
    CLOSED,
    OPEN,
    READINGS,
    SIZE,
    Count,
    apart,
    counted,
    decided,
    over_readings,
    ratios,
    share,
    sides,
    total,
)
from .cells import EARLY, ONSET, RESOLVED

CONSUMER, TACTICAL, NAVIGATION = GRADES = ("consumer", "tactical", "navigation")
SHORT, LONG = tuple(f"{i:02d}" for i in range(1, 7)), tuple(f"{i:02d}" for i in range(7, 12))
STRAIGHT = "07"
TOO_SURE = 1.1
"""A filter is called inconsistent where the interval of its typical NEES/15 lies above this: too
sure of itself; below 1 it is too careful."""
ABORTS = "by both abort rules, and by the 500 m rule alone"
SMALL_DRIFT = 100.0
"""m of raw INS drift, below which the linearisation should not matter."""
RARELY = 60.0
"""s: resets that are this far apart or further are occasional."""


class Evidence(NamedTuple):
    """All numbers that the claims rest on."""

    flights: pd.DataFrame  # of cells.table
    offset: pd.DataFrame  # the same of the flights with the accelerometer offset, constant
    drift: pd.DataFrame  # flight, grade, run, correlation, small_ratio; see drift.py
    # as `offset`, with the offset as initial value of the bias process; None: not flown
    initial: pd.DataFrame | None = None
    # of the ablation: flight, interval_s, survived(_low, _high), position(_low, _high) reset by
    # closed loop; None: not run
    resets: pd.DataFrame | None = None


FLIGHTS, OFFSET, DRIFT, RESETS = map(attrgetter, ("flights", "offset", "drift", "resets"))


def flown(flights: Sequence[str], *grades: str) -> Callable[[Evidence], pd.DataFrame]:
    """Chooses the cells of flights without offset, of some grades."""
    return lambda e: e.flights[e.flights["grade"].isin(grades) & e.flights["flight"].isin(flights)]


def position(rows: pd.DataFrame, side: str) -> Judged:
    """Filter `side` has the better position, by both readings of the abort rule."""
    counts = [sides(rows, f"position{reading}", side) for reading in READINGS]
    texts = [
        f"{name}: {count} ({ratios(rows, f'position{reading}')})"
        for name, count, reading in zip(
            ("Both abort rules, 500 m counted from the abort on", "500 m alone"), counts, READINGS
        )
    ]
    return Judged(over_readings(*(count.verdict for count in counts)), "; ".join(texts))


def survival(rows: pd.DataFrame, loop: str, more: bool) -> Judged:
    """More than half of the runs of a filter survive, or fewer, by both readings of the abort
    rule."""
    both, alone, strict = (
        share(rows, f"{loop}_survived{reading}", more) for reading in (*READINGS, "_500_in_model")
    )
    return Judged(
        over_readings(both.verdict, alone.verdict),
        f"Both abort rules: {both}; 500 m alone: {alone}; 500 m, and leaving the model counts as "
        f"lost: {strict}",
    )


def biases_better(rows: pd.DataFrame, side: str) -> Count:
    """Count of the cells in which filter `side` has the better biases."""
    return total([sides(rows, name, side) for name in ("accel_bias", "gyro_bias")])


def told(rows: pd.DataFrame, column: str, how: str = "median") -> float:
    """Median, "min" or "max" of a column over the cells."""
    return float(rows[column].agg(how))


def each(rows: pd.DataFrame, form: str, between: str = ", ") -> str:
    """Text: the format string `form` filled with each row r."""
    return between.join(form.format(r=r) for r in rows.itertuples())


def drift_correlates(drift: pd.DataFrame) -> Judged:
    """The rank correlation of drift and ratio of the NEES is above 0.5 on average."""
    p = paired(drift["correlation"].to_numpy(float), np.zeros(len(drift)))
    return Judged(
        decided(p.low > 0.5, p.high < 0.5),
        f"{p.difference:.2f} ({p.low:.2f} to {p.high:.2f}) over {p.count} runs",
    )


def alike_at_small_drift(drift: pd.DataFrame) -> Judged:
    """While the drift is small the NEES of both filters differ by less than TOO_SURE - 1."""
    p = paired(np.log(drift["small_ratio"].to_numpy(float)), np.zeros(len(drift)))
    value, low, high = np.exp([p.difference, p.low, p.high])
    return Judged(
        decided(low > 1 / TOO_SURE and high < TOO_SURE, low > TOO_SURE or high < 1 / TOO_SURE),
        f"{value:.3g} ({low:.3g} to {high:.3g})",
    )


def drift_by_grade(drift: pd.DataFrame) -> str:
    """Text: mean correlation and ratio at small drift of each grade."""
    return "; ".join(
        f"{grade} {part['correlation'].mean():.2f} and "
        f"{np.exp(np.log(part['small_ratio']).mean()):.3g}"
        for grade, part in drift.groupby("grade", sort=False)
    )


def amplified(flights: pd.DataFrame) -> Count:
    """Count over consumer and tactical grade of the straight flights whose open-loop error a
    shorter dynamic one exceeds (supports), or a longer one undercuts (contradicts)."""
    by_cell = {(row["grade"], row["flight"]): row for _, row in flights.iterrows()}
    name, votes = "open_censored_500_m", []
    for grade in (CONSUMER, TACTICAL):
        for flown_as in (("06", STRAIGHT, "08"), ("09", "10", "11")):
            shorter, straight, longer = (by_cell.get((grade, flight)) for flight in flown_as)
            if straight is not None:
                supports = shorter is not None and apart(shorter, straight, name) > 0
                contradicts = longer is not None and apart(longer, straight, name) < 0
                votes.append(int(supports) - int(contradicts))
    return counted(votes)


Beside: TypeAlias = list[tuple[pd.Series, pd.Series]]
"""[(a cell with offset, the one of its grade and flight without)]."""


def with_and_without(e: Evidence) -> Beside:
    """Chooses the cells with offset that were flown without, too."""
    without = {(row["grade"], row["flight"]): row for _, row in e.flights.iterrows()}
    rows = [(row, without.get((row["grade"], row["flight"]))) for _, row in e.offset.iterrows()]
    return [(row, other) for row, other in rows if other is not None]


def sooner(cells: Beside, name: str) -> Count:
    """Count of the cells in which time `name` is shorter with offset (intervals apart)."""
    return counted(-apart(row, without, name) for row, without in cells)


def as_small(cells: Beside, name: str, factor: float) -> Count:
    """Count of the cells in which `name` is at most `factor` times that without offset."""
    return counted(
        int(row[f"{name}_high"] <= factor * without[name])
        - int(row[f"{name}_low"] > factor * without[name])
        for row, without in cells
    )


def against_straight(rows: pd.DataFrame, name: str, sign: int) -> Judged:
    """Over the dynamic flights time `name` is longer (`sign` 1) or shorter (-1) than on the straight
    one of their grade; of one that ends before, only that it is longer is known."""
    votes, texts = [], []
    for grade, part in rows.groupby("grade", sort=False):
        straight, dynamic = (part[(part["flight"] == STRAIGHT) == which] for which in (True, False))
        if len(straight):
            for (_, row), ended in zip(dynamic.iterrows(), unfinished(dynamic, name)):
                vote = apart(row, straight.iloc[0], name)
                votes.append(0 if vote < 0 and ended else sign * vote)
            texts.append(f"{grade}: {times(dynamic, name)}, straight {times(straight, name)}")
    count = counted(votes)
    return Judged(count.verdict, f"{count}" + f". {'; '.join(texts)}" * bool(texts))


def unfinished(rows: pd.DataFrame, name: str) -> pd.Series:
    """Does the flight end before the time is known? Then it is longer than what stands there."""
    return rows[name] >= 0.99 * 60 * rows["minutes"]


def times(rows: pd.DataFrame, name: str) -> str:
    """Text: smallest and largest time of the rows that have one within the flight, and how many
    have not."""
    within = rows.loc[~unfinished(rows, name), name]
    ended, least = len(rows) - len(within), f"{within.min():.0f}"
    span = {0: "", 1: f"{least} s"}.get(len(within), f"{least} to {within.max():.0f} s")
    missing = f"{ended} not within the flight" if len(rows) > 1 else "not within the flight"
    return ", ".join(filter(None, (span, missing * bool(ended))))


def stable_by_resets(resets: pd.DataFrame) -> Judged:
    """One interval of RARELY or more on the longest flight with which runs survive and the
    position is not worse than the closed loop's is enough."""
    rows = resets[(resets["minutes"] == resets["minutes"].max()) & (resets["interval_s"] >= RARELY)]
    good = (rows["survived_low"] > 0.5) & (rows["position_high"] < 1 + SIZE)
    bad = (rows["survived_high"] < 0.5) | (rows["position_low"] > 1 + SIZE)
    form = (
        "every {r.interval_s:.0f} s: {r.survived:.0%} survive, position RMSE {r.position:.4g} times "
        "the closed loop's ({r.position_low:.4g} to {r.position_high:.4g})"
    )
    return Judged(decided(bool(good.any()), bool(bad.all())), each(rows, form, "; "))


def read_twice(claim: Claim) -> Claim:
    """A claim about the offset by both readings of what it is; opposite verdicts mean that what
    the paper leaves open decides."""

    def readings(e: Evidence) -> Judged:
        constant = judge(claim, e)
        if e.initial is None:
            return Judged(constant["verdict"], constant["measured"])
        initial = judge(claim, e._replace(offset=e.initial))
        return Judged(
            over_readings(constant["verdict"], initial["verdict"]),
            f"Constant ({constant['verdict']}): {constant['measured']}. Initial value "
            f"({initial['verdict']}): {initial['measured']}",
        )

    return claim._replace(
        rule=f"{claim.rule}; with the offset read as constant, and as initial value of the bias "
        f"process",
        parts={"readings": readings},
        measured="{readings}",
        shown={},
    )


BIAS_ERROR = "closed_end_accel_bias_m_s2"
CLAIMS = {
    "smooth_fusion": Claim(
        "Open loops give smooth fusion and the best short- to middle-term accuracy with high-end "
        "IMUs.",
        "Abstract; VI",
        f"navigation grade, flights 01-06: open loop better in position, {ABORTS}",
        {"position": over(flown(SHORT, NAVIGATION), position, OPEN)},
        "{position}",
        "figures 2 and 7",
    ),
    "low_drift": Claim(
        "When INS drift is low - higher-grade IMUs and shorter horizons - the open-loop filter "
        "systematically outperforms the "
        "closed loop.",
        "V",
        "as claim 1, for tactical and navigation grade on flights 01-06; both grades must hold",
        {grade: over(flown(SHORT, grade), position, OPEN) for grade in (TACTICAL, NAVIGATION)},
        "Tactical: {tactical}. Navigation: {navigation}",
        "figures 2 and 7",
    ),
    "crossover": Claim(
        "With tactical IMUs the boundary beyond which open loop is worse than closed loop lies "
        "between flights 01-06 and 07-11.",
        "V",
        "as claim 1: open loop better on 01-06 and closed loop better on 07-11",
        {
            "before": over(flown(SHORT, TACTICAL), position, OPEN),
            "after": over(flown(LONG, TACTICAL), position, CLOSED),
        },
        "01-06, open better: {before}. 07-11, closed better: {after}",
        "figures 2 and 7",
    ),
    "consumer_diverges": Claim(
        "For lower-grade IMUs the open loop begins to diverge within a few minutes across most "
        "profiles.",
        "V",
        f"consumer grade: on a flight more than half of the runs have a position error beyond "
        f"{ONSET:g} m before {EARLY:g} s "
        f"(Wilson interval above "
        f"one half)",
        {"early": over(flown(SHORT + LONG, CONSUMER), share, "open_early")},
        "{early}; typical time {least:.0f} to {most:.0f} s; given up by both rules at "
        "{lasted:.0f} s (median)",
        "figure 2, table flights",
        {
            "least": over(flown(SHORT + LONG, CONSUMER), told, "open_onset_s", "min"),
            "most": over(flown(SHORT + LONG, CONSUMER), told, "open_onset_s", "max"),
            "lasted": over(flown(SHORT + LONG, CONSUMER), told, "open_lasted_median_s"),
        },
    ),
    "eventually_diverges": Claim(
        "Eventually the open loop diverges for all grades, with growing position errors towards the "
        "end.",
        "V",
        f"flights 10 and 11 (90 and 95 min), all grades: more than half of the runs exceed "
        f"{ONSET:g} m at some time (Wilson)",
        {"diverged": over(flown(("10", "11"), *GRADES), share, "open_diverged")},
        "{diverged}. Share of runs: {shares}",
        "figures 2 and 3",
        {
            "shares": over(
                flown(("10", "11"), *GRADES), each, "{r.grade} {r.flight}: {r.open_diverged:.0%}"
            )
        },
    ),
    "navigation_inconsistent": Claim(
        "With navigation-grade sensors over short horizons the closed loop is statistically "
        "inconsistent and its biases wander a "
        "little.",
        "V; VI",
        f"navigation grade, 01-06: the interval of the closed loop's typical NEES/15 (until the "
        f"abort) above {TOO_SURE:g}; and "
        f"its accelerometer and gyro "
        f"biases worse than the open loop's after 120 s; both parts must hold",
        {
            "sure": over(flown(SHORT, NAVIGATION), share, "closed_anees", level=TOO_SURE),
            "wanders": over(flown(SHORT, NAVIGATION), biases_better, OPEN),
        },
        "Too sure: {sure} (closed {closed_min:.3g} to {closed_max:.3g}, open {open_min:.3g} to "
        "{open_max:.3g}). Biases better in the open loop: {wanders}",
        "table flights, figure 8",
        {
            f"{loop}_{how}": over(flown(SHORT, NAVIGATION), told, f"{loop}_anees", how)
            for loop in ("open", "closed")
            for how in ("min", "max")
        },
    ),
    "linearisation": Claim(
        "The difference is not a linearisation discrepancy as such: the open loop degrades because "
        "the accumulated drift "
        "violates the small-error "
        "assumption behind its linear error model.",
        "V",
        f"runs of all cells: the rank correlation of the raw INS's drift with the ratio of the "
        f"NEES, open by closed, is above "
        f"0.5 on average (95 % interval); "
        f"and while the drift is below {SMALL_DRIFT:g} m the NEES differ by less than "
        f"{TOO_SURE - 1:.0%}; both parts must hold. "
        f"Both grow with time, so that "
        "the correlation alone proves no cause; the resets of the ablation take the cause away",
        {"related": over(DRIFT, drift_correlates), "equal": over(DRIFT, alike_at_small_drift)},
        "Correlation {related}; ratio of NEES at small drift {equal}. By grade: {grades}",
        "figure 8",
        {"grades": over(DRIFT, drift_by_grade)},
    ),
    "dynamic_flights": Claim(
        "Dynamic flights amplify integration errors, in particular of the open loop (03 and 05 at "
        "consumer and tactical grade).",
        "V",
        "the paths of the paper's 03 and 05 are not published, so their numbers cannot be checked. "
        "Instead, consumer and "
        "tactical: a dynamic flight that is "
        "shorter than a straight one and yet has the larger open-loop RMSE supports it (06 against "
        "07, 09 against 10); one that "
        "is longer and has the "
        "smaller RMSE contradicts it (08, 11); RMSE censored at 500 m by the 500 m rule alone, "
        "intervals apart",
        {"amplified": over(FLIGHTS, amplified)},
        "{amplified}. Our own 03 and 05: {own}",
        "figure 2",
        {
            "own": over(
                flown(("03", "05"), CONSUMER, TACTICAL),
                each,
                "{r.grade} {r.flight}: {r.open_censored_500_m:.3g} m",
                "; ",
            )
        },
    ),
    "roll_pitch": Claim(
        "The closed loop gives better roll and pitch with consumer and tactical IMUs.",
        "V, Fig. 4",
        "tilt (roll and pitch together) after 120 s and while both filters are within 500 m; both "
        "grades must hold",
        {
            grade: over(flown(SHORT + LONG, grade), sides, "tilt", CLOSED)
            for grade in (CONSUMER, TACTICAL)
        },
        "consumer: {consumer} ({consumer_ratios}); tactical: {tactical} ({tactical_ratios})",
        "figure 4",
        {
            f"{grade}_ratios": over(flown(SHORT + LONG, grade), ratios, "tilt")
            for grade in (CONSUMER, TACTICAL)
        },
    ),
    "heading": Claim(
        "Open loops better preserve heading with good enough sensors.",
        "V, Fig. 4; VI",
        "navigation grade, all flights, heading after 120 s and while both are within 500 m",
        {"open": over(flown(SHORT + LONG, NAVIGATION), sides, "heading", OPEN)},
        "{open} ({ratios})",
        "figure 4",
        {"ratios": over(flown(SHORT + LONG, NAVIGATION), ratios, "heading")},
    ),
    "heading_degraded": Claim(
        "With navigation-grade IMUs feedback is a perturbation that degrades heading accuracy.",
        "VI",
        "as the claim before on the short flights 01-06, where the open loop has hardly drifted",
        {"open": over(flown(SHORT, NAVIGATION), sides, "heading", OPEN)},
        "{open} ({ratios})",
        "figure 4",
        {"ratios": over(flown(SHORT, NAVIGATION), ratios, "heading")},
    ),
    "offset_unstable": read_twice(
        Claim(
            "An unknown constant accelerometer offset of 0.5 m/s^2 makes the open loop unstable, "
            "early; long flights fail.",
            "V, Figs. 5, 6",
            f"flights 01-07 with offset, all grades: fewer than half of the open-loop runs survive "
            f"(Wilson), {ABORTS}",
            {"fails": over(OFFSET, survival, "open", False)},
            "{fails}. Given up after {lasted:.0f} s (median over cells)",
            "figures 5 and 6",
            {"lasted": over(OFFSET, told, "open_lasted_median_s")},
        )
    ),
    "offset_shortens": read_twice(
        Claim(
            "An unknown initial bias reduces the stable runtime of the open loop.",
            "VI",
            f"time until the position error exceeds {ONSET:g} m, at most the flight's, with offset "
            f"shorter than without (intervals "
            f"apart)",
            {"sooner": over(with_and_without, sooner, "open_onset_s")},
            "{sooner}",
            "figure 6, tables",
        )
    ),
    "offset_isolated": read_twice(
        Claim(
            "The closed loop directly isolates the offset, its estimates converge smoothly and stay "
            "bounded.",
            "V, Fig. 5",
            f"flights 01-07 with offset, all grades: more than half of the closed-loop runs survive "
            f"(Wilson), {ABORTS}; and the "
            f"accelerometer bias error at the end "
            f"is at most twice that without offset (intervals); both parts must hold",
            {
                "survives": over(OFFSET, survival, "closed", True),
                "converged": over(with_and_without, as_small, BIAS_ERROR, 2.0),
            },
            "{survives}. Converged: {converged}",
            "figures 5 and 6",
        )
    ),
    "straight_is_slow": read_twice(
        Claim(
            "On straight flights even the closed loop takes longer to resolve the accelerometer "
            "bias; manoeuvres accelerate it.",
            "V",
            f"with offset, each grade: the time until the closed loop's accelerometer bias error "
            f"stays below {RESOLVED:g} m/s^2 is "
            f"shorter on a dynamic flight than on "
            f"the straight 07 (intervals apart; a flight that ends before says nothing)",
            {"shorter": over(OFFSET, against_straight, "closed_resolved_s", -1)},
            "{shorter}",
            "figure 5, table offset",
        )
    ),
    "symptoms_delayed": read_twice(
        Claim(
            "Short dynamic flights delay the visible symptoms of the offset in the open loop.",
            "V",
            f"with offset, each grade: the time until the open loop's position error exceeds "
            f"{ONSET:g} m is longer on a dynamic "
            f"flight than on the straight 07 "
            f"(intervals apart; a flight that ends before its symptoms supports it where 07 has "
            f"failed by then)",
            {"longer": over(OFFSET, against_straight, "open_onset_s", 1)},
            "{longer}",
            "table offset",
        )
    ),
    "closed_is_bounded": Claim(
        "The closed loop is stable and bounded over long horizons.",
        "Abstract; V",
        f"flights 07-11, all grades: more than half of the closed-loop runs survive (Wilson), "
        f"{ABORTS}",
        {"survives": over(flown(LONG, *GRADES), survival, "closed", True)},
        "{survives}",
        "figure 2",
    ),
    "mandatory": Claim(
        "Closed loops are mandatory to prevent divergence with lower-grade sensors.",
        "VI",
        f"consumer grade, all flights: more than half of the open-loop runs exceed {ONSET:g} m, and "
        f"fewer than half of the "
        f"closed-loop runs (Wilson); both parts must "
        f"hold",
        {
            "diverges": over(flown(SHORT + LONG, CONSUMER), share, "open_diverged"),
            "kept": over(flown(SHORT + LONG, CONSUMER), share, "closed_diverged", False),
        },
        "Open loop diverges: {diverges}. Closed loop does not: {kept}",
        "figure 2",
    ),
    "resets": Claim(
        "Long-term stability can also be obtained by occasional resets.",
        "VI",
        f"tactical grade, the longest flight of the ablation, resets every {RARELY:.0f} s or more "
        f"rarely: more than half of the runs survive "
        "(Wilson) and the position RMSE is "
        f"not worse than the closed loop's (ratio below {1 + SIZE:g} with its interval); one such "
        f"interval reproduces it",
        {"resets": over(RESETS, stable_by_resets)},
        "{resets}",
        "ablation resets",
        lacks=lambda e: "" if e.resets is not None and len(e.resets) else "needs the ablations",
    ),
}
"""In the order of the paper."""


def claims(evidence: Evidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
