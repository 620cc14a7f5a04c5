"""Lists of what the library has, in the pages. Between the marks

    <!-- begin: output of strapdown COMMAND -->
    <!-- end -->

stands what the command prints; with `table of kinds` or `table of scenarios` in place of it, one of
TABLES. `python docs/_site/doc_lists.py` writes them anew.
"""

import re
import sys
from functools import cache
from pathlib import Path

from doc_pages import ROOT, every
from typer.testing import CliRunner

import strapdown as sd
from strapdown import aiding
from strapdown.cli import app

MARKED = re.compile(
    r"<!-- begin: (output of strapdown .+?|table of kinds|table of scenarios) -->\n.*?<!-- end -->",
    re.DOTALL,
)
COMMAND = "python docs/_site/doc_lists.py"


@cache
def output(command: str) -> str:
    """What a command prints."""
    done = CliRunner().invoke(app.app, command.split()[1:], env={"COLUMNS": "200"})
    if done.exit_code:
        raise RuntimeError(f"{command} ended with {done.exit_code}: {done.output}")
    return "\n".join(line.rstrip() for line in done.output.strip("\n").splitlines())


def kinds() -> str:
    """A table of the kinds of measurement."""
    lines = [
        "| kind | components | file or constraint | can be a state | after |",
        "|---|---|---|---|---|",
    ]
    for name in aiding.names():
        kind = aiding.find(name)
        components = ", ".join(dict.fromkeys(kind.quantities))
        comes = "rows of a file" if kind.recorded else f"constraint {kind.when}".strip()
        own = (f"{kind.shared} {each}".lstrip() for each in kind.states)
        able = ", ".join((*kind.calibration_parameters, *own)) or "–"
        lines.append(f"| `{name}` | {components} | {comes} | {able} | {kind.reference or '–'} |")
    return "\n".join(lines)


def scenarios() -> str:
    """A table of the scenarios."""
    lines = ["| scenario | is | duration, s | IMU |", "|---|---|---|---|"]
    for name in sd.scenarios():
        each = sd.scenario(name)
        lines.append(f"| `{name}` | {each.about} | {each.duration:g} | {each.imu} |")
    return "\n".join(lines)


TABLES = {"table of kinds": kinds, "table of scenarios": scenarios}


def listed(what: str) -> str:
    """The text that stands between marks of this name."""
    if what in TABLES:
        return TABLES[what]()
    return f"```text\n{output(what.removeprefix('output of '))}\n```"


def filled(text: str) -> str:
    """A page with today's lists between its marks."""
    return MARKED.sub(lambda m: f"<!-- begin: {m[1]} -->\n{listed(m[1])}\n<!-- end -->", text)


def marked() -> list[Path]:
    """Pages that hold such lists."""
    pages = [path for path in every() if path.suffix == ".md"]
    return [path for path in pages if MARKED.search(path.read_text(encoding="utf-8"))]


def stale() -> list[str]:
    """A line for each page whose lists are no longer those of the library."""
    return [
        f"{path.relative_to(ROOT)}: its lists are not what the commands print; run `{COMMAND}`"
        for path in marked()
        if filled(text := path.read_text(encoding="utf-8")) != text
    ]


if __name__ == "__main__":
    for path in marked():
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")
    sys.exit()
