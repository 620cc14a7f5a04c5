"""Limits on files, so that none stops or fills the process that reads it: a regular file, of
bounded size once unpacked, of bounded depth and number of entries.

`file_access` has the ways of opening a file, which ask here; nothing else opens one. What unpacks or
allocates by what a file says counts it with a `Meter`. The limits in force are those of the
innermost `reading_limits`.
"""

import stat
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

from ..checks import DataError, check_flag, check_number
from ..typing import File


class ReadingLimits(NamedTuple):
    """Limits of a file. A week at 200 Hz as CSV has 15 GB."""

    # bytes of a file's content, once unpacked; of text of what it takes in memory, if that is more
    size: float = 64e9
    # unpacked bytes by packed one beyond FREE: logs reach 30, a file made to fill memory 1000
    expansion: float = 200.0
    settings: float = 4e6  # bytes of a TOML or JSON file
    depth: int = 40  # tables within tables of such a file, groups within groups
    entries: int = 100_000  # values of a TOML file, files of an archive or a folder
    columns: int = 10_000  # of a table
    pipes: bool = False  # whether pipes are read
    outside: bool = True  # whether a description may name files outside its folder


class LimitError(DataError):
    """A file that is beyond a limit."""


FREE = 100e6
"""Bytes that any packed file may unpack to."""
PIECE = 1 << 20
"""Bytes that are copied at a time."""
DEFAULT = ReadingLimits()
_IN_FORCE: ContextVar[ReadingLimits] = ContextVar("limits", default=DEFAULT)
_COPIES: ContextVar["_Copies | None"] = ContextVar("copies", default=None)


class _Copies:
    """Copies of the pipes that a block reads, by device and inode, for each can be read once."""

    def __init__(self) -> None:
        self.paths: dict[tuple[int, int], Path] = {}
        self.files = ExitStack()

    def of(self, path: Path) -> Path:
        found = path.stat()
        key = found.st_dev, found.st_ino
        if key not in self.paths:
            try:
                self.paths[key] = self._copy(path)
            except OSError as error:
                if error.filename == str(path):  # the pipe itself is refused
                    raise
                raise DataError(
                    f"{path}: the temporary folder takes no copy of the pipe "
                    f"({error.strerror or error}); make room there, or name another folder (TMPDIR)"
                ) from error
        return self.paths[key]

    def _copy(self, path: Path) -> Path:
        # without a buffer, which would be refused once more where the file is closed
        new = tempfile.NamedTemporaryFile(prefix="strapdown-", buffering=0)
        copy, size = self.files.enter_context(new), 0
        with path.open("rb") as pipe:
            while piece := pipe.read(PIECE):
                size += len(piece)
                check_size(size, path)
                while piece := piece[copy.write(piece) :]:  # a write may take a part
                    pass
        return Path(copy.name)


@contextmanager
def reading_limits(**changes: float | bool) -> Iterator[ReadingLimits]:
    """Read files with other limits within a `with` block.

    A pipe that the block reads is copied once, to a temporary file that goes when the block ends.

    Parameters
    ----------
    **changes : float or bool
        Fields of `ReadingLimits`.

    Yields
    ------
    ReadingLimits
        The limits that hold in the block.

    Raises
    ------
    DataError
        Where there is no such limit, or its value is out of range.

    Examples
    --------
    >>> import strapdown as sd
    >>> with sd.reading_limits(pipes=True) as limits:
    ...     limits.pipes
    True
    """
    for name, value in changes.items():
        if name not in ReadingLimits._fields:
            raise DataError(
                f"limit {name!r} is unknown; there are {', '.join(ReadingLimits._fields)}"
            )
        if name in ("pipes", "outside"):
            check_flag(value, f"limit {name!r}")
        else:
            check_number(value, f"limit {name!r}", above=0, infinite=True)
    token = _IN_FORCE.set(in_force()._replace(**changes))  # type: ignore[arg-type]  # checked above
    copies = _COPIES.set(_COPIES.get() or _Copies())
    try:
        yield in_force()
    finally:
        mine = _COPIES.get()
        _COPIES.reset(copies)
        if mine is not None and mine is not _COPIES.get():
            mine.files.close()
        _IN_FORCE.reset(token)


def in_force() -> ReadingLimits:
    """The limits that hold now."""
    return _IN_FORCE.get()


def regular(path: File) -> Path:
    """The path of a regular file (or of a folder, or of nothing), not larger than the limit; of a
    pipe, where they are allowed, that of a copy.

    Raises DataError of a device, a pipe or a socket, which might never end; what the system refuses
    is left to who opens it.
    """
    path = Path(path)
    try:
        found = path.stat()
    except (OSError, ValueError):
        return path
    if not in_force().outside:
        check_inside(path, path.parent)
    if stat.S_ISREG(found.st_mode):
        check_size(found.st_size, path)
    elif stat.S_ISFIFO(found.st_mode) and in_force().pipes:
        copies = _COPIES.get()
        return path if copies is None else copies.of(path)
    elif not stat.S_ISDIR(found.st_mode):
        pipe = stat.S_ISFIFO(found.st_mode)
        raise LimitError(
            f"{path}: is no regular file but a {'pipe' if pipe else 'device'}, which might never end; "
            f"copy it to a file{', or allow pipes (option --pipes before the command)' * pipe}"
        )
    return path


def check_inside(path: Path, folder: Path) -> None:
    """Refuse a file that is not in a folder or below it, also where a symbolic link leads out.
    Raises DataError."""
    if not path.resolve().is_relative_to(folder.resolve()):
        raise LimitError(
            f"{path}: is outside the folder {folder}, and such files are not read here; put the "
            f"file itself there, or allow it (without the option --inside)"
        )


def check_size(size: float, path: File, packed: float | None = None) -> None:
    """Refuse content of `size` bytes, where it is unpacked from `packed` bytes also what is out of
    all proportion to them; a `path` of "" is not named. Raises DataError."""
    limits = in_force()
    name = f"{path}: " if str(path) else ""
    if size > limits.size:
        raise LimitError(
            f"{name}has {size / 1e9:.3g} GB, and {limits.size / 1e9:.3g} GB are read at most; "
            f"raise the limit (option --max-size before the command) if it is yours"
        )
    if packed is not None and size > FREE + limits.expansion * packed:
        raise LimitError(
            f"{name}unpacks to {size / 1e6:.3g} MB or more from {packed / 1e6:.3g} MB, as no log "
            f"does; unpack it yourself if it is yours"
        )


def check_count(count: int, path: File, what: str, limit: str = "entries") -> None:
    """Refuse more than a limit of something. Raises DataError."""
    most = getattr(in_force(), limit)
    if count > most:
        raise LimitError(
            f"{path}: has {count} {what} or more, and {most} are read at most; split it, or raise "
            f"the limit (reading_limits({limit}=...)) if it is yours"
        )


class Meter:
    """Counts the bytes that one file unpacks to, whatever it states.

    packed: its own bytes; None where nothing is packed.
    """

    def __init__(self, path: File, packed: float | None = None) -> None:
        self.path, self.packed, self.size = path, packed, 0.0

    def add(self, size: float) -> None:
        """Take in `size` bytes more. Raises DataError where they are too many."""
        self.size += size
        check_size(self.size, self.path, self.packed)


@contextmanager
def reading_within(path: File) -> Iterator[None]:
    """Around what reads a file: where memory runs out, or the file nests too deep, is a DataError of
    one line."""
    try:
        yield
    except MemoryError as error:
        raise LimitError(
            f"{path}: needs more memory than there is; split it, or read it on a larger machine"
        ) from error
    except RecursionError as error:
        raise LimitError(f"{path}: nests too deep; is it the file of a device?") from error
