"""Readers of recordings: the files of the room `readers`, one per format, each ending in `READER =
Reader(...)`. There is no other list of them. Plugins add more.

A file that begins with the bytes `begins` of a format has this format, whatever its name. For other
files the suffix decides, the longest one that fits. Where two formats share a suffix, `sniff` is
called first. A file with an unknown suffix, or with a text suffix but other content, goes to the
first reader whose `sniff` returns True. A zip with one file counts under the name of that file
unless a reader claims the zip itself.
"""

import importlib
import pkgutil
from functools import cache
from pathlib import Path
from typing import Any

from .. import plugins
from ..checks import DataError, printable
from ..extras import name_extra
from ..fileio.limits import reading_within, regular
from .reader import Reader
from .tables.table_file import PACKED, SUFFIXES as OF_TEXT, files_in, head_of

START = 1 << 12
"""Number of bytes that distinguish text from other content."""
UTF_16 = (b"\xff\xfe", b"\xfe\xff")


@cache
def _own_readers() -> dict[str, Reader]:
    folder = f"{__package__}.readers"
    path = importlib.import_module(folder).__path__
    modules = [
        importlib.import_module(f"{folder}.{module.name}") for module in pkgutil.iter_modules(path)
    ]
    return {module.READER.name: module.READER for module in modules}


def readers() -> dict[str, Reader]:
    """Return {name: Reader} of all formats, those of plugins last."""
    return _own_readers() | {name: reader for name, (reader, _) in REGISTRY.plugin_values().items()}


def check(reader: Reader) -> None:
    """Refuse an unusable Reader, and one that shares a suffix with a reader of the library but has
    no `sniff` to distinguish the two. Raises DataError."""
    _check_fields(reader)
    for other in _own_readers().values():
        shared = set(reader.suffixes) & set(other.suffixes)
        if shared and reader.sniff is None and other.sniff is None:
            raise DataError(
                f"reader {reader.name!r}: files that end in {min(shared)} are read by "
                f"{other.name!r}; give it a sniff that distinguishes them, or another suffix"
            )


def _check_fields(reader: Reader) -> None:
    def is_text(value: object) -> bool:
        return isinstance(value, str) and value.strip() != "" and len(value.splitlines()) == 1

    suffixes, has_sniff = reader.suffixes, reader.sniff is not None
    fits = {
        "name": (is_text(reader.name), "text"),
        "suffixes": (
            isinstance(suffixes, tuple)
            and all(is_text(each) and each[0] == "." and each == each.lower() for each in suffixes)
            and (len(suffixes) > 0 or has_sniff),
            'a tuple of endings in lower case, such as (".log", ".log.xz"), empty only with a sniff',
        ),
        "summary": (reader.summary == "" or is_text(reader.summary), "one line of text"),
        "read": (
            callable(reader.read) or (reader.read is None and callable(reader.open)),
            "a function of a path, or None with an open",
        ),
        "begins": (
            isinstance(reader.begins, tuple)
            and all(isinstance(each, bytes) and each for each in reader.begins),
            'a tuple of bytes, such as (b"LOG1",)',
        ),
    }
    for name in ("inspect", "sniff", "open"):
        value = getattr(reader, name)
        fits[name] = value is None or callable(value), "a function of a path, or None"
    for name, (fitting, wanted) in fits.items():
        if not fitting:
            raise DataError(
                f"reader {reader.name!r}: {name} is {getattr(reader, name)!r:.60}; it must be {wanted}"
            )


REGISTRY = plugins.Registry(
    Reader,
    "no reader is called",
    lambda name: _own_readers().get(name),
    lambda: _own_readers(),
    check,
)


def find(path: Path) -> Reader | None:
    """Return the Reader of a file or a folder, or None for an unknown file. Raises DataError where
    a `sniff` fails, where two readers equally claim the file, and for an unknown folder."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # the readers have their own messages for this
    except (OSError, ValueError) as error:  # too long a name, a zero in it
        raise DataError(f"{str(path)[:80]!r}: is not a path ({error.args[-1]}); check it") from None
    regular(path)
    inside = files_in(path)
    head = head_of(path, START) if len(inside) < 2 else b""
    for reader in readers().values():
        if reader.begins and head.startswith(reader.begins):
            return reader
    found = _claiming_reader(path, path.name, head)
    if found is None and len(inside) == 1:
        found = _claiming_reader(path, f"{inside[0]}.zip", head)
    if found is None and path.is_fifo() and head and _is_text(head):
        return readers()["table"]  # a pipe has no file name
    if found is None and path.is_dir():
        raise DataError(
            f"{path}: is a folder without files that a reader recognises; give the files themselves"
        )
    return found


def _claiming_reader(path: Path, name: str, head: bytes) -> Reader | None:
    """Return the Reader that claims a file of this name."""
    lower, claims = name.lower(), []
    misnamed = lower.endswith(OF_TEXT) and not _is_text(head)
    for reader in readers().values():
        length = max((len(end) for end in reader.suffixes if lower.endswith(end)), default=0)
        if length or reader.sniff:
            claims.append(((0 if misnamed else -length, reader.sniff is None), reader))
    claims.sort(key=lambda each: each[0])
    for number, (claim, reader) in enumerate(claims):
        if _takes(reader, path):
            for other_claim, other in claims[number + 1 :]:
                if other_claim == claim and _takes(other, path):
                    raise DataError(
                        f"{path}: the readers {reader.name!r} and {other.name!r} both claim it; "
                        f"remove one of them"
                    )
            return reader
    return None


def _is_text(head: bytes) -> bool:
    """Return True where first bytes may be text; only UTF-16 text contains zeros."""
    return b"\0" not in head or head.startswith(UTF_16) or not any(head[1:200:2])


def _takes(reader: Reader, path: Path) -> bool:
    """Return True where a reader that claims the name accepts the file. A folder needs a reader
    that inspects it; a missing file needs a reader that uses only the name."""
    if not path.exists():
        return reader.sniff is None
    if not path.is_dir():
        return not reader.sniff or bool(ask(reader, "sniff", path))
    try:
        return reader.sniff is not None and bool(ask(reader, "sniff", path))
    except DataError:  # from a sniff that expects a file
        return False


def looker(path: Path) -> Reader:
    """Return the Reader that inspects a file; the table reader for text of unknown format. Raises
    DataError."""
    found = find(path)
    if found is None:  # an empty or binary file is not a table either
        is_empty = path.is_file() and not path.stat().st_size
        return taker(path) if is_empty or not _is_text(head_of(path, START)) else readers()["table"]
    return found


def ask(reader: Reader, function: str, path: Path, *arguments: Any) -> Any:
    """Return the result of a function of the reader. Any exception becomes a one-line DataError."""
    try:
        with reading_within(path):
            return getattr(reader, function)(path, *arguments)
    except DataError as error:
        if printable(path.name) in str(error):
            raise
        raise DataError(f"{path}: {error}") from error
    except (Exception, SystemExit) as error:
        if told := name_extra(error):
            raise DataError(f"{path}: {told}") from error
        reason = (str(error).splitlines() or [""])[0]
        said = (
            f"needs a package that is not installed ({reason}); install it"
            if isinstance(error, ImportError)
            else f"fails in `{function}` ({type(error).__name__}: {reason}); report this to its "
            f"author"
        )
        raise DataError(f"{path}: the reader {reader.name!r} {said}") from error


def taker(path: Path) -> Reader:
    """Return the Reader of a file. Raises DataError where there is none."""
    reader = find(path)
    if reader is not None:
        return reader
    if path.is_fifo():
        raise DataError(
            f"{path}: the data from the pipe are neither a text table nor a log with known first bytes; "
            f"decompress them (as zcat does), or copy them to a file and give that"
        )
    known = [
        each.name
        for each in readers().values()
        if path.name.lower().endswith(each.suffixes or ("\0",))
    ]
    if (known or not path.suffix) and not path.exists():
        raise DataError(f"{path}: cannot be read (no such file or folder); check the path")
    if path.is_file() and not path.stat().st_size:
        raise DataError(f"{path}: is empty; copy it again from the device")
    if len(inside := files_in(path)) > 1:
        raise DataError(
            f"{path}: holds {len(inside)} files that are not a recording together; unpack it and give "
            f"the files themselves"
        )
    if known:
        raise DataError(
            f"{path}: its suffix is that of {' and '.join(known)}, but its content is not; "
            f"it may be damaged or lack its beginning: copy it again"
        )
    ending = "".join(path.suffixes[-2 if path.suffix.lower() in PACKED else -1 :]).lower()
    raise DataError(
        f"{path}: files of type {ending or '(no suffix)'!r} cannot be read; supported are "
        f"{', '.join(sorted({end for each in readers().values() for end in _plain(each)}))}: see "
        f"`strapdown fuse --help`"
    )


def formats() -> list[tuple[str, list[str]]]:
    """Return [(short description, suffixes)] of the supported formats."""
    return [(reader.summary, _plain(reader)) for reader in readers().values() if reader.summary]


def _plain(reader: Reader) -> list[str]:
    """Return its suffixes of uncompressed files; none for a reader that only refuses."""
    return [each for each in reader.suffixes if reader.summary and not each.endswith(PACKED)]
