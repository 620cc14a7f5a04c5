"""Tables of files, whose error messages name the file, the line and the column, and functions that
open plain or compressed files."""

import bz2
import gzip
import io
import lzma
import mmap
import re
import struct
import sys
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple, TextIO

import numpy as np

from ...checks import DataError, did_you_mean
from ...extras import optional_import
from ...fileio.file_access import Zip, metered_file, open_file
from ...fileio.limits import Meter, regular
from ...preprocessing.origin import Origin
from ...typing import Array, ArrayLike, File, Ints, Mask

if TYPE_CHECKING:
    import pandas as pd

PACKED = (".gz", ".xz", ".bz2", ".zst", ".zstd", ".zip")
"""Endings of files that `open_text` decompresses."""


ZSTD = "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"


def zstd() -> Any:
    """Return the zstd module, part of Python from 3.14 on; it is loaded when needed. Raises
    DataError where it is missing."""
    with optional_import():
        return import_module(ZSTD)


OPENERS: dict[str, Any] = {
    ".gz": gzip.open,
    ".xz": lzma.open,
    ".bz2": bz2.open,
    ".zst": lambda path: zstd().open(path),
    ".zstd": lambda path: zstd().open(path),
}


def packed_suffixes(*suffixes: str) -> tuple[str, ...]:
    """Return these suffixes, plain and compressed: ".csv", ".csv.gz", ..."""
    return tuple(suffix + way for suffix in suffixes for way in ("", *PACKED))


def unpacking_errors() -> tuple[type[Exception], ...]:
    """Return the exceptions of decompressing a damaged file."""
    damaged = lzma.LZMAError, zlib.error, zipfile.BadZipFile
    of_zstd = (zstd().ZstdError,) if ZSTD in sys.modules else ()  # without it, none was raised
    return EOFError, struct.error, *damaged, *of_zstd


SUFFIXES = packed_suffixes(".csv", ".txt", ".tsv", ".dat")


@contextmanager
def reading_file(path: File) -> Iterator[None]:
    """Context for reading a file: a missing, truncated or damaged file raises a DataError with the
    remedy."""
    try:
        yield
    except unpacking_errors() as error:  # called only after an exception
        raise DataError(
            f"{path}: the compressed file is truncated or damaged ({first_line_of(error)}); copy it again"
        ) from error
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read ({error.strerror or first_line_of(error)}); check the path"
        ) from error


class NumberColumns(dict[str | int, np.ndarray[Any, Any]]):
    """{name: column (n,)} of floats or integers: a table without pandas, which takes 0.25 s to
    load."""

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """The same as a DataFrame, made on first use."""
        import pandas as pd

        return pd.DataFrame(self, copy=False)

    def take(self, rows: Mask) -> "NumberColumns":
        """These rows of it."""
        return NumberColumns({name: column[rows] for name, column in self.items()})


class FileTable(NamedTuple):
    """A table of a file: its raw cells, and the line (or record) of each row in the file."""

    name: str
    content: "pd.DataFrame | NumberColumns"
    lines: Ints
    word: str = "line"  # word for a row of the file
    units: Mapping[str, str] = {}  # of columns, where a line of the file names them
    notes: tuple[str, ...] = ()  # on parts of the file that were left out

    @classmethod
    def of(
        cls,
        name: str,
        columns: Mapping[str, ArrayLike],
        rows: Ints | None = None,
        word: str = "record",
    ) -> "FileTable":
        """Return a table of columns (n,) by name; `rows` (n,) are their numbers in the file, by
        default from 0."""
        content = _numbers_or_frame(columns)
        count = len(content[next(iter(columns))]) if columns else 0
        return cls(name, content, np.arange(count) if rows is None else rows, word)

    @property
    def frame(self) -> "pd.DataFrame":
        """The raw cells as a pandas DataFrame."""
        return self.content.frame if isinstance(self.content, NumberColumns) else self.content

    @property
    def names(self) -> list[str | int]:
        """Names of the columns."""
        return [*self.content]

    @property
    def titles(self) -> list[str]:
        """Names of the columns as text, their numbers where there is no header."""
        return [str(name) for name in self.names]

    def with_columns(self, added: Mapping[str, Array]) -> "FileTable":
        """Return the table with these columns (n,) added or replaced."""
        content = self.content
        if isinstance(content, NumberColumns):
            return self._replace(content=NumberColumns([*content.items(), *added.items()]))
        return self._replace(content=content.assign(**added))

    def take(self, rows: Mask) -> "FileTable":
        """These rows of it."""
        content = self.content
        some = content.take(rows) if isinstance(content, NumberColumns) else content[rows]
        return self._replace(content=some, lines=self.lines[rows])

    @property
    def origin(self) -> Origin:
        """Origin that names lines of this file."""
        return Origin(self.name, self.lines, self.word)

    def cells(self, column: str | int) -> np.ndarray[Any, Any]:
        """Return the column as read (n,), integers as integers. Raises DataError for a missing
        column."""
        if column not in self.content:
            raise DataError(f"{self.name}: {self._missing_text(column)}")
        cells = self.content[column]
        return cells if isinstance(cells, np.ndarray) else cells.to_numpy()

    def cells_filled(self, column: str | int) -> Mask:
        """Return True for the rows (n,) whose cell of a column is not empty."""
        cells = self.content[column]
        if isinstance(cells, np.ndarray):
            return np.asarray(cells == cells)  # NaN is not itself
        return cells.notna().to_numpy()

    def numbers(self, column: str | int) -> Array:
        """Return the column as floats (n,); missing cells are NaN. Raises DataError for a missing
        column or a cell that is not a number."""
        if column not in self.content:
            raise DataError(f"{self.name}: {self._missing_text(column)}")
        cells = self.content[column]
        if isinstance(cells, np.ndarray):
            return cells.astype(float)
        if cells.dtype.kind in "iuf":
            return cells.to_numpy(float, na_value=np.nan)
        import pandas as pd

        values = pd.to_numeric(cells, errors="coerce").to_numpy(float, na_value=np.nan)
        wrong = np.isnan(values) & self.cells_filled(column)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise DataError(
                f"{self.origin.row(row)}, column {column!r}: {str(cells.iloc[row])[:40]!r} is not a "
                f"number; "
                "correct the cell or leave it empty"
            )
        return values

    def _missing_text(self, column: str | int) -> str:
        names = [
            "".join(each if each.isprintable() else "?" for each in str(name))
            for name in self.names
        ]
        if isinstance(column, int):
            return f"column {column} is missing; it has {len(names)} columns"
        if sum(map(is_number, names)) > len(names) / 2:
            return f"column {column!r} is missing; the file has no header line: give columns by number, the first is 1"
        hint = did_you_mean(column, names)
        return f"column {column!r} is missing{hint}; it has {', '.join(names[:20])}"


def _numbers_or_frame(columns: Mapping[str, ArrayLike]) -> "pd.DataFrame | NumberColumns":
    """Return columns (n,) by name, without pandas where all are numbers."""
    arrays = {name: np.asarray(column) for name, column in columns.items()}
    shapes = {column.shape for column in arrays.values()}
    if len(shapes) == 1 and all(c.ndim == 1 and c.dtype.kind in "iuf" for c in arrays.values()):
        return NumberColumns(arrays)
    import pandas as pd

    return pd.DataFrame(dict(columns), copy=False)


def open_bytes(path: Path, lines: bool = False) -> BinaryIO:
    """Open a plain or compressed file (the first file of an archive) for reading and count its
    content; with `lines`, the length of a line is limited. Raises OSError, the `unpacking_errors`
    on reading, and DataError beyond the limits."""
    if path.is_dir():
        raise IsADirectoryError(0, "it is a folder")
    ending = path.suffix.lower()
    if ending == ".zip":
        archive = Zip(path)
        files = _files(archive)
        if not files:
            raise zipfile.BadZipFile("it holds no file")
        return archive.content(files[0], lines=lines)
    if ending in OPENERS:
        plain = regular(path)
        meter = Meter(path, plain.stat().st_size)
        return metered_file(OPENERS[ending](plain), meter, lines)
    return metered_file(open_file(path), Meter(path), lines) if lines else open_file(path)


def _files(archive: Zip) -> list[str]:
    """Return the files of an archive, without those that macOS adds."""
    return [
        name
        for name in archive.namelist()
        if not name.endswith(("/", ".DS_Store")) and not name.startswith("__MACOSX")
    ]


def files_in(path: Path) -> list[str]:
    """Return the names of the files in a zip, without folders; none for other files."""
    if path.suffix.lower() != ".zip":
        return []
    try:
        with Zip(path) as archive:
            return [PurePosixPath(name).name for name in _files(archive)]
    except (zipfile.BadZipFile, OSError, DataError):
        return []


def open_text(path: Path) -> TextIO:
    """Open a plain or compressed text file for reading. Raises as `open_bytes`."""
    return io.TextIOWrapper(
        open_bytes(path, lines=True), encoding="utf-8-sig", errors="replace", newline=""
    )


def read_bytes(path: Path, most: int = -1, lines: bool = False) -> bytes:
    """Return the content of a plain or compressed file, or its first `most` bytes; `lines` as in
    `open_bytes`. Raises DataError."""
    with reading_file(path), open_bytes(path, lines) as file:
        return file.read(most)


def head_of(path: Path, most: int) -> bytes:
    """Return the first `most` bytes of a file's content, for a `sniff`; empty for an unreadable
    file."""
    try:
        return read_bytes(path, most)
    except DataError:
        return b""


def is_number(text: str) -> bool:
    """Return True where a header cell reads as a number, so that the line is probably no header."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def split_error(error: BaseException) -> str:
    """Return pandas' message on a text that it cannot split into columns, in plain words."""
    found = re.search(r"Expected (\d+) fields in line (\d+), saw (\d+)", str(error))
    if found is None:
        return first_line_of(error)
    expected, line, seen = found.groups()
    return f"line {line} has {seen} cells, but the lines before it at most {expected}"


def first_line_of(error: BaseException) -> str:
    """Return the first line of an exception's message, or the name of its class."""
    return str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__


def map_file(path: Path) -> memoryview:
    """Return the bytes of a file: a plain one is mapped without reading it into memory, a
    compressed one is decompressed. Raises DataError."""
    with reading_file(path):
        plain = regular(path)
        if path.name.lower().endswith(PACKED) or not plain.is_file() or not plain.stat().st_size:
            return memoryview(read_bytes(path))
        with plain.open("rb") as file:
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
