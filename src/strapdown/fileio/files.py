"""Writing files so that a reader never meets half of one or of a set, reading TOML with complaints
for people, and the TOML files that ship with packages."""

import os
import shutil
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from io import BytesIO
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..checks import DataError
from ..plugins import PluginWarning
from ..typing import File
from .checksum import append_checksum
from .file_access import settings_text, toml_of
from .locks import LockPart, part_of, second_name
from .spreadsheet import inert_table

if TYPE_CHECKING:
    import pandas as pd

IN_MEMORY = 1_000_000_000
"""Bytes of arrays up to which a NetCDF file is made in memory: some 10 million IMU samples."""


class _Ready(NamedTuple):
    """A file that is written and waits for the others of its set."""

    path: File  # as the caller named it
    target: Path
    part: LockPart


class _Set(NamedTuple):
    """Files that are to appear together, and what removes their temporary ones."""

    ready: list[_Ready]
    parts: ExitStack


_SET: ContextVar[_Set | None] = ContextVar("set of files", default=None)


@contextmanager
def together() -> Iterator[_Set]:
    """Put all files that `replacing` writes in the block in place when the block ends well; else
    leave the former files untouched.

    Until then a reader finds the files of before. A set inside another one is part of it; a thread
    has its own. Only a kill or a power failure between two of the last renames, some microseconds,
    leaves some files of each.
    """
    around = _SET.get()
    if around is not None:
        yield around
        return
    with ExitStack() as parts:
        files = _Set([], parts)
        token = _SET.set(files)
        try:
            yield files
        finally:
            _SET.reset(token)
        _rename(files.ready)


@contextmanager
def replacing(path: File) -> Iterator[Path]:
    """A temporary path beside `path` to write to; it takes the place of `path` when the block and
    the set of `together` around it end well, else it is removed.

    Whatever the system refuses (no folder, no permission, disk full) is raised as a DataError of
    one line.
    """
    with together() as files, _refusals(path):
        target = Path(os.path.realpath(path))
        _check_writable(target)
        part = files.parts.enter_context(part_of(target))
        yield part.path
        os.fsync(part.file.fileno())
        files.ready.append(_Ready(path, target, part))


def write_table(table: "pd.DataFrame", path: File, digits: int) -> None:
    """Write a table as CSV, whole or not at all: its columns without the index, numbers with so many
    digits, texts as `inert_table` makes them. Raises DataError."""
    with replacing(path) as part:
        inert_table(table).to_csv(part, index=False, float_format=f"%.{digits}g")


def _rename(files: list[_Ready]) -> None:
    """Put all files in their places; where one cannot be, those before it are put back."""
    with ExitStack() as names, ExitStack() as undo:
        before = []
        for file in files if len(files) > 1 else ():
            with _refusals(file.path):
                before.append(names.enter_context(second_name(file.target)))
        for file, old in zip_longest(files, before):  # at once, for no kill to fall between
            if len(files) > 1:
                undo.callback(_put_back, old, file.target)
            with _refusals(file.path):
                file.part.rename(file.target)
        undo.pop_all()


def _put_back(before: Path | None, target: Path) -> None:
    with suppress(OSError):
        if before is None:
            target.unlink(missing_ok=True)
        else:
            os.replace(before, target)


@contextmanager
def _refusals(path: File) -> Iterator[None]:
    """Raise an OSError of the block as a DataError on `path`."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise DataError(
            f"{path}: cannot be written ({reason}); choose another folder, or make room there"
        ) from error


def _check_writable(target: Path) -> None:
    if target.is_dir():
        raise IsADirectoryError(0, "it is a folder")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(0, "it is read-only")


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
    has room for all of it. It ends with its checksum, and says so in its attribute `checksum`.
    """
    import h5netcdf

    said = {"checksum": "CRC-32, in the last line"}

    if size > IN_MEMORY:
        if shutil.disk_usage(part.parent).free < size:
            raise OSError(28, f"the disk has not the {size / 1e9:.2g} GB that it needs")
        # HDF5's own lock would meet that of `replacing`
        with h5netcdf.File(part, "w", locking=False) as file:
            file.attrs.update(said)
            yield file
    else:
        buffer = BytesIO()
        with h5netcdf.File(buffer, "w") as file:
            file.attrs.update(said)
            yield file
        part.write_bytes(buffer.getbuffer())
    append_checksum(part)


@cache
def shipped_files(kind: str, package: str, others: bool = True) -> dict[str, Traversable]:
    """{name: file} of the TOML files in folder `kind` (`grades`, `parts`, `scenarios`) of `package` and,
    with `others`, of installed packages that bring some.

    Such a package names itself under the entry points `strapdown.data`; a name that `package` has
    itself stays its own. One that cannot be imported is reported and left out.
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
    """The TOML file of that name in a folder of `shipped_files`, or None. What `package` has itself is
    found whatever else is installed."""
    return shipped_files(kind, package, False).get(name) or shipped_files(kind, package).get(name)


def make_folder(folder: Path) -> None:
    """Make a folder with those above it. Raises DataError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(
            f"{folder}: cannot be made ({error.strerror}); choose another folder"
        ) from None
