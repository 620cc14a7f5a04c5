"""Plotly's script, less what the figures of a page do not use."""

from __future__ import annotations

import functools
import re

TRIMMED = "plotly.js v4.1."
"""Releases that are cut; of others the page has the whole script. Add one when the browser tests of
the pages pass with it."""
MODULE = re.compile(r"var ([\w$]+)=W\(")
"""Where a module of the bundle begins; W is what esbuild calls a module that runs on first use."""
REGISTERED = re.compile(r"\.register\(\[((?:[\w$]+\(\),?)+)\]\)")
"""The one call that names all kinds of traces, each by its module."""
NAME = re.compile(r"[\w$]+\Z")
FORWARD = re.compile(r"exports=([\w$]+)\(\)")


@functools.lru_cache(8)
def plotly_script(kinds: frozenset[str]) -> str:
    """The script that draws figures with traces of those kinds (plotly's "scatter", "scatter3d", ...).

    All of it where the script is not of a release that can be cut, or has no such kind.
    """
    from plotly.offline import get_plotlyjs

    whole = get_plotlyjs()
    return (_cut_modules(whole, kinds) if TRIMMED in whole[:100] else None) or whole


def _cut_modules(whole: str, kinds: frozenset[str]) -> str | None:
    """The modules that are called from one another, beginning at those of the kinds; None where the
    script is not built as expected.

    What stands between two modules goes with the one before. A name that is local to one module
    and that of another module keeps that one too: too much stays, never too little.
    """
    starts = list(MODULE.finditer(whole))
    listed = REGISTERED.search(whole, starts[-1].start()) if starts else None
    if listed is None:
        return None
    end = whole.index("});", listed.end()) + 3
    ends = [*(start.start() for start in starts[1:]), end]
    text = {m[1]: whole[m.start() : stop] for m, stop in zip(starts, ends, strict=True)}
    owner = {name: name for name in text}
    for name, part in text.items():
        owner |= dict.fromkeys(_before("=Ea(", part), name)
    modules = {_kind(name, text): name for name in _before("()", listed[1])}
    wanted = kinds - {"scatter"}  # which is part of the core
    if not wanted <= modules.keys():
        return None
    first = starts[-1][1]
    asked = ",".join(f"{modules[kind]}()" for kind in sorted(wanted))
    text[first] = text[first].replace(listed[1], asked)
    kept, todo = {first}, [first]
    while todo:
        called = {owner[name] for name in _before("()", text[todo.pop()]) if name in owner} - kept
        kept |= called
        todo += called
    parts = (part for name, part in text.items() if name in kept)
    return whole[: starts[0].start()] + "".join(parts) + whole[end:]


def _before(mark: str, text: str) -> list[str]:
    """The names right before each `mark`; a regular expression for both takes ten times as long."""
    found = (NAME.search(part[-20:]) for part in text.split(mark)[:-1])
    return [name[0] for name in found if name]


def _kind(name: str, text: dict[str, str]) -> str | None:
    """The kind of trace that a module, or the one that it hands on, brings; None of others."""
    for _ in range(4):
        part = text.get(name, "")
        if 'moduleType:"trace"' in part:
            found = re.search(r'name:"(\w+)"', part)
            return found[1] if found else None
        forward = FORWARD.search(part)
        if forward is None:
            return None
        name = forward[1]
    return None
