"""The numbers of a running filter on a terminal, once a second in the same place; a line a second where
standard output is none. A thread of its own writes them, so a terminal that does not take them never keeps
the filter waiting."""

import os
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from shutil import get_terminal_size
from types import TracebackType
from typing import Any

from ...units.wording import number
from ..output import fit_lines
from .dashboard import Dashboard

EVERY = 1.0
"""s between two views."""
EVENTS = 5
"""Newest events in a view."""
CLEAR, HOME, END_OF_LINE, BELOW = "\x1b[2J", "\x1b[H", "\x1b[K", "\x1b[J"
"""ANSI: erase all, go to the top, erase what is right, erase what is below."""


class TerminalView:
    """Shows a dashboard as long as the context lasts."""

    def __init__(self, dashboard: Dashboard) -> None:
        self._dashboard, self._look = dashboard, 0
        self._events: deque[Sequence[Any]] = deque(maxlen=EVENTS)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.in_place = is_in_place()

    def __enter__(self) -> "TerminalView":
        if self.in_place:
            sys.stdout.write(CLEAR)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join(EVERY)

    def _run(self) -> None:
        # its reader may go before the program ends
        with suppress(OSError), self._dashboard.count_viewer():
            while not self._over.wait(EVERY):
                self._show()

    def _show(self) -> None:
        self._look, shown = self._dashboard.since(self._look)
        self._events.extend(shown["events"])
        if self._look:
            sys.stdout.write(self._text(shown))
            sys.stdout.flush()

    def _text(self, shown: Mapping[str, Any]) -> str:
        if not self.in_place:
            return f"{one_line_view(shown)}\n"
        columns, rows = get_terminal_size()
        lines = [
            part
            for line in view_lines(shown, [*self._events])
            for part in fit_lines(line, columns - 1, "", "    ")
        ]
        return HOME + "".join(f"{line}{END_OF_LINE}\n" for line in lines[: rows - 1]) + BELOW


def is_in_place() -> bool:
    """Return True where standard output is a terminal on which a view can be written again."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


def one_line_view(shown: Mapping[str, Any]) -> str:
    """Return the numbers in one line."""
    parts = [_head(shown)]
    if "rph" in shown:
        parts += [_position(shown), _velocity(shown).split(":")[0], _attitude(shown)]
    parts += [f"{each['name']} {uses_text(each)}" for each in shown["sources"]]
    parts.append(f"verdict {shown['verdict']['word']}")
    return "; ".join(filter(None, parts))


def view_lines(shown: Mapping[str, Any], events: Sequence[Sequence[Any]]) -> list[str]:
    """Return the numbers in lines, with the newest of the events."""
    lines = [f"strapdown live: {shown['name']}, filter {shown['filter']}", _head(shown)]
    lines.append(f"newest sample {shown['since_sample']:.1f} s ago")
    lines.append(_verdict(shown["verdict"]))
    if "rph" in shown:
        named = {"position": _position(shown), "velocity": _velocity(shown)}
        named["attitude"] = _attitude(shown)
        lines += ["", *(f"{name}  {text}" for name, text in named.items() if text)]
    ports = [f"{port}: {error}" for port, error in shown["ports"].items() if error]
    lines += ["", *_source_lines(shown), *ports, *loss_lines(shown), "", "newest events:"]
    return lines + [f"  {t:.2f} s: {text}" for t, text in reversed(events)]


def _head(shown: Mapping[str, Any]) -> str:
    t = "no time yet" if shown["t"] is None else f"{shown['t']:.2f} s"
    utc = f" ({shown['utc']})" if shown["utc"] else ""
    return f"{t}{utc}: {shown['status']}, {shown['reason']}"


def _verdict(verdict: Mapping[str, str]) -> str:
    span = f" ({verdict['of']})" if verdict["of"] else ""
    failure = f"; the last attempt failed: {verdict['error']}" if verdict["error"] else ""
    return f"verdict{span}: {verdict['line']}{failure}"


def _position(shown: Mapping[str, Any]) -> str:
    if None in shown["lat_lon"]:
        return ""
    lat, lon = shown["lat_lon"]
    north, east, up = map(number, shown["position_std"])
    height = f"height {shown['height']:.2f} +- {up} m"
    return f"{lat:.7f} deg, {lon:.7f} deg (+- {north} m north, {east} m east), {height}"


def _velocity(shown: Mapping[str, Any]) -> str:
    if shown["speed"] is None:
        return ""
    values = zip(("north", "east", "down"), shown["v_n"], shown["velocity_std"])
    axes = ", ".join(f"{axis} {value:.2f} +- {number(std)}" for axis, value, std in values)
    return f"{shown['speed']:.2f} m/s: {axes} m/s"


def _attitude(shown: Mapping[str, Any]) -> str:
    values = zip(("roll", "pitch", "heading"), shown["rph"], shown["rph_std"])
    return ", ".join(
        f"{angle} {value:.2f} +- {number(std)} deg"
        for angle, value, std in values
        if value is not None
    )


def uses_text(source: Mapping[str, Any]) -> str:
    """Return the counts of a source as text."""
    return f"{source['used']} used, {source['rejected']} rejected"


def _source_lines(shown: Mapping[str, Any]) -> Iterator[str]:
    for k, source in enumerate(shown["sources"]):
        text, test = f"{source['name']}: {uses_text(source)}", shown["tests"].get(str(k))
        if test:
            text += f", innovation {number(test['innovation'])} {test['unit']}"
            text += f", NIS {number(test['nis'])} of {number(test['gate'])}"
        yield text + (f"; silent for {source['silent']:.0f} s" if source["silent"] else "")


def loss_lines(lost: Mapping[str, Any]) -> Iterator[str]:
    """Return lines on data that were dropped or not read, and on clocks."""
    for cause, count in lost["dropped"].items():
        yield f"dropped: {count} {cause}"
    for port, count in lost["missed"].items():
        if count:
            yield f"{port}: {count} datagrams dropped by the system"
    for port, count in lost["unsent"].items():
        if count:
            yield f"{port}: {count} states not written"
    for port, clock in lost["clocks"].items():
        yield f"{port}: clock: {clock}"
    if lost["bad"]:
        yield f"not read: {lost['bad']} lines or pieces"
