"""attitude-mekf against a dense filter written from its equations; mahony against the published
observer, integrated, and its linear poles."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from strapdown import aiding
from strapdown.core.loop.contract import InitialState, Noise, compile_kernel
from strapdown.core.mathematics.source import new_source
from strapdown.filters.attitude.attitude_error_state import SIX
from strapdown.filters.attitude.attitude_mekf import ATTITUDE_MEKF, GRAVITY, MAGNETOMETERS
from strapdown.filters.attitude.mahony import MAHONY, poles

FIELD, RATE, LAT, G = np.array([21e-6, 1.6e-6, 43.9e-6]), 7.292115e-5, 0.8, 9.7803253359
NOISE = Noise(
    gyro=3e-3, accel=0.05, gyro_bias=1e-4, accel_bias=0.0, gyro_decay=1 / 100, accel_decay=0.0
)
WHITE = dict(
    low_pass=0.0, acceleration=0.0, rate_error=0.0, heading=0.0, timing=0.0, disturbance=0.0
)
EARTH = np.array([RATE * math.cos(LAT), 0.0, -RATE * math.sin(LAT)])
UP, DOWN = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
# roll, pitch, heading, deg
ATTITUDES = {
    "level": (0, 0, 20),
    "south": (3, -5, 180),
    "banked": (-60, 20, 250),
    "steep": (10, 88, -90),
    "upside down": (179.9, 1, 135),
}


def rotvec(v):
    return Rotation.from_rotvec(v).as_matrix()


def skew(x):
    return np.cross(np.eye(3), x)


def begun(
    filter,
    rph,
    std=(0.3, 0.2, 0.5, 0.02, 0.03, 0.01),
    b_g=(0.01, -0.02, 0.03),
    noise=NOISE,
    **options,
):
    """A belief of `filter`; rph in deg, std of attitude and gyro bias."""
    for kernel in (filter.predict, filter.correct):
        compile_kernel(kernel)
    all_std = (1.0,) * 6 + tuple(std[:3]) + (1.0,) * 3 + tuple(std[3:])
    return filter.start(
        InitialState(
            0.0, (LAT, 0.2, 500.0), (0.0,) * 3, tuple(np.radians(rph)), (0.0,) * 3, b_g, all_std
        ),
        noise,
        **options,
    )


def correct(filter, belief, kind, y, std, gate=math.inf, field=FIELD):
    """(NIS, innovation) of one fix."""
    sensor = aiding.find(kind)
    compile_kernel(sensor.observe)
    innovation, source = np.zeros(12), new_source()
    source.parameters[:3] = field
    y, std = (np.r_[value, np.full(3 - np.size(value), np.nan)].astype(float) for value in (y, std))
    return filter.correct(
        belief, y, std, aiding.number(sensor.name), sensor.observe, source, gate, innovation
    ), innovation[:3]


def correlated(belief, seed):
    """Give the belief a full covariance of the six states with the standard deviations it has."""
    rng = np.random.default_rng(seed)
    B = np.linalg.cholesky(np.eye(6) + np.ones((6, 6))) @ rng.standard_normal((6, 12))
    B *= (np.sqrt(np.diag(belief.P)[list(SIX)]) / np.linalg.norm(B, axis=1))[:, None]
    belief.P[np.ix_(SIX, SIX)] = B @ B.T
    return belief


class Twin:
    """The six-state filter with dense matrices: true C = exp(theta) C, true b = b + db; white
    noise alone."""

    def __init__(self, belief):
        self.C, self.b, self.P = (
            belief.C_nb.copy(),
            belief.b_g.copy(),
            belief.P[np.ix_(SIX, SIX)].copy(),
        )

    def predict(self, u, dt):
        r, f = u[:3] - self.b * dt, u[3:] / dt
        F = np.block([[-skew(EARTH), -self.C], [np.zeros((3, 3)), -NOISE.gyro_decay * np.eye(3)]])
        Phi = expm(F * dt)
        self.P = (
            Phi @ self.P @ Phi.T
            + np.diag(np.r_[np.full(3, NOISE.gyro**2), np.full(3, NOISE.gyro_bias**2)]) * dt
        )
        self.C = rotvec(-EARTH * dt) @ self.C @ rotvec(r)
        self.b = self.b * math.exp(-NOISE.gyro_decay * dt)
        # of what a vector at rest in n looks like over the sample
        mean = expm(np.block([[-skew(r), np.eye(3)], [np.zeros((3, 6))]]))[:3, 3:]
        f = self.C @ rotvec(-r) @ np.linalg.solve(mean, f)
        if np.linalg.norm(f) < 0.5:
            return
        axis, angle = np.cross(f, UP), math.acos(np.clip(-f[2] / np.linalg.norm(f), -1, 1))
        axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) else np.array([1.0, 0, 0])
        self.correct(np.eye(2, 3), (angle * axis)[:2], (NOISE.accel / G) ** 2 / dt * np.eye(2))

    def field(self, y, std):
        azimuth = lambda theta: math.atan2(*(rotvec(theta) @ self.C @ y)[[1, 0]])
        e = (math.atan2(FIELD[1], FIELD[0]) - azimuth(np.zeros(3)) + math.pi) % (
            2 * math.pi
        ) - math.pi
        wrapped = lambda angle: (angle + math.pi) % (2 * math.pi) - math.pi
        H = np.array(
            [[wrapped(azimuth(1e-6 * axis) - azimuth(-1e-6 * axis)) / 2e-6 for axis in np.eye(3)]]
        )
        return e, self.correct(
            H, np.array([e]), np.array([[std**2 / np.sum((self.C @ y)[:2] ** 2)]])
        )

    def correct(self, H, e, R):
        H = np.c_[H, np.zeros_like(H)]
        S = H @ self.P @ H.T + R
        K = self.P @ H.T @ np.linalg.inv(S)
        keep = np.eye(6) - K @ H
        self.P = keep @ self.P @ keep.T + K @ R @ K.T
        self.C, self.b = rotvec((K @ e)[:3]) @ self.C, self.b + (K @ e)[3:]
        return e @ np.linalg.solve(S, e)

    def compare(self, belief, tolerance):
        """Differences in standard deviations."""
        std = np.sqrt(np.diag(self.P))
        theta = Rotation.from_matrix(self.C @ belief.C_nb.T).as_rotvec()
        assert np.abs(np.r_[theta, self.b - belief.b_g] / std).max() < tolerance
        assert np.abs((belief.P[np.ix_(SIX, SIX)] - self.P) / np.outer(std, std)).max() < tolerance
        np.testing.assert_array_equal(belief.P, belief.P.T)
        assert (
            not np.delete(belief.P, SIX, axis=0).any()
            and not np.delete(belief.P, SIX, axis=1).any()
        )
        np.testing.assert_allclose(belief.C_nb @ belief.C_nb.T, np.eye(3), atol=1e-12)


@pytest.mark.short
@pytest.mark.parametrize("dt", [1e-5, 0.004, 0.01])
@pytest.mark.parametrize("name", ATTITUDES)
def test_prediction_and_level_are_those_of_the_dense_filter(name, dt):
    rng = np.random.default_rng(1)
    for seed in range(5):
        belief = correlated(begun(ATTITUDE_MEKF, ATTITUDES[name], **WHITE), seed)
        twin, u = (
            Twin(belief),
            np.r_[rng.standard_normal(3) * 2, rng.standard_normal(3) * 3 + [0, 0, -9.8]] * dt,
        )
        twin.predict(u, dt)
        ATTITUDE_MEKF.predict(belief, u, dt, NOISE)
        twin.compare(belief, 1e-4)


@pytest.mark.short
@pytest.mark.parametrize("name", ATTITUDES)
def test_the_field_is_used_as_by_the_dense_filter(name):
    """Fields from all sides of the body; the Jacobian is the numeric one in all three errors."""
    rng = np.random.default_rng(2)
    for seed in range(20):
        belief = correlated(begun(ATTITUDE_MEKF, ATTITUDES[name], **WHITE), seed)
        twin, y = Twin(belief), rng.standard_normal(3) * 30e-6
        e, nis = twin.field(y, 1e-6)
        found, innovation = correct(ATTITUDE_MEKF, belief, "magnetic-field", y, np.full(3, 1e-6))
        assert (found, innovation[0]) == (
            pytest.approx(nis, rel=1e-6),
            pytest.approx(e, abs=1e-12),
        ) and np.isnan(innovation[1:]).all()
        twin.compare(belief, 1e-6)


@pytest.mark.short
def test_over_many_irregular_samples_the_filters_stay_together():
    rng, belief = (
        np.random.default_rng(3),
        begun(ATTITUDE_MEKF, ATTITUDES["south"], std=(0.05, 0.05, 0.1, 0.02, 0.02, 0.02), **WHITE),
    )
    twin, C = Twin(belief), rotvec([0.1, 0, 0]) @ belief.C_nb
    for step in range(400):
        dt = rng.uniform(1e-3, 0.02)
        r = np.array([1.0, 2.0 * math.sin(step / 30), -1.5]) * dt
        u = np.r_[
            r + [0.02 * dt, 0, 0],
            (rotvec(-r / 2) @ (C.T @ UP) * G + rng.standard_normal(3) * 0.05) * dt,
        ]
        C = C @ rotvec(r)
        twin.predict(u, dt)
        ATTITUDE_MEKF.predict(belief, u, dt, NOISE)
        if step % 3 == 0:
            y = C.T @ FIELD + rng.standard_normal(3) * 1e-6
            twin.field(y, 1e-6)
            correct(ATTITUDE_MEKF, belief, "magnetic-field", y, np.full(3, 1e-6))
    twin.compare(belief, 0.02)  # what second order leaves in 400 steps
    assert np.linalg.eigvalsh(belief.P[np.ix_(SIX, SIX)]).min() > 0


def test_the_covariance_keeps_its_sign_over_an_hour():
    belief = begun(ATTITUDE_MEKF, (0, 0, 30), std=(3.0, 3.0, 3.0, 1.0, 1.0, 1.0), **WHITE)
    u = np.r_[0.01, -0.02, 0.015, 0, 0, -0.098]
    smallest = []
    for k in range(360_000):
        ATTITUDE_MEKF.predict(belief, u, 0.01, NOISE)
        if k % 60_000 < 3:
            smallest.append(np.linalg.eigvalsh(belief.P[np.ix_(SIX, SIX)]).min())
    assert min(smallest) > 0 and np.isfinite(belief.C_nb).all()
    np.testing.assert_array_equal(belief.P, belief.P.T)


@pytest.mark.short
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
@pytest.mark.parametrize(
    "y", [(math.nan, 2e-5, 4e-5), (2e-5, math.nan, 4e-5), (0, 0, 0), (math.nan,) * 3], ids=str
)
def test_a_field_without_a_direction_is_not_measured(filter, y):
    belief = begun(filter, (3, 4, 50))
    filter.predict(belief, np.array([0, 0, 0, 0, 0, -0.098]), 0.01, NOISE)
    before = [part.copy() for part in belief[:8]]
    nis, innovation = correct(filter, belief, "magnetic-field", y, np.full(3, 1e-6))
    assert math.isnan(nis) and np.isnan(innovation).all()
    assert all(np.array_equal(part, was) for part, was in zip(belief, before))
    # at a magnetic pole
    assert math.isnan(
        correct(filter, belief, "magnetic-field", FIELD, np.full(3, 1e-6), field=(0.0, 0.0, 5e-5))[
            1
        ][0]
    )
    assert math.isfinite(correct(filter, belief, "magnetic-field", FIELD, np.full(3, 1e-6))[1][0])


@pytest.mark.short
def test_a_vertical_field_tells_no_heading():
    """Its direction is noise, and the filter knows; heading keeps its standard deviation."""
    belief = begun(ATTITUDE_MEKF, (0, 0, 50), std=(1e-3, 1e-3, 0.1, 0.01, 0.01, 0.01), **WHITE)
    before = belief.P[8, 8]
    correct(ATTITUDE_MEKF, belief, "magnetic-field", (1e-9, -1e-9, 48e-6), np.full(3, 1e-6))
    assert belief.P[8, 8] == pytest.approx(before, rel=1e-2) and np.isfinite(belief.C_nb).all()


@pytest.mark.short
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
def test_free_fall_has_no_vertical_and_no_time_changes_nothing(filter):
    belief = begun(filter, (30, 40, 50), b_g=(0.0, 0.0, 0.0))
    before = [part.copy() for part in belief]
    filter.predict(belief, np.full(6, 0.3), 0.0, NOISE)
    # where the smoother is told so
    assert all(
        np.array_equal(part, was)
        for name, part, was in zip(belief._fields, belief, before)
        if name != "workspace"
    )
    C, r = belief.C_nb.copy(), np.array([0.02, -0.01, 0.03])
    filter.predict(belief, np.r_[r, 1e-3, -1e-3, 2e-3], 0.01, NOISE)
    np.testing.assert_allclose(belief.C_nb, rotvec(-EARTH * 0.01) @ C @ rotvec(r), atol=1e-12)
    assert not belief.b_g.any()


@pytest.mark.short
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
def test_the_first_sample_is_the_whole_vertical(filter):
    """Whatever the low-pass: nothing was there before it."""
    belief = begun(filter, (10, 0, 0), b_g=(0.0, 0.0, 0.0))
    f = np.array([1.0, -2.0, -9.5])
    filter.predict(belief, np.r_[np.zeros(3), f * 0.01], 0.01, NOISE)
    np.testing.assert_allclose(belief.f, f, rtol=1e-12)


HEADINGS = range(0, 360, 10)


@pytest.mark.short
@pytest.mark.parametrize("kind", ["magnetic-field", "heading"])
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
def test_what_is_left_of_a_heading_error_is_the_same_at_every_heading(filter, kind):
    """Errata of the printed compass Jacobian, which vanishes at 180 deg: 20 deg off, ten fixes,
    at level and tilted."""
    for roll, pitch in ((0, 0), (25, -40)):
        left = []
        for heading in HEADINGS:
            belief = begun(
                filter,
                (roll, pitch, heading),
                b_g=(0.0,) * 3,
                **({"k1": 0.5, "k2": 1.0, "k3": 1.0} if filter is MAHONY else WHITE),
            )
            C = rotvec([0, 0, math.radians(20)]) @ belief.C_nb
            for _ in range(10):
                filter.predict(belief, np.r_[np.zeros(3), C.T @ UP * G * 0.1], 0.1, NOISE)
                y, std = (
                    (C.T @ FIELD, np.full(3, 3e-6))
                    if kind == "magnetic-field"
                    else (math.atan2(C[1, 0], C[0, 0]), 0.1)
                )
                correct(filter, belief, kind, y, std)
            left.append(Rotation.from_matrix(C @ belief.C_nb.T).magnitude())
        assert max(left) < math.radians(9) and np.ptp(left) < 1e-4


def published(body, bias, k1, k2, ki, R0, T):
    """(R, b) at T of q' = T(w - b + sigma) q, b' = -ki sigma, sigma = sum of k v x R' v0, under
    the rate w = turn + bias; the turning Earth besides."""
    north = np.r_[FIELD[:2], 0] / math.hypot(*FIELD[:2])

    def rate(t, x):
        R, b = x[:9].reshape(3, 3), x[9:]
        v1, m = body(t).T @ UP, body(t).T @ FIELD
        v2 = m - (m @ v1) * v1
        sigma = k1 * np.cross(v1, R.T @ UP) + k2 * np.cross(v2 / np.linalg.norm(v2), R.T @ north)
        return np.r_[(R @ skew(TURN + bias - b + sigma) - skew(EARTH) @ R).ravel(), -ki * sigma]

    x = solve_ivp(rate, (0, T), np.r_[R0.ravel(), np.zeros(3)], rtol=1e-9, atol=1e-11).y[:, -1]
    return x[:9].reshape(3, 3), x[9:]


TURN = np.array([0.4, -0.7, 0.5])  # rad/s, body


@pytest.mark.parametrize(
    "k1, k2, ki",
    [(1.0, 1.0, 0.2), (0.5, 0.3, 0.05), (2.0, 0.5, 0.0), (0.0, 1.0, 0.1), (1.0, 0.0, 0.1)],
)
def test_without_low_pass_the_observer_is_the_published_one(k1, k2, ki):
    """Ten seconds from 60 deg off, with a gyro bias: the difference vanishes with the sampling
    interval."""
    T, bias, before = 10.0, np.array([0.02, -0.03, 0.01]), rotvec([0.2, -0.1, 2.0])
    body = lambda t: rotvec(-EARTH * t) @ before @ rotvec(TURN * t)
    off = rotvec(np.radians(60) * np.array([0.6, 0.48, 0.64]))
    R, b = published(body, bias, k1, k2, ki, off @ before, T)
    found = []
    for dt in (0.01, 0.005):
        h, p, r = Rotation.from_matrix(off @ before).as_euler("ZYX", degrees=True)
        belief = begun(
            MAHONY,
            (r, p, h),
            b_g=(0.0,) * 3,
            noise=NOISE._replace(gyro_decay=0.0),
            k1=k1,
            k2=k2,
            k3=0.0,
            ki=ki,
            low_pass=0.0,
        )
        for k in range(round(T / dt)):
            MAHONY.predict(
                belief,
                np.r_[(TURN + bias) * dt, body((k + 0.5) * dt).T @ UP * G * dt],
                dt,
                NOISE._replace(gyro_decay=0.0),
            )
            correct(
                MAHONY, belief, "magnetic-field", body((k + 1) * dt).T @ FIELD, np.full(3, 1e-6)
            )
        found.append(np.r_[Rotation.from_matrix(R @ belief.C_nb.T).as_rotvec(), b - belief.b_g])
    coarse, fine = (np.abs(each).max() for each in found)
    assert fine < 2e-3 and (fine < 1e-6 or 1.7 < coarse / fine < 2.3)


def closed_loop(belief, step, places, dt):
    """Poles (1/s) of `step` as a map of small changes of the places [(array, index)], attitude
    changes being rotations in n."""

    def state(change):
        b = belief._replace(
            **{
                name: getattr(belief, name).copy()
                for name in ("C_nb", "f", "b_g", "workspace", "omega", "P")
            }
        )
        for (name, index), value in zip(places, change):
            if name == "C_nb":
                b.C_nb[:] = rotvec(value * np.eye(3)[index]) @ b.C_nb
            else:
                getattr(b, name)[index] += value
        step(b)
        return np.array(
            [
                Rotation.from_matrix(b.C_nb).as_rotvec()[index]
                if name == "C_nb"
                else getattr(b, name)[index]
                for name, index in places
            ]
        )

    change = 1e-5 * np.eye(len(places))
    M = np.column_stack([(state(row) - state(-row)) / 2e-5 for row in change])
    return np.log(np.linalg.eigvals(M).astype(complex)) / dt


@pytest.mark.short
@pytest.mark.parametrize(
    "k, ki, low_pass", [(0.5, 0.005, 2.0), (1.0, 0.2, 0.5), (0.3, 0.02, 5.0), (2.0, 0.4, 0.0)]
)
def test_poles_are_those_of_the_closed_loop(k, ki, low_pass):
    from strapdown.filters.attitude.mahony import SECONDS

    dt, noise = 1e-3, NOISE._replace(gyro_decay=0.0)
    level, still = np.array([0, 0, -G]), np.r_[EARTH, 0, 0, -G] * dt
    belief = begun(
        MAHONY, (0, 0, 0), b_g=(0.0,) * 3, noise=noise, k1=k, k2=k, k3=k, ki=ki, low_pass=low_pass
    )
    belief.f[:], belief.workspace[SECONDS] = level, 1e9
    places = [("C_nb", 0), ("b_g", 0)] + ([("f", 1)] if low_pass else [])
    found = closed_loop(belief, lambda b: MAHONY.predict(b, still, dt, noise), places, dt)
    np.testing.assert_allclose(
        np.sort_complex(found), np.sort_complex(poles(k, ki, low_pass)), rtol=0.01
    )
    for kind, y in (("magnetic-field", FIELD), ("heading", 0.0)):

        def step(b):
            MAHONY.predict(b, still, dt, noise)
            correct(MAHONY, b, kind, y, 0.01 * np.ones(np.size(y)))

        found = closed_loop(belief, step, [("C_nb", 2), ("b_g", 2)], dt)
        np.testing.assert_allclose(
            np.sort_complex(found), np.sort_complex(poles(k, ki, 0.0)), rtol=0.01
        )


# gains: what of 10 deg of tilt and of heading error is left after 20 s of field and compass
COMBINATIONS = {
    "force": (dict(k1=1.0), True, False, False),
    "field": (dict(k2=1.0), True, True, False),
    "compass": (dict(k3=1.0), False, True, True),
    "force and field": (dict(k1=1.0, k2=1.0), True, True, False),
    "force and compass": (dict(k1=1.0, k3=1.0), True, True, True),
    "all": (dict(k1=1.0, k2=1.0, k3=1.0), True, True, True),
}


@pytest.mark.parametrize("name", COMBINATIONS)
def test_each_combination_of_directions_corrects_what_it_sees(name):
    """Field and compass contradict each other by 0.2 rad where only one is used; without k1 the
    field alone levels about one axis."""
    gains, levels, heads, compass = COMBINATIONS[name]
    belief = begun(
        MAHONY,
        (0, 0, 0),
        b_g=(0.0,) * 3,
        **{"k1": 0.0, "k2": 0.0, "k3": 0.0, "ki": 0.0, "low_pass": 0.0} | gains,
    )
    # of the truth: the field, which points north and down, sees this tilt
    C = rotvec([0.0, 0.17, 0]) @ rotvec([0, 0, 0.17]) @ belief.C_nb
    both = "k2" in gains and "k3" in gains
    psi = math.atan2(C[1, 0], C[0, 0])
    for _ in range(2000):
        MAHONY.predict(belief, np.r_[C.T @ EARTH, C.T @ UP * G] * 0.01, 0.01, NOISE)
        correct(
            MAHONY,
            belief,
            "magnetic-field",
            C.T @ FIELD if not compass or both else C.T @ rotvec([0, 0, 0.2]) @ FIELD,
            np.full(3, 1e-6),
        )
        correct(MAHONY, belief, "heading", psi if compass else psi + 0.2, 0.01)
    theta = Rotation.from_matrix(C @ belief.C_nb.T).as_rotvec()
    heading = psi - math.atan2(belief.C_nb[1, 0], belief.C_nb[0, 0])
    assert (abs(theta[1]) < 0.01) == levels and (abs(heading) < 0.01) == heads, (theta, heading)


@pytest.mark.short
@pytest.mark.parametrize(
    "kind, rph",
    [
        ("level", (0, 0, 20)),
        ("level", (-60, 20, 250)),
        ("heading", (0, 0, 20)),
        ("heading", (0, 0, 200)),
    ],
)
def test_the_observers_covariance_is_what_its_kernels_do_to_small_errors(kind, rph):
    """P of two beliefs apart by P0 stays apart by M P0 M', M the numeric derivative of all that
    the kernels do to a belief."""
    gains = dict(k1=0.8, k2=0.7, k3=0.6, ki=0.2, low_pass=0.0)
    own = dict(b_g=(0.0,) * 3, noise=NOISE, **gains)
    belief, dt = correlated(begun(MAHONY, rph, **own), 7), 0.2
    C = belief.C_nb.copy()
    u = np.r_[C.T @ EARTH * dt, C.T @ UP * belief.workspace[GRAVITY] * dt]

    def step(b):
        MAHONY.predict(b, u, dt, NOISE)
        if kind == "heading":
            correct(MAHONY, b, kind, math.radians(rph[2]), 0.03)

    def after(change, P):
        b = belief._replace(
            **{name: np.array(getattr(belief, name)) for name in belief._fields if name != "P"},
            P=P.copy(),
        )
        b.C_nb[:] = rotvec(change[:3]) @ b.C_nb
        b.b_g[:] += change[3:]
        step(b)
        return b

    zero = np.zeros_like(belief.P)
    at = after(np.zeros(6), belief.P)
    error = lambda b: np.r_[Rotation.from_matrix(b.C_nb @ at.C_nb.T).as_rotvec(), b.b_g - at.b_g]
    M = np.column_stack(
        [(error(after(e, zero)) - error(after(-e, zero))) / 2e-5 for e in 1e-5 * np.eye(6)]
    )
    six = np.ix_(SIX, SIX)
    found = at.P[six] - after(np.zeros(6), zero).P[six]
    expected = M @ belief.P[six] @ M.T
    scale = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(scale, scale)).max() < 0.01


@pytest.mark.short
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
def test_more_magnetometers_than_books_share_the_last_ones(filter):
    found = []
    for number in (MAGNETOMETERS - 1, MAGNETOMETERS, MAGNETOMETERS + 5):
        belief = begun(filter, (0, 0, 30), b_g=(0.0,) * 3)
        filter.predict(belief, np.r_[np.zeros(3), belief.C_nb.T @ UP * G * 0.1], 0.1, NOISE)
        source = new_source()
        source.parameters[:3], source.of_kind = FIELD, number
        sensor, innovation = aiding.find("magnetic-field"), np.zeros(12)
        compile_kernel(sensor.observe)
        filter.correct(
            belief,
            belief.C_nb.T @ FIELD,
            np.full(3, 1e-6),
            aiding.number(sensor.name),
            sensor.observe,
            source,
            math.inf,
            innovation,
        )
        found.append(belief.workspace.copy())
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


@pytest.mark.short
@pytest.mark.parametrize("filter", [ATTITUDE_MEKF, MAHONY], ids=lambda filter: filter.name)
@pytest.mark.parametrize("field", [(21e-6, 0.0, 44e-6), (0.0, 21e-6, 44e-6)], ids=str)
def test_a_field_along_an_axis_has_an_azimuth(filter, field):
    belief = begun(filter, (3, 4, 50), b_g=(0.0,) * 3)
    filter.predict(belief, np.r_[np.zeros(3), belief.C_nb.T @ UP * G * 0.01], 0.01, NOISE)
    turned = rotvec([0.0, 0.0, 0.1])
    y = belief.C_nb.T @ turned.T @ field  # as of a body turned to the right by 0.1 rad more
    _, innovation = correct(filter, belief, "magnetic-field", y, np.full(3, 1e-6), field=field)
    assert innovation[0] == pytest.approx(0.1, abs=1e-4)
