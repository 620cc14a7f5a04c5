"""Chunk files of a campaign: what they hold, writing and reading them."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import DataError
from ...fileio.checksum import DAMAGED
from ...io.own.array_rules import Column, check_arrays
from ...io.own.hdf5_content import content
from .chunks import SCALARS, Arrays
from .scoring import ERROR_GROUPS, ERROR_STATE_NAMES, PARAMETER_SCALARS, RUN_REASONS

RUNS = re.compile(r"(\d{6,9})-(\d{6,9})\.nc", re.ASCII)
"""Name of a chunk file: its first run, and that after its last."""


def _number(axes: str, least: float = 0.0, optional: bool = False) -> Column:
    """Return a Column of numbers that are not negative, NaN where a run has none, inf where it
    diverged."""
    return Column(axes, least=least, missing=True, infinite=True, optional=optional)


COLUMNS = {
    "t": Column("t", rising=True),
    "error": _number("filter run t state", -np.inf),
    "std": _number("filter run t state"),
    "nees_rows": _number("filter run t"),
    "bias": _number("run t bias_axis", -np.inf),
    "squares": _number("filter t state"),
    "variances": _number("filter t state"),
    "nees_sum": _number("filter t"),
    "alive": Column("filter t", least=0.0, whole=True),
    "bound": _number("t state", optional=True),  # in the file of the first run
    "mean_square": _number("filter run group"),
    "coverage": _number("filter run sigma"),
    **dict.fromkeys(SCALARS, _number("filter run")),
    "correlation": _number("filter run", -np.inf),
    "reason": Column("filter run", least=0.0, most=len(RUN_REASONS) - 1, whole=True),
    # of a study with a wrong installation
    **dict.fromkeys(PARAMETER_SCALARS, _number("filter run", -np.inf, optional=True)),
    "parameter_error": _number("filter run parameter", -np.inf, optional=True),
    "parameter_std": _number("filter run parameter", optional=True),
}
"""The numbers of a chunk file, by name. Their axes are its dimensions."""
LABELS = "parameter"
"""Names of the parameters of a wrong installation."""
OF_INSTALLATION = (*PARAMETER_SCALARS, "parameter_error", "parameter_std")
"""Those of a study with a wrong installation."""
ABOUT = {
    "t": "s",
    "error": "true - estimate, m, m/s, rad, m/s^2, rad/s",
    "std": "as the filter states it, units of error",
    "bias": "true biases, m/s^2, rad/s",
    "bound": "variances of the Cramer-Rao bound, units of error squared",
    "nees_rows": "of 15 states",
    "parameter_error": "true - estimate at the end, in the units of the names",
    "parameter_std": "as the filter states it at the end; NaN of what is no state",
    "lasted": "s",
    "left_model": "s",
    "censored": "mean squared position error, m^2",
    "mean_square": "until the abort, SI and radians squared",
    "reason": "0 survived, 1 lost, 2 inconsistent, 3 quarantined",
}


def labels_of(
    filters: Sequence[str], runs: Sequence[int] | Any, t: Any, parameters: Sequence[str] | Any
) -> dict[str, Any]:
    """Return {dimension: labels}."""
    labels: dict[str, Any] = {
        "filter": list(filters),
        "run": np.array(runs),
        "state": list(ERROR_STATE_NAMES),
        "group": list(ERROR_GROUPS),
        "sigma": np.array([1, 2, 3]),
        "bias_axis": list(ERROR_STATE_NAMES[9:]),
        "t": t,
    }
    return labels | ({LABELS: list(map(str, parameters))} if len(parameters) else {})


def fill(file: Any, arrays: Arrays, filters: Sequence[str], runs: range) -> None:
    """Write a chunk into an h5netcdf file, with a checksum for each array, so that arrays can be
    read separately."""
    import h5py

    labels = labels_of(filters, runs, arrays["t"], arrays.get(LABELS, ()))
    file.dimensions = {name: len(values) for name, values in labels.items()}
    dimensions = {name: (name,) for name in labels} | {
        name: tuple(column.axes.split()) for name, column in COLUMNS.items()
    }
    for name, values in (arrays | labels).items():
        if name == "kept":
            continue
        text = isinstance(values, list)
        made = file.create_variable(
            name,
            dimensions[name],
            h5py.string_dtype() if text else values.dtype,
            data=np.array(values, object) if text else values,
            **({} if text else {"chunks": values.shape, "fletcher32": True}),
        )
        if name in ABOUT:
            made.attrs["long_name"] = ABOUT[name]


def read(
    path: Path,
    names: Collection[str],
    manifest: Mapping[str, Any],
    identity: str,
    known: Mapping[str, int],
    whole: bool,
) -> Arrays:
    """Return {name: array} of "t" and those of `names` in a chunk file. It must be the file of
    `identity` and agree with its format and the manifest. Raises DataError.

    known: further lengths of dimensions; whole: its checksum was already verified.
    """
    try:
        if manifest.get("installation"):
            names = {*names, LABELS}
        found = content(path, "chunk of a study", {*names, "t"}, whole)
        if str(found.attributes.get("identity")) != identity:
            raise DataError(
                f"{path}: it is the file of another study, cell or chunk, or manifest.json was changed"
            )
        arrays = found.variables
        schema = {
            name: _required_column(name, manifest) for name in ("t", *names) if name in COLUMNS
        }
        sizes = _sizes(path, manifest) | _label_sizes(path, names, arrays)
        check_arrays(arrays, schema, path, {**known, **sizes})
    except DataError as error:
        said = str(error).removeprefix(f"{path}: ").removesuffix(f"; {DAMAGED}")
        raise DataError(
            f"{path}: cannot be read ({said}); remove it and run the study again"
        ) from None
    return arrays


def _required_column(name: str, manifest: Mapping[str, Any]) -> Column:
    """The Column of an array that must be there."""
    column = COLUMNS[name]
    return column._replace(
        optional=column.optional and not (name in OF_INSTALLATION and manifest.get("installation"))
    )


def _label_sizes(path: Path, names: Collection[str], arrays: Arrays) -> dict[str, int]:
    """{"parameter": how many it names} where that is wanted. Raises DataError."""
    if LABELS not in names:
        return {}
    labels = arrays.get(LABELS)
    if labels is None or labels.ndim != 1 or labels.dtype.kind != "O":
        raise DataError(f"{path}: {LABELS} is not a list of names; {DAMAGED}")
    return {LABELS: len(labels)}


def _sizes(path: Path, manifest: Mapping[str, Any]) -> dict[str, int]:
    """{dimension: length}, as far as the manifest and the name of the file say it."""
    runs = RUNS.fullmatch(path.name)
    if not runs or not int(runs[1]) < int(runs[2]) <= manifest["runs"]:
        raise DataError(f"{path}: its name is not that of runs of the study")
    return {
        "filter": len(manifest["filters"]),
        "run": int(runs[2]) - int(runs[1]),
        "state": len(ERROR_STATE_NAMES),
        "group": len(ERROR_GROUPS),
        "sigma": 3,
        "bias_axis": 6,
    }
