"""Interface of the readers of file formats, and the findings of an inspection."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ..checks import DataError
from ..data.recording import Recording
from ..data.verdict import Reason
from .tables.table_file import FileTable

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
        """Return the function's result; None where it raises a DataError, which becomes a
        problem."""
        try:
            return function(*arguments)
        except DataError as error:
            self.problems.append(str(error))
            return None


ROLES = {
    "imu": "IMU",
    "gnss": "GNSS receiver",
    "magnetometer": "magnetometer",
    "barometer": "barometer",
    "airspeed": "airspeed sensor",
    "speed": "speed sensor",
    "heading": "source of headings",
    "attitude": "source of attitudes",
    "reference": "reference",
}
"""Sensors of the sections of a log. Of each role one instance is taken, and a user may name
another."""


GUESS = "?"
"""Ends the `axes` of an IMU that a reader guessed and the user has not confirmed, as in "FLU?"."""


class Section(NamedTuple):
    """A section of a `recording.toml` as a file's own format gives it, or as it was guessed.

    `keys` are those of docs/reference/recording-format.md with their values, without `file`; `table` names the
    table of the log. An [imu] with `gyro` or `accel` alone is joined with the other one, of
    another table.
    """

    of: str  # "imu", "source" or "reference"
    role: str  # one of ROLES; sections of one role and instance are taken together
    keys: Mapping[str, Any]
    instance: int = 0  # which of several alike, as the format counts them
    title: str = ""  # what it is in the words of the format, as "vehicle_imu 1, 198 Hz"
    # {key: why it has this value}: what the file does not say
    assumed: Mapping[str, str] = {}
    # why it is only taken where a user asks for it, as "made of the same IMU"; "": it may be taken
    left: str = ""
    remarks: tuple[str, ...] = ()  # lines for the drafted text, such as keys that one may want
    faster: str = ""  # of an IMU: the setting of the device that logs it at a higher rate


class Log(NamedTuple):
    """A file of tables, rather than a whole recording, and the sections of a recording that they
    fill.

    A complaint names a row of a table by the name of that table.
    """

    tables: Mapping[str, FileTable]  # by the names that `table` has in the sections
    sections: tuple[Section, ...]
    facts: tuple[str, ...] = ()  # lines on what the file holds
    left: tuple[str, ...] = ()  # lines on what is not taken, and why
    # lines on what is wrong, or must be known and nothing tells, with the remedy: reading refuses
    asked: tuple[str, ...] = ()
    # keys at the top of a description, such as "epoch", UTC of t = 0 of a clock of its own
    head: Mapping[str, Any] = {}
    reader: str = ""  # name of the Reader that gave it, put in when it is opened


class Reader(NamedTuple):
    """One file format. What its functions find wrong they raise as DataError of one line.

    A format of whole recordings has `read`. One whose file may be a part of a recording, or holds
    several IMUs, has `open`: several such files make one recording together, and everything
    that a user can do with a description can be done with them.
    """

    name: str
    suffixes: tuple[
        str, ...
    ]  # how names of such files end, in small letters, as (".imu", ".imu.xz")
    # what such a file is, a few words for help; "" of a reader that only refuses
    summary: str
    read: Callable[[Path], Recording] | None = None
    # Findings, or (facts, problems) alone, also of a file that `read` refuses; None: of what `read`
    # gives
    inspect: Callable[[Path], Findings | tuple[list[str], list[str]]] | None = None
    # whether the file (or folder) is one, by its content, where other formats have its suffix or it
    # has none
    sniff: Callable[[Path], bool] | None = None
    open: Callable[[Path], Log] | None = None
    # first bytes that no other format has: a file with them is one, whatever its name
    begins: tuple[bytes, ...] = ()
