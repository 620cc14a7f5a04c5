"""What a file holds, what is probably wrong with it and what could not be checked, in lines for
people; works where reading would refuse."""

from pathlib import Path
from typing import NamedTuple

from ..checks import DataError
from ..typing import File
from ..verdict import Reason
from .contract import Reader
from .facts import recording_facts
from .readers import ask, find, read, readers


class Inspection(NamedTuple):
    """`facts` and `problems` are lines; a problem names the field and the remedy. `reasons` are
    those among the problems that the parts of the recording say of each other, `inconclusive` lines
    on what they do not tell."""

    path: str
    facts: tuple[str, ...]
    problems: tuple[str, ...]
    reasons: tuple[Reason, ...] = ()
    inconclusive: tuple[str, ...] = ()

    @property
    def lines(self) -> list[str]:
        """All lines, ready to print."""
        verdict = [f"problem: {text}" for text in self.problems] or ["no mistakes found"]
        untold = [f"inconclusive: {text}" for text in self.inconclusive]
        return [str(self.path), *("  " + text for text in self.facts), *verdict, *untold]

    def __str__(self) -> str:
        return "\n".join(self.lines)


def taker(path: Path) -> Reader:
    """The Reader that looks at a file: that of tables, where the format is not known."""
    return find(path) or readers()["table"]


def inspect(path: File) -> Inspection:
    """The Inspection of a recording in any format, or of a bare table, as which every file is taken
    whose format is not known.

    Raises DataError only where the file itself cannot be read.
    """
    path = Path(path)
    reader = taker(path)
    found = recording_facts(read(path)) if reader.inspect is None else ask(reader, "inspect", path)
    try:
        facts, problems, *more = map(tuple, found)
    except (TypeError, ValueError):
        raise DataError(
            f"{path}: the reader {reader.name!r} gives no facts and problems but a {type(found).__name__}"
        ) from None
    return Inspection(str(path), facts, tuple(dict.fromkeys(problems)), *more[:2])
