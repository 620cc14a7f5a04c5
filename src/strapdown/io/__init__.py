"""Files in and out: everything between a file and a `strapdown.recording.Recording`.

locate.py finds files and tables.py reads CSV; units.py and axes.py turn columns into SI and body
axes; samples.py and fixes.py clean and check them, plausible.py looks for mistaken units and axes,
origin.py names their lines in messages; schema.py and description.py are the keys of
`recording.toml` and their complaints, recording.py what it yields; netcdf.py keeps a whole
recording in one file; psins.py reads logs of the PSINS toolbox, broad.py attitude trials of BROAD;
magnetometer.py what reading a magnetometer needs besides; inspection.py and draft.py look at a file
and say what it holds; solution.py and kml.py write and read what a filter made of it.
"""

from pathlib import Path

from ..data import DataError


def read(path):
    """A Recording from a `recording.toml`, a NetCDF file written by `write_recording`, a PSINS log
    (.imu) or a BROAD trial (.npz).

    Raises DataError of one line.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        from .description.read import read_description

        return read_description(path)
    if suffix == ".nc":
        from .netcdf import read_recording

        return read_recording(path)
    if suffix == ".npz":
        from .broad import read_broad

        return read_broad(path)
    from .psins import is_psins, read_psins

    if is_psins(path):
        return read_psins(path)
    from .tables import SUFFIXES

    if path.name.lower().endswith(SUFFIXES):
        raise DataError(
            f"{path}: a table alone does not say its units and axes; "
            f"`strapdown inspect {path} --write recording.toml` drafts the description to read instead"
        )
    raise DataError(
        f"{path}: files of type {suffix or '(no suffix)'!r} are not read; "
        "supported are recording.toml (naming CSV files), recording.nc, PSINS logs (.imu) and BROAD trials (.npz)"
    )


def write_recording(recording, path):
    """Write a Recording as NetCDF, atomically. Raises DataError where the path cannot be
    written."""
    from .netcdf import write_recording

    write_recording(recording, path)
