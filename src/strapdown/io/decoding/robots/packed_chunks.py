"""Compressed chunks of a log."""

import bz2
import io
from typing import IO, cast

from ....checks import DataError
from ....extras import optional_import
from ....fileio.limits import Meter
from ...tables.table_file import zstd

PIECE = 1 << 20
"""Bytes that are decompressed at a time, so that an incorrect size costs no memory."""


def _open_packed(packed: bytes, way: str) -> IO[bytes]:
    if way == "bz2":
        return bz2.open(io.BytesIO(packed))
    if way == "lz4":
        with optional_import():
            import lz4.frame

        return cast(IO[bytes], lz4.frame.open(io.BytesIO(packed)))
    return cast(IO[bytes], zstd().open(io.BytesIO(packed)))


def unpack(packed: bytes | memoryview, way: str, size: int, meter: Meter) -> bytes:
    """Decompress `size` bytes with the method `way`: "lz4" (frames), "zstd", "bz2", or "" and
    "none" for plain bytes. `meter` counts them. Raises DataError where they are damaged or have
    another size."""
    if way in ("", "none"):
        unpacked = bytes(packed)
    elif way not in ("lz4", "zstd", "bz2"):
        raise DataError(f"is compressed with {way!r:.20}; only lz4, zstd, bz2 and none can be read")
    else:
        pieces, left = [], size + 1
        try:
            with _open_packed(bytes(packed), way) as file:
                while left > 0 and (piece := file.read(min(PIECE, left))):
                    meter.add(len(piece))
                    pieces.append(piece)
                    left -= len(piece)
        except DataError:
            raise
        except Exception as error:  # each package has errors of its own
            raise DataError(f"is damaged ({type(error).__name__})") from error
        unpacked = b"".join(pieces)
    if len(unpacked) != size:
        raise DataError("has another size when decompressed than it states")
    return unpacked


def unpack_frames(packed: bytes, most: int) -> bytes:
    """Decompress consecutive zstd frames to at most `most` bytes. Raises DataError."""
    try:
        with _open_packed(packed, "zstd") as file:
            unpacked = file.read(most + 1)
    except (EOFError, zstd().ZstdError) as error:
        raise DataError(f"is damaged ({str(error):.60})") from error
    if len(unpacked) > most:
        raise DataError(f"decompresses to more than {most} bytes")
    return unpacked
