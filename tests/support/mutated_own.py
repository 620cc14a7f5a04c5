"""Small whole files of what the package writes or asks for itself, and of further tables: cases for
the tests with damaged files."""

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import looks
import nine_axis
import numpy as np
import synthetic
from mutated_cases import TOML, alone, arrays, described, table_files
from mutations import Case

import strapdown as sd
from strapdown.experiments.monte_carlo.study import Study
from strapdown.io.calibration_file import Correction, write_calibration
from strapdown.sim.scenario import Scenario
from strapdown.sim.trajectory import demo_flight


def written(tmp_path: Path, name: str) -> Case:
    """A solution with its covariances, as a file of that name."""
    made = synthetic.solution(synthetic.flight(20, rate=2.0))
    path = tmp_path / name
    made = replace(made, covariance=np.tile(np.eye(15), (len(made.t), 1, 1)))
    sd.write_solution(made, path)
    return alone(name, path.name, path.read_bytes())._replace(look=looks.solution)


def campaign_case(tmp_path: Path) -> Case:
    """The folder of a study of two runs, each a chunk."""
    flown = Scenario("short", demo_flight(), 5.0, rate=20.0)
    study = Study(flown, filters=("closed-loop",), runs=2, chunk_steps=100)
    study.run(tmp_path / "study", threads=1)
    files = {
        str(file.relative_to(tmp_path / "study")): file.read_bytes()
        for file in sorted((tmp_path / "study").rglob("*"))
        if file.suffix in (".nc", ".json")
    }
    return Case("campaign", files, ("",), tuple(files), looks.campaign)


def manifest_case(tmp_path: Path) -> Case:
    return campaign_case(tmp_path)._replace(name="manifest", bent=("manifest.json",))


SCENARIO = """name = "valley"
imu = "industrial"
rate_hz = 100
duration_s = 100
date = "2025-06-01"

[motion]
kind = "flight"
start = { latitude_deg = 46.5, longitude_deg = 9.8, height_m = 1900 }
course_deg = 220
speed_m_s = 35
legs = [
    { duration_s = 40 },
    { turn_deg = 180, bank_deg = 30 },
    { repeat = 2, legs = [
        { duration_s = 30, climb_m_s = 2, speed_m_s = 40 },
        { turn_deg = -90, bank_deg = 20 },
    ] },
]

[gnss]
interval_s = 0.2
position_std_m = [1.5, 1.5, 3]
velocity_std_m_s = 0.1
lever_arm_m = [0.4, 0, -1.1]
outages_s = [[60, 90]]

[[sensors]]
kind = "altitude"
std = 2
rate_hz = 5
parameters = [0, 0, -0.4]
"""
PLAN = """name = "field"
place = { latitude_deg = 47.63, longitude_deg = 9.35, height_m = 500 }
waypoints_m = [[0, 0, 0], [500, 0, 20], [500, 500, 40], [0, 500, 0]]
airspeed_m_s = [25, 26, 24]
start_airspeed_m_s = 25
clearance_m = 100
bank_deg = 30
duration_s = 60
"""


def settings(look: Callable[[list[Path], bool], str], text: str) -> Case:
    name = look.__name__
    return alone(name, f"{name}.toml", text.encode())._replace(look=look)


def shipped(*parts: str) -> str:
    return Path(sd.__file__).parent.joinpath(*parts).read_text(encoding="utf-8")


def aircraft_case(_: Path) -> Case:
    return settings(looks.aircraft, shipped("flight", "aircraft_model", "sets", "aerosonde.toml"))


def grade_case(_: Path) -> Case:
    return settings(looks.grade, shipped("sensor_models", "grades", "consumer.toml"))


def calibration_case(tmp_path: Path) -> Case:
    found = Correction(
        np.array([1e-3, 2e-3, -1e-3]), np.eye(3), ((-20.0, 1e-3, 0, 0), (60.0, 0, 0, 1e-3))
    )
    field = Correction(np.array([1e-5, 2e-5, -1e-5]), 1.01 * np.eye(3))
    write_calibration(tmp_path / "c.toml", {"gyro": found, "magnetometer": field}, ["by hand"])
    return settings(looks.calibration, (tmp_path / "c.toml").read_text(encoding="utf-8"))


def noise_case(_: Path) -> Case:
    return settings(looks.noise, NOISE)


NOISE = """# found by hand
[GNSS]
std_factor = [1.9, 1.9, 2.4]  # 95 %
correlated = { std = [1.5, 1.5, 3.0], time = 30.0, states = false }

["heading"]
std_factor = 0.5
correlated = { std = 2, time = 9 }
"""


def described_case(_: Path) -> Case:
    """A description with a magnetometer and its calibration, attitudes, and a reference."""
    files = {"calibration.toml": b"[magnetometer]\nbias = [1e-6, 0, 0]\n"}
    for name, frame in zip(("imu", "mag"), nine_axis.tables()):
        files[f"{name}.csv"] = frame.iloc[:400].to_csv(index=False).encode()
    rows = "".join(f"{t},{t / 9},{-t / 9},{350 + t}\n" for t in range(8))
    files["attitude.csv"] = b"t,roll,pitch,heading\n" + rows.encode()
    text = nine_axis.TOML + 'calibration = "calibration.toml"\n' + ATTITUDE
    files["recording.toml"] = text.encode()
    return Case("nine axes", files, ("recording.toml",), tuple(files))


ATTITUDE = """
[[source]]
kind = "attitude"
file = "attitude.csv"
time = { column = "t", unit = "s" }
columns = ["roll", "pitch", "heading"]
unit = "deg"
std = 1.0

[reference]
file = "attitude.csv"
time = { column = "t", unit = "s" }
attitude = { columns = ["roll", "pitch", "heading"], unit = "deg" }
"""


def european_case(_: Path) -> Case:
    """Tables with decimal commas, blanks or semicolons, and dates, one of them packed."""
    files = table_files()
    imu = files["imu.csv"].replace(b",", b";").replace(b".", b",")
    content = {"imu.csv": b"\xef\xbb\xbf" + imu, "gnss.csv.gz": gzip.compress(files["gnss.csv"])}
    text = TOML.replace('"gnss.csv"', '"gnss.csv.gz"').encode()
    files = {**content, "recording.toml": text}
    return Case("european", files, ("recording.toml",), ("imu.csv", "gnss.csv.gz"))


HEADERLESS = """[imu]
file = "imu.csv"
time = { column = 1, unit = "s" }
axes = "RFU"
gyro = { columns = [2, 3, 4], unit = "rad/s" }
accel = { columns = [5, 6, 7], unit = "m/s^2" }
"""


def headerless_case(_: Path) -> Case:
    rows = table_files()["imu.csv"].partition(b"\n")[2]
    files = {"imu.csv": rows, "recording.toml": HEADERLESS.encode()}
    return Case("headerless", files, ("recording.toml",), tuple(files))


def matlab_73_case(tmp_path: Path) -> Case:
    import h5py

    path = tmp_path / "imu.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays().items():
            file[name] = values[None]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    return described("matlab 7.3", "imu.mat", path.read_bytes())


OWN: dict[str, Callable[[Path], Case]] = {
    "solution.nc": lambda tmp_path: written(tmp_path, "solution.nc"),
    "solution.csv": lambda tmp_path: written(tmp_path, "solution.csv"),
    "campaign": campaign_case,
    "manifest": manifest_case,
    "scenario": lambda _: settings(looks.scenario, SCENARIO),
    "plan": lambda _: settings(looks.plan, PLAN),
    "aircraft": aircraft_case,
    "grade": grade_case,
    "calibration": calibration_case,
    "noise of sources": noise_case,
    "nine axes": described_case,
    "european table": european_case,
    "headerless table": headerless_case,
    "matlab 7.3": matlab_73_case,
}
