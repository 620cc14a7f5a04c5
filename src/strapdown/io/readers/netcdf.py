"""A complete Recording in one NetCDF file: group imu, a group per source, group reference. Every
variable has its unit; SI and radians."""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...aiding import find
from ...checks import DataError, check_path, locate_errors
from ...core.loop.contract import Imu
from ...data.recording import Recording, RecordingMeta as RecordingFacts, check_recording
from ...data.solution import Correlated, Source, Trajectory
from ...fileio.checksum import DAMAGED
from ...fileio.files import netcdf, replacing
from ...preprocessing.fixes import checked_sources, overlap
from ...typing import Array, File
from ...units.quantities import dimension, innovation_dimension, si
from ..facts import recording_facts
from ..own.array_rules import Column, Schema, check_arrays
from ..own.hdf5_content import Content, OwnFormat, content_of
from ..reader import Findings, Reader
from ..solutions.solution_netcdf import Variables, fill, plain
from ..unfelt_tilt import accusation, decide_accusation

FORMAT = OwnFormat(
    "recording",
    1,
    others="solutions are read with read_solution",
    again="read the original files, and write it again with write_recording",
)
SOURCE = re.compile(r"source_\d{1,9}", re.ASCII)
AXES = {"axis": 3, "quaternion": 4}
IMU_COLUMNS = {
    "t": Column("time", "s", "end of the interval", rising=True),
    "dt": Column("time", "s", "length of the interval", above=0.0),
    "dtheta": Column("time axis", "rad", "integral of the angular rate, body FRD"),
    "dv": Column("time axis", "m/s", "integral of the specific force, body FRD"),
}
REFERENCE_COLUMNS = {
    "t": Column("time", "s", "time", rising=True),
    "lla": Column(
        "time axis", "rad, rad, m", "latitude, longitude, ellipsoidal height", missing=True
    ),
    "v_n": Column("time axis", "m/s", "velocity north, east, down", missing=True, optional=True),
    "q_nb": Column(
        "time quaternion",
        "1",
        "body to navigation, scalar first",
        missing=True,
        unit_length=True,
        optional=True,
    ),
    "std": Column(
        "time state",
        "SI",
        "standard deviations in the order of the error states",
        missing=True,
        infinite=True,
        least=0.0,
        optional=True,
    ),
}


def write_recording(recording: Recording, path: File) -> None:
    """Write a recording as NetCDF; `read` returns it unchanged. The file is complete, or not
    written.

    Parameters
    ----------
    recording : Recording
        With all its sources, its reference and its meta.
    path : str or path
        Ending in .nc.

    Raises
    ------
    DataError
        Where the path cannot be written.

    Examples
    --------
    >>> import tempfile, strapdown as sd
    >>> recording = sd.simulate("car", 10.0, seed=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sd.write_recording(recording, f"{folder}/car.nc")
    ...     sd.read(f"{folder}/car.nc") == recording
    True
    """
    check_recording(recording)
    check_path(path)
    groups: dict[str, tuple[Schema, dict[str, Any], dict[str, Any]]]
    groups = {"imu": (IMU_COLUMNS, recording.imu._asdict(), {})}
    for number, source in enumerate(recording.sources, 1):
        attributes: dict[str, Any] = {"kind": source.kind, "name": source.name}
        attributes |= (
            {"parameters": np.array(source.parameters, float)} if len(source.parameters) else {}
        )
        attributes |= {"gate": float(source.gate)} if source.gate is not None else {}
        attributes |= {"estimate": json.dumps(dict(source.estimate))} if source.estimate else {}
        attributes |= {"slip": float(source.slip)} if source.slip else {}
        attributes |= _noise_attributes(source)
        groups[f"source_{number}"] = (_source_columns(source.kind), vars(source), attributes)
    if recording.reference is not None:
        groups["reference"] = (REFERENCE_COLUMNS, vars(recording.reference), {})
    columns = {name: _columns(*group[:2], f"{path}: {name}") for name, group in groups.items()}
    meta = _meta(recording.meta)
    size = sum(
        np.asarray(values).nbytes
        for variables in (*columns.values(), meta)
        for _, values, _ in variables.values()
    )
    with replacing(path) as part, netcdf(part, size) as file:
        file.attrs["format"] = FORMAT.mark
        fill(file, meta)
        for name, variables in columns.items():
            group = file.create_group(name)
            group.attrs.update(groups[name][2])
            fill(group, variables)


def _source_columns(kind: str) -> Schema:
    quantities = find(kind).quantities
    units = [
        names[0] if len(set(names)) == 1 else ", ".join(names)
        for names in (
            [si(of(quantity)) for quantity in quantities]
            for of in (dimension, innovation_dimension)
        )
    ]
    return {
        "t": Column("time", "s", "time of the fix", ordered=True),
        "y": Column("time component", units[0], ", ".join(quantities), missing=True),
        "std": Column(
            "time component",
            units[1],
            "standard deviation per component",
            missing=True,
            infinite=True,
            least=0.0,
        ),
    }


def _meta(meta: RecordingFacts) -> Variables:
    """Return the arrays of meta as variables and the rest as JSON, in a variable because attributes
    are limited to 64 KiB."""
    arrays = {
        key: value
        for key, value in meta.items()
        if isinstance(value, np.ndarray) and value.ndim and value.dtype.kind in "fi"
    }
    text = json.dumps(plain({key: value for key, value in meta.items() if key not in arrays}))
    return {
        f"meta_{key}": ([f"{key}_{axis}" for axis in range(value.ndim)], value, {})
        for key, value in arrays.items()
    } | {"meta": ([], text, {"long_name": "meta as JSON"})}


def _columns(layout: Schema, values: Mapping[str, Any], where: str) -> Variables:
    """{name: (dimensions, array, attributes)} of the existing columns. Raises DataError where their
    lengths differ."""
    found: Variables = {
        name: (
            column.axes.split(),
            np.asarray(values[name], float),
            {"units": column.units, "long_name": column.about},
        )
        for name, column in layout.items()
        if values[name] is not None
    }
    for name, (dims, array, _) in found.items():
        if array.ndim != len(dims) or len(array) != len(found["t"][1]):
            raise DataError(
                f"{where}: not written, the columns of the recording have different lengths ({name} "
                f"has the shape {array.shape}, "
                f"t {found['t'][1].shape})"
            )
    return found


def read_recording(path: File) -> Recording:
    """Return the Recording in a file of `write_recording`, with the same checks as on first
    reading. Raises DataError."""
    meta, imu, sources, reference = parts(path)
    accused = accusation(imu, None, meta.get("vehicle"), str(path), field=False)
    checked, notes = checked_sources(imu, sources)
    if reference is not None:
        overlap(imu, reference.t, f"{path}: reference")
    recording = Recording(imu, checked, reference, meta)
    notes = list(dict.fromkeys([*meta.get("notes", []), *notes]))
    return decide_accusation(recording.with_meta(notes=notes), accused)


def parts(path: File) -> tuple[RecordingFacts, Imu, list[Source], Trajectory | None]:
    """(meta, Imu, sources, reference) as stored in the file, whose format is checked. Raises
    DataError."""
    path = Path(path)
    if not os.path.isfile(path):
        raise DataError(
            f"{path}: cannot be read ({'it is a folder' if os.path.isdir(path) else 'no such file'}); "
            f"check the path"
        )
    found = content_of(path, FORMAT)
    if "imu" not in found.groups:
        raise DataError(f"{path}: group imu is missing; {DAMAGED}")
    imu = Imu(**_check_group(found.groups["imu"], IMU_COLUMNS, f"{path}: group imu"))
    if len(imu.t) < 2:
        raise DataError(f"{path}: group imu: t has {len(imu.t)} samples; it must have 2 or more")
    groups = {name: SOURCE.fullmatch(name) for name in found.groups}
    sources = [
        _source(found.groups[name], f"{path}: group {name}")
        for name in sorted(filter(groups.get, groups), key=lambda name: int(name[7:]))
    ]
    truth = found.groups.get("reference")
    reference = truth and Trajectory(
        **_check_group(truth, REFERENCE_COLUMNS, f"{path}: group reference")
    )
    return _meta_of(found, path), imu, sources, reference


def _check_group(group: Content, schema: Schema, where: str) -> dict[str, Array]:
    """{name: array} of the variables of a schema that the group has. Raises DataError."""
    check_arrays(group.variables, schema, where, AXES, group.units)
    return {
        name: np.require(group.variables[name], float, ["C", "W"])
        for name in schema
        if name in group.variables
    }


def _meta_of(found: Content, path: Path) -> RecordingFacts:
    from ..own.text_rules import RecordingMetaRules, check_values, from_json

    where = f"{path}: meta"
    meta = check_values(dict[str, Any], from_json(found.texts.get("meta"), where), where)
    arrays = {name[5:]: values for name, values in found.variables.items() if name[:5] == "meta_"}
    for name, values in arrays.items():
        if values.dtype.kind not in "iuf":
            raise DataError(f"{path}: meta_{name} is not an array of numbers; {DAMAGED}")
    warmth = arrays.get("temperature")
    if warmth is not None and (warmth.ndim != 2 or warmth.shape[1] != 2 or not len(warmth)):
        raise DataError(
            f"{path}: meta_temperature has the shape {warmth.shape}; it must have rows of time (s) and "
            f"degC; {DAMAGED}"
        )
    known = {
        name: arrays[name].tolist() for name in set(arrays) & set(RecordingMetaRules.model_fields)
    }
    check_values(RecordingMetaRules, meta | known, where)
    return cast(RecordingFacts, {**meta, **arrays})


def _source(group: Content, where: str) -> Source:
    from ..own.text_rules import SourceAttributes, check_values, from_json

    said = dict(group.attributes)
    for name in {"parameters", "correlated_std"} & set(said):
        said[name] = np.atleast_1d(said[name]).tolist()
    for name in {"robust", "correlated_states"} & set(said):
        said[name] = said[name] if said[name] not in (0, 1) else bool(said[name])
    if "estimate" in said:
        said["estimate"] = from_json(said["estimate"], f"{where}: estimate")
    check_values(SourceAttributes, said, where)
    with locate_errors(where):
        schema = _source_columns(said["kind"])
    columns = _check_group(group, schema, where)
    return Source(
        said["kind"],
        **columns,
        parameters=tuple(map(float, said.get("parameters", ()))),
        gate=None if said.get("gate") is None else float(said["gate"]),
        name=said["name"],
        estimate={name: tuple(std) for name, std in said.get("estimate", {}).items()},
        slip=float(said.get("slip", 0.0)),
        correlated=_correlated_errors(said),
        robust=bool(said.get("robust", False)),
        adaptive=float(said.get("adaptive", 0.0)),
        receiver=said.get("receiver", ""),
    )


def _noise_attributes(source: Source) -> dict[str, Any]:
    """Return the attributes of a source's error model, apart from plain white noise."""
    said: dict[str, Any] = {"robust": 1} if source.robust else {}
    said |= {"adaptive": float(source.adaptive)} if source.adaptive else {}
    said |= {"receiver": source.receiver} if source.receiver else {}
    if source.correlated is not None:
        std, time, states = source.correlated
        said |= {"correlated_std": np.array(std, float), "correlation_time": float(time)}
        said |= {"correlated_states": int(states)}
    return said


def _correlated_errors(said: dict[str, Any]) -> Correlated | None:
    if not said.get("correlated_std"):
        return None
    return Correlated(
        tuple(map(float, said["correlated_std"])),
        float(said.get("correlation_time", 1.0)),
        bool(said.get("correlated_states", True)),
    )


def inspect(path: Path) -> Findings:
    """Return the findings on a recording, also for impossible samples. Raises DataError for a file
    that is not a complete recording."""
    meta, imu, sources, reference = parts(path)
    found = Findings.of()
    found.attempt(read_recording, path)
    found.add(*recording_facts(Recording(imu, tuple(sources), reference, meta)))
    return found


READER = Reader("netcdf", (".nc",), "recording that strapdown wrote", read_recording, inspect)
