"""PSINS logs: a small one by hand, the ring-laser record against gravity and the rate of the
Earth, and every way to break a file."""

import lzma

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.io.inspection import inspect
from strapdown.io.readers.psins import read_psins

LOG = """% PSINS-format SIMU log file.
% comment

0.5 -0.25 -90.6 1.0 2.0 3.0
34.246048 108.909664 380.0 100.0 10.0 9.780327
0.1 0.2 0.3 125.0 100.0 50.0
1 20 -300 4 5 200
-2 0 3 4 5 220
3 1 1 4 5 200
0 0 0 4 5 200
"""
G = 9.780327
pytestmark = pytest.mark.short


def write(folder, text=LOG, name="log.imu"):
    path = folder / name
    path.write_bytes(lzma.compress(text.encode()) if name.endswith("xz") else text.encode())
    return path


@pytest.mark.parametrize("name", ["log.imu", "log.IMU", "log.imu.xz"])
def test_counts_become_increments_in_body_axes(tmp_path, name):
    recording = sd.read(write(tmp_path, name=name))
    imu, arcsec = recording.imu, np.radians(1 / 3600)
    np.testing.assert_allclose(imu.t, [100.01, 100.02, 100.03, 100.04])
    # forward, right, down
    np.testing.assert_allclose(
        imu.dtheta[0], [20 * 0.2 * arcsec, 1 * 0.1 * arcsec, 300 * 0.3 * arcsec]
    )
    np.testing.assert_allclose(imu.dv[0], [5 * 100e-6 * G, 4 * 125e-6 * G, -200 * 50e-6 * G])
    assert recording.meta["name"] == "log" and recording.reference is None


def test_the_header_is_kept_in_the_frames_of_the_package(tmp_path):
    meta = read_psins(write(tmp_path)).meta
    # roll, pitch, heading clockwise
    np.testing.assert_allclose(np.degrees(meta["attitude"]), [-0.25, 0.5, 90.6])
    np.testing.assert_allclose(meta["velocity"], [2.0, 1.0, -3.0])
    np.testing.assert_allclose(np.degrees(meta["position"][:2]), [34.246048, 108.909664])
    assert meta["position"][2] == 380.0 and meta["gravity"] == G
    position, velocity = read_psins(write(tmp_path)).sources
    assert position.kind == "position" and position.t == velocity.t == pytest.approx(100.0)
    np.testing.assert_array_equal(
        np.r_[position.y[0], velocity.y[0]], meta["position"] + meta["velocity"]
    )


def test_a_filter_can_start_from_the_header(tmp_path):
    recording = sd.read(write(tmp_path, LOG + 60 * "1 20 -3 4 5 200\n"))
    solution = sd.fuse(recording, imu="navigation")
    assert solution.t[0] >= 100.0 and np.degrees(solution.trajectory.lla[0, 0]) == pytest.approx(
        34.246048, abs=1e-6
    )


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("1 20 -300 4 5 200", "1 20 -300 4 5", "line 7: '1 20 -300 4 5' is not six numbers"),
        ("-2 0 3", "-2 1_0 3", "line 8: '-2 1_0 3 4 5 220' is not six numbers"),
        ("34.246048 108", "34.2_46048 108", "line 5: .* is not six numbers"),
        ("-2 0 3", "-2 x 3", "line 8: '-2 x 3 4 5 220' is not six numbers"),
        ("-2 0 3", "-2 nan 3", "line 8: a count is not a finite number"),
        ("34.246048 108", "134.246048 108", "line 5: latitude, longitude"),
        (" 10.0 9.78", " 0.0 9.78", "line 5: latitude, longitude"),
        ("0.1 0.2 0.3", "0.1 0.0 0.3", "line 6: the size of a count"),
        (
            "0.1 0.2 0.3",
            "0.1 0.2 0.3 1",
            "line 6: '0.1 0.2 0.3 1 125.0 100.0 50.0' is not six numbers",
        ),
        (LOG[LOG.index("-2 0") :], "", "4 lines of numbers"),
        (LOG[LOG.index("0.1 0.2") :], "", "2 lines of numbers"),
        ("125.0 100.0 50.0", "1.25e7 1e7 5e6", "log.imu: "),
    ],
)
def test_what_is_wrong_in_a_log_is_named(tmp_path, old, new, words):
    assert old in LOG
    path = write(tmp_path, LOG.replace(old, new, 1))
    with pytest.raises(DataError, match=words) as caught:
        sd.read(path)
    assert "log.imu" in str(caught.value) and "\n" not in str(caught.value)


def test_damaged_and_absent_files_are_refused(tmp_path):
    path = write(tmp_path, LOG * 100, "log.imu.xz")
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(DataError, match="truncated or damaged"):
        sd.read(path)
    with pytest.raises(DataError, match="cannot be read"):
        sd.read(tmp_path / "absent.imu")


def test_inspection_reads_the_header(tmp_path):
    lines = str(inspect(write(tmp_path)))
    wrong = inspect(write(tmp_path, LOG.replace("125.0 100.0 50.0", "1.25e7 1e7 5e6"), "wrong.imu"))
    assert any("specific force" in problem for problem in wrong.problems) and wrong.facts
    assert (
        "34.246048 deg north, 108.909664 deg east, 380.0 m, heading 90.6 deg" in lines
        and "4 samples" in lines
    )


def test_the_ring_laser_record_feels_gravity_and_the_turning_earth(data_folder):
    recording = sd.read(data_folder / "lasergyro" / "lasergyro.imu.xz")
    imu, (latitude, _, height) = recording.imu, recording.meta["position"]
    assert len(imu.t) == 184718 and imu.dt.sum() == pytest.approx(1847.18)
    rate, force = imu.dtheta.sum(axis=0) / imu.dt.sum(), imu.dv.sum(axis=0) / imu.dt.sum()
    sine = np.sin(latitude) ** 2
    # Somigliana, WGS-84
    gravity = (
        9.7803253359 * (1 + 0.00193185265241 * sine) / np.sqrt(1 - 0.00669437999013 * sine)
        - 3.0877e-6 * height
    )
    assert np.linalg.norm(force) == pytest.approx(gravity, abs=1e-3)  # 0.1 mg
    assert np.degrees(np.linalg.norm(rate)) * 3600 == pytest.approx(15.041, rel=0.02)
    up = force / np.linalg.norm(force)
    vertical = np.degrees(rate @ up) * 3600
    # deg/h; 0.1 deg/h of misalignment and drift was measured
    assert vertical == pytest.approx(15.041 * np.sin(latitude), abs=0.3)
    horizontal = rate - (rate @ up) * up
    heading = np.degrees(np.arctan2(-horizontal[1], horizontal[0])) % 360
    # the header's 90.6; the README's 88
    assert heading == pytest.approx(np.degrees(recording.meta["attitude"][2]), abs=5)


@pytest.mark.parametrize("cell", ["\u0661", "\uff11"])
def test_digits_that_one_of_two_parsers_takes_are_read(tmp_path, cell):
    """Python reads digits of every script, numpy does not."""
    path = tmp_path / "odd.imu"
    path.write_text(LOG + f"{cell} 0 0 0 0 1000\n", encoding="utf-8")
    assert read_psins(path).imu.dtheta[-1, 1] == pytest.approx(0.1 * np.radians(1 / 3600))


def test_a_mark_of_comments_within_a_row_is_named(tmp_path):
    path = tmp_path / "odd.imu"
    path.write_text(LOG + "# 1 2 3 4 5 6\n")
    with pytest.raises(DataError, match="line 11: .* is not six numbers"):
        sd.read(path)
