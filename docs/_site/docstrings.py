"""Docstrings of this library as reStructuredText. They are plain prose, in which `name: meaning;`
says what a parameter is; autodoc gets a list of the parameters in its place."""

import inspect
import re
from collections.abc import Sequence
from typing import Any

from sphinx.application import Sphinx


def parameters(value: Any) -> list[str]:
    """Names of what a function or class is called with."""
    try:
        found = list(inspect.signature(value).parameters)
    except (TypeError, ValueError):
        return []
    return [name for name in found if name not in ("self", "cls")]


def meanings(text: str, names: Sequence[str]) -> dict[str, str]:
    """{parameter: what a docstring says of it}; only of those that it explains one by one."""
    found: dict[str, str] = {}
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        _, items, _ = _split(" ".join(paragraph.split()), names)
        found |= {name: said for each, said in items for name in re.split(", | and ", each)}
    return found


def with_list(text: str, names: Sequence[str]) -> str:
    """One paragraph, what it says of parameters as a list; the sentences before and behind stay
    prose."""
    said, items, rest = _split(text, names)
    if not items:
        return text
    listed = "\n".join(f"- ``{name}``: {meaning}" for name, meaning in items)
    return "\n\n".join(part for part in (said, listed, rest) if part)


def _split(text: str, names: Sequence[str]) -> tuple[str, list[tuple[str, str]], str]:
    """(sentences before, [(name or names, meaning)], sentences behind) of one paragraph."""
    one = "|".join(map(re.escape, sorted(names, key=len, reverse=True))) or "(?!)"
    heads = list(re.finditer(rf"(?:^|(?<=[.;:)] ))((?:{one})(?:(?:, | and )(?:{one}))*): ", text))
    if not heads:
        return text, [], ""
    ends = [head.start() for head in heads[1:]] + [len(text)]
    items = [(head[1], text[head.end() : end].strip()) for head, end in zip(heads, ends)]
    last, rest = _sentence(items[-1][1])
    items[-1] = (items[-1][0], last)
    kept = [(name, meaning.rstrip(";.")) for name, meaning in items]
    return text[: heads[0].start()].strip(), kept, rest


def _sentence(text: str) -> tuple[str, str]:
    """The first sentence, and the rest."""
    found = re.search(r"\.\s+(?=[A-Z])", text)
    return (text[: found.start()], text[found.end() :]) if found else (text, "")


def rst(text: str, names: Sequence[str]) -> str:
    """A docstring: paragraphs are taken one by one, what is indented or listed stays."""
    done = []
    for paragraph in re.split(r"\n\s*\n", text):
        if any(line[:1] in " -*>|=" for line in paragraph.splitlines() if line):
            done.append(_verbatim(paragraph))
        else:
            done.append(with_list(_escaped(" ".join(paragraph.split())), names))
    return "\n\n".join(done)


def _escaped(text: str) -> str:
    """`code` as ``code``, docs/PAGE.md as a link to it; outside them, stars, bars and underscores that
    are no markup."""
    text = re.sub(r"`?\bdocs/([\w/-]+)\.md`?", r":doc:`/\1`", text)
    parts = re.split(r"(:doc:`[^`]*`|`+[^`]*`+)", text)
    return "".join(
        part
        if part.startswith(":doc:")
        else f"``{part.strip('`')}``"
        if part[:1] == "`"
        else re.sub(r"([*|\\])|_(?=\W|$)", r"\\\g<0>", part)
        for part in parts
    )


def _verbatim(paragraph: str) -> str:
    """A paragraph whose lines are set as they stand."""
    return "\n".join(f"| {_escaped(line)}".rstrip() for line in paragraph.splitlines())


def process(app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Of autodoc: the docstring of `value` in place."""
    text = "\n".join(lines).strip()
    if text:
        lines[:] = [*rst(text, parameters(value)).splitlines(), ""]


def skip(app: Sphinx, what: str, name: str, value: Any, skipped: bool, options: Any) -> bool | None:
    """Of autodoc: fields of a NamedTuple of which nothing is said, and its helpers."""
    text = getattr(value, "__doc__", None) or ""
    return True if text.startswith("Alias for field number") or name in ("count", "index") else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Join autodoc."""
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-skip-member", skip)
    return {"parallel_read_safe": True}
