"""Calibration files: bias, matrix and temperature table of a sensor in the axes of its columns;
reading and writing them.

corrected = matrix @ (raw - bias - bias at the temperature of the sample),   rad/s, m/s^2, T
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..checks import DataError, check_array, locate_errors
from ..fileio.files import read_toml, replacing
from ..sensor_models.errors import Triad
from ..sensor_models.imu import temperature_rows
from ..typing import Array, File, Mask

SECTIONS = {"gyro": "rad/s", "accel": "m/s^2", "magnetometer": "T"}
"""Sections of a calibration file and the unit of their bias."""
HEATED = ("gyro", "accel")
"""Sections that take a temperature table."""
MAX_BIAS = 1e-3
"""T: largest reading of a vehicle's magnetometer."""
MAX_NUMBER = 1e6
"""Upper bound of the numbers of a calibration, SI or degC, beyond any sensor; sums and products of
much larger ones would overflow."""


class Correction(NamedTuple):
    """One section: the correction of a sensor's raw samples, SI, in the axes of the columns."""

    bias: Array  # (3,)
    matrix: Array  # (3, 3)
    # rows (degC, bias x, y, z), linear in between; none: ()
    temperature: tuple[tuple[float, ...], ...] = ()

    def at(self, temperature: Array) -> tuple[Array, Mask]:
        """Return the bias (n, 3) at the temperatures (n,) degC, constant beyond the ends of the
        table, and which of them are outside the table (n,)."""
        if not self.temperature:
            return np.tile(self.bias, (len(temperature), 1)), np.zeros(len(temperature), bool)
        low, high = self.temperature[0][0], self.temperature[-1][0]
        outside = (temperature < low) | (temperature > high)
        return self.bias + Triad(temperature=self.temperature).temperature_bias(
            np.clip(temperature, low, high)
        ), outside


NONE = Correction(np.zeros(3), np.eye(3))


def read_calibration(path: File) -> dict[str, tuple[Array, Array]]:
    """{"gyro": (bias (3,), matrix (3, 3)), "accel": ..., "magnetometer": ...}; corrected = matrix @
    (raw - bias), SI, in the axes of the columns.

    A gyro or accel that the file lacks gets zero and identity; "magnetometer" is present only if
    the file has it. Raises DataError.
    """
    return {name: (found.bias, found.matrix) for name, found in read_corrections(path).items()}


def read_corrections(path: File) -> dict[str, Correction]:
    """{section: Correction} of a calibration file, sections as of `read_calibration`. Raises
    DataError."""
    table = read_toml(path, "check calibration")
    if unknown := set(table) - set(SECTIONS):
        raise DataError(
            f"{path}: unknown section {min(unknown)!r}; a calibration has [gyro], [accel] and "
            f"[magnetometer]"
        )
    return {
        name: _correction(path, name, table.get(name, {}))
        for name in SECTIONS
        if name in table or name != "magnetometer"
    }


def _correction(path: File, name: str, section: Any) -> Correction:
    keys = ["bias", "matrix", "temperature"] if name in HEATED else ["bias", "matrix"]
    if not isinstance(section, dict) or set(section) - set(keys):
        raise DataError(
            f"{path}: [{name}] has {', '.join(keys[:-1])} and {keys[-1]} and no other key"
        )
    bias, matrix = (
        _check_bounded(section.get(key, default), f"{path}: [{name}] {key}", np.shape(default))
        for key, default in (("bias", np.zeros(3)), ("matrix", np.eye(3)))
    )
    if abs(np.linalg.det(matrix)) <= 1e-6:
        raise DataError(f"{path}: [{name}] matrix cannot be inverted; check its rows")
    if name == "magnetometer" and np.linalg.det(matrix) < 0:
        raise DataError(
            f"{path}: [{name}] matrix mirrors the field (its determinant is negative): check the "
            f"sign of each row and column"
        )
    if name == "magnetometer" and np.abs(bias).max() > MAX_BIAS:
        raise DataError(
            f"{path}: [{name}] bias is {bias.tolist()} T, beyond {MAX_BIAS * 1e3:g} mT, where the "
            f"Earth's field has 22 to 67 uT: "
            "it must be in T; is it in uT?"
        )
    return Correction(bias, matrix, _temperature(path, name, section))


def _check_bounded(value: Any, where: str, shape: tuple[int | None, ...]) -> Array:
    return check_array(value, where, shape, least=-MAX_NUMBER, most=MAX_NUMBER)


def _temperature(path: File, name: str, section: dict[str, Any]) -> tuple[tuple[float, ...], ...]:
    if "temperature" not in section:
        return ()
    where = f"{path}, {name}.temperature"
    rows = temperature_rows(section["temperature"], SECTIONS[name], where)
    if rows:
        _check_bounded(rows, f"{where}: rows", (None, 4))
    with locate_errors(where):
        return Triad(temperature=tuple(rows)).temperature


def compose_corrections(
    section: str, bias: Array, matrix: Array, columns: Mapping[str, Any]
) -> dict[str, Correction]:
    """Return {section: Correction} in the axes of the columns, for corrections matrix @ (x - bias)
    in body axes, with x = axes @ (own calibration of the columns).

    columns: the sensor's own frame from `description.calibrations.frames`; its key "gyro" keeps a
    calibration of the gyro beside that of the accelerometer.
    """
    axes, own = np.array(columns.get("axes", np.eye(3))), _own_correction(columns)
    to_body = axes @ own.matrix
    found = {
        section: Correction(
            own.bias + np.linalg.solve(to_body, bias), axes.T @ matrix @ to_body, own.temperature
        )
    }
    gyro = columns.get("gyro", {})
    return ({"gyro": _own_correction(gyro)} if set(gyro) - {"axes"} else {}) | found


def _own_correction(columns: Mapping[str, Any]) -> Correction:
    rows = tuple(tuple(row) for row in columns.get("temperature", ()))
    return Correction(
        np.array(columns.get("bias", np.zeros(3))), np.array(columns.get("matrix", np.eye(3))), rows
    )


def calibration_text(sections: Mapping[str, Correction], comments: Iterable[str]) -> str:
    """Return the text of a calibration file: {section: Correction}, after comment lines on its
    origin."""

    def numbers(values: Iterable[float]) -> str:
        return "[" + ", ".join(repr(float(f"{float(value):.12g}")) for value in values) + "]"

    def rows(table: Iterable[Iterable[float]]) -> str:
        return "[" + ", ".join(map(numbers, table)) + "]"

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


def write_calibration(
    path: File, sections: Mapping[str, Correction], comments: Iterable[str] = ()
) -> None:
    """Write {section: Correction} as a file that `read_corrections` reads. Raises DataError
    where it cannot be written."""
    with replacing(path) as part:
        part.write_text(calibration_text(sections, comments), encoding="utf-8")
