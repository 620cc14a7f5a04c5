"""Locations of files: the data folder, and the paths in a description."""

import os
import re
from pathlib import Path

from ..checks import DataError
from ..typing import File

VARIABLE = "STRAPDOWN_DATA"


def data_folder(start: File = ".") -> Path:
    """Return the folder of recorded data: `STRAPDOWN_DATA`, else `shared/data` in the nearest
    folder at or above `start` or the current one. Raises DataError."""
    named = os.environ.get(VARIABLE)
    if named:
        if not Path(named).is_dir():
            raise DataError(
                f"{VARIABLE}: {named} is not a folder; set it to the folder that holds the recorded "
                f"data"
            )
        return Path(named)
    for folder in (Path(start).resolve(), Path.cwd()):
        for parent in (folder, *folder.parents):
            if (parent / "shared" / "data").is_dir():
                return parent / "shared" / "data"
    raise DataError(
        f"{VARIABLE} is not set and no data folder was found above {Path(start).resolve()}; set it "
        f"to the folder of the recorded data"
    )


def locate(file: str, folder: File) -> Path:
    """Return the path of `file` in a description in `folder`: `${STRAPDOWN_DATA}` is the data
    folder, relative paths start at `folder`."""
    for name in re.findall(r"\$\{(\w*)\}", file):
        if name != VARIABLE:
            raise DataError(
                f"{file}: only ${{{VARIABLE}}} is replaced in file names, not ${{{name}}}; write "
                f"the full path"
            )
    if "${" in file:
        file = file.replace(f"${{{VARIABLE}}}", str(data_folder(folder)))
    return Path(folder) / Path(file).expanduser()
