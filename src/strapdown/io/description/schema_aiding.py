"""The schema of `[[aiding]]` in `recording.toml`: a source of fixes, whose kind decides which
keys it takes."""

import math
import re
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from ...aiding import find
from ...core.contract import Measurement
from ...preprocessing.attitude_record import QuaternionOrder, axes_of
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix
from ...quantities import dimension, innovation_dimension
from ...typing import Array
from ...units import factor
from .schema_base import Column, Finite, Part, Time, Triple, column, is_number, named

HEADING = r"(yaw|heading|hdg|psi|azimuth)"
"""How columns of a heading are named."""


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
    vector = tuple(value[key] * factor(value["unit"], "magnetic field") for key in axes)
    if not 1e-6 <= math.hypot(*vector) <= 100e-6:
        raise ValueError(
            f"its strength is {math.hypot(*vector) * 1e6:.4g} uT, where the Earth's is 22 to 67; "
            f"check the unit"
        )
    if math.hypot(*vector[:2]) < 1e-3 * math.hypot(*vector):
        raise ValueError(
            "it has nothing horizontal and so gives no heading; give north and east, or leave it "
            "out for the geomagnetic model"
        )
    return vector


class Declination(Part):
    """declination of a field taken from the record: of magnetic from true north, positive east."""

    value: Finite
    unit: str | None = None

    @property
    def angle(self) -> float:
        """rad."""
        return self.value * factor(self.unit, "angle")

    @model_validator(mode="after")
    def _units(self) -> Self:
        named("unit", factor, self.unit, "angle")
        return self


class AidingPart(Part):
    """[[aiding]]: what its kind measures decides which keys it takes."""

    kind: str
    file: str | None = None
    time: Time | None = None
    columns: list[Column] | None = None
    unit: Any = None
    scale: Any = 1.0
    axes: str | None = None
    quaternion: QuaternionOrder | None = None
    sd: Any = None
    lever_arm: Triple | None = None
    calibration: str | None = None
    field: Annotated[Any, AfterValidator(_field)] = None
    declination: Declination | None = None
    rate: Annotated[Finite, Field(gt=0)] | None = None
    level: Annotated[Finite, Field(ge=-12e3, le=12e3)] | None = None
    gate: Annotated[float, Field(gt=0)] | None = None
    name: str | None = None

    @property
    def sensor(self) -> Measurement:
        """The Measurement of this kind: quantities, frame, what the lever arm means."""
        return find(self.kind)

    @property
    def many(self) -> int:
        """Components that are measured: those of the kind, of an attitude without a column of
        the heading two."""
        sensor = self.sensor
        tilt = sensor.name == "attitude" and self.columns is not None and len(self.columns) == 2
        return 2 if tilt else len(sensor.quantities)

    @property
    def units(self) -> list[Any]:
        """A unit per component; of a quaternion that of its standard deviations."""
        return self.unit if isinstance(self.unit, list) else [self.unit] * self.many

    @property
    def scales(self) -> list[Any]:
        """A scale per column."""
        return (
            self.scale
            if isinstance(self.scale, list)
            else [self.scale] * (4 if self.quaternion else self.many)
        )

    @property
    def factors(self) -> list[float]:
        """What makes SI of each column: its scale and, but for a quaternion, its unit."""
        units = (
            [1.0] * 4
            if self.quaternion
            else [
                factor(unit, dimension(quantity))
                for unit, quantity in zip(self.units, self.sensor.quantities)
            ]
        )
        return [unit * scale for unit, scale in zip(units, self.scales)]

    @property
    def deviations(self) -> list[Any]:
        """A number, a column or a table of column, unit and scale per component."""
        return self.sd if isinstance(self.sd, list) else [self.sd] * self.many

    @property
    def matrix(self) -> Array | None:
        """(3, 3) that turns the columns into NED or FRD, or None where the kind is no vector."""
        named = {"n": NAVIGATION_AXES, "b": BODY_AXES}.get(self.sensor.vector)
        return (
            axes_matrix(
                self.axes or next(iter(named)),
                named,
                right_handed=self.sensor.parameters == "field",
            )
            if named
            else None
        )

    @property
    def vector_matrix(self) -> Array:
        """`matrix` of a kind that is known to be a vector."""
        matrix = self.matrix
        assert matrix is not None
        return matrix

    @model_validator(mode="after")
    def _agrees_with_kind(self) -> Self:
        sensor = named("kind", lambda: self.sensor)
        allowed = {"file", "time", "columns", "unit", "scale"} if sensor.recorded else {"rate"}
        for key in ("file", "time", "columns", "unit", "scale", "rate"):
            if key in self.model_fields_set and key not in allowed:
                raise ValueError(
                    f"{key}: {sensor.name} takes none; "
                    + (
                        "its fixes come at the times of the file"
                        if sensor.recorded
                        else "it is a constraint of the vehicle, given by rate and sd"
                    )
                )
        for key in sorted(allowed - {"unit", "scale"}) + ["sd"]:
            if getattr(self, key) is None:
                raise ValueError(
                    f"{key}: is missing; {sensor.name} needs "
                    f"{', '.join(sorted(allowed - {'scale'}))} and sd"
                )
        if self.axes is not None and sensor.name == "attitude":
            named("axes", axes_of, self.axes)
        elif self.axes is not None:
            if not sensor.vector:
                raise ValueError(f"axes: {sensor.name} is no vector and takes no axes")
            named("axes", lambda: self.matrix)
        self._parameters(sensor)
        self._components(sensor)
        return self

    def _parameters(self, sensor: Measurement) -> None:
        if self.lever_arm is not None and sensor.parameters not in ("antenna", "reference"):
            raise ValueError(f"lever_arm: {sensor.name} takes none")
        for key in ("calibration", "field", "declination"):
            if getattr(self, key) is not None and sensor.parameters != "field":
                raise ValueError(f"{key}: {sensor.name} takes none; only a magnetometer does")
        if self.level is not None and (sensor.recorded or sensor.quantities != ("length",)):
            raise ValueError(
                f"level: {sensor.name} takes none; it is the height of mean sea level, m above the "
                f"ellipsoid"
            )
        if self.quaternion and sensor.name != "attitude":
            raise ValueError(f"quaternion: {sensor.name} takes none; only an attitude does")
        if self.declination is not None and self.field != "record":
            raise ValueError(
                'declination: it belongs to field = "record"; the geomagnetic model and a given '
                "field have their own"
            )

    def _components(self, sensor: Measurement) -> None:
        many, columns = self.many, self.columns or []
        wanted = f"{sensor.name} has {many}: {', '.join(sensor.quantities[:many])}"
        if sensor.recorded:
            if sensor.name == "attitude":
                check_attitude_columns(columns, self.quaternion)
            elif len(columns) != many:
                raise ValueError(f"columns: {len(columns)} given, {wanted}")
            for key, values, length in (
                ("unit", self.units, many),
                ("scale", self.scales, len(columns)),
            ):
                if len(values) != length:
                    raise ValueError(
                        f"{key}: {len(values)} given, {wanted}"
                        if length == many
                        else f"{key}: {len(values)} given, {length} needed"
                    )
            for scale in self.scales:
                if not is_number(scale) or scale == 0:
                    raise ValueError(f"scale: {scale!r} is no number other than zero")
            for quantity, unit in zip(sensor.quantities, self.units):
                if unit is not None and not isinstance(unit, str):
                    raise ValueError(f"unit: {unit!r} is no text")
                named("unit", factor, unit, dimension(quantity))
        if len(self.deviations) != many:
            raise ValueError(f"sd: {len(self.deviations)} given, {wanted}")
        for quantity, sd in zip(sensor.quantities, self.deviations):
            self._deviation(sd, quantity, sensor.recorded)

    def _deviation(self, sd: Any, quantity: str, recorded: bool) -> None:
        if is_number(sd):
            if sd <= 0:
                raise ValueError(f"sd: {sd:g} must be above zero")
        elif not recorded:
            raise ValueError(f"sd: {sd!r} is no number")
        elif isinstance(sd, dict):
            unknown = set(sd) - {"column", "unit", "scale"}
            if (
                unknown
                or "column" not in sd
                or not is_number(sd.get("scale", 1.0))
                or sd.get("scale", 1.0) <= 0
            ):
                raise ValueError(
                    'sd: write { column = "name", unit = "m", scale = 1.0 }, with column and unit '
                    "at least and scale above zero"
                )
            named("sd", factor, sd.get("unit"), innovation_dimension(quantity))
        else:
            named("sd", column, sd)


def check_attitude_columns(columns: list[Column], quaternion: QuaternionOrder | None) -> None:
    """Raise ValueError where the columns are no roll, pitch and heading, no roll and pitch, and
    no quaternion of the order `quaternion`."""
    if quaternion is not None and len(columns) != 4:
        raise ValueError(
            f"columns: {len(columns)} given, a quaternion ({quaternion}) has 4; "
            "without the key quaternion they are roll, pitch, heading"
        )
    if quaternion is None and len(columns) == 4:
        raise ValueError(
            'columns: 4 given; of a quaternion say the order: quaternion = "wxyz", scalar first, or '
            '"xyzw"'
        )
    if len(columns) not in (2, 3, 4):
        raise ValueError(
            f"columns: {len(columns)} given; attitude is roll, pitch, heading, or roll and pitch "
            f"alone, or the four of a quaternion"
        )
    if len(columns) == 2 and re.match(HEADING, str(columns[1]).strip().lower()):
        raise ValueError(
            f"columns: {columns[1]!r} is named like a heading; two columns are roll and pitch, "
            "which come together (kind heading has one)"
        )
