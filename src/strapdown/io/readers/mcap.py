"""Logs of ROS in MCAP files."""

from pathlib import Path

from ..decoding.robots.mcap_records import MAGIC
from ..reader import Log, Reader
from ..tables.table_file import packed_suffixes


def open_mcap(path: Path) -> Log:
    """Return the Log of an MCAP file with messages of ROS 2 (CDR) or ROS 1. Raises DataError."""
    from ..decoding.robots.mcap_records import read_mcap
    from ..decoding.robots.robot_sections import log_of
    from ..decoding.robots.ros_messages import Messages
    from ..tables.table_file import map_file

    return log_of(path, "MCAP file", read_mcap(map_file(path), Messages()))


READER = Reader(
    "mcap", packed_suffixes(".mcap"), "MCAP log of a robot", open=open_mcap, begins=(MAGIC,)
)
