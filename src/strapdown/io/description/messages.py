"""Check `recording.toml` against its schema. Every error message is one line: file, [section] key,
error, remedy."""

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from ...checks import DataError, did_you_mean
from ...fileio.files import read_toml
from ...typing import File
from .schema import Description
from .schema_base import KeyPart


def load(path: File, content: dict[str, Any] | None = None) -> Description:
    """Return the Description in a TOML file, or in `content`. Raises DataError with the first error
    message and the number of others."""
    lines = complaints(path, content)
    if isinstance(lines, Description):
        return lines
    raise DataError(lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""))


def complaints(path: File, content: dict[str, Any] | None = None) -> Description | list[str]:
    """Return the Description in a TOML file, or the list of its errors, one line each. `content`,
    if given, replaces the file; messages still name `path`. Raises DataError for a file that is not
    TOML."""
    content = parse(path) if content is None else content
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        # unknown keys first: a misspelt key explains a missing one
        not_unknown = lambda item: item["type"] != "extra_forbidden"
        items = sorted(error.errors(include_url=False), key=not_unknown)
        return [f"{path}: {_complaint(item, content)}" for item in items]


def parse(path: File) -> dict[str, Any]:
    """Return the content of a TOML file as a dict. Raises DataError."""
    content = read_toml(path, "check the path")
    if not content:
        raise DataError(
            f'{path}: is empty; see the page "Recordings on disk: recording.toml" of the documentation'
        )
    return content


def _complaint(item: ErrorDetails, content: dict[str, Any]) -> str:
    location, kind, message = (
        list(item["loc"]),
        item["type"],
        item["msg"].removeprefix("Value error, "),
    )
    if kind == "extra_forbidden":
        *location, key = location
        kind, known = "value_error", _keys(location)
        message = f"unknown key {key!r}{did_you_mean(key, known)}; known: {', '.join(known)}"
    elif kind == "missing":
        message = "is missing"
    elif kind != "value_error":
        message = f"{message[0].lower()}{message[1:]}, not {str(item['input'])[:40]!r}"
    place = _place(location, content)
    return (
        f"{place} {message}"
        if kind == "value_error" and place.endswith("]") or place.endswith(")")
        else f"{place}: {message}"
    )


def _place(location: Sequence[int | str], content: dict[str, Any]) -> str:
    if not location:
        return "top level"
    if location[0] == "source" and len(location) > 1:
        number = int(location[1])
        entry = content["source"][number]
        kind = entry.get("kind") if isinstance(entry, dict) else None
        head, rest = f"[[source]] {number + 1}{f' ({kind})' if kind else ''}", location[2:]
    elif isinstance(content.get(str(location[0])), dict):
        head, rest = f"[{location[0]}]", location[1:]
    else:
        head, rest = (
            ("", location)
            if location[0] in ("epoch", "date", "point", "vehicle")
            else (f"[{location[0]}]", location[1:])
        )
    return " ".join(part for part in (head, ".".join(map(str, rest))) if part)


def _keys(location: Sequence[int | str]) -> list[str]:
    model: type[KeyPart] = Description
    for name in location:
        if isinstance(name, str):
            annotation = model.model_fields[name].annotation
            model = next(
                part
                for part in [annotation, *getattr(annotation, "__args__", ())]
                if isinstance(part, type) and issubclass(part, KeyPart)
            )
    return list(model.model_fields)
