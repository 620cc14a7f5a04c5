"""`recording.toml`: the description of tables, in the room `description`, whose pydantic costs 0.2 s
and is loaded where it is needed."""

from pathlib import Path

from ...data.recording import Recording
from ..reader import Findings, Reader


def read(path: Path) -> Recording:
    """The Recording that a description yields. Raises DataError."""
    from ..description.read import read_description

    return read_description(path)


def inspect(path: Path) -> Findings:
    """Findings on all that a description names. Raises DataError where it is no TOML."""
    from ..description.inspected_description import inspect_description

    return inspect_description(path)


READER = Reader("recording.toml", (".toml",), "recording.toml that names tables", read, inspect)
