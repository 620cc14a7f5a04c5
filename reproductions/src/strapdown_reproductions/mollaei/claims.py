"""What Mollaei et al. claim of EKF, UKF and PKF in the loop of an aircraft, each claim decided by a
rule from the tables of flights; the kinds of rules are in rules.py."""

from operator import attrgetter

from ..common.claims import Claim, findings, over
from ..common.paired_ratios import many_times
from ..common.verdicts import RULE
from .cells import E0, E1, E2, EKF, FILTERS, IMU, MODEL, NO_FILTER, PKF, PUBLISHED, UKF
from .rules import (
    AWAY,
    DEVIATIONS,
    NEAR,
    NEARLY_ALL,
    OVERSHOOTS,
    PRINTED_ALL,
    PRINTED_DEVIATIONS,
    SAME,
    SETTLING,
    TWICE,
    ZERO,
    Evidence,
    Pair,
    away,
    better,
    by_case,
    ends,
    enough,
    flown,
    kept,
    lost_once,
    median_ratios,
    medians,
    most_flights,
    near,
    no_larger,
    one_filter,
    printed,
    rows_smaller,
    slower_than_real_time,
    symmetric,
)

CELLS = (
    "a cell is a measure in one reading (IMU- or model-driven prediction, Q and R from the sensors "
    "or as printed); "
    "a filter is better where the 95 % interval of the ratio over the seeds lies below 1 by more "
    "than 1 %"
)
TWO_FINALS = (
    "judged with the final value of the flight itself and with that of the reference flight: "
    "with opposite verdicts it depends on the reading, else the less favourable"
)
TWO_OVERSHOOTS = "judged as share of the final value and as share of the step: with opposite verdicts it depends on the reading, else the less favourable"
NONLINEAR = (UKF, PKF)
BOTH = ((UKF, EKF), (PKF, EKF))
FROM_REFERENCE = tuple(f"{name}_ref" for name in DEVIATIONS)
OF_STEP = ("step_x_pct", "step_z_pct")
"""The second readings of DEVIATIONS and OVERSHOOTS."""


def compared(
    text: str,
    source: str,
    experiments: tuple[str, ...],
    measures: tuple[str, ...],
    pairs: tuple[Pair, ...],
    decided_by: str,
    others: tuple[str, ...] = (),
    how: str = "",
    extra: str = "",
) -> Claim:
    """The row of a claim that the first mode of each pair is better in `experiments`, in all
    `measures`; others: those of a second reading, which is judged too; how: what the two readings
    are; extra: said after what was measured."""
    cells = flown(*experiments)
    return Claim(
        text,
        source,
        "; ".join(filter(None, (CELLS, RULE, "all pairs must hold", how))),
        {"better": over(cells, better, measures, pairs, others)},
        f"{{better}}; {{ratios}}{extra}",
        decided_by,
        {"ratios": over(cells, median_ratios, measures, pairs)},
    )


CLAIMS = {
    "accurate_estimates": compared(
        "Nonlinear filters, particularly the PKF, outperform the EKF in accurate position and "
        "velocity estimates.",
        "Abstract; 5",
        (E0, E1),
        ("horizontal_rmse_m", "vertical_rmse_m", "velocity_rmse_m_s"),
        BOTH,
        'figure 8; tables "Left out"',
        extra=". The paper shows no error of an estimate",
    ),
    "prevents_divergence": Claim(
        "Nonlinear filters prevent divergence of the system in GPS outages; Kalman filtering "
        "effectively prevents divergence of the autopilot.",
        "Abstract; 5",
        f"of the flights of E1 and E2 with UKF or PKF, in each reading, more than {NEARLY_ALL:.0%} "
        f"(Wilson) do not diverge: "
        f"neither stop nor have estimate or aircraft more than {AWAY:g} m off; {enough(200)}, "
        f"{enough(50)}; {RULE}",
        {"kept": over(flown(E1, E2), most_flights, kept, NONLINEAR, NEARLY_ALL)},
        "{kept}. Diverged: {diverged}",
        "figures 8, 10",
        {"diverged": over(flown(E1, E2), by_case, away, NONLINEAR)},
    ),
    "ekf_deviates": compared(
        "With fixes, UKF and PKF resemble the direct feedback, while the EKF leads to greater "
        "deviations of forces and moments.",
        "4; Table 2",
        (E0,),
        DEVIATIONS,
        BOTH,
        "Table 2 redrawn; figure 2",
        FROM_REFERENCE,
        TWO_FINALS,
        rows_smaller("Table 2", PRINTED_DEVIATIONS, EKF),
    ),
    "better_than_none": compared(
        "With fixes, deviations and overshoots are smaller with UKF and PKF than without a filter.",
        "4; its Table 2 contradicts it in most rows",
        (E0,),
        (*DEVIATIONS, *OVERSHOOTS),
        ((UKF, NO_FILTER), (PKF, NO_FILTER)),
        "Table 2 redrawn",
        (*FROM_REFERENCE, *OF_STEP),
        TWO_FINALS,
        rows_smaller("Table 2", PRINTED_ALL, NO_FILTER),
    ),
    "overshoots": compared(
        "The overshoot of velocity is smaller with UKF and PKF than with the EKF.",
        "4; 4.1; its Table 2 has 5.07 % in X with the EKF and 56.36 % with the UKF",
        (E0, E1),
        OVERSHOOTS,
        BOTH,
        "Tables 2, 3 redrawn; figure 3",
        OF_STEP,
        TWO_OVERSHOOTS,
        ". Published rows smaller: "
        + "; ".join(
            f"{table} UKF {printed(table, OVERSHOOTS, UKF, EKF)}, PKF "
            f"{printed(table, OVERSHOOTS, PKF, EKF)}"
            for table in ("Table 2", "Table 3")
        ),
    ),
    "elevator_and_rudder": compared(
        "With fixes, the deviations of elevator and rudder are smaller with UKF and PKF than with "
        "the EKF or no filter.",
        "4",
        (E0,),
        ("elevator_deg", "rudder_deg"),
        (*BOTH, (UKF, NO_FILTER), (PKF, NO_FILTER)),
        "figure 1",
        ("elevator_deg_ref", "rudder_deg_ref"),
        TWO_FINALS,
    ),
    "engine_and_alpha": compared(
        "Engine speed, AOF and elevator deviate less with UKF and PKF than with the EKF.",
        "4; 4.1; AOF taken as the angle of attack",
        (E0, E1),
        ("engine_rad_s", "alpha_deg", "elevator_deg"),
        BOTH,
        "figures 1, 4",
        ("engine_rad_s_ref", "alpha_deg_ref", "elevator_deg_ref"),
        TWO_FINALS,
    ),
    "symmetric": Claim(
        "Fy and Gy do not deviate at all from their final values (0 in all rows).",
        "Tables 2 to 4",
        f"in E0 the rms deviations of Fy and of the lateral weight are below {ZERO:g} N, printed as "
        f"0.0000, in all flights; "
        "not reproduced where in none",
        {"zero": over(flown(E0), symmetric)},
        "{zero}. Exact zeros mean that nothing lateral is estimated or flown",
        "Table 2 redrawn",
    ),
    "no_filter_diverges": Claim(
        "Without a filter the parameters diverge when the GPS is cut, and the position goes to "
        "zero.",
        "4.1; Table 3; figures 4, 5",
        f"Fx and Fz deviate at least {TWICE:g} times as much (whole 95 % interval) as with EKF, UKF "
        f"and PKF; {RULE}; "
        "all three must hold. That the position goes to zero is how no filter is made here, and not "
        "judged",
        {
            mode: over(flown(E1), many_times, ("fx_n", "fz_n"), NO_FILTER, mode, TWICE)
            for mode in FILTERS
        },
        "Against EKF: {EKF}. Against UKF: {UKF}. Against PKF: {PKF}. "
        f"Stopped or more than {AWAY:g} m off: {{lost}}",
        "figures 4, 5",
        {"lost": over(flown(E1), lost_once, NO_FILTER)},
    ),
    "wrong_alpha": Claim(
        "Without a filter AOF converges to an incorrect value after the cut; with a filter it does "
        "not.",
        "4.1; AOF taken as the angle of attack",
        f"its final value is at least {TWICE:g} times as far (whole 95 % interval) from that of the "
        f"reference flight as with EKF, UKF and PKF; "
        f"{RULE}; all three must hold",
        {
            mode: over(flown(E1), many_times, ("alpha_off_deg",), NO_FILTER, mode, TWICE)
            for mode in FILTERS
        },
        "Against EKF: {EKF}. Against UKF: {UKF}. Against PKF: {PKF}; {medians}",
        "figure 4",
        {"medians": over(flown(E1), medians, "alpha_off_deg", "deg")},
    ),
    "convergence": compared(
        "The curves of UKF and PKF converge much faster than those of the EKF.",
        "4.1",
        (E1,),
        SETTLING,
        BOTH,
        "figure 4",
        extra=". Settled: elevator, engine speed and angle of attack within a tenth of the reference "
        "flight's range about the final value",
    ),
    "position_in_outage": compared(
        "After the cut the position estimates of UKF and PKF are more accurate than those of the "
        "EKF.",
        "4.1; figure 5",
        (E1,),
        (
            "outage_horizontal_rmse_m",
            "outage_vertical_rmse_m",
            "horizontal_end_m",
            "vertical_end_m",
        ),
        BOTH,
        "figures 5, 8",
    ),
    "deviations_in_outage": compared(
        "With the GPS cut, forces and moments deviate less with UKF and PKF than with the EKF.",
        "4.1; Table 3",
        (E1,),
        DEVIATIONS,
        BOTH,
        "Table 3 redrawn",
        FROM_REFERENCE,
        TWO_FINALS,
        rows_smaller("Table 3", PRINTED_DEVIATIONS, EKF),
    ),
    "nonlinearity": Claim(
        "The EKF is not suitable, because it needs a linearised model and the system has many "
        "nonlinear factors.",
        "4; 4.1",
        f"forces and moments deviate at least {TWICE:g} times as much (whole 95 % interval) with "
        f"the EKF as with the UKF, in E0 and E1 "
        f"(published: 2.9 to 19 times); {RULE}",
        {"all": over(flown(E0, E1), many_times, DEVIATIONS, EKF, UKF, TWICE)},
        "{all}. Of E1, IMU-driven, where the system is linear: {linear}. Model-driven: {driven}; "
        "{ratios}",
        "Tables 2, 3 redrawn; figure 9",
        {
            "linear": over(flown(E1, prediction=IMU), many_times, DEVIATIONS, EKF, UKF, TWICE),
            "driven": over(flown(E1, prediction=MODEL), many_times, DEVIATIONS, EKF, UKF, TWICE),
            "ratios": over(flown(E0, E1), median_ratios, DEVIATIONS, ((EKF, UKF),)),
        },
    ),
    "pkf_over_ukf": compared(
        "The PKF usually gives a better response than the UKF: smaller deviations and overshoots.",
        "4.1; 4.2; Tables 3, 4",
        (E1, E2),
        (*DEVIATIONS, *OVERSHOOTS),
        ((PKF, UKF),),
        "Tables 3, 4 redrawn; figure 9",
        (*FROM_REFERENCE, *OF_STEP),
        TWO_FINALS,
        ". Published rows smaller: "
        + "; ".join(f"{table} {printed(table, PRINTED_ALL, PKF, UKF)}" for table in PUBLISHED),
    ),
    "long_outage": Claim(
        "Without a filter or with the EKF, prolonged outages cause divergence.",
        "4.2, said of results that are not shown",
        "in E2 more than half of the flights (Wilson) stop, or have the aircraft or, with a filter, "
        "the estimate "
        f"more than {AWAY:g} m off; {RULE}; both must hold",
        {
            "without": over(flown(E2), most_flights, away, [NO_FILTER]),
            "ekf": over(flown(E2), most_flights, away, [EKF]),
        },
        f"{NO_FILTER}: {{without}}, {{without_by}}. {EKF}: {{ekf}}, {{ekf_by}}. Beside them "
        f"{UKF} {{ukf_by}}, {PKF} {{pkf_by}}",
        "figures 6, 10",
        {
            f"{name}_by": over(flown(E2), by_case, away, [mode])
            for name, mode in (("without", NO_FILTER), ("ekf", EKF), ("ukf", UKF), ("pkf", PKF))
        },
    ),
    "much_less": Claim(
        "In five minutes without GPS the path is tracked with an error much less than 500 m.",
        "4.1; 4.2",
        f"estimate and aircraft stay within {NEAR:g} m in more than {NEARLY_ALL:.0%} (Wilson) of "
        f"the flights of E2 with UKF or PKF, "
        f"in each reading; {enough(50)}: one that does not leaves its reading open; {RULE}",
        {"near": over(flown(E2), most_flights, near, NONLINEAR, NEARLY_ALL)},
        "{near}. Within: {within}. Horizontal error of the estimate at the end: {ends}",
        "figure 10",
        {
            "within": over(flown(E2), by_case, near, NONLINEAR),
            "ends": over(flown(E2), ends, "horizontal_end_m", NONLINEAR),
        },
    ),
    "hour_and_a_half": Claim(
        "The 315 s with UKF and PKF take about an hour and a half.",
        "4.2",
        "reproduced where a flight takes longer than it lasts, one after the other on one core",
        {"time": over(attrgetter("seconds"), slower_than_real_time, NONLINEAR)},
        "{time}",
        'table "Time of one flight (E2)"',
    ),
    "fastest": compared(
        "The PKF converges the fastest.",
        "5; 4.2",
        (E0, E1, E2),
        SETTLING,
        ((PKF, UKF), (PKF, EKF)),
        "figures 1, 4, 7",
    ),
    "negligible": Claim(
        "In outages the positional error is reduced to negligible levels.",
        "5",
        f"the horizontal RMSE of the estimate in the outage is less than {TWICE:g} times that "
        f"before it (geometric mean over the flights, "
        f"whole 95 % interval), with UKF and PKF, in E1 and E2, in each reading; {RULE}",
        {
            "outage": over(
                flown(E1, E2),
                no_larger,
                "outage_horizontal_rmse_m",
                "fixed_horizontal_rmse_m",
                NONLINEAR,
            )
        },
        "{outage}",
        "figures 8, 10",
    ),
    "laboratory": Claim(
        "Tested in a scientific center and on a laboratory plant: the linear filter diverges "
        "completely when the GPS is cut, "
        "with theirs the error almost reaches its bound.",
        "1",
        "no data, no figure and no description of the plant are given: not decidable",
        {},
        "nothing to measure",
        "–",
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
    ),
}
"""In the order of the paper."""


def claims(evidence: Evidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
