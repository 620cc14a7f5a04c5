"""Bare tables, such as CSV: they do not say their units and axes, so they are inspected, and a
recording.toml is drafted for them."""

from pathlib import Path

from ...checks import DataError
from ...recording import Recording
from ..contract import Findings, Reader
from ..table_file import SUFFIXES


def read(path: Path) -> Recording:
    """Raises DataError that says what to do instead."""
    raise DataError(
        f"{path}: a table alone does not say its units and axes; `strapdown inspect {path} --write "
        f"recording.toml` drafts the description to read instead"
    )


def inspect(path: Path) -> Findings:
    """Findings on a table by names and magnitudes of its columns. Raises DataError where it cannot
    be read."""
    from ..description.draft import inspect_table  # loads pydantic: 0.2 s

    return inspect_table(path)


def draft(path: Path, folder: Path | None = None) -> str:
    """Text of a `recording.toml` for the table. Raises DataError."""
    from ..description.draft import draft

    return draft(path, folder)


READER = Reader("table", SUFFIXES, "bare table", read, inspect, draft=draft)
