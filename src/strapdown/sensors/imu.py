"""Error model of an inertial measurement unit: white noise, turn-on bias, bias random walk and Gauss-Markov bias; its TOML file and the grades.

A further error term is a field of `Triad` with its units and a line in `Triad.errors`.
"""
import difflib
import tomllib
from dataclasses import dataclass, field, fields
from importlib.resources import files
from numbers import Real
from pathlib import Path

import numpy as np

from ..core.contract import Imu, Noise
from ..data import DataError
from ..files import replacing

_DEG, _G = np.pi / 180, 9.80665

UNITS = {
    "rad/sqrt(s)": {"rad/sqrt(s)": 1.0, "rad/s/sqrt(Hz)": 1.0, "deg/sqrt(s)": _DEG, "deg/s/sqrt(Hz)": _DEG, "mdps/sqrt(Hz)": _DEG * 1e-3,
                    "deg/sqrt(h)": _DEG / 60, "deg/h/sqrt(Hz)": _DEG / 3600},
    "m/s/sqrt(s)": {"m/s/sqrt(s)": 1.0, "m/s^2/sqrt(Hz)": 1.0, "m/s/sqrt(h)": 1 / 60, "mg/sqrt(Hz)": _G * 1e-3, "ug/sqrt(Hz)": _G * 1e-6},
    "rad/s": {"rad/s": 1.0, "deg/s": _DEG, "deg/h": _DEG / 3600},
    "m/s^2": {"m/s^2": 1.0, "g": _G, "mg": _G * 1e-3, "ug": _G * 1e-6},
    "rad/s/sqrt(s)": {"rad/s/sqrt(s)": 1.0, "rad/s^2/sqrt(Hz)": 1.0, "deg/s/sqrt(s)": _DEG, "deg/s/sqrt(h)": _DEG / 60,
                      "deg/h/sqrt(s)": _DEG / 3600, "deg/h/sqrt(h)": _DEG / 3600 / 60},
    "m/s^2/sqrt(s)": {"m/s^2/sqrt(s)": 1.0, "m/s^3/sqrt(Hz)": 1.0, "m/s^2/sqrt(h)": 1 / 60, "mg/sqrt(s)": _G * 1e-3, "mg/sqrt(h)": _G * 1e-3 / 60,
                      "ug/sqrt(s)": _G * 1e-6, "ug/sqrt(h)": _G * 1e-6 / 60},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0},
}
"""Accepted units of each SI unit and their size in it; g is the standard 9.80665 m/s^2, a noise density is two-sided (equal to the random walk)."""

SHEET = {"rad/sqrt(s)": "deg/sqrt(h)", "m/s/sqrt(s)": "m/s/sqrt(h)", "rad/s": "deg/h", "m/s^2": "mg",
         "rad/s/sqrt(s)": "deg/h/sqrt(h)", "m/s^2/sqrt(s)": "mg/sqrt(h)", "s": "s"}
"""The unit of each SI unit that datasheets use, for tables."""


def _term(gyro, accel):
    return field(default=0.0, metadata={"gyro": gyro, "accel": accel})


@dataclass(frozen=True)
class Triad:
    """Errors of three like axes, in SI; 0 means absent. Raises DataError on what no sensor can have."""
    noise: float = _term("rad/sqrt(s)", "m/s/sqrt(s)")              # white noise: angle or velocity random walk
    turn_on_bias: float = _term("rad/s", "m/s^2")                   # sd of a bias that is constant during a run
    bias_walk: float = _term("rad/s/sqrt(s)", "m/s^2/sqrt(s)")      # random walk of the bias: infinite time constant
    gauss_markov: float = _term("rad/s", "m/s^2")                   # stationary sd of a first-order Gauss-Markov bias
    time_constant: float = _term("s", "s")                          # of the Gauss-Markov bias

    def __post_init__(self):
        for name in (f.name for f in fields(self)):
            _check(getattr(self, name), name)
        if (self.gauss_markov > 0) != (self.time_constant > 0):
            present, absent = ("gauss_markov", "time_constant") if self.gauss_markov else ("time_constant", "gauss_markov")
            raise DataError(f"{present} is given without {absent}; a Gauss-Markov bias needs both, larger than 0")

    def bias_sd(self):
        """Standard deviation of the bias at the start of a run, rad/s or m/s^2."""
        return float(np.hypot(self.turn_on_bias, self.gauss_markov))

    def bias_model(self):
        """(driving noise, decay) of the one bias state of a filter: db/dt = -decay b + noise.

        A Gauss-Markov bias alone is represented exactly. Beside a turn-on bias or a walk, which do not decay, one state cannot follow both:
        the decay is 0, which is right over times short against the time constant and cautious beyond it.
        """
        alone = self.gauss_markov > 0 and self.turn_on_bias == 0 and self.bias_walk == 0
        driving = self.bias_walk ** 2 + (2 * self.gauss_markov ** 2 / self.time_constant if self.gauss_markov else 0.0)
        return float(np.sqrt(driving)), 1 / self.time_constant if alone else 0.0

    def errors(self, t, dt, rng):
        """Error of the increments and the bias behind it, (n, 3) each, at sample times `t` and intervals `dt`.

        Each term has a random stream of its own, so that two grades with one seed differ by size alone.
        The bias is held over a sample; from sample to sample it follows its exact discrete law.
        """
        white, turn_on, walk, markov = rng.spawn(4)
        step = np.diff(t)
        bias = np.zeros((len(t), 3))
        if self.turn_on_bias:
            bias += self.turn_on_bias * turn_on.standard_normal(3)
        if self.bias_walk:
            bias[1:] += np.cumsum(walk.standard_normal((len(step), 3)) * (self.bias_walk * np.sqrt(step))[:, None], axis=0)
        if self.gauss_markov:
            bias += self.gauss_markov * _gauss_markov(step / self.time_constant, markov)
        error = bias * dt[:, None]
        if self.noise:
            error += white.standard_normal((len(t), 3)) * (self.noise * np.sqrt(dt))[:, None]
        return error, bias


def _check(value, name):
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 <= value < np.inf:
        raise DataError(f"{name} is {value!r}; it must be a finite number, 0 or more")


def _gauss_markov(step, rng):
    """Stationary first-order Gauss-Markov sequence of unit variance, (len(step) + 1, 3); `step` is in time constants."""
    keep, drive = np.exp(-step), np.sqrt(-np.expm1(-2 * step))
    x = rng.standard_normal((len(step) + 1, 3))
    x[1:] *= drive[:, None]
    if len(step) and np.ptp(step) < 1e-6 * step[0]:
        from scipy.signal import lfilter
        return lfilter([1.0], [1.0, -keep.mean()], x, axis=0)
    for k in range(len(step)):
        x[k + 1] += keep[k] * x[k]
    return x


@dataclass(frozen=True, repr=False)
class ImuSpec:
    """What is wrong with an IMU, per axis, in SI. Written as a TOML file in datasheet units (docs/imu.md)."""
    name: str
    gyro: Triad
    accel: Triad
    source: str = ""

    def noise(self):
        """What a filter with one bias state per axis should assume (see `Triad.bias_model`), as core.contract.Noise."""
        (gyro_bias, gyro_decay), (accel_bias, accel_decay) = self.gyro.bias_model(), self.accel.bias_model()
        return Noise(self.gyro.noise, self.accel.noise, gyro_bias, accel_bias, gyro_decay, accel_decay)

    def bias_sd(self):
        """Initial standard deviations (accelerometer m/s^2, gyro rad/s)."""
        return self.accel.bias_sd(), self.gyro.bias_sd()

    def corrupt(self, imu, rng):
        """(Imu with errors, b_a (n, 3) m/s^2, b_g (n, 3) rad/s) of an error-free `imu`; `rng` is a numpy Generator, the source of all chance."""
        accel, gyro = rng.spawn(2)
        dv, b_a = self.accel.errors(imu.t, imu.dt, accel)
        dtheta, b_g = self.gyro.errors(imu.t, imu.dt, gyro)
        return Imu(imu.t, imu.dt, imu.dtheta + dtheta, imu.dv + dv), b_a, b_g

    def datasheet(self):
        """{"gyro noise, deg/sqrt(h)": value, ...}: every term of both triads in the units of datasheets."""
        return {f"{sensor} {f.name.replace('turn_on', 'turn-on').replace('_', ' ')}, {unit}": getattr(getattr(self, sensor), f.name) / UNITS[f.metadata[sensor]][unit]
                for sensor in ("gyro", "accel") for f in fields(Triad) for unit in [SHEET[f.metadata[sensor]]]}

    @classmethod
    def from_toml(cls, path):
        """Read a spec file. Raises DataError naming file and field."""
        try:
            table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror})") from None
        except UnicodeDecodeError:
            raise DataError(f"{path}: not a UTF-8 text file") from None
        except tomllib.TOMLDecodeError as error:
            raise DataError(f"{path}: not valid TOML: {error}") from None
        return _from_table(table, str(path))

    def to_toml(self, path):
        """Write a spec file that `from_toml` reads back to an equal spec (SI values; datasheet units beside them as comments)."""
        with replacing(path) as part:
            part.write_text(_as_toml(self), encoding="utf-8")

    def __repr__(self):
        parts = []
        for sensor, noise, bias in (("gyro", "rad/sqrt(s)", "rad/s"), ("accel", "m/s/sqrt(s)", "m/s^2")):
            triad, shown = getattr(self, sensor), lambda value, si: f"{value / UNITS[si][SHEET[si]]:.3g} {SHEET[si]}"
            parts.append(f"{sensor} {shown(triad.noise, noise)}, bias {shown(triad.bias_sd(), bias)}")
        return f"ImuSpec({self.name}: {'; '.join(parts)})"


def grades():
    """Names of the grades that ship with the package, sorted."""
    return sorted(entry.name.removesuffix(".toml") for entry in files(__package__).joinpath("grades").iterdir() if entry.name.endswith(".toml"))


def grade(name):
    """The ImuSpec of a grade's name or of a spec file's path (ends in .toml or contains a folder); an ImuSpec is returned as it is.

    A dict is one that was stored with a recording (dataclasses.asdict).
    """
    if isinstance(name, ImuSpec):
        return name
    if isinstance(name, dict):
        return ImuSpec(**{**name, "gyro": Triad(**name["gyro"]), "accel": Triad(**name["accel"])})
    name = str(name)
    if name in grades():
        resource = files(__package__).joinpath("grades", name + ".toml")
        return _from_table(tomllib.loads(resource.read_text(encoding="utf-8")), f"grade {name}")
    if name.endswith(".toml") or len(Path(name).parts) > 1:
        return ImuSpec.from_toml(name)
    raise DataError(f"unknown IMU grade {name!r}{_nearest(name, grades())}; grades: {', '.join(grades())}; or give the path of a .toml file")


def _nearest(word, words):
    match = difflib.get_close_matches(str(word), list(words), n=1, cutoff=0.5)
    return f" (did you mean {match[0]!r}?)" if match else ""


def _refuse_unknown(table, known, where):
    for key in table:
        if key not in known:
            raise DataError(f"{where}: unknown key {key!r}{_nearest(key, known)}; known: {', '.join(known)}")


def _from_table(table, where):
    _refuse_unknown(table, ["name", "source", "gyro", "accel"], where)
    text = {"name": Path(where).stem, "source": "", **{key: table[key] for key in ("name", "source") if key in table}}
    for key, value in text.items():
        if not isinstance(value, str):
            raise DataError(f"{where}: {key} must be text, not {value!r}")
    return ImuSpec(text["name"], _triad(table, "gyro", where), _triad(table, "accel", where), text["source"])


def _triad(table, sensor, where):
    terms = table.get(sensor)
    if not isinstance(terms, dict):
        raise DataError(f"{where}: section [{sensor}] is missing; it needs at least noise = {{ value = ..., unit = ... }}")
    units = {f.name: f.metadata[sensor] for f in fields(Triad)}
    _refuse_unknown(terms, list(units), f"{where}, [{sensor}]")
    if "noise" not in terms:
        raise DataError(f"{where}, [{sensor}]: noise is missing; give it as {{ value = ..., unit = \"{SHEET[units['noise']]}\" }}")
    values = {name: _quantity(entry, units[name], f"{where}, {sensor}.{name}") for name, entry in terms.items()}
    try:
        return Triad(**values)
    except DataError as error:
        raise DataError(f"{where}, [{sensor}]: {error}") from None


def _quantity(entry, si, where):
    """The SI value of {value, unit}."""
    if not isinstance(entry, dict):
        raise DataError(f"{where}: {entry!r} has no unit; write {{ value = {entry}, unit = \"{SHEET[si]}\" }}")
    _refuse_unknown(entry, ["value", "unit"], where)
    if missing := [key for key in ("value", "unit") if key not in entry]:
        raise DataError(f"{where}: {missing[0]} is missing; known units: {', '.join(UNITS[si])}")
    value, unit = entry["value"], entry["unit"]
    if unit not in list(UNITS[si]):
        raise DataError(f"{where}: unknown unit {unit!r}{_nearest(unit, UNITS[si])}; known: {', '.join(UNITS[si])}")
    _check(value, where)
    return float(value) * UNITS[si][unit]


def _as_toml(spec):
    quote = lambda text: '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
    lines = [f"name = {quote(spec.name)}", f"source = {quote(spec.source)}"]
    for sensor in ("gyro", "accel"):
        lines.append(f"\n[{sensor}]")
        for term in fields(Triad):
            value, si = float(getattr(getattr(spec, sensor), term.name)), term.metadata[sensor]
            if value or term.name == "noise":
                lines.append(f'{term.name} = {{ value = {value!r}, unit = "{si}" }}  # {value / UNITS[si][SHEET[si]]:.6g} {SHEET[si]}')
    return "\n".join(lines) + "\n"
