"""Calibration of accelerometer and magnetometer: exact recovery, oracles, honest standard
deviations, and what too little motion ends in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp
from scipy.stats import chi2

import strapdown as sd
from strapdown.calibration.ellipsoid import ellipsoid, inflation
from strapdown.calibration.gyro_aided import fit_by_turns, windows
from strapdown.calibration.methods import coverage, hard_and_soft_iron, missing_directions, rests
from strapdown.core.loop.contract import Imu
from strapdown.core.mathematics.earth import gravity
from strapdown.data.recording import Recording
from strapdown.data.solution import Source

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
G = 9.81
FIELD = np.array([20.0, 1.0, 44.0]) * 1e-6
STRENGTH, DIP = float(np.linalg.norm(FIELD)), float(np.arctan2(44.0, np.hypot(20.0, 1.0)))
A = np.array([[1.05, 0.03, -0.02], [0.01, 0.93, 0.04], [0.02, -0.03, 1.10]])
B = np.array([30.0, -20.0, 45.0]) * 1e-6
GYRO_BIAS = np.array([0.010, -0.005, 0.008])
SYMMETRIC = np.array([[1.02, 0.01, -0.02], [0.01, 0.97, 0.015], [-0.02, 0.015, 1.05]])


def turned(rates, rate=50.0, bias=np.zeros(3)):
    """(Imu at one place, C_nb (n + 1, 3, 3)) of a body with angular rates (n, 3), level at
    first; the gyros have a bias."""
    n, dt = len(rates), 1 / rate
    C = np.empty((n + 1, 3, 3))
    C[0] = np.eye(3)
    for k, turn in enumerate(Rotation.from_rotvec(rates * dt).as_matrix()):
        C[k + 1] = C[k] @ turn
    force = -np.einsum("kji,j->ki", C[1:], [0, 0, G])
    return Imu(dt * np.arange(1, n + 1), np.full(n, dt), (rates + bias) * dt, force * dt), C


def tumble(seconds=120.0, rate=50.0, seed=1):
    """A sensor turned by hand through all directions."""
    rng, t = np.random.default_rng(seed), np.arange(int(seconds * rate)) / rate
    waves = lambda: sum(
        a * np.sin(2 * np.pi * f * t + p)
        for a, f, p in zip(rng.uniform(0.3, 1, 4), rng.uniform(0.02, 0.2, 4), rng.uniform(0, 6, 4))
    )
    return turned(np.stack([waves() for _ in range(3)], axis=1), rate, GYRO_BIAS)


def flat(seconds=120.0, rate=20.0):
    """A car on a plane: it turns about its z axis alone."""
    return turned(
        np.stack(
            [0 * (t := np.arange(int(seconds * rate)) / rate), 0 * t, 0.3 + 0.2 * np.sin(t / 7)],
            axis=1,
        ),
        rate,
    )


def circling(seconds, rate):
    """An aircraft in circles, banked by up to 45 deg to both sides: the directions are a fifth
    of the sphere."""
    t = np.arange(int(seconds * rate) + 1) / rate
    C = Rotation.from_euler("ZYX", np.c_[0.4 * t, 0.15 * np.sin(0.9 * t), 0.8 * np.sin(0.35 * t)])
    imu, turns = turned((C[:-1].inv() * C[1:]).as_rotvec() * rate, rate, GYRO_BIAS)
    return imu, turns


def felt(C):
    """The field in body axes at the ends of the samples."""
    return np.einsum("kji,j->ki", C[1:], FIELD)


def recording(imu, y, **meta):
    return Recording(
        imu,
        (
            Source(
                "magnetic-field",
                imu.t,
                y,
                np.full(y.shape, 3e-7),
                tuple(FIELD),
                name="magnetic-field",
            ),
        ),
        None,
        {"name": "made", **meta},
    )


def directions(n, seed=0):
    v = np.random.default_rng(seed).standard_normal((n, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


@pytest.mark.short
def test_ellipsoid_recovers_a_symmetric_distortion_exactly():
    u = directions(200)
    fit = ellipsoid(STRENGTH * u @ np.linalg.inv(SYMMETRIC).T + B, STRENGTH)
    np.testing.assert_allclose(fit.matrix, SYMMETRIC, atol=1e-10)
    np.testing.assert_allclose(fit.bias, B, atol=1e-15)
    assert not fit.held and not fit.missing and fit.used.all()


@pytest.mark.short
def test_six_positions_agree_with_the_linear_form():
    """Titterton & Weston: with axes exactly up and down, bias = (up + down)/2 and scale = (up -
    down)/(2 g)."""
    bias, scale = np.array([0.3, -0.2, 0.1]), np.array([1.02, 0.97, 1.01])
    y = np.vstack([np.diag(scale), -np.diag(scale)]) * G + bias
    fit = ellipsoid(y, G)
    up, down = np.diag(y[:3]), np.diag(y[3:])
    np.testing.assert_allclose(fit.bias, (up + down) / 2, atol=1e-9)
    np.testing.assert_allclose(fit.matrix, np.diag(2 * G / (up - down)), atol=1e-9)
    assert (
        set(fit.held) == {"misalignment xy", "misalignment xz", "misalignment yz"}
        and not fit.missing
    )


@pytest.mark.short
def test_outliers_do_not_move_the_ellipsoid():
    rng, u = np.random.default_rng(5), directions(600)
    clean = STRENGTH * u @ np.linalg.inv(SYMMETRIC).T + B + 1e-7 * rng.standard_normal(u.shape)
    y = clean.copy()
    y[::10] += 3e-5 * rng.standard_normal((60, 3))
    spoilt, plain = ellipsoid(y, STRENGTH), ellipsoid(clean, STRENGTH)
    assert np.abs(spoilt.bias - plain.bias).max() < 5e-8 and 45 <= (~spoilt.used).sum() <= 62
    least_squares = np.linalg.norm((y - plain.bias) @ plain.matrix, axis=1).std()
    assert least_squares > 1e-6  # the outliers are real


@pytest.mark.deep
def test_standard_deviations_of_the_ellipsoid_are_honest():
    """Normalised squared errors over 200 sets: chi-square with 9 degrees of freedom each, 99.9 %
    band of the sum."""
    rng, u, runs = np.random.default_rng(11), directions(300), 200
    truth = np.r_[B, SYMMETRIC[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]]
    pick = [0, 1, 2, 3, 7, 11, 4, 5, 8]
    clean, total = STRENGTH * u @ np.linalg.inv(SYMMETRIC).T + B, 0.0
    for _ in range(runs):
        fit = ellipsoid(clean + 3e-7 * rng.standard_normal(u.shape), STRENGTH)
        error = np.r_[fit.bias, fit.matrix.ravel()][pick] - truth
        total += error @ np.linalg.solve(fit.covariance[np.ix_(pick, pick)], error)
    low, high = chi2.ppf([0.0005, 0.9995], 9 * runs)
    assert low < total < high, total / runs


@pytest.mark.short
def test_turning_recovers_a_general_distortion_and_the_gyro_bias():
    imu, C = tumble(36.0)
    fit, gyro = fit_by_turns(imu.t, felt(C) @ A.T + B, imu, STRENGTH, DIP)
    np.testing.assert_allclose(fit.matrix, np.linalg.inv(A), atol=2e-6)
    np.testing.assert_allclose(fit.bias, B, atol=1e-10)
    np.testing.assert_allclose(gyro, GYRO_BIAS, atol=1e-6)
    assert not fit.held and not fit.missing


@pytest.mark.deep
def test_standard_deviations_of_turning_are_honest():
    """Normalised squared errors over 40 sets, 12 degrees of freedom each, 99.9 % band of the
    sum; the magnetometer is turned against the IMU."""
    imu, C = circling(70.0, 20.0)
    askew = A @ Rotation.from_euler("ZYX", [60, 20, -30], degrees=True).as_matrix()
    rng, total, runs, truth = (
        np.random.default_rng(12),
        0.0,
        40,
        np.r_[B, np.linalg.inv(askew).ravel()],
    )
    clean = felt(C) @ askew.T + B
    for _ in range(runs):
        fit, _ = fit_by_turns(
            imu.t, clean + 3e-7 * rng.standard_normal(clean.shape), imu, STRENGTH, DIP
        )
        error = np.r_[fit.bias, fit.matrix.ravel()] - truth
        total += error @ np.linalg.solve(fit.covariance, error)
    low, high = chi2.ppf([0.0005, 0.9995], 12 * runs)
    assert low < total < high, total / runs


def test_turning_bridges_no_gap_and_survives_outliers():
    imu, C = tumble(100.0, 20.0)
    rng = np.random.default_rng(3)
    y = felt(C) @ A.T + B + 2e-7 * rng.standard_normal((len(imu.t), 3))
    y[::25] += 4e-5
    keep = (imu.t < 40) | (imu.t > 52)
    torn = Imu(*(column[keep] for column in imu))
    rows = windows(imu.t, y, torn, STRENGTH).rows
    assert keep[rows].all() and (np.diff(imu.t[rows], axis=1) < 0.11).all()
    fit, _ = fit_by_turns(imu.t, y, torn, STRENGTH, DIP)
    assert np.abs((felt(C) @ A.T + B - fit.bias) @ fit.matrix.T - felt(C)).max() < 0.01 * STRENGTH
    assert (
        not fit.used[(imu.t > 40.5) & (imu.t < 51.9)].any()
        and fit.used[imu.t < 40][::2].sum() > 150
    )


def test_a_car_on_a_plane_gets_what_it_can_and_is_told_the_rest():
    imu, C = flat()
    y = felt(C) + B + 1e-7 * np.random.default_rng(0).standard_normal((len(imu.t), 3))
    found = sd.calibrate(recording(imu, y))
    assert (
        found.form == "turning"
        and "scale z" in found.held
        and any("no excitation" in note and "scale z" in note for note in found.notes)
    )
    m = (felt(C) + B - found.bias) @ found.matrix.T
    assert np.abs(m - felt(C))[:, :2].max() < 0.01 * STRENGTH
    assert {"+z", "-z"} - {"+z"} <= set(found.lacking)


@pytest.mark.short
def test_too_few_directions_are_refused_with_those_that_lack():
    imu, C = turned(np.zeros((600, 3)), 20.0)
    y = felt(C) + B + 1e-7 * np.random.default_rng(0).standard_normal((600, 3))
    with pytest.raises(
        sd.DataError,
        match=r"too few directions: no field along .*\(within 30 deg\); turn the sensor",
    ):
        sd.calibrate(recording(imu, y))
    y[:, 1] = 2e-5
    with pytest.raises(sd.DataError, match="y is constant: the sensor is stuck"):
        sd.calibrate(recording(imu, y))
    with pytest.raises(sd.DataError, match="0 rests of 2 s|1 rest of 2 s.*at least six"):
        sd.calibrate(recording(imu, y), "accelerometer")
    with pytest.raises(sd.DataError, match="no source of kind magnetic-field"):
        sd.calibrate(replace(recording(imu, y), sources=()), "magnetometer")
    with pytest.raises(sd.DataError, match="sensor 'compass' is unknown; there is accelerometer"):
        sd.calibrate(recording(imu, y), "compass")
    twice = replace(recording(imu, y).sources[0], name="magnetometer")
    with pytest.raises(sd.DataError, match="there is accelerometer, magnetometer$"):
        sd.calibrate(replace(recording(imu, y), sources=(twice,)), "gyro")


@pytest.mark.short
@pytest.mark.parametrize("field", [(), (0.0, 0.0, 0.0)])
def test_a_sensor_that_never_turned_is_refused_where_the_strength_is_unknown(field):
    imu, C = turned(np.zeros((1200, 3)), 20.0)  # 60 s at rest
    y = np.array([20.0, 0.0, 45.0]) * 1e-6 + 1e-7 * np.random.default_rng(1).standard_normal(
        (1200, 3)
    )
    still = recording(imu, y)
    with pytest.raises(
        sd.DataError,
        match=r"changes by \+-0\.2\d uT .* too few directions; turn the sensor through all directions, upside down too",
    ):
        sd.calibrate(replace(still, sources=(replace(still.sources[0], parameters=field),)))


@pytest.mark.short
@pytest.mark.parametrize("strength", [None, STRENGTH])
@pytest.mark.parametrize("noise", [1e-18, 1e-13, 1e-9])
def test_nearly_constant_samples_end_in_a_sentence(strength, noise):
    imu, _ = turned(np.zeros((600, 3)), 20.0)
    y = FIELD + noise * np.random.default_rng(2).standard_normal((600, 3))
    with pytest.raises(sd.DataError, match="too few directions|is constant"):
        hard_and_soft_iron(imu.t, y, imu, strength)


def test_a_saturated_magnetometer_is_refused():
    imu, C = tumble(30.0)
    with pytest.raises(sd.DataError, match="saturated"):
        # an axis is always beyond the limit
        sd.calibrate(recording(imu, np.clip(10 * felt(C), -1e-4, 1e-4)))


def test_left_handed_axes_are_refused_and_turned_ones_said():
    imu, C = tumble(40.0, 20.0)
    y = felt(C) + B + 1e-7 * np.random.default_rng(0).standard_normal((len(imu.t), 3))
    with pytest.raises(sd.DataError, match="left-handed"):
        hard_and_soft_iron(imu.t, y * [1, 1, -1], imu, STRENGTH, DIP)
    fit, form, _ = hard_and_soft_iron(
        imu.t, y * [1, -1, -1] + 1e-6 * np.sin(imu.t / 3)[:, None], imu, STRENGTH, DIP
    )
    fit, _ = fit_by_turns(imu.t, y * [1, -1, -1], imu, STRENGTH, DIP)
    np.testing.assert_allclose(fit.matrix, np.diag([1, -1, -1]), atol=0.01)


def test_without_a_known_field_the_scale_stays():
    imu, C = tumble(60.0, 20.0)
    y = felt(C) @ A.T + B
    known, _, _ = hard_and_soft_iron(imu.t, y, imu, STRENGTH, DIP)
    own, _, _ = hard_and_soft_iron(imu.t, y, imu, None)
    np.testing.assert_allclose(
        own.matrix, known.matrix / np.cbrt(np.linalg.det(known.matrix)), atol=1e-5
    )
    assert np.linalg.det(own.matrix) == pytest.approx(1)
    np.testing.assert_allclose(own.bias, known.bias, atol=1e-9)


def poses(angles, seconds=5.0, rate=50.0, noise=0.02, seed=2, M=np.eye(3), b=np.zeros(3)):
    """Imu that rests at each of the Euler angles (roll, pitch in deg), turned between them; its
    accelerometer reads inv(M) f + b."""
    rng, n = np.random.default_rng(seed), int(seconds * rate)
    forces, rates = [], []
    for roll, pitch in np.radians(angles):
        f = -G * np.array(
            [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
        )
        forces += [np.tile(f, (n, 1)), rng.normal(0, 5, (20, 3)) + f]
        rates += [np.zeros((n, 3)), np.full((20, 3), 2.0)]
    f = np.concatenate(forces) @ np.linalg.inv(M).T + b
    f += noise * rng.standard_normal(f.shape)
    k, dt = len(f), 1 / rate
    return Imu(dt * np.arange(1, k + 1), np.full(k, dt), np.concatenate(rates) * dt, f * dt)


SIX = [(0, 0), (180, 0), (90, 0), (-90, 0), (0, 90), (0, -90)]
TILTED = [
    *SIX,
    (45, 0),
    (135, 0),
    (-45, 0),
    (-135, 0),
    (0, 45),
    (0, -45),
    (180, 45),
    (180, -45),
    (90, 45),
    (-90, 45),
    (90, -45),
    (-90, -45),
]


def test_rests_are_found_and_the_accelerometer_is_calibrated():
    bias = np.array([0.2, -0.15, 0.3])
    imu = poses(TILTED, M=SYMMETRIC, b=bias)
    found = rests(imu)
    assert len(found.t) == len(TILTED) and 0 < found.std < 0.02 / np.sqrt(100)
    made = sd.calibrate(Recording(imu, meta={"place": [0.8, 0.1, 200.0]}), "accelerometer")
    g = float(gravity(np.sin(0.8), 200.0))
    np.testing.assert_allclose(made.bias, bias, atol=0.005)
    np.testing.assert_allclose(made.matrix, SYMMETRIC * g / G, atol=1e-3)
    assert (
        made.form == "rests"
        and made.lacking == ()
        and not made.held
        and made.coverage > 0.2
        and made.strength == g
    )
    assert made.after < 0.003 < 0.2 < made.before


@pytest.mark.parametrize("earlier", [{}, {"bias": [0.1, 0.0, 0.0]}])
def test_the_command_says_what_its_numbers_are_on_top_of(earlier, monkeypatch, tmp_path, capsys):
    from strapdown.cli.calibrate import calibrate

    box = Recording(poses(TILTED, M=SYMMETRIC, b=np.zeros(3)), meta={"sensors": {"accel": earlier}})
    monkeypatch.setattr(sd, "read", lambda path: box)
    calibrate([tmp_path / "recording.toml"], "accelerometer", out=tmp_path)
    assert (
        "on top of the calibration that the recording names" in capsys.readouterr().out
    ) == bool(earlier)


def test_missing_poses_are_named_and_their_parameters_held():
    made = sd.calibrate(
        Recording(poses([pose for pose in TILTED if abs(pose[0]) < 90])), "accelerometer"
    )
    assert made.lacking == ("+y", "-y", "+z") and made.held and abs(made.matrix[2, 2] - 1) < 0.01
    text = " ".join(made.notes)
    assert (
        "no rest with the y axis up, the y axis down, the z axis up (within 30 deg)" in text
        and "no excitation: " in text
    )
    with pytest.raises(
        sd.DataError,
        match="accelerometer: too few directions in 3 rests: no rest with the x axis up, the .* up",
    ):
        sd.calibrate(Recording(poses([(0, 0), (5, 0), (0, 5)])), "accelerometer")


@pytest.mark.short
def test_coverage_counts_cells_of_equal_area():
    share, counts, lack = coverage(directions(20000))
    assert share == 1 and lack == ()
    expected = 20000 / counts.size
    assert np.abs(counts - expected).max() < 5 * np.sqrt(expected)
    share, counts, lack = coverage(np.array([[0, 0, 1.0]]))
    assert (share, counts.sum(), lack) == (1 / 48, 1, ("+x", "-x", "+y", "-y", "-z"))
    assert (
        missing_directions(("+z",), "no rest with") == "no rest with the z axis up (within 30 deg)"
    )


@pytest.mark.short
def test_correlated_misfits_enlarge_the_deviations():
    rng = np.random.default_rng(0)
    white = rng.standard_normal((5000, 3))
    assert 1 <= inflation(white) < 1.3
    assert inflation(np.repeat(white[:100], 50, axis=0)) == pytest.approx(50, rel=0.01)


def test_the_magnetometer_of_the_flight(data_folder, monkeypatch):
    """Against the attitude computed on board, which the calibration has not seen: at most 0.015
    gauss per axis and 4 deg of heading."""
    from strapdown.sensor_models.geomagnetism import geomagnetic_field

    monkeypatch.setenv("STRAPDOWN_DATA", str(data_folder))
    whole = sd.read(EXAMPLES / "thor75-attitude.toml")
    (source,) = [a for a in whole.sources if a.kind == "magnetic-field"]
    reference, rows = whole.reference, slice(*np.searchsorted(source.t, [240, 575]))
    t, m = source.t[rows], source.y[rows]
    R = Slerp(reference.t, reference.rotation)(t)
    place = reference.lla[len(reference.t) // 2]
    field = geomagnetic_field("2012-10-10", *map(float, place))
    residual = np.sqrt(np.mean((m - R.inv().apply(field.field)) ** 2, axis=0)) * 1e4
    assert (residual < 0.015).all(), residual
    heading, pitch, roll = R.as_euler("ZYX").T
    level = Rotation.from_euler("ZYX", np.c_[0 * heading, pitch, roll]).apply(m.copy())
    error = np.arctan2(-level[:, 1], level[:, 0]) + field.declination - heading
    error = np.degrees((error + np.pi) % (2 * np.pi) - np.pi)
    assert np.sqrt(np.mean(error**2)) < 4, np.sqrt(np.mean(error**2))
    again = sd.calibrate(whole, start=240, stop=575)
    np.testing.assert_allclose(again.matrix, np.eye(3), atol=1e-3)
    assert np.abs(again.bias).max() < 1e-7
