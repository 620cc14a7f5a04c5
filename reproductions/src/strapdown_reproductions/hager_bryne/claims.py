"""What Hager & Bryne claim, each claim decided by a rule from the tables of cells.py;
nothing here runs a filter."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import paired

from ..common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED, finding
from ..common.verdicts import (
    CLOSED,
    OPEN,
    READINGS,
    SIZE,
    Count,
    apart,
    both,
    over_readings,
    ratios,
    share,
    sides,
    total,
)
from .cells import EARLY, ONSET, RESOLVED

CONSUMER, TACTICAL, NAVIGATION = "consumer", "tactical", "navigation"
SHORT, LONG = tuple(f"{i:02d}" for i in range(1, 7)), tuple(f"{i:02d}" for i in range(7, 12))
TOO_SURE = 1.1
"""A filter is called inconsistent where the interval of its typical NEES/15 lies above this: too
sure of itself; below 1 it is too careful."""
ABORTS = "by both abort rules, and by the 500 m rule alone"
SMALL_DRIFT = 100.0
"""m of raw INS drift, below which the linearisation should not matter."""


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


Claim: TypeAlias = Callable[[Evidence], dict[str, str]]
"""Makes a `finding` from the evidence."""


def claims(evidence: Evidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return [
        make(evidence)
        for make in (
            smooth_fusion,
            low_drift,
            crossover,
            consumer_diverges,
            eventually_diverges,
            navigation_inconsistent,
            linearisation,
            dynamic_flights,
            roll_pitch,
            heading,
            heading_degraded,
            offset_unstable,
            offset_shortens,
            offset_isolated,
            straight_is_slow,
            symptoms_delayed,
            closed_is_bounded,
            mandatory,
            resets,
        )
    ]


def _offset_read_twice(make: Claim) -> Claim:
    """A claim about the offset by both readings of what it is; opposite verdicts mean that what
    the paper leaves open decides."""

    def combined(e: Evidence) -> dict[str, str]:
        constant = make(e)
        if e.initial is None:
            return constant
        initial = make(e._replace(offset=e.initial))
        return constant | {
            "verdict": over_readings(constant["verdict"], initial["verdict"]),
            "rule": f"{constant['rule']}; with the offset read as constant, and as initial value of "
            f"the bias process",
            "measured": f"Constant ({constant['verdict']}): {constant['measured']}. Initial value "
            f"({initial['verdict']}): {initial['measured']}",
        }

    return combined


def _pick(rows: pd.DataFrame, grades: Sequence[str], flights: Sequence[str]) -> pd.DataFrame:
    return rows[rows["grade"].isin(grades) & rows["flight"].isin(flights)]


def _position(rows: pd.DataFrame, side: str) -> tuple[str, str]:
    """Verdict and text on which filter has the better position, by both readings of the abort
    rule."""
    counts = [sides(rows, f"position{reading}", side) for reading in READINGS]
    text = "; ".join(
        f"{name}: {count} ({ratios(rows, f'position{reading}')})"
        for name, count, reading in zip(
            ("both abort rules, 500 m counted from the abort on", "500 m alone"), counts, READINGS
        )
    )
    return over_readings(*(count.verdict for count in counts)), text[0].upper() + text[1:]


def smooth_fusion(e: Evidence) -> dict[str, str]:
    """Abstract and VI."""
    accurate, text = _position(_pick(e.flights, [NAVIGATION], SHORT), OPEN)
    return finding(
        "Open loops give smooth fusion and the best short- to middle-term accuracy with high-end "
        "IMUs.",
        "Abstract; VI",
        f"navigation grade, flights 01-06: open loop better in position, {ABORTS}",
        text,
        accurate,
        "figures 2 and 7",
    )


def low_drift(e: Evidence) -> dict[str, str]:
    """V."""
    rows = [_pick(e.flights, [grade], SHORT) for grade in (TACTICAL, NAVIGATION)]
    found = [_position(part, OPEN) for part in rows]
    return finding(
        "When INS drift is low - higher-grade IMUs and shorter horizons - the open-loop filter "
        "systematically outperforms the "
        "closed loop.",
        "V",
        "as claim 1, for tactical and navigation grade on flights 01-06; both grades must hold",
        f"Tactical: {found[0][1]}. Navigation: {found[1][1]}",
        both(*(verdict for verdict, _ in found)),
        "figures 2 and 7",
    )


def crossover(e: Evidence) -> dict[str, str]:
    """V."""
    before, first = _position(_pick(e.flights, [TACTICAL], SHORT), OPEN)
    after, second = _position(_pick(e.flights, [TACTICAL], LONG), CLOSED)
    return finding(
        "With tactical IMUs the boundary beyond which open loop is worse than closed loop lies "
        "between flights 01-06 and 07-11.",
        "V",
        "as claim 1: open loop better on 01-06 and closed loop better on 07-11",
        f"01-06, open better: {first}. 07-11, closed better: {second}",
        both(before, after),
        "figures 2 and 7",
    )


def consumer_diverges(e: Evidence) -> dict[str, str]:
    """V."""
    rows = _pick(e.flights, [CONSUMER], SHORT + LONG)
    count = share(rows, "open_early")
    return finding(
        "For lower-grade IMUs the open loop begins to diverge within a few minutes across most "
        "profiles.",
        "V",
        f"consumer grade: on a flight more than half of the runs have a position error beyond "
        f"{ONSET:g} m before {EARLY:g} s "
        f"(Wilson interval above "
        f"one half)",
        f"{count}; typical time {rows['open_onset_s'].min():.0f} to "
        f"{rows['open_onset_s'].max():.0f} s; given up "
        f"by both rules at "
        f"{rows['open_lasted_median_s'].median():.0f} s (median)",
        count.verdict,
        "figure 2, table flights",
    )


def eventually_diverges(e: Evidence) -> dict[str, str]:
    """V."""
    rows = _pick(e.flights, [CONSUMER, TACTICAL, NAVIGATION], ("10", "11"))
    count = share(rows, "open_diverged")
    shares = ", ".join(f"{r.grade} {r.flight}: {r.open_diverged:.0%}" for r in rows.itertuples())
    return finding(
        "Eventually the open loop diverges for all grades, with growing position errors towards the "
        "end.",
        "V",
        f"flights 10 and 11 (90 and 95 min), all grades: more than half of the runs exceed "
        f"{ONSET:g} m at some time (Wilson)",
        f"{count}. Share of runs: {shares}",
        count.verdict,
        "figures 2 and 3",
    )


def navigation_inconsistent(e: Evidence) -> dict[str, str]:
    """V and VI."""
    rows = _pick(e.flights, [NAVIGATION], SHORT)
    sure = share(rows, "closed_anees", level=TOO_SURE)
    biases = [sides(rows, name, OPEN) for name in ("accel_bias", "gyro_bias")]
    wanders = total(biases)
    return finding(
        "With navigation-grade sensors over short horizons the closed loop is statistically "
        "inconsistent and its biases wander a "
        "little.",
        "V; VI",
        f"navigation grade, 01-06: the interval of the closed loop's typical NEES/15 (until the "
        f"abort) above {TOO_SURE:g}; and "
        f"its accelerometer and gyro "
        f"biases worse than the open loop's after 120 s; both parts must hold",
        f"Too sure: {sure} (closed {rows['closed_anees'].min():.3g} to "
        f"{rows['closed_anees'].max():.3g}, open "
        f"{rows['open_anees'].min():.3g} to "
        f"{rows['open_anees'].max():.3g}). Biases better in the open loop: {wanders}",
        both(sure.verdict, wanders.verdict),
        "table flights, figure 8",
    )


def linearisation(e: Evidence) -> dict[str, str]:
    """V."""
    rho = e.drift["correlation"].to_numpy(float)
    small = e.drift["small_ratio"].to_numpy(float)
    p = paired(rho, np.zeros(len(rho)))
    same = paired(np.log(small), np.zeros(len(small)))
    low, value, high = np.exp([same.low, same.difference, same.high])
    grades = "; ".join(
        f"{grade} {part['correlation'].mean():.2f} and "
        f"{np.exp(np.log(part['small_ratio']).mean()):.3g}"
        for grade, part in e.drift.groupby("grade", sort=False)
    )
    related = REPRODUCED if p.low > 0.5 else NOT_REPRODUCED if p.high < 0.5 else UNDECIDED
    equal = (
        REPRODUCED
        if low > 1 / TOO_SURE and high < TOO_SURE
        else NOT_REPRODUCED
        if low > TOO_SURE or high < 1 / TOO_SURE
        else UNDECIDED
    )
    return finding(
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
        f"Correlation {p.difference:.2f} ({p.low:.2f} to {p.high:.2f}) over {p.count} runs; ratio "
        f"of NEES at small drift "
        f"{value:.3g} ({low:.3g} to {high:.3g}). By grade: {grades}",
        both(related, equal),
        "figure 8",
    )


def dynamic_flights(e: Evidence) -> dict[str, str]:
    """V: by the flights that are comparable in length."""
    votes = [
        _amplified(e.flights, grade, straight, shorter, longer)
        for grade in (CONSUMER, TACTICAL)
        for straight, shorter, longer in (("07", "06", "08"), ("10", "09", "11"))
    ]
    count = total(votes)
    own = "; ".join(
        f"{r.grade} {r.flight}: {r.open_censored_500_m:.3g} m"
        for r in _pick(e.flights, [CONSUMER, TACTICAL], ("03", "05")).itertuples()
    )
    return finding(
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
        f"{count}. Our own 03 and 05: {own}",
        count.verdict,
        "figure 2",
    )


def _amplified(rows: pd.DataFrame, grade: str, straight: str, shorter: str, longer: str) -> Count:
    own = {
        flight: found.iloc[0]
        for flight in (straight, shorter, longer)
        if len(found := _pick(rows, [grade], [flight]))
    }
    if straight not in own:
        return Count(0, 0, 0)
    supports = shorter in own and apart(own[shorter], own[straight], "open_censored_500_m") > 0
    contradicts = longer in own and apart(own[longer], own[straight], "open_censored_500_m") < 0
    return Count(int(supports and not contradicts), int(contradicts and not supports), 1)


def roll_pitch(e: Evidence) -> dict[str, str]:
    """V, Fig. 4."""
    rows = [_pick(e.flights, [grade], SHORT + LONG) for grade in (CONSUMER, TACTICAL)]
    counts = [sides(part, "tilt", CLOSED) for part in rows]
    return finding(
        "The closed loop gives better roll and pitch with consumer and tactical IMUs.",
        "V, Fig. 4",
        "tilt (roll and pitch together) after 120 s and while both filters are within 500 m; both "
        "grades must hold",
        "; ".join(
            f"{grade}: {count} ({ratios(part, 'tilt')})"
            for grade, count, part in zip((CONSUMER, TACTICAL), counts, rows)
        ),
        both(*(count.verdict for count in counts)),
        "figure 4",
    )


def heading(e: Evidence) -> dict[str, str]:
    """V and VI: with good sensors."""
    rows = _pick(e.flights, [NAVIGATION], SHORT + LONG)
    count = sides(rows, "heading", OPEN)
    return finding(
        "Open loops better preserve heading with good enough sensors.",
        "V, Fig. 4; VI",
        "navigation grade, all flights, heading after 120 s and while both are within 500 m",
        f"{count} ({ratios(rows, 'heading')})",
        count.verdict,
        "figure 4",
    )


def heading_degraded(e: Evidence) -> dict[str, str]:
    """VI: feedback degrades heading."""
    rows = _pick(e.flights, [NAVIGATION], SHORT)
    count = sides(rows, "heading", OPEN)
    return finding(
        "With navigation-grade IMUs feedback is a perturbation that degrades heading accuracy.",
        "VI",
        "as the claim before on the short flights 01-06, where the open loop has hardly drifted",
        f"{count} ({ratios(rows, 'heading')})",
        count.verdict,
        "figure 4",
    )


def _survival(rows: pd.DataFrame, name: str, more: bool) -> tuple[str, str]:
    counts = [share(rows, f"{name}_survived{reading}", more) for reading in READINGS]
    strict = share(rows, f"{name}_survived_500_in_model", more)
    text = f"Both abort rules: {counts[0]}; 500 m alone: {counts[1]}; 500 m, and leaving the model counts as lost: {strict}"
    return over_readings(*(count.verdict for count in counts)), text


@_offset_read_twice
def offset_unstable(e: Evidence) -> dict[str, str]:
    """V, Figs. 5 and 6."""
    verdict, text = _survival(e.offset, "open", False)
    return finding(
        "An unknown constant accelerometer offset of 0.5 m/s^2 makes the open loop unstable, early; "
        "long flights fail.",
        "V, Figs. 5, 6",
        f"flights 01-07 with offset, all grades: fewer than half of the open-loop runs survive "
        f"(Wilson), {ABORTS}",
        f"{text}. Given up after {e.offset['open_lasted_median_s'].median():.0f} s (median over "
        f"cells)",
        verdict,
        "figures 5 and 6",
    )


@_offset_read_twice
def offset_shortens(e: Evidence) -> dict[str, str]:
    """VI."""
    pairs = [
        (
            with_,
            e.flights[
                (e.flights["grade"] == with_["grade"]) & (e.flights["flight"] == with_["flight"])
            ],
        )
        for _, with_ in e.offset.iterrows()
    ]
    found = [
        apart(with_, without.iloc[0], "open_onset_s") for with_, without in pairs if len(without)
    ]
    count = Count(found.count(-1), found.count(1), len(found))
    return finding(
        "An unknown initial bias reduces the stable runtime of the open loop.",
        "VI",
        f"time until the position error exceeds {ONSET:g} m, at most the flight's, with offset "
        f"shorter than without (intervals "
        f"apart)",
        str(count),
        count.verdict,
        "figure 6, tables",
    )


@_offset_read_twice
def offset_isolated(e: Evidence) -> dict[str, str]:
    """V, Fig. 5."""
    survives, text = _survival(e.offset, "closed", True)
    pairs = [
        (
            row,
            e.flights[
                (e.flights["grade"] == row["grade"]) & (e.flights["flight"] == row["flight"])
            ],
        )
        for _, row in e.offset.iterrows()
    ]
    found = [_converged(row, without.iloc[0]) for row, without in pairs if len(without)]
    count = Count(found.count(True), found.count(False), len(found))
    return finding(
        "The closed loop directly isolates the offset, its estimates converge smoothly and stay "
        "bounded.",
        "V, Fig. 5",
        f"flights 01-07 with offset, all grades: more than half of the closed-loop runs survive "
        f"(Wilson), {ABORTS}; and the "
        f"accelerometer bias error at the end "
        f"is at most twice that without offset (intervals); both parts must hold",
        f"{text}. Converged: {count}",
        both(survives, count.verdict),
        "figures 5 and 6",
    )


def _converged(row: pd.Series, without: pd.Series) -> bool | None:
    name = "closed_end_accel_bias_m_s2"
    if row[f"{name}_high"] <= 2 * without[name]:
        return True
    return False if row[f"{name}_low"] > 2 * without[name] else None


@_offset_read_twice
def straight_is_slow(e: Evidence) -> dict[str, str]:
    """V."""
    count = _against_straight(e.offset, "closed_resolved_s", -1)
    return finding(
        "On straight flights even the closed loop takes longer to resolve the accelerometer bias; "
        "manoeuvres accelerate it.",
        "V",
        f"with offset, each grade: the time until the closed loop's accelerometer bias error stays "
        f"below {RESOLVED:g} m/s^2 is "
        f"shorter on a dynamic flight than on "
        f"the straight 07 (intervals apart; a flight that ends before says nothing)",
        str(count[0]) + count[1],
        count[0].verdict,
        "figure 5, table offset",
    )


@_offset_read_twice
def symptoms_delayed(e: Evidence) -> dict[str, str]:
    """V."""
    count = _against_straight(e.offset, "open_onset_s", 1)
    return finding(
        "Short dynamic flights delay the visible symptoms of the offset in the open loop.",
        "V",
        f"with offset, each grade: the time until the open loop's position error exceeds {ONSET:g} "
        f"m is longer on a dynamic "
        f"flight than on the straight 07 "
        f"(intervals apart; a flight that ends before its symptoms supports it where 07 has failed "
        f"by then)",
        str(count[0]) + count[1],
        count[0].verdict,
        "table offset",
    )


def _against_straight(rows: pd.DataFrame, name: str, sign: int) -> tuple[Count, str]:
    """(Count, text) of the dynamic flights against the straight 07 of their grade, where `sign`
    supports."""
    found, texts = [], []
    for grade, part in rows.groupby("grade", sort=False):
        straight = part[part["flight"] == "07"]
        if len(straight):
            dynamic = part[part["flight"] != "07"]
            votes = [apart(row, straight.iloc[0], name) for _, row in dynamic.iterrows()]
            found += [
                0 if vote < 0 and _cut(row, name) else sign * vote
                for vote, (_, row) in zip(votes, dynamic.iterrows())
            ]
            texts.append(f"{grade}: {_times(dynamic, name)}, straight {_times(straight, name)}")
    return Count(found.count(1), found.count(-1), len(found)), (
        ". " + "; ".join(texts)
    ) if texts else ""


def _times(rows: pd.DataFrame, name: str) -> str:
    """Text: smallest and largest time of the rows that have one within the flight, and how many
    have not."""
    within = [row[name] for _, row in rows.iterrows() if not _cut(row, name)]
    cut = len(rows) - len(within)
    parts = (
        [
            f"{min(within):.0f} s"
            if len(within) == 1
            else f"{min(within):.0f} to {max(within):.0f} s"
        ]
        if within
        else []
    )
    return ", ".join(
        parts
        + (
            [f"{cut} not within the flight" if len(rows) > 1 else "not within the flight"]
            if cut
            else []
        )
    )


def _cut(row: pd.Series, name: str) -> bool:
    """Does the flight end before the time is known? Then it is longer than what stands there."""
    return bool(row[name] >= 0.99 * 60 * row["minutes"])


def closed_is_bounded(e: Evidence) -> dict[str, str]:
    """Abstract and V."""
    verdict, text = _survival(
        _pick(e.flights, [CONSUMER, TACTICAL, NAVIGATION], LONG), "closed", True
    )
    return finding(
        "The closed loop is stable and bounded over long horizons.",
        "Abstract; V",
        f"flights 07-11, all grades: more than half of the closed-loop runs survive (Wilson), "
        f"{ABORTS}",
        text,
        verdict,
        "figure 2",
    )


def mandatory(e: Evidence) -> dict[str, str]:
    """VI."""
    rows = _pick(e.flights, [CONSUMER], SHORT + LONG)
    diverged, kept = share(rows, "open_diverged"), share(rows, "closed_diverged", False)
    return finding(
        "Closed loops are mandatory to prevent divergence with lower-grade sensors.",
        "VI",
        f"consumer grade, all flights: more than half of the open-loop runs exceed {ONSET:g} m, and "
        f"fewer than half of the "
        f"closed-loop runs (Wilson); both parts must "
        f"hold",
        f"Open loop diverges: {diverged}. Closed loop does not: {kept}",
        both(diverged.verdict, kept.verdict),
        "figure 2",
    )


def resets(e: Evidence) -> dict[str, str]:
    """VI."""
    text, source = "Long-term stability can also be obtained by occasional resets.", "VI"
    rule = (
        "tactical grade, the longest flight of the ablation, resets every 60 s or more rarely: more "
        "than half of the runs survive "
        "(Wilson) and the position RMSE is "
        f"not worse than the closed loop's (ratio below {1 + SIZE:g} with its interval); one such "
        f"interval reproduces it"
    )
    if e.resets is None or not len(e.resets):
        return finding(text, source, rule, "needs the ablations", UNDECIDED, "ablation resets")
    rows = e.resets[
        (e.resets["minutes"] == e.resets["minutes"].max()) & (e.resets["interval_s"] >= 60)
    ]
    good = rows[(rows["survived_low"] > 0.5) & (rows["position_high"] < 1 + SIZE)]
    bad = rows[(rows["survived_high"] < 0.5) | (rows["position_low"] > 1 + SIZE)]
    verdict = REPRODUCED if len(good) else NOT_REPRODUCED if len(bad) == len(rows) else UNDECIDED
    listed = "; ".join(
        f"every {r.interval_s:.0f} s: {r.survived:.0%} survive, position RMSE {r.position:.4g} "
        f"times the closed loop's "
        f"({r.position_low:.4g} to {r.position_high:.4g})"
        for r in rows.itertuples()
    )
    return finding(text, source, rule, listed, verdict, "ablation resets")
