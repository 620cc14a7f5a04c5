"""The schema of `recording.toml`: its sections as types that check themselves before any table
is read."""

import datetime
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, model_validator

from ...checks import DataError
from ...core.earth import LATITUDE_LIMIT
from ...preprocessing.attitude_record import QuaternionOrder, axes_of
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix, rotation_matrix
from ...typing import Array
from ...units import factor
from .schema_aiding import AidingPart, check_attitude_columns
from .schema_base import Column, Finite, Part, Signal, Time, Triple, named


def _body_axes(text: str) -> str:
    axes_matrix(text, BODY_AXES)
    return text


def _date(value: Any) -> str:
    if isinstance(value, (datetime.date, datetime.datetime)):
        return value.isoformat()
    try:
        datetime.datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise ValueError(f'{value!r} is no date; write it as "2012-10-10"') from None
    return value


class Mounting(Part):
    """Sensor to body: C_bs = Rz(heading) Ry(pitch) Rx(roll)."""

    roll: Finite = 0.0
    pitch: Finite = 0.0
    heading: Finite = 0.0
    unit: str | None = None

    @model_validator(mode="after")
    def _units(self) -> Self:
        named("unit", factor, self.unit, "angle")
        return self


class Temperature(Part):
    """temperature: the column of the IMU's own, degC = column * scale + offset."""

    column: Column
    unit: Literal["degC"] = "degC"
    scale: Finite = 1.0
    offset: Finite = 0.0


class ImuPart(Part):
    """[imu]"""

    file: str
    time: Time
    kind: Literal["rate", "increment"] = "rate"
    axes: Annotated[str, AfterValidator(_body_axes)] = "FRD"
    gyro: Signal
    accel: Signal
    mounting: Mounting | None = None
    calibration: str | None = None
    temperature: Temperature | None = None
    lever_arm: Triple = [0.0, 0.0, 0.0]
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
        if self.mounting is None:
            return C
        mounting, unit = self.mounting, factor(self.mounting.unit, "angle")
        angles = mounting.roll * unit, mounting.pitch * unit, mounting.heading * unit
        return rotation_matrix(*angles) @ C

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
    unit: str | None = None

    @property
    def lla(self) -> list[float]:
        """Latitude and longitude in rad, ellipsoidal height in m."""
        unit = factor(self.unit, "angle")
        return [self.latitude * unit, self.longitude * unit, self.height]

    @model_validator(mode="after")
    def _on_earth(self) -> Self:
        named("unit", factor, self.unit, "angle")
        latitude, longitude, height = self.lla
        if abs(latitude) > math.pi / 2 * (1 + 1e-12) or abs(longitude) > 2 * math.pi:
            raise ValueError(
                f"no place is at latitude {self.latitude:g}, longitude {self.longitude:g} "
                f"{self.unit}; check unit and order"
            )
        if abs(latitude) > LATITUDE_LIMIT:
            raise ValueError(
                f"latitude: {self.latitude:g} {self.unit}; results hold up to "
                f"{math.degrees(LATITUDE_LIMIT):.0f} deg"
            )
        if not -12e3 <= height <= 850e3:
            raise ValueError(f"height: {height:g} m is no height of a vehicle; is it in m?")
        return self


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
    time: Time | None = None
    position: Vector | None = None
    velocity: Vector | None = None
    attitude: Vector | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (
            self.time is None
            and self.position is None
            and self.velocity is None
            and self.attitude is None
        ):
            return self
        for key in ("time", "position"):
            if getattr(self, key) is None:
                raise ValueError(
                    f"{key}: is missing; a reference needs time and position, or, written by this "
                    f"library, the file alone"
                )
        for key, dimensions in (
            ("position", ["angle", "angle", "length"]),
            ("velocity", ["speed"] * 3),
            ("attitude", ["angle"] * 3),
        ):
            part = getattr(self, key)
            if part is not None:
                if key == "attitude":
                    named(key, check_attitude_columns, part.columns, part.quaternion)
                if len(part.columns) != (4 if part.quaternion else 3):
                    raise ValueError(f"{key}.columns: {len(part.columns)} given, 3 needed")
                if part.quaternion and (key != "attitude" or part.unit is not None):
                    raise ValueError(
                        f"{key}.{'unit: a quaternion has none' if key == 'attitude' else 'quaternion: only an attitude takes it'}"
                    )
                named(f"{key}.unit", lambda: vector_factors(part, dimensions))
                if part.axes is not None:
                    self._axes(key, part.axes)
        return self

    def _axes(self, key: str, axes: str) -> None:
        if key == "position":
            raise ValueError("position.axes: only a velocity and an attitude take axes")
        named(f"{key}.axes", axes_of, axes) if key == "attitude" else named(
            f"{key}.axes", axes_matrix, axes, NAVIGATION_AXES, False
        )


class Description(Part):
    """A whole `recording.toml`."""

    date: Annotated[Any, AfterValidator(_date)] = None
    point: Literal["imu", "reference"] = "imu"
    place: Place | None = None
    imu: ImuPart
    aiding: list[AidingPart] = []
    reference: ReferencePart | None = None


def vector_factors(part: Vector, dimensions: Sequence[str]) -> list[float]:
    """Factor to SI of each of the columns; 1 of a quaternion's."""
    if part.quaternion:
        return [1.0] * 4
    units = part.unit if isinstance(part.unit, list) else [part.unit] * 3
    if len(units) != 3:
        raise DataError(f"{len(units)} units given, 3 needed")
    return [factor(unit, dimension) for unit, dimension in zip(units, dimensions)]
