"""ULog files by the specification, https://docs.px4.io/main/en/dev_log/ulog_file_format.html,
written without the reader."""

import struct
from pathlib import Path

import numpy as np

NUMPY = {
    "uint64_t": "<u8",
    "int64_t": "<i8",
    "uint32_t": "<u4",
    "int32_t": "<i4",
    "uint16_t": "<u2",
    "uint8_t": "u1",
    "bool": "u1",
    "float": "<f4",
    "double": "<f8",
}
EPOCH = 1_700_000_000_000_000  # us of UTC where the clock of the log is 0


def message(kind, body):
    """A record: its length, kind and body."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def keyed(kind, key, value):
    """A record of a key and its value."""
    return message(kind, bytes([len(key)]) + key.encode() + value)


def parameter(name, value):
    """A record of a parameter: an int as int32_t, a float as float."""
    if isinstance(value, int):
        return keyed("P", f"int32_t {name}", struct.pack("<i", value))
    return keyed("P", f"float {name}", struct.pack("<f", value))


def columns_of(topic):
    """(type, field, (n, k) values) of a topic {field: (type, values)}; k > 1 is an array."""
    for field, (kind, values) in topic.items():
        values = np.asarray(values)
        yield kind, field, values.reshape(len(values), -1)


def declared(name, topic):
    """The format of a topic."""
    fields = [
        f"{kind}{f'[{values.shape[1]}]' if values.shape[1] > 1 else ''} {field}"
        for kind, field, values in columns_of(topic)
    ]
    return message("F", f"{name}:{';'.join(fields)};".encode())


def data_records(number, topic):
    """(n, size) bytes of the data records of a topic."""
    parts = [
        np.ascontiguousarray(values.astype(NUMPY[kind])).view(np.uint8).reshape(len(values), -1)
        for kind, _, values in columns_of(topic)
    ]
    size = 2 + sum(part.shape[1] for part in parts)
    head = np.frombuffer(struct.pack("<HBH", size, ord("D"), number), np.uint8)
    return np.hstack([np.tile(head, (len(parts[0]), 1)), *parts])


def interleaved(blocks, times):
    """The bytes of blocks (n, size) of records in the order of their times."""
    if not blocks:
        return b""
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks])
    order = np.argsort(np.concatenate(times), kind="stable")
    starts = np.empty(len(sizes), np.int64)
    starts[order] = np.cumsum(sizes[order]) - sizes[order]
    written, row = np.empty(int(sizes.sum()), np.uint8), 0
    for block in blocks:
        at = starts[row : row + len(block)]
        written[at[:, None] + np.arange(block.shape[1])] = block
        row += len(block)
    return written.tobytes()


def ulog(topics, parameters=None, start=0, between=b""):
    """The bytes of a ULog of {(name, instance): {field: (type, values)}}, whose first field is
    `timestamp`; `between` are records before the data."""
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", start)
    head += message("B", bytes(40)) + keyed("I", "char[8] ver_hw", b"PX4_SITL")
    for name in dict.fromkeys(name for name, _ in topics):
        head += declared(name, next(topic for key, topic in topics.items() if key[0] == name))
    head += b"".join(parameter(*each) for each in (parameters or {}).items())
    for number, (name, instance) in enumerate(topics):
        head += message("A", struct.pack("<BH", instance, number) + name.encode())
    blocks = [data_records(number, topic) for number, topic in enumerate(topics.values())]
    return head + between + interleaved(blocks, [each["timestamp"][1] for each in topics.values()])


def microseconds(t):
    """Times in s as whole microseconds."""
    return np.round(np.asarray(t) * 1e6).astype(np.int64)


def fixes(position, velocity, later=0.0):
    """The topic `sensor_gps` of a source of positions and one of velocities at the same times,
    stamped `later` s after they were measured."""
    t, degrees = microseconds(position.t), np.degrees(position.y[:, :2])
    one = np.ones(len(t))
    return {
        "timestamp": ("uint64_t", t + round(later * 1e6)),
        "time_utc_usec": ("uint64_t", t + EPOCH),
        "latitude_deg": ("double", degrees[:, 0]),
        "longitude_deg": ("double", degrees[:, 1]),
        "altitude_msl_m": ("double", position.y[:, 2] - 47.0),
        "altitude_ellipsoid_m": ("double", position.y[:, 2]),
        "s_variance_m_s": ("float", velocity.std[:, 0]),
        "eph": ("float", position.std[:, 0]),
        "epv": ("float", position.std[:, 2]),
        "vel_n_m_s": ("float", velocity.y[:, 0]),
        "vel_e_m_s": ("float", velocity.y[:, 1]),
        "vel_d_m_s": ("float", velocity.y[:, 2]),
        "fix_type": ("uint8_t", 3 * one),
        "vel_ned_valid": ("bool", one),
    }


def topics_of(recording, later=0.0):
    """The topics of a recording: `sensor_combined` and, where it has fixes, `sensor_gps`."""
    imu = recording.imu
    topics = {
        ("sensor_combined", 0): {
            "timestamp": ("uint64_t", microseconds(imu.t)),
            "gyro_rad": ("float", imu.dtheta / imu.dt[:, None]),
            "gyro_integral_dt": ("uint32_t", microseconds(imu.dt)),
            "accelerometer_m_s2": ("float", imu.dv / imu.dt[:, None]),
            "accelerometer_integral_dt": ("uint32_t", microseconds(imu.dt)),
        }
    }
    found = {each.kind: each for each in recording.sources}
    if {"position", "velocity"} <= set(found):
        topics["sensor_gps", 0] = fixes(found["position"], found["velocity"], later)
    return topics


def write(path, recording, parameters=None, later=0.0):
    """A PX4 log of a recording at `path`."""
    Path(path).write_bytes(ulog(topics_of(recording, later), parameters))
