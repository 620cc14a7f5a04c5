"""From files to a Recording, whatever their formats."""

from pathlib import Path

from ..checks import DataError, printable
from ..data.recording import Recording
from ..fileio.limits import reading_within
from ..typing import File
from .registry import ask, taker


def read(path: File, /, *more: File, **instances: int | None) -> Recording:
    """A Recording from a file of any format that `readers` lists, or from several that belong
    together, such as an IMU's and a receiver's; docs/reference/recording-format.md tells of them.

    `instances` says which of several alike is taken from the logs of devices, `imu=1`, and None that
    none is, `magnetometer=None`. Raises DataError of one line.
    """
    paths = [Path(each) for each in (path, *more)]
    reader = [taker(each) for each in paths][0]
    if len(paths) == 1 and reader.read is not None:
        if instances:
            raise DataError(f"{path}: is a whole recording; there are no instances to choose from")
        found = ask(reader, "read", paths[0])
        if not isinstance(found, Recording):
            raise DataError(
                f"{path}: the reader {reader.name!r} gives no Recording but a "
                f"{type(found).__name__}"
            )
        return _printable(found)
    from .description.logs import read_logs  # loads pydantic: 0.2 s

    with reading_within(", ".join(map(str, paths))):
        return _printable(read_logs(paths, instances))


def _printable(recording: Recording) -> Recording:
    """The same with lines that are told without control characters, which names in files may have."""
    notes, read = recording.meta.get("notes"), recording.meta.get("read")
    if isinstance(notes, list):
        recording = recording.knowing(notes=[*map(printable, map(str, notes))])
    if isinstance(read, list):
        recording = recording.knowing(read=[*map(printable, map(str, read))])
    return recording
