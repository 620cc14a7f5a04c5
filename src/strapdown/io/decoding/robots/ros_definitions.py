"""The messages of ROS that are read, as their definitions have them, and the places of their fields
in bytes.

Sources: the packages std_msgs, geometry_msgs, sensor_msgs and nav_msgs of ROS 1 and 2;
https://wiki.ros.org/msg for the serialisation of ROS 1, which has no gaps; OMG DDSI-RTPS 10.2 for
CDR, that of ROS 2, where a number of n bytes stands at a multiple of n.
"""

import re
from collections.abc import Iterator

from ....checks import DataError

NUMBERS = {
    "int8": "i1",
    "uint8": "u1",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float64": "f8",
}
VECTORS = {"Vector3": 3, "Point": 3, "Quaternion": 4}
"""Parts that are this many float64 in a row: x, y, z, w."""
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
"""Name with the parts that it is of, as "twist.linear"; numpy's code or "string"; how many."""


def _members(definition: str) -> list[tuple[str, int, str]]:
    """(type without its package, how many of a fixed array or 1, name) of each member."""
    found = []
    for member in definition.split(","):
        whole = re.fullmatch(r"\s*(?:\w+/)*(\w+)(?:\[(\d+)\])?\s+(\w+)\s*", member)
        if whole is None:
            raise DataError(f"{member.strip()[:60]!r} is none of its members")
        found.append((whole[1], int(whole[2] or 1), whole[3]))
    return found


def fields_of(message: str, encoding: str) -> list[Field]:
    """The fields of a message in the order of their bytes; encoding "ros1" or "cdr"."""
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
    """Whether the text of a definition, in the format of .msg files, has the members of the message
    of this type that is read. Another text, of none or of an .idl file, tells nothing: True."""
    top = re.split(r"^=+$", text, maxsplit=1, flags=re.MULTILINE)[0]
    lines = (line.split("#")[0].strip() for line in top.splitlines())
    members = [line for line in lines if line and "=" not in line]
    if not members or "module " in top:
        return True
    try:
        return _members(",".join(members)) == _members(MESSAGES[message])
    except DataError:
        return False
