"""PX4's log format ULog, https://docs.px4.io/main/en/dev_log/ulog_file_format.html: topics as
tables, parameters and texts."""

import re
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....checks import DataError
from ....units.wording import count_text
from ..record_walk import Follow, Walked, how_it_begins, structured_records

MAGIC = b"ULog\x01\x12\x35"
HEADER = 16  # bytes: magic, version, time of the start
APPENDED = 1
"""The incompatible flag that this reader supports: data appended at given places."""
KINDS = b"BFIMPQARDLCSO"
TYPES = {
    "int8_t": "i1",
    "uint8_t": "u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "i1",
    "char": "i1",
}
FIELD = re.compile(r"^(\w+)(?:\[(\d{1,5})\])? (\w+)$")
MAX_MESSAGE = 65535  # bytes of a message
DEEPEST = 8  # types within types
Fields = list[tuple[str, str, int]]
"""(name, numpy type, offset in bytes) of each number of a record."""


class UlogTopic(NamedTuple):
    """The topic behind one id of a log's data messages."""

    name: str
    instance: int
    fields: Fields
    sizes: tuple[int, ...]  # possible sizes of its messages in bytes, with the id; () if unknown


class ULog(Walked):
    """A ULog, read in one pass; `columns` decodes a topic on request.

    Raises DataError for other bytes, or for a ULog that needs a newer reader.
    """

    def __init__(self, content: bytes) -> None:
        if content[: len(MAGIC)] != MAGIC or len(content) < HEADER:
            raise DataError(f"is not a ULog: {how_it_begins(content, MAGIC)}")
        super().__init__(content)
        self.start = int.from_bytes(content[8:HEADER], "little")  # us
        self.info: dict[str, str] = {}
        self.dropouts: list[int] = []  # ms
        self._formats: dict[str, str] = {}
        self._topics: dict[int, UlogTopic] = {}
        self._sizes: list[tuple[int, ...] | None] = [None] * (MAX_MESSAGE + 1)
        self._handlers = {
            ord("F"): self._format,
            ord("I"): self._information,
            ord("P"): self._parameter,
            ord("A"): self._subscription,
            ord("O"): self._dropout,
        }
        edges = [HEADER, *self._appended_places(), len(content)]
        for begin, end in zip(edges, edges[1:]):
            self._walk(begin, end)
        self._rows = self._group_records(self._ids, sorted(self._topics))

    def _ids(self, starts: NDArray[np.int64]) -> NDArray[Any]:
        """Return the ids of the data messages that begin at these places."""
        return structured_records(self.data, starts + 3, np.dtype("<u2"))

    @property
    def topics(self) -> dict[tuple[str, int], int]:
        """{(name, instance): messages} of the topics that have any."""
        found: dict[tuple[str, int], int] = {}
        for number, topic in self._topics.items():
            many = len(self._rows.get(number, ())) if topic.fields else 0
            if many:
                key = topic.name, topic.instance
                found[key] = found.get(key, 0) + many
        return dict(sorted(found.items()))

    def columns(self, name: str, instance: int = 0) -> dict[str, NDArray[Any]]:
        """Return the columns of a topic by the names of its fields, such as `gyro_rad[0]`, in file
        order; {} for a missing topic."""
        parts = [
            self._of(number)
            for number, topic in self._topics.items()
            if (topic.name, topic.instance) == (name, instance)
        ]
        parts = [part for part in parts if part and len(part["timestamp"])] or parts[:1]
        if len(parts) < 2:
            return parts[0] if parts else {}
        names = [each for each in parts[0] if all(each in part for part in parts)]
        return {each: np.concatenate([part[each] for part in parts]) for each in names}

    def _of(self, number: int) -> dict[str, NDArray[Any]]:
        fields = self._topics[number].fields
        if not fields or fields[0][0] != "timestamp":
            return {}
        names, kinds, offsets = zip(*fields)
        size = offsets[-1] + np.dtype(kinds[-1]).itemsize
        kind = np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": size})
        found = structured_records(self.data, self._rows[number] + 5, kind)
        return {each: found[each] for each in names}

    def _appended_places(self) -> list[int]:
        """Return the places of appended data from the flags at the beginning. Raises DataError for
        unknown flags."""
        at = HEADER
        if self.content[at + 2 : at + 3] != b"B" or len(self.content) < at + 43:
            return []
        incompatible = self.content[at + 11 : at + 19]
        if incompatible[0] & ~APPENDED or any(incompatible[1:]):
            raise DataError(
                f"is a ULog with the incompatible flags {incompatible.hex()}, which this reader does "
                f"not support; log without them"
            )
        places = struct.unpack("<3Q", self.content[at + 19 : at + 43])
        places = tuple(each for each in places if HEADER < each < len(self.content))
        return sorted(set(places)) if incompatible[0] & APPENDED else []

    def _take_records(self, at: int, end: int) -> int:
        content, sizes, place, handlers = (
            self.content,
            self._sizes,
            self._places.append,
            self._handlers,
        )
        while at + 3 <= end:
            size = content[at] + 256 * content[at + 1]
            after = at + 3 + size
            if after > end:
                return at
            kind = content[at + 2]
            if kind == 68:  # D
                if size < 2:
                    return at
                known = sizes[content[at + 3] + 256 * content[at + 4]]
                if known is not None:
                    if size not in known:
                        return at
                    place(at)
            elif kind in handlers:
                handlers[kind](content[at + 3 : after])
            elif kind not in KINDS or not size:
                return at
            at = after
        return at

    def _is_cut(self, at: int, end: int) -> bool:
        if at + 3 > end:
            return True
        size = self.content[at] + 256 * self.content[at + 1]
        kind = self.content[at + 2]
        if at + 3 + size <= end or kind not in KINDS:
            return False
        if kind != ord("D") or at + 5 > end:
            return True
        known = self._sizes[self.content[at + 3] + 256 * self.content[at + 4]]
        return known is None or size in known

    def _follow(self, end: int) -> Follow:
        """Return a Follow for data of a known size, sync marks, and short texts."""
        data = self.data
        sizes = np.full((MAX_MESSAGE + 1, 2), -1)
        for number, topic in self._topics.items():
            sizes[number, : len(topic.sizes)] = topic.sizes
        plain = np.zeros(256, bool)
        plain[list(b"IMPQALC")] = True

        def follow(at: NDArray[np.int64]) -> NDArray[np.int64]:
            head = data[np.minimum(at[:, None] + np.arange(5), len(data) - 1)].astype(np.int64)
            size, kind = head[:, 0] + 256 * head[:, 1], head[:, 2]
            number = head[:, 3] + 256 * head[:, 4]
            good = (kind == ord("D")) & (sizes[number] == size[:, None]).any(axis=1)
            good |= plain[kind] & (size > 3) & (size < 512)
            good |= ((kind == ord("S")) & (size == 8)) | ((kind == ord("O")) & (size == 2))
            after = at + 3 + size
            return np.where(good & (after <= end), after, -1)

        return follow

    def _format(self, body: bytes) -> None:
        name, _, fields = body.decode("ascii", "replace").partition(":")
        self._formats.setdefault(name, fields)

    def _subscription(self, body: bytes) -> None:
        if len(body) < 4:
            return
        number, name = body[1] + 256 * body[2], body[3:].decode("ascii", "replace")
        if number in self._topics:
            return
        fields: Fields = []
        try:
            whole, logged = self._flat(name, "", 0, fields, 0)
            if len({label for label, _, _ in fields}) < len(fields):
                raise DataError(f"{name} has a field twice")
        except DataError:
            whole = logged = 0
            fields = []
        # padding at the end is not logged
        sizes = tuple({whole + 2, logged + 2}) if fields else ()
        self._topics[number] = UlogTopic(name, body[0], fields, sizes)
        self._sizes[number] = sizes if fields else None

    def _flat(
        self, name: str, prefix: str, begin: int, fields: Fields, depth: int
    ) -> tuple[int, int]:
        """Add the fields of a type that begins at a byte; return its end with and without the
        padding. Raises DataError for an invalid format."""
        if name not in self._formats or depth > DEEPEST:
            raise DataError(f"no format {name}")
        at = logged = begin
        for text in self._formats[name].strip(";").split(";"):
            match = FIELD.match(text)
            if match is None:
                raise DataError(f"no field {text}")
            of, many, field = match[1], match[2], match[3]
            for k in range(int(many or 1)):
                label = f"{prefix}{field}[{k}]" if many else f"{prefix}{field}"
                padding = field.startswith("_padding")
                if of not in TYPES:
                    at, _ = self._flat(of, f"{label}.", at, fields, depth + 1)
                else:
                    if not padding:
                        fields.append((label, TYPES[of], at))
                    at += np.dtype(TYPES[of]).itemsize
                if at > MAX_MESSAGE:
                    raise DataError(f"{name} is too long")
                logged = logged if padding else at
        return at, logged

    def _information(self, body: bytes) -> None:
        kind, key, value = _entry(body)
        if kind.startswith("char"):
            self.info[key] = value.decode("utf-8", "replace").strip("\0")

    def _parameter(self, body: bytes) -> None:
        kind, key, value = _entry(body)
        if len(value) != 4 or kind not in ("int32_t", "float"):
            return
        self._set(key, float(np.frombuffer(value, TYPES[kind])[0]))

    def _dropout(self, body: bytes) -> None:
        if len(body) >= 2:
            self.dropouts.append(body[0] + 256 * body[1])

    @property
    def remarks(self) -> list[str]:
        """Lines on what of the file was lost."""
        lines = []
        if self.dropouts:
            lines.append(
                f"{count_text(len(self.dropouts), 'dropout')} of the logger, {sum(self.dropouts)} ms in "
                f"total: its card was too slow"
            )
        if unknown := sum(not topic.fields for topic in self._topics.values()):
            lines.append(
                f"{count_text(unknown, 'topic')} not read: the format is missing or inconsistent"
            )
        return lines + super().remarks


def _entry(body: bytes) -> tuple[str, str, bytes]:
    """(type, name, value) of an information message or a parameter."""
    length = body[0] if body else 0
    kind, _, key = body[1 : 1 + length].decode("ascii", "replace").partition(" ")
    return kind, key, body[1 + length :]
