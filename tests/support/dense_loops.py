"""Parts of the loops of Hager & Bryne with dense matrices: an INS, Phi and Q_d by Van Loan, gain and
covariance of a position."""

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import dynamics
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.geometry.geodesy import displace_lla

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)


class State:
    """Position, velocity, attitude: an INS, or a belief."""

    def __init__(self, lla, v, C):
        self.lla, self.v, self.C = np.array(lla, float), np.array(v, float), np.array(C, float)

    def plus(self, error):
        """This state (+) an error of nine numbers: equations (21)-(23)."""
        return State(
            displace_lla(self.lla, error[:3]),
            self.v + error[3:6],
            Rotation.from_rotvec(error[6:9]).as_matrix() @ self.C,
        )

    def step(self, rotation, force, dt):
        mechanize(self.lla, self.v, self.C, rotation, force, dt, np.zeros(3))


def increments(imu):
    """Rotation and velocity increments of each sample, compensated for coning and sculling."""
    before = None
    for dt, rotation, force in zip(imu.dt, imu.dtheta, imu.dv):
        r, a = rotation.copy(), force.copy()
        if before is not None:
            r += np.cross(before[0], rotation) / 12
            a += (np.cross(before[0], force) + np.cross(before[1], rotation)) / 12
        before = rotation, force
        yield r, a, dt


def transition(belief, b, rotation, force, dt):
    """Phi and Q_d at a belief with bias-corrected increments (Van Loan)."""
    middle = belief.C @ Rotation.from_rotvec((rotation - b[3:] * dt) / 2).as_matrix()
    F, Q = dynamics(belief.lla, belief.v, middle, middle @ (force / dt - b[:3]), NOISE)
    van_loan = expm(np.block([[-F, Q], [np.zeros((15, 15)), F.T]]) * dt)
    Phi = van_loan[15:, 15:].T
    return Phi, Phi @ van_loan[:15, 15:]


def gain(P, std):
    """K and the covariance after it, in Joseph's form, of a position without lever arm."""
    H, R = np.eye(3, 15), np.diag(std**2)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    keep = np.eye(15) - K @ H
    return K, keep @ P @ keep.T + K @ R @ K.T


def after(P, dx):
    """P of the errors that are left when dx was injected."""
    turn = np.eye(15)
    turn[6:9, 6:9] = Rotation.from_rotvec(dx[6:9] / 2).as_matrix()
    return turn @ P @ turn.T


def fix_at(recording, t):
    source = recording.sources[0]
    return next(iter(np.flatnonzero(np.abs(source.t - t) < 1e-6)), None)
