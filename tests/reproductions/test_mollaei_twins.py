"""The filters of Mollaei et al. as printed, step by step, against their equations written down
again: (19) to (39), and the process of (1) to (18) with the textbook aircraft of tests/support.

Nothing of the package computes here but the filter that is tested. Both see the same increments,
fixes and controls, and go their own way from the start.
"""

from dataclasses import replace

import numpy as np
import pytest
from flat_flight import GRAVITY, NOISE, ORIGIN, flat, flight, geodetic
from flown import flown
from scipy.spatial.transform import Rotation
from textbook_aircraft import forces

from strapdown import InitialState
from strapdown.core.loop.contract import Imu
from strapdown.core.mathematics.earth import gravity
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.engine import batch
from strapdown.engine.options import run_options
from strapdown.flight.aircraft_model.parameters import aircraft
from strapdown_reproductions.mollaei.six_state import filters, particle_filter
from strapdown_reproductions.mollaei.six_state.model import X

NEAR = 1e-9
"""m, m/s, and of covariances their square: the most that filter and twin are apart."""
UNKNOWN = 0.1
"""m/s/sqrt(s), what the model does not know, as the filters have it by default."""
STEP = 1e-5
"""m/s, of the differences that stand for the derivative N of (22): one-sided, as in the filter."""
CRAFT = aircraft("aerosonde")


class World:
    """What a filter sees, sample by sample: increments, fixes, and controls where there are any."""

    def __init__(self, recording, start, inputs=None):
        self.recording, self.start, self.inputs = recording, start, inputs
        self.dt = recording.imu.dt[0]
        lat, _, height = start.lla
        self.gravity = gravity(np.sin(lat), height)
        self.samples = list(self._samples())

    def _samples(self):
        """(change of velocity by the IMU, C at mid-sample, rates, fixes) of each sample."""
        C, old = Rotation.from_euler("ZYX", self.start.rph[::-1]), np.zeros((2, 3))
        fixes = {}
        for source in self.recording.sources:
            first = 0 if source.kind == "position" else 3
            for t, y, std in zip(source.t, source.y, source.std):
                metres = flat(y, self.start.lla) if first == 0 else y
                fixes.setdefault(round(t / self.dt), []).append((first, metres, std))
        imu = self.recording.imu
        for k, (theta, dv) in enumerate(zip(imu.dtheta, imu.dv), 1):
            r = theta + np.cross(old[0], theta) / 12
            a = dv + (np.cross(old[0], dv) + np.cross(old[1], theta)) / 12
            turned = a + np.cross(r, a) / 2 + np.cross(r, np.cross(r, a)) / 6
            change = C.apply(turned) + [0, 0, self.gravity * self.dt]
            middle = (C * Rotation.from_rotvec(r / 2)).as_matrix()
            C, old = C * Rotation.from_rotvec(r), np.array([theta, dv])
            yield change, middle, r / self.dt, fixes.get(k, [])

    def process(self, k, model):
        """Function x (6,) -> x after sample k: x' = v, v' by the IMU or by the aircraft's forces
        (midpoint rule)."""
        change, C, rates, _ = self.samples[k]
        dt = self.dt

        def acceleration(v):
            controls, wind = self.inputs[k, 1:5], self.inputs[k, 5:8]
            force, _ = forces(CRAFT, C.T @ (v - wind), rates, controls, CRAFT["density"])
            return C @ force / CRAFT["mass"] + [0, 0, self.gravity]

        def advance(x):
            v = x[3:]
            if model:
                w = v + dt * acceleration(v + 0.5 * dt * acceleration(v))
            else:
                w = v + change
            return np.r_[x[:3] + 0.5 * dt * (v + w), w]

        def slope(x):
            """The derivative of `advance` by x, from that of the acceleration at mid-sample."""
            A = np.eye(3)
            if model:
                middle = x[3:] + 0.5 * dt * acceleration(x[3:])
                at = acceleration(middle)
                J = np.column_stack(
                    [(acceleration(middle + d) - at) / STEP for d in STEP * np.eye(3)]
                )
                A = A + J * dt + J @ J * dt**2 / 2
            return np.block([[np.eye(3), 0.5 * dt * (np.eye(3) + A)], [np.zeros((3, 3)), A]])

        return advance, slope


def noise_of(dt, density, q):
    """Q of a sample: of white acceleration of that density (m/s/sqrt(s)), or q I as printed."""
    if q:
        return q * np.eye(6)
    I, s = np.eye(3), density**2
    return s * np.block([[dt**3 / 3 * I, dt**2 / 2 * I], [dt**2 / 2 * I, dt * I]])


def density_of(model):
    return UNKNOWN if model else NOISE.accel


def begun(start):
    return np.r_[0, 0, 0, start.v_n], np.diag(np.array(start.std[:6]) ** 2)


def kalman(x, P, first, y, R):
    """(19), (20) and (21), which lacks a transpose, of a fix that sees three states; and its
    innovation and their covariance."""
    H = np.eye(6)[first : first + 3]
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    e = y - H @ x
    I = np.eye(6)
    return x + K @ e, (I - K @ H) @ P @ (I - K @ H).T + K @ R @ K.T, e, S


def extended(world, model, q=0.0, r=0.0):
    """(19) to (22): (x, P) after each sample."""
    x, P = begun(world.start)
    Q = noise_of(world.dt, density_of(model), q)
    for k, (_, _, _, fixes) in enumerate(world.samples):
        advance, slope = world.process(k, model)
        F = slope(x)
        x, P = advance(x), F @ P @ F.T + Q
        for first, y, std in fixes:
            x, P, _, _ = kalman(x, P, first, y, r * np.eye(3) if r else np.diag(std**2))
        yield x, P


def sigma_points(x, P, merwe):
    """Points, weights of the mean and of the covariance: (30) with alpha 0.1, beta 2, kappa 0, or
    (23) and (24)."""
    n = len(x)
    scaled = 0.1**2 * n if merwe else n
    L = np.linalg.cholesky(scaled * P)
    points = np.vstack([x, x + L.T, x - L.T])
    mean = np.r_[1 - n / scaled, np.full(2 * n, 0.5 / scaled)]
    spread = mean.copy()
    if merwe:
        spread[0] += 1 - 0.1**2 + 2
    return points, mean, spread


def moments(points, mean, spread):
    centre = mean @ points
    off = points - centre
    return centre, off.T @ (spread[:, None] * off)


def augmented(dt, model, q):
    """Covariance of the six noises of (25), and what they do to the state."""
    I = np.eye(3)
    if q:
        return q * np.eye(6), np.eye(6)
    v = density_of(model) ** 2 * dt
    effect = np.block([[0.5 * dt * I, I], [I, 0 * I]])
    return np.diag([v] * 3 + [v * dt**2 / 12] * 3), effect


def spread_through(world, k, model, x, P, merwe, q):
    """Prediction by the points of the state with its noise, (25)."""
    noise, effect = augmented(world.dt, model, q)
    joint = np.block([[P, np.zeros((6, 6))], [np.zeros((6, 6)), noise]])
    points, mean, weights = sigma_points(np.r_[x, np.zeros(6)], joint, merwe)
    advance, _ = world.process(k, model)
    moved = np.array([advance(p[:6]) + effect @ p[6:] for p in points])
    return moments(moved, mean, weights)


def unscented(world, model, merwe=True, q=0.0, r=0.0):
    """(23) to (32), noise augmented, points drawn anew for each fix: (x, P) after each sample."""
    x, P = begun(world.start)
    for k, (_, _, _, fixes) in enumerate(world.samples):
        x, P = spread_through(world, k, model, x, P, merwe, q)
        for first, y, std in fixes:
            R = r * np.eye(3) if r else np.diag(std**2)
            points, mean, weights = sigma_points(x, P, merwe)
            seen = points[:, first : first + 3]
            z, S = moments(seen, mean, weights)
            S = S + R
            K = (points - x).T @ (weights[:, None] * (seen - z)) @ np.linalg.inv(S)
            x, P = x + K @ (y - z), P - K @ S @ K.T
        yield x, P


def through(world, filter, model, **options):
    """(run, x, P) of the filter after each sample."""
    run = batch.begin(
        world.recording,
        filter,
        run_options(options=options, start=world.start, noise=NOISE),
    )
    for k in range(len(world.samples)):
        if world.inputs is not None:
            workspace = run.belief.workspace
            workspace[filters.INPUTS : filters.INPUTS + 9] = world.inputs[k]
            workspace[filters.INPUTS] = float(model)
        run.advance(k + 1)
        yield run, run.belief.workspace[X].copy(), run.belief.P[:6, :6].copy()


def in_motion(seconds, rate=20.0):
    recording, start, _ = flight(seconds, rate=rate, gps=1.0)
    return World(ungated(recording), start)


def ungated(recording):
    return replace(recording, sources=tuple(replace(a, gate=np.inf) for a in recording.sources))


def at_rest(seconds, rate=20.0):
    """A body that stands level, with the noise of the IMU, and fixes of its place each second."""
    rng, n, dt = np.random.default_rng(6), round(seconds * rate), 1 / rate
    t = dt * np.arange(1, n + 1)
    draw = lambda density: density * np.sqrt(dt) * rng.standard_normal((n, 3))
    fixed = t[round(rate) - 1 :: round(rate)]
    sources = (
        Source(
            "position",
            fixed,
            geodetic(rng.standard_normal((len(fixed), 3))),
            np.ones((len(fixed), 3)),
            gate=np.inf,
        ),
        Source(
            "velocity",
            fixed,
            0.1 * rng.standard_normal((len(fixed), 3)),
            np.full((len(fixed), 3), 0.1),
            gate=np.inf,
        ),
    )
    imu = Imu(t, np.full(n, dt), draw(NOISE.gyro), [0, 0, -GRAVITY * dt] + draw(NOISE.accel))
    std = (2.0,) * 3 + (0.3,) * 3 + (1e-6,) * 9
    start = InitialState(0.0, tuple(ORIGIN), *[(0.0,) * 3] * 4, std)
    return World(Recording(imu, sources, None, {"name": "rest"}), start)


def by_model(seconds, dt=0.05):
    made = flown(seconds, dt, fixes=np.arange(1.0, seconds, 1.0))
    return World(made.recording, made.start, made.inputs)


def apart(twin, run):
    """Largest differences of states and of covariances over all samples."""
    off = [(np.abs(x - own).max(), np.abs(P - of).max()) for (x, P), (_, own, of) in zip(twin, run)]
    assert len(off) > 1
    return np.max(off, axis=0)


PRINTED = {"q": 0.1, "r": 0.5}


@pytest.mark.parametrize("world", [at_rest, in_motion])
@pytest.mark.parametrize("given", [{}, PRINTED])
def test_the_ekf_is_19_to_22_for_five_minutes(world, given):
    made = world(300.0)
    options = {**given, "rate": 20.0}
    off = apart(extended(made, False, **given), through(made, filters.EKF6, False, **options))
    assert off.max() < NEAR, off


@pytest.mark.parametrize("world", [at_rest, in_motion])
@pytest.mark.parametrize("given", [{}, PRINTED])
@pytest.mark.parametrize("sigma", ["merwe", "symmetric"])
def test_the_ukf_is_23_to_32_for_five_minutes(world, given, sigma):
    made = world(300.0)
    twin = unscented(made, False, sigma == "merwe", **given)
    options = {**given, "sigma": sigma, "rate": 20.0}
    off = apart(twin, through(made, filters.UKF6, False, **options))
    assert off.max() < NEAR, off


@pytest.mark.parametrize("made", [dict(seconds=300.0, dt=0.05), dict(seconds=10.0, dt=0.02)])
def test_the_ekf_is_19_to_22_with_the_process_1_to_18(made):
    """The derivative of (22) is a difference of both; one that is none would show in P."""
    world = by_model(**made)
    run = through(world, filters.EKF6, True, rate=1 / world.dt)
    off = apart(extended(world, True), run)
    assert off.max() < NEAR, off


@pytest.mark.parametrize("sigma", ["merwe", "symmetric"])
def test_the_ukf_is_23_to_32_with_the_process_1_to_18(sigma):
    world = by_model(30.0)
    run = through(world, filters.UKF6, True, sigma=sigma, rate=1 / world.dt)
    off = apart(unscented(world, True, sigma == "merwe"), run)
    assert off.max() < NEAR, off


COUNT = 4


def mixture_of(run):
    """(means (COUNT, 6), covariances (COUNT, 6, 6), weights (COUNT,)) of the particle filter."""
    own = particle_filter.SLOTS.views(run.belief.workspace)["COMPONENTS"]
    each = own[: 42 * COUNT].reshape(COUNT, 42).copy()
    weights = own[42 * COUNT : 43 * COUNT].copy()
    return each[:, :6], each[:, 6:].reshape(COUNT, 6, 6), weights


def whole(means, covariances, weights):
    """Mean and covariance of the density (33)."""
    x = weights @ means
    off = means - x
    return x, np.einsum("i,ijk->jk", weights, covariances) + off.T @ (weights[:, None] * off)


def particles(world, k, model, points, mixture):
    """(33) to (36) of one sample: each component predicted by (22) or the points (37) to (39),
    corrected by (19) to (21), weighted by the likelihood of its innovation."""
    means, covariances, weights = (each.copy() for each in mixture)
    Q = noise_of(world.dt, density_of(model), 0.0)
    advance, slope = world.process(k, model)
    for i in range(COUNT):
        x, P = means[i], covariances[i]
        if points:
            x, P = spread_through(world, k, model, x, P, False, 0.0)
        else:
            F = slope(x)
            x, P = advance(x), F @ P @ F.T + Q
        for first, y, std in world.samples[k][3]:
            x, P, e, S = kalman(x, P, first, y, np.diag(std**2))
            weights[i] *= np.exp(-0.5 * e @ np.linalg.solve(S, e)) / np.sqrt(np.linalg.det(S))
        means[i], covariances[i] = x, P
    return means, covariances, weights / weights.sum()


@pytest.mark.parametrize("model", [False, True])
@pytest.mark.parametrize("points", [False, True])
@pytest.mark.parametrize("resample", [0.0, 1.0])
def test_the_pkf_is_33_to_39_at_each_step(model, points, resample):
    """Of a component each; where they are drawn anew, mean and covariance stay. Fixes of position
    alone, so that at most one of them is in a sample."""
    world = by_model(15.0) if model else in_motion(60.0)
    recording = replace(world.recording, sources=world.recording.sources[:1])
    world = World(recording, world.start, world.inputs)
    options = {"components": COUNT, "kernel": 0.6, "resample": resample, "rate": 1 / world.dt}
    options["transition"] = "sigma-points" if points else "linearised"
    before, drawn, counts = None, 0, set()
    for k, (run, x, P) in enumerate(through(world, filters.PKF6, model, **options)):
        now, renewed = mixture_of(run), run.belief.workspace[particle_filter.RESAMPLINGS]
        if before is not None:
            twin = particles(world, k, model, points, before)
            off = [np.abs(a - b).max() for a, b in zip(whole(*twin), (x, P))]
            if renewed == drawn:
                off += [np.abs(a - b).max() for a, b in zip(twin, now)]
            assert max(off) < NEAR, (k, off)
            counts.add(len(off))
        before, drawn = now, renewed
    assert counts == ({5} if resample == 0 else {2, 5})
