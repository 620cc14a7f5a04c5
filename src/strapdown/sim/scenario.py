"""Scenarios by name: those that ship with installed packages, and those of scenario files."""

from pathlib import Path

from ..checks import DataError, did_you_mean
from ..fileio.files import find_shipped, shipped_files
from ..typing import File
from .scenario_file import read
from .scenario_model import START_SD, Scenario

__all__ = ["START_SD", "Scenario", "scenario", "scenarios"]


def scenarios() -> list[str]:
    """Names of the scenarios that ship with this and other installed packages, sorted."""
    return list(shipped_files("scenarios", __package__))


def scenario(name: Scenario | File) -> Scenario:
    """The Scenario of a built-in name or of a TOML file's path (ends in .toml or contains a
    folder); a Scenario is returned as it is.

    Raises DataError.
    """
    if isinstance(name, Scenario):
        return name
    if resource := find_shipped("scenarios", __package__, str(name)):
        return read(str(resource))
    if str(name).endswith(".toml") or len(Path(name).parts) > 1:
        return read(name)
    raise DataError(
        f"unknown scenario {str(name)!r}{did_you_mean(name, scenarios())}; "
        f"scenarios: {', '.join(scenarios())}; or give the path of a .toml file"
    )
