"""Small whole files of each format for the tests with damaged files."""

import io
import lzma
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import recordings
import written_dataflash
import written_nmea
import written_ros
import written_rtklib
import written_ubx
import written_ulog
from multicopter import motion
from mutations import Case
from scipy.io import savemat
from written_phones import START, gnsslogger, phyphox, sensor_logger, signals, zipped

import strapdown as sd
from strapdown.io.readers import live_log

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
    """A recording with fixes and a reference."""
    sd.write_recording(flight(), tmp_path / "recording.nc")
    return alone("netcdf", "recording.nc", (tmp_path / "recording.nc").read_bytes())


def alone(name: str, file: str, content: bytes) -> Case:
    """One file that is a recording."""
    return Case(name, {file: content}, (file,), (file,))


def beside(name: str, file: str, content: bytes) -> Case:
    """A file without an IMU, read beside one."""
    files = imu_beside() | {file: content}
    return Case(name, files, tuple(files), (file,))


def flight():
    """A short simulated Recording with fixes."""
    return recordings.flight(SECONDS, 25.0)


def bag_case(tmp_path: Path) -> Case:
    path = tmp_path / "drive.bag"
    written_ros.write_bag(path, written_ros.drive("ros1", flight()), "lz4")
    return alone("rosbag1", "drive.bag", path.read_bytes())


def bag2_case(tmp_path: Path) -> Case:
    path = tmp_path / "drive"
    written_ros.write_bag2(path, written_ros.drive("cdr", flight()))
    files = {file.name: file.read_bytes() for file in path.iterdir()}
    return Case("rosbag2", files, ("",), tuple(files))


def mcap_case(tmp_path: Path) -> Case:
    path = tmp_path / "drive.mcap"
    written_ros.write_mcap(path, written_ros.drive("cdr", flight()), "none", chunk_size=4000)
    return alone("mcap", "drive.mcap", path.read_bytes())


def packed_mcap_case(tmp_path: Path) -> Case:
    path = tmp_path / "drive.mcap"
    written_ros.write_mcap(path, written_ros.drive("cdr", flight()), "zstd", chunk_size=4000)
    return alone("packed mcap", "drive.mcap", path.read_bytes())


def receiver():
    """(moments of UTC, speed in m/s, course in deg, latitude, longitude, height) of fixes beside
    `imu_beside`."""
    s = walk()
    moments = np.datetime64(START, "ns") + np.round(s.fix_t * 1e9).astype("timedelta64[ns]")
    return moments.astype("datetime64[ms]"), s.speed, s.course, *s.fixes.T


def nmea_case(_: Path) -> Case:
    text = ""
    for moment, *values in zip(*receiver()):
        speed, course, latitude, longitude, height = map(float, values)
        where = moment, latitude, longitude
        text += written_nmea.gga(*where, height - 48.0, 48.0) + written_nmea.GSV
        text += written_nmea.rmc(*where, speed / 0.514444, course)
        text += written_nmea.gst(moment, 1.0, 1.0, 2.0)
    return beside("nmea", "gnss.nmea", text.encode())


def rtklib_case(_: Path) -> Case:
    moments, _, _, *place = receiver()
    deviations = np.tile([0.1, 0.1, 0.2, 0.0, 0.0, 0.0], (len(moments), 1))
    text = written_rtklib.pos(moments, np.stack(place, axis=1), deviations, scale="UTC")
    return beside("rtklib", "gnss.pos", text.encode())


def ubx_case(_: Path) -> Case:
    moments = receiver()[0]
    gps = moments.astype(np.int64) - 315_964_800_000 + 18_000
    carrier = 1 | np.arange(len(gps)) % 3 << 6
    baselines = written_ubx.relposned(gps, np.tile([9000, 700, -30], (len(gps), 1)))
    frames = np.concatenate([written_ubx.pvt(gps, flags=carrier), baselines], axis=1)
    return beside("ubx", "gnss.ubx", frames.tobytes())


def ubx_imu_case(_: Path) -> Case:
    """A receiver with an IMU at rest: 100 Hz, a fix after each ten samples."""
    rng, n, per_fix = np.random.default_rng(1), 300, 10
    gyro, accel = rng.integers(-40, 40, (n, 3)), rng.integers(-40, 40, (n, 3)) + [0, 0, 10042]
    raw = written_ubx.esf_raw(5_000_000 + 10 * np.arange(n), gyro, accel)
    fixes = written_ubx.pvt(1_399_999_982_000 + 10 * per_fix * np.arange(n // per_fix))
    both = np.concatenate([fixes, raw.reshape(n // per_fix, -1)], axis=1)
    return alone("ubx with IMU", "car.ubx", both.tobytes())


PSINS = """% PSINS-format SIMU log file.

0.5 -0.25 -90.6 1.0 2.0 3.0
34.246048 108.909664 380.0 100.0 10.0 9.780327
0.1 0.2 0.3 125.0 100.0 50.0
"""


def live_log_case(_: Path) -> Case:
    """A log of strapdown live."""
    recording = flight()
    start = sd.align(recording, sd.imu("tactical"))
    text = live_log.head_line("closed-loop", recording.sources, start, "tactical", None, {})
    rows = zip(*(column.tolist() for column in recording.imu))
    text += "".join(live_log.sample_line(*row) for row in rows)
    for s, a in enumerate(recording.sources):
        fixes = zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
        text += "".join(live_log.fix_line(s, t, y, std) for t, y, std in fixes)
    return alone("live log", "log.jsonl", text.encode())


def psins_case(_: Path) -> Case:
    rows = "".join(f"{k % 3} {20 - k % 7} -300 4 5 {200 + k % 5}\n" for k in range(200))
    return alone("psins", "log.imu", (PSINS + rows).encode())


def broad_case(_: Path) -> Case:
    n, out = 300, io.BytesIO()
    t = np.arange(n) / 100
    still = np.tile(np.float32([0.0, 0.0, 9.81]), (n, 1))
    np.savez(
        out,
        fs=np.array(100.0),
        gyr=np.float32(1e-3 * np.sin(np.outer(t, [1, 2, 3]))),
        acc=still + np.float32(1e-3 * np.cos(np.outer(t, [3, 2, 1]))),
        mag=np.tile(np.float32([0.0, 18.0, -45.0]), (n, 1)),
        quat_wxyz_enu=np.tile(np.float32([1, 0, 0, 0]), (n, 1)),
        pos_enu=np.tile(np.float32([1.0, 2.0, 3.0]), (n, 1)),
        movement=t > 2.5,
    )
    return alone("broad", "trial.npz", out.getvalue())


TOML = """date = "2024-05-01"

[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
axes = "RFU"
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }

[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = ["std", "std", { column = "std", unit = "m", scale = 1.5 }]
"""


def table_files() -> dict[str, bytes]:
    """Tables with one time."""
    s = walk()
    imu = "t,gx,gy,gz,ax,ay,az\n" + "".join(
        ",".join(f"{each:.6f}" for each in row) + "\n" for row in np.c_[s.t, s.gyro, s.accel]
    )
    gnss = "t,lat,lon,alt,std\n" + "".join(
        ",".join(f"{each:.9f}" for each in row) + ",2.0\n" for row in np.c_[s.fix_t, s.fixes]
    )
    return {"imu.csv": imu.encode(), "gnss.csv": gnss.encode()}


def description_case(_: Path) -> Case:
    files = table_files() | {"recording.toml": TOML.encode()}
    return Case("recording.toml", files, ("recording.toml",), tuple(files))


def packed_case(_: Path) -> Case:
    """A table that is packed: what damages it is found while it is unpacked."""
    files = table_files()
    packed = {"imu.csv.xz": lzma.compress(files["imu.csv"]), "gnss.csv": files["gnss.csv"]}
    text = TOML.replace("imu.csv", "imu.csv.xz").encode()
    return Case("packed", packed | {"recording.toml": text}, ("recording.toml",), ("imu.csv.xz",))


def tables_case(_: Path) -> Case:
    files = table_files()
    return Case("table", files, tuple(files), tuple(files))


def arrays():
    """Columns of a table with an IMU and no fixes."""
    s = walk()
    values = np.c_[s.t, s.gyro, s.accel]
    return dict(zip(("t_s", "gx_rad_s", "gy_rad_s", "gz_rad_s", "ax", "ay", "az"), values.T))


ARRAYS = """[imu]
file = "{}"
time = {{ column = "t_s", unit = "s" }}
axes = "RFU"
gyro = {{ columns = ["gx_rad_s", "gy_rad_s", "gz_rad_s"], unit = "rad/s" }}
accel = {{ columns = ["ax", "ay", "az"], unit = "m/s^2" }}
"""


def described(name: str, file: str, content: bytes) -> Case:
    """A table of arrays with its description."""
    files = {file: content, "recording.toml": ARRAYS.format(file).encode()}
    return Case(name, files, ("recording.toml",), (file,))


def matlab_case(tmp_path: Path) -> Case:
    path = tmp_path / "imu.mat"
    savemat(path, {key: values[:, None] for key, values in arrays().items()}, do_compression=True)
    return described("matlab", "imu.mat", path.read_bytes())


def parquet_case(tmp_path: Path) -> Case:
    path = tmp_path / "imu.parquet"
    pd.DataFrame(arrays()).to_parquet(path)
    return described("parquet", "imu.parquet", path.read_bytes())


def unread_case(_: Path) -> Case:
    """RTCM 3, which is refused by its content after all other formats were looked for."""
    frame = bytes.fromhex("D300133ED7D30202980EDEEF34B4BD62AC0941986F33360B98")
    made = alone("unread", "a.bin", b"uexUUaaD" + 30 * frame)
    return made._replace(refused=True)


def copter():
    """A recording of a multicopter, brief."""
    return sd.simulate(motion(), duration=4, imu="consumer", rate=50.0)


def ulog_case(_: Path) -> Case:
    return alone("ulog", "a.ulg", written_ulog.ulog(written_ulog.topics_of(copter())))


def dataflash_case(_: Path) -> Case:
    messages = written_dataflash.messages_of(copter())
    return alone("dataflash", "a.bin", written_dataflash.dataflash(messages))


CASES: dict[str, Callable[[Path], Case]] = {
    "sensor-logger": sensor_logger_case,
    "phyphox": phyphox_case,
    "zip": zip_case,
    "gnsslogger": gnsslogger_case,
    "netcdf": netcdf_case,
    "ulog": ulog_case,
    "dataflash": dataflash_case,
    "rosbag1": bag_case,
    "rosbag2": bag2_case,
    "mcap": mcap_case,
    "packed mcap": packed_mcap_case,
    "nmea": nmea_case,
    "rtklib": rtklib_case,
    "ubx": ubx_case,
    "ubx with IMU": ubx_imu_case,
    "psins": psins_case,
    "live log": live_log_case,
    "broad": broad_case,
    "recording.toml": description_case,
    "packed table": packed_case,
    "table": tables_case,
    "matlab": matlab_case,
    "parquet": parquet_case,
    "unread": unread_case,
}
