"""Reading `recording.toml` against its schema. Every complaint is one line: file, [section] key,
what is wrong, the remedy."""

from difflib import get_close_matches

from pydantic import ValidationError

from ...data import DataError
from ...files import read_toml
from .schema import Description
from .schema_base import Part


def load(path):
    """The Description in a TOML file. Raises DataError with the first complaint and the number
    of others."""
    lines = complaints(path)
    if isinstance(lines, Description):
        return lines
    raise DataError(lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""))


def complaints(path):
    """The Description in a TOML file, or the list of what is wrong with it, a line each. Raises
    DataError where it is no TOML."""
    content = parse(path)
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        not_unknown = lambda item: (
            item["type"] != "extra_forbidden"
        )  # unknown keys first: a misspelt key is why another is missing
        items = sorted(error.errors(include_url=False), key=not_unknown)
        return [f"{path}: {_complaint(item, content)}" for item in items]


def parse(path):
    """The content of a TOML file as a dict. Raises DataError."""
    content = read_toml(path, "check the path")
    if not content:
        raise DataError(f"{path}: is empty; docs/recording-format.md tells what it holds")
    return content


def _complaint(item, content):
    location, kind, message = (
        list(item["loc"]),
        item["type"],
        item["msg"].removeprefix("Value error, "),
    )
    if kind == "extra_forbidden":
        known = _keys(location[:-1])
        near = get_close_matches(str(location[-1]), known, 1, 0.5)
        remedy = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        return f"{_place(location[:-1], content)}: unknown key {location[-1]!r}; {remedy}"
    if kind == "missing":
        message = "is missing"
    elif kind != "value_error":
        message = f"{message[0].lower()}{message[1:]}, not {str(item['input'])[:40]!r}"
    place = _place(location, content)
    return (
        f"{place} {message}"
        if kind == "value_error" and place.endswith("]") or place.endswith(")")
        else f"{place}: {message}"
    )


def _place(location, content):
    if not location:
        return "top level"
    if location[0] == "aiding" and len(location) > 1:
        entry = content["aiding"][location[1]]
        kind = entry.get("kind") if isinstance(entry, dict) else None
        head, rest = f"[[aiding]] {location[1] + 1}{f' ({kind})' if kind else ''}", location[2:]
    elif isinstance(content.get(location[0]), dict):
        head, rest = f"[{location[0]}]", location[1:]
    else:
        head, rest = (
            ("", location)
            if location[0] in ("date", "point")
            else (f"[{location[0]}]", location[1:])
        )
    return " ".join(part for part in (head, ".".join(map(str, rest))) if part)


def _keys(location):
    model = Description
    for name in location:
        if isinstance(name, str):
            annotation = model.model_fields[name].annotation
            model = next(
                part
                for part in [annotation, *getattr(annotation, "__args__", ())]
                if isinstance(part, type) and issubclass(part, Part)
            )
    return list(model.model_fields)
