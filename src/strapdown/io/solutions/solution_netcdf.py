"""Solutions as NetCDF with the CF conventions: the full content of a Solution, each variable with
its unit, and times as dates where the clock is absolute."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...checks import DataError
from ...core.loop.contract import BRIDGED, DOUBTFUL, INVALID, VALID
from ...data.solution import (
    BIAS_COLUMNS,
    NAV_COLUMNS,
    STD_COLUMNS,
    STD_SCALE,
    UNITS,
    Innovations,
    Separation,
    Solution,
    Trajectory,
)
from ...data.verdict import NOT_JUDGED
from ...fileio.checksum import DAMAGED
from ...fileio.files import netcdf
from ...typing import Array
from ..own.array_rules import Column, check_arrays
from ..own.hdf5_content import Content, OwnFormat, content_of

QUATERNION = ["q_w", "q_x", "q_y", "q_z"]
Variables: TypeAlias = dict[str, tuple[Sequence[str], Any, dict[str, Any]]]
"""{name: (dimensions, values, attributes)} of a group of a NetCDF file."""
FORMAT = OwnFormat(
    "solution",
    1,
    others="recordings are read with read",
    again="fuse the recording again, and write its solution with write_solution",
)
CONVENTIONS = "CF-1.11"
STANDARD_NAMES = {
    "lat": "latitude",
    "lon": "longitude",
    "alt": "height_above_reference_ellipsoid",
    "roll": "platform_roll_starboard_down",
    "pitch": "platform_pitch_fore_up",
    "heading": "platform_orientation",
}
"""Standard names of the CF conventions, for variables that have one."""
ERROR_STATES = (
    *(f"position {axis}" for axis in ("north", "east", "down")),
    *(f"velocity {axis}" for axis in ("north", "east", "down")),
    *(f"rotation about {axis}" for axis in ("north", "east", "down")),
    *(f"{sensor} bias {axis}" for sensor in ("accelerometer", "gyro") for axis in "xyz"),
)
"""Quantity of each column of standard deviations."""
LONG_NAMES = {
    **dict(zip(NAV_COLUMNS[:3], ("latitude", "longitude", "height above the WGS-84 ellipsoid"))),
    **dict(zip(NAV_COLUMNS[3:6], ERROR_STATES[3:6])),
    **dict(zip(NAV_COLUMNS[6:], ("roll", "pitch", "heading, clockwise from true north"))),
    **dict(zip(BIAS_COLUMNS, ERROR_STATES[9:])),
    **{name: f"standard deviation of {of}" for name, of in zip(STD_COLUMNS, ERROR_STATES)},
}
CLAIMS = {
    **dict(zip(NAV_COLUMNS[:6] + BIAS_COLUMNS, STD_COLUMNS[:6] + STD_COLUMNS[9:])),
    **dict.fromkeys(NAV_COLUMNS[6:], " ".join(STD_COLUMNS[6:9])),
}
"""{column: those of its standard deviation}."""
CF_UNITS = {"deg": "degree", "deg/h": "degree/hour", "deg/s": "degree/s"}
"""Names of units in UDUNITS, where they differ from ours."""
SINCE = re.compile("seconds since ")
"""Beginning of the unit of times that are dates."""
EXTRA = re.compile(r"extra_\d+", re.ASCII)
EXTRA_COLUMN = Column("time", missing=True, infinite=True)
PART_OF_Q = Column("time", "1", missing=True)
Q_COLUMN = Column("time quaternion", missing=True, unit_length=True)
LIMITS = {"lat": 90.0, "lon": 360.0, "roll": 180.0, "pitch": 90.0, "heading": 360.0}
"""deg: limits of the written angles, with a margin of the last digit."""


def _units(name: str) -> str:
    """The CF units of a column of the table."""
    unit = {"lat": "degrees_north", "lon": "degrees_east"}.get(name, UNITS[name])
    return CF_UNITS.get(unit, unit)


SCHEMA = {
    "time": Column("time", "s", rising=True),
    **{
        name: Column(
            "time",
            _units(name),
            missing=True,
            infinite=True,
            least=-LIMITS.get(name, np.inf) - 1e-6,
            most=LIMITS.get(name, np.inf) + 1e-6,
        )
        for name in NAV_COLUMNS + BIAS_COLUMNS
    },
    **{
        name: Column("time", _units(name), missing=True, infinite=True, least=0.0)
        for name in STD_COLUMNS
    },
    "status": Column("time", "1", least=VALID, most=DOUBTFUL, whole=True),
    "covariance": Column("time state state", missing=True, infinite=True, optional=True),
    **dict.fromkeys(
        ("separation", "separation_std"),
        Column("time part", missing=True, least=0.0, optional=True),
    ),
    "fix_time": Column("fix", "s", ordered=True),
    "fix_source": Column("fix", "1", least=0, whole=True),
    "innovation": Column("fix row", missing=True, infinite=True),
    "nis": Column("fix", "1", missing=True, infinite=True, least=0.0),
    "accepted": Column("fix", "1", least=0, most=1, whole=True),
}
"""Rules for the arrays of a solution."""


def write_netcdf(solution: Solution, part: Path) -> None:
    """Write a Solution to `part`."""
    variables = _variables(solution)
    names = [str(solution.meta[key]) for key in ("recording", "filter") if solution.meta.get(key)]
    with netcdf(
        part, sum(np.asarray(values).nbytes for _, values, _ in variables.values())
    ) as file:
        file.attrs.update(format=FORMAT.mark, Conventions=CONVENTIONS)
        file.attrs["title"] = " ".join(names) or "strapdown solution"
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


def _variables(solution: Solution) -> Variables:
    """Return the content of the file; texts are variables because attributes are limited to 64
    KiB."""
    fixes = solution.innovations
    texts = {
        "sources": fixes.names,
        "gates": fixes.gates,
        "events": solution.events,
        "meta": {name: value for name, value in solution.meta.items() if name != "verdict"},
    }
    if solution.verdict.word != NOT_JUDGED:
        texts["verdict"] = solution.verdict.as_dict()
    return arrays_of(solution) | {
        name: ((), json.dumps(plain(value)), {"long_name": f"{name} as JSON"})
        for name, value in texts.items()
    }


def arrays_of(solution: Solution) -> Variables:
    """Return the numbers in the file, of rows and of fixes."""
    fixes, columns, q_nb = solution.innovations, columns_of(solution), solution.trajectory.q_nb
    clock = _clock(solution)
    found: Variables = {
        "time": (
            ("time",),
            solution.t,
            {"long_name": "time of the recording", "axis": "T", **clock},
        )
    }
    found |= {
        name: (("time",), columns[name], attributes(name))
        for name in NAV_COLUMNS + BIAS_COLUMNS + STD_COLUMNS
    }
    if q_nb is not None:
        found |= {
            name: (("time",), q_nb[:, i], {"units": "1"}) for i, name in enumerate(QUATERNION)
        }
    meanings = {
        "units": "1",
        "flag_values": np.array([VALID, BRIDGED, INVALID, DOUBTFUL], solution.status.dtype),
        "flag_meanings": "valid bridged invalid doubtful",
    }
    found["status"] = (("time",), solution.status, meanings)
    found |= {
        f"extra_{i}": (("time",), values, {"long_name": name, **_unit_of(name)})
        for i, (name, values) in enumerate(solution.columns.items())
    }
    if solution.covariance is not None:
        found["covariance"] = (
            ("time", "state", "state_2"),
            solution.covariance,
            {"long_name": "covariance of the error states in order, m, m/s, rad, m/s^2, rad/s"},
        )
    if solution.separation is not None:
        apart = "of the filter from the smoother: position, velocity, attitude, m, m/s, rad"
        found |= {
            "separation": (("time", "part"), solution.separation.size, {"long_name": apart}),
            "separation_std": (
                ("time", "part"),
                solution.separation.std,
                {"long_name": "standard deviation of the separation"},
            ),
        }
    return found | {
        "fix_time": (("fix",), fixes.t, {"long_name": "time of the fix", **clock}),
        "fix_source": (("fix",), fixes.source, {"units": "1", "long_name": "index into `sources`"}),
        "innovation": (
            ("fix", "row"),
            fixes.innovation,
            {"long_name": "innovation, SI, as the source"},
        ),
        "nis": (("fix",), fixes.nis, {"units": "1", "long_name": "normalised innovation squared"}),
        "accepted": (("fix",), fixes.accepted.astype(np.int8), {"units": "1"}),
    }


def _clock(solution: Solution) -> dict[str, str]:
    """Return the attributes of times, which CF treats as dates where the clock is absolute.

    The calendar has no leap seconds. Those between the epoch and the first row are included in the
    reference time, so that dates are correct except for a leap second within the solution.
    """
    moments, t = solution.utc, solution.t
    known = np.flatnonzero(np.isfinite(t))
    if moments is None or not len(known):
        return {"units": "s"}
    zero = moments[known[0]] - np.round(t[known[0]] * 1e9).astype("m8[ns]")
    since = str((zero + np.timedelta64(500, "ns")).astype("M8[us]")).replace("T", " ")
    units = f"seconds since {since.removesuffix('.000000')}"
    return {"standard_name": "time", "units": units, "calendar": "standard"}


def attributes(name: str) -> dict[str, str]:
    """Return the CF attributes of a column of the table."""
    found = {"units": _units(name), "long_name": LONG_NAMES[name]}
    if name in STANDARD_NAMES:
        found["standard_name"] = STANDARD_NAMES[name]
    if name in CLAIMS:
        found["ancillary_variables"] = CLAIMS[name]
    return found


def _unit_of(name: str) -> dict[str, str]:
    """Return the unit in the brackets of a column's name."""
    found = re.search(r"\[([^\]]+)\]", name)
    return {"units": CF_UNITS.get(found[1], found[1])} if found else {}


def read_netcdf(path: Path) -> Solution:
    """Return the Solution in a file of `write_netcdf`, unchanged. Raises DataError."""
    found = content_of(path, FORMAT)
    texts = _texts(found, path)
    columns = found.variables
    units = {name: "s" if SINCE.match(unit) else unit for name, unit in found.units.items()}
    extra = {name: column for name, column in columns.items() if EXTRA.fullmatch(name)}
    schema = SCHEMA | dict.fromkeys(extra, EXTRA_COLUMN)
    has_attitude = not columns.keys().isdisjoint(QUATERNION)
    schema |= dict.fromkeys(QUATERNION if has_attitude else (), PART_OF_Q)
    check_arrays(columns, schema, path, {"row": 3, "part": 3}, units)

    def table(names: list[str]) -> Array:
        return np.column_stack([columns[name] for name in names])

    q_nb = table(QUATERNION) if has_attitude else None
    if q_nb is not None:
        check_arrays({"quaternion": q_nb}, {"quaternion": Q_COLUMN}, path)
    trajectory, b_a, b_g = state_of(columns["time"], table, q_nb)
    return Solution(
        trajectory,
        b_a,
        b_g,
        columns["status"],
        _innovations(found, texts, path),
        tuple((t, text) for t, text in texts["events"]),
        {found.names.get(name, name): column for name, column in extra.items()},
        columns.get("covariance"),
        texts["meta"] | ({"verdict": texts["verdict"]} if "verdict" in texts else {}),
        separation=_separation(columns, path),
    )


def _separation(columns: Mapping[str, Any], path: Path) -> Separation | None:
    """Return the separation. Raises DataError where the file has only half of it."""
    size, std = (columns.get(name) for name in ("separation", "separation_std"))
    if (size is None) != (std is None):
        raise DataError(f"{path}: separation and separation_std belong together; {DAMAGED}")
    return None if size is None or std is None else Separation(size, std)


def _texts(found: Content, path: Path) -> dict[str, Any]:
    """Return the content of the JSON variables, {name: value}. Raises DataError."""
    from ..own import text_rules as rules

    models = {
        "sources": rules.Sources,
        "gates": rules.Gates,
        "events": rules.Events,
        "meta": rules.SolutionMetaRules,
        "verdict": rules.VerdictRules,
    }
    return {
        name: rules.check_values(model, rules.from_json(found.texts.get(name), where), where)
        for name, model in models.items()
        for where in [f"{path}: {name}"]
        if name != "verdict" or name in found.texts
    }


def _innovations(found: Content, texts: Mapping[str, Any], path: Path) -> Innovations:
    """Return the innovations. Raises DataError where a fix belongs to no source."""
    names, source = tuple(texts["sources"]), found.variables["fix_source"]
    if len(texts["gates"]) not in (0, len(names)) or (len(source) and source.max() >= len(names)):
        raise DataError(
            f"{path}: there are {len(names)} sources and {len(texts['gates'])} gates, but a fix of "
            f"source {source.max(initial=0)}; {DAMAGED}"
        )
    return Innovations(
        found.variables["fix_time"],
        source,
        found.variables["innovation"],
        found.variables["nis"],
        found.variables["accepted"].astype(bool),
        names,
        tuple(texts["gates"]),
    )


def plain(value: Any) -> Any:
    """Convert `value` (as in `Solution.meta`) to the types of JSON: named tuples and data classes
    become objects, other types their text."""
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


# ---- the table of a solution


def columns_of(solution: Solution) -> dict[str, Any]:
    """Return the columns of a solution's table by name, (n,) each, NaN where its trajectory does
    not have them; without pandas, which takes 0.3 s to load."""
    known, none = solution.as_columns(), np.full(len(solution.t), np.nan)
    names = [*NAV_COLUMNS, *BIAS_COLUMNS, *STD_COLUMNS, *solution.columns, "status"]
    return {name: known.get(name, none) for name in names}


def state_of(
    t: Array, table: Callable[[list[str]], Array], q_nb: Array | None
) -> tuple[Trajectory, Array, Array]:
    """Return trajectory, b_a and b_g in SI from `table(names)` in the units of `UNITS`."""
    lla = table(NAV_COLUMNS[:3]) * [np.pi / 180, np.pi / 180, 1]
    b_a, b_g = np.hsplit(table(BIAS_COLUMNS) / STD_SCALE[9:], 2)
    return (
        Trajectory(t, lla, table(NAV_COLUMNS[3:6]), q_nb, table(STD_COLUMNS) / STD_SCALE),
        b_a,
        b_g,
    )
