"""Solutions of RTKLIB: equality with what was written in each of its forms, the drive that is also
there as CSV, and damage."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from support.written_rtklib import pos

import strapdown as sd
from strapdown.checks import DataError
from strapdown.geometry.geodesy import displacement, ned_axes, to_ecef
from strapdown.io.description.logs import join
from strapdown.io.readers.rtklib import open_pos
from strapdown.preprocessing.receiver_classes import join_classes

pytestmark = pytest.mark.short
START = np.datetime64("2024-06-01T23:59:50.000", "ms")
T = START + 250 * np.arange(100) * np.timedelta64(1, "ms")
LLH = np.stack(
    [40 + 1e-6 * np.arange(100), -105 - 2e-6 * np.arange(100), 1600 + 0.01 * np.arange(100)], 1
)
STD = np.tile([0.01, 0.02, 0.03, 0.005, -0.004, 0.006], (100, 1))
EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
GRADE = EXAMPLES / "drive0708-imu"


@pytest.fixture
def written(tmp_path):
    """Function of the arguments of `pos` -> Log."""

    def write(*arguments, **named):
        path = tmp_path / "a.pos"
        path.write_text(pos(*arguments, **named))
        return open_pos(path)

    return write


IMU = """
[imu]
file = "imu.csv"
time = { column = "t", unit = "s", clock = "unix" }
gyro = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
"""


def read(tmp_path, log):
    """The recording of a log's sections, written as text, beside an IMU at rest."""
    values = np.random.default_rng(1).normal(0, 0.01, (2600, 6)) - [0, 0, 0, 0, 0, 9.8]
    frame = pd.DataFrame(values, columns=["gx", "gy", "gz", "ax", "ay", "az"])
    frame["t"] = START.astype(np.int64) / 1e3 - 18 + 0.01 * np.arange(2600)
    frame.to_csv(tmp_path / "imu.csv", index=False)
    text = join({tmp_path / "a.pos": log}).text(tmp_path) + IMU
    (tmp_path / "recording.toml").write_text(text)
    return sd.read(tmp_path / "recording.toml")


@pytest.mark.parametrize("form", ["llh", "dms"])
@pytest.mark.parametrize("weeks", [False, True])
@pytest.mark.parametrize("separator", [" ", "  ", ","])
def test_rows_are_those_that_were_written(written, form, weeks, separator):
    log = written(T, LLH, STD, form, weeks=weeks, separator=separator)
    frame = log.tables["solution"].frame
    assert (frame["gps_ms"] == (T - np.datetime64("1980-01-06", "ms")).astype(np.int64)).all()
    for i, name in enumerate(("latitude", "longitude", "height")):
        assert np.allclose(frame[name], LLH[:, i], atol=3e-9 if i < 2 else 1e-4)
    names = ["sdn", "sde", "sdu", "sdne", "sdeu", "sdun"]
    assert np.allclose(frame[names], STD)
    assert log.sections[0].keys["std"] == ["sdn", "sde", "sdu"] and not log.left


@pytest.mark.parametrize("scale, behind", [("GPST", 18), ("UTC", 0), ("JST", 9 * 3600)])
def test_time_scales_are_known(written, tmp_path, scale, behind):
    log = written(T, LLH, STD, scale=scale)
    frame, time = log.tables["solution"].frame, log.sections[0].keys["time"]
    unix = T.astype(np.int64) - 1000 * behind
    if scale == "GPST":
        assert time["clock"] == "gps"
        unix = unix - 1000 * (315964800 - 18)
    assert (frame[time["column"]] == unix).all()


def test_ecef_and_its_covariance(written, tmp_path):
    lla = LLH * [np.pi / 180, np.pi / 180, 1]
    C = Rotation.from_euler("xyz", [0.3, -0.5, 1.1]).as_matrix()
    P = C @ np.diag([0.01, 0.04, 0.09]) ** 2 @ C.T
    parts = P[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]
    roots = np.tile(np.sign(parts) * np.sqrt(np.abs(parts)), (100, 1))
    log = written(T, to_ecef(lla), roots, "xyz")
    assert log.sections[0].keys["axes"] == "ECEF" and len(log.sections[0].keys["std"]) == 6
    position = read(tmp_path, log).sources[0]
    assert np.abs(displacement(position.y, lla[: len(position.y)])).max() < 2e-4
    axes = ned_axes(lla[0])
    assert np.allclose(position.std, np.sqrt(np.diag(axes @ P @ axes.T)), atol=2e-4)


def test_a_baseline_needs_its_base(written, tmp_path):
    base = np.array([40.0, -105.0, 1600.0])
    enu = np.stack([0.5 * np.arange(100), -0.2 * np.arange(100), 0.01 * np.arange(100)], 1)
    head = f"% ref pos   : {base[0]:.9f} {base[1]:.9f} {base[2]:.4f}"
    log = written(T, enu, STD[:, [1, 0, 2, 3, 4, 5]], "enu", head=head)
    frame = log.tables["solution"].frame
    radians = [np.pi / 180, np.pi / 180, 1]
    place = frame[["latitude", "longitude", "height"]].to_numpy() * radians
    ned = displacement(place, base * radians)
    assert np.allclose(ned[:, :2], enu[:, [1, 0]], atol=2e-3)
    assert np.allclose(-ned[:, 2], enu[:, 2], atol=2e-3)
    assert np.allclose(frame["sdn"], 0.01) and np.allclose(frame["sde"], 0.02)
    for words in ("40 00 00.00000 -105 00 00.00000 1600.0000", "40.0, -105.0, 1600.0"):
        log = written(T, enu, STD[:, [1, 0, 2, 3, 4, 5]], "enu", head=f"% ref pos   : {words}")
        assert np.allclose(log.tables["solution"].frame, frame, atol=1e-9)
    head = "% ref pos   :  -35 10 12.12345  136 54 33.45678    80.0000"
    place = written(T[:1], 0 * enu[:1], STD, "enu", head=head).tables["solution"].frame
    south, east = -(35 + 10 / 60 + 12.12345 / 3600), 136 + 54 / 60 + 33.45678 / 3600
    found = place[["latitude", "longitude", "height"]].to_numpy()
    assert np.allclose(found, [[south, east, 80]], atol=1e-8)
    for head in ("", "% ref pos : 35 10 12.1 136 54 33.4", "% ref pos : 35 136 80 2"):
        with pytest.raises(DataError, match="its header names no base"):
            written(T, enu, STD, "enu", head=head)


def test_velocities_that_were_not_worked_out_are_not_used(written, tmp_path):
    """RTKLIB writes them as 0 with standard deviations of 0."""
    moved = np.tile([1.0, 2.0, 3.0, 0.1, 0.1, 0.0, 0, 0, 0], (100, 1))
    moved[:7] = 0
    log = written(T, LLH, STD, moved=moved)
    velocity = log.tables["solution"].frame[["vn", "ve", "vu"]].to_numpy()
    assert np.isnan(velocity[:7]).all() and (velocity[7:] == [1, 2, 3]).all()
    assert any("7 rows whose velocity has no standard" in line for line in log.left)
    assert [each.keys.get("kind") for each in log.sections] == ["position", "velocity", None]
    times = {each.kind: each.t for each in read(tmp_path, log).sources}
    assert len(times["position"]) == len(times["velocity"]) + 7
    log = written(T, LLH, STD, moved=0 * moved)
    assert [each.keys.get("kind") for each in log.sections] == ["position", None]
    assert "velocity" not in log.sections[1].keys
    assert any("100 rows whose velocity" in line for line in log.left)


def test_heights_above_the_geoid_are_said(written):
    head = "% (lat/lon/height=WGS84/geodetic,Q=1:fix,2:float)"
    section = written(T, LLH, STD, head=head).sections[0]
    assert section.keys["geoid"] == "EGM96" and "geoid" in section.assumed
    head = "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float)"
    assert "geoid" not in written(T, LLH, STD, head=head).sections[0].keys


def test_damage(tmp_path):
    text = pos(T, LLH, STD)
    path = tmp_path / "a.pos"
    lines = text.splitlines()
    lines[5] = lines[5].replace("40.0", "4x.0")
    lines[7] = lines[7][:50]
    lines[8] = lines[8].replace(" 1 9 ", " 0 9 ")
    lines[10], lines[11] = lines[11], lines[10]
    lines[12] = lines[12].replace("2024/", "2024/77")
    path.write_text("\n".join([*lines, lines[-1]]))
    log = open_pos(path)
    assert len(log.tables["solution"].frame) == 96
    said = " ".join(log.left)
    assert "3 lines that are no row" in said and "1 rows without a fix" in said
    assert "1 rows out of order" in said and "1 rows that repeat a time" in said
    for cut in range(0, len(text), 777):
        path.write_text(text[:cut])
        try:
            open_pos(path)
        except DataError as error:
            assert "\n" not in str(error)
    path.write_text("\n".join(lines[1:]))
    with pytest.raises(DataError, match="out-outhead = on"):
        open_pos(path)


def test_the_drive_is_the_one_of_its_csv(data_folder, tmp_path):
    """The recording of the examples with its fixes from the .pos instead."""
    path = data_folder / "native" / "drive0708_rtklib.pos.xz"
    table = pd.read_csv(data_folder / "drive0708" / "gnss_rtk.csv.xz")
    frame = open_pos(path).tables["solution"].frame
    own = ["lat_deg", "lon_deg", "h_ell_m", "vn", "ve", "vu"]
    names = ["latitude", "longitude", "height", "vn", "ve", "vu"]
    assert np.abs(frame[names].to_numpy() - table[own].to_numpy()).max() < 1e-9
    # its [imu] beside the sections of the log
    imu = (EXAMPLES / "drive0708.toml").read_text().split("[imu]")[1].split("# The receiver")[0]
    text = join({path: open_pos(path)}).text(tmp_path)
    text = (
        'epoch = "2025-07-08T19:34:00Z"\n'
        + text
        + "[imu]"
        + imu.replace("drive0708-imu", str(GRADE))
    )
    (tmp_path / "recording.toml").write_text(text)
    found, wanted = sd.read(tmp_path / "recording.toml"), sd.read(EXAMPLES / "drive0708.toml")
    assert [len(a.t) for a in found.sources] == [2189, 8, 2197]  # fixed, float, velocities
    for one, other, late in zip(join_classes(found.sources), wanted.sources, (0, 0.125)):
        assert np.allclose(one.t, other.t + late, atol=2e-6) and len(one.t) == 2197
        assert np.allclose(one.y, other.y, atol=1e-12)
    assert np.allclose(found.imu.t, wanted.imu.t)
