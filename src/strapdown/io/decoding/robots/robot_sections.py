"""Sections of a recording from the messages of a robot's log.

Axes and units follow REP 103 and REP 145 (https://ros.org/reps): forward, left, up; SI; an
accelerometer at rest reads +9.8 m/s^2 upwards; fixes in east, north, up.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from ....sensor_models.errors import MAX_NUMBER
from ...reader import Log, Section
from ...tables.table_file import FileTable
from .robot_parts import BASE, Made, Robot
from .robot_sources import barometer, fix, imu, magnetometer, odometry, twist
from .robot_streams import TopicStream, streams_of, unread
from .ros_messages import Columns, Messages
from .ros_transforms import RosFrames

MAKERS: Mapping[str, Callable[[TopicStream, Robot], Made]] = {
    "sensor_msgs/Imu": imu,
    "sensor_msgs/NavSatFix": fix,
    "sensor_msgs/MagneticField": magnetometer,
    "sensor_msgs/FluidPressure": barometer,
    "geometry_msgs/Twist": twist,
    "geometry_msgs/TwistStamped": twist,
    "geometry_msgs/TwistWithCovarianceStamped": twist,
    "nav_msgs/Odometry": odometry,
}


def log_of(path: Path, what: str, messages: Messages) -> Log:
    """Return the Log of a robot's messages; `what` names the container. Raises DataError where none
    of them can be used."""
    streams, left = streams_of(messages)
    robot = Robot(path, frames := RosFrames(messages.transforms), _base(streams, frames))
    tables: dict[str, FileTable] = {}
    sections: list[Section] = []
    counts: Counter[str] = Counter()
    for stream in streams:
        with np.errstate(over="ignore", invalid="ignore"):  # numbers of damaged messages
            made, columns = MAKERS[stream.type](stream, robot)
            left += _without_nonsense(stream.topic, columns)
        name = f"{path} [{stream.topic}]"
        tables[stream.topic] = FileTable.of(
            name, {"stamp": stream.stamp, **columns}, word="message"
        )
        for section in made:
            sections.append(_complete_section(section, stream, counts[section.role]))
            counts[section.role] += 1
    clock = "UTC" if streams[0].absolute else "a clock without a date, as in a simulator"
    return Log(
        tables,
        tuple(_with_receivers(sections, streams)),
        (f"{what}, {clock}", *(each.fact for each in streams)),
        (*left, *_count_lines(messages.left), *unread(messages.topics.values())),
        tuple(_open_questions(sections)),
    )


def _without_nonsense(topic: str, columns: Columns) -> list[str]:
    """Make impossible numbers missing, and return a line on them."""
    wrong = 0
    for name, values in columns.items():
        beyond = np.abs(values) > MAX_NUMBER
        if beyond.any():
            wrong += int(beyond.sum())
            columns[name] = np.where(beyond, np.nan, values)
    return (
        [f"{wrong} numbers beyond {MAX_NUMBER:g} in {topic}: damaged, treated as missing"]
        if wrong
        else []
    )


def _complete_section(section: Section, stream: TopicStream, number: int) -> Section:
    """Return the section with its table, its time and its number."""
    return section._replace(
        keys={**section.keys, "table": stream.topic, "time": stream.time},
        instance=number,
        left=section.left.replace("--imu N", f"--imu {number}"),
        title=f"{stream.topic}, {stream.rate:.4g} Hz{section.title}",
        assumed={**section.assumed, **({"time": stream.remark} if stream.remark else {})},
    )


def _count_lines(lines: list[str]) -> list[str]:
    """Return each line once, with its count."""
    return [f"{line} ({n} times)" if n > 1 else line for line, n in Counter(lines).items()]


def _open_questions(sections: list[Section]) -> list[str]:
    """Return one line on why the first IMU is left out, where all are left out; else []."""
    of_imus = [each for each in sections if each.role == "imu"]
    if not of_imus or any(not each.left for each in of_imus):
        return []
    return [f"{each.keys['table']}: {each.left}" for each in of_imus[:1]]


def _base(streams: list[TopicStream], frames: RosFrames) -> str:
    """Return the frame that is used as the vehicle's: base_link, that of the odometry, or the
    IMU's."""
    imus = [each.frame for each in streams if each.type == "sensor_msgs/Imu"]
    if not imus:
        return "base_link"
    children = [
        each.text("child_frame_id").lstrip("/") for each in streams if "Odometry" in each.type
    ]
    usual = [each for each in [*frames.frame_names(), *children] if BASE.search(each)]
    for candidate in [*usual, *children]:
        if frames.pose(imus[0], candidate) is not None:
            return candidate
    return imus[0]


def _with_receivers(sections: list[Section], streams: list[TopicStream]) -> list[Section]:
    """Return the sections with the velocities of a receiver numbered like its positions. They
    belong together if their topic names begin alike or their frames agree, and if they may be
    used."""
    frames = {each.topic: each.frame for each in streams}
    fixes = [each for each in sections if each.keys.get("kind") == "position"]
    fixes = [each._replace(instance=number) for number, each in enumerate(fixes)]
    numbers = {each.keys["table"]: each.instance for each in fixes}

    def instance(topic: str) -> int:
        if topic in numbers or not fixes:
            return numbers.get(topic, 0)
        return max(
            fixes,
            key=lambda fix: (
                not fix.left,
                _common_parts(topic, fix.keys["table"]),
                frames[fix.keys["table"]] == frames[topic],
                -fix.instance,
            ),
        ).instance

    return [
        each._replace(instance=instance(each.keys["table"])) if each.role == "gnss" else each
        for each in sections
    ]


def _common_parts(one: str, other: str) -> int:
    """Number of common leading parts of two topic names."""
    pairs = zip(one.split("/"), other.split("/"))
    return next((k for k, (a, b) in enumerate(pairs) if a != b), 99)
