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

import strapdown as sd  # noqa: E402

SECONDS, RATE, FIX_RATE = 3600.0, 200.0, 10.0
ROWS = 100_000
"""Of the solution that is written."""
TABLES = ["tables, reading over pandas", "tables, memory of reading", "tables, writing a row"]
TOML = """
epoch = "2024-05-01T00:00:00Z"
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
grade = "tactical"
[[aiding]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
sd = [1.0, 1.0, 2.0]
[[aiding]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
sd = 0.1
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
    trajectory = solution.trajectory.taking(index)
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
    arrays = [*found.imu, *(each for a in found.aidings for each in (a.t, a.y, a.sd))]
    return [peak, sum(each.nbytes for each in arrays)]


if __name__ == "__main__" and sys.argv[1:2] == ["memory"]:
    print(json.dumps(memory(sys.argv[2])))
elif __name__ == "__main__":
    for figure, (value, note) in zip(TABLES, tables()):
        print(f"{figure}: {value:.3g}  ({note})")
