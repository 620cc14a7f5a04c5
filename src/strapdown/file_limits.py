"""What a file may be, so that none stops or fills the process that reads it: a regular file, of
bounded size once unpacked, of bounded depth and number of entries.

Whatever opens a file asks `regular`, whatever unpacks or allocates by what a file says asks
`check_size`. The limits in force are those of the innermost `reading_limits`.
"""

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from .checks import DataError, check_flag, check_number
from .typing import File


class Limits(NamedTuple):
    """What a file may be. A week at 200 Hz as CSV has 15 GB."""

    size: float = 64e9  # bytes of a file's content, once unpacked
    # unpacked bytes by packed one beyond FREE: logs reach 30, a file made to fill memory 1000
    expansion: float = 200.0
    settings: float = 4e6  # bytes of a TOML or JSON file
    depth: int = 40  # tables within tables of such a file
    entries: int = 100_000  # of such a file, or files of an archive
    pipes: bool = False  # whether what is no regular file is read, such as a pipe


FREE = 100e6
"""Bytes that any packed file may unpack to."""
DEFAULT = Limits()
_IN_FORCE: ContextVar[Limits] = ContextVar("limits", default=DEFAULT)


@contextmanager
def reading_limits(**changes: float | bool) -> Iterator[Limits]:
    """Other limits for the files that the block reads: fields of `Limits`. Raises DataError."""
    for name, value in changes.items():
        if name not in Limits._fields:
            raise DataError(f"limit {name!r} is unknown; there are {', '.join(Limits._fields)}")
        if name == "pipes":
            check_flag(value, "limit 'pipes'")
        else:
            check_number(value, f"limit {name!r}", above=0, infinite=True)
    token = _IN_FORCE.set(in_force()._replace(**changes))  # type: ignore[arg-type]  # checked above
    try:
        yield in_force()
    finally:
        _IN_FORCE.reset(token)


def in_force() -> Limits:
    """The limits that hold now."""
    return _IN_FORCE.get()


def regular(path: File) -> Path:
    """The path of a regular file (or of a folder, or of nothing), not larger than the limit.

    Raises DataError of a device, a pipe or a socket, which might never end; what the system refuses
    is left to who opens it.
    """
    path = Path(path)
    try:
        found = path.stat()
    except (OSError, ValueError):
        return path
    if stat.S_ISREG(found.st_mode):
        check_size(found.st_size, path)
    elif not stat.S_ISDIR(found.st_mode) and not in_force().pipes:
        raise DataError(
            f"{path}: is no regular file but a device or a pipe, which might never end; copy it to "
            f"a file, or allow pipes (option --pipes before the command)"
        )
    return path


def check_size(size: float, path: File, packed: float | None = None) -> None:
    """Refuse content of `size` bytes, where it is unpacked from `packed` bytes also what is out of
    all proportion to them. Raises DataError."""
    limits = in_force()
    if size > limits.size:
        raise DataError(
            f"{path}: has {size / 1e9:.3g} GB, and {limits.size / 1e9:.3g} GB are read at most; "
            f"raise the limit (option --max-size before the command) if it is yours"
        )
    if packed is not None and size > FREE + limits.expansion * packed:
        raise DataError(
            f"{path}: unpacks to {size / 1e6:.3g} MB or more from {packed / 1e6:.3g} MB, as no log "
            f"does; unpack it yourself if it is yours"
        )
