"""The schema of `[[source]]` in `recording.toml`: a source of fixes, whose kind determines its
keys."""

import math
import re
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...aiding import find
from ...aiding.more_parameters import ATMOSPHERE, BEACON, DIRECTION, direction_of
from ...checks import DataError, check_number, is_number
from ...core.loop.contract import MeasurementModel
from ...data.calibration_parameters import asked_at, requested_priors
from ...data.solution import Correlated
from ...preprocessing.attitude_record import QuaternionOrder, axes_of
from ...preprocessing.axes import BODY_AXES, NAVIGATION_AXES, axes_matrix
from ...preprocessing.baseline_length import KIND as BASELINE, MIN_LENGTH
from ...preprocessing.fixes import DRAG, MAX_DRAG
from ...typing import Array
from ...units.constants import MAX_TIME_CONSTANT
from ...units.conversion import factor, spread_factor
from ...units.quantities import dimension, innovation_dimension, shown_unit
from .schema_base import (
    Column,
    Declination,
    EarthField,
    Finite,
    Geoid,
    KeyPart,
    Time,
    Triple,
    Where,
    call_with_key,
    column,
    refuse,
)

ECEF = "ECEF"
"""Axes with the origin at the centre of the Earth: x through latitude 0, longitude 0, z through the
north pole."""
FORMS = {
    "speed, course": ("speed", "angle"),
    "speed, course, down": ("speed", "angle", "speed"),
    "speed, course, up": ("speed", "angle", "speed"),
}
"""Forms of a velocity over ground, with the quantities of their columns."""
Form = Literal["speed, course", "speed, course, down", "speed, course, up"]
CELSIUS_ZERO = 273.15  # K
COVARIANCE = 6
"""Entries of `std` in ECEF: x, y, z, then xy, yz and zx of a covariance."""
HEADING = r"(yaw|heading|hdg|psi|azimuth)"
"""Names of columns of a heading."""


def is_ecef(axes: str | None) -> bool:
    """Return True where axes are "ECEF" or, of an attitude, "... to ECEF"."""
    return axes is not None and axes.split()[-1:] == [ECEF]


class CorrelatedPart(KeyPart):
    """correlated: time-correlated errors, in addition to the white ones of `std`."""

    std: Annotated[Finite, Field(ge=0)] | list[Annotated[Finite, Field(ge=0)]]
    time: Annotated[Finite, Field(gt=0, le=MAX_TIME_CONSTANT)]
    states: bool = True


class AtmospherePart(KeyPart):
    """atmosphere: what a weather station says, of the air in which an airspeed is indicated."""

    pressure: Annotated[Finite, Field(ge=100, le=1100)]  # hPa
    temperature: Annotated[Finite, Field(ge=-90, le=60)]  # degC
    height: Annotated[Finite, Field(ge=-500, le=9000)] = 0.0  # m above the ellipsoid

    @property
    def parameters(self) -> tuple[float, float, float]:
        """Pressure, Pa, temperature, K, height, m."""
        return 100 * self.pressure, CELSIUS_ZERO + self.temperature, self.height


class BeaconPart(KeyPart):
    """beacon: its place, deg, deg and m above the ellipsoid."""

    lat: Annotated[Finite, Field(ge=-90, le=90)]
    lon: Annotated[Finite, Field(ge=-360, le=360)]
    height: Annotated[Finite, Field(ge=-12e3, le=40e6)]


class SourcePart(KeyPart):
    """[[source]]: its kind determines which keys it takes."""

    kind: str
    file: str | None = None
    table: str | None = None
    time: Time | None = None
    where: Where = []
    columns: list[Column] | None = None
    form: Form | None = None
    unit: Any = None
    scale: Any = 1.0
    axes: str | None = None
    quaternion: QuaternionOrder | None = None
    std: Any = None
    geoid: Geoid = None
    lever_arm: Triple | None = None
    baseline: Triple | None = None
    direction: Triple | None = None
    beacon: BeaconPart | None = None
    calibration: str | None = None
    field: EarthField = None
    declination: Declination | None = None
    rate: Annotated[Finite, Field(gt=0)] | None = None
    level: Annotated[Finite, Field(ge=-12e3, le=12e3)] | None = None
    atmosphere: AtmospherePart | None = None
    drag: (
        Annotated[Finite, Field(gt=0, le=MAX_DRAG)]
        | list[Annotated[Finite, Field(gt=0, le=MAX_DRAG)]]
        | None
    ) = None
    estimate: Any = None
    slip_test: bool = True
    slip: Annotated[Finite, Field(ge=0, le=0.1)] = 0.0
    correlated: CorrelatedPart | None = None
    robust: bool = False
    adaptive: Annotated[Finite, Field(ge=0, le=MAX_TIME_CONSTANT)] = 0.0
    gate: Annotated[float, Field(gt=0)] | None = None
    receiver: str | None = None
    name: str | None = None

    @property
    def sensor(self) -> MeasurementModel:
        """The MeasurementModel of this kind: quantities, frame, meaning of the lever arm."""
        return find(self.kind)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities of the columns, from the kind or the given form; two for an attitude
        without a heading column."""
        sensor = self.sensor
        if self.form is not None:
            return FORMS[self.form]
        if self.ecef and sensor.name == "position":
            return ("length",) * 3
        tilt = sensor.name == "attitude" and self.columns is not None and len(self.columns) == 2
        return sensor.quantities[: 2 if tilt else None]

    @property
    def many(self) -> int:
        """Number of components of the columns."""
        return len(self.quantities)

    @property
    def ecef(self) -> bool:
        """True where the axes are ECEF."""
        return is_ecef(self.axes)

    @property
    def needs_place(self) -> bool:
        """True where reading its rows needs the position of the vehicle."""
        turned = self.ecef and self.kind != "position"
        return turned or (self.kind == "altitude" and self.geoid == "EGM96")

    @property
    def units(self) -> list[Any]:
        """A unit per component; for a quaternion, that of its standard deviations."""
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
        """The factor of each column to SI: its scale and, except for a quaternion, its unit."""
        units = (
            [1.0] * 4
            if self.quaternion
            else [
                factor(unit, dimension(quantity))
                for unit, quantity in zip(self.units, self.quantities)
            ]
        )
        return [unit * scale for unit, scale in zip(units, self.scales)]

    @property
    def deviations(self) -> list[tuple[Any, str, Any]]:
        """(a number, a column or a table of column, unit and scale; quantity; unit), one per
        component. For speed and course, that of the speed may be the only one; in ECEF there may be
        the six of a covariance."""
        entries = self.std if isinstance(self.std, list) else [self.std] * self.many
        if self.form is not None and not isinstance(self.std, list):
            entries = entries[:1]
        return list(zip(entries, self.quantities * 2, self.units * 2))

    @property
    def estimated(self) -> dict[str, tuple[float, ...]]:
        """Its estimated parameters: {name: prior standard deviations, SI}."""
        known = asked_at(self.sensor.calibration_parameters)
        return {} if self.estimate is None else requested_priors(self.estimate, known)

    @property
    def correlated_errors(self) -> Correlated | None:
        """Its correlated errors, with standard deviations in the unit of tables, such as m or uT,
        whatever the unit of the columns."""
        if self.correlated is None:
            return None
        given, quantities = self.correlated.std, self.sensor.quantities
        std = given if isinstance(given, list) else [given] * len(quantities)
        if len(std) != len(quantities) or not any(std):
            raise DataError(
                f"std: {len(std)} given, {self.sensor.name} has {len(quantities)}"
                if any(std)
                else "std: none is above zero; leave correlated out"
            )
        si = tuple(float(x) / shown_unit(quantity)[1] for x, quantity in zip(std, quantities))
        return Correlated(si, self.correlated.time, self.correlated.states)

    @property
    def more_parameters(self) -> tuple[float, ...]:
        """Its parameters behind the lever arm. Raises DataError."""
        if self.atmosphere is not None:
            return self.atmosphere.parameters
        if self.beacon is not None:
            return tuple(np.radians([self.beacon.lat, self.beacon.lon])) + (self.beacon.height,)
        return () if self.direction is None else direction_of(self.direction)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Its first parameters, where they are no lever arm."""
        if self.drag is not None:
            return tuple(self.drag if isinstance(self.drag, list) else [self.drag] * 2) + (0.0,)
        return () if self.baseline is None else tuple(self.baseline)

    @property
    def matrix(self) -> Array | None:
        """(3, 3) from the columns to NED or FRD, or None where they are not such a vector."""
        named = {"n": NAVIGATION_AXES, "b": BODY_AXES}.get(self.sensor.vector)
        if self.ecef or self.form is not None:
            return None
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
        sensor = call_with_key("kind", lambda: self.sensor)
        of_file = ("file", "table", "time", "where", "columns", "unit", "scale")
        refuse(
            *(
                (
                    key in self.model_fields_set,
                    f"{key}: {sensor.name} takes none; "
                    + (
                        "its fixes come at the times of the file"
                        if sensor.recorded
                        else "it is a constraint of the vehicle, given by rate and std"
                    ),
                )
                for key in (("rate",) if sensor.recorded else of_file)
            ),
            *(
                (
                    getattr(self, key) is None,
                    f"{key}: is missing; {sensor.name} needs "
                    f"{'columns, file, time, unit' if sensor.recorded else 'rate'} and std",
                )
                for key in (("columns", "file", "time") if sensor.recorded else ("rate",))
                + ("std",)
            ),
        )
        self._parameters(sensor)
        self._components(sensor)
        return self

    def _parameters(self, sensor: MeasurementModel) -> None:
        is_attitude, is_field = sensor.name == "attitude", sensor.parameters == "field"
        refuse(
            (
                self.axes is not None and sensor.name == "position" and not self.ecef,
                f"axes: {self.axes!r} of a position; it is latitude, longitude and height without "
                f'axes, or x, y, z with axes = "ECEF"',
            ),
            (
                self.axes is not None
                and not sensor.vector
                and sensor.name not in ("attitude", "position"),
                f"axes: {sensor.name} is not a vector and takes no axes",
            ),
            (
                self.ecef and sensor.vector == "b",
                f"axes: {sensor.name} is a vector in axes of the body, not in ECEF",
            ),
            (
                self.form is not None and sensor.name != "velocity",
                f"form: {sensor.name} takes none; only a velocity does, as speed and course",
            ),
            (
                self.form is not None and self.axes is not None,
                "axes: a course is measured from north, so speed and course take no axes",
            ),
            (
                self.geoid is not None
                and (sensor.name not in ("position", "altitude") or self.ecef),
                "geoid: only heights take it, those of a position with latitude and longitude or of an "
                "altitude",
            ),
            (
                self.ecef and is_attitude and self.many == 2,
                "axes: roll and pitch alone do not determine an attitude in ECEF; give all three or a "
                "quaternion",
            ),
            (
                "slip_test" in self.model_fields_set and sensor.name != "speed",
                f"slip_test: {sensor.name} takes none; speed does, where wheels measure it",
            ),
            (
                self.slip > 0 and not sensor.slips,
                f"slip: {sensor.name} takes none; zero-lateral-velocity does",
            ),
            (
                self.lever_arm is not None and sensor.parameters not in ("antenna", "reference"),
                f"lever_arm: {sensor.name} takes none",
            ),
            (
                self.baseline is not None and sensor.parameters != BASELINE,
                f"baseline: {sensor.name} takes none",
            ),
            (
                sensor.parameters == BASELINE and math.hypot(*self.baseline or ()) < MIN_LENGTH,
                f"baseline: {'is missing' if self.baseline is None else 'is too short'}; "
                f"{sensor.name} needs the vector from the first to the second antenna, m forward, "
                f"right, down, at least {MIN_LENGTH:g} m long",
            ),
            (
                (self.direction is None) == (sensor.more_parameters == DIRECTION),
                f"direction: {sensor.name} "
                + (
                    "takes none"
                    if self.direction
                    else "needs it: the vector forward, right, down along which it measures"
                ),
            ),
            (
                (self.beacon is None) == (sensor.more_parameters == BEACON),
                f"beacon: {sensor.name} "
                + (
                    "takes none"
                    if self.beacon
                    else "needs its place: { lat, lon, height }, deg, deg, m above the ellipsoid"
                ),
            ),
            (
                self.receiver is not None and sensor.name not in ("position", "baseline"),
                f"receiver: {sensor.name} takes none; only a position or a baseline has classes",
            ),
            (
                (self.drag is None) == (sensor.parameters == DRAG),
                f"drag: {sensor.name} "
                + (
                    "takes none"
                    if self.drag
                    else "needs it: of the rotors, 1/s, 0.1 to 0.6 as a rule"
                ),
            ),
            (
                isinstance(self.drag, list) and len(self.drag) != 2,
                "drag: give one coefficient, or two: forward and to the right",
            ),
            *(
                (
                    getattr(self, key) is not None and not is_field,
                    f"{key}: {sensor.name} takes none; only a magnetometer does",
                )
                for key in ("calibration", "field", "declination")
            ),
            (
                self.level is not None and (sensor.recorded or sensor.quantities != ("length",)),
                f"level: {sensor.name} takes none; it is the height of mean sea level, m above the "
                f"ellipsoid",
            ),
            (
                self.atmosphere is not None and sensor.more_parameters != ATMOSPHERE,
                f"atmosphere: {sensor.name} takes none; an indicated airspeed does",
            ),
            (
                self.quaternion and not is_attitude,
                f"quaternion: {sensor.name} takes none; only an attitude does",
            ),
            (
                self.declination is not None and self.field != "record",
                'declination: it belongs to field = "record"; the geomagnetic model and a given '
                "field have their own",
            ),
        )
        call_with_key("estimate", lambda: self.estimated)
        call_with_key("direction", lambda: self.more_parameters)
        call_with_key("correlated", lambda: self.correlated_errors)
        if self.axes is not None and self.axes != ECEF:
            call_with_key("axes", axes_of if is_attitude else lambda axes: self.matrix, self.axes)

    def _components(self, sensor: MeasurementModel) -> None:
        many, columns = self.many, self.columns or []
        wanted = f"{sensor.name} has {many}: {self.form or ', '.join(self.quantities)}"
        if sensor.recorded:
            if sensor.name == "attitude":
                check_attitude_columns(columns, self.quaternion)
            given, needed = len(columns), len(self.scales)
            refuse(
                (
                    sensor.name != "attitude" and given != many,
                    f"columns: {given} given, {wanted}",
                ),
                (len(self.units) != many, f"unit: {len(self.units)} given, {wanted}"),
                (
                    needed != given,
                    f"scale: {needed} given, {wanted if given == many else f'{given} needed'}",
                ),
                *(
                    (
                        not is_number(scale) or scale == 0,
                        f"scale: {scale!r} must be a number other than zero",
                    )
                    for scale in self.scales
                ),
            )
            for quantity, unit in zip(self.quantities, self.units):
                call_with_key("unit", factor, unit, dimension(quantity))
        given = len(self.std) if isinstance(self.std, list) else many
        whole = self.ecef and sensor.name != "attitude" and given == COVARIANCE
        refuse((given != many and not whole, f"std: {given} given, {wanted}"))
        for std, quantity, _ in self.deviations:
            self._deviation(std, quantity, sensor.recorded)

    def _deviation(self, std: Any, quantity: str, recorded: bool) -> None:
        if is_number(std) or not recorded:
            check_number(std, "std", above=0)
        elif isinstance(std, dict):
            scale = std.get("scale", 1.0)
            refuse(
                (
                    not {"column"} <= set(std) <= {"column", "unit", "scale"}
                    or not (is_number(scale) and scale > 0),
                    'std: write { column = "name", unit = "m", scale = 1.0 }, with at least column and '
                    "unit, and scale above zero",
                )
            )
            call_with_key("std", spread_factor, std.get("unit"), innovation_dimension(quantity))
        else:
            call_with_key("std", column, std)


def check_attitude_columns(columns: list[Column], quaternion: QuaternionOrder | None) -> None:
    """Raise ValueError unless the columns are roll, pitch and heading, roll and pitch, or a
    quaternion of the order `quaternion`."""
    given, second = len(columns), [*columns, None, None][1]
    refuse(
        (
            quaternion is not None and given != 4,
            f"columns: {given} given, a quaternion ({quaternion}) has 4; "
            "without the key quaternion they are roll, pitch, heading",
        ),
        (
            quaternion is None and given == 4,
            'columns: 4 given; for a quaternion give the order: quaternion = "wxyz", scalar first, or '
            '"xyzw"',
        ),
        (
            given not in (2, 3, 4),
            f"columns: {given} given; attitude is roll, pitch, heading, or roll and pitch "
            f"alone, or the four of a quaternion",
        ),
        (
            given == 2 and re.match(HEADING, str(second).strip().lower()),
            f"columns: {second!r} has the name of a heading, but two columns are roll and pitch; "
            "give both (kind heading has one column)",
        ),
    )
