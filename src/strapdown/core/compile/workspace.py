"""The workspace of a filter by name: what one architecture alone keeps, declared once, slot by slot.

    SLOTS = Slots(after=ERROR_STATE)  # goes on where the layout of core/mathematics/error_state.py ends
    REPAIRS = SLOTS.output("repairs")  # an output column, with its unit in brackets
    ELAPSED = SLOTS.number("ELAPSED")  # s since the last reset
    FORCE = SLOTS.array("FORCE", 3)  # mean specific force, m/s^2
    BEFORE = SLOTS.matrix("BEFORE", 3, 3)  # an attitude that is left

What a declaration gives is a plain number or slice. numba freezes it into the kernels, which read
workspace[ELAPSED], workspace[FORCE] and matrix(workspace, BEFORE, 3, 3). Sizes follow: `start`
takes SLOTS.zeros(), and the Filter says slots=SLOTS. What depends on the number of states n is
declared for MAX_STATES of them.
"""

import math
from typing import Any

import numpy as np

from ...typing import Array

MAX_STATES = 45
"""States of a filter at most: the library's fifteen, the eighteen of scale and misalignment of an
IMU, and a dozen of sources and installation."""


class Slots:
    """A layout: slots in the order in which they are declared, each named once.

    after: a layout that this one continues. room: numbers kept at the beginning for the output
    columns of the layouts that go on from here. Whatever would make two slots share a number, or a
    workspace too small, raises RuntimeError: mistakes of whoever writes a filter, at import.
    """

    def __init__(self, after: "Slots | None" = None, room: int = 0) -> None:
        self.columns: tuple[str, ...] = ()  # of the output, in their order
        self.size = self.room = room
        self.places: dict[str, tuple[int, tuple[int, ...] | Slots]] = {}
        self.closed = self.ended = False
        if after is not None:
            if after.ended:
                raise RuntimeError("the layout ends with a part of open size; nothing follows it")
            after.closed = True
            self.columns, self.size, self.room = after.columns, after.size, after.room
            self.places = dict(after.places)

    def outputs(self, *columns: str) -> slice:
        """The next output columns, by name and unit. They are the first numbers of a workspace, so
        that they come before other slots or into the room of the layout that is continued."""
        first, last = len(self.columns), len(self.columns) + len(columns)
        if first == self.size and not self.closed:
            self.size = self.room = last
        if self.closed or last > self.room or len({*self.columns, *columns}) < last:
            raise RuntimeError(
                f"no place for {columns}: each column has a name of its own, and columns come "
                f"first, of this layout {self.room} at most"
            )
        self.columns += columns
        return slice(first, last)

    def output(self, column: str) -> int:
        """The next output column."""
        return int(self.outputs(column).start)

    def number(self, name: str) -> int:
        """A number."""
        return self._place(name, 1, ())

    def numbers(self, *names: str) -> tuple[int, ...]:
        """Numbers that belong together, one after the other."""
        return tuple(self.number(name) for name in names)

    def array(self, name: str, size: int) -> slice:
        """So many numbers."""
        first = self._place(name, size, (size,))
        return slice(first, first + size)

    def matrix(self, name: str, rows: int, columns: int) -> int:
        """Where a matrix begins, for `matrix(workspace, first, rows, columns)` of core/compile/jit.py."""
        return self._place(name, rows * columns, (rows, columns))

    def part(self, name: str, layout: "Slots") -> slice:
        """Room for a whole layout, whose own slots count from the beginning of this slice."""
        first = self._place(name, layout.size, layout)
        layout.closed = True
        return slice(first, first + layout.size)

    def rest(self, name: str) -> int:
        """Where a part at the end begins, whose size is known only at the start. Nothing follows
        it."""
        first = self._place(name, 0, (-1,))
        self.closed = self.ended = True
        return first

    def zeros(self, rest: int = 0) -> Array:
        """Return a workspace with room for all slots, and `rest` numbers in the part at the end."""
        if (rest > 0) != self.ended:
            raise RuntimeError("the part of open size at the end, and only that, needs a size")
        self.closed = True
        return np.zeros(self.size + rest)

    def views(self, workspace: Array) -> dict[str, Any]:
        """{name: number, array, matrix, or again such a dictionary of a part}, views of a
        workspace: to look at, and for tests."""
        found: dict[str, Any] = {name: workspace[i] for i, name in enumerate(self.columns)}
        for name, (first, shape) in self.places.items():
            if isinstance(shape, Slots):
                found[name] = shape.views(workspace[first:])
            else:
                size = workspace.size - first if shape == (-1,) else math.prod(shape)
                found[name] = workspace[first : first + size].reshape(shape)
        return found

    def _place(self, name: str, size: int, shape: "tuple[int, ...] | Slots") -> int:
        if name in self.places:
            raise RuntimeError(f"slot {name} is declared twice")
        if self.closed:
            raise RuntimeError(f"slot {name} comes too late: its layout is in use or continued")
        first, self.size = self.size, self.size + size
        self.places[name] = first, shape
        return first
