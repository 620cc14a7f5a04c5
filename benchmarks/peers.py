"""Other packages on the same workloads, each as one small function: (workload, seconds) -> Result.

The peers work with what they have: pyins with its two filters, smsfusion (flat Earth) with
AidedINS, filterpy with an unscented filter whose motion model is written here in plain numpy. All
assume the noise that the workload was made with.
"""

import math
import time
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

import numpy as np
from workload import DEG, SETTLED, Rms, score

PACKAGES = ("python-ins", "smsfusion", "filterpy")


class Estimate(NamedTuple):
    """What a filter says of position, velocity and attitude."""

    t: np.ndarray  # (n,) s
    lla: np.ndarray  # (n, 3) rad, rad, m
    v: np.ndarray  # (n, 3) NED, m/s
    C: np.ndarray  # (n, 3, 3) body to navigation frame
    std: np.ndarray  # (n, 3) claimed standard deviations of the position, NED, m


class Result(NamedTuple):
    """What a peer took and reached."""

    us: float  # microseconds of the processor per IMU sample
    rms: Rms | None  # None on a piece too short to score, or without truth at each sample
    estimate: Estimate | None = None


def versions():
    """{package: version, or None where it is not installed}."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


def judged(workload, seconds, *estimate):
    """A Result from the time taken and the fields of an Estimate; on a short piece without
    accuracy."""
    known = workload.lla is not None and workload.t[-1] > SETTLED
    rms = score(workload, *estimate[:4]) if known else None
    return Result(seconds / (len(workload.t) - 1) * 1e6, rms, Estimate(*estimate))


def _pyins_setup(w):
    """Inputs of pyins' filters: initial state, its four standard deviations, increments and the
    keyword arguments."""
    import pandas as pd
    from pyins import inertial_sensor, measurements, strapdown, util

    p = w.parameters
    degrees = np.array([1 / DEG, 1 / DEG, 1.0])
    start = pd.Series(
        np.r_[w.start[0] * degrees, w.start[1], w.start[2] / DEG],
        index=util.LLA_COLS + util.VEL_COLS + util.RPH_COLS,
        name=w.t[0],
    )
    imu = pd.DataFrame(np.c_[w.dtheta, w.dv], index=w.t, columns=util.GYRO_COLS + util.ACCEL_COLS)
    models = {
        f"{sensor}_model": inertial_sensor.EstimationModel(
            p[sensor + "_bias_std"], p[sensor + "_noise"], p[sensor + "_bias_walk"]
        )
        for sensor in ("gyro", "accel")
    }
    fixes = pd.DataFrame(w.fix * degrees, index=w.fix_t, columns=util.LLA_COLS)
    models["measurements"] = [measurements.Position(fixes, p["gnss_std"])]
    return (
        start,
        [p[key] for key in ("pos_std", "vel_std", "level_std", "azimuth_std")],
        strapdown.compute_increments_from_imu(imu, "increment"),
        models,
    )


def _pyins_result(w, seconds, result):
    from pyins import transform, util

    trajectory, t = result.trajectory, result.trajectory.index.to_numpy(float)
    # it says them at 10 Hz
    std = [
        np.interp(t, result.trajectory_sd.index, result.trajectory_sd[name])
        for name in util.NED_COLS
    ]

    lla = trajectory[util.LLA_COLS].to_numpy() * [DEG, DEG, 1.0]
    C = transform.mat_from_rph(trajectory[util.RPH_COLS].to_numpy())
    v = trajectory[util.VEL_COLS].to_numpy()
    return judged(w, seconds, t, lla, v, C, np.column_stack(std))


def pyins_feedback(workload, seconds=60.0):
    """pyins' closed loop (covariance at 10 Hz or at every fix)."""
    from pyins import filters

    w = workload.first(seconds)
    start, std, increments, models = _pyins_setup(w)
    begin = time.process_time()
    result = filters.run_feedback_filter(start, *std, increments, **models)
    return _pyins_result(w, time.process_time() - begin, result)


def pyins_feedforward(workload, seconds=60.0):
    """pyins' open loop: integration of the increments, then the filter beside it."""
    from pyins import filters, strapdown

    w = workload.first(seconds)
    start, std, increments, models = _pyins_setup(w)
    begin = time.process_time()
    nominal = strapdown.Integrator(start).integrate(increments)
    result = filters.run_feedforward_filter(nominal, nominal, *std, **models)
    return _pyins_result(w, time.process_time() - begin, result)


def _radii(lat, alt):
    """Metres per radian of latitude and of longitude at `alt`."""
    x = 1 - 6.6943799901413e-3 * math.sin(lat) ** 2
    normal = 6378137.0 / math.sqrt(x)
    return normal * (1 - 6.6943799901413e-3) / x + alt, (normal + alt) * math.cos(lat)


def smsfusion_aided(workload, seconds=1800.0):
    """smsfusion's AidedINS in a plane tangent at the start; its Gauss-Markov bias with a long
    time constant stands for the random walk."""
    import smsfusion
    from scipy.spatial.transform import Rotation

    w = workload.first(seconds)
    p, origin, long = w.parameters, w.start[0], 1e5
    scale = np.array([*_radii(origin[0], origin[2]), -1.0])
    errors = [
        {"N": p[s + "_noise"], "B": p[s + "_bias_walk"] * math.sqrt(long / 2), "tau_cb": long}
        for s in ("accel", "gyro")
    ]
    x = np.r_[
        np.zeros(3),
        w.start[1],
        Rotation.from_euler("xyz", w.start[2]).as_quat()[[3, 0, 1, 2]],
        np.zeros(6),
    ]
    ins = smsfusion.AidedINS(
        1 / w.dt,
        x,
        np.diag(w.std**2),
        *errors,
        g=smsfusion.gravity(origin[0] / DEG),
        ignore_bias_acc=False,
        cold_start=False,
    )
    f, omega, fixes, variance = (
        w.dv / w.dt,
        w.dtheta / w.dt,
        (w.fix - origin) * scale,
        np.full(3, p["gnss_std"] ** 2),
    )
    fix_of = dict(zip(np.rint((w.fix_t - w.t[0]) / w.dt).astype(int), fixes))
    states, std = np.empty((len(w.t) - 1, 16)), np.empty((len(w.t) - 1, 3))
    begin = time.process_time()
    # sample k + 1 leads from t[k] to t[k+1]; the fix of t[k] comes first
    for k in range(len(states)):
        fix = fix_of.get(k)
        ins.update(f[k + 1], omega[k + 1], pos=fix, pos_var=None if fix is None else variance)
        states[k], std[k] = ins.x, np.sqrt(ins.P.diagonal()[:3])
    took = time.process_time() - begin
    C = Rotation.from_quat(states[:, [7, 8, 9, 6]]).as_matrix()
    return judged(w, took, w.t[:-1], origin + states[:, :3] / scale, states[:, 3:6], C, std)


def _rotation(r):
    """exp([r x]), rad."""
    x, y, z = r
    s = x * x + y * y + z * z
    angle = math.sqrt(s)
    a, b = (
        (1 - s / 6, 0.5 - s / 24)
        if s < 1e-8
        else (math.sin(angle) / angle, (1 - math.cos(angle)) / s)
    )
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )


def _small_rotation(R):
    """Rotation vector of a matrix close to the identity, rad: good to the third order."""
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2


def _cross(a, b):
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _mechanise(lla, v, C, dtheta, dv, dt):
    """One step of WGS-84 mechanisation in NED: (lla, v, C)."""
    sine, (north, east) = math.sin(lla[0]), _radii(lla[0], lla[2])
    cosine = math.cos(lla[0])
    earth = np.array([7.292115e-5 * cosine, 0.0, -7.292115e-5 * sine])
    transport = np.array([v[1] * cosine / east, -v[0] / north, -v[1] * sine / east])
    g = (
        9.7803253359
        * (1 + 0.00193185265241 * sine**2)
        / math.sqrt(1 - 6.6943799901413e-3 * sine**2)
        * (1 - 2 * lla[2] / 6378137.0)
    )
    f = C @ (dv + _cross(dtheta, dv) / 2)
    after = v + f - _cross(earth + transport, f) * dt / 2 - _cross(2 * earth + transport, v) * dt
    after[2] += g * dt
    mean = (v + after) / 2 * dt
    return (
        lla + mean / np.array([north, east, -1.0]),
        after,
        _rotation(-(earth + transport) * dt) @ C @ _rotation(dtheta),
    )


class _Unscented:
    """filterpy's UKF on 15 states: metres from `origin`, velocity, rotation from `C`, biases.
    `C` moves so that the rotation stays small."""

    def __init__(self, w):
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        p, self.dt, self.origin = w.parameters, w.dt, w.start[0]
        self.scale = np.array([*_radii(w.start[0][0], w.start[0][2]), -1.0])
        self.C = (
            _rotation([0, 0, w.start[2][2]])
            @ _rotation([0, w.start[2][1], 0])
            @ _rotation([w.start[2][0], 0, 0])
        )
        points = MerweScaledSigmaPoints(15, alpha=1.0, beta=0.0, kappa=0.0)
        self.filter = UnscentedKalmanFilter(15, 3, w.dt, lambda x: x[:3], self.move, points)
        self.filter.x = np.r_[np.zeros(3), w.start[1], np.zeros(9)]
        self.filter.P, self.filter.R = np.diag(w.std**2), np.eye(3) * p["gnss_std"] ** 2
        self.filter.Q = np.diag(
            np.repeat(
                [0, p["accel_noise"], p["gyro_noise"], p["accel_bias_walk"], p["gyro_bias_walk"]], 3
            )
            ** 2
            * w.dt
        )

    def after(self, x, C, dtheta, dv):
        lla, v, C = _mechanise(
            self.origin + x[:3] / self.scale,
            x[3:6],
            C,
            dtheta - x[12:] * self.dt,
            dv - x[9:12] * self.dt,
            self.dt,
        )
        return (lla - self.origin) * self.scale, v, C

    def move(self, x, dt, dtheta, dv, new):
        """Sigma point after a sample; its rotation is from `new`, the attitude of the mean."""
        r, v, C = self.after(x, _rotation(x[6:9]) @ self.C, dtheta, dv)
        return np.r_[r, v, _small_rotation(C @ new.T), x[9:]]

    def step(self, dtheta, dv, fix):
        new = self.after(self.filter.x, self.C, dtheta, dv)[2]
        self.filter.predict(dtheta=dtheta, dv=dv, new=new)
        if fix is not None:
            self.filter.update((fix - self.origin) * self.scale)
        self.C = _rotation(self.filter.x[6:9]) @ new
        self.filter.x[6:9] = 0.0
        std = np.sqrt(self.filter.P.diagonal()[:3])
        return self.origin + self.filter.x[:3] / self.scale, self.filter.x[3:6], self.C, std


def filterpy_ukf(workload, seconds=5.0):
    """filterpy's UnscentedKalmanFilter with 15 states and 31 sigma points."""
    w = workload.first(seconds)
    ukf, n = _Unscented(w), len(w.t) - 1
    fix_of = dict(zip(np.rint((w.fix_t - w.t[0]) / w.dt).astype(int), w.fix))
    lla, v, C, std = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
    begin = time.process_time()
    for k in range(n):
        lla[k], v[k], C[k], std[k] = ukf.step(w.dtheta[k + 1], w.dv[k + 1], fix_of.get(k + 1))
    return judged(w, time.process_time() - begin, w.t[1:], lla, v, C, std)


RUNS = (
    ("python-ins feedback", pyins_feedback, "python-ins", {"A": 30.0, "B": 10.0}),
    ("python-ins feedforward", pyins_feedforward, "python-ins", {"N": 60.0}),
    ("smsfusion AidedINS", smsfusion_aided, "smsfusion", {"A": 1800.0, "B": 1800.0}),
    ("filterpy UKF", filterpy_ukf, "filterpy", {"A": 5.0, "B": 25.0}),
)
"""(name, function, package, seconds of each workload that are enough to time it)."""
