"""Detection of a measurement that is handed over a second time: an observer beside a filter has no
gate, and must use it once."""

import math

from ...core.compile.jit import helper
from ...core.compile.selection import where
from ...core.compile.workspace import Slots
from ...typing import Array

MEMORY = Slots()
"""Slots by which a fix is remembered."""
KIND = MEMORY.number("KIND")  # of the one that was rejected last, or FORGOTTEN
Y = MEMORY.array("Y", 3)  # what it measured
FORGOTTEN = -1.0


@helper
def is_repeated(memory: Array, y: Array, kind: int, gate: float, nis: float) -> bool:
    """True where this call hands over the measurement of the call before again. Stores it in
    `memory` (of MEMORY), for the next call, where its `nis` is above `gate`.

    The loop does so where it lifts a gate, right after a rejection, with `gate` infinite; and where
    it asks what the filter makes of a fix, with `gate` -1, before it hands it over with other
    standard deviations. Other sources may measure the same at the same time.
    """
    asked = gate == math.inf or gate < 0
    same, its_y = (memory[KIND] == kind) & asked, memory[Y]
    for i in range(3):
        same = same & _is_alike(its_y[i], y[i])
        its_y[i] = y[i]
    memory[KIND] = where(nis > gate, kind, FORGOTTEN)
    return same


@helper
def _is_alike(a: float, b: float) -> bool:
    return (a == b) | ((a != a) & (b != b))
