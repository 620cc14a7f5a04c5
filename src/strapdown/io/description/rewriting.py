"""Change values of a `recording.toml` in place and keep its comments, order and layout."""

import os
import re
import stat
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Float, InlineTable, Item, Table, Trivia

from ...checks import DataError
from ...data.calibration_parameters import CLOCK, LEVER_ARM, MOUNTING
from ...fileio.file_access import open_file, toml_of
from ...fileio.files import replacing, together
from ...typing import File
from ...units.conversion import DEG
from .edits import Edit, deviations, number, round_std

TIME = CLOCK.key
ASSUMED = "assumed"  # key of [imu]; a newly written value, except a clock, is no longer assumed


class Keyed(Protocol):
    """An edit of one key of a section."""

    @property
    def source(self) -> int | None:
        """[[source]], from 0; None: [imu]."""

    @property
    def key(self) -> str:
        """The key of the section that changes."""


def change_installation(section: Any, edit: Edit, mark: str) -> None:
    """Set the key of a section, and its comment."""
    key = edit.key
    if edit.of is CLOCK:
        time, std = section[TIME], edit.std[0]
        set_key(
            section, "offset", _number(time.get("offset", 0.0) + edit.value[0], std, edit), TIME
        )
        inline = isinstance(time, InlineTable)
        where, key = (section, TIME) if inline else (section[TIME], "offset")
        said = f"{'offset ' if where is section else ''}+- {round_std(std)} s"
    elif edit.of is MOUNTING:
        where, said = section, deviations(edit)
        _set_mounting(section, edit)
    elif edit.of is LEVER_ARM:
        where, said = section, deviations(edit)
        _set_arm(section, edit)
    else:
        where, said = section, f"+- {round_std(edit.std[0])} of it"
        _set_scale(section, edit)
    notify(where[key], f"{said}, {mark}", mark)


def rewrite_text(
    path: File,
    edits: Iterable[Keyed],
    kinds: Sequence[str],
    mark: str,
    change: Callable[[Any, Any, str], None] = change_installation,
) -> str:
    """Return the text of a description with changed values. Each gets a comment with its standard
    deviation and `mark` at the end. kinds: those of [[source]] that it must have; change: function
    that applies an edit and the mark to a section of tomlkit.

    Raises DataError for another file, or where a change would affect other values.
    """
    text = _text(path)
    old, content = _check_sections(path, text, kinds)
    edits = list(edits)
    for edit in edits:
        own = [name for name in ("gyro", "accel") if TIME in old["imu"].get(name, {})]
        if own and isinstance(edit, Edit) and edit.source is None and edit.key == TIME:
            raise DataError(
                f"{path}: [imu] {own[0]} has its own time; add {edit.value[0]:+.4g} s to the "
                f"offset of each time of [imu] by hand"
            )
    try:
        for edit in edits:
            section: Any = content["imu"] if edit.source is None else content["source"][edit.source]
            change(section, edit, mark)
            if edit.key != TIME and edit.key in section.get(ASSUMED, ()):
                section[ASSUMED].remove(edit.key)
        # tomlkit ends its own lines with \n
        ends = "\r\n" if "\r\n" in text else "\n"
        new = tomlkit.dumps(content).replace("\r\n", "\n").replace("\n", ends)
        made = tomllib.loads(new)
    except (TOMLKitError, tomllib.TOMLDecodeError, TypeError, AttributeError, KeyError):
        raise _unable(path, edits) from None
    if _others(made, edits) != _others(old, edits) or not all(_there(made, e) for e in edits):
        raise _unable(path, edits)
    return new


def rewrite(
    path: File,
    edits: Iterable[Keyed],
    kinds: Sequence[str],
    mark: str,
    change: Callable[[Any, Any, str], None] = change_installation,
) -> Path:
    """Change a description on disk (see `rewrite_text`) and return the path of the copy of the old
    one beside it, NAME.before or NAME.before-2, ... Raises DataError without changing anything."""
    new = rewrite_text(path, edits, kinds, mark, change)
    check_writable(path)
    target = Path(os.path.realpath(path))
    copy = _free_name(target)
    with together():
        with replacing(copy) as part:
            part.write_bytes(target.read_bytes())
        with replacing(target) as part:
            part.write_bytes(new.encode())
            part.chmod(target.stat().st_mode)
    return copy


def _text(path: File) -> str:
    if Path(path).suffix.lower() != ".toml":
        raise DataError(
            f"{path}: only a recording.toml can be changed; change the file that it was made from"
        )
    try:
        with open_file(path) as file:
            return file.read().decode("utf-8")
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise DataError(f"{path}: is not UTF-8 text; save it as UTF-8") from None


def check_writable(path: File) -> None:
    """Refuse a read-only file. Raises DataError."""
    if not Path(os.path.realpath(path)).stat().st_mode & stat.S_IWUSR:
        raise DataError(f"{path}: is read-only; make it writable, or change it by hand")


def _free_name(target: Path) -> Path:
    """Return a free path beside a file for its copy."""
    number = 1
    while True:
        copy = target.with_name(f"{target.name}.before{f'-{number}' if number > 1 else ''}")
        if not os.path.lexists(copy):
            return copy
        number += 1


def check_sections(path: File, kinds: Sequence[str]) -> None:
    """Refuse a file that is not a description with sources of these kinds. Raises DataError."""
    _check_sections(path, _text(path), kinds)


def _check_sections(path: File, text: str, kinds: Sequence[str]) -> tuple[dict[str, Any], Any]:
    """(content, the same as an editable document) of a description. Raises DataError."""
    try:
        old, content = toml_of(text, path), tomlkit.parse(text)
    except TOMLKitError as error:
        raise DataError(f"{path}: is not valid TOML: {str(error).splitlines()[0]}") from None
    sources = old.get("source", [])
    found = [each.get("kind") for each in sources if isinstance(each, dict)]
    if "imu" not in old or found != list(kinds):
        there = f"[imu] and {len(found)} [[source]]" if "imu" in old else "no [imu]"
        raise DataError(
            f"{path}: has {there} ({', '.join(map(str, found))}), but the recording has "
            f"{', '.join(kinds)}; give the file from which it was read"
        )
    return old, content


def _unable(path: File, edits: Iterable[Keyed]) -> DataError:
    keys = dict.fromkeys(edit.key for edit in edits)
    return DataError(
        f"{path}: its layout cannot be changed in place; change it by hand, or write "
        f"{' and '.join(f'`{key}`' for key in keys)} as keys of their section"
    )


def _set_mounting(section: Any, edit: Edit) -> None:
    if edit.key not in section:
        set_key(section, edit.key, tomlkit.value('{ unit = "deg" }'))
    given = section[edit.key]
    unit = DEG if given["unit"] == "deg" else 1.0
    std = min(each for each in edit.std if each) / unit
    for name, angle in zip(MOUNTING.components, edit.value):
        item = _number(angle / unit, std, edit)
        if name in given or float(item.as_string()):
            set_key(section, name, item, edit.key)


def _set_arm(section: Any, edit: Edit) -> None:
    least = min(each for each in edit.std if each)
    items = [_number(x, std or least, edit) for x, std in zip(edit.value, edit.std)]
    if edit.key not in section:
        texts = ", ".join(item.as_string() for item in items)
        set_key(section, edit.key, tomlkit.value(f"[{texts}]"))
        return
    for axis, (item, std) in enumerate(zip(items, edit.std)):
        if std:
            section[edit.key][axis] = item


def _set_scale(section: Any, edit: Edit) -> None:
    (by,), (std,) = edit.value, edit.std
    old = section.get(edit.key, 1.0)
    if isinstance(old, list):
        for i, each in enumerate(old):
            old[i] = _number(each * by, abs(each) * std, edit)
    else:
        set_key(section, edit.key, _number(old * by, abs(old) * std, edit))


def set_key(section: Any, key: str, item: Item, within: str | None = None) -> None:
    """Set a key of a section, or of its table `within`; a new key follows the last one, before
    comments at the end."""
    table = section if within is None else section[within]
    if key in table:
        table[key] = item
    elif isinstance(table, InlineTable):
        head = table.as_string().rstrip("}")
        space = head[len(head.rstrip()) :]
        comma = ", " if len(table) else ""
        section[within] = tomlkit.value(
            f"{head.rstrip()}{comma}{key} = {item.as_string()}{space}}}"
        )
    elif isinstance(table, Table):
        behind, body = [], table.value.body
        while body and body[-1][0] is None:
            behind.append(body.pop())
        table.append(key, item)
        body.extend(reversed(behind))
    else:
        table[key] = item


def _number(value: float, std: float, edit: Edit) -> Item:
    """Return a number with the digits that are significant by its standard deviation."""
    text = number(value, std, edit.of.digits)
    return Float(float(text), Trivia(), text)


def notify(item: Item, text: str, mark: str) -> None:
    """Add `text`, which has `+-` or `95 %` and ends with the mark, to the comment of an item or of
    the last item in a section, and replace an earlier addition."""
    if isinstance(item, Table):  # a separate section
        item = next(reversed(list(item.values())))
    kind = re.escape(mark.partition(", ")[2])
    own = rf"(?:^|; )[^;]*(?:\+-|95 %) [^;]*, \d{{4}}-\d\d-\d\d, {kind}$"
    before = re.sub(own, "", item.trivia.comment.lstrip("#").strip())
    space = item.trivia.comment_ws
    item.comment("; ".join(filter(None, [before, text])))
    item.trivia.comment_ws = space or "  "


def _path(edit: Keyed) -> tuple[Any, ...]:
    """Return the keys that lead to the value of an edit."""
    section: tuple[Any, ...] = ("imu",) if edit.source is None else ("source", edit.source)
    return (*section, "time", "offset") if edit.key == TIME else (*section, edit.key)


def _others(content: dict[str, Any], edits: Iterable[Keyed]) -> Any:
    """Return the content without the values that the edits change."""
    left = tomllib.loads(tomlkit.dumps(content))  # a copy
    for edit in edits:
        *way, last = _path(edit)
        place: Any = left
        for step in way:
            place = place[step]
        place.pop(last, None)
    left["imu"].pop(ASSUMED, None)
    return left


def _there(made: dict[str, Any], edit: Keyed) -> bool:
    """Return True where the content has the key of an edit."""
    place: Any = made
    for step in _path(edit):
        if isinstance(place, dict) and step not in place:
            return False
        place = place[step]
    return True
