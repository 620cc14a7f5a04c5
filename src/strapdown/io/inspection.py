"""Inspection of a file: its content, likely mistakes and what could not be checked, as lines of
text. It also works where reading would refuse the file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ..checks import DataError, printable
from ..data.verdict import Reason
from ..fileio.limits import reading_within
from ..typing import File
from .facts import recording_facts
from .recordings import read
from .registry import ask, looker


class Inspection(NamedTuple):
    """`facts` and `problems` are lines; a problem names the field and the remedy. `reasons` are the
    problems that the mutual checks of the recording's parts found, `inconclusive` are lines on
    checks without a result."""

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
        lines = [str(self.path), *("  " + text for text in self.facts), *verdict, *untold]
        return list(map(printable, lines))

    def __str__(self) -> str:
        return "\n".join(self.lines)


def inspect(path: File, /, *more: File, **instances: int | None) -> Inspection:
    """Return the Inspection of a recording in any format, of files that make one together, as for
    `read`, or of a bare table. A file of unknown format is treated as a bare table.

    Raises DataError only where the file itself cannot be read.
    """
    paths = [Path(each) for each in (path, *more)]
    reader = looker(paths[0])
    if reader.open is not None or more:
        from .description.inspected_description import inspect_logs  # loads pydantic: 0.2 s

        label = ", ".join(map(str, paths))
        with reading_within(label):
            of_logs = inspect_logs(paths, instances)
        return Inspection(label, *map(tuple, of_logs))  # type: ignore[arg-type]
    path = paths[0]
    found = recording_facts(read(path)) if reader.inspect is None else ask(reader, "inspect", path)
    try:
        facts, problems, *rest = map(tuple, found)
    except (TypeError, ValueError):
        raise DataError(
            f"{path}: the reader {reader.name!r} returns a {type(found).__name__} instead of facts and problems"
        ) from None
    return Inspection(str(path), facts, tuple(dict.fromkeys(problems)), *rest[:2])


def check_drafted(paths: Sequence[Path]) -> None:
    """Refuse files that need no draft. Raises DataError."""
    for path in paths:
        reader = looker(path)
        if reader.open is None:
            raise DataError(
                f"--write drafts the description of tables and logs; {path} is a recording already"
            )


def draft(
    paths: Sequence[Path], take: Mapping[str, int | None], folder: Path, grade: str | None = None
) -> str:
    """Return the text of the `recording.toml` in `folder` that states what `read` takes from the
    files; `grade`: of the IMU, else one is assumed.

    Raises DataError, also where a file is already a recording.
    """
    check_drafted(paths)
    from .description.logs import join, open_logs

    joined = join(open_logs(paths), take)
    if not joined.taken and not joined.left:
        raise DataError(joined.asked[0])
    return joined.with_grade(grade).text(folder)
