"""Calibration files: read, written and read again; temperature tables; a calibration in the axes
of the columns, and calibrated twice; the command."""

from dataclasses import replace

import nine_axis
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io import read, write_recording
from strapdown.io.calibration_file import (
    Correction,
    compose_corrections,
    read_calibration,
    read_corrections,
    write_calibration,
)
from strapdown.io.inspection import inspect

pytestmark = pytest.mark.short
MATRIX = np.array([[1.01, 0.002, 0.0], [0.0, 0.98, 0.001], [0.003, 0.0, 1.02]])
TABLE = ((-20.0, 0.02, 0.0, -0.01), (20.0, 0.0, 0.01, 0.0), (60.0, -0.02, 0.03, 0.04))
TEMPERATURE = 'calibration = "warm.toml"\ntemperature = { column = "T" }\n'


def test_a_file_is_read_back_as_it_was_written(tmp_path):
    path, bias = tmp_path / "c.toml", np.array([1e-5, -2e-5, 1 / 3 * 1e-5])
    sections = {
        "gyro": Correction(np.array([0.1, 0.2, 0.3]), np.eye(3), TABLE),
        "accel": Correction(bias, MATRIX),
        "magnetometer": Correction(bias, MATRIX),
    }
    write_calibration(path, sections, ["where it is from"])
    again = read_corrections(path)
    for name, section in sections.items():
        np.testing.assert_allclose(again[name].bias, section.bias, rtol=1e-11)
        np.testing.assert_allclose(again[name].matrix, section.matrix, rtol=1e-11)
    assert again["gyro"].temperature == TABLE and path.read_text().startswith(
        "# where it is from\n"
    )
    np.testing.assert_array_equal(
        read_calibration(path)["magnetometer"][1], again["magnetometer"].matrix
    )


def test_sections_that_are_missing_change_nothing(tmp_path):
    (tmp_path / "c.toml").write_text("[accel]\nbias = [1, 2, 3]\n")
    found = read_calibration(tmp_path / "c.toml")
    assert set(found) == {"gyro", "accel"}
    np.testing.assert_array_equal(found["accel"][0], [1, 2, 3])
    np.testing.assert_array_equal(found["gyro"][1], np.eye(3))


@pytest.mark.parametrize(
    "text, words",
    [
        (
            "[mag]\nbias = [1, 2, 3]",
            r"unknown section 'mag'; a calibration has \[gyro\], \[accel\] and \[magnetometer\]",
        ),
        (
            '[magnetometer]\ntemperature = { unit = "uT", rows = [] }',
            r"\[magnetometer\] has bias and matrix and no other key",
        ),
        ("[accel]\nbias = [1, 2, nan]", "must be 3 finite numbers"),
        ("[accel]\nmatrix = [[1, 0, 0], [0, 1, 0], [1, 1, 0]]", "cannot be inverted"),
        ("[gyro]\nbias = [1e308, 0, 0]", "gyro. bias is .*, each -1e.06 or more and at most 1e.06"),
        ("[gyro]\nmatrix = [[1, 0, 1e308], [0, 1, 0], [1e308, 0, 1]]", "matrix is .*at most 1e.06"),
        (
            '[accel]\ntemperature = { unit = "g", rows = [[0, 1, 1e308, 3], [1, 1e308, 2, 3]] }',
            "accel.temperature: rows is .*, each -1e.06 or more",
        ),
        (
            '[gyro]\ntemperature = { unit = "degrees", rows = [[0, 1, 2, 3], [1, 1, 2, 3]] }',
            "gyro.temperature: unknown unit 'degrees'",
        ),
        (
            '[gyro]\ntemperature = { unit = "deg/s", rows = [[0, 1, 2, 3]] }',
            "gyro.temperature: the temperature table has one row",
        ),
        (
            '[gyro]\ntemperature = { unit = "deg/s", rows = [[5, 1, 2, 3], [1, 1, 2, 3]] }',
            "do not rise",
        ),
        ("gyro = 3", r"\[gyro\] has bias, matrix and temperature"),
        ("[gyro", "is not TOML"),
    ],
)
def test_what_no_calibration_is(tmp_path, text, words):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(DataError, match=words) as caught:
        read_calibration(tmp_path / "c.toml")
    assert "c.toml" in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(DataError, match="missing.toml: cannot be read"):
        read_calibration(tmp_path / "missing.toml")


def heated(frame):
    """The IMU of `build` with a temperature from 0 to 80 degC whose bias is that of TABLE on the
    gyro (deg/s), and a cell that is empty."""
    T = np.linspace(0, 80, len(frame))
    rows = np.array(TABLE)
    bias = np.stack([np.interp(T, rows[:, 0], column) for column in rows[:, 1:].T], axis=1)
    frame = frame.assign(T=T)
    frame[["gx", "gy", "gz"]] += bias
    frame.loc[100, "T"] = np.nan
    return frame


def test_the_bias_follows_the_temperature(build, tmp_path):
    plain = read(build()).imu
    rows = ", ".join(str(list(row)) for row in TABLE)
    (tmp_path / "warm.toml").write_text(
        f'[gyro]\ntemperature = {{ unit = "deg/s", rows = [{rows}] }}\n'
    )
    warm = read(
        build(
            imu=heated, toml=lambda s: s.replace('axes = "FRD"\n', 'axes = "FRD"\n' + TEMPERATURE)
        )
    )
    np.testing.assert_allclose(warm.imu.dtheta, plain.dtheta, atol=1e-9)
    np.testing.assert_array_equal(warm.imu.dv, plain.dv)
    (note,) = [note for note in warm.meta["notes"] if "temperature" in note]
    assert note.startswith(
        "gyro: 500 samples at 60.0 to 80.0 degC, outside the temperature table (-20 to 60 degC)"
    )


def test_temperature_without_table_or_column_is_refused(build, tmp_path):
    (tmp_path / "warm.toml").write_text(
        '[gyro]\ntemperature = { unit = "deg/s", rows = [[0, 1, 1, 1], [10, 1, 1, 1]] }\n'
    )
    with pytest.raises(
        DataError, match=r"\[imu\] temperature: is missing; the table of gyro in warm.toml needs"
    ):
        read(
            build(
                toml=lambda s: s.replace('axes = "FRD"', 'axes = "FRD"\ncalibration = "warm.toml"')
            )
        )
    with pytest.raises(DataError, match=r"column 'T'|'T'"):
        read(build(toml=lambda s: s.replace('axes = "FRD"\n', 'axes = "FRD"\n' + TEMPERATURE)))


def test_a_temperature_without_a_table_is_kept_and_said(build, tmp_path):
    """Means over each second, of the cells that are not empty; times of the file."""
    path = build(
        imu=heated,
        toml=lambda s: s.replace(
            'axes = "FRD"\n', 'axes = "FRD"\ntemperature = { column = "T" }\n'
        ),
    )
    recording = read(path)
    t, degrees = recording.meta["temperature"].T
    whole = np.linspace(0, 80, len(recording.imu.t))
    assert len(t) <= np.ptp(recording.imu.t) + 2 and np.diff(t).min() > 0.5
    assert degrees == pytest.approx(np.interp(t, recording.imu.t, whole), abs=0.1)
    found = inspect(path)
    assert f"temperature of the IMU: {degrees.min():.1f} to {degrees.max():.1f} degC" in found.facts
    write_recording(recording, tmp_path / "all.nc")
    assert np.array_equal(
        read(tmp_path / "all.nc").meta["temperature"], recording.meta["temperature"]
    )
    bent = replace(recording, meta=recording.meta | {"temperature": degrees})
    write_recording(bent, tmp_path / "bent.nc")
    with pytest.raises(
        DataError, match=r"meta_temperature has the shape .* rows of time \(s\) and"
    ):
        read(tmp_path / "bent.nc")


def test_a_correction_in_body_axes_comes_back_to_the_columns():
    rng = np.random.default_rng(1)
    axes = Rotation.from_euler("ZYX", [0.3, -0.2, 2.0]).as_matrix()
    own, raw = Correction(rng.normal(size=3), MATRIX), rng.normal(size=(5, 3))
    bias, matrix = rng.normal(size=3), np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    body = (raw - own.bias) @ own.matrix.T @ axes.T
    found = compose_corrections(
        "accel",
        bias,
        matrix,
        {"axes": axes.tolist(), "bias": own.bias.tolist(), "matrix": own.matrix.tolist()},
    )
    assert set(found) == {"accel"}
    np.testing.assert_allclose(
        (raw - found["accel"].bias) @ found["accel"].matrix.T @ axes.T,
        (body - bias) @ matrix.T,
        atol=1e-12,
    )


IRON = np.array([12.0, -30.0, 20.0])
TOML = nine_axis.added('axes = "+y +x -z"')(nine_axis.TOML.replace("mag.csv", "imu.csv"))


@pytest.fixture
def turned(tmp_path, monkeypatch):
    """Folder with recording.toml of a sensor turned for 60 s at 20 Hz; its magnetometer stands
    right, forward, up and has hard and soft iron."""
    monkeypatch.chdir(tmp_path)
    t = 0.05 * np.arange(1, 1201)
    attitude = lambda t: Rotation.from_euler(
        "ZYX", np.c_[0.5 * t, 1.4 * np.sin(0.21 * t), 3 * np.sin(0.17 * t + 0.3)]
    )
    rate = (attitude(t - 0.05).inv() * attitude(t)).as_rotvec() / 0.05
    field = attitude(t).inv().apply(np.array(nine_axis.EARTH.field) * 1e6)
    m = (
        field[:, [1, 0, 2]] * [1, 1, -1] @ np.linalg.inv(MATRIX).T
        + IRON
        + np.random.default_rng(2).normal(0, 0.05, field.shape)
    )
    table = np.c_[t, rate, attitude(t - 0.025).inv().apply([0, 0, -9.807]), m]
    pd.DataFrame(table, columns=["t", "gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz"]).to_csv(
        "imu.csv", index=False
    )
    (tmp_path / "recording.toml").write_text(TOML)
    return tmp_path


def test_the_file_of_a_calibration_is_one_that_the_description_can_name(turned):
    before = sd.calibrate(read("recording.toml"))
    before.to_toml("found.toml")
    bias, matrix = read_calibration("found.toml")["magnetometer"]
    np.testing.assert_allclose(bias * 1e6, IRON, atol=0.1)
    np.testing.assert_allclose(matrix, MATRIX, atol=0.006)
    (turned / "recording.toml").write_text(
        TOML.replace("std = 0.5", 'std = 0.5\ncalibration = "found.toml"')
    )
    recording = read("recording.toml")
    (field,) = recording.sources
    np.testing.assert_allclose(field.y, before.calibrated, atol=1e-13)
    assert not any("strength" in note for note in recording.meta["notes"])
    again = sd.calibrate(recording)
    assert np.abs(again.bias).max() < 1e-7 and np.abs(again.matrix - np.eye(3)).max() < 2e-3
    again.to_toml("again.toml")
    np.testing.assert_allclose(
        read_calibration("again.toml")["magnetometer"][0] * 1e6, IRON, atol=0.1
    )
    sd.write_recording(recording, turned / "recording.nc")
    assert sd.read(turned / "recording.nc").meta["sensors"] == recording.meta["sensors"]


def test_the_command_writes_file_and_page(turned, command):
    code, out, err = command(
        "calibrate", "recording.toml", "--from", 1, "--to", 58, "--out", "results"
    )
    assert code == 0 and not err
    assert (
        "magnetometer   x" in out
        and "strength: 4" in out
        and 'in recording.toml: [[source]] kind = "magnetic-field": calibration = "results/calibration.toml"'
        in out
    )
    page = (turned / "results" / "calibration.html").read_text()
    assert (
        all(heading in page for heading in ("Parameters", "Strength", "Directions", "Misfits"))
        and "http:" not in page.split("<script>")[0]
    )
    assert "magnetometer" in read_calibration(turned / "results" / "calibration.toml")


def test_bad_input_of_the_command_ends_in_one_line(turned, command):
    for words, text in (
        (["--sensor", "accelerometer"], "accelerometer: 0 rests"),
        (["--sensor", "compass"], "sensor 'compass' is unknown"),
        (["--from", 59.5], "calibration needs at least 20"),
        (["--from", 100], "no IMU samples between"),
    ):
        code, _, err = command("calibrate", "recording.toml", *words, "--out", "none")
        assert code == 2 and len(err) == 1 and text in err[0], err
        assert not (turned / "none").exists()
