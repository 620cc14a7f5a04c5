"""A plain affine Kalman filter beside a given trajectory, with dense matrices: the oracle of the
exogenous Kalman filter."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown.core.loop.contract import Noise
from strapdown.core.mathematics.error_dynamics import (
    BLOCKS,
    cross_matrix,
    dynamics,
    kinematic_blocks,
)
from strapdown.core.mathematics.kalman import propagate_error
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.geometry.geodesy import radii

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
ARM = np.array([0.3, -0.2, -0.5])
FIX_STD = {"position": np.array([1.5, 1.5, 3.0]), "velocity": np.array([0.1, 0.1, 0.2])}


class State(NamedTuple):
    """Position, velocity, attitude and biases."""

    lla: np.ndarray
    v_n: np.ndarray
    C_nb: np.ndarray
    b_a: np.ndarray
    b_g: np.ndarray


def copied(state):
    return State(*(np.array(getattr(state, name), float) for name in State._fields))


def plus(state, x):
    """state (+) x, metres at the state."""
    M, N = np.add(radii(state.lla[0]), state.lla[2])
    return State(
        state.lla + [x[0] / M, x[1] / (N * np.cos(state.lla[0])), -x[2]],
        state.v_n + x[3:6],
        Rotation.from_rotvec(x[6:9]).as_matrix() @ state.C_nb,
        state.b_a + x[9:12],
        state.b_g + x[12:15],
    )


def minus(other, state):
    """other (-) state, so that plus(state, minus(other, state)) is other."""
    M, N = np.add(radii(state.lla[0]), state.lla[2])
    p = (other.lla - state.lla) * [M, N * np.cos(state.lla[0]), -1]
    return np.r_[
        p,
        other.v_n - state.v_n,
        Rotation.from_matrix(other.C_nb @ state.C_nb.T).as_rotvec(),
        other.b_a - state.b_a,
        other.b_g - state.b_g,
    ]


def moved(state, u, dt):
    """One mechanization of a state with its own biases, which decay as the model says."""
    lla, v, C = state.lla.copy(), state.v_n.copy(), state.C_nb.copy()
    mechanize(lla, v, C, u[:3] - state.b_g * dt, u[3:] - state.b_a * dt, dt, np.zeros(3))
    return State(
        lla,
        v,
        C,
        state.b_a * np.exp(-NOISE.accel_decay * dt),
        state.b_g * np.exp(-NOISE.gyro_decay * dt),
    )


def expected(kind, state, rate):
    """(what a fix at this state measures beyond the position of the IMU, H)."""
    H, swing = (
        np.zeros((3, 15)),
        state.C_nb @ (ARM if kind == "position" else np.cross(rate - state.b_g, ARM)),
    )
    H[:, 6:9] = -cross_matrix(swing)
    if kind == "position":
        H[:, :3] = np.eye(3)
        return swing, H
    H[:, 3:6], H[:, 12:15] = np.eye(3), state.C_nb @ cross_matrix(ARM)
    return state.v_n + swing, H


def turned(x, bar, after):
    """The attitude error x counted from `after` instead of `bar`: what is affine in it of
    log(exp(x) exp(m))."""
    m = Rotation.from_matrix(bar.C_nb @ after.C_nb.T).as_rotvec()
    return x + m + np.cross(x, m) / 2


class Dense:
    """The affine filter with dense matrices and the Joseph form, beside whatever trajectory it
    is given; without `mismatch` as if that were a solution of the model. Its transition is the
    library's column by column, or the matrix exponential (`exact`)."""

    def __init__(self, state, bar, P, mismatch=True, exact=False):
        self.x, self.P, self.mismatch, self.exact, self.rate = (
            minus(state, bar),
            P.copy(),
            mismatch,
            exact,
            np.zeros(3),
        )

    def predict(self, bar, after, u, dt):
        """While the trajectory goes from `bar` to `after`."""
        if self.exact:
            C = bar.C_nb @ Rotation.from_rotvec((u[:3] - bar.b_g * dt) / 2).as_matrix()
            F, density = dynamics(bar.lla, bar.v_n, C, C @ (u[3:] - bar.b_a * dt) / dt, NOISE)
            large = expm(np.block([[-F, density], [np.zeros((15, 15)), F.T]]) * dt)
            Phi = large[15:, 15:].T
            self.P = Phi @ self.P @ Phi.T + Phi @ large[:15, 15:]
        else:
            Phi = library_transition(bar, u, dt)
            half = (
                np.diag(
                    np.repeat(
                        np.square(
                            [0.0, NOISE.accel, NOISE.gyro, NOISE.accel_bias, NOISE.gyro_bias]
                        ),
                        3,
                    )
                )
                * dt
                / 2
            )
            self.P = Phi @ (self.P + half) @ Phi.T + half
        self.x, self.rate = Phi @ self.x, u[:3] / dt
        if self.mismatch:
            self.jump(moved(bar, u, dt), after)

    def correct(self, bar, kind, y):
        """Returns the NIS of a fix."""
        h, H = expected(kind, bar, self.rate)
        e = (minus(bar._replace(lla=y), bar)[:3] if kind == "position" else y) - h - H @ self.x
        S = H @ self.P @ H.T + np.diag(FIX_STD[kind] ** 2)
        K = self.P @ H.T @ np.linalg.inv(S)
        keep = np.eye(15) - K @ H
        self.x, self.P = (
            self.x + K @ e,
            keep @ self.P @ keep.T + K @ np.diag(FIX_STD[kind] ** 2) @ K.T,
        )
        return e @ np.linalg.solve(S, e)

    def jump(self, bar, after):
        """The trajectory jumps."""
        if self.mismatch:
            attitude = turned(self.x[6:9], bar, after)
            self.x = minus(plus(bar, self.x), after)
            self.x[6:9] = attitude


def library_transition(bar, u, dt):
    """Phi, from where the library's transition carries unit errors; tests of its own compare
    that with the matrix exponential."""
    blocks, columns = np.zeros(BLOCKS), np.eye(15)
    w = np.multiply(kinematic_blocks(bar.lla, bar.v_n, 0, blocks), dt)
    middle = bar.C_nb @ (np.eye(3) + cross_matrix((u[:3] - bar.b_g * dt) / 2))
    for column in columns:
        propagate_error(
            column, blocks, middle, middle @ (u[3:] - bar.b_a * dt), w, dt, NOISE, np.zeros(600)
        )
    return columns.T
