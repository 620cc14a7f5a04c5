"""Vehicles and their limits: samples, measurements and states beyond them are out of range."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..checks import DataError, check_choice, check_number
from ..units.constants import STANDARD_GRAVITY


@dataclass(frozen=True)
class Vehicle:
    """Generous limits of a vehicle. Raises DataError if they are invalid.

    Attributes
    ----------
    name : str
        Name, as messages have it.
    speed : float
        Largest speed over ground, m/s.
    acceleration : float
        Largest specific force of a sample, shocks included, m/s^2.
    lowest : float
        Lowest height above the ellipsoid, m.
    highest : float
        Largest height above the ellipsoid, m.
    """

    name: str = "own"
    speed: float = 1000.0
    acceleration: float = 50 * STANDARD_GRAVITY
    lowest: float = -12e3
    highest: float = 100e3

    def __str__(self) -> str:
        return f"vehicle {self.name!r}"

    @property
    def by_thrust(self) -> bool:
        """True where thrust along an axis of its own is all that holds the vehicle up: it flies to
        any side, so that its course is no heading, and its accelerometer does not feel a tilt."""
        return self.name == "multicopter"

    @property
    def points_ahead(self) -> bool:
        """True where the forward axis points along the course; a person may carry the sensors
        in any attitude."""
        return not self.by_thrust and self.name != "pedestrian"

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name):
            raise DataError(f"vehicle name is {self.name!r}; it must be text, such as 'rover'")
        for bound in ("speed", "acceleration"):
            check_number(getattr(self, bound), f"vehicle {bound}", above=0, infinite=True)
        for bound in ("lowest", "highest"):
            check_number(getattr(self, bound), f"vehicle {bound}", least=-math.inf)
        if not self.lowest < self.highest:
            raise DataError(
                f"vehicle lowest is {self.lowest:g} m and highest {self.highest:g} m; the lowest "
                f"height must be below the highest"
            )


BOUNDS = ("speed", "acceleration", "lowest", "highest")
VEHICLES = {
    vehicle.name: vehicle
    for vehicle in (
        Vehicle("any"),
        Vehicle("pedestrian", speed=15, lowest=-500, highest=9e3),
        Vehicle("car", speed=120, lowest=-500, highest=7e3),
        Vehicle("ship", speed=60, lowest=-200, highest=5e3),
        Vehicle("multicopter", speed=100, lowest=-500, highest=10e3),
        Vehicle("aircraft", speed=400, lowest=-500, highest=25e3),
    )
}
"""By name. Shocks and hand-held knocks reach tens of g, so that all have the bound of `any` on
acceleration."""


GivenVehicle = str | Vehicle | Mapping[str, Any]
"""A vehicle as a user names it: a name, a Vehicle, or its fields, as files keep them."""


def find(vehicle: GivenVehicle | None) -> Vehicle:
    """The Vehicle of a name; "any" for None. Raises DataError naming those there are."""
    if isinstance(vehicle, Vehicle):
        return vehicle
    if isinstance(vehicle, Mapping):
        if not vehicle:
            raise DataError(f"vehicle: it has no limit; give some of {', '.join(BOUNDS)}")
        for bound in vehicle:
            check_choice(bound, "vehicle: the limit", Vehicle.__dataclass_fields__)
        return Vehicle(**vehicle)
    name = "any" if vehicle is None else vehicle
    check_choice(name, "vehicle", VEHICLES)
    return VEHICLES[name]
