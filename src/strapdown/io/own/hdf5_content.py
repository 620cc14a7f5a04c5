"""NetCDF files of our own in memory. This module turns every error of checksum, structure, HDF5 or
a library into one line."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import DataError, brief, printable
from ...fileio.checksum import DAMAGED, has_checksum
from ...fileio.limits import reading_within, regular
from ...typing import File
from ..tables.hdf5_file import open_hdf5
from ..tables.table_file import first_line_of

NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"
"""Beginning of the attribute NAME of a dataset that only gives the size of a dimension (NetCDF-4
format specification, appendix on dimension scales)."""
OF_NETCDF = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"}
"""Internal attributes of NetCDF and HDF5, besides those that begin with _N."""
SEALED = "checksum"
"""Root attribute of files that must have the line of `strapdown.fileio.checksum`."""


class OwnFormat(NamedTuple):
    """A kind of NetCDF file that strapdown writes."""

    what: str  # as messages call its content
    version: int
    others: str  # what to do with a file of another kind
    again: str  # how to make one of this version

    @property
    def mark(self) -> str:
        """The attribute `format` of its files."""
        return f"strapdown {self.what} {self.version}"


class Content(NamedTuple):
    """The content of a group."""

    attributes: dict[str, Any]
    variables: dict[str, np.ndarray[Any, Any]]  # as stored; texts as arrays of objects
    texts: dict[str, str]  # variables that are one text
    units: dict[str, str]  # of the variables that have one
    names: dict[str, str]  # long names of the variables that have one
    groups: dict[str, "Content"]


def content(
    path: File, what: str, names: Collection[str] | None = None, whole: bool = False
) -> Content:
    """Return the content of a file: its root and the groups directly below it. Raises DataError.

    what: the expected content, such as "NetCDF recording"; names: the variables to read, without
    their units (default: all); whole: its checksum was already verified.
    """
    path = Path(path)
    with one_line(path, what):
        sealed = whole or has_checksum(regular(path))
        with open_hdf5(path) as file:
            found = _group(file, path, names)
    if SEALED in found.attributes and not sealed:
        raise DataError(f"{path}: the line with its checksum is missing; {DAMAGED}")
    return found


def content_of(path: File, format: OwnFormat) -> Content:
    """Return the content of a file that has the mark of a format of our own. Raises DataError."""
    found = content(path, f"NetCDF {format.what}")
    said = found.attributes.get("format")
    if isinstance(said, str) and said == format.mark:
        return found
    if isinstance(said, str) and said.startswith(f"strapdown {format.what} "):
        raise DataError(
            f"{path}: is a {format.what} of another version of strapdown (its format attribute is "
            f"{brief(said)}, but this version reads {format.mark!r}); {format.again}"
        )
    raise DataError(
        f"{path}: is not a {format.what} (its format attribute is {brief(said)}, not {format.mark!r}); "
        f"{format.others}"
    )


def _group(group: Any, path: Path, names: Collection[str] | None, depth: int = 0) -> Content:
    import h5py

    found = Content(_attributes(group), {}, {}, {}, {}, {})
    for name in group:
        if names is not None and name not in names:
            continue
        node = group[name]
        if isinstance(node, h5py.Dataset):
            said = _attributes(node) if names is None else {}
            if names is None and _is_dimension(node):
                continue
            values = _values(node, path)
            if isinstance(values, str):
                found.texts[name] = values
            else:
                found.variables[name] = values
            for key, into in (("units", found.units), ("long_name", found.names)):
                if key in said:
                    into[name] = str(said[key])
        elif isinstance(node, h5py.Group) and not depth:
            found.groups[name] = _group(node, path, None, depth + 1)
        else:
            raise DataError(f"{path}: {repr(name)[:60]} is not a variable; {DAMAGED}")
    return found


def _is_dimension(node: Any) -> bool:
    """Return True where the dataset only gives the size of a dimension."""
    name = node.attrs.get("NAME", b"")
    return isinstance(name, bytes) and name.startswith(NO_VARIABLE)


def _values(node: Any, path: Path) -> np.ndarray[Any, Any] | str:
    """The values of a dataset."""
    values = node[()]
    if isinstance(values, bytes):
        return values.decode()
    values = np.asarray(values)
    if values.dtype.kind == "O":
        texts = [each.decode() for each in values.ravel()]
        return np.array(texts, object).reshape(values.shape)
    if values.dtype.kind not in "iuf":
        raise DataError(f"{path}: {repr(node.name)[:60]} holds no numbers; {DAMAGED}")
    return values


def _attributes(node: Any) -> dict[str, Any]:
    """Return {name: text, number or array of numbers} of a group or dataset, without NetCDF's
    own."""
    found = {}
    for name in node.attrs:
        if name in OF_NETCDF or name.startswith("_N"):
            continue
        value = node.attrs[name]
        if isinstance(value, np.ndarray) and value.size == 1:  # NetCDF stores numbers as arrays
            value = value.ravel()[0]
        found[name] = value.item() if isinstance(value, np.generic) else value
    return {
        name: value.decode() if isinstance(value, bytes) else value for name, value in found.items()
    }


@contextmanager
def one_line(path: File, what: str) -> Iterator[None]:
    """Context for reading a file that should be `what`, such as "NetCDF recording": every exception
    becomes a one-line DataError."""
    try:
        with reading_within(path):
            yield
    except DataError:
        raise
    except OSError as error:
        said = (
            error.strerror
            if error.errno and error.strerror
            else printable(first_line_of(error)[:120])
        )
        raise DataError(f"{path}: is not a whole {what} ({said}); {DAMAGED}") from error
    except Exception as error:
        said = f"{type(error).__name__}: {printable(first_line_of(error)[:120])}"
        raise DataError(f"{path}: is not a whole {what} ({said}); {DAMAGED}") from error
