"""A checksum behind the content of a binary file: one more line, which readers of HDF5 and NetCDF pass
over. With it a file is known to be whole before anything takes it apart.

It is the CRC-32 of all bytes before it (as of zlib, ISO 3309), which takes 0.4 s a gigabyte.
"""

import re
import zlib
from pathlib import Path

from ..checks import DataError

LINE = b"\nstrapdown CRC-32 of all before this line: %08x\n"
FOUND = re.compile(re.escape(LINE).replace(b"%08x", b"([0-9a-f]{8})"))
LENGTH = len(LINE % 0)
BLOCK = 1 << 22
"""Bytes that are read at once."""
DAMAGED = "it is damaged, or was changed after strapdown wrote it: copy it again or write it again"


def append_checksum(path: Path) -> None:
    """Add the line to a file that is complete. Raises OSError."""
    found = _crc(path, path.stat().st_size)
    with open(path, "ab") as file:
        file.write(LINE % found)


def has_checksum(path: Path) -> bool:
    """Return True where the file has a checksum and it is correct, False where it has none. Raises
    DataError where it is wrong, and OSError."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        file.seek(max(0, size - LENGTH))
        line = FOUND.fullmatch(file.read())
    if line is None:
        return False
    found, said = _crc(path, size - LENGTH), int(line[1], 16)
    if found != said:
        raise DataError(f"{path}: its checksum is {found:08x}, it says {said:08x}; {DAMAGED}")
    return True


def _crc(path: Path, size: int) -> int:
    """CRC-32 of the first `size` bytes."""
    found = 0
    with open(path, "rb") as file:
        while size > 0 and (block := file.read(min(BLOCK, size))):
            found = zlib.crc32(block, found)
            size -= len(block)
    return found
