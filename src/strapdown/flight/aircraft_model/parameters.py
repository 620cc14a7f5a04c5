"""Parameters of an aircraft: by name, as the row that the kernels read, and as TOML files."""

import math
import tomllib
from collections import ChainMap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ...checks import (
    DataError,
    check_array,
    check_choice,
    check_keys,
    check_number,
    check_type,
    did_you_mean,
    locate_errors,
)
from ...core.compile.records import row_of, rows
from ...core.mathematics.earth import E2, A
from ...fileio.files import read_toml
from ...fileio.toml_keys import Key, in_unit, read_table, section, table_reader, text
from ...geometry.geodesy import gravity
from ...typing import Array, ArrayLike, File

SECTIONS: dict[str, tuple[tuple[str, str, float, float], ...]] = {
    "body": (
        ("mass", "kg", 1e-3, 1e6),
        ("J_x", "kgm2", 1e-7, 1e9),
        ("J_y", "kgm2", 1e-7, 1e9),
        ("J_z", "kgm2", 1e-7, 1e9),
        ("J_xz", "kgm2", -1e9, 1e9),
    ),
    "wing": (
        ("area", "m2", 1e-4, 1e4),
        ("span", "m", 1e-2, 200.0),
        ("chord", "m", 1e-3, 50.0),
        ("oswald", "", 0.1, 1.5),
        ("density", "kgm3", 0.0, 10.0),
    ),
    "longitudinal": (
        ("C_L_0", "", -5, 5),
        ("C_L_alpha", "", 0.1, 20),
        ("C_L_q", "", -200, 200),
        ("C_L_elevator", "", -10, 10),
        ("stall_alpha", "rad", 0.05, 1.5),
        ("stall_blend", "", 1, 150),
        ("C_D_p", "", 0, 2),
        ("C_D_q", "", -50, 50),
        ("C_D_elevator", "", -2, 2),
        ("C_m_0", "", -2, 2),
        ("C_m_alpha", "", -50, 50),
        ("C_m_q", "", -500, 0),
        ("C_m_elevator", "", -20, 20),
    ),
    "lateral": tuple(
        (f"C_{axis}_{term}", "", -limit, limit)
        for axis, limit in (("Y", 20), ("l", 10), ("n", 10))
        for term in ("0", "beta", "p", "r", "aileron", "rudder")
    ),
    "propulsion": (
        ("diameter", "m", 1e-2, 20),
        ("C_T_0", "", 0, 2),
        ("C_T_1", "", -2, 2),
        ("C_T_2", "", -2, 2),
        ("C_Q_0", "", 1e-6, 1),
        ("C_Q_1", "", -1, 1),
        ("C_Q_2", "", -1, 1),
        ("voltage", "V", 0, 1e4),
        ("motor_constant", "Nm_A", 1e-5, 100),
        ("resistance", "Ohm", 1e-5, 100),
        ("idle_current", "A", 0, 1e3),
    ),
    "actuators": tuple(
        (
            f"{control}_{term}",
            unit if control == "throttle" else {"": "deg", "1_s": "deg_s"}.get(unit, unit),
            low,
            high,
        )
        for control in ("elevator", "aileron", "rudder", "throttle")
        for term, unit, low, high in (
            ("min", "", -1.5, 1.5),
            ("max", "", -1.5, 1.5),
            ("rate", "1_s", 1e-3, 1e4),
            ("lag", "s", 0, 10),
        )
    ),
}
"""Parameters of each section of an aircraft file: name, unit that its key ends in, least and largest
value in SI."""
TERMS = {
    name: (section, unit, low, high)
    for section, terms in SECTIONS.items()
    for name, unit, low, high in terms
}
_FACTOR = {"deg": math.pi / 180, "deg_s": math.pi / 180}

NAMES = tuple(TERMS)
"""Parameters of an aircraft."""


class Parameters:
    """Row of an aircraft's parameters (NAMES) on one Earth, and of what follows from them, for
    kernels."""

    mass: float
    J_x: float
    J_y: float
    J_z: float
    J_xz: float
    area: float
    span: float
    chord: float
    oswald: float
    density: float
    C_L_0: float
    C_L_alpha: float
    C_L_q: float
    C_L_elevator: float
    stall_alpha: float
    stall_blend: float
    C_D_p: float
    C_D_q: float
    C_D_elevator: float
    C_m_0: float
    C_m_alpha: float
    C_m_q: float
    C_m_elevator: float
    C_Y_0: float
    C_Y_beta: float
    C_Y_p: float
    C_Y_r: float
    C_Y_aileron: float
    C_Y_rudder: float
    C_l_0: float
    C_l_beta: float
    C_l_p: float
    C_l_r: float
    C_l_aileron: float
    C_l_rudder: float
    C_n_0: float
    C_n_beta: float
    C_n_p: float
    C_n_r: float
    C_n_aileron: float
    C_n_rudder: float
    diameter: float
    C_T_0: float
    C_T_1: float
    C_T_2: float
    C_Q_0: float
    C_Q_1: float
    C_Q_2: float
    voltage: float
    motor_constant: float
    resistance: float
    idle_current: float
    elevator_min: float
    elevator_max: float
    elevator_rate: float
    elevator_lag: float
    aileron_min: float
    aileron_max: float
    aileron_rate: float
    aileron_lag: float
    rudder_min: float
    rudder_max: float
    rudder_rate: float
    rudder_lag: float
    throttle_min: float
    throttle_max: float
    throttle_rate: float
    throttle_lag: float

    rotates: float  # 1 on the rotating WGS-84 Earth, 0 on the flat one
    # of the flat one: m/s^2, and rad of latitude and of longitude to the metre
    gravity: float
    latitude_rate: float
    longitude_rate: float
    # 1/J_y and the inverse of [[J_x, -J_xz], [-J_xz, J_z]], 1/(kg m^2)
    inverse_yy: float
    inverse_xx: float
    inverse_xz: float
    inverse_zz: float
    polar: float  # 1 / (pi oswald span^2 / area): drag to the square of lift


PARAMETERS = row_of(Parameters)


@dataclass(frozen=True, repr=False)
class Aircraft:
    """A fixed-wing aircraft: `values` gives every parameter by name (NAMES), in SI; read-only.
    Raises DataError on what no aircraft can have.

    Attributes
    ----------
    name : str
        Name of the set.
    values : Mapping[str, float]
        {parameter: value}, SI and radians.
    source : str
        Where the numbers are from.
    """

    name: str
    values: Mapping[str, float] = field(hash=False)
    source: str = ""

    def __post_init__(self) -> None:
        where = f"aircraft {self.name!r}"
        if not isinstance(self.values, Mapping):
            raise DataError(f"{where}: values are {self.values!r}; give a number for each name")
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))
        check_keys(self.values, NAMES, where)
        if missing := [name for name in NAMES if name not in self.values]:
            raise DataError(
                f"{where}: {missing[0]} is "
                f"missing{f' (and {len(missing) - 1} more)' if missing[1:] else ''}; give it in "
                f"[{TERMS[missing[0]][0]}]"
            )
        for name, value in self.values.items():
            _, _, low, high = TERMS[name]
            check_number(value, f"{where}: {name}", "(SI)", least=low, most=high)
        _check_inertia(self.values, where)
        _check_stops(self.values, where)

    def __reduce__(self) -> tuple[type["Aircraft"], tuple[str, dict[str, float], str]]:
        # a read-only view cannot be pickled
        return Aircraft, (
            self.name,
            dict(self.values),
            self.source,
        )

    def __getitem__(self, name: str) -> float:
        """A parameter by name, SI. Raises DataError for an unknown one."""
        check_keys([name], NAMES, f"aircraft {self.name!r}")
        return self.values[name]

    def replace(self, name: str | None = None, **changes: float) -> "Aircraft":
        """Another Aircraft with these parameters (SI) changed. Raises DataError."""
        return Aircraft(name or self.name, {**self.values, **changes}, self.source)

    def parameters(
        self, earth: str = "geodetic", origin: Iterable[float] = (0.0, 0.0, 0.0)
    ) -> Parameters:
        """The row of Parameters that the kernels read, for one Earth: "geodetic" (rotating WGS-84)
        or "flat". Raises DataError.

        The flat one touches WGS-84 at `origin` (rad, rad, m): gravity there, everywhere; latitude
        and longitude by the radii there; no rotation.
        """
        check_choice(earth, "earth", ("geodetic", "flat"))
        lat, _, height = checked_origin(origin)
        north, east = _scales(lat, height)
        row: Parameters
        (row,) = rows(Parameters, 1)
        for name in NAMES:
            setattr(row, name, self.values[name])
        row.rotates, row.gravity = earth == "geodetic", gravity(lat, height)
        row.latitude_rate, row.longitude_rate = 1 / north, 1 / east
        determinant = row.J_x * row.J_z - row.J_xz**2
        row.inverse_yy, row.inverse_xx = 1 / row.J_y, row.J_z / determinant
        row.inverse_xz, row.inverse_zz = row.J_xz / determinant, row.J_x / determinant
        row.polar = row.area / (math.pi * row.oswald * row.span**2)
        return row

    def table(self) -> dict[str, float]:
        """{"mass, kg": 11.0, ...}: every parameter with the unit of the aircraft file."""
        shown = {
            "kgm2": "kg m^2",
            "kgm3": "kg/m^3",
            "m2": "m^2",
            "deg_s": "deg/s",
            "1_s": "1/s",
            "Nm_A": "N m/A",
            "": "1",
        }
        return {
            f"{name}, {shown.get(unit, unit)}": self.values[name] / _FACTOR.get(unit, 1.0)
            for name, (_, unit, _, _) in TERMS.items()
        }

    def __repr__(self) -> str:
        return f"Aircraft({self.name}: {self['mass']:g} kg, span {self['span']:g} m, wing {self['area']:g} m^2)"


def aircraft(name: Aircraft | File = "aerosonde") -> Aircraft:
    """Return the aircraft of a name or file.

    Parameters
    ----------
    name : str, path or Aircraft
        A built-in set, or a .toml file (the path ends in .toml or contains a folder); an Aircraft is
        returned as it is.

    Returns
    -------
    Aircraft
        Its parameters by name, in SI.

    Raises
    ------
    DataError
        Where there is no such set, or the file has a field that no aircraft can have.

    References
    ----------
    Beard & McLain (2012), "Small Unmanned Aircraft", chapter 4; each set names its own source.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.flight.aircraft("aerosonde").name
    'aerosonde'
    """
    if isinstance(name, Aircraft):
        return name
    check_type(name, "aircraft", (str, PathLike), "an Aircraft, its name or the path of its file")
    name = str(name)
    folder = files(__package__).joinpath("sets")
    known = sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )
    if name in known:
        return _from_table(
            tomllib.loads(folder.joinpath(name + ".toml").read_text(encoding="utf-8")), name
        )
    if name.endswith(".toml") or len(Path(name).parts) > 1:
        return _from_table(
            read_toml(name, "give a built-in aircraft's name or the path of a .toml file"), name
        )
    raise DataError(
        f"unknown aircraft {name!r}{did_you_mean(name, known)}; built in: {', '.join(known)}; or give "
        f"the path of a .toml file"
    )


def key(name: str) -> str:
    """The key of a parameter in an aircraft file: its name and its unit."""
    return "_".join(filter(None, (name, TERMS[name][1])))


def checked_origin(origin: Iterable[float]) -> tuple[float, float, float]:
    """(lat rad, lon rad, height m) as floats. Raises DataError unless it is a place below 89 deg
    of latitude."""
    what = "numbers: latitude and longitude in rad, height in m"
    lat, lon, height = check_array(origin, "origin", (3,), what=what).tolist()
    if not (abs(lat) <= math.radians(89) and abs(lon) <= 2 * math.pi and -1e4 <= height <= 1e5):
        raise DataError(
            f"origin is ({lat:g} rad, {lon:g} rad, {height:g} m); latitude goes to 89 deg (1.553 "
            f"rad), height from -10 to 100 km"
        )
    return lat, lon, height


def checked_array(value: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    """`value` as a contiguous float array of `shape` (None: any length). Raises DataError naming
    `what` where it is another or not finite."""
    return np.ascontiguousarray(check_array(value, what, shape))


def flat_metres(parameters: Parameters, origin: ArrayLike, lla: ArrayLike) -> Array:
    """North, east, down (m; (3,) or (n, 3)) of `lla` on the flat Earth of `parameters` about `origin`
    (rad, rad, m): an affine map."""
    north, east, up = np.moveaxis(np.asarray(lla, float) - np.asarray(origin, float), -1, 0)
    return np.stack(
        [north / parameters.latitude_rate, east / parameters.longitude_rate, -up], axis=-1
    )


def _scales(lat: float, height: float) -> tuple[float, float]:
    """Metres to the rad of latitude and of longitude on WGS-84."""
    sine = math.sin(lat)
    root = math.sqrt(1 - E2 * sine * sine)
    return A * (1 - E2) / root**3 + height, (A / root + height) * math.cos(lat)


def _check_inertia(values: Mapping[str, float], where: str) -> None:
    J_x, J_y, J_z, J_xz = (values[name] for name in ("J_x", "J_y", "J_z", "J_xz"))
    if J_x * J_z <= J_xz**2:
        raise DataError(
            f"{where}: J_xz is {J_xz:g} kg m^2; its square must be below J_x J_z ({J_x * J_z:g}), "
            f"else the inertia is not positive definite"
        )
    principal = sorted([*np.linalg.eigvalsh([[J_x, -J_xz], [-J_xz, J_z]]), J_y])
    if principal[2] > 1.0001 * (principal[0] + principal[1]):
        raise DataError(
            f"{where}: the largest principal moment of inertia ({principal[2]:g} kg m^2) exceeds "
            f"the sum of the others "
            f"({principal[0] + principal[1]:g}), which no body has; check J_x, J_y, J_z and J_xz"
        )


def _check_stops(values: Mapping[str, float], where: str) -> None:
    for control in ("elevator", "aileron", "rudder", "throttle"):
        low, high = values[f"{control}_min"], values[f"{control}_max"]
        if not low < high:
            raise DataError(
                f"{where}: {control}_min ({low:g}) is not below {control}_max ({high:g})"
            )
    if values["throttle_min"] < 0 or values["throttle_max"] > 1:
        raise DataError(
            f"{where}: throttle goes from {values['throttle_min']:g} to {values['throttle_max']:g}; "
            f"keep it between 0 and 1"
        )


KEYS: dict[str, Key] = {
    "name": Key("name", text),
    "source": Key("source", text),
    **{
        section_name: Key(
            section_name,
            section(
                table_reader(
                    dict,
                    {
                        key(name): Key(name, in_unit(_FACTOR.get(unit, 1.0)))
                        for name, unit, *_ in each
                    },
                )
            ),
        )
        for section_name, each in SECTIONS.items()
    },
}
"""Keys of an aircraft file."""


def _from_table(table: dict[str, Any], where: str) -> Aircraft:
    with locate_errors(where):
        sections = {"name": Path(where).stem, "source": ""} | read_table(table, KEYS)
        name, source = sections.pop("name"), sections.pop("source")
        return Aircraft(name, dict(ChainMap(*sections.values())), source)
