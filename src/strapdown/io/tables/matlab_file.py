"""MATLAB files of version 5 to 7, unpacked within the limits and looked through before they are read: a
matrix may state no more elements than it has bytes.

By "MAT-File Format", The MathWorks,
https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import io
import math
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

from ...checks import DataError
from ...file_limits import PIECE, Meter, check_count
from ...opening import open_file

HEADER, MATRIX, COMPRESSED = 128, 14, 15
CELL, STRUCT, OBJECT, SPARSE = 1, 2, 3, 5
"""Classes of matrices whose elements are matrices, and one whose elements are not all there."""


class Element(NamedTuple):
    """A data element: its type, where its data begin and end, and where the next one begins."""

    kind: int
    begin: int
    end: int
    next: int


def unpacked(path: Path) -> io.BytesIO:
    """The content of a file of version 7 or older with nothing packed in it. Raises OSError, and
    DataError where it is damaged, states more than it holds or is beyond the limits."""
    with open_file(path) as file:
        content = file.read()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None or 0 in content[:4]:  # version 4, in which nothing is packed
        return io.BytesIO(content)
    meter = Meter(path, len(content))
    parts, at = [content[:HEADER]], HEADER
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(order + "II", content, at)
        part = content[at : at + 8 + size]
        part = _inflated(part[8:], meter) if kind == COMPRESSED else part
        _check(part, order, path)
        parts.append(part)
        at += 8 + size
    return io.BytesIO(b"".join(parts))


def _inflated(packed: bytes, meter: Meter) -> bytes:
    pieces, stream = [], zlib.decompressobj()
    try:
        while packed and not stream.eof:
            pieces.append(stream.decompress(packed, PIECE))
            packed = stream.unconsumed_tail
            meter.add(len(pieces[-1]))
    except zlib.error as error:
        raise _damaged(Path(meter.path)) from error
    return b"".join(pieces)


def _damaged(path: Path) -> DataError:
    return DataError(f"{path}: is no whole MATLAB file; save or copy it again")


def _check(content: bytes, order: str, path: Path) -> None:
    """Refuse matrices that are deep in one another, or state more than they hold. Raises
    DataError."""
    try:
        left = [(_element(content, 0, order), 1)]
        while left:
            matrix, depth = left.pop()
            check_count(depth, path, "matrices within matrices", "depth")
            if matrix.kind != MATRIX or matrix.begin == matrix.end:
                continue
            if matrix.end > len(content):
                raise _damaged(path)
            inner = _inner(content, matrix, order)
            _check_count(content, matrix, inner, order, path)
            left += [(each, depth + 1) for each in inner if each.kind == MATRIX]
    except struct.error as error:
        raise _damaged(path) from error


def _inner(content: bytes, matrix: Element, order: str) -> list[Element]:
    found, at = [], matrix.begin
    while at + 8 <= matrix.end:
        found.append(_element(content, at, order))
        at = found[-1].next
    return found


def _element(content: bytes, at: int, order: str) -> Element:
    kind, size = struct.unpack_from(order + "II", content, at)
    if kind >> 16:  # a small one has its data within its tag
        return Element(kind & 0xFFFF, at + 4, at + 4 + min(kind >> 16, 4), at + 8)
    return Element(kind, at + 8, at + 8 + size, at + 8 + size + -size % 8)


def _check_count(
    content: bytes, matrix: Element, inner: list[Element], order: str, path: Path
) -> None:
    """Refuse a matrix of more elements than bytes, or of more matrices than tags."""
    if len(inner) < 2:
        raise _damaged(path)
    flags, dimensions = inner[0].begin, inner[1]
    kind = struct.unpack_from(order + "I", content, flags)[0] & 0xFF
    sizes = struct.unpack_from(
        f"{order}{(dimensions.end - dimensions.begin) // 4}i", content, dimensions.begin
    )
    fields = 1
    if kind in (STRUCT, OBJECT) and len(inner) > 4 + (kind == OBJECT):
        length, names = inner[3 + (kind == OBJECT) : 5 + (kind == OBJECT)]
        longest = struct.unpack_from(order + "i", content, length.begin)[0]
        fields = max(1, (names.end - names.begin) // max(1, longest))
    count = math.prod(sizes) * fields
    least = 8 if kind in (CELL, STRUCT, OBJECT) else 1
    if min(sizes, default=0) < 0 or (
        kind != SPARSE and count > 1 and count * least > matrix.end - matrix.begin
    ):
        raise DataError(
            f"{path}: is no whole MATLAB file (a matrix states {count} elements and has "
            f"{matrix.end - matrix.begin} bytes); save or copy it again"
        )
