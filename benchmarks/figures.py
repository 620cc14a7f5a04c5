"""One figure is one line: name, value, unit, target, holds or not. The figures of a whole run stand in
result.json beside this file, which is committed: docs/reference/figures.md is made from it, and
`commit` tells how old it is."""

import json
import math
import os
import platform
import re
import subprocess
import tomllib
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

TARGETS = Path(__file__).with_name("targets.toml")
RESULT = Path(__file__).with_name("result.json")
MEASURED = ("src", "reproductions", "benchmarks", "examples", "setup.py", "pyproject.toml")
"""What of the checkout decides the figures."""
FIELDS = {"target", "comparison", "unit", "text"}


class Figure(NamedTuple):
    """A measured figure; `holds` is None where there is no target, and False where a figure with
    a target could not be measured."""

    name: str
    value: float | None
    unit: str
    target: float | None = None
    comparison: str = ""
    tolerance: float | None = None
    holds: bool | None = None
    note: str = ""
    part: str = ""

    def __str__(self):
        return f"{self.name:<36} {self.measured():>26}   {self.wanted() or 'no target':<22} {self.verdict():<7}{' ' + self.note if self.note else ''}".rstrip()

    def measured(self):
        """Its value with the unit, as text."""
        if self.value is None:
            return "not measured"
        value = f"{self.value:.0f}" if abs(self.value) >= 1e4 else f"{self.value:.4g}"
        return f"{value} {self.unit}".rstrip()

    def wanted(self):
        """Its target as text; "" where it has none."""
        how = {
            "<=": "at most",
            ">=": "at least",
            "within": f"within {100 * (self.tolerance or 0):g} % of",
        }
        return "" if self.target is None else f"{how[self.comparison]} {self.target:g}"

    def verdict(self):
        """`holds` as a word."""
        return {True: "holds", False: "MISSED", None: "-"}[self.holds]


def targets(path=TARGETS):
    """{name: table} of the file, checked. Raises ValueError that names the figure."""
    tables = tomllib.loads(Path(path).read_text())
    for name, table in tables.items():
        within = table.get("comparison") == "within"
        if set(table) != FIELDS | ({"tolerance"} if within else set()) or table[
            "comparison"
        ] not in ("<=", ">=", "within"):
            raise ValueError(
                f"{path}: figure {name!r} needs {', '.join(sorted(FIELDS))} (comparison '<=' or '>=', or 'within' and tolerance)"
            )
    return tables


def judge(value, table):
    """Whether a value holds its target; what was not measured does not."""
    if value is None or math.isnan(value):
        return False
    if table["comparison"] == "<=":
        return bool(value <= table["target"])
    if table["comparison"] == ">=":
        return bool(value >= table["target"])
    return bool(abs(value - table["target"]) <= table["tolerance"] * table["target"])


def against_target(name, value, tables, note=""):
    """The Figure of that name in targets.toml."""
    table = tables[name]
    value = None if value is None or math.isnan(value) else float(value)
    return Figure(
        name,
        value,
        table["unit"],
        table["target"],
        table["comparison"],
        table.get("tolerance"),
        judge(value, table),
        note,
    )


def informative(name, value, unit, note=""):
    """A Figure without target."""
    return Figure(name, None if value is None else float(value), unit, note=note)


def about():
    """What was measured, when, and on what machine: commit, whether the checkout has other content
    than the commit, date, processor, cores, load and versions."""
    versions = {name: version(name) for name in ("numpy", "scipy", "numba")}
    changed = git("status", "--porcelain", "--", *MEASURED, f":!benchmarks/{RESULT.name}")
    return {
        "commit": git("rev-parse", "HEAD"),
        "changed": bool(changed),
        "date": date.today().isoformat(),
        "machine": {
            "processor": processor(),
            "cores": os.cpu_count(),
            "load": round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None,
            "system": f"{platform.system()} {platform.machine()}",
            "python": platform.python_version(),
            **versions,
        },
    }


def git(*words):
    """What a command of git says in this checkout; "" where there is none."""
    try:
        done = subprocess.run(
            ["git", *words], cwd=TARGETS.parents[1], capture_output=True, text=True
        )
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def processor():
    """Its model as the system names it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:  # not Linux
        return platform.processor()
    found = re.search(r"^model name\s*: (.+)$", text, re.MULTILINE)
    return found[1] if found else platform.processor()


def write(path, figures, about, parts, broken):
    """Write the result of a whole run, a line for each figure, whole or not at all."""
    lines = lambda each: ",\n".join(f"  {json.dumps(one, ensure_ascii=False)}" for one in each)
    head = "".join(
        f" {json.dumps(key)}: {json.dumps(value)},\n"
        for key, value in (about | {"broken": broken}).items()
    )
    text = (
        f'{{\n{head} "parts": [\n{lines(parts)}\n ],\n'
        f' "figures": [\n{lines(figure._asdict() for figure in map(rounded, figures))}\n ]\n}}\n'
    )
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def rounded(figure):
    """With six digits, so that a change is one that counts."""
    return figure._replace(value=None if figure.value is None else float(f"{figure.value:.6g}"))


def read(path=RESULT):
    """(what `about` says with `parts` and `broken`, [Figure]) of a result. Raises ValueError."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        return found, [Figure(**line) for line in found.pop("figures")]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: no result of a bench ({error}); run `make bench`") from None


def commit(path=RESULT):
    """The commit that the committed result was measured at, "" where that is not known."""
    try:
        return read(path)[0].get("commit", "")
    except ValueError:
        return ""


def apart(found, tables):
    """Lines on targets without a figure, or with one that was judged by another target, and on
    figures whose target is no longer there."""
    by_name = {figure.name: figure for figure in found}
    lines = [f"{name}: no figure" for name in tables if name not in by_name]
    lines += [
        f"{figure.name}: no target"
        for figure in found
        if figure.target is not None and figure.name not in tables
    ]
    return lines + [
        f"{name}: judged by another target"
        for name, table in tables.items()
        if name in by_name and against_target(name, None, tables)[2:6] != by_name[name][2:6]
    ]
