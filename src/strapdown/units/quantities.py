"""Quantities that a component of a measurement can have: units, innovation, and the limits of
sensors."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from .. import plugins
from ..checks import DataError, check_choice, check_number
from .conversion import UNITS

SHOWN = {"rad": "deg", "rad/s": "deg/s", "T": "uT"}
"""Units that people read in place of SI."""


class Quantity(NamedTuple):
    """A quantity that a `MeasurementModel` can have. Values in files have one of its units; inside, and
    in an innovation, they are SI."""

    name: str
    dimension: str = ""  # of units.UNITS; empty: its own, with `units`
    units: Mapping[str, float] = {}  # factor to SI of its own; the first is the SI unit itself
    innovation: str = ""  # dimension of its innovation and standard deviation; empty: its own
    most: float = math.inf  # largest magnitude that a sensor reads, SI
    hint: str = ""  # what is probably wrong beyond it
    # smallest standard deviation of its innovation that a sensor has, SI: less is a mistake
    min_std: float = 0.0


OWN = {
    quantity.name: quantity
    for quantity in (
        Quantity("latitude", "angle", innovation="length", min_std=1e-3),
        Quantity(
            "longitude",
            "angle",
            innovation="length",
            most=2 * math.pi,
            hint="is the unit deg, or is a scale missing?",
            min_std=1e-3,
        ),
        Quantity("angle", "angle", most=4 * math.pi, hint="is the unit deg?", min_std=1e-6),
        Quantity("length", "length", most=500e3, hint="is the unit mm or ft?", min_std=1e-3),
        Quantity("speed", "speed", most=1e4, hint="is the unit mm/s or cm/s?", min_std=1e-4),
        Quantity("acceleration", "acceleration", min_std=1e-6),
        Quantity(
            "angular rate", "angular rate", most=100.0, hint="is the unit deg/s?", min_std=1e-9
        ),
        Quantity(
            "magnetic field",
            "magnetic field",
            most=1e-3,
            hint="the Earth's is 22 to 67 uT: is the unit gauss, uT, nT or mgauss, or is a scale "
            "missing?",
            min_std=1e-11,
        ),
        Quantity("pressure", "pressure", innovation="length", min_std=1e-3),
        Quantity(
            "water pressure",
            "pressure",
            innovation="length",
            most=1.2e8,
            hint="11 km below the sea it is 1.1e8 Pa: is the unit dbar, bar or kPa?",
            min_std=1e-3,
        ),
    )
}


def dimension(name: str) -> str:
    """The dimension in `units` of a quantity."""
    return REGISTRY.find(name).dimension or name


def innovation_dimension(name: str) -> str:
    """The dimension of the innovation of a quantity and of its standard deviation."""
    return REGISTRY.find(name).innovation or dimension(name)


def si(dimension: str) -> str:
    """The SI unit of a dimension."""
    return next(iter(UNITS[dimension]))


def shown_unit(name: str) -> tuple[str, float]:
    """(the unit in which people read the innovation of a quantity, what 1 in SI is in it)."""
    return _display_unit(innovation_dimension(name))


def shown_value_unit(name: str) -> tuple[str, float]:
    """The same of its values."""
    return _display_unit(dimension(name))


def _display_unit(dimension: str) -> tuple[str, float]:
    units = UNITS[dimension]
    unit = SHOWN.get(next(iter(units)), next(iter(units)))
    return unit, 1 / units[unit]


def check(quantity: Quantity) -> None:
    """Refuse a Quantity that cannot be used; take up its units. Raises DataError."""
    what, own = f"Quantity {quantity.name!r}: ", not quantity.dimension
    check_number(quantity.most, what + "most", above=0, infinite=True)
    for dimension in filter(None, (quantity.dimension, quantity.innovation)):
        check_choice(dimension, what + "dimension", UNITS)
    if quantity.dimension and quantity.units:
        raise DataError(f"{what}it has units of its own and a dimension; give one of the two")
    if own and quantity.name in DIMENSIONS_OF_LIBRARY:
        raise DataError(f"{what}it is a dimension already: give dimension={quantity.name!r}")
    if own and next(iter(quantity.units.values()), 0) != 1:
        raise DataError(f"{what}its units must begin with the SI unit, of factor 1")
    for unit, size in quantity.units.items() if own else ():
        check_number(size, f"{what}the size of {unit!r}", above=0)
        for dimension, units in UNITS.items():
            if unit in units and dimension != quantity.name:
                raise DataError(
                    f"{what}the unit {unit!r} exists already, as one of {dimension}; choose another "
                    f"name, or give dimension={dimension!r}"
                )
    if own:
        UNITS[quantity.name] = dict(quantity.units)


DIMENSIONS_OF_LIBRARY = frozenset(UNITS)
REGISTRY = plugins.Registry(
    Quantity, "no quantity is called", lambda name: OWN.get(name), lambda: OWN, check
)
