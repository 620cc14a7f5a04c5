"""Reading and writing files: an hour of an IMU at 200 Hz and of fixes at 10 Hz from any format, tables
beside pandas, a solution as a table.

`python benchmarks/logs.py` prints these figures alone.
"""

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "src"), str(HERE.parent / "tests" / "support")]

import processes  # noqa: E402
import written_dataflash  # noqa: E402
import written_nmea  # noqa: E402
import written_phones  # noqa: E402
import written_ros  # noqa: E402
import written_rtklib  # noqa: E402
import written_ubx  # noqa: E402
import written_ulog  # noqa: E402

import strapdown as sd  # noqa: E402

SECONDS, RATE, FIX_RATE = 3600.0, 200.0, 10.0
ROWS = 100_000
"""Of the solution that is written."""
START = np.datetime64("2024-05-01T08:00:00", "ms")
TABLES = ["tables, reading over pandas", "tables, memory of reading", "tables, writing a row"]
HOURS_READ = ["an hour of logs, the slowest format"]
TOML = """
epoch = "2024-05-01T00:00:00Z"
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
grade = "tactical"
[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 2.0]
[[source]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1
"""


def drive():
    """Arrays of an hour of a car that turns and brakes, with noise: t, gyro, accel of the IMU and t,
    lla (deg, m), v_n of the fixes."""
    rng = np.random.default_rng(7)
    t = np.arange(1, int(SECONDS * RATE) + 1) / RATE
    gyro, accel = rng.normal(0.0, 1e-3, (len(t), 3)), rng.normal(0.0, 0.02, (len(t), 3))
    gyro[:, 2] += 0.05 * np.sin(t / 20)
    accel += [0.0, 0.0, -9.81]
    at = np.arange(1, int(SECONDS * FIX_RATE) + 1) / FIX_RATE
    lla = np.c_[47 + 1e-6 * at, 8 + 1e-6 * at, np.full(len(at), 500.0)]
    return (
        t,
        gyro,
        accel,
        at,
        lla + rng.normal(0, 1e-7, lla.shape),
        rng.normal(0.1, 0.02, lla.shape),
    )


def write_tables(folder, arrays):
    """recording.toml with two CSV files, and short.toml with their beginning."""
    t, gyro, accel, at, lla, v_n = arrays
    for name, head, rows in (
        ("imu.csv", "t,gx,gy,gz,ax,ay,az", np.c_[t, gyro, accel]),
        ("gnss.csv", "t,lat,lon,alt,vn,ve,vd", np.c_[at, lla, v_n]),
    ):
        for start, part in (("", rows), ("short-", rows[:2000])):
            np.savetxt(folder / (start + name), part, "%.9f", ",", header=head, comments="")
    (folder / "short.toml").write_text(TOML.replace('file = "', 'file = "short-'))
    path = folder / "recording.toml"
    path.write_text(TOML)
    return path


def seconds(function, times=3):
    """Median of the seconds that a call takes."""
    found = []
    for _ in range(times):
        begin = time.perf_counter()
        function()
        found.append(time.perf_counter() - begin)
    return float(np.median(found))


def tables():
    """[(value, note)] of TABLES."""
    import pandas as pd

    with tempfile.TemporaryDirectory() as name:
        folder, arrays = Path(name), drive()
        path = write_tables(folder, arrays)
        frames = lambda: [pd.read_csv(folder / each) for each in ("imu.csv", "gnss.csv")]
        frames(), sd.read(path)
        pairs = [(seconds(frames, 1), seconds(lambda: sd.read(path), 1)) for _ in range(5)]
        theirs, own = np.median(pairs, axis=0)
        ratio = float(np.median([a / b for a, b in pairs]))
        peak, size = processes.child(__file__, "memory", path)[1]
    return [
        (ratio, f"{own:.2f} s, pandas alone {theirs:.2f} s, an hour at 200 Hz and 10 Hz"),
        (
            peak / size,
            f"{peak / 1e6:.0f} MB at most, {size / 1e6:.0f} MB of arrays in the recording",
        ),
        (writing(), f"a solution of {ROWS} rows"),
    ]


def hours(formats=None):
    """{name of a format: (seconds that its hour takes to read, note)}."""
    found = {}
    with tempfile.TemporaryDirectory() as name:
        recording = as_recording(drive())
        for each, write in HOURS.items():
            if formats is None or each in formats:
                folder = Path(name) / each.replace(" ", "-")
                folder.mkdir()
                paths = write(folder, recording)
                size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
                read = lambda: sd.read(*paths)
                samples = len(read().imu.t)
                found[each] = seconds(read, 1), f"{samples} samples, {size / 1e6:.0f} MB"
    return found


def slowest():
    """[(seconds of the slowest, all of them)] of HOURS_READ."""
    found = hours()
    said = ", ".join(f"{name} {value:.1f}" for name, (value, _) in found.items())
    return [(max(value for value, _ in found.values()), f"in s: {said}")]


def as_recording(arrays):
    """The arrays of `drive` as a Recording."""
    t, gyro, accel, at, lla, v_n = arrays
    lla = lla * [np.pi / 180, np.pi / 180, 1.0]
    deviations = np.tile([1.0, 1.0, 2.0], (len(at), 1))
    sources = (
        sd.Source("position", at, lla, deviations),
        sd.Source("velocity", at, v_n, 0.1 * np.ones(v_n.shape)),
    )
    return sd.Recording.from_arrays(t, gyro, accel, sources)


def csv_hour(folder, recording):
    return [write_tables(folder, drive())]


def ulog_hour(folder, recording):
    written_ulog.write(folder / "hour.ulg", recording)
    return [folder / "hour.ulg"]


def dataflash_hour(folder, recording):
    written_dataflash.write(folder / "hour.bin", recording)
    return [folder / "hour.bin"]


def ubx_hour(folder, recording):
    path = folder / "hour.ubx"
    path.write_bytes(written_ubx.drive(int(SECONDS * RATE), int(RATE / FIX_RATE), 5)[0])
    return [path]


def imu_table(folder, recording):
    """A table of the IMU in Unix time, beside a receiver's file."""
    imu = recording.imu
    moments = START.astype(float) / 1e3 + imu.t
    values = np.c_[moments, imu.dtheta / imu.dt[:, None], imu.dv / imu.dt[:, None]]
    path = folder / "imu.csv"
    head = "unix_time_s,gyro_x_rad/s,gyro_y_rad/s,gyro_z_rad/s,acc_x_m/s^2,acc_y_m/s^2,acc_z_m/s^2"
    np.savetxt(path, values, "%.9f", ",", header=head, comments="")
    return path


def nmea_hour(folder, recording):
    position, velocity = recording.sources
    moments = START + np.round(position.t * 1e3).astype("timedelta64[ms]")
    lines = []
    for moment, lla, v in zip(moments, position.y, velocity.y):
        where = np.degrees(lla[0]), np.degrees(lla[1])
        knots, course = np.hypot(v[0], v[1]) * 3600 / 1852, np.degrees(np.arctan2(v[1], v[0])) % 360
        lines.append(written_nmea.gga(moment, *where, lla[2] - 47.2))
        lines.append(written_nmea.rmc(moment, *where, knots, course) + written_nmea.GSV)
    (folder / "hour.nmea").write_text("".join(lines))
    return [imu_table(folder, recording), folder / "hour.nmea"]


def pos_hour(folder, recording):
    position = recording.sources[0]
    moments = START + np.round(position.t * 1e3 + 18_000).astype("timedelta64[ms]")
    place = position.y * [180 / np.pi, 180 / np.pi, 1.0]
    text = written_rtklib.pos(moments, place, np.full((len(place), 6), 0.02))
    (folder / "hour.pos").write_text(text)
    return [imu_table(folder, recording), folder / "hour.pos"]


def bag_hour(folder, recording):
    written_ros.write_bag(folder / "hour.bag", written_ros.drive("ros1", recording), "lz4")
    return [folder / "hour.bag"]


def db3_hour(folder, recording):
    written_ros.write_bag2(folder / "hour", written_ros.drive("cdr", recording))
    return [folder / "hour"]


def mcap_hour(folder, recording):
    written_ros.write_mcap(folder / "hour.mcap", written_ros.drive("cdr", recording))
    return [folder / "hour.mcap"]


def phone_hour(write):
    def hour(folder, recording):
        files = write(written_phones.signals(SECONDS, RATE, FIX_RATE))
        written_phones.folder(folder / "hour", files)
        return [folder / "hour"]

    return hour


def gnsslogger_hour(folder, recording):
    text = written_phones.gnsslogger(written_phones.signals(SECONDS, RATE, FIX_RATE))
    (folder / "hour.txt").write_bytes(text)
    return [folder / "hour.txt"]


HOURS = {
    "CSV": csv_hour,
    "PX4 ULog": ulog_hour,
    "ArduPilot BIN": dataflash_hour,
    "UBX": ubx_hour,
    "NMEA and CSV": nmea_hour,
    "RTKLIB and CSV": pos_hour,
    "ROS bag 1": bag_hour,
    "ROS bag 2": db3_hour,
    "MCAP": mcap_hour,
    "Sensor Logger": phone_hour(written_phones.sensor_logger),
    "phyphox": phone_hour(written_phones.phyphox),
    "GnssLogger": gnsslogger_hour,
}
"""{format: function of (folder, Recording) that writes an hour and gives the paths to read}."""


def writing():
    """us a row of a solution as CSV."""
    motion = sd.simulate("car", 10.0, "consumer", seed=1)
    short = sd.fuse(motion)
    solution = repeated(short, ROWS)
    with tempfile.TemporaryDirectory() as name:
        sd.write_solution(short, Path(name) / "a.csv")
        return 1e6 * seconds(lambda: sd.write_solution(solution, Path(name) / "a.csv")) / ROWS


def repeated(solution, rows):
    """A solution of so many rows, those of another one again and again, later each time."""
    from dataclasses import replace

    n = len(solution.t)
    index = np.arange(rows) % n
    trajectory = solution.trajectory.take(index)
    later = (np.arange(rows) // n) * (solution.t[-1] - solution.t[0] + 0.01)
    return replace(
        solution,
        trajectory=replace(trajectory, t=trajectory.t + later),
        b_a=solution.b_a[index],
        b_g=solution.b_g[index],
        status=solution.status[index],
        columns={name: values[index] for name, values in solution.columns.items()},
        covariance=None,
        events=(),
        recording=None,
    )


def memory(path):
    """Bytes that reading takes at most above what the process had, and those of the arrays that it
    gives."""
    path = Path(path)
    sd.read(path.with_name("short.toml"))  # imports
    before = processes.memory()[0]
    found = sd.read(path)
    peak = processes.memory()[1] - before
    arrays = [*found.imu, *(each for a in found.sources for each in (a.t, a.y, a.std))]
    return [peak, sum(each.nbytes for each in arrays)]


if __name__ == "__main__" and sys.argv[1:2] == ["memory"]:
    print(json.dumps(memory(sys.argv[2])))
elif __name__ == "__main__":
    for figure, (value, note) in zip(TABLES, tables()):
        print(f"{figure}: {value:.3g}  ({note})")
    for name, (value, note) in hours(sys.argv[1:] or None).items():
        print(f"an hour of {name}: {value:.2f} s  ({note})", flush=True)
