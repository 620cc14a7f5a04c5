"""Fixed-gain observer: sampled poles at any rate, Lyapunov's covariance, commuting with yaw, two
kinds of fixes together, refused gains."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from recordings import ahrs, flight, start
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding, filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState, Kind, Noise, compile_kernel
from strapdown.core.mathematics.mechanization import stationary_increments
from strapdown.core.mathematics.source import new_source
from strapdown.filters.ahrs_aided.fixed_gain import fastest_turn, poles
from strapdown.geometry.geodesy import displace_lla, displacement

pytestmark = pytest.mark.short
NOISE = Noise(1e-3, 1e-2, 1e-5, 1e-4, 0.0, 0.0)
LLA, RPH = np.array([0.8, 0.1, 500.0]), (0.1, -0.2, 0.7)
KINDS = {"position": Kind.POSITION, "velocity": Kind.VELOCITY, "altitude": Kind.ALTITUDE}
DEFAULT = (0.7, 0.14, 0.008)


class Standing:
    """An observer at rest whose error of position, velocity and bias (m, m/s, m/s^2, in n) is
    set and read; the truth stands still."""

    def __init__(self, **gains):
        self.filter = filters.find("fixed-gain")
        for kernel in (
            self.filter.predict,
            self.filter.correct,
            *(aiding.find(kind).observe for kind in (*KINDS, "attitude")),
        ):
            compile_kernel(kernel)
        self.belief = self.filter.start(
            InitialState(0.0, tuple(LLA), (0.0,) * 3, RPH, (0.0,) * 3, (0.0,) * 3, (1.0,) * 15),
            NOISE,
            **gains,
        )
        self.C, self.u = self.belief.C_nb.copy(), np.zeros(6)

    def set(self, error):
        b = self.belief
        b.lla[:], b.v_n[:], b.b_a[:] = displace_lla(LLA, -error[0]), -error[1], -self.C.T @ error[2]

    @property
    def error(self):
        return np.array(
            [displacement(LLA, self.belief.lla), -self.belief.v_n, -self.C @ self.belief.b_a]
        )

    def wait(self, seconds):
        stationary_increments(LLA, np.zeros(3), self.C, seconds, self.u)
        self.filter.predict(self.belief, self.u, seconds, NOISE)

    def fix(self, kind, off=np.zeros(3)):
        y = {
            "position": displace_lla(LLA, off),
            "velocity": off,
            "altitude": np.array([LLA[2] - off[2], np.nan, np.nan]),
        }[kind]
        innovation = np.zeros(12)
        nis = self.filter.correct(
            self.belief,
            y,
            np.ones(3),
            KINDS[kind],
            aiding.find(kind).observe,
            new_source(),
            np.inf,
            innovation,
        )
        assert nis >= 0
        return innovation[:3]


def sampled(observer, steps, axis):
    """The 3 x 3 matrix by which `steps`, [(seconds, kind)], multiply an error on that axis."""
    for (
        seconds,
        kind,
    ) in (
        steps
    ):  # once before, so that the seconds since the last fix of each kind are those of a period
        observer.wait(seconds)
        observer.fix(kind)
    columns = []
    for k in range(3):
        error = np.zeros((3, 3))
        error[k, axis] = (10.0, 1.0, 0.01)[k]
        observer.set(error)
        for seconds, kind in steps:
            observer.wait(seconds)
            observer.fix(kind)
        columns.append(observer.error[:, axis] / error[k, axis])
    return np.column_stack(columns)


@pytest.mark.parametrize("T", [0.1, 1.0, 2.5])
@pytest.mark.parametrize(
    "roots", [(-0.1, -0.2, -0.4), (-0.2, -0.2, -0.2), (-0.1, -0.15 + 0.3j, -0.15 - 0.3j)]
)
def test_sampled_errors_have_the_poles_of_the_continuous_observer(roots, T):
    gains = np.real(np.poly(roots))[1:]
    observer = Standing(
        k1=gains[0], k2=gains[1], k3=gains[2], l1=gains[0], l2=gains[1], l3=gains[2]
    )
    for axis, kind in ((0, "position"), (1, "position"), (2, "position"), (2, "altitude")):
        found = np.poly(sampled(observer, [(T, kind)], axis))
        np.testing.assert_allclose(found, np.real(np.poly(np.exp(np.array(roots) * T))), atol=5e-5)
    np.testing.assert_allclose(np.poly(poles(*gains)), np.poly(roots), atol=1e-12)


@pytest.mark.parametrize("roots", [(-0.1, -0.4), (-0.2 + 0.3j, -0.2 - 0.3j)])
def test_and_of_a_velocity(roots):
    gains = np.real(np.poly(roots))[1:]
    observer = Standing(kv1=gains[0], kv2=gains[1], lv1=gains[0], lv2=gains[1])
    for axis in (0, 2):
        found = sampled(observer, [(1.0, "velocity")], axis)[1:, 1:]
        np.testing.assert_allclose(np.poly(found), np.real(np.poly(np.exp(roots))), atol=2e-5)


def test_without_the_last_gain_the_bias_stands_still():
    observer = Standing(k3=0.0, kv2=0.0)
    for kind in ("position", "velocity"):
        M = sampled(observer, [(1.0, kind)], 0)
        np.testing.assert_allclose(M[2], [0, 0, 1], atol=1e-8)
        settled = np.delete(np.linalg.eigvals(M), np.argmax(np.abs(np.linalg.eigvals(M))))
        assert (np.abs(settled) < 0.95).all() or kind == "velocity"
    none = Standing(kv1=0.0, kv2=0.0)
    none.set(np.eye(3))
    none.wait(1.0)
    before = none.error
    assert (
        np.isfinite(none.fix("velocity")).all()
        and np.abs(none.error - before)[:, :2].max()
        < 1e-8
        < np.abs(none.error - before)[:, 2].max()
    )


@pytest.mark.parametrize("T", [5.0, 60.0])
def test_at_fixes_slower_than_the_poles_it_settles_within_a_few(T):
    """A pole faster than 1/T counts as 1/T."""
    found = np.poly(sampled(Standing(), [(T, "position")], 0))
    # gravity's gradient
    np.testing.assert_allclose(
        found, np.poly(np.exp(np.maximum([-0.1, -0.2, -0.4], -1 / T) * T)), atol=1e-3 + 1e-6 * T**2
    )


def test_both_kinds_of_fixes_together_settle_at_any_rates():
    """From 10 Hz to 0.02 Hz each, at once or with any delay between them; rates that are
    multiples, so that the sampled error is periodic."""
    slowest = {}
    for often, times, delay, first in product(
        (0.1, 1.0, 5.0, 10.0, 50.0), (1, 2, 5), (0.0, 0.3, 0.7, 0.95), ("position", "velocity")
    ):
        second = "velocity" if first == "position" else "position"
        at = sorted(
            [((k + 1) * often, first) for k in range(times)]
            + [((times - 1 + (delay or 1)) * often, second)]
        )
        steps = [
            (max(t - before, 1e-9), kind) for (t, kind), (before, _) in zip(at, [(0.0, ""), *at])
        ]
        rest = times * often - at[-1][0]
        steps[0] = (steps[0][0] + rest, steps[0][1])
        for axis in (0, 2):
            slowest[often, times, delay, first, axis] = -np.log(
                np.abs(np.linalg.eigvals(sampled(Standing(), steps, axis))).max()
            ) / (times * often)
    assert min(slowest.values()) > 0.004, min(slowest, key=slowest.get)
    # the continuous observer: 0.082 1/s
    assert min(rate for (often, *_), rate in slowest.items() if often <= 1) > 0.07
    np.testing.assert_allclose(np.max(poles(*DEFAULT, 0.5, 0.04).real), -0.0822, atol=1e-4)


def test_errors_are_as_large_as_lyapunovs_equation_says():
    """1900 position fixes with white errors of 1 m at 1 Hz: some 150 independent errors per
    axis, so variances within 4 x 7 %."""
    observer, rng = Standing(), np.random.default_rng(8)
    M = sampled(observer, [(1.0, "position")], 0)
    observer.set(np.zeros((3, 3)))
    observer.wait(1.0)
    before = observer.error[:, 0]
    observer.fix("position", np.array([1.0, 0, 0]))
    K = -(observer.error[:, 0] - before)
    expected = np.diag(solve_discrete_lyapunov(M, np.outer(K, K)))
    errors = []
    for _k in range(1900):
        observer.wait(1.0)
        observer.fix("position", rng.standard_normal(3))
        errors.append(observer.error)
    found = np.mean(np.square(errors[60:]), axis=0)
    np.testing.assert_allclose(found / expected[:, None], 1, atol=0.28)
    assert 0.5 < np.sqrt(expected[0]) < 1 and np.sqrt(expected[2]) < 0.05


def test_a_turned_vehicle_has_turned_errors():
    """The gains commute with yaw: the same fixes in a course 70 deg further make the same error
    70 deg further."""
    found = []
    yaw = np.radians(70)
    level = Rotation.from_euler("z", yaw).as_matrix()
    for turned in (0.0, yaw):
        filter, rng = filters.find("fixed-gain"), np.random.default_rng(3)
        truth = InitialState(
            0.0,
            tuple(LLA),
            (0.0,) * 3,
            (0.1, -0.2, 0.4 + turned),
            (0.0,) * 3,
            (0.0,) * 3,
            (1.0,) * 15,
        )
        observer = Standing()
        belief = filter.start(truth, NOISE)
        observer.belief, observer.C = belief, belief.C_nb.copy()
        turn, offset = (level if turned else np.eye(3)), rng.standard_normal((3, 3))
        observer.set(offset @ turn.T)
        for _k in range(20):
            observer.wait(0.5)
            observer.fix("position", turn @ rng.standard_normal(3))
            observer.wait(0.5)
            observer.fix("velocity", turn @ rng.standard_normal(3))
        found.append(observer.error @ turn)
    np.testing.assert_allclose(found[0], found[1], atol=2e-3)
    assert np.abs(found[0][0]).max() > 0.1


@pytest.mark.parametrize("beyond, stable", [(0.97, True), (1.03, False)])
def test_the_fastest_turn_is_where_the_bias_begins_to_swing_up(beyond, stable):
    """In n the bias of a turning body turns: s^3 + ... with one complex pole."""
    rate = beyond * fastest_turn(*DEFAULT)
    F = np.array([[-0.7, 1, 0], [-0.14, 0, -1], [0.008, 0, 1j * rate]])
    assert (np.linalg.eigvals(F).real.max() < 0) == stable
    assert np.degrees(fastest_turn(*DEFAULT)) == pytest.approx(19.7, abs=0.1)


@pytest.mark.parametrize("beyond, stable", [(0.8, True), (1.2, False)])
def test_and_the_observer_on_a_turning_body_does_so(beyond, stable, T=0.1):
    """A level body turns on the spot, exact positions come at 10 Hz: the error (north + j east)
    goes as the slowest eigenvalue of the sampled observer."""
    rate, observer = beyond * fastest_turn(*DEFAULT), Standing()
    carried = lambda turn: expm(np.array([[0, 1, 0], [0, 0, -1], [0, 0, 1j * turn]]) * T)
    # what a fix multiplies the error by
    fixed = sampled(observer, [(T, "position")], 0) @ np.linalg.inv(carried(0.0))
    expected = np.log(np.abs(np.linalg.eigvals(fixed @ carried(rate))).max()) / T
    observer = Standing()
    observer.belief.C_nb[:] = np.eye(3)
    observer.belief.b_a[:] = [0.01, 0.02, 0.0]
    sizes = []
    for _ in range(900):
        stationary_increments(LLA, np.zeros(3), observer.belief.C_nb, T, observer.u)
        observer.u[2] += rate * T
        observer.filter.predict(observer.belief, observer.u, T, NOISE)
        observer.fix("position")
        sizes.append(np.linalg.norm(observer.belief.b_a[:2]))
    # 1/s, after what is faster has settled
    found = np.polyfit(T * np.arange(500), np.log(sizes[400:]), 1)[0]
    assert (found < 0) == (expected < 0) == stable and found == pytest.approx(expected, rel=0.03)


def test_it_follows_a_flight_and_claims_what_it_estimates():
    recording = flight(100.0)
    recording = replace(recording, sources=(*recording.sources, ahrs(recording.reference)))
    solution = sd.fuse(recording, "fixed-gain", start=start(recording))
    e = sd.rms(sd.errors(solution, recording.reference), (50.0, 100.0))
    assert (
        np.linalg.norm(e.position) < 1.5
        and np.linalg.norm(e.velocity) < 0.4
        and np.abs(e.rph).max() < np.radians(1.5)
    )
    assert (
        np.isfinite(solution.trajectory.std[:, :12]).all()
        and np.isnan(solution.trajectory.std[:, 12:]).all()
        and np.isnan(solution.b_g).all()
        and np.isfinite(solution.b_a).all()
    )
    assert np.isfinite(solution.innovations.nis).all() and solution.counts() == {
        "GNSS position": (100, 0),
        "GNSS velocity": (100, 0),
        "ahrs": (100, 0),
    }


def test_the_attitude_is_the_measured_one_and_keeps_a_heading_that_is_not():
    observer = Standing()
    observe = aiding.find("attitude").observe

    def record(*rph):
        observer.filter.correct(
            observer.belief,
            np.array(rph),
            np.full(3, 0.01),
            Kind.ATTITUDE,
            observe,
            new_source(),
            np.inf,
            np.zeros(12),
        )
        return Rotation.from_matrix(observer.belief.C_nb).as_euler("ZYX")[::-1]

    np.testing.assert_allclose(record(0.3, 0.2, -2.0), [0.3, 0.2, -2.0], atol=1e-12)
    np.testing.assert_allclose(record(-0.1, 0.1, np.nan), [-0.1, 0.1, -2.0], atol=1e-12)
    np.testing.assert_allclose(record(np.nan, np.nan, np.nan), [-0.1, 0.1, -2.0], atol=1e-12)


@pytest.mark.parametrize("T", [0.5, 4.0])
@pytest.mark.parametrize("correlation", [0.0, 2.0])
def test_the_attitude_is_as_uncertain_as_its_records(correlation, T):
    """About forward and right of the heading, each record new but for exp(-T/tau) of the one
    before; a heading that is missing keeps its variance."""
    observer, tilt = Standing(correlation=correlation), np.array([0.03, 0.01])
    observe, P = aiding.find("attitude").observe, observer.belief.P
    turn = Rotation.from_euler("z", RPH[2]).as_matrix()[:2, :2]
    P[12:], P[:, 12:] = 0.0, 0.0  # gyros without a bias: what is left of their drift is 1e-5 rad^2

    def record(heading):
        observer.filter.correct(
            observer.belief,
            np.array([*RPH[:2], heading]),
            np.r_[tilt, 0.05],
            Kind.ATTITUDE,
            observe,
            new_source(),
            np.inf,
            np.zeros(12),
        )

    record(RPH[2])
    before = P[6:9, 6:9].copy()
    for heading in (RPH[2], np.nan):
        observer.wait(T)
        record(heading)
    kept = np.exp(-2 * T / correlation) if correlation else 0.0  # of a variance
    expected = turn @ np.diag(tilt**2) @ turn.T
    np.testing.assert_allclose(
        P[6:8, 6:8], expected + kept**2 * (before[:2, :2] - expected), atol=1e-5
    )
    assert P[8, 8] == pytest.approx(0.05**2 + kept * (before[2, 2] - 0.05**2), abs=1e-5)


def test_it_publishes_rate_and_force_without_the_biases():
    observer, rng, dt = Standing(), np.random.default_rng(6), 0.1
    belief, u = observer.belief, rng.standard_normal(6)
    belief.b_a[:], belief.b_g[:] = rng.standard_normal((2, 3))
    b_a, b_g = belief.b_a.copy(), belief.b_g.copy()
    observer.filter.predict(belief, u, dt, NOISE)
    np.testing.assert_allclose(belief.omega, u[:3] / dt - b_g, rtol=1e-12)
    np.testing.assert_allclose(belief.f, u[3:] / dt - b_a, rtol=1e-12)


def test_of_two_fixes_at_one_time_the_second_changes_nothing_and_a_missing_component_waits():
    observer = Standing()
    observer.wait(1.0)
    observer.fix("position", np.array([1.0, np.nan, 1.0]))
    first = observer.error
    assert first[0, 0] != 0 and abs(first[0, 1]) < 1e-8
    observer.fix("position", np.array([5.0, 5.0, 5.0]))
    assert (
        np.allclose(observer.error[:, [0, 2]], first[:, [0, 2]], atol=1e-12)
        and observer.error[0, 1] < -2
    )


@pytest.mark.parametrize(
    "gains, message",
    [
        (
            {"k3": 0.2},
            r"the horizontal gains 0.7, 0.14, 0.2 of positions and 0.5, 0.04 of velocities are not stable: poles with position .*[+]0.*j.* 1/s; ",
        ),
        ({"l1": -0.1}, "the vertical gains -0.1, .* are not stable: poles with position"),
        ({"k2": 0.0, "k3": 0.0}, "not stable: poles with position -0.7"),
        ({"kv1": -1.0}, "not stable: poles with velocity"),
        ({"lv1": np.nan}, "vertical gains .* must be finite numbers"),
        (
            {"k1": 0.0, "k2": 0.0, "k3": 0.0, "kv1": 0.0, "kv2": 0.0},
            "horizontal gains .* nothing is corrected",
        ),
        ({"k1": "fast"}, "k1 is 'fast'; it must be a number"),
    ],
)
def test_gains_that_do_not_settle_are_refused_with_their_poles(gains, message):
    recording = flight()
    recording = replace(recording, sources=(*recording.sources, ahrs(recording.reference)))
    with pytest.raises(DataError, match=f"filter 'fixed-gain'.*{message}"):
        sd.fuse(recording, "fixed-gain", start=start(recording), options=gains)
