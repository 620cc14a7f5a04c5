"""Make a Recording from files of any format."""

from pathlib import Path

from ..checks import DataError, check_path, printable
from ..data.recording import Recording
from ..fileio.limits import reading_within
from ..typing import File
from .registry import ask, taker


def read(path: File, /, *more: File, **instances: int | None) -> Recording:
    """Return the recording in a file of any format, or in several files that belong together.

    Parameters
    ----------
    path, *more : str or path
        A recording.toml, a table, or the log of a device; several if, for example, IMU and receiver
        wrote one file each. docs/reference/recording-format.md and docs/how-to/logs.md list the
        formats.
    **instances : int or None
        Which of several equal sensors to take from the logs of devices, `imu=1`; None for none,
        `magnetometer=None`.

    Returns
    -------
    Recording
        In SI; `recording.meta["notes"]` lists the repairs made while reading.

    Raises
    ------
    DataError
        In one line, with file, row or field and the remedy.

    Examples
    --------
    >>> import tempfile, strapdown as sd
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sd.simulate("car", 10.0, seed=1).save(f"{folder}/car.nc")
    ...     len(sd.read(f"{folder}/car.nc"))
    1000
    """
    for each in (path, *more):
        check_path(each)
    paths = [Path(each) for each in (path, *more)]
    reader = [taker(each) for each in paths][0]
    if len(paths) == 1 and reader.read is not None:
        if instances:
            raise DataError(
                f"{path}: is a complete recording; there are no instances to choose from"
            )
        found = ask(reader, "read", paths[0])
        if not isinstance(found, Recording):
            raise DataError(
                f"{path}: the reader {reader.name!r} returns a "
                f"{type(found).__name__} instead of a Recording"
            )
        return _printable(found)
    from .description.logs import read_logs  # loads pydantic: 0.2 s

    with reading_within(", ".join(map(str, paths))):
        return _printable(read_logs(paths, instances))


def _printable(recording: Recording) -> Recording:
    """Return a copy whose texts have no control characters, which names in files may contain."""
    notes, read = recording.meta.get("notes"), recording.meta.get("read")
    if isinstance(notes, list):
        recording = recording.with_meta(notes=[*map(printable, map(str, notes))])
    if isinstance(read, list):
        recording = recording.with_meta(read=[*map(printable, map(str, read))])
    return recording
