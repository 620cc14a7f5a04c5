"""MATLAB files of version 4 to 7: their arrays of numbers and structs, decompressed within the
limits. The stated size of a matrix is compared with its bytes before an array is made.

Source: "MAT-File Format", The MathWorks,
https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import math
import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...fileio.file_access import open_file
from ...fileio.limits import PIECE, Meter, check_count

HEADER, MATRIX, COMPRESSED = 128, 14, 15
STRUCT, DOUBLE, UINT64 = 2, 6, 15
"""Classes of matrices: structs, and the first and last class of numbers."""
COMPLEX = 0x0800
"""Flag of a matrix with a second array."""
RANK = 32
"""Largest number of dimensions of a matrix."""
STORED = dict(zip((1, 2, 3, 4, 5, 6, 7, 9, 12, 13), "i1 u1 i2 u2 i4 u4 f4 f8 i8 u8".split()))
"""NumPy type of the numbers in an element of each type."""
STORED_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
"""The same of version 4."""


class MatlabPart(NamedTuple):
    """Bytes, and the byte order of their numbers."""

    content: bytes
    order: str  # of `struct` and NumPy
    path: Path

    def numbers(self, kind: str, at: int) -> tuple[int, ...]:
        """Return the numbers, in `struct` notation, that begin at a byte."""
        return struct.unpack_from(self.order + kind, self.content, at)


class Element(NamedTuple):
    """A data element: its type, the beginning and end of its data, and the beginning of the next
    one."""

    kind: int
    begin: int
    end: int
    next: int


def variables(path: Path) -> dict[str, Any]:
    """Return {name: array} of the real numbers in a file of version 7 or older, with {field: array}
    for a struct; other content is left out. Raises OSError, and DataError for a file that is
    damaged, states more than it holds or exceeds the limits."""
    with open_file(path) as file:
        content = file.read()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    try:
        if 0 in content[:4]:
            return dict(_of_version_4(content, path))
        if order is None:
            raise _damage_error(path, "its header has no version")
        return dict(_of_version_5(MatlabPart(content, order, path)))
    except struct.error as error:
        raise _damage_error(path, "it ends within a matrix") from error


def _damage_error(path: Path, why: str) -> DataError:
    return DataError(f"{path}: is not a complete MATLAB file ({why}); save or copy it again")


def _array(part: MatlabPart, kind: str, at: int, sizes: tuple[int, ...], end: int) -> Any:
    """Return the array of that type and shape in the bytes from `at` to `end`."""
    count, end = math.prod(sizes), min(end, len(part.content))
    if min(sizes) < 0 or count * int(kind[1]) > end - at:
        raise _damage_error(
            part.path, f"a matrix states {count} elements, but has {max(0, end - at)} bytes"
        )
    if not count:
        return np.empty(0)
    found = np.frombuffer(part.content, part.order + kind, count, at)
    return found.reshape(sizes, order="F").squeeze().astype(kind)


def _of_version_4(content: bytes, path: Path) -> Iterator[tuple[str, Any]]:
    at = 0
    while at < len(content):
        part = MatlabPart(content, "<", path)
        if not 0 <= part.numbers("i", at)[0] < 1000:
            part = part._replace(order=">")
        said, rows, columns, imaginary, length = part.numbers("5i", at)
        stored, kind = said // 10 % 10, said % 10
        if not 0 <= said < 2000 or stored >= len(STORED_4) or kind > 2 or length < 1:
            raise _damage_error(path, "it has a matrix of unknown type")
        begin = at + 20 + length
        name = content[at + 20 : begin].rstrip(b"\0").decode("latin1")
        array = _array(part, STORED_4[stored], begin, (rows, columns), len(content))
        if not kind and not imaginary:
            yield name, array
        at = begin + array.nbytes * (2 if imaginary else 1)


def _of_version_5(file: MatlabPart) -> Iterator[tuple[str, Any]]:
    meter, at = Meter(file.path, len(file.content)), HEADER
    while at + 8 <= len(file.content):
        kind, size = file.numbers("II", at)
        part = file._replace(content=file.content[at : at + 8 + size])
        if kind == COMPRESSED:
            part = part._replace(content=_inflate(part.content[8:], meter, file.path))
        found = _element(part, 0)
        if found.kind != MATRIX or found.next < len(part.content):
            raise _damage_error(file.path, "it has a variable that is not one matrix")
        name, value = _matrix(part, found, 1)
        if name and value is not None:
            yield name, value
        at += 8 + size


def _inflate(packed: bytes, meter: Meter, path: Path) -> bytes:
    pieces, stream = [], zlib.decompressobj()
    try:
        while packed and not stream.eof:
            pieces.append(stream.decompress(packed, PIECE))
            packed = stream.unconsumed_tail
            meter.add(len(pieces[-1]))
    except zlib.error as error:
        raise _damage_error(path, str(error)) from error
    return b"".join(pieces)


def _element(part: MatlabPart, at: int) -> Element:
    kind, size = part.numbers("II", at)
    if kind >> 16:  # a small element has its data within its tag
        if kind >> 16 > 4:
            raise _damage_error(part.path, f"a tag holds {kind >> 16} bytes of 4")
        return Element(kind & 0xFFFF, at + 4, at + 4 + (kind >> 16), at + 8)
    return Element(kind, at + 8, at + 8 + size, at + 8 + size + -size % 8)


def _inner(part: MatlabPart, matrix: Element) -> Iterator[Element]:
    at = matrix.begin
    while at + 8 <= matrix.end:
        found = _element(part, at)
        yield found
        at = found.next


def _matrix(part: MatlabPart, matrix: Element, depth: int) -> tuple[str, Any]:
    """(name, value) of a matrix; the value is None unless it is real numbers or one struct."""
    check_count(depth, part.path, "matrices within matrices", "depth")
    if matrix.end > len(part.content):
        raise _damage_error(part.path, "it ends within a matrix")
    inner = _inner(part, matrix)
    head = list(islice(inner, 3))
    if len(head) < 3:
        if not head:  # a matrix of nothing
            return "", None
        raise _damage_error(part.path, "a matrix lacks class, shape or name")
    flags = part.numbers("I", head[0].begin)[0]
    rank = (head[1].end - head[1].begin) // 4
    if not 2 <= rank <= RANK:
        raise _damage_error(part.path, f"a matrix of {rank} dimensions")
    sizes = part.numbers(f"{rank}i", head[1].begin)
    name = part.content[head[2].begin : head[2].end].decode("latin1")
    if flags & 0xFF == STRUCT and math.prod(sizes) == 1:
        return name, _struct(part, inner, depth)
    if not DOUBLE <= flags & 0xFF <= UINT64 or flags & COMPLEX:
        return name, None
    data = next(inner, None)
    if data is None or data.kind not in STORED:
        raise _damage_error(part.path, "a matrix of numbers has no numbers")
    return name, _array(part, STORED[data.kind], data.begin, sizes, data.end)


def _struct(part: MatlabPart, inner: Iterator[Element], depth: int) -> dict[str, Any]:
    """{field: value} of the elements after the name of a struct."""
    head = list(islice(inner, 2))
    length = part.numbers("i", head[0].begin)[0] if len(head) == 2 else 0
    if length < 1:
        raise _damage_error(part.path, "a struct lacks its fields")
    found = {}
    for at in range(head[1].begin, head[1].end, length):
        field = next(inner, None)
        if field is None or field.kind != MATRIX:
            raise _damage_error(part.path, "a struct has fewer fields than names")
        name = part.content[at : at + length].partition(b"\0")[0].decode("latin1")
        value = _matrix(part, field, depth + 1)[1]
        if value is not None:
            found[name] = value
    return found
