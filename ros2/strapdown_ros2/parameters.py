"""The parameters of the node, with the names and units of `recording.toml` where it has the same thing."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from strapdown import aiding
from strapdown.checks import (
    DataError,
    check_array,
    check_choice,
    check_flag,
    check_keys,
    check_number,
    check_type,
)
from strapdown.io.decoding.robots.ros_transforms import plain
from strapdown.preprocessing.axes import BODY_AXES, axes_matrix, rotation_matrix
from strapdown.units.conversion import factor

from .mounts import Mount

OF_ROS = ("use_sim_time", "qos_overrides", "start_type_description_service")
"""Parameters that every node has."""
TOP = (
    *("imu", "sources", "filter", "vehicle", "options", "estimate"),
    *("lag", "replay", "align_within", "history", "place", "heading"),
    *(
        "base_frame",
        "world_frame",
        "odom_frame",
        "origin",
        "rate",
        "publish_tf",
        "tf_within",
        "verdict_every",
    ),
)
OF_IMU = ("topic", "grade", "stamp", "frame", "axes", "mounting", "lever_arm")
OF_SOURCE = (
    *("topic", "kind", "message", "stamp", "frame", "axes", "lever_arm"),
    *("std", "field", "gate", "robust", "adaptive"),
)
TWISTS = ("TwistStamped", "TwistWithCovarianceStamped")
MESSAGES: Mapping[str, tuple[str, ...]] = {
    "position": ("NavSatFix",),
    "velocity": TWISTS,
    "speed": ("Odometry", *TWISTS),
    "body-velocity": (*TWISTS, "Odometry"),
    "magnetic-field": ("MagneticField",),
    "pressure": ("FluidPressure",),
}
"""{kind of source: messages that it can come from, the usual one first}."""
WITHOUT_COVARIANCE = {
    "pressure": "m of height; the variance of a message covers the sensor, not the weather",
    "magnetic-field": "T; drivers do not know the error of the calibration",
}
"""Kinds whose `std` must be given, and its unit."""
STAMPS = ("header", "arrival")


class ImuInput(NamedTuple):
    """imu.*"""

    topic: str
    grade: str
    stamp: str
    frame: str  # of tf; empty: that of the messages
    mount: Mount | None  # None: by tf


class SourceInput(NamedTuple):
    """NAME.*"""

    name: str
    topic: str
    kind: str
    message: str
    stamp: str
    frame: str
    mount: Mount | None
    std: tuple[float, ...] | None  # None: by the covariances of the messages
    field: tuple[float, ...] | None  # T, north, east, down
    gate: float | None
    robust: bool
    adaptive: float


class NodeConfig(NamedTuple):
    """All that a node needs."""

    imu: ImuInput
    sources: tuple[SourceInput, ...]
    filter: str
    vehicle: str | None
    options: dict[str, Any]
    estimate: list[str] | None
    lag: float
    replay: bool
    align_within: float
    history: int
    place: tuple[float, float, float] | None  # rad, rad, m
    heading: float | None  # rad
    base_frame: str
    world_frame: str
    odom_frame: str  # empty: tf leads from the world to the base frame
    origin: tuple[float, float, float] | None  # rad, rad, m
    rate: float
    publish_tf: bool
    tf_within: float
    verdict_every: float


def tables_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters with dots in their names as tables.

    Raises
    ------
    DataError
        If a name is a value and a table.

    Examples
    --------
    >>> tables_of({"lag": 0.5, "imu.topic": "/imu"})
    {'lag': 0.5, 'imu': {'topic': '/imu'}}
    """
    found: dict[str, Any] = {}
    for name, value in given.items():
        *parents, last = name.split(".")
        table = found
        for parent in parents:
            table = table.setdefault(parent, {})
            check_type(table, name.rpartition(".")[0], dict, f"a table, since it has {last!r}")
        if last in table:
            raise DataError(f"{name} is {value!r}; it must be a table, since it has parameters")
        table[last] = value
    return found


def config_of(given: Mapping[str, Any]) -> NodeConfig:
    """Return the NodeConfig of parameters by name, such as {"imu.topic": "/imu/data"}.

    Parameters
    ----------
    given : mapping
        Parameters as the node gets them: numbers, texts, flags and lists of these.

    Raises
    ------
    DataError
        If a parameter is unknown, missing or out of range.
    """
    table = tables_of(given)
    names = _names(table)
    check_keys(table, (*TOP, *names, *OF_ROS))
    lag = check_number(table.get("lag", 1.0), "lag", "s", least=0)
    heading = table.get("heading")
    return NodeConfig(
        _imu(_table(table, "imu")),
        tuple(_source(name, _table(table, name)) for name in names),
        _text(table.get("filter", "closed-loop"), "filter"),
        _text(table["vehicle"], "vehicle") if "vehicle" in table else None,
        _table(table, "options"),
        _texts(table["estimate"], "estimate") if "estimate" in table else None,
        lag,
        check_flag(table.get("replay", lag > 0), "replay"),
        _number(table, "align_within", 60.0, "s", least=0, infinite=True),
        int(_number(table, "history", 65536, "samples", least=100, whole=True)),
        _place(table, "place"),
        None if heading is None else float(np.radians(check_number(heading, "heading", "deg"))),
        plain(_text(table.get("base_frame", "base_link"), "base_frame")),
        plain(_text(table.get("world_frame", "map"), "world_frame")),
        plain(_text(table["odom_frame"], "odom_frame")) if "odom_frame" in table else "",
        _place(table, "origin"),
        _number(table, "rate", 20.0, "Hz", above=0, infinite=True),
        check_flag(table.get("publish_tf", True), "publish_tf"),
        _number(table, "tf_within", 10.0, "s", least=0, infinite=True),
        _number(table, "verdict_every", 0.0, "s", least=0),
    )


def _names(table: Mapping[str, Any]) -> list[str]:
    names = _texts(table.get("sources", []), "sources")
    for name in names:
        if name in (*TOP, *OF_ROS) or names.count(name) > 1:
            raise DataError(f"sources: {name!r} is taken; give the source another name")
        if name not in table:
            raise DataError(f"sources: {name!r} has no parameters; give {name}.topic and .kind")
    return names


def _table(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = table.get(key, {})
    check_type(found, key, dict, f"a table: give {key}.NAME")
    return dict(found)


def _number(table: Mapping[str, Any], key: str, default: float, unit: str, **bounds: Any) -> float:
    return check_number(table.get(key, default), key, unit, **bounds)


def _text(value: object, where: str) -> str:
    if not isinstance(value, str) or not value:
        raise DataError(f"{where} is {value!r}; it must be text")
    return value


def _texts(value: Any, where: str) -> list[str]:
    check_type(value, where, (list, tuple), "a list of texts")
    return [_text(each, where) for each in value]


def _needed_text(part: Mapping[str, Any], key: str, where: str) -> str:
    if key not in part:
        raise DataError(f"{where}.{key} is missing; give it")
    return _text(part[key], f"{where}.{key}")


def _place(table: Mapping[str, Any], key: str) -> tuple[float, float, float] | None:
    if key not in table:
        return None
    part = _table(table, key)
    check_keys(part, ("latitude", "longitude", "height", "unit"), key)
    size = factor(part.get("unit", "deg"), "angle")
    found = []
    for name, most in (("latitude", 89.0), ("longitude", 360.0)):
        limit = float(np.radians(most)) / size
        found.append(size * check_number(part.get(name), f"{key}.{name}", least=-limit, most=limit))
    height = check_number(part.get("height", 0.0), f"{key}.height", "m", least=-12e3, most=500e3)
    return found[0], found[1], float(height)


def _three(part: Mapping[str, Any], key: str, where: str, what: str) -> np.ndarray[Any, Any]:
    return check_array(part.get(key, (0.0, 0.0, 0.0)), f"{where}.{key}", (3,), what=what)


def _axes(part: Mapping[str, Any], where: str) -> np.ndarray[Any, Any]:
    try:
        return axes_matrix(_text(part.get("axes", "FLU"), f"{where}.axes"), BODY_AXES)
    except DataError as error:
        raise DataError(f"{where}.axes: {error}") from None


def _mount(part: Mapping[str, Any], where: str) -> Mount | None:
    """Return the Mount that parameters give; None where none of them does."""
    if not {"axes", "mounting", "lever_arm"} & {*part}:
        return None
    matrix = _axes(part, where)
    if "mounting" in part:
        own = _table(part, "mounting")
        check_keys(own, ("roll", "pitch", "heading", "unit"), f"{where}.mounting")
        size = factor(own.get("unit", "deg"), "angle")
        angles = [
            size * check_number(own.get(name, 0.0), f"{where}.mounting.{name}")
            for name in ("roll", "pitch", "heading")
        ]
        matrix = rotation_matrix(*angles) @ matrix
    return Mount(matrix, _three(part, "lever_arm", where, "numbers, m forward, right, down"))


def _imu(part: Mapping[str, Any]) -> ImuInput:
    check_keys(part, OF_IMU, "imu")
    return ImuInput(
        _needed_text(part, "topic", "imu"),
        _needed_text(part, "grade", "imu"),
        check_choice(part.get("stamp", "header"), "imu.stamp", STAMPS),
        plain(str(part.get("frame", ""))),
        _mount(part, "imu"),
    )


def _source(name: str, part: Mapping[str, Any]) -> SourceInput:
    check_keys(part, OF_SOURCE, name)
    kind = check_choice(part.get("kind", ""), f"{name}.kind", MESSAGES)
    usual = MESSAGES[kind]
    gate = part.get("gate")
    adaptive = check_number(part.get("adaptive", 0.0), f"{name}.adaptive", "s", least=0)
    return SourceInput(
        name,
        _needed_text(part, "topic", name),
        kind,
        check_choice(part.get("message", usual[0]), f"{name}.message", usual),
        check_choice(part.get("stamp", "header"), f"{name}.stamp", STAMPS),
        plain(str(part.get("frame", ""))),
        Mount.none() if kind == "pressure" else _mount(part, name),
        _std(part, name, kind),
        _field(part, name, kind),
        None if gate is None else check_number(gate, f"{name}.gate", above=0, infinite=True),
        check_flag(part.get("robust", False), f"{name}.robust"),
        float(adaptive),
    )


def _std(part: Mapping[str, Any], name: str, kind: str) -> tuple[float, ...] | None:
    """Return the standard deviations of the components, one number standing for all."""
    width = len(aiding.find(kind).quantities)
    if "std" not in part:
        if kind in WITHOUT_COVARIANCE:
            raise DataError(f"{name}.std is missing; give it in {WITHOUT_COVARIANCE[kind]}")
        return None
    value = part["std"]
    values = check_array(np.atleast_1d(value), f"{name}.std", (None,), above=0)
    if len(values) not in (1, width):
        raise DataError(f"{name}.std has {len(values)} numbers; give one, or {width}")
    return tuple(np.broadcast_to(values, width).tolist())


def _field(part: Mapping[str, Any], name: str, kind: str) -> tuple[float, ...] | None:
    if "field" not in part:
        return None
    if kind != "magnetic-field":
        raise DataError(f"{name}.field is of the kind magnetic-field, not of {kind}; remove it")
    return tuple(_three(part, "field", name, "numbers, T north, east, down").tolist())
