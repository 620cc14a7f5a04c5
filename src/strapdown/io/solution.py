"""Solutions on disk: NetCDF holds everything and reads back as it was, CSV holds the table, KML the
track for a map viewer.

Every column says its unit: as an attribute in NetCDF, in brackets behind the name in CSV (`lat
[deg]`). docs/report.md lists them.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..checks import DataError
from ..core.contract import BRIDGED, INVALID, VALID
from ..data import (
    BIAS_COLUMNS,
    NAV_COLUMNS,
    SD_COLUMNS,
    SD_SCALE,
    UNITS,
    Innovations,
    Solution,
    Trajectory,
)
from ..files import netcdf, replacing
from ..typing import Array, File
from .kml import kml

if TYPE_CHECKING:
    import pandas as pd

QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
FORMAT = "strapdown solution 1"
CSV_DECIMALS = 10
"""Digits after the point in CSV: 0.01 mm of latitude, and nine orders below the biases of any
sensor."""


def write_solution(solution: Solution, path: File) -> None:
    """Write a Solution as .nc, .csv, .csv.gz, .csv.xz or .kml (which needs a position), by the
    ending of `path`, whole or not at all.

    Raises DataError.
    """
    write = {"nc": _write_netcdf, "csv": _write_csv, "kml": _write_kml}[
        _format(path, "nc, csv, kml")
    ]
    with replacing(path) as part:
        write(solution, part, Path(path))


def read_solution(path: File) -> Solution:
    """The Solution in a .nc or .csv file of `write_solution`; a CSV brings no innovations,
    events or covariance. Raises DataError."""
    path = Path(path)
    read = {"nc": _read_netcdf, "csv": _read_csv}[_format(path, "nc, csv")]
    if not path.is_file():
        reason = "is a folder" if path.is_dir() else "no such file"
        raise DataError(
            f"{path}: {reason}; give a solution file that strapdown wrote (.nc or .csv)"
        )
    try:
        return read(path)
    except DataError:
        raise
    except (
        OSError,
        EOFError,
        ValueError,
        KeyError,
        RuntimeError,
    ) as error:  # of pandas, h5netcdf and the decompressors
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise DataError(
            f"{path}: not a solution, or damaged ({reason}); write it again with strapdown fuse"
        ) from error
    except Exception as error:
        # lzma.LZMAError and zlib.error are no OSErrors
        if type(error).__name__ not in (
            "LZMAError",
            "error",
            "BadGzipFile",
        ):
            raise
        raise DataError(
            f"{path}: the compressed file is damaged or cut short; write it again with strapdown "
            f"fuse"
        ) from error


def _format(path: File, known: str) -> str:
    ending = re.search(r"\.(nc|csv|kml)(\.gz|\.xz)?$", Path(path).name.lower())
    if not ending or (ending[2] and ending[1] != "csv") or ending[1] not in known:
        raise DataError(
            f"{path}: this ending is not one of a solution; use .{known.replace(', ', ', .')}, "
            f".csv.gz or .csv.xz"
        )
    return ending[1]


# NetCDF


def _write_netcdf(solution: Solution, part: Path, _: Path) -> None:
    variables = {
        name: (dims, np.asarray(values), attributes)
        for name, (dims, values, attributes) in _variables(solution).items()
    }
    with netcdf(part, sum(values.nbytes for _, values, _ in variables.values())) as file:
        file.attrs["format"] = FORMAT
        for name, (dims, values, attributes) in variables.items():
            for dim, size in zip(dims, values.shape):
                if dim not in file.dimensions:
                    file.dimensions[dim] = size
            packed = (
                {"compression": "gzip", "compression_opts": 1, "shuffle": True}
                if dims and values.size
                else {}
            )
            text = {"dtype": _text()} if values.dtype.kind == "U" else {}
            variable = file.create_variable(
                name, dims, data=values.astype(object) if text else values, **packed, **text
            )
            variable.attrs.update(attributes)


def _text() -> Any:
    """h5py's type of a text of any length."""
    import h5py

    return h5py.string_dtype()


def _variables(solution: Solution) -> dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]]:
    """{name: (dimensions, values, attributes)} of all that the file holds; texts are variables
    because attributes end at 64 KiB."""
    fixes, table, q_nb = solution.innovations, solution.table(), solution.trajectory.q_nb
    assert q_nb is not None  # every filter estimates an attitude
    found: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]]
    found = {"time": (("time",), solution.t, {"units": "s", "long_name": "time of the recording"})}
    found |= {
        name: (("time",), table[name].to_numpy(), {"units": UNITS[name]})
        for name in NAV_COLUMNS + BIAS_COLUMNS + SD_COLUMNS
    }
    found |= {name: (("time",), column, {"units": "1"}) for name, column in zip(QUATERNION, q_nb.T)}
    meanings = {
        "units": "1",
        "flag_values": np.array([VALID, BRIDGED, INVALID]),
        "flag_meanings": "valid bridged invalid",
    }
    found["status"] = (("time",), solution.status, meanings)
    found |= {
        f"extra_{i}": (("time",), values, {"long_name": name})
        for i, (name, values) in enumerate(solution.columns.items())
    }
    if solution.covariance is not None:
        found["covariance"] = (
            ("time", "state", "state_2"),
            solution.covariance,
            {"units": "products of m, m/s, rad, m/s^2, rad/s (the error states in order)"},
        )
    found |= {
        "fix_time": (("fix",), fixes.t, {"units": "s"}),
        "fix_source": (("fix",), fixes.source, {"units": "1", "long_name": "index into `sources`"}),
        "innovation": (("fix", "row"), fixes.innovation, {"units": "SI, as the source"}),
        "nis": (("fix",), fixes.nis, {"units": "1", "long_name": "normalised innovation squared"}),
        "accepted": (("fix",), fixes.accepted.astype(np.int8), {"units": "1"}),
    }
    texts = {
        "sources": fixes.names,
        "gates": fixes.gates,
        "events": solution.events,
        "meta": solution.meta,
    }
    return found | {
        name: ((), json.dumps(plain(value)), {"long_name": f"{name} as JSON"})
        for name, value in texts.items()
    }


def _read_netcdf(path: Path) -> Solution:
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        if file.attrs.get("format") != FORMAT:
            raise DataError(
                f"{path}: this NetCDF file is no solution (`format` is not {FORMAT!r}); read "
                f"recordings with strapdown.read"
            )

        def column(name: str) -> np.ndarray[Any, Any]:
            return np.asarray(file[name][...])

        def table(names: list[str]) -> Array:
            return np.column_stack([column(name) for name in names])

        def read(name: str) -> Any:
            return json.loads(np.asarray(file[name][...]).item())

        innovations = Innovations(
            column("fix_time"),
            column("fix_source"),
            column("innovation"),
            column("nis"),
            column("accepted").astype(bool),
            tuple(read("sources")),
            tuple(read("gates")),
        )
        extra = {
            str(file[name].attrs["long_name"]): column(name)
            for name in file.variables
            if re.fullmatch(r"extra_\d+", name)
        }
        covariance = column("covariance") if "covariance" in file.variables else None
        trajectory, b_a, b_g = _state(column("time"), table, table(QUATERNION))
        return Solution(
            trajectory,
            b_a,
            b_g,
            column("status"),
            innovations,
            tuple((t, text) for t, text in read("events")),
            extra,
            covariance,
            read("meta"),
        )


def _state(
    t: Array, table: Callable[[list[str]], Array], q_nb: Array
) -> tuple[Trajectory, Array, Array]:
    """Trajectory, b_a and b_g in SI from `table(names)`, which is in the units of `UNITS`."""
    lla = table(NAV_COLUMNS[:3]) * [np.pi / 180, np.pi / 180, 1]
    b_a, b_g = np.hsplit(table(BIAS_COLUMNS) / SD_SCALE[9:], 2)
    return Trajectory(t, lla, table(NAV_COLUMNS[3:6]), q_nb, table(SD_COLUMNS) / SD_SCALE), b_a, b_g


def plain(value: Any) -> Any:
    """`value` (as of `Solution.meta`) in the types of JSON: named tuples and data classes become
    objects, the unknown its text."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    elif hasattr(value, "model_dump"):
        value = value.model_dump()
    elif hasattr(value, "__dataclass_fields__"):
        value = {name: getattr(value, name) for name in value.__dataclass_fields__}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


# CSV


def _write_csv(solution: Solution, part: Path, path: Path) -> None:
    table = solution.table()
    table.columns = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in table.columns]
    ways: dict[str, Any] = {".gz": "gzip", ".xz": {"method": "xz", "preset": 1}}
    compression = ways.get(path.suffix.lower())
    table.index = table.index.to_series().round(CSV_DECIMALS).rename("t [s]")
    table.round(CSV_DECIMALS).to_csv(part, compression=compression, lineterminator="\n")


def _read_csv(path: Path) -> Solution:
    import pandas as pd

    ways: dict[str, Literal["gzip", "xz"]] = {".gz": "gzip", ".xz": "xz"}
    table = pd.read_csv(path, compression=ways.get(path.suffix.lower()))
    units = {column: re.fullmatch(r"(\S+) \[(.*)\]", column) for column in table.columns}
    known = {match[1]: match[2] for match in units.values() if match and match[1] in UNITS}
    for name, unit in known.items():
        if unit != UNITS[name]:
            raise DataError(
                f"{path}: column {name!r} is in {unit!r}; a solution has it in {UNITS[name]!r}"
            )
    table = table.rename(
        columns={column: match[1] for column, match in units.items() if match and match[1] in UNITS}
    )
    _check(path, table)

    def read(names: list[str]) -> Array:
        return table[names].to_numpy(float)

    none = Innovations(
        np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0, bool)
    )
    extra = {
        name: table[name].to_numpy()
        for name in table.columns
        if name not in UNITS and name != "status"
    }
    t = table["t"].to_numpy(float)
    trajectory, b_a, b_g = _state(t, read, _quaternion(read(NAV_COLUMNS[6:])))
    return Solution(
        trajectory,
        b_a,
        b_g,
        table["status"].to_numpy(),
        none,
        columns=extra,
        meta={
            "recording": path.name,
            "notes": [f"read from {path.name}: a table without innovations, events or covariance"],
        },
    )


def _check(path: Path, table: "pd.DataFrame") -> None:
    needed = [*UNITS, "status"]
    missing = [name for name in needed if name not in table]
    if missing:
        wanted = f"{missing[0]} [{UNITS[missing[0]]}]" if missing[0] in UNITS else missing[0]
        raise DataError(
            f"{path}: column {wanted!r} is missing; write the solution again, or use read for a "
            f"recording"
        )
    if not len(table):
        raise DataError(f"{path}: the table has no rows")
    import pandas as pd

    for name in needed:
        if not pd.api.types.is_numeric_dtype(table[name]):
            row = int(
                (pd.to_numeric(table[name], errors="coerce").isna() & table[name].notna()).argmax()
            )
            cell = table[name][row]
            raise DataError(
                f"{path}: row {row + 2}, column {name!r}: {cell!r} is not a number; correct it or "
                f"write the solution again"
            )


def _quaternion(rph: Array) -> Array:
    """From roll, pitch, heading in degrees."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("ZYX", rph[:, ::-1], degrees=True).as_quat()[:, [3, 0, 1, 2]]


def _write_kml(solution: Solution, part: Path, path: Path) -> None:
    if not solution.has_position:
        filter = solution.meta.get("filter")
        raise DataError(
            f"{path}: the solution{f' of {filter}' if filter else ''} has no position, so there is "
            f"no track to write; use .nc or .csv"
        )
    part.write_bytes(kml(solution))
