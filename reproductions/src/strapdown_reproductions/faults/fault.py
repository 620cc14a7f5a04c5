"""A fault, and how it changes what a logger holds: most change some columns in some rows."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from strapdown.typing import Array, Mask

from .raw import BEGINS, Raw, RawFixes

IMU, GNSS, START, MAGNETOMETER, AHRS, HEIGHT, WORLD, LIVE = (
    "IMU",
    "GNSS",
    "start",
    "magnetometer",
    "AHRS",
    "height",
    "world",
    "arrival",
)
"""Kinds of data that a fault changes."""
KINDS: dict[str, tuple[str, ...]] = {
    GNSS: ("position", "velocity"),
    MAGNETOMETER: ("magnetic-field",),
    AHRS: ("attitude",),
    HEIGHT: ("altitude",),
}
"""Kinds of sources without which there is no such fault."""
NOMINAL = "nominal"

Change: TypeAlias = Callable[[Raw], None]
Holder: TypeAlias = Raw | RawFixes
"""The samples, or the fixes of a source."""
Rows: TypeAlias = Callable[[Raw, Holder], Mask | slice]
"""Which rows of a holder are changed."""
Values: TypeAlias = Callable[[Array], Array | float]
"""A change of the values in these rows."""


class Fault(NamedTuple):
    """One class of faults."""

    name: str
    of: str
    change: Change


# where


class FaultColumns(NamedTuple):
    """Arrays of the samples or of some sources, or some axes of them."""

    of: Callable[[Raw], Sequence[Holder]]
    names: tuple[str, ...]
    axes: int | slice = slice(None)

    def at(self, axes: int | slice) -> "FaultColumns":
        """Some axes of them."""
        return self._replace(axes=axes)


def samples(raw: Raw) -> list[Holder]:
    """The samples of the IMU."""
    return [raw]


def sources(*kinds: str) -> Callable[[Raw], list[Holder]]:
    """Chooses the sources of these kinds."""
    return lambda raw: list(raw.of(*kinds))


# when


def throughout(raw: Raw, holder: Holder) -> slice:
    """All rows."""
    return slice(None)


def rows_of_fault(lasting: float = np.inf) -> Rows:
    """Those of the fault's `lasting` seconds."""
    return lambda raw, holder: holder.from_fault(lasting)


def first(raw: Raw, holder: Holder) -> slice:
    """The first one of the fault."""
    row = int(np.argmax(holder.from_fault()))
    return slice(row, row + 1)


def every(step: int, begin: int = 0) -> Rows:
    """Return a selection of every `step`-th row from `begin` on."""
    return lambda raw, holder: slice(begin, None, step)


def some(share: float) -> Rows:
    """A random share."""
    return lambda raw, holder: raw.rng.random(len(holder.t)) < share


# how


def on(columns: FaultColumns, values: Values, rows: Rows = throughout) -> Change:
    """A change of the values of some columns in some rows."""

    def change(raw: Raw) -> None:
        for holder in columns.of(raw):
            changed = rows(raw, holder)
            for name in columns.names:
                own = getattr(holder, name)[..., columns.axes]
                own[changed] = values(own[changed])

    return change


def add_drift(columns: FaultColumns, size: float, seconds: float = 1.0) -> Change:
    """Return a change that adds a drift from the beginning of the fault on, `size` in `seconds`."""

    def change(raw: Raw) -> None:
        for holder in columns.of(raw):
            for name in columns.names:
                own = getattr(holder, name)[..., columns.axes]
                own += size * np.clip(holder.t - BEGINS, 0.0, None) / seconds

    return change


def without(of: Callable[[Raw], Sequence[Holder]], rows: Rows) -> Change:
    """Leaves these rows out."""

    def change(raw: Raw) -> None:
        for holder in of(raw):
            left_out = np.zeros(len(holder.t), bool)
            left_out[rows(raw, holder)] = True
            holder.take(~left_out)

    return change


def set_to(value: float) -> Values:
    """One value in all rows."""
    return lambda values: value


def times(factor: float) -> Values:
    """Return a function that multiplies values by `factor`."""
    return lambda values: values * factor


def over(divisor: float) -> Values:
    """Values divided by a number."""
    return lambda values: values / divisor


def plus(size: float | Sequence[float]) -> Values:
    """Values that are off by a number, or by one for each axis."""
    return lambda values: values + np.asarray(size)


def round_to_step(step: float) -> Values:
    """Values in whole steps."""
    return lambda values: np.round(values / step) * step


def hold_first(values: Array) -> Array:
    """The first of the values in all rows, as of what is stuck."""
    return values[:1]


def swap_axes(values: Array) -> Array:
    """x and y in each other's place."""
    return values[:, [1, 0, 2]]


MISSING, ZERO, NEGATED = set_to(np.nan), set_to(0.0), times(-1.0)
