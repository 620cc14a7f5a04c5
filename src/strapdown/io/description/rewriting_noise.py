"""The noise in a `recording.toml` changed in place: standard deviations of sources, their
correlated errors, and the file that describes the IMU."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import tomlkit
from tomlkit.items import Float, Item, Trivia

from ...checks import DataError, is_number
from ...typing import File
from ...units.conversion import spread_factor
from ...units.quantities import dimension, innovation_dimension
from .messages import load
from .rewriting import notify, set_key
from .schema_source import SourcePart

STD, CORRELATED, GRADE = "std", "correlated", "grade"


class NoiseEdit(NamedTuple):
    """One key of a section, with a new value."""

    source: int | None  # [[source]], from 0; None: [imu]
    key: str  # STD, CORRELATED or GRADE
    values: tuple[str, ...]  # TOML: of a `std` that is a list one per entry, else one
    said: str  # which the comment says before its date, with `95 %` in it


def scaled_deviations(path: File, source: int, factors: Sequence[float], said: str) -> NoiseEdit:
    """The edit that multiplies the standard deviations of a source of a description by factors, one
    per row of its innovation: numbers change, columns get another scale. Raises DataError."""
    part = load(path).source[source]
    entries = part.std if isinstance(part.std, list) else [part.std]
    same = len(set(factors)) == 1
    if not same and (part.ecef or (part.form is not None and len(entries) == 1)):
        raise DataError(
            f"{path}: [[source]] {source + 1} ({part.kind}): its std is in other axes, so that the "
            f"horizontal ones alone cannot be changed; take the sources from a file of their own"
        )
    if same:
        factors = [factors[0]] * len(entries)
    elif len(entries) == 1:
        entries = entries * len(factors)
    texts = [_scale_entry(part, *each) for each in zip(range(len(entries)), entries, factors)]
    one = same or isinstance(part.std, list)
    return NoiseEdit(source, STD, tuple(texts) if one else (f"[{', '.join(texts)}]",), said)


def _scale_entry(part: SourcePart, number: int, entry: Any, factor: float) -> str:
    """Return the TOML of an entry of `std` that is `factor` times as large."""
    if is_number(entry):
        return _number(entry * factor)
    _, quantity, unit = part.deviations[number]
    if isinstance(entry, str):  # a plain column is in the unit of its component
        own = innovation_dimension(quantity) != dimension(quantity)
        entry = {"column": entry, "unit": "m" if own else unit}
    squared = spread_factor(entry["unit"], innovation_dimension(quantity))[1]
    scale = entry.get("scale", 1.0) * (factor**2 if squared else factor)
    column, unit = (tomlkit.item(entry[key]).as_string() for key in ("column", "unit"))
    return f"{{ column = {column}, unit = {unit}, scale = {_number(scale)} }}"


def change_noise(section: Any, edit: NoiseEdit, mark: str) -> None:
    """Set the key of a section, and its comment."""
    given = section.get(edit.key)
    if edit.key == STD and isinstance(given, list):
        for number, text in enumerate(edit.values):
            if _content(given[number]) != _content(tomlkit.value(text)):
                _replace(given, number, text)
    elif edit.key == STD and isinstance(given, dict):
        _replace(section, STD, edit.values[0])
    else:
        set_key(section, edit.key, _item(edit.values[0]))
    notify(section[edit.key], f"{edit.said}, {mark}", mark)


def _replace(holder: Any, key: Any, text: str) -> None:
    """Replace a value; where both are tables, the new scale goes into the old one."""
    old: Any = holder[key]
    new: Any = tomlkit.value(text)
    if isinstance(old, dict) and isinstance(new, dict):
        set_key(holder, "scale", _item(new["scale"].as_string()), key)
    else:
        holder[key] = _item(text)


def _item(text: str) -> Item:
    """Return an item of tomlkit that keeps the text, for a number its digits."""
    item = tomlkit.value(text)
    return Float(float(text), Trivia(), text) if is_number(item) else item


def _content(item: Any) -> Any:
    return item.unwrap() if hasattr(item, "unwrap") else item


def _number(value: float) -> str:
    """Return a float of TOML with four significant digits."""
    text = f"{value:.4g}"
    return text if set(text) & set(".en") else f"{text}.0"
