"""`recording.toml`, the description of tables. The room `description` is imported only when needed,
because its pydantic takes 0.2 s to load."""

from pathlib import Path

from ...data.recording import Recording
from ..reader import Findings, Reader


def read(path: Path) -> Recording:
    """Return the Recording of a description. Raises DataError."""
    from ..description.read import read_description

    return read_description(path)


def inspect(path: Path) -> Findings:
    """Return the findings on all files that a description names. Raises DataError for a file that
    is not TOML."""
    from ..description.inspected_description import inspect_description

    return inspect_description(path)


READER = Reader("recording.toml", (".toml",), "recording.toml that names tables", read, inspect)
