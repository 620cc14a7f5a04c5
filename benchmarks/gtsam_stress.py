"""GTSAM's own stress test of its IMU factors, beside the closed loop on the same increments.

Three experiments of its release 4.3 (gtsam/navigation/doc/GalileanImuFactorNEES.ipynb): increments of a held
or slowly changing rate and force with white noise, no fixes, and the normalised squared error of position,
velocity and attitude at the end, 9 where the claimed covariance is right. strapdown flies them over the Earth,
with its gravity and rotation, to the end that the increments without noise have in steps a hundred times
finer; in the third, as there, to the end that it has itself without noise.

    python benchmarks/gtsam_stress.py            # with the extra `ranking`; the table of the page
"""

from typing import NamedTuple

import numpy as np

from strapdown.core.loop.contract import InitialState, Noise
from strapdown.core.mathematics.mechanization import compensate
from strapdown.evaluation.consistency import nees
from strapdown.filters.ins import closed_loop
from strapdown.geometry.geodesy import displacement

LATITUDE, G = np.deg2rad(32.99), 9.80665
FINE = 100
"""Steps of the truth in one of the increments."""
CERTAIN = (1e-5,) * 3 + (1e-5,) * 3 + (1e-7,) * 3 + (1e-9,) * 6
"""Standard deviations of the start: it is known."""


class Stress(NamedTuple):
    """One experiment: rates and forces in the body, (n, 3) or (3,), and what noise they get."""

    name: str
    dt: float
    steps: int
    runs: int
    seed: int
    rate: np.ndarray  # rad/s
    force: np.ndarray  # m/s^2
    gyro: np.ndarray  # rad/sqrt(s), three axes
    accel: np.ndarray  # m/s/sqrt(s)
    own_mean: bool  # errors are from the end without noise, not from the truth
    published: float  # mean NEES of the Galilean form
    others: float  # and of the three older forms


def _slow():
    t = (np.arange(100) + 0.5) * 0.1
    force = (0.8 + 0.35 * np.sin(0.37 * t), -0.45 + 0.25 * np.cos(0.53 * t), 0.3 * np.sin(0.29 * t))
    rate = (
        0.35 * np.sin(0.41 * t),
        -0.30 * np.cos(0.31 * t),
        0.20 + 0.15 * np.sin(0.23 * t),
    )
    return np.column_stack(rate), np.column_stack(force)


FAST, ACCEL = np.array([0.01, 0.015, 0.02]), np.array([0.03, 0.04, 0.05])
SLOW_RATE, SLOW_FORCE = _slow()
EXPERIMENTS = (
    Stress(
        "one second at 20 Hz",
        0.05,
        20,
        3000,
        2231,
        np.array([1.2, -0.8, 2.0]),
        np.array([2.0, -1.0, 0.5]),
        FAST,
        ACCEL,
        False,
        8.959,
        14.502,
    ),
    Stress(
        "ascent with 12 g, four seconds at 20 Hz",
        0.05,
        80,
        3000,
        2232,
        np.array([0.0, -0.04, 0.0]),
        np.array([0.0, 0.0, 12 * G]),
        FAST / 20,
        ACCEL,
        False,
        9.090,
        14.012,
    ),
    Stress(
        "ten seconds at 10 Hz",
        0.1,
        100,
        2000,
        2904,
        SLOW_RATE,
        SLOW_FORCE,
        np.array([0.07, 0.09, 0.11]),
        np.array([0.25, 0.30, 0.35]),
        True,
        8.993,
        8.995,
    ),
)


def isotropic(experiment):
    """The experiment with the same noise on all axes, which is what a filter of this package is told."""
    even = lambda axes: np.full(3, np.sqrt(np.mean(axes**2)))
    return experiment._replace(gyro=even(experiment.gyro), accel=even(experiment.accel))


def flown(experiment, rates, forces, dt):
    """The belief of the closed loop after increments of these rates and forces, from a known start."""
    noise = Noise(float(experiment.gyro[0]), float(experiment.accel[0]), 0.0, 0.0, 0.0, 0.0)
    zero = (0.0, 0.0, 0.0)
    at = InitialState(0.0, (LATITUDE, 0.0, 1000.0), zero, zero, zero, zero, CERTAIN)
    belief, before, u = closed_loop.start(at, noise), np.zeros(7), np.empty(6)
    for rate, force in zip(rates, forces):
        compensate(rate * dt, force * dt, dt, before, u)
        before[:3], before[3:6], before[6] = rate * dt, force * dt, dt
        closed_loop.predict(belief, u, dt, noise)
    return belief


def ours(experiment):
    """(runs, 2) normalised squared errors of the closed loop: as differences in north, east and down, and
    as one logarithm in SE_2(3), whose coordinates GTSAM uses."""
    from scipy.spatial.transform import Rotation

    e, rng = experiment, np.random.default_rng(experiment.seed)
    rates, forces = (np.broadcast_to(part, (e.steps, 3)) for part in (e.rate, e.force))
    finer = 1 if e.own_mean else FINE
    truth = flown(e, *(np.repeat(part, finer, axis=0) for part in (rates, forces)), e.dt / finer)
    errors, covariances = np.empty((e.runs, 2, 9)), np.empty((e.runs, 2, 9, 9))
    for i in range(e.runs):
        # in the order in which the notebook draws them
        force = forces + rng.normal(size=(e.steps, 3)) * e.accel / np.sqrt(e.dt)
        rate = rates + rng.normal(size=(e.steps, 3)) * e.gyro / np.sqrt(e.dt)
        end = flown(e, rate, force, e.dt)
        turned = Rotation.from_matrix(truth.C_nb @ end.C_nb.T).as_rotvec()
        moved, faster = displacement(truth.lla, end.lla), truth.v_n - end.v_n
        errors[i, 0] = np.r_[moved, faster, turned]
        body = np.kron(np.eye(3), end.C_nb.T)
        back = inverse_jacobian(end.C_nb.T @ turned) @ end.C_nb.T
        errors[i, 1] = np.r_[back @ moved, back @ faster, end.C_nb.T @ turned]
        covariances[i] = end.P[:9, :9], body @ end.P[:9, :9] @ body.T
    flat = nees(errors.reshape(-1, 9), covariances.reshape(-1, 9, 9))
    return flat.reshape(e.runs, 2)


def inverse_jacobian(r):
    """(3, 3) inverse of the left Jacobian of SO(3) at a rotation vector; Barfoot (2017) (7.86)."""
    angle, cross = np.linalg.norm(r), np.cross(np.eye(3), r)
    beyond = 1 / 12 if angle < 1e-4 else (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.eye(3) - cross / 2 + beyond * cross @ cross


def theirs(experiment, form):
    """(runs,) normalised squared errors of one of GTSAM's preintegrations, from its exact end."""
    import gtsam

    e, rng = experiment, np.random.default_rng(experiment.seed)
    rates, forces = (np.broadcast_to(part, (e.steps, 3)) for part in (e.rate, e.force))
    parameters = gtsam.PreintegrationParams(np.zeros(3))
    parameters.setAccelerometerCovariance(np.diag(e.accel**2))
    parameters.setGyroscopeCovariance(np.diag(e.gyro**2))
    parameters.setIntegrationCovariance(np.zeros((3, 3)))
    bias, start = gtsam.imuBias.ConstantBias(), gtsam.NavState()

    def integrated(rates, forces, form):
        pim = form(parameters, bias)
        for rate, force in zip(rates, forces):
            pim.integrateMeasurement(force, rate, e.dt)
        return pim

    exact = form if e.own_mean else gtsam.PreintegratedImuMeasurementsG
    truth, found = integrated(rates, forces, exact).predict(start, bias), np.empty(e.runs)
    for i in range(e.runs):
        force = forces + rng.normal(size=(e.steps, 3)) * e.accel / np.sqrt(e.dt)
        rate = rates + rng.normal(size=(e.steps, 3)) * e.gyro / np.sqrt(e.dt)
        pim = integrated(rate, force, form)
        error = np.asarray(truth.logmap(pim.predict(start, bias)))
        found[i] = error @ np.linalg.solve(np.asarray(pim.residualCovariance()), error)
    return found


def rows():
    """Lines of the table, one for each experiment."""
    import gtsam

    galilean, older = (
        gtsam.PreintegratedImuMeasurementsG,
        gtsam.PreintegratedImuMeasurementsManifold,
    )
    for experiment in EXPERIMENTS:
        even = isotropic(experiment)
        again = [float(theirs(experiment, form).mean()) for form in (galilean, older)]
        same = [float(theirs(even, form).mean()) for form in (galilean, older)]
        yield experiment, again, same, ours(even).mean(axis=0).tolist()


if __name__ == "__main__":
    for experiment, again, same, own in rows():
        print(
            experiment.name,
            "published",
            experiment.published,
            experiment.others,
            "again",
            again,
            "even noise",
            same,
            "strapdown",
            own,
        )
