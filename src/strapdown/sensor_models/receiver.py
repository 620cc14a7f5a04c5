"""Grades of GNSS receivers, which ship with the package or are described in a TOML file."""

import os
import tomllib
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from ..checks import DataError, brief, check_flag, check_type, did_you_mean, locate_errors
from ..data.solution import Correlated
from ..fileio.files import find_shipped, read_toml, shipped_files
from ..fileio.toml_keys import (
    Key,
    Read,
    flag,
    list_of,
    number,
    read_table,
    table_reader,
    text,
    three,
)
from ..typing import File
from .gnss import Gnss


def _correlated_reader(unit: str) -> Read:
    """The function that reads correlated errors in that unit."""
    keys = {
        f"std_{unit}": Key("std", three, ""),
        "time_s": Key("time", number, ""),
        "states": Key("states", flag),
    }
    return table_reader(Correlated, keys)


ERROR_KEYS = {
    "interval_s": Key("interval", number),
    "position_std_m": Key("position_std", three),
    "velocity_std_m_s": Key("velocity_std", three),
    "latency_s": Key("latency", number),
    "position_correlated": Key("position_correlated", _correlated_reader("m")),
    "velocity_correlated": Key("velocity_correlated", _correlated_reader("m_s")),
    "stated": Key("stated", flag),
}
"""Keys of what a receiver itself does."""
GNSS_KEYS = ERROR_KEYS | {
    "lever_arm_m": Key("lever_arm", three),
    "outages_s": Key("outages", list_of(list_of(number))),
}
"""Those and the keys of where and when it is carried."""
GRADE_KEYS = {"name": Key("name", text), "source": Key("source", text)} | ERROR_KEYS
"""Keys of a receiver's file."""
NOTHING = Gnss(position_std=None, velocity_std=None)
"""A receiver that measures only what is added."""


class ReceiverGrade(NamedTuple):
    """A receiver, and where its figures come from."""

    name: str
    gnss: Gnss
    source: str = ""

    def sheet(self) -> dict[str, str]:
        """{"position, white, m": "0.5 0.5 1", ...}: its terms, north, east, down."""
        gnss, none = self.gnss, Correlated((), 0.0)
        terms: dict[str, Any] = {"rate, Hz": 1 / gnss.interval}
        for what, unit, std, lasting in (
            ("position", "m", gnss.position_std, gnss.position_correlated or none),
            ("velocity", "m/s", gnss.velocity_std, gnss.velocity_correlated or none),
        ):
            terms[f"{what}, white, {unit}"] = std or ()
            terms[f"{what}, correlated, {unit}"] = lasting.std
            terms[f"{what}, correlation time, s"] = lasting.time or ()
        return {
            term: " ".join(f"{each:g}" for each in (value if isinstance(value, tuple) else [value]))
            for term, value in terms.items()
        }


def receivers(others: bool = True) -> list[str]:
    """Return the names of the GNSS receivers, sorted.

    Parameters
    ----------
    others : bool
        Also those of other installed packages.

    Returns
    -------
    list of str
        Names that `receiver` takes.

    Examples
    --------
    >>> import strapdown as sd
    >>> "sbas" in sd.receivers()
    True
    """
    return list(shipped_files("receivers", __package__, check_flag(others, "others")))


def receiver_grade(name: File) -> ReceiverGrade:
    """The ReceiverGrade of a name, or of a file's path (ends in .toml or contains a folder). Raises
    DataError naming file, key and remedy."""
    if not isinstance(name, (str, os.PathLike)):
        raise DataError(
            f"gnss is {brief(name)}; give a Gnss, a receiver's name ({', '.join(receivers())}) or "
            f"the path of a .toml file"
        )
    name = str(name)
    if resource := find_shipped("receivers", __package__, name):
        return _from_table(
            tomllib.loads(resource.read_text(encoding="utf-8")), f"receiver {name}", name
        )
    if name.endswith(".toml") or len(Path(name).parts) > 1:
        hint = "give a receiver's name or the path of a .toml file"
        return _from_table(read_toml(name, hint), name, Path(name).stem)
    raise DataError(
        f"unknown receiver {name!r}{did_you_mean(name, receivers())}; receivers: "
        f"{', '.join(receivers())}; or give the path of a .toml file"
    )


def receiver(name: Gnss | File, like: Gnss = NOTHING) -> Gnss:
    """Return the error model of a GNSS receiver by its name or file.

    Parameters
    ----------
    name : str, path or Gnss
        A receiver, or a .toml file; a Gnss is returned as it is.
    like : Gnss
        Whose lever arm and outages it gets.

    Returns
    -------
    Gnss
        In SI.

    Raises
    ------
    DataError
        Where there is no such receiver, or a value is out of range.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.receiver("sbas").interval
    1.0
    """
    if isinstance(name, Gnss):
        return name
    check_type(
        name, "receiver", (str, PathLike), "a Gnss, the name of a receiver or its file's path"
    )
    check_type(like, "like", Gnss, "a Gnss")
    found = receiver_grade(name).gnss
    return found._replace(lever_arm=like.lever_arm, outages=like.outages)


def _from_table(table: dict[str, Any], where: str, name: str) -> ReceiverGrade:
    with locate_errors(where):
        fields = {"name": name, "source": ""} | read_table(table, GRADE_KEYS)
        name, source = fields.pop("name"), fields.pop("source")
        gnss = NOTHING._replace(**fields)
        gnss.check()
        if gnss.position_std is None and gnss.velocity_std is None:
            raise DataError("it measures nothing; write position_std_m, velocity_std_m_s or both")
    return ReceiverGrade(name, gnss, source)
