"""A campaign: the folder of a study, with its manifest, one file per finished chunk, and the tables
made of them.

`manifest.json` says what is run and with which version; `chunks/CELL/FIRST-STOP.nc` are written
whole or not at all; `summary.csv` and `runs.csv` are made from the chunk files alone, in their
order. Arrays stay in the files and open lazily.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tempfile
import weakref
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import __version__
from ...checks import DataError
from ...core.kernel_cache import closure_digest
from ...file_locks import lock
from ...files import netcdf, replacing, together
from ...plugins import Plugin
from ...typing import File
from .chunks import SCALARS, Arrays, Chunk, plugins_of, run_chunk
from .scoring import ERROR_GROUPS, ERROR_STATE_NAMES, PARAMETER_SCALARS
from .summaries import run_rows, summary_row

if TYPE_CHECKING:
    import xarray

    from .study import Study

CAMPAIGN_FORMAT = 1
"""Of manifest and chunk files."""
CHUNK_DIMENSIONS = {
    "error": ("filter", "run", "t", "state"),
    "sd": ("filter", "run", "t", "state"),
    "nees_rows": ("filter", "run", "t"),
    "bias": ("run", "t", "bias_axis"),
    "squares": ("filter", "t", "state"),
    "variances": ("filter", "t", "state"),
    "nees_sum": ("filter", "t"),
    "alive": ("filter", "t"),
    "bound": ("t", "state"),
    "mean_square": ("filter", "run", "group"),
    "coverage": ("filter", "run", "sigma"),
    "parameter_error": ("filter", "run", "parameter"),
    "parameter_sd": ("filter", "run", "parameter"),
    **dict.fromkeys((*SCALARS, *PARAMETER_SCALARS), ("filter", "run")),
}
ABOUT = {
    "t": "s",
    "error": "true - estimate, m, m/s, rad, m/s^2, rad/s",
    "sd": "as the filter states it, units of error",
    "bias": "true biases, m/s^2, rad/s",
    "bound": "variances of the Cramer-Rao bound, units of error squared",
    "nees_rows": "of 15 states",
    "parameter_error": "true - estimate at the end, in the units of the names",
    "parameter_sd": "as the filter states it at the end; NaN of what is no state",
    "lasted": "s",
    "left_model": "s",
    "censored": "mean squared position error, m^2",
    "mean_square": "until the abort, SI and radians squared",
    "reason": "0 survived, 1 lost, 2 inconsistent, 3 quarantined",
}
SOURCES = (
    "core",
    "aiding",
    "filters",
    "sim",
    "sensor_models",
    "engine",
    "evaluation",
    "experiments/filter_label.py",
    "estimable.py",
    "geodesy.py",
    "experiments/monte_carlo/chunks.py",
    "experiments/monte_carlo/study.py",
    "experiments/monte_carlo/scoring.py",
    "experiments/monte_carlo/wrong_installation.py",
)
"""What can change a result."""


class Campaign:
    """A study in its folder. `Study.run` makes one, `Campaign.open` finds a finished one again."""

    _remover: object  # weakref.finalize of a temporary folder: it goes with the campaign

    def __init__(self, folder: File, manifest: dict[str, Any], study: Study | None = None) -> None:
        self.folder, self.manifest, self.study = Path(folder), manifest, study

    @classmethod
    def begin(cls, study: Study, out: File | None = None) -> Campaign:
        """The campaign of `study` in folder `out`, new or to be resumed. Raises DataError where
        the folder holds another one."""
        manifest = describe(study)
        if out is None:
            folder = tempfile.mkdtemp(prefix="strapdown-study-")
            campaign = cls(folder, manifest, study)
            campaign._remover = weakref.finalize(campaign, _remove, folder)
        else:
            campaign = cls(out, manifest, study)
        make_folder(campaign.folder)
        with campaign.locked():
            campaign._settle()
        return campaign

    def _settle(self) -> None:
        """Write the manifest, or compare with the one that is there; one that has no chunks yet
        binds nobody. The folder must be locked."""
        path, chunks = self.folder / "manifest.json", any(self.folder.glob("chunks/*/*.nc"))
        if chunks and not path.exists():
            raise DataError(
                f"{self.folder}: it holds chunks of a study but no manifest.json; choose another "
                f"folder"
            )
        if chunks:
            _same(_manifest(self.folder), self.manifest, self.folder)
        else:
            with replacing(path) as part:
                part.write_text(json.dumps(self.manifest, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def open(cls, folder: File) -> Campaign:
        """A campaign that some run has left in `folder`, to read. Raises DataError."""
        return cls(folder, _manifest(Path(folder)))

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder: a second process that wants to write there is refused."""
        try:
            held = open(self.folder / "lock", "wb")
        except OSError as error:
            raise DataError(
                f"{self.folder}: nothing can be written there ({error.strerror}); choose another "
                f"folder"
            ) from None
        with held:
            try:
                lock(held)
            except OSError:
                raise DataError(
                    f"{self.folder}: another process works on this campaign; wait for it, or choose "
                    f"another folder"
                ) from None
            yield

    def check(self) -> None:
        """Raise DataError where another study has taken the folder since."""
        _same(_manifest(self.folder), self.manifest, self.folder)

    def path(self, chunk: Chunk) -> Path:
        """The file of a chunk."""
        return (
            self.folder
            / "chunks"
            / self.cells[chunk.cell]
            / f"{chunk.first:06d}-{chunk.stop:06d}.nc"
        )

    @property
    def cells(self) -> list[str]:
        """Names of the cells, SCENARIO--IMU."""
        return [cell["name"] for cell in self.manifest["cells"]]

    def missing(self) -> list[Chunk]:
        """Chunks without a file."""
        assert self.study is not None  # one that was opened to be read asks for none
        return [chunk for chunk in self.study.chunks() if not self.path(chunk).exists()]

    def work(self, chunk: Chunk, skip: Collection[int] = ()) -> Chunk:
        """Run a chunk and write its file."""
        assert self.study is not None  # one that was opened to be read has no work
        arrays = run_chunk(self.study, chunk, skip)
        path = self.path(chunk)
        make_folder(path.parent)
        runs, size = range(chunk.first, chunk.stop), sum(each.nbytes for each in arrays.values())
        with replacing(path) as part, netcdf(part, size) as file:
            _fill(file, arrays, self.manifest["filters"], runs)
            file.attrs["format"], file.attrs["identity"] = CAMPAIGN_FORMAT, self._identity(path)
        return chunk

    def _identity(self, path: Path) -> str:
        """What only the file at `path` of this campaign says: a digest of the manifest, the cell
        and the runs."""
        text = json.dumps(self.manifest, sort_keys=True) + f"{path.parent.name}/{path.name}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def finish(self) -> None:
        """Write summary.csv and runs.csv."""
        with together():
            for name, table in (("summary", self.summary), ("runs", self.runs)):
                with replacing(self.folder / f"{name}.csv") as part:
                    table.to_csv(part, index=False, float_format="%.9g")

    def _files(self, cell: str) -> list[Path]:
        files = sorted((self.folder / "chunks" / cell).glob("*.nc"))
        if not files:
            raise DataError(
                f"{self.folder}: no finished runs of {cell!r}; it has {', '.join(self.cells)}"
            )
        return files

    def read(self, cell: str, names: Iterable[str]) -> list[Arrays]:
        """[{name: array}] of the chunk files of a cell, in the order of the runs; names that a
        file has not are left out."""
        import h5py

        found = []
        for path in self._files(cell):
            try:
                with h5py.File(
                    path, "r"
                ) as file:  # a tenth of the time that its NetCDF dress takes
                    if file.attrs.get("identity") != self._identity(path):
                        raise OSError("it is the file of another study, cell or chunk")
                    found.append({name: file[name][...] for name in names if name in file})
            except (OSError, KeyError, RuntimeError) as error:
                raise DataError(
                    f"{path}: cannot be read ({str(error).splitlines()[0]}); remove it and run the "
                    f"study again"
                ) from None
        return found

    def numbers(self, cell: str) -> Arrays:
        """{name: array (filter, run, ...)} of every run of a cell: SCALARS, "mean_square"
        (ERROR_GROUPS) and "coverage" (1, 2, 3 sigma); of a wrong installation PARAMETER_SCALARS,
        "parameter_error" and "parameter_sd" (`parameters`)."""
        more = (*PARAMETER_SCALARS, "parameter_error", "parameter_sd")
        parts = self.read(cell, (*SCALARS, "mean_square", "coverage", *more))
        return {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}

    def parameters(self, cell: str) -> list[str]:
        """The parameters of the installation that were drawn wrong, with their units."""
        found = self.read(cell, ("parameter",))[0].get("parameter", ())
        return [name.decode() for name in found]

    def curves(self, cell: str) -> Arrays:
        """{name: array} over the stored epochs of a cell, from sums over the runs that were
        alive: "t" s, and per filter "rmse" and "sd" (the root of the mean stated variance)
        (filter, epoch, state), "nees" (mean / 15), "alive" (filter, epoch); "bound" (epoch,
        state), the Cramer-Rao standard deviation."""
        parts = self.read(cell, ("t", "squares", "variances", "nees_sum", "alive", "bound"))

        def total(name: str) -> NDArray[Any]:
            first = parts[0][name]
            return sum(part[name] for part in parts[1:]) + first if len(parts) > 1 else first

        alive = total("alive")
        with np.errstate(all="ignore"):
            return {
                "t": parts[0]["t"],
                "rmse": np.sqrt(total("squares") / alive[..., None]),
                "sd": np.sqrt(total("variances") / alive[..., None]),
                "nees": total("nees_sum") / alive / len(ERROR_STATE_NAMES),
                "alive": alive,
                "bound": np.sqrt(parts[0]["bound"]),
            }

    def arrays(self, cell: str) -> xarray.Dataset:
        """The stored rows of a cell as a labelled xarray Dataset (filter, run, t, state) that
        stays in the chunk files until it is used."""
        try:
            import xarray

            return xarray.open_mfdataset(
                self._files(cell),
                combine="nested",
                concat_dim="run",
                data_vars="minimal",
                coords="minimal",
                compat="override",
                engine="h5netcdf",
                drop_variables=("squares", "variances", "nees_sum", "alive"),
            )
        except (ImportError, ValueError) as error:
            if not re.search("xarray|dask", str(error)):
                raise
            raise DataError(
                "labelled arrays need xarray and dask: pip install 'strapdown[study]'"
            ) from None

    @cached_property
    def summary(self) -> pd.DataFrame:
        """pandas DataFrame with a row per cell and filter; see `summaries.summary_row` for its
        columns."""
        return pd.DataFrame(
            [
                summary_row(self, number, place)
                for number in range(len(self.cells))
                for place in range(len(self.manifest["filters"]))
            ]
        )

    @cached_property
    def runs(self) -> pd.DataFrame:
        """pandas DataFrame with a row per cell, filter and run."""
        return pd.concat(
            [run_rows(self, number) for number in range(len(self.cells))], ignore_index=True
        )

    def __reduce__(self) -> tuple[type[Campaign], tuple[Path, dict[str, Any], Study | None]]:
        return Campaign, (self.folder, self.manifest, self.study)

    def __repr__(self) -> str:
        return f"Campaign({self.folder}: {len(self.cells)} cells, {len(self.manifest['filters'])} filters, {self.manifest['runs']} runs)"


def describe(study: Study) -> dict[str, Any]:
    """The manifest of a study: all that its results depend on."""
    cells = [
        {"name": cell.name, "scenario": cell.scenario.describe(), "imu": asdict(cell.imu)}
        for cell in study.cells
    ]
    manifest = {
        "format": CAMPAIGN_FORMAT,
        "versions": {"strapdown": __version__, "sources": _sources(), "numpy": np.__version__},
        "seed": int(study.seed),
        "runs": int(study.runs),
        "filters": list(study.filters),
        "epoch_s": float(study.epoch),
        "keep": int(study.keep),
        "limits": study.limits._asdict(),
        "installation": dict(study.installation),
        "chunk_steps": int(study.chunk_steps),
        "cells": cells,
    }
    if brought := plugins_of(study):
        manifest["plugins"] = sorted([plugin.name, _digest(plugin)] for plugin in brought)
    return json.loads(json.dumps(manifest, default=float))


def _digest(plugin: Plugin) -> str:
    """A short digest of the code of a plugin. Raises DataError."""
    try:
        return closure_digest(plugin.module)[:12] if plugin.where else plugin.module
    except OSError as error:
        raise DataError(
            f"plugin {plugin.name}: its file cannot be read any more ({error.strerror}); put it back"
        ) from None


def _sources() -> str:
    """A short digest of the code that can change a result."""
    package, digest = Path(__file__).parents[2], hashlib.sha256()
    for name in SOURCES:
        for file in (
            sorted((package / name).rglob("*.py"))
            if (package / name).is_dir()
            else [package / name]
        ):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        number = manifest["format"]
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read ({error.strerror}); is this the folder of a study?"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise DataError(f"{path}: not the manifest of a study; choose another folder") from None
    if number != CAMPAIGN_FORMAT:
        raise DataError(
            f"{path}: format {number!r}, this version reads {CAMPAIGN_FORMAT}; use the version of "
            f"strapdown that wrote it, or another folder"
        )
    return manifest


def _same(found: dict[str, Any], wanted: dict[str, Any], folder: Path) -> None:
    """Raise DataError naming the first difference of two manifests."""
    if found == wanted:
        return
    if found["versions"] != wanted["versions"]:

        def text(versions: dict[str, str]) -> str:
            return ", ".join(f"{key} {value}" for key, value in versions.items())

        raise DataError(
            f"{folder}: this campaign was begun with {text(found['versions'])}; this is "
            f"{text(wanted['versions'])}, whose results must not "
            f"be mixed with it; finish it with that version, or choose another folder"
        )
    key = next(key for key in wanted if found.get(key) != wanted[key])
    if key == "cells":
        before, after = found[key], wanted[key]
        changed = [b["name"] for a, b in zip(before, after) if a != b] or [
            cell["name"]
            for cell in (before if len(before) > len(after) else after)[
                min(len(before), len(after)) :
            ]
        ]
        raise DataError(
            f"{folder}: it holds another study: cell {changed[0]!r} differs; choose another folder"
        )
    raise DataError(
        f"{folder}: it holds another study: {key} is {found.get(key)!r} there and {wanted[key]!r} "
        f"here; choose another folder"
    )


def make_folder(folder: Path) -> None:
    """Make a folder with those above it. Raises DataError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(
            f"{folder}: cannot be made ({error.strerror}); choose another folder"
        ) from None


def _remove(folder: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def _fill(file: Any, arrays: Arrays, filters: Sequence[str], runs: range) -> None:
    """Write a chunk into an h5netcdf file, with checksums."""
    import h5py

    labels: dict[str, Any] = {
        "filter": list(filters),
        "run": np.array(runs),
        "state": list(ERROR_STATE_NAMES),
        "group": list(ERROR_GROUPS),
        "sigma": np.array([1, 2, 3]),
        "bias_axis": list(ERROR_STATE_NAMES[9:]),
        "t": arrays["t"],
    }
    if "parameter" in arrays:
        labels["parameter"] = arrays["parameter"].tolist()
    file.dimensions = {name: len(values) for name, values in labels.items()}
    dimensions = {name: (name,) for name in labels} | CHUNK_DIMENSIONS
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
