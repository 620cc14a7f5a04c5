"""Files in and out: everything between a file and a `strapdown.recording.Recording`.

The room readers has one file for each format of a recording, registry.py finds them, contract.py
says what such a file offers; the room description holds the keys of `recording.toml`, their complaints and what it yields;
locate.py finds files and table_file.py reads tables; calibration_file.py reads and writes
calibrations, magnetic_record.py checks the samples of a magnetometer; inspection.py looks at a file
and says what it holds, facts.py what can be said of samples and fixes; solution.py writes
and reads what a filter made of it. What cleans and checks the samples is in the room preprocessing.
"""

from .readers.netcdf import write_recording
from .recordings import read

__all__ = ["read", "write_recording"]
