"""The origin of rows, so that a message can name the line."""

from collections.abc import Callable
from typing import Any, NamedTuple, Self, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from ..checks import DataError
from ..typing import Ints, Mask
from ..units.wording import count_text


class Origin(NamedTuple):
    """The origin of rows: its name in messages, and the word for a row there."""

    name: str
    lines: Ints | None = None  # numbers of the rows in that source; None: 0, 1, 2, ...
    word: str = "row"

    def row(self, i: SupportsIndex) -> str:
        """`imu.csv, line 12`."""
        return f"{self.name}, {self.line(i)}"

    def line(self, i: SupportsIndex) -> str:
        """`line 12`."""
        return f"{self.word} {i if self.lines is None else self.lines[i]}"

    def keep_rows(self, index: Ints | Mask, count: int) -> "Origin":
        """Return the origin for the rows of `index` (numbers or mask) among its `count` rows."""
        return self._replace(lines=(np.arange(count) if self.lines is None else self.lines)[index])

    def refuse(self, wrong: Mask, text: Callable[[int], str]) -> None:
        """Raise DataError that names the first row where `wrong` (n,) is true; `text` returns the
        error message for the number of that row."""
        if wrong.any():
            row = int(np.argmax(wrong))
            raise DataError(f"{self.row(row)}: {text(row)}")


class RowsOfFile(NamedTuple):
    """Columns of one source, with the time first, the origin of their rows, and notes on dropped
    rows."""

    origin: Origin
    columns: tuple[NDArray[Any], ...]  # (n,) or (n, k) each
    notes: list[str]

    def keep_rows(self, index: Ints | Mask) -> Self:
        """Only these rows, numbers or mask."""
        origin = self.origin.keep_rows(index, len(self.columns[0]))
        return self._replace(origin=origin, columns=tuple(each[index] for each in self.columns))

    def note(self, rows: Ints, what: str, done: str) -> None:
        """Add a note with the number of rows: `what` they are, and what was `done` with them."""
        self.notes.append(
            f"{self.origin.name}: {count_text(len(rows), what)} {done}, the first in "
            f"{self.origin.line(rows[0])}"
        )

    def without(self, wrong: Mask, what: str, done: str = "dropped") -> Self:
        """Return all but the rows where `wrong` (n,) is true, and count these in the notes."""
        if not wrong.any():
            return self
        self.note(np.flatnonzero(wrong), what, done)
        return self.keep_rows(~wrong)
