"""Recordings and solutions as tables of pandas and arrays of xarray: names and units of the CF
conventions, as the NetCDF files have them."""

from __future__ import annotations

import re
from functools import singledispatch
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ...aiding import find
from ...checks import check_choice
from ...data.recording import Recording
from ...data.solution import (
    ATTITUDE_COLUMNS,
    NAV_COLUMNS,
    Solution,
    SolutionMeta,
    Source,
    Trajectory,
)
from ...evaluation.metrics import EULER, NED_AXES
from ...extras import optional_import
from ...io.solutions.solution_netcdf import (
    CF_UNITS,
    CONVENTIONS,
    LONG_NAMES,
    STANDARD_NAMES,
    Variables,
    arrays_of,
    attributes,
)
from ...typing import Array
from ...units.quantities import shown_unit, shown_value_unit
from ...units.time_scales import utc

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

IMU_COLUMNS = tuple(f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz")
"""As `Recording.from_frames` takes them."""
IMU = "imu"
"""Name of the IMU among the parts of a recording."""
NAMES = {
    "position": NAV_COLUMNS[:3],
    "velocity": NAV_COLUMNS[3:6],
    "attitude": ATTITUDE_COLUMNS,
    "altitude": NAV_COLUMNS[2:3],
    "heading": ATTITUDE_COLUMNS[2:],
}
"""{kind of measurement: columns of its values}; others are named after the kind."""


@singledispatch
def frame_of(value: object) -> pd.DataFrame:
    """A value as a table with names and units as attrs."""
    raise TypeError(f"no table of a {type(value).__name__}")


@singledispatch
def dataset_of(value: object) -> xr.Dataset:
    """A value as a Dataset. Raises DataError where xarray is missing."""
    raise TypeError(f"no Dataset of a {type(value).__name__}")


@frame_of.register(Solution)
def solution_frame(solution: Solution) -> pd.DataFrame:
    """The table of a Solution with dates where the clock is absolute, units and names as attrs."""
    table = solution.table()
    named = {column: attributes(column) for column in table.columns if column in LONG_NAMES}
    return _date_index(table, solution.meta.get("epoch"), named, solution.meta)


@frame_of.register(Trajectory)
def trajectory_frame(made: Trajectory, epoch: str | None = None) -> pd.DataFrame:
    """The same of a Trajectory, whose own times say nothing of dates."""
    table = made.table()
    return _date_index(table, epoch, {column: attributes(column) for column in table.columns}, {})


@frame_of.register(Recording)
def recording_frame(recording: Recording, part: str = IMU) -> pd.DataFrame:
    """The samples of the IMU of a Recording, its reference, or the fixes of a source. Raises
    DataError with the nearest name."""
    import pandas as pd

    epoch, sources = recording.meta.get("epoch"), _sources(recording)
    parts = [IMU, *(["reference"] if recording.reference is not None else []), *sources]
    check_choice(part, "part", parts)
    if part == "reference" and recording.reference is not None:
        return trajectory_frame(recording.reference, epoch)
    if part == IMU:
        t, variables = recording.imu.t, _imu(recording)
    else:
        t, variables = sources[part].t, _source(sources[part])
    columns = {name: values for name, (_, values, _) in variables.items()}
    table = pd.DataFrame(columns, index=pd.Index(t, name="t"))
    return _date_index(table, epoch, {name: said for name, (_, _, said) in variables.items()}, {})


def _titles(meta: SolutionMeta) -> dict[str, str | None]:
    """Names of the recording and the filter, as far as they are known."""
    return {"recording": meta.get("recording"), "filter": meta.get("filter")}


def _date_index(
    table: pd.DataFrame,
    epoch: str | None,
    named: dict[str, dict[str, str]],
    meta: SolutionMeta,
) -> pd.DataFrame:
    """A table with dates as its index and seconds as a column, where there is an epoch; attrs has
    units, standard names, and what of `meta` names where it comes from."""
    import pandas as pd

    if epoch is not None:
        table = table.reset_index().set_index(
            pd.DatetimeIndex(utc(epoch, table.index.to_numpy()), tz="UTC", name="time")
        )
    table.attrs = {
        **{name: str(value) for name, value in _titles(meta).items() if value},
        "units": {"t": "s", **{name: said["units"] for name, said in named.items()}},
        "standard_names": {
            name: said["standard_name"] for name, said in named.items() if "standard_name" in said
        },
    }
    return table


@dataset_of.register(Solution)
def solution_dataset(solution: Solution) -> xr.Dataset:
    """A Solution as a Dataset over time and fixes. Raises DataError where xarray is missing."""
    variables = arrays_of(solution)
    for i, name in enumerate(solution.columns):
        plain = re.sub(r"\W+", "_", re.sub(r"\[.*?\]", "", name)).strip("_")
        variables[plain if plain not in variables else f"extra_{i}"] = variables.pop(f"extra_{i}")
    names = solution.innovations.names
    dims, values, said = variables["fix_source"]
    meant = {"flag_values": np.arange(len(names)), "flag_meanings": " ".join(map(_word, names))}
    variables["fix_source"] = dims, values, {"units": "1", "long_name": "source", **meant}
    about = {**_titles(solution.meta), "verdict": solution.verdict.word}
    return _dataset(variables, ("time", "fix_time"), solution.meta.get("epoch"), about)


@dataset_of.register(Trajectory)
def trajectory_dataset(made: Trajectory) -> xr.Dataset:
    """A Trajectory as a Dataset over time. Raises DataError where xarray is missing."""
    return _dataset(_trajectory(made, "time"), ("time",), None, {})


@dataset_of.register(Recording)
def recording_dataset(recording: Recording) -> xr.Dataset:
    """A Recording as a Dataset: samples of the IMU over `time`, fixes of each source and the
    reference over times of their own. Raises DataError where xarray is missing."""
    variables = {"time": (("time",), recording.imu.t, CLOCK), **_imu(recording)}
    times = ["time"]
    for name, source in _sources(recording).items():
        word = _word(name)
        times.append(f"time_{word}")
        variables[times[-1]] = (times[-1],), source.t, CLOCK
        variables |= {
            f"{word}_{column}": ((times[-1],), values, said)
            for column, (_, values, said) in _source(source).items()
        }
    if recording.reference is not None:
        times.append("time_reference")
        variables |= {
            name if name == times[-1] else f"reference_{name}": variable
            for name, variable in _trajectory(recording.reference, times[-1]).items()
        }
    about = {"recording": recording.meta.get("name")}
    return _dataset(variables, times, recording.meta.get("epoch"), about)


CLOCK = {"units": "s", "long_name": "time of the recording", "axis": "T"}


def _dataset(
    variables: Variables, times: Any, epoch: str | None, about: dict[str, str | None]
) -> xr.Dataset:
    """The Dataset of variables, `times` being coordinates, and dates where there is an epoch."""
    xarray = need_xarray()
    for name in times:
        dims, t, said = variables[name]
        if epoch is not None:
            dated = {"standard_name": "time", "long_name": said["long_name"], "axis": "T"}
            variables[name] = dims, utc(epoch, t), dated
            seconds = name.replace("time", "t", 1) if name != "fix_time" else "fix_t"
            variables[seconds] = dims, t, CLOCK
    made = xarray.Dataset({name: each for name, each in variables.items() if name not in times})
    made = made.assign_coords({name: variables[name] for name in times})
    return made.assign_attrs(
        Conventions=CONVENTIONS, **{name: text for name, text in about.items() if text}
    )


def need_xarray() -> Any:
    """The module xarray. Raises DataError where it is missing."""
    with optional_import("to_xarray"):
        return import_module("xarray")


def _trajectory(made: Trajectory, time: str) -> Variables:
    """The columns of a Trajectory over its times."""
    found: Variables = {time: ((time,), made.t, CLOCK)}
    for name, values in made.as_columns().items():
        said = attributes(name)
        said.pop("ancillary_variables", None)
        found[name] = (time,), values, said
    return found


def _imu(recording: Recording) -> Variables:
    """Mean rate and specific force of each sample."""
    imu = recording.imu
    parts = ((imu.dtheta, "rad/s", "angular rate"), (imu.dv, "m/s^2", "specific force"))
    return {
        f"{sensor}_{axis}": (
            ("time",),
            increments[:, i] / imu.dt,
            {"units": unit, "long_name": f"{what}, body {axis}, mean over the sample"},
        )
        for sensor, (increments, unit, what) in zip(("gyro", "accel"), parts)
        for i, axis in enumerate("xyz")
    }


def _sources(recording: Recording) -> dict[str, Source]:
    """{name: source}; names that occur twice are numbered."""
    found: dict[str, Source] = {}
    for source in recording.sources:
        name = base = source.name or source.kind
        number = 1
        while name in found:
            number += 1
            name = f"{base} {number}"
        found[name] = source
    return found


def _source(source: Source) -> Variables:
    """Values and standard deviations of the fixes of a source, in the units of tables."""
    kind = find(source.kind)
    word = _word(source.kind)
    names = NAMES.get(source.kind) or (
        [word] if len(kind.quantities) == 1 else [f"{word}_{axis}" for axis in "xyz"]
    )
    found: Variables = {}
    for name, quantity, values in zip(names, kind.quantities, source.y.T):
        unit, factor = shown_value_unit(quantity)
        said = {"units": CF_UNITS.get(unit, unit), "long_name": f"{quantity} of {source.kind}"}
        if name in STANDARD_NAMES:
            said["standard_name"] = STANDARD_NAMES[name]
        found[name] = ("fix",), values * factor, said
    rows = _rows(source.kind, kind.vector, source.std)
    for name, quantity, values in zip(rows, kind.quantities, source.std.T):
        unit, factor = shown_unit(quantity)
        said = {"units": CF_UNITS.get(unit, unit), "long_name": f"standard deviation, {name}"}
        found[f"std_{name}"] = ("fix",), values * factor, said
    return found


def _rows(kind: str, vector: str, std: Array) -> tuple[str, ...]:
    """Names of the rows of its innovation."""
    if std.shape[1] == 1:
        return (_word(kind),)
    return EULER if kind == "attitude" else tuple("xyz") if vector == "b" else NED_AXES


def _word(name: str) -> str:
    """A name as one word that CF takes."""
    return re.sub(r"\W+", "_", name).strip("_") or "source"
