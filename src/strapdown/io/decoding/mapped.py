"""The content of a binary file as memory."""

import mmap
from pathlib import Path

from ..tables.table_file import PACKED, read_bytes, reading
from .robots.unpacking import unpack_frames

MOST_RATIO = 1000
"""By which zstd may have packed a file."""


def mapped(path: Path) -> memoryview:
    """The bytes of a file: of a plain one without reading all of it into memory, of a packed one
    unpacked. Raises DataError."""
    if path.suffix.lower() == ".zstd":
        packed = read_bytes(path)
        return memoryview(unpack_frames(packed, MOST_RATIO * len(packed)))
    with reading(path):
        if path.name.lower().endswith(PACKED) or not path.is_file() or not path.stat().st_size:
            return memoryview(read_bytes(path))
        with path.open("rb") as file:
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
