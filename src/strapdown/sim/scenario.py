"""Scenarios by name: those that ship with installed packages, and those of scenario files."""

from os import PathLike
from pathlib import Path

from ..checks import DataError, check_type, did_you_mean
from ..fileio.files import find_shipped, shipped_files
from ..typing import File
from .scenario_file import read
from .scenario_model import START_STD, Scenario

__all__ = ["START_STD", "Scenario", "scenario", "scenarios"]


def scenarios() -> list[str]:
    """Return the names of the scenarios that ship with this and other installed packages, sorted.

    Returns
    -------
    list of str
        Names that `scenario` takes.

    Examples
    --------
    >>> import strapdown as sd
    >>> "car" in sd.scenarios()
    True
    """
    return list(shipped_files("scenarios", __package__))


def scenario(name: Scenario | File) -> Scenario:
    """Return the scenario of a name or file.

    Parameters
    ----------
    name : str, path or Scenario
        A built-in one, or a .toml file (the path ends in .toml or contains a folder); a Scenario is
        returned as it is.

    Returns
    -------
    Scenario
        In SI and radians.

    Raises
    ------
    DataError
        Where there is no such scenario, or the file is out of range.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.scenario("car").rate
    100.0
    """
    if isinstance(name, Scenario):
        return name
    wanted = "a Scenario, its name or the path of its file"
    check_type(name, "scenario", (str, PathLike), wanted)
    if resource := find_shipped("scenarios", __package__, str(name)):
        return read(str(resource))
    if str(name).endswith(".toml") or len(Path(name).parts) > 1:
        return read(name)
    raise DataError(
        f"unknown scenario {str(name)!r}{did_you_mean(name, scenarios())}; "
        f"scenarios: {', '.join(scenarios())}; or give the path of a .toml file"
    )
