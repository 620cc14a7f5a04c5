"""Bags of ROS 2: single SQLite databases, or folders with SQLite databases or MCAP files. Source of
the tables: rosbag2_storage_sqlite3 of https://github.com/ros2/rosbag2."""

import re
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...checks import DataError
from ...fileio.file_access import files_of
from ...fileio.limits import regular
from ..reader import Log, Reader
from ..tables.table_file import PACKED, packed_suffixes, read_bytes

if TYPE_CHECKING:
    from ..decoding.robots.ros_messages import Messages

SUFFIXES = packed_suffixes(".db3")
METADATA = "metadata.yaml"
SQLITE, START = b"SQLite format 3\0", 1 << 16
"""First bytes of a database, and number of bytes that contain the names of its tables."""
RECOVER = "sqlite3 FILE.db3 .recover | sqlite3 whole.db3"
"""Command of SQLite's own program for a damaged database."""
MAX_TOPICS = 10_000
AT_ONCE = 5000
"""Messages."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a zstd frame, in a bag whose messages are compressed one by one."""
MAX_UNPACKED = 1 << 16
"""Largest size of a usable compressed message in bytes."""
STEPS = 100_000
"""Steps of SQLite's virtual machine between two checks that it has not made more steps than the
file has bytes. An intact file needs a tenth of these; a damaged one may never end."""

Row = tuple[int, int, bytes]
"""Topic, time of recording in ns, message."""


def sniff(path: Path) -> bool:
    """Return True for a database, by its name or its tables, and for the folder of a bag."""
    if path.name.lower().endswith(SUFFIXES) or (path / METADATA).is_file():
        return True
    try:
        start = read_bytes(path, START)
    except DataError:
        return False
    return start.startswith(SQLITE) and b"CREATE TABLE topics" in start


def _parts(path: Path) -> list[Path]:
    """The files of a bag in the order of their numbers."""
    if not path.is_dir():
        return [path]
    endings = (*SUFFIXES, *packed_suffixes(".mcap"))
    found = [each for each in files_of(path) if each.name.lower().endswith(endings)]
    if not found:
        raise DataError(
            f"{path}: is the folder of a bag but has no .db3 or .mcap file; copy it again"
        )
    return sorted(
        found, key=lambda each: [int(n) for n in re.findall(r"\d+", each.name)] + [each.name]
    )


def _connect(path: Path) -> tuple[sqlite3.Connection, int]:
    """A database, and its size in bytes."""
    if path.name.lower().endswith(PACKED):
        from ..tables.table_file import map_file

        content = map_file(path)
        if not len(content):  # SQLite would report that memory ran out
            raise DataError(f"{path}: is empty; copy it again from the device")
        database = sqlite3.connect(":memory:")
        database.deserialize(content)
        return database, len(content)
    path = regular(path)
    size = path.stat().st_size
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True), size


def read_database(path: Path, messages: "Messages") -> None:
    """Take the messages of a database. Raises DataError."""
    from ..decoding.robots.ros_messages import TRANSFORMS, RosTopic

    try:
        database, size = _connect(path)
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(size, 1000))
        budget = iter(range(10 + size // STEPS))
        database.execute("PRAGMA mmap_size = 1099511627776")
        database.execute("PRAGMA trusted_schema = OFF")
        database.set_progress_handler(lambda: int(next(budget, None) is None), STEPS)
        rows = database.execute("SELECT id, name, type, serialization_format FROM topics")
        numbers = {}
        for number, name, kind, encoding in rows.fetchmany(MAX_TOPICS):
            topic, mine = RosTopic.of(str(name), str(kind), str(encoding)), messages.next_number
            messages.topics[mine] = topic
            if not topic.why_left or topic.type in TRANSFORMS:
                numbers[int(number)] = mine
    except (sqlite3.Error, ValueError, TypeError, OverflowError) as error:
        raise DataError(
            f"{path}: is not a readable database of ROS 2 ({error}); if it was cut short or "
            f"damaged, copy it again, or recover the intact part with `{RECOVER}`"
        ) from error
    try:
        _read_messages(database, size, numbers, messages)
    except (sqlite3.Error, OverflowError) as error:
        messages.left.append(
            f"the database is damaged ({error}); the data before the damage are used, and "
            f"`{RECOVER}` may recover more"
        )
    finally:
        database.close()
    if path.with_name(path.name + "-wal").is_file():
        messages.left.append(
            f"{path.name}-wal holds messages that are not yet in the database; open the bag once "
            f"with `ros2 bag info`"
        )


def _read_messages(
    database: sqlite3.Connection, size: int, numbers: dict[int, int], messages: "Messages"
) -> None:
    rows = database.execute(
        f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN "
        f"({', '.join(map(str, numbers))}) AND typeof(timestamp) = 'integer' AND typeof(data) = 'blob'"
    )
    damaged = 0
    for some in _batches(rows, size):
        if some and some[0][2].startswith(ZSTD):
            good = list(_unpack_rows(some))
            damaged += len(some) - len(good)
            some = good
        if not some:
            continue
        ids, times, data = zip(*some)
        known, which = np.unique(ids, return_inverse=True)
        lengths = np.fromiter(map(len, data), np.int64, len(data))
        messages.add(
            np.frombuffer(b"".join(data), np.uint8),
            np.array([numbers[int(each)] for each in known])[which],
            np.cumsum(lengths) - lengths,
            lengths,
            np.array(times, np.int64),
        )
    if damaged:
        messages.left.append(f"{damaged} compressed messages are damaged and not used")


def _batches(rows: Iterable[Row], size: int) -> Iterator[list[Row]]:
    """Yield the rows in batches. Raises sqlite3.Error where their total length exceeds that of the
    file, `size`."""
    batch: list[Row] = []
    for row in rows:
        size -= len(row[2])
        if size < 0:
            yield batch
            raise sqlite3.DatabaseError("its messages are longer than the file")
        batch.append(row)
        if len(batch) == AT_ONCE:
            yield batch
            batch = []
    yield batch


def _unpack_rows(rows: list[Row]) -> Iterator[Row]:
    """Yield the rows with each message decompressed, without damaged ones."""
    from ..decoding.robots.packed_chunks import unpack_frames

    for number, time, packed_message in rows:
        try:
            yield number, time, unpack_frames(packed_message, MAX_UNPACKED)
        except DataError:
            continue


def messages_of(path: Path) -> "Messages":
    """Return the messages of a database or of the folder of a bag. Raises DataError."""
    from ..decoding.robots.mcap_records import read_mcap
    from ..decoding.robots.ros_messages import Messages
    from ..tables.table_file import map_file

    messages = Messages()
    for part in _parts(path):
        if part.name.lower().endswith(SUFFIXES):
            read_database(part, messages)
        else:
            read_mcap(map_file(part), messages)
    return messages


def open_rosbag2(path: Path) -> Log:
    """The Log of a database or of the folder of a bag. Raises DataError."""
    from ..decoding.robots.robot_sections import log_of

    return log_of(path, "bag of ROS 2", messages_of(path))


READER = Reader(
    "rosbag2", SUFFIXES, "bag of ROS 2, database or folder", sniff=sniff, open=open_rosbag2
)
