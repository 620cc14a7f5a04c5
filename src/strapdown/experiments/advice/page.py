"""The output of `strapdown advise`: the sentences, the table of evidence, and the page with its
figures."""

from __future__ import annotations

import re
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ...data.solution import Correlated
from ...evaluation.consistency import Interval
from ...pages.parts import caption, numbered_list, paragraphs, table
from ...pages.shell import Document, Page
from ...typing import ArrayLike
from ...units.wording import duration_text, join_words, number
from .verdicts import (
    CLOSED,
    MAX_RUNS,
    NO,
    STRETCHES,
    UNDECIDED,
    YES,
    Decision,
    FilterEvidence,
    FilterVerdict,
    display_name,
)

if TYPE_CHECKING:
    from .advise import Advice

FOOTER = "Simulated runs with the IMU's error model as it is described; a real IMU, vibration and faulty fixes are no part of them."
ANSWERS = {
    "open": "open loop",
    "reset": "reset",
    "closed": "closed loop",
    "none": "none",
    "undecided": "not decided",
}
ERRORS_CAPTION = (
    "Root mean square over the runs that are still alive (solid), what the filter states (dashed), "
    "and the Cramer-Rao bound, which no "
    "filter can undercut on average."
)
NEES = (
    "Mean over the runs that are still alive. A filter that is as good as it says is around 1: in "
    "the grey band at 95 % of the times. "
    "Red: where the rule ends belief."
)
SURVIVAL = "Share of runs that are neither lost nor inconsistent yet. Red: what the rule asks for."
EVIDENCE = (
    "In brackets 95 % intervals. ✗: the criterion is broken; ?: its interval holds the threshold. "
    "Lost / incons.: runs lost, "
    "inconsistent. Worst NEES: per state, in the tenth of the mission where it is farthest from 1. "
    "RMSE: of the position, every error counted "
    "with at most 500 m, and an aborted run with 500 m from there on; RMSE ratio: by the closed "
    "loop's on the same runs; ahead: runs in which it is smaller. "
    "summary.csv has more columns."
)
LEGEND = (
    "The crossover map: which architecture is admissible for a mission that long, by the estimates "
    "of its runs; a number is the longest "
    "admissible time between resets of those compared (60 s stands for all), a question mark says "
    "that an interval allows another answer."
)


NO_MAP = "Not made; leave out --quick and --no-map for it."
UNESTIMATED = (
    "scale_factor",
    "misalignment",
    "g_sensitivity",
    "quantisation",
    "saturation",
    "temperature",
)
"""Error terms of an IMU that the filters' models of noise and bias do not include, or, as the
temperature, include only roughly."""


def sentences(advice: Advice) -> list[str]:
    """The condition, the answer, what it is about, the reasons, and how sure it is: a list of
    lines."""
    head = [_condition(advice), _headline(advice), _about(advice), *notes(advice)]
    lines = [f"  {display_name(e.filter):<20} {_verdict(advice, e)}" for e in advice.found.values()]
    return [*head, *lines, *_not_estimated(advice), _sure(advice), *_shorter(advice)]


def flight(advice: Advice) -> str:
    """Name of the mission's flight, without its duration."""
    return advice.scenario.name.rpartition("-")[0]


def imu_name(advice: Advice) -> str:
    """The IMU for people: "tactical IMU"; a name that says it is one stays as it is."""
    name = advice.imu.name
    return name if re.search(r"(^|[\s_-])imu$", name.lower()) else f"{name} IMU"


def _condition(advice: Advice) -> str:
    """Return the condition of the answer: how well the attitude is known at the start."""
    north, east, down = np.degrees(np.array(advice.scenario.start_std[6:9], float))
    known = f"roll and pitch are known to {max(north, east):.2g} deg and heading to {down:.2g} deg"
    how = "after an alignment in motion" if advice.alignment == "moving" else "at the start"
    return f"If {how} {known}:"


def _headline(advice: Advice) -> str:
    decision, length = advice.decision, duration_text(advice.scenario.duration)
    closed, name = advice.found[CLOSED], display_name(decision.filter)
    decided = {
        "open": f"Open loop: for this mission of {length} it serves as well as the closed loop, "
        f"and the INS stays isolated from the fixes.",
        "reset": f"{name.capitalize()}: the open loop cannot be left alone for {length}, but "
        f"between resets the INS may stay isolated.",
        "closed": f"Closed loop: neither the open loop nor resets that were tried are admissible "
        f"for {length}.",
        "none": f"None is trustworthy here, not even the closed loop: "
        f"{'; '.join(_failed_criteria(closed, decision.verdicts[CLOSED], NO))}.",
    }
    if decision.answer in decided:
        return decided[decision.answer]
    which = "closed loop, if any; to tell whether even that can be trusted takes"
    until = ""
    if decision.doubtful != CLOSED:
        which = f"to tell whether the answer is {display_name(decision.doubtful)} takes"
        until = f" Until then{f': {name}' if decision.filter else ' none can be recommended'}."
    return f"Not decided by {closed.count} runs: {which} {_runs(decision.runs)}.{until}"


def _runs(needed: int) -> str:
    """The number of runs that would decide, in words; two digits, for it is a guess."""
    if needed >= MAX_RUNS:
        return f"more than {MAX_RUNS} runs: it is on the boundary"
    step = 10 ** max(len(str(needed)) - 2, 0)
    return f"about {-(-needed // step) * step} runs in all"


def _about(advice: Advice) -> str:
    scenario, gnss = advice.scenario, advice.scenario.gnss

    def axes(std: ArrayLike) -> str:
        return " ".join(f"{value:g}" for value in np.atleast_1d(np.asarray(std, float)))

    def correlation_text(correlated: Correlated | None, unit: str) -> str:
        if correlated is None:
            return ""
        return f", and {axes(correlated.std)} {unit} correlated over {correlated.time:g} s"

    receiver = (
        ("position", gnss.position_std, gnss.position_correlated, "m"),
        ("velocity", gnss.velocity_std, gnss.velocity_correlated, "m/s"),
    )
    measured = [
        f"{what} (std {axes(std)} {unit} NED{correlation_text(correlated, unit)})"
        for what, std, correlated, unit in receiver
        if std is not None
    ]
    return (
        f"{imu_name(advice)}, {flight(advice)}, {duration_text(scenario.duration)}, simulated at "
        f"{scenario.rate:g} Hz; "
        f"GNSS {' and '.join(measured) or 'nothing'} every {gnss.interval:g} s; "
        f"{advice.found[CLOSED].count} runs, seed {advice.seed}"
    )


def notes(advice: Advice) -> list[str]:
    """Return caveats on this mission: sentences, often none."""
    truth, found = advice.scenario.glance(200), []
    low, high = truth.lla[:, 2].min(), truth.lla[:, 2].max()
    if high - low > 3000:
        found.append(
            f"note: flown again and again the motion goes from {low:.0f} to {high:.0f} m of height; "
            f"is that the mission you mean?"
        )
    if flight(advice) == "demo" and advice.scenario.duration > 600:
        found.append(
            "note: the demo flight goes straight on after 600 s; the flight `dynamic` keeps turning"
        )
    return found


def _failed_criteria(e: FilterEvidence, verdict: FilterVerdict, state: str) -> list[str]:
    """Return the evidence against a filter: the criteria that are in `state`, in words."""
    factor = np.sqrt(max(e.nees.value, 1 / e.nees.value)) if e.nees.value > 0 else np.nan
    small = "small" if e.nees.value > 1 else "large"
    said = {
        "survival": f"lost or inconsistent in {e.count - e.lived} of {e.count} runs",
        "belief": f"NEES per state of {_interval(e.nees)} at worst, so its stated uncertainty is "
        f"too {small} by a factor of {number(factor)}",
        "worse": f"position RMSE {_interval(e.ratio)} times the closed loop's",
    }
    return [text for name, text in said.items() if getattr(verdict, name) == state]


def _interval(interval: Interval) -> str:
    return f"{number(interval.value)} ({number(interval.low)} to {number(interval.high)})"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _verdict(advice: Advice, e: FilterEvidence) -> str:
    verdict = advice.decision.verdicts[e.filter]
    if verdict.admissible == YES:
        ratio = f", position RMSE {_interval(e.ratio)} times the closed loop's"
        other = "" if e.filter == CLOSED else ratio
        return f"admissible: survived in {e.lived} of {e.count} runs, NEES per state {_interval(e.nees)} at worst{other}"
    if verdict.admissible == NO:
        return f"not admissible: {'; '.join(_failed_criteria(e, verdict, NO))}"
    return f"not decided: {'; '.join(_failed_criteria(e, verdict, UNDECIDED))}; {_runs(verdict.runs)} would tell"


def _not_estimated(advice: Advice) -> list[str]:
    """Return a likely cause and the remedy where not even the closed loop is admissible: errors of
    the IMU that no filter here estimates."""
    if advice.decision.verdicts[CLOSED].admissible != NO:
        return []
    triads = {"gyro": advice.imu.gyro, "accelerometer": advice.imu.accel}
    terms = {
        sensor: [
            name.replace("_", " ").replace("g s", "g-s")
            for name in UNESTIMATED
            if getattr(triad, name)
        ]
        for sensor, triad in triads.items()
    }
    found = [f"{join_words(own)} of the {sensor}" for sensor, own in terms.items() if own]
    if not found:
        return []
    return [
        f"Likely cause: the IMU has errors that the filters do not estimate ({'; '.join(found)}), "
        f"and that their noise does not cover. State more "
        "noise in the IMU's file, or leave these terms out to judge the architecture alone."
    ]


def _sure(advice: Advice) -> str:
    """The influence of the thresholds and on the number of runs."""
    own = (advice.decision.answer, advice.decision.filter)

    def text(d: Decision) -> str:
        return display_name(d.filter) if d.answer != "undecided" else "not decided"

    changed = [
        f"{text(d)} with {name}"
        for name, d in advice.others.items()
        if (d.answer, d.filter) != own and d.answer != "undecided"
    ]
    untold = [name for name, d in advice.others.items() if d.answer == "undecided"]
    counts = few = ""
    if best := advice.found.get(advice.decision.filter or ""):
        within = f"{_percent(best.survived.low)} to {_percent(best.survived.high)}"
        counts = f"survival in {best.lived} of {best.count} runs (95 % interval: {within}); "
    if untold and advice.answer != "undecided":
        few = f"; too few runs to tell for {', '.join(untold)}"
    same = "decides it either" if advice.answer == "undecided" else "gives another answer"
    said = (
        f"the answer would be {', '.join(changed)}"
        if changed
        else f"no other threshold that was tried {same}"
    )
    start = (
        " The start decides too: an alignment in motion knows less, see --alignment moving."
        if advice.alignment != "moving"
        else ""
    )
    return f"How sure: {counts}{said}{few}.{start}"


def _shorter(advice: Advice) -> list[str]:
    """The time for which the open loop would do on this mission, by the estimates."""
    if advice.answer in ("open", "undecided"):
        return []
    served = [t for t, d in takewhile(lambda each: each[1].answer == "open", advice.through)]
    if not served:
        first = duration_text(advice.through[0][0])
        return [f"The open loop is not admissible even for the first {first}."]
    long = duration_text(served[-1])
    return [f"By the estimates the open loop would do for the first {long} of this mission."]


def summary_table(advice: Advice) -> pd.DataFrame:
    """pandas DataFrame with a row per filter: the evidence and the verdicts."""

    def ends(name: str, i: Interval) -> dict[str, float]:
        return {name: i.value, f"{name}_low": i.low, f"{name}_high": i.high}

    own, verdicts = advice.campaign.summary.set_index("filter"), advice.decision.verdicts
    return pd.DataFrame(
        {
            "filter": e.filter,
            "admissible": verdicts[e.filter].admissible,
            "runs": e.count,
            "survived_runs": e.lived,
            "lost": own.lost[e.filter],
            "inconsistent": own.inconsistent[e.filter],
            **ends("survived", e.survived),
            **ends("worst_nees_per_state", e.nees),
            **ends("rmse_ratio", e.ratio),
            "ahead_of_closed_loop_runs": e.ahead,
            "censored_rmse_m": e.rmse,
            "heading_rmse_deg": e.heading,
            "bound_ratio": own.bound_ratio[e.filter],
            "runs_needed": verdicts[e.filter].runs,
        }
        for e in advice.found.values()
    )


def page(advice: Advice) -> Page:
    """The Page of an Advice."""
    from ..monte_carlo import figures as study_figures
    from . import figures

    document = Document(
        f"Open loop, resets or closed loop: {imu_name(advice)}, {flight(advice)}, "
        f"{duration_text(advice.scenario.duration)}",
        _facts(advice),
        FOOTER,
        f"{_condition(advice)} {_headline(advice)}",
    )
    place, drawn = document.place, figures.curves_of(advice)
    document.add("Why", _why(advice))
    document.add(
        "Error and stated uncertainty",
        place(study_figures.position(drawn), "Position error over time", ERRORS_CAPTION),
        place(study_figures.heading(drawn), "Heading error over time", "The same for the heading."),
    )
    document.add(
        "Can it be believed",
        place(study_figures.nees(drawn, advice.rules.belief), "NEES per state over time", NEES),
        place(study_figures.survival(drawn, advice.rules.survival), "Survival", SURVIVAL),
    )
    document.add("Shorter missions", _through(advice))
    loops = "Which loop, for which IMU, duration and dynamics"
    crossover = figures.crossover(advice) if advice.map else None
    document.add("Crossover map", place(crossover, loops, LEGEND) or caption(NO_MAP))
    document.add("The rule", _rule(advice))
    return document.page()


def _facts(advice: Advice) -> dict[str, object]:
    return {
        "IMU": advice.imu.name,
        "mission": flight(advice),
        "duration": duration_text(advice.scenario.duration),
        "condition": _condition(advice).removesuffix(":"),
        "answer": display_name(advice.decision.filter)
        if advice.answer != "undecided"
        else "not decided",
        "runs": advice.found[CLOSED].count,
        "seed": str(advice.seed),
    }


def _why(advice: Advice) -> str:
    _, _, about, *rest = [line.strip() for line in sentences(advice)]
    said = [
        line
        for line in rest
        if not line.startswith(tuple(display_name(label) for label in advice.found))
    ]
    return caption(about) + paragraphs(said) + _evidence(advice)


def _evidence(advice: Advice) -> str:
    def mark(text: str, state: str) -> str:
        return f"{text}{'' if state == YES else ' ✗' if state == NO else ' ?'}"

    def within(i: Interval) -> str:
        return f"{number(i.value)} ({number(i.low)}–{number(i.high)})"

    rows, own = [], advice.campaign.summary.set_index("filter")
    for e in advice.found.values():
        v, closed = advice.decision.verdicts[e.filter], e.filter == CLOSED
        share = f"{100 * e.survived.low:.0f}–{100 * e.survived.high:.0f} %"
        rows.append(
            [
                display_name(e.filter),
                {YES: "yes", NO: "no", UNDECIDED: "open"}[v.admissible],
                mark(f"{e.lived} of {e.count} ({share})", v.survival),
                f"{own.lost[e.filter]} / {own.inconsistent[e.filter]}",
                mark(within(e.nees), v.belief),
                "1" if closed else mark(within(e.ratio), v.worse),
                "–" if closed else f"{e.ahead} of {e.count}",
                number(e.rmse),
                number(e.heading),
            ]
        )
    head = [
        "filter",
        "admissible",
        "survived",
        "lost / incons.",
        "worst NEES",
        "RMSE ratio",
        "ahead in",
        "RMSE [m]",
        "heading [deg]",
    ]
    return table(head, rows) + caption(EVIDENCE)


def _through(advice: Advice) -> str:
    rows = [
        [duration_text(t), ANSWERS[d.answer], display_name(d.filter)] for t, d in advice.through
    ]
    cut = "From the same runs cut short, by the estimates alone, without intervals."
    return table(["first ... of the mission", "answer", "filter"], rows) + caption(cut)


def _rule(advice: Advice) -> str:
    r = advice.rules
    criteria = [
        f"It survives: at least {_percent(r.survival)} of the runs are neither lost (500 m) nor "
        f"inconsistent "
        "(NEES beyond its 1 − 1e-6 bound for more than 10 s).",
        f"It can be believed: NEES per state, mean over the runs alive, is between {1 / r.belief:g} "
        f"and {r.belief:g} in each "
        f"of {STRETCHES} equal stretches; its stated standard deviations are then right within a "
        f"factor of {np.sqrt(r.belief):.3g}.",
        f"It is not worse: its censored position RMSE is at most {_percent(r.worse)} above the "
        f"closed loop's on the same runs.",
    ]
    others = [
        [name, ANSWERS[d.answer], display_name(d.filter)] for name, d in advice.others.items()
    ]
    asked = "An architecture is admissible if the 95 % interval of each of these says so:"
    chosen = (
        "The answer is the open loop where it is admissible, for it keeps the INS isolated; else the "
        "longest admissible time between resets; else the closed loop. Where an interval leaves open "
        "which of these it is, the answer is “not decided”."
    )
    return (
        f"{paragraphs([asked])}{numbered_list(criteria)}{paragraphs([chosen])}"
        f"<h3>With one threshold changed</h3>{table(['threshold', 'answer', 'filter'], others)}"
    )
