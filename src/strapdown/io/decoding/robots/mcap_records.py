"""The records of an MCAP file, https://mcap.dev/spec. They are read from the beginning without the
index, so that a truncated file is read as far as possible."""

import struct
import zlib
from typing import Any, NamedTuple

import numpy as np

from ....checks import DataError
from ....fileio.limits import LimitError, Meter
from ....typing import Ints
from ..record_walk import how_it_begins
from .packed_chunks import unpack
from .ros_messages import Messages, RosTopic, take

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 3, 4, 5, 6, 15
MESSAGE_HEAD = 22
"""Bytes of a message before its content: channel, sequence, time of log and of publication."""


class Records(NamedTuple):
    """The complete records of a file or a chunk: begin and end of their contents."""

    messages: Ints  # (n, 2)
    others: list[tuple[int, int, int]]  # (opcode, begin, end)
    end: int  # of the last complete one


def walk(content: bytes | memoryview, begin: int) -> Records:
    """The Records from `begin` on."""
    messages: list[int] = []
    others = []
    size, head = len(content), struct.Struct("<BQ").unpack_from
    while begin + 9 <= size:
        opcode, length = head(content, begin)
        end = begin + 9 + length
        if end > size:
            break
        if opcode == MESSAGE:
            messages += (begin + 9, end)
        else:
            others.append((opcode, begin + 9, end))
        begin = end
    return Records(np.array(messages, int).reshape(-1, 2), others, begin)


def _text(content: bytes | memoryview, begin: int, end: int) -> tuple[str, int]:
    """Return a text that follows its length, and its end."""
    first = begin + 4
    last = first + struct.unpack_from("<I", content, begin)[0]
    if last > end:
        raise struct.error("a text ends beyond its record")
    return bytes(content[first:last]).decode("utf-8", "replace"), last


class _File:
    """Schemas, encodings, messages and damage found so far in a file."""

    def __init__(self, content: bytes | memoryview, messages: Messages) -> None:
        self.content = content
        self.messages = messages
        self.first = messages.next_number
        self.schemas: dict[int, tuple[str, str]] = {}  # {number: (name, definition)}
        self.encodings: set[str] = set()
        self.damaged: list[str] = []
        self.meter = Meter("", len(content))

    def add(self, content: bytes | memoryview, records: Records) -> None:
        """Take the schemas, channels, chunks and messages of the file or of a chunk."""
        for opcode, begin, end in records.others:
            try:
                if opcode == SCHEMA:
                    self._add_schema(content, begin, end)
                elif opcode == CHANNEL:
                    self._add_channel(content, begin, end)
                elif opcode == CHUNK and content is self.content:
                    self._add_chunk(content, begin, end)
            except LimitError:
                raise
            except DataError as error:
                self.damaged.append(f"a chunk {error}")
            except struct.error:
                self.damaged.append("a schema or channel does not fit its record")
        self._add_messages(content, records.messages)

    def _add_schema(self, content: bytes | memoryview, begin: int, end: int) -> None:
        name, at = _text(content, begin + 2, end)
        kind, at = _text(content, at, end)
        text = _text(content, at, end)[0] if kind in ("ros1msg", "ros2msg") else ""
        self.schemas[struct.unpack_from("<H", content, begin)[0]] = name, text

    def _add_channel(self, content: bytes | memoryview, begin: int, end: int) -> None:
        number, schema = struct.unpack_from("<HH", content, begin)
        topic, at = _text(content, begin + 4, end)
        encoding, _ = _text(content, at, end)
        self.encodings.add(encoding)
        name, text = self.schemas.get(schema, ("", ""))
        known = RosTopic.of(topic, name, encoding, text)
        # every chunk and the end of the file repeat it
        self.messages.topics.setdefault(self.first + number, known)

    def _add_messages(self, content: bytes | memoryview, places: Ints) -> None:
        begin, end = places[np.diff(places, axis=1)[:, 0] >= MESSAGE_HEAD].T
        if not len(begin):
            return
        raw = np.frombuffer(content, np.uint8)
        head: Any = take(raw, begin, MESSAGE_HEAD).view(
            np.dtype([("channel", "<u2"), ("sequence", "<u4"), ("log", "<i8"), ("publish", "<i8")])
        )
        first = begin + MESSAGE_HEAD
        numbers = head["channel"].astype(np.int64) + self.first
        self.messages.add(raw, numbers, first, end - first, head["log"])

    def _add_chunk(self, content: bytes | memoryview, begin: int, end: int) -> None:
        """Take a chunk. Raises DataError where it is damaged."""
        try:
            size, crc = struct.unpack_from("<QI", content, begin + 16)
            way, at = _text(content, begin + 28, end)
            packed = struct.unpack_from("<Q", content, at)[0]
        except struct.error:
            raise DataError("does not fit its record") from None
        if packed != end - at - 8:
            raise DataError("does not fit its record")
        inner = unpack(content[at + 8 : end], way, size, self.meter)
        if crc and zlib.crc32(inner) != crc:
            raise DataError("fails its checksum")
        self.add(inner, walk(inner, 0))


def read_mcap(content: bytes | memoryview, messages: Messages) -> Messages:
    """Take the messages of a file. Raises a one-line DataError where none is a ROS message."""
    if bytes(content[: len(MAGIC)]) != MAGIC:
        raise DataError(f"is not an MCAP file of version 0: {how_it_begins(content, MAGIC)}")
    records, file = walk(content, len(MAGIC)), _File(content, messages)
    for opcode, begin, end in records.others:
        if opcode == DATA_END and len(records.messages) and end - begin >= 4:
            crc = struct.unpack_from("<I", content, begin)[0]
            if crc and zlib.crc32(content[: begin - 9]) != crc:
                raise DataError("its messages fail the checksum at its end; copy it again")
    file.add(content, records)
    if file.encodings and not file.encodings & {"cdr", "ros1"}:
        raise DataError(
            f"its messages have the encoding {', '.join(sorted(file.encodings))}, not that of ROS (cdr, "
            f"ros1), and cannot be read; record ROS messages, or export a table"
        )
    messages.left += file.damaged
    if bytes(content[records.end :]) != MAGIC:
        messages.left.append(
            f"it was cut short or damaged: {len(content) - records.end} bytes at its end are not a "
            f"complete record; the data before them are used"
        )
    return messages
