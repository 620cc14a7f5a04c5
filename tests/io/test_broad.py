"""BROAD trials: a small one made here with a known attitude, the five of the data folder, and
every way to break a file."""

import numpy as np
import pytest
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.checks import DataError
from strapdown.geometry.geodesy import displacement
from strapdown.io.readers.broad import (
    BROAD_IMU,
    BROAD_PLACE,
    body_to_ned,
    first_rest,
    read_broad,
    windows,
    with_positions,
)

FS, N = 100.0, 600
FIELD = np.array([0.0, 18.0, -45.0])  # uT, east, north, up: magnetic north
GRAVITY = np.array([0.0, 0.0, 9.81])  # specific force at rest, up
pytestmark = pytest.mark.short


def attitude(t):
    """Rotation of the sensor to east, north, up: tilted, at rest for 3 s, then turning at 0.6
    rad/s about the sensor's x axis."""
    turned = 0.6 * np.clip(t - 3.0, 0.0, None)
    return Rotation.from_euler("ZYX", [0.7, 0.2, -0.1]) * Rotation.from_rotvec(
        np.outer(turned, [1.0, 0, 0])
    )


def arrays():
    """A trial without noise; its reference lacks rows 100 to 149."""
    t = np.arange(N) / FS
    turn = attitude(t)
    quaternion = turn.as_quat()[:, [3, 0, 1, 2]].astype(np.float32)
    quaternion[100:150] = np.nan
    return {
        "fs": np.array(FS),
        "gyr": np.where(t[:, None] > 3.0, [0.6, 0, 0], 0.0).astype(np.float32),
        "acc": turn.inv().apply(GRAVITY).astype(np.float32),
        "mag": turn.inv().apply(FIELD).astype(np.float32),
        "quat_wxyz_enu": quaternion,
        "pos_enu": np.tile(np.float32([1.0, 2.0, 3.0]), (N, 1)),
        "movement": (t >= 3.5) & (t < 5.5),
    }


def write(folder, **changes):
    """Path of that trial with arrays replaced, or left out where they are None."""
    made = {name: value for name, value in (arrays() | changes).items() if value is not None}
    np.savez(folder / "99_made.npz", **made)
    return folder / "99_made.npz"


def test_samples_and_field_are_in_body_axes(tmp_path):
    recording, found = sd.read(write(tmp_path)), arrays()
    imu, (magnetometer,) = recording.imu, recording.sources
    np.testing.assert_allclose(imu.t, np.arange(N) / FS)
    np.testing.assert_allclose(imu.dtheta * FS, found["gyr"] * [1, -1, -1], atol=1e-6)
    np.testing.assert_allclose(imu.dv * FS, found["acc"] * [1, -1, -1], rtol=1e-6)
    np.testing.assert_allclose(magnetometer.y, found["mag"] * [1e-6, -1e-6, -1e-6], rtol=1e-6)
    assert (
        magnetometer.kind == "magnetic-field"
        and (magnetometer.std > 0).all()
        and recording.meta["name"] == "99_made"
    )


def test_the_reference_field_is_that_of_the_rest_without_declination(tmp_path):
    np.testing.assert_allclose(
        sd.read(write(tmp_path)).sources[0].parameters, (18e-6, 0.0, 45e-6), rtol=1e-5
    )


def test_a_magnet_that_passes_does_not_shift_the_reference_field(tmp_path):
    mag = arrays()["mag"]
    mag[50:120] += [80.0, -30.0, 60.0]
    np.testing.assert_allclose(
        sd.read(write(tmp_path, mag=mag)).sources[0].parameters, (18e-6, 0.0, 45e-6), rtol=1e-5
    )


def test_the_optical_attitude_plays_no_part_in_the_measurements(tmp_path):
    recording = sd.read(write(tmp_path))
    other = sd.read(
        write(
            tmp_path,
            quat_wxyz_enu=np.tile([1.0, 0, 0, 0], (N, 1)),
            pos_enu=np.zeros((N, 3)),
            movement=np.ones(N, bool),
        )
    )
    assert recording.sources[0].parameters == other.sources[0].parameters
    for column, same in zip(recording.imu, other.imu):
        np.testing.assert_array_equal(column, same)


def test_the_reference_turns_gravity_and_field_where_they_belong(tmp_path):
    """The attitude is right when it turns what the sensors feel to (0, 0, -g) and to north and
    down, in NED."""
    recording = sd.read(write(tmp_path))
    rows = np.searchsorted(recording.imu.t, recording.reference.t)
    np.testing.assert_allclose(
        recording.reference.rotation.apply(recording.imu.dv[rows] * FS),
        np.tile([0, 0, -9.81], (len(rows), 1)),
        atol=2e-5,
    )
    np.testing.assert_allclose(
        recording.reference.rotation.apply(recording.sources[0].y[rows]),
        np.tile([18e-6, 0, 45e-6], (len(rows), 1)),
        atol=1e-10,
    )


def test_a_box_lying_flat_has_no_roll_and_pitch():
    turned = sd.Trajectory(
        np.zeros(2), np.zeros((2, 3)), q_nb=body_to_ned(np.array([[1.0, 0, 0, 0], [np.nan] * 4]))
    )
    # its x axis points east
    np.testing.assert_allclose(np.degrees(turned.rph[0]), [0, 0, 90], atol=1e-9)
    assert np.isnan(turned.q_nb[1]).all()


def test_only_known_rows_of_the_reference_are_kept(tmp_path):
    reference = sd.read(write(tmp_path)).reference
    assert len(reference) == N - 50 and not ((reference.t > 0.995) & (reference.t < 1.495)).any()
    assert np.isfinite(reference.q_nb).all() and np.isfinite(reference.lla).all()
    assert sd.read(write(tmp_path, quat_wxyz_enu=np.full((N, 4), np.nan))).reference is None


def test_positions_are_metres_from_the_nominal_place(tmp_path):
    recording = sd.read(write(tmp_path))
    np.testing.assert_allclose(
        displacement(recording.reference.lla[0], np.array(BROAD_PLACE)), [2.0, 1.0, -3.0], atol=1e-5
    )
    assert recording.meta["place"] == list(BROAD_PLACE)


def test_movement_is_kept_as_stretches(tmp_path):
    assert sd.read(write(tmp_path)).meta["movement"] == [[3.5, 5.49]]
    assert windows(np.arange(6.0), np.array([True, False, True, True, False, True])) == [
        [0.0, 0.0],
        [2.0, 3.0],
        [5.0, 5.0],
    ]
    assert windows(np.arange(3.0), np.zeros(3, bool)) == []


def test_the_imu_is_described(tmp_path):
    recording = sd.read(write(tmp_path))
    assert sd.imu(recording.meta["grade"]) == BROAD_IMU and "02, 21 and 24" in BROAD_IMU.source
    sd.write_recording(recording, tmp_path / "trial.nc")
    again = sd.read(tmp_path / "trial.nc")
    assert (
        sd.imu(again.meta["grade"]) == BROAD_IMU
        and again.meta["movement"] == recording.meta["movement"]
    )
    assert again.sources[0].parameters == pytest.approx(recording.sources[0].parameters)


def test_without_a_rest_the_magnetometer_is_left_out_and_that_is_said(tmp_path):
    recording = sd.read(write(tmp_path, gyr=np.tile([0.15, 0.0, 0.0], (N, 1))))
    assert recording.sources == () and any(
        "magnetometer left out" in note for note in recording.meta["notes"]
    )


def test_samples_without_values_are_dropped_and_counted(tmp_path):
    gyr = arrays()["gyr"]
    gyr[10:12] = np.nan
    mag = arrays()["mag"]
    mag[5] = np.nan
    recording = sd.read(write(tmp_path, gyr=gyr, mag=mag))
    assert len(recording.imu.t) == N - 2 and len(recording.sources[0].t) == N - 1
    assert any("2 samples with NaN" in note for note in recording.meta["notes"]) and any(
        "magnetometer: 1 row" in note for note in recording.meta["notes"]
    )


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"mag": None}, "array 'mag' is missing"),
        ({"fs": None}, "array 'fs' is missing"),
        ({"movement": None}, "array 'movement' is missing"),
        (
            {"gyr": np.zeros((N, 2))},
            r"gyr has shape \(600, 2\); with 600 rows of gyr it must be \(600, 3\)",
        ),
        ({"acc": np.zeros((N - 1, 3))}, r"acc has shape \(599, 3\)"),
        ({"movement": np.ones((N, 1), bool)}, "movement has shape"),
        ({"quat_wxyz_enu": np.ones((N, 3))}, "quat_wxyz_enu has shape"),
        ({"gyr": np.array(1.0)}, "gyr has shape"),
        (
            {"quat_wxyz_enu": np.ones((N, 4))},
            "quat_wxyz_enu, row 0: quaternion .* has norm 2, not 1; check columns and scale",
        ),
        ({"fs": np.array([1.0, 2.0])}, "fs must be one sampling rate"),
        ({"fs": np.array(-3.0)}, "fs must be one sampling rate"),
        ({"fs": np.zeros((3, 0))}, r"it is an array of shape \(3, 0\)"),
        ({"fs": np.array(np.nan)}, "fs must be"),
        ({"acc": np.array([["a"] * 3] * N)}, "are numbers"),
        ({"acc": arrays()["acc"] / 9.81}, "unit g"),
        ({"acc": -arrays()["acc"]}, "axes"),
        ({"mag": np.array([{}] * N)}, "not an .npz file of plain arrays"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, changes, words):
    with pytest.raises(DataError, match=words) as caught:
        sd.read(write(tmp_path, **changes))
    assert "99_made.npz" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 not a zip", None, "npy"])
def test_damaged_and_absent_files_are_refused(tmp_path, content):
    path = tmp_path / "trial.npz"
    if content == "npy":
        with open(path, "wb") as file:
            np.save(file, np.zeros(3))
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError, match="trial.npz") as caught:
        sd.read(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match="."):
        sd.read(tmp_path)


def test_a_locked_member_is_refused(tmp_path):
    content = bytearray(write(tmp_path).read_bytes())
    for mark, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(mark) + at] |= (
            1  # APPNOTE of PKWARE, general purpose bit 0: encrypted
        )
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(DataError, match="encrypted"):
        sd.read(tmp_path / "a.npz")


def test_a_file_cut_or_altered_anywhere_is_refused(tmp_path):
    whole = write(tmp_path).read_bytes()
    for share in (0.1, 0.5, 0.99):
        (tmp_path / "cut.npz").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(DataError, match="cut.npz"):
            sd.read(tmp_path / "cut.npz")
    at = whole.index(b"gyr.npy") + 4000
    (tmp_path / "cut.npz").write_bytes(whole[:at] + b"\xff\xff\xff" + whole[at + 3 :])
    with pytest.raises(DataError, match="truncated or damaged"):
        sd.read(tmp_path / "cut.npz")


@pytest.mark.parametrize("number", ["02", "15", "21", "24", "33"])
def test_the_trials_agree_with_their_reference(data_folder, number):
    """Through the optical attitude the mean specific force is gravity; at rest field and level
    agree with it. Bounds: offsets of these sensors."""
    (path,) = (data_folder / "broad").glob(f"{number}_*.npz")
    recording = read_broad(path)
    imu, reference, (magnetometer,) = recording.imu, recording.reference, recording.sources
    rows = np.searchsorted(imu.t, reference.t)
    np.testing.assert_array_equal(imu.t[rows], reference.t)
    np.testing.assert_allclose(
        reference.rotation.apply(imu.dv[rows] / imu.dt[rows, None]).mean(axis=0),
        [0, 0, -9.813],
        atol=0.06,
    )
    north, east, down = reference.rotation.apply(magnetometer.y[rows].copy()).mean(axis=0) * 1e6
    assert (
        abs(np.degrees(np.arctan2(east, north))) < 6
        and 10 < np.hypot(north, east) < 20
        and 30 < down < 50
    )
    rest, movement = first_rest(imu), recording.meta["movement"]
    assert (
        len(movement) == 1
        and imu.t[rest.stop - 1] < movement[0][0]
        and imu.t[rest.stop - 1] - imu.t[rest.start] > 30
    )
    np.testing.assert_allclose(np.degrees(reference.rph[0, :2]), 0, atol=3)
    assert not recording.meta["notes"]


@pytest.mark.parametrize(
    "number, least", [("02", 0.92), ("15", 0.996), ("21", 0.993), ("24", 0.89), ("33", 0.99)]
)
def test_the_optical_position_moves_as_the_accelerometer_says(data_folder, number, least):
    """Twice differentiated (cubics over 31 samples, 0.1 s) it is the specific force turned to
    NED less gravity; the slow trials accelerate little."""
    (path,) = (data_folder / "broad").glob(f"{number}_*.npz")
    recording, width = read_broad(path), 31
    imu, reference, ((start, stop),) = (
        recording.imu,
        recording.reference,
        recording.meta["movement"],
    )
    rows = np.searchsorted(imu.t, reference.t)
    force = savgol_filter(
        reference.rotation.apply(imu.dv[rows] / imu.dt[rows, None]), width, 3, axis=0
    )
    acceleration = savgol_filter(
        displacement(reference.lla, np.array(BROAD_PLACE)),
        width,
        3,
        deriv=2,
        delta=float(np.median(imu.dt)),
        axis=0,
    )
    near_gap = np.convolve(np.diff(rows, prepend=rows[0] - 1) != 1, np.ones(2 * width), "same") > 0
    use = (reference.t > start) & (reference.t < stop) & ~near_gap
    correlation = [
        np.corrcoef(acceleration[use, axis], force[use, axis])[0, 1] for axis in range(3)
    ]
    assert min(correlation) > least and use.mean() > 0.5, correlation


def test_positions_are_decimated_and_have_the_noise_stated(tmp_path):
    """An epoch every 0.1 s but in the gap; 4 to 5 deviations bound the mean and the rms of a
    hundred draws."""
    trial = sd.read(write(tmp_path))
    made = with_positions(trial, rate=10.0, std=(0.05, 0.1, 0.2), seed=3)
    *others, fixes = made.sources
    assert tuple(others) == trial.sources and (fixes.kind, fixes.name, fixes.parameters) == (
        "position",
        "optical position",
        (0.0, 0.0, 0.0),
    )
    np.testing.assert_allclose(fixes.t, np.r_[0.1:0.95:0.1, 1.5:5.95:0.1], atol=1e-9)
    assert (
        len(fixes.t) == 54
        and np.isin(fixes.t, trial.reference.t).all()
        and "54 fixes at 10 Hz" in made.meta["notes"][-1]
        and "5 epochs without the body" in made.meta["notes"][-1]
    )
    errors = (displacement(fixes.y, np.array(BROAD_PLACE)) - [2.0, 1.0, -3.0]) / fixes.std
    assert (
        (fixes.std == [0.05, 0.1, 0.2]).all()
        and np.abs(errors.mean(axis=0)).max() < 4 / np.sqrt(54)
        and np.abs((errors**2).mean(axis=0) - 1).max() < 5 * np.sqrt(2 / 54)
    )
    np.testing.assert_array_equal(
        with_positions(trial, 10.0, (0.05, 0.1, 0.2), 3).sources[-1].y, fixes.y
    )
    assert not np.array_equal(
        with_positions(trial, 10.0, (0.05, 0.1, 0.2), 4).sources[-1].y, fixes.y
    )
    whole = sd.read(write(tmp_path, quat_wxyz_enu=np.tile([1.0, 0, 0, 0], (N, 1))))
    there = np.isin(with_positions(whole, 10.0, (0.05, 0.1, 0.2), 3).sources[-1].t, fixes.t)
    # a gap changes no draw
    np.testing.assert_array_equal(
        with_positions(whole, 10.0, (0.05, 0.1, 0.2), 3).sources[-1].y[there], fixes.y
    )


def test_positions_that_cannot_be_made_are_refused(tmp_path):
    trial = sd.read(write(tmp_path))
    for change in (
        {"rate": 0.0},
        {"rate": np.inf},
        {"rate": 101.0},
        {"std": 0.0},
        {"std": (0.1, 0.1)},
        {"std": np.nan},
    ):
        with pytest.raises(DataError, match="99_made: .*above 0"):
            with_positions(trial, **change)
    with pytest.raises(DataError, match="99_made: the trial has no optical position"):
        with_positions(sd.read(write(tmp_path, quat_wxyz_enu=np.full((N, 4), np.nan))))


def test_inspection_says_what_a_trial_holds(tmp_path):
    from strapdown.io.inspection import inspect

    lines = str(inspect(write(tmp_path)))
    assert (
        "600 samples" in lines
        and "movement: 3.50 to 5.49 s" in lines
        and "reference: Trajectory(550 rows" in lines
        and "magnetometer" in lines
    )
    assert any(
        "array 'mag' is missing" in problem
        for problem in inspect(write(tmp_path, mag=None)).problems
    )
