"""Kits of vehicles: sections of `recording.toml` with what constrains one, each number with its reason, to be
read and changed."""

from importlib.resources import as_file

from ..checks import check_choice
from ..fileio.file_access import settings_text
from ..fileio.files import shipped_files


def vehicle_kits() -> list[str]:
    """Return the names of the kits, sorted.

    Returns
    -------
    list of str
        Names that `vehicle_kit` takes.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.vehicle_kits()
    ['boat', 'car', 'fixed-wing', 'multicopter', 'rail', 'underwater']
    """
    return sorted(shipped_files("kits", "strapdown.io"))


def vehicle_kit(name: str) -> str:
    """Return a kit as TOML text, to be appended to a `recording.toml` and changed there.

    Parameters
    ----------
    name : str
        One of `vehicle_kits`.

    Returns
    -------
    str
        Sections of constraints, or of sensors as comments, with the reasons of their numbers.

    Raises
    ------
    DataError
        If there is no such kit.

    Examples
    --------
    >>> import strapdown as sd
    >>> print(sd.vehicle_kit("fixed-wing").splitlines()[0])
    # A fixed wing: append to recording.toml, and set at its top: vehicle = "aircraft"
    """
    found = shipped_files("kits", "strapdown.io")
    check_choice(name, "name of a vehicle kit", found)
    with as_file(found[name]) as path:
        return settings_text(path)
