"""Solutions on disk: NetCDF holds everything and reads back as it was, CSV holds the table, KML, GPX and
GeoJSON the track, TUM the poses.

Every column says its unit: as an attribute in NetCDF, in brackets behind the name in CSV (`lat
[deg]`). docs/how-to/report.md lists them.
"""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from ..checks import DataError
from ..data.solution import Solution
from ..fileio.files import replacing
from ..typing import File
from .own.hdf5_content import one_line
from .solutions.geojson import geojson
from .solutions.gpx import gpx
from .solutions.kml import kml
from .solutions.solution_csv import read_csv, write_csv
from .solutions.solution_netcdf import read_netcdf, write_netcdf
from .solutions.tum import tum

TRACKS: dict[str, Callable[[Solution, Path], bytes]] = {
    "kml": kml,
    "gpx": gpx,
    "geojson": geojson,
    "tum": tum,
}
"""Formats that are only written, by ending: the bytes of a Solution that goes to a path."""
READ = ("nc", "csv", "csv.gz", "csv.xz")
"""Endings that are read back."""
ENDINGS = (*READ, *TRACKS)


def write_solution(solution: Solution, path: File, utc: bool = False) -> None:
    """Write a Solution by the ending of `path`, whole or not at all: .nc, .csv, .csv.gz, .csv.xz, or,
    of a solution with a position, .kml, .gpx, .geojson or .tum.

    utc: a CSV has a second column, ISO 8601 in UTC, where the recording has an absolute clock; the
    other formats have such times without it. Raises DataError.
    """
    ending = _ending(path, ENDINGS)
    with replacing(path) as part:
        if ending == "nc":
            write_netcdf(solution, part)
        elif ending in READ:
            write_csv(solution, part, Path(path), utc)
        else:
            part.write_bytes(TRACKS[ending](solution, Path(path)))


def read_solution(path: File) -> Solution:
    """The Solution in a .nc or .csv file of `write_solution`; a CSV brings no innovations,
    events or covariance. Raises DataError."""
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
