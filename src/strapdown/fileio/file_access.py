"""The ways of opening a file to read, each within `file_limits`: plain, unpacked and counted, a zip, a
folder, TOML and JSON. `tests/fileio/test_file_access.py` knows who else calls what opens a file, and why."""

import io
import json
import re
import struct
import tomllib
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, cast

from ..checks import DataError
from ..typing import File
from .limits import PIECE, LimitError, Meter, check_count, in_force, regular

LINE = 2 * PIECE + (1 << 12)
"""Bytes of a line of text at most, or a little more."""
STEP = 1 << 12
"""Bytes in which a line ends where lines are not long."""
ENDS = b"\n", b"\r"
WHOLE = 64
"""Bits of a whole number of TOML, by its specification."""
CELL = 8
ROW = 32
TEXT = 64
"""Bytes that a number, the rest of its row and a cell of text take in memory at least."""
SEPARATORS = b",", b";", b"\t", b"|"
NOT_KEYS = re.compile(
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:""")?'
    r"|'''(?:[^']++|'(?!''))*+(?:''')?"
    r'|"(?:[^"\\\n]++|\\.)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+",
    re.DOTALL,
)
"""Strings and comments of TOML."""


def open_file(path: File) -> BinaryIO:
    """A file open to read. Raises OSError, and DataError of what is no regular file or too large.

    What has no size is empty, so that files of the system's own (/proc), which have none, stay
    closed.
    """
    path = regular(path)
    if path.is_file() and not path.stat().st_size:
        return io.BytesIO()
    return path.open("rb")


def in_memory(text: bytes) -> int:
    """Bytes that the rows of a text become in memory, by its signs: never fewer than it has."""
    lines = max(map(text.count, ENDS))
    blanks = text.count(b" ") - text.count(b"  ")  # several are one separator
    cells = lines + max(blanks, *map(text.count, SEPARATORS))
    return max(len(text), CELL * cells + ROW * lines)


class _Metered(io.RawIOBase):
    """An open file whose bytes are counted while they are read."""

    def __init__(self, file: BinaryIO, meter: Meter, lines: bool) -> None:
        self._file, self._meter, self._lines = file, meter, lines
        self._line = 0  # bytes since the last end of a line
        self._at = 0  # bytes that were read

    def readable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def readinto(self, into: Any) -> int:
        count: int = self._file.readinto(into)  # type: ignore[attr-defined]
        self._at += count
        if self._lines:
            piece = bytes(memoryview(into)[:count])
            self._meter.add(in_memory(piece))
            self._check_line(piece)
        else:
            self._meter.add(count)
        return count

    def _check_line(self, piece: bytes) -> None:
        last = max(map(piece.rfind, ENDS))
        self._line = len(piece) - 1 - last + (self._line if last < 0 else 0)
        if self._line > LINE:
            raise _long_line(self._meter.path)

    def readall(self) -> bytes:
        pieces, into = [], memoryview(bytearray(PIECE))
        while count := self.readinto(into):
            pieces.append(bytes(into[:count]))
        return b"".join(pieces)

    def close(self) -> None:
        self._file.close()
        super().close()


def metered_file(file: BinaryIO, meter: Meter, lines: bool = False) -> BinaryIO:
    """An open file whose content is counted while it is read; of `lines` as `in_memory`, and none
    may be without an end. Raises DataError."""
    return cast(BinaryIO, io.BufferedReader(_Metered(file, meter, lines), PIECE))


def _long_line(path: File) -> LimitError:
    return LimitError(
        f"{path}: has a line of more than {LINE / 1e6:.0f} MB, so it is no table of text or log"
    )


def check_lines(path: File) -> None:
    """Refuse a plain file in which a line does not end, by looking at some places of it: one that
    is long covers one of them. Raises DataError."""
    with open_file(path) as file:
        size = file.seek(0, io.SEEK_END)
        for at in range(0, size - PIECE - STEP, PIECE):
            file.seek(at)
            if ENDS[0] not in file.read(STEP):
                piece = file.read(PIECE)
                if not any(end in piece for end in ENDS):
                    raise _long_line(path)


class Zip(zipfile.ZipFile):
    """A zip open to read, whose files are counted. Raises as ZipFile, and DataError."""

    def __init__(self, path: File) -> None:
        self.path, self._found = path, _Few(path)
        plain = regular(path)
        with _zip_errors(path):
            super().__init__(plain)
        self.meter = Meter(path, plain.stat().st_size)

    @property
    def filelist(self) -> list[zipfile.ZipInfo]:
        """Its files; ZipFile appends to it while it reads the directory."""
        return self._found

    @filelist.setter
    def filelist(self, files: Iterable[zipfile.ZipInfo]) -> None:
        self._found[:] = files

    def content(self, name: str, meter: Meter | None = None, lines: bool = False) -> BinaryIO:
        """Return the unpacked content of a file of the archive, open to read. Raises as `open`, and
        DataError."""
        with _zip_errors(self.path):
            return metered_file(cast(BinaryIO, self.open(name)), meter or self.meter, lines)


@contextmanager
def _zip_errors(path: File) -> Iterator[None]:
    """Around what opens a zip: whatever `zipfile` raises of a damaged one is a BadZipFile, and of one
    that it cannot read a DataError."""
    try:
        yield
    except DataError:
        raise
    except (NotImplementedError, RuntimeError) as error:  # another version or method, a password
        raise DataError(
            f"{path}: is packed in a way that is not read ({error}); unpack it yourself, and name its "
            f"files"
        ) from None
    except (ValueError, KeyError, IndexError, OverflowError, struct.error) as error:
        reason = "a name in it is no text" if isinstance(error, UnicodeError) else error
        raise zipfile.BadZipFile(str(reason)) from None


class _Few(list[zipfile.ZipInfo]):
    def __init__(self, path: File) -> None:
        self._path = path

    def append(self, info: zipfile.ZipInfo) -> None:
        check_count(len(self) + 1, self._path, "files")
        super().append(info)


def files_of(folder: Path, pattern: str = "*") -> Iterator[Path]:
    """The files of a folder. Raises DataError where they are too many."""
    found = list(islice(folder.glob(pattern), in_force().entries + 1))
    check_count(len(found), folder, "files")
    return iter(found)


def settings_text(path: File) -> str:
    """The text of a TOML or JSON file. Raises OSError, UnicodeDecodeError, and DataError where it is
    too large."""
    most = int(min(in_force().settings, 1e18))
    with open_file(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise LimitError(
            f"{path}: has more than {most / 1e6:.3g} MB, so it is no file of settings; raise the "
            f"limit (reading_limits(settings=...)) if it is yours"
        )
    return content.decode("utf-8").replace("\r\n", "\n")


def toml_of(text: str, path: File) -> dict[str, Any]:
    """Parse a text in TOML. Raises DataError, which names `path`, where it is not TOML, and where a
    parser would take long to read it: too many values, too deep, integers of more than 64 bits."""
    check_toml(text, path)
    try:
        found = tomllib.loads(text)
    except ValueError as error:  # tomllib's own, or an integer too long for Python
        raise DataError(f"{path}: is not TOML: {str(error).splitlines()[0]}") from error
    _check_whole(found, path)
    return found


def check_toml(text: str, path: File) -> None:
    """Refuse a text that a parser of TOML would take long to read, by its signs. Raises DataError."""
    signs = NOT_KEYS.sub(lambda found: "" if found[0][0] == "#" else "s", text)
    check_count(signs.count("=") + signs.count(","), path, "values")
    depth = most = 0
    for sign in re.findall(r"[\[\]{}]", signs):
        depth = max(0, depth + (1 if sign in "[{" else -1))
        most = max(most, depth)
    keys = re.split(r"[\n,=\[\]{}]", signs.replace(" ", "").replace("\t", ""))
    most = max(most, *(key.count(".") for key in keys))
    check_count(most, path, "tables within tables", "depth")


def _check_whole(value: Any, path: File, key: str = "") -> None:
    if isinstance(value, dict):
        for name, each in value.items():
            _check_whole(each, path, name)
    elif isinstance(value, list):
        for each in value:
            _check_whole(each, path, key)
    elif isinstance(value, int) and value.bit_length() > WHOLE:
        raise DataError(
            f"{path}: is not TOML: {key[:60]} is a whole number of more than {WHOLE} bits; write it "
            f"with a decimal point"
        )


def json_of(text: str | bytes, path: File) -> Any:
    """Parse a text in JSON. Raises DataError, which names `path`, where it is not JSON."""
    try:
        return json.loads(text)
    except RecursionError:
        raise LimitError(f"{path}: its JSON nests too deep") from None
    except ValueError as error:
        raise DataError(f"{path}: is not JSON: {str(error).splitlines()[0]}") from error
