"""A campaign: the folder of a study, with its manifest, one file per finished chunk, and the tables
made of them.

`manifest.json` has the definition of the runs and the version; each `chunks/CELL/FIRST-STOP.nc` is
complete or not written; `summary.csv` and `runs.csv` are made only from the chunk files, in order.
Arrays stay in the files and open lazily.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
import weakref
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ... import __version__
from ...checks import DataError, brief
from ...core.compile.closure_values import NoWords
from ...core.compile.jit import COMPILED, Kernel
from ...core.compile.kernel_cache import closure_digest, code_digest
from ...core.compile.library import processor
from ...data.value import read_only
from ...extras import optional_import
from ...fileio.file_access import json_of, settings_text
from ...fileio.files import make_folder, netcdf, replacing, together, write_table
from ...fileio.limits import LimitError, regular
from ...fileio.locks import lock
from ...io.own.hdf5_content import content
from ...plugins import Plugin
from ...typing import File
from . import processors, sources
from .chunk_files import LABELS, OF_INSTALLATION, fill, read
from .chunks import SCALARS, Arrays, Chunk, plugins_of, run_chunk
from .scoring import ERROR_STATE_NAMES
from .summaries import run_rows, summary_row

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import xarray

    from ...pages.shell import Page
    from .study import Study

Made = TypeVar("Made")
CAMPAIGN_FORMAT = 1
"""Version of the format of manifest and chunk files."""
SHOWN = {
    **{name: name for name in ("scenario", "imu", "filter", "runs", "survived")},
    "rmse_position_m": "RMSE position [m]",
    "within_3_sigma": "within 3σ",
    "anees": "NEES / state",
}
"""{column of the summary that a notebook shows: its heading}."""


class Campaign:
    """A study in its folder. `Study.run` makes one, `Campaign.open` finds a finished one again."""

    _remover: object  # weakref.finalize of a temporary folder: it goes with the campaign

    def __init__(self, folder: File, manifest: dict[str, Any], study: Study | None = None) -> None:
        self.folder, self.manifest, self.study = Path(folder), dict(manifest), study
        self.processors: dict[str, str] = self.manifest.pop("processors", {})
        """Processors that made the chunks, and their agreement, after the end; see `processors`."""
        self._whole: set[Path] = set()  # chunk files with a verified checksum
        self._kept: dict[str, tuple[Any, Any]] = {}  # see _made_once

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
        with campaign.lock():
            campaign._settle()
        return campaign

    def _settle(self) -> None:
        """Write the manifest, or compare it with an existing one; a manifest without chunks may be
        replaced. The folder must be locked."""
        path, chunks = self.folder / "manifest.json", any(self.folder.glob("chunks/*/*.nc"))
        if chunks and not path.exists():
            raise DataError(
                f"{self.folder}: it holds chunks of a study but no manifest.json; choose another "
                f"folder"
            )
        if chunks:
            _same(_study_of(_manifest(self.folder)), self.manifest, self.folder)
        else:
            self._write_manifest()

    def _write_manifest(self) -> None:
        said = self.manifest | ({"processors": self.processors} if self.processors else {})
        with replacing(self.folder / "manifest.json") as part:
            part.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def open(cls, folder: File) -> Campaign:
        """Open the campaign in `folder` for reading. Raises DataError."""
        return cls(folder, _manifest(Path(folder)))

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Lock the folder: a second process that wants to write there is refused."""
        try:
            held = open(self.folder / "lock", "wb")
        except OSError as error:
            raise DataError(
                f"{self.folder}: is not writable ({error.strerror}); choose another folder"
            ) from None
        with held:
            try:
                lock(held)
            except OSError:
                raise DataError(
                    f"{self.folder}: another process is running this campaign; wait for it, or choose "
                    f"another folder"
                ) from None
            yield

    def check(self) -> None:
        """Raise DataError where another study has taken the folder since."""
        _same(_study_of(_manifest(self.folder)), self.manifest, self.folder)

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

    def missing_chunks(self) -> list[Chunk]:
        """Chunks without a file."""
        assert self.study is not None  # not called for a campaign opened for reading
        return [chunk for chunk in self.study.chunks() if not self.path(chunk).exists()]

    def work(self, chunk: Chunk, skip: Collection[int] = ()) -> Chunk:
        """Run a chunk and write its file."""
        assert self.study is not None  # a campaign opened for reading has no work
        arrays = run_chunk(self.study, chunk, skip)
        path = self.path(chunk)
        make_folder(path.parent)
        runs, size = range(chunk.first, chunk.stop), sum(each.nbytes for each in arrays.values())
        with replacing(path) as part, netcdf(part, size) as file:
            fill(file, arrays, self.manifest["filters"], runs)
            file.attrs["format"], file.attrs["identity"] = CAMPAIGN_FORMAT, self._identity(path)
            file.attrs["processor"] = processor()
        return chunk

    def made_by(self, path: Path) -> str:
        """The processor that made a chunk file."""
        return str(content(path, "chunk of a study", (), True).attributes.get("processor", ""))

    def chunk(self, chunk: Chunk, names: Collection[str]) -> Arrays:
        """Arrays of one chunk, as `read` has those of a cell."""
        path = self.path(chunk)
        return read(path, names, self.manifest, self._identity(path), {}, path in self._whole)

    def _identity(self, path: Path) -> str:
        """Return the identity of the file at `path` in this campaign: a digest of the manifest, the
        cell and the runs."""
        text = json.dumps(self.manifest, sort_keys=True) + f"{path.parent.name}/{path.name}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def finish(self) -> None:
        """Write summary.csv and runs.csv, and into the manifest which processors have worked."""
        self.processors = processors.compare_processors(self)
        self._write_manifest()
        with together():
            for name, table in (("summary", self.summary), ("runs", self.runs)):
                write_table(table, self.folder / f"{name}.csv", 9)

    def _files(self, cell: str) -> list[Path]:
        files = sorted((self.folder / "chunks" / cell).glob("*.nc"))
        if not files:
            raise DataError(
                f"{self.folder}: no finished runs of {cell!r}; it has {', '.join(self.cells)}"
            )
        return files

    def read(self, cell: str, names: Collection[str]) -> list[Arrays]:
        """[{name: array}] of the chunk files of a cell, in the order of the runs; names that a
        file has not are left out."""
        found: list[Arrays] = []
        known: dict[str, int] = {}  # number of epochs, equal in all files of a cell
        for path in self._files(cell):
            arrays = read(
                path, names, self.manifest, self._identity(path), known, path in self._whole
            )
            self._whole.add(path)
            known |= {name: len(arrays[name]) for name in ("t", LABELS) if name in arrays}
            found.append({name: arrays[name] for name in names if name in arrays})
        return found

    def _last_of(self, what: str, cell: str, make: Callable[[], Arrays]) -> Arrays:
        """Return the result of `make` for a cell, cached until another cell is requested or a file
        has changed, because tables request it once for each filter."""

        def build() -> Arrays:
            return {name: read_only(values) for name, values in make().items()}

        return dict(self._made_once(what, [cell], build))

    def _made_once(self, what: str, cells: Sequence[str], make: Callable[[], Made]) -> Made:
        """Return the result of `make`, computed again for other cells than the last ones or after a
        change of their files."""
        stats = [path.stat() for cell in cells for path in self._files(cell)]
        key = (*cells, *((stat.st_ino, stat.st_mtime_ns, stat.st_size) for stat in stats))
        if self._kept.get(what, (None, None))[0] != key:
            self._kept[what] = key, make()
        kept: Made = self._kept[what][1]
        return kept

    def numbers(self, cell: str) -> Arrays:
        """{name: array (filter, run, ...)} of every run of a cell: SCALARS, "mean_square"
        (ERROR_GROUPS) and "coverage" (1, 2, 3 sigma); of a wrong installation PARAMETER_SCALARS,
        "parameter_error" and "parameter_std" (`parameters`)."""

        def build() -> Arrays:
            more = OF_INSTALLATION if self.manifest.get("installation") else ()
            parts = self.read(cell, (*SCALARS, "mean_square", "coverage", *more))
            return {
                name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]
            }

        return self._last_of("numbers", cell, build)

    def parameters(self, cell: str) -> list[str]:
        """The parameters of the installation that were drawn wrong, with their units."""
        if not self.manifest.get("installation"):
            return []
        return list(map(str, self.read(cell, (LABELS,))[0][LABELS]))

    def curves(self, cell: str) -> Arrays:
        """{name: array} over the stored epochs of a cell, from sums over the runs that were
        alive: "t" s, and per filter "rmse" and "std" (the root of the mean stated variance)
        (filter, epoch, state), "nees" (mean / 15), "alive" (filter, epoch); "bound" (epoch,
        state), the Cramer-Rao standard deviation."""
        return self._last_of("curves", cell, lambda: self._curves(cell))

    def _curves(self, cell: str) -> Arrays:
        parts = self.read(cell, ("t", "squares", "variances", "nees_sum", "alive", "bound"))

        def total(name: str) -> NDArray[Any]:
            first = parts[0][name]
            return sum(part[name] for part in parts[1:]) + first if len(parts) > 1 else first

        alive = total("alive")
        with np.errstate(all="ignore"):
            return {
                "t": parts[0]["t"],
                "rmse": np.sqrt(total("squares") / alive[..., None]),
                "std": np.sqrt(total("variances") / alive[..., None]),
                "nees": total("nees_sum") / alive / len(ERROR_STATE_NAMES),
                "alive": alive,
                "bound": np.sqrt(parts[0].get("bound", np.full_like(alive[0], np.nan))),
            }

    def arrays(self, cell: str) -> xarray.Dataset:
        """The stored rows of a cell as a labelled xarray Dataset (filter, run, t, state) that
        stays in the chunk files until it is used."""
        self.read(cell, ("t",))  # checks that the files are complete and of this study
        with optional_import("an array of a study"):
            from .labelled import labelled_dataset

        def load(path: Path, names: Collection[str]) -> Arrays:
            return read(path, names, self.manifest, self._identity(path), {}, True)

        filters = self.manifest["filters"]
        return labelled_dataset(self._files(cell), load, filters, self.parameters(cell))

    @property
    def summary(self) -> pd.DataFrame:
        """pandas DataFrame with a row per cell and filter; see `summaries.summary_row` for its
        columns."""

        def build() -> pd.DataFrame:
            return pd.DataFrame(
                [
                    summary_row(self, number, place)
                    for number in range(len(self.cells))
                    for place in range(len(self.manifest["filters"]))
                ]
            )

        return self._made_once("summary", self.cells, build).copy()

    @property
    def runs(self) -> pd.DataFrame:
        """pandas DataFrame with a row per cell, filter and run."""

        def build() -> pd.DataFrame:
            cells = [run_rows(self, number) for number in range(len(self.cells))]
            return pd.concat(cells, ignore_index=True)

        return self._made_once("runs", self.cells, build).copy()

    def plot(self, what: str = "position", cell: str | None = None) -> go.Figure:
        """Return a figure over time as a plotly Figure, which can be changed.

        Parameters
        ----------
        what : {"position", "velocity", "attitude", "heading", "nees", "survival"}
            RMSE of the runs that are alive with the standard deviation that each filter states
            (dashed) and the Cramer-Rao bound; NEES per state with the band of a consistent filter;
            or the share of runs alive.
        cell : str, optional
            One of `cells`; by default the first.

        Raises
        ------
        DataError
            Where there is no such figure or cell, or no finished run of it.
        """
        from .figures import figure_of_name

        return figure_of_name(self, what, cell)

    def page(self) -> Page:
        """Return the page of the study: which filter errs least, figures over time, the table.

        Raises
        ------
        DataError
            Where it has no finished run.
        """
        from .page import page

        return page(self)

    def __reduce__(self) -> tuple[type[Campaign], tuple[Path, dict[str, Any], Study | None]]:
        return Campaign, (self.folder, self.manifest, self.study)

    def _repr_html_(self) -> str:
        from ...pages.notebook.cards import card, frame, lines

        facts = {"runs": self.manifest["runs"], "seed": self.manifest["seed"], "in": self.folder}
        try:
            shown = frame(self.summary[[*SHOWN]].rename(columns=SHOWN))
        except DataError as error:  # it was not run to its end
            shown = lines([error])
        return card("Study", facts, shown)

    def __repr__(self) -> str:
        return f"Campaign({self.folder}: {len(self.cells)} cells, {len(self.manifest['filters'])} filters, {self.manifest['runs']} runs)"


def describe(study: Study) -> dict[str, Any]:
    """Return the manifest of a study: everything that determines its results."""
    cells = [
        {"name": cell.name, "scenario": cell.scenario.describe(), "imu": asdict(cell.imu)}
        for cell in study.cells
    ]
    manifest = {
        "format": CAMPAIGN_FORMAT,
        "versions": {"strapdown": __version__} | sources.versions(),
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
    """A short digest of the code of a plugin and of the values that its kernels close over. Raises
    DataError."""
    if not plugin.where:
        return plugin.module
    parts = (part for each in plugin.values if isinstance(each, tuple) for part in each)
    kernels = {part for part in parts if isinstance(part, Kernel)} if COMPILED else set()
    try:
        said = [closure_digest(plugin.module), *sorted(map(code_digest, kernels))]
        return hashlib.sha256("".join(said).encode()).hexdigest()[:12]
    except NoWords as error:
        raise DataError(
            f"plugin {plugin.name}: {error}, so it cannot be checked whether runs of a study belong "
            f"together; make it a number, a tuple or an array"
        ) from None
    except OSError as error:
        raise DataError(
            f"plugin {plugin.name}: its file cannot be read any more ({error.strerror}); put it back"
        ) from None


def _study_of(manifest: dict[str, Any]) -> dict[str, Any]:
    """Return the part of a manifest that describes the study, without the machines that worked on
    it."""
    return {key: value for key, value in manifest.items() if key != "processors"}


def _manifest(folder: Path) -> dict[str, Any]:
    from ...io.own.text_rules import check_values
    from .manifest_rules import ManifestRules

    path = regular(folder / "manifest.json")
    try:
        manifest = json_of(settings_text(path), path)
        number = manifest["format"]
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read ({error.strerror}); give the folder of a study"
        ) from None
    except LimitError:
        raise
    except (ValueError, KeyError, TypeError):
        raise DataError(f"{path}: not the manifest of a study; choose another folder") from None
    if number != CAMPAIGN_FORMAT:
        raise DataError(
            f"{path}: has format {brief(number)}, but this version reads {CAMPAIGN_FORMAT}; use the version "
            f"of strapdown that wrote it, or another folder"
        )
    found: dict[str, Any] = check_values(ManifestRules, manifest, path)
    return found


def _same(found: dict[str, Any], wanted: dict[str, Any], folder: Path) -> None:
    """Raise DataError naming the first difference of two manifests."""
    if found == wanted:
        return
    if found["versions"] != wanted["versions"]:

        def text(these: dict[str, str], others: dict[str, str]) -> str:
            unlike = [f"{key} {these[key]}" for key in these if these[key] != others.get(key)]
            return ", ".join(unlike) or "fewer packages"

        before, now = found["versions"], wanted["versions"]
        raise DataError(
            f"{folder}: this campaign was begun with {text(before, now)}; this is "
            f"{text(now, before)}, whose results must not "
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


def _remove(folder: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
