"""The pages of the filters, all in one layout:

    python docs/_site/filter_pages.py

writes docs/reference/filters/NAME.md and the table of filters.md from the filters themselves, the
pages of evidence and benchmarks/filter_costs.csv.
"""

import csv
from pathlib import Path
from typing import Any

import doc_marks as marks
from doc_pages import DOCS, ROOT
from docstrings import meanings

from strapdown import filters
from strapdown.core.loop.contract import BIAS, Filter
from strapdown_reproductions.common import markdown

FOLDER = DOCS / "reference" / "filters"
TABLE = DOCS / "reference" / "filters.md"
EVIDENCE = DOCS / "reference" / "evidence"
COSTS = ROOT / "benchmarks" / "filter_costs.csv"
COMMAND = "python docs/_site/filter_pages.py"
STATES = {
    (0, 1, 2): "position",
    (3, 4, 5): "velocity",
    (6, 7, 8): "attitude",
    (0, 1): "horizontal position",
    (2,): "height",
    (3, 4): "horizontal velocity",
    (5,): "vertical velocity",
    (6, 7): "roll and pitch",
    (8,): "heading",
    (9, 10, 11): "accelerometer bias",
    (12, 13, 14): "gyro bias",
}
EXPLAINED = {
    "ins": "reference/filters.md",
    "sigma_point": "explanation/sigma-points.md",
    "particle": "explanation/particle.md",
    "observer": "explanation/observer.md",
    "invariant": "explanation/invariant.md",
    "two_stage": "explanation/two-stage.md",
    "ahrs_aided": "explanation/navigation.md#filters-fed-by-an-ahrs",
    "attitude": "explanation/attitude.md",
    "mekf": "explanation/navigation.md#mekf",
    "ekf": "explanation/sigma-points.md",
    "xkf": "explanation/exogenous.md",
    "vru": "explanation/vru.md",
    "fixed-gain": "explanation/navigation.md#fixed-gain",
    "direct-ahrs": "explanation/navigation.md#direct-ahrs",
    "direct-euler": "explanation/navigation.md#direct-euler",
}
"""{filter, else its family: page of docs/ that explains it}."""
MEANINGS = {
    "error_model": "`corrected`, or [what Hager & Bryne print](../filters.md#options), in whole or in part",
    "crab": "standard deviation of the angle between course and heading, deg; it increases the claimed "
    "std of the heading and changes no gain",
    "kernel": "width of a resampled component, as a fraction of the mixture, above 0 and at most 1; "
    "`None`: [by the number of components](../../explanation/particle.md#options)",
}
"""{option: its meaning on these pages, where a docstring leads to code}."""
BIAS_MEANING = (
    "model of an estimated bias between fixes: `decaying`, `held` or `random-walk`; "
    "[how to choose](../evidence/bias-decay.md)"
)
VERDICTS = (
    "*Consistent*: the errors agree with the claimed standard deviations; *by chance*: a consistent "
    "filter may also give this result. *Too cautious*, *too sure*: the standard deviations are too "
    "large, too small. *Diverging*: in at least 2 of 60 runs the error reached 500 m, or far exceeded "
    "the claimed covariance for more than 10 s. *Refused*: do not use this combination; the "
    "alternative is given below."
)


def estimated(filter: Filter) -> str:
    """Its states in words."""
    left, found = set(filter.estimates), []
    for rows, name in STATES.items():
        if set(rows) <= left:
            left -= set(rows)
            found.append((rows, name))
    return ", ".join(name for _, name in sorted(found))


def explanation(name: str) -> str:
    """The page that explains a filter, with its title."""
    path = EXPLAINED.get(name, EXPLAINED[filters.family(name)])
    page = DOCS / path.partition("#")[0]
    title = page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
    return f"[{title}](../../{path})"


def costs() -> dict[str, dict[str, str]]:
    """{filter: row of the measured times}."""
    with COSTS.open(encoding="utf-8", newline="") as file:
        return {row["filter"]: row for row in csv.DictReader(file)}


def evidence(page: str) -> str:
    """The text of a page of evidence."""
    return (EVIDENCE / f"{page}.md").read_text(encoding="utf-8")


def options(name: str, filter: Filter) -> list[str]:
    """Lines of the table of options."""
    if not filter.options:
        return ["This filter has no options."]
    said = meanings(filter.start.__doc__ or "", list(filter.options)) | {BIAS: BIAS_MEANING}
    said |= {option: MEANINGS[option] for option in said if option in MEANINGS}
    lines = ["| option | default | meaning |", "|---|---|---|"]
    for option, default in filter.options.items():
        if option in said:
            lines.append(f"| `{option}` | `{default}` | {said[option].replace('|', '/')} |")
    others = [f"`{each}` = `{filter.options[each]}`" for each in filter.options if each not in said]
    if not others:
        return lines
    lines = lines if len(lines) > 2 else []
    return [*lines, "", f"{explanation(name)} explains {', '.join(others)}."]


def consistency(name: str) -> list[str]:
    """Lines on what the study of consistency found: a grid of motions and grades."""
    _, *found = markdown.rows(markdown.section(evidence("consistency-each"), name)) or [[]]
    if not found:
        return [
            "The [study of consistency](../evidence/consistency.md) does not include this filter."
            if 0 in filters.find(name).estimates
            else "The study of consistency covers filters that estimate position. The standard "
            f"deviations of this filter are discussed in {explanation(name)}."
        ]
    grades = list(dict.fromkeys(row[1] for row in found))
    verdicts = {(row[0], row[1]): row[2] for row in found}
    lines = [
        "Agreement of the errors with the claimed covariance, 60 simulated runs per cell "
        "([method](../evidence/consistency.md), "
        "`strapdown reproduce consistency --out DIR`):",
        "",
        "| motion | " + " | ".join(grades) + " |",
        "|---" * (len(grades) + 1) + "|",
    ]
    for scenario in dict.fromkeys(row[0] for row in found):
        cells = [verdicts.get((scenario, grade), "–") for grade in grades]
        lines.append(f"| {scenario} | " + " | ".join(cells) + " |")
    lines += ["", VERDICTS]
    refused = evidence("consistency").partition("Refused cells:")
    for row in markdown.rows(refused[2])[1:]:
        if name in [each.strip() for each in row[0].split(",")]:
            lines += ["", f"Refused, {row[1]} with {row[2]}: {row[3]}"]
    return lines


def recorded(name: str) -> list[str]:
    """Lines of its row in the table of every filter on every recording."""
    head, *found = markdown.rows(
        markdown.section(evidence("every-filter"), "Every filter on every recording")
    )
    row = next((row for row in found if row[0] == name), None)
    if row is None:
        return [
            "[Every filter on every recording](../evidence/every-filter.md) does not include this filter."
        ]
    lines = [
        "RMS errors: horizontal / vertical position; velocity; roll / pitch / heading; for BROAD "
        "inclination / heading ([all filters](../evidence/every-filter.md), "
        "`strapdown reproduce recordings --out DIR`):",
        "",
        "| recording | errors |",
        "|---|---|",
    ]
    for recording, cell in zip(head[1:], row[1:]):
        kept = [part for part in cell.split("<br>") if not part.startswith(("fixes", "others"))]
        lines.append(f"| {recording} | {'<br>'.join(kept)} |")
    _, *found = markdown.rows(
        markdown.section(
            evidence("every-filter"), "Dead reckoning without position and velocity fixes"
        )
    )
    row = next((row for row in found if row[0] == name), None)
    if row:
        lines += [
            "",
            "Largest horizontal error in an outage, median: "
            f"drive0708, 15 s: {_metres(row[1])}; thor75, 30 s: {_metres(row[5])}.",
        ]
    return lines


def _metres(cell: str) -> str:
    return "does not run" if cell == "–" else f"{cell} m"


def yes(value: Any) -> str:
    """The word of a table for a property."""
    return "yes" if value else "no"


def page(name: str) -> str:
    """The page of one filter."""
    filter, cost = filters.find(name), costs().get(name)
    uses = ", ".join(f"`{kind}`" for kind in filter.uses) if filter.uses else "every kind of source"
    needs = ", ".join(f"`{kind}`" for kind in filter.needs)
    if 0 in filter.estimates:
        needs = ", ".join(part for part in ("`position`", needs) if part)
    facts = [
        ("good for", filter.good_for),
        ("not for", f"{filter.poor_for} ([which?](../../how-to/which-filter.md))"),
        ("estimates", estimated(filter)),
        ("needs", needs or "the IMU alone"),
        ("uses", uses),
    ]
    if set(filter.states) != set(filter.estimates):
        facts.append(("std", "NaN for some of them"))
    if cost and name != "closed-loop":
        facts.append(
            (
                "time",
                f"{float(cost['over closed-loop']):g} times that of `closed-loop` "
                "(`python benchmarks/filter_costs.py`)",
            )
        )
    facts += [
        ("[smoothing](../../how-to/smoothing.md)", yes(filter.smoother)),
        ("[robust and adaptive sources](../../how-to/robust.md)", yes(filter.weighs)),
        ("[installation as states](../../how-to/installation.md)", yes(filter.installation)),
        ("[eight runs at a time](../../explanation/lanes.md)", yes(filter.lanes)),
    ]
    if filter.columns:
        facts.append(("additional columns", ", ".join(f"`{column}`" for column in filter.columns)))
    facts += [("reference", filter.reference), ("explained in", explanation(name))]
    parts = [
        f"# {name}",
        f"<!-- written by {COMMAND} -->",
        f"Family: *{filters.FAMILIES[filters.family(name)]}*.",
        "\n".join(["| | |", "|---|---|", *(f"| {what} | {text} |" for what, text in facts)]),
        f"```text\nstrapdown fuse RECORDING --filter {name}\n```",
        "## Options",
        "\n".join(options(name, filter)),
        "## Measured consistency",
        "\n".join(consistency(name)),
        "## On recordings",
        "\n".join(recorded(name)),
    ]
    return "\n\n".join(parts) + "\n"


def table() -> str:
    """All filters, grouped by family, each leading to its page."""
    measured, lines = costs(), []
    for family, title in filters.FAMILIES.items():
        names = [name for name in filters.own_names() if filters.family(name) == family]
        names.sort(key=lambda name: (name != "closed-loop", name))
        lines += [f"### {title}", "", "| filter | good for | not for | time |"]
        lines += ["|---|---|---|---|"]
        for name in names:
            filter, time = filters.find(name), float(measured[name]["over closed-loop"])
            lines.append(
                f"| [`{name}`](filters/{name}.md) | {filter.good_for} | {filter.poor_for} | {time:g} |"
            )
        lines.append("")
    return "\n".join(lines)


def written() -> dict[Path, str]:
    """{file: what it should hold}."""
    found = {FOLDER / f"{name}.md": page(name) for name in filters.own_names()}
    text = TABLE.read_text(encoding="utf-8")
    return found | {TABLE: marks.filled(text, "filters", COMMAND, table())}


def stale() -> list[str]:
    """A line for each file that is not what the command would write."""
    should = written()
    lines = [
        f"{path.relative_to(ROOT)}: is not what `{COMMAND}` writes; run it"
        for path, text in should.items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    more = set(FOLDER.glob("*.md")) - set(should)
    return lines + [
        f"{path.relative_to(ROOT)}: no filter has this name; remove it" for path in more
    ]


def main() -> None:
    """Write all of them."""
    FOLDER.mkdir(exist_ok=True)
    for path, text in written().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
