"""Small whole files of each format for the tests with damaged files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import written_nmea as nmea
import written_ubx as ubx
from mutations import Case
from written_phones import (
    START as ZERO,
    folder,
    gnsslogger,
    phyphox,
    sensor_logger,
    signals,
    zipped,
)
from written_rtklib import pos

import strapdown as sd

START = np.datetime64(ZERO // 10**9 * 1000, "ms")
"""UTC of the first fix."""
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


def ubx_case(_: Path) -> Case:
    """An IMU at 100 Hz in two kinds of message, fixes among NMEA and text."""
    n = 400
    counts = np.random.default_rng(3).integers(-900, 900, (n, 6)) + [0, 0, 0, 0, 0, 10042]
    tag, t = 5_000_000 + 10 * np.arange(n), 1_400_000_000_000 + 100 * np.arange(n // 10)
    raw = ubx.esf_raw(tag, counts[:, :3], counts[:, 3:]).reshape(n // 10, -1)
    fixes = ubx.pvt(t, lat=450000000 + 9 * np.arange(n // 10), height=200_000)
    other = ubx.esf_meas(tag[::10], (14, 13, 5, 16, 17, 18), counts[::10])
    text = np.frombuffer(nmea.gga(START, 45.0, 7.0, 200).encode(), np.uint8)
    parts = [fixes, raw, other, np.tile(text, (n // 10, 1))]
    return alone("ubx", "drive.ubx", np.concatenate(parts, axis=1).tobytes())


def epochs():
    """(moment, latitude) of a receiver's fixes beside the IMU."""
    return [(START + 500 * i * np.timedelta64(1, "ms"), 45 + 1e-6 * i) for i in range(10)]


def nmea_case(_: Path) -> Case:
    lines = [
        nmea.gga(t, lat, 7.0, 200) + nmea.rmc(t, lat, 7.0, 3, 90) + nmea.gst(t, 1, 1, 2) + nmea.GSV
        for t, lat in epochs()
    ]
    return beside("nmea", "gnss.nmea", "".join(lines).encode())


def rtklib_case(_: Path) -> Case:
    place = [(lat, 7.0, 250.0) for _, lat in epochs()]
    sd = [(0.01, 0.01, 0.02, 0.001, 0.002, -0.001)] * len(place)
    text = pos([t for t, _ in epochs()], place, sd, scale="UTC")
    return beside("rtklib", "gnss.pos", text.encode())


def alone(name: str, file: str, content: bytes) -> Case:
    """One file that is a recording."""
    return Case(name, {file: content}, (file,), (file,))


def beside(name: str, file: str, content: bytes) -> Case:
    """A file without an IMU, read beside one."""
    files = imu_beside() | {file: content}
    return Case(name, files, tuple(files), (file,))


CASES: dict[str, Callable[[Path], Case]] = {
    "sensor-logger": sensor_logger_case,
    "phyphox": phyphox_case,
    "zip": zip_case,
    "gnsslogger": gnsslogger_case,
    "netcdf": netcdf_case,
    "ubx": ubx_case,
    "nmea": nmea_case,
    "rtklib": rtklib_case,
}
