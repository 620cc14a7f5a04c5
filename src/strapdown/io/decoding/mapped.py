"""The content of a binary file as memory."""

import mmap
from pathlib import Path

from ...file_limits import regular
from ..tables.table_file import PACKED, read_bytes, reading


def mapped(path: Path) -> memoryview:
    """The bytes of a file: of a plain one without reading all of it into memory, of a packed one
    unpacked. Raises DataError."""
    with reading(path):
        plain = regular(path)
        if path.name.lower().endswith(PACKED) or not plain.is_file() or not plain.stat().st_size:
            return memoryview(read_bytes(path))
        with plain.open("rb") as file:
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
