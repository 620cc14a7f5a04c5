"""GTSAM: combined IMU factors (Galilean preintegration) between positions, in Cartesian axes north, east and
down of the start that turn with the Earth, with the gravity of each state's place,
as a smoother with fixed lag (the newest state is scored) and over all states at once.

A state stands at each fix, and where fixes are missing at the times that they would have had.
"""

import time
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from adapters import fixes_by_sample, instants, judged
from strapdown.core.mathematics.earth import RATE
from strapdown.geometry.geodesy import from_ecef, gravity, ned_axes, to_ecef

LAG = 30.0
"""s of the smoother with fixed lag, longer than the outages."""
SIZES = {"x": 6, "v": 3, "b": 6}
"""Coordinates of a pose, a velocity, the biases."""


class _Axes(NamedTuple):
    """North, east and down of the start."""

    origin: np.ndarray  # (3,) m, ECEF
    turn: np.ndarray  # (3, 3) from ECEF to these axes
    lat: float

    def metres(self, lla):
        """A place in these axes."""
        return self.turn @ (to_ecef(lla) - self.origin)

    def places(self, metres):
        """(lla, turn from these axes to north, east and down there) of (n, 3) or (3,)."""
        lla = from_ecef(self.origin + metres @ self.turn)
        return lla, ned_axes(lla) @ self.turn.T


def _axes(w):
    lla = np.asarray(w.start[0], float)
    return _Axes(to_ecef(lla), ned_axes(lla), lla[0])


def _parameters(gtsam, w, axes, metres):
    """Those of a preintegration that begins at a place."""
    p, (lla, turn) = w.parameters, axes.places(metres)
    made = gtsam.PreintegrationCombinedParams(turn.T @ [0.0, 0.0, gravity(lla[0], lla[2])])
    square = lambda value: np.eye(3) * value**2
    made.setAccelerometerCovariance(square(p["accel_noise"]))
    made.setGyroscopeCovariance(square(p["gyro_noise"]))
    made.setIntegrationCovariance(np.zeros((3, 3)))
    made.setBiasAccCovariance(square(p["accel_bias_walk"]))
    made.setBiasOmegaCovariance(square(p["gyro_bias_walk"]))
    made.setOmegaCoriolis(RATE * np.array([np.cos(axes.lat), 0.0, -np.sin(axes.lat)]))
    return made


def _keys(gtsam, i):
    shorthand = gtsam.symbol_shorthand
    return shorthand.X(i), shorthand.V(i), shorthand.B(i)


def _prior(gtsam, w):
    """(graph, values) of the start."""
    pose = gtsam.Pose3(gtsam.Rot3.RzRyRx(*w.start[2]), np.zeros(3))
    v, bias, (x, u, b) = (
        np.asarray(w.start[1], float),
        gtsam.imuBias.ConstantBias(),
        _keys(gtsam, 0),
    )
    sigmas, R = gtsam.noiseModel.Diagonal.Sigmas, pose.rotation().matrix()
    turned = np.zeros((6, 6))
    turned[:3, :3] = R.T @ np.diag(w.std[6:9] ** 2) @ R
    turned[3:, 3:] = R.T @ np.diag(w.std[:3] ** 2) @ R
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose3(x, pose, gtsam.noiseModel.Gaussian.Covariance(turned)))
    graph.add(gtsam.PriorFactorVector(u, v, sigmas(w.std[3:6])))
    graph.add(gtsam.PriorFactorConstantBias(b, bias, sigmas(w.std[9:15])))
    for key, value in ((x, pose), (u, v), (b, bias)):
        values.insert(key, value)
    return graph, values


class _Step(NamedTuple):
    """What one state adds to the graph."""

    k: int  # its sample
    graph: object
    values: object
    keys: tuple


def _steps(gtsam, w, newest):
    """The states of a workload in turn, as _Step. `newest(keys)` is what is known of the state before:
    (NavState, bias)."""
    fixes, axes = fixes_by_sample(w), _axes(w)
    stands = set(instants(w))
    model = gtsam.noiseModel.Isotropic.Sigma(3, w.parameters["gnss_std"])
    begun = lambda state, bias: gtsam.PreintegratedCombinedMeasurementsG(
        _parameters(gtsam, w, axes, state.position()), bias
    )
    state, bias = newest(_keys(gtsam, 0))
    f, omega, i, pim = w.dv / w.dt, w.dtheta / w.dt, 0, begun(state, bias)
    for k in range(1, len(w.t)):
        pim.integrateMeasurement(f[k], omega[k], w.dt)
        if k not in stands:
            continue
        before = _keys(gtsam, i)
        i, (x, v, b) = i + 1, _keys(gtsam, i + 1)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.GalileanCombinedImuFactor(*before[:2], x, v, before[2], b, pim))
        if k in fixes:
            graph.add(gtsam.GPSFactor(x, axes.metres(fixes[k]), model))
        ahead = pim.predict(state, bias)
        for key, value in ((x, ahead.pose()), (v, ahead.velocity()), (b, bias)):
            values.insert(key, value)
        yield _Step(k, graph, values, (x, v, b))
        state, bias = newest((x, v, b))
        pim = begun(state, bias)


def _row(pose, v, of_pose, of_v):
    """(metres, velocity, C, std) of a state with its marginal covariances, the pose's in body axes."""
    R = pose.rotation().matrix()
    blocks = (R @ of_pose[3:, 3:] @ R.T, of_v, R @ of_pose[:3, :3] @ R.T)
    return pose.translation(), v, R, np.sqrt(np.concatenate([np.diag(part) for part in blocks]))


def _judged(w, took, t, rows):
    metres, v, C, std = (np.array(column) for column in zip(*rows))
    lla, turn = _axes(w).places(metres)
    return judged(w, took, t, lla, np.einsum("nij,nj->ni", turn, v), turn @ C, std)


def _forward(gtsam, w):
    """Each _Step of the smoother with fixed lag, after its update, with the smoother."""
    (graph, values), robust = _prior(gtsam, w), gtsam.ISAM2Params()
    robust.setFactorization("QR")  # of an ill-conditioned graph Cholesky finds no factors
    smoother = gtsam.IncrementalFixedLagSmoother(LAG, robust)
    smoother.update(graph, values, dict.fromkeys(_keys(gtsam, 0), float(w.t[0])))

    def newest(keys):
        x, v, b = keys
        state = gtsam.NavState(
            smoother.calculateEstimatePose3(x), smoother.calculateEstimateVector(v)
        )
        return state, smoother.calculateEstimateConstantBias(b)

    for step in _steps(gtsam, w, newest):
        smoother.update(step.graph, step.values, dict.fromkeys(step.keys, float(w.t[step.k])))
        yield step, smoother


def fixed_lag(workload, seconds=60.0):
    """GTSAM's IncrementalFixedLagSmoother: the newest state of each step."""
    import gtsam

    w = workload.first(seconds)
    begin, t, rows = time.process_time(), [], []
    for step, smoother in _forward(gtsam, w):
        x, v, _ = step.keys
        t.append(w.t[step.k])
        pose, velocity = smoother.calculateEstimatePose3(x), smoother.calculateEstimateVector(v)
        rows.append(_row(pose, velocity, *map(smoother.marginalCovariance, (x, v))))
    return _judged(w, time.process_time() - begin, np.array(t), rows)


def batch(workload, seconds=60.0):
    """GTSAM's Levenberg-Marquardt over all states at once, from those of the fixed lag,
    whose time counts."""
    import gtsam

    w = workload.first(seconds)
    graph, first = _prior(gtsam, w)
    begin, t, keys = time.process_time(), [], []
    for step, smoother in _forward(gtsam, w):
        x, v, b = step.keys
        first.insert(x, smoother.calculateEstimatePose3(x))
        first.insert(v, smoother.calculateEstimateVector(v))
        first.insert(b, smoother.calculateEstimateConstantBias(b))
        graph.push_back(step.graph)
        t.append(w.t[step.k])
        keys.append(step.keys)
    robust = gtsam.LevenbergMarquardtParams()
    robust.setLinearSolverType("MULTIFRONTAL_QR")
    best = gtsam.LevenbergMarquardtOptimizer(graph, first, robust).optimize()
    marginal = _marginal(gtsam, graph, best)
    rows = [_row(best.atPose3(x), best.atVector(v), marginal(x), marginal(v)) for x, v, _ in keys]
    return _judged(w, time.process_time() - begin, np.array(t), rows)


def _marginal(gtsam, graph, best):
    """A function that finds the covariance of a key. GTSAM's Marginals know Cholesky alone in Python; where
    that finds no factors, those of QR over the whole Jacobian."""
    try:
        return gtsam.Marginals(graph, best).marginalCovariance
    except RuntimeError:
        order = gtsam.Ordering.ColamdNonlinearFactorGraph(graph)
        keys = [order.at(i) for i in range(order.size())]
        R = np.linalg.qr(graph.linearize(best).jacobian(order)[0], mode="r")
        rows = solve_triangular(R, np.eye(len(R)))
        ends = np.cumsum([SIZES[chr(gtsam.Symbol(key).chr())] for key in keys])
        inside = {
            key: slice(end - n, end) for key, end, n in zip(keys, ends, np.diff(np.r_[0, ends]))
        }
        return lambda key: rows[inside[key]] @ rows[inside[key]].T
