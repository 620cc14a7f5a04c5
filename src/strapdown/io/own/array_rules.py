"""Rules for the arrays of our own files, declared for each variable."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...fileio.checksum import DAMAGED

UNIT_LENGTH = 1e-6
"""Largest difference of the norm of a quaternion from 1, above the rounding of single precision."""


class Column(NamedTuple):
    """A variable: names of its axes (axes of one name have one length), meaning and rules of its
    values."""

    axes: str  # separated by blanks
    units: str = ""  # other units are refused where a file states one; "": any
    about: str = ""
    missing: bool = False  # NaN is allowed
    infinite: bool = False  # inf too
    least: float = -np.inf
    above: float = -np.inf
    most: float = np.inf
    rising: bool = False  # strictly increasing along its first axis
    ordered: bool = False  # not decreasing along its first axis
    unit_length: bool = False  # along its last axis, where it is known
    whole: bool = False  # whole numbers, of an integer type or not
    optional: bool = False


Schema = Mapping[str, Column]


def check_arrays(
    found: Mapping[str, "np.ndarray[Any, Any]"],
    schema: Schema,
    where: object,
    sizes: Mapping[str, int] | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, int]:
    """Refuse arrays that contradict the schema, and return {axis: length}, which begins with
    `sizes`. `units` are those in the file. Raises DataError that begins with `where`."""
    lengths = dict(sizes or {})
    for name, column in schema.items():
        if name not in found:
            if not column.optional:
                raise DataError(f"{where}: {name} is missing; {DAMAGED}")
            continue
        said = (units or {}).get(name, column.units)
        if column.units and said != column.units:
            raise DataError(
                f"{where}: {name} is in {said[:40]!r}; it must be in {column.units!r}; {DAMAGED}"
            )
        wrong = _shape(found[name], column, lengths) or _values(found[name], column)
        if wrong:
            raise DataError(f"{where}: {name} {wrong}; {DAMAGED}")
    return lengths


def _shape(values: "np.ndarray[Any, Any]", column: Column, lengths: dict[str, int]) -> str:
    """Return the fault of type or shape; "" without one."""
    if values.dtype.kind not in "iufb":
        return "holds no numbers"
    axes = column.axes.split()
    if values.ndim == len(axes):
        for axis, length in zip(axes, values.shape):
            lengths.setdefault(axis, length)
    if values.shape != tuple(lengths.get(axis, -1) for axis in axes):
        wanted = " x ".join(str(lengths.get(axis, axis)) for axis in axes)
        return f"has the shape {values.shape}; it must be {wanted}"
    return ""


def _values(values: "np.ndarray[Any, Any]", column: Column) -> str:
    """Return the fault of the numbers; "" without one."""
    for bad, wanted in broken_rules(values, column):
        if bad.any():
            at = tuple(map(int, np.argwhere(bad)[0]))
            return f"is {values[at]:g} at {list(at)}; it must be {wanted}"
    return _together(values, column)


def broken_rules(
    values: "np.ndarray[Any, Any]", column: Column
) -> Iterator[tuple["np.ndarray[Any, Any]", str]]:
    """Yield (where the values break a rule, requirement) for each rule on single numbers."""
    if column.infinite:
        yield np.isnan(values) & (not column.missing), "no NaN"
    elif column.missing:
        yield np.isinf(values), "finite or NaN"
    else:
        yield ~np.isfinite(values), "finite"
    bounds = f"within {column.least:g} and {column.most:g}"
    if not np.isfinite(column.most):
        bounds = f"{column.least:g} or more"
    yield (values < column.least) | (values > column.most), bounds
    if column.above > -np.inf:  # else -inf would be none
        yield values <= column.above, f"above {column.above:g}"
    if column.whole:
        yield values != np.rint(values), "a whole number"


def _together(values: "np.ndarray[Any, Any]", column: Column) -> str:
    """Return the fault in the order or the norm of numbers; "" without one."""
    if column.rising and len(values) > 1 and not (np.diff(values) > 0).all():
        row = int(np.argmin(np.diff(values) > 0))
        return f"must increase, but is {values[row]:.9g} before {values[row + 1]:.9g}"
    if column.ordered and len(values) > 1 and (np.diff(values) < 0).any():
        row = int(np.argmax(np.diff(values) < 0))
        return f"must not decrease, but is {values[row]:.9g} before {values[row + 1]:.9g}"
    if column.unit_length:
        norm = np.linalg.norm(values, axis=-1)
        off = (np.abs(norm - 1) > UNIT_LENGTH) | (np.isnan(norm) & ~np.isnan(values).all(axis=-1))
        if off.any():
            return f"has the norm {norm[off][0]:.6g} in row {int(np.argmax(off))}; it must have 1"
    return ""
