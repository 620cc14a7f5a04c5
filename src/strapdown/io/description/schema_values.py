"""Values of keys of `[[aiding]]` that are tables of their own: the Earth's field, its declination, and
the geoid."""

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator

from ...checks import check_keys, check_number, is_number
from ...units import factor, quantity
from .schema_base import MISSING, AngleUnit, Finite, Part, column, refuse


def _field(value: Any) -> str | tuple[float, ...]:
    """ "record", or north, east, down in T."""
    if value == "record":
        return "record"
    example = '{ north = 17.6, east = 0.1, down = 52.8, unit = "uT" }'
    axes = ("north", "east", "down")
    if (
        not isinstance(value, dict)
        or set(value) != {*axes, "unit"}
        or not all(is_number(value[key]) for key in axes)
    ):
        raise ValueError(
            f'write {example}, or "record" for the strengths in the record, or leave it out for the '
            f"geomagnetic model"
        )
    north, east, down = (value[key] * factor(value["unit"], "magnetic field") for key in axes)
    strength = math.hypot(north, east, down)
    refuse(
        (
            not 1e-6 <= strength <= 100e-6,
            f"its strength is {strength * 1e6:.4g} uT, where the Earth's is 22 to 67; check the unit",
        ),
        (
            math.hypot(north, east) < 1e-3 * strength,
            "it has nothing horizontal and so gives no heading; give north and east, or leave it "
            "out for the geomagnetic model",
        ),
    )
    return north, east, down


EarthField = Annotated[Any, AfterValidator(_field)]


class Declination(Part):
    """declination of a field taken from the record: of magnetic from true north, positive east."""

    value: Finite
    unit: AngleUnit = MISSING

    @property
    def angle(self) -> float:
        """rad."""
        return self.value * self.unit


class Separation(NamedTuple):
    """geoid: the height of the geoid above the ellipsoid, in m = column * size, or value."""

    value: float = 0.0
    column: str | int | None = None
    size: float = 1.0


def _geoid(value: Any) -> Literal["EGM96"] | Separation:
    """ "EGM96", or the separation in a column or as one number."""
    if value == "EGM96":
        return "EGM96"
    if not isinstance(value, dict) or not ({"column"} <= set(value) or {"value"} <= set(value)):
        raise ValueError(
            f'{value!r} is no geoid; give "EGM96", its height above the ellipsoid as '
            '{ value = 46.3, unit = "m" }, or the column that has it, { column = "sep", unit = "m" }'
        )
    if "value" in value:
        return Separation(quantity(value, "m", "its height", "m", -math.inf))
    check_keys(value, ["column", "unit", "scale"])
    scale = check_number(value.get("scale", 1.0), "scale", least=-math.inf)
    return Separation(0.0, column(value["column"]), scale * factor(value.get("unit"), "length"))


Geoid = Annotated[Any, AfterValidator(_geoid)]
