"""Files in and out: everything between a file and a `strapdown.recording.Recording`.

The room readers has one file for each format of a recording, contract.py says what such a file
offers; the room description holds the keys of `recording.toml`, their complaints and what it yields;
locate.py finds files and table_file.py reads tables; calibration_file.py reads and writes
calibrations, magnetic_record.py checks the samples of a magnetometer; inspection.py looks at a file
and says what it holds, facts.py what can be said of samples and fixes; solution.py and kml.py write
and read what a filter made of it. What cleans and checks the samples is in the room preprocessing.
"""

from pathlib import Path

from ..checks import DataError
from ..recording import Recording
from ..typing import File
from .readers import ask, find, formats
from .readers.netcdf import write_recording

__all__ = ["read", "write_recording"]


def read(path: File) -> Recording:
    """A Recording from a file of any format that `strapdown.io.readers` has: a `recording.toml`, a
    NetCDF file written by `write_recording`, and others that docs/recording-format.md lists.

    Raises DataError of one line.
    """
    path = Path(path)
    reader = find(path)
    if reader is None:
        raise DataError(
            f"{path}: files of type {path.suffix.lower() or '(no suffix)'!r} are not read; supported "
            f"are: {formats()}"
        )
    found = ask(reader, "read", path)
    if not isinstance(found, Recording):
        raise DataError(f"{path}: the reader {reader.name!r} gives no Recording but {found!r:.60}")
    return found
