"""What Mollaei et al. claim of EKF, UKF and PKF in the loop of an aircraft, each claim decided by a
rule from the tables of flights.

The rule stands beside each claim; how cells are counted is in rules.py.
"""

import numpy as np

from strapdown.evaluation.consistency import paired

from ..common.pages import NOT_REPRODUCED, PARTLY, REPRODUCED, UNDECIDED, finding
from ..common.paired_ratios import LEAST
from ..common.verdicts import RULE, Count, both, total
from .cells import (
    E0,
    E1,
    E2,
    EKF,
    FILTERS,
    IMU,
    MODEL,
    MODES,
    NO_FILTER,
    PKF,
    PUBLISHED,
    UKF,
    known,
    of,
)
from .rules import (
    AWAY,
    BOTH,
    DEVIATIONS,
    NEAR,
    NEARLY_ALL,
    OVERSHOOTS,
    PRINTED_ALL,
    PRINTED_DEVIATIONS,
    REAL_TIME,
    SAME,
    SETTLING,
    TWICE,
    TWO_FINALS,
    TWO_OVERSHOOTS,
    ZERO,
    Evidence,
    Question,
    against,
    away,
    by_case,
    compared,
    enough,
    factor,
    kept,
    median,
    near,
    printed,
    rows_smaller,
    share,
)


def claims(evidence: Evidence) -> list[dict[str, str]]:
    """All findings, in the order of the paper."""
    return [
        make(evidence)
        for make in (
            accurate_estimates,
            prevents_divergence,
            ekf_deviates,
            better_than_none,
            overshoots,
            elevator_and_rudder,
            engine_and_alpha,
            symmetric,
            no_filter_diverges,
            wrong_alpha,
            convergence,
            position_in_outage,
            deviations_in_outage,
            nonlinearity,
            pkf_over_ukf,
            long_outage,
            much_less,
            hour_and_a_half,
            fastest,
            negligible,
            laboratory,
            one_filter,
        )
    ]


def accurate_estimates(e: Evidence) -> dict[str, str]:
    """Abstract, 5."""
    return compared(
        e,
        "Nonlinear filters, particularly the PKF, outperform the EKF in accurate position and "
        "velocity estimates.",
        "Abstract; 5",
        Question((E0, E1), ("horizontal_rmse_m", "vertical_rmse_m", "velocity_rmse_m_s"), BOTH),
        'figure 8; tables "Left out"',
        ". The paper shows no error of an estimate",
    )


def prevents_divergence(e: Evidence) -> dict[str, str]:
    """Abstract, 5."""
    cells = {
        (case, mode): away(table, mode)
        for experiment in (E1, E2)
        for case, table in of(e.tables, experiment).items()
        for mode in (UKF, PKF)
    }
    count = total([share(kept(found), NEARLY_ALL) for found in cells.values()])
    return finding(
        "Nonlinear filters prevent divergence of the system in GPS outages; Kalman filtering "
        "effectively prevents divergence of the autopilot.",
        "Abstract; 5",
        f"of the flights of E1 and E2 with UKF or PKF, in each reading, more than {NEARLY_ALL:.0%} "
        f"(Wilson) do not diverge: "
        f"neither stop nor have estimate or aircraft more than {AWAY:g} m off; {enough(200)}, "
        f"{enough(50)}; {RULE}",
        f"{count}. Diverged: "
        + "; ".join(
            f"{mode}, {case} {found[0]} of {found[1]}" for (case, mode), found in cells.items()
        ),
        count.verdict,
        "figures 8, 10",
    )


def ekf_deviates(e: Evidence) -> dict[str, str]:
    """4."""
    return compared(
        e,
        "With fixes, UKF and PKF resemble the direct feedback, while the EKF leads to greater "
        "deviations of forces and moments.",
        "4; Table 2",
        Question((E0,), DEVIATIONS, BOTH, tuple(f"{name}_ref" for name in DEVIATIONS), TWO_FINALS),
        "Table 2 redrawn; figure 2",
        f". Published: {rows_smaller('Table 2', PRINTED_DEVIATIONS, EKF)}",
    )


def better_than_none(e: Evidence) -> dict[str, str]:
    """4."""
    pairs = ((UKF, NO_FILTER), (PKF, NO_FILTER))
    return compared(
        e,
        "With fixes, deviations and overshoots are smaller with UKF and PKF than without a filter.",
        "4; its Table 2 contradicts it in most rows",
        Question(
            (E0,),
            (*DEVIATIONS, *OVERSHOOTS),
            pairs,
            (*(f"{name}_ref" for name in DEVIATIONS), "step_x_pct", "step_z_pct"),
            TWO_FINALS,
        ),
        "Table 2 redrawn",
        f". Published: {rows_smaller('Table 2', PRINTED_ALL, NO_FILTER)}",
    )


def overshoots(e: Evidence) -> dict[str, str]:
    """4, 4.1."""
    texts = [
        f"{table} UKF {printed(table, OVERSHOOTS, UKF, EKF)}, PKF "
        f"{printed(table, OVERSHOOTS, PKF, EKF)}"
        for table in ("Table 2", "Table 3")
    ]
    return compared(
        e,
        "The overshoot of velocity is smaller with UKF and PKF than with the EKF.",
        "4; 4.1; its Table 2 has 5.07 % in X with the EKF and 56.36 % with the UKF",
        Question((E0, E1), OVERSHOOTS, BOTH, ("step_x_pct", "step_z_pct"), TWO_OVERSHOOTS),
        "Tables 2, 3 redrawn; figure 3",
        f". Published rows smaller: {'; '.join(texts)}",
    )


def elevator_and_rudder(e: Evidence) -> dict[str, str]:
    """4."""
    pairs = ((UKF, EKF), (PKF, EKF), (UKF, NO_FILTER), (PKF, NO_FILTER))
    return compared(
        e,
        "With fixes, the deviations of elevator and rudder are smaller with UKF and PKF than with "
        "the EKF or no filter.",
        "4",
        Question(
            (E0,),
            ("elevator_deg", "rudder_deg"),
            pairs,
            ("elevator_deg_ref", "rudder_deg_ref"),
            TWO_FINALS,
        ),
        "figure 1",
    )


def engine_and_alpha(e: Evidence) -> dict[str, str]:
    """4, 4.1."""
    measures = ("engine_rad_s", "alpha_deg", "elevator_deg")
    return compared(
        e,
        "Engine speed, AOF and elevator deviate less with UKF and PKF than with the EKF.",
        "4; 4.1; AOF taken as the angle of attack",
        Question((E0, E1), measures, BOTH, tuple(f"{name}_ref" for name in measures), TWO_FINALS),
        "figures 1, 4",
    )


def symmetric(e: Evidence) -> dict[str, str]:
    """Tables 2 to 4."""
    values = {
        mode: np.concatenate(
            [
                np.maximum(known(table, "fy_n", mode), known(table, "gy_n", mode))
                for table in of(e.tables, E0).values()
            ]
            or [np.empty(0)]
        )
        for mode in MODES
    }
    zero, count = (
        sum(int((each < ZERO).sum()) for each in values.values()),
        sum(map(len, values.values())),
    )
    verdict = (
        UNDECIDED
        if not count
        else REPRODUCED
        if zero == count
        else NOT_REPRODUCED
        if zero == 0
        else PARTLY
    )
    medians = ", ".join(
        f"{mode} {np.median(each):.2g} N" for mode, each in values.items() if len(each)
    )
    return finding(
        "Fy and Gy do not deviate at all from their final values (0 in all rows).",
        "Tables 2 to 4",
        f"in E0 the rms deviations of Fy and of the lateral weight are below {ZERO:g} N, printed as "
        f"0.0000, in all flights; "
        "not reproduced where in none",
        f"{zero} of {count} flights; medians of the larger: {medians}. Exact zeros mean that "
        f"nothing lateral is estimated or flown",
        verdict,
        "Table 2 redrawn",
    )


def no_filter_diverges(e: Evidence) -> dict[str, str]:
    """4.1, Table 3."""
    tables = of(e.tables, E1)
    counts = {mode: factor(tables, ("fx_n", "fz_n"), NO_FILTER, mode) for mode in FILTERS}
    # the flight is the same in all readings
    lost = [away(table, NO_FILTER) for table in tables.values()][:1]
    return finding(
        "Without a filter the parameters diverge when the GPS is cut, and the position goes to "
        "zero.",
        "4.1; Table 3; figures 4, 5",
        f"Fx and Fz deviate at least {TWICE:g} times as much (whole 95 % interval) as with EKF, UKF "
        f"and PKF; {RULE}; "
        "all three must hold. That the position goes to zero is how no filter is made here, and not "
        "judged",
        f"{against(counts)}. Stopped or more than {AWAY:g} m off: "
        + ", ".join(f"{found[0]} of {found[1]}" for found in lost),
        both(*(count.verdict for count in counts.values())),
        "figures 4, 5",
    )


def wrong_alpha(e: Evidence) -> dict[str, str]:
    """4.1."""
    tables = of(e.tables, E1)
    counts = {mode: factor(tables, ("alpha_off_deg",), NO_FILTER, mode) for mode in FILTERS}
    medians = lambda table: ", ".join(
        f"{mode} {np.median(known(table, 'alpha_off_deg', mode)):.2g} deg"
        for mode in MODES
        if len(known(table, "alpha_off_deg", mode))
    )
    return finding(
        "Without a filter AOF converges to an incorrect value after the cut; with a filter it does "
        "not.",
        "4.1; AOF taken as the angle of attack",
        f"its final value is at least {TWICE:g} times as far (whole 95 % interval) from that of the "
        f"reference flight as with EKF, UKF and PKF; "
        f"{RULE}; all three must hold",
        f"{against(counts)}; "
        + "; ".join(f"{case}: {medians(table)}" for case, table in tables.items()),
        both(*(count.verdict for count in counts.values())),
        "figure 4",
    )


def convergence(e: Evidence) -> dict[str, str]:
    """4.1."""
    return compared(
        e,
        "The curves of UKF and PKF converge much faster than those of the EKF.",
        "4.1",
        Question((E1,), SETTLING, BOTH),
        "figure 4",
        ". Settled: elevator, engine speed and angle of attack within a tenth of the reference "
        "flight's range about the final value",
    )


def position_in_outage(e: Evidence) -> dict[str, str]:
    """4.1, figure 5."""
    return compared(
        e,
        "After the cut the position estimates of UKF and PKF are more accurate than those of the "
        "EKF.",
        "4.1; figure 5",
        Question(
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
    )


def deviations_in_outage(e: Evidence) -> dict[str, str]:
    """4.1, Table 3."""
    return compared(
        e,
        "With the GPS cut, forces and moments deviate less with UKF and PKF than with the EKF.",
        "4.1; Table 3",
        Question((E1,), DEVIATIONS, BOTH, tuple(f"{name}_ref" for name in DEVIATIONS), TWO_FINALS),
        "Table 3 redrawn",
        f". Published: {rows_smaller('Table 3', PRINTED_DEVIATIONS, EKF)}",
    )


def nonlinearity(e: Evidence) -> dict[str, str]:
    """4, 4.1."""
    tables = of(e.tables, E0) | of(e.tables, E1)
    count = factor(tables, DEVIATIONS, EKF, UKF)
    linear, driven = (
        factor(of(e.tables, E1, prediction=each), DEVIATIONS, EKF, UKF) for each in (IMU, MODEL)
    )
    return finding(
        "The EKF is not suitable, because it needs a linearised model and the system has many "
        "nonlinear factors.",
        "4; 4.1",
        f"forces and moments deviate at least {TWICE:g} times as much (whole 95 % interval) with "
        f"the EKF as with the UKF, in E0 and E1 "
        f"(published: 2.9 to 19 times); {RULE}",
        f"{count}. Of E1, IMU-driven, where the system is linear: {linear}. Model-driven: {driven}; "
        f"{by_case(e, (E0, E1), DEVIATIONS, ((EKF, UKF),))}",
        count.verdict,
        "Tables 2, 3 redrawn; figure 9",
    )


def pkf_over_ukf(e: Evidence) -> dict[str, str]:
    """4.1, 4.2."""
    texts = [f"{table} {printed(table, PRINTED_ALL, PKF, UKF)}" for table in PUBLISHED]
    return compared(
        e,
        "The PKF usually gives a better response than the UKF: smaller deviations and overshoots.",
        "4.1; 4.2; Tables 3, 4",
        Question(
            (E1, E2),
            (*DEVIATIONS, *OVERSHOOTS),
            ((PKF, UKF),),
            (*(f"{name}_ref" for name in DEVIATIONS), "step_x_pct", "step_z_pct"),
            TWO_FINALS,
        ),
        "Tables 3, 4 redrawn; figure 9",
        f". Published rows smaller: {'; '.join(texts)}",
    )


def long_outage(e: Evidence) -> dict[str, str]:
    """4.2."""
    tables = of(e.tables, E2)
    cells = {
        mode: {case: away(table, mode) for case, table in tables.items()}
        for mode in (NO_FILTER, EKF)
    }
    counts = {
        mode: total([share(found, 0.5) for found in own.values()]) for mode, own in cells.items()
    }
    listed = lambda own: "; ".join(
        f"{case} {found[0]} of {found[1]}" for case, found in own.items()
    )
    others = {
        mode: listed({case: away(table, mode) for case, table in tables.items()})
        for mode in (UKF, PKF)
    }
    return finding(
        "Without a filter or with the EKF, prolonged outages cause divergence.",
        "4.2, said of results that are not shown",
        "in E2 more than half of the flights (Wilson) stop, or have the aircraft or, with a filter, "
        "the estimate "
        f"more than {AWAY:g} m off; {RULE}; both must hold",
        ". ".join(f"{mode}: {counts[mode]}, {listed(own)}" for mode, own in cells.items())
        + ". Beside them "
        + ", ".join(f"{mode} {text}" for mode, text in others.items()),
        both(*(count.verdict for count in counts.values())),
        "figures 6, 10",
    )


def much_less(e: Evidence) -> dict[str, str]:
    """4.1, 4.2."""
    cells = {
        (case, mode): near(table, mode)
        for case, table in of(e.tables, E2).items()
        for mode in (UKF, PKF)
    }
    count = total([share(found, NEARLY_ALL) for found in cells.values()])
    texts = [
        f"{mode}, {case} {median(table, 'horizontal_end_m', mode)} m"
        for case, table in of(e.tables, E2).items()
        for mode in (UKF, PKF)
    ]
    return finding(
        "In five minutes without GPS the path is tracked with an error much less than 500 m.",
        "4.1; 4.2",
        f"estimate and aircraft stay within {NEAR:g} m in more than {NEARLY_ALL:.0%} (Wilson) of "
        f"the flights of E2 with UKF or PKF, "
        f"in each reading; {enough(50)}: one that does not leaves its reading open; {RULE}",
        f"{count}. Within: "
        + "; ".join(
            f"{mode}, {case} {found[0]} of {found[1]}" for (case, mode), found in cells.items()
        )
        + f". Horizontal error of the estimate at the end: {'; '.join(texts)}",
        count.verdict,
        "figure 10",
    )


def hour_and_a_half(e: Evidence) -> dict[str, str]:
    """4.2."""
    slowest = max(e.seconds.values(), default=np.nan)
    verdict = (
        UNDECIDED if np.isnan(slowest) else REPRODUCED if slowest > REAL_TIME else NOT_REPRODUCED
    )
    return finding(
        "The 315 s with UKF and PKF take about an hour and a half.",
        "4.2",
        "reproduced where a flight takes longer than it lasts, one after the other on one core",
        "; ".join(
            f"{mode}, {driven}-driven {seconds:.2g} s"
            for (mode, driven), seconds in e.seconds.items()
            if mode in (UKF, PKF)
        )
        + f"; the paper: 5400 s, {5400 / max(slowest, 1e-9):.0f} times as long as the slowest",
        verdict,
        'table "Time of one flight (E2)"',
    )


def fastest(e: Evidence) -> dict[str, str]:
    """5, 4.2."""
    return compared(
        e,
        "The PKF converges the fastest.",
        "5; 4.2",
        Question((E0, E1, E2), SETTLING, ((PKF, UKF), (PKF, EKF))),
        "figures 1, 4, 7",
    )


def negligible(e: Evidence) -> dict[str, str]:
    """5."""
    counts, texts = [], []
    for mode in (UKF, PKF):
        for case, table in (of(e.tables, E1) | of(e.tables, E2)).items():
            a, b = (known(table, f"{part}_horizontal_rmse_m", mode) for part in ("outage", "fixed"))
            found = (
                paired(*(np.log(np.maximum(values, LEAST)) for values in (a, b)))
                if len(a) == len(b)
                else paired([], [])
            )
            counts.append(Count(int(found.high < np.log(TWICE)), int(found.low > np.log(TWICE)), 1))
            texts.append(f"{mode}, {case} x{np.exp(found.difference):.3g}")
    count = total(counts)
    return finding(
        "In outages the positional error is reduced to negligible levels.",
        "5",
        f"the horizontal RMSE of the estimate in the outage is less than {TWICE:g} times that "
        f"before it (geometric mean over the flights, "
        f"whole 95 % interval), with UKF and PKF, in E1 and E2, in each reading; {RULE}",
        f"{count}. {'; '.join(texts)}",
        count.verdict,
        "figures 8, 10",
    )


def laboratory(e: Evidence) -> dict[str, str]:
    """1."""
    return finding(
        "Tested in a scientific center and on a laboratory plant: the linear filter diverges "
        "completely when the GPS is cut, "
        "with theirs the error almost reaches its bound.",
        "1",
        "no data, no figure and no description of the plant are given: not decidable",
        "nothing to measure",
        UNDECIDED,
        "–",
    )


def one_filter(e: Evidence) -> dict[str, str]:
    """Not said; section 4 and (25)."""
    own = {
        mode: e.apart.loc[e.apart["mode"] == mode, "apart_m"].to_numpy(float) for mode in (UKF, PKF)
    }
    most = float(own[UKF].max(initial=0.0)) if len(own[UKF]) else np.nan
    verdict = UNDECIDED if np.isnan(most) else REPRODUCED if most <= SAME else NOT_REPRODUCED
    return finding(
        "(Not said:) With positions and velocities as its states and driven by the IMU, the model "
        "is linear, and EKF and UKF are one filter; "
        "the PKF is it too, but for its random draws.",
        '4: "the previous position values (X, Y, Z) and velocities along the three axes were used '
        'as state variables"',
        f"in all IMU-driven flights estimate and aircraft are within {SAME:g} m of those with the "
        f"EKF, at every sample, with the UKF",
        f"UKF: at most {most:.2g} m in {len(own[UKF])} flights; PKF: at most "
        f"{own[PKF][np.isfinite(own[PKF])].max(initial=0.0):.2g} m"
        + (
            f", and {ended} flights stopped at another time"
            if (ended := int(np.isinf(own[PKF]).sum()))
            else ""
        ),
        verdict,
        "figure 9",
    )
