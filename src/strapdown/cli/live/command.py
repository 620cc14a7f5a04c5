"""The command `strapdown live`."""

import gc
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import strapdown as sd

from ...checks import check_number
from ..output import INTERRUPTED, complain, give_up_output, is_shown, record, say, wrote

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
    to ports, a log and a state on disk. It ends after --seconds, at the end of its inputs, and by SIGTERM,
    SIGHUP or Ctrl-C, always with its log and state written."""
    from .config import config_of
    from .terminal import TerminalView, is_in_place

    if seconds is not None:
        check_number(seconds, "--seconds", "s", least=0, infinite=True)
    _set_signals(ENDS, _leave)
    # events stand in the view, which lines on the same terminal would break
    seen = terminal and is_in_place() and sys.stderr.isatty()
    parts = config_of(config)
    uses_output = any(part.address.kind == "-" for part in parts.outputs)
    # a program writes its state when it ends, even where it has done nothing
    _check_standard_output(terminal, uses_output)
    program = sd.Live(parts, on_event=None if seen else _complain, page=page)
    told = _end_by_signals(program)
    # a collection of all that was loaded until now would keep samples waiting
    gc.freeze()
    with program:
        try:
            if program.page:
                _say_error(f"page: {program.page}")
            with TerminalView(program.watch()) if terminal else nullcontext():
                program.run(inf if seconds is None else seconds)
        finally:
            program.close()
            _end_output(program, not uses_output)
    if signal.SIGINT in told:
        raise typer.Exit(INTERRUPTED)


ENDS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that end a program in order; Ctrl-C does so, too, with a code of its own."""


def _check_standard_output(terminal: bool, uses_output: bool) -> None:
    """Refuse two that both need standard output. Raises DataError."""
    needed = {
        "--terminal": terminal,
        "the output `-`": uses_output,
        "--json": not is_shown(),
    }
    names = [name for name, needs in needed.items() if needs]
    if len(names) > 1:
        raise sd.DataError(f"{names[0]} and {names[1]} both need standard output; leave out one")


def _complain(t: float, text: str) -> None:
    _say_error(f"{t:.2f} s: {text}")


def _say_error(text: str) -> None:
    # where the terminal has gone the filter goes on
    with suppress(OSError):
        complain(text)


def _end_output(program: "Live", says: bool) -> None:
    """Say what there was; a standard output that has gone is no failure of the program."""
    try:
        _summarise(program, says)
        sys.stdout.flush()
    except OSError:
        give_up_output()
    if any(each.sink.error for each in program.outputs if each.sink.address.kind == "-"):
        give_up_output()


def _summarise(program: "Live", says: bool) -> None:
    """Record counts and clocks, and say them: on standard error where states go to standard output."""
    from .dashboard import losses, source_rows
    from .terminal import loss_lines, uses_text

    rows, lost = source_rows(program), losses(program)
    record(t=program.stream.t)
    record(counts={each["name"]: (each["used"], each["rejected"]) for each in rows})
    clocks = {port: clock._asdict() for port, clock in program.clocks.items()}
    record(**lost | {"clocks": clocks})
    record(cut_logs=program.cut_logs)
    tell = say if says else _say_error
    for each in rows:
        tell(f"{each['name']}: {uses_text(each)}")
    for line in loss_lines(lost):
        tell(line)
    for path, why in program.cut_logs.items():
        tell(f"{path}: ends too early: {why}")
    if says:
        wrote(*program.logs)
    elif program.logs:
        tell(f"wrote {', '.join(map(str, program.logs))}")


def _set_signals(numbers: Sequence[int], handler: Callable[[int, object], None]) -> None:
    """Handle signals, but for those that the process was started to ignore, as `nohup` does."""
    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _leave(number: int, _: object) -> None:
    """End while there is nothing yet to be saved."""
    raise SystemExit(0)


def _end_by_signals(program: "Live") -> list[int]:
    """Let signals end a program after its present turn, so that no sample is used by half, and a second
    Ctrl-C at once. Return the list to which a signal is added that came."""
    told: list[int] = []

    def end(number: int, _: object) -> None:
        told.append(number)
        program.end()
        if number == signal.SIGINT:
            signal.signal(number, signal.default_int_handler)

    _set_signals([*ENDS, signal.SIGINT], end)
    return told
