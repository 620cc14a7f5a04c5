"""Writing files so that a reader never meets half of one."""
import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

from .data import DataError


@contextmanager
def replacing(path):
    """A temporary path beside `path` to write to; it takes the place of `path` when the block ends well, else it is removed.

    Whatever the system refuses (no folder, no permission, disk full) is raised as a DataError of one line.
    """
    target = Path(os.path.realpath(path))
    part = None
    try:
        part = _part(target)
        yield part
        with open(part, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(part, target)
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise DataError(f"{path}: cannot be written ({reason}); choose another folder, or make room there") from error
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


def _part(target):
    if target.is_dir():
        raise IsADirectoryError(0, "it is a folder")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(0, "it is read-only")
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
    umask = os.umask(0)     # mkstemp makes private files; the result gets the permissions of any other new file
    os.umask(umask)
    os.fchmod(handle, 0o666 & ~umask)
    os.close(handle)
    return Path(name)
