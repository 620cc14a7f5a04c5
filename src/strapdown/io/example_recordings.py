"""Recordings that come with the package, for a first try and for tutorials."""

from pathlib import Path

from ..checks import check_choice
from ..data.recording import Recording
from .recordings import read

FOLDER = Path(__file__).with_name("examples")


def examples() -> list[str]:
    """Return the names of the recordings that come with the package, sorted.

    Returns
    -------
    list of str
        Names that `example` takes.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.examples()
    ['drive']
    """
    return sorted(path.parent.name for path in FOLDER.glob("*/recording.toml"))


def example(name: str = "drive") -> Recording:
    """Return a recording that comes with the package.

    Parameters
    ----------
    name : str
        One of `examples`. "drive": a car in hills, 549 s, consumer IMU at 100 Hz, RTK positions and
        velocities at 4 Hz; the positions, of the antenna, are the reference too.

    Returns
    -------
    Recording
        As its description has it, whose path `strapdown.io.example_recordings.example_description` gives.

    Raises
    ------
    DataError
        Where there is none of that name.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.example("drive").reference is not None
    True
    """
    return read(example_description(name))


def example_description(name: str = "drive") -> Path:
    """Return the path of the recording.toml of an example. Raises DataError."""
    check_choice(name, "name", examples())
    return FOLDER / name / "recording.toml"
