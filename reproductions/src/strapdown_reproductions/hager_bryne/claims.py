"""Claims of Hager & Bryne, each with its kind, its cells, the rule of rules.py that decides it, and the
factors of readings.py by which it is read; nothing here runs a filter."""

from typing import Any

from ..common.claims import Claim, over
from ..common.kinds import ALWAYS, EXPLANATION, MORE_THAN, MOSTLY, always
from ..common.verdicts import CLOSED, OPEN, SIZE, ratios
from . import readings as read
from .cells import FIX_STD, ONSET, RESOLVED
from .readings import (
    ABORT,
    BIASES,
    DIVERGES,
    MINUTES,
    OFFSET as AS_OFFSET,
    P0,
    SIGMA,
    START,
    UPDATE,
    WITHOUT_COUNT,
    ReadClaim,
)
from .rules import (
    CONSUMER,
    DRIFT,
    FLIGHTS,
    GRADES,
    LARGE_TURN,
    LONG,
    NAVIGATION,
    OFFSET,
    PLACES,
    RARELY,
    RESETS,
    SHORT,
    SMALL_DRIFT,
    SMALL_TURN,
    TACTICAL,
    TOO_SURE,
    FlownReadings,
    against_straight,
    as_small,
    better_by,
    biases_better,
    cells_above,
    change,
    choose_flights,
    column_value,
    drift_by_grade,
    drift_explains,
    each,
    ins_grows,
    judge_amplification,
    one_filter,
    one_result,
    rarest_that_holds,
    runs_that,
    sooner,
    stable_by_resets,
    stays_small_while_wrong,
    times_beside_straight,
    too_sure,
    with_and_without,
)

ALL = SHORT + LONG
BIAS_ERROR = "closed_end_accel_bias_m_s2"
NO_ABLATIONS = "needs the ablations"
WORLD = (SIGMA, P0, BIASES)
CLAIMS = {
    "smooth_fusion": ReadClaim(
        Claim(
            "Open loops give smooth fusion and the best short- to middle-term accuracy with high-end "
            "IMUs.",
            "Abstract; VI",
            "navigation grade, flights 01-06: open loop better in position, and smoother (the position "
            "error moves less in 5 s); both must hold",
            {
                "position": over(choose_flights(SHORT, NAVIGATION), better_by, "position", OPEN),
                "smooth": over(choose_flights(SHORT, NAVIGATION), better_by, "steps", OPEN),
            },
            "Position: {position}. Smoothness: {smooth}",
            "figures 2, 7 and 9",
            {
                "change": over(choose_flights(SHORT, NAVIGATION), change, "position"),
                "steps": over(choose_flights(SHORT, NAVIGATION), change, "steps"),
            },
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the open loop's position RMSE against the "
            "closed one's is {change}, and what it moves in 5 s {steps} (medians).",
            identity=over(choose_flights(SHORT, NAVIGATION), one_filter("position", "steps")),
        ),
        (*WORLD, START, UPDATE, ABORT),
    ),
    "low_drift": ReadClaim(
        Claim(
            "When INS drift is low - higher-grade IMUs and shorter horizons - the open-loop filter "
            "systematically outperforms the closed loop.",
            "V",
            'tactical and navigation grade on flights 01-06: open loop better in position; "systematically" '
            "is always; both grades must hold",
            {
                grade: over(choose_flights(SHORT, grade), better_by, "position", OPEN, always)
                for grade in (TACTICAL, NAVIGATION)
            },
            "Tactical: {tactical}. Navigation: {navigation}",
            "figures 2, 7 and 9",
            {
                f"{grade}_change": over(choose_flights(SHORT, grade), change, "position")
                for grade in (TACTICAL, NAVIGATION)
            },
            kind=ALWAYS,
            answer="On flights 01-06 the open loop's position RMSE against the closed one's is "
            "{tactical_change} at tactical and {navigation_change} at navigation grade (medians).",
            identity=over(choose_flights(SHORT, TACTICAL, NAVIGATION), one_filter("position")),
        ),
        (*WORLD, START, UPDATE, ABORT),
    ),
    "crossover": ReadClaim(
        Claim(
            "With tactical IMUs the boundary beyond which open loop is worse than closed loop lies "
            "between flights 01-06 and 07-11.",
            "V",
            "tactical grade, position: open loop better on 01-06 and closed loop better on 07-11; both "
            "must hold",
            {
                "before": over(choose_flights(SHORT, TACTICAL), better_by, "position", OPEN),
                "after": over(choose_flights(LONG, TACTICAL), better_by, "position", CLOSED),
            },
            "01-06, open better: {before}. 07-11, closed better: {after}",
            "figures 2, 7 and 9",
            {
                "short": over(choose_flights(SHORT, TACTICAL), change, "position"),
                "long": over(choose_flights(LONG, TACTICAL), change, "position"),
            },
            kind=MOSTLY,
            answer="At tactical grade the open loop's position RMSE against the closed one's is "
            "{short} on flights 01-06 and {long} on 07-11 (medians).",
            identity=over(choose_flights(ALL, TACTICAL), one_filter("position")),
        ),
        (*WORLD, UPDATE, ABORT),
    ),
    "consumer_diverges": ReadClaim(
        Claim(
            "For lower-grade IMUs the open loop begins to diverge within a few minutes across most "
            "profiles.",
            "V",
            "consumer grade: on a flight more than half of the runs begin to diverge within a few "
            "minutes (Wilson interval above one half)",
            {"early": over(choose_flights(ALL, CONSUMER), runs_that, "open_early")},
            "{early}; typical time {least:.0f} to {most:.0f} s",
            "figure 2, table flights",
            {
                "least": over(choose_flights(ALL, CONSUMER), column_value, "open_begins_s", "min"),
                "most": over(choose_flights(ALL, CONSUMER), column_value, "open_begins_s", "max"),
                "onset_least": over(
                    choose_flights(ALL, CONSUMER), column_value, "open_onset_s", "min"
                ),
                "onset_most": over(
                    choose_flights(ALL, CONSUMER), column_value, "open_onset_s", "max"
                ),
                "flights": over(choose_flights(ALL, CONSUMER), cells_above, "open_early"),
            },
            kind=MOSTLY,
            answer="At consumer grade most runs are interrupted within 5 min on {flights} flights, "
            f"typically at {{least:.0f}} to {{most:.0f}} s; they err by {ONSET:g} m at "
            "{onset_least:.0f} to {onset_most:.0f} s.",
        ),
        (*WORLD, DIVERGES, MINUTES),
    ),
    "eventually_diverges": ReadClaim(
        Claim(
            "Eventually the open loop diverges for all grades, with growing position errors towards "
            "the end.",
            "V",
            "flights 10 and 11 (90 and 95 min), all grades: more than half of the runs exceed "
            f"{ONSET:g} m at some time (Wilson); and in more than half the position error is larger in "
            "the last quarter of the flight than in the one before; both must hold",
            {
                "diverged": over(
                    choose_flights(("10", "11"), *GRADES), runs_that, "open_diverged", always
                ),
                "grew": over(choose_flights(("10", "11"), *GRADES), runs_that, "open_grew", always),
            },
            f"Beyond {ONSET:g} m: {{diverged}}. Growing: {{grew}}. Shares of runs: {{shares}}",
            "figures 2 and 3",
            {
                "shares": over(
                    choose_flights(("10", "11"), *GRADES),
                    each,
                    "{r.grade} {r.flight}: {r.open_diverged:.0%} and {r.open_grew:.0%}",
                ),
                "least": over(
                    choose_flights(("10", "11"), *GRADES), column_value, "open_diverged", "min"
                ),
                "least_grew": over(
                    choose_flights(("10", "11"), *GRADES), column_value, "open_grew", "min"
                ),
            },
            kind=ALWAYS,
            answer=f"On flights 10 and 11 at least {{least:.0%}} of the open-loop runs of each grade "
            f"exceed {ONSET:g} m, and in at least {{least_grew:.0%}} the error grows towards the end.",
        ),
        (*WORLD, START),
    ),
    "navigation_inconsistent": ReadClaim(
        Claim(
            "With navigation-grade sensors over short horizons the closed loop is statistically "
            "inconsistent and its biases wander a little.",
            "V; VI",
            "navigation grade, 01-06: the interval of the closed loop's typical NEES/15 above "
            f"{TOO_SURE:g}; and its accelerometer and gyro biases worse than the open loop's; both must "
            "hold",
            {
                "sure": over(choose_flights(SHORT, NAVIGATION), too_sure),
                "wanders": over(choose_flights(SHORT, NAVIGATION), biases_better, OPEN),
            },
            "Too sure: {sure} (closed {closed_min:.3g} to {closed_max:.3g}, open {open_min:.3g} to "
            "{open_max:.3g}). Biases better in the open loop: {wanders}",
            "table flights, figures 8b and 9",
            {
                f"{loop}_{how}": over(
                    choose_flights(SHORT, NAVIGATION), column_value, f"{loop}_anees", how
                )
                for loop in ("open", "closed")
                for how in ("min", "max")
            },
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the closed loop's NEES/15 is "
            "{closed_min:.3g} to {closed_max:.3g}, the open loop's {open_min:.3g} to {open_max:.3g}.",
        ),
        (*WORLD, START, UPDATE, WITHOUT_COUNT),
    ),
    "linearisation": ReadClaim(
        Claim(
            "The difference is not a linearisation discrepancy as such: the open loop degrades because "
            "the accumulated drift violates the small-error assumption behind its linear error model.",
            "V",
            "runs of all cells: the rank correlation of the raw INS's drift with the ratio of the "
            "NEES, open by closed, is above 0.5 on average (95 % interval)\n"
            f"at each grade, while the INS has drifted by less than {SMALL_DRIFT:g} m and "
            f"{SMALL_TURN:g} deg, the NEES differ by less than {TOO_SURE - 1:.0%}\n"
            f"at less than {SMALL_DRIFT:g} m and beyond {LARGE_TURN:g} deg, where that is met, the open "
            "loop's NEES is larger by more than that, so that the attitude is not a matter of time\n"
            "all must hold",
            {"explains": over(DRIFT, drift_explains)},
            "{explains}",
            "figure 8, tables drift and turns",
            {"grades": over(DRIFT, drift_by_grade)},
            lacks=lambda e: "" if e.drift is not None else "its drift was not measured",
            kind=EXPLANATION,
            answer=f"Below {SMALL_DRIFT:g} m and {SMALL_TURN:g} deg of drift of the raw INS the NEES "
            "open by closed is {grades}.",
        ),
        (SIGMA, BIASES, START),
    ),
    "dynamic_flights": ReadClaim(
        Claim(
            "Dynamic flights amplify integration errors, in particular of the open loop (03 and 05 at "
            "consumer and tactical grade).",
            "V",
            "the paths of the paper's 03 and 05 are not published, so their numbers cannot be checked\n"
            "instead, consumer and tactical: the open-loop RMSE of a dynamic flight is larger than that "
            "of the straight flight 10 over the same time (by the 500 m rule alone; interval of their "
            f"ratio, beyond {SIZE:.0%})",
            {"amplified": over(FLIGHTS, judge_amplification, (CONSUMER, TACTICAL))},
            "{amplified}. Our own 03 and 05: {own}",
            "figure 2, table flights",
            {
                "own": over(
                    choose_flights(("03", "05"), CONSUMER, TACTICAL),
                    each,
                    "{r.grade} {r.flight}: {r.open_censored_500_m:.3g} m",
                    ", ",
                )
            },
            kind=MOSTLY,
            answer="The open loop errs more on a dynamic flight than over the same time of a straight "
            "one: {amplified}.",
        ),
        WORLD,
    ),
    "roll_pitch": ReadClaim(
        Claim(
            "The closed loop gives better roll and pitch with consumer and tactical IMUs.",
            "V, Fig. 4",
            "tilt, roll and pitch together; both grades must hold",
            {
                grade: over(choose_flights(ALL, grade), better_by, "tilt", CLOSED)
                for grade in (CONSUMER, TACTICAL)
            },
            "Consumer: {consumer}. Tactical: {tactical}",
            "figure 4",
            {
                f"{grade}_change": over(choose_flights(ALL, grade), change, "tilt")
                for grade in (CONSUMER, TACTICAL)
            },
            kind=MOSTLY,
            answer="The open loop's tilt RMSE against the closed one's is {consumer_change} at "
            "consumer and {tactical_change} at tactical grade (medians over flights).",
            identity=over(choose_flights(ALL, CONSUMER, TACTICAL), one_filter("tilt")),
        ),
        (*WORLD, UPDATE, WITHOUT_COUNT),
    ),
    "heading": ReadClaim(
        Claim(
            "Open loops better preserve heading with good enough sensors.",
            "V, Fig. 4; VI",
            "navigation grade, all flights: open loop better in heading",
            {"open": over(choose_flights(ALL, NAVIGATION), better_by, "heading", OPEN)},
            "{open}",
            "figure 4",
            {"change": over(choose_flights(ALL, NAVIGATION), change, "heading")},
            kind=MOSTLY,
            answer="At navigation grade the open loop's heading RMSE against the closed one's is "
            "{change} (median over all flights).",
            identity=over(choose_flights(ALL, NAVIGATION), one_filter("heading")),
        ),
        (*WORLD, START, UPDATE, WITHOUT_COUNT),
    ),
    "heading_degraded": ReadClaim(
        Claim(
            "With navigation-grade IMUs feedback is a perturbation that degrades heading accuracy.",
            "VI",
            "as the claim before on the short flights 01-06, where the open loop has hardly drifted",
            {"open": over(choose_flights(SHORT, NAVIGATION), better_by, "heading", OPEN)},
            "{open}",
            "figure 4",
            {"change": over(choose_flights(SHORT, NAVIGATION), change, "heading")},
            kind=MOSTLY,
            answer="At navigation grade on flights 01-06 the open loop's heading RMSE against the "
            "closed one's is {change} (median).",
            identity=over(choose_flights(SHORT, NAVIGATION), one_filter("heading")),
        ),
        (*WORLD, START, UPDATE, WITHOUT_COUNT),
    ),
    "offset_unstable": ReadClaim(
        Claim(
            "An unknown constant accelerometer offset of 0.5 m/s^2 makes the open loop unstable, "
            "early; long flights fail.",
            "V, Figs. 5, 6",
            "flights 01-07 with offset, all grades: fewer than half of the open-loop runs survive "
            "(Wilson)",
            {"fails": over(OFFSET, runs_that, "open_survived", more=False)},
            "{fails}; interrupted after {lasted:.0f} s (median over cells)",
            "figures 5 and 6",
            {
                "lasted": over(OFFSET, column_value, "open_lasted_median_s"),
                "survive": over(OFFSET, cells_above, "open_survived"),
            },
            kind=MOSTLY,
            answer="Most open-loop runs with offset survive the 500 m rule on {survive} flights and "
            "grades; both rules interrupt them after {lasted:.0f} s.",
        ),
        (*WORLD, START, WITHOUT_COUNT, AS_OFFSET),
    ),
    "offset_shortens": ReadClaim(
        Claim(
            "An unknown initial bias reduces the stable runtime of the open loop.",
            "VI",
            f"time until the position error exceeds {ONSET:g} m, at most the flight's, with offset "
            "shorter than without (interval of their ratio; a flight that ends before both says "
            "nothing)",
            {"sooner": over(with_and_without, sooner, "open_onset_s")},
            "{sooner}",
            "figure 6, tables",
            kind=MOSTLY,
            answer=f"The open loop errs by {ONSET:g} m sooner with offset than without: {{sooner}}.",
        ),
        (*WORLD, START, AS_OFFSET),
    ),
    "offset_isolated": ReadClaim(
        Claim(
            "The closed loop directly isolates the offset, its estimates converge smoothly and stay "
            "bounded.",
            "V, Fig. 5",
            "flights 01-07 with offset, all grades: more than half of the closed-loop runs survive "
            "(Wilson); and the accelerometer bias error at the end is at most twice that without "
            "offset (intervals); both must hold",
            {
                "survives": over(OFFSET, runs_that, "closed_survived"),
                "converged": over(with_and_without, as_small, BIAS_ERROR, 2.0),
            },
            "Survives: {survives}. Converged: {converged}",
            "figures 5 and 6",
            {"end": over(OFFSET, column_value, BIAS_ERROR)},
            kind=MOSTLY,
            answer="At the end the closed loop's accelerometer bias is wrong by {end:.2g} m/s² "
            "(median over cells); at most twice as much as without offset: {converged}.",
        ),
        (*WORLD, START, UPDATE, WITHOUT_COUNT, AS_OFFSET),
    ),
    "straight_is_slow": ReadClaim(
        Claim(
            "On straight flights even the closed loop takes longer to resolve the accelerometer "
            "bias; manoeuvres accelerate it.",
            "V",
            "with offset, each grade: the time until the closed loop's accelerometer bias error stays "
            f"below {RESOLVED:g} m/s^2 is shorter on a dynamic flight than on the straight 07 (interval "
            "of their ratio; a flight that ends before says nothing)",
            {"shorter": over(OFFSET, against_straight, "closed_resolved_s", -1)},
            "{shorter}. {times}",
            "figure 5, table offset",
            {"times": over(OFFSET, times_beside_straight, "closed_resolved_s")},
            kind=MOSTLY,
            answer="The bias is resolved sooner on dynamic flights than on the straight one: "
            "{shorter}.",
        ),
        (*WORLD, START, UPDATE, AS_OFFSET),
    ),
    "symptoms_delayed": ReadClaim(
        Claim(
            "Short dynamic flights delay the visible symptoms of the offset in the open loop.",
            "V",
            "with offset, each grade: the time until the open loop's position error exceeds "
            f"{ONSET:g} m is longer on a dynamic flight than on the straight 07 (interval of their "
            "ratio)\n"
            "a flight that ends before its symptoms supports it where 07 has failed by then, and else "
            "says nothing",
            {"longer": over(OFFSET, against_straight, "open_onset_s", 1)},
            "{longer}. {times}",
            "table offset",
            {"times": over(OFFSET, times_beside_straight, "open_onset_s")},
            kind=MOSTLY,
            answer=f"Errors of {ONSET:g} m come later on dynamic flights than on the straight one: "
            "{longer}.",
        ),
        (*WORLD, START, AS_OFFSET),
    ),
    "closed_is_bounded": ReadClaim(
        Claim(
            "The closed loop is stable and bounded over long horizons.",
            "Abstract; V",
            "flights 07-11, all grades: more than half of the closed-loop runs survive (Wilson)",
            {"survives": over(choose_flights(LONG, *GRADES), runs_that, "closed_survived", always)},
            "{survives}",
            "figures 2 and 9",
            {"survive": over(choose_flights(LONG, *GRADES), cells_above, "closed_survived")},
            kind=ALWAYS,
            answer="On flights 07-11 most closed-loop runs survive the 500 m rule on {survive} flights "
            "and grades.",
        ),
        (*WORLD, START, UPDATE, WITHOUT_COUNT),
    ),
    "mandatory": ReadClaim(
        Claim(
            "Closed loops are mandatory to prevent divergence with lower-grade sensors.",
            "VI",
            f"consumer grade, all flights: more than half of the open-loop runs exceed {ONSET:g} m, and "
            "fewer than half of the closed-loop runs (Wilson); both must hold",
            {
                "diverges": over(choose_flights(ALL, CONSUMER), runs_that, "open_diverged", always),
                "kept": over(
                    choose_flights(ALL, CONSUMER), runs_that, "closed_diverged", always, False
                ),
            },
            "Open loop diverges: {diverges}. Closed loop does not: {kept}",
            "figures 2 and 9",
            {
                "open": over(choose_flights(ALL, CONSUMER), cells_above, "open_diverged"),
                "closed": over(choose_flights(ALL, CONSUMER), cells_above, "closed_diverged"),
            },
            kind=ALWAYS,
            answer=f"At consumer grade most open-loop runs exceed {ONSET:g} m on {{open}} flights, "
            "most closed-loop runs on {closed}.",
        ),
        (*WORLD, UPDATE),
    ),
    "resets": ReadClaim(
        Claim(
            "Long-term stability can also be obtained by occasional resets.",
            "VI",
            f"tactical grade, the longest flight of the ablation, resets every {RARELY:.0f} s or more "
            "rarely: more than half of the runs survive (Wilson) and the position RMSE is not worse "
            f"than the closed loop's (ratio below {1 + SIZE:g} with its interval)\n"
            "one such interval reproduces it",
            {"resets": over(RESETS, stable_by_resets)},
            "{resets}",
            "ablation resets",
            {"rarest": over(RESETS, rarest_that_holds)},
            lacks=lambda e: "" if e.resets is not None and len(e.resets) else NO_ABLATIONS,
            kind=MORE_THAN,
            answer="On the longest flight most runs survive with resets as rare as every {rarest}.",
        ),
    ),
    "covariance_contained": ReadClaim(
        Claim(
            "The open loop's error state grows without bound, while its covariance stays contained by "
            "the measurement updates.",
            "IV-A",
            "all flights and grades: the stated standard deviation of the position never exceeds that "
            f"of a fix, {FIX_STD:g} m on each axis, after 120 s, in more than half of the runs (Wilson)\n"
            "and the raw INS has drifted farther in the last quarter of the flight than in the one "
            "before, in more than half of the runs; both must hold",
            {
                "contained": over(
                    choose_flights(ALL, *GRADES), runs_that, "open_contained", always
                ),
                "grows": over(DRIFT, ins_grows),
            },
            "Contained: {contained}. INS drifts farther: {grows}",
            "figure 3, table drift-runs",
            {"cells": over(choose_flights(ALL, *GRADES), cells_above, "open_contained")},
            lacks=lambda e: "" if e.drift is not None else "its drift was not measured",
            kind=ALWAYS,
            answer="The open loop's stated position error stays below a fix's on {cells} flights and "
            "grades; the raw INS drifts farther towards the end in {grows}.",
        ),
        (SIGMA, BIASES, START),
    ),
    "bias_in_either": ReadClaim(
        Claim(
            "The bias dynamics can evolve either in the INS or in the error state.",
            "IV-B",
            "tactical grade, flights of the ablation: position and heading RMSE of the two differ by "
            f"less than {SIZE:.0%} with their intervals",
            {"alike": over(PLACES, one_result, ("position_500", "heading_500"))},
            "{alike} ({changes})",
            "ablation bias",
            {"changes": over(PLACES, ratios, "position_500")},
            lacks=lambda e: "" if e.places is not None and len(e.places) else NO_ABLATIONS,
            kind=ALWAYS,
            answer="With the bias in the INS and in the error state, results agree within "
            f"{SIZE:.0%}: {{alike}}.",
        ),
    ),
    "false_stability": ReadClaim(
        Claim(
            "With the offset the open loop maintains false short-term stability until it amplifies the "
            "offset into divergence.",
            "V, Fig. 5",
            "flights 01-07 with offset, all grades: the run is interrupted as inconsistent before its "
            f"position errs by {ONSET:g} m (interval of the ratio of the times)\n"
            f"and more than half of the runs err by {ONSET:g} m before the end (Wilson); both must hold",
            {
                "hidden": over(OFFSET, stays_small_while_wrong),
                "diverges": over(OFFSET, runs_that, "open_diverged"),
            },
            "Inconsistent before it is visible: {hidden}. Diverges: {diverges}",
            "figures 5 and 6, table offset",
            {
                "lasted": over(OFFSET, column_value, "open_given_up_s"),
                "onset": over(OFFSET, column_value, "open_onset_s"),
            },
            kind=MOSTLY,
            answer="With offset the open loop is inconsistent after {lasted:.0f} s and errs by "
            f"{ONSET:g} m after {{onset:.0f}} s (medians over cells).",
        ),
        (*WORLD, START, AS_OFFSET),
    ),
}
"""In the order of the paper; the last three are statements that were added later."""


def claims(
    evidence: FlownReadings,
) -> tuple[list[dict[str, Any]], list[dict[read.WorldReading, str]]]:
    """(findings, verdicts of each by reading) on all claims."""
    found = [read.verdicts(each, evidence) for each in CLAIMS.values()]
    told = [read.finding(each, evidence, own) for each, own in zip(CLAIMS.values(), found)]
    return told, found
