"""Files in and out: everything between a file and a `strapdown.data.recording.Recording`.

README.md of this folder says what its rooms have.
"""

from .readers.netcdf import write_recording
from .recordings import read

__all__ = ["read", "write_recording"]
