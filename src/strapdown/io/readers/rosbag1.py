"""Bags of ROS 1."""

from pathlib import Path

from ..decoding.robots.bag_records import MAGIC
from ..reader import Log, Reader
from ..tables.table_file import packed_suffixes


def open_rosbag1(path: Path) -> Log:
    """The Log of a bag. Raises DataError."""
    from ..decoding.robots.bag_records import read_bag
    from ..decoding.robots.robot_sections import log_of
    from ..tables.table_file import map_file

    return log_of(path, "bag of ROS 1", read_bag(map_file(path)))


READER = Reader(
    "rosbag1", packed_suffixes(".bag"), "bag of ROS 1", open=open_rosbag1, begins=(MAGIC,)
)
