"""The schema of `recording.toml`: sections as types that check their values before any table is
read."""

import datetime
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from ...checks import DataError, check_keys, check_number
from ...core.mathematics.earth import LATITUDE_LIMIT
from ...data.calibration_parameters import ASKED_OF_IMU, requested_priors
from ...data.vehicle import GivenVehicle, Vehicle, find as find_vehicle
from ...preprocessing.attitude_record import QuaternionOrder, axes_of
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix, rotation_matrix
from ...typing import Array
from ...units.conversion import factor
from ...units.time_scales import gps_of
from ..reader import GUESS
from .schema_base import (
    MISSING,
    AngleUnit,
    Column,
    Finite,
    Geoid,
    KeyPart,
    Signal,
    Time,
    Triple,
    Where,
    call_with_key,
    refuse,
)
from .schema_source import (
    ECEF,
    FORMS,
    Form,
    SourcePart,
    check_attitude_columns,
    is_ecef,
)

MAX_SOURCES = 200
"""Largest number of sections [[source]]; each is compared with all before it."""


def _body_axes(text: str) -> str:
    axes_matrix(text.removesuffix(GUESS), BODY_AXES)
    return text


def _estimate(value: Any) -> dict[str, tuple[float, ...]]:
    return requested_priors(value, ASKED_OF_IMU)


def _date(value: Any) -> str:
    if isinstance(value, (datetime.date, datetime.datetime)):
        return value.isoformat()
    try:
        datetime.datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise ValueError(f'{value!r} is not a date; write it as "2012-10-10"') from None
    return value


def _epoch(value: Any) -> float:
    """Return the epoch of t = 0 in seconds of GPS time since its zero."""
    return gps_of(value)


class Mounting(KeyPart):
    """Sensor to body: C_bs = Rz(heading) Ry(pitch) Rx(roll)."""

    roll: Finite = 0.0
    pitch: Finite = 0.0
    heading: Finite = 0.0
    unit: AngleUnit = MISSING

    @property
    def angles(self) -> list[float]:
        """Roll, pitch and heading, rad."""
        return [self.unit * each for each in (self.roll, self.pitch, self.heading)]

    @property
    def matrix(self) -> Array:
        """(3, 3) C_bs."""
        return rotation_matrix(*self.angles)


class Temperature(KeyPart):
    """temperature: the column with the temperature of the IMU, degC = column * scale + offset.
    Table and time are those of the section unless given here."""

    column: Column
    unit: Literal["degC"] = "degC"
    scale: Finite = 1.0
    offset: Finite = 0.0
    table: str | None = None
    time: Time | None = None


class ImuPart(KeyPart):
    """[imu]"""

    file: str
    table: str | None = None
    time: Time
    where: Where = []
    kind: Literal["rate", "increment"] = "rate"
    axes: Annotated[str, AfterValidator(_body_axes)] = "FRD"
    gyro: Signal
    accel: Signal
    mounting: Mounting | None = None
    calibration: str | None = None
    temperature: Temperature | None = None
    lever_arm: Triple = [0.0, 0.0, 0.0]
    estimate: Annotated[Any, AfterValidator(_estimate)] = None
    grade: str | None = None
    assumed: list[str] = []

    @property
    def dimensions(self) -> tuple[str, str]:
        """Dimensions of gyro and accel."""
        return (
            ("angular rate", "acceleration")
            if self.kind == "rate"
            else ("angle", "velocity increment")
        )

    @property
    def guessed_axes(self) -> str | None:
        """The axes if they are a guess, else None."""
        return self.axes.removesuffix(GUESS) if self.axes.endswith(GUESS) else None

    @property
    def matrix(self) -> Array:
        """(3, 3) from the columns to the body: axes, then mounting."""
        C = axes_matrix(self.axes.removesuffix(GUESS), BODY_AXES)
        return C if self.mounting is None else self.mounting.matrix @ C

    @model_validator(mode="after")
    def _units(self) -> Self:
        for name, signal, dimension in zip(
            ("gyro", "accel"), (self.gyro, self.accel), self.dimensions
        ):
            call_with_key(f"{name}.unit", factor, signal.unit, dimension)
        return self

    @model_validator(mode="after")
    def _check_assumed(self) -> Self:
        for name in self.assumed:
            refuse(
                (
                    name not in self.model_fields_set,
                    f"assumed: {name!r} is not a key of this section; remove it from the list",
                )
            )
        return self


class PlaceKeys(KeyPart):
    """place: the position of the recording, for models of the magnetic field and of gravity;
    latitude and longitude in `unit`, height in m."""

    latitude: Finite
    longitude: Finite
    height: Finite = 0.0
    unit: AngleUnit = MISSING

    @property
    def lla(self) -> list[float]:
        """Latitude and longitude in rad, ellipsoidal height in m."""
        return [self.latitude * self.unit, self.longitude * self.unit, self.height]

    @model_validator(mode="after")
    def _on_earth(self) -> Self:
        latitude, longitude, height = self.lla
        degrees = f"{math.degrees(latitude):g}"
        refuse(
            (
                abs(latitude) > math.pi / 2 * (1 + 1e-12) or abs(longitude) > 2 * math.pi,
                f"no place is at latitude {degrees}, longitude {math.degrees(longitude):g} deg; check "
                f"unit and order",
            ),
            (
                abs(latitude) > LATITUDE_LIMIT,
                f"latitude: {degrees} deg; results hold up to {math.degrees(LATITUDE_LIMIT):.0f} deg",
            ),
            (
                not -12e3 <= height <= 850e3,
                f"height: {height:g} m is no height of a vehicle; is it in m?",
            ),
        )
        return self


BOUNDS = {
    "speed": "speed",
    "acceleration": "acceleration",
    "lowest": "length",
    "highest": "length",
}
"""Limits of a vehicle, with their dimensions; SI, unless the key NAME_unit names a unit."""


def _vehicle(value: Any) -> GivenVehicle:
    """vehicle: a name, or a table of limits."""
    if not isinstance(value, dict):
        find_vehicle(value)
        return value
    if not value:
        find_vehicle(value)  # raises for an unknown name
    check_keys(value, ["name", *BOUNDS, *(f"{bound}_unit" for bound in BOUNDS)])
    bounds = {}
    for bound, dimension in BOUNDS.items():
        if bound in value:
            unit = value.get(f"{bound}_unit")
            scale = 1.0 if unit is None else call_with_key(bound, factor, unit, dimension)
            bounds[bound] = scale * check_number(value[bound], bound, least=-math.inf)
    return Vehicle(str(value.get("name", "own")), **bounds)


class Vector(KeyPart):
    """Columns of a reference with one unit, or a unit for each. A velocity and an attitude may have
    axes; an attitude may be a quaternion, a velocity may be speed and course, and a position may be
    in ECEF or have its height above the geoid."""

    columns: list[Column]
    unit: Any = None
    form: Form | None = None
    axes: str | None = None
    quaternion: QuaternionOrder | None = None
    geoid: Geoid = None

    @property
    def ecef(self) -> bool:
        """True where the axes are ECEF."""
        return is_ecef(self.axes)

    def quantities(self, key: str) -> tuple[str, ...]:
        """Return the quantities of the columns for the part `key` of a reference."""
        if self.form is not None:
            return FORMS[self.form]
        return ("length",) * 3 if self.ecef and key == "position" else VECTORS[key]


class ReferencePart(KeyPart):
    """[reference]: missing parts are not scored; with only a file, the columns are those of the
    library's own tables."""

    file: str
    table: str | None = None
    time: Time | None = None
    where: Where = []
    position: Vector | None = None
    velocity: Vector | None = None
    attitude: Vector | None = None

    @property
    def parts(self) -> dict[str, Vector]:
        """{"position", "velocity", "attitude": its columns} of the given parts."""
        found = {key: getattr(self, key) for key in VECTORS}
        return {key: part for key, part in found.items() if part is not None}

    @model_validator(mode="after")
    def _complete(self) -> Self:
        missing = "time" if self.time is None else "" if self.parts else "position"
        if missing and (self.parts or self.time is not None or self.where):
            raise ValueError(
                f"{missing}: is missing; a reference needs time and a position, velocity or attitude, "
                f"or, written by this library, the file alone"
            )
        for key, part in self.parts.items():
            _check_vector(key, part)
        return self


class Description(KeyPart):
    """A whole `recording.toml`."""

    epoch: Annotated[Any, AfterValidator(_epoch)] = None
    date: Annotated[Any, AfterValidator(_date)] = None
    point: Literal["imu", "reference"] = "imu"
    place: PlaceKeys | None = None
    vehicle: Annotated[Any, AfterValidator(_vehicle)] = None
    imu: ImuPart
    source: Annotated[list[SourcePart], Field(max_length=MAX_SOURCES)] = []
    reference: ReferencePart | None = None

    @property
    def lla(self) -> list[float] | None:
        """The place: latitude and longitude in rad, ellipsoidal height in m."""
        return None if self.place is None else self.place.lla


VECTORS = {
    "position": ("angle", "angle", "length"),
    "velocity": ("speed",) * 3,
    "attitude": ("angle",) * 3,
}
"""Dimensions of the parts of a reference."""


def _check_vector(key: str, part: Vector) -> None:
    is_attitude, axes = key == "attitude", part.axes
    if is_attitude:
        call_with_key(key, check_attitude_columns, part.columns, part.quaternion)
    needed = 4 if part.quaternion else len(part.quantities(key))
    refuse(
        (
            part.form is not None and key != "velocity",
            f"{key}.form: only a velocity takes it, as speed and course",
        ),
        (
            part.form is not None and axes is not None,
            f"{key}.axes: a course is measured from north, so speed and course take no axes",
        ),
        (
            part.geoid is not None and (key != "position" or part.ecef),
            f"{key}.geoid: only a position with latitude and longitude takes it",
        ),
        (
            len(part.columns) != needed,
            f"{key}.columns: {len(part.columns)} given, {needed} needed",
        ),
        (
            part.quaternion and not is_attitude,
            f"{key}.quaternion: only an attitude takes it",
        ),
        (part.quaternion and part.unit is not None, f"{key}.unit: a quaternion has none"),
        (
            axes is not None and key == "position" and not part.ecef,
            f"position.axes: {axes!r}; a position is latitude, longitude and height without axes, or "
            f'x, y, z with axes = "ECEF"',
        ),
    )
    call_with_key(f"{key}.unit", vector_factors, part, part.quantities(key))
    if axes == ECEF and not is_attitude:
        return
    if axes is not None and is_attitude:
        call_with_key(f"{key}.axes", axes_of, axes)
    elif axes is not None:
        call_with_key(f"{key}.axes", axes_matrix, axes, NAVIGATION_AXES, False)


def vector_factors(part: Vector, dimensions: Sequence[str]) -> list[float]:
    """Return the factor of each column to SI; 1 for a quaternion."""
    if part.quaternion:
        return [1.0] * 4
    many = len(dimensions)
    units = part.unit if isinstance(part.unit, list) else [part.unit] * many
    if len(units) != many:
        raise DataError(f"{len(units)} units given, {many} needed")
    return [factor(unit, dimension) for unit, dimension in zip(units, dimensions)]
