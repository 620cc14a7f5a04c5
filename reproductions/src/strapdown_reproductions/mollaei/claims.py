"""Claims of Mollaei et al. on EKF, UKF and PKF in the loop of an aircraft, each decided by a rule
from the tables of flights; the kinds of rules are in rules.py."""

from operator import attrgetter
from typing import Any, NamedTuple

from ..common import kinds
from ..common.claims import Claim, ClaimKind, findings, over
from .cells import (
    CKF,
    DIRECT,
    E0,
    E1,
    E2,
    EKF,
    EKFS,
    FILTERS,
    NO_FILTER,
    OUTLIERS,
    PKF,
    PUBLISHED,
    UKF,
)
from .metrics import DEVIATIONS
from .noise_of_state import NoiseOfState, carries_noise_of_state
from .outliers import FACTOR, SHARE
from .rules import (
    AWAY,
    BY_ALGEBRA,
    CONTROLS,
    NEAR,
    NEARLY_ALL,
    OVERSHOOTS,
    PRINTED_ALL,
    PRINTED_DEVIATIONS,
    PRINTED_Y,
    SAME,
    SETTLING,
    TWICE,
    ZERO,
    MollaeiEvidence,
    Pair,
    Voting,
    aileron_ratios,
    algebra,
    away,
    better,
    by_case,
    cause,
    choose_flown,
    count_not_away,
    count_printed,
    ends,
    enough,
    less_pronounced,
    lost_by_truth,
    lost_once,
    medians,
    middles,
    near,
    nearly_all,
    no_larger,
    one_filter,
    printed_overshoots,
    resembles,
    rows_smaller,
    sides,
    suitable,
    symmetric,
    worse_than_filters,
)

CELLS = (
    "a cell is a measure in a case (an experiment, Q and R from the sensors or as printed); a filter "
    "is better where the 95 % interval of the ratio over the seeds lies below 1 by more than 1 %, "
    "and is not where it lies above that; cells in which the filters are one by algebra do not vote "
    "and are counted apart"
)
READ = (
    "judged in each reading of the EKF, of the PKF, of no filter, of what is flown and of who "
    "predicts: with opposite verdicts it depends on the reading, else the least favourable"
)
BY_FEEDBACK = (
    "judged for the last fix and for the true state as direct feedback: with opposite verdicts it "
    "depends"
)
TWO_FINALS = (
    "with the final value of the flight itself, and with that of the reference flight, which are "
    "readings too"
)
TWO_OVERSHOOTS = "as share of the final value and as share of the step, which are readings too"
BY_WHO = "judged for the IMU and for the model as what predicts: with opposite verdicts it depends"
NONLINEAR = (UKF, PKF)
BOTH = ((UKF, EKF), (PKF, EKF))
RESEMBLE = (
    f"a curve of E0 resembles that of direct feedback where its rms distance is less than "
    f"1/{TWICE:g} of what that curve itself deviates, in most cells; {BY_FEEDBACK}, as with who "
    "predicts"
)
FROM_REFERENCE = tuple(f"{name}_ref" for name in DEVIATIONS)
OF_STEP = ("step_x_pct", "step_z_pct")
"""The second readings of DEVIATIONS and OVERSHOOTS."""


class ClaimComparison(NamedTuple):
    """A comparison of the first mode of each pair with the second."""

    experiments: tuple[str, ...]
    measures: tuple[str, ...]
    pairs: tuple[Pair, ...]
    # measures of a second reading, which is judged too, and names of the two readings
    others: tuple[str, ...] = ()
    how: str = ""
    voting: Voting = sides


def compare_modes(
    text: str,
    source: str,
    of: ClaimComparison,
    decided_by: str,
    extra: str = "",
    kind: ClaimKind = kinds.OVERALL,
) -> Claim:
    """The row of a claim that the first mode of each pair is better in all experiments and
    measures; extra: text after the measured values."""
    cells = choose_flown(*of.experiments)
    return Claim(
        text,
        source,
        "; ".join(filter(None, (CELLS, "all pairs must hold", READ, of.how))),
        {"better": over(cells, better, of.measures, of.pairs, of.others, of.voting)},
        f"{{better}}{extra}",
        decided_by,
        kind=kind,
        answer="{better.answer}",
        identity=over(cells, algebra, of.pairs),
    )


def compare_alike(*args: Any, **options: Any) -> Claim:
    """The row of `compare_modes` for a claim that also says that the filters resemble direct
    feedback."""
    row = compare_modes(*args, **options)
    curves = over(choose_flown(E0), resembles, DEVIATIONS, NONLINEAR)
    return row._replace(
        identity=None,
        rule=f"{RESEMBLE}; {row.rule}",
        parts={"resembles": curves, **row.parts},
        measured=f"Resemblance: {{resembles}}. {row.measured}",
        answer="Resemblance {resembles.verdict}, greater deviations {better.verdict}. "
        "{better.answer}",
    )


CLAIMS = {
    "accurate_estimates": compare_modes(
        "Nonlinear filters, particularly the PKF, outperform the EKF in accurate position and "
        "velocity estimates.",
        "Abstract; 5",
        ClaimComparison(
            (E0, E1), ("horizontal_rmse_m", "vertical_rmse_m", "velocity_rmse_m_s"), BOTH
        ),
        'figure 8; tables "Left out"',
        extra=". The paper shows no error of an estimate",
    ),
    "prevents_divergence": Claim(
        "Nonlinear filters prevent divergence of the system in GPS outages; Kalman filtering "
        "effectively prevents divergence of the autopilot.",
        "Abstract; 5",
        f"a cell is a case and a filter, UKF or PKF, of E1 and E2: of its flights more than "
        f"{NEARLY_ALL:.0%} (Wilson) do not diverge: neither stop nor have estimate or aircraft more "
        f"than {AWAY:g} m off; {enough(200)}; {BY_WHO}",
        {"kept": over(choose_flown(E1, E2), nearly_all, count_not_away, NONLINEAR)},
        "{kept}. Not diverged: {flights}",
        "figures 8, 10",
        {
            "flights": over(choose_flown(E1, E2), by_case, count_not_away, NONLINEAR),
            "long": over(choose_flown(E2), by_case, count_not_away, NONLINEAR),
        },
        kind=kinds.ALWAYS,
        answer="Not diverged in five minutes: {long}.",
    ),
    "ekf_deviates": compare_alike(
        "With fixes, UKF and PKF resemble the direct feedback, while the EKF leads to greater "
        "deviations of forces and moments.",
        "4; Table 2",
        ClaimComparison((E0,), DEVIATIONS, BOTH, FROM_REFERENCE, TWO_FINALS),
        "Table 2 redrawn; figure 2",
        extra=rows_smaller("Table 2", PRINTED_DEVIATIONS, EKF),
    ),
    "better_than_none": compare_modes(
        "With fixes, deviations and overshoots are smaller with UKF and PKF than without a filter.",
        "4; its Table 2 contradicts it in most rows",
        ClaimComparison(
            (E0,),
            (*DEVIATIONS, *OVERSHOOTS),
            ((UKF, NO_FILTER), (PKF, NO_FILTER)),
            (*FROM_REFERENCE, *OF_STEP),
            TWO_FINALS,
        ),
        "Table 2 redrawn",
        extra=rows_smaller("Table 2", PRINTED_ALL, NO_FILTER),
    ),
    "overshoots": compare_modes(
        "The overshoot of velocity is smaller with UKF and PKF than with the EKF.",
        "4; 4.1; its Table 2 has 5.07 % in X with the EKF and 56.36 % with the UKF",
        ClaimComparison((E0, E1), OVERSHOOTS, BOTH, OF_STEP, TWO_OVERSHOOTS),
        "Tables 2, 3 redrawn; figure 3",
        extra=(
            ". Published rows smaller: "
            + "; ".join(
                f"{table} UKF {count_printed(table, OVERSHOOTS, UKF, EKF)}, PKF "
                f"{count_printed(table, OVERSHOOTS, PKF, EKF)}"
                for table in ("Table 2", "Table 3")
            )
        ),
    ),
    "elevator_and_rudder": compare_modes(
        "With fixes, the deviations of elevator and rudder are smaller with UKF and PKF than with "
        "the EKF or no filter.",
        "4",
        ClaimComparison(
            (E0,),
            ("elevator_deg", "rudder_deg"),
            (*BOTH, (UKF, NO_FILTER), (PKF, NO_FILTER)),
            ("elevator_deg_ref", "rudder_deg_ref"),
            TWO_FINALS,
        ),
        "figure 1",
    ),
    "engine_and_alpha": compare_modes(
        "Engine speed, AOF and elevator deviate less with UKF and PKF than with the EKF.",
        "4; 4.1; AOF taken as the angle of attack",
        ClaimComparison(
            (E0, E1),
            ("engine_rad_s", "alpha_deg", "elevator_deg"),
            BOTH,
            ("engine_rad_s_ref", "alpha_deg_ref", "elevator_deg_ref"),
            TWO_FINALS,
        ),
        "figures 1, 4",
    ),
    "symmetric": Claim(
        "Fy and Gy do not deviate at all from their final values (0 in all rows).",
        "Tables 2 to 4",
        f"a cell is a flight of E0, without an interval: the rms deviations of Fy and of the lateral "
        f"weight are below {ZERO:g} N, printed as 0.0000",
        {"zero": over(choose_flown(E0), symmetric)},
        "{zero}. Exact zeros mean that nothing lateral is estimated or flown",
        "Table 2 redrawn",
        kind=kinds.ALWAYS,
        answer="{zero}.",
    ),
    "no_filter_diverges": Claim(
        "Without a filter the parameters diverge when the GPS is cut, and the position goes to "
        "zero.",
        "4.1; Table 3; figures 4, 5",
        f"a cell is Fx or Fz in a case of E1, against EKF, UKF and PKF: it deviates at least "
        f"{TWICE:g} times as much; {BY_FEEDBACK}. That the position goes to zero is how no filter is made here, "
        "and not judged",
        {"deviates": over(choose_flown(E1), worse_than_filters, ("fx_n", "fz_n"), FILTERS, TWICE)},
        f"{{deviates}}. Stopped or more than {AWAY:g} m off: {{lost}}",
        "figures 4, 5",
        {"lost": over(choose_flown(E1), lost_once, NO_FILTER)},
        kind=kinds.ALWAYS,
        answer="{deviates}.",
    ),
    "wrong_alpha": Claim(
        "Without a filter AOF converges to an incorrect value after the cut; with a filter it does "
        "not.",
        "4.1; AOF taken as the angle of attack",
        f"a cell is a case of E1, against EKF, UKF and PKF: the final value is at least {TWICE:g} "
        f"times as far from that of the reference flight; {BY_FEEDBACK}",
        {"off": over(choose_flown(E1), worse_than_filters, ("alpha_off_deg",), FILTERS, TWICE)},
        "{off}; {medians}",
        "figure 4",
        {"medians": over(choose_flown(E1), medians, "alpha_off_deg", "deg")},
        kind=kinds.ALWAYS,
        answer="{off}.",
    ),
    "convergence": compare_modes(
        "The curves of UKF and PKF converge much faster than those of the EKF.",
        "4.1",
        ClaimComparison((E1,), SETTLING, BOTH),
        "figure 4",
        extra=". Settled: elevator, engine speed and angle of attack within a tenth of the reference "
        "flight's range about the final value",
    ),
    "position_in_outage": compare_modes(
        "After the cut the position estimates of UKF and PKF are more accurate than those of the "
        "EKF.",
        "4.1; figure 5",
        ClaimComparison(
            (E1,),
            (
                "outage_horizontal_rmse_m",
                "outage_vertical_rmse_m",
                "horizontal_end_m",
                "vertical_end_m",
            ),
            BOTH,
        ),
        "figures 5, 8",
    ),
    "deviations_in_outage": compare_modes(
        "With the GPS cut, forces and moments deviate less with UKF and PKF than with the EKF.",
        "4.1; Table 3",
        ClaimComparison((E1,), DEVIATIONS, BOTH, FROM_REFERENCE, TWO_FINALS),
        "Table 3 redrawn",
        extra=rows_smaller("Table 3", PRINTED_DEVIATIONS, EKF),
    ),
    "nonlinearity": Claim(
        "The EKF is not suitable, because it needs a linearised model and the system has many "
        "nonlinear factors.",
        "4; 4.1",
        f"the effect: forces and moments deviate at least {TWICE:g} times as much with the EKF as "
        "with the UKF in most cells of E0 and E1 (published: 2.9 to 19 times); what is to cause it: "
        "the model, which is not linear, in place of the IMU, with which the process is; in each "
        "reading of the EKF: with opposite verdicts it depends on the reading, else the least "
        "favourable",
        {"effect": over(choose_flown(E0, E1), suitable, DEVIATIONS, UKF, TWICE)},
        "{effect}",
        'Tables 2, 3 redrawn; figure 9; table "Readings"',
        kind=kinds.EXPLANATION,
        answer="{effect.answer}",
    ),
    "pkf_over_ukf": compare_modes(
        "The PKF usually gives a better response than the UKF: smaller deviations and overshoots.",
        "4.1; 4.2; Tables 3, 4",
        ClaimComparison(
            (E1, E2),
            (*DEVIATIONS, *OVERSHOOTS),
            ((PKF, UKF),),
            (*FROM_REFERENCE, *OF_STEP),
            TWO_FINALS,
        ),
        "Tables 3, 4 redrawn; figure 9",
        extra=(
            ". Published rows smaller: "
            + "; ".join(
                f"{table} {count_printed(table, PRINTED_ALL, PKF, UKF)}" for table in PUBLISHED
            )
        ),
        kind=kinds.MOSTLY,
    ),
    "long_outage": Claim(
        "Without a filter or with the EKF, prolonged outages cause divergence.",
        "4.2, said of results that are not shown",
        "of the flights of E2: they stop, or have the aircraft or, with a filter, the estimate more "
        f"than {AWAY:g} m off; both must hold, each in each reading, of direct feedback, of the EKF and of who "
        "predicts: with opposite verdicts it depends on the reading, else the least favourable",
        {
            "without": over(choose_flown(E2), cause, list(DIRECT)),
            "ekf": over(choose_flown(E2), cause, list(EKFS)),
        },
        "{without}. {ekf}. Beside them, diverged: {others}",
        "figures 6, 10",
        {
            "others": over(choose_flown(E2), by_case, away, NONLINEAR),
            "lost": over(choose_flown(E2), by_case, away, [EKF]),
            "none": over(choose_flown(E2), lost_once, NO_FILTER),
            "fed": over(choose_flown(E2), lost_by_truth),
        },
        kind=kinds.MOSTLY,
        answer="Diverged: no filter {none}, by true feedback {fed}; EKF {lost}; UKF and PKF {others}.",
    ),
    "much_less": Claim(
        "In five minutes without GPS the path is tracked with an error much less than 500 m.",
        "4.1; 4.2",
        f"a cell is a case and a filter, UKF or PKF, of E2: estimate and aircraft stay within "
        f"{NEAR:g} m in more than {NEARLY_ALL:.0%} (Wilson) of its flights; {enough(200)}; {BY_WHO}",
        {"near": over(choose_flown(E2), nearly_all, near, NONLINEAR)},
        "{near}. Horizontal error of the estimate at the end: {ends}",
        "figure 10",
        {
            "within": over(choose_flown(E2), by_case, near, NONLINEAR),
            "ends": over(choose_flown(E2), ends, "horizontal_end_m", NONLINEAR),
        },
        kind=kinds.ALWAYS,
        answer=f"Within {NEAR:g} m: {{within}}.",
    ),
    "fastest": compare_modes(
        "The PKF converges the fastest.",
        "5; 4.2",
        ClaimComparison((E0, E1, E2), SETTLING, ((PKF, UKF), (PKF, EKF))),
        "figures 1, 4, 7",
    ),
    "negligible": Claim(
        "In outages the positional error is reduced to negligible levels.",
        "5",
        f"a cell is a case and a filter, UKF or PKF, of E1 and E2: the horizontal RMSE of the "
        f"estimate in the outage is less than {TWICE:g} times that before it (geometric mean over "
        f"the flights); {BY_WHO}",
        {
            "outage": over(
                choose_flown(E1, E2),
                no_larger,
                "outage_horizontal_rmse_m",
                "fixed_horizontal_rmse_m",
                NONLINEAR,
            )
        },
        "{outage}",
        "figures 8, 10",
        {"ends": over(choose_flown(E2), ends, "outage_horizontal_rmse_m", NONLINEAR)},
        kind=kinds.ALWAYS,
        answer="Horizontal RMSE in five minutes of outage: {ends}.",
    ),
    "one_filter": Claim(
        "(Not said:) With positions and velocities as its states and driven by the IMU, the model "
        "is linear, and EKF and UKF are one filter; "
        "the PKF is it too, but for its random draws.",
        '4: "the previous position values (X, Y, Z) and velocities along the three axes were used '
        'as state variables"',
        f"in all IMU-driven flights estimate and aircraft are within {SAME:g} m of those with the "
        f"EKF, at every sample, with the UKF",
        {"ukf": over(attrgetter("apart"), one_filter)},
        "{ukf}",
        "figure 9",
        kind=kinds.ALWAYS,
        answer="{ukf}.",
        identity=lambda evidence: BY_ALGEBRA,
    ),
    "aileron": compare_modes(
        "Of UKF and PKF the deviations of Ue and Ur are significantly smaller than with the EKF or "
        "no filter; for Ua this difference is less pronounced.",
        "4",
        ClaimComparison(
            (E0,),
            CONTROLS,
            (*BOTH, (UKF, NO_FILTER), (PKF, NO_FILTER)),
            tuple(f"{name}_ref" for name in CONTROLS),
            "a cell supports it where Ue or Ur is better, and its ratio smaller than that of Ua by "
            "more than 1 %; " + TWO_FINALS,
            less_pronounced,
        ),
        "figure 1",
    )._replace(
        answer="{better.answer} Ua beside Ue and Ur, median ratios: {aileron}.",
        shown={"aileron": over(choose_flown(E0), aileron_ratios, (*BOTH, (UKF, NO_FILTER)))},
    ),
    "overshoot_y": Claim(
        "The overshoots of velocity Y are negligible in all cases, ranging between 10 and 50.",
        "4; per cent, as the rows above it",
        f"a cell is a case of E0 and a mode: in more than half of the flights (Wilson) the overshoot "
        f"of velocity Y is between {PRINTED_Y[0]:g} and {PRINTED_Y[1]:g} % of the final value; "
        f"{BY_FEEDBACK}",
        {"inside": over(choose_flown(E0), printed_overshoots)},
        "{inside}; medians: {medians}",
        "figure 3",
        {"medians": over(choose_flown(E0), middles, "over_y_pct", "%", (*DIRECT, *FILTERS))},
        kind=kinds.ALWAYS,
        answer="Medians: {medians}. The final value is near zero, so that per cents of it say "
        "nothing.",
    ),
    "outliers": compare_modes(
        "With non-Gaussian noise or highly corrupted measurements the PKF is more reliable than "
        "the CKF.",
        f"1; flown with fixes of which {SHARE:.0%} have {FACTOR:g} times the error",
        ClaimComparison(
            (OUTLIERS,),
            (
                "fixed_horizontal_rmse_m",
                "outage_horizontal_rmse_m",
                "vertical_rmse_m",
                "velocity_rmse_m_s",
            ),
            ((PKF, CKF),),
        ),
        'table "Left out: outliers"',
        extra=". (36) weights by a Gaussian likelihood, and takes such a fix for what it states",
    ),
    "noise_of_state": Claim(
        "Even with noise dependent on the state vector, the filter can be easily used.",
        "3.3, of (39)",
        f"x (1 + w), x and w known to {NoiseOfState().share:.0%}: the variance by the points (37) to "
        "(39) is the exact one within 1 %",
        {"points": carries_noise_of_state},
        "{points}",
        "the text",
        kind=kinds.ALWAYS,
        answer="So it can, as the EKF can: {points}.",
        identity=lambda evidence: "a product of state and noise in closed form",
    ),
}
"""In the order of the paper; those that got a rule later stand at the end, so that numbers stay."""
NOT_JUDGED = (
    (
        "In the laboratory plant the error was greatly reduced, and the linear filter diverged "
        "completely.",
        "1",
        "no data, no number and no plant are published",
    ),
    (
        "The filters are applied to a six-degree-of-freedom model: a filter on the twelve states of "
        "(1) to (18).",
        "abstract; 2",
        "section 4 has six states, position and velocity; a filter on all twelve needs Q and R of "
        "the other six, which are not printed. The nearest are the 15 states driven by the model, "
        "which lose every flight of five minutes without gyros",
    ),
    (
        "The PKF's computational demands remain a consideration.",
        "5",
        'no bound is named; the table "Time of one flight" has ours',
    ),
)
"""[(sentence, where, why it has no rule)]."""


def claims(evidence: MollaeiEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
