"""The tables that a description names, and where they are."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from ...checks import DataError
from ...typing import Array, File
from ..locate import locate
from ..table_file import Table, read_table
from .schema_base import Time


class Files:
    """The tables that one description names, each read once."""

    def __init__(self, description_path: File) -> None:
        self.path = Path(description_path)
        self.folder = self.path.parent
        self.table = cache(self._table)

    def _table(self, file: str, header: bool = True) -> Table:
        return read_table(self.locate(file), header)

    def locate(self, file: str) -> Path:
        """The path that the description means by `file`."""
        try:
            return locate(file, self.folder)
        except DataError as error:
            raise DataError(f"{self.path}: {error}") from None

    def columns(
        self, file: str, time: Time, columns: Sequence[str | int]
    ) -> tuple[Table, Array, list[Array]]:
        """(Table, t in s, list of arrays) of one file; columns given by number say that it has
        no header."""
        table = self.table(
            file, not any(isinstance(column, int) for column in (time.column, *columns))
        )
        t = table.numbers(time.column) * (time.scale * time.unit) + time.offset
        return table, t, [table.numbers(column) for column in columns]
