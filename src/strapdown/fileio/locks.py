"""Locks of open files, by which a process sees what another one still works on; and temporary
files, which stay as long as their lock is held and are swept when their process died.

A lock belongs to an open file: the system lets go of it when the process ends, however it ends, and
no process id is taken for another's. What differs between systems stands below `if sys.platform`.
"""

import os
import secrets
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, NamedTuple

PART = ".strapdown.part"
"""Ending of temporary files; their names begin with a dot."""

if sys.platform == "win32":  # not tested: there is no such machine here
    import msvcrt

    def lock(file: IO[bytes]) -> None:
        """Hold `file` until it is closed. Raises OSError where somebody else holds it."""
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def lock(file: IO[bytes]) -> None:
        """Hold `file` until it is closed. Raises OSError where somebody else holds it."""
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class LockPart(NamedTuple):
    """A temporary file, and what holds its lock."""

    path: Path
    file: IO[bytes]

    def rename(self, target: Path) -> None:
        """Put it in the place of `target`."""
        if sys.platform == "win32":  # where what is open cannot be renamed
            self.file.close()
        os.replace(self.path, target)


@contextmanager
def part_of(target: Path) -> Iterator[LockPart]:
    """A new, empty Part beside `target`, removed at the end unless it was renamed. What dead
    processes left in the folder is swept. Raises OSError."""
    sweep(target.parent)
    part = None
    while part is None:
        part = _new(target)
    try:
        yield part
    finally:
        if sys.platform == "win32":  # where what is open cannot be deleted
            part.file.close()
        _remove(part.path)  # before its lock is given up
        part.file.close()


@contextmanager
def second_name(target: Path) -> Iterator[Path | None]:
    """Another name beside it of the file that stands at `target`, for as long as the block lasts;
    None where there is no file. Raises OSError."""
    if not target.exists():
        yield None
        return
    path = _name_beside(target)
    with ExitStack() as stack:
        stack.callback(_remove, path)
        try:
            os.link(target, path)
        except OSError:  # a file system without links
            shutil.copyfile(target, path)
        if sys.platform != "win32":  # where nothing takes the place of what is open
            with suppress(OSError):
                lock(stack.enter_context(open(path, "rb+")))
        yield path


def sweep(folder: Path) -> None:
    """Delete the temporary files in `folder` whose processes no longer run."""
    for path in folder.glob(f".*{PART}"):
        with suppress(OSError):
            if sys.platform == "win32":  # which refuses to delete what is open
                path.unlink()
            elif path.is_file():  # opening a pipe would wait
                with open(path, "rb+") as file:
                    lock(file)
                    path.unlink()


def _name_beside(target: Path) -> Path:
    return target.with_name(f".{target.name[:40]}.{secrets.token_hex(6)}{PART}")


def _new(target: Path) -> LockPart | None:
    """An empty Part with the permissions of any new file; None where a sweep was quicker than
    its lock."""
    path = _name_beside(target)
    file = open(path, "xb+")
    try:
        if sys.platform != "win32":
            lock(file)
    except BlockingIOError:
        pass
    except OSError:  # a file system without locks, where nothing is swept either
        return LockPart(path, file)
    else:
        if path.exists():
            return LockPart(path, file)
    file.close()
    return None


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
