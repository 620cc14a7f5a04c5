"""Smoothers to compare with over all fifteen states, in dense numpy: textbook Rauch-Tung-Striebel,
and least squares of a whole log at once.

Both rest on the continuous INS equations of tests/support/ins_equations.py, integrated over each
sample with its mean rate and specific force, and on numeric derivatives of that: nothing of the
library's error dynamics is in them. x = (position m NED, velocity, attitude in n, biases), true =
estimate (+) error.
"""

from typing import NamedTuple

import numpy as np
from ins_equations import RATE, gravity, radii
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.spatial.transform import Rotation

N = 15


class State(NamedTuple):
    """Of n times, or of n neighbours of one."""

    lla: np.ndarray  # (n, 3)
    v: np.ndarray  # (n, 3)
    C: np.ndarray  # (n, 3, 3)
    b: np.ndarray  # (n, 6) accelerometer and gyro bias; and, where there is a barometer, its (n, 7)

    def moved(self, x):
        """This state (+) errors (n, 15)."""
        scale = metres(self.lla)
        return State(
            self.lla + x[:, 0:3] / scale,
            self.v + x[:, 3:6],
            Rotation.from_rotvec(x[:, 6:9]).as_matrix() @ self.C,
            self.b + x[:, 9:],
        )

    def less(self, other):
        """(n, 15): the errors that take `other` to this state."""
        turned = Rotation.from_matrix(self.C @ np.swapaxes(other.C, -1, -2)).as_rotvec()
        return np.hstack(
            [(self.lla - other.lla) * metres(other.lla), self.v - other.v, turned, self.b - other.b]
        )

    def rows(self, rows):
        return State(*(part[rows] for part in self))


def metres(lla):
    """(n, 3): metres north, east and down per unit of a position."""
    M, R = radii(lla[:, 0])
    return np.stack(
        [M + lla[:, 2], (R + lla[:, 2]) * np.cos(lla[:, 0]), -np.ones(len(lla))], axis=1
    )


class Log(NamedTuple):
    """What a smoother is given."""

    start: object
    noise: object
    dt: float
    # (n, 6) rotation vectors and velocity increments of the samples, coning and sculling taken out
    u: np.ndarray
    at: np.ndarray  # (m,) samples at whose end there is a position fix
    y: np.ndarray  # (m, 3) rad, rad, m
    std: float  # m
    arm: np.ndarray  # to the antenna, m
    baro: object = (
        None  # Source of heights with a bias, at ends of samples; its bias is another state
    )
    baro_std: float = 0.0  # of that bias at the start, m
    baro_walk: float = 0.0  # m/sqrt(s)

    def first(self):
        """The State at the start, of one time."""
        s = self.start
        return State(
            np.array([s.lla]),
            np.array([s.v_n]),
            Rotation.from_euler("ZYX", [s.rph[::-1]]).as_matrix(),
            np.array([[*s.b_a, *s.b_g, *[0.0] * self.augmented]]),
        )

    @property
    def augmented(self):
        return int(self.baro is not None)

    @property
    def baro_at(self):
        """{sample: row of the barometer}."""
        return {round((t - self.start.t) / self.dt) - 1: row for row, t in enumerate(self.baro.t)}

    @property
    def P0(self):
        return np.diag([*self.start.std, *[self.baro_std] * self.augmented]) ** 2

    @property
    def density(self):
        """Of the process noise, per second."""
        n = self.noise
        return np.repeat([0.0, n.accel**2, n.gyro**2, n.accel_bias**2, n.gyro_bias**2], 3)

    @property
    def keep(self):
        return np.exp(
            -self.dt
            * np.r_[
                np.repeat([self.noise.accel_decay, self.noise.gyro_decay], 3),
                [0.0] * self.augmented,
            ]
        )


def log_of(recording, start, noise):
    """The Log of an evenly sampled recording whose only aiding is a position at ends of samples."""
    imu, fix = recording.imu, recording.sources[0]
    u = np.hstack([imu.dtheta, imu.dv])
    before = np.vstack([np.zeros(6), u[:-1]])
    cross = lambda i, j: np.cross(before[:, i : i + 3], u[:, j : j + 3]) / 12
    u = u + np.hstack([cross(0, 0), cross(0, 3) + cross(3, 0)])
    return Log(
        start,
        noise,
        float(imu.dt[0]),
        u,
        np.searchsorted(imu.t, fix.t - 1e-6),
        fix.y,
        fix.std[0, 0],
        np.array(fix.parameters),
    )


def skew(a):
    out = np.zeros((*a.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i, j], out[..., j, i] = -a[..., k], a[..., k]
    return out


def derivative(lla, v, C, omega, f):
    """Time derivatives of position, velocity and attitude, as in ins_equations, for many at
    once."""
    M, R = (r + lla[:, 2] for r in radii(lla[:, 0]))
    zero = 0 * M
    ie = RATE * np.stack([np.cos(lla[:, 0]), zero, -np.sin(lla[:, 0])], axis=1)
    en = np.stack([v[:, 1] / R, -v[:, 0] / M, -v[:, 1] * np.tan(lla[:, 0]) / R], axis=1)
    lla_rate = np.stack([v[:, 0] / M, v[:, 1] / (R * np.cos(lla[:, 0])), -v[:, 2]], axis=1)
    down = np.stack([zero, zero, gravity(lla[:, 0], lla[:, 2])], axis=1)
    v_rate = (C @ f[:, :, None])[:, :, 0] + down - np.cross(2 * ie + en, v)
    return lla_rate, v_rate, C @ skew(omega) - skew(ie + en) @ C


def propagated(log, state, u):
    """The State a sample later, by Runge and Kutta; u (n, 6) or (6,)."""
    f, omega = u[..., 3:] / log.dt - state.b[:, :3], u[..., :3] / log.dt - state.b[:, 3:6]
    now, h = state[:3], log.dt / 2
    for _ in range(2):
        rates = []
        for share in (0, 0.5, 0.5, 1):
            there = (
                [part + share * h * rate for part, rate in zip(now, rates[-1])] if rates else now
            )
            rates.append(derivative(*there, omega, f))
        now = [part + h / 6 * (a + 2 * b + 2 * c + d) for part, a, b, c, d in zip(now, *rates)]
    return State(*now, log.keep * state.b)


STEP = np.repeat([1e-2, 1e-3, 1e-5, 1e-3, 1e-5], 3)


def misfit(log, state, y):
    """(n, 3): the fix less the antenna, m."""
    return (y - state.lla) * metres(state.lla) - state.C @ log.arm


def noise_of(log, Phi):
    """Covariance of the process over a sample by the trapezoidal rule."""
    Q = np.diag(log.density * log.dt / 2)
    return Phi @ Q @ np.swapaxes(Phi, -1, -2) + Q


def _corrected(state, P, H, e, R):
    """A correction, in Joseph's form, and A, which turns the attitude error by half of it: from one
    about the state before to one about the state after."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    I, A, x = np.eye(len(P)) - K @ H, np.eye(len(P)), K @ e
    A[6:9, 6:9] = Rotation.from_rotvec(x[6:9] / 2).as_matrix()
    return state.moved(x[None]), A @ (I @ P @ I.T + K @ R @ K.T) @ A.T, A


def _at(log, k, state, P):
    """State and P after the fixes at the end of sample k, and A of all of them."""
    turned = np.eye(len(P))
    for row in np.flatnonzero(log.at == k):
        H = np.hstack(
            [np.eye(3), np.zeros((3, 3)), -skew((state.C @ log.arm)[0]), np.zeros((3, len(P) - 9))]
        )
        state, P, A = _corrected(
            state, P, H, misfit(log, state, log.y[row : row + 1])[0], log.std**2 * np.eye(3)
        )
        turned = A @ turned
    if log.baro is not None and k in log.baro_at:
        row = log.baro_at[k]
        H = np.zeros((1, N + 1))
        H[0, 2], H[0, N] = 1.0, -1.0
        state, P, A = _corrected(
            state,
            P,
            H,
            state.lla[0, 2:] + state.b[0, 6] - log.baro.y[row],
            np.array([[log.baro.std[row, 0] ** 2]]),
        )
        turned = A @ turned
    return state, P, turned


def rauch_tung_striebel(log):
    """(States, covariances (n, 15 or 16, ...)) at the ends of the samples: extended Kalman
    filter, then backwards."""
    state, P, steps, n, walked = log.first(), log.P0, [], N + log.augmented, 0
    around = np.zeros((1 + 2 * N, n))
    around[1 : N + 1, :N], around[N + 1 :, :N] = np.diag(STEP), -np.diag(STEP)
    many = [0] * len(around)
    for k, u in enumerate(log.u):
        neighbours = propagated(log, state.rows(many).moved(around), u)
        held = log.noise.held * (1 - log.keep) * state.b
        state = neighbours.rows([0])
        state = state._replace(b=state.b + held)
        x, Phi, Q = neighbours.less(state.rows(many)), np.eye(n), np.zeros((n, n))
        Phi[:, :N] = ((x[1 : N + 1] - x[N + 1 :]) / (2 * STEP[:, None])).T
        Q[:N, :N] = noise_of(log, Phi[:N, :N])
        if log.baro is not None and k in log.baro_at:  # its bias need not walk before it is seen
            Q[N, N], walked = log.baro_walk**2 * (k + 1 - walked) * log.dt, k + 1
        P = Phi @ P @ Phi.T + Q
        before = state, P
        state, P, turned = _at(log, k, state, P)
        steps.append((Phi, before, (state, P), turned))
    found = [steps[-1][2]]
    for (_, _, (state, P), _), (Phi, (ahead, P_ahead), _, turned) in zip(
        steps[-2::-1], steps[:0:-1]
    ):
        later, P_later = found[-1]
        P_later = turned.T @ P_later @ turned  # of errors about the state before the fixes
        gain = np.linalg.solve(P_ahead, Phi @ P).T
        found.append(
            (
                state.moved((gain @ later.less(ahead)[0])[None]),
                P + gain @ (P_later - P_ahead) @ gain.T,
            )
        )
    states, P = zip(*found[::-1])
    return State(*(np.concatenate(part) for part in zip(*states))), np.array(P)


def least_squares(log, state, rows, iterations=4):
    """(States at the n ends, covariances at `rows`, size of the last step in prior std) by Gauss and
    Newton over all n + 1 times at once.

    `state` (n + 1) is where it begins. Unknowns are in units of `scale`, and the normal equations
    banded.
    """
    n, scale = len(log.u), np.array(log.start.std)
    for _ in range(iterations):
        there = propagated(log, state.rows(slice(0, n)), log.u)
        # of the prediction by the state before; by the one after it is I, nearly
        ahead, J = (
            state.rows(slice(1, n + 1)),
            np.zeros((n, N, N)),
        )
        E = np.zeros((n, N, N))
        for i in range(N):
            x = np.zeros((n, N))
            x[:, i] = STEP[i]
            behind = [
                ahead.less(propagated(log, state.rows(slice(0, n)).moved(s * x), log.u))
                for s in (1, -1)
            ]
            J[:, :, i] = (behind[0] - behind[1]) / (2 * STEP[i])
            E[:, :, i] = (ahead.moved(x).less(there) - ahead.moved(-x).less(there)) / (2 * STEP[i])
        inverse = np.linalg.inv(noise_of(log, -J))
        r = ahead.less(there)
        # diagonal blocks, blocks below
        normal, right = (
            np.zeros((n + 1, 2, N, N)),
            np.zeros((n + 1, N)),
        )
        normal[0, 0] += np.diag(1 / scale**2)
        right[0] -= state.rows([0]).less(log.first())[0] / scale**2
        JT, ET = np.swapaxes(J, 1, 2), np.swapaxes(E, 1, 2)
        normal[:n, 0] += JT @ inverse @ J
        normal[1:, 0] += ET @ inverse @ E
        normal[:n, 1] += ET @ inverse @ J
        right[:n] -= (JT @ inverse @ r[:, :, None])[:, :, 0]
        right[1:] -= (ET @ inverse @ r[:, :, None])[:, :, 0]
        seen = log.at + 1
        antenna, e = state.rows(seen), misfit(log, state.rows(seen), log.y)
        for k, C in zip(seen, antenna.C):
            H = np.hstack([np.eye(3), np.zeros((3, 3)), -skew(C @ log.arm), np.zeros((3, 6))])
            normal[k, 0] += H.T @ H / log.std**2
            right[k] += H.T @ e[np.flatnonzero(seen == k)[0]] / log.std**2
        factor = cholesky_banded(_banded(normal * np.outer(scale, scale)), lower=True)
        x = cho_solve_banded((factor, True), (right * scale).ravel()).reshape(n + 1, N)
        state = state.moved(x * scale)
    P = np.empty((len(rows), N, N))
    for number, row in enumerate(rows):
        units = np.zeros(((n + 1) * N, N))
        units[(row + 1) * N : (row + 2) * N] = np.eye(N)
        P[number] = cho_solve_banded((factor, True), units)[
            (row + 1) * N : (row + 2) * N
        ] * np.outer(scale, scale)
    return state.rows(slice(1, n + 1)), P, np.abs(x).max()


def _banded(normal):
    """The lower band of a matrix of blocks on and below the diagonal."""
    count = len(normal)
    band = np.zeros((2 * N, count * N))
    for k in range(count):
        for i in range(N):
            for j in range(N):
                if i >= j:
                    band[i - j, k * N + j] = normal[k, 0, i, j]
                if k + 1 < count:
                    band[N + i - j, k * N + j] = normal[k, 1, i, j]
    return band
