"""Which rows of a table of fixes count: those with a fix, that are not zeros, and where it arrived."""

import re
from typing import Any

import numpy as np

from ...typing import Mask
from ..description.schema_base import Condition
from ..description.source_files import holds
from .column_names import ECEF, ECEF_VELOCITY, FIX, POSITION, VELOCITY, Names, plain

NO_FIX = re.compile(r"no(ne|[ _-]?fix|t .*)?|invalid|v|false|0|2d?|time.*", re.IGNORECASE)
"""What a text says of a row that is no fix in three dimensions."""


def conditions(columns: Names, is_imu: bool) -> list[tuple[dict[str, Any], str]]:
    """[(condition of the key `where`, why)]; beside an IMU fixes may be held from row to row."""
    fix = _where(columns)
    found = [fix, _zeros(columns, fix[0]), _held(columns) if is_imu else (None, "")]
    return [(where, why) for where, why in found if where]


def _where(columns: Names) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows that are fixes, or None; why)."""
    name = columns.find(FIX)
    if name is None:
        return None, ""
    cells = columns.table.frame[name].dropna()
    if cells.dtype.kind in "iuf":
        values = np.unique(cells.to_numpy(float))
        if (
            not len(values)
            or np.any(values != np.round(values))
            or values.min() < 0
            or values.max() > 60
        ):
            return None, ""
        type_of_fix = re.search("type|mode", plain(name)) is not None
        least = (
            3 if type_of_fix and values.max() >= 3 else 2 if type_of_fix and values.max() > 1 else 1
        )
        unused = int((cells < least).sum())
        return {"column": name, "least": least}, f"{unused} rows of {len(cells)} are no fix"
    texts = sorted({str(cell) for cell in cells})
    good = [text for text in texts if not NO_FIX.fullmatch(text.strip())]
    if not good or len(texts) > 12:
        return None, ""
    unused = int((~cells.astype(str).isin(good)).sum())
    return {"column": name, "equals": good}, f"{unused} rows of {len(cells)} are no fix"


def _zeros(columns: Names, where: dict[str, Any] | None) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows that are fixes, or None; why) of a receiver that writes zeros without
    one, of the rows of which `where` holds."""
    names = [columns.find(POSITION["latitude"]), columns.find(POSITION["longitude"])]
    if not all(names):
        names = [columns.find(pattern) for pattern in ECEF.values()]
    some = [name for name in names if name]
    if len(some) < len(names):
        return None, ""
    zero = np.stack([columns.numbers(name) == 0 for name in some], axis=1)
    if where:
        zero = zero[holds(columns.table, Condition.model_validate(where))]
    count = int(zero.all(axis=1).sum())
    alone = [name for name, each in zip(some, zero.T) if each.sum() == count]
    if not 0 < count < len(zero) or not alone:
        return None, ""
    return {"column": alone[0], "unequal": 0}, f"{count} rows of {len(zero)} are zeros, no fix"


def _held(columns: Names) -> tuple[dict[str, Any] | None, str]:
    """(Condition on the rows where a fix arrived, or None; why) of fixes that most rows repeat."""
    patterns = [*POSITION.values(), *VELOCITY.values()]
    if not columns.find(POSITION["latitude"]):
        patterns = [*ECEF.values(), *ECEF_VELOCITY.values()]
    names = list(dict.fromkeys(filter(None, map(columns.find, patterns))))
    if not names:
        return None, ""
    values = np.stack([columns.numbers(name) for name in names], axis=1)
    known: Mask = np.asarray(np.isfinite(values).any(axis=1))
    changed = np.not_equal(values[1:], values[:-1]) & np.isfinite(values[1:])
    repeats = int((known[1:] & known[:-1] & ~changed.any(axis=1)).sum())
    if 2 * repeats <= known.sum() or not changed.any():
        return None, ""
    name = names[int(np.argmax(changed.sum(axis=0)))]
    why = f"{repeats} rows of {known.sum()} repeat the fix of the row before"
    return {"column": name, "changes": True}, why
