"""filterpy: its UnscentedKalmanFilter, which wants a model of the motion; here one in plain numpy."""

import math
import time

import numpy as np

from adapters import fixes_by_sample, judged
from adapters.local_frame import radii


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


def _rotation_vector(R):
    """Rotation vector of a matrix, rad, below pi."""
    sine = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    size = math.sqrt(sine @ sine)
    angle = math.atan2(size, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2)
    return sine if size < 1e-12 else sine * (angle / size)


def _cross(a, b):
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _mechanise(lla, v, C, dtheta, dv, dt):
    """One step of WGS-84 mechanisation in NED: (lla, v, C)."""
    sine, (north, east) = math.sin(lla[0]), radii(lla[0], lla[2])
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
        self.scale = np.array([*radii(w.start[0][0], w.start[0][2]), -1.0])
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
        return np.r_[r, v, _rotation_vector(C @ new.T), x[9:]]

    def step(self, dtheta, dv, fix):
        new = self.after(self.filter.x, self.C, dtheta, dv)[2]
        self.filter.predict(dtheta=dtheta, dv=dv, new=new)
        if fix is not None:
            self.filter.update((fix - self.origin) * self.scale)
        self.C = _rotation(self.filter.x[6:9]) @ new
        self.filter.x[6:9] = 0.0
        std = np.sqrt(self.filter.P.diagonal()[:9])
        return self.origin + self.filter.x[:3] / self.scale, self.filter.x[3:6], self.C, std


def ukf(workload, seconds=5.0):
    """filterpy's UnscentedKalmanFilter with 15 states and 31 sigma points."""
    w = workload.first(seconds)
    ukf, n = _Unscented(w), len(w.t) - 1
    fix_of = fixes_by_sample(w)
    lla, v, C, std = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 9))
    begin = time.process_time()
    for k in range(n):
        lla[k], v[k], C[k], std[k] = ukf.step(w.dtheta[k + 1], w.dv[k + 1], fix_of.get(k + 1))
    return judged(w, time.process_time() - begin, w.t[1:], lla, v, C, std)
