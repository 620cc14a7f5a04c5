"""The schema of `recording.toml`: its sections as types that check themselves before any table is read."""
import datetime
import math
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from ..core.earth import LATITUDE_LIMIT
from ..data import DataError
from .axes import BODY, NAVIGATION, axes_matrix
from .units import DIMENSIONS, factor

Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]


def _column(value):
    if isinstance(value, str) and value or isinstance(value, int) and not isinstance(value, bool) and value >= 1:
        return value
    raise ValueError(f"{value!r} is no column: give its name, or in a file without header its number, the first being 1")


def _body_axes(text):
    axes_matrix(text, BODY)
    return text


def _date(value):
    if isinstance(value, (datetime.date, datetime.datetime)):
        return value.isoformat()
    try:
        datetime.datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise ValueError(f"{value!r} is no date; write it as \"2012-10-10\"") from None
    return value


def _field(value):
    """"record", or north, east, down in T."""
    if value == "record":
        return value
    example = '{ north = 17.6, east = 0.1, down = 52.8, unit = "uT" }'
    axes = ("north", "east", "down")
    if not isinstance(value, dict) or set(value) != {*axes, "unit"} or not all(_is_number(value[key]) for key in axes):
        raise ValueError(f"write {example}, or \"record\" for the strengths in the record, or leave it out for the geomagnetic model")
    vector = tuple(value[key] * factor(value["unit"], "magnetic field") for key in axes)
    if not 1e-6 <= math.hypot(*vector) <= 100e-6:
        raise ValueError(f"its strength is {math.hypot(*vector) * 1e6:.4g} uT, where the Earth's is 22 to 67; check the unit")
    if math.hypot(*vector[:2]) < 1e-3 * math.hypot(*vector):
        raise ValueError("it has nothing horizontal and so gives no heading; give north and east, or leave it out for the geomagnetic model")
    return vector


Column = Annotated[Any, AfterValidator(_column)]
Columns = Annotated[list[Column], Field(min_length=3, max_length=3)]


class Part(BaseModel):
    """Base of all parts: unknown keys are refused, numbers are not taken from text."""
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Time(Part):
    """t = column * scale * unit + offset, s."""
    column: Column
    unit: str | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0

    @model_validator(mode="after")
    def _units(self):
        _named("unit", factor, self.unit, "time")
        return self


class Signal(Part):
    """Three columns with one unit; `scale` is what a count is worth in that unit."""
    columns: Columns
    unit: str | None = None
    scale: Finite = 1.0


class Mounting(Part):
    """Sensor to body: C_bs = Rz(heading) Ry(pitch) Rx(roll)."""
    roll: Finite = 0.0
    pitch: Finite = 0.0
    heading: Finite = 0.0
    unit: str | None = None

    @model_validator(mode="after")
    def _units(self):
        _named("unit", factor, self.unit, "angle")
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
    def dimensions(self):
        """Dimensions of gyro and accel."""
        return ("angular rate", "acceleration") if self.kind == "rate" else ("angle", "velocity increment")

    @model_validator(mode="after")
    def _units(self):
        for name, signal, dimension in zip(("gyro", "accel"), (self.gyro, self.accel), self.dimensions):
            _named(f"{name}.unit", factor, signal.unit, dimension)
        return self


class Place(Part):
    """place: where the recording is, for models of the magnetic field and of gravity; latitude and longitude in `unit`, height in m."""
    latitude: Finite
    longitude: Finite
    height: Finite = 0.0
    unit: str | None = None

    @property
    def lla(self):
        """Latitude and longitude in rad, ellipsoidal height in m."""
        unit = factor(self.unit, "angle")
        return [self.latitude * unit, self.longitude * unit, self.height]

    @model_validator(mode="after")
    def _on_earth(self):
        _named("unit", factor, self.unit, "angle")
        latitude, longitude, height = self.lla
        if abs(latitude) > math.pi / 2 * (1 + 1e-12) or abs(longitude) > 2 * math.pi:
            raise ValueError(f"no place is at latitude {self.latitude:g}, longitude {self.longitude:g} {self.unit}; check unit and order")
        if abs(latitude) > LATITUDE_LIMIT:
            raise ValueError(f"latitude: {self.latitude:g} {self.unit}; results hold up to {math.degrees(LATITUDE_LIMIT):.0f} deg")
        if not -12e3 <= height <= 850e3:
            raise ValueError(f"height: {height:g} m is no height of a vehicle; is it in m?")
        return self


class Declination(Part):
    """declination of a field taken from the record: of magnetic from true north, positive east."""
    value: Finite
    unit: str | None = None

    @property
    def angle(self):
        """rad."""
        return self.value * factor(self.unit, "angle")

    @model_validator(mode="after")
    def _units(self):
        _named("unit", factor, self.unit, "angle")
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
    def sensor(self):
        """The Sensor of this kind: quantities, frame, what the lever arm means."""
        from ..aiding import find
        return find(self.kind)

    @property
    def units(self):
        """A unit per component."""
        return self.unit if isinstance(self.unit, list) else [self.unit] * len(self.sensor.quantities)

    @property
    def scales(self):
        """A scale per component."""
        return self.scale if isinstance(self.scale, list) else [self.scale] * len(self.sensor.quantities)

    @property
    def deviations(self):
        """A number, a column or a DeviationPart per component."""
        return self.sd if isinstance(self.sd, list) else [self.sd] * len(self.sensor.quantities)

    @property
    def matrix(self):
        """What turns the columns into NED or FRD, or None where the kind is no vector."""
        named = {"n": NAVIGATION, "b": BODY}.get(self.sensor.vector)
        return axes_matrix(self.axes or next(iter(named)), named, right_handed=self.sensor.parameters == "field") if named else None

    @model_validator(mode="after")
    def _agrees_with_kind(self):
        sensor = _named("kind", lambda: self.sensor)
        allowed = {"file", "time", "columns", "unit", "scale"} if sensor.recorded else {"rate"}
        for key in ("file", "time", "columns", "unit", "scale", "rate"):
            if key in self.model_fields_set and key not in allowed:
                raise ValueError(f"{key}: {sensor.name} takes none; " + ("its fixes come at the times of the file" if sensor.recorded
                                                                         else "it is a constraint of the vehicle, given by rate and sd"))
        for key in sorted(allowed - {"unit", "scale"}) + ["sd"]:
            if getattr(self, key) is None:
                raise ValueError(f"{key}: is missing; {sensor.name} needs {', '.join(sorted(allowed - {'scale'}))} and sd")
        if self.axes is not None:
            if not sensor.vector:
                raise ValueError(f"axes: {sensor.name} is no vector and takes no axes")
            _named("axes", lambda: self.matrix)
        self._parameters(sensor)
        self._components(sensor)
        return self

    def _parameters(self, sensor):
        if self.lever_arm is not None and sensor.parameters not in ("antenna", "reference"):
            raise ValueError(f"lever_arm: {sensor.name} takes none")
        for key in ("calibration", "field", "declination"):
            if getattr(self, key) is not None and sensor.parameters != "field":
                raise ValueError(f"{key}: {sensor.name} takes none; only a magnetometer does")
        if self.level is not None and (sensor.recorded or sensor.quantities != ("length",)):
            raise ValueError(f"level: {sensor.name} takes none; it is the height of mean sea level, m above the ellipsoid")
        if self.declination is not None and self.field != "record":
            raise ValueError("declination: it belongs to field = \"record\"; the geomagnetic model and a given field have their own")

    def _components(self, sensor):
        many = len(sensor.quantities)
        wanted = f"{sensor.name} has {many}: {', '.join(sensor.quantities)}"
        if sensor.recorded:
            if len(self.columns) != many:
                raise ValueError(f"columns: {len(self.columns)} given, {wanted}")
            for key, values in (("unit", self.units), ("scale", self.scales)):
                if len(values) != many:
                    raise ValueError(f"{key}: {len(values)} given, {wanted}")
            for quantity, unit, scale in zip(sensor.quantities, self.units, self.scales):
                if not _is_number(scale) or scale == 0:
                    raise ValueError(f"scale: {scale!r} is no number other than zero")
                if unit is not None and not isinstance(unit, str):
                    raise ValueError(f"unit: {unit!r} is no text")
                _named("unit", factor, unit, DIMENSIONS[quantity])
        if len(self.deviations) != many:
            raise ValueError(f"sd: {len(self.deviations)} given, {wanted}")
        for quantity, sd in zip(sensor.quantities, self.deviations):
            self._deviation(sd, quantity, sensor.recorded)

    def _deviation(self, sd, quantity, recorded):
        if _is_number(sd):
            if sd <= 0:
                raise ValueError(f"sd: {sd:g} must be above zero")
        elif not recorded:
            raise ValueError(f"sd: {sd!r} is no number")
        elif isinstance(sd, dict):
            unknown = set(sd) - {"column", "unit", "scale"}
            if unknown or "column" not in sd or not _is_number(sd.get("scale", 1.0)) or sd.get("scale", 1.0) <= 0:
                raise ValueError("sd: write { column = \"name\", unit = \"m\", scale = 1.0 }, with column and unit at least and scale above zero")
            _named("sd", factor, sd.get("unit"), deviation_dimension(quantity))
        else:
            _named("sd", _column, sd)


class Vector(Part):
    """Columns of a reference with their unit, or a unit for each."""
    columns: list[Column]
    unit: Any = None
    axes: str = "NED"


class ReferencePart(Part):
    """[reference]: what is missing is not scored; with a file alone, the columns are those of the library's own tables."""
    file: str
    time: Time | None = None
    position: Vector | None = None
    velocity: Vector | None = None
    attitude: Vector | None = None

    @model_validator(mode="after")
    def _complete(self):
        if self.time is None and self.position is None and self.velocity is None and self.attitude is None:
            return self
        for key in ("time", "position"):
            if getattr(self, key) is None:
                raise ValueError(f"{key}: is missing; a reference needs time and position, or, written by this library, the file alone")
        for key, dimensions in (("position", ["angle", "angle", "length"]), ("velocity", ["speed"] * 3), ("attitude", ["angle"] * 3)):
            part = getattr(self, key)
            if part is not None:
                if len(part.columns) != 3:
                    raise ValueError(f"{key}.columns: {len(part.columns)} given, 3 needed")
                _named(f"{key}.unit", lambda: vector_factors(part, dimensions))
                _named(f"{key}.axes", axes_matrix, part.axes, NAVIGATION, False)
                if part.axes != "NED" and key != "velocity":
                    raise ValueError(f"{key}.axes: only a velocity takes axes")
        return self


class Description(Part):
    """A whole `recording.toml`."""
    date: Annotated[Any, AfterValidator(_date)] = None
    point: Literal["imu", "reference"] = "imu"
    place: Place | None = None
    imu: ImuPart
    aiding: list[AidingPart] = []
    reference: ReferencePart | None = None


def deviation_dimension(quantity):
    """Dimension of the standard deviation of a quantity: length for latitude, longitude and pressure (a height), else its own."""
    return "length" if quantity in ("latitude", "longitude", "pressure") else DIMENSIONS[quantity]


def vector_factors(part, dimensions):
    """Factor to SI of each of the three columns."""
    units = part.unit if isinstance(part.unit, list) else [part.unit] * 3
    if len(units) != 3:
        raise DataError(f"{len(units)} units given, 3 needed")
    return [factor(unit, dimension) for unit, dimension in zip(units, dimensions)]


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _named(key, function, *arguments):
    try:
        return function(*arguments)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
