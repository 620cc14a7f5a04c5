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
    """Lines on a file: its content, likely mistakes, and what could not be checked. A problem names
    the field and the remedy. For problems from the mutual checks of the recording's parts, the
    reason is kept as well."""

    facts: list[str]
    problems: list[str]
    reasons: list[Reason]
    inconclusive: list[str]

    @classmethod
    def of(cls, facts: Iterable[str] = (), problems: Iterable[str] = ()) -> "Findings":
        """Return Findings of these lines, without a reason."""
        return cls(list(facts), list(problems), [], [])

    def add(
        self,
        facts: Iterable[str] = (),
        problems: Iterable[str] = (),
        reasons: Iterable[Reason] = (),
        inconclusive: Iterable[str] = (),
    ) -> None:
        """Add lines and reasons."""
        self.facts.extend(facts)
        self.problems.extend(problems)
        self.reasons.extend(reasons)
        self.inconclusive.extend(inconclusive)

    def take(self, facts: Iterable[str], reasons: Iterable[Reason], more: Iterable[str]) -> None:
        """Add the results of the mutual checks of the recording's parts; `more` is inconclusive."""
        reasons = list(reasons)
        self.add(facts, map(str, reasons), reasons, more)

    def attempt(self, function: Callable[..., Made], *arguments: Any) -> Made | None:
        """Return the function's result; a DataError becomes a problem, and the result is None."""
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
    "baseline": "pair of antennas",
    "reference": "reference",
}
"""Sensors of the sections of a log. One instance of each role is taken; a user may choose
another."""


GUESS = "?"
"""Suffix of IMU `axes` that a reader guessed and the user has not confirmed, as in "FLU?"."""


class Section(NamedTuple):
    """A section of a `recording.toml` from a file's own format, or a guessed one.

    `keys` are those of docs/reference/recording-format.md with their values, without `file`;
    `table` names the table of the log. An [imu] that has only `gyro` or `accel` is joined with the
    other one from another table.
    """

    of: str  # "imu", "source" or "reference"
    role: str  # one of ROLES; sections of one role and instance are taken together
    keys: Mapping[str, Any]
    instance: int = 0  # number among several of its kind, in the format's own numbering
    title: str = ""  # its name in the words of the format, such as "vehicle_imu 1, 198 Hz"
    # {key: reason for its value}, for values that the file does not state
    assumed: Mapping[str, str] = {}
    # why it is only taken on request, such as "computed from the same IMU"; "": it may be taken
    left: str = ""
    remarks: tuple[str, ...] = ()  # lines for the drafted text, such as optional keys
    faster: str = ""  # of an IMU: the setting of the device that logs it at a higher rate


class Log(NamedTuple):
    """A file of tables, rather than a whole recording, and the sections of a recording that they
    fill.

    An error message about a row begins with the name of its table.
    """

    tables: Mapping[str, FileTable]  # by the names that `table` has in the sections
    sections: tuple[Section, ...]
    facts: tuple[str, ...] = ()  # lines on the content of the file
    left: tuple[str, ...] = ()  # lines on what is left out, and why
    # lines on errors, or on missing information, with the remedy: reading refuses the file
    asked: tuple[str, ...] = ()
    # keys at the top of a description, such as "epoch", UTC of t = 0 of a clock of its own
    head: Mapping[str, Any] = {}
    reader: str = ""  # name of the Reader that gave it, set on opening


class Reader(NamedTuple):
    """One file format. Its functions raise errors as one-line DataErrors.

    A format of complete recordings has `read`. A format whose file may be a part of a recording, or
    holds several IMUs, has `open`: several such files can make one recording together, and can be
    used like a description.
    """

    name: str
    suffixes: tuple[
        str, ...
    ]  # endings of the file names in lower case, such as (".imu", ".imu.xz")
    # short description of the format for help; "" for a reader that only refuses
    summary: str
    read: Callable[[Path], Recording] | None = None
    # Findings, or (facts, problems) alone, also of a file that `read` refuses; None: of what `read`
    # gives
    inspect: Callable[[Path], Findings | tuple[list[str], list[str]]] | None = None
    # whether the file (or folder) is one, by its content, where other formats have its suffix or it
    # has none
    sniff: Callable[[Path], bool] | None = None
    open: Callable[[Path], Log] | None = None
    # first bytes that no other format has: a file with them has this format, whatever its name
    begins: tuple[bytes, ...] = ()
