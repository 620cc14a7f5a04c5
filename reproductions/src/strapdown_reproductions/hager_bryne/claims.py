"""Claims of Hager & Bryne, each with its kind, its cells and the rule of rules.py that decides it;
nothing here runs a filter."""

from ..common.claims import Claim, findings, over
from ..common.kinds import ALWAYS, EXPLANATION, MORE_THAN, MOSTLY, always
from ..common.verdicts import CLOSED, OPEN, SIZE, ratios
from .cells import EARLY, ONSET, RESOLVED
from .rules import (
    CONSUMER,
    DRIFT,
    FLIGHTS,
    GRADES,
    LONG,
    NAVIGATION,
    OFFSET,
    RARELY,
    RESETS,
    SHORT,
    SMALL_DRIFT,
    STARTS,
    TACTICAL,
    TOO_SURE,
    UPDATES,
    UPDATES_AND_STARTS,
    HagerBryneEvidence,
    against_straight,
    amplified,
    as_small,
    better_side,
    biases_better,
    cells_above,
    change,
    drift_by_grade,
    drift_explains,
    each,
    flown,
    offset_twice,
    one_filter,
    position,
    rarest_that_holds,
    runs_that,
    sooner,
    stable_by_resets,
    survival,
    times_beside_straight,
    told,
    too_sure,
    updates_and_starts,
    with_and_without,
)

ABORTS = "by both abort rules, and by the 500 m rule alone"
POSITIONS = ("position", "position_500")
BIAS_ERROR = "closed_end_accel_bias_m_s2"
BY_ALL = (*UPDATES, *STARTS, *UPDATES_AND_STARTS)
CLAIMS = {
    "smooth_fusion": updates_and_starts(
        Claim(
            "Open loops give smooth fusion and the best short- to middle-term accuracy with high-end "
            "IMUs.",
            "Abstract; VI",
            f"navigation grade, flights 01-06: open loop better in position, {ABORTS}",
            {"position": over(flown(SHORT, NAVIGATION), position, OPEN)},
            "{position}",
            "figures 2, 7 and 9",
            {"change": over(flown(SHORT, NAVIGATION), change, "position_500")},
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the open loop's position RMSE against the "
            "closed one's is {change} (median over flights, 500 m rule alone).",
            identity=over(flown(SHORT, NAVIGATION), one_filter(*POSITIONS)),
        ),
        *BY_ALL,
    ),
    "low_drift": updates_and_starts(
        Claim(
            "When INS drift is low - higher-grade IMUs and shorter horizons - the open-loop filter "
            "systematically outperforms the "
            "closed loop.",
            "V",
            f"tactical and navigation grade on flights 01-06: open loop better in position, {ABORTS}; "
            f'"systematically" is always; both grades must hold',
            {
                grade: over(flown(SHORT, grade), position, OPEN, always)
                for grade in (TACTICAL, NAVIGATION)
            },
            "Tactical: {tactical}. Navigation: {navigation}",
            "figures 2, 7 and 9",
            {
                f"{grade}_change": over(flown(SHORT, grade), change, "position_500")
                for grade in (TACTICAL, NAVIGATION)
            },
            kind=ALWAYS,
            answer="On flights 01-06 the open loop's position RMSE against the closed one's is "
            "{tactical_change} at tactical and {navigation_change} at navigation grade (medians, "
            "500 m rule alone).",
            identity=over(flown(SHORT, TACTICAL, NAVIGATION), one_filter(*POSITIONS)),
        ),
        *BY_ALL,
    ),
    "crossover": updates_and_starts(
        Claim(
            "With tactical IMUs the boundary beyond which open loop is worse than closed loop lies "
            "between flights 01-06 and 07-11.",
            "V",
            f"tactical grade, position, {ABORTS}: open loop better on 01-06 and closed loop better on "
            f"07-11; both must hold",
            {
                "before": over(flown(SHORT, TACTICAL), position, OPEN),
                "after": over(flown(LONG, TACTICAL), position, CLOSED),
            },
            "01-06, open better: {before}. 07-11, closed better: {after}",
            "figures 2, 7 and 9",
            {
                "short": over(flown(SHORT, TACTICAL), change, "position_500"),
                "long": over(flown(LONG, TACTICAL), change, "position_500"),
            },
            kind=MOSTLY,
            answer="At tactical grade the open loop's position RMSE against the closed one's is "
            "{short} on flights 01-06 and {long} on 07-11 (medians, 500 m rule alone).",
            identity=over(flown(SHORT + LONG, TACTICAL), one_filter(*POSITIONS)),
        ),
        *UPDATES,
    ),
    "consumer_diverges": Claim(
        "For lower-grade IMUs the open loop begins to diverge within a few minutes across most "
        "profiles.",
        "V",
        f"consumer grade: on a flight more than half of the runs have a position error beyond "
        f"{ONSET:g} m before {EARLY:g} s (Wilson interval above one half)",
        {"early": over(flown(SHORT + LONG, CONSUMER), runs_that, "open_early")},
        "{early}; typical time {least:.0f} to {most:.0f} s; given up by both rules at "
        "{lasted:.0f} s (median)",
        "figure 2, table flights",
        {
            "least": over(flown(SHORT + LONG, CONSUMER), told, "open_onset_s", "min"),
            "most": over(flown(SHORT + LONG, CONSUMER), told, "open_onset_s", "max"),
            "lasted": over(flown(SHORT + LONG, CONSUMER), told, "open_lasted_median_s"),
            "flights": over(flown(SHORT + LONG, CONSUMER), cells_above, "open_early"),
        },
        kind=MOSTLY,
        answer=f"At consumer grade most runs err by {ONSET:g} m before {EARLY:g} s on {{flights}} "
        "flights; the typical time is {least:.0f} to {most:.0f} s.",
    ),
    "eventually_diverges": updates_and_starts(
        Claim(
            "Eventually the open loop diverges for all grades, with growing position errors towards "
            "the end.",
            "V",
            f"flights 10 and 11 (90 and 95 min), all grades: more than half of the runs exceed "
            f"{ONSET:g} m at some time (Wilson)",
            {"diverged": over(flown(("10", "11"), *GRADES), runs_that, "open_diverged", always)},
            "{diverged}. Share of runs: {shares}",
            "figures 2 and 3",
            {
                "shares": over(
                    flown(("10", "11"), *GRADES),
                    each,
                    "{r.grade} {r.flight}: {r.open_diverged:.0%}",
                ),
                "least": over(flown(("10", "11"), *GRADES), told, "open_diverged", "min"),
            },
            kind=ALWAYS,
            answer=f"On flights 10 and 11 at least {{least:.0%}} of the open-loop runs of each grade "
            f"exceed {ONSET:g} m.",
        ),
        *STARTS,
    ),
    "navigation_inconsistent": updates_and_starts(
        Claim(
            "With navigation-grade sensors over short horizons the closed loop is statistically "
            "inconsistent and its biases wander a "
            "little.",
            "V; VI",
            f"navigation grade, 01-06: the interval of the closed loop's typical NEES/15 (until the "
            f"abort) above {TOO_SURE:g}; and "
            f"its accelerometer and gyro "
            f"biases worse than the open loop's after 120 s; both parts must hold",
            {
                "sure": over(flown(SHORT, NAVIGATION), too_sure),
                "wanders": over(flown(SHORT, NAVIGATION), biases_better, OPEN),
            },
            "Too sure: {sure} (closed {closed_min:.3g} to {closed_max:.3g}, open {open_min:.3g} to "
            "{open_max:.3g}). Biases better in the open loop: {wanders}",
            "table flights, figures 8b and 9",
            {
                f"{loop}_{how}": over(flown(SHORT, NAVIGATION), told, f"{loop}_anees", how)
                for loop in ("open", "closed")
                for how in ("min", "max")
            },
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the closed loop's NEES/15 is "
            "{closed_min:.3g} to {closed_max:.3g}, the open loop's {open_min:.3g} to {open_max:.3g}.",
        ),
        *BY_ALL,
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
        f"{TOO_SURE - 1:.0%}. "
        f"Both grow with time, so that "
        "the correlation alone proves no cause; the resets of the ablation take the cause away",
        {"explains": over(DRIFT, drift_explains)},
        "{explains}. By grade: {grades}",
        "figure 8",
        {"grades": over(DRIFT, drift_by_grade)},
        kind=EXPLANATION,
        answer=f"Rank correlation of drift with NEES open by closed, and their ratio below "
        f"{SMALL_DRIFT:g} m of drift: {{grades}}.",
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
        kind=MOSTLY,
        answer="Of dynamic flights against straight ones: {amplified}.",
    ),
    "roll_pitch": updates_and_starts(
        Claim(
            "The closed loop gives better roll and pitch with consumer and tactical IMUs.",
            "V, Fig. 4",
            "tilt (roll and pitch together) after 120 s and while both filters are within 500 m; "
            "both grades must hold",
            {
                grade: over(flown(SHORT + LONG, grade), better_side, "tilt", CLOSED)
                for grade in (CONSUMER, TACTICAL)
            },
            "consumer: {consumer} ({consumer_ratios}); tactical: {tactical} ({tactical_ratios})",
            "figure 4",
            {
                f"{grade}_{name}": over(flown(SHORT + LONG, grade), tell, "tilt")
                for grade in (CONSUMER, TACTICAL)
                for name, tell in (("ratios", ratios), ("change", change))
            },
            kind=MOSTLY,
            answer="The open loop's tilt RMSE against the closed one's is {consumer_change} at "
            "consumer and {tactical_change} at tactical grade (medians over flights).",
            identity=over(flown(SHORT + LONG, CONSUMER, TACTICAL), one_filter("tilt")),
        ),
        *UPDATES,
    ),
    "heading": updates_and_starts(
        Claim(
            "Open loops better preserve heading with good enough sensors.",
            "V, Fig. 4; VI",
            "navigation grade, all flights, heading after 120 s and while both are within 500 m",
            {"open": over(flown(SHORT + LONG, NAVIGATION), better_side, "heading", OPEN)},
            "{open} ({ratios})",
            "figure 4",
            {
                "ratios": over(flown(SHORT + LONG, NAVIGATION), ratios, "heading"),
                "change": over(flown(SHORT + LONG, NAVIGATION), change, "heading"),
            },
            kind=MOSTLY,
            answer="At navigation grade the open loop's heading RMSE against the closed one's is "
            "{change} (median over all flights).",
            identity=over(flown(SHORT + LONG, NAVIGATION), one_filter("heading")),
        ),
        *BY_ALL,
    ),
    "heading_degraded": updates_and_starts(
        Claim(
            "With navigation-grade IMUs feedback is a perturbation that degrades heading accuracy.",
            "VI",
            "as the claim before on the short flights 01-06, where the open loop has hardly drifted",
            {"open": over(flown(SHORT, NAVIGATION), better_side, "heading", OPEN)},
            "{open} ({ratios})",
            "figure 4",
            {
                "ratios": over(flown(SHORT, NAVIGATION), ratios, "heading"),
                "change": over(flown(SHORT, NAVIGATION), change, "heading"),
            },
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the open loop's heading RMSE against the "
            "closed one's is {change} (median).",
            identity=over(flown(SHORT, NAVIGATION), one_filter("heading")),
        ),
        *BY_ALL,
    ),
    "offset_unstable": offset_twice(
        Claim(
            "An unknown constant accelerometer offset of 0.5 m/s^2 makes the open loop unstable, "
            "early; long flights fail.",
            "V, Figs. 5, 6",
            f"flights 01-07 with offset, all grades: fewer than half of the open-loop runs survive "
            f"(Wilson), {ABORTS}",
            {"fails": over(OFFSET, survival, "open", False)},
            "{fails}. Given up after {lasted:.0f} s (median over cells)",
            "figures 5 and 6",
            {
                "lasted": over(OFFSET, told, "open_lasted_median_s"),
                "both": over(OFFSET, cells_above, "open_survived"),
                "alone": over(OFFSET, cells_above, "open_survived_500"),
            },
            kind=MOSTLY,
            answer="Most open-loop runs with offset survive both abort rules on {both} flights and "
            "grades, and the 500 m rule alone on {alone}; given up after {lasted:.0f} s.",
        )
    ),
    "offset_shortens": offset_twice(
        Claim(
            "An unknown initial bias reduces the stable runtime of the open loop.",
            "VI",
            f"time until the position error exceeds {ONSET:g} m, at most the flight's, with offset "
            f"shorter than without (interval of their ratio; a flight that "
            f"ends before both says nothing)",
            {"sooner": over(with_and_without, sooner, "open_onset_s")},
            "{sooner}",
            "figure 6, tables",
            kind=MOSTLY,
            answer=f"The open loop errs by {ONSET:g} m sooner with offset than without: {{sooner}}.",
        )
    ),
    "offset_isolated": offset_twice(
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
            {"end": over(OFFSET, told, BIAS_ERROR)},
            kind=MOSTLY,
            answer="At the end the closed loop's accelerometer bias is wrong by {end:.2g} m/s² "
            "(median over cells); at most twice as much as without offset: {converged}.",
        )
    ),
    "straight_is_slow": offset_twice(
        Claim(
            "On straight flights even the closed loop takes longer to resolve the accelerometer "
            "bias; manoeuvres accelerate it.",
            "V",
            f"with offset, each grade: the time until the closed loop's accelerometer bias error "
            f"stays below {RESOLVED:g} m/s^2 is "
            f"shorter on a dynamic flight than on "
            f"the straight 07 (interval of their ratio; a flight that ends before says nothing)",
            {"shorter": over(OFFSET, against_straight, "closed_resolved_s", -1)},
            "{shorter}. {times}",
            "figure 5, table offset",
            {"times": over(OFFSET, times_beside_straight, "closed_resolved_s")},
            kind=MOSTLY,
            answer="The bias is resolved sooner on dynamic flights than on the straight one: "
            "{shorter}.",
        )
    ),
    "symptoms_delayed": offset_twice(
        Claim(
            "Short dynamic flights delay the visible symptoms of the offset in the open loop.",
            "V",
            f"with offset, each grade: the time until the open loop's position error exceeds "
            f"{ONSET:g} m is longer on a dynamic "
            f"flight than on the straight 07 "
            f"(interval of their ratio; a flight that ends before its symptoms supports it where 07 "
            f"has failed by then, and else says nothing)",
            {"longer": over(OFFSET, against_straight, "open_onset_s", 1)},
            "{longer}. {times}",
            "table offset",
            {"times": over(OFFSET, times_beside_straight, "open_onset_s")},
            kind=MOSTLY,
            answer=f"Errors of {ONSET:g} m come later on dynamic flights than on the straight one: "
            "{longer}.",
        )
    ),
    "closed_is_bounded": updates_and_starts(
        Claim(
            "The closed loop is stable and bounded over long horizons.",
            "Abstract; V",
            f"flights 07-11, all grades: more than half of the closed-loop runs survive (Wilson), "
            f"{ABORTS}",
            {"survives": over(flown(LONG, *GRADES), survival, "closed", True, always)},
            "{survives}",
            "figures 2 and 9",
            {
                "both": over(flown(LONG, *GRADES), cells_above, "closed_survived"),
                "alone": over(flown(LONG, *GRADES), cells_above, "closed_survived_500"),
            },
            kind=ALWAYS,
            answer="On flights 07-11 most closed-loop runs survive both abort rules on {both} flights "
            "and grades, and the 500 m rule alone on {alone}.",
        ),
        *BY_ALL,
    ),
    "mandatory": updates_and_starts(
        Claim(
            "Closed loops are mandatory to prevent divergence with lower-grade sensors.",
            "VI",
            f"consumer grade, all flights: more than half of the open-loop runs exceed {ONSET:g} m, "
            f"and fewer than half of the "
            f"closed-loop runs (Wilson); both parts must "
            f"hold",
            {
                "diverges": over(flown(SHORT + LONG, CONSUMER), runs_that, "open_diverged", always),
                "kept": over(
                    flown(SHORT + LONG, CONSUMER), runs_that, "closed_diverged", always, False
                ),
            },
            "Open loop diverges: {diverges}. Closed loop does not: {kept}",
            "figures 2 and 9",
            {
                "open": over(flown(SHORT + LONG, CONSUMER), cells_above, "open_diverged"),
                "closed": over(flown(SHORT + LONG, CONSUMER), cells_above, "closed_diverged"),
            },
            kind=ALWAYS,
            answer=f"At consumer grade most open-loop runs exceed {ONSET:g} m on {{open}} flights, "
            "most closed-loop runs on {closed}.",
        ),
        *UPDATES,
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
        {"rarest": over(RESETS, rarest_that_holds)},
        lacks=lambda e: "" if e.resets is not None and len(e.resets) else "needs the ablations",
        kind=MORE_THAN,
        answer="On the longest flight most runs survive with resets as rare as every {rarest}.",
    ),
}
"""In the order of the paper."""


def claims(evidence: HagerBryneEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
