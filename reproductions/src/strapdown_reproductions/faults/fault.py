"""A fault, and the table that the files of faults fill."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from .raw import Raw

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
"""What a fault is of."""
KINDS: dict[str, tuple[str, ...]] = {
    GNSS: ("position", "velocity"),
    MAGNETOMETER: ("magnetic-field",),
    AHRS: ("attitude",),
    HEIGHT: ("altitude",),
}
"""Kinds of sources without which there is no such fault."""
NOMINAL = "nominal"

Change: TypeAlias = Callable[[Raw], None]


class Fault(NamedTuple):
    """One class of faults."""

    name: str
    of: str
    change: Change


FAULTS: dict[str, Fault] = {}
"""{name: Fault}, in the order of the tables."""


def fault(name: str, of: str) -> Callable[[Change], Change]:
    """Put a function that changes a Raw into FAULTS under that name."""

    def put(change: Change) -> Change:
        if name in FAULTS:
            raise RuntimeError(f"two faults are called {name!r}")
        FAULTS[name] = Fault(name, of, change)
        return change

    return put
