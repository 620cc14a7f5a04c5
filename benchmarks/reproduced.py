"""Figures of studies that take hours: not run again, but read from the pages of docs/ that they wrote.

Each note names the page, the commit that last changed the text of the study there, and its command.
"""

import re
import subprocess
from collections.abc import Callable
from typing import NamedTuple

from strapdown_reproductions.common import markdown, write_docs
from strapdown_reproductions.consistency.summary import TARGETS as CONSISTENCY
from strapdown_reproductions.faults.summary import TARGETS as FAULTS
from strapdown_reproductions.geometry.main import TARGETS as GEOMETRY
from strapdown_reproductions.installation.summary import TARGETS as INSTALLATION
from strapdown_reproductions.noise.summary import TARGETS as NOISE
from strapdown_reproductions.verdict_corpus.summary import TARGETS as VERDICTS
from strapdown_reproductions.wrong_setups.summary import TARGETS as SETUPS

ROOT = write_docs.DOCS.parents[2]
FILTER = "closed-loop"
"""Of the studies of every filter, this one has targets."""


class Study(NamedTuple):
    """A study by its name in `strapdown reproduce`, and {figure: function of its text}."""

    name: str
    figures: dict[str, Callable[[str], float]]
    more: bool = False
    """Whether the figures stand in its second page."""
    page: str = ""
    """Of what is no study of `strapdown reproduce`: its page, below docs/reference/evidence."""


def number(cell):
    """Of a cell such as "97.7 %"."""
    return float(cell.split()[0])


def measured(target):
    """A function that finds what the study measured for one of its targets."""

    def found(text):
        cells = {row[0]: row[2] for row in markdown.rows(text)[1:]}
        return number(cells[markdown.cell(target.text)])

    return found


def column(heading, name, text, **wanted):
    """Numbers of a column of the table below a heading, of the rows that have the wanted cells."""
    head, *rows = markdown.rows(markdown.section(text, heading))
    found = [dict(zip(head, row)) for row in rows]
    return [
        number(row[name])
        for row in found
        if all(row[key] in allowed for key, allowed in wanted.items())
    ]


def silent(text):
    """Runs of the closed loop, in batch, live and smoothed, that are silently wrong."""
    own = (FILTER, f"{FILTER} live", f"{FILTER} smoothed")
    heading = "Results of the runs whose fault the data can show"
    return sum(column(heading, "silent", text, runs=own))


def doubted(text):
    """Flights of the closed loop without a fault that are doubted, of 200."""
    counts = [
        sum(column("Flights without a fault", name, text, filter=(FILTER,)))
        for name in ("doubted", "flights")
    ]
    return 200 * counts[0] / counts[1]


def worst_cell(name):
    """A function that finds the least of a column of the cells of the closed loop that are not
    refused."""

    def found(text):
        head, *rows = markdown.rows(markdown.section(text, FILTER))
        place, verdict = head.index(name), head.index("verdict")
        return min(number(row[place]) for row in rows if row[verdict] != "refused")

    return found


def refused(text):
    """Refused cells of the closed loop."""
    return sum(column("Cells of each filter", "refused", text, filter=(FILTER,)))


PUBLISHED = ("two-stage-ekf", "xkf-two-stage", "nlo")
"""Filters whose gains are published and whose covariance is that of the errors they leave."""


def behind_ekf(text):
    """Cells in which the ekf is right, less those of the worst of PUBLISHED."""
    right = {}
    for name in (*PUBLISHED, "ekf"):
        cells = [
            column("Cells of each filter", kind, text, filter=(name,))
            for kind in ("consistent", "by chance")
        ]
        right[name] = sum(map(sum, cells))
    return right["ekf"] - min(right[name] for name in PUBLISHED)


def of_group(name):
    """A function that finds the time of a filter on the group over that of the closed loop."""

    def found(text):
        heading = "Kalman filters whose error is on a group"
        (time,) = column(heading, "time", text, filter=(f"[`{name}`](filters/{name}.md)",))
        return time

    return found


RANKING = "of python benchmarks/ranking.py"
EVIDENCE = ROOT / "docs" / "reference" / "evidence"


def ranked(name):
    """A function that finds of how many cells strapdown is first or level with the first, %."""

    def found(text):
        head, row, *_ = markdown.rows(text)
        first, of, all_cells = row[head.index(name)].split()
        return 100 * int(first) / int(all_cells)

    return found


def farthest_from_nine(text):
    """How far the mean of the last column is from 9 in the worst row, %."""
    return max(abs(number(row[-1]) / 9 - 1) * 100 for row in markdown.rows(text)[1:])


LIVE = "../../how-to/live.md"


def after_words(words):
    """A function that finds the number after these words."""
    return lambda text: number(text.partition(f"{words} ")[2])


def before_words(words):
    """A function that finds the number before these words."""
    return lambda text: number(text.partition(f" {words}")[0].split()[-1])


def over_no_restart(text):
    """Mean of the table's NEES after a restart over that without it."""
    rows = [row[1:] for row in markdown.rows(text)[1:]]
    restarted, alike, _ = (
        [number(cell) for row in rows[way::3] for cell in row[1:]] for way in range(3)
    )
    return sum(restarted) / sum(alike)


STUDIES = (
    Study(
        "wrong-setups",
        {
            "wrong set-ups, found": measured(SETUPS["found"]),
            "wrong set-ups, named": measured(SETUPS["named"]),
            "right set-ups, doubted": measured(SETUPS["alarms"]),
            "verdict, time over filter": measured(SETUPS["cost"]),
            "diagnose, filter runs": measured(SETUPS["runs"]),
        },
    ),
    Study(
        "faults",
        {
            "faults, silently wrong": silent,
            "faults, jumps of 50 m refused": measured(FAULTS["50 m"]),
            "faults, jumps of 20 m refused": measured(FAULTS["20 m"]),
            "faults, jumps of 10 m refused": measured(FAULTS["10 m"]),
            "faults, lasting jump of 5 m said": measured(FAULTS["lasting"]),
            "faults, right flights doubted": doubted,
        },
    ),
    Study(
        "consistency",
        {
            "consistency, epochs in the band": worst_cell("inside, %"),
            "consistency, survival": worst_cell("survived, %"),
            "consistency, cells refused": refused,
            "consistency, cells of all filters that miss": measured(CONSISTENCY["missed"]),
            "consistency, of them not by chance": measured(CONSISTENCY["wrong"]),
            "consistency, published gains behind ekf": behind_ekf,
        },
        more=True,
    ),
    Study(
        "installation",
        {
            "drive0708 from wrong set-ups, clock": measured(INSTALLATION["drive clock"]),
            "drive0708 from wrong set-ups, arm": measured(INSTALLATION["drive lever-arm"]),
            "drive0708 from wrong set-ups, mounting": measured(INSTALLATION["drive mounting"]),
            "drive0708 calibrated, alone": measured(INSTALLATION["drive alone"]),
            "drive0708 calibrated, constrained": measured(INSTALLATION["drive constrained"]),
            "installation, NEES from a known start": measured(INSTALLATION["nees, known start"]),
            "installation, NEES from own alignment": measured(INSTALLATION["nees, own alignment"]),
            "installation, found though not shown": measured(INSTALLATION["unseen"]),
            "odometer scale after five minutes": measured(INSTALLATION["scale"]),
            "thor75 roll, installation found": measured(INSTALLATION["thor75 roll"]),
            "thor75 D, installation found": measured(INSTALLATION["thor75 position D"]),
            "drive0708 alone, installation found": measured(INSTALLATION["drive0708 alone"]),
        },
    ),
    Study(
        "noise",
        {
            "correlated errors as states, lowest": measured(NOISE["correlated low, states"]),
            "correlated errors as states, highest": measured(NOISE["correlated high, states"]),
            "correlated errors tuned, lowest": measured(NOISE["correlated low, tuned"]),
            "correlated errors tuned, highest": measured(NOISE["correlated high, tuned"]),
            "white errors tuned": measured(NOISE["white, tuned"]),
            "noise stated wrongly, tuned": measured(NOISE["misstated rms"]),
            "noise stated wrongly, NIS lowest": measured(NOISE["misstated NIS low"]),
            "noise stated wrongly, NIS highest": measured(NOISE["misstated NIS high"]),
            "robust, a tenth of the fixes wrong": measured(NOISE["robust outliers"]),
            "robust, clean fixes": measured(NOISE["robust clean"]),
            "adaptive, clean fixes": measured(NOISE["adaptive clean"]),
            "hidden fixes within 1 std, tuned": measured(NOISE["coverage 1"]),
            "hidden fixes within 3 std, tuned": measured(NOISE["coverage 3"]),
        },
    ),
    Study(
        "verdicts",
        {
            "verdict corpus, results": measured(VERDICTS["results"]),
            "verdict, trusted and wrong": measured(VERDICTS["wrong"]),
            "verdict, right set-ups doubted": measured(VERDICTS["right"]),
            "verdict, right results doubted": measured(VERDICTS["harmless"]),
            "verdict, true cause first": measured(VERDICTS["named"]),
            "verdict, wrong results doubted": measured(VERDICTS["found"]),
            "verdict, beyond protection levels": measured(VERDICTS["misleading"]),
            "verdict, spoilt by advice": measured(VERDICTS["advice"]),
            "verdict, time over filter beyond 5 minutes": measured(VERDICTS["cost"]),
        },
    ),
    Study(
        f"filters {RANKING}",
        {f"ranking, {name}": ranked(name) for name in ("error", "honesty", "time")},
        page="ranking.md",
    ),
    Study(f"stress {RANKING}", {"GTSAM's stress test": farthest_from_nine}, page="ranking.md"),
    Study(
        "geometry",
        {
            "iekf, starts far off": measured(GEOMETRY["home"]),
            "iekf, ANEES beside the closed loop": measured(GEOMETRY["flights"]),
            "iekf, cells that refuse the closed loop": measured(GEOMETRY["refused"]),
            "iekf, all cells": measured(GEOMETRY["cells"]),
        },
    ),
    Study(
        "filters of python docs/_site/filter_pages.py",
        {"iekf, time": of_group("iekf")},
        page="../filters.md",
    ),
    Study(
        "day of python benchmarks/live_day.py",
        {
            "live, memory of a day": after_words("Memory grew by"),
            "live, lines of a day lost uncounted": before_words("were lost uncounted"),
        },
        page=LIVE,
    ),
    Study(
        "restart of python benchmarks/live_restart.py",
        {"live, NEES after a restart": over_no_restart},
        page=LIVE,
    ),
    Study(
        "vehicle-kit",
        {
            "drive0708, vehicle kit with clock and arm as states": lambda text: number(
                next(
                    row[3]
                    for row in markdown.rows(text)
                    if row[:2] == ["evidence", "kit, clock and lever arm as states too"]
                )
            )
        },
    ),
)


def place(study):
    """(page, mark above the text) of a study."""
    if study.page:
        return (EVIDENCE / study.page).resolve(), f"<!-- begin: {study.name} -->"
    file, page = (write_docs.MORE if study.more else write_docs.PAGES)[study.name]
    return (write_docs.DOCS / page).resolve(), markdown.begin(file, study.name)


def last_change(page, mark):
    """The commit, shortened, that was the last to change a line below the mark; "no known commit"
    without git."""
    lines = page.read_text(encoding="utf-8").splitlines()
    first = lines.index(mark) + 2
    last = next(i for i in range(first, len(lines)) if lines[i].startswith("<!-- end"))
    command = ["git", "blame", "--line-porcelain", f"-L{first},{last}", "--", page]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    times = re.findall(r"^(\w{40}) (?:.*\n)*?committer-time (\d+)$", done.stdout, re.MULTILINE)
    return max(times, key=lambda found: int(found[1]))[0][:8] if times else "no known commit"


def read(study):
    """[(value, note)] for the figures of a study. Raises ValueError that names a figure whose page
    does not hold it."""
    page, mark = place(study)
    text = markdown.read_marked(page, mark)
    where = page.relative_to(ROOT)
    command = study.name.partition(" of ")[2] or f"strapdown reproduce {study.name}"
    note = f"{where} as of {last_change(page, mark)}, {command}"
    found = []
    for figure, value in study.figures.items():
        try:
            found.append((value(text), note))
        except (KeyError, IndexError, StopIteration, ValueError) as error:
            raise ValueError(f"{where}: holds no {figure!r} ({error}); run `{command}`") from None
    return found
