"""Standard output of a command: text for people, with --quiet the verdict alone, with --json one
document for programs.

A command says lines and tables (`say`, `note`, `table`), adds numbers to the document (`record`) and
names the files that it wrote (`wrote`). `command_output`, which is around every command, decides what of
that is shown. Light, since every start loads it.
"""

import codecs
import errno
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from io import StringIO, TextIOBase, TextIOWrapper
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any, TextIO

import typer

INTERRUPTED = 130
"""Exit code after Ctrl-C."""
NARROWEST = 32
"""Columns that text has at least."""
PROSE = 24
"""Characters from which on a cell of several words may go on in the next line."""
GAPS = 2, 1
"""Columns between two columns of a table, and where it is narrow."""


class _Output:
    """Output of one command: its document and its files; `shown` is standard output, where that is
    not for all that it says."""

    def __init__(self, command: str = "", as_json: bool = False, quiet: bool = False) -> None:
        self.document: dict[str, Any] = {"command": command, "notes": [], "written": []}
        self.as_json, self.quiet = as_json, quiet
        self.shown: TextIO | None = sys.stdout if as_json or quiet else None
        self.written: dict[str, list[str]] = {}


_current = _Output()


@contextmanager
def command_output(command: str, as_json: bool, quiet: bool) -> Iterator[None]:
    """Show what a command says as it was asked to: the line of its files comes last, the document
    alone. A command that ends by an exit code has its results."""
    global _current
    before, _current = _current, _Output(command, as_json, quiet)
    unseen = redirect_stdout(StringIO()) if _current.shown else nullcontext()
    try:
        with unseen:
            try:
                yield
            finally:
                _say_written()
    except (SystemExit, typer.Exit):
        _print_document()
        raise
    else:
        _print_document()
    finally:
        _current = before


def is_quiet() -> bool:
    """True where only the verdict and errors are to be seen."""
    return _current.quiet


def is_shown() -> bool:
    """True where lines for people go to standard output."""
    return _current.shown is None


def say(text: str = "") -> None:
    """Print a line, on a terminal in lines of its width that go on indented."""
    _print(text, sys.stdout)


def say_verdict(text: str) -> None:
    """The same of a line that --quiet shows too."""
    _print(text, _current.shown if _current.shown and not _current.as_json else sys.stdout)


def complain(text: str) -> None:
    """Print a line on standard error."""
    _print(text, sys.stderr)


def _print(text: str, stream: TextIO) -> None:
    print("\n".join(on_terminal(text, stream)), file=stream, flush=stream is sys.stderr)


def note(text: str) -> None:
    """Say what a user must know beside the result."""
    say(f"note: {text}")
    record_note(text)


def record_note(text: str) -> None:
    """The same of what was said already."""
    _current.document["notes"].append(text)


def record(**facts: Any) -> None:
    """Add to the document; what is a mapping already goes on."""
    for key, value in facts.items():
        there = _current.document.get(key)
        if isinstance(there, dict) and isinstance(value, dict):
            there.update(value)
        else:
            _current.document[key] = value


def wrote(*paths: Path | str) -> None:
    """Name files that were written, for the last line and the document."""
    for path in map(Path, paths):
        _current.document["written"].append(str(path))
        _current.written.setdefault(str(path.parent), []).append(path.name)


def _say_written() -> None:
    """The line of all files: a folder is named once."""
    folders = []
    for folder, names in _current.written.items():
        first = "" if folder == "." else f"{folder}/"
        folders.append(first + ", ".join(names))
    if folders:
        say(f"wrote {'; '.join(folders)}")


def _print_document() -> None:
    if _current.as_json:
        from .. import __version__

        document = {"strapdown": __version__, **_current.document}
        print(json.dumps(plain(document), indent=1, allow_nan=False), file=_current.shown)


def plain(value: Any) -> Any:
    """A value in the types of JSON, which knows no NaN: null."""
    if hasattr(value, "to_dict"):  # a table of pandas
        value = value.to_dict("records")
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if hasattr(value, "tolist"):  # an array or a number of numpy
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


# ---- what fits a terminal


SPELT = {
    **{"σ": " sigma", "μ": "u", "µ": "u", "Δ": "delta ", "√": "sqrt", "χ": "chi"},
    **{
        "°": " deg",
        "±": "+-",
        "²": "^2",
        "³": "^3",
        "·": "*",
        "×": "x",
        "−": "-",
        "–": "-",
        "…": "...",
    },
    **{"≤": "<=", "≥": ">=", "→": "->", "“": '"', "”": '"', "‘": "'", "’": "'"},
}
"""{sign: how it is spelt where the output has no such sign}."""


def _spell(error: UnicodeError) -> tuple[str, int]:
    """As codecs ask: the signs of an error in others that every output has."""
    assert isinstance(error, UnicodeEncodeError)
    signs = error.object[error.start : error.end]
    texts = (SPELT.get(sign) or sign.encode("ascii", "backslashreplace").decode() for sign in signs)
    return "".join(texts), error.end


def spell_for(stream: TextIO) -> None:
    """Let a stream that has no UTF-8 spell the signs that it does not have."""
    codecs.register_error("strapdown", _spell)
    if isinstance(stream, TextIOWrapper):
        stream.reconfigure(errors="strapdown")


class ClosedOutput(TextIOBase):
    """Standard output of a process that was started without it."""

    def write(self, text: str) -> int:
        """As of a stream that takes nothing."""
        raise OSError(errno.EBADF, "it is closed")


def open_standard_streams() -> None:
    """Put streams where a process was started without them, and let no file that it opens have their
    numbers, since processes that it starts write there."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the first number that is free
    if sys.stdout is None:
        sys.stdout = ClosedOutput()
    if sys.stderr is None:
        sys.stderr = _nowhere()


def give_up_output() -> None:
    """Let all that is still to be printed go nowhere: standard output takes no more."""
    nowhere = _nowhere()
    try:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
    except (OSError, ValueError):
        sys.stdout = nowhere


def _nowhere() -> TextIO:
    return os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")


def text_width() -> int:
    """Columns that text has."""
    return max(get_terminal_size().columns, NARROWEST)


def fit_lines(text: str, width: int, indent: str = "", further: str | None = None) -> list[str]:
    """A text in lines of a width, broken between words alone; `further` begins those after the
    first."""
    return wrap(
        text,
        width,
        initial_indent=indent,
        subsequent_indent=indent if further is None else further,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [""]


def on_terminal(text: str, stream: TextIO) -> list[str]:
    """A text as it goes to a stream: to a terminal in lines that fit, which go on below what they
    begin with."""
    if not stream.isatty():
        return [text]
    found = []
    for line in text.split("\n"):
        indent = " " * (len(line) - len(line.lstrip()))
        short = len(line) <= text_width()
        found += [line] if short else fit_lines(line.strip(), text_width(), indent, f"{indent}    ")
    return found


def table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> None:
    """Print a table as wide as its cells, on a terminal as wide as that."""
    head, found = layout(header, rows)
    for line in [*head, *(line for lines in found for line in lines)]:
        print(line)


def known_columns(
    header: Sequence[str], rows: Sequence[Sequence[str]]
) -> tuple[list[str], list[list[str]]]:
    """A table without the columns in which nothing is known."""
    kept = [i for i in range(len(header)) if any(row[i] != "-" for row in rows)]
    return [header[i] for i in kept], [[row[i] for i in kept] for row in rows]


def layout(
    header: Sequence[object], rows: Iterable[Sequence[object]]
) -> tuple[list[str], list[list[str]]]:
    """(Lines of the header, lines of each row) of a table.

    Where the terminal is too narrow headers go on below themselves, then long texts. Where that is
    not enough each row is a list of its cells, and there is no header.
    """
    names, cells = [*map(str, header)], [[*map(str, row)] for row in rows]
    columns = [*zip(names, *cells)]
    room = text_width() if sys.stdout.isatty() else sys.maxsize
    for gap in GAPS:
        widths = _widths(columns, room - gap * (len(columns) - 1))
        if widths:
            rule = ["-" * width for width in widths]
            head = [*_row(names, widths, gap), *_row(rule, widths, gap)]
            return head, [_row(row, widths, gap) for row in cells]
    return [], [_list_lines(names, row, room) for row in cells]


def _widths(columns: Sequence[Sequence[str]], room: int) -> list[int] | None:
    """Widths of columns that fit, or None."""
    whole = [max(map(len, column)) for column in columns]
    least = [
        max(_longest_word(head), *(len(cell) for cell in cells), 0) for head, *cells in columns
    ]
    if sum(least) > room:
        least = [
            max(map(_longest_word, column)) if _is_prose(column) else width
            for column, width in zip(columns, least)
        ]
    spare = room - sum(least)
    if spare < 0:
        return None
    # what is left goes to the narrowest of those that would take more
    while spare and (short := [i for i, width in enumerate(least) if width < whole[i]]):
        least[min(short, key=least.__getitem__)] += 1
        spare -= 1
    return least


def _longest_word(text: str) -> int:
    return max(map(len, text.split()), default=0)


def _is_prose(column: Sequence[str]) -> bool:
    """True of texts; numbers stay in one line."""
    return any(len(cell) > PROSE and cell.count(" ") > 2 for cell in column[1:])


def _row(cells: Sequence[str], widths: Sequence[int], gap: int) -> list[str]:
    """The lines of a row: each cell goes on below itself."""
    parts = [
        [cell] if len(cell) <= width else fit_lines(cell, width)
        for cell, width in zip(cells, widths)
    ]
    return [
        (" " * gap).join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip()
        for line in zip_longest(*parts, fillvalue="")
    ]


def _list_lines(names: Sequence[str], row: Sequence[str], room: int) -> list[str]:
    """A row as a list: its first cell, and the others below it with their headers."""
    lines = fit_lines(row[0], room)
    for name, cell in zip(names[1:], row[1:]):
        if cell:
            lines += fit_lines(f"{name}: {cell}" if name else cell, room, "  ", "    ")
    return lines


def has_colour() -> bool:
    """True of a terminal that shows colours, unless NO_COLOR is set (https://no-color.org)."""
    able = sys.stdout.isatty() and os.environ.get("TERM") != "dumb"
    return able and not os.environ.get("NO_COLOR")
