"""Figures, numbers and scripts as short text inside a page, which figures.js unpacks."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from plotly.utils import PlotlyJSONEncoder

from ..typing import Array

FINENESS = 256
"""Numbers of a figure keep this much of the usual difference between neighbours, which no screen
shows, and 1/FINENESS² of the usual value, which no reader notices."""


def pack_json(content: Mapping[str, Any]) -> str:
    """Return JSON content, with arrays of numbers anywhere inside, as text: the JSON, a line feed,
    the numbers; deflated, in base64."""
    columns: list[bytes] = []
    described = _lift_columns(content, columns)
    head = json.dumps(described, cls=PlotlyJSONEncoder, separators=(",", ":")).encode()
    return deflate_text(head + b"\n" + b"".join(columns))


def deflate_text(content: bytes) -> str:
    """Deflated, in base64."""
    return base64.b64encode(zlib.compress(content, 6)).decode()


def _lift_columns(value: Any, columns: list[bytes]) -> Any:
    """The content with what stands for the numbers that went to `columns`."""
    if isinstance(value, dict):
        if value.keys() == {"dtype", "bdata"} and value["dtype"] in ("f4", "f8"):  # plotly's arrays
            raw = np.frombuffer(base64.b64decode(value["bdata"]), value["dtype"])
            return _column(raw.astype(float), columns) or value
        return {key: _lift_columns(each, columns) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_lift_columns(each, columns) for each in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.ndim == 1:
        return _column(value.astype(float), columns) or value
    return value


def _column(values: Array, columns: list[bytes]) -> dict[str, Any] | None:
    """Where a column is among the others and how to unpack it; None where it cannot be packed.

    Its whole steps are kept as differences, whose four bytes, the lowest first, each stand together:
    what a line has in common with itself a moment ago is what deflating finds.
    """
    unknown = np.isnan(values)
    known = values[~unknown]
    if not len(known) or not np.isfinite(known).all():
        return None
    step = _step(known)
    if np.abs(known).max() / step > 2**30:
        return None
    if len(known) < len(values):
        last = np.maximum.accumulate(np.where(unknown, 0, np.arange(len(values))))
        values = np.where(unknown[last], 0.0, values[last])
    whole = np.rint(values / step).astype(np.int64)
    change = np.diff(whole, prepend=0)
    folded = ((change << 1) ^ (change >> 63)).astype("<u4")  # small ones of either sign stay small
    begin = sum(map(len, columns))
    columns.append(np.ascontiguousarray(folded.view(np.uint8).reshape(-1, 4).T).tobytes())
    return {"packed": [begin, len(values), step], "unknown": _runs(unknown)}


def _step(known: Array) -> float:
    """The power of two that the values are rounded to."""
    change, size = np.abs(np.diff(known)), np.abs(known)
    usual = [_middle(change[change > 0]) / FINENESS] if change.any() else []
    usual += [_middle(size[size > 0]) / FINENESS**2] if size.any() else [1.0]
    return float(2.0 ** np.floor(np.log2(min(usual))))


def _middle(values: Array) -> float:
    """The upper median; numpy's takes four times as long to look for NaN and to average."""
    half = len(values) // 2
    return float(np.partition(values, half)[half])


def _runs(unknown: Array) -> list[int]:
    """[first, number, first, number, ...] of the rows that are not known."""
    if not unknown.any():
        return []
    edges = np.flatnonzero(np.diff(unknown.astype(int), prepend=0, append=0))
    edges[1::2] -= edges[::2]
    return [int(edge) for edge in edges]
