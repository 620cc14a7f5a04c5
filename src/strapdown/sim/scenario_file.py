"""Scenario files (TOML): every number's key names its unit, every unknown key is refused.
docs/how-to/simulate.md lists the keys."""

import datetime
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..checks import DataError, check_choice, locate_errors
from ..fileio.files import read_toml
from ..fileio.toml_keys import (
    Key,
    Read,
    bound,
    entries,
    exactly_three,
    flag,
    in_unit,
    list_of,
    number,
    read_table,
    section,
    table_reader,
    text,
    three,
    within,
)
from ..sensor_models.ahrs import Ahrs
from ..sensor_models.any_sensor import Simulated
from ..sensor_models.barometer import Barometer
from ..sensor_models.gnss import Spell
from ..sensor_models.magnetometer import Disturbance, Magnetometer
from ..sensor_models.receiver import GNSS_KEYS, NOTHING, receiver
from ..typing import File
from . import motions
from .jsbsim import JsbsimTarget, jsbsim_motion
from .scenario_model import START_STD, Scenario
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
    "multicopter": motions.multicopter,
    "moored": motions.moored_vessel,
    "jsbsim": jsbsim_motion,
}
"""Kinds of a [motion], and the function that makes it; the function's parameters are its
keys."""
UNIT_OF_PARAMETER = {
    "azimuth": "deg",
    "course": "deg",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
    "amplitude": "deg",
    "yaw": "deg",
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

NO_END = "duration_s is missing; this motion has no end of its own"
MICRO = 1e-6
degrees = in_unit(DEG)


def _date(value: Any, where: str) -> str:
    """A date of TOML, or its text, as ISO text."""
    return value.isoformat() if isinstance(value, datetime.date) else text(value, where)


def _raw(value: Any, where: str) -> Any:
    """A value that its field judges."""
    return value


START_KEYS = {
    "position_std_m": Key("position", three),
    "velocity_std_m_s": Key("velocity", three),
    "attitude_std_deg": Key("attitude", in_unit(DEG, three)),
    "accel_bias_std_m_s2": Key("accel_bias", three),
    "gyro_bias_std_deg_h": Key("gyro_bias", in_unit(DEG / 3600, three)),
    "biases_known": Key("biases_known", flag),
}
"""Standard deviations of a start in the order of the error states, and what is no such."""


def _start(value: Any, where: str) -> dict[str, Any]:
    """Return the fields of a scenario for the start of its filter."""
    given, std = read_table(value, START_KEYS, where), list(START_STD)
    for row, (field, _, _) in enumerate(list(START_KEYS.values())[:-1]):
        std[3 * row : 3 * row + 3] = given.get(field, std[3 * row : 3 * row + 3])
    return {"start_std": tuple(std), "biases_known": given.get("biases_known", False)}


DISTURBANCE_KEYS = {
    "start_s": Key("start", number, ""),
    "stop_s": Key("stop", number, ""),
    "field_uT": Key("field", in_unit(MICRO, exactly_three), ""),
    "frame": Key("frame", text),
}
SPELL_KEYS = {
    "start_s": Key("start", number, ""),
    "stop_s": Key("stop", number, ""),
    "class": Key("name", text),
    "receiver": Key("receiver", text),
    "position_std_m": Key("position_std", three),
    "position_correlated": GNSS_KEYS["position_correlated"],
    "off_m": Key("off", exactly_three),
}
RECEIVER_KEYS = GNSS_KEYS | {
    "receiver": Key("receiver", text),
    "class": Key("usual", text),
    "spells": Key("spells", list_of(table_reader(dict, SPELL_KEYS))),
}
"""Keys of a receiver in a scenario, and of its spells in other classes."""
MEASURED = "position_std", "velocity_std"
"""Fields of a receiver, of which it needs at least one."""
MAGNETOMETER_KEYS = {
    "rate_hz": Key("rate", number),
    "std_uT": Key("std", in_unit(MICRO, three)),
    "hard_iron_uT": Key("hard_iron", in_unit(MICRO, exactly_three)),
    "soft_iron": Key("soft_iron", list_of(exactly_three)),
    "scale": Key("scale", three),
    "saturation_uT": Key("saturation", in_unit(MICRO)),
    "field_uT": Key("field", in_unit(MICRO, exactly_three)),
    "disturbances": Key(
        "disturbances",
        list_of(table_reader(Disturbance, DISTURBANCE_KEYS)),
    ),
}
BAROMETER_KEYS = {
    "rate_hz": Key("rate", number),
    "std_Pa": Key("std", number),
    "bias_Pa": Key("bias", number),
    "drift_Pa": Key("drift", number),
    "drift_time_s": Key("drift_time", number),
    "zero_m": Key("zero", number),
    "lever_arm_m": Key("lever_arm", exactly_three),
    "quantity": Key("quantity", text),
}
ATTITUDE_KEYS = {"rate_hz": Key("rate", number), "std_deg": Key("std", in_unit(DEG, three))}
SENSOR_KEYS = {
    "kind": Key("kind", text, ""),
    "std": Key("std", _raw, ""),
    "rate_hz": Key("rate", number),
    "parameters": Key("parameters", list_of(number)),
    "states": Key("states", list_of(number)),
    "name": Key("name", text),
}
TARGET_KEYS = {
    "at_s": Key("at", number),
    "heading_deg": Key("heading", degrees),
    "height_m": Key("height", number),
    "throttle": Key("throttle", number),
}
PLACE_KEYS = {
    "latitude_deg": Key("latitude", number, ""),
    "longitude_deg": Key("longitude", number, ""),
    "height_m": Key("height", number, ""),
}
TOP_KEYS = {
    "name": Key("name", text),
    "about": Key("about", text),
    "duration_s": Key("duration", number),
    "rate_hz": Key("rate", number),
    "imu": Key("imu", text),
    "accel_offset_m_s2": Key("accel_offset", three),
    "accel_offset_decays": Key("offset_decays", flag),
    "gate": Key("gate", bound),
    "gravity": Key("gravity", text),
    "date": Key("date", _date),
    "motion": Key("motion", section(entries), "write a section [motion] with its kind"),
    "gnss": Key("gnss", section(table_reader(dict, RECEIVER_KEYS))),
    "magnetometer": Key("magnetometer", section(table_reader(Magnetometer, MAGNETOMETER_KEYS))),
    "barometer": Key("barometer", section(table_reader(Barometer, BAROMETER_KEYS))),
    "attitude": Key("attitude", section(table_reader(Ahrs, ATTITUDE_KEYS))),
    "sensors": Key("sensors", list_of(table_reader(Simulated, SENSOR_KEYS))),
    "start": Key("start", section(_start)),
}
"""Keys of a scenario and of its tables, each with its field and its reader."""
GO_WITH = (
    ("", "accel_offset_decays", ("accel_offset_m_s2",)),
    ("gnss", "class", ("spells",)),
    ("gnss", "stated", ("position_correlated", "velocity_correlated", "receiver")),
    ("barometer", "drift_time_s", ("drift_Pa",)),
)
"""(section, key, keys of which one must be present for it to have an effect)."""


def read(path: File) -> Scenario:
    """The Scenario of a TOML file. Raises DataError naming file and key."""
    table = read_toml(path, "check the path")
    with locate_errors(path):
        return from_table(table, Path(path))


def from_table(table: dict[str, Any], path: Path) -> Scenario:
    """The Scenario of a parsed scenario file; `path` gives a missing name and the folder of an
    IMU's or receiver's file. Raises DataError naming the key."""
    values = {"name": path.stem} | read_table(table, TOP_KEYS)
    _together(table)
    motion = _motion(values["motion"], values.get("duration"))
    values["motion"] = motion = motion._replace(name=values["name"])
    if not (rate := values.get("rate", 100.0)) > 0:
        raise DataError(f"rate_hz is {rate:g}; it must be larger than 0")
    if "duration" not in values:
        if math.isinf(motion.end):
            raise DataError(NO_END)
        values["duration"] = math.floor(motion.end * rate) / rate
    if "imu" in values:
        values["imu"] = _beside(path, values["imu"])
    if "gnss" in values:
        named = values["gnss"].pop("receiver", None)
        # the receiver measures only the quantities in [gnss]
        carried = NOTHING if named is None else receiver(_beside(path, named))
        if named is None and values["gnss"] and not {*MEASURED} & values["gnss"].keys():
            raise DataError(
                "[gnss] measures nothing: give position_std_m, velocity_std_m_s or receiver, or leave "
                "the section empty where there is no receiver"
            )
        spells = values["gnss"].pop("spells", ())
        values["gnss"] = carried._replace(
            **values["gnss"], spells=tuple(_spell(each, path) for each in spells)
        )
    return Scenario(**values | values.pop("start", {}))


def _spell(values: dict[str, Any], path: Path) -> Spell:
    """A time in another class, whose receiver may be named. Raises DataError."""
    named = values.pop("receiver", None)
    if named is not None:
        carried = receiver(_beside(path, named))
        values = {
            "position_std": carried.position_std,
            "position_correlated": carried.position_correlated,
        } | values
    return Spell(**values)


def _together(table: dict[str, Any]) -> None:
    """Refuse a key without effect because another one is missing. Raises DataError."""
    for name, key, others in GO_WITH:
        part = table.get(name, {}) if name else table
        if key in part and not any(other in part for other in others):
            where = within(f"[{name}]" if name else "", key)
            raise DataError(f"{where} has no effect without {' or '.join(others)}; leave it out")


def _beside(path: Path, name: str) -> str:
    """Return a name, or the path of a file relative to the scenario's."""
    return str(path.parent / name) if name.endswith(".toml") else name


def _motion(table: dict[str, Any], duration: float | None) -> Motion:
    build = MOTION_KINDS[check_choice(table.get("kind"), "[motion] kind", MOTION_KINDS)]
    parameters = dict(inspect.signature(build).parameters)
    parameters.pop("name", None)
    given: dict[str, Any] = {}
    if parameters.pop("duration", None):
        if duration is None:
            raise DataError(NO_END)
        given["duration"] = duration
    keys = {
        _key(name): Key(
            name,
            _parameter(name, table["kind"]),
            "" if parameter.default is inspect.Parameter.empty else None,
        )
        for name, parameter in parameters.items()
    }
    given |= read_table(table, {"kind": Key("kind", text)} | keys, "[motion]")
    del given["kind"]
    try:
        return build(**given)
    except DataError as error:
        raise DataError(f"[motion] {error}") from None


def _key(name: str) -> str:
    return f"{name}_{UNIT_OF_PARAMETER[name]}" if name in UNIT_OF_PARAMETER else name


def _parameter(name: str, kind: str) -> Read:
    """The function that reads a parameter of a motion of that kind."""
    if name == "legs":
        return _legs(kind)
    return READ_OF_PARAMETER.get(name) or (
        degrees if UNIT_OF_PARAMETER.get(name) == "deg" else number
    )


def _legs(kind: str) -> Read:
    """The function that reads the legs of a motion of that kind; those within a repeated leg
    likewise."""

    def leg(value: Any, where: str) -> dict[str, Any]:
        names = motions.leg_keys(motions.CLIMB_KEYS[kind])
        keys = {_key(name): Key(name, _parameter(name, kind)) for name in names}
        return read_table(value, keys | {"repeat": Key("repeat", _raw)}, where)

    return list_of(leg)


def _place(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, dict):
        raise DataError(
            f"{where} is {value!r}; write {{ latitude_deg = ..., longitude_deg = ..., height_m = "
            f"... }}"
        )
    lat, lon, height = read_table(value, PLACE_KEYS, where).values()
    if abs(lat) > 90 or abs(lon) > 360:
        raise DataError(
            f"{where}: {lat:g}, {lon:g} is not a position; latitude is within 90 deg, longitude within "
            f"360"
        )
    return lat * DEG, lon * DEG, height


def _properties(value: Any, where: str) -> dict[str, float]:
    """Numbers by names that are not ours."""
    return {key: number(each, within(where, key)) for key, each in entries(value, where).items()}


READ_OF_PARAMETER: dict[str, Read] = {
    "start": _place,
    "waypoints": list_of(_place),
    "aircraft": text,
    "targets": list_of(table_reader(JsbsimTarget, TARGET_KEYS)),
    "properties": _properties,
}
"""Functions that read the non-numeric parameters of motions."""
