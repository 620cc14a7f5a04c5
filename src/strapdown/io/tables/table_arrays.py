"""The tables of a file by name: text, MATLAB (.mat, also of version 7.3) or Parquet."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError
from ...fileio.file_access import open_file
from ...fileio.limits import Meter, check_count, regular
from .hdf5_file import open_hdf5
from .matlab_file import variables
from .table_file import SUFFIXES as TEXT, FileTable, first_line_of, is_number, reading_file
from .table_text import read_table

MATLAB, PARQUET = ".mat", ".parquet"
SUFFIXES = (*TEXT, MATLAB, PARQUET)
HDF5 = b"\x89HDF"
AT_ONCE = 1 << 18
"""Number of rows of a Parquet file that are read at a time."""


def tables_of(path: Path, header: bool | None = None) -> dict[str, FileTable]:
    """Return {name: Table}. A text or Parquet file has one table, with the name of the file. A
    MATLAB file has one for each struct, or for the arrays of one length; its matrices (n, k) become
    the columns NAME_1 to NAME_k. Raises DataError.

    header: whether a text has one; None: if its first line holds names.
    """
    suffix = path.suffix.lower()
    if suffix == MATLAB:
        with reading_file(path):
            return _matlab(path)
    if suffix == PARQUET:
        with reading_file(path):
            return {path.stem: _parquet(path)}
    table = read_table(path, header is not False)
    if header is None and sum(map(is_number, table.titles)) > len(table.titles) / 2:
        table = read_table(path, False)
    return {path.name.partition(".")[0]: table}


def _parquet(path: Path) -> FileTable:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise DataError(f"{path}: reading Parquet needs pyarrow: pip install pyarrow") from error
    try:
        frame, left = _parquet_frame(path)
    except pyarrow.ArrowMemoryError:
        raise
    except (pyarrow.ArrowException, ValueError, KeyError, TypeError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"{path}: is not a Parquet file ({first_line_of(error)}); copy it again"
        ) from error
    if any(frame.index.names):
        frame = frame.reset_index()
    columns = {str(name): _plain(frame[name]) for name in frame}
    return FileTable.of(str(path), columns, word="row")._replace(notes=left)


def _parquet_frame(path: Path) -> tuple[Any, tuple[str, ...]]:
    """(frame, notes) of the columns with one value per row, read in batches and counted."""
    import pyarrow
    from pyarrow.parquet import ParquetFile

    plain = regular(path)
    with ParquetFile(plain) as file:
        schema = file.schema
        check_count(len(schema), path, "columns", "columns")
        parts = [schema.column(k) for k in range(len(schema))]
    flat = [part for part in parts if not part.max_repetition_level and part.path == part.name]
    # repeated texts are stored once
    texts = [part.name for part in flat if part.physical_type == "BYTE_ARRAY"]
    meter = Meter(path, plain.stat().st_size)
    with ParquetFile(plain, read_dictionary=texts) as file:
        batches = []
        for batch in file.iter_batches(AT_ONCE, columns=[part.name for part in flat]):
            meter.add(batch.nbytes)
            batches.append(batch)
        wanted = batches[0].schema if batches else file.schema_arrow
    note = f"{path}: {len(parts) - len(flat)} columns of lists or records left out"
    notes = (note,) if len(flat) < len(parts) else ()
    return pyarrow.Table.from_batches(batches, wanted).to_pandas(), notes


def _plain(cells: Any) -> Any:
    """Return a column without a special type: moments as POSIX nanoseconds."""
    if cells.dtype.kind == "M":
        return cells.to_numpy("datetime64[ns]").astype(np.int64)
    return cells.to_numpy() if cells.dtype.kind in "iuf" else cells.to_numpy(object)


def _matlab(path: Path) -> dict[str, FileTable]:
    with open_file(path) as file:
        is_hdf5 = file.read(4) == HDF5 or _is_hdf5_with_header(file)
    content = _of_version_73(path) if is_hdf5 else variables(path)
    found = dict(_tables(path, path.stem, content))
    if not found:
        raise DataError(
            f"{path}: holds no numeric arrays of two rows or more; tables and datetimes of MATLAB are "
            f"not read: save table2struct(T, 'ToScalar', true), times as numbers"
        )
    return found


def _is_hdf5_with_header(file: Any) -> bool:
    file.seek(512)  # MATLAB writes its own text before
    return bool(file.read(4) == HDF5)


def _of_version_73(path: Path) -> dict[str, Any]:
    import h5py

    def read(group: Any) -> dict[str, Any]:
        return {
            name: read(value) if isinstance(value, h5py.Group) else value[()].T
            for name, value in group.items()
            if not name.startswith("#") and (isinstance(value, h5py.Group) or is_array(value))
        }

    def is_array(value: Any) -> bool:
        return isinstance(value, h5py.Dataset) and value.dtype.kind in "iuf" and value.ndim > 0

    try:
        with open_hdf5(path) as file:
            return read(file)
    except (DataError, MemoryError):
        raise
    except Exception as error:  # h5py raises many types, ValueError for data types
        raise DataError(
            f"{path}: is not a complete MATLAB file ({first_line_of(error)}); copy it again"
        ) from error


def _tables(path: Path, name: str, content: Mapping[str, Any]) -> Iterator[tuple[str, FileTable]]:
    """Yield (name, Table) for the arrays of a struct and of its inner structs; arrays of one length
    form one table."""
    lengths: dict[int, dict[str, Any]] = {}
    for key, value in content.items():
        if isinstance(value, Mapping):
            yield from _tables(path, key if name == path.stem else f"{name}.{key}", value)
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or not array.size > 1:
            continue
        rows = array.reshape(len(array), -1)
        rows = rows.T if rows.shape[1] > rows.shape[0] else rows
        one = rows.shape[1] == 1
        columns = {key if one else f"{key}_{k + 1}": column for k, column in enumerate(rows.T)}
        lengths.setdefault(len(rows), {}).update(columns)
    for columns in lengths.values():
        called = name if len(lengths) == 1 else f"{name}.{next(iter(columns))}"
        label = called.removeprefix(f"{path.stem}.")
        yield label, FileTable.of(f"{path} [{label}]", columns, word="row")
