"""The two-stage Kalman filter once more, with dense matrices in its own coordinates: position,
velocity in the body, Euler angles, biases.

About the estimate itself (EKF) or about states that are given (affine filter). One function of
plain numpy for each equation of docs/explanation/two-stage.md.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.core.mathematics.earth import RATE, gravity
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.filters.attitude.attitude_error_state import carry
from strapdown.geometry.geodesy import displace_lla, displacement

CROSS = lambda a: np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
WRAP = lambda angle: (angle + np.pi) % (2 * np.pi) - np.pi
P, V, A, BA, BG = (slice(3 * i, 3 * i + 3) for i in range(5))


def matrix(angles):
    """C_nb of roll, pitch, heading (rad)."""
    return Rotation.from_euler("ZYX", np.asarray(angles)[::-1]).as_matrix()


def angles_of(C):
    return Rotation.from_matrix(C).as_euler("ZYX")[::-1]


def jacobian(angles):
    """J of theta_n = J d(roll, pitch, heading): the axes about which the three angles turn, in
    n."""
    _, pitch, heading = angles
    turn = Rotation.from_euler("Z", heading).as_matrix()
    return np.c_[turn @ [np.cos(pitch), 0, -np.sin(pitch)], turn @ [0, 1, 0], [0, 0, 1]]


def coordinates(angles):
    """d(library's errors) / d(own errors) at these Euler angles."""
    T = np.eye(15)
    T[V, V], T[A, A] = matrix(angles), jacobian(angles)
    return T


class State:
    """lla, v_b, Euler angles, biases."""

    def __init__(self, lla, v, angles, ba, bg, of_body=False):
        self.lla, self.angles, self.ba, self.bg = (
            np.array(part, float) for part in (lla, angles, ba, bg)
        )
        self.v = np.array(v, float) if of_body else matrix(angles).T @ v

    @property
    def C(self):
        return matrix(self.angles)

    def plus(self, x):
        return State(
            displace_lla(self.lla, x[P]),
            self.v + x[V],
            self.angles + x[A],
            self.ba + x[BA],
            self.bg + x[BG],
            True,
        )

    def minus(self, other):
        return np.r_[
            displacement(self.lla, other.lla),
            self.v - other.v,
            WRAP(self.angles - other.angles),
            self.ba - other.ba,
            self.bg - other.bg,
        ]


class Twin:
    """The filter, its options (rad, SI) and Noise; `bar` is None or the state to linearise at."""

    min_speed, max_bank, crab, correlation, window, acceleration = (
        3.0,
        np.radians(45),
        np.radians(5),
        10.0,
        1.0,
        0.2,
    )

    def __init__(self, start, noise, bar=None):
        self.at, self.bar, self.noise = (
            State(start.lla, start.v, start.rph, start.ba, start.bg),
            bar,
            noise,
        )
        T = coordinates(start.rph)
        self.P = np.linalg.inv(T) @ np.diag(np.square(start.sd)) @ np.linalg.inv(T).T
        self.force, self.centrifugal, self.seconds, self.then, self.since, self.moved = (
            np.zeros(3),
            np.zeros(3),
            0.0,
            None,
            3.0,
            np.zeros(3),
        )

    @property
    def about(self):
        return self.at if self.bar is None else self.bar

    def predict(self, u, dt, bar=None):
        """Prediction; `bar` is the given state at the end of the sample."""
        x, noise = self.about, self.noise
        r, a, C = u[:3] - x.bg * dt, u[3:] - x.ba * dt, self.about.C
        for mean, new in ((self.force, u[3:] - x.ba * dt), (self.centrifugal, np.cross(r, x.v))):
            carry(mean, np.r_[np.zeros(3), new], *r, dt, dt / (self.seconds + dt))
        self.seconds, self.since = self.seconds + dt, self.since + dt
        lla, v, turned, f = x.lla.copy(), C @ x.v, C.copy(), np.zeros(3)
        mechanize(lla, v, turned, r, a, dt, f, 1.0)
        moved = State(
            lla,
            v,
            angles_of(turned),
            x.ba * np.exp(-noise.accel_decay * dt),
            x.bg * np.exp(-noise.gyro_decay * dt),
        )
        middle = C @ (np.eye(3) + CROSS(r / 2))
        drift, driven, kept = np.eye(15), np.eye(15), np.eye(15)
        drift[P, V] = 0.5 * dt * np.eye(3)
        driven[V, BA] = driven[A, BG] = -middle * dt
        kept[BA, BA], kept[BG, BG] = (
            np.exp(-noise.accel_decay * dt) * np.eye(3),
            np.exp(-noise.gyro_decay * dt) * np.eye(3),
        )
        first, last = (
            kept @ driven @ drift @ coordinates(x.angles),
            np.linalg.inv(coordinates(moved.angles)) @ drift,
        )
        S = first @ self.P @ first.T
        S += (
            np.diag(
                np.repeat(
                    [0, noise.accel**2, noise.gyro**2, noise.accel_bias**2, noise.gyro_bias**2], 3
                )
            )
            * dt
        )
        # without velocities the given attitude is also wrong by what the estimate has more than it
        d = (coordinates(x.angles) @ self.at.minus(x))[A] * (self.since >= 3)
        tilt = S[A, A] + np.outer(d, d)
        S[V, V] += 2 * self.correlation / dt * CROSS(f) @ tilt @ CROSS(f).T
        self.P = last @ S @ last.T
        self.at = moved.plus(last @ first @ self.at.minus(x))
        if bar is not None:
            self.moved += (bar.C - moved.C) @ self.at.v
            self.bar = bar
        if self.since >= 3 and self.seconds >= self.window:
            swing = np.sum((u[:3] / dt - self.about.bg) ** 2) * np.trace(self.covariance()[V, V])
            self.inject(
                self._level(
                    self.about.C,
                    self.force - self.centrifugal,
                    (self.acceleration**2 + noise.accel**2) / self.seconds + swing,
                )
            )
            self.then, self.seconds = None, 0.0

    def update(self, y, H, R):
        """Kalman correction by an innovation y at `about`, in the coordinates of the library; an
        EKF injects at once."""
        x = self.about
        own = H @ coordinates(x.angles)
        e = y - own @ self.at.minus(x)
        S = own @ self.P @ own.T + R
        K = self.P @ own.T @ np.linalg.inv(S)
        keep = np.eye(15) - K @ own
        self.P = keep @ self.P @ keep.T + K @ R @ K.T
        return K @ e, e @ np.linalg.solve(S, e)

    def inject(self, x):
        """Own errors into the state; what the attitude turns the velocity by counts as its
        error."""
        before = self.at.C
        self.at = self.at.plus(x)
        if self.bar is None and x[A].any():
            turned = before.T @ ((self.at.C - before) @ self.at.v)  # in the body as it was,
            turned = self.at.C.T @ before @ turned  # and as it is
            self.P[V, V] += np.outer(turned, turned)

    def position(self, y, sd, arm):
        self._doubt()
        C, H = self.about.C, np.zeros((3, 15))
        H[:, P] = np.eye(3)
        self.inject(
            self.update(displacement(y, self.about.lla) - C @ arm, H, np.diag(np.square(sd)))[0]
        )

    def velocity(self, y, sd, arm, omega):
        """Gravity by the change of velocity, and course, both at one linearisation; then the
        velocity."""
        self._doubt()
        x = self.about
        C, vel = x.C, y - x.C @ np.cross(omega, arm)
        found, T = np.zeros(15), self.seconds
        if self.then is not None and T >= 0.9 * self.window:
            earth = RATE * np.array([np.cos(x.lla[0]), 0, -np.sin(x.lla[0])])
            a = (vel - self.then) / T + 2 * np.cross(earth, vel)
            heading = (jacobian(x.angles) @ self.P[A, A] @ jacobian(x.angles).T)[2, 2]
            found += self._level(
                C,
                self.force - C.T @ a,
                self.acceleration**2 / T
                + 2 * np.mean(np.square(sd)) / T**2
                + (a[:2] @ a[:2]) * heading,
            )
        if self.then is None or T >= 0.9 * self.window:
            self.then, self.seconds = vel, 0.0
        found += self._course(C, vel, sd, found)
        self.since = 0.0
        self.inject(found)
        C, H = self.about.C, np.zeros((3, 15))
        H[:, V] = np.eye(3)
        self.inject(
            self.update(y - C @ self.about.v - C @ np.cross(omega, arm), H, np.diag(np.square(sd)))[
                0
            ]
        )

    def _level(self, C, z, variance):
        """Correction by the specific force z less the body's own acceleration, with that
        variance of what is left."""
        g, H = gravity(np.sin(self.about.lla[0]), self.about.lla[2]), np.zeros((3, 15))
        H[:, A] = C.T @ CROSS([0, 0, -g])
        R = variance + (np.linalg.norm(z) - g) ** 2
        return self._believed(
            z - C.T @ [0, 0, -g], H, R * np.eye(3) + np.diag(np.diag(self.P)[BA]), 16.266
        )

    def _course(self, C, vel, sd, found):
        speed = np.hypot(*vel[:2])
        if speed < self.min_speed or abs(self.about.angles[0]) > self.max_bank:
            return np.zeros(15)
        R = np.mean(np.square(sd[:2])) / speed**2 + self.crab**2 * max(
            2 * self.correlation / self.since, 1
        )
        H = np.zeros((1, 15))
        H[0, A] = np.linalg.inv(jacobian(self.about.angles))[2]
        e = (
            WRAP(np.arctan2(vel[1], vel[0]) - self.about.angles[2])
            - H @ coordinates(self.about.angles) @ found
        )
        return self._believed(e, H, R * np.eye(1), 10.828)

    def _believed(self, e, H, R, bound):
        kept = self.P.copy()
        dx, nis = self.update(e, H, R)
        if nis > bound:
            self.P = kept
            dx, _ = self.update(e, H, R * nis / bound)
        return dx

    def _doubt(self):
        if self.bar is not None:
            moved = self.bar.C.T @ self.moved
            self.P[V, V] += np.outer(moved, moved)
            self.moved = np.zeros(3)

    def covariance(self):
        """P in the coordinates of the library."""
        T = coordinates(self.about.angles)
        return T @ self.P @ T.T
