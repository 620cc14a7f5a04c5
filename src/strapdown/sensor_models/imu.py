"""Model of an inertial measurement unit: the errors of its two triads (errors.py), its TOML file,
and the grades that ship with the package."""

import math
import re
import tomllib
from dataclasses import dataclass
from importlib.resources.abc import Traversable
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ..checks import (
    DataError,
    brief,
    check_flag,
    check_number,
    check_type,
    did_you_mean,
    locate_errors,
)
from ..core.loop.contract import Imu, Noise
from ..data.calibration_parameters import (
    ACCEL_MISALIGNMENT,
    ACCEL_SCALE,
    GYRO_MISALIGNMENT,
    GYRO_SCALE,
)
from ..fileio.files import find_shipped, read_toml, replacing, shipped_files
from ..fileio.toml_keys import Key, Read, read_table, section, table_reader, text
from ..typing import Array, File
from ..units.conversion import SHEET, factor, in_units, quantity, toml_quantity
from .errors import Triad, WarmUp, terms
from .imu_errors import RATES, Own, Shared, draw_errors, shared_errors, simulate_errors
from .streams import RandomStream, SeedLike

WARM_UP = {"start": "degC", "end": "degC", "time_constant": "s"}
"""Keys of the section [warm_up] and their SI units."""
EXAMPLE = 'write noise = {{ value = ..., unit = "{}" }}'
"""Least content of the section of a sensor."""


@dataclass(frozen=True, repr=False)
class ImuSpec:
    """Errors of an IMU, per axis, in SI. Written as a TOML file in datasheet units
    (docs/how-to/imu.md). Raises DataError where they are out of range.

    Attributes
    ----------
    name : str
        Name of the grade.
    gyro : Triad
        Errors of the gyros, rad/s.
    accel : Triad
        Errors of the accelerometers, m/s^2.
    source : str
        Where the numbers are from.
    warm_up : WarmUp or None
        Temperature of a run; goes with the temperature table of a triad.
    """

    name: str
    gyro: Triad
    accel: Triad
    source: str = ""
    warm_up: WarmUp | None = None

    def __post_init__(self) -> None:
        if self.accel.g_sensitivity:
            raise DataError(
                "g_sensitivity is an error of gyros; the accelerometer's answer to specific force "
                "is its scale_factor"
            )
        tables = {
            sensor: triad.temperature
            for sensor, triad in (("gyro", self.gyro), ("accel", self.accel))
            if triad.temperature
        }
        if bool(tables) != (self.warm_up is not None):
            raise DataError(
                "warm_up is given without a temperature table of gyro or accel; leave it out"
                if self.warm_up
                else (
                    f"the temperature table of {min(tables)} needs warm_up: temperatures at start "
                    f"and end, time constant"
                )
            )
        for sensor, table in tables.items():
            assert self.warm_up is not None  # as just checked
            low, high = sorted((self.warm_up.start, self.warm_up.end))
            if low < table[0][0] or high > table[-1][0]:
                raise DataError(
                    f"warm_up goes from {self.warm_up.start:g} to {self.warm_up.end:g} degC, beyond "
                    f"the temperature table of {sensor}, "
                    f"which covers {table[0][0]:g} to {table[-1][0]:g}"
                )

    def noise(self) -> Noise:
        """Return the noise that a filter with one bias state per axis should assume (see
        `Triad.bias_model`), as core.loop.contract.Noise."""
        (gyro_bias, gyro_decay), (accel_bias, accel_decay) = (
            self.gyro.bias_model(self.warm_up),
            self.accel.bias_model(self.warm_up),
        )
        return Noise(
            self.gyro.noise, self.accel.noise, gyro_bias, accel_bias, gyro_decay, accel_decay
        )

    def bias_std(self) -> tuple[float, float]:
        """Initial standard deviations (accelerometer m/s^2, gyro rad/s)."""
        return self.accel.bias_std(self.warm_up), self.gyro.bias_std(self.warm_up)

    def axes_std(self) -> dict[str, tuple[float, ...]]:
        """{parameter of `calibration_parameters`: standard deviations of its components} of the scale factors and
        misalignments that it states; {} without any."""
        found = {}
        for scale, misalignment, triad in (
            (GYRO_SCALE, GYRO_MISALIGNMENT, self.gyro),
            (ACCEL_SCALE, ACCEL_MISALIGNMENT, self.accel),
        ):
            for what, std in ((scale, triad.scale_factor), (misalignment, triad.misalignment)):
                if std:
                    found[what.name] = (float(std),) * len(what.components)
        return found

    def corrupt(self, imu: Imu, seed: SeedLike) -> tuple[Imu, Array, Array]:
        """(Imu with errors, b_a (n, 3) m/s^2, b_g (n, 3) rad/s) of an error-free `imu`; `seed`, the
        source of all chance, is a number, several, a numpy Generator or SeedSequence, or a RandomStream.

        The biases are all that adds to specific force and rate but noise: turn-on, walk,
        Gauss-Markov, flicker and temperature.
        """
        u, bias = np.empty((len(imu.t), 6)), np.empty((len(imu.t), 6))
        own = self.draw_constants(RandomStream.of(seed))
        rows = np.array([0, len(imu.t)])
        simulate_errors(rows, self.shared_errors(imu), own, np.zeros(RATES), u, bias)
        dtheta, dv, b_g, b_a = (
            np.ascontiguousarray(part) for part in (u[:, :3], u[:, 3:], bias[:, :3], bias[:, 3:])
        )
        return Imu(imu.t, imu.dt, dtheta, dv), b_a, b_g

    def shared_errors(self, imu: Imu) -> Shared:
        """Return the part of the errors that all runs over an error-free `imu` share, for
        `simulate_errors`."""
        return shared_errors(self.gyro, self.accel, self.warm_up, imu)

    def draw_constants(self, stream: RandomStream) -> Own:
        """Draw the random constants of a run before its first sample."""
        return draw_errors(self.gyro, self.accel, stream)

    def datasheet(self) -> dict[str, float]:
        """{"gyro noise, deg/sqrt(h)": value, ...}: every term of both triads in the units of
        datasheets; of a temperature table the largest bias."""
        sheet = {}
        for sensor in ("gyro", "accel"):
            triad = getattr(self, sensor)
            for term in terms(sensor):
                unit, name = (
                    term.metadata[f"{sensor}_sheet"],
                    term.name.replace("turn_on", "turn-on").replace("g_s", "g-s").replace("_", " "),
                )
                sheet[f"{sensor} {name}, {unit}"] = in_units(
                    getattr(triad, term.name), term.metadata[sensor], unit
                )
            si = _bias_unit(sensor)
            largest = max(
                (abs(value) for row in triad.temperature for value in row[1:]), default=0.0
            )
            sheet[f"{sensor} temperature bias (largest), {SHEET[si]}"] = in_units(largest, si)
        for key, si in WARM_UP.items():
            sheet[f"warm-up {key.replace('_', ' ')}, {si}"] = (
                getattr(self.warm_up, key) if self.warm_up else 0.0
            )
        return sheet

    @classmethod
    def from_toml(cls, path: File) -> "ImuSpec":
        """Read a spec file. Raises DataError naming the file, the field and the remedy."""
        return _from_table(
            read_toml(path, "give a grade's name or the path of a .toml file"), str(path)
        )

    def to_toml(self, path: File) -> None:
        """Write a spec file that `from_toml` reads back to an equal spec (SI values; datasheet
        units beside them as comments)."""
        with replacing(path) as part:
            part.write_text(_as_toml(self), encoding="utf-8")

    def __repr__(self) -> str:
        def show(value: float, si: str) -> str:
            return f"{in_units(value, si):.3g} {SHEET[si]}"

        parts = []
        for sensor, bias_std in (("gyro", self.bias_std()[1]), ("accel", self.bias_std()[0])):
            unit = {term.name: term.metadata[sensor] for term in terms(sensor)}
            parts.append(
                f"{sensor} {show(getattr(self, sensor).noise, unit['noise'])}, bias "
                f"{show(bias_std, unit['turn_on_bias'])}"
            )
        return f"ImuSpec({self.name}: {'; '.join(parts)})"


GivenImu: TypeAlias = ImuSpec | dict[str, Any] | File
"""A choice of an IMU: the name of a grade, the path of a file, a table of its fields, or an ImuSpec."""


OF_GRADES = {
    "ICM-20948": "consumer",
    "DMU10": "dmu10",
    "MTi-600": "industrial",
    "STIM300": "tactical",
}
"""{part: grade that has its data sheet}."""
SERIES = {
    "navigation": ("hg9900", "hg2801"),
    "tactical": ("stim", "hg", "kvh", "ln200"),
    "industrial": ("adis", "mti", "xsens", "vn", "3dm", "mg3", "g3", "ellipse"),
    "consumer": ("mpu", "icm", "iim", "bmi", "bno", "lsm", "ism"),
}
"""{grade: beginnings of names of parts of its kind}, as their data sheets have them."""


def saturation_notes(spec: ImuSpec, imu: Imu) -> list[str]:
    """Sentences for the notes of a recording: how many samples of `imu`, corrupted by `spec`,
    stand at full scale; none where none does."""
    notes = []
    for sensor, increments, si, unit in (
        ("gyro", imu.dtheta, "rad/s", "deg/s"),
        ("accelerometer", imu.dv, "m/s^2", "g"),
    ):
        triad = spec.gyro if sensor == "gyro" else spec.accel
        if count := triad.count_saturated(increments, imu.dt):
            notes.append(
                f"{sensor}: {count} of {len(imu.t)} samples saturated at "
                f"{in_units(triad.saturation, si, unit):.4g} {unit}"
            )
    return notes


def imus(others: bool = True) -> list[str]:
    """Return the names of the IMU grades, sorted.

    Parameters
    ----------
    others : bool
        Also those of other installed packages.

    Returns
    -------
    list of str
        Names that `grade` takes.

    Examples
    --------
    >>> import strapdown as sd
    >>> "tactical" in sd.imus()
    True
    """
    return list(shipped_files("grades", __package__, check_flag(others, "others")))


def imu_parts() -> dict[str, str]:
    """{name of a part of the market: what `imu` takes for it}: a file of its own, or a grade that has its
    data sheet."""
    own = {name.upper(): name for name in shipped_files("parts", __package__, False)}
    return dict(sorted({**own, **OF_GRADES}.items()))


def _plain(name: str) -> str:
    """A name of a part without what people write differently: case, hyphens, spaces."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _find_file(name: str) -> Traversable | None:
    """The TOML file of a grade, or of a part however it is written."""
    if resource := find_shipped("grades", __package__, name):
        return resource
    for part, own in imu_parts().items():
        if _plain(part) == _plain(name):
            kind = "grades" if part in OF_GRADES else "parts"
            return find_shipped(kind, __package__, own)
    return None


def imu(name: GivenImu) -> ImuSpec:
    """Return the error model of an IMU by the name of a grade or of a part, or by a file.

    Parameters
    ----------
    name : str, path, dict or ImuSpec
        A grade, a part such as "MPU-6050" (`strapdown imus` lists both), a .toml file (the path ends in
        .toml or contains a folder), or the fields of an ImuSpec as `dataclasses.asdict` gives them; an
        ImuSpec is returned as it is.

    Returns
    -------
    ImuSpec
        In SI.

    Raises
    ------
    DataError
        Where there is no such grade, or a value is out of range.

    Examples
    --------
    >>> import strapdown as sd
    >>> sd.imu("tactical").name
    'tactical'
    """
    if isinstance(name, ImuSpec):
        return name
    if isinstance(name, dict):
        return _from_fields(name)
    wanted = "an ImuSpec, the name of a grade, the path of its file, or a table"
    check_type(name, "imu", (str, PathLike), wanted)
    name = str(name)
    if resource := _find_file(name):
        return _from_table(tomllib.loads(resource.read_text(encoding="utf-8")), f"grade {name}")
    if name.endswith(".toml") or len(Path(name).parts) > 1:
        return ImuSpec.from_toml(name)
    raise DataError(
        f"unknown IMU {name!r}{_suggestion(name)}; grades: "
        f"{', '.join(imus())}; parts: {', '.join(imu_parts())}; of another part take consumer for a chip "
        f"of a phone or a hobby board, industrial for a calibrated module, or give the path of a .toml "
        f"file with its data sheet"
    )


def _suggestion(name: str) -> str:
    """A name for one that is not known: of a part of a known series the grade of its kind, else the
    name that it is most like."""
    for grade, series in SERIES.items():
        if _plain(name).startswith(series):
            return f" (a part like it is of the grade {grade!r})"
    return did_you_mean(name, [*imus(), *imu_parts()])


def required_imu(
    given: GivenImu | None, without: str = "the recording does not name its IMU: "
) -> ImuSpec:
    """The ImuSpec of what `imu` takes. Raises DataError where there is none; `without`: what to say
    first then."""
    if given is None:
        raise DataError(
            f"{without}give imu=, one of {', '.join(imus())}, or a file that describes it"
        )
    return imu(given)


def _from_fields(fields: dict[str, Any]) -> ImuSpec:
    try:
        warm_up = fields.get("warm_up")
        return ImuSpec(
            **{
                **fields,
                "gyro": Triad(**fields["gyro"]),
                "accel": Triad(**fields["accel"]),
                "warm_up": WarmUp(**warm_up) if warm_up else None,
            }
        )
    except (KeyError, TypeError):
        raise DataError(
            f"imu is {brief(fields)}; a dict must have the fields of an ImuSpec, as "
            f"dataclasses.asdict gives them; or give a grade or a file"
        ) from None


def _bias_unit(sensor: str) -> str:
    return "rad/s" if sensor == "gyro" else "m/s^2"


def _from_table(table: dict[str, Any], where: str) -> ImuSpec:
    with locate_errors(where):
        values = {"name": Path(where).stem, "warm_up": None} | read_table(table, IMU_KEYS)
        return ImuSpec(**values)


def _quantity(si: str, sheet: str | None = None, least: float = 0.0) -> Read:
    """The function that reads a table {value, unit}."""
    return lambda value, where: quantity(value, si, where, sheet, least)


def _triad(sensor: str) -> Read:
    """The function that reads the section of a sensor."""
    keys = {
        term.name: Key(
            term.name,
            _quantity(term.metadata[sensor], term.metadata[f"{sensor}_sheet"]),
            EXAMPLE.format(term.metadata[f"{sensor}_sheet"]) if term.name == "noise" else None,
        )
        for term in terms(sensor)
    }
    si = _bias_unit(sensor)
    keys["temperature"] = Key(
        "temperature", lambda value, where: temperature_rows(value, si, where)
    )

    def read(value: Any, where: str) -> Triad:
        values = read_table(value, keys, where)
        if values.get("saturation") == 0:
            raise DataError(
                f"{where} saturation: the full scale is 0, so nothing would be measured; give it "
                f"above 0, or leave it out for none"
            )
        with locate_errors(where):
            return Triad(**values)

    return section(read)


def temperature_rows(entry: Any, si: str, where: str) -> list[tuple[float, ...]]:
    """Rows in degC and SI of the TOML table {unit, rows}, unsorted and unchecked beyond their
    shape. Raises DataError naming `where`."""
    if (
        not isinstance(entry, dict)
        or set(entry) != {"unit", "rows"}
        or not isinstance(entry["rows"], list)
    ):
        raise DataError(
            f'{where}: write {{ unit = "{SHEET[si]}", rows = [[temperature in degC, bias x, y, z], '
            f"...] }}"
        )
    unit, rows = factor(entry["unit"], si, where), []
    for row in entry["rows"]:
        if not isinstance(row, list) or len(row) != 4:
            raise DataError(f"{where}: row {row!r} is not [temperature in degC, bias x, y, z]")
        for value in row:
            check_number(value, f"{where}: a number of row {row}")
        rows.append((row[0], *(value * unit for value in row[1:])))
    return rows


IMU_KEYS = {
    "name": Key("name", text),
    "source": Key("source", text),
    "gyro": Key("gyro", _triad("gyro"), EXAMPLE.format("deg/sqrt(h)")),
    "accel": Key("accel", _triad("accel"), EXAMPLE.format("m/s/sqrt(h)")),
    "warm_up": Key(
        "warm_up",
        section(
            table_reader(
                WarmUp,
                {key: Key(key, _quantity(si, least=-math.inf), "") for key, si in WARM_UP.items()},
            )
        ),
    ),
}
"""Keys of a spec file."""


def _as_toml(spec: ImuSpec) -> str:
    def quote(text: str) -> str:
        return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'

    lines = [f"name = {quote(spec.name)}", f"source = {quote(spec.source)}"]
    for sensor in ("gyro", "accel"):
        triad = getattr(spec, sensor)
        lines.append(f"\n[{sensor}]")
        for term in terms(sensor):
            if (value := getattr(triad, term.name)) or term.name == "noise":
                lines.append(
                    f"{term.name} = "
                    f"{toml_quantity(value, term.metadata[sensor], term.metadata[f'{sensor}_sheet'])}"
                )
        if triad.temperature:
            rows = ", ".join(str(list(row)) for row in triad.temperature)
            lines.append(f'temperature = {{ unit = "{_bias_unit(sensor)}", rows = [{rows}] }}')
    if spec.warm_up:
        lines += [
            "\n[warm_up]",
            *(
                f"{key} = {toml_quantity(getattr(spec.warm_up, key), si)}"
                for key, si in WARM_UP.items()
            ),
        ]
    return "\n".join(lines) + "\n"
