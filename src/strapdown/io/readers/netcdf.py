"""A whole Recording in one NetCDF file: group imu, a group per aiding, group reference; every
variable says its unit. SI and radians."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...aiding import find
from ...checks import DataError
from ...core.contract import Imu
from ...data import Aiding, Trajectory
from ...files import netcdf, replacing
from ...opening import json_of
from ...preprocessing.fixes import checked_aidings, overlap
from ...preprocessing.plausible import mistakes
from ...quantities import dimension, innovation_dimension, si
from ...recording import Recording
from ...typing import Array, File
from ..contract import Findings, Reader
from ..facts import recording_facts
from ..solutions.solution_netcdf import Variables, fill, plain
from ..tables.hdf5_file import open_netcdf

Layout: TypeAlias = Mapping[str, tuple[str, str, str]]
"""{name: (dimensions, unit, what it is)} of the columns of a group."""

FORMAT = "strapdown recording 1"
IMU_COLUMNS = {
    "t": ("time", "s", "end of the interval"),
    "dt": ("time", "s", "length of the interval"),
    "dtheta": ("time axis", "rad", "integral of the angular rate, body FRD"),
    "dv": ("time axis", "m/s", "integral of the specific force, body FRD"),
}
REFERENCE_COLUMNS = {
    "t": ("time", "s", "time"),
    "lla": ("time axis", "rad, rad, m", "latitude, longitude, ellipsoidal height"),
    "v_n": ("time axis", "m/s", "velocity north, east, down"),
    "q_nb": ("time quaternion", "1", "body to navigation, scalar first"),
    "sd": ("time state", "SI", "standard deviations in the order of the error states"),
}


def write_recording(recording: Recording, path: File) -> None:
    """Write a Recording as NetCDF, atomically. Raises DataError where the path cannot be
    written."""
    groups: dict[str, tuple[Layout, dict[str, Any], dict[str, Any]]]
    groups = {"imu": (IMU_COLUMNS, recording.imu._asdict(), {})}
    for number, aiding in enumerate(recording.aidings, 1):
        attributes: dict[str, Any] = {"kind": aiding.kind, "name": aiding.name}
        attributes |= (
            {"parameters": np.array(aiding.parameters, float)} if len(aiding.parameters) else {}
        )
        attributes |= {"gate": float(aiding.gate)} if aiding.gate is not None else {}
        attributes |= {"estimate": json.dumps(dict(aiding.estimate))} if aiding.estimate else {}
        attributes |= {"slip": float(aiding.slip)} if aiding.slip else {}
        groups[f"aiding_{number}"] = (_aiding_layout(aiding.kind), vars(aiding), attributes)
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
        file.attrs["format"] = FORMAT
        fill(file, meta)
        for name, variables in columns.items():
            group = file.create_group(name)
            group.attrs.update(groups[name][2])
            fill(group, variables)


def _aiding_layout(kind: str) -> Layout:
    quantities = find(kind).quantities
    units = [
        names[0] if len(set(names)) == 1 else ", ".join(names)
        for names in (
            [si(of(quantity)) for quantity in quantities]
            for of in (dimension, innovation_dimension)
        )
    ]
    return {
        "t": ("time", "s", "time of the fix"),
        "y": ("time component", units[0], ", ".join(quantities)),
        "sd": ("time component", units[1], "standard deviation per component"),
    }


def _meta(meta: dict[str, Any]) -> Variables:
    """The arrays of meta as variables, the rest as JSON, which stands in a variable because an
    attribute ends at 64 KiB."""
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


def _columns(layout: Layout, values: Mapping[str, Any], where: str) -> Variables:
    """{name: (dimensions, array, attributes)} of the columns that there are. Raises DataError
    where their lengths differ."""
    found: Variables = {
        name: (dims.split(), np.asarray(values[name], float), {"units": unit, "long_name": text})
        for name, (dims, unit, text) in layout.items()
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
    """The Recording in a file of `write_recording`, checked as when it was first read. Raises
    DataError."""
    meta, imu, aidings, reference = parts(path)
    for _, text in mistakes(imu):
        raise DataError(f"{path}: imu: {text}")
    checked, notes = checked_aidings(imu, aidings)
    if reference is not None:
        overlap(imu, reference.t, f"{path}: reference")
    return Recording(
        imu,
        checked,
        reference,
        meta | {"notes": list(dict.fromkeys([*meta.get("notes", []), *notes]))},
    )


def parts(path: File) -> tuple[dict[str, Any], Imu, list[Aiding], Trajectory | None]:
    """(meta, Imu, aidings, reference) as they stand in the file, the IMU checked for shape only.
    Raises DataError."""
    path = Path(path)
    if not path.is_file():
        raise DataError(
            f"{path}: cannot be read ({'it is a folder' if path.is_dir() else 'no such file'}); "
            f"check the path"
        )
    try:
        found = _parts(path)
    except DataError:
        raise
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        reason = (str(error) or type(error).__name__).splitlines()[0][:120]
        raise DataError(
            f"{path}: is not a whole NetCDF recording ({reason}); write it again"
        ) from error
    _check_columns(found[1], path)
    return found


def _parts(path: Path) -> tuple[dict[str, Any], Imu, list[Aiding], Trajectory | None]:
    with open_netcdf(path) as file:
        if file.attrs.get("format") != FORMAT:
            raise DataError(
                f"{path}: is no recording (its format attribute is {file.attrs.get('format')!r}, "
                f"not {FORMAT!r}); "
                "solutions are read with read_solution"
            )
        imu = Imu(**{name: _column(file["imu"][name]) for name in Imu._fields})
        sources = sorted(
            (name for name in file.groups if name.startswith("aiding_")),
            key=lambda name: int(name[7:]),
        )
        aidings = [_aiding(file[name]) for name in sources]
        truth = file["reference"] if "reference" in file.groups else None
        reference = (
            None
            if truth is None
            else Trajectory(
                **{
                    name: _column(truth[name])
                    for name in REFERENCE_COLUMNS
                    if name in truth.variables
                }
            )
        )
        text = np.asarray(file["meta"][...]).item()
        meta = json_of(text, path)
        meta |= {name[5:]: file[name][...] for name in file.variables if name.startswith("meta_")}
        return meta, imu, aidings, reference


def _column(variable: Any) -> Array:
    return np.require(variable[...], float, ["C", "W"])


def _aiding(group: Any) -> Aiding:
    gate, parameters = group.attrs.get("gate"), np.atleast_1d(group.attrs.get("parameters", ()))
    estimate = json_of(group.attrs.get("estimate", "{}"), group.name)
    return Aiding(
        group.attrs["kind"],
        _column(group["t"]),
        _column(group["y"]),
        _column(group["sd"]),
        parameters=tuple(map(float, parameters)),
        gate=None if gate is None else float(gate),
        name=group.attrs["name"],
        estimate={name: tuple(sd) for name, sd in estimate.items()},
        slip=float(group.attrs.get("slip", 0.0)),
    )


def _check_columns(imu: Imu, path: Path) -> None:
    n = len(imu.t)
    whole = imu.t.shape == imu.dt.shape == (n,) and imu.dtheta.shape == imu.dv.shape == (n, 3)
    if (
        not whole
        or n < 2
        or not all(np.isfinite(column).all() for column in imu)
        or not (np.diff(imu.t) > 0).all()
        or not (imu.dt > 0).all()
    ):
        raise DataError(
            f"{path}: group imu must hold at least 2 finite samples in rising time with positive "
            f"dt; read the original files again"
        )


def inspect(path: Path) -> Findings:
    """Findings on a recording, also where its samples cannot be true. Raises DataError where the
    file is no whole recording."""
    meta, imu, aidings, reference = parts(path)
    found = Findings.of()
    found.attempt(read_recording, path)
    found.add(*recording_facts(Recording(imu, tuple(aidings), reference, meta)))
    return found


READER = Reader("netcdf", (".nc",), "recording that strapdown wrote", read_recording, inspect)
