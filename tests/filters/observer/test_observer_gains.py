"""The gain designer: against scipy's Riccati solution, numpy's poles and the recursion that the
filter runs, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from strapdown.data.solution import Source
from strapdown.filters.observer import gains
from strapdown.filters.observer.translation_gains import grow

pytestmark = pytest.mark.short
DEFAULTS = gains.DEFAULTS


def source(kind, interval, deviation, seconds=60.0):
    t = np.arange(interval, seconds, interval)
    return Source(kind, t, np.zeros((len(t), 3)), np.full((len(t), 3), deviation))


@pytest.mark.parametrize("interval", [0.2, 1.0, 10.0])
def test_the_riccati_design_is_that_of_scipy(interval):
    Phi, Q = gains.transition(interval), gains.driving_noise(interval, DEFAULTS["wander"] ** 2)
    for kinds, std in ((("position",), [2.0]), (("position", "velocity"), [2.0, 0.1])):
        H = np.eye(3)[: len(kinds)]
        P = solve_discrete_are(Phi.T, H.T, Q, np.diag(np.square(std)))
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(np.square(std)))
        jumps = gains.schedule(DEFAULTS, interval, interval if len(kinds) == 2 else 0.0, 2.0, 0.1)
        assert [kind for _, kind, _ in jumps] == list(kinds)
        one_by_one = np.eye(3)
        for _, kind, k in jumps:
            one_by_one = (np.eye(3) - np.outer(k, np.eye(3)[int(kind == "velocity")])) @ one_by_one
        assert np.abs(one_by_one - (np.eye(3) - K @ H)).max() < 1e-6
        radius = np.abs(np.linalg.eigvals((np.eye(3) - K @ H) @ Phi)).max()
        assert abs(gains.spectral_radius(jumps) - radius) < 1e-6 and radius < 1


def test_sampled_model_and_its_noise_are_those_of_the_chain():
    A = np.diag([1.0, 1.0], 1)
    for T in (0.2, 3.0):
        van_loan = expm(np.block([[-A, np.diag([0, 0.3, 0.04])], [np.zeros((3, 3)), A.T]]) * T)
        Phi, P = van_loan[3:, 3:].T, np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 0.5]])
        assert np.abs(gains.transition(T) - Phi).max() < 1e-12
        numbers = P[np.triu_indices(3)].copy()
        grow(numbers, T, 0.04, 0.3, 0.0)
        assert (
            np.abs(numbers - (Phi @ P @ Phi.T + Phi @ van_loan[:3, 3:])[np.triu_indices(3)]).max()
            < 1e-9
        )


@pytest.mark.parametrize("poles", ["-0.5 -0.7 -1", "-0.2, -0.3+0.4j, -0.3-0.4j"])
def test_the_poles_are_those_asked_for(poles):
    wanted = np.array([complex(part) for part in poles.replace(",", " ").split()])
    for T, T_v in ((1.0, 0.0), (1.0, 1.0), (2.0, 0.5)):
        o = DEFAULTS | dict(design="poles", poles=poles)
        jumps = gains.schedule(o, T, T_v)
        M = np.eye(3)
        for step, kind, K in jumps:
            M = (
                (np.eye(3) - np.outer(K, np.eye(3)[int(kind == "velocity")]))
                @ gains.transition(step)
                @ M
            )
        found, asked = (
            sorted(values, key=lambda z: (z.real, z.imag))
            for values in (np.linalg.eigvals(M), np.exp(wanted * T))
        )
        assert np.abs(np.array(found) - asked).max() < 1e-6


def test_theta_speeds_all_up_alike_with_its_cube_on_xi_and_not_with_its_square():
    """Row e: with theta, theta^2, theta^3 the continuous poles are theta times as fast; with
    theta^2 on xi they are others."""
    A, K, theta = np.diag([1.0, 1.0], 1), np.array([1.5, 0.8, 0.2]), 3.0
    C, poles = (
        np.array([[1.0, 0, 0]]),
        lambda k: np.sort_complex(np.linalg.eigvals(A - np.outer(k, C))),
    )
    asked = np.sort_complex(theta * poles(K))
    assert (
        np.abs(poles(K * theta ** np.array([1, 2, 3])) - asked).max()
        < 1e-9
        < 0.1
        < np.abs(poles(K * theta ** np.array([1, 2, 2])) - asked).max()
    )
    given = gains._given_gains(
        DEFAULTS | dict(kpp=0.1, kvp=0.02, kxp=0.003, kpv=0.1, kvv=0.2, kxv=0.03, theta=2.0)
    )
    assert np.allclose(given, [[0.2, 0.08, 0.024], [0.1, 0.4, 0.12]])


def test_raw_velocity_injected_has_no_equilibrium_at_the_truth():
    """Row f: the error of a velocity is C_v (v - v^); with C_v = 0 on the estimate alone the
    truth is pushed away by K v."""
    v, K = np.array([30.0, 0, 0]), 0.5
    assert K * np.linalg.norm(0 * v - 0 * v) == 0 and K * np.linalg.norm(v - 0 * v) == 15


def test_fit_completes_the_options_and_says_gains_and_radius():
    options, notes = gains.configure(
        {"wander": 0.05}, (source("position", 1.0, 2.0), source("velocity", 0.2, 0.1))
    )
    assert options == {"wander": 0.05, "outage_after": pytest.approx(0.6)}
    assert len(notes) == 2 and all(
        "spectral radius 0." in note and "position every 1 s and velocity every 0.2 s" in note
        for note in notes
    )
    few = gains.configure(
        {"outage_after": 7.0}, (source("position", 1.0, 2.0, 1.5), source("velocity", 0.2, 0.1))
    )
    assert few == (
        {"outage_after": 7.0},
        ["fewer than two fixes of position: the observer's gains are not checked"],
    )


def without(source, column, place):
    """The source with NaN at this place of a column."""
    values = getattr(source, column).copy()
    values[place] = np.nan
    return replace(source, **{column: values})


@pytest.mark.parametrize("column", ["y", "std"])
def test_a_fix_without_an_axis_does_not_count_on_it(column):
    """One NaN changes nothing but by that fix; an axis that is never measured has no velocity,
    and without positions no check."""
    position, velocity = source("position", 1.0, 2.0), source("velocity", 0.2, 0.1)
    whole = gains.configure({}, (position, velocity))
    position, velocity = (
        without(position, column, (5, 2)),
        without(velocity, column, (7, 0)),
    )
    assert gains.configure({}, (position, velocity)) == whole
    velocity = without(velocity, column, (slice(None), 2))
    options, (north, down) = gains.configure({}, (position, velocity))
    assert (
        options == whole[0]
        and north == whole[1][0]
        and "every 1 s; down:" in down
        and "velocity every" not in down
    )
    velocity = without(velocity, column, (slice(None), 0))
    assert ["; east:" in note for note in gains.configure({}, (position, velocity))[1]] == [
        False,
        True,
        False,
    ]
    position = without(position, column, (slice(None), 2))
    assert (
        gains.configure({}, (position, velocity))[1][-1]
        == "down: fewer than two fixes of position; the observer's gains are not checked there"
    )
    position = without(position, column, (slice(None), slice(2)))
    assert gains.configure({}, (position, velocity))[1] == [
        "fewer than two fixes of position: the observer's gains are not checked"
    ]


def test_fit_refuses_what_it_cannot_run_on():
    with pytest.raises(ValueError, match="nothing measures heading or course: add"):
        gains.configure({}, (source("position", 1.0, 2.0),))
    gains.configure({"course": "none"}, (source("position", 1.0, 2.0),))
    with pytest.raises(ValueError, match="nothing measures the position"):
        gains.configure({}, (source("velocity", 1.0, 0.1),))
    with pytest.raises(
        ValueError,
        match="translational motion observer is not stable at fixes every 1 s: spectral radius",
    ):
        gains.configure(dict(kpp=2.5), (source("position", 1.0, 2.0), source("velocity", 1.0, 0.1)))
    with pytest.raises(ValueError, match="not stable"):
        gains.configure(
            dict(ki=3.0, ki_start=3.0), (source("position", 5.0, 2.0), source("velocity", 5.0, 0.1))
        )
    slow, notes = gains.configure({"course": "none"}, (source("position", 20.0, 5.0, 200.0),))
    assert slow["ki_start"] < DEFAULTS["ki_start"] and any(
        "ki_start lowered to" in note for note in notes
    )


def test_an_interval_is_rounded_to_milliseconds_unless_it_is_that_short():
    rng = np.random.default_rng(4)
    for interval, expected in ((0.2, 0.2), (1.0, 1.0), (0.05, 0.05)):
        t = np.arange(interval, 60.0, interval)
        jittered = Source(
            "position",
            t + rng.uniform(-2e-4, 2e-4, len(t)),
            np.zeros((len(t), 3)),
            np.ones((len(t), 3)),
        )
        assert gains.fix_interval((jittered,), "position") == expected
    assert gains.fix_interval((source("position", 0.0025, 1.0, 1.0),), "position") == pytest.approx(
        0.0025, abs=1e-12
    )


def test_the_same_design_is_done_once_and_is_the_same():
    sources = source("position", 1.0, 2.0), source("velocity", 0.2, 0.1)
    gains._design_gains.cache_clear()
    first = gains.configure({"wander": 0.05}, sources)
    assert (
        gains.configure({"wander": 0.05}, sources) == first
        and gains._design_gains.cache_info().hits == 1
    )
    first[1].clear()  # what it hands out is the caller's
    assert len(gains.configure({"wander": 0.05}, sources)[1]) == 2
    assert (
        gains.configure({"wander": 0.06}, sources)[1]
        != gains.configure({"wander": 0.05}, sources)[1]
    )
    assert (
        gains.configure(
            {"wander": 0.05, "ki": 0.005},
            (source("position", 20.0, 5.0, 200.0), source("velocity", 20.0, 0.1, 200.0)),
        )[0]["ki"]
        == 0.005
    )


@pytest.mark.parametrize("accel, most", [(3e-4, 1e-4), (3e-3, 5e-3)])
@pytest.mark.parametrize("interval", [0.2, 1.0])
def test_what_the_printed_gains_leave_out_is_small(interval, accel, most):
    """The accelerometer's noise (m/s/sqrt(s)), which the filter has and the design that is
    printed has not."""
    printed = [K for _, _, K in gains.schedule(DEFAULTS, interval, interval, 2.0, 0.1)]
    A = np.array([4.0, 0, 0, 1, 0, 1])
    for _ in range(2000):
        grow(A, interval, DEFAULTS["wander"] ** 2, accel**2, 0.0)
        found, P = [], np.zeros((3, 3))
        P[np.triu_indices(3)] = A
        P = P + np.triu(P, 1).T
        for row, std in enumerate((2.0, 0.1)):
            found.append(P[:, row] / (P[row, row] + std**2))
            P = P - np.outer(found[-1], P[row])
        A = P[np.triu_indices(3)].copy()
    difference = max(np.abs(f / p - 1).max() for f, p in zip(found, printed))
    assert difference < most, difference


@pytest.mark.parametrize(
    "options, said",
    [
        (dict(k1=0.0), "k1 is 0.0; it must be a finite number above 0"),
        (dict(k2=-1.0), "k2 is -1"),
        (dict(ki=-0.1), "ki is -0.1; it must be a finite number, 0 or more"),
        (dict(wander=float("nan")), "wander is nan; it must be a finite number"),
        (dict(gyro_bound=0.0), "gyro_bound is 0"),
        (dict(course="north"), "course is 'north'; it must be one of tilt-compensated"),
        (dict(field="x"), "field is 'x'"),
        (dict(design="lqr"), "design is 'lqr'"),
        (dict(poles="-1 -1"), "poles is '-1 -1'"),
        (dict(poles="-1 -1 1"), "real parts below zero"),
        (dict(poles="a b c"), "poles is 'a b c'"),
        (dict(poles="-1 -1+1j -2-1j"), "complex ones in pairs"),
        (dict(kpp=-0.1), "kpp is -0.1"),
    ],
)
def test_options_out_of_bounds_are_refused_by_name(options, said):
    with pytest.raises(ValueError, match=said.replace("+", r"\+")):
        gains.check_gain_options(options)
