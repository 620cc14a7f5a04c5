"""Scenario files (TOML): every number's key names its unit, every unknown key is refused.
docs/simulate.md lists the keys."""

import datetime
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..checks import DataError, check_keys, did_you_mean
from ..files import read_toml
from ..sensor_models.ahrs import Ahrs
from ..sensor_models.barometer import Barometer
from ..sensor_models.gnss import Gnss
from ..sensor_models.magnetometer import Disturbance, Magnetometer
from ..sensor_models.simulated import Simulated
from ..typing import File
from . import motions
from .jsbsim import Target, jsbsim_motion
from .scenario_model import START_SD, Scenario
from .sortie import sortie
from .trajectory import DEG, Motion, demo_flight
from .waypoints import waypoints

MOTION_KINDS: dict[str, Callable[..., Motion]] = {
    "demo": demo_flight,
    "static": motions.static,
    "straight": motions.straight,
    "flight": motions.flight,
    "sortie": sortie,
    "waypoints": waypoints,
    "car": motions.car,
    "ship": motions.ship,
    "hand-held": motions.hand_held,
    "moored": motions.moored,
    "jsbsim": jsbsim_motion,
}
"""What a [motion] can be, and the function that makes it; the function's parameters are its
keys."""
UNIT_OF_PARAMETER = {
    "azimuth": "deg",
    "course": "deg",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
    "amplitude": "deg",
    "turn": "deg",
    "bank": "deg",
    "speed": "m_s",
    "climb": "m_s",
    "duration": "s",
    "period": "s",
    "wave_period": "s",
    "smoothing": "s",
    "wave_height": "m",
    "heave": "m",
    "rest": "s",
    "wind": "m_s",
    "wind_from": "deg",
}
"""Unit of each parameter that has one: its key ends in it."""
TOP_KEYS = (
    "name",
    "about",
    "duration_s",
    "rate_hz",
    "imu",
    "accel_offset_m_s2",
    "accel_offset_decays",
    "gate",
    "gravity",
    "date",
    "motion",
    "gnss",
    "magnetometer",
    "barometer",
    "attitude",
    "sensors",
    "start",
)
START_KEYS = {
    "position_sd_m": (0, 1.0),
    "velocity_sd_m_s": (3, 1.0),
    "attitude_sd_deg": (6, DEG),
    "accel_bias_sd_m_s2": (9, 1.0),
    "gyro_bias_sd_deg_h": (12, DEG / 3600),
}
GNSS_KEYS = (
    "interval_s",
    "position_sd_m",
    "velocity_sd_m_s",
    "lever_arm_m",
    "outages_s",
    "latency_s",
)
MAGNETOMETER_KEYS = {
    "rate_hz": ("rate", 1.0),
    "sd_uT": ("sd", 1e-6),
    "hard_iron_uT": ("hard_iron", 1e-6),
    "soft_iron": ("soft_iron", 1.0),
    "scale": ("scale", 1.0),
    "saturation_uT": ("saturation", 1e-6),
    "field_uT": ("field", 1e-6),
    "disturbances": ("disturbances", 1.0),
}
DISTURBANCE_KEYS = ("start_s", "stop_s", "field_uT", "frame")
BAROMETER_KEYS = {
    "rate_hz": "rate",
    "sd_Pa": "sd",
    "bias_Pa": "bias",
    "drift_Pa": "drift",
    "drift_time_s": "drift_time",
    "zero_m": "zero",
    "lever_arm_m": "lever_arm",
    "quantity": "quantity",
}
ATTITUDE_KEYS = ("rate_hz", "sd_deg")
SENSOR_KEYS = {
    "kind": "kind",
    "sd": "sd",
    "rate_hz": "rate",
    "parameters": "parameters",
    "name": "name",
}
TARGET_KEYS = {
    "at_s": ("at", 1.0),
    "heading_deg": ("heading", DEG),
    "height_m": ("height", 1.0),
    "throttle": ("throttle", 1.0),
}
"""Keys of the sections of sensors; those of magnetometer and barometer with the field that each
sets, and the size of its unit; those of a target of JSBSim's autopilot likewise."""


def read(path: File) -> Scenario:
    """The Scenario of a TOML file. Raises DataError naming file and key."""
    table = read_toml(path, "check the path")
    try:
        return from_table(table, Path(path))
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def from_table(table: dict[str, Any], path: Path) -> Scenario:
    """The Scenario of a parsed scenario file; `path` gives a missing name and the folder of an
    IMU file. Raises DataError naming the key."""
    check_keys(table, TOP_KEYS)
    name = _text(table.get("name", path.stem), "name")
    duration = _number(table["duration_s"], "duration_s") if "duration_s" in table else None
    motion = _motion(_table(table, "motion"), duration)._replace(name=name)
    if duration is None and math.isinf(motion.end):
        raise DataError("duration_s is missing; this motion has no end of its own")
    values: dict[str, Any] = {"name": name, "motion": motion}
    for key, field, read in (
        ("rate_hz", "rate", _number),
        ("gate", "gate", _bound),
        ("gravity", "gravity", _text),
        ("about", "about", _text),
        ("accel_offset_m_s2", "accel_offset", _three),
        ("accel_offset_decays", "offset_decays", _flag),
        ("imu", "imu", _text),
    ):
        if key in table:
            values[field] = read(table[key], key)
    rate = values.get("rate", 100.0)
    if not rate > 0:
        raise DataError(f"rate_hz is {rate:g}; it must be larger than 0")
    values["duration"] = duration if duration is not None else math.floor(motion.end * rate) / rate
    if values.get("imu", "").endswith(".toml"):
        values["imu"] = str(path.parent / values["imu"])
    if "gnss" in table:
        values["gnss"] = _gnss(_table(table, "gnss"))
    if "date" in table:
        values["date"] = _date(table["date"])
    if "magnetometer" in table:
        values["magnetometer"] = _magnetometer(_table(table, "magnetometer"))
    if "barometer" in table:
        values["barometer"] = _barometer(_table(table, "barometer"))
    if "attitude" in table:
        values["attitude"] = _attitude(_table(table, "attitude"))
    values["sensors"] = tuple(
        _sensor(each, f"[[sensors]] {number}")
        for number, each in enumerate(_list(table.get("sensors", []), "sensors"), 1)
    )
    return Scenario(**values, **_start(_table(table, "start") if "start" in table else {}))


def _motion(table: dict[str, Any], duration: float | None) -> Motion:
    if table.get("kind") not in list(MOTION_KINDS):
        raise DataError(
            f"[motion] kind is {table.get('kind')!r}{did_you_mean(table.get('kind'), MOTION_KINDS)}; it "
            f"is one of {', '.join(MOTION_KINDS)}"
        )
    build = MOTION_KINDS[table["kind"]]
    parameters = {
        name: parameter
        for name, parameter in inspect.signature(build).parameters.items()
        if name != "name"
    }
    given: dict[str, Any] = {}
    if "duration" in parameters:
        if duration is None:
            raise DataError("duration_s is missing; this motion has no end of its own")
        given["duration"] = duration
        del parameters["duration"]
    keys = {_key(name): name for name in parameters}
    check_keys(table, ["kind", *keys], "[motion]")
    for key, name in keys.items():
        if key in table:
            given[name] = _value(name, table[key], f"[motion] {key}", table["kind"])
        elif parameters[name].default is inspect.Parameter.empty:
            raise DataError(f"[motion] {key} is missing")
    try:
        return build(**given)
    except DataError as error:
        raise DataError(f"[motion] {error}") from None


def _key(name: str) -> str:
    return f"{name}_{UNIT_OF_PARAMETER[name]}" if name in UNIT_OF_PARAMETER else name


def _value(name: str, value: Any, where: str, kind: str) -> Any:
    """A parameter of a motion of that kind in SI."""
    if name == "start":
        return _place(value, where)
    if name == "waypoints":
        return [
            _place(place, f"{where} {number}")
            for number, place in enumerate(_list(value, where), 1)
        ]
    if name == "legs":
        return [
            _leg(leg, f"{where} {number}", kind)
            for number, leg in enumerate(_list(value, where), 1)
        ]
    if name == "aircraft":
        return _text(value, where)
    if name == "targets":
        return [
            _target(target, f"{where} {number}")
            for number, target in enumerate(_list(value, where), 1)
        ]
    if name == "properties":
        return {
            key: _number(each, f"{where}, {key}") for key, each in _entries(value, where).items()
        }
    return _number(value, where) * (DEG if UNIT_OF_PARAMETER.get(name) == "deg" else 1.0)


def _leg(leg: Any, where: str, kind: str) -> dict[str, Any]:
    if not isinstance(leg, dict):
        raise DataError(f"{where} is {leg!r}; write a table of its keys")
    keys = {_key(name): name for name in motions.leg_keys(motions.CLIMB_KEYS[kind])}
    check_keys(leg, keys, where)
    return {
        name: leg[key] if name == "repeat" else _value(name, leg[key], f"{where}, {key}", kind)
        for key, name in keys.items()
        if key in leg
    }


def _target(value: Any, where: str) -> Target:
    check_keys(_entries(value, where), TARGET_KEYS, where)
    return Target(
        **{
            field: _number(value[key], f"{where}, {key}") * unit
            for key, (field, unit) in TARGET_KEYS.items()
            if key in value
        }
    )


def _entries(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise DataError(f"{where} is {value!r}; write a table of its keys")
    return value


def _place(value: Any, where: str) -> tuple[float, float, float]:
    keys = ("latitude_deg", "longitude_deg", "height_m")
    if not isinstance(value, dict):
        raise DataError(
            f"{where} is {value!r}; write {{ latitude_deg = ..., longitude_deg = ..., height_m = "
            f"... }}"
        )
    check_keys(value, keys, where)
    if missing := [key for key in keys if key not in value]:
        raise DataError(f"{where}: {missing[0]} is missing")
    lat, lon, height = (_number(value[key], f"{where}, {key}") for key in keys)
    if abs(lat) > 90 or abs(lon) > 360:
        raise DataError(
            f"{where}: {lat:g}, {lon:g} is no position; latitude is within 90 deg, longitude within "
            f"360"
        )
    return lat * DEG, lon * DEG, height


def _gnss(table: dict[str, Any]) -> Gnss:
    """The receiver: what [gnss] does not name, it does not measure."""
    check_keys(table, GNSS_KEYS, "[gnss]")
    values: dict[str, Any] = {"position_sd": None, "velocity_sd": None}
    for key, field, read in (
        ("interval_s", "interval", _number),
        ("position_sd_m", "position_sd", _three),
        ("velocity_sd_m_s", "velocity_sd", _three),
        ("lever_arm_m", "lever_arm", _three),
        ("latency_s", "latency", _number),
    ):
        if key in table:
            values[field] = read(table[key], f"[gnss] {key}")
    windows = _list(table.get("outages_s", []), "[gnss] outages_s")
    values["outages"] = tuple(
        tuple(_number(edge, "[gnss] outages_s") for edge in _list(window, "[gnss] outages_s"))
        for window in windows
    )
    return Gnss(**values)


def _magnetometer(table: dict[str, Any]) -> Magnetometer:
    check_keys(table, MAGNETOMETER_KEYS, "[magnetometer]")
    values: dict[str, Any] = {}
    for key, (field, unit) in MAGNETOMETER_KEYS.items():
        where = f"[magnetometer] {key}"
        if key not in table:
            continue
        if key in ("rate_hz", "saturation_uT"):
            values[field] = _number(table[key], where) * unit
        elif key == "soft_iron":
            values[field] = tuple(
                _exactly_three(row, f"{where}, row {number}")
                for number, row in enumerate(_list(table[key], where), 1)
            )
        elif key == "disturbances":
            values[field] = tuple(
                _disturbance(each, f"{where} {number}")
                for number, each in enumerate(_list(table[key], where), 1)
            )
        else:
            read = _exactly_three if key in ("hard_iron_uT", "field_uT") else _three
            values[field] = tuple(value * unit for value in read(table[key], where))
    return Magnetometer(**values)


def _disturbance(table: Any, where: str) -> Disturbance:
    if not isinstance(table, dict):
        raise DataError(f"{where} is {table!r}; write a table of its keys")
    check_keys(table, DISTURBANCE_KEYS, where)
    if missing := [key for key in DISTURBANCE_KEYS[:3] if key not in table]:
        raise DataError(f"{where}: {missing[0]} is missing")
    start, stop = (_number(table[key], f"{where}, {key}") for key in DISTURBANCE_KEYS[:2])
    field = tuple(value * 1e-6 for value in _exactly_three(table["field_uT"], f"{where}, field_uT"))
    return Disturbance(start, stop, field, _text(table.get("frame", "n"), f"{where}, frame"))


def _barometer(table: dict[str, Any]) -> Barometer:
    check_keys(table, BAROMETER_KEYS, "[barometer]")
    read: dict[str, Callable[[Any, str], Any]] = {
        **dict.fromkeys(BAROMETER_KEYS, _number),
        "lever_arm_m": _exactly_three,
        "quantity": _text,
    }
    return Barometer(
        **{
            field: read[key](table[key], f"[barometer] {key}")
            for key, field in BAROMETER_KEYS.items()
            if key in table
        }
    )


def _attitude(table: dict[str, Any]) -> Ahrs:
    check_keys(table, ATTITUDE_KEYS, "[attitude]")
    values: dict[str, Any] = {}
    if "rate_hz" in table:
        values["rate"] = _number(table["rate_hz"], "[attitude] rate_hz")
    if "sd_deg" in table:
        values["sd"] = tuple(value * DEG for value in _three(table["sd_deg"], "[attitude] sd_deg"))
    return Ahrs(**values)


def _sensor(table: Any, where: str) -> Simulated:
    check_keys(_entries(table, where), SENSOR_KEYS, where)
    if missing := [key for key in ("kind", "sd") if key not in table]:
        raise DataError(f"{where}: {missing[0]} is missing")
    for key in ("kind", "name"):
        _text(table.get(key, ""), f"{where}, {key}")
    return Simulated(**{field: table[key] for key, field in SENSOR_KEYS.items() if key in table})


def _date(value: Any) -> str:
    """A date of TOML, or its text, as ISO text."""
    return value.isoformat() if isinstance(value, datetime.date) else _text(value, "date")


def _start(table: dict[str, Any]) -> dict[str, Any]:
    check_keys(table, [*START_KEYS, "biases_known"], "[start]")
    sd = list(START_SD)
    for key, (first, unit) in START_KEYS.items():
        if key in table:
            sd[first : first + 3] = [value * unit for value in _three(table[key], f"[start] {key}")]
    known = table.get("biases_known", False)
    if not isinstance(known, bool):
        raise DataError(f"[start] biases_known is {known!r}; it is true or false")
    return {"start_sd": tuple(sd), "biases_known": known}


def _table(table: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(table.get(key), dict):
        raise DataError(
            f"section [{key}] is missing"
            if key not in table
            else f"{key} is {table[key]!r}; write a section [{key}]"
        )
    return table[key]


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise DataError(f"{where} is {value!r}; write a list in square brackets")
    return value


def _flag(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise DataError(f"{where}: {value!r} must be true or false")
    return value


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise DataError(f"{where} is {value!r}; it must be text in quotes")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise DataError(f"{where} is {value!r}; it must be a number")
    if not abs(value) < 1e300:  # an integer of TOML has no end
        raise DataError(f"{where} is {str(value)[:20]}; it must be a finite number")
    return float(value)


def _bound(value: Any, where: str) -> float:
    """A number that may be infinite."""
    return value if value == math.inf else _number(value, where)


def _exactly_three(value: Any, where: str) -> tuple[float, ...]:
    """Three numbers in a list."""
    return _three(_list(value, where), where)


def _three(value: Any, where: str) -> tuple[float, ...]:
    """Three numbers; a single one stands for three."""
    values = value if isinstance(value, list) else [value] * 3
    if len(values) != 3:
        raise DataError(f"{where} has {len(values)} numbers; it takes one or three")
    return tuple(_number(each, where) for each in values)
