"""What a reader of a file format offers, and what an inspection finds."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ..checks import DataError
from ..recording import Recording

Made = TypeVar("Made")


class Findings(NamedTuple):
    """Lines on a file: what it holds, and what is probably wrong with it. A problem names the field
    and the remedy."""

    facts: list[str]
    problems: list[str]

    def add(self, facts: Iterable[str] = (), problems: Iterable[str] = ()) -> None:
        """Take these lines in."""
        self.facts.extend(facts)
        self.problems.extend(problems)

    def attempt(self, function: Callable[..., Made], *arguments: Any) -> Made | None:
        """What the function returns; None where it raises a DataError, which then is a problem."""
        try:
            return function(*arguments)
        except DataError as error:
            self.problems.append(str(error))
            return None


class Reader(NamedTuple):
    """One file format. What its functions find wrong they raise as DataError of one line."""

    name: str
    suffixes: tuple[
        str, ...
    ]  # how names of such files end, in small letters, as (".imu", ".imu.xz")
    summary: str  # what such a file is, a few words for help and complaints
    read: Callable[[Path], Recording]
    # (facts, problems), also of a file that `read` refuses; None: of what `read` gives
    inspect: Callable[[Path], tuple[list[str], list[str]]] | None = None
    # whether the file is one, by its content, where other formats have its suffix or it has none
    sniff: Callable[[Path], bool] | None = None
    # of a format that is not read alone: text of a recording.toml that stands in the folder
    draft: Callable[[Path, Path | None], str] | None = None
