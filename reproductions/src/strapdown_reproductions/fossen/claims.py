"""Claims of Fossen's chapter 14 on its inertial navigation filters, each decided by a rule from the
tables of runs.

The rules were written beside trials of seeds that the study does not use, before the study was run,
and none was changed for its verdict.
"""

from collections.abc import Callable, Collection, Sequence
from itertools import product
from operator import attrgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import proportion
from strapdown.typing import Mask

from ..common.claims import Claim, JudgedClaim, findings, over
from ..common.kinds import (
    ALWAYS,
    MOSTLY,
    NEVER,
    SOMETIMES,
    Share,
    Votes,
    always,
    clustered,
    mostly,
    never,
    sometimes,
)
from ..common.verdicts import vote
from .cases import CHAPTER, CONSIDERED, DECIDING, FADING, LAST, RIGHT, START_SD
from .intro import BIASES, FORMS
from .runs import DROPOUT, KEYS, quantiles, seconds
from .signals import SIGNALS

Cells: TypeAlias = list[tuple[Any, pd.DataFrame]]
"""What a cell is called, and its rows, one for each run."""
STILL = ("at rest", "steady")
MINUTES, GYRO = 120.0, 10.0
"""s that the biases of accelerometers and gyros may take."""
POSITION, VELOCITY, ATTITUDE = 0.087, 0.05, float(np.radians(1.0))
"""m, m/s and rad: rms errors over the last LAST s below which a state has converged; the first
is the error of one position fix."""
DRIFTED, KEPT = 100.0, 1.0
"""m: a raw INS that has drifted, and an estimate that has not."""
MEKF = (
    "mekf, position + field, 1 Hz",
    "mekf, position + field",
    "mekf, position + velocity + field",
    "mekf, position + gravity + field",
    "mekf, position + compass",
    "mekf, position + velocity + compass",
)
EULER = "direct-euler, position + compass"
PRINTED = "euler-direct as printed, position + compass"
PRINTED_INDIRECT = "euler-indirect as printed, position + compass"
HALF_A_TURN = float(np.pi)
"""rad: standard deviation with which a filter says that it knows nothing of an angle."""
INDIRECT = ("indirect-ahrs-closed", "indirect-ahrs-open")
COLUMNS = (
    "position_m",
    "velocity_m_s",
    "attitude_rad",
    "ins_m",
    "angle_sd_rad",
    "accel_m_s2",
    "accel_s",
    "gyro_s",
    "accel_before",
    "accel_after",
    "accel_left",
    "accel_model",
    "position_after_m",
    "bias_before",
    "bias_after",
    *(f"accel_left_{axis}" for axis in "xyz"),
)
NO_RUN = pd.DataFrame([dict.fromkeys(COLUMNS, np.nan) | {"stopped": False}])


class FossenEvidence(NamedTuple):
    """All that the claims rest on."""

    runs: pd.DataFrame  # of fossen_runs.Results
    dropouts: pd.DataFrame
    intro: pd.DataFrame  # of fossen_intro.study: a row per seed, form and biases


RUNS = attrgetter("runs")


def chosen(rows: pd.DataFrame, keys: Sequence[str], **wanted: Collection[Any]) -> Cells:
    """[(values of `keys`, rows)] of the cells of the rows whose columns have one of the `wanted`
    values each."""
    own = rows[np.logical_and.reduce([rows[name].isin(values) for name, values in wanted.items()])]
    return list(own.groupby(list(keys), sort=False))


def pick(
    runs: pd.DataFrame,
    cases: Sequence[str],
    excitations: Collection[str],
    tunings: Sequence[str] = DECIDING,
) -> Cells:
    """[((case, excitation, tuning), rows)] of the cells asked for that have runs."""
    return chosen(runs, KEYS, case=cases, excitation=excitations, tuning=tunings)


def of_runs(
    cases: Sequence[str], excitations: Collection[str], *tunings: str
) -> Callable[[FossenEvidence], Cells]:
    """The cells of the runs with these excitations, of DECIDING where no tuning is named."""
    return over(RUNS, pick, cases, excitations, tunings or DECIDING)


def of_intro(
    outage: int, forms: Sequence[str], biases: Sequence[str]
) -> Callable[[FossenEvidence], Any]:
    """The cells of the introductory example, one per form and kind of biases."""

    return lambda e: chosen(e.intro, ["biases", "form"], outage=[outage], form=forms, biases=biases)


def of_dropouts(tuning: str) -> Callable[[FossenEvidence], Cells]:
    """The cells of the dropouts of a tuning: indirect filters and MEKF."""
    cases = (*INDIRECT, MEKF[1])
    return lambda e: chosen(e.dropouts, ["case", "excitation"], case=cases, tuning=[tuning])


def holds(rows: pd.DataFrame, what: str) -> Mask:
    """In which of the rows a condition on their columns holds, such as "accel_s < never"."""
    return rows.eval(what, resolvers=[{"never": np.inf}]).to_numpy(bool)


def votes(cells: Cells, what: str) -> Votes:
    """Return the vote of each cell: +1 where a condition holds in more than half of its runs by
    Wilson's interval, -1 where in fewer, else 0."""
    found = [(int(holds(rows, what).sum()), len(rows)) for _, rows in cells]
    return lambda confidence: [vote(*proportion(*each, confidence)[1:], 0.5) for each in found]


def everywhere(cells: Cells, what: str) -> JudgedClaim:
    """ALWAYS, of cells where a condition holds."""
    return always(votes(cells, what))


def nowhere(cells: Cells, what: str) -> JudgedClaim:
    """NEVER, of cells where a condition holds."""
    return never(votes(cells, what))


def mainly(cells: Cells, what: str) -> JudgedClaim:
    """MOSTLY, of cells where a condition holds."""
    return mostly(votes(cells, what))


def single(cells: Cells, what: str) -> Share:
    """Share of all runs of the cells in which a condition holds, clustered by seed."""
    rows = together(cells)
    rows = rows.assign(holds=holds(rows, what)) if cells else rows.assign(holds=False, seed=0)
    return clustered(
        (int(own.sum()), len(own)) for _, own in rows.groupby("seed")["holds"] if cells
    )


def at_times(cells: Cells, what: str) -> JudgedClaim:
    """SOMETIMES, of the runs in which a condition holds."""
    return sometimes(single(cells, what))


def spread(cells: Cells, name: str) -> str:
    """Text: quantiles of a time of convergence over all runs of the cells."""
    if not cells:
        return "no runs"
    low, middle, high = map(
        seconds, quantiles(np.concatenate([rows[name].to_numpy(float) for _, rows in cells]))
    )
    return f"median {middle} s, 80 % of the runs {low} to {high} s".replace("never s", "never")


def together(cells: Cells) -> pd.DataFrame:
    """The runs of all cells, a row of NaN where there is none."""
    return pd.concat([rows for _, rows in cells]) if cells else NO_RUN


def median(cells: Cells, name: str) -> float:
    """Median of a column over all runs of the cells."""
    return float(together(cells)[name].median())


def share(cells: Cells, what: str) -> float:
    """Share of all runs of the cells in which a condition holds."""
    return float(holds(together(cells), what).mean()) if cells else np.nan


def errors(cells: Cells) -> str:
    """Text: medians of the errors over all runs of the cells, nothing where there is none."""
    rows = together(cells)
    return (
        f" (medians {rows['position_m'].median():.2g} m, {rows['velocity_m_s'].median():.2g} m/s, "
        f"{np.degrees(rows['attitude_rad'].median()):.2g} deg)"
    ) * bool(cells)


def lines(cells: Cells, line: str, joint: str = " on ") -> str:
    """Text: the format string `line` of the medians of each cell, under its name."""
    return "; ".join(
        f"{joint.join(key)}: {line.format(**rows.median(numeric_only=True))}" for key, rows in cells
    )


def positions(runs: pd.DataFrame, cases: Sequence[str]) -> str:
    """Text: the position errors of cases that pitch through the vertical."""
    cells = {case: pick(runs, [case], ["steep"]) for case in cases}
    return "; ".join(
        f"{case.split(',')[0]}: position {median(own, 'position_m'):.3g} m (median)"
        for case, own in cells.items()
        if own
    )


def left(runs: pd.DataFrame, cases: Sequence[str], excitations: Sequence[str]) -> str:
    """Text, true noises: what is left of the accelerometers' deviations along x, y, z (medians
    of shares); what that amounts to, against the error."""
    texts = []
    for case, excitation in product(cases, excitations):
        rows = together(pick(runs, [case], [excitation], [RIGHT]))
        shares = np.array([rows[f"accel_left_{axis}"].median() for axis in "xyz"])
        texts.append(
            f"{case}, {excitation}: {' '.join(f'{each:.2g}' for each in shares)}, that is "
            f"{np.linalg.norm(shares * START_SD[9:12]):.2g} m/s² stated for an error of "
            f"{rows['accel_m_s2'].median():.2g} m/s²"
        )
    return "; ".join(texts)


def no_dropouts(e: FossenEvidence) -> str:
    """Return the requirement that a claim on dropouts misses where runs are too short for one; else
    an empty text."""
    return "needs runs of 300 s" * e.dropouts.empty


NEAR_THE_TRUTH = (
    f"position_m < {POSITION} and velocity_m_s < {VELOCITY} and attitude_rad < {ATTITUDE}"
)
CELL = "A cell is one filter with its sensors, excitation and tuning; it supports the claim where more than half of its runs do (95 % Wilson)"
CONVERGED = (
    "Converged: the length of the error of the three biases goes below 0.02 m/s² (accelerometers) "
    "or 0.35 deg/s (gyros), 6 and 5 % of "
    "the biases, and stays there"
)
BOTH = lambda *names: [name + reading for name in names for reading in ("", CONSIDERED)]
AHRS = of_runs(BOTH("direct-ahrs"), (*SIGNALS, *STILL))
INDIRECT_RUNS = of_runs(BOTH(*INDIRECT), (*SIGNALS, *STILL))
EULER_STILL, EULER_MOVED = of_runs([PRINTED], STILL), of_runs([PRINTED], SIGNALS)
STEEP, STEEP_MEKF = of_runs([PRINTED], ["steep"]), of_runs([MEKF[4]], ["steep"])
BLOWN_UP = f"stopped or angle_sd_rad > {HALF_A_TURN} or ~(position_m < 10)"
CLOSED, OPEN = (of_runs(BOTH(name), SIGNALS) for name in INDIRECT)
MEKF_STILL, MEKF_MOVED = of_runs(MEKF, STILL), of_runs(MEKF, SIGNALS)
MEKF_CHAPTER, MEKF_RIGHT = of_runs(MEKF, SIGNALS, CHAPTER), of_runs(MEKF, SIGNALS, RIGHT)
MEKF_FADING = of_runs(MEKF, SIGNALS, FADING)
MEKF_TURNING = of_runs(MEKF, ["turning"])
FORWARD = of_intro(0, ["feedforward"], BIASES)
TUNED = (
    "With the chapter's weights: {chapter} ({in_chapter}); with the true noises: {right} "
    "({in_right}). With estimates that decay in place of the published held ones: {fading:.0%} of "
    "the runs with the chapter's weights"
)
CLAIMS = {
    "ahrs_all_states": Claim(
        "With an AHRS the 15-state linear time-varying Kalman filter estimates all 15 states, "
        "thanks to observability.",
        "14.3.2",
        "direct-ahrs, with errors of the AHRS neglected in the velocity as published and, with the "
        "true noises, considered too, both signals, at rest and steady: biases of accelerometers and gyros "
        f"converge within the run. {CONVERGED}. {CELL}",
        {"cells": over(AHRS, everywhere, "accel_s < never and gyro_s < never")},
        "{cells}. Accelerometers: {accel}; gyros: {gyro}",
        "table cells",
        {
            "accel": over(AHRS, spread, "accel_s"),
            "gyro": over(AHRS, spread, "gyro_s"),
            "share": over(AHRS, share, "accel_s < never and gyro_s < never"),
        },
        kind=ALWAYS,
        answer="All biases converge in {share:.0%} of the runs.",
    ),
    "euler_is_hard": Claim(
        "In the direct EKF with Euler angles the acceleration bias is hard to estimate and usually "
        "requires sufficient excitation.",
        "14.3.3",
        "the printed direct filter with position and compass: accelerometer biases do not converge "
        "within the run at rest and steady, and do under the two signals; both parts must hold",
        {
            "still": over(EULER_STILL, mainly, "~(accel_s < never)"),
            "moved": over(EULER_MOVED, mainly, "accel_s < never"),
        },
        "At rest and steady they do not: {still}. Under the signals they do: {moved} ({times})",
        "figure 4, table cells",
        {
            "times": over(EULER_MOVED, spread, "accel_s"),
            "at_rest": over(EULER_STILL, share, "accel_s < never"),
            "in_motion": over(EULER_MOVED, share, "accel_s < never"),
        },
        kind=MOSTLY,
        answer="They converge in {in_motion:.0%} of the runs in motion and in {at_rest:.0%} of "
        "those without.",
    ),
    "euler_blows_up": Claim(
        "Covariance blow-up due to the Euler angles is possible in the direct EKF; consider the "
        "MEKF instead.",
        "14.3.3",
        "a motion that pitches through the vertical, position and compass: the covariance has "
        "blown up where the printed direct filter states a standard deviation of an angle beyond "
        "half a turn, stops, or is 10 m off (rms, last "
        f"{LAST:g} s); and the MEKF neither stops nor is so far off in any cell",
        {
            "printed": over(STEEP, at_times, BLOWN_UP),
            "mekf": over(STEEP_MEKF, everywhere, "~stopped and position_m < 10"),
        },
        "Blown up: {printed}, the largest deviation of an angle {largest:.3g} rad in the median; "
        "10 m off or stopped: {lost:.0%}. The MEKF holds: {mekf}. {positions}",
        "table cells",
        {
            "largest": over(STEEP, median, "angle_sd_rad"),
            "lost": over(STEEP, share, "stopped or ~(position_m < 10)"),
            "share": over(STEEP, share, BLOWN_UP),
            "positions": over(RUNS, positions, (PRINTED, PRINTED_INDIRECT, EULER, MEKF[4])),
        },
        kind=SOMETIMES,
        answer="The printed filter's covariance blows up in {share:.0%} of the runs through the "
        "vertical, and {lost:.0%} are lost.",
    ),
    "intro_drift": Claim(
        "The two IMU biases are important to estimate in order to avoid drift: the INS drifts, INS "
        "and estimated error together do not.",
        "14.4.1",
        "introductory example, feedforward, constant and decaying biases: after the run the INS is "
        f"off by more than {DRIFTED:g} m and the estimate by less than {KEPT:g} m",
        {"cells": over(FORWARD, everywhere, f"ins_m > {DRIFTED} and position_m < {KEPT}")},
        "{cells}. INS {ins:.3g} m, estimate {estimate:.2g} m (medians)",
        "figure 7",
        {"ins": over(FORWARD, median, "ins_m"), "estimate": over(FORWARD, median, "position_m")},
        kind=ALWAYS,
        answer="The INS is {ins:.3g} m off, the estimate {estimate:.2g} m.",
    ),
    "intro_decay": Claim(
        "The time constants ensure that the bias errors go exponentially to zero during dead "
        "reckoning.",
        "14.4.1",
        "introductory example, dropout of 60 s, feedforward and feedback: the error of the "
        "accelerometer bias is smaller after the dropout than before, for constant biases and for "
        "biases that decay as modelled; both parts must hold",
        {
            "constant": over(
                of_intro(1, FORMS[:2], ["constant"]), everywhere, "bias_after < bias_before"
            ),
            "decaying": over(
                of_intro(1, FORMS[:2], ["decaying"]), everywhere, "bias_after < bias_before"
            ),
        },
        "Constant: {constant}; decaying: {decaying}. Error before to after, and "
        "position error after: {medians}",
        "figure 8",
        {
            "medians": over(
                of_intro(1, FORMS, BIASES),
                lines,
                "{bias_before:.2g} to {bias_after:.2g} m/s², position {position_m:.3g} m",
                ", ",
            ),
            "share": over(of_intro(1, FORMS[:2], BIASES), share, "bias_after < bias_before"),
        },
        kind=ALWAYS,
        answer="The error of the bias shrinks in {share:.0%} of the dropouts.",
    ),
    "indirect_converges": Claim(
        "In the indirect filter with AHRS, feedforward or feedback, the estimated biases converge "
        "to their true value.",
        "14.4.2",
        "as claim 1, indirect-ahrs-open and indirect-ahrs-closed",
        {"cells": over(INDIRECT_RUNS, everywhere, "accel_s < never and gyro_s < never")},
        "{cells}. Accelerometers: {accel}; gyros: {gyro}",
        "table cells",
        {
            "accel": over(INDIRECT_RUNS, spread, "accel_s"),
            "gyro": over(INDIRECT_RUNS, spread, "gyro_s"),
            "share": over(INDIRECT_RUNS, share, "accel_s < never and gyro_s < never"),
        },
        kind=ALWAYS,
        answer="All biases converge in {share:.0%} of the runs.",
    ),
    "decay": Claim(
        "The time constants ensure that the bias errors go exponentially to zero during dead "
        "reckoning (15 states).",
        "14.4.2",
        f"dropout of all fixes from {DROPOUT[0]:g} to {DROPOUT[1]:g} s, chapter's weights, indirect "
        "filters and MEKF. With estimates that decay, as the chapter's equations have them: the "
        "estimated accelerometer bias decays with its time constant (within 5 %), and its error, "
        "true less estimate, is smaller after the dropout than before. With estimates that are "
        "held, as the published code has them: the error is smaller too. All parts must hold",
        {
            "model": over(
                of_dropouts(FADING), everywhere, "abs(accel_left / accel_model - 1) < 0.05"
            ),
            "smaller": over(of_dropouts(FADING), everywhere, "accel_after < accel_before"),
            "held": over(of_dropouts(CHAPTER), everywhere, "accel_after < accel_before"),
        },
        "Decays: {model}. Error smaller: {smaller}; held: {held}. Decaying: {medians}; position "
        "after {fading_m:.3g} m, held {held_m:.3g} m (medians)",
        "table dropouts",
        {
            "medians": over(
                of_dropouts(FADING), lines, "{accel_before:.2g} to {accel_after:.2g} m/s²"
            ),
            "fading_m": over(of_dropouts(FADING), median, "position_after_m"),
            "held_m": over(of_dropouts(CHAPTER), median, "position_after_m"),
            "share": over(of_dropouts(FADING), share, "accel_after < accel_before"),
        },
        no_dropouts,
        kind=ALWAYS,
        answer="The error shrinks in {share:.0%} of the dropouts where the estimate decays.",
    ),
    "drift": Claim(
        "In the feedforward filter the INS drifts, the estimate compensates drift and biases.",
        "14.4.2",
        f"indirect-ahrs-open under the two signals: the raw INS is off by more than {DRIFTED:g} m "
        f"at the end and the estimate by less than {KEPT:g} m (rms, last {LAST:g} s)",
        {"cells": over(OPEN, everywhere, f"ins_m > {DRIFTED} and position_m < {KEPT}")},
        "{cells}. INS {ins:.4g} m, estimate {estimate:.2g} m (medians)",
        "table cells",
        {"ins": over(OPEN, median, "ins_m"), "estimate": over(OPEN, median, "position_m")},
        kind=ALWAYS,
        answer="The INS is {ins:.3g} m off, the estimate {estimate:.2g} m.",
    ),
    "feedback_bounds": Claim(
        "Feedback prevents the INS errors from growing.",
        "14.4.2",
        "indirect-ahrs-closed under the two signals: position "
        f"error below {KEPT:g} m (rms, last {LAST:g} s)",
        {"cells": over(CLOSED, everywhere, f"position_m < {KEPT}")},
        "{cells}. Median {estimate:.2g} m",
        "table cells",
        {"estimate": over(CLOSED, median, "position_m")},
        kind=ALWAYS,
        answer="The position is {estimate:.2g} m off in the median.",
    ),
    "accel_minutes": Claim(
        "MEKF: the acceleration biases converge to their true values in 1-2 minutes.",
        "14.4.3, concluding remarks",
        f"MEKF with six sets of sensors, two signals: converged after {MINUTES:g} s at the latest, "
        "sooner counts for the claim; both tunings must hold",
        {
            "chapter": over(MEKF_CHAPTER, mainly, f"accel_s <= {MINUTES}"),
            "right": over(MEKF_RIGHT, mainly, f"accel_s <= {MINUTES}"),
        },
        f"{TUNED}. Of all runs {{before:.0%}} before 1 min, {{within:.0%}} in 1-2 min, "
        "{later:.0%} later, {never:.0%} not within 5 min",
        "figures 3 to 5",
        {
            "in_chapter": over(MEKF_CHAPTER, spread, "accel_s"),
            "in_right": over(MEKF_RIGHT, spread, "accel_s"),
            "before": over(MEKF_MOVED, share, "accel_s < 60"),
            "within": over(MEKF_MOVED, share, "accel_s >= 60 and accel_s <= 120"),
            "later": over(MEKF_MOVED, share, "accel_s > 120 and accel_s < never"),
            "never": over(MEKF_MOVED, share, "accel_s == never"),
            "fading": over(MEKF_FADING, share, f"accel_s <= {MINUTES}"),
            "share": over(MEKF_MOVED, share, f"accel_s <= {MINUTES}"),
        },
        kind=MOSTLY,
        answer="They converge within two minutes in {share:.0%} of the runs; with estimates that "
        "decay in {fading:.0%}.",
    ),
    "gyro_seconds": Claim(
        "MEKF: the angular rate sensor biases need less than 10 seconds to converge.",
        "14.4.3, concluding remarks",
        f"as the claim before, converged before {GYRO:g} s",
        {
            "chapter": over(MEKF_CHAPTER, mainly, f"gyro_s < {GYRO}"),
            "right": over(MEKF_RIGHT, mainly, f"gyro_s < {GYRO}"),
        },
        TUNED,
        "figures 3 to 5",
        {
            "in_chapter": over(MEKF_CHAPTER, spread, "gyro_s"),
            "in_right": over(MEKF_RIGHT, spread, "gyro_s"),
            "fading": over(MEKF_FADING, share, f"gyro_s < {GYRO}"),
            "share": over(MEKF_MOVED, share, f"gyro_s < {GYRO}"),
        },
        kind=MOSTLY,
        answer="They converge within ten seconds in {share:.0%} of the runs.",
    ),
    "states_converge": Claim(
        "MEKF: position, velocity and attitude converge to their true values.",
        "14.4.3, concluding remarks",
        f"as before: rms over the last {LAST:g} s below {POSITION:g} m (the error of one fix), "
        f"{VELOCITY:g} m/s and 1 deg, all three; both tunings must hold",
        {
            "chapter": over(MEKF_CHAPTER, everywhere, NEAR_THE_TRUTH),
            "right": over(MEKF_RIGHT, everywhere, NEAR_THE_TRUTH),
        },
        "With the chapter's weights: {chapter}{in_chapter}; with the true noises: {right}{in_right}; "
        "with estimates that decay: {fading:.0%} of the runs with the chapter's weights{in_fading}",
        "figure 2, table cells",
        {
            "in_chapter": over(MEKF_CHAPTER, errors),
            "in_right": over(MEKF_RIGHT, errors),
            "in_fading": over(MEKF_FADING, errors),
            "fading": over(MEKF_FADING, share, NEAR_THE_TRUTH),
            "share": over(MEKF_MOVED, share, NEAR_THE_TRUTH),
        },
        kind=ALWAYS,
        answer="All three are near the truth in {share:.0%} of the runs; with estimates that decay "
        "in {fading:.0%}.",
    ),
    "excitation": Claim(
        "The acceleration bias does not converge unless the vehicle is sufficiently excited: "
        "observability is related to manoeuvres.",
        "14.4.3; chapter goals",
        "MEKF: accelerometer biases do not converge within the run at rest and steady, and do under "
        "the two signals; both parts must hold",
        {
            "still": over(MEKF_STILL, everywhere, "~(accel_s < never)"),
            "moved": over(MEKF_MOVED, everywhere, "accel_s < never"),
        },
        "At rest and steady they do not: {still}. Under the signals they do: {moved}. What is left "
        "of the initial deviations along x, y, z: {left}",
        "figure 6, table cells",
        {
            "left": over(RUNS, left, (MEKF[1], MEKF[4]), ("signal 1", "at rest")),
            "at_rest": over(MEKF_STILL, share, "accel_s < never"),
            "in_motion": over(MEKF_MOVED, share, "accel_s < never"),
        },
        kind=ALWAYS,
        answer="They converge in {in_motion:.0%} of the runs in motion and in {at_rest:.0%} of "
        "those without.",
    ),
    "roll_and_pitch": Claim(
        "It takes excitation in roll and pitch.",
        "14.4.3, concluding remarks",
        "MEKF on a level body whose heading swings by 40 deg within a minute and that does nothing "
        "else: the accelerometer biases converge within the run",
        {"cells": over(MEKF_TURNING, nowhere, "accel_s < never")},
        "They do not: {cells} ({times})",
        "figure 6, table cells",
        {
            "times": over(MEKF_TURNING, spread, "accel_s"),
            "share": over(MEKF_TURNING, share, "accel_s < never"),
        },
        kind=NEVER,
        answer="A swinging heading alone makes them converge in {share:.0%} of the runs.",
    ),
}
"""In the order of the chapter."""


def claims(evidence: FossenEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the chapter."""
    return findings(CLAIMS.values(), evidence)
