"""What a reader of a file format offers, and what an inspection finds."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ..checks import DataError
from ..recording import Recording
from ..verdict import Reason

Made = TypeVar("Made")


class Findings(NamedTuple):
    """Lines on a file: what it holds, what is probably wrong with it, and what could not be
    checked. A problem names the field and the remedy; of one that the checks of a recording against
    itself found, the reason is kept too."""

    facts: list[str]
    problems: list[str]
    reasons: list[Reason]
    inconclusive: list[str]

    @classmethod
    def of(cls, facts: Iterable[str] = (), problems: Iterable[str] = ()) -> "Findings":
        """These lines, without a reason."""
        return cls(list(facts), list(problems), [], [])

    def add(
        self,
        facts: Iterable[str] = (),
        problems: Iterable[str] = (),
        reasons: Iterable[Reason] = (),
        inconclusive: Iterable[str] = (),
    ) -> None:
        """Take these in."""
        self.facts.extend(facts)
        self.problems.extend(problems)
        self.reasons.extend(reasons)
        self.inconclusive.extend(inconclusive)

    def take(self, facts: Iterable[str], reasons: Iterable[Reason], more: Iterable[str]) -> None:
        """Take in what the checks of a recording against itself say: `more` is inconclusive."""
        reasons = list(reasons)
        self.add(facts, map(str, reasons), reasons, more)

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
    # Findings, or (facts, problems) alone, also of a file that `read` refuses; None: of what `read`
    # gives
    inspect: Callable[[Path], Findings | tuple[list[str], list[str]]] | None = None
    # whether the file is one, by its content, where other formats have its suffix or it has none
    sniff: Callable[[Path], bool] | None = None
    # of a format that is not read alone: text of a recording.toml that stands in the folder
    draft: Callable[[Path, Path | None], str] | None = None
