"""Where rows came from, so that a message can name the line."""

from typing import NamedTuple, SupportsIndex

import numpy as np

from ..typing import Ints, Mask


def counted(count: int, noun: str) -> str:
    """`1 row`, `2 rows`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


class Origin(NamedTuple):
    """A source of rows: its name in messages, and what each row is called there."""

    name: str
    lines: Ints | None = None  # numbers of the rows in that source; None: 0, 1, 2, ...
    word: str = "row"

    def row(self, i: SupportsIndex) -> str:
        """`imu.csv, line 12`."""
        return f"{self.name}, {self.line(i)}"

    def line(self, i: SupportsIndex) -> str:
        """`line 12`."""
        return f"{self.word} {i if self.lines is None else self.lines[i]}"

    def kept(self, index: Ints | Mask, count: int) -> "Origin":
        """The same source after only the rows of `index` (numbers or mask) of its `count` rows
        were kept."""
        return self._replace(lines=(np.arange(count) if self.lines is None else self.lines)[index])
