"""The command `strapdown live`."""

import gc
import signal
import sys
from contextlib import nullcontext
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import strapdown as sd

from ..output import INTERRUPTED, complain, is_shown, record, say, wrote

if TYPE_CHECKING:
    from .program import Live


def live(
    config: Annotated[Path, typer.Argument(help="TOML file with inputs, sources and outputs.")],
    seconds: Annotated[float | None, typer.Option(metavar="S", help="End after this time.")] = None,
    page: Annotated[
        int | None,
        typer.Option(metavar="PORT", help="Show a page at http://127.0.0.1:PORT; 0: a free port."),
    ] = None,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="Show the numbers here, once a second.")
    ] = False,
) -> None:
    """Run a filter on what sensors send now: from UDP, TCP, serial lines, growing files or a recording,
    to ports, a log and a state on disk. Ctrl-C or SIGTERM ends it."""
    from .terminal import TerminalView, is_in_place

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # events stand in the view, which lines on the same terminal would break
    seen = terminal and is_in_place() and sys.stderr.isatty()
    program = sd.Live(config, on_event=None if seen else _complain, page=page)
    is_told = _end_by_signals(program)
    uses_output = any(part.address.kind == "-" for part in program.config.outputs)
    # a collection of all that was loaded until now would keep samples waiting
    gc.freeze()
    try:
        if terminal and (uses_output or not is_shown()):
            other = "the output `-`" if uses_output else "--json"
            raise sd.DataError(f"--terminal and {other} both need standard output; leave out one")
        if program.page:
            complain(f"page: {program.page}")
        with TerminalView(program.watch()) if terminal else nullcontext():
            program.run(inf if seconds is None else seconds)
    finally:
        program.close()
        _summarise(program, not uses_output)
    if is_told:
        raise typer.Exit(INTERRUPTED)


def _complain(t: float, text: str) -> None:
    complain(f"{t:.2f} s: {text}")


def _summarise(program: "Live", says: bool) -> None:
    """Record counts and clocks, and say them."""
    from .dashboard import losses, source_rows
    from .terminal import loss_lines, uses_text

    rows, lost = source_rows(program), losses(program)
    record(t=program.stream.t)
    record(counts={each["name"]: (each["used"], each["rejected"]) for each in rows})
    record(**lost)
    record(clocks={port: clock._asdict() for port, clock in program.clocks.items()})
    if says:
        for each in rows:
            say(f"{each['name']}: {uses_text(each)}")
        for line in loss_lines(lost):
            say(line)
    wrote(*program.logs)


def _end_by_signals(program: "Live") -> list[int]:
    """Let Ctrl-C and SIGTERM end a program after its present turn, so that no sample is used by half, and a
    second one at once. Return the list to which a signal is added that came."""
    told: list[int] = []

    def end(number: int, _: object) -> None:
        told.append(number)
        program.end()
        signal.signal(number, signal.default_int_handler)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    return told
