"""Update a recording.toml with results from the recording that was read from it."""

import datetime
import difflib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from ...checks import DataError
from ...data.recording import Recording
from ...fileio.file_access import settings_text
from ...typing import File
from .installed import difference, installation_numbers
from .messages import load
from .rewriting import Keyed, change_installation, check_sections, rewrite, rewrite_text


class Change(NamedTuple):
    """A change that a command makes to the file of a recording."""

    recording: Recording  # as read from the file
    command: str  # follows the date in the comments that it writes
    section: Callable[[Any, Any, str], None] = change_installation

    def check(self, path: File) -> None:
        """Refuse a file that is not a description, or whose values differ from those that the
        recording was read with. Raises DataError."""
        check_sections(path, self._kinds)
        read = self.recording.meta.get("installed")
        differs = (
            "the recording was not read from a recording.toml, or was changed since"
            if read is None
            else difference(installation_numbers(load(path)), read)
        )
        if differs:
            raise DataError(f"{path}: {differs}; read that file and {self.command.split()[0]} it")

    def lines(self, path: File, edits: Iterable[Keyed]) -> list[str]:
        """Return the lines that the edits change, with their numbers: - old, + new. Raises
        DataError."""
        new = rewrite_text(path, edits, self._kinds, self._mark, self.section).splitlines()
        old, lines = settings_text(path).splitlines(), []
        matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
        for step, i, j, k, m in matcher.get_opcodes():
            if step != "equal":
                lines += [f"{row + 1:4d} - {old[row]}" for row in range(i, j)]
                lines += [f"{row + 1:4d} + {new[row]}" for row in range(k, m)]
        return lines

    def write(self, path: File, edits: Iterable[Keyed]) -> Path:
        """Change the file and return the path of the copy of the old one. Raises DataError without
        changing anything."""
        return rewrite(path, edits, self._kinds, self._mark, self.section)

    @property
    def _kinds(self) -> list[str]:
        return [a.kind for a in self.recording.sources]

    @property
    def _mark(self) -> str:
        return f"{datetime.date.today().isoformat()}, {self.command}"
