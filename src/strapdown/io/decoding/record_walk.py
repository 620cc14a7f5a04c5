"""Consecutive records of a binary log: those of one kind as an array, and where to resume after
damage."""

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...units.wording import count_text
from ..tables.table_file import FileTable

Bytes = NDArray[np.uint8]
Follow = Callable[[NDArray[np.int64]], NDArray[np.int64]]
"""End of the record that begins at each of these places; -1 without a record."""
IN_A_ROW = 4
"""Number of consecutive records that prove that a place is the beginning of a record."""
MAX_DAMAGES = 1000
"""Largest number of restarts after damage; the rest of the file is then left out."""
MAX_AT_ONCE = 1 << 18
"""Number of places that are examined together; each takes some hundred bytes of arrays."""


def side_by_side(data: Bytes, starts: NDArray[np.int64], size: int) -> Bytes:
    """Return copies (n, size) of the bytes from each start; all must lie in the data."""
    if not len(starts):
        return np.empty((0, size), np.uint8)
    return np.lib.stride_tricks.sliding_window_view(data, size)[starts]


def structured_records(data: Bytes, starts: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the records (n,) of a structured type that begin at each start."""
    return side_by_side(data, starts, kind.itemsize).view(kind)[:, 0]


def next_record(follow: Follow, begin: int, end: int) -> int:
    """Return the first place from `begin` on with consecutive records, or `end`."""
    size = 256
    while begin < end:
        at = np.arange(begin, min(begin + size, end))
        last = at
        for _ in range(IN_A_ROW):
            inside = (last >= 0) & (last < end)
            last = np.where(inside, follow(np.where(inside, last, begin)), last)
        if (last >= 0).any():
            return int(at[np.argmax(last >= 0)])
        begin, size = begin + size, min(2 * size, MAX_AT_ONCE)
    return end


class Walked(ABC):
    """A log of consecutive records, read in one pass, with its parameters and counts of lost data.
    Each format defines which records are complete, which one is cut short, and how records follow
    each other."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.data: Bytes = np.frombuffer(content, np.uint8)
        self.parameters: dict[str, float] = {}
        self.changed: dict[str, list[float]] = {}  # values that parameters had before
        self.unread = 0  # bytes between damage and the next record
        self.damages = 0
        self.cut = 0  # bytes of a record that the end of the file cuts short
        self._places = array("q")  # where records begin

    @abstractmethod
    def _take_records(self, at: int, end: int) -> int:
        """Take complete records from `at` on; return where they end."""

    @abstractmethod
    def _is_cut(self, at: int, end: int) -> bool:
        """Return True where the record at `at` is valid, but cut short by the end of the file."""

    @abstractmethod
    def _follow(self, end: int) -> Follow:
        """The Follow of this file."""

    def _walk(self, begin: int, end: int) -> None:
        """Take the records from `begin` on; other bytes are skipped and counted."""
        while begin < end:
            begin = self._take_records(begin, end)
            if begin >= end:
                return
            if self._is_cut(begin, end):
                self.cut += end - begin
                return
            self.damages += 1
            found = end
            if self.damages <= MAX_DAMAGES:
                found = next_record(self._follow(end), begin + 1, end)
            self.unread += found - begin
            begin = found

    def _group_records(
        self, kind_of: Callable[[NDArray[np.int64]], NDArray[Any]], kinds: Sequence[int]
    ) -> dict[int, NDArray[np.int64]]:
        """{kind: beginnings of its records}, in rising order; `kind_of` has the kind of each
        place."""
        starts = np.frombuffer(self._places, np.int64)
        every = kind_of(starts)
        order = np.argsort(every, kind="stable")
        cuts = np.searchsorted(every[order], kinds)
        return dict(zip(kinds, np.split(starts[order], cuts)[1:]))

    def _set(self, name: str, value: float) -> None:
        """Store the value of a parameter."""
        if name in self.parameters and self.parameters[name] != value:
            self.changed.setdefault(name, []).append(self.parameters[name])
        self.parameters[name] = value

    @property
    def remarks(self) -> list[str]:
        """Lines on lost parts of the file."""
        lines = []
        if self.unread:
            lines.append(
                f"{count_text(self.damages, 'damaged place')}, {self.unread} bytes skipped"
            )
        if self.cut:
            lines.append(f"the last record is cut short ({self.cut} bytes)")
        return lines


class Tables(Mapping[str, FileTable]):
    """Tables by name, each made on request."""

    def __init__(self, makers: Mapping[str, Callable[[], FileTable]]) -> None:
        self._makers = makers
        self._made: dict[str, FileTable] = {}

    def __getitem__(self, name: str) -> FileTable:
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)


def how_it_begins(content: bytes | memoryview, magic: bytes) -> str:
    """Return the message and remedy for a file that does not begin with the magic bytes of its
    format."""
    if not len(content):
        return "it is empty; copy it again from the device"
    start = bytes(content[: len(magic)])
    if magic.startswith(start):
        return f"it ends after {len(content)} bytes, within its header; copy it again"
    return "it begins with other bytes; give the complete file of the device"
