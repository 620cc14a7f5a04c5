"""The exogenous Kalman filter of fifteen errors once more, in plain numpy beside a given observer: the
affine filter of Johansen & Fossen (2017), and the filter whose Jacobians alone are the observer's, as
Alam et al. print it. Nothing of it is the library's. Equations of docs/explanation/exogenous.md.
"""

from typing import NamedTuple

import numpy as np
from plain_ins import cross, displaced, mechanized, transition, turn, way_between
from scipy.spatial.transform import Rotation


class Motion(NamedTuple):
    """Position, velocity, attitude and biases."""

    lla: np.ndarray
    v: np.ndarray
    C: np.ndarray
    b_a: np.ndarray
    b_g: np.ndarray

    def plus(self, x):
        C = turn(x[6:9]) @ self.C
        return Motion(
            displaced(self.lla, x[:3]), self.v + x[3:6], C, self.b_a + x[9:12], self.b_g + x[12:]
        )

    def minus(self, other):
        turned = Rotation.from_matrix(self.C @ other.C.T).as_rotvec()
        way, biases = way_between(self.lla, other.lla), (self.b_a - other.b_a, self.b_g - other.b_g)
        return np.r_[way, self.v - other.v, turned, *biases]

    def ahead(self, u, dt, noise):
        """A sample later by the model itself."""
        r, a = u[:3] - self.b_g * dt, u[3:] - self.b_a * dt
        lla, v, C, _ = mechanized(self.lla, self.v, self.C, r, a, dt)
        keep_a, keep_g = np.exp(-noise.accel_decay * dt), np.exp(-noise.gyro_decay * dt)
        return Motion(lla, v, C, self.b_a * keep_a, self.b_g * keep_g)


class ExogenousTwin:
    """Estimate `at`, its errors x about the observer `bar`, and P; affine: the mean is propagated
    about the observer too."""

    def __init__(self, at, P, noise, affine):
        self.at = self.bar = at
        self.P, self.noise, self.affine, self.x = P.copy(), noise, affine, np.zeros(15)

    def predict(self, u, dt, bar):
        """Prediction; `bar` is the observer at the end of the sample."""
        noise, x = self.noise, self.bar
        r, a, decays = u[:3] - x.b_g * dt, u[3:] - x.b_a * dt, (noise.accel_decay, noise.gyro_decay)
        Phi, _ = transition(x.lla, x.v, x.C, r, a, dt, decays)
        density = (0.0, noise.accel, noise.gyro, noise.accel_bias, noise.gyro_bias)
        half = np.diag(np.repeat(np.square(density), 3)) * dt / 2
        self.P = Phi @ (self.P + half) @ Phi.T + half
        left, self.u = x.ahead(u, dt, noise), u[:3] / dt
        if self.affine:
            self.x = Phi @ self.x
            self.at = left.plus(self.x)
        else:
            self.at = self.at.ahead(u, dt, noise)
        self.bar = left
        self.jump(bar)

    def jump(self, bar):
        """The observer moves, the estimate stays."""
        errors = self.at.minus(bar)
        if self.affine:
            m = Rotation.from_matrix(self.bar.C @ bar.C.T).as_rotvec()
            errors[6:9] = self.x[6:9] + m + np.cross(self.x[6:9], m) / 2
        self.x, self.bar = errors, bar

    def correct(self, kind, y, std, arm):
        """Correction by a position or velocity of an antenna."""
        H, R = np.zeros((3, 15)), np.diag(np.square(std))
        expected = lambda at: (
            at.C @ arm if kind == "position" else at.C @ np.cross(self.u - at.b_g, arm)
        )
        H[:, 6:9] = -cross(expected(self.bar))
        if kind == "position":
            H[:, :3] = np.eye(3)
        else:
            H[:, 3:6], H[:, 12:] = np.eye(3), self.bar.C @ cross(arm)
        at = self.bar if self.affine else self.at
        e = (way_between(y, at.lla) if kind == "position" else y - at.v) - expected(at)
        e = e - H @ self.x * self.affine
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        keep = np.eye(15) - K @ H
        self.P, self.x = keep @ self.P @ keep.T + K @ R @ K.T, self.x + K @ e
        self.at = self.bar.plus(self.x)
