"""Each Kalman filter of the chapter as printed, step by step against its equations written down again
in numpy: at rest and under signal 2, with constant and with varying biases.

Nothing here comes from the library but the recording: the strapdown equations with their gravity and
radii, Jacobians, gains and injections are written anew, as in Fossen (2021) 14.3.2, 14.3.3, 14.4.2, 14.4.3
and the published ins_ahrs.m, ins_euler.m, ins_mekf.m and ins_mekf_psi.m.
"""

import numpy as np
import pytest
from ins_equations import gravity, gravity_north, radii, rates_of_frame
from scipy.spatial.transform import Rotation

from strapdown.engine.batch import fuse
from strapdown_reproductions.fossen import cases, signals
from strapdown_reproductions.fossen.printed_filters import PRINTED_FILTERS

I, O = np.eye(3), np.zeros((3, 3))
WITHIN = 1e-9
"""rad, m/s^2, rad/s, and of the standard deviations."""
BY_PLACE = 1e-8
"""m and m/s: a latitude is rounded to 1e-9 m, which gains of several 1/s bring into the velocity."""


def S(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def exp(a):
    """The rotation matrix of a rotation vector, by Rodrigues's formula."""
    angle = np.sqrt(a @ a)
    if angle < 1e-4:  # to the fifth order
        return I + (1 - angle**2 / 6) * S(a) + (0.5 - angle**2 / 24) * S(a) @ S(a)
    return I + np.sin(angle) / angle * S(a) + (1 - np.cos(angle)) / angle**2 * S(a) @ S(a)


def rotation(angles):
    """R(Theta) of the chapter."""
    (sr, sp, sh), (cr, cp, ch) = np.sin(angles), np.cos(angles)
    return np.array(
        [
            [ch * cp, -sh * cr + ch * sp * sr, sh * sr + ch * cr * sp],
            [sh * cp, ch * cr + sr * sp * sh, -ch * sr + sp * sh * cr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of(R):
    return np.array(
        [np.arctan2(R[2, 1], R[2, 2]), np.arcsin(-R[2, 0]), np.arctan2(R[1, 0], R[0, 0])]
    )


def transformation(angles):
    """T(Theta) of the chapter."""
    s, c, cp, tp = np.sin(angles[0]), np.cos(angles[0]), np.cos(angles[1]), np.tan(angles[1])
    return np.array([[1, s * tp, c * tp], [0, c, -s], [0, s / cp, c / cp]])


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def slope(function, x):
    """The derivative of `function` at x (3,), by complex steps."""
    return np.stack([np.imag(function(x + 1e-30j * e)) / 1e-30 for e in I], axis=1)


def compensated(imu):
    """Yields (t, dt, rotation vector, velocity increment): coning and sculling by the sample before,
    of equal length (Savage 1998)."""
    before = np.zeros(3), np.zeros(3)
    for t, h, dtheta, dv in zip(*imu):
        (x, y), before = before, (dtheta, dv)
        yield (
            t,
            h,
            dtheta + np.cross(x, dtheta) / 12,
            dv + (np.cross(x, dv) + np.cross(y, dtheta)) / 12,
        )


class Filter:
    """The states that all have, in the order position, velocity, attitude, accelerometer bias, gyro
    bias; `tau`: time constants of the covariance, `fade`: those of the estimates."""

    first_order = False

    def __init__(self, start, noise, tau, fade):
        self.lla, self.v = np.array(start.lla), np.array(start.v_n)
        self.angles, self.C = np.array(start.rph), rotation(np.array(start.rph))
        self.b_a, self.b_g, self.P = np.zeros(3), np.zeros(3), np.diag(np.square(start.std))
        self.noise, self.tau, self.fade = noise, tau, fade

    def R(self):
        return self.C

    def predict(self, h, dtheta, dv):
        """Ad P Ad' + Q, then the state; h in s."""
        r, a, R = dtheta - self.b_g * h, dv - self.b_a * h, self.R()
        attitude, by_attitude, by_bias, drive = self.jacobian(r / h, a / h)
        A = np.block(
            [
                [O, I, O, O, O],
                [O, O, by_attitude, -R, O],
                [O, O, attitude, O, by_bias],
                [O, O, O, -I / self.tau[0], O],
                [O, O, O, O, -I / self.tau[1]],
            ]
        )
        Ad = np.eye(15) + h * A + (0 if self.first_order else 0.5 * (h * A) @ (h * A))
        q, Q = self.noise, np.zeros((15, 15))
        Q[3:6, 3:6], Q[6:9, 6:9] = q.accel**2 * I, q.gyro**2 * drive @ drive.T
        Q[9:12, 9:12], Q[12:, 12:] = q.accel_bias**2 * I, q.gyro_bias**2 * I
        self.P = Ad @ self.P @ Ad.T + h * Q
        self.f = a / h
        self.turn(r, h)
        self.move(R, r, a, h)
        self.b_a, self.b_g = (
            self.b_a * np.exp(-h / self.fade[0]),
            self.b_g * np.exp(-h / self.fade[1]),
        )

    def frame(self):
        """Rates of the Earth and of n against it, rad/s, at the state."""
        M, N = (each + self.lla[2] for each in radii(self.lla[0]))
        return (*rates_of_frame(self.lla[0], self.v, M, N), M, N)

    def move(self, R, r, a, h):
        """Position and velocity on the turning ellipsoid; what R is after it, in self.R_after."""
        ie, en, M, N = self.frame()
        lat, v, height = self.lla[0], self.v, self.lla[2] - 0.5 * h * self.v[2]
        s = a + np.cross(r, a) / 2 + np.cross(r, np.cross(r, a)) / 6
        f = R @ s
        f = f - 0.5 * h * np.cross(ie + en, f)
        g = h * np.array([gravity_north(lat, height), 0, gravity(lat, height)])
        turn = h * (2 * ie + en)
        middle = v + 0.5 * (f - np.cross(turn, v) + g)
        self.v = v + f - np.cross(turn, middle) + g
        m = 0.5 * (v + self.v)
        # the frame of mid-interval, to first order in the way
        way = 0.5 * h * m[0] / M
        tan = np.tan(lat) + (1 + np.tan(lat) ** 2) * way
        w = np.array(
            [ie[0] + ie[2] * way + m[1] / N, -m[0] / M, ie[2] - ie[0] * way - tan * m[1] / N]
        )
        self.R_after = exp(-h * w) @ R @ exp(r)
        cosine = np.cos(lat) - 0.5 * np.sin(lat) * h * m[0] / M
        self.lla = self.lla + h * np.array([m[0] / M, m[1] / (N * cosine), -m[2]])

    def correct(self, H, e, std):
        R = np.diag(np.square(std))
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        rest = np.eye(15) - K @ H
        self.P, x = rest @ self.P @ rest.T + K @ R @ K.T, K @ e
        M, N = (each + self.lla[2] for each in radii(self.lla[0]))
        self.lla = self.lla + x[:3] / [M, N * np.cos(self.lla[0]), -1]
        self.v, self.b_a, self.b_g = self.v + x[3:6], self.b_a + x[9:12], self.b_g + x[12:]
        self.inject(x[6:9])

    def use(self, kind, y, std, reference):
        """One measurement."""
        rows = lambda first: np.eye(3, 15, first)
        if kind == "position":
            M, N = (each + self.lla[2] for each in radii(self.lla[0]))
            self.correct(rows(0), (y - self.lla) * [M, N * np.cos(self.lla[0]), -1], std)
        elif kind == "velocity":
            self.correct(rows(3), y - self.v, std)
        elif kind == "attitude":
            self.correct(rows(6), wrapped(y - self.angles), std)
            self.known = rotation(y)
        elif kind == "heading":
            H = np.zeros((1, 15))
            H[0, 6:9] = self.compass()
            self.correct(H, wrapped(y - angles_of(self.C)[2:]), std)
        else:
            up = kind == "gravity"
            v, v0 = (self.f, np.array([0, 0, -1.0])) if up else (y, np.array(reference))
            size = cases.GRAVITY_SIZE if up else np.linalg.norm(v0)
            expected, H = self.C.T @ v0 / np.linalg.norm(v0), np.zeros((3, 15))
            H[:, 6:9] = S(expected)
            self.correct(H, v / np.linalg.norm(v) - expected, std / size)

    def compass(self):
        return np.array([0, 0, 1.0])

    def published(self):
        """P with attitude errors as small rotations in n."""
        (sp, sh), (cp, ch) = np.sin(self.angles[1:]), np.cos(self.angles[1:])
        return self.in_n(np.array([[ch * cp, -sh, 0], [sh * cp, ch, 0], [-sp, 0, 1]]))

    def in_n(self, J):
        A = np.eye(15)
        A[6:9, 6:9] = J
        return A @ self.P @ A.T


class DirectEuler(Filter):
    """14.3.3: Euler angles as states; derivatives of R f and T w by the angles."""

    first_order = True

    def jacobian(self, w, f):
        T = transformation(self.angles)
        return (
            slope(lambda x: transformation(x) @ w, self.angles),
            slope(lambda x: rotation(x) @ f, self.angles),
            -T,
            -T,
        )

    def turn(self, r, h):
        """The angles, by the midpoint rule."""
        ie, en, _, _ = self.frame()
        body = r - h * self.C.T @ (ie + en)
        half = self.angles + 0.5 * transformation(self.angles) @ body
        self.angles = self.angles + transformation(half) @ body

    def move(self, R, r, a, h):
        super().move(R, r, a, h)
        self.C = rotation(self.angles)

    def inject(self, x):
        self.angles = self.angles + x
        self.C = rotation(self.angles)


class InsEuler(DirectEuler):
    """ins_euler.m: errors of a small rotation in body axes, added to the angles."""

    first_order = False

    def jacobian(self, w, f):
        return -S(w), -self.C @ S(f), -I, -I


class Ahrs(DirectEuler):
    """14.3.2 and ins_ahrs.m: R and T of the AHRS, carried on by the gyros."""

    first_order = False

    def __init__(self, *given):
        super().__init__(*given)
        self.known = self.C

    def R(self):
        return self.known

    def jacobian(self, w, f):
        T = transformation(angles_of(self.known))
        return O, O, -T, -T

    def turn(self, r, h):
        """The angles, by Euler's method as printed."""
        ie, en, _, _ = self.frame()
        body = r - h * self.known.T @ (ie + en)
        self.angles = self.angles + transformation(angles_of(self.known)) @ body

    def move(self, R, r, a, h):
        super().move(R, r, a, h)
        self.known = self.R_after


class Mekf(Filter):
    """ins_mekf.m and ins_mekf_psi.m: attitude as a rotation, its error as twice a Gibbs vector."""

    def __init__(self, *given):
        super().__init__(*given)
        self.P = self.in_n(self.C.T)

    def jacobian(self, w, f):
        return -S(w), -self.C @ S(f), -I, -I

    def turn(self, r, h):
        pass

    def move(self, R, r, a, h):
        super().move(R, r, a, h)
        self.C = self.R_after

    def inject(self, a):
        """C <- C R(dq), dq = [2, a]/sqrt(4 + a'a)."""
        e, *v = np.r_[2, a] / np.sqrt(4 + a @ a)
        v = np.array(v)
        self.C = self.C @ (I + 2 * e * S(v) + 2 * S(v) @ S(v))

    def compass(self):
        """Of the whole attitude's Gibbs vector, as printed."""
        q = Rotation.from_matrix(self.C).as_quat()
        a = 2 * q[:3] / q[3]
        y, x = 2 * a[0] * a[1] + 4 * a[2], 4 + a[0] ** 2 - a[1] ** 2 - a[2] ** 2
        dy, dx = np.array([2 * a[1], 2 * a[0], 4]), np.array([2 * a[0], -2 * a[1], -2 * a[2]])
        return (dy * x - dx * y) / (x * x + y * y)

    def published(self):
        return self.in_n(self.C)


TWINS = {
    "euler-direct": (DirectEuler, cases.EULER, ("position", "velocity", "heading")),
    "euler-indirect": (InsEuler, cases.EULER, ("position", "heading", "gravity")),
    "ahrs-direct": (Ahrs, cases.AHRS, ("position", "attitude")),
    "ahrs-indirect": (Ahrs, cases.AHRS, ("position", "attitude")),
    "mekf-printed": (Mekf, cases.MEKF, ("position", "magnetic-field", "gravity")),
    "mekf-printed, compass": (Mekf, cases.MEKF, ("position", "velocity", "heading")),
}
"""Filter, weights and sensors, those with printed weights and one of the true noises."""


class FixedGain(Ahrs):
    """14.3.1: gains on position, velocity and the bias in n, the same for north and east; at a fix
    those that give the sampled error the poles exp(s T), by Ackermann's formula."""

    GAINS = 0.7, 0.14, 0.008
    since = 0.0

    def predict(self, h, dtheta, dv):
        self.since += h
        self.move(self.known, dtheta - self.b_g * h, dv - self.b_a * h, h)
        self.C = self.known

    def use(self, kind, y, std, reference):
        if kind == "attitude":
            self.known = self.C = rotation(y)
            return
        T, self.since = self.since, 0.0
        Phi = np.array([[1, T, T * T / 2], [0, 1, T], [0, 0, 1]])
        H = Phi[:1]
        poles = np.exp(T * np.roots([1, *self.GAINS]))
        wanted = np.eye(3)
        for pole in poles:
            wanted = wanted @ (Phi - pole.real * np.eye(3))
        seen = np.vstack([H, H @ Phi, H @ Phi @ Phi])
        k1, k2, k3 = wanted @ np.linalg.solve(seen, [0, 0, 1])
        M, N = (each + self.lla[2] for each in radii(self.lla[0]))
        scale = np.array([M, N * np.cos(self.lla[0]), -1])
        e = (y - self.lla) * scale
        self.lla, self.v = self.lla + k1 * e / scale, self.v + k2 * e
        self.b_a = self.b_a - self.C.T @ (k3 * e)


class ForceObserver(Filter):
    """14.2.3: cross products of the specific force with gravity, or with what GNSS velocities say of
    it, and of the field with north."""

    k1, k2, ki, by_gnss = 1.0, 1.0, 0.1, True

    def __init__(self, *given):
        super().__init__(*given)
        self.gathered, self.seconds, self.since, self.before = np.zeros(3), 0.0, 0.0, None

    def predict(self, h, dtheta, dv):
        r, lat = dtheta - self.b_g * h, self.lla[0]
        middle = self.C @ exp(0.5 * r)
        self.gathered = self.gathered + middle @ dv
        earth = 7.292115e-5 * np.array([np.cos(lat), 0, -np.sin(lat)])
        self.C = exp(-h * earth) @ middle @ exp(0.5 * r)
        self.seconds, self.since = self.seconds + h, self.since + h
        self.b_g = self.b_g * np.exp(-h / self.fade[1])

    def pull(self, x, gain):
        self.b_g = self.b_g - self.ki * gain * self.C.T @ x
        self.C = exp(gain * x) @ self.C

    def use(self, kind, y, std, reference):
        if kind == "velocity":
            T, s, before = self.seconds, self.gathered, self.before
            self.seconds, self.gathered, self.before = 0.0, np.zeros(3), y
            if before is not None:
                r = np.array([0, 0, -gravity(self.lla[0], self.lla[2]) * T])
                r = r + (y - before if self.by_gnss else 0)
                x = np.cross(s, r) / np.linalg.norm(s) / np.linalg.norm(r)
                self.pull(x, 1 - np.exp(-self.k1 * T))
            return
        m, n = (self.C @ y)[:2], np.array(reference[:2])
        off = np.cross(np.r_[m, 0], np.r_[n, 0])[2] / np.linalg.norm(m) / np.linalg.norm(n)
        self.pull(np.array([0, 0, off]), 1 - np.exp(-self.k2 * self.since))
        self.since = 0.0


class GravityObserver(ForceObserver):
    by_gnss = False


def case_of(name):
    """The FilterCase of a twin."""
    twin, weights, kinds = TWINS[name]
    filter = PRINTED_FILTERS.get(name.split(",")[0])
    return cases.FilterCase(name, filter.name, kinds, weights)


def both(case, twin, tuning, excitation, walking, seconds):
    """(the filter's Solution, rows of the twin: lla, v, C, biases, standard deviations in n)."""
    whole = signals.recording(excitation, 7, 100.0, seconds, walking=walking)
    used, filter, model = cases.select_sources(whole, case, tuning), case.value, case.value.bias
    start, noise = cases.start(whole, tuning, 7), cases.noise(case, cases.CHAPTER, excitation)
    never = (np.inf, np.inf)
    tau = never if model == "random-walk" else (1 / noise.accel_decay, 1 / noise.gyro_decay)
    own = twin(start, noise, tau, tau if model == "decaying" else never)
    options = {**case.options, **({"bias": model} if model else {})}
    found = fuse(used, filter, start=start, noise=noise, options=options, every=10)
    kept, at = [], [0] * len(used.sources)
    for k, (t, h, dtheta, dv) in enumerate(compensated(used.imu), 1):
        own.predict(h, dtheta, dv)
        for i, source in enumerate(used.sources):
            if at[i] < len(source.t) and source.t[at[i]] < t + 1e-6:
                own.use(source.kind, source.y[at[i]], source.std[at[i]], source.parameters[:3])
                at[i] += 1
        if k % 10 == 0:
            deviations = np.sqrt(np.diag(own.published()))
            kept.append((own.lla, own.v, own.C, np.r_[own.b_a, own.b_g], deviations))
    return found, kept


def apart(found, kept):
    """{state: largest difference}, that of position and velocity by BY_PLACE over WITHIN; NaN where
    the filter does not estimate it."""
    lla, v, C, biases, deviations = map(np.array, zip(*kept))
    path, most = found.trajectory, lambda difference: np.abs(difference).max()
    metres = (path.lla - lla) * [6.4e6, 6.4e6 * np.cos(lla[0, 0]), 1.0]
    assert len(found.t) == len(kept)
    return {
        "position": most(metres) * WITHIN / BY_PLACE,
        "velocity": most(path.v_n - v) * WITHIN / BY_PLACE,
        "attitude": most(path.rotation.as_matrix() - C),
        "accelerometer biases": most(found.b_a - biases[:, :3]),
        "gyro biases": most(found.b_g - biases[:, 3:]),
        "deviations": most(path.std - deviations),
    }


MOTIONS = (("at rest", False), ("signal 2", False), ("signal 2", True))
"""Excitation, and whether its biases vary."""


@pytest.mark.parametrize("name", TWINS)
@pytest.mark.parametrize(("excitation", "walking"), MOTIONS)
def test_each_printed_filter_is_its_equations(name, excitation, walking, seconds=300.0):
    case = case_of(name)
    tuning = cases.RIGHT if "velocity" in case.kinds else cases.CHAPTER
    worst = apart(*both(case, TWINS[name][0], tuning, excitation, walking, seconds))
    assert max(worst.values()) < WITHIN, worst


OBSERVERS = {
    "fixed-gain": FixedGain,
    "observer, reference by GNSS": ForceObserver,
    "observer, reference by gravity": GravityObserver,
}


@pytest.mark.parametrize("name", OBSERVERS)
@pytest.mark.parametrize(("excitation", "walking"), MOTIONS)
def test_each_observer_is_its_equations(name, excitation, walking, seconds=300.0):
    """Without the standard deviations, which the chapter's observers do not have."""
    case = next(case for case in cases.CASES if case.name == name)
    worst = apart(*both(case, OBSERVERS[name], cases.RIGHT, excitation, walking, seconds))
    states = (
        ("attitude", "gyro biases")
        if "observer" in name
        else ("position", "velocity", "attitude", "accelerometer biases")
    )
    assert max(worst[state] for state in states) < WITHIN, worst


@pytest.mark.parametrize("tuning", [cases.CHAPTER, cases.RIGHT])
def test_through_the_vertical_the_printed_compass_row_loses_the_attitude(tuning):
    """And the same filter with the exact row holds it."""
    case = next(
        case for case in cases.CASES if case.name == "mekf as printed, position + gravity + compass"
    )
    recording, found = signals.recording("steep", 900), {}
    for compass in ("printed", "corrected"):
        own = case._replace(options={"compass": compass})
        run = cases.run(recording, own, tuning, "steep", 900)
        found[compass] = cases.numbers(run, 300.0)
    assert np.degrees(found["printed"]["attitude_rad"]) > 30 and found["printed"]["position_m"] > 3
    assert np.degrees(found["corrected"]["attitude_rad"]) < 0.15
    assert found["corrected"]["position_m"] < 0.05
