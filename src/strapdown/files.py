"""Writing files so that a reader never meets half of one, reading TOML with complaints for
people, and the TOML files that ship with packages."""

import os
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from io import BytesIO
from pathlib import Path
from typing import Any

from .checks import DataError
from .opening import settings_text, toml_of
from .plugins import PluginWarning
from .typing import File

IN_MEMORY = 1_000_000_000
"""Bytes of arrays up to which a NetCDF file is made in memory: some 10 million IMU samples."""


@contextmanager
def replacing(path: File) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the place of `path` when the block ends
    well, else it is removed.

    Whatever the system refuses (no folder, no permission, disk full) is raised as a DataError of
    one line.
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
        raise DataError(
            f"{path}: cannot be written ({reason}); choose another folder, or make room there"
        ) from error
    finally:
        if part is not None:
            part.unlink(missing_ok=True)


def read_toml(path: File, hint: str) -> dict[str, Any]:
    """The content of a TOML file as a dict. Raises DataError naming the file; `hint` is the
    remedy where it cannot be read."""
    try:
        return toml_of(settings_text(path), path)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error}); {hint}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is not UTF-8 text; save it as UTF-8") from error


@contextmanager
def netcdf(part: Path, size: int) -> Iterator[Any]:
    """A new h5netcdf.File that becomes the file `part` (of `replacing`) when the block ends;
    `size`: bytes of the arrays that go into it.

    It is made in memory and written at once, for HDF5 that runs out of disk cannot even close its
    file and takes the process with it. Above IN_MEMORY it is written directly, into a folder that
    has room for all of it.
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


def _part(target: Path) -> Path:
    if target.is_dir():
        raise IsADirectoryError(0, "it is a folder")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(0, "it is read-only")
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
    # mkstemp makes private files; the result gets the permissions of any other new file
    umask = os.umask(0)
    os.umask(umask)
    os.fchmod(handle, 0o666 & ~umask)
    os.close(handle)
    return Path(name)


@cache
def shipped(kind: str, package: str, others: bool = True) -> dict[str, Traversable]:
    """{name: file} of the TOML files in folder `kind` (`grades`, `scenarios`) of `package` and,
    with `others`, of installed packages that bring some.

    Such a package names itself under the entry points `strapdown.data`; a name that `package` has
    itself stays its own. One that cannot be imported is told of and left out.
    """
    found: dict[str, Traversable] = {}
    for place in (
        package,
        *(entry.value for entry in entry_points(group="strapdown.data") if others),
    ):
        try:
            folder = files(place).joinpath(kind)
        except ImportError as error:
            warnings.warn(
                f"plugin {place}: it should bring {kind}, and cannot be imported ({error}); install "
                f"it again",
                PluginWarning,
                stacklevel=2,
            )
            continue
        if folder.is_dir():
            own = {
                entry.name.removesuffix(".toml"): entry
                for entry in folder.iterdir()
                if entry.name.endswith(".toml")
            }
            found |= {name: entry for name, entry in own.items() if name not in found}
    return dict(sorted(found.items()))


def find_shipped(kind: str, package: str, name: str) -> Traversable | None:
    """The TOML file of that name in a folder of `shipped`, or None. What `package` has itself is
    found whatever else is installed."""
    return shipped(kind, package, False).get(name) or shipped(kind, package).get(name)
