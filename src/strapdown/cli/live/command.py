"""The command `strapdown live`."""

import signal
from math import inf
from pathlib import Path
from typing import Annotated, Any

import typer

import strapdown as sd

from ..output import complain, record, say, wrote


def live(
    config: Annotated[Path, typer.Argument(help="TOML file with inputs, sources and outputs.")],
    seconds: Annotated[float | None, typer.Option(metavar="S", help="End after this time.")] = None,
) -> None:
    """Run a filter on what sensors send now: from UDP, TCP, serial lines, growing files or a recording,
    to ports, a log and a state on disk. Ctrl-C or SIGTERM ends it."""
    signal.signal(signal.SIGTERM, _end)
    program = sd.Live(config, on_event=lambda t, text: complain(f"{t:.2f} s: {text}"))
    try:
        program.run(inf if seconds is None else seconds)
    finally:
        stream = program.stream
        of_sources = [a.name or a.kind for a in program.config.sources]
        counts = dict(zip(of_sources, stream.counts()))
        dropped = {cause: count for cause, count in stream.dropped_by.items() if count}
        record(t=stream.t, counts=counts, dropped=dropped, bad=program.bad)
        record(missed=program.missed, unsent=program.unsent)
        record(clocks={port: clock._asdict() for port, clock in program.clocks.items()})
        if all(part.address.kind != "-" for part in program.config.outputs):
            for name, (used, rejected) in counts.items():
                say(f"{name}: {used} used, {rejected} rejected")
            for cause, count in dropped.items():
                say(f"dropped: {count} {cause}")
            for port, count in program.missed.items():
                if count:
                    say(f"{port}: {count} datagrams dropped by the system")
            for port, count in program.unsent.items():
                if count:
                    say(f"{port}: {count} states not written")
            for port, clock in program.clocks.items():
                say(f"{port}: clock: {clock}")
            if program.bad:
                say(f"not read: {program.bad} lines or pieces")
        wrote(*program.logs)


def _end(*_: Any) -> None:
    """End as by Ctrl-C, so that state and log are written."""
    raise KeyboardInterrupt
