"""Measurements of a receiver from the log that its newest bytes make. It needs what reads recordings, so that
it is loaded only with a receiver."""

from pathlib import Path
from typing import NamedTuple

from ...io.description.fix_columns import Whereabouts, read_fixes
from ...io.description.schema_source import SourcePart
from ...io.description.source_files import Files
from ...io.reader import Log


class ReceiverRow(NamedTuple):
    """A measurement of a receiver."""

    t: float
    kind: str
    y: tuple[float, ...]
    std: tuple[float, ...]


def receiver_rows(
    log: Log, name: Path, epoch: float | None
) -> tuple[float | None, list[ReceiverRow]]:
    """Return the epoch, that of the log where it is None, and the measurements of a log, as a
    description of it would read them."""
    parts = [
        SourcePart.model_validate({**section.keys, "file": str(name)})
        for section in log.sections
        if section.of == "source" and not section.left and not section.instance
        if "clock" in section.keys["time"] and section.keys["time"].get("week", "") is not None
    ]
    if epoch is None and parts:
        first = Files(name, None, ".", {name: log})
        read_fixes(parts[0], first, Whereabouts((), None), str(name))
        epoch = first.epoch
    files, rows = Files(name, epoch, ".", {name: log}), list[ReceiverRow]()
    for part in parts:
        found = read_fixes(part, files, Whereabouts((), None), str(name))
        columns = found.t.tolist(), found.y.tolist(), found.std.tolist()
        rows += [ReceiverRow(t, part.kind, tuple(y), tuple(std)) for t, y, std in zip(*columns)]
    return epoch, rows
