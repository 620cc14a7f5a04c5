"""Claims of Fossen's chapter 14 on its inertial navigation filters, each decided by a rule from the
tables of runs.

The rules were written beside trials of seeds that the study does not use, before the study was run,
and none was changed for its verdict.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import proportion
from strapdown.experiments.outages.summaries import over_blocks
from strapdown.typing import Mask

from ..common.claims import Claim, JudgedClaim, findings, over
from ..common.kinds import (
    ALWAYS,
    EXPLANATION,
    MORE_THAN,
    MOSTLY,
    NEVER,
    SOMETIMES,
    Share,
    Votes,
    always,
    cluster_share,
    more_than,
    mostly,
    never,
    sometimes,
)
from ..common.verdicts import vote
from .cases import CHAPTER, CONSIDERED, DECIDING, FADING, FAST, LAST, RIGHT, START_STD, TUNINGS
from .intro import BIASES, FORMS
from .readings import ByReading, Cells, choose_cells, filters, pick, table, together as over_named
from .runs import DROPOUT, quantiles, seconds
from .signals import MOVED
from .statements import (
    COST,
    FIELDS,
    FLIGHT,
    GAINS,
    OBSERVED,
    QUATERNION,
    SETTLING,
    STABILITY,
    STATIC,
    flight_rms,
)

STILL = ("at rest", "steady")
MINUTES, GYRO = 120.0, 10.0
"""s that the biases of accelerometers and gyros may take."""
POSITION, VELOCITY, ATTITUDE = 0.087, 0.05, float(np.radians(1.0))
"""m, m/s and rad: rms errors over the last LAST s below which a state has converged; the first
is the error of one position fix."""
DRIFTED, KEPT = 100.0, 1.0
"""m: a raw INS that has drifted, and an estimate that has not."""
GROWN = 1.5
"""An error has grown whose rms of the last LAST s is more than this times that of the LAST s
before: one that grows linearly has 1.65 in 300 s, one with the square of the time 2.6."""
TILTED, MOVES = 1.0, 1.0
"""deg: an inaccurate static attitude; m/s^2: rms of a high acceleration."""
SURE = 0.9
"""Share of the starts from which a stable observer comes home, as far as the runs can tell."""
HOME = 1.0
"""deg: off the truth, of an observer that has converged."""
RANK = 1e-9
"""Smallest over largest eigenvalue of a covariance that is rank deficient."""
HALF_A_MILLISECOND = 500.0
"""µs: time available per sample for a filter at 2 kHz."""
MEKF = (
    "mekf, position + field, 1 Hz",
    "mekf, position + field",
    "mekf, position + velocity + field",
    "mekf, position + gravity + field",
    "mekf, position + compass",
    "mekf, position + velocity + compass",
)
MEKF_PRINTED = (
    "mekf as printed, position + gravity + field",
    "mekf as printed, position + gravity + compass",
)
EULER = "direct-euler, position + compass"
PRINTED = "euler-direct as printed, position + compass"
PRINTED_INDIRECT = "euler-indirect as printed, position + compass"
AHRS_PRINTED, INDIRECT_PRINTED = "ahrs-direct as printed", "ahrs-indirect as printed"
HALF_A_TURN = float(np.pi)
"""rad: standard deviation with which a filter says that it knows nothing of an angle."""
INDIRECT = ("indirect-ahrs-closed", "indirect-ahrs-open")
COLUMNS = (
    "position_m",
    "velocity_m_s",
    "attitude_rad",
    "ins_m",
    "angle_std_rad",
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
    "bias_left",
    "bias_model",
    "growth",
    "ins_growth",
    *(f"accel_left_{axis}" for axis in "xyz"),
)
NO_RUN = pd.DataFrame([dict.fromkeys(COLUMNS, np.nan) | {"stopped": False}])


class FossenEvidence(NamedTuple):
    """All that the claims rest on."""

    runs: pd.DataFrame  # of fossen_runs.Results
    dropouts: pd.DataFrame
    intro: pd.DataFrame  # of fossen_intro.study: a row per seed, form and biases
    beside: Mapping[str, pd.DataFrame] = {}  # of statements.all_tables


RUNS = attrgetter("runs")


def of_runs(
    cases: Sequence[str], excitations: Collection[str], *tunings: str
) -> Callable[[FossenEvidence], Cells]:
    """The cells of the runs with these excitations, of DECIDING where no tuning is named."""
    return over(RUNS, pick, cases, excitations, tunings or DECIDING)


def of_intro(
    outage: int, forms: Sequence[str], biases: Sequence[str]
) -> Callable[[FossenEvidence], Any]:
    """The cells of the introductory example, one per form and kind of biases."""

    return lambda e: choose_cells(
        e.intro, ["biases", "form"], outage=[outage], form=forms, biases=biases
    )


def of_dropouts(tuning: str) -> Callable[[FossenEvidence], Cells]:
    """The cells of the dropouts of a tuning: indirect filters and MEKF, as printed and the
    library's."""
    cases = (INDIRECT_PRINTED, *INDIRECT, MEKF_PRINTED[0], MEKF[1])
    return lambda e: choose_cells(e.dropouts, ["case", "excitation"], case=cases, tuning=[tuning])


def holds(rows: pd.DataFrame, what: str) -> Mask:
    """In which of the rows a condition on their columns holds, such as "accel_s < never"."""
    return rows.eval(what, resolvers=[{"never": np.inf}]).to_numpy(bool)


def votes(cells: Cells, what: str, level: float = 0.5) -> Votes:
    """Return the vote of each cell: +1 where a condition holds in more than half of its runs (or
    the share `level`) by Wilson's interval, -1 where in fewer, else 0."""
    found = [(int(holds(rows, what).sum()), len(rows)) for _, rows in cells]
    return lambda confidence: [vote(*proportion(*each, confidence)[1:], level) for each in found]


def beside(name: str, *keys: str, **wanted: Sequence[Any]) -> Callable[[FossenEvidence], Cells]:
    """The cells of a table of statements, one for each value of the `keys`."""
    return lambda e: choose_cells(e.beside[name], keys, **wanted)


def missing_text(name: str) -> Callable[[FossenEvidence], str]:
    """Text: that a table of statements is missing; else an empty one."""
    return lambda e: f"needs the table {name}" * (name not in e.beside or e.beside[name].empty)


def surely(cells: Cells, what: str) -> JudgedClaim:
    """ALWAYS, of cells where a condition holds in SURE of the runs."""
    return always(votes(cells, what, SURE))


def certain(cells: Cells, what: str) -> JudgedClaim:
    """ALWAYS, of cells without chance, where a condition holds or does not."""
    found = [2 * int(holds(rows, what).all()) - 1 for _, rows in cells]
    return always(lambda _: found)


def ratio_above(rows: pd.DataFrame, first: str, second: str, block: str) -> JudgedClaim:
    """MORE_THAN 1, of the ratio of two columns: geometric mean with its interval over blocks."""
    logs = np.log(rows[first].to_numpy(float) / rows[second].to_numpy(float))
    value, low, high = np.exp(over_blocks(logs, rows[block].to_numpy())[:3])
    return more_than(low, high, 1.0, f"{value:.3g} ({low:.3g} to {high:.3g})")


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
    return cluster_share(
        (int(own.sum()), len(own)) for _, own in rows.groupby("seed")["holds"] if cells
    )


def at_times(cells: Cells, what: str) -> JudgedClaim:
    """SOMETIMES, of the runs in which a condition holds."""
    return sometimes(single(cells, what))


def spread_text(cells: Cells, name: str) -> str:
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


def remainder_text(runs: pd.DataFrame, cases: Sequence[str], excitations: Sequence[str]) -> str:
    """Text, true noises: what is left of the accelerometers' deviations along x, y, z (medians
    of shares); what that amounts to, against the error."""
    texts = []
    for case, excitation in product(cases, excitations):
        rows = together(pick(runs, [case], [excitation], [RIGHT]))
        shares = np.array([rows[f"accel_left_{axis}"].median() for axis in "xyz"])
        texts.append(
            f"{case}, {excitation}: {' '.join(f'{each:.2g}' for each in shares)}, that is "
            f"{np.linalg.norm(shares * START_STD[9:12]):.2g} m/s² stated for an error of "
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
BOTH = lambda *names: [name + reading for name in names for reading in ("", CONSIDERED)]
EULER_STILL = of_runs([PRINTED], STILL)
STEEP = of_runs([PRINTED], ["steep"])
BLOWN_UP = f"stopped or angle_std_rad > {HALF_A_TURN} or ~(position_m < 10)"
HOLDS = f"~stopped and position_m < 10 and attitude_rad < {np.radians(10.0)}"
OPEN = of_runs(BOTH("indirect-ahrs-open"), MOVED)
MEKF_STILL, MEKF_MOVED = (
    of_runs((*MEKF, *MEKF_PRINTED), STILL),
    of_runs((*MEKF, *MEKF_PRINTED), MOVED),
)
OF_MEKF = filters(MEKF_PRINTED, MEKF)
OF_AHRS = filters([AHRS_PRINTED], ["direct-ahrs"], considered=True)
OF_INDIRECT = filters([INDIRECT_PRINTED], INDIRECT, considered=True)
OF_FEEDBACK = filters([INDIRECT_PRINTED], ["indirect-ahrs-closed"], considered=True)
ALL_BIASES = "accel_s < never and gyro_s < never"
FORWARD = of_intro(0, ["feedforward"], BIASES)
DECAYED = "abs({left} / {model} - 1) < 0.05"
STATE, ERROR, HELD_ERROR = (
    "estimated error state (letter, by algebra)",
    "true less estimate (spirit)",
    "the same, held (letter of the code)",
)
FAST_NAMES = [case.name for case in FAST]


def name_parts(
    **parts: Callable[[FossenEvidence], JudgedClaim],
) -> Callable[[FossenEvidence], JudgedClaim]:
    """A part that is judged in readings of its own, by their names."""
    return lambda e: over_named({name: part(e) for name, part in parts.items()})


def mekf(rule: Callable[[Cells, str], JudgedClaim], what: str) -> ByReading:
    """A part on all MEKF under the signals, in every reading."""
    return ByReading(rule, what, OF_MEKF, TUNINGS)


def mekf_shown(what: str, time: str = "") -> dict[str, Callable[[FossenEvidence], object]]:
    """Shares of the runs of all MEKF in which a condition holds: of the letter (as printed, the
    chapter's weights, constant biases), of all tunings that decide, of decaying estimates."""
    of_letter = of_runs(MEKF_PRINTED, ("signal 1", MOVED[-1]), CHAPTER)
    fading = of_runs((*MEKF, *MEKF_PRINTED), MOVED, FADING)
    found = {
        "letter": over(of_letter, share, what),
        "share": over(MEKF_MOVED, share, what),
        "fading": over(fading, share, what),
    }
    return found | ({"times": over(MEKF_MOVED, spread_text, time)} if time else {})


def _by(cells: Cells, moved: bool) -> Cells:
    """The cells of motions with a high acceleration, or of the others."""
    return [
        (key, rows) for key, rows in cells if (rows["acceleration_m_s2"].iloc[0] >= MOVES) == moved
    ]


CLAIMS = {
    "ahrs_all_states": Claim(
        "With an AHRS the 15-state linear time-varying Kalman filter estimates all 15 states, "
        "thanks to observability.",
        "14.3.2",
        "the direct filter with an AHRS in every reading, signals, at rest and steady: biases of "
        "accelerometers and gyros converge within the run",
        {"cells": ByReading(everywhere, ALL_BIASES, OF_AHRS, DECIDING, STILL)},
        "{cells}. Accelerometers: {accel}; gyros: {gyro}",
        "tables readings, cells",
        {
            "accel": lambda e: spread_text(
                CLAIMS["ahrs_all_states"].parts["cells"].all_cells(e), "accel_s"
            ),
            "gyro": lambda e: spread_text(
                CLAIMS["ahrs_all_states"].parts["cells"].all_cells(e), "gyro_s"
            ),
            "share": lambda e: share(
                CLAIMS["ahrs_all_states"].parts["cells"].all_cells(e), ALL_BIASES
            ),
        },
        kind=ALWAYS,
        answer="All biases converge in {share:.0%} of the runs. By reading - {cells}.",
    ),
    "euler_is_hard": Claim(
        "In the direct EKF with Euler angles the acceleration bias is hard to estimate and usually "
        "requires sufficient excitation.",
        "14.3.3",
        "the printed direct filter with position and compass: accelerometer biases do not converge "
        "within the run at rest and steady, and do under the signals, in every reading; both parts "
        "must hold",
        {
            "still": over(EULER_STILL, mainly, "~(accel_s < never)"),
            "moved": ByReading(mainly, "accel_s < never", filters([PRINTED], []), DECIDING),
        },
        "At rest and steady they do not: {still}. Under the signals they do - {moved} ({times})",
        "figure 4, tables readings, cells",
        {
            "times": over(of_runs([PRINTED], MOVED), spread_text, "accel_s"),
            "at_rest": over(EULER_STILL, share, "accel_s < never"),
            "in_motion": over(of_runs([PRINTED], MOVED), share, "accel_s < never"),
        },
        kind=MOSTLY,
        answer="They converge in {in_motion:.0%} of the runs in motion and in {at_rest:.0%} of "
        "those without. By reading - {moved}.",
    ),
    "euler_blows_up": Claim(
        "Covariance blow-up due to the Euler angles is possible in the direct EKF; consider the "
        "MEKF instead.",
        "14.3.3",
        "through the vertical, position and compass: the printed direct filter states a standard "
        "deviation of an angle beyond half a turn, stops, or is 10 m off (rms, last "
        f"{LAST:g} s); the MEKF, as printed and the library's, neither stops nor is off by 10 m or 10 deg",
        {
            "printed": over(STEEP, at_times, BLOWN_UP),
            "mekf": ByReading(
                everywhere,
                HOLDS,
                filters([MEKF_PRINTED[1]], [MEKF[4]]),
                TUNINGS,
                ["steep"],
                moved=False,
            ),
        },
        "Blown up: {printed}, the largest deviation of an angle {largest:.3g} rad in the median; "
        "10 m off or stopped: {lost:.0%}. The MEKF holds - {mekf}. {positions}",
        "tables readings, cells",
        {
            "largest": over(STEEP, median, "angle_std_rad"),
            "lost": over(STEEP, share, "stopped or ~(position_m < 10)"),
            "share": over(STEEP, share, BLOWN_UP),
            "mekf_lost": over(
                of_runs([MEKF_PRINTED[1], MEKF[4]], ["steep"]),
                share,
                f"~({HOLDS})",
            ),
            "positions": over(
                RUNS, positions, (PRINTED, PRINTED_INDIRECT, EULER, MEKF_PRINTED[1], MEKF[4])
            ),
        },
        kind=SOMETIMES,
        answer="The printed filter's covariance blows up in {share:.0%} of the runs through the "
        "vertical, and {lost:.0%} are lost; of the MEKF's {mekf_lost:.0%} are. By reading - {mekf}.",
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
        "introductory example, dropout of 60 s. Bias errors are, to the letter, the error state of "
        "the feedforward filter: it decays by its time constant within 5 %; in spirit, true less "
        "estimate: smaller after the dropout, feedforward and feedback, constant and decaying biases",
        {
            "readings": name_parts(
                **{
                    STATE: over(
                        of_intro(1, FORMS[:1], BIASES),
                        everywhere,
                        DECAYED.format(left="bias_left", model="bias_model"),
                    ),
                    ERROR: over(
                        of_intro(1, FORMS[:2], BIASES), everywhere, "bias_after < bias_before"
                    ),
                }
            ),
        },
        "{readings}. Error before to after, and position error after: {medians}",
        "figure 8",
        {
            "medians": over(
                of_intro(1, FORMS, BIASES),
                lines,
                "{bias_before:.2g} to {bias_after:.2g} m/s², position {position_m:.3g} m",
                ", ",
            ),
            "share": over(of_intro(1, FORMS[:2], BIASES), share, "bias_after < bias_before"),
            "state": over(
                of_intro(1, FORMS[:1], BIASES),
                share,
                DECAYED.format(left="bias_left", model="bias_model"),
            ),
        },
        kind=ALWAYS,
        answer="The estimated error state decays as modelled in {state:.0%} of the dropouts, the "
        "error of the estimate shrinks in {share:.0%}. By reading - {readings}.",
    ),
    "indirect_converges": Claim(
        "In the indirect filter with AHRS, feedforward or feedback, the estimated biases converge "
        "to their true value.",
        "14.4.2",
        "as claim 1, the indirect filters with an AHRS in every reading",
        {"cells": ByReading(everywhere, ALL_BIASES, OF_INDIRECT, TUNINGS, STILL)},
        "{cells}. Accelerometers: {accel}; gyros: {gyro}",
        "tables readings, cells",
        {
            "accel": lambda e: spread_text(
                CLAIMS["indirect_converges"].parts["cells"].all_cells(e), "accel_s"
            ),
            "gyro": lambda e: spread_text(
                CLAIMS["indirect_converges"].parts["cells"].all_cells(e), "gyro_s"
            ),
            "held": over(
                of_runs((INDIRECT_PRINTED, *BOTH(*INDIRECT)), (*MOVED, *STILL)), share, ALL_BIASES
            ),
            "fading": over(
                of_runs((INDIRECT_PRINTED, *INDIRECT), (*MOVED, *STILL), FADING), share, ALL_BIASES
            ),
        },
        kind=ALWAYS,
        answer="All biases converge in {held:.0%} of the runs with held estimates or true noises, "
        "and in {fading:.0%} of those with decaying ones. By reading - {cells}.",
    ),
    "decay": Claim(
        "The time constants ensure that the bias errors go exponentially to zero during dead "
        "reckoning (15 states).",
        "14.4.2",
        f"dropout from {DROPOUT[0]:g} to {DROPOUT[1]:g} s, chapter's weights, indirect filters and "
        "MEKF. Bias errors are, to the letter, the error state: the estimate decays within 5 % of its "
        "time constant; in spirit, true less estimate: smaller after the dropout, of estimates that "
        "decay, and that are held as in the code",
        {
            "readings": name_parts(
                **{
                    STATE: over(
                        of_dropouts(FADING),
                        everywhere,
                        DECAYED.format(left="accel_left", model="accel_model"),
                    ),
                    ERROR: over(of_dropouts(FADING), everywhere, "accel_after < accel_before"),
                    HELD_ERROR: over(
                        of_dropouts(CHAPTER), everywhere, "accel_after < accel_before"
                    ),
                }
            ),
        },
        "{readings}. Decaying: {medians}; position after {fading_m:.3g} m, held {held_m:.3g} m "
        "(medians)",
        "table dropouts",
        {
            "medians": over(
                of_dropouts(FADING), lines, "{accel_before:.2g} to {accel_after:.2g} m/s²"
            ),
            "fading_m": over(of_dropouts(FADING), median, "position_after_m"),
            "held_m": over(of_dropouts(CHAPTER), median, "position_after_m"),
            "share": over(of_dropouts(FADING), share, "accel_after < accel_before"),
            "state": over(
                of_dropouts(FADING), share, DECAYED.format(left="accel_left", model="accel_model")
            ),
        },
        no_dropouts,
        kind=ALWAYS,
        answer="The estimated error state decays as modelled in {state:.0%} of the dropouts, the "
        "error of the estimate shrinks in {share:.0%}. By reading - {readings}.",
    ),
    "drift": Claim(
        "In the feedforward filter the INS drifts, the estimate compensates drift and biases.",
        "14.4.2",
        f"indirect-ahrs-open under the signals: the raw INS is off by more than {DRIFTED:g} m "
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
        f"position error under the signals, rms of the last {LAST:g} s over that of the {LAST:g} s "
        f"before: with feedback below {GROWN:g} in every reading, of the raw INS beside it above "
        f"(linear growth is 1.65); both parts must hold",
        {
            "feedback": ByReading(everywhere, f"growth < {GROWN}", OF_FEEDBACK, TUNINGS),
            "without": over(OPEN, everywhere, f"ins_growth > {GROWN}"),
        },
        "With feedback {growth:.3g} in the median, {estimate:.2g} m - {feedback}. The raw INS "
        "{ins_growth:.3g}: {without}",
        "tables readings, cells",
        {
            "growth": over(
                of_runs((INDIRECT_PRINTED, *BOTH("indirect-ahrs-closed")), MOVED, *TUNINGS),
                median,
                "growth",
            ),
            "estimate": over(
                of_runs((INDIRECT_PRINTED, *BOTH("indirect-ahrs-closed")), MOVED, *TUNINGS),
                median,
                "position_m",
            ),
            "ins_growth": over(OPEN, median, "ins_growth"),
        },
        kind=ALWAYS,
        answer=f"From one {LAST:g} s to the next the error grows by a factor of {{growth:.2g}} with "
        "feedback and of {ins_growth:.2g} without. By reading - {feedback}.",
    ),
    "accel_minutes": Claim(
        "MEKF: the acceleration biases converge to their true values in 1-2 minutes.",
        "14.4.3, concluding remarks",
        f"MEKF, two sets of sensors as printed and six of the library, signals, in every reading: "
        f"converged after {MINUTES:g} s at the latest, sooner counts for the claim",
        {"cells": mekf(mainly, f"accel_s <= {MINUTES}")},
        "{cells}. {times}. Of all runs but decaying ones {before:.0%} before 1 min, {within:.0%} in "
        "1-2 min, {later:.0%} later, {never:.0%} not within 5 min",
        "figures 3 to 5, table readings",
        {
            **mekf_shown(f"accel_s <= {MINUTES}", "accel_s"),
            "before": over(MEKF_MOVED, share, "accel_s < 60"),
            "within": over(MEKF_MOVED, share, "accel_s >= 60 and accel_s <= 120"),
            "later": over(MEKF_MOVED, share, "accel_s > 120 and accel_s < never"),
            "never": over(MEKF_MOVED, share, "accel_s == never"),
        },
        kind=MOSTLY,
        answer="They converge within two minutes in {letter:.0%} of the runs read to the letter, in "
        "{share:.0%} of all; with estimates that decay in {fading:.0%}. By reading - {cells}.",
    ),
    "gyro_seconds": Claim(
        "MEKF: the angular rate sensor biases need less than 10 seconds to converge.",
        "14.4.3, concluding remarks",
        f"as the claim before, converged before {GYRO:g} s",
        {"cells": mekf(mainly, f"gyro_s < {GYRO}")},
        "{cells}. {times}",
        "figures 3 to 5, table readings",
        mekf_shown(f"gyro_s < {GYRO}", "gyro_s"),
        kind=MOSTLY,
        answer="They converge within ten seconds in {letter:.0%} of the runs read to the letter, in "
        "{share:.0%} of all; with estimates that decay in {fading:.0%}. By reading - {cells}.",
    ),
    "states_converge": Claim(
        "MEKF: position, velocity and attitude converge to their true values.",
        "14.4.3, concluding remarks",
        f"as before: rms over the last {LAST:g} s below {POSITION:g} m (the error of one fix), "
        f"{VELOCITY:g} m/s and 1 deg, all three",
        {"cells": mekf(everywhere, NEAR_THE_TRUTH)},
        "{cells}. All but decaying ones{errors}",
        "figure 2, tables readings, cells",
        {**mekf_shown(NEAR_THE_TRUTH), "errors": over(MEKF_MOVED, errors)},
        kind=ALWAYS,
        answer="All three are near the truth in {letter:.0%} of the runs read to the letter, in "
        "{share:.0%} of all; with estimates that decay in {fading:.0%}. By reading - {cells}.",
    ),
    "excitation": Claim(
        "The acceleration bias does not converge unless the vehicle is sufficiently excited: "
        "observability is related to manoeuvres.",
        "14.4.3; chapter goals",
        "MEKF: accelerometer biases do not converge within the run at rest and steady, and do under "
        "the signals, in every reading; both parts must hold",
        {
            "still": over(MEKF_STILL, everywhere, "~(accel_s < never)"),
            "moved": mekf(everywhere, "accel_s < never"),
        },
        "At rest and steady they do not: {still}. Under the signals they do - {moved}. Left of the "
        "initial deviations along x, y, z: {left}",
        "figure 6, tables readings, cells",
        {
            **mekf_shown("accel_s < never"),
            "left": over(RUNS, remainder_text, (MEKF[1], MEKF[4]), ("signal 1", "at rest")),
            "at_rest": over(MEKF_STILL, share, "accel_s < never"),
        },
        kind=ALWAYS,
        answer="They converge in {letter:.0%} of the runs in motion read to the letter, in "
        "{share:.0%} of all (decaying estimates {fading:.0%}), and in {at_rest:.0%} of those without. "
        "By reading - {moved}.",
    ),
    "roll_and_pitch": Claim(
        "It takes excitation in roll and pitch.",
        "14.4.3, concluding remarks",
        "MEKF on a level body whose heading swings by 40 deg within a minute and that does nothing "
        "else: the accelerometer biases converge within the run, in every reading",
        {
            "cells": ByReading(
                nowhere, "accel_s < never", OF_MEKF, TUNINGS, ["turning"], moved=False
            )
        },
        "They do not - {cells} ({times})",
        "figure 6, tables readings, cells",
        {
            "times": over(of_runs((*MEKF, *MEKF_PRINTED), ["turning"]), spread_text, "accel_s"),
            "share": over(of_runs((*MEKF, *MEKF_PRINTED), ["turning"]), share, "accel_s < never"),
        },
        kind=NEVER,
        answer="A swinging heading alone makes them converge in {share:.0%} of the runs. By reading - "
        "{cells}.",
    ),
    "static_attitude": Claim(
        "The static mapping from specific force to roll and pitch suffers from inaccuracies when "
        "performing high-acceleration manoeuvres.",
        "14.2.1",
        f"static roll and pitch of an ideal accelerometer: off by less than {TILTED:g} deg (rms) in "
        f"motions below {MOVES:g} m/s² and by more in a coordinated turn of 6 m/s²; both parts must hold",
        {
            "still": over(
                beside(STATIC, "motion"),
                lambda cells: certain(_by(cells, False), f"tilt_deg < {TILTED}"),
            ),
            "moved": over(
                beside(STATIC, "motion"),
                lambda cells: certain(_by(cells, True), f"tilt_deg > {TILTED}"),
            ),
        },
        "Slow: {still}; in the turn: {moved}. {tilts}",
        "table static",
        {
            "tilts": over(
                beside(STATIC, "motion"),
                lambda cells: "; ".join(
                    f"{key[0]}: {rows['tilt_deg'].iloc[0]:.2g} deg at {rows['acceleration_m_s2'].iloc[0]:.2g} m/s²"
                    for key, rows in cells
                ),
            ),
            "slow": lambda e: (
                e.beside[STATIC].query(f"acceleration_m_s2 < {MOVES}")["tilt_deg"].max()
            ),
            "turn": lambda e: (
                e.beside[STATIC].query(f"acceleration_m_s2 >= {MOVES}")["tilt_deg"].max()
            ),
        },
        missing_text(STATIC),
        kind=EXPLANATION,
        answer="It errs by at most {slow:.2g} deg in slow motions and by {turn:.3g} deg in a "
        "coordinated turn.",
    ),
    "observer_cheaper": Claim(
        "The nonlinear attitude observer is less computationally demanding than the MEKF.",
        "14.2.3",
        "time for a sample of the MEKF with position and field over that of the attitude observer "
        "with the same field, compiled alike, in pairs of runs: the ratio lies above 1",
        {"ratio": lambda e: ratio_above(e.beside[COST], "mekf_us", "observer_us", "repeat")},
        "MEKF over observer {ratio}",
        "table cost",
        {
            "mekf_us": lambda e: e.beside[COST]["mekf_us"].median(),
            "observer_us": lambda e: e.beside[COST]["observer_us"].median(),
        },
        missing_text(COST),
        kind=MORE_THAN,
        answer="The MEKF takes {mekf_us:.2g} µs a sample, the observer {observer_us:.2g} µs.",
    ),
    "observer_stable": Claim(
        "The attitude observer renders the equilibrium semiglobally exponentially stable.",
        "14.2.3",
        f"the printed observer at rest without noise, gyro bias unknown, 30 to 170 deg off about "
        f"random axes: below {HOME:g} deg after {OBSERVED:g} s in more than {SURE:.0%} of the starts; "
        "to the letter with the field across the vertical, in spirit with the whole field",
        {
            "readings": name_parts(
                **{
                    f"{field} field ({word})": over(
                        beside(STABILITY, "start_deg", field=[field]), surely, f"off_deg < {HOME}"
                    )
                    for field, word in zip(FIELDS, ("letter", "spirit"))
                }
            )
        },
        "{readings}. Largest error: {projected:.2g} deg with the field across the vertical, "
        "{whole:.2g} deg with the whole field",
        "table stability",
        {
            field: lambda e, field=field: (
                e.beside[STABILITY].query(f"field == '{field}'")["off_deg"].max()
            )
            for field in FIELDS
        }
        | {
            f"{field}_home": over(
                beside(STABILITY, "start_deg", field=[field]), share, f"off_deg < {HOME}"
            )
            for field in FIELDS
        },
        missing_text(STABILITY),
        kind=ALWAYS,
        answer="From {projected_home:.0%} of the starts it comes home with the field across the "
        "vertical, from {whole_home:.0%} with the whole field. By reading - {readings}.",
    ),
    "demonstration": Claim(
        "With an acceleration reference vector by GPS the observer estimates the attitude of a "
        "helicopter and of an aircraft in flight.",
        "14.2.3, experimental testing",
        "those flights are not public; on thor75, 200 to 600 s, default gains: the tilt error of the "
        "observer with gravity alone over that with GNSS velocity, over blocks of 20 s, lies above 1",
        {"ratio": lambda e: ratio_above(e.beside[FLIGHT], "gravity_deg", "gnss_deg", "block")},
        "Gravity over GNSS {ratio}. Tilt {gnss:.2g} deg with the reference by GNSS velocity, "
        "{gravity:.2g} deg with gravity alone (rms of an axis)",
        "figure 9, table flight",
        {
            name: lambda e, name=name: flight_rms(e.beside[FLIGHT])[name]
            for name in ("gnss", "gravity")
        },
        missing_text(FLIGHT),
        kind=MORE_THAN,
        answer="On a recorded flight it has {gnss:.2g} deg of tilt, with gravity alone {gravity:.2g} deg.",
    ),
    "hurwitz": Claim(
        "A necessary condition for global exponential stability of the fixed-gain observer is that F "
        "is Hurwitz.",
        "14.3.1",
        f"random gains, attitude constant: where F is not Hurwitz an error is larger after "
        f"{SETTLING:g} s, where it is Hurwitz less than a hundredth is left; both parts must hold",
        {
            "not": over(beside(GAINS, "hurwitz", hurwitz=[False]), surely, "left > 1"),
            "hurwitz": over(beside(GAINS, "hurwitz", hurwitz=[True]), surely, "left < 0.01"),
        },
        "Not Hurwitz: {not}; Hurwitz: {hurwitz}. In a steady turn twice as fast as the gains allow "
        "{turning:.0%} of the Hurwitz sets diverge",
        "table gains",
        {
            "grown": over(beside(GAINS, "hurwitz", hurwitz=[False]), share, "left > 1"),
            "settled": over(beside(GAINS, "hurwitz", hurwitz=[True]), share, "left < 0.01"),
            "turning": over(beside(GAINS, "hurwitz", hurwitz=[True]), share, "turning_1_s > 0"),
        },
        missing_text(GAINS),
        kind=EXPLANATION,
        answer="Errors grow with {grown:.0%} of the gains that are not Hurwitz and settle with "
        "{settled:.0%} of the others; in a fast turn {turning:.0%} of these diverge.",
        identity=lambda e: "with constant attitude the error system is linear and time-invariant",
    ),
    "quaternion_rank": Claim(
        "The covariance of a unit quaternion is rank deficient, and adding a correction violates the "
        "unit constraint.",
        "14.4.3",
        f"random attitudes and covariances: the smallest eigenvalue of the quaternion's covariance is "
        f"below {RANK:g} of the largest, and adding a correction of 0.1 rad changes the length",
        {
            "rank": over(beside(QUATERNION, "all"), surely, f"smallest < {RANK}"),
            "length": over(beside(QUATERNION, "all"), surely, "length > 1e-6"),
        },
        "Rank: {rank}; length: {length}",
        "table quaternion",
        {
            "smallest": lambda e: e.beside[QUATERNION]["smallest"].max(),
            "off": lambda e: e.beside[QUATERNION]["length"].median(),
        },
        missing_text(QUATERNION),
        kind=ALWAYS,
        answer="The smallest eigenvalue is at most {smallest:.0e} of the largest; 0.1 rad added "
        "changes the length by {off:.1e}.",
        identity=lambda e: "the four elements depend on three errors to first order",
    ),
    "fast_rates": Claim(
        "It is straightforward to run the estimator at 1000-2000 Hz.",
        "14.4.3",
        "MEKF at 1 kHz with the true noises under both signals: states near the truth as in claim 12; "
        f"and a sample takes less than {HALF_A_MILLISECOND:g} µs, what 2 kHz leaves; both parts must hold",
        {
            "states": over(of_runs(FAST_NAMES, MOVED, RIGHT), everywhere, NEAR_THE_TRUTH),
            "time": over(beside(COST, "all"), surely, f"mekf_us < {HALF_A_MILLISECOND}"),
        },
        "At 1 kHz{errors}: {states}. Time: {time}",
        "tables cells, cost",
        {
            "errors": over(of_runs(FAST_NAMES, MOVED, RIGHT), errors),
            "share": over(of_runs(FAST_NAMES, MOVED, RIGHT), share, NEAR_THE_TRUTH),
            "mekf_us": lambda e: e.beside[COST]["mekf_us"].median(),
        },
        lambda e: (
            missing_text(COST)(e)
            or "needs runs at 1 kHz" * (not e.runs["case"].isin(FAST_NAMES).any())
        ),
        kind=ALWAYS,
        answer="At 1 kHz {share:.0%} of the runs are near the truth, and a sample takes {mekf_us:.2g} µs.",
    ),
}
"""In the order of the chapter; those from the static attitude on are statements beside its
filters."""


def claims(evidence: FossenEvidence) -> list[dict[str, str]]:
    """All findings, in the order of the chapter."""
    return findings(CLAIMS.values(), evidence)


def by_reading(evidence: FossenEvidence) -> pd.DataFrame:
    """A row per claim and reading, with its word and verdict."""
    return table(CLAIMS, evidence)
