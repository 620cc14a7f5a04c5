"""One figure is one line: name, value, unit, target, holds or not. The same lines go to a JSON
file."""

import json
import math
import os
import tomllib
from pathlib import Path
from typing import NamedTuple

TARGETS = Path(__file__).with_name("targets.toml")
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

    def __str__(self):
        value = "not measured" if self.value is None else f"{self.value:.4g} {self.unit}"
        wanted = {
            "<=": "at most",
            ">=": "at least",
            "within": f"within {100 * (self.tolerance or 0):g} % of",
        }.get(self.comparison, "")
        target = f"{wanted} {self.target:g}" if self.target is not None else "no target"
        holds = {True: "holds", False: "MISSED", None: "-"}[self.holds]
        return f"{self.name:<36} {value:>26}   {target:<22} {holds:<7}{' ' + self.note if self.note else ''}".rstrip()


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


def write(path, figures, machine):
    """Write {"machine": ..., "figures": [...]} whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(
        json.dumps(
            {"machine": machine, "figures": [figure._asdict() for figure in figures]}, indent=1
        )
        + "\n"
    )
    os.replace(part, path)
