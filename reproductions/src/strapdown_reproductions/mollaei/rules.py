"""Rules from flights to verdicts on the claims of Mollaei et al.: the bounds, the readings, the
measures, and what of them common.kinds decides.

Tables are those of cells.wide, {Case: table}.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from strapdown.evaluation.consistency import paired_comparison, proportion
from strapdown.experiments.outages.summaries import over_blocks
from strapdown.typing import Array

from ..common import kinds
from ..common.claims import JudgedClaim
from ..common.kinds import Share, Votes, cluster_share
from ..common.pages import NOT_REPRODUCED, REPRODUCED, UNDECIDED
from ..common.paired_ratios import MIN_ERROR, better as sides, both_of, ratio
from ..common.verdicts import SIZE, both, decide, over_readings, vote
from .cells import (
    AT_TRIM,
    CKF,
    CONDITIONS,
    DIRECT,
    E0,
    E1,
    EKF,
    EKFS,
    FED_TRUTH,
    FILTERS,
    HELD,
    IMU,
    MODEL,
    MODES,
    NO_FILTER,
    ONCE,
    PKF,
    POINTS,
    PUBLISHED,
    SENSORS,
    SIX,
    UKF,
    FlightCase,
    flown_values,
)
from .metrics import BY_FIXES, BY_TRUTH

OVERSHOOTS = ("over_x_pct", "over_z_pct")
CONTROLS, AILERON = ("elevator_deg", "rudder_deg"), "aileron_deg"
"""Ue and Ur, and Ua."""
LETTER, SPIRIT, CHARITY = "letter", "spirit", "charity"
"""Kinds of readings: as printed, the likely meaning of the text, or the one that favours the
claim."""
PRINTED_Y = (10.0, 50.0)
"""Per cent: between which the overshoots of velocity Y "in all cases" are said to lie."""
SETTLING = ("settle_elevator_s", "settle_engine_s", "settle_alpha_s")
TWICE = 2.0
"""\"Diverges\", \"negligible\", \"not suitable\": a factor of so much."""
AWAY, NEAR = 500.0, 100.0
"""m: a flight has diverged when it stopped, or estimate or aircraft were further off; \"much less
than 500 m\" is less than a fifth of it."""
NEARLY_ALL = 0.9
"""Share of the flights that must not diverge, or stay near."""
SAME = 1e-6
"""m: filters whose estimates and flights differ by at most this count as one filter."""
ZERO = 5e-5
"""N: largest value that the tables print as 0.0000."""
PRINTED_DEVIATIONS, PRINTED_ALL = (
    ("fx_n", "fz_n", "gx", "gz"),
    ("fx_n", "fz_n", "gx", "gz", *OVERSHOOTS),
)
"""Rows of the published tables."""
ONE_FILTER = {EKF, AT_TRIM, UKF, CKF, PKF, POINTS}
"""One filter where the process is linear, the particle filters but for their draws."""
BY_ALGEBRA = (
    "driven by the IMU the process is linear in position and velocity, and the filters are one, the "
    "PKF but for its draws"
)
Tables: TypeAlias = dict[FlightCase, pd.DataFrame]
Pair: TypeAlias = tuple[str, str]
"""(first, second): two modes, of which the first is to be better."""
Counting: TypeAlias = Callable[[pd.DataFrame, str], tuple[int, int]]
"""(flights of a mode of which something is so, its flights) of the table of a case."""


@dataclass(frozen=True, eq=False)
class MollaeiReading:
    """One reading of the points that the paper leaves open."""

    name: str
    instead: Mapping[str, str] = field(default_factory=dict)  # {mode: the one that stands for it}
    condition: str = ""  # of cells.CONDITIONS
    word: str = CHARITY  # LETTER, SPIRIT or CHARITY


AS_PRINTED = MollaeiReading("as printed", word=LETTER)
READINGS = (
    AS_PRINTED,
    MollaeiReading(FED_TRUTH, {NO_FILTER: FED_TRUTH}, word=LETTER),
    MollaeiReading(AT_TRIM, {EKF: AT_TRIM}, word=SPIRIT),
    *(MollaeiReading(ekf, {EKF: ekf}) for ekf in (ONCE, HELD)),
    MollaeiReading(POINTS, {PKF: POINTS}, word=LETTER),
    *(MollaeiReading(condition, condition=condition) for condition in CONDITIONS),
)


class MollaeiEvidence(NamedTuple):
    """All that the claims rest on."""

    tables: Tables
    # a row per IMU-driven flight: mode and apart_m, largest distance of estimate or aircraft from
    # the EKF's
    apart: pd.DataFrame


def choose_flown(
    *experiments: str, prediction: str | None = None
) -> Callable[[MollaeiEvidence], Tables]:
    """Chooses the six-state tables of experiments, of all readings or of one prediction."""
    return lambda evidence: {
        case: table
        for experiment in experiments
        for case, table in evidence.tables.items()
        if (case.experiment, case.form) == (experiment, SIX)
        and prediction in (None, case.prediction)
    }


def usual(tables: Tables, prediction: str | None = None) -> Tables:
    """Return the cells with default conditions, of all predictions or of one."""
    return {
        case: table
        for case, table in tables.items()
        if not case.condition and prediction in (None, case.prediction)
    }


def foregone(case: FlightCase, pair: Iterable[str]) -> bool:
    """True where algebra makes the modes one filter in a case; nothing then needs measuring."""
    return case.linear and set(pair) <= ONE_FILTER


class Cells(NamedTuple):
    """Where a pair is compared in a reading."""

    free: Tables
    same: Tables  # where it is one filter by algebra
    pair: Pair  # as it is flown there


def cells_of(tables: Tables, reading: MollaeiReading, pair: Pair) -> Cells:
    """The Cells of a pair in a reading."""
    first, second = (reading.instead.get(mode, mode) for mode in pair)
    own = {
        case: table
        for case, table in tables.items()
        if case.condition == reading.condition
        and {("fx_n", first), ("fx_n", second)} <= set(table.columns)
    }
    same = {case: table for case, table in own.items() if foregone(case, (first, second))}
    free = {case: table for case, table in own.items() if case not in same}
    return Cells(free, same, (first, second))


def readings_of(tables: Tables, pairs: Sequence[Pair]) -> dict[MollaeiReading, dict[Pair, Cells]]:
    """{reading that says something of the pairs, and was flown with all: {pair: Cells}}."""
    found = {
        reading: {pair: cells_of(tables, reading, pair) for pair in pairs} for reading in READINGS
    }
    return {
        reading: own
        for reading, own in found.items()
        if all(cells.free or cells.same for cells in own.values())
        and (not reading.instead or any(cells.pair != pair for pair, cells in own.items()))
    }


def algebra(tables: Tables, pairs: Sequence[Pair]) -> str:
    """Text: that the pairs are one filter wherever they were flown; else ""."""
    found = [cells for own in readings_of(tables, pairs).values() for cells in own.values()]
    return BY_ALGEBRA if found and not any(cells.free for cells in found) else ""


def at_least(tables: Tables, measures: Sequence[str], pair: Pair, factor: float) -> Votes:
    """Votes of the cells in which the measure of the first of a pair is at least `factor` times
    that of the second."""

    def votes(confidence: float) -> list[int]:
        found = [
            ratio(table, measure, *pair, probability=confidence)
            for table in tables.values()
            for measure in measures
        ]
        return [int(each.low >= factor) - int(each.high < factor) for each in found]

    return votes


class ComparedRule(NamedTuple):
    """A JudgedClaim that has a sentence of its own for its answer."""

    verdict: str
    text: str
    answer: str

    def __str__(self) -> str:
        return self.text


Voting: TypeAlias = Callable[..., Votes]
"""(tables, measures, first, second) -> Votes of the cells for the first of a pair."""


def better(
    tables: Tables,
    measures: Sequence[str],
    pairs: Sequence[Pair],
    others: Sequence[str] = (),
    voting: Voting = sides,
) -> ComparedRule:
    """The first of each pair is better in most cells (kinds.mostly), in every reading, whoever
    predicts, and, if there are `others`, with these in place of `measures`. voting: how a cell
    votes, by default for the smaller measure.

    Cells that are identities do not vote, and are counted apart; where there are no others at all,
    the filters are one, and neither is better.
    """
    verdicts: dict[str, str] = {}
    texts, ratios, same = [], {}, 0
    for driven in (MODEL, IMU):
        by_one = {case: table for case, table in tables.items() if case.prediction == driven}
        for reading, own in readings_of(by_one, pairs).items():
            if reading is AS_PRINTED:
                same += sum(len(cells.same) for cells in own.values()) * len(measures)
            if not any(cells.free for cells in own.values()):
                continue
            name = f"{reading.name} ({reading.word}), {driven}-driven"
            judged = [
                {
                    cells.pair: kinds.mostly(voting(cells.free, each, *cells.pair))
                    for cells in own.values()
                    if cells.free
                }
                for each in (measures, others)
                if each
            ]
            verdicts[name] = over_readings(
                *(both(*(pair.verdict for pair in each.values())) for each in judged)
            )
            ratios[name] = ", ".join(
                f"{' / '.join(pair)} {median_of(middle_ratios(free, measures, pair))}"
                for free, _, pair in own.values()
                if free
            )
            counted = ". By the other measure: ".join(
                ". ".join(f"{a} better than {b}: {each}" for (a, b), each in pairs_of.items())
                for pairs_of in judged
            )
            texts.append(f"{name}: {verdicts[name]}. {counted}; median ratios, {ratios[name]}")
    texts += [f"{same} cells more are identities: {BY_ALGEBRA}"] * bool(same)
    none = NOT_REPRODUCED if same else UNDECIDED
    verdict = over_readings(*verdicts.values()) if verdicts else none
    answer = _answer(verdicts, ratios, same, verdict)
    return ComparedRule(verdict, ". ".join(texts) or "not flown", answer)


def _answer(verdicts: dict[str, str], ratios: dict[str, str], same: int, verdict: str) -> str:
    """A sentence with the median ratios as printed, and one on the readings that turn it; those
    that leave it open do so where the `verdict` of all is left open."""
    one = "Driven by the IMU they are one filter." * bool(same)
    base = next(iter(verdicts), "")
    if not base:
        return one or "Not flown."
    said = f"Median ratios, {base}: {ratios[base]}. {one}".strip()
    silent = {verdicts[base]} if verdict == UNDECIDED else {verdicts[base], UNDECIDED}
    turned = [name for name in verdicts if verdicts[name] not in silent]
    if turned:
        each = "; ".join(f"{name} ({ratios[name]}: {verdicts[name]})" for name in turned)
        said += f" It turns with another reading: {each}."
        against = " Equation (22) linearises at the estimate, against these readings of the EKF."
        said += against * any(name.startswith((AT_TRIM, ONCE, HELD)) for name in turned)
    return said


def middle_ratios(tables: Tables, measures: Sequence[str], pair: Pair) -> Array:
    """(n,) ratios of a pair, of the cells that have one."""
    found = np.array(
        [ratio(table, each, *pair).value for table in tables.values() for each in measures], float
    )
    return found[np.isfinite(found)]


def median_of(values: Array | Sequence[float]) -> str:
    """Text: the median, "–" of nothing."""
    return f"{np.median(values):.3g}" if len(values) else "–"


def less_pronounced(tables: Tables, measures: Sequence[str], first: str, second: str) -> Votes:
    """Votes of the cells (a case and a measure) for the first of a pair deviating less than the
    second, and by a larger factor in that measure than in the aileron."""
    aileron = f"{AILERON}_ref" if measures[0].endswith("_ref") else AILERON

    def votes(confidence: float) -> list[int]:
        found = []
        for table in tables.values():
            block, a, b = both_of(table, aileron, first, second)
            for measure in measures:
                _, c, d = both_of(table, measure, first, second)
                gain = over_blocks(np.log(d / c) - np.log(b / a), block, 1.0, confidence)
                side = ratio(table, measure, first, second, confidence).side
                found.append(min(side, vote(gain.low, gain.high, np.log1p(SIZE))))
        return found

    return votes


def aileron_ratios(tables: Tables, pairs: Sequence[Pair]) -> str:
    """Text: medians of the ratios of the pairs, of the aileron beside CONTROLS, in cells where
    they are not one filter by algebra."""
    return "; ".join(
        f"{' / '.join(pair)} {median_of(middle_ratios(free, (AILERON,), pair))} beside "
        f"{median_of(middle_ratios(free, CONTROLS, pair))}"
        for pair in pairs
        for free in [cells_of(tables, AS_PRINTED, pair).free]
        if free
    )


def resembles(tables: Tables, measures: Sequence[str], modes: Sequence[str]) -> JudgedClaim:
    """The curves of each of the modes resemble those of direct feedback in most cells
    (kinds.mostly): their distance is less than 1 / TWICE of what the curve of direct feedback
    itself deviates (geometric mean over the seeds). By both readings of direct feedback, and by
    who predicts."""
    found = {}
    for blue, mode_of_blue in ((BY_TRUTH, FED_TRUTH), (BY_FIXES, NO_FILTER)):
        names = [f"{measure}_{blue}" for measure in measures]
        for driven in (MODEL, IMU):
            own = usual(tables, driven)
            for mode in modes if own else ():
                values = [
                    flown_values(table, name, mode) for table in own.values() for name in names
                ]
                median = median_of([np.exp(np.mean(np.log(v))) for v in values if len(v)])
                judged = kinds.mostly(_near_to(values))
                name = f"{mode}, beside {mode_of_blue}, {driven}-driven"
                found[name] = JudgedClaim(judged.verdict, f"{judged}, median distance {median}")
    return JudgedClaim(
        over_readings(*(each.verdict for each in found.values())) if found else UNDECIDED,
        "; ".join(f"{name}: {each.verdict}, {each}" for name, each in found.items()),
    )


def _near_to(distances: Sequence[Array]) -> Votes:
    """Votes of cells, the distances of whose flights are given, for their being below 1 / TWICE."""

    def votes(confidence: float) -> list[int]:
        found = []
        for values in distances:
            logs = np.log(np.maximum(values, MIN_ERROR))
            each = paired_comparison(logs, np.zeros(len(logs)), confidence)
            found.append(-vote(each.low, each.high, -np.log(TWICE)))
        return found

    return votes


def by_direct(judge: Callable[[str], JudgedClaim]) -> JudgedClaim:
    """Judge with each reading of direct feedback in place of no filter, and combine the
    verdicts."""
    found = {mode: judge(mode) for mode in DIRECT}
    return JudgedClaim(
        over_readings(*(each.verdict for each in found.values())),
        ". ".join(f"{each}" for each in found.values()),
    )


def worse_than_filters(
    tables: Tables, measures: Sequence[str], seconds: Sequence[str], factor: float
) -> JudgedClaim:
    """`many_times` of no filter, by both readings of direct feedback."""
    return by_direct(lambda mode: many_times(tables, measures, mode, seconds, factor))


def many_times(
    tables: Tables, measures: Sequence[str], first: str, seconds: Sequence[str], factor: float
) -> JudgedClaim:
    """The measures of `first` are at least `factor` times those of each of `seconds`, in every cell
    (kinds.always)."""
    own = usual(tables)
    votes = [at_least(own, measures, (first, second), factor) for second in seconds]
    smallest = {
        second: min(middle_ratios(own, measures, (first, second)), default=np.nan)
        for second in seconds
    }
    found = kinds.always(kinds.of_all(*votes))
    least = ", ".join(f"{first} / {second} {value:.3g}" for second, value in smallest.items())
    return JudgedClaim(found.verdict, f"{found}; smallest ratios: {least}")


def suitable(tables: Tables, measures: Sequence[str], second: str, factor: float) -> ComparedRule:
    """The EKF's `measures` are `factor` times those of `second`, because of what is not linear:
    where the model predicts they are (kinds.mostly), and driven by the IMU, where the process is
    linear, they are not; in each reading of the EKF."""
    verdicts, texts, answers = [], [], []
    for ekf in EKFS:
        pair = (ekf, second)
        own = {
            driven: {
                case: table
                for case, table in usual(tables, driven).items()
                if ("fx_n", ekf) in table.columns
            }
            for driven in (MODEL, IMU)
        }
        if not own[MODEL]:
            continue
        curved, straight = (
            kinds.mostly(at_least(cases, measures, pair, factor)) for cases in own.values()
        )
        by_algebra = all(foregone(case, pair) for case in own[IMU])
        without = NOT_REPRODUCED if by_algebra else straight.verdict
        verdicts.append(
            decide(
                curved.verdict == REPRODUCED and without == NOT_REPRODUCED,
                NOT_REPRODUCED == curved.verdict or without == REPRODUCED,
            )
        )
        middle = median_of(middle_ratios(own[MODEL], measures, pair))
        linear = "1 by algebra" if by_algebra else f"{straight}"
        texts.append(
            f"{ekf}: {verdicts[-1]}; model-driven {curved}, median {middle}; IMU-driven, where the "
            f"system is linear: {linear}"
        )
        answers.append(f"{ekf} {middle}")
    answer = f"Model-driven deviations over the {second}'s, medians: {', '.join(answers)}."
    verdict = over_readings(*verdicts) if verdicts else UNDECIDED
    return ComparedRule(verdict, ". ".join(texts) or "not flown", answer * bool(texts))


def list_medians(values: dict[str, Array], unit: str) -> str:
    """Text: the median of each mode that was flown."""
    return ", ".join(
        f"{mode} {np.median(own):.2g} {unit}" for mode, own in values.items() if len(own)
    )


def medians(tables: Tables, measure: str, unit: str) -> str:
    """Text: the medians of a measure of all modes of the paper, by case."""
    return "; ".join(
        f"{case}: {list_medians({mode: flown_values(table, measure, mode) for mode in MODES}, unit)}"
        for case, table in usual(tables).items()
    )


def count_printed(table: str, measures: Sequence[str], first: str, second: str) -> str:
    """Text: in how many rows of a published table, of those that are not 0, the first mode's
    number is smaller."""
    a, b = (
        np.array([PUBLISHED[table][name][MODES.index(mode)] for name in measures], float)
        for mode in (first, second)
    )
    real = ~((a == 0) & (b == 0)) & np.isfinite(a) & (~np.isnan(b))
    return f"{int((a < b)[real].sum())} of {int(real.sum())}"


def rows_smaller(table: str, measures: Sequence[str], second: str) -> str:
    """Text: in how many rows of a published table UKF and PKF have smaller numbers than the mode
    `second`."""
    texts = (f"{first} {count_printed(table, measures, first, second)}" for first in (UKF, PKF))
    return f". Published: {', '.join(texts)} rows smaller"


def furthest(table: pd.DataFrame, mode: str) -> Array:
    """(flights,) m: how far aircraft or estimate were off at most; without a filter only the
    aircraft counts."""
    names = ("off_max_m",) if mode in DIRECT else ("off_max_m", "worst_m")
    return np.max([flown_values(table, name, mode) for name in names], axis=0)


def away(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of the flights that diverged: stopped, or were further than AWAY off."""
    off = furthest(table, mode)
    return int((off > AWAY).sum()), len(off)


def count_not_away(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of those that did not."""
    diverged, flights = away(table, mode)
    return flights - diverged, flights


def near(table: pd.DataFrame, mode: str) -> tuple[int, int]:
    """Counting of the flights whose estimate and aircraft stay within NEAR."""
    off = furthest(table, mode)
    return int((off < NEAR).sum()), len(off)


def nearly_all(tables: Tables, counting: Counting, modes: Sequence[str]) -> JudgedClaim:
    """With each of the modes it is so in more than NEARLY_ALL of the flights (Wilson), in every
    case (kinds.always); by who predicts."""

    def judge(cases: Tables) -> JudgedClaim:
        flights = [counting(table, mode) for table in cases.values() for mode in modes]
        return kinds.always(
            lambda confidence: [
                vote(*proportion(*cell, confidence)[1:], NEARLY_ALL) for cell in flights
            ]
        )

    return by_prediction(tables, judge)


def by_prediction(tables: Tables, judge: Callable[[Tables], JudgedClaim]) -> JudgedClaim:
    """Judge the IMU-driven and the model-driven flights apart, and combine the verdicts."""
    found = {driven: judge(own) for driven in (IMU, MODEL) if (own := usual(tables, driven))}
    return JudgedClaim(
        over_readings(*(own.verdict for own in found.values())) if found else UNDECIDED,
        ". ".join(f"{driven}-driven: {own.verdict}, {own}" for driven, own in found.items()),
    )


def share_of(table: pd.DataFrame, counting: Counting, mode: str) -> Share:
    """Share of the flights of a mode in which something is so; a seed has one of each."""
    count, flights = counting(table, mode)
    return cluster_share([(1, 1)] * count + [(0, 1)] * (flights - count))


def cause(tables: Tables, modes: Sequence[str]) -> JudgedClaim:
    """Most flights diverge (kinds.mostly_of), in each reading: of `modes`, and of who predicts."""
    found = {
        f"{mode}, {case}": _lost_alike(table)
        if mode == FED_TRUTH
        else kinds.mostly_of(share_of(table, away, mode))
        for case, table in usual(tables).items()
        for mode in modes
        if ("off_max_m", mode) in table.columns
    }
    return JudgedClaim(
        over_readings(*(own.verdict for own in found.values())) if found else UNDECIDED,
        "; ".join(f"{name}: {own.verdict}, {own}" for name, own in found.items()),
    )


def _lost_alike(table: pd.DataFrame) -> JudgedClaim:
    """The flight by true feedback, which is the same for all seeds, diverges."""
    lost, flights = away(table, FED_TRUTH)
    verdict = decide(0 < flights == lost, 0 == lost < flights)
    return JudgedClaim(verdict, f"the one flight {'diverges' if lost else 'does not diverge'}")


def by_case(tables: Tables, counting: Counting, modes: Sequence[str]) -> str:
    """Text: in how many flights it is so, by mode, where there are several, and case."""
    return "; ".join(
        f"{mode}, " * (len(modes) > 1) + f"{case} " + "{} of {}".format(*counting(table, mode))
        for case, table in usual(tables).items()
        for mode in modes
    )


def lost_once(tables: Tables, mode: str) -> str:
    """Text: flights that diverged, of a mode that is the same in all readings."""
    first = list(usual(tables).values())[:1]
    return "".join("{} of {}".format(*away(table, mode)) for table in first)


def lost_by_truth(tables: Tables) -> str:
    """Text: that the flight by true feedback, the same in all readings, diverges or does not."""
    return "".join(f"{_lost_alike(table)}" for table in list(usual(tables).values())[:1])


def ends(tables: Tables, measure: str, modes: Sequence[str]) -> str:
    """Text: the median of a measure, m, by case and mode."""
    return "; ".join(
        f"{mode}, {case} {median_of(flown_values(table, measure, mode))} m"
        for case, table in usual(tables).items()
        for mode in modes
    )


def enough(flights: int) -> str:
    """Text: of how many `flights` Wilson's interval lies above NEARLY_ALL, and where it begins
    with those and with one fewer."""
    begins = [proportion(count, flights).low for count in range(flights + 1)]
    least = int(np.searchsorted(begins, NEARLY_ALL, side="right"))
    return (
        f"of {flights} flights {least} are enough (the interval begins at {begins[least]:.3f}), "
        f"{least - 1} are not "
        f"({begins[least - 1]:.3f})"
    )


def printed_overshoots(tables: Tables) -> JudgedClaim:
    """In every case and mode (kinds.always) the overshoot of velocity Y is inside PRINTED_Y in
    most of the flights (Wilson); by both readings of direct feedback."""

    def judge(direct: str) -> JudgedClaim:
        flights = [
            (values, int(((values > PRINTED_Y[0]) & (values < PRINTED_Y[1])).sum()))
            for table in usual(tables).values()
            for mode in (direct, *FILTERS)
            for values in [flown_values(table, "over_y_pct", mode)]
        ]
        found = kinds.always(
            lambda confidence: [
                vote(*proportion(inside, len(values), confidence)[1:], 0.5)
                for values, inside in flights
            ]
        )
        return JudgedClaim(found.verdict, f"{direct} and filters: {found}")

    return by_direct(judge)


def middles(tables: Tables, measure: str, unit: str, modes: Sequence[str]) -> str:
    """Text: the median of a measure over all flights of the usual cases, by mode."""
    own = usual(tables).values()
    values = {
        mode: np.concatenate([np.empty(0), *(flown_values(table, measure, mode) for table in own)])
        for mode in modes
    }
    return list_medians(values, unit)


def symmetric(tables: Tables) -> JudgedClaim:
    """Fy and the lateral weight are ZERO in every flight, each of which is a cell."""
    larger = {
        mode: np.concatenate(
            [
                np.empty(0),
                *(
                    np.maximum(flown_values(table, "fy_n", mode), flown_values(table, "gy_n", mode))
                    for table in usual(tables).values()
                ),
            ]
        )
        for mode in MODES
    }
    values = np.concatenate(list(larger.values()))
    found = kinds.always(lambda confidence: [1 if value < ZERO else -1 for value in values])
    zero, count = int((values < ZERO).sum()), len(values)
    return JudgedClaim(
        found.verdict,
        f"{zero} of {count} flights; medians of the larger: {list_medians(larger, 'N')}",
    )


def no_larger(tables: Tables, measure: str, other: str, modes: Sequence[str]) -> JudgedClaim:
    """Over the flights of a case `measure` is less than TWICE the measure `other` (geometric mean),
    in every case (kinds.always); by who predicts."""

    def judge(cases: Tables) -> JudgedClaim:
        logs = {
            (mode, case): tuple(
                np.log(np.maximum(flown_values(table, each, mode), MIN_ERROR))
                for each in (measure, other)
            )
            for mode in modes
            for case, table in cases.items()
        }

        def votes(confidence: float) -> list[int]:
            found = [paired_comparison(a, b, confidence) for a, b in logs.values()]
            return [-vote(each.low, each.high, np.log(TWICE)) for each in found]

        means = "; ".join(
            f"{mode}, {case} x{np.exp(paired_comparison(a, b).difference):.3g}"
            for (mode, case), (a, b) in logs.items()
        )
        found = kinds.always(votes)
        return JudgedClaim(found.verdict, f"{found}. {means}")

    return by_prediction(tables, judge)


def one_filter(apart: pd.DataFrame) -> JudgedClaim:
    """Estimate and aircraft of the UKF are within SAME of those of the EKF."""
    ukf, pkf = (apart.loc[apart["mode"] == mode, "apart_m"].to_numpy(float) for mode in (UKF, PKF))
    most, ended = float(np.max(ukf, initial=0.0)), int(np.isinf(pkf).sum())
    text = (
        f"UKF: at most {most if len(ukf) else np.nan:.2g} m in {len(ukf)} flights; PKF: at most "
        f"{pkf[np.isfinite(pkf)].max(initial=0.0):.2g} m"
    )
    text += f", and {ended} flights stopped at another time" * bool(ended)
    return JudgedClaim(decide(0 < len(ukf) and most <= SAME, most > SAME), text)


SHOWN = {
    "horizontal_rmse_m": "position, horizontal",
    "vertical_rmse_m": "vertical",
    "horizontal_end_m": "at the end, horizontal",
    "fx_n": "Fx",
    "over_z_pct": "overshoot of velocity Z",
}
"""Columns of `readings`."""


def readings(tables: Tables) -> pd.DataFrame:
    """DataFrame of text: the ratios of UKF and PKF to EKF and to no filter in each reading, of E0
    and E1 with Q and R from the sensors, with 95 % intervals; an identity is called that."""
    own = {
        case: table
        for case, table in tables.items()
        if case.experiment in (E0, E1) and case.form == SIX and case.tuning == SENSORS
    }
    return pd.DataFrame(
        [
            {
                "reading": reading.name,
                "in a word": reading.word,
                "case": str(case._replace(condition="")),
                "ratio": " / ".join(cells.pair),
                **{
                    title: "identity"
                    if case in cells.same
                    else str(ratio(table, measure, *cells.pair))
                    for measure, title in SHOWN.items()
                },
            }
            for reading in READINGS
            for pair in ((UKF, EKF), (PKF, EKF), (UKF, NO_FILTER), (PKF, NO_FILTER))
            for cells in [cells_of(own, reading, pair)]
            if not reading.instead or cells.pair != pair
            for case, table in (cells.same | cells.free).items()
        ]
    )
