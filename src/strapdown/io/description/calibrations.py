"""The calibration files that a description names: applied to the IMU, and kept in the metadata of
the Recording."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...checks import DataError
from ...core.loop.contract import Imu
from ...data.recording import RecordingMeta
from ...data.solution import Source
from ...typing import Array
from ...units.wording import count_text
from ..calibration_file import HEATED, NONE, Correction, read_corrections
from .schema import Description, ImuPart, Temperature
from .source_files import Files


def of_the_imu(part: ImuPart, files: Files) -> dict[str, Correction]:
    """{"gyro": Correction, "accel": Correction} that [imu] names; zero and identity without one.
    Raises DataError."""
    found = (
        read_corrections(files.locate(part.calibration))
        if part.calibration
        else {"gyro": NONE, "accel": NONE}
    )
    tables = [name for name in HEATED if found[name].temperature]
    if tables and part.temperature is None:
        raise DataError(
            f"{files.path}: [imu] temperature: is missing; the table of {tables[0]} in "
            f"{part.calibration} needs "
            'temperature = { column = "...", unit = "degC" }'
        )
    return found


def calibrate_imu(part: ImuPart, files: Files, imu: Imu) -> tuple[Array, Array, list[str]]:
    """(increments of the gyro and of the accelerometer (n, 3) in the axes of the columns, notes):
    an Imu after the calibration of [imu].

    Raises DataError.
    """
    found = of_the_imu(part, files)
    notes: list[str] = []
    results = []
    for name, increments in (("gyro", imu.dtheta), ("accel", imu.dv)):
        correction, bias = found[name], found[name].bias
        if correction.temperature and part.temperature is not None:
            temperature = np.interp(imu.t, *temperatures(part, part.temperature, files))
            bias, outside = correction.at(temperature)
            if outside.any():
                low, high, beyond = (
                    correction.temperature[0][0],
                    correction.temperature[-1][0],
                    temperature[outside],
                )
                notes.append(
                    f"{name}: {count_text(len(beyond), 'sample')} at {beyond.min():.1f} to "
                    f"{beyond.max():.1f} degC, "
                    f"outside the temperature table ({low:g} to {high:g} degC); the bias at its end "
                    f"is used there"
                )
        if np.any(bias):
            increments = increments - bias * imu.dt[:, None]
        if not np.array_equal(correction.matrix, np.eye(3)):
            increments = increments @ correction.matrix.T
        results.append(increments)
    gyro, accel = results
    return gyro, accel, notes


def temperatures(part: ImuPart, column: Temperature, files: Files) -> tuple[Array, Array]:
    """(t (m,) s, (m,) degC) of the cells that are not empty, in time order. Raises DataError
    without any."""
    table, t, (values,), _ = files.columns(
        part.file,
        column.time or part.time,
        [column.column],
        column.table or part.table,
        part.where if column.table is None else (),
    )
    known = np.isfinite(t) & np.isfinite(values)
    if not known.any():
        raise DataError(
            f"{table.name}: column {column.column!r} holds no temperature; leave [imu] temperature "
            f"out"
        )
    order = np.argsort(t[known], kind="stable")
    return t[known][order], values[known][order] * column.scale + column.offset


def kept_temperatures(part: ImuPart, files: Files) -> RecordingMeta:
    """{"temperature": (m, 2) s and degC} for the metadata of a Recording, at most one per second;
    empty where [imu] names none. Raises DataError."""
    if part.temperature is None:
        return {}
    t, values = temperatures(part, part.temperature, files)
    first = np.flatnonzero(np.diff(np.floor(t), prepend=-np.inf))
    count = np.diff(np.r_[first, len(t)])
    means = [np.add.reduceat(each, first) / count for each in (t, values)]
    return {"temperature": np.column_stack(means)}


def frames(
    description: Description, files: Files, sources: Iterable[Source]
) -> dict[str, dict[str, Any]]:
    """{"gyro", "accel" and names of magnetometers: {"axes", "bias", "matrix", "temperature",
        "field"}} as lists, for the metadata of a Recording.

    A later calibration in body axes needs them to return to the axes of the columns. A missing
    entry means identity, zero or none.
    """
    imu = description.imu
    found = (
        {
            name: _frame(imu.matrix, correction)
            for name, correction in of_the_imu(imu, files).items()
        }
        if imu.calibration
        else dict.fromkeys(HEATED, _frame(imu.matrix, NONE))
    )
    for part, source in zip(description.source, sources):
        if part.sensor.parameters == "field":
            correction = (
                read_corrections(files.locate(part.calibration)).get("magnetometer", NONE)
                if part.calibration
                else NONE
            )
            found[source.name] = _frame(part.vector_matrix, correction) | (
                {"field": "record"} if part.field == "record" else {}
            )
    return {name: frame for name, frame in found.items() if frame}


def _frame(axes: Array, correction: Correction) -> dict[str, Any]:
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
