"""Writing files so that a reader never meets half of one, and reading TOML with complaints for people."""
import os
import shutil
import tempfile
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from .data import DataError

IN_MEMORY = 1_000_000_000
"""Bytes of arrays up to which a NetCDF file is made in memory: some 10 million IMU samples."""


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


def read_toml(path, hint):
    """The content of a TOML file as a dict. Raises DataError naming the file; `hint` is the remedy where it cannot be read."""
    import tomllib
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error}); {hint}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is not UTF-8 text; save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: is not TOML: {str(error).splitlines()[0]}") from error


@contextmanager
def netcdf(part, size):
    """A new h5netcdf.File that becomes the file `part` (of `replacing`) when the block ends; `size`: bytes of the arrays that go into it.

    It is made in memory and written at once, for HDF5 that runs out of disk cannot even close its file and takes the process with it. Above
    IN_MEMORY it is written directly, into a folder that has room for all of it.
    """
    import h5netcdf
    if size > IN_MEMORY:
        if shutil.disk_usage(part.parent).free < size:
            raise OSError(28, f"the disk has not the {size / 1e9:.2g} GB that it needs")
        with h5netcdf.File(part, "w") as file:
            yield file
        return
    buffer = BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        yield file
    part.write_bytes(buffer.getbuffer())


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
