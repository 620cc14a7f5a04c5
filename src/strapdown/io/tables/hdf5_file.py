"""HDF5 files (also NetCDF and MATLAB 7.3), checked before any data are read: links to other files,
stated sizes without data, and decompressed size.

Source: HDF5 File Format Specification,
https://support.hdfgroup.org/documentation/hdf5/latest/_s_p_e_c.html
"""

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...checks import DataError
from ...fileio.limits import FREE, LimitError, Meter, check_count, in_force, regular

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
FILTERS = {DEFLATE, SHUFFLE, FLETCHER32}
"""Allowed filters of chunks, each once; for others the decompressed size is unknown."""
LONG_CHUNK = 10e6
"""Bytes of a chunk that are counted although its array is shorter."""
MANY_PACKED = 400_000
"""Compressed size of a chunk above which its decompressed size is tested: deflate makes up to 1032
bytes of one."""
HEAP = re.compile(re.escape(b"GCOL\x01"))
"""Beginning of a collection of the global heap, which holds the texts and has no checksum."""
OBJECT = 16
"""Sizes of the header of each object of a collection, and of the collection itself."""


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open an h5py.File for reading and check it. Raises OSError and DataError."""
    import h5py

    plain = regular(path)
    with h5py.File(plain, "r", locking=False) as file:
        _check_heaps(plain, Path(path))
        _check(file, Meter(path, plain.stat().st_size))
        yield file


def _check_heaps(plain: Path, path: Path) -> None:
    """Refuse a collection that its objects do not fill consecutively: HDF5 follows their lengths
    without a check, and never ends if they lead back. Raises DataError."""
    with plain.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        for found in HEAP.finditer(content):
            begin = found.start()
            if begin + OBJECT > len(content):
                continue
            end = begin + struct.unpack_from("<Q", content, begin + 8)[0]
            at = begin + OBJECT if end <= len(content) else end + 1
            while at + OBJECT <= end:
                number, size = struct.unpack_from("<H6xQ", content, at)
                step = (
                    OBJECT + size + -size % 8 if number else size
                )  # of 0, the free rest, all of it
                at = at + step if step >= OBJECT else end + 1
            if at > end:
                raise DataError(
                    f"{path}: is damaged (its texts extend beyond their heap); copy it again"
                )


def _check(file: Any, meter: Meter) -> None:
    """Refuse a file whose stated content exceeds the limits or its data. The limit of depth stops a
    group within itself. Raises DataError."""
    import h5py

    path, count = Path(meter.path), 0
    left = [(file, 1)]
    while left:
        group, depth = left.pop()
        check_count(depth, path, "groups within groups", "depth")
        for name in group:
            count += 1
            check_count(count, path, "arrays and groups")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise _refusal(path, f"{repr(name)[:60]} is a link to another place or file")
            value = group[name]
            if isinstance(value, h5py.Dataset):
                _check_array(value, meter)
            elif isinstance(value, h5py.Group):
                left.append((value, depth + 1))


def _refusal(path: Path, why: str) -> LimitError:
    return LimitError(f"{path}: cannot be read: {why}, which strapdown and MATLAB never write")


def _check_array(array: Any, meter: Meter) -> None:
    path, settings = Path(meter.path), array.id.get_create_plist()
    filters = [settings.get_filter(k)[0] for k in range(settings.get_nfilters())]
    if array.is_virtual or settings.get_external_count():
        raise _refusal(path, "it has an array in other files")
    if not set(filters) <= FILTERS or len(set(filters)) < len(filters):
        raise _refusal(path, f"it has an array with the filters {filters}")
    count, each = array.size or 0, array.id.get_type().get_size()
    packed = meter.packed or 0.0
    if array.dtype.kind == "O" and count * packed > FREE + in_force().expansion * packed:
        raise _refusal(path, f"it has an array of {count} texts")
    chunk = each
    for length in array.chunks or ():
        chunk *= length
    # an array without chunks needs no memory for them
    long = array.chunks is not None and chunk > LONG_CHUNK
    meter.add(max(count * each, chunk) if long else count * each)
    if DEFLATE in filters:
        _check_chunks(array, chunk, path)


def _check_chunks(array: Any, size: int, path: Path) -> None:
    """Refuse chunks that decompress to more than their `size`. Raises DataError."""
    found: list[Any] = []
    array.id.chunk_iter(found.append)
    for chunk in found:
        if chunk.size > 1.1 * size + 1000:
            raise _refusal(path, "it has a compressed chunk that is longer than its content")
        if chunk.size <= MANY_PACKED or chunk.filter_mask:
            continue
        _, packed = array.id.read_direct_chunk(chunk.chunk_offset)
        try:
            if len(zlib.decompressobj().decompress(packed, size + 1)) > size:
                raise _refusal(
                    path, f"it has a chunk that decompresses to more than its {size} bytes"
                )
        except zlib.error as error:
            raise DataError(f"{path}: is damaged ({error}); copy it again") from None
