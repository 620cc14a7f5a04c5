"""Files packed by zstd (RFC 8878), read as those of gzip and xz are: across frames, and an end within
a frame is an error, which the reader of the package `zstandard` passes over."""

import io
from pathlib import Path
from typing import Any, BinaryIO, cast

PIECE = 1 << 12
"""Packed bytes that are unpacked at a time: blocks of four bytes can become 128 KiB each."""


class ZstdFile(io.RawIOBase):
    """A file, unpacked while it is read. Raises OSError, EOFError and zstandard.ZstdError."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._frame = self._new()
        self._ready = memoryview(b"")

    @staticmethod
    def _new() -> Any:
        import zstandard

        return zstandard.ZstdDecompressor().decompressobj()

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, into: Any) -> int:
        """Fill `into` as far as there is something, and how many bytes that are; 0 at the end."""
        while not self._ready:
            at_end = self._frame.eof
            packed = (self._frame.unused_data if at_end else b"") or self._file.read(PIECE)
            if not packed:
                if at_end:
                    return 0
                raise EOFError("it ends within a frame of zstd")
            if at_end:
                self._frame = self._new()
            self._ready = memoryview(self._frame.decompress(packed))
        count = min(len(into), len(self._ready))
        into[:count], self._ready = self._ready[:count], self._ready[count:]
        return count

    def close(self) -> None:
        """Close the file too."""
        self._file.close()
        super().close()


def unpacking(file: BinaryIO) -> BinaryIO:
    """What an open file packed by zstd holds, to read."""
    return cast(BinaryIO, io.BufferedReader(ZstdFile(file), 1 << 20))


def open_zstd(path: Path, mode: str = "rb") -> BinaryIO:
    """A file packed by zstd, open to read."""
    return unpacking(path.open("rb"))
