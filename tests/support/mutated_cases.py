"""Small whole files of each format for the tests with damaged files."""

from collections.abc import Callable
from pathlib import Path

import written_dataflash
import written_ulog
from multicopter import motion
from mutations import Case
from written_phones import folder, gnsslogger, phyphox, sensor_logger, signals, zipped

import strapdown as sd

SECONDS = 4.0
"""Of the recordings: enough for a few fixes."""


def walk():
    """Signals of a phone, for the formats of phones and as the IMU beside a receiver's file."""
    return signals(SECONDS, 50.0)


def imu_beside() -> dict[str, bytes]:
    """An IMU on UTC in two tables."""
    files = sensor_logger(walk())
    return {name: files[name] for name in ("Gyroscope.csv", "TotalAcceleration.csv")}


def sensor_logger_case(_: Path) -> Case:
    files = sensor_logger(walk())
    return Case("sensor-logger", files, ("",), tuple(files))


def phyphox_case(_: Path) -> Case:
    files = phyphox(walk(), pause=(2.0, 0.5))
    return Case("phyphox", files, ("",), tuple(files))


def zip_case(tmp_path: Path) -> Case:
    path = zipped(tmp_path / "walk.zip", sensor_logger(signals(2.0, 50.0)))
    return Case("zip", {"walk.zip": path.read_bytes()}, ("walk.zip",), ("walk.zip",))


def gnsslogger_case(_: Path) -> Case:
    return alone("gnsslogger", "log.txt", gnsslogger(walk()))


def netcdf_case(tmp_path: Path) -> Case:
    path = tmp_path / "recording.nc"
    folder(tmp_path / "walk", sensor_logger(walk()))
    sd.write_recording(sd.read(tmp_path / "walk"), path)
    return alone("netcdf", "recording.nc", path.read_bytes())


def alone(name: str, file: str, content: bytes) -> Case:
    """One file that is a recording."""
    return Case(name, {file: content}, (file,), (file,))


def beside(name: str, file: str, content: bytes) -> Case:
    """A file without an IMU, read beside one."""
    files = imu_beside() | {file: content}
    return Case(name, files, tuple(files), (file,))


def flight():
    """A recording of a multicopter, brief."""
    return sd.simulate(motion(), duration=4, imu="consumer", rate=50.0)


def ulog_case(_: Path) -> Case:
    return alone("ulog", "a.ulg", written_ulog.ulog(written_ulog.topics_of(flight())))


def dataflash_case(_: Path) -> Case:
    messages = written_dataflash.messages_of(flight())
    return alone("dataflash", "a.bin", written_dataflash.dataflash(messages))


CASES: dict[str, Callable[[Path], Case]] = {
    "sensor-logger": sensor_logger_case,
    "phyphox": phyphox_case,
    "zip": zip_case,
    "gnsslogger": gnsslogger_case,
    "netcdf": netcdf_case,
    "ulog": ulog_case,
    "dataflash": dataflash_case,
}
