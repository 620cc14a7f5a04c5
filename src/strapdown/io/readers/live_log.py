"""Logs of `strapdown live`: JSON lines with the samples and measurements that its filter used, in the order of
use, after a line with its sources and its start. `fuse` goes on from that start, so that it
reproduces the run bit for bit. A last line that was cut short is left out."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import aiding
from ...checks import DataError
from ...core.loop.contract import Imu, InitialState
from ...data.recording import Recording
from ...data.solution import Correlated, Source
from ...fileio.file_access import json_of, open_file
from ...typing import File
from ..reader import Reader

BEGIN = b'{"strapdown": "live log"'
FORMAT = 1
OF_FIXES = ("t", "y", "std")


def head_line(
    filter: str,
    sources: Sequence[Source],
    start: InitialState,
    imu: object,
    vehicle: object,
    estimate: Mapping[str, Any],
) -> str:
    """Return the first line: the set-up of the filter and its start."""
    head = {
        "strapdown": "live log",
        "format": FORMAT,
        "filter": filter,
        "imu": imu,
        "vehicle": vehicle,
        "estimate": estimate,
        "start": start._asdict(),
        "sources": [
            {each.name: getattr(a, each.name) for each in fields(a) if each.name not in OF_FIXES}
            for a in sources
        ],
    }
    return json.dumps(head, default=_plain) + "\n"


def _plain(value: Any) -> Any:
    """Return an IMU, a vehicle or a path as JSON has it."""
    if isinstance(value, Path):
        return str(value)
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else dict(value)


def sample_line(t: float, dt: float, dtheta: Sequence[float], dv: Sequence[float]) -> str:
    """Return the line of a sample: s, rad, m/s."""
    return f"[{t!r},{dt!r},{[*map(float, dtheta)]!r},{[*map(float, dv)]!r}]\n"


def fix_line(source: int, t: float, y: Sequence[float], std: Sequence[float]) -> str:
    """Return the line of a measurement of a source, by its place in the first line; SI."""
    values = [[value if value == value else None for value in each] for each in (y, std)]
    return json.dumps([source, t, *values]) + "\n"


def read(path: Path) -> Recording:
    """Return the Recording of a log. Raises DataError."""
    with open_file(path) as file:
        head = json_of(file.readline(), path)
        _check_head(head, path)
        samples: list[list[Any]] = []
        fixes: list[list[Any]] = []
        for number, line in enumerate(file, 2):
            if not line.endswith(b"\n"):  # cut short
                break
            try:
                row = json_of(line, path)
                kind = samples if isinstance(row[2], list) and isinstance(row[0], float) else fixes
                kind.append(_numbers(row))
            except (ValueError, TypeError, IndexError, KeyError):  # DataError is a ValueError
                raise DataError(f"{path}: line {number} is neither a sample nor a fix") from None
    try:
        return _recording(path, head, samples, fixes)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        raise DataError(f"{path}: does not hold what a live log holds ({error})") from error


def _check_head(head: Any, path: Path) -> None:
    if not isinstance(head, dict) or head.get("strapdown") != "live log":
        raise DataError(f"{path}: is no log of strapdown live")
    if head.get("format") != FORMAT:
        raise DataError(
            f"{path}: is a live log of format {head.get('format')!r}, this version reads {FORMAT}"
        )


def _numbers(row: Sequence[Any]) -> list[Any]:
    """Return a row with NaN for what was not measured. Raises ValueError for another form."""
    if len(row) != 4 or not isinstance(row[3], list):
        raise ValueError("another form")
    parts = [[np.nan if value is None else float(value) for value in row[k]] for k in (2, 3)]
    return [*row[:2], *parts]


def _recording(
    path: Path, head: Mapping[str, Any], samples: list[list[Any]], fixes: list[list[Any]]
) -> Recording:
    if not samples:
        raise DataError(f"{path}: holds no sample")
    t, dt, dtheta, dv = (np.array(column, float) for column in zip(*samples))
    if not (dtheta.shape == dv.shape == (len(t), 3) and (np.diff(t) > 0).all() and (dt > 0).all()):
        raise ValueError("samples have three numbers each and are in the order of time")
    if not all(np.isfinite(column).all() for column in (t, dt, dtheta, dv)):
        raise ValueError("a sample is not finite")
    sources = tuple(
        _source(table, [fix for fix in fixes if fix[0] == s])
        for s, table in enumerate(head["sources"])
    )
    meta: dict[str, Any] = {"name": path.name.partition(".")[0], "start": head["start"]}
    meta |= {
        key: head[name] for key, name in (("grade", "imu"), ("vehicle", "vehicle")) if head[name]
    }
    if head["estimate"]:
        meta["estimate"] = {
            key: tuple(map(float, prior)) for key, prior in head["estimate"].items()
        }
    InitialState(**head["start"])
    return Recording(Imu(t, dt, dtheta, dv), sources, meta=meta)  # type: ignore[arg-type]  # built by key


def _source(table: Mapping[str, Any], fixes: list[list[Any]]) -> Source:
    width = len(aiding.find(table["kind"]).quantities)
    y, std = (np.array([fix[k][:width] for fix in fixes], float) for k in (2, 3))
    more = dict(table)
    correlated = more.get("correlated")
    more["correlated"] = correlated and Correlated(tuple(correlated[0]), *correlated[1:])
    more["parameters"] = tuple(map(float, more["parameters"]))
    more["estimate"] = {name: tuple(prior) for name, prior in more["estimate"].items()}
    t, y, std = (
        np.array([fix[1] for fix in fixes], float),
        y.reshape(-1, width),
        std.reshape(-1, width),
    )
    known = np.isfinite(y)
    if not ((known | np.isnan(y)).all() and np.isfinite(t).all() and (np.diff(t) >= 0).all()):
        raise ValueError("fixes of a source are finite and in the order of time")
    if not (np.isfinite(std[known]).all() and (std[known] > 0).all()):
        raise ValueError("a standard deviation is not above 0")
    return Source(t=t, y=y, std=std, **more)


def sniff(path: File) -> bool:
    """Return True where the file begins as such a log."""
    with open_file(path) as file:
        return file.read(len(BEGIN)) == BEGIN


READER = Reader(
    "live log", (".jsonl",), "log of strapdown live", read=read, sniff=sniff, begins=(BEGIN,)
)
