"""Readers of recordings: the files of the room `readers`, one per format, each of which ends in
`READER = Reader(...)`. Nothing else lists them. Plugins bring more.

A file whose first bytes are those that a format `begins` with is one, whatever its name. Others go
to the reader whose suffix their name has, to the one of the longest where several have one. Where a
format's suffix is also another's, its `sniff` is asked first; a file with a suffix that nobody has,
or with one of text and a content that is none, goes to the first whose `sniff` says yes. A zip of
one file that no reader knows by its own name has the name of that file.
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
"""Bytes of a file that tell text from other contents."""
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
    """{name: Reader} of all formats, those of plugins last."""
    return _own_readers() | {name: reader for name, (reader, _) in REGISTRY.plugin_values().items()}


def check(reader: Reader) -> None:
    """Refuse a Reader that cannot be used, or whose suffix is that of one of the library's without
    a `sniff` that tells the two apart. Raises DataError."""
    _check_fields(reader)
    for other in _own_readers().values():
        shared = set(reader.suffixes) & set(other.suffixes)
        if shared and reader.sniff is None and other.sniff is None:
            raise DataError(
                f"reader {reader.name!r}: files that end in {min(shared)} are read by "
                f"{other.name!r}; give it a sniff that tells them apart, or another suffix"
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
            'a tuple of endings in small letters as (".log", ".log.xz"), empty only beside a sniff',
        ),
        "summary": (reader.summary == "" or is_text(reader.summary), "one line of text"),
        "read": (
            callable(reader.read) or (reader.read is None and callable(reader.open)),
            "a function of a path, or None beside an open",
        ),
        "begins": (
            isinstance(reader.begins, tuple)
            and all(isinstance(each, bytes) and each for each in reader.begins),
            'a tuple of bytes as (b"LOG1",)',
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
    """The Reader of a file or a folder, or None of a file that none knows. Raises DataError where a
    `sniff` fails, where two readers claim the file alike, and for a folder that none knows."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # which the readers say in words of their own
    except (OSError, ValueError) as error:  # too long a name, a zero in it
        raise DataError(f"{str(path)[:80]!r}: is no path ({error.args[-1]}); check it") from None
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
        return readers()["table"]  # a pipe has no name that tells
    if found is None and path.is_dir():
        raise DataError(
            f"{path}: is a folder in which no reader finds what it knows; name the files themselves"
        )
    return found


def _claiming_reader(path: Path, name: str, head: bytes) -> Reader | None:
    """The Reader that claims a file of this name."""
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
                        f"{path}: the readers {reader.name!r} and {other.name!r} both take it for "
                        f"theirs; leave one of them out"
                    )
            return reader
    return None


def _is_text(head: bytes) -> bool:
    """Return True where first bytes may be those of a text: no text but UTF-16 has zeros."""
    return b"\0" not in head or head.startswith(UTF_16) or not any(head[1:200:2])


def _takes(reader: Reader, path: Path) -> bool:
    """Return True where a reader that claims a name takes the file. A folder needs a reader that
    looks into it; a missing file needs one that goes by names alone."""
    if not path.exists():
        return reader.sniff is None
    if not path.is_dir():
        return not reader.sniff or bool(ask(reader, "sniff", path))
    try:
        return reader.sniff is not None and bool(ask(reader, "sniff", path))
    except DataError:  # of a sniff that expects a file
        return False


def looker(path: Path) -> Reader:
    """The Reader that looks at a file: that of tables for a text of no known format. Raises
    DataError."""
    found = find(path)
    if found is None:  # an empty or a binary file is no table either
        is_empty = path.is_file() and not path.stat().st_size
        return taker(path) if is_empty or not _is_text(head_of(path, START)) else readers()["table"]
    return found


def ask(reader: Reader, function: str, path: Path, *arguments: Any) -> Any:
    """Return the result of a function of the reader. Any exception becomes a DataError of one
    line."""
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
            else f"fails at it in `{function}` ({type(error).__name__}: {reason}); its author should "
            f"know"
        )
        raise DataError(f"{path}: the reader {reader.name!r} {said}") from error


def taker(path: Path) -> Reader:
    """The Reader of a file. Raises DataError where there is none."""
    reader = find(path)
    if reader is not None:
        return reader
    if path.is_fifo():
        raise DataError(
            f"{path}: what comes through the pipe is no table of text, and no log that is known by its "
            f"first bytes; unpack it (as zcat does), or copy it to a file and name that"
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
            f"{path}: holds {len(inside)} files that are no recording together; unpack it and name "
            f"the files themselves"
        )
    if known:
        raise DataError(
            f"{path}: its name ends as files of {' and '.join(known)} do, and its content is none; "
            f"is it damaged or without its beginning? copy it again"
        )
    ending = "".join(path.suffixes[-2 if path.suffix.lower() in PACKED else -1 :]).lower()
    raise DataError(
        f"{path}: files of type {ending or '(no suffix)'!r} are not read; supported are "
        f"{', '.join(sorted({end for each in readers().values() for end in _plain(each)}))}: see "
        f"`strapdown fuse --help`"
    )


def formats() -> list[tuple[str, list[str]]]:
    """[(a few words, suffixes)] of the formats that are read."""
    return [(reader.summary, _plain(reader)) for reader in readers().values() if reader.summary]


def _plain(reader: Reader) -> list[str]:
    """Its suffixes of files that are not packed; none of a reader that only refuses."""
    return [each for each in reader.suffixes if reader.summary and not each.endswith(PACKED)]
