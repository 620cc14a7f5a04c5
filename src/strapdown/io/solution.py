"""Solutions on disk: NetCDF holds everything and reads back as it was, CSV holds the table, KML, GPX and
GeoJSON the track, TUM the poses.

Every column says its unit: as an attribute in NetCDF, in brackets behind the name in CSV (`lat
[deg]`). docs/how-to/report.md lists them.
"""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from ..checks import DataError, check_path, check_type
from ..data.solution import Solution
from ..fileio.files import replacing
from ..typing import ArrayLike, File
from .own.hdf5_content import one_line
from .solutions.geojson import geojson
from .solutions.gpx import gpx
from .solutions.kml import kml
from .solutions.solution_csv import read_csv, write_csv
from .solutions.solution_netcdf import read_netcdf, write_netcdf
from .solutions.tum import read_origin as read_origin, tum

TRACKS: dict[str, Callable[[Solution, Path], bytes]] = {
    "kml": kml,
    "gpx": gpx,
    "geojson": geojson,
}
"""Formats that are only written, in geodetic positions, by ending: the bytes of a Solution that goes to
a path."""
LOCAL = {"tum": tum}
"""Those in positions from an origin."""
READ = ("nc", "csv", "csv.gz", "csv.xz")
"""Endings that are read back."""
ENDINGS = (*READ, *TRACKS, *LOCAL)


def write_solution(
    solution: Solution, path: File, *, utc: bool = False, origin: ArrayLike | None = None
) -> None:
    """Write a Solution to a file, whole or not at all.

    Parameters
    ----------
    solution : Solution
        It needs a position for .kml, .gpx, .geojson and .tum.
    path : str or path
        Its ending says the format: .nc, .csv, .csv.gz, .csv.xz, .kml, .gpx, .geojson or .tum.
    utc : bool
        A CSV has a second column, ISO 8601 in UTC, where the recording has an absolute clock; the
        other formats have such times without it.
    origin : array_like, shape (3,), optional
        Of the local frame of .tum, whose positions are m east, north and up from it: latitude and
        longitude in rad, height above the ellipsoid in m. By default the first position. The file
        says it, and `read_origin` reads it back.

    Raises
    ------
    DataError
        Where the solution or the format has no place for what is asked.

    Examples
    --------
    >>> import tempfile, strapdown as sd
    >>> solution = sd.fuse(sd.simulate("car", 60.0, seed=1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sd.write_solution(solution, f"{folder}/car.nc")
    ...     len(sd.read_solution(f"{folder}/car.nc")) == len(solution)
    True
    """
    check_type(solution, "solution", Solution, "a Solution, such as sd.fuse gives")
    check_path(path)
    ending = _ending(path, ENDINGS)
    if origin is not None and ending not in LOCAL:
        raise DataError(
            f"{path}: origin: positions in .{ending} are geodetic; leave origin out, or write "
            f".{' or .'.join(LOCAL)}"
        )
    with replacing(path) as part:
        if ending == "nc":
            write_netcdf(solution, part)
        elif ending in READ:
            write_csv(solution, part, Path(path), utc)
        elif ending in LOCAL:
            part.write_bytes(LOCAL[ending](solution, Path(path), origin))
        else:
            part.write_bytes(TRACKS[ending](solution, Path(path)))


def read_solution(path: File) -> Solution:
    """Return the solution in a file of `write_solution`.

    Parameters
    ----------
    path : str or path
        A .nc, .csv, .csv.gz or .csv.xz. A CSV brings no innovations, events or covariance.

    Returns
    -------
    Solution
        Without the recording that it was made of.

    Raises
    ------
    DataError
        Where the file cannot be read, is damaged or is no solution.

    Examples
    --------
    >>> import tempfile, strapdown as sd
    >>> solution = sd.fuse(sd.simulate("car", 60.0, seed=1), every=100)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     solution.save(f"{folder}/car.csv")
    ...     len(sd.read_solution(f"{folder}/car.csv")) == len(solution)
    True
    """
    check_path(path)
    path = Path(path)
    read = read_netcdf if _ending(path, READ) == "nc" else read_csv
    if not os.path.isfile(path):
        reason = "is a folder" if os.path.isdir(path) else "no such file"
        raise DataError(
            f"{path}: {reason}; give a solution file that strapdown wrote (.nc or .csv)"
        )
    with one_line(path, "solution"):
        return read(path)


def _ending(path: File, known: Iterable[str]) -> str:
    for ending in known:
        if Path(path).name.lower().endswith(f".{ending}"):
            return ending
    raise DataError(f"{path}: this ending is not one of a solution; use .{', .'.join(known)}")
