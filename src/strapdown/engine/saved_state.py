"""Files that hold the state of a stream: one line of text, the packed JSON of the state with its arrays
as base64, and the checksum of `fileio`."""

import base64
import json
import zlib
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import DataError
from ..data.solution import Source
from ..fileio.checksum import LENGTH, append_checksum, has_checksum
from ..fileio.file_access import json_of, open_file
from ..fileio.files import replacing
from ..typing import File

FIRST = b"strapdown stream, format "
FORMAT = 2
"""Changes with what the file holds."""
MAX_SIZE = 1 << 28
"""Largest number of unpacked bytes. A stream that has started takes 10 to 100 kB; one that waits
for its start with 10 million samples takes more than this and is refused."""


class OtherStateError(DataError):
    """A file that is whole, but holds no state that this stream can go on from."""


def write_state(path: File, state: dict[str, Any]) -> None:
    """Write a state of numbers, texts, lists, tables and arrays of float64 or int64, whole or not
    at all. Raises DataError."""
    write_state_text(path, state_text(path, state))


def state_text(path: File, state: dict[str, Any]) -> bytes:
    """Return the JSON of a state for `write_state_text`. Raises DataError where it is too long."""
    text = json.dumps(state, default=_plain, separators=(",", ":")).encode()
    if len(text) > MAX_SIZE:
        raise DataError(
            f"{path}: the state has {len(text) / 1e6:.0f} MB, most of it samples that wait; give "
            "the stream a shorter history or lag"
        )
    return text


def write_state_text(path: File, text: bytes) -> None:
    """Write the `state_text` of a state, whole or not at all. Raises DataError."""
    with replacing(path) as part:
        part.write_bytes(FIRST + b"%d\n" % FORMAT + zlib.compress(text))
        append_checksum(part)


def read_state(path: File) -> dict[str, Any]:
    """Return the state of such a file. Raises DataError where it is none, is damaged or of another
    format."""
    try:
        with open_file(path) as file:
            content = file.read(MAX_SIZE)
        first, _, packed = content.partition(b"\n")
        if not first.startswith(FIRST):
            raise OtherStateError(f"{path}: is no saved stream; give a file that Stream.save wrote")
        if first != FIRST + b"%d" % FORMAT:
            said = first.removeprefix(FIRST)[:8].decode("ascii", "replace")
            raise OtherStateError(
                f"{path}: is of format {said}, this version reads {FORMAT}; begin a new stream"
            )
        if not has_checksum(Path(path)):
            raise DataError(f"{path}: is cut short; begin a new stream, or use an older copy")
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read ({error.strerror or error}); begin a new stream"
        ) from error
    try:
        unpack = zlib.decompressobj()
        text = unpack.decompress(packed[:-LENGTH], MAX_SIZE)
        found = _with_arrays(json_of(text, path)) if unpack.eof else None
    except (zlib.error, ValueError, KeyError, TypeError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise contradiction(path)
    return found


def contradiction(path: File) -> DataError:
    """Return the error on a file whose content contradicts itself."""
    return DataError(f"{path}: does not hold what a saved stream holds; begin a new stream")


def _plain(value: Any) -> Any:
    """Return what JSON has no type for as a type that it has."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.str[1:] in ("f8", "i8"):
        data = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
        return {"array": value.dtype.str, "shape": value.shape, "data": data}
    raise TypeError(f"a state cannot hold {type(value).__name__}")


def _with_arrays(value: Any) -> Any:
    """Return what JSON holds with the arrays that `_plain` made texts of."""
    if isinstance(value, list):
        return [_with_arrays(each) for each in value]
    if not isinstance(value, dict):
        return value
    if "array" not in value:
        return {name: _with_arrays(each) for name, each in value.items()}
    if value["array"][1:] not in ("f8", "i8"):
        raise ValueError("no array of numbers")
    data = np.frombuffer(base64.b64decode(value["data"]), value["array"])
    return data.reshape(value["shape"]).astype(data.dtype.newbyteorder("="))


def put_array(into: Any, saved: Any) -> None:
    """Copy a saved array over one of the same shape and type. Raises ValueError where they
    differ."""
    if not isinstance(saved, np.ndarray) or (saved.shape, saved.dtype) != (into.shape, into.dtype):
        raise ValueError("an array of another shape")
    into[...] = saved


def plain_source(a: Source) -> tuple[Any, ...]:
    """Return what a source says besides its fixes."""
    return tuple(getattr(a, each.name) for each in fields(a) if each.name not in ("t", "y", "std"))


def check_set_up(path: File, saved: Any, own: dict[str, str]) -> None:
    """Raise OtherStateError where the parts of a saved stream, by name, are not those of this one."""
    if not isinstance(saved, dict) or saved.keys() != own.keys():
        raise contradiction(path)
    for name, part in own.items():
        if saved[name] != part:
            which = f": {saved[name]}, not {part}" if name in ("strapdown", "filter") else ""
            raise OtherStateError(
                f"{path}: was saved by a stream with another {name}{which}; restore it into a "
                "stream that is built alike, or begin a new one"
            )
