"""Bare tables, such as CSV, MATLAB and Parquet. They do not state units and axes, so the reader
guesses these and reports each guess."""

from pathlib import Path

from ..reader import Log, Reader
from ..tables.table_arrays import SUFFIXES


def open_table(path: Path) -> Log:
    """The Log of a file of tables. Raises DataError."""
    from ..columns.draft import open_table  # loads pydantic: 0.2 s

    return open_table(path)


READER = Reader(
    "table", SUFFIXES, "table of any columns, as CSV, MATLAB or Parquet", open=open_table
)
