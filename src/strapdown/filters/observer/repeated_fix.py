"""Whether a fix is handed over a second time: what stands beside a filter and does not gate, as
an observer does, must take it once."""

import math

from ...core.jit import helper
from ...typing import Array

MEMORY = 7
"""Numbers to remember by: kind of a fix that was rejected last, or FORGOTTEN; its y and sd."""
FORGOTTEN = -1.0


@helper
def repeated(memory: Array, y: Array, sd: Array, kind: int, gate: float, nis: float) -> bool:
    """Whether this call brings the fix of the call before once more; remembers it in `memory`
    (MEMORY numbers) where its `nis` is above `gate`.

    The loop does so only where it lifts a gate: right after a rejection, with `gate` infinite.
    Other sources may measure the same at the same time.
    """
    same = memory[0] == kind and gate == math.inf
    for i in range(3):
        same = same and _alike(memory[1 + i], y[i]) and _alike(memory[4 + i], sd[i])
        memory[1 + i], memory[4 + i] = y[i], sd[i]
    memory[0] = kind if nis > gate else FORGOTTEN
    return same


@helper
def _alike(a: float, b: float) -> bool:
    return a == b or (a != a and b != b)
