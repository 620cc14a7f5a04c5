"""Solutions on disk: NetCDF holds everything and reads back unchanged, CSV holds the table, KML,
GPX and GeoJSON the track, TUM the poses.

Every column has its unit: as an attribute in NetCDF, in brackets after the name in CSV (`lat
[deg]`). docs/how-to/report.md lists the columns.
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
"""Write-only formats with geodetic positions, by ending: functions that return the bytes of a
Solution for a path."""
LOCAL = {"tum": tum}
"""The same for formats with positions from an origin."""
READ = ("nc", "csv", "csv.gz", "csv.xz")
"""Endings of formats that can be read."""
ENDINGS = (*READ, *TRACKS, *LOCAL)


def write_solution(
    solution: Solution, path: File, *, utc: bool = False, origin: ArrayLike | None = None
) -> None:
    """Write a Solution to a file. The file is complete, or not written.

    Parameters
    ----------
    solution : Solution
        It needs a position for .kml, .gpx, .geojson and .tum.
    path : str or path
        Its ending chooses the format: .nc, .csv, .csv.gz, .csv.xz, .kml, .gpx, .geojson or .tum.
    utc : bool
        Add a second column to a CSV, ISO 8601 in UTC, if the recording has an absolute clock; the
        other formats always have such times.
    origin : array_like, shape (3,), optional
        Origin of the local frame of .tum, in which positions are m east, north and up: latitude and
        longitude in rad, height above the ellipsoid in m; default: the first position. The file
        contains it, and `read_origin` reads it back.

    Raises
    ------
    DataError
        If the solution or the format does not support the request.

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
        A .nc, .csv, .csv.gz or .csv.xz. A CSV has no innovations, events or covariance.

    Returns
    -------
    Solution
        Without the original recording.

    Raises
    ------
    DataError
        If the file cannot be read, is damaged or is not a solution.

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
    raise DataError(f"{path}: a solution cannot have this ending; use .{', .'.join(known)}")
