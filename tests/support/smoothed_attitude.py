"""Smoothers to compare with, over attitude and gyro bias, in dense numpy: textbook
Rauch-Tung-Striebel, and least squares of a whole log at once.

Both take what the filter takes of each sample, with its white-noise model: the specific force at
its end as vertical, the direction of the field. Rotations are scipy's; x = (attitude error in n,
gyro bias), true = estimate (+) error.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

G = 9.7803253359
RATE = 7.292115e-5


class Log(NamedTuple):
    """What a smoother is given."""

    start: object
    noise: object
    dt: float
    r: np.ndarray  # (n, 3) rotation vectors of the samples, with the gyro bias, rad
    f: np.ndarray  # (n, 3) mean specific force of the samples, body, m/s^2
    at: np.ndarray  # (m,) samples at whose end there is a field
    field: np.ndarray  # (m, 3) body, T
    declination: float
    field_std: float  # T

    @property
    def earth(self):
        """Rotation of n over a sample, rad."""
        lat = self.start.lla[0]
        return RATE * self.dt * np.array([np.cos(lat), 0.0, -np.sin(lat)])

    @property
    def keep(self):
        return np.exp(-self.noise.gyro_decay * self.dt)

    @property
    def P0(self):
        return np.diag(np.r_[self.start.std[6:9], self.start.std[12:15]]) ** 2

    @property
    def Q(self):
        return np.diag(
            np.r_[[self.noise.gyro**2 * self.dt] * 3, [self.noise.gyro_bias**2 * self.dt] * 3]
        )

    @property
    def level_variance(self):
        return self.noise.accel**2 / (G**2 * self.dt)

    def first(self):
        """(attitude, gyro bias) at the start."""
        return Rotation.from_euler("ZYX", self.start.rph[::-1]), np.array(self.start.b_g)


def log_of(recording, start, noise):
    """The Log of an evenly sampled recording, whose last aiding is a magnetic field at ends of
    samples."""
    imu, field = recording.imu, recording.sources[-1]
    before = np.vstack([np.zeros(6), np.hstack([imu.dtheta, imu.dv])[:-1]])
    a, b = before[:, :3], before[:, 3:]
    r = imu.dtheta + np.cross(a, imu.dtheta) / 12
    dv = imu.dv + (np.cross(a, imu.dv) + np.cross(b, imu.dtheta)) / 12
    at = np.searchsorted(imu.t, field.t - 1e-6)
    return Log(
        start,
        noise,
        imu.dt[0],
        r,
        dv / imu.dt[:, None],
        at,
        field.y,
        np.arctan2(field.parameters[1], field.parameters[0]),
        field.std[0, 0],
    )


def tilt(C, f, turned):
    """(..., 2): the rotation about north and east that takes to straight up the force at the end
    of a sample, whose mean over it is f."""
    # a vector at rest in n
    n = C.apply(f - np.cross(turned, f) / 2 + np.cross(turned, np.cross(turned, f)) / 12)
    angle = np.arctan2(np.hypot(n[..., 0], n[..., 1]), -n[..., 2]) / np.hypot(n[..., 0], n[..., 1])
    return np.stack([-n[..., 1] * angle, n[..., 0] * angle], axis=-1)


def azimuth(C, field, declination):
    """(...): declination less the azimuth of the field, and what to divide its deviation by: its
    horizontal strength."""
    n = C.apply(np.array(field))
    off = declination - np.arctan2(n[..., 1], n[..., 0])
    return (off + np.pi) % (2 * np.pi) - np.pi, np.hypot(n[..., 0], n[..., 1])


def _update(C, b, P, e, H, R):
    """A correction, in Joseph's form."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    x, I = K @ e, np.eye(6) - K @ H
    return Rotation.from_rotvec(x[:3]) * C, b + x[3:], I @ P @ I.T + K @ R @ K.T


def rauch_tung_striebel(log):
    """(attitudes, gyro biases (n, 3), covariances (n, 6, 6)) at the ends of the samples."""
    C, b = log.first()
    P, steps, has = log.P0, [], dict(zip(log.at, log.field))
    for k, (r, f) in enumerate(zip(log.r, log.f)):
        turned = r - b * log.dt
        middle = C * Rotation.from_rotvec(0.5 * turned)
        Phi = np.block(
            [
                [Rotation.from_rotvec(-log.earth).as_matrix(), -middle.as_matrix() * log.dt],
                [np.zeros((3, 3)), log.keep * np.eye(3)],
            ]
        )
        C, b, P = (
            Rotation.from_rotvec(-log.earth) * C * Rotation.from_rotvec(turned),
            log.keep * b,
            Phi @ P @ Phi.T + log.Q,
        )
        predicted = C, b, P
        C, b, P = _update(
            C, b, P, tilt(C, f, turned), np.eye(6)[:2], log.level_variance * np.eye(2)
        )
        if k in has:
            n = C.apply(np.array(has[k]))
            square = n[0] ** 2 + n[1] ** 2
            H = np.array([[-n[0] * n[2] / square, -n[1] * n[2] / square, 1, 0, 0, 0]])
            off, _ = azimuth(C, has[k], log.declination)
            C, b, P = _update(C, b, P, np.array([off]), H, np.array([[log.field_std**2 / square]]))
        steps.append((Phi, predicted, (C, b, P)))
    smoothed = [steps[-1][2]]
    for (_, _, (C, b, P)), (Phi, (Cp, bp, Pp), _) in zip(steps[-2::-1], steps[:0:-1]):
        Cs, bs, Ps = smoothed[-1]
        gain = P @ Phi.T @ np.linalg.inv(Pp)
        x = gain @ np.r_[(Cs * Cp.inv()).as_rotvec(), bs - bp]
        smoothed.append((Rotation.from_rotvec(x[:3]) * C, b + x[3:], P + gain @ (Ps - Pp) @ gain.T))
    Cs, bs, Ps = zip(*smoothed[::-1])
    return Rotation.concatenate(Cs), np.array(bs), np.array(Ps)


def _residuals(log, C, b, strength):
    """Prior (6), process (n, 6), verticals (n, 2) and fields (m), each over its standard
    deviation, in one row; C, b at the start and the n ends."""
    C0, b0 = log.first()
    prior = np.r_[(C[0] * C0.inv()).as_rotvec(), b[0] - b0] / np.sqrt(np.diag(log.P0))
    turned = log.r - b[:-1] * log.dt
    there = Rotation.from_rotvec(-log.earth) * C[:-1] * Rotation.from_rotvec(turned)
    process = np.hstack([(C[1:] * there.inv()).as_rotvec(), b[1:] - log.keep * b[:-1]]) / np.sqrt(
        np.diag(log.Q)
    )
    vertical = tilt(C[1:], log.f, turned) / np.sqrt(log.level_variance)
    field = azimuth(C[log.at + 1], log.field, log.declination)[0] * strength / log.field_std
    return np.concatenate([prior, process.ravel(), vertical.ravel(), field])


def least_squares(log, C, b, iterations=3):
    """As `rauch_tung_striebel`, by Gauss and Newton over all states at once from (n + 1)
    attitudes C and biases b; and how far the last step went."""
    n, step = len(log.r), 1e-6
    strength = azimuth(C[log.at + 1], log.field, log.declination)[1]
    # a residual's, with the states
    sample = np.concatenate(
        [np.zeros(6, int), np.repeat(np.arange(n), 6), np.repeat(np.arange(n), 2), log.at]
    )
    for _ in range(iterations):  # before and after it
        J = np.zeros((len(sample), n + 1, 6))
        for parity in (
            0,
            1,
            # neighbours are never moved at once, so that it is known which of the two a residual
            # answers to
        ):
            owner = sample + (sample % 2 != parity)
            for i in range(6):
                x = np.zeros((n + 1, 6))
                x[parity::2, i] = step
                up, down = (
                    _residuals(
                        log, Rotation.from_rotvec(s * x[:, :3]) * C, b + s * x[:, 3:], strength
                    )
                    for s in (1, -1)
                )
                J[np.arange(len(sample)), owner, i] = (up - down) / (2 * step)
        J = J.reshape(len(sample), -1)
        factor = cho_factor(J.T @ J)
        x = -cho_solve(factor, J.T @ _residuals(log, C, b, strength)).reshape(n + 1, 6)
        C, b = Rotation.from_rotvec(x[:, :3]) * C, b + x[:, 3:]
    P = cho_solve(factor, np.eye(len(J.T))).reshape(n + 1, 6, n + 1, 6)
    return C[1:], b[1:], np.stack([P[k, :, k] for k in range(1, n + 1)]), np.abs(x).max()
