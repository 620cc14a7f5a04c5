"""Claims of Mollaei et al. on EKF, UKF and PKF in the loop of an aircraft, each decided by a rule
from the tables of flights; the kinds of rules are in rules.py."""

from operator import attrgetter
from typing import NamedTuple

from ..common import kinds
from ..common.claims import Claim, ClaimKind, findings, over
from .cells import E0, E1, E2, EKF, EKFS, FILTERS, NO_FILTER, PKF, PUBLISHED, UKF
from .rules import (
    AWAY,
    BY_ALGEBRA,
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
    MollaeiEvidence,
    Pair,
    algebra,
    away,
    better,
    by_case,
    cause,
    ends,
    enough,
    flown,
    kept,
    lost_once,
    many_times,
    medians,
    near,
    nearly_all,
    no_larger,
    one_filter,
    printed,
    rows_smaller,
    suitable,
    symmetric,
)

CELLS = (
    "a cell is a measure in a case (an experiment, Q and R from the sensors or as printed); a filter "
    "is better where the 95 % interval of the ratio over the seeds lies below 1 by more than 1 %, "
    "and is not where it lies above that; cells in which the filters are one by algebra do not vote "
    "and are counted apart"
)
READ = (
    "judged in each reading of the EKF, of the PKF, of what is flown and of who predicts: with "
    "opposite verdicts it depends on the reading, else the least favourable"
)
TWO_FINALS = (
    "with the final value of the flight itself, and with that of the reference flight, which are "
    "readings too"
)
TWO_OVERSHOOTS = "as share of the final value and as share of the step, which are readings too"
BY_WHO = "judged for the IMU and for the model as what predicts: with opposite verdicts it depends"
NONLINEAR = (UKF, PKF)
BOTH = ((UKF, EKF), (PKF, EKF))
FROM_REFERENCE = tuple(f"{name}_ref" for name in DEVIATIONS)
OF_STEP = ("step_x_pct", "step_z_pct")
"""The second readings of DEVIATIONS and OVERSHOOTS."""


class ClaimComparison(NamedTuple):
    """A comparison of the first mode of each pair with the second."""

    experiments: tuple[str, ...]
    measures: tuple[str, ...]
    pairs: tuple[Pair, ...]
    # measures of a second reading, which is judged too, and what the two readings are
    others: tuple[str, ...] = ()
    how: str = ""


def compared(
    text: str,
    source: str,
    of: ClaimComparison,
    decided_by: str,
    extra: str = "",
    kind: ClaimKind = kinds.OVERALL,
) -> Claim:
    """The row of a claim that the first mode of each pair is better in all experiments and
    measures; extra: said after what was measured."""
    cells = flown(*of.experiments)
    return Claim(
        text,
        source,
        "; ".join(filter(None, (CELLS, "all pairs must hold", READ, of.how))),
        {"better": over(cells, better, of.measures, of.pairs, of.others)},
        f"{{better}}{extra}",
        decided_by,
        kind=kind,
        answer="{better.answer}",
        identity=over(cells, algebra, of.pairs),
    )


CLAIMS = {
    "accurate_estimates": compared(
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
        f"than {AWAY:g} m off; {enough(200)}, {enough(50)}; {BY_WHO}",
        {"kept": over(flown(E1, E2), nearly_all, kept, NONLINEAR)},
        "{kept}. Not diverged: {flights}",
        "figures 8, 10",
        {
            "flights": over(flown(E1, E2), by_case, kept, NONLINEAR),
            "long": over(flown(E2), by_case, kept, NONLINEAR),
        },
        kind=kinds.ALWAYS,
        answer="Not diverged in five minutes: {long}.",
    ),
    "ekf_deviates": compared(
        "With fixes, UKF and PKF resemble the direct feedback, while the EKF leads to greater "
        "deviations of forces and moments.",
        "4; Table 2",
        ClaimComparison((E0,), DEVIATIONS, BOTH, FROM_REFERENCE, TWO_FINALS),
        "Table 2 redrawn; figure 2",
        extra=rows_smaller("Table 2", PRINTED_DEVIATIONS, EKF),
    ),
    "better_than_none": compared(
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
    "overshoots": compared(
        "The overshoot of velocity is smaller with UKF and PKF than with the EKF.",
        "4; 4.1; its Table 2 has 5.07 % in X with the EKF and 56.36 % with the UKF",
        ClaimComparison((E0, E1), OVERSHOOTS, BOTH, OF_STEP, TWO_OVERSHOOTS),
        "Tables 2, 3 redrawn; figure 3",
        extra=(
            ". Published rows smaller: "
            + "; ".join(
                f"{table} UKF {printed(table, OVERSHOOTS, UKF, EKF)}, PKF "
                f"{printed(table, OVERSHOOTS, PKF, EKF)}"
                for table in ("Table 2", "Table 3")
            )
        ),
    ),
    "elevator_and_rudder": compared(
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
    "engine_and_alpha": compared(
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
        {"zero": over(flown(E0), symmetric)},
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
        f"{TWICE:g} times as much. That the position goes to zero is how no filter is made here, "
        "and not judged",
        {"deviates": over(flown(E1), many_times, ("fx_n", "fz_n"), NO_FILTER, FILTERS, TWICE)},
        f"{{deviates}}. Stopped or more than {AWAY:g} m off: {{lost}}",
        "figures 4, 5",
        {"lost": over(flown(E1), lost_once, NO_FILTER)},
        kind=kinds.ALWAYS,
        answer="{deviates}.",
    ),
    "wrong_alpha": Claim(
        "Without a filter AOF converges to an incorrect value after the cut; with a filter it does "
        "not.",
        "4.1; AOF taken as the angle of attack",
        f"a cell is a case of E1, against EKF, UKF and PKF: the final value is at least {TWICE:g} "
        "times as far from that of the reference flight",
        {"off": over(flown(E1), many_times, ("alpha_off_deg",), NO_FILTER, FILTERS, TWICE)},
        "{off}; {medians}",
        "figure 4",
        {"medians": over(flown(E1), medians, "alpha_off_deg", "deg")},
        kind=kinds.ALWAYS,
        answer="{off}.",
    ),
    "convergence": compared(
        "The curves of UKF and PKF converge much faster than those of the EKF.",
        "4.1",
        ClaimComparison((E1,), SETTLING, BOTH),
        "figure 4",
        extra=". Settled: elevator, engine speed and angle of attack within a tenth of the reference "
        "flight's range about the final value",
    ),
    "position_in_outage": compared(
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
    "deviations_in_outage": compared(
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
        {"effect": over(flown(E0, E1), suitable, DEVIATIONS, UKF, TWICE)},
        "{effect}",
        'Tables 2, 3 redrawn; figure 9; table "Readings"',
        kind=kinds.EXPLANATION,
        answer="{effect.answer}",
    ),
    "pkf_over_ukf": compared(
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
            + "; ".join(f"{table} {printed(table, PRINTED_ALL, PKF, UKF)}" for table in PUBLISHED)
        ),
        kind=kinds.MOSTLY,
    ),
    "long_outage": Claim(
        "Without a filter or with the EKF, prolonged outages cause divergence.",
        "4.2, said of results that are not shown",
        "of the flights of E2: they stop, or have the aircraft or, with a filter, the estimate more "
        f"than {AWAY:g} m off; both must hold, the EKF's in each reading of it and of who predicts: "
        "with opposite verdicts it depends on the reading, else the least favourable",
        {
            "without": over(flown(E2), cause, [NO_FILTER]),
            "ekf": over(flown(E2), cause, list(EKFS)),
        },
        "{without}. {ekf}. Beside them, diverged: {others}",
        "figures 6, 10",
        {
            "others": over(flown(E2), by_case, away, NONLINEAR),
            "lost": over(flown(E2), by_case, away, [EKF]),
            "none": over(flown(E2), lost_once, NO_FILTER),
        },
        kind=kinds.MOSTLY,
        answer="Diverged: no filter {none}; EKF {lost}; UKF and PKF {others}.",
    ),
    "much_less": Claim(
        "In five minutes without GPS the path is tracked with an error much less than 500 m.",
        "4.1; 4.2",
        f"a cell is a case and a filter, UKF or PKF, of E2: estimate and aircraft stay within "
        f"{NEAR:g} m in more than {NEARLY_ALL:.0%} (Wilson) of its flights; {enough(50)}; {BY_WHO}",
        {"near": over(flown(E2), nearly_all, near, NONLINEAR)},
        "{near}. Horizontal error of the estimate at the end: {ends}",
        "figure 10",
        {
            "within": over(flown(E2), by_case, near, NONLINEAR),
            "ends": over(flown(E2), ends, "horizontal_end_m", NONLINEAR),
        },
        kind=kinds.ALWAYS,
        answer=f"Within {NEAR:g} m: {{within}}.",
    ),
    "fastest": compared(
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
                flown(E1, E2),
                no_larger,
                "outage_horizontal_rmse_m",
                "fixed_horizontal_rmse_m",
                NONLINEAR,
            )
        },
        "{outage}",
        "figures 8, 10",
        {"ends": over(flown(E2), ends, "outage_horizontal_rmse_m", NONLINEAR)},
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
}
"""In the order of the paper."""


def claims(evidence: MollaeiEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return findings(CLAIMS.values(), evidence)
