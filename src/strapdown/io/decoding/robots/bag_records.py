"""The records of a bag of ROS 1, format 2.0, http://wiki.ros.org/Bags/Format/2.0. They are read
from the beginning without the index, so that a truncated or unindexed bag is read as far as
possible."""

import struct
from typing import Any

import numpy as np

from ....checks import DataError
from ....fileio.limits import LimitError, Meter
from ....typing import Ints
from ..record_walk import how_it_begins
from .packed_chunks import unpack
from .ros_messages import Messages, RosTopic, take

MAGIC = b"#ROSBAG V2.0\n"
OLDER = b"#ROSBAG V1"
MESSAGE, CHUNK, CONNECTION = b"\2", b"\5", b"\7"
HEAD = {b"op": 1, b"conn": 4, b"time": 8}
"""Fields of the header of a message, and their sizes in bytes."""
MIN_HEAD, MAX_HEAD = 34, 255
"""Largest size of such a header in bytes: these fields with their names, and a margin."""
MAX_LAYOUTS = 16
"""Largest number of orders of these fields in headers of one length; a program writes one order."""


def read_bag(content: bytes | memoryview) -> Messages:
    """Return the messages of a bag. Raises a one-line DataError for other files."""
    if bytes(content[: len(MAGIC)]) != MAGIC:
        raise DataError(
            f"is not a bag of ROS 1 in format 2.0: {how_it_begins(content, MAGIC)}"
            + ("; `rosbag migrate` converts format 1.2" if OLDER in bytes(content[:12]) else "")
        )
    messages = Messages()
    end = _add(messages, content, len(MAGIC), Meter("", len(content)))
    if end != len(content):
        messages.left.append(
            f"it was cut short or damaged: {len(content) - end} bytes at its end are not a complete "
            f"record; the data before them are used"
        )
    return messages


def _add(
    messages: Messages,
    content: bytes | memoryview,
    begin: int,
    meter: Meter,
    in_chunk: bool = False,
) -> int:
    """Take the records of a bag or a chunk from `begin` on; return the end of the last complete
    one."""
    places, end = walk(content, begin)
    if not len(places):
        return end
    raw = np.frombuffer(content, np.uint8)
    rows, connections, times = message_heads(raw, places)
    other = np.ones(len(places), bool)
    other[rows] = False
    for first, second, third, last in places[other].tolist():
        header, data = content[first:second], content[third:last]
        try:
            found = _values(header)
            if found.get(b"op") == CONNECTION:
                number = int.from_bytes(found[b"conn"], "little")
                topic = _topic(found[b"topic"], _values(data))
                messages.topics.setdefault(number, topic)  # the end of the bag repeats it
            elif found.get(b"op") == CHUNK and not in_chunk:
                size = int.from_bytes(found[b"size"], "little")
                inner = unpack(data, _text(found[b"compression"]), size, meter)
                if _add(messages, inner, 0, meter, in_chunk=True) != size:
                    raise DataError("has an incomplete record at its end")
        except LimitError:
            raise
        except DataError as error:
            messages.left.append(f"a chunk or record {error}")
        except KeyError as error:
            messages.left.append(f"a record has no field {_text(error.args[0])}")
    begins = places[rows, 2]
    messages.add(raw, connections, begins, places[rows, 3] - begins, times)
    return end


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


def _values(header: bytes | memoryview) -> dict[bytes, bytes]:
    return {name: bytes(header[begin:end]) for name, (begin, end) in fields(header).items()}


def _topic(name: bytes, info: dict[bytes, bytes]) -> RosTopic:
    definition = _text(info.get(b"message_definition", b""))
    return RosTopic.of(_text(name), _text(info[b"type"]), "ros1", definition)


def fields(header: bytes | memoryview) -> dict[bytes, tuple[int, int]]:
    """Return {name: (begin, end) of its value} of the header of a record. Raises DataError."""
    found, at = {}, 0
    while at < len(header):
        if at + 4 > len(header):
            raise DataError("has a header that ends within a field")
        end = at + 4 + struct.unpack_from("<I", header, at)[0]
        name, mark, _ = bytes(header[at + 4 : end]).partition(b"=")
        if end > len(header) or not mark:
            raise DataError("has a header with an invalid field")
        found[name] = at + 5 + len(name), end
        at = end
    return found


def walk(content: bytes | memoryview, begin: int) -> tuple[Ints, int]:
    """Return begin and end of header and data of each complete record (n, 4), and the end of the
    last."""
    found: list[int] = []
    size, length = len(content), struct.Struct("<I").unpack_from
    while begin + 8 <= size:
        header = begin + 4 + length(content, begin)[0]
        if header + 4 > size:
            break
        end = header + 4 + length(content, header)[0]
        if end > size:
            break
        found += (begin + 4, header, header + 4, end)
        begin = end
    return np.array(found, int).reshape(-1, 4), begin


def message_heads(raw: np.ndarray[Any, Any], places: Ints) -> tuple[Ints, Ints, Ints]:
    """(rows of `places` with messages, their connections, their times in ns)."""
    lengths = places[:, 1] - places[:, 0]
    found = [(np.zeros(0, np.int64),) * 3]
    for length in np.unique(lengths[(lengths >= MIN_HEAD) & (lengths <= MAX_HEAD)]).tolist():
        rows = np.flatnonzero(lengths == length)
        heads = take(raw, places[rows, 0], length).view("u1").reshape(-1, length)
        for _ in range(MAX_LAYOUTS):
            if not len(rows):
                break
            alike, which, connections, times = _like_first(heads)
            found.append((rows[which], connections, times))
            rows, heads = rows[~alike], heads[~alike]
    rows, connections, times = (np.concatenate(each) for each in zip(*found))
    return rows, connections, times


def _like_first(heads: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], Ints, Ints, Ints]:
    """Return a mask (n,) of the headers (n, length) with the layout of the first one, and of these
    the rows with messages, their connections and times in ns."""
    none = np.zeros(0, np.int64)
    try:
        layout = fields(heads[0].tobytes())
    except DataError:
        return (heads == heads[0]).all(axis=1), none, none, none
    fixed = np.ones(heads.shape[1], bool)
    for begin, end in layout.values():
        fixed[begin:end] = False
    alike = (heads[:, fixed] == heads[0, fixed]).all(axis=1)
    sizes = {name: end - begin for name, (begin, end) in layout.items()}
    if any(sizes.get(name) != size for name, size in HEAD.items()):
        return alike, none, none, none
    which = np.flatnonzero(alike & (heads[:, layout[b"op"][0]] == MESSAGE[0]))

    def numbers(name: bytes) -> Ints:
        bytes_of = np.ascontiguousarray(heads[which, slice(*layout[name])])
        return bytes_of.view("<u4").astype(np.int64)

    times = numbers(b"time")
    return alike, which, numbers(b"conn")[:, 0], times[:, 0] * 1_000_000_000 + times[:, 1]
