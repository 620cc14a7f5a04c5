"""Calibration files: bias, matrix and temperature table of a sensor in the axes of its columns;
reading, applying and writing them.

corrected = matrix @ (raw - bias - bias at the temperature of the sample),   rad/s, m/s^2, T
"""

from typing import NamedTuple

import numpy as np

from ..data import DataError
from ..files import read_toml, replacing
from ..preprocessing.origin import counted
from ..sensor_models.errors import Triad
from ..sensor_models.imu import temperature_rows

SECTIONS = {"gyro": "rad/s", "accel": "m/s^2", "magnetometer": "T"}
"""Sections of a calibration file and the unit of their bias."""
HEATED = ("gyro", "accel")
"""Sections that take a temperature table."""
MOST_BIAS = 1e-3
"""T: beyond it no magnetometer of a vehicle reads."""


class Correction(NamedTuple):
    """One section: what turns raw samples of a sensor into right ones, SI, in the axes of the
    columns."""

    bias: np.ndarray  # (3,)
    matrix: np.ndarray  # (3, 3)
    temperature: tuple = ()  # rows (degC, bias x, y, z), linear in between; none: ()

    def at(self, temperature):
        """((n, 3) bias at temperatures (n,) degC, held at the ends of the table; (n,) bool:
        outside the table)."""
        if not self.temperature:
            return np.tile(self.bias, (len(temperature), 1)), np.zeros(len(temperature), bool)
        low, high = self.temperature[0][0], self.temperature[-1][0]
        outside = (temperature < low) | (temperature > high)
        return self.bias + Triad(temperature=self.temperature).temperature_bias(
            np.clip(temperature, low, high)
        ), outside


NONE = Correction(np.zeros(3), np.eye(3))


def read_calibration(path):
    """{"gyro": (bias (3,), matrix (3, 3)), "accel": ..., "magnetometer": ...}; corrected = matrix @
    (raw - bias), SI, in the axes of the columns.

    gyro and accel that the file does not have are zero and identity; "magnetometer" is there only
    where the file has it. Raises DataError.
    """
    return {name: (found.bias, found.matrix) for name, found in read_corrections(path).items()}


def read_corrections(path):
    """{section: Correction} of a calibration file, sections as of `read_calibration`. Raises
    DataError."""
    table = read_toml(path, "check calibration")
    if unknown := set(table) - set(SECTIONS):
        raise DataError(
            f"{path}: unknown section {min(unknown)!r}; a calibration has [gyro], [accel] and [magnetometer]"
        )
    return {
        name: _correction(path, name, table.get(name, {}))
        for name in SECTIONS
        if name in table or name != "magnetometer"
    }


def _correction(path, name, section):
    keys = ["bias", "matrix", "temperature"] if name in HEATED else ["bias", "matrix"]
    if not isinstance(section, dict) or set(section) - set(keys):
        raise DataError(
            f"{path}: [{name}] has {', '.join(keys[:-1])} and {keys[-1]} and no other key"
        )
    try:
        bias, matrix = (
            np.array(section.get(key, default), float)
            for key, default in (("bias", np.zeros(3)), ("matrix", np.eye(3)))
        )
        right = (
            bias.shape == (3,)
            and matrix.shape == (3, 3)
            and np.isfinite(bias).all()
            and abs(np.linalg.det(matrix)) > 1e-6
        )
    except (TypeError, ValueError):
        right = False
    if not right:
        raise DataError(
            f"{path}: [{name}] bias must be 3 numbers and matrix 3 rows of 3 numbers that can be inverted"
        )
    if name == "magnetometer" and np.linalg.det(matrix) < 0:
        raise DataError(
            f"{path}: [{name}] matrix mirrors the field (its determinant is below 0): check the sign of each row and column"
        )
    if name == "magnetometer" and np.abs(bias).max() > MOST_BIAS:
        raise DataError(
            f"{path}: [{name}] bias is {bias.tolist()} T, beyond {MOST_BIAS * 1e3:g} mT, where the Earth's field has 22 to 67 uT: "
            "it must be in T; is it in uT?"
        )
    return Correction(bias, matrix, _temperature(path, name, section))


def _temperature(path, name, section):
    if "temperature" not in section:
        return ()
    rows = temperature_rows(section["temperature"], SECTIONS[name], f"{path}, {name}.temperature")
    try:
        return Triad(temperature=rows).temperature
    except DataError as error:
        raise DataError(f"{path}, {name}.temperature: {error}") from None


def of_the_imu(part, files):
    """{"gyro": Correction, "accel": Correction} that [imu] names; zero and identity where it
    names none. Raises DataError."""
    found = (
        read_corrections(files.locate(part.calibration))
        if part.calibration
        else {"gyro": NONE, "accel": NONE}
    )
    tables = [name for name in HEATED if found[name].temperature]
    if tables and part.temperature is None:
        raise DataError(
            f"{files.path}: [imu] temperature: is missing; the table of {tables[0]} in {part.calibration} needs "
            'temperature = { column = "...", unit = "degC" }'
        )
    if part.temperature is not None and not tables:
        raise DataError(
            f"{files.path}: [imu] temperature: belongs to a temperature table of gyro or accel in calibration, "
            "and there is none; leave it out"
        )
    return found


def corrected(part, files, imu):
    """(increments of the gyro, of the accelerometer (n, 3) in the axes of the columns, notes): an
    Imu with the calibration of [imu].

    Raises DataError.
    """
    found, notes = of_the_imu(part, files), []
    temperature = None if part.temperature is None else _temperatures(part, files, imu)
    results = []
    for name, increments in (("gyro", imu.dtheta), ("accel", imu.dv)):
        correction, bias = found[name], found[name].bias
        if correction.temperature:
            bias, outside = correction.at(temperature)
            if outside.any():
                low, high, beyond = (
                    correction.temperature[0][0],
                    correction.temperature[-1][0],
                    temperature[outside],
                )
                notes.append(
                    f"{name}: {counted(len(beyond), 'sample')} at {beyond.min():.1f} to {beyond.max():.1f} degC, "
                    f"outside the temperature table ({low:g} to {high:g} degC); the bias of its end is used there"
                )
        results.append((increments - bias * imu.dt[:, None]) @ correction.matrix.T)
    return *results, notes


def _temperatures(part, files, imu):
    """(n,) degC at the samples of the IMU; linear across cells that are empty."""
    table, t, (values,) = files.columns(part.file, part.time, [part.temperature.column])
    known = np.isfinite(t) & np.isfinite(values)
    if not known.any():
        raise DataError(
            f"{table.name}: column {part.temperature.column!r} holds no temperature; leave [imu] temperature out"
        )
    order = np.argsort(t[known], kind="stable")
    return np.interp(
        imu.t,
        t[known][order],
        values[known][order] * part.temperature.scale + part.temperature.offset,
    )


def frames(description, files, aidings):
    """{"gyro", "accel" and names of magnetometers: {"axes", "bias", "matrix", "temperature",
    "field"}} as lists, for the meta of a Recording.

    It is what a later calibration in body axes needs to come back to the columns; what is left out
    is identity, zero or none.
    """
    from ..preprocessing.axes import sensor_to_body

    imu = description.imu
    found = (
        {
            name: _frame(sensor_to_body(imu), correction)
            for name, correction in of_the_imu(imu, files).items()
        }
        if imu.calibration
        else dict.fromkeys(HEATED, _frame(sensor_to_body(imu), NONE))
    )
    for part, aiding in zip(description.aiding, aidings):
        if part.sensor.parameters == "field":
            correction = (
                read_corrections(files.locate(part.calibration)).get("magnetometer", NONE)
                if part.calibration
                else NONE
            )
            found[aiding.name] = _frame(part.matrix, correction) | (
                {"field": "record"} if part.field == "record" else {}
            )
    return {name: frame for name, frame in found.items() if frame}


def _frame(axes, correction):
    values = {
        "axes": (axes, np.eye(3)),
        "bias": (correction.bias, np.zeros(3)),
        "matrix": (correction.matrix, np.eye(3)),
    }
    frame = {
        key: value.tolist()
        for key, (value, plain) in values.items()
        if not np.array_equal(value, plain)
    }
    return frame | (
        {"temperature": [list(row) for row in correction.temperature]}
        if correction.temperature
        else {}
    )


def composed(section, bias, matrix, columns):
    """{section: Correction} in the axes of the columns of what is matrix @ (x - bias) in body axes,
    x = axes @ (own calibration of the columns).

    columns: frames of `frames`, that of the sensor itself; its key "gyro" keeps a calibration of
    the gyro beside that of the accelerometer.
    """
    axes, own = np.array(columns.get("axes", np.eye(3))), _own(columns)
    to_body = axes @ own.matrix
    found = {
        section: Correction(
            own.bias + np.linalg.solve(to_body, bias), axes.T @ matrix @ to_body, own.temperature
        )
    }
    gyro = columns.get("gyro", {})
    return ({"gyro": _own(gyro)} if set(gyro) - {"axes"} else {}) | found


def _own(columns):
    rows = tuple(tuple(row) for row in columns.get("temperature", ()))
    return Correction(
        np.array(columns.get("bias", np.zeros(3))), np.array(columns.get("matrix", np.eye(3))), rows
    )


def calibration_text(sections, comments):
    """The text of a calibration file: {section: Correction}, and lines to say where it is from."""
    numbers = lambda values: (
        "[" + ", ".join(repr(float(f"{float(value):.12g}")) for value in values) + "]"
    )
    rows = lambda table: "[" + ", ".join(map(numbers, table)) + "]"
    lines = [f"# {comment}" for comment in comments]
    for name, found in sections.items():
        lines += [
            "",
            f"[{name}]",
            f"bias = {numbers(found.bias)}     # {SECTIONS[name]}",
            f"matrix = {rows(found.matrix)}",
        ]
        if found.temperature:
            lines.append(
                f'temperature = {{ unit = "{SECTIONS[name]}", rows = {rows(found.temperature)} }}'
            )
    return "\n".join(lines) + "\n"


def write_calibration(path, sections, comments=()):
    """Write {section: Correction} as a file that `read_corrections` reads. Raises DataError
    where it cannot be written."""
    with replacing(path) as part:
        part.write_text(calibration_text(sections, comments), encoding="utf-8")
