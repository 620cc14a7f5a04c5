"""Files in and out: everything between a file and a `strapdown.recording.Recording`.

locate.py finds files and tables.py reads CSV; the room description holds the keys of
`recording.toml`, their complaints and what it yields; netcdf.py keeps a whole recording in one
file; psins.py reads logs of the PSINS toolbox, broad.py attitude trials of BROAD;
calibration_file.py reads and writes calibrations, magnetic_record.py checks the samples of a
magnetometer; inspection.py looks at a file and says what it holds; solution.py and kml.py write
and read what a filter made of it. What cleans and checks the samples is in the room preprocessing.
"""

from pathlib import Path

from ..checks import DataError
from ..recording import Recording
from ..typing import File
from .broad import read_broad
from .netcdf import read_recording, write_recording
from .psins import is_psins, read_psins
from .table_file import SUFFIXES

__all__ = ["read", "write_recording"]


def read(path: File) -> Recording:
    """A Recording from a `recording.toml`, a NetCDF file written by `write_recording`, a PSINS log
    (.imu) or a BROAD trial (.npz).

    Raises DataError of one line.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        from .description.read import read_description  # loads pydantic: 0.2 s

        return read_description(path)
    if suffix == ".nc":
        return read_recording(path)
    if suffix == ".npz":
        return read_broad(path)
    if is_psins(path):
        return read_psins(path)
    if path.name.lower().endswith(SUFFIXES):
        raise DataError(
            f"{path}: a table alone does not say its units and axes; "
            f"`strapdown inspect {path} --write recording.toml` drafts the description to read "
            f"instead"
        )
    raise DataError(
        f"{path}: files of type {suffix or '(no suffix)'!r} are not read; "
        "supported are recording.toml (naming CSV files), recording.nc, PSINS logs (.imu) and BROAD "
        "trials (.npz)"
    )
