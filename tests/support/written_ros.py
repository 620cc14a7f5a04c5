"""Logs of a robot for the tests of their readers: messages of ROS 1 and 2 by their serialisations,
whole topics at a time, put into bags and MCAP files by other people's writers."""

from functools import cache
from typing import NamedTuple

import numpy as np

START = 1_714_550_400_000_000_000  # 2024-05-01T08:00:00Z, POSIX ns
FLU = np.array([1.0, -1.0, -1.0])


class Written(NamedTuple):
    """A topic with its messages."""

    name: str
    type: str  # as "sensor_msgs/msg/Imu"
    payloads: list[bytes]
    times: np.ndarray  # (n,) ns, of recording


def serialised(encoding, parts, order="<"):
    """Messages (n of them) of the parts in their order: a text, which all share, or an array (n,)
    or (n, k) of numbers; encoding "ros1" (no gaps) or "cdr" (numbers at multiples of their size,
    texts end in a zero)."""
    cdr = encoding == "cdr"
    n = next(len(part) for part in parts if not isinstance(part, (str, bytes)))
    names, formats, offsets, values, at = [], [], [], [], 0

    def put(value, code, size, many=1):
        nonlocal at
        at += -at % size if cdr else 0
        names.append(f"f{len(names)}")
        formats.append((code, (many,)) if many > 1 else code)
        offsets.append(at + (4 if cdr else 0))
        values.append(value)
        at += size * many

    for part in parts:
        if isinstance(part, str):
            text = part.encode() + (b"\0" if cdr else b"")
            put(len(text), f"{order}u4", 4)
            if text:
                put(text, f"S{len(text)}", 1)
                at += len(text) - 1
        else:
            part = np.asarray(part)
            many = part.shape[1] if part.ndim == 2 else 1
            put(part, part.dtype.newbyteorder(order), part.dtype.itemsize, many)
    head = 4 if cdr else 0
    layout = {"names": names, "formats": formats, "offsets": offsets, "itemsize": at + head}
    rows = np.zeros(n, np.dtype(layout))
    for name, value in zip(names, values):
        rows[name] = value
    raw = rows.view("u1").reshape(n, -1)
    if cdr:
        raw[:, 1] = order == "<"
    return [row.tobytes() for row in raw]


def header(encoding, stamps, frame):
    """Parts of a std_msgs/Header; `stamps` (n,) ns."""
    first = [np.arange(len(stamps), dtype="u4")] if encoding == "ros1" else []
    seconds = (stamps // 10**9).astype("u4" if encoding == "ros1" else "i4")
    return [*first, seconds, (stamps % 10**9).astype("u4"), frame]


def diagonal(n, variances, size=3):
    """(n, size * size) covariances."""
    matrix = np.zeros((n, size * size))
    matrix[:, :: size + 1] = variances
    return matrix


def imu(encoding, stamps, gyro, accel, frame="imu_link", q=None, covariance=0.0, order="<"):
    n = len(stamps)
    unknown = np.zeros((n, 9))
    unknown[:, 0] = -1.0
    orientation = [np.zeros((n, 4)), unknown] if q is None else [q, diagonal(n, 1e-4)]
    parts = [*orientation, gyro, diagonal(n, covariance), accel, diagonal(n, covariance)]
    return serialised(encoding, [*header(encoding, stamps, frame), *parts], order)


def fixes(encoding, stamps, lla, std=None, status=0, frame="gps", order="<"):
    """`lla` (n, 3) in deg and m; `std` (n, 3) east, north, up."""
    n = len(stamps)
    covariance = np.zeros((n, 9)) if std is None else diagonal(n, np.square(std))
    state = np.broadcast_to(np.asarray(status, "i1"), n)
    kind = np.full(n, 0 if std is None else 2, "u1")
    parts = [state, np.ones(n, "u2"), *lla.T, covariance, kind]
    return serialised(encoding, [*header(encoding, stamps, frame), *parts], order)


def twist(encoding, stamps, linear, frame="gps", variance=None, angular=None):
    """geometry_msgs/TwistStamped; with a variance TwistWithCovarianceStamped."""
    n = len(stamps)
    angular = np.zeros((n, 3)) if angular is None else angular
    more = [] if variance is None else [diagonal(n, variance, 6)]
    return serialised(encoding, [*header(encoding, stamps, frame), linear, angular, *more])


def bare_twist(encoding, linear):
    return serialised(encoding, [linear, np.zeros_like(linear)])


def odometry(encoding, stamps, speed, child="base_link", variance=1e-3):
    n = len(stamps)
    pose = [np.zeros((n, 3)), np.tile([0.0, 0, 0, 1], (n, 1)), np.zeros((n, 36))]
    linear = np.c_[speed, np.zeros((n, 2))]
    motion = [linear, np.zeros((n, 3)), diagonal(n, variance, 6)]
    return serialised(encoding, [*header(encoding, stamps, "odom"), child, *pose, *motion])


def field(encoding, stamps, values, frame="imu_link"):
    parts = [values, np.zeros((len(stamps), 9))]
    return serialised(encoding, [*header(encoding, stamps, frame), *parts])


def pressure(encoding, stamps, values):
    return serialised(encoding, [*header(encoding, stamps, "baro"), values, np.zeros(len(stamps))])


def transform(encoding, parent, child, translation, q, stamp=START):
    """One tf2_msgs/TFMessage of one transform; q is x, y, z, w."""
    stamps = np.array([stamp])
    parts = [*header(encoding, stamps, parent), child, np.array([translation]), np.array([q])]
    return serialised(encoding, [np.array([1], "u4"), *parts])[0]


def merged(topics):
    """(number of the topic, time, payload) of all messages by time."""
    times = np.concatenate([np.zeros(0, int), *(topic.times for topic in topics)])
    counts = np.array([len(topic.payloads) for topic in topics], int)
    numbers = np.repeat(np.arange(len(topics)), counts)
    payloads = [payload for topic in topics for payload in topic.payloads]
    order = np.argsort(times, kind="stable")
    return [(int(numbers[k]), int(times[k]), payloads[k]) for k in order]


@cache
def types(encoding):
    """The types that rosbags knows."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)


def definition(encoding, name):
    return types(encoding).generate_msgdef(
        name, **({} if encoding == "ros1" else {"ros_version": 2})
    )[0]


def _defined(kind):
    """rosbags knows no transforms of ROS 1."""
    if "TFMessage" in kind:
        text = "geometry_msgs/TransformStamped[] transforms\n"
        return {"msgdef": text, "md5sum": "94810edda583a504dfda3829e70d7eec"}
    return {"typestore": types("ros1")}


def write_bag(path, topics, compression=None):
    """A bag of ROS 1; compression None, "lz4" or "bz2"."""
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:
        open_ = [
            writer.add_connection(topic.name, topic.type, **_defined(topic.type))
            for topic in topics
        ]
        for number, time, payload in merged(topics):
            writer.write(open_[number], time, payload)
    return path


def write_bag2(folder, topics, storage="sqlite3", compression=None):
    """The folder of a bag of ROS 2; compression None, "message" or "file"."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    writer = Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        open_ = [
            writer.add_connection(topic.name, topic.type, typestore=types("cdr"))
            for topic in topics
        ]
        for number, time, payload in merged(topics):
            writer.write(open_[number], time, payload)
    return folder


def write_mcap(path, topics, compression="zstd", encoding="cdr", **options):
    """An MCAP file; compression "zstd", "lz4" or "none"."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType[compression.upper()], **options)
        writer.start("ros2" if encoding == "cdr" else "ros1", "test")
        channels = []
        for topic in topics:
            name = topic.type if encoding == "cdr" else topic.type.replace("/msg/", "/")
            kind = "ros2msg" if encoding == "cdr" else "ros1msg"
            schema = writer.register_schema(name, kind, definition(encoding, topic.type).encode())
            channels.append(writer.register_channel(topic.name, encoding, schema))
        for number, time, payload in merged(topics):
            writer.add_message(channels[number], time, payload, time)
        writer.finish()
    return path


def drive(encoding, recording, frame="imu_link"):
    """Topics of a simulated recording: IMU, fixes, velocities of the receiver."""
    stamps = START + np.round(recording.imu.t * 1e9).astype(np.int64)
    gyro = recording.imu.dtheta / recording.imu.dt[:, None] * FLU
    accel = recording.imu.dv / recording.imu.dt[:, None] * FLU
    topics = [
        Written(
            "/imu/data", "sensor_msgs/msg/Imu", imu(encoding, stamps, gyro, accel, frame), stamps
        )
    ]
    for source in recording.sources:
        at = START + np.round(source.t * 1e9).astype(np.int64)
        if source.kind == "position":
            lla = np.c_[np.degrees(source.y[:, :2]), source.y[:, 2]]
            kind, rows = (
                "sensor_msgs/msg/NavSatFix",
                fixes(encoding, at, lla, source.std[:, [1, 0, 2]]),
            )
            topics.append(Written("/gps/fix", kind, rows, at + 60_000_000))
        if source.kind == "velocity":
            kind = "geometry_msgs/msg/TwistWithCovarianceStamped"
            variance = np.r_[source.std[0, [1, 0, 2]] ** 2, 0.0, 0.0, 0.0]
            rows = twist(encoding, at, source.y[:, [1, 0, 2]] * [1, 1, -1], variance=variance)
            topics.append(Written("/gps/vel", kind, rows, at + 60_000_000))
    return topics
