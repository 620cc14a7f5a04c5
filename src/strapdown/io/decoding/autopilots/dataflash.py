"""ArduPilot's log format DataFlash,
https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html and
`AP_Logger/LogStructure.h`: its messages as tables, its parameters and its text."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....checks import DataError
from ..record_walk import Follow, Walked, structured_records

HEAD = b"\xa3\x95"
FORMAT, FORMAT_LENGTH = 128, 89
"""Type and length, in bytes, of the message that declares the others."""
TYPES = {
    "a": ("<i2", 32),
    "b": ("i1", 1),
    "B": ("u1", 1),
    "M": ("u1", 1),
    "h": ("<i2", 1),
    "H": ("<u2", 1),
    "c": ("<i2", 1),
    "C": ("<u2", 1),
    "i": ("<i4", 1),
    "I": ("<u4", 1),
    "e": ("<i4", 1),
    "E": ("<u4", 1),
    "L": ("<i4", 1),
    "q": ("<i8", 1),
    "Q": ("<u8", 1),
    "g": ("<f2", 1),
    "f": ("<f4", 1),
    "d": ("<f8", 1),
    "n": ("S4", 1),
    "N": ("S16", 1),
    "Z": ("S64", 1),
}
"""numpy type and count of each letter of a format."""
DIVISORS = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 10_000_000}
"""Counts of a letter that make a unit: hundredths, and degrees of 1e-7."""


class DataflashMessage(NamedTuple):
    """The declaration of one kind of message in a log."""

    name: str
    length: int  # bytes, the head included
    letters: str
    columns: tuple[str, ...]

    @property
    def kind(self) -> np.dtype[Any] | None:
        """The structured type of the bytes after the header; None for a declaration that
        contradicts itself."""
        if (
            len(self.letters) != len(self.columns)
            or len(set(self.columns)) != len(self.columns)
            or any(letter not in TYPES for letter in self.letters)
            or not all(self.columns)
            or not self.letters
        ):
            return None
        parts = [
            (name, kind, many) if many > 1 else (name, kind)
            for name, (kind, many) in zip(self.columns, (TYPES[each] for each in self.letters))
        ]
        found = np.dtype(parts)
        return found if found.itemsize == self.length - 3 else None


class DataFlash(Walked):
    """A binary DataFlash log, read in one pass. Raises DataError for other bytes."""

    def __init__(self, content: bytes) -> None:
        if HEAD not in content[:4096]:
            raise DataError("is not a DataFlash log; give the .BIN file of the autopilot")
        super().__init__(content)
        self.messages: dict[int, DataflashMessage] = {
            FORMAT: DataflashMessage(
                "FMT",
                FORMAT_LENGTH,
                "BBnNZ",
                ("Type", "Length", "Name", "Format", "Columns"),
            )
        }
        self._lengths = [0] * 256
        self._lengths[FORMAT] = FORMAT_LENGTH
        self._walk(0, len(content))
        self._rows = self._group_records(lambda starts: self.data[starts + 2], range(256))
        columns = self.columns("PARM")
        if {"Name", "Value"} <= set(columns):
            for raw, value in zip(columns["Name"].tolist(), columns["Value"].tolist()):
                self._set(raw.decode("ascii", "replace"), float(value))

    @property
    def counts(self) -> dict[str, int]:
        """{name: number of messages} of the messages in the log."""
        found = {each.name: len(self._rows[kind]) for kind, each in self.messages.items()}
        return {name: many for name, many in sorted(found.items()) if many}

    def columns(self, name: str) -> dict[str, NDArray[Any]]:
        """Return the columns of a message by their names in the log, with hundredths and 1e-7 deg
        converted to plain units; texts are bytes. {} for a missing or unreadable message."""
        for number, message in self.messages.items():
            kind = message.kind if message.name == name else None
            if kind is not None and len(self._rows[number]):
                found = structured_records(self.data, self._rows[number] + 3, kind)
                scaled = zip(message.columns, message.letters)
                return {
                    column: found[column] / DIVISORS[letter]
                    if letter in DIVISORS
                    else found[column]
                    for column, letter in scaled
                }
        return {}

    def texts(self) -> list[str]:
        """Return the texts that the autopilot wrote, in order."""
        texts = self.columns("MSG").get("Message", np.array([], "S1"))
        return [each.decode("utf-8", "replace") for each in texts.tolist()]

    def _take_records(self, at: int, end: int) -> int:
        content, lengths, place = self.content, self._lengths, self._places.append
        while at + 3 <= end:
            kind = content[at + 2]
            after = at + lengths[kind]
            if content[at] != 0xA3 or content[at + 1] != 0x95 or after == at or after > end:
                return at
            if kind == FORMAT:
                self._declare(content[at + 3 : after])
            place(at)
            at = after
        return at

    def _is_cut(self, at: int, end: int) -> bool:
        if not HEAD.startswith(self.content[at : at + 2]):
            return False
        return at + 3 > end or at + self._lengths[self.content[at + 2]] > end

    def _follow(self, end: int) -> Follow:
        data, lengths = self.data, np.array(self._lengths)

        def follow(at: NDArray[np.int64]) -> NDArray[np.int64]:
            head = data[np.minimum(at[:, None] + np.arange(3), len(data) - 1)]
            after = at + lengths[head[:, 2]]
            good = (head[:, 0] == 0xA3) & (head[:, 1] == 0x95) & (after > at) & (after <= end)
            return np.where(good, after, -1)

        return follow

    def _declare(self, body: bytes) -> None:
        number, length = body[0], body[1]
        name, letters, columns = (
            part.split(b"\0", 1)[0].decode("ascii", "replace")
            for part in (body[2:6], body[6:22], body[22:86])
        )
        if number not in self.messages and length > 3:
            self.messages[number] = DataflashMessage(
                name, length, letters, tuple(columns.split(","))
            )
            self._lengths[number] = length
