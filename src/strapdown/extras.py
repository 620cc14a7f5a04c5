"""Packages that an installation may lack, and how to install them: each belongs to an extra of
pyproject.toml."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from .checks import DataError


class OptionalPackage(NamedTuple):
    """A package that an installation may lack."""

    use: str  # what needs it, which begins a sentence
    extra: str  # which brings it


OPTIONAL = {
    "numba": OptionalPackage("compiling kernels", "compile"),
    "pandas": OptionalPackage("a DataFrame, or a table with text or empty cells,", "logs"),
    "lz4": OptionalPackage("reading a log that is packed by lz4", "logs"),
    "backports.zstd": OptionalPackage("reading a file that is packed by zstd", "logs"),
    "scipy": OptionalPackage("this analysis", "analysis"),
    "dask": OptionalPackage("a study by several processes", "study"),
    "xarray": OptionalPackage("a labelled array", "notebook"),
    "ipykernel": OptionalPackage("a notebook", "notebook"),
    "ppigrf": OptionalPackage("the magnetic field before 2010", "igrf"),
    "jsbsim": OptionalPackage("an aircraft of JSBSim", "jsbsim"),
    "pymavlink": OptionalPackage("MAVLink", "mavlink"),
}
"""By the name under which it is installed."""
OF_MODULE = {name.partition(".")[0]: name for name in OPTIONAL} | {
    "llvmlite": "numba",
    "distributed": "dask",
}
"""Package by the first part of a module's name."""


def remedy(package: str) -> str:
    """The command that installs a package of OPTIONAL."""
    return f'pip install "strapdown[{OPTIONAL[package].extra}]"'


def missing_error(package: str, use: str = "") -> DataError:
    """The error for a package of OPTIONAL that is not installed; `use` says what needs it."""
    return DataError(f"{use or OPTIONAL[package].use} needs {package}: {remedy(package)}")


def name_extra(error: BaseException, use: str = "") -> DataError | None:
    """The error to raise in place of a failed import of a package of OPTIONAL, None for any other
    error; `use` says what needs the package."""
    name = error.name if isinstance(error, ImportError) else None
    package = OF_MODULE.get((name or "").partition(".")[0])
    return None if package is None else missing_error(package, use)


@contextmanager
def optional_import(use: str = "") -> Iterator[None]:
    """Around imports: a package of OPTIONAL that is not installed is a DataError, which says what
    needs it and how to install it."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise name_extra(error, use) or error from None
