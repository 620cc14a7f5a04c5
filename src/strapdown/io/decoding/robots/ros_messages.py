"""Messages of ROS, many at a time: collected from chunks by topic and length, then viewed as arrays
of the fields in their definitions.

Sources: the packages std_msgs, geometry_msgs, sensor_msgs and nav_msgs of ROS 1 and 2;
https://wiki.ros.org/msg for the serialisation of ROS 1, which has no gaps; OMG DDSI-RTPS 10.2 for
CDR, that of ROS 2, where a number of n bytes is aligned to a multiple of n.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ....checks import DataError
from ....typing import Ints

NUMBERS = {
    "int8": "i1",
    "uint8": "u1",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float64": "f8",
}
VECTORS = {"Vector3": 3, "Point": 3, "Quaternion": 4}
"""Parts that consist of so many consecutive float64: x, y, z, w."""
PARTS = {
    "NavSatStatus": "int8 status, uint16 service",
    "Twist": "Vector3 linear, Vector3 angular",
    "TwistWithCovariance": "Twist twist, float64[36] covariance",
    "Pose": "Point position, Quaternion orientation",
    "PoseWithCovariance": "Pose pose, float64[36] covariance",
}
HEADERS = {
    "ros1": "uint32 seq, uint32 sec, uint32 nanosec, string frame_id",
    "cdr": "int32 sec, uint32 nanosec, string frame_id",
}
"""std_msgs/Header by encoding, with the parts of its stamp."""
MESSAGES = {
    "sensor_msgs/Imu": "Header header, Quaternion orientation, float64[9] orientation_covariance, "
    "Vector3 angular_velocity, float64[9] angular_velocity_covariance, "
    "Vector3 linear_acceleration, float64[9] linear_acceleration_covariance",
    "sensor_msgs/NavSatFix": "Header header, NavSatStatus status, float64 latitude, "
    "float64 longitude, float64 altitude, float64[9] position_covariance, "
    "uint8 position_covariance_type",
    "sensor_msgs/MagneticField": "Header header, Vector3 magnetic_field, "
    "float64[9] magnetic_field_covariance",
    "sensor_msgs/FluidPressure": "Header header, float64 fluid_pressure, float64 variance",
    "geometry_msgs/Twist": PARTS["Twist"],
    "geometry_msgs/TwistStamped": "Header header, Twist twist",
    "geometry_msgs/TwistWithCovarianceStamped": "Header header, TwistWithCovariance twist",
    "nav_msgs/Odometry": "Header header, string child_frame_id, PoseWithCovariance pose, "
    "TwistWithCovariance twist",
}
"""The messages that are read, by type."""

Field = tuple[str, str, int]
"""Name with its parents, as "twist.linear"; numpy's code or "string"; number of elements."""


def _members(definition: str) -> list[tuple[str, int, str]]:
    """(type without its package, how many of a fixed array or 1, name) of each member."""
    found = []
    for member in definition.split(","):
        whole = re.fullmatch(r"\s*(?:\w+/)*(\w+)(?:\[(\d+)\])?\s+(\w+)\s*", member)
        if whole is None:
            raise DataError(f"{member.strip()[:60]!r} is not one of its members")
        found.append((whole[1], int(whole[2] or 1), whole[3]))
    return found


def fields_of(message: str, encoding: str) -> list[Field]:
    """Return the fields of a message in byte order; encoding "ros1" or "cdr"."""
    return list(_fields(MESSAGES[message], encoding, ""))


def _fields(definition: str, encoding: str, prefix: str) -> Iterator[Field]:
    for kind, many, name in _members(definition):
        if kind in VECTORS:
            yield prefix + name, "f8", VECTORS[kind]
        elif kind == "Header":
            yield from _fields(HEADERS[encoding], encoding, "")
        elif kind in PARTS:
            yield from _fields(PARTS[kind], encoding, f"{prefix}{name}.")
        else:
            yield prefix + name, NUMBERS.get(kind, kind), many


def is_known(message: str, text: str) -> bool:
    """Return True where a definition in the format of .msg files has the members of `message` that
    are read here, and for any other text (empty, or of an .idl file), which proves nothing."""
    top = re.split(r"^=+$", text, maxsplit=1, flags=re.MULTILINE)[0]
    lines = (line.split("#")[0].strip() for line in top.splitlines())
    members = [line for line in lines if line and "=" not in line]
    if not members or "module " in top:
        return True
    try:
        return _members(",".join(members)) == _members(MESSAGES[message])
    except DataError:
        return False


Columns = dict[str, np.ndarray[Any, Any]]
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")
MAX_TRANSFORMS = 1000
"""Number of messages with transforms that are read of each topic; mountings do not change."""
ALIGNED = {"ros1": False, "cdr": True}


class RosTopic(NamedTuple):
    """A topic of a log, or what one node publishes there."""

    name: str
    type: str  # as "sensor_msgs/Imu", also of ROS 2
    encoding: str  # "ros1" or "cdr"; another one is not read
    definition: str = ""

    @classmethod
    def of(cls, name: str, kind: str, encoding: str, definition: str = "") -> "RosTopic":
        """Return the topic from the names in a log; "sensor_msgs/msg/Imu" is the form of ROS 2."""
        return cls(name, kind.replace("/msg/", "/"), encoding, definition)

    @property
    def why_left(self) -> str:
        """Reason why its messages are not decoded; "" where they are."""
        if self.encoding not in ALIGNED:
            return f"its messages are {self.encoding or 'of unknown encoding'}, not of ROS"
        if self.type not in MESSAGES:
            return "messages of this type are not read"
        if not is_known(self.type, self.definition):
            return "its definition differs from that of ROS"
        return ""


class Decoded(NamedTuple):
    """Messages of a topic in order of recording."""

    record: Ints  # (n,) ns, time of recording
    columns: Columns  # by the names of MESSAGES, (n,) or (n, k); strings as bytes
    wrong: int  # messages that do not fit the definition and are not used


def take(content: np.ndarray[Any, Any], offsets: Ints, length: int) -> np.ndarray[Any, Any]:
    """Return pieces (n,) of `length` bytes of an array at these offsets, which must fit in."""
    every = np.ndarray(len(content) - length + 1, f"V{length}", content, strides=(1,))
    return every[offsets]


class Messages:
    """Content of a log: topics by the log's own numbers, messages of the topics that are read, and
    lines on unusable content."""

    def __init__(self) -> None:
        self.topics: dict[int, RosTopic] = {}
        self.transforms: list[tuple[RosTopic, bytes]] = []
        self.left: list[str] = []
        self._found: dict[int, dict[int, list[tuple[np.ndarray[Any, Any], Ints]]]] = {}
        self._looked: dict[int, int] = {}

    @property
    def next_number(self) -> int:
        """Return a number above those of all topics."""
        return max(self.topics, default=-1) + 1

    def add(
        self,
        content: np.ndarray[Any, Any],
        numbers: Ints,
        offsets: Ints,
        lengths: Ints,
        record: Ints,
    ) -> None:
        """Take messages (n,) in `content`, given the numbers of their topics, their beginnings,
        lengths and times."""
        for number in np.unique(numbers).tolist():
            topic = self.topics.get(number)
            if topic is None or (topic.why_left and topic.type not in TRANSFORMS):
                continue
            mine = np.flatnonzero(numbers == number)
            if topic.type in TRANSFORMS:
                self._look(number, topic, content, offsets[mine], lengths[mine])
                continue
            found = self._found.setdefault(number, {})
            for length in np.unique(lengths[mine]).tolist():
                alike = mine[lengths[mine] == length]
                found.setdefault(length, []).append(
                    (take(content, offsets[alike], length), record[alike])
                )

    def _look(
        self,
        number: int,
        topic: RosTopic,
        content: np.ndarray[Any, Any],
        offsets: Ints,
        lengths: Ints,
    ) -> None:
        seen = self._looked.get(number, 0)
        if topic.encoding not in ALIGNED or seen >= MAX_TRANSFORMS:
            return
        for offset, length in zip(offsets.tolist(), lengths.tolist()):
            self.transforms.append((topic, content[offset : offset + length].tobytes()))
        self._looked[number] = seen + len(offsets)

    def decode(self) -> Iterator[tuple[RosTopic, Decoded]]:
        """Yield the messages of each topic by name, those of several nodes together."""
        by_topic: dict[tuple[str, str, str], list[int]] = {}
        for number in self._found:
            topic = self.topics[number]
            by_topic.setdefault((topic.name, topic.type, topic.encoding), []).append(number)
        for _, numbers in sorted(by_topic.items()):
            topic = self.topics[numbers[0]]
            fields = fields_of(topic.type, topic.encoding)
            pieces, wrong = [], 0
            for number in numbers:
                for length, found in self._found.pop(number).items():
                    payload = np.concatenate([each for each, _ in found])
                    record = np.concatenate([each for _, each in found])
                    found.clear()
                    good = list(_decode(payload, length, fields, topic.encoding))
                    pieces += [(record[rows], columns) for rows, columns in good]
                    wrong += len(payload) - sum(len(rows) for rows, _ in good)
            yield topic, _join_pieces(pieces, wrong)


def _join_pieces(pieces: list[tuple[Ints, Columns]], wrong: int) -> Decoded:
    if not pieces:
        return Decoded(np.zeros(0, int), {}, wrong)
    record, columns = pieces[0]
    if len(pieces) > 1:
        record = np.concatenate([each for each, _ in pieces])
        columns = {name: np.concatenate([each[name] for _, each in pieces]) for name in columns}
    if np.any(np.diff(record) < 0):
        order = np.argsort(record, kind="stable")
        record, columns = record[order], {name: each[order] for name, each in columns.items()}
    return Decoded(record, columns, wrong)


def _decode(
    payload: np.ndarray[Any, Any], length: int, fields: list[Field], encoding: str
) -> Iterator[tuple[Ints, Columns]]:
    """(rows, their columns) of messages of one length, those of one layout at a time."""
    raw = payload.view("u1").reshape(len(payload), length)
    if not ALIGNED[encoding]:
        yield from _layouts(payload, raw, np.arange(len(raw)), fields, "<", 0, encoding)
    elif length >= 4:
        # CDR begins with 0, 0 (big endian) or 0, 1 (little endian) and two bytes of options
        for order, mark in ((">", 0), ("<", 1)):
            rows = np.flatnonzero((raw[:, 0] == 0) & (raw[:, 1] == mark))
            if len(rows):
                yield from _layouts(payload, raw, rows, fields, order, 4, encoding)


def _layouts(
    payload: np.ndarray[Any, Any],
    raw: np.ndarray[Any, Any],
    rows: Ints,
    fields: list[Field],
    order: str,
    begin: int,
    encoding: str,
) -> Iterator[tuple[Ints, Columns]]:
    """As `_decode`. A text of another length shifts the fields behind it, so its rows form a group
    of their own."""
    length, aligned = raw.shape[1], ALIGNED[encoding]
    todo: list[tuple[Ints, int, int, dict[str, tuple[str, int]]]] = [(rows, 0, begin, {})]
    while todo:
        rows, number, at, layout = todo.pop()
        if number == len(fields):
            # CDR may be padded by up to four bytes
            if length - (3 if aligned else 0) <= at <= length:
                yield rows, _view(payload if len(rows) == len(payload) else payload[rows], layout)
            continue
        name, code, many = fields[number]
        size = 4 if code == "string" else int(code[1])
        at += -(at - begin) % size if aligned else 0
        if code != "string":
            kind = f"{order}{code}" if many == 1 else f"({many},){order}{code}"
            todo.append((rows, number + 1, at + size * many, {**layout, name: (kind, at)}))
            continue
        if at + 4 > length:
            continue
        texts = np.ascontiguousarray(raw[rows, at : at + 4]).view(f"{order}u4")[:, 0]
        for text in np.unique(texts[texts <= length - at - 4]).tolist():
            place = {**layout, name: (f"S{text}" if text else "", at + 4)}
            todo.append((rows[texts == text], number + 1, at + 4 + text, place))


def _view(payload: np.ndarray[Any, Any], layout: Mapping[str, tuple[str, int]]) -> Columns:
    filled = {name: place for name, place in layout.items() if place[0]}
    whole = np.dtype(
        {
            "names": list(filled),
            "formats": [code for code, _ in filled.values()],
            "offsets": [at for _, at in filled.values()],
            "itemsize": payload.dtype.itemsize,
        }
    )
    seen = payload.view(whole)
    return {name: seen[name] if name in filled else np.zeros(len(payload), "S1") for name in layout}
