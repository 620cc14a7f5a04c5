"""The schema of `recording.toml`: its sections as types that check themselves before any table
is read."""

import datetime
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, model_validator

from ...checks import DataError, check_keys, check_number
from ...core.earth import LATITUDE_LIMIT
from ...estimable import ASKED_OF_IMU, asked
from ...preprocessing.attitude_record import QuaternionOrder, axes_of
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix, rotation_matrix
from ...time_scales import gps_of
from ...typing import Array
from ...units import factor
from ...vehicle import GivenVehicle, Vehicle, find as find_vehicle
from .schema_aiding import AidingPart, check_attitude_columns
from .schema_base import (
    MISSING,
    AngleUnit,
    Column,
    Finite,
    Part,
    Signal,
    Time,
    Triple,
    named,
    refuse,
)


def _body_axes(text: str) -> str:
    axes_matrix(text, BODY_AXES)
    return text


def _estimate(value: Any) -> dict[str, tuple[float, ...]]:
    return asked(value, ASKED_OF_IMU)


def _date(value: Any) -> str:
    if isinstance(value, (datetime.date, datetime.datetime)):
        return value.isoformat()
    try:
        datetime.datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise ValueError(f'{value!r} is no date; write it as "2012-10-10"') from None
    return value


def _epoch(value: Any) -> float:
    """Of t = 0, in seconds of GPS time since its zero."""
    return gps_of(value)


class Mounting(Part):
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


class Temperature(Part):
    """temperature: the column of the IMU's own, degC = column * scale + offset."""

    column: Column
    unit: Literal["degC"] = "degC"
    scale: Finite = 1.0
    offset: Finite = 0.0


class ImuPart(Part):
    """[imu]"""

    file: str
    table: str | None = None
    time: Time
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

    @property
    def dimensions(self) -> tuple[str, str]:
        """Dimensions of gyro and accel."""
        return (
            ("angular rate", "acceleration")
            if self.kind == "rate"
            else ("angle", "velocity increment")
        )

    @property
    def matrix(self) -> Array:
        """(3, 3) from the columns to the body: axes, then mounting."""
        C = axes_matrix(self.axes, BODY_AXES)
        return C if self.mounting is None else self.mounting.matrix @ C

    @model_validator(mode="after")
    def _units(self) -> Self:
        for name, signal, dimension in zip(
            ("gyro", "accel"), (self.gyro, self.accel), self.dimensions
        ):
            named(f"{name}.unit", factor, signal.unit, dimension)
        return self


class Place(Part):
    """place: where the recording is, for models of the magnetic field and of gravity; latitude
    and longitude in `unit`, height in m."""

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
"""Of a vehicle, with their dimensions; SI, where the key NAME_unit names no unit."""


def _vehicle(value: Any) -> GivenVehicle:
    """vehicle: a name, or a table of bounds of one's own."""
    if not isinstance(value, dict):
        find_vehicle(value)
        return value
    if not value:
        find_vehicle(value)  # which says what it may have
    check_keys(value, ["name", *BOUNDS, *(f"{bound}_unit" for bound in BOUNDS)])
    bounds = {}
    for bound, dimension in BOUNDS.items():
        if bound in value:
            unit = value.get(f"{bound}_unit")
            scale = 1.0 if unit is None else named(bound, factor, unit, dimension)
            bounds[bound] = scale * check_number(value[bound], bound, least=-math.inf)
    return Vehicle(str(value.get("name", "own")), **bounds)


class Vector(Part):
    """Columns of a reference with their unit, or a unit for each; a velocity and an attitude
    take axes, an attitude may be a quaternion."""

    columns: list[Column]
    unit: Any = None
    axes: str | None = None
    quaternion: QuaternionOrder | None = None


class ReferencePart(Part):
    """[reference]: what is missing is not scored; with a file alone, the columns are those of
    the library's own tables."""

    file: str
    table: str | None = None
    time: Time | None = None
    position: Vector | None = None
    velocity: Vector | None = None
    attitude: Vector | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        parts = {
            "time": self.time,
            "position": self.position,
            "velocity": self.velocity,
            "attitude": self.attitude,
        }
        missing = [key for key in ("time", "position") if parts[key] is None]
        if missing and any(part is not None for part in parts.values()):
            raise ValueError(
                f"{missing[0]}: is missing; a reference needs time and position, or, written by this "
                f"library, the file alone"
            )
        for key, part in parts.items():
            if isinstance(part, Vector):
                _check_vector(key, part)
        return self


class Description(Part):
    """A whole `recording.toml`."""

    epoch: Annotated[Any, AfterValidator(_epoch)] = None
    date: Annotated[Any, AfterValidator(_date)] = None
    point: Literal["imu", "reference"] = "imu"
    place: Place | None = None
    vehicle: Annotated[Any, AfterValidator(_vehicle)] = None
    imu: ImuPart
    aiding: list[AidingPart] = []
    reference: ReferencePart | None = None


VECTORS = {
    "position": ["angle", "angle", "length"],
    "velocity": ["speed"] * 3,
    "attitude": ["angle"] * 3,
}
"""Dimensions of the parts of a reference."""


def _check_vector(key: str, part: Vector) -> None:
    is_attitude, axes = key == "attitude", part.axes
    if is_attitude:
        named(key, check_attitude_columns, part.columns, part.quaternion)
    refuse(
        (
            len(part.columns) != (4 if part.quaternion else 3),
            f"{key}.columns: {len(part.columns)} given, 3 needed",
        ),
        (
            part.quaternion and not is_attitude,
            f"{key}.quaternion: only an attitude takes it",
        ),
        (part.quaternion and part.unit is not None, f"{key}.unit: a quaternion has none"),
        (
            axes is not None and key == "position",
            "position.axes: only a velocity and an attitude take axes",
        ),
    )
    named(f"{key}.unit", vector_factors, part, VECTORS[key])
    if axes is not None and is_attitude:
        named(f"{key}.axes", axes_of, axes)
    elif axes is not None:
        named(f"{key}.axes", axes_matrix, axes, NAVIGATION_AXES, False)


def vector_factors(part: Vector, dimensions: Sequence[str]) -> list[float]:
    """Factor to SI of each of the columns; 1 of a quaternion's."""
    if part.quaternion:
        return [1.0] * 4
    units = part.unit if isinstance(part.unit, list) else [part.unit] * 3
    if len(units) != 3:
        raise DataError(f"{len(units)} units given, 3 needed")
    return [factor(unit, dimension) for unit, dimension in zip(units, dimensions)]
