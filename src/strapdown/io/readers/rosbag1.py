"""Bags of ROS 1, format 2.0, http://wiki.ros.org/Bags/Format/2.0: read from their beginning, without
their index, so that one that was cut short or not indexed is read as far as it goes."""

import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import DataError
from ..contract import Log, Reader
from ..table_file import packed

if TYPE_CHECKING:
    from ...typing import Ints
    from ..decoding.ros_messages import Messages

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = 2, 5, 7
HEAD = {"op": 1, "conn": 4, "time": 8}
"""Fields of the header of a message, and their bytes."""
MOST_LAYOUTS = 16
"""Orders of these fields in headers of one length. A program writes one."""


def fields(header: bytes | memoryview) -> dict[bytes, tuple[int, int]]:
    """{name: (begin, end) of its value} of the header of a record. Raises DataError."""
    found, at = {}, 0
    while at < len(header):
        if at + 4 > len(header):
            raise DataError("a header that ends within a field")
        end = at + 4 + struct.unpack_from("<I", header, at)[0]
        name, mark, _ = bytes(header[at + 4 : end]).partition(b"=")
        if end > len(header) or not mark:
            raise DataError("a header without a field that fits")
        found[name] = at + 5 + len(name), end
        at = end
    return found


def walk(content: bytes | memoryview, begin: int) -> tuple["Ints", int]:
    """Where header and data of each whole record begin and end (n, 4), and where the last of them
    ends."""
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


def message_heads(raw: np.ndarray[Any, Any], places: "Ints") -> tuple["Ints", "Ints", "Ints"]:
    """(rows of `places` that are messages, their connections, their times in ns)."""
    from ..decoding.ros_messages import take

    lengths = places[:, 1] - places[:, 0]
    rows, connections, times = [], [], []
    for length in np.unique(lengths[(lengths >= 34) & (lengths < 256)]).tolist():
        left = np.flatnonzero(lengths == length)
        heads = take(raw, places[left, 0], length).view("u1").reshape(-1, length)
        for _ in range(MOST_LAYOUTS):
            if not len(left):
                break
            try:
                layout = fields(heads[0].tobytes())
            except DataError:
                layout = {}
            fixed = np.ones(length, bool)
            for begin, end in layout.values():
                fixed[begin:end] = False
            alike = (heads[:, fixed] == heads[0, fixed]).all(axis=1)
            if all(np.diff(layout.get(name.encode(), (0, 0))) == n for name, n in HEAD.items()):
                at = {name: layout[name.encode()][0] for name in HEAD}
                mine = alike & (heads[:, at["op"]] == MESSAGE)
                some = heads[mine]
                conn = some[:, at["conn"] : at["conn"] + 4].copy().view("<u4")[:, 0]
                time = some[:, at["time"] : at["time"] + 8].copy().view("<u4").astype(np.int64)
                rows.append(left[mine])
                connections.append(conn.astype(np.int64))
                times.append(time[:, 0] * 1_000_000_000 + time[:, 1])
            left, heads = left[~alike], heads[~alike]
    none = np.zeros(0, np.int64)
    return tuple(np.concatenate([none, *each]) for each in (rows, connections, times))  # type: ignore[return-value]


def add(messages: "Messages", content: bytes | memoryview, begin: int, depth: int = 0) -> int:
    """Take in the records from `begin` on, of a bag or of a chunk; the end of the last whole one."""
    from ..decoding.ros_messages import Topic
    from ..decoding.unpacking import unpack

    places, end = walk(content, begin)
    if not len(places):
        return end
    raw = np.frombuffer(content, np.uint8)
    rows, connections, times = message_heads(raw, places)
    other = np.ones(len(places), bool)
    other[rows] = False
    for place in places[other].tolist():
        header, data = content[place[0] : place[1]], content[place[2] : place[3]]
        try:
            found = {name: bytes(header[a:b]) for name, (a, b) in fields(header).items()}
            if found.get(b"op") == bytes([CONNECTION]):
                info = {
                    name: bytes(data[a:b]).decode("utf-8", "replace")
                    for name, (a, b) in fields(data).items()
                }
                number = int.from_bytes(found[b"conn"], "little")
                messages.topics[number] = Topic.of(
                    found[b"topic"].decode("utf-8", "replace"),
                    info[b"type"],
                    "ros1",
                    info.get(b"message_definition", ""),
                )
            elif found.get(b"op") == bytes([CHUNK]) and depth == 0:
                size = int.from_bytes(found[b"size"], "little")
                inner = unpack(data, found[b"compression"].decode("ascii", "replace"), size)
                whole = add(messages, inner, 0, depth + 1)
                if whole != size:
                    raise DataError("has a record at its end that is not whole")
        except DataError as error:
            messages.left.append(f"a chunk or record {error}")
        except KeyError as error:
            messages.left.append(f"a record without its field {error}")
    begins = places[rows, 2]
    messages.add(raw, connections, begins, places[rows, 3] - begins, times)
    return end


def open_rosbag1(path: Path) -> Log:
    """The Log of a bag. Raises DataError."""
    from ..decoding.mapped import mapped
    from ..decoding.robot_sections import log_of
    from ..decoding.ros_messages import Messages

    with mapped(path) as content:
        if bytes(content[: len(MAGIC)]) != MAGIC:
            raise DataError(
                f"{path}: is no bag of ROS 1 of format 2.0: it begins with "
                f"{bytes(content[:12]).decode('ascii', 'replace')!r}; `rosbag migrate` brings one of 1.2 there"
            )
        messages = Messages()
        end = add(messages, content, len(MAGIC))
        if end != len(content):
            messages.left.append(
                f"it was cut short or damaged: {len(content) - end} bytes at its end are no whole "
                f"record; what is before them is used"
            )
        return log_of(path, "bag of ROS 1", messages)


READER = Reader("rosbag1", packed(".bag"), "bag of ROS 1", open=open_rosbag1)
