"""Exports of apps that write one CSV file per sensor: a folder of them, a zip, or one alone."""

import io
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from ....checks import DataError
from ....fileio.file_access import Zip, files_of
from ....fileio.limits import Meter
from ...tables.table_file import (
    FileTable,
    first_line_of,
    open_bytes,
    packed_suffixes,
    reading_file,
    split_error,
)

if TYPE_CHECKING:
    import pandas as pd

CSV = tuple(end for end in packed_suffixes(".csv") if not end.endswith(".zip"))
"""Endings of the names of the files."""
MAX_FILES = 200
"""Largest number of files of an export; an app has some twenty sensors."""
HEAD = 4096
"""Number of bytes that contain the header line of a file."""


class Export(NamedTuple):
    """The CSV files of an export: for each name without ending, such as "meta/time", a function
    that opens the file."""

    path: Path
    files: Mapping[str, Callable[[], BinaryIO]]

    @property
    def alone(self) -> bool:
        """True where the export is one CSV file."""
        return self.path.is_file() and self.path.suffix.lower() != ".zip"

    def head(self, name: str) -> str:
        """Return the header line of a file without quotes, "" without one. Raises DataError."""
        with self._read_errors(), self.files[name]() as file:
            text = file.read(HEAD).decode("utf-8-sig", "replace")
        return text.splitlines()[0].replace('"', "") if text.strip() else ""

    def table(self, name: str) -> FileTable:
        """Return a file as a FileTable, which may have no rows. Raises DataError."""
        label = str(self.path) if self.alone else f"{self.path} [{name}.csv]"
        head = self.head(name)
        separator = max(",;\t", key=head.count)
        with self._read_errors(), self.files[name]() as file:
            content = file.read()
        # in some languages, apps write 1,5 between semicolons or tabs
        comma = separator != "," and re.search(rb"\d,\d", content[len(head) :][:HEAD])
        decimal = "," if comma else "."
        frame = parse_cells(content, label, sep=separator, decimal=decimal, index_col=False)
        return FileTable(label, frame, np.arange(len(frame)) + 2)

    @contextmanager
    def _read_errors(self) -> Iterator[None]:
        """Context for reading: the exceptions of a damaged archive become a one-line DataError."""
        try:
            with reading_file(self.path):
                yield
        except (NotImplementedError, RuntimeError, ValueError, KeyError, struct.error) as error:
            if isinstance(error, DataError):
                raise
            raise DataError(
                f"{self.path}: cannot be unpacked ({first_line_of(error)}); unpack it and name the folder"
            ) from None


def parse_cells(content: bytes, label: str, **options: Any) -> "pd.DataFrame":
    """Parse a text of cells with pandas; the result may have no rows. Raises DataError, which
    begins with `label`."""
    import pandas as pd

    try:
        frame = pd.read_csv(
            io.BytesIO(content), encoding_errors="replace", low_memory=False, **options
        )
    except pd.errors.EmptyDataError:
        frame = pd.DataFrame(columns=options.get("names"))
    except (pd.errors.ParserError, ValueError, OverflowError) as error:
        raise DataError(
            f"{label}: is not a table of comma-separated values ({split_error(error)}); export it again"
        ) from None
    frame.columns = pd.Index([str(column).strip() for column in frame.columns])
    return frame


def export(path: Path) -> Export:
    """Return the Export in a folder, a zip or a CSV file; without files for anything else. Raises
    DataError."""
    found = Export(path, {})
    with found._read_errors():
        if path.is_dir():
            files = _of_folder(path)
        elif path.suffix.lower() == ".zip":
            with Zip(path) as archive:
                files = _of_zip(archive)
        elif path.name.lower().endswith(CSV):
            files = {_name(path.name): partial(open_bytes, path, True)}
        else:
            files = {}
    return found._replace(files=dict(sorted(files.items())[:MAX_FILES]))


def heads(path: Path) -> dict[str, str]:
    """{name: header line} of the files of an export, for a `sniff`; {} for other files. Raises
    DataError for a damaged archive."""
    try:
        found = export(path)
        return {name: found.head(name) for name in found.files}
    except DataError:
        if path.suffix.lower() == ".zip":
            raise
        return {}


def _name(file: str) -> str:
    """`Accelerometer` of `Accelerometer.csv.xz`."""
    lower = file.lower()
    return file[: -max(len(end) for end in CSV if lower.endswith(end))]


def _of_folder(path: Path) -> dict[str, Callable[[], BinaryIO]]:
    files = [*files_of(path), *files_of(path, "meta/*")]
    return {
        _name(file.relative_to(path).as_posix()): partial(open_bytes, file, True)
        for file in files
        if file.name.lower().endswith(CSV) and not file.name.startswith(".") and file.is_file()
    }


def _of_zip(archive: Zip) -> dict[str, Callable[[], BinaryIO]]:
    """The same for an archive, whose files may be in one folder."""
    path, names, meter = Path(archive.path), archive.namelist(), archive.meter
    found = {
        PurePosixPath(name).parts: name
        for name in names
        if name.lower().endswith(".csv")
        and not PurePosixPath(name).name.startswith(".")
        and not name.startswith("__MACOSX")
    }
    tops = {parts[0] for parts in found}
    inside = len(tops) == 1 and all(len(parts) > 1 for parts in found)
    return {
        _name("/".join(parts[1:] if inside else parts)): partial(_member, path, name, meter)
        for parts, name in found.items()
    }


def _member(path: Path, name: str, meter: Meter) -> BinaryIO:
    """Open a file of an archive for reading; the meter counts the unpacked bytes of all files."""
    return Zip(path).content(name, meter, True)
