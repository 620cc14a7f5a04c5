"""The tables and pictures of docs/reference/evidence/ranking.md, from the results of ranking.py."""

from pathlib import Path

import gtsam_stress
import numpy as np
import px4_replays
import ranking_figures
import ranking_scores as scores
from ranking import LOST, SYSTEMS
from ranking_cases import FOLLOWED

from strapdown_reproductions.common import markdown

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/reference/evidence/ranking.md"
COMMAND = "python benchmarks/ranking.py"
OWN = "strapdown"
ERROR, HONESTY, TIME = "error", "honesty", "time"


PACKAGES = {system.name: system.package for system in SYSTEMS}
SCORED_BY_FIXES = scores.QUESTIONS[0], "position"


def cells(found, systems):
    """Cells of the ranking among some systems: {(case, question, error, kind): {system: blocks}}, kind
    ERROR with mean squares or HONESTY with those over the claimed variance, of all that ran."""
    made = {}
    for case, runs in found.items():
        for question in scores.QUESTIONS:
            for error in scores.ERRORS:
                if (question, error) == SCORED_BY_FIXES and case in FOLLOWED:
                    continue
                for kind, key in ((ERROR, "square"), (HONESTY, "scaled")):
                    row = {
                        name: runs[name]["scores"][question][error][key]
                        for name in systems
                        if name in runs and error in _scores(runs[name], question)
                    }
                    row = {name: part for name, part in row.items() if part}
                    if len(row) > 1:
                        made[case, question, error, kind] = row
    return made


def _scores(run, question):
    return {} if "stopped" in run else run["scores"][question]


def statistic(kind):
    """What a cell is ranked by, small being good."""
    return scores.size if kind == ERROR else scores.dishonesty


def judged(cell, kind):
    """(the first system, {system: value}, {system: first or level with the first}) of a cell."""
    measure = statistic(kind)
    values = {name: _value(measure, part) for name, part in cell.items()}
    best = min(values, key=values.get)
    same = {name: name == best or _level(cell, name, best, measure) for name in cell}
    return best, values, same


def _value(measure, part):
    value = measure(part)
    return value if np.isfinite(value) else np.inf


def _level(cell, name, best, measure):
    return bool(np.isfinite(cell[name]).all()) and scores.level(cell[name], cell[best], measure)


def summary(found, smoothers):
    """Table of one class of systems: of how many cells each is first or level with the first."""
    systems = [system.name for system in SYSTEMS if system.smoother == smoothers]
    kinds = (ERROR, HONESTY, TIME, "ratio", "us")
    counts = {name: {kind: [] for kind in kinds} for name in systems}
    for (_, _, _, kind), cell in cells(found, systems).items():
        best, values, same = judged(cell, kind)
        for name in cell:
            counts[name][kind].append(same[name])
            if kind == ERROR:
                counts[name]["ratio"].append(values[name] / values[best])
    for runs in found.values():
        times = {name: runs[name]["us"] for name in systems if "us" in runs.get(name, {})}
        for name, us in times.items():
            counts[name]["us"].append(us)
            others = [times[other] for other in times if PACKAGES[other] != PACKAGES[name]]
            counts[name][TIME].append(all(us < other for other in others))
    head = ("system", ERROR, "median ratio to the first", HONESTY, TIME, "µs per sample")
    return _table(head, [_summed(name, counts[name]) for name in systems if counts[name]["us"]])


def _summed(name, count):
    share = lambda kind: f"{sum(count[kind])} of {len(count[kind])}"
    ratio, us = np.median(count["ratio"]), np.median(count["us"])
    return name, share(ERROR), f"{ratio:.2f}", share(HONESTY), share(TIME), _short(us)


def behind(found, smoothers):
    """Of how many cells strapdown's systems are neither first nor level, and the table of those in which
    one is not: who is first, and by how much."""
    systems = [system.name for system in SYSTEMS if system.smoother == smoothers]
    own = [system.name for system in SYSTEMS if system.name in systems and system.package == OWN]
    lines, lost = [], []
    for title, cell in cells(found, systems).items():
        _, values, same = judged(cell, title[-1])
        lost.append([name in same and not same[name] for name in own])
        if any(lost[-1]):
            first = min((name for name in cell if name not in own), key=values.get)
            lines.append(_cell_behind(title, cell, values, first, same, own))
    each = ", ".join(f"{name} in {n}" for name, n in zip(own, np.sum(lost, axis=0)))
    told = f"Of {len(lost)} cells neither first nor level: {each}, all of them in {np.all(lost, axis=1).sum()}."
    return f"{told}\n\n" + _table(("case", "when", "cell", "first", "its figure", *own), lines)


def _cell_behind(title, cell, values, first, same, own):
    """Row of the table of `behind`: an asterisk where one of our own is first or level."""
    case, question, error, kind = title
    unit = {"position": " m", "velocity": " m/s", "attitude": " deg"}[error]
    show = lambda name: (
        f"{values[name]:.3g}{unit}" if kind == ERROR else f"{np.mean(cell[name]):.2f}"
    )
    ours = ((show(name) + "\\*" * same[name] if name in cell else "–") for name in own)
    return case, question, f"{kind} of {error}", first, show(first), *ours


def recorded(found):
    """Table of the recordings: errors and honesty of every system."""
    head = (
        "recording",
        "system",
        "position, m",
        "attitude, deg",
        "in outages: position, m",
        "velocity, m/s",
        "inside 1 std, %",
        "inside 3 std, %",
        "square over variance",
    )
    lines = [
        (case, name, *_recorded(run))
        for case, runs in found.items()
        if "," not in case
        for name, run in runs.items()
    ]
    return _table(head, lines)


def _recorded(run):
    if "stopped" in run:
        return f"stopped: {run['stopped']}", *[""] * 6
    clear, outage = (run["scores"][question] for question in scores.QUESTIONS)
    position = outage["position"]
    if not scores.size(position["square"]) < LOST:
        return "lost", *[""] * 6
    show = lambda part, error: (
        f"{scores.size(part[error]['square']):.3g}" if part.get(error, {}).get("square") else "–"
    )
    percent = lambda key: f"{100 * np.mean(position[key]):.0f}"
    return (
        show(clear, "position"),
        show(clear, "attitude"),
        show(outage, "position"),
        show(outage, "velocity"),
        percent("inside 1"),
        percent("inside 3"),
        f"{np.mean(position['scaled']):.2f}",
    )


def flown(found):
    """Table of the simulated flights: position in outages, m, of every filter."""
    systems = [system.name for system in SYSTEMS if not system.smoother]
    lines = [
        (case, *(_outage(runs.get(name)) for name in systems))
        for case, runs in found.items()
        if "," in case
    ]
    return _table(("flight", *systems), lines)


def _outage(run):
    if run is None:
        return "–"
    if "stopped" in run:
        return "stopped"
    size = scores.size(run["scores"]["in outages"]["position"]["square"])
    return f"{size:.3g}" if size < LOST else "lost"


def stress():
    """Table of GTSAM's stress test."""
    head = (
        "experiment",
        "published",
        "GTSAM again",
        "GTSAM, even noise",
        "strapdown",
        "strapdown in Logmap",
    )
    lines = []
    for experiment, again, same, own in gtsam_stress.rows():
        pair = lambda values: " / ".join(f"{value:.3f}" for value in values)
        lines.append(
            (
                experiment.name,
                pair((experiment.published, experiment.others)),
                pair(again),
                pair(same),
                *(f"{value:.3f}" for value in own),
            )
        )
    return _table(head, lines)


def replays():
    """Table of PX4's replays; without a clone of PX4-ECL it says so."""
    if px4_replays.folder() is None:
        return "Not measured: STRAPDOWN_PEERS names no folder with a clone of PX4-ECL.\n"
    lines = [
        (
            name,
            f"{quantity}, {unit}",
            *("–" if value is None else f"{value:.3g}" for value in figures),
        )
        for name in px4_replays.REPLAYS
        for quantity, (unit, *figures) in px4_replays.compared(name).items()
    ]
    return _table(
        ("replay", "quantity", "difference, rms", "claimed by strapdown", "claimed by EKF2"), lines
    )


def _short(value):
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _table(head, lines):
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows) + "\n"


def mark(name):
    """The line of the page before a table."""
    return f"<!-- begin: {name} of {COMMAND} -->"


def write(found):
    """Put every table into the page, and the pictures beside it."""
    tables = {
        "filters": lambda: summary(found, False),
        "filters behind": lambda: behind(found, False),
        "smoothers": lambda: summary(found, True),
        "smoothers behind": lambda: behind(found, True),
        "recordings": lambda: recorded(found),
        "flights": lambda: flown(found),
        "stress": stress,
        "replays": replays,
    }
    for name, table in tables.items():
        markdown.insert(PAGE, table(), mark(name))
    ranking_figures.draw(found, PAGE.parent)
