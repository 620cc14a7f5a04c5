"""[imu] of a u-blox receiver: its sensors as tables and sections of a description."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....typing import Array, Ints
from ....units.time_scales import rate_of
from ...reader import GUESS, Section
from ...tables.table_file import FileTable
from .ubx_frames import LAYOUTS, UbxFrames, UbxMessage
from .ubx_sensors import ACCEL, ACCEL_SCALE, GYRO, GYRO_SCALE, Samples, UbxSensors, sensors


class ImuEpochs(NamedTuple):
    """Epochs of the receiver that set the clock of the sensors."""

    place: Ints  # in the file (n,)
    gps: Array  # s (n,)
    absolute: bool


def imu_sections(
    path: Path,
    frames: UbxFrames,
    by: ImuEpochs,
    tables: dict[str, FileTable],
    left: list[str],
) -> list[Section]:
    """Return the sections of the IMU, those of the fastest message first."""
    mounting = mounting_angles(frames)
    read = {
        key: sensors(frames, key, by.place, by.gps)
        for key in (UbxMessage.ESF_RAW, UbxMessage.ESF_MEAS)
        if frames.count(key)
    }
    for key, each in read.items():
        if each is None:
            left.append(
                f"{key.title}: it lacks a gyro with an accelerometer, or NAV messages between its own that "
                f"would set its clock"
            )
    every = sorted(filter(None, read.values()), key=lambda each: -rate_of(each.gyro.t, 1e-6))
    sections: list[Section] = []
    for instance, each in enumerate(every):
        if len(each.gyro.t) and len(each.accel.t):
            sections.append(_imu(path, each, instance, mounting, by.absolute, tables))
            if each.lost:
                left.append(f"{each.name}: {each.lost} samples whose time is unknown")
    return sections


def _imu(
    path: Path,
    each: UbxSensors,
    instance: int,
    mounting: tuple[Mapping[str, Any], str],
    gps: bool,
    tables: dict[str, FileTable],
) -> Section:
    """[imu]; an accelerometer with its own times has its own table."""
    absolute = each.absolute and gps
    column = "gps_us" if absolute else "us"
    time: dict[str, Any] = {"column": column, "unit": "us"}
    if each.absolute:
        time |= {"clock": "gps"} if gps else {"clock": "gps", "week": None}
    assumed = {
        "axes": "the module lies flat with its x axis forward",
        "grade": "the MEMS IMU of the receiver",
    }
    if each.absolute:
        assumed["time"] = (
            f"the sensor's clock is set to GPS time from the order of the messages, within "
            f"{1e3 * each.scatter:.1f} ms plus the receiver's latency, which the file does not state"
        )
    angles, origin = mounting
    if angles:
        assumed["mounting"] = origin
    gyro = _signal(each.gyro, "gyro", GYRO, {"unit": "deg/s", "scale": GYRO_SCALE})
    accel = _signal(each.accel, "accel", ACCEL, {"unit": "m/s^2", "scale": ACCEL_SCALE})
    together = np.array_equal(each.gyro.t, each.accel.t)
    names = (each.name, each.name) if together else (f"{each.name} gyro", f"{each.name} accel")
    columns: dict[str, dict[str, Ints]] = {}
    for name, samples, (_, values) in zip(names, (each.gyro, each.accel), (gyro, accel)):
        columns.setdefault(name, {column: samples.t}).update(values)
    for name, values in columns.items():
        tables[name] = FileTable.of(f"{path} [{name}]", values, word="sample")
    keys = {
        "table": names[0],
        "time": time,
        "axes": "FLU" if angles else f"FLU{GUESS}",
        "gyro": gyro[0],
        "accel": accel[0] | ({} if together else {"table": names[1], "time": time}),
        **({"mounting": angles} if angles else {}),
        "grade": "consumer",
    }
    title = f"{each.name}, {rate_of(each.gyro.t, 1e-6):.0f} Hz"
    return Section("imu", "imu", keys, instance, title, assumed)


def _signal(
    samples: Samples, sensor: str, types: tuple[int, ...], unit: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Ints]]:
    """(the key `gyro` or `accel`, its columns)."""
    names = [f"{sensor}_{axis}" for axis in "xyz"]
    values = {name: samples.values[kind] for name, kind in zip(names, types)}
    return {"columns": names, **unit}, values


def mounting_angles(frames: UbxFrames) -> tuple[dict[str, Any], str]:
    """(the mounting of the receiver's IMU, its source), from ESF-ALG where the receiver has found
    the angles (status 3 and 4) or uses angles that a user has set (status 0). The angles rotate the
    installation frame (forward, left, up) to the IMU, yaw first; in forward, right, down yaw and
    pitch change their signs. Angles of 0 that were never set do not count. Empty without angles."""
    _, records = frames.records(UbxMessage.ESF_ALG, LAYOUTS[UbxMessage.ESF_ALG])
    status = records["flags"] >> 1 & 7
    turned = (records["yaw"] != 0) | (records["pitch"] != 0) | (records["roll"] != 0)
    ready = ((status >= 3) | (status == 0) & turned) & (records["error"] == 0)
    if not ready.any():
        return {}, ""
    last = records[ready][-1]
    origin = "found it" if status[ready][-1] else "has it from its settings"
    yaw, pitch, roll = (float(last[name]) / 100 for name in ("yaw", "pitch", "roll"))
    return {
        "roll": roll,
        "pitch": -pitch,
        "heading": -yaw,
        "unit": "deg",
    }, f"as the receiver {origin} (ESF-ALG)"
