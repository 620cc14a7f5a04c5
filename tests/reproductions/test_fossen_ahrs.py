"""The filters with an AHRS, weighted as the chapter has them, step by step against its published
recursion (`ins_ahrs` of the Marine Systems Simulator) written down again in numpy, also at rest."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.geometry.geodesy import displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown_reproductions.fossen import cases, signals

CASE = next(case for case in cases.CASES if case.name == "indirect-ahrs-closed")
Q, (T_ACC, T_ARS), R = CASE.weights
SECONDS = 20.0
EARTH = 7.292115e-5 * np.array([np.cos(signals.TRONDHEIM[0]), 0, -np.sin(signals.TRONDHEIM[0])])
GRAVITY = 9.7803253359 * (1 + 0.00193185265241 * np.sin(signals.TRONDHEIM[0]) ** 2)
GRAVITY = np.array(
    [0, 0, GRAVITY / np.sqrt(1 - 0.00669437999013 * np.sin(signals.TRONDHEIM[0]) ** 2)]
)
I, O = np.eye(3), np.zeros((3, 3))


def transformation(angles):
    """T(Theta) of the chapter: Euler rates by body rates."""
    (s, _), (c, cp), t = np.sin(angles[:2]), np.cos(angles[:2]), np.tan(angles[1])
    return np.array([[1, s * t, c * t], [0, c, -s], [0, s / cp, c / cp]])


def corrected(x, P, H, variance, residual):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + variance * I)
    keep = np.eye(15) - K @ H
    return x + K @ residual, keep @ P @ keep.T + variance * K @ K.T


def ins_ahrs(recording):
    """Yields (x, P) after each sample; x in the chapter's order p, v, b_acc, Theta, b_ars.

    Beside what the m-file has: the Earth turns, the force turns with the body during a sample, each
    fix is used when it comes, and between records the gyros carry the attitude on.
    """
    position, attitude = recording.sources
    truth = recording.reference
    place = displacement(position.y, truth.lla[0])
    known, x, P = truth.rotation[0], np.zeros(15), np.eye(15)
    x[9:12] = truth.rph[0]
    for t, h, dtheta, dv in zip(*recording.imu):
        C, T = known.as_matrix(), transformation(known.as_euler("ZYX")[::-1])
        w, f = dtheta / h - x[12:] - C.T @ EARTH, dv / h - x[6:9]
        A = np.block(
            [
                [O, I, O, O, O],
                [O, O, -C, O, O],
                [O, O, -I / T_ACC, O, O],
                [O, O, O, O, -T],
                [O, O, O, O, -I / T_ARS],
            ]
        )
        E = np.block([[O, O, O, O], [-C, O, O, O], [O, I, O, O], [O, O, -T, O], [O, O, O, I]])
        Ad = expm(A * h)
        P = Ad @ P @ Ad.T + E @ np.diag(np.repeat(Q, 3) * cases.PUBLISHED_STEP * h) @ E.T
        a = C @ (f + h / 2 * np.cross(w, f)) + GRAVITY - 2 * np.cross(EARTH, x[3:6])
        x[:3] += h * x[3:6] + h * h / 2 * a
        x[3:6] += h * a
        x[9:12] += h * T @ w
        known = known * Rotation.from_rotvec(w * h)
        for row in np.flatnonzero(np.abs(position.t - t) < 1e-6):
            x, P = corrected(x, P, np.eye(3, 15), R["position"], place[row] - x[:3])
        for row in np.flatnonzero(np.abs(attitude.t - t) < 1e-6):
            off = (attitude.y[row] - x[9:12] + np.pi) % (2 * np.pi) - np.pi
            x, P = corrected(x, P, np.eye(3, 15, 9), R["attitude"], off)
            known = Rotation.from_euler("ZYX", attitude.y[row][::-1])
        yield x.copy(), np.sqrt(np.diag(P))


def fused(recording, name, **options):
    return sd.fuse(
        recording,
        name,
        start=cases.start(recording, cases.CHAPTER, 1),
        noise=cases.noise(CASE, cases.CHAPTER, "at rest"),
        options={**options, "bias": "held"},
    )


@pytest.mark.parametrize("excitation", ["at rest", "signal 1", "signal 2"])
def test_with_the_chapters_weights_they_are_the_published_recursion(excitation):
    """Within a hundredth of a standard deviation at every sample: left are the transport rate, the
    change of the place and second-order terms of the angles."""
    recording = cases.select_sources(
        signals.recording(excitation, 5, 100.0, SECONDS), CASE, cases.CHAPTER
    )
    x, deviation = map(np.array, zip(*ins_ahrs(recording)))
    for name in ("indirect-ahrs-closed", "indirect-ahrs-open", "direct-ahrs"):
        found = fused(recording, name, **cases.AS_PUBLISHED)
        own = found.trajectory
        apart = np.hstack(
            [
                displacement(own.lla, recording.reference.lla[0]) - x[:, :3],
                own.v_n - x[:, 3:6],
                found.b_a - x[:, 6:9],
                (own.rph - x[:, 9:12] + np.pi) % (2 * np.pi) - np.pi,
                found.b_g - x[:, 12:],
            ]
        )
        assert np.abs(apart / deviation).max() < 0.01, name
        ratio = own.std[:, [0, 1, 2, 3, 4, 5, 9, 10, 11]] / deviation[:, :9]
        assert np.abs(ratio - 1).max() < 1e-3, name


@pytest.mark.parametrize("name", ["indirect-ahrs-closed", "direct-ahrs", "fixed-gain"])
def test_an_ahrs_that_states_too_much_invents_no_bias(name):
    """A car whose AHRS errs by 0.2, 0.2 and 0.5 deg and states 10 deg: its accelerometer bias errs by
    no more than three of the stated standard deviations, where a mean shifted by that covariance
    would be 0.3 m/s^2 off."""
    for seed in (21, 22):
        recording = sd.simulate("car", 100.0, "tactical", seed, gnss=Gnss(lever_arm=(0.0,) * 3))
        truth = recording.reference
        rows = np.arange(10, len(truth.t), 10)
        noise = np.radians([0.2, 0.2, 0.5]) * np.random.default_rng(seed).standard_normal(
            (len(rows), 3)
        )
        ahrs = sd.Source(
            "attitude",
            truth.t[rows],
            truth.rph[rows] + noise,
            np.full((len(rows), 3), np.radians(10.0)),
            name="ahrs",
        )
        kept = tuple(a for a in recording.sources if a.kind in ("position", "velocity"))
        found = sd.fuse(
            sd.Recording(recording.imu, (*kept, ahrs), truth, recording.meta), name, imu="tactical"
        )
        error = found.b_a[-1] - recording.meta["b_a"][-1]
        assert (np.abs(error) < 3 * found.trajectory.std[-1, 9:12]).all()
