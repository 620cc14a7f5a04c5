"""`inspect` names the mistake and the remedy where reading refuses, and drafts a description
that reads."""

import re

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.recording import Recording
from strapdown.io import read, write_recording
from strapdown.io.inspection import draft as drafted, inspect

pytestmark = pytest.mark.short


def draft(path, folder=None):
    """Text of the recording.toml for one table."""
    return drafted([path], {}, folder or path.parent)


def car(n=12000, dt=0.01):
    """A car that turns left and right at 10 m/s: t, gyro (rad/s), accel (m/s^2), and north, east
    velocity."""
    t = dt * np.arange(1, n + 1)
    rate = 0.2 * np.sin(0.3 * t)
    heading = np.cumsum(rate) * dt
    rng = np.random.default_rng(2)
    gyro = np.c_[np.zeros((n, 2)), rate] + rng.normal(0, 0.002, (n, 3)) + [0.01, 0, 0]
    accel = np.c_[0 * t, 10 * rate, 0 * t - 9.8] + rng.normal(0, 0.3, (n, 3))
    return t, gyro, accel, 10 * np.c_[np.cos(heading), np.sin(heading)]


@pytest.fixture
def drive(tmp_path):
    """Function (changes of arrays and text) -> path of a description of that drive, without any
    mistake unless changed."""

    def drive(gyro=1.0, offset=0.0, toml=lambda s: s):
        t, w, f, v = car()
        pd.DataFrame(
            np.c_[t, w * gyro, f],
            columns=["t_s", "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"],
        ).to_csv(tmp_path / "imu.csv", index=False)
        rows = slice(99, None, 20)
        pd.DataFrame(
            np.c_[t[rows] + offset, v[rows], 0 * t[rows]], columns=["t", "vn", "ve", "vd"]
        ).to_csv(tmp_path / "gnss.csv", index=False)
        path = tmp_path / "recording.toml"
        path.write_text(
            toml("""[imu]
file = "imu.csv"
time = { column = "t_s", unit = "s" }
gyro = { columns = ["gyro_x", "gyro_y", "gyro_z"], unit = "rad/s" }
accel = { columns = ["acc_x", "acc_y", "acc_z"], unit = "m/s^2" }

[[source]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1
""")
        )
        return path

    return drive


def test_facts_of_a_good_recording(build, tmp_path):
    path = build(imu=lambda f: f.drop(range(500, 1000)))
    text = str(inspect(path))
    for words in (
        "imu: 1500 samples, 10.010 to 30.000 s (20.0 s), 100 Hz",
        "gaps: 1, the longest 5.000 s after 15.000 s",
        "median magnitude 9.80",
        "seems at rest, by the IMU alone, for 15.0 s",
        "z is negative, as required",
        "angular rate [1.0",
        "position: 20 fixes, 10.500 to 29.500 s, every 1 s",
        "19.0 s of them within the IMU record",
        "note: ",
        "no mistakes found",
    ):
        assert words in text, text
    write_recording(read(path), tmp_path / "recording.nc")
    assert [line for line in inspect(tmp_path / "recording.nc").facts if "note" not in line] == [
        line for line in inspect(path).facts if "note" not in line
    ]


@pytest.mark.parametrize(
    "changes, words",
    [
        (dict(), None),
        (dict(gyro=57.3), "gyro.unit: the gyro shows tilting"),
        (
            dict(gyro=1 / 57.3),
            "times as much as the course of velocity: rad/s read as deg/s",
        ),
        (dict(gyro=[1, 1, -1]), "check the sign of gyro z"),
        (
            dict(offset=1.0),
            "s to `offset` of the `time` of velocity, or +1",
        ),
        (
            dict(toml=lambda s: s.replace('"m/s^2"', '"g"')),
            "accel.unit: specific force has median magnitude 97",
        ),
        (
            dict(toml=lambda s: s.replace("[imu]", '[imu]\naxes = "FLU"')),
            "axes: specific force on z has median +9.8",
        ),
        (
            dict(toml=lambda s: s.replace("[imu]", '[imu]\naxes = "+z +y -x"')),
            "specific force lies mostly on x",
        ),
        (dict(offset=1e4), "nothing falls within the IMU record"),
        (
            dict(toml=lambda s: s.replace('columns = ["vn"', 'columns = ["vnn"')),
            "column 'vnn' is missing (did you mean 'vn'?)",
        ),
    ],
)
def test_mistakes_are_named(drive, changes, words):
    found = inspect(drive(**changes))
    assert any(line.startswith("imu: 12000 samples") for line in found.facts), (
        "the IMU is described whatever is wrong"
    )
    if words is None:
        assert found.problems == () and found.lines[-1] == "no mistakes found"
    else:
        assert any(words in problem for problem in found.problems), found


def test_an_invalid_description_still_shows_the_table(drive):
    found = inspect(
        drive(toml=lambda s: s.replace("rad/s", "radians").replace("std = 0.1", "std = 0"))
    )
    assert (
        len(found.problems) >= 2
        and "accepted for angular rate" in found.problems[0]
        and "above 0" in found.problems[1]
    )
    assert any("imu: 12000 samples" in line for line in found.facts)


def test_held_fixes_are_pointed_out(build):
    path = build(
        gnss=lambda f: (
            f.loc[f.index.repeat(4)].reset_index(drop=True).assign(t=lambda g: 10.5 + 0.2 * g.index)
        )
    )
    assert any(
        re.search(r"7\d % of the fixes repeat the one before", problem)
        for problem in inspect(path).problems
    )


def frame(accel, gyro_names, accel_names, time="time", rate=1.0):
    t, w, f, v = car(3000)
    return pd.DataFrame(np.c_[t, w * rate, f * accel], columns=[time, *gyro_names, *accel_names])


@pytest.mark.parametrize(
    "table, expected",
    [
        (
            frame(
                1, ["wx_rad_s", "wy_rad_s", "wz_rad_s"], ["fx_m_s2", "fy_m_s2", "fz_m_s2"], "t_s"
            ),
            ['unit = "rad/s"', 'axes = "FRD?"', 'unit = "m/s^2"'],
        ),
        (
            frame(
                1 / 9.80665,
                ["gyro_x [deg/s]", "gyro_y [deg/s]", "gyro_z [deg/s]"],
                ["acc_x [g]", "acc_y [g]", "acc_z [g]"],
                rate=57.2958,
            ),
            ['unit = "deg/s"', 'unit = "g"'],
        ),
        (
            frame(
                -1000 / 9.80665, ["GyrX", "GyrY", "GyrZ"], ["AccX", "AccY", "AccZ"], rate=57.2958
            ),
            ['axes = "FLU?"', 'unit = "mg"', 'unit = "deg/s" } # check'],
        ),
        (
            frame(4096 / 9.80665, ["imu_gx", "imu_gy", "imu_gz"], ["imu_ax", "imu_ay", "imu_az"]),
            ["scale = 0.0023", "check: counts?"],
        ),
        (
            frame([1, 1, 1], ["gx", "gy", "gz"], ["az", "ax", "ay"]),
            ['axes = "+x -z +y?"', "gravity is along y"],
        ),
    ],
)
def test_a_draft_reads(tmp_path, table, expected):
    (tmp_path / "logs").mkdir()
    table.to_csv(tmp_path / "logs" / "flight.csv", index=False)
    text = draft(tmp_path / "logs" / "flight.csv", tmp_path)
    assert 'file = "logs/flight.csv"' in text and "check" in text
    for words in expected:
        assert words in text, text
    (tmp_path / "recording.toml").write_text(text)
    recording = read(tmp_path / "recording.toml")
    assert len(recording.imu.t) == 3000 and np.median(
        recording.imu.dv[:, 2] / recording.imu.dt
    ) == pytest.approx(-9.8, abs=0.2)
    assert inspect(tmp_path / "logs" / "flight.csv").problems == ()


@pytest.mark.parametrize(
    "names, size, expected",
    [
        (
            ["mx", "my", "mz"],
            1.0,
            [
                'columns = ["mx", "my", "mz"]\nunit = "uT"                      # check',
                "std = 1.0  ",
            ],
        ),
        (["mag_x_gauss", "mag_y_gauss", "mag_z_gauss"], 0.01, ['unit = "gauss"\n', "std = 0.01"]),
        (["MagnX", "MagnY", "MagnZ"], 10.0, ['unit = "mgauss"']),
        (["magX [nT]", "magY [nT]", "magZ [nT]"], 1e3, ['unit = "nT"\n']),
        (["mag_x", "mag_y", "mag_z"], 60.0, ['unit = "uT"', "scale = 0.016", "counts?"]),
    ],
)
def test_a_draft_keeps_the_magnetometer(tmp_path, names, size, expected):
    t, w, f, _ = car()
    heading = np.cumsum(w[:, 2]) * 0.01
    field = size * np.c_[20 * np.cos(heading), -20 * np.sin(heading), 0 * t + 43.0]
    columns = ["t", "gx", "gy", "gz", "ax", "ay", "az", *names]
    pd.DataFrame(
        np.c_[t, w, f, field + np.random.default_rng(3).normal(0, 0.05 * size, field.shape)],
        columns=columns,
    ).to_csv(tmp_path / "log.csv", index=False)
    text = drafted([tmp_path / "log.csv"], {"magnetometer": 0}, tmp_path)
    assert (
        'kind = "magnetic-field"' in text
        and 'axes = "FRD"' in text
        and all(words in text for words in expected)
    ), text
    assert any(
        fact.startswith(f"magnetometer: {', '.join(names)} in ")
        for fact in inspect(tmp_path / "log.csv").facts
    )
    (tmp_path / "recording.toml").write_text(text)
    (mag,) = read(tmp_path / "recording.toml").sources
    assert np.median(np.linalg.norm(mag.y, axis=1)) == pytest.approx(47.5e-6, rel=0.05) and mag.std[
        0, 0
    ] == pytest.approx(1e-6)


def test_a_draft_with_fixes_and_time_in_ms(tmp_path):
    table = frame(1, ["gx", "gy", "gz"], ["ax", "ay", "az"], "timestamp")
    table["timestamp"] = (table["timestamp"] * 1000).round()
    fixed = table.index % 100 == 99
    for name, value in (
        ("latitude", 451234567),
        ("longitude", -1.2e9),
        ("altitude", 300.0),
        ("vel_n", 1.0),
        ("vel_e", 2.0),
        ("vel_u", 0.5),
    ):
        table[name] = np.where(fixed, value, np.nan)
    table.to_csv(tmp_path / "log.csv", index=False)
    text = draft(tmp_path / "log.csv")
    (tmp_path / "recording.toml").write_text(text)
    position, velocity = read(tmp_path / "recording.toml").sources
    np.testing.assert_allclose(position.y[0], [np.radians(45.1234567), np.radians(-120), 300])
    np.testing.assert_allclose(velocity.y[0], [1, 2, -0.5])
    assert len(position.t) == 30 and position.t[0] == pytest.approx(1.0)


def test_tables_that_cannot_be_guessed(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("1,2,3\n4,5,6\n7,8,9\n")
    found = inspect(path)
    assert "column 2: 2 to 8, median 5" in found.facts and "no header line" in found.problems[0]
    with pytest.raises(DataError, match="no header line"):
        draft(path)
    path.write_text("a,b\n1,2\n3,4\n")
    assert "no column has the name or the content of a time" in inspect(path).problems[0]
    with pytest.raises(DataError, match="cannot be read"):
        inspect(tmp_path / "nothing.csv")


def test_arrays_are_not_accused():
    t, gyro, accel, _ = car()
    for turn in (1, 5):  # a car, and a vehicle that turns five times as fast
        assert Recording.from_arrays(t, gyro * [1, 1, turn], accel).meta["notes"] == []


def test_reasons_and_what_was_not_checked(drive):
    found = inspect(drive(offset=1.0))
    (reason,) = found.reasons
    assert reason.cause == "clock" and str(reason) in found.problems
    seconds, std = map(float, re.search(r"with ([-+.\d]+) \+- ([.\d]+) s", reason.seen).groups())
    assert abs(seconds + 1.0) < 0.1 and abs(seconds + 1.0) < 2 * std
    still = inspect(drive(toml=lambda s: s.replace('"vn", "ve"', '"vd", "vd"')))
    assert still.problems == () and still.reasons == ()
    assert still.lines[-1] == f"inconclusive: {still.inconclusive[-1]}"
    assert "no mistakes found" in still.lines


def test_a_time_zone_is_named(drive):
    (problem,) = inspect(drive(offset=-7200.0)).problems
    assert "+7200 s added to its time make it overlap (a time zone, +2 h?)" in problem


def test_jitter_is_one_line(drive, tmp_path):
    path = drive()
    table = pd.read_csv(tmp_path / "imu.csv")
    table["t_s"] += np.where(np.arange(len(table)) % 100 == 50, 0.009, 0.0)
    table.to_csv(tmp_path / "imu.csv", index=False)
    facts = inspect(path).facts
    assert any("time stamps: 120 intervals are longer than the median by" in f for f in facts)
    assert "gaps: none of several samples" in facts


@pytest.mark.parametrize("name, wrong", [("hMSL", True), ("alt_amsl_m", True), ("h_ell", False)])
def test_a_column_that_speaks_of_the_sea_level(build, name, wrong):
    path = build(
        gnss=lambda f: f.rename(columns={"alt": name}),
        toml=lambda s: s.replace('"alt"', f'"{name}"'),
    )
    found = inspect(path)
    assert [reason.cause for reason in found.reasons] == ["height"] * wrong
    assert any("mean sea level" in problem for problem in found.problems) == wrong
    verdict = sd.fuse(read(path), imu="consumer").verdict
    assert any(reason in verdict.reasons for reason in found.reasons) == wrong, str(verdict)
