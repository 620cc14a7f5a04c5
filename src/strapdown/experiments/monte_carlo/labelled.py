"""The stored rows of a cell as labelled arrays that stay in the chunk files until they are used.

They are read like every other part of a chunk, because damaged dimension scales can make a library
end the process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import dask.array
import numpy as np
import xarray
from dask.delayed import delayed

from .chunk_files import ABOUT, COLUMNS, RUNS, labels_of
from .chunks import Arrays


def labelled_dataset(
    files: Sequence[Path],
    load: Callable[[Path, Sequence[str]], Arrays],
    filters: Sequence[str],
    parameters: Sequence[str],
) -> xarray.Dataset:
    """Dataset of what is stored of each run (and of the bound) over all `files`, which follow each
    other. `load` gives those of the named arrays that a file has."""
    first = load(files[0], [*COLUMNS])
    runs = np.concatenate([np.arange(*_runs(path)) for path in files])
    found = {
        name: (
            COLUMNS[name].axes.split(),
            values,
            {"long_name": ABOUT[name]} if name in ABOUT else {},
        )
        for name, values in first.items()
        if "run" in COLUMNS[name].axes.split() or name == "bound"  # others: sums over one chunk
    }
    for name, (axes, values, about) in found.items():
        if "run" in axes:
            found[name] = axes, _join_arrays(files, load, name, values), about
    labels = labels_of(filters, runs, first["t"], parameters)
    return xarray.Dataset(found, {name: (name, list(values)) for name, values in labels.items()})


def _runs(path: Path) -> tuple[int, int]:
    """The first run of a chunk file, and that after its last."""
    found = RUNS.fullmatch(path.name)
    assert found is not None  # `load` has checked it
    return int(found[1]), int(found[2])


def _join_arrays(files: Sequence[Path], load: Any, name: str, first: Any) -> Any:
    """The array of that name of all files along its runs, each file a block; `first` is of the
    first file."""
    axis, blocks = COLUMNS[name].axes.split().index("run"), []
    for path in files:
        begin, stop = _runs(path)
        shape = (*first.shape[:axis], stop - begin, *first.shape[axis + 1 :])
        block = delayed(_one)(load, path, name)
        blocks.append(dask.array.from_delayed(block, shape, first.dtype))
    return dask.array.concatenate(blocks, axis)


def _one(load: Any, path: Path, name: str) -> Any:
    return load(path, [name])[name]
