"""Solutions on disk: NetCDF holds everything and reads back as it was, CSV holds the table, KML the
track for a map viewer.

Every column says its unit: as an attribute in NetCDF, in brackets behind the name in CSV (`lat
[deg]`). docs/report.md lists them.
"""

import gzip
import json
import lzma
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ..checks import DataError
from ..core.contract import BRIDGED, DOUBTFUL, INVALID, VALID
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
from ..verdict import NOT_JUDGED, Verdict
from .kml import kml
from .table_file import open_text, reading
from .table_text import read_table

if TYPE_CHECKING:
    import pandas as pd

QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
Variables: TypeAlias = dict[str, tuple[Sequence[str], Any, dict[str, Any]]]
"""{name: (dimensions, values, attributes)} of a group of a NetCDF file."""
FORMAT = "strapdown solution 1"
VERDICT_LINE = "# verdict: "
"""Begins the first line of a CSV file whose solution was judged; the word follows, then all as
JSON."""
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
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:  # of h5netcdf
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise DataError(
            f"{path}: not a solution, or damaged ({reason}); write it again with strapdown fuse"
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
    variables = _variables(solution)
    with netcdf(
        part, sum(np.asarray(values).nbytes for _, values, _ in variables.values())
    ) as file:
        file.attrs["format"] = FORMAT
        if solution.verdict.word != NOT_JUDGED:
            file.attrs["verdict"] = solution.verdict.word
        fill(file, variables, compression="gzip", compression_opts=1, shuffle=True)


def fill(group: Any, variables: Variables, **packing: Any) -> None:
    """Write variables to a group of an h5netcdf file; `packing` is for those that are arrays."""
    import h5py

    for name, (dims, values, attributes) in variables.items():
        values = np.asarray(values)
        text = values.dtype.kind == "U"
        for dim, size in zip(dims, values.shape):
            if dim not in group.dimensions:
                group.dimensions[dim] = size
        group.create_variable(
            name,
            tuple(dims),
            dtype=h5py.string_dtype() if text else None,
            data=values.astype(object) if text else values,
            **(packing if values.ndim and values.size else {}),
        ).attrs.update(attributes)


def _table(solution: Solution) -> "pd.DataFrame":
    """The table of a solution, with NaN in the columns of what its trajectory does not have."""
    names = [*NAV_COLUMNS, *BIAS_COLUMNS, *SD_COLUMNS, *solution.columns, "status"]
    return solution.table().reindex(columns=names)


def _variables(solution: Solution) -> Variables:
    """All that the file holds; texts are variables because attributes end at 64 KiB."""
    fixes, table, q_nb = solution.innovations, _table(solution), solution.trajectory.q_nb
    found: Variables = {
        "time": (("time",), solution.t, {"units": "s", "long_name": "time of the recording"})
    }
    found |= {
        name: (("time",), table[name].to_numpy(), {"units": UNITS[name]})
        for name in NAV_COLUMNS + BIAS_COLUMNS + SD_COLUMNS
    }
    if q_nb is not None:
        found |= {
            name: (("time",), q_nb[:, i], {"units": "1"}) for i, name in enumerate(QUATERNION)
        }
    meanings = {
        "units": "1",
        "flag_values": np.array([VALID, BRIDGED, INVALID, DOUBTFUL]),
        "flag_meanings": "valid bridged invalid doubtful",
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
        "meta": {name: value for name, value in solution.meta.items() if name != "verdict"},
    }
    if solution.verdict.word != NOT_JUDGED:
        texts["verdict"] = solution.verdict.as_dict()
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
        meta = read("meta")
        if "verdict" in file.variables:
            meta["verdict"] = _checked(read("verdict"))
        covariance = column("covariance") if "covariance" in file.variables else None
        q_nb = table(QUATERNION) if QUATERNION[0] in file.variables else None
        trajectory, b_a, b_g = _state(column("time"), table, q_nb)
        return Solution(
            trajectory,
            b_a,
            b_g,
            column("status"),
            innovations,
            tuple((t, text) for t, text in read("events")),
            extra,
            covariance,
            meta,
        )


def _state(
    t: Array, table: Callable[[list[str]], Array], q_nb: Array | None
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
    table = _table(solution)
    table.columns = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in table.columns]
    ways: dict[str, Any] = {".gz": gzip.open, ".xz": partial(lzma.open, preset=1)}
    table.index = table.index.to_series().round(CSV_DECIMALS).rename("t [s]")
    verdict = solution.verdict
    with ways.get(path.suffix.lower(), open)(part, "wt", encoding="utf-8", newline="") as file:
        if verdict.word != NOT_JUDGED:
            file.write(f"{VERDICT_LINE}{verdict.word} {json.dumps(verdict.as_dict())}\n")
        table.round(CSV_DECIMALS).to_csv(file, lineterminator="\n")


def _read_csv(path: Path) -> Solution:
    table = read_table(path)
    columns = {}
    for column in map(str, table.frame.columns):
        name, unit = column.removesuffix("]").split(" [", 1) if " [" in column else (column, None)
        if name in UNITS and unit not in (None, UNITS[name]):
            raise DataError(
                f"{path}: column {name!r} is in {unit!r}; a solution has it in {UNITS[name]!r}"
            )
        columns[name if name in UNITS else column] = column
    if missing := [name for name in (*UNITS, "status") if name not in columns]:
        wanted = f"{missing[0]} [{UNITS[missing[0]]}]" if missing[0] in UNITS else missing[0]
        raise DataError(
            f"{path}: column {wanted!r} is missing; write the solution again, or use read for a "
            f"recording"
        )

    def read(names: list[str]) -> Array:
        return np.column_stack([table.numbers(columns[name]) for name in names])

    none = Innovations(
        np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty(0, bool)
    )
    extra = {
        name: table.frame[column].to_numpy()
        for name, column in columns.items()
        if name not in UNITS and name != "status"
    }
    trajectory, b_a, b_g = _state(
        table.numbers(columns["t"]), read, _quaternion(read(NAV_COLUMNS[6:]))
    )
    return Solution(
        trajectory,
        b_a,
        b_g,
        table.numbers("status").astype(np.int64),
        none,
        columns=extra,
        meta={
            "recording": path.name,
            "notes": [f"read from {path.name}: a table without innovations, events or covariance"],
            **_verdict_of(path),
        },
    )


def _verdict_of(path: Path) -> dict[str, Any]:
    """{"verdict": as the first line of a CSV file says it}; {} where it says none."""
    with reading(path), open_text(path) as file:
        first = file.readline()
    if not first.startswith(VERDICT_LINE):
        return {}
    return {"verdict": _checked(json.loads(first[first.index("{") :]))}


def _checked(verdict: dict[str, Any]) -> dict[str, Any]:
    """What a file says as its verdict, where it is one; else what `read_solution` refuses."""
    return Verdict.from_dict(verdict).as_dict()


def _quaternion(rph: Array) -> Array | None:
    """From roll, pitch, heading in degrees; None where none is known."""
    from scipy.spatial.transform import Rotation

    if not np.isfinite(rph).any():
        return None
    return Rotation.from_euler("ZYX", rph[:, ::-1], degrees=True).as_quat()[:, [3, 0, 1, 2]]


def _write_kml(solution: Solution, part: Path, path: Path) -> None:
    if not solution.has_position:
        filter = solution.meta.get("filter")
        raise DataError(
            f"{path}: the solution{f' of {filter}' if filter else ''} has no position, so there is "
            f"no track to write; use .nc or .csv"
        )
    part.write_bytes(kml(solution))
