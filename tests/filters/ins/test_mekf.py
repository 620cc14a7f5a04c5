"""The multiplicative EKF against one with a quaternion and body-frame errors, against the closed
loop, and with every sensor at its own rate."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import flight, start, turning
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding
from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown.core.mathematics.earth import place, rotation_rates
from strapdown.core.mathematics.error_dynamics import cross_matrix, dynamics
from strapdown.core.mathematics.mechanization import mechanize
from strapdown.core.mathematics.source import new_source
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.filters.ins.closed_loop import CLOSED_LOOP
from strapdown.filters.ins.ekf import EKF
from strapdown.filters.ins.mekf import MEKF
from strapdown.filters.sigma_point.ckf import CKF
from strapdown.filters.sigma_point.ukf import UKF
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.imu import ImuSpec, Triad
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.synthesis import draw_start
from strapdown.sim.trajectory import DEG, Motion, increments, sample, static

NOISE = Noise(
    gyro=3e-4, accel=3e-3, gyro_bias=2e-5, accel_bias=2e-4, gyro_decay=1 / 200, accel_decay=1 / 100
)
FIELD = np.array([20e-6, 1.5e-6, 43e-6])  # T, NED
PLACE = (DEG * 47.0, DEG * 8.0, 500.0)
WALK = 0.1  # m/sqrt(s) of a barometer's bias
GRAVITY = 9.8072  # m/s^2 at that place


# ---- the filter of the book: a quaternion, errors in body axes, dense matrices


def product(p, q):
    """Hamilton product, scalar first."""
    return np.r_[p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])]


def matrix(q):
    return (
        np.eye(3) + 2 * q[0] * cross_matrix(q[1:]) + 2 * cross_matrix(q[1:]) @ cross_matrix(q[1:])
    )


def exponential(rotation):
    half = np.linalg.norm(rotation) / 2
    return np.r_[np.cos(half), np.sinc(half / np.pi) * rotation / 2]


def gibbs(a):
    """The quaternion whose 2 x Gibbs vector is a."""
    return np.r_[2.0, a] / np.sqrt(4 + a @ a)


class Book:
    """Position, velocity, quaternion, biases of accelerometer, gyro and barometer; errors p, v,
    a, b_a, b_g, b_h with a in body axes."""

    def __init__(self, begin, baro_std):
        self.lla, self.v = np.array(begin.lla, float), np.array(begin.v_n, float)
        self.q = Rotation.from_euler("ZYX", begin.rph[::-1]).as_quat()[[3, 0, 1, 2]]
        self.b_a, self.b_g, self.bh = np.array(begin.b_a, float), np.array(begin.b_g, float), 0.0
        self.P = self.in_body(np.diag(np.r_[begin.std, baro_std] ** 2))

    def in_body(self, P):
        A = block_diag(np.eye(6), matrix(self.q).T, np.eye(7))
        return A @ P @ A.T

    def in_n(self):
        A = block_diag(np.eye(6), matrix(self.q), np.eye(7))
        return A @ self.P @ A.T

    def step(self, rotation, force, dt):
        """Errors of the textbook, a' = -w x a - b_g and v' = -C (f x a) - C b_a; what the Earth
        adds is the library's, its rows of a turned to the body."""
        r, a = rotation - self.b_g * dt, force - self.b_a * dt
        self.w, self.f = r / dt, a / dt
        middle = matrix(product(self.q, exponential(r / 2)))
        F, Q = dynamics(self.lla, self.v, middle, np.zeros(3), NOISE)
        F[6:9, :6] = middle.T @ F[6:9, :6]
        F[3:6, 6:9], F[3:6, 9:12] = -middle @ cross_matrix(self.f), -middle
        F[6:9, 6:9], F[6:9, 12:15] = -cross_matrix(self.w), -np.eye(3)
        van_loan = expm(np.block([[-F, Q], [np.zeros((15, 15)), F.T]]) * dt)
        Phi = van_loan[15:, 15:].T
        whole = block_diag(Phi, 1)
        self.P = whole @ self.P @ whole.T + block_diag(Phi @ van_loan[:15, 15:], 0)
        sine, cosine, M, N = place(self.lla[0], self.lla[2])
        turn = np.array(rotation_rates(self.v[0], self.v[1], sine, cosine, M, N)[2:]) * dt
        mechanize(self.lla, self.v, matrix(self.q), r, a, dt, np.zeros(3))
        self.q = product(exponential(-turn), product(self.q, exponential(r)))
        self.b_a, self.b_g = (
            self.b_a * np.exp(-NOISE.accel_decay * dt),
            self.b_g * np.exp(-NOISE.gyro_decay * dt),
        )

    def expected(self, source, y):
        """(innovation, rows of H) of a fix, with derivatives by the error in body axes."""
        C, arm, H = matrix(self.q), np.array(source.parameters or (0, 0, 0)), np.zeros((3, 16))
        swing = np.cross(self.w, arm)
        match source.kind:
            case "position":
                H[:, :3], H[:, 6:9] = np.eye(3), -C @ cross_matrix(arm)
                return displacement(y, self.lla) - C @ arm, H
            case "velocity":
                H[:, 3:6], H[:, 6:9], H[:, 12:15] = (
                    np.eye(3),
                    -C @ cross_matrix(swing),
                    C @ cross_matrix(arm),
                )
                return y - self.v - C @ swing, H
            case "heading":
                pitch, roll = -np.arcsin(C[2, 0]), np.arctan2(C[2, 1], C[2, 2])
                H[0, 6:9] = [0, np.sin(roll) / np.cos(pitch), np.cos(roll) / np.cos(pitch)]
                return (y - np.arctan2(C[1, 0], C[0, 0]) + np.pi) % (2 * np.pi) - np.pi, H[:1]
            case "magnetic-field":
                H[:, 6:9] = cross_matrix(C.T @ arm)
                return y - C.T @ arm, H
            case "gravity":
                H[:, 6:9], H[:, 9:12] = -C @ cross_matrix(self.f), -C
                return -C @ self.f - [0, 0, GRAVITY], H
            case "pressure-altitude":
                H[0, 2], H[0, 15] = 1, -1
                return np.array([self.lla[2] + self.bh - y[0]]), H[:1]

    def correct(self, source, y, deviation):
        e, H = self.expected(source, y)
        R = np.diag(deviation**2)
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        keep, dx = np.eye(16) - K @ H, K @ e
        self.P = keep @ self.P @ keep.T + K @ R @ K.T
        back = Rotation.from_quat([*-dx[6:9] / 2, 1.0]) ** 0.5
        reset = block_diag(np.eye(6), back.as_matrix(), np.eye(7))
        self.P = reset @ self.P @ reset.T
        self.lla, self.v, self.q = (
            displace_lla(self.lla, dx[:3]),
            self.v + dx[3:6],
            product(self.q, gibbs(dx[6:9])),
        )
        self.q /= np.linalg.norm(self.q)
        self.b_a, self.b_g, self.bh = self.b_a + dx[9:12], self.b_g + dx[12:15], self.bh + dx[15]


def book(recording, begin):
    """(lla, v, C, biases, P in n) after each sample; fixes at the ends of samples, in the order
    of their sources."""
    made, before, seen = Book(begin, 150.0), None, {}
    for t, dt, rotation, force in zip(*recording.imu):
        r, a = rotation.copy(), force.copy()
        if before is not None:
            r, a = (
                r + np.cross(before[0], rotation) / 12,
                a + (np.cross(before[0], force) + np.cross(before[1], rotation)) / 12,
            )
        before = rotation, force
        made.step(r, a, dt)
        for source in recording.sources:
            for row in np.flatnonzero(np.abs(source.t - t) < 1e-6):
                if source.kind == "pressure-altitude":
                    made.P[15, 15] += WALK**2 * (t - seen.get(source.kind, 0.0))
                    seen[source.kind] = t
                made.correct(source, source.y[row], source.std[row])
        yield (
            made.lla.copy(),
            made.v.copy(),
            matrix(made.q),
            np.r_[made.b_a, made.b_g, made.bh],
            made.in_n(),
        )


def every_kind(seconds=3.0, rate=20.0):
    """The turning flight with position, velocity, compass, field, gravity and a barometer, each
    at its rate, and a start whose errors matter."""
    recording = flight(seconds, rate)
    truth, rng = recording.reference, np.random.default_rng(5)
    made = [replace(a, gate=np.inf) for a in recording.sources]
    kinds = (
        ("heading", 4, 0.02, lambda C, h: [np.arctan2(C[1, 0], C[0, 0])], ()),
        ("magnetic-field", 2, 5e-7, lambda C, h: C.T @ FIELD, tuple(FIELD)),
        ("gravity", 10, 3.0, lambda C, h: np.zeros(3), ()),
        ("pressure-altitude", 5, 1.0, lambda C, h: [h + 80.0], ()),
    )
    for kind, each, deviation, model, parameters in kinds:
        rows = np.arange(each, len(truth.t), each)
        y = np.array([model(truth.rotation[k].as_matrix(), truth.lla[k, 2]) for k in rows])
        made.append(
            Source(
                kind,
                truth.t[rows],
                y + (kind != "gravity") * rng.normal(0, deviation, y.shape),
                np.full(y.shape, deviation),
                parameters,
                gate=np.inf,
            )
        )
    begin, deviation = (
        start(recording),
        np.r_[[2.0] * 3, [0.5] * 3, 0.1, 0.1, 0.4, [0.05] * 3, [2e-3] * 3],
    )
    rph = np.array(begin.rph) + [0.06, -0.05, 0.25]
    return replace(recording, sources=tuple(made)), begin._replace(
        rph=tuple(rph), b_a=(0.05, -0.03, 0.04), b_g=(1e-3, -2e-3, 1e-3), std=tuple(deviation)
    )


def distance(solution, made):
    """Largest distances of a Solution from `book`: m, m/s, rad, biases in their std, covariance
    in std."""
    lla, v, C, b, P = (np.array(part) for part in zip(*made))
    scale = np.sqrt(np.einsum("kii->ki", P))
    found = np.c_[solution.b_a, solution.b_g, solution.columns["pressure-altitude bias [m]"]]
    return np.array(
        [
            np.abs(displacement(solution.trajectory.lla, lla)).max(),
            np.abs(solution.trajectory.v_n - v).max(),
            (solution.trajectory.rotation * Rotation.from_matrix(C).inv()).magnitude().max(),
            np.abs((found - b) / scale[:, 9:]).max(),
            np.abs((solution.covariance - P) / (scale[:, :, None] * scale[:, None, :])).max(),
        ]
    )


@pytest.mark.short
def test_it_is_the_filter_of_the_book():
    recording, begin = every_kind()
    made = list(book(recording, begin))
    ours, closed = (
        sd.fuse(recording, name, start=begin, noise=NOISE, covariance=True)
        for name in ("mekf", "closed-loop")
    )
    assert (distance(ours, made) < [3e-5, 5e-5, 1e-6, 3e-4, 1e-3]).all()
    # which of the two it is is no matter of rounding: they compose a correction differently
    assert distance(closed, made)[2] > 20 * distance(ours, made)[2]
    assert np.array_equal(ours.covariance, ours.covariance.swapaxes(1, 2))


# ---- the correction by itself


def corrected(a, C, filter=MEKF):
    """(C, P, P that the gain alone leaves) of a correction whose attitude error in n is a: a
    velocity northward that errs as the attitude about a does."""
    sensor = aiding.find("velocity")
    for kernel in (filter.correct, sensor.observe):
        compile_kernel(kernel)
    rph, length = Rotation.from_matrix(C).as_euler("ZYX")[::-1], np.linalg.norm(a)
    belief = filter.start(
        InitialState(0.0, PLACE, (0.0,) * 3, tuple(rph), (0.0,) * 3, (0.0,) * 3, (1.0,) * 15), NOISE
    )
    P = np.diag(np.r_[[1.0] * 3, 0.1, 0.2, 0.3, 0.1, 0.2, 0.3, [0.01] * 6] ** 2)
    P[3, 6:9] = P[6:9, 3] = 0.06 * a / length
    P[6:9, 6:9] += np.outer(a, a) / length**2
    belief.P[...], e = P, np.array([length * (P[3, 3] + 1e-6) / 0.06, np.nan, np.nan])
    assert (
        filter.correct(
            belief,
            e,
            np.array([1e-3, np.nan, np.nan]),
            aiding.number(sensor.name),
            sensor.observe,
            new_source(),
            np.inf,
            np.zeros(12),
        )
        > 0
    )
    return belief.C_nb, belief.P, P - np.outer(P[:, 3], P[3]) / (P[3, 3] + 1e-6)


@pytest.mark.short
@pytest.mark.parametrize("angle", [1e-6, 0.01, 1.0, 30.0, 90.0, 120.0, 170.0, 179.0])
@pytest.mark.parametrize("axis", [(0, 0, 1), (0.6, 0, 0.8), (-0.48, 0.8, 0.36)])
def test_a_correction_is_a_gibbs_vector_at_every_angle(angle, axis):
    """By tan(angle/2) = |a|/2: what the rotation vector would make of 179 deg is 36 turns. The
    covariance left turns by half of it."""
    C = Rotation.from_euler("ZYX", [2.0, -0.4, 0.7]).as_matrix()
    a = 2 * np.tan(angle * DEG / 2) * np.array(axis)
    found, P, left = corrected(a, C)
    turn = Rotation.from_quat([*a / 2, 1.0]).as_matrix()
    np.testing.assert_allclose(found, turn @ C, atol=1e-13)
    half = Rotation.from_rotvec(0.5 * angle * DEG * np.array(axis)).as_matrix()
    A = block_diag(np.eye(6), half, np.eye(6))
    np.testing.assert_allclose(P, A @ left @ A.T, atol=1e-14)
    assert np.array_equal(P, P.T) and np.linalg.eigvalsh(P).min() > 0


@pytest.mark.short
@pytest.mark.parametrize("filter", [CLOSED_LOOP, MEKF, EKF, UKF, CKF], ids=lambda each: each.name)
def test_the_covariance_after_a_correction_is_that_of_the_error_left(filter):
    """The error left, true (x) corrected^-1, by differences of the error before; without a turn,
    or with that of the whole correction, P is off by fifty times as much."""
    C = Rotation.from_euler("ZYX", [2.0, -0.4, 0.7])
    a, h = np.array([0.03, -0.02, 0.04]), 1e-6
    found, P, before = corrected(a, C.as_matrix(), filter)
    turn = lambda x: Rotation.from_rotvec(x)
    applied = Rotation.from_matrix(found) * C.inv()
    c = applied.as_rotvec()
    left = lambda x: (turn(c + x) * applied.inv()).as_rotvec()
    J = np.stack([(left(h * x) - left(-h * x)) / (2 * h) for x in np.eye(3)], axis=1)
    exact = J @ before[6:9, 6:9] @ J.T
    off = np.linalg.norm(P[6:9, 6:9] - exact)
    assert off < 0.02 * np.linalg.norm(before[6:9, 6:9] - exact)


@pytest.mark.short
def test_a_fix_that_is_rejected_changes_nothing():
    recording, begin = every_kind(1.0)
    far = replace(recording.sources[1], y=recording.sources[1].y + 50, gate=11.0)
    with_it, without = (
        sd.fuse(
            replace(recording, sources=(*others, *recording.sources[2:])),
            "mekf",
            start=begin,
            noise=NOISE,
            covariance=True,
        )
        for others in ((far,), ())
    )
    assert with_it.counts()["GNSS velocity"] == (0, 1)
    assert np.array_equal(with_it.covariance, without.covariance) and np.array_equal(
        with_it.trajectory.q_nb, without.trajectory.q_nb
    )


# ---- against the closed loop


def exact(motion, seconds, rate, *sources):
    """Recording of an IMU and of sources without errors; each source is (kind, rate, deviation,
    model of the truth, parameters)."""
    t = np.arange(round(seconds * rate) + 1) / rate
    truth, made = sample(motion, t), []
    for kind, hertz, deviation, model, parameters in sources:
        rows = np.arange(1, round(seconds * hertz) + 1) * round(rate / hertz)
        y = np.array([model(truth, k) for k in rows])
        made.append(Source(kind, t[rows], y, np.full(y.shape, deviation), parameters, gate=np.inf))
    return Recording(increments(motion, t), tuple(made), truth, {"grade": "consumer"})


def aside(recording, error, deviation):
    """The InitialState that errs by `error` in the fifteen states, true - start."""
    truth, x = recording.reference, np.array(error)
    C = Rotation.from_rotvec(-x[6:9]) * truth.rotation[0]
    return InitialState(
        0.0,
        tuple(displace_lla(truth.lla[0], -x[:3])),
        tuple(truth.v_n[0] - x[3:6]),
        tuple(C.as_euler("ZYX")[::-1]),
        tuple(-x[9:12]),
        tuple(-x[12:15]),
        tuple(deviation),
    )


def apart(recording, scale):
    """(state differences between mekf and closed loop in standard deviations, attitude
    difference, sum of the attitude corrections, rad)."""
    deviation = np.r_[[3.0] * 3, [0.5] * 3, 0.08, 0.08, 0.2, [0.05] * 3, [2e-3] * 3]
    begin = aside(
        recording,
        scale * deviation * np.r_[1, -1, 1, 1, 1, -1, 1, -1, 1, 1, -1, 1, -1, 1, 1],
        deviation,
    )
    a, b = (sd.fuse(recording, name, start=begin, noise=NOISE) for name in ("mekf", "closed-loop"))
    between = (a.trajectory.rotation * b.trajectory.rotation.inv()).as_rotvec()
    state = np.c_[
        displacement(a.trajectory.lla, b.trajectory.lla),
        a.trajectory.v_n - b.trajectory.v_n,
        between,
        a.b_a - b.b_a,
        a.b_g - b.b_g,
    ]
    corrections = (
        sum(
            np.linalg.norm(
                np.diff(sd.errors(s, recording.reference).attitude, axis=0), axis=1
            ).sum()
            for s in (a, b)
        )
        / 2
    )
    return (
        np.abs(state / b.trajectory.std).max(axis=0),
        np.linalg.norm(between, axis=1).max(),
        corrections,
    )


@pytest.mark.short
def test_it_agrees_with_the_closed_loop_to_second_order():
    """What is left is of third order: a Gibbs vector c differs by |c|^3/12, and so does what P
    turns by."""
    recording = exact(
        turning(),
        10.0,
        20.0,
        ("position", 1, 1.0, lambda truth, k: truth.lla[k], ()),
        ("velocity", 1, 0.1, lambda truth, k: truth.v_n[k], ()),
        (
            "magnetic-field",
            4,
            5e-7,
            lambda truth, k: truth.rotation[k].as_matrix().T @ FIELD,
            tuple(FIELD),
        ),
    )
    state, attitude, corrections = zip(*(apart(recording, scale) for scale in (0.2, 0.1, 0.05)))
    for difference, total in zip(attitude, corrections):
        assert 1e-5 * total**3 < difference < total**3 / 6
    for coarse, fine in (
        (attitude[0], attitude[1]),
        (attitude[1], attitude[2]),
        (state[0].max(), state[1].max()),
        (state[1].max(), state[2].max()),
    ):
        assert 6.0 < coarse / fine < 11.0  # of third order: by 8


# ---- heading 180 deg


def heading_errors(heading, off):
    """Errors of the heading (rad) of a body at rest with a compass at 5 Hz and exact positions,
    which begins `off` (deg) beside it."""
    still = exact(
        static(PLACE, (0.1, -0.2, heading * DEG)),
        8.0,
        20.0,
        ("position", 1, 1.0, lambda truth, k: truth.lla[k], ()),
        ("heading", 5, 0.02, lambda truth, k: [truth.rph[k, 2]], ()),
    )
    deviation = np.r_[[1.0] * 3, [0.1] * 3, 0.01, 0.01, 0.5, [1e-2] * 3, [1e-4] * 3]
    begin = aside(still, np.r_[np.zeros(6), 0, 0, off * DEG, np.zeros(6)], deviation)
    return sd.errors(sd.fuse(still, "mekf", start=begin, noise=NOISE), still.reference).attitude[
        :, 2
    ]


@pytest.mark.short
@pytest.mark.parametrize("off", [-25.0, 1.0, 25.0])
@pytest.mark.parametrize("heading", [90.0, 179.999, 180.0, -155.0, -90.0])
def test_a_compass_converges_at_every_heading_as_at_north(heading, off):
    """The Earth's rate alone tells one heading from another: 7e-5 rad/s over 8 s, less what the
    compass corrects."""
    found, north = heading_errors(heading, off), heading_errors(0.0, off)
    np.testing.assert_allclose(found, north, atol=2e-5)
    assert (
        abs(north[2]) == pytest.approx(abs(off) * DEG, rel=0.01)
        and abs(north[-1]) < 0.01 * abs(off) * DEG
    )


# ---- every sensor at its own rate


def hover():
    """In one place but for some centimetres, at heading 100 deg."""
    wave = lambda t, period: np.sin(2 * np.pi * t / period)
    return Motion(
        "hover",
        PLACE,
        lambda t: (0.02 * wave(t, 11.0), 0.02 * wave(t, 17.0), 0.02 * wave(t, 13.0)),
        lambda t: (0.02 * np.sin(t), 0.03 * np.cos(t), 100 * DEG + 0.05 * np.sin(0.3 * t)),
    )


SPEC = ImuSpec(
    "white MEMS", Triad(noise=3e-4, turn_on_bias=1e-3), Triad(noise=3e-3, turn_on_bias=2e-2)
)
DEVIATION = np.r_[[2.0] * 3, [0.1] * 3, np.radians([0.5, 0.5, 8.0]), [2e-2] * 3, [1e-3] * 3]


@pytest.fixture(scope="module")
def hovering():
    """(recording, start) of 30 s: position at 1 Hz but for 10 s, field at 100 Hz, gravity at 10
    Hz, pressure at 50 Hz."""
    t = np.arange(3001) / 100.0
    truth, (of_imu, of_start, of_fix, of_field, of_baro) = (
        sample(hover(), t),
        np.random.default_rng(9).spawn(5),
    )
    imu, b_a, b_g = SPEC.corrupt(increments(hover(), t), of_imu)
    at = np.r_[100:1001:100, 2100:3001:100]
    position = Source(
        "position",
        t[at],
        displace_lla(truth.lla[at], of_fix.normal(0, 1.0, (len(at), 3))),
        np.ones((len(at), 3)),
    )
    field = Magnetometer(rate=100.0, std=1e-6, field=tuple(FIELD)).measure(truth, of_field)
    baro = Barometer(rate=50.0, std=3.0, bias=40.0).measure(truth, of_baro)
    gravity = Source("gravity", t[10::10], np.zeros((300, 3)), np.full((300, 3), 0.1))
    sources = tuple(replace(a, gate=np.inf) for a in (position, field, baro, gravity))
    begin = draw_start(truth, DEVIATION, of_start, biases=(b_a[0], b_g[0]))
    return Recording(imu, sources, truth, {"grade": "consumer"}), begin


def test_whatever_arrives_between_position_fixes_is_used(hovering):
    recording, begin = hovering
    solution = sd.fuse(recording, "mekf", start=begin, noise=SPEC.noise())
    e, used = sd.errors(solution, recording.reference), solution.innovations
    assert solution.counts() == {
        "position": (20, 0),
        "magnetometer": (3000, 0),
        "barometer": (1500, 0),
        "gravity": (300, 0),
    }
    assert (
        np.isin(np.round(used.t[used.source > 0], 6), recording.sources[0].t, invert=True).sum()
        == 2980 + 1480 + 280
    )
    off = np.c_[e.position, e.velocity, e.attitude] / e.std[:, :9]
    assert np.abs(off[100:]).max() < 4.5 and np.sqrt(np.mean(off[100:] ** 2)) < 1.5
    horizontal = e.std[:, :2].max(axis=1)
    # dead reckoning from 10 to 21 s
    assert horizontal[2090] > 2 * max(horizontal[1000], horizontal[2900])
    # but for height and heading
    assert e.std[2090, 2] < 1.5 * e.std[1000, 2] and e.std[2090, 8] < 1.2 * e.std[1000, 8]


def test_a_field_between_position_fixes_improves_the_heading(hovering):
    """Against the field at the times of positions alone, which is what the published routine
    makes of it."""
    recording, begin = hovering
    position, field, *others = recording.sources
    rare = replace(
        recording,
        sources=(position, field._where(np.isin(np.round(field.t, 6), position.t)), *others),
    )
    ours, printed = (
        sd.errors(sd.fuse(each, "mekf", start=begin, noise=SPEC.noise()), recording.reference)
        for each in (recording, rare)
    )
    assert (ours.std[200:, 8] < 0.5 * printed.std[200:, 8]).all()
    assert np.sqrt(np.mean(ours.rph[200:, 2] ** 2)) < 0.5 * np.sqrt(
        np.mean(printed.rph[200:, 2] ** 2)
    )
