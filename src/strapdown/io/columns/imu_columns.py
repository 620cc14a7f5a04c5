"""Sections of a table's gyro, accelerometer, magnetometer and attitude, by the names and magnitudes
of its columns."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError
from ...preprocessing.axes import BODY_AXES, axes_matrix
from ...preprocessing.imu_samples import increments
from ...preprocessing.plausible import (
    MIN_MEDIAN_FORCE,
    NO_GRAVITY,
    UNFELT,
    is_temperature,
    mistakes,
)
from ...typing import Array
from ...units.constants import STANDARD_GRAVITY as G
from ...units.conversion import UNITS
from ..description.magnetic_sources import EARTH_FIELD
from ..description.schema_source import HEADING
from ..reader import GUESS, Section
from .column_names import ACCEL, GYRO, MAG, TEMPERATURE, ColumnNames

ANGLES = {"roll": r"(roll|phi)", "pitch": r"(pitch|theta)", "heading": HEADING}
NO_ANGLE = r"(?!.*(rate|dot|sd|std|sigma|var|cov|err|bias|acc))"
"""Text that excludes a column from being roll, pitch or heading."""
AXES = ("FRD", "forward-right-down")
IMU_KEYS = (
    '# mounting = { roll = 0.0, pitch = 0.0, heading = 0.0, unit = "deg" }    # sensor to body, where '
    "the IMU is not aligned with the vehicle",
    "# lever_arm = [0.0, 0.0, 0.0]    # m, forward-right-down, from the vehicle's reference point to "
    "the IMU",
)
UNCALIBRATED = (
    "the table does not say that it is calibrated, and nearby iron distorts the heading; calibrate it "
    "first (`strapdown calibrate`)"
)
MAG_KEYS = (
    '# place = { latitude = 47.0, longitude = 8.0, height = 500.0, unit = "deg" }    # at the top, '
    "beside date: headings are then from true north",
    '# calibration = "mag.toml"       # written by `strapdown calibrate`; few magnetometers are '
    "accurate without",
)


class Part(NamedTuple):
    """Keys of a section, reasons for assumed values, facts and open questions."""

    keys: dict[str, Any]
    assumed: dict[str, str] = {}
    facts: Sequence[str] = ()
    asked: Sequence[str] = ()


class Force(NamedTuple):
    """The accelerometer of a table."""

    names: list[str]
    raw: Array  # (n, 3), as in the table
    unit: str
    scale: float
    why: str  # unit and scale are assumed; "": the table states them
    axes: tuple[str, str]  # (axes, why they are assumed)

    @property
    def factor(self) -> float:
        """The factor from the raw values to m/s^2."""
        return self.scale * UNITS["acceleration"][self.unit]


def imu_section(
    columns: ColumnNames, time: dict[str, Any], t: Array
) -> tuple[Section | None, list[str], list[str]]:
    """(Section [imu] with gyro, accel or both, or None; facts; open questions) of a table with the
    times `time`, t (n,) s; units and axes are those that fit gravity best."""
    gyro, accel = columns.triple(GYRO), columns.triple(ACCEL)
    if not gyro and not accel:
        return None, [], []
    force = _force(columns, accel) if accel else None
    parts = [Part({"time": time})]
    parts += [_accel_part(force)] if force else []
    parts += [_gyro_part(columns, gyro, t, force)] if gyro else []
    parts.append(_temperature_part(columns))
    found = {key: value for part in parts for key, value in part.keys.items()}
    order = ("time", "kind", "axes", "gyro", "accel", "temperature")
    keys = {key: found[key] for key in order if key in found}
    assumed = {key: why for part in parts for key, why in part.assumed.items()}
    facts = [fact for part in parts for fact in part.facts]
    asked = [line for part in parts for line in part.asked]
    return Section("imu", "imu", keys, assumed=assumed, remarks=IMU_KEYS), facts, asked


def _force(columns: ColumnNames, names: list[str]) -> Force:
    """The Force of these columns."""
    raw = _stack(columns, names)
    found = Force(names, raw, *_accel_unit(columns, names[0], raw), AXES)
    whole = raw[np.isfinite(raw).all(axis=1)]
    if not len(whole):
        return found
    return found._replace(axes=_axes(np.median(whole, axis=0) * found.factor))


def _accel_part(force: Force) -> Part:
    """The keys accel and axes."""
    names, (axes, why_axes) = ", ".join(force.names), force.axes
    accel: dict[str, Any] = {"columns": force.names, "unit": force.unit}
    times = ""
    if force.scale != 1:
        accel["scale"] = float(f"{force.scale:.6g}")
        times = f" times {force.scale:g}"
    size = _strength(force.raw) * force.factor
    asked = [
        f"accel: {names} have a median magnitude of {size:.2g} m/s^2, where gravity alone gives 9.8: "
        f"{NO_GRAVITY}"
    ]
    return Part(
        {"axes": axes + GUESS, "accel": accel},
        {"axes": why_axes} | ({"accel": force.why} if force.why else {}),
        [f"accel: {names} in {force.unit}{times}; axes {axes} ({why_axes})"],
        asked if size < MIN_MEDIAN_FORCE else [],
    )


def _gyro_part(columns: ColumnNames, names: list[str], t: Array, force: Force | None) -> Part:
    """The key gyro."""
    raw = _stack(columns, names)
    unit, scale, why = _gyro_unit(columns, names[0], t, raw, force)
    whole = bool(np.all(raw[np.isfinite(raw)] % 1 == 0))
    asked = [
        f"gyro: {', '.join(names)} are whole numbers, as are the accelerometer's: enter unit and "
        f"scale from the data sheet in the draft, as gyro = {{ columns = [...], "
        f'unit = "deg/s", scale = 0.0076 }}'
    ]
    times = f" times {scale:g}" if scale != 1 else ""
    return Part(
        {"gyro": {"columns": names, "unit": unit} | ({"scale": scale} if scale != 1 else {})},
        {"gyro": why} if why else {},
        [f"gyro: {', '.join(names)} in {unit}{times}{' (a guess)' if why else ''}"],
        asked if why and force is not None and force.scale != 1 and whole else [],
    )


def _temperature_part(columns: ColumnNames) -> Part:
    """The key temperature, where a column holds degC."""
    name = columns.find(TEMPERATURE)
    if name is None:
        return Part({})
    said = columns.unit(name, ("degC", "degF"))
    if said == "degF" or not is_temperature(columns.numbers(name)):
        return Part({})
    return Part({"temperature": {"column": name}}, {} if said else {"temperature": "in degC"})


def _stack(columns: ColumnNames, names: list[str]) -> Array:
    return np.stack([columns.numbers(name) for name in names], axis=1)


def _strength(vectors: Array) -> float:
    """Median magnitude of the complete rows (n, 3); 0 without any."""
    whole = vectors[np.isfinite(vectors).all(axis=1)]
    return float(np.median(np.linalg.norm(whole, axis=1))) if len(whole) else 0.0


def _gyro_unit(
    columns: ColumnNames, name: str, t: Array, gyro: Array, force: Force | None
) -> tuple[str, float, str]:
    """(unit, scale, why they are assumed)."""
    for named in ("mdps", "mrad/s", "deg/h", "rad/s", "deg/s"):
        if columns.unit(name, (named,)):
            return (
                {"mdps": "deg/s", "mrad/s": "rad/s"}.get(named, named),
                (0.001 if named in ("mdps", "mrad/s") else 1.0),
                "",
            )
    if force is None:
        largest = float(np.nanpercentile(np.abs(gyro), 99)) if np.isfinite(gyro).any() else 0.0
        unit = "deg/s" if largest > 12 else "rad/s"
        return unit, 1.0, f"the unit is not in the name; 1 % of the values exceed {largest:.3g}"
    try:
        imu, _ = increments(t, gyro, force.raw * force.factor)
    except DataError:  # reading reports it
        return "rad/s", 1.0, "the unit is not in the name"
    turn = axes_matrix(force.axes[0], BODY_AXES).T
    imu = imu._replace(dtheta=imu.dtheta @ turn, dv=imu.dv @ turn)
    wrong = [text for field, text in mistakes(imu, "rate") if field == "gyro.unit"]
    if wrong:
        unless = ", unless it is a multicopter" * (UNFELT in wrong[0])
        return "deg/s", 1.0, f"too large for rad/s{unless}"
    return "rad/s", 1.0, "the unit is not in the name"


def _accel_unit(columns: ColumnNames, name: str, raw: Array) -> tuple[str, float, str]:
    """(unit, scale, why they are assumed) of the accelerometer columns."""
    unit = columns.unit(name, ("m/s^2", "mg", "g"))
    if unit is not None:
        return unit, 1.0, ""
    magnitude = _strength(raw)
    for unit, gravity in (("m/s^2", G), ("g", 1.0), ("mg", 1000.0)):
        if 0.6 < magnitude / gravity < 1.7:
            return unit, 1.0, f"median magnitude is {magnitude:.4g}"
    if magnitude < MIN_MEDIAN_FORCE:
        return "m/s^2", 1.0, f"median magnitude is {magnitude:.4g}"
    why = "counts? scale was set so that the median magnitude is gravity"
    return "m/s^2", G / magnitude, why


def _axes(force: Array) -> tuple[str, str]:
    """Return (axes, comment) that bring the median specific force to -z."""
    main = int(np.argmax(np.abs(force)))
    up = force[main] > 0
    if main == 2:
        return (
            ("FLU", "z points up; RFU where x points right and y forward")
            if up
            else ("FRD", "z points down; check that x points forward")
        )
    forward, other = ("z", "y") if main == 0 else ("x", "z")
    down = ("-" if up else "+") + "xyz"[main]
    for sign in "+-":
        text = f"+{forward} {sign}{other} {down}"
        try:
            axes_matrix(text, BODY_AXES)
            return text, "gravity is along " + "xyz"[main] + "; forward and right are a guess"
        except DataError:
            continue
    raise AssertionError("one of the two signs makes them right-handed")


def magnetometer_section(
    columns: ColumnNames, time: dict[str, Any], axes: str
) -> tuple[Section | None, list[str]]:
    """(Section [[source]] of a magnetometer or None, facts). Its unit is that of the name, or the
    one that gives about the Earth's field strength."""
    names = columns.triple(MAG)
    if not names:
        return None, []
    median = _strength(_stack(columns, names))
    known = UNITS["magnetic field"]
    named = columns.unit(names[0], ("uT", "nT", "mgauss", "gauss", "T"))
    tesla = named or next(
        (each for each in known if 0.32 < median * known[each] / EARTH_FIELD < 3.2), None
    )
    scale = 1.0 if tesla or not median > 0 else EARTH_FIELD / known["uT"] / median
    tesla = tesla or "uT"
    counts = "" if scale == 1 else "; counts? scale was set to the Earth's field"
    keys: dict[str, Any] = {"kind": "magnetic-field", "time": time, "columns": names, "unit": tesla}
    keys |= {"scale": float(f"{scale:.6g}")} if scale != 1 else {}
    keys |= {"axes": axes, "std": float(f"{1e-6 / known[tesla]:.3g}"), "field": "record"}
    assumed = {
        "axes": "those of the IMU; many magnetometers have others",
        "std": "in the unit above, here 1 uT",
        "field": "headings are from magnetic north; for true north give date and place at the top "
        "instead",
    } | ({} if named else {"unit": f"median strength is {median:.4g}{counts}"})
    fact = (
        f"magnetometer: {', '.join(names)} in {tesla}{'' if named else ' (a guess)'}"
        f"{f' times {scale:g}' if scale != 1 else ''}: check its axes and calibrate it"
    )
    section = Section(
        "source", "magnetometer", keys, assumed=assumed, left=UNCALIBRATED, remarks=MAG_KEYS
    )
    return section, [fact]


def attitude_section(
    columns: ColumnNames, time: dict[str, Any]
) -> tuple[Section | None, list[str]]:
    """(Section [[source]] of roll, pitch and heading or None, facts). It is left out: a logged
    attitude usually comes from another filter that used the same IMU."""
    tilt = {key: columns.find(NO_ANGLE + pattern) for key, pattern in ANGLES.items()}
    if not tilt["roll"] or not tilt["pitch"]:
        return None, []
    names = [name for name in tilt.values() if name]
    named = columns.unit(names[0], ("rad", "deg"))
    values = np.abs(_stack(columns, names))
    largest = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    angle = named or ("rad" if 0 < largest < 6.3 else "deg")
    keys = {
        "kind": "attitude",
        "time": time,
        "columns": names,
        "unit": angle,
        "std": 1.0 if angle == "deg" else 0.02,
        "axes": "FRD to NED",
    }
    assumed = {"std": "of roll, pitch and heading", "axes": 'or "FLU to ENU"'}
    assumed |= {} if named else {"unit": f"the largest is {largest:.4g}"}
    fact = f"attitude: {', '.join(names)} in {angle}{'' if named else ' (a guess)'}"
    left = (
        "an attitude beside the IMU usually comes from another filter that used the same IMU; if it is "
        "that of a separate AHRS, --take attitude=0 takes it"
    )
    return Section("source", "attitude", keys, assumed=assumed, left=left), [fact]
