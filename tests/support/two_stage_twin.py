"""The two-stage Kalman filter once more, with dense matrices in its own coordinates: position,
velocity in the body, Euler angles, biases. Nothing of it is the library's.

About the estimate itself (EKF), about states that are given (affine filter), or with the mean of the
first and the transition matrix of the second (XKF by the letter). One function of plain numpy for
each equation of docs/explanation/two-stage.md.
"""

import numpy as np
from plain_ins import SPIN, carried, cross, displaced, gravity, mechanized, way_between, wrap
from scipy.spatial.transform import Rotation

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

    def __init__(self, lla, v, angles, b_a, b_g, of_body=False):
        self.lla, self.angles, self.b_a, self.b_g = (
            np.array(part, float) for part in (lla, angles, b_a, b_g)
        )
        self.v = np.array(v, float) if of_body else matrix(angles).T @ v

    @property
    def C(self):
        return matrix(self.angles)

    def plus(self, x):
        return State(
            displaced(self.lla, x[P]),
            self.v + x[V],
            self.angles + x[A],
            self.b_a + x[BA],
            self.b_g + x[BG],
            True,
        )

    def minus(self, other):
        return np.r_[
            way_between(self.lla, other.lla),
            self.v - other.v,
            wrap(self.angles - other.angles),
            self.b_a - other.b_a,
            self.b_g - other.b_g,
        ]


class Twin:
    """The filter, its options (rad, SI) and Noise; `bar` is None or the state to linearise at."""

    max_bank, max_course_std, crab, correlation, window, acceleration = (
        np.radians(45),
        np.radians(5),
        np.radians(5),
        10.0,
        1.0,
        0.2,
    )

    def __init__(self, start, noise, bar=None, affine=True, raw=False, down=False):
        """bar: the state to linearise at, or None; affine: whether the mean goes on about it too;
        raw: the accelerometers level with their bias; down: of velocities the component along z."""
        self.at, self.bar, self.noise = (
            State(start.lla, start.v_n, start.rph, start.b_a, start.b_g),
            bar,
            noise,
        )
        self.affine, self.raw, self.down, self.far = affine, raw, down, {1: 0, 3: 0}
        T = coordinates(start.rph)
        self.P = np.linalg.inv(T) @ np.diag(np.square(start.std)) @ np.linalg.inv(T).T
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
        """Where the mean is taken, and H."""
        return self.bar if self.bar is not None and self.affine else self.at

    @property
    def linearised(self):
        """Where the transition matrix is taken."""
        return self.at if self.bar is None else self.bar

    def _ahead(self, x, u, dt):
        """(state, velocity increment by the specific force) of a state a sample later."""
        step = mechanized(x.lla, x.C @ x.v, x.C, u[:3] - x.b_g * dt, u[3:] - x.b_a * dt, dt)
        keep_a, keep_g = np.exp(-self.noise.accel_decay * dt), np.exp(-self.noise.gyro_decay * dt)
        angles = angles_of(step.C)
        return State(step.lla, step.v, angles, x.b_a * keep_a, x.b_g * keep_g), step.force

    def predict(self, u, dt, bar=None):
        """Prediction; `bar` is the given state at the end of the sample."""
        x, noise = self.about, self.noise
        r, own, share = (
            u[:3] - x.b_g * dt,
            u[3:] - (not self.raw) * x.b_a * dt,
            dt / (self.seconds + dt),
        )
        self.force = carried(self.force, own, r, (share, share / dt))
        self.centrifugal = carried(self.centrifugal, np.cross(r, x.v), r, (share, share / dt))
        self.seconds, self.since = self.seconds + dt, self.since + dt
        self.rate = r / dt
        before, x = self.at, self.linearised
        moved, f = self._ahead(x, u, dt)
        C, r = x.C, u[:3] - x.b_g * dt
        middle = C @ (np.eye(3) + cross(r / 2))
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
        d = (coordinates(x.angles) @ before.minus(x))[A] * (self.since >= 3) * self.affine
        tilt = S[A, A] + np.outer(d, d)
        S[V, V] += 2 * self.correlation / dt * cross(f) @ tilt @ cross(f).T
        self.P = last @ S @ last.T
        if self.affine:
            self.at = moved.plus(last @ first @ before.minus(x))
        else:
            self.at, _ = self._ahead(before, u, dt)
        if bar is not None:
            self.bar = moved
            self.jump(bar)
        if self.since >= 3 and self.seconds >= self.window:
            swing = self.rate @ self.rate * np.trace(self.covariance()[V, V])
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
        before, itself, about = self.at.C, self.about is self.at, self.about.lla
        way = way_between(self.at.lla, about) + x[P]
        self.at = self.at.plus(x)
        self.at.lla = displaced(about, way)
        if itself and x[A].any():
            turned = before.T @ ((self.at.C - before) @ self.at.v)  # in the body as it was,
            turned = self.at.C.T @ before @ turned  # and as it is
            self.P[V, V] += np.outer(turned, turned)

    def position(self, y, std, arm):
        self._doubt()
        C, H = self.about.C, np.zeros((3, 15))
        H[:, P] = np.eye(3)
        e = way_between(y, self.about.lla) - C @ arm
        self.inject(self.update(e, H, np.diag(np.square(std)))[0])

    def velocity(self, y, std, arm):
        """Gravity by the change of velocity, and course, both at one linearisation; then the
        velocity."""
        self._doubt()
        x = self.about
        C, vel = x.C, y - x.C @ np.cross(self.rate, arm)
        found, T = np.zeros(15), self.seconds
        if self.then is not None and T >= 0.9 * self.window:
            earth = SPIN * np.array([np.cos(x.lla[0]), 0, -np.sin(x.lla[0])])
            a = (vel - self.then) / T + 2 * np.cross(earth, vel)
            heading = (jacobian(x.angles) @ self.P[A, A] @ jacobian(x.angles).T)[2, 2]
            noise = 2 * np.mean(np.square(std)) / T**2 + (a[:2] @ a[:2]) * heading
            found += self._level(C, self.force - C.T @ a, self.acceleration**2 / T + noise)
        if self.then is None or T >= 0.9 * self.window:
            self.then, self.seconds = vel, 0.0
        found += self._course(vel, std, found)
        self.since = 0.0
        self.inject(found)
        C, H, R = self.about.C, np.zeros((3, 15)), np.diag(np.square(std))
        H[:, V] = np.eye(3)
        e = y - C @ self.about.v - C @ np.cross(self.rate, arm)
        if self.down:
            axis = C[:, 2]
            e, H, R = np.atleast_1d(axis @ e), (axis @ H)[None], np.atleast_2d(axis @ R @ axis)
        self.inject(self.update(e, H, R)[0])

    def _level(self, C, z, variance):
        """Correction by the specific force z less the body's own acceleration, with that
        variance of what is left."""
        g, H = gravity(self.about.lla[0], self.about.lla[2])[2], np.zeros((3, 15))
        H[:, A] = C.T @ cross([0, 0, -g])
        R = (variance + (np.linalg.norm(z) - g) ** 2) * np.eye(3)
        R += (not self.raw) * np.diag(np.diag(self.P)[BA])
        return self._believed(z - C.T @ [0, 0, -g], H, R, 16.266)

    def _course(self, vel, std, found):
        """Correction by the direction of a velocity, where it is sure and the wings are level."""
        speed, own = np.hypot(*vel[:2]), np.sqrt(np.mean(np.square(std[:2])))
        if speed * self.max_course_std < own or abs(self.about.angles[0]) > self.max_bank:
            return np.zeros(15)
        lasting = max(2 * self.correlation / self.since, 1)
        H = np.zeros((1, 15))
        H[0, A] = np.linalg.inv(jacobian(self.about.angles))[2]
        e = wrap(np.arctan2(vel[1], vel[0]) - self.about.angles[2])
        R = (own / speed) ** 2 + self.crab**2 * lasting
        return self._believed(np.atleast_1d(e), H, R * np.eye(1), 10.828, found)

    def _believed(self, e, H, R, bound, found=0.0):
        """Correction by rows of stage 1 beyond what was `found`; far ones count for less, and many
        of them let P of stage 1 grow."""
        kept, own, rows = self.P.copy(), H @ coordinates(self.about.angles), len(e)
        e = e - own @ (found * np.ones(15))
        dx, nis = self.update(e, H, R)
        self.far[rows] = self.far[rows] + 1 if nis > bound else 0
        if self.far[rows] >= 5:
            grown = np.ones(15)
            grown[A] = grown[BG] = np.sqrt(min(nis / bound, 9.0))
            self.P = grown[:, None] * kept * grown
            dx, _ = self.update(e, H, R)
        elif nis > bound:
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

    def jump(self, bar):
        """The given state jumps; Euler angles, velocity in the body and biases stay, and position as
        the sum of metres from the one state and between both."""
        if self.affine:
            self.moved += (bar.C - self.bar.C) @ self.at.v
            way = way_between(self.at.lla, self.bar.lla) + way_between(self.bar.lla, bar.lla)
            self.at.lla = displaced(bar.lla, way)
        self.bar = bar
