"""Lists of events, similar ones folded, and of stretches with faults; their entries jump to the
time in the figures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from ..core.loop.contract import BRIDGED, DOUBTFUL, INVALID
from ..data.solution import Solution
from ..units.time_scales import utc
from .drawing import outages, stretches
from .parts import LISTED

FOLDED = 4
"""Number of events, differing in their numbers alone, from which they are folded."""
STATUS_NAMES: dict[int, str] = {BRIDGED: "gap bridged", DOUBTFUL: "doubtful", INVALID: "not valid"}


def occasions(solutions: Mapping[str, Solution]) -> str:
    """HTML of the events and stretches of {name: Solution}; solutions with the same share a list.
    "" where nothing happened."""
    lists = {"Gaps, outages and doubtful stretches": _stretches, "Events": _events}
    shown = []
    for heading, made in lists.items():
        same: dict[str, list[str]] = {}
        for name, solution in solutions.items():
            if len(solution.t) and (text := made(solution)):
                same.setdefault(text, []).append(name)
        for text, names in same.items():
            whose = f" of {escape(', '.join(names))}" if len(names) < len(solutions) else ""
            shown.append(f"<div><h3>{heading}{whose}</h3>{text}</div>")
    if not shown:
        return ""
    first = min(solution.t[0] for solution in solutions.values() if len(solution.t))
    last = max(solution.t[-1] for solution in solutions.values() if len(solution.t))
    return f"<div class=occasions data-whole='{first:.3f} {last:.3f}'>{''.join(shown)}</div>"


def _events(solution: Solution) -> str:
    """The events, numbered as in the figures; alike ones stand together where the first of them
    does."""
    times = [t for t, _ in solution.events[:LISTED]]
    clocks = _clocks(solution, times)
    alike: dict[str, list[tuple[int, str, str]]] = {}
    for number, (t, clock, (_, text)) in enumerate(zip(times, clocks, solution.events), 1):
        line = _jump(f"{t:.2f} s{clock}: {text}", t, t)
        alike.setdefault(re.sub(r"[\d.]+", "#", text), []).append((number, text, line))
    parts = []
    for group in alike.values():
        lines = "".join(f"<li value={number}>{line}</li>" for number, _, line in group)
        if len(group) < FOLDED:
            parts.append(lines)
        else:
            number, text, _ = group[0]
            parts.append(
                f"<li value={number}><details><summary>{escape(text)} <b>×{len(group)}</b></summary>"
                f"<ol>{lines}</ol></details></li>"
            )
    more = len(solution.events) - LISTED
    parts += [f"<li class=more>and {more} more</li>"] if more > 0 else []
    return f"<ol class=list>{''.join(parts)}</ol>" if parts else ""


def _stretches(solution: Solution) -> str:
    """Stretches of each kind in the order of time, the kinds folded where there are many."""
    found: dict[str, list[tuple[float, float]]] = {}
    for start, stop, status in stretches(solution):
        found.setdefault(STATUS_NAMES[status], []).append((start, stop))
    found["no position fix accepted"] = outages(solution)
    parts = []
    for kind, spans in found.items():
        spans.sort()
        clocks = _clocks(solution, [start for start, _ in spans])
        lines = "".join(
            f"<li>{_jump(f'{start:.1f} to {stop:.1f} s{clock}: {stop - start:.3g} s, {kind}', start, stop)}</li>"
            for (start, stop), clock in zip(spans, clocks)
        )
        if len(spans) < FOLDED:
            parts.append(lines)
        else:
            total = sum(stop - start for start, stop in spans)
            parts.append(
                f"<li><details><summary>{kind} <b>×{len(spans)}</b>, {total:.3g} s</summary>"
                f"<ul>{lines}</ul></details></li>"
            )
    return f"<ul class=list>{''.join(parts)}</ul>" if any(parts) else ""


def _clocks(solution: Solution, times: Sequence[float]) -> list[str]:
    """` (UTC)` of each time; "" without an absolute clock."""
    epoch = solution.meta.get("epoch")
    if epoch is None:
        return [""] * len(times)
    return [f" ({str(each)[11:21]} UTC)" for each in utc(epoch, np.array(times))]


def _jump(text: str, start: float, stop: float) -> str:
    """A button that shows the time from `start` to `stop` in all figures."""
    return (
        f"<button type=button class=jump data-jump='{start:.3f} {stop:.3f}'>{escape(text)}</button>"
    )
