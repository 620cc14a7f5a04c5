"""The configuration of `strapdown live`: a TOML file, or a table of the same keys."""

import os
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ... import aiding
from ...checks import (
    DataError,
    brief,
    check_choice,
    check_flag,
    check_keys,
    check_number,
    check_path,
    locate_errors,
    one_line_repr,
)
from ...core.loop.contract import MeasurementModel
from ...data.solution import Source
from ...fileio.files import read_toml
from ...io import read
from ...units.conversion import factor
from ...units.time_scales import gps_of
from .encoders import MESSAGES, OUTPUTS
from .line_formats import NO_CLOCK, check_columns
from .ports import Address, address_of
from .receiver_imu import IMU_MESSAGES, ImuMounting

SCALES = {
    "json": ("own", "unix", "gps", "arrival", NO_CLOCK),
    "csv": ("own", "unix", "gps", "arrival"),
    "ubx": ("gps", "arrival"),
    "nmea": ("gps", "arrival"),
    "mavlink": ("own", "arrival"),
}
"""Clocks of the formats of inputs from ports, the one that counts without any first."""
INPUTS = (*SCALES, "recording")
KEYS = "format port clock latency columns pps imu axes mounting"
"""Keys of inputs from ports."""


class InputPart(NamedTuple):
    """[[input]]"""

    format: str
    address: Address | None  # None of a recording
    clock: str  # of its times, one of SCALES
    recording: str
    speed: float  # of a recording, in its own seconds per second
    latency: float  # s until the fastest message arrives, where arrival counts
    columns: tuple[str, ...] = ()  # of CSV
    pps: str = ""  # path of the file with its pulses
    imu: str = ""  # the message of a receiver with the samples of its IMU
    mounting: ImuMounting | None = None  # of that


class OutputPart(NamedTuple):
    """[[output]]"""

    format: str
    address: Address
    rate: float  # Hz
    messages: tuple[str, ...] = ()  # of MAVLink


class Config(NamedTuple):
    """All that a program needs."""

    name: str  # as messages have it
    filter: str
    imu: Any
    vehicle: Any
    sources: tuple[Source, ...]
    inputs: tuple[InputPart, ...]
    outputs: tuple[OutputPart, ...]
    lag: float
    replay: bool
    align_within: float
    options: dict[str, Any]
    estimate: Any
    epoch: float | None  # s of GPS time since its zero
    log: str
    state: str
    save_every: float  # s


def config_of(given: str | Path | Mapping[str, Any] | Config) -> Config:
    """Return the Config of a file or a table, or itself. Raises DataError, which names file and key."""
    if isinstance(given, Config):
        return given
    if isinstance(given, Mapping):
        name, folder, table = "configuration", Path("."), dict(given)
    else:
        check_path(given, "config")
        name, folder = str(given), Path(_text(str(given), "config")).parent
        table = read_toml(Path(given), "check the path")
    keys = "filter imu vehicle lag replay align_within options estimate epoch log state save_every source input output"
    check_keys(table, keys.split(), name)
    inputs = tuple(
        _input(part, f"{name}: [[input]] {k}", folder) for k, part in _parts(table, "input", name)
    )
    if not inputs:
        raise DataError(f"{name}: has no [[input]]; add one with a port and a format")
    sources = tuple(
        _source(part, f"{name}: [[source]] {k}") for k, part in _parts(table, "source", name)
    )
    recorded = [part.recording for part in inputs if part.recording]
    imu, vehicle = table.get("imu"), table.get("vehicle")
    if recorded and not sources:
        recording = read(recorded[0])
        sources = tuple(a._where(np.zeros(len(a.t), bool)) for a in recording.sources)
        imu = imu if imu is not None else recording.meta.get("grade")
        vehicle = vehicle if vehicle is not None else recording.meta.get("vehicle")
    _check_names(sources, name)
    lag = check_number(table.get("lag", 1.0), f"{name}: lag", "s", least=0)
    found = Config(
        name,
        _text(table.get("filter", "closed-loop"), f"{name}: filter"),
        imu,
        vehicle,
        sources,
        inputs,
        tuple(
            _output(part, f"{name}: [[output]] {k}", folder)
            for k, part in _parts(table, "output", name)
        ),
        lag,
        check_flag(table.get("replay", lag > 0), f"{name}: replay"),
        check_number(
            table.get("align_within", 60.0), f"{name}: align_within", "s", least=0, infinite=True
        ),
        _options(table.get("options", {}), f"{name}: options"),
        table.get("estimate"),
        _epoch(table["epoch"], f"{name}: epoch") if "epoch" in table else None,
        _own_file(table.get("log", ""), f"{name}: log", folder),
        _own_file(table.get("state", ""), f"{name}: state", folder),
        check_number(table.get("save_every", 10.0), f"{name}: save_every", "s", above=0),
    )
    _check_files(found)
    return found


def _check_names(sources: Sequence[Source], name: str) -> None:
    """Refuse two sources of one name, which counts, events and lines could not tell apart. Raises
    DataError."""
    names = [a.name or a.kind for a in sources]
    for k, each in enumerate(names):
        if each in names[:k]:
            raise DataError(
                f"{name}: [[source]] {names.index(each) + 1} and {k + 1} are both named {each!r}; give each "
                "a `name` of its own"
            )


def _check_files(config: Config) -> None:
    """Refuse a file that is written twice, or read and written, or cannot be. Raises DataError."""
    reads = [part.recording or _file_of(part.address) for part in config.inputs]
    outputs = [_file_of(part.address) for part in config.outputs]
    writes = [each for each in (config.log, config.state, *outputs) if each]
    for path in writes:
        if writes.count(path) > 1 or path in reads:
            raise DataError(
                f"{config.name}: {path} is named twice among log, state, inputs and outputs; write to a "
                "file of its own"
            )
        _check_writable(path, config.name, path in outputs)


def _check_writable(path: str, name: str, is_appended_to: bool) -> None:
    """Refuse a file that is not there and cannot be made, or cannot be written. Raises DataError."""
    folder, file = Path(path).parent, Path(path)
    if not folder.is_dir():
        raise DataError(
            f"{name}: {path}: there is no folder {folder}; make it, or name another one"
        )
    # an output is appended to, and the others are made in the folder
    if not os.access(file if is_appended_to and file.exists() else folder, os.W_OK):
        raise DataError(f"{name}: {path} cannot be written there; name another folder")


def _file_of(address: Address | None) -> str:
    return address.place if address is not None and address.kind == "file" else ""


def _parts(table: Mapping[str, Any], key: str, name: str) -> list[tuple[int, dict[str, Any]]]:
    """[(number, table)] of the parts of a list."""
    parts = table.get(key, [])
    if not isinstance(parts, list) or not all(isinstance(part, Mapping) for part in parts):
        raise DataError(f"{name}: {key} must be given as [[{key}]]")
    return [(k, dict(part)) for k, part in enumerate(parts, 1)]


def _text(value: object, where: str) -> str:
    if not isinstance(value, str) or not value or "\0" in value:
        raise DataError(f"{where} is {one_line_repr(value)}; it must be text")
    return value


def _epoch(value: object, where: str) -> float:
    with locate_errors(where):
        return gps_of(_text(value, "it"))


def _options(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise DataError(
            f"{where} is {brief(value)}; it must be a table, [options] with their names"
        )
    return dict(value)


def _path(value: object, where: str, folder: Path) -> str:
    return str(folder / _text(value, where)) if value != "" else ""


def _own_file(value: object, where: str, folder: Path) -> str:
    """Return the path of a file that the program writes; a device or a folder is none."""
    path = _path(value, where, folder)
    if path and Path(path).exists() and not Path(path).is_file():
        raise DataError(f"{where}: {path} is no regular file; name a file")
    return path


def _in_folder(address: Address, folder: Path) -> Address:
    return (
        address._replace(place=str(folder / address.place)) if address.kind == "file" else address
    )


def _input(part: dict[str, Any], where: str, folder: Path) -> InputPart:
    format = check_choice(part.get("format", "json"), f"{where}: format", INPUTS)
    if format == "recording":
        check_keys(part, ("format", "path", "speed"), where)
        speed = check_number(part.get("speed", 1.0), f"{where}: speed", above=0, infinite=True)
        path = _path(_text(part.get("path"), f"{where}: path"), f"{where}: path", folder)
        return InputPart(format, None, "own", path, speed, 0.0)
    check_keys(part, KEYS.split(), where)
    clock = check_choice(part.get("clock", SCALES[format][0]), f"{where}: clock", SCALES[format])
    latency = check_number(part.get("latency", 0.0), f"{where}: latency", "s", least=0)
    if latency and clock not in ("arrival", NO_CLOCK):
        raise DataError(f'{where}: latency is that of the clock "arrival", not of {clock!r}')
    address = _in_folder(address_of(part.get("port"), where), folder)
    columns, pps = _columns(part, format, where), _pulses(part, format, clock, where, folder)
    imu, mounting = _receiver_imu(part, format, clock, where)
    return InputPart(format, address, clock, "", 1.0, latency, columns, pps, imu, mounting)


def _pulses(part: dict[str, Any], format: str, clock: str, where: str, folder: Path) -> str:
    """Return the path of the file with the pulses of a receiver; empty without any."""
    if "pps" not in part:
        return ""
    if format not in ("ubx", "nmea") or clock != "arrival":
        raise DataError(
            f'{where}: pps is that of a receiver, ubx or nmea with the clock "arrival", not of {format} '
            f"with {clock!r}"
        )
    return _path(_text(part["pps"], f"{where}: pps"), f"{where}: pps", folder)


def _receiver_imu(
    part: dict[str, Any], format: str, clock: str, where: str
) -> tuple[str, ImuMounting | None]:
    """Return the message with the samples of a receiver's IMU, and its mounting; empty without any."""
    if "imu" not in part:
        for key in ("axes", "mounting"):
            if key in part:
                raise DataError(f"{where}: {key} is that of the IMU of a receiver; give `imu` too")
        return "", None
    message = check_choice(part["imu"], f"{where}: imu", tuple(IMU_MESSAGES))
    if format != "ubx" or clock != "arrival":
        raise DataError(
            f'{where}: imu is that of a receiver with its own clock, ubx with clock = "arrival", not of '
            f"{format} with {clock!r}"
        )
    axes = _text(part.get("axes", "FLU"), f"{where}: axes")
    with locate_errors(where):
        return message, ImuMounting.of_axes(axes, _mounting(part.get("mounting")))


def _mounting(given: object) -> tuple[float, float, float] | None:
    """Return roll, pitch and heading of a mounting as [imu] of a recording has it, rad."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise DataError(f"mounting is {brief(given)}; it must be {{ roll, pitch, heading, unit }}")
    check_keys(given, ("roll", "pitch", "heading", "unit"), "mounting")
    unit = factor(given.get("unit"), "angle", "mounting")
    roll, pitch, heading = (
        unit * check_number(given.get(key, 0.0), f"mounting: {key}")
        for key in ("roll", "pitch", "heading")
    )
    return roll, pitch, heading


def _columns(part: dict[str, Any], format: str, where: str) -> tuple[str, ...]:
    """Return the names of the columns of CSV; none where its first line has them."""
    if "columns" not in part:
        return ()
    names = part["columns"]
    if format != "csv":
        raise DataError(f'{where}: columns are those of the format "csv", not of {format!r}')
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise DataError(f"{where}: columns is {brief(names)}; it must be a list of names")
    with locate_errors(where):
        check_columns(names)
    return tuple(names)


def _output(part: dict[str, Any], where: str, folder: Path) -> OutputPart:
    check_keys(part, ("format", "port", "rate", "messages"), where)
    format = check_choice(part.get("format", "json"), f"{where}: format", OUTPUTS)
    rate = check_number(part.get("rate", inf), f"{where}: rate", "Hz", above=0, infinite=True)
    address = _in_folder(address_of(part.get("port"), where), folder)
    return OutputPart(format, address, rate, _messages(part, format, where))


def _messages(part: dict[str, Any], format: str, where: str) -> tuple[str, ...]:
    """Return the messages of an output of MAVLink, ODOMETRY where none are named."""
    if "messages" in part and format != "mavlink":
        raise DataError(f'{where}: messages are those of the format "mavlink", not of {format!r}')
    names = part.get("messages", MESSAGES[:1])
    if not isinstance(names, list | tuple) or not names:
        raise DataError(f"{where}: messages is {brief(names)}; it must be a list of names")
    return tuple(check_choice(name, f"{where}: messages", MESSAGES) for name in names)


def _source(part: dict[str, Any], where: str) -> Source:
    check_keys(
        part, ("kind", "name", "parameters", "lever_arm", "gate", "robust", "adaptive"), where
    )
    with locate_errors(where):
        kind = aiding.find(_text(part.get("kind"), "kind"))
    width, gate = len(kind.quantities), part.get("gate")
    return Source(
        kind.name,
        np.empty(0),
        np.empty((0, width)),
        np.empty((0, width)),
        parameters=_parameters(part, kind, where),
        gate=None if gate is None else check_number(gate, f"{where}: gate", above=0, infinite=True),
        name=_text(part["name"], f"{where}: name") if "name" in part else "",
        robust=check_flag(part.get("robust", False), f"{where}: robust"),
        adaptive=check_number(part.get("adaptive", 0.0), f"{where}: adaptive", "s", least=0),
    )


def _parameters(part: dict[str, Any], kind: MeasurementModel, where: str) -> tuple[float, ...]:
    """Return the parameters of a source: none, a vector, or a vector and three more."""
    if "lever_arm" in part and "parameters" in part:
        raise DataError(f"{where}: has lever_arm and parameters, which begin with it; give one")
    key = "lever_arm" if "lever_arm" in part else "parameters"
    own, counts = part.get(key, ()), (0, 3, 6) if kind.more_parameters else (0, 3)
    if not isinstance(own, list | tuple) or len(own) not in counts:
        more = ", and three more" if kind.more_parameters else ""
        raise DataError(
            f"{where}: {key} is {brief(own)}; it must be a list of three numbers, as a lever arm in m "
            f"forward, right, down{more}"
        )
    return tuple(check_number(value, f"{where}: {key}") for value in own)
