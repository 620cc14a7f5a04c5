"""The adaptive part of the observer: what it believes of its own answers by running it, its least
squares against dense ones, and what it learns and does not."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding, filters
from strapdown.core.compile.jit import matrix
from strapdown.core.loop.contract import InitialState, Kind, Noise, compile_kernel
from strapdown.core.mathematics.source import new_source
from strapdown.filters.observer import adaptive_law
from strapdown.filters.observer.adaptive_law import AIR, COUNT, GYRO, WIND
from strapdown.filters.observer.covariance import AUXILIARY, FULL, step
from strapdown.filters.observer.equations import ADAPTIVE, FADE, XI
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.sortie import sortie

NLO = filters.find("nlo")
SILENT = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
DEAF = dict(xi_noise=1e6, slip=1e6)
FIXED = ((Kind.POSITION, "position"), (Kind.VELOCITY, "velocity"))
STD = (1.0,) * 3 + (0.1,) * 3 + (0.01,) * 3 + (0.5,) * 3 + (0.004,) * 3


def begun(change=None, **options):
    """An observer after its start, with what it takes for known moved by `change` (8,), in
    standard deviations."""
    rph, lla = (0.1, 0.05, 0.7), (0.8, 0.1, 500.0)
    given = InitialState(0.0, lla, (30.0, 25.0, 0.0), rph, (0.0,) * 3, (0.0,) * 3, STD)
    belief = NLO.start(given, SILENT, **options)
    own = adaptive_law.ADAPTIVE.views(belief.workspace[ADAPTIVE])
    belief.workspace[FADE], own["BEGUN"][...] = 0.0, 1.0
    if change is not None:
        moved = own["SCALE"] * change
        belief.b_a[:], belief.b_g[:], own["WIND"][:] = moved[:GYRO], moved[GYRO:AIR], moved[AIR:]
    return belief


def fly(belief, seconds, seen, turn=0.15, std_of=1.0, off=1.0):
    """A coordinated turn at 50 Hz from `belief`, with the fixes that were `seen` at the end of each
    second; where there are none they are near those of the belief, and of a course 5 mrad off."""
    for second in range(seconds):
        for _ in range(50):
            u = np.r_[0.0, 0.3 * turn, turn, 0.3, 39.0 * turn, -9.8 - 3.0 * turn] * 0.02
            NLO.predict(belief, u, 0.02, SILENT)
        if len(seen) <= second:
            v = Rotation.from_rotvec([0, 0, 5e-3 * off]).apply(belief.v_n)
            seen.append([displace_lla(belief.lla, off * np.array([0.05, -0.1, 0.05])), v])
        for (kind, name), y in zip(FIXED, seen[second]):
            rest = kind, aiding.find(name).observe, new_source(), np.inf, np.zeros(12)
            NLO.correct(belief, y, np.full(3, std_of), *rest)


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    kernels = (aiding.find(name).observe for _, name in FIXED)
    for kernel in (NLO.predict, NLO.correct, *kernels):
        compile_kernel(kernel)


@pytest.mark.short
def test_its_answers_are_those_of_an_observer_that_is_moved():
    """U, column by column: two observers that learn nothing, of which one begins with another
    bias, or wind."""
    exact, seen, small = begun(**DEAF), [], 1e-4
    fly(exact, 8, seen)
    own = adaptive_law.ADAPTIVE.views(exact.workspace[ADAPTIVE])
    for j in range(COUNT):
        belief = begun(small * (np.arange(COUNT) == j), **DEAF)
        fly(belief, 8, iter_of(seen))
        turned = Rotation.from_matrix(belief.C_nb) * Rotation.from_matrix(exact.C_nb).inv()
        for name, found in (
            ("U_P", displacement(belief.lla, exact.lla)),
            ("U_V", belief.v_n - exact.v_n),
            ("U_TILT", turned.as_rotvec()),
            ("U_GYRO", belief.b_g - exact.b_g),
            ("U_XI", exact.workspace[XI] - belief.workspace[XI]),
        ):
            most = max(np.abs(own[name]).max(), 1e-9)
            assert np.abs(found / small - own[name][:, j]).max() < 0.03 * most, (name, j)


def iter_of(seen):
    """The fixes as they were."""
    return [list(pair) for pair in seen]


@pytest.mark.short
def test_its_least_squares_are_the_dense_ones_and_never_lose():
    """J, and beta^ without noise: the weighted length of the error does not grow, whatever the
    rows, also as it forgets."""
    belief, rng = begun(memory=20.0, xi_noise=0.2), np.random.default_rng(4)
    own = belief.workspace[ADAPTIVE]
    named, J, left = adaptive_law.ADAPTIVE.views(own), np.eye(COUNT), rng.standard_normal(COUNT)
    before, kept = np.inf, left.copy()
    for _ in range(60):
        X, a = 0.3 * rng.standard_normal((3, COUNT)), 0.2 * rng.standard_normal(COUNT)
        named["U_XI"][:], named["U_TILT"][2] = X, a
        wind = np.array([-np.sin(0.7), np.cos(0.7)]) * named["SCALE"][AIR:] / 40.0
        h = a + np.r_[np.zeros(AIR), wind]
        own[adaptive_law.SINCE], J = 1.0, J + np.outer(h, h) * 3.0
        adaptive_law.see_course(own, belief.C_nb, h @ left, 1 / 40.0, 3.0)
        adaptive_law.see_force(own, X @ left, 5.0)
        J = J + 5.0 * X.T @ X
        J += (np.eye(COUNT) - J) / 20.0
        adaptive_law.forget(own, True)
        known = adaptive_law.factor(own)
        np.testing.assert_allclose(np.tril(named["J"]), np.tril(J), rtol=1e-9)
        assert known == pytest.approx(1 - np.diag(np.linalg.inv(J))[:GYRO].max(), abs=1e-9)
        change = named["SUM"].copy()
        expected = np.linalg.solve(J, change)
        adaptive_law.solve(own, change)
        np.testing.assert_allclose(change, expected, rtol=1e-8)
        named["SUM"][:], left = 0.0, left - change
        assert left @ J @ left < before
        before = left @ J @ left
    assert np.linalg.norm(left) < 0.01 * np.linalg.norm(kept)


@pytest.mark.short
def test_with_fast_fixes_and_no_turns_xi_is_minus_c_times_the_bias():
    """The law is then b_a' = -k C' xi."""
    slow = dict(k1=1e-9, k2=1e-9, ki=0.0, k1_start=1e-9, k2_start=1e-9, ki_start=0.0)
    belief = begun(**slow, **DEAF, wander=10.0, wander_start=10.0)
    fly(belief, 10, [], turn=0.0, std_of=1e-3)
    own = adaptive_law.ADAPTIVE.views(belief.workspace[ADAPTIVE])
    np.testing.assert_allclose(own["U_XI"][:, :GYRO] / own["SCALE"][:GYRO], -belief.C_nb, atol=0.02)


def legs(*found):
    return [{"duration": seconds, "turn": turn} for seconds, turn in found]


def flown(found, seed, wind=0.0, **options):
    """(solution, recording) of a flight by such legs, with biases of 0.3 m/s^2 that the start does
    not know."""
    motion = sortie((0.82, 0.14, 800.0), 0.5, legs(*found), speed=45.0, wind=wind, wind_from=1.0)
    seconds = sum(each[0] for each in found)
    made = sd.simulate(motion, seconds, "tactical", seed, 50.0, Gnss(0.2, 0.5, 0.05))
    bias = np.array([0.3, -0.25, 0.2])
    dv = made.imu.dv + bias * made.imu.dt[:, None]
    made = replace(made, imu=made.imu._replace(dv=dv))
    begin = start(made)
    begin = begin._replace(std=(*begin.std[:9], *[0.3] * 3, *begin.std[12:]))
    return sd.fuse(made, "nlo", start=begin, options=options), made, bias + made.meta["b_a"][-1]


TURNS = ((20.0, 2.0), (20.0, -2.6), (15.0, 0.0), (20.0, 1.5)) * 2


def test_turns_tell_bias_and_wind_and_a_straight_leg_does_not():
    solution, _, bias = flown(TURNS, 905, wind=8.0)
    assert np.abs(solution.b_a[-1] - bias).max() < 0.04
    own = solution.columns["excitation"]
    assert own[-1] > 0.97 and own[np.searchsorted(solution.t, 35.0)] < 0.5
    straight, _, bias = flown(((150.0, 0.0),), 906)
    # along the force it is seen at once, across it the attitude has made up for it
    assert abs(straight.b_a[-1, 2] - bias[2]) < 0.05
    assert np.abs(straight.b_a[-1, :2]).max() < 0.18 and straight.columns["excitation"][-1] < 0.5


def test_the_paper_s_law_leaves_what_lies_across_the_force():
    solution, made, bias = flown(TURNS, 907, wind=8.0, bias_law="norm")
    better, _, _ = flown(TURNS, 907, wind=8.0)
    heading = lambda found: np.abs(sd.errors(found, made.reference).attitude[-2000:, 2]).mean()
    assert np.abs(solution.b_a[-1] - bias)[:2].max() > 0.2
    assert heading(better) < 0.5 * heading(solution)


@pytest.mark.parametrize("part", range(5))
def test_p_is_what_learning_does_to_small_errors(part):
    """An error of position, velocity, attitude, accelerometer or gyro bias at the end of the start:
    what forty seconds leave of it in attitude and biases, by runs of their own. Of what is learnt
    itself P knows less than the runs: it counts no wind, and the course as crab."""
    rows, seen = slice(3 * part, 3 * part + 3), []
    fly(begun(crab=0.0), 40, seen, std_of=0.05, off=0.0)
    known, exact = begun(crab=0.0), begun(crab=0.0)
    P = matrix(known.workspace, FULL, 15 + AUXILIARY, 15 + AUXILIARY)
    P[:15, :15] = np.diag(np.where(np.isin(np.arange(15), np.r_[rows]), STD, 1e-9)) ** 2
    known.P[:] = P[:15, :15]
    for belief in (known, exact):
        fly(belief, 40, iter_of(seen), std_of=0.05)
    step(known)
    found, share = np.zeros((3, 9)), 0.1
    for axis in range(3):
        belief, moved = begun(crab=0.0), share * STD[3 * part] * np.eye(3)[axis]
        if part == 0:
            belief.lla[:] = displace_lla(belief.lla, moved)
        elif part == 2:
            belief.C_nb[:] = Rotation.from_rotvec(moved).as_matrix() @ belief.C_nb
        else:
            (belief.v_n, None, belief.b_a, belief.b_g)[part - 1][:] += moved
        fly(belief, 40, iter_of(seen), std_of=0.05)
        turned = Rotation.from_matrix(exact.C_nb) * Rotation.from_matrix(belief.C_nb).inv()
        found[axis] = (
            np.r_[turned.as_rotvec(), exact.b_a - belief.b_a, exact.b_g - belief.b_g] / share
        )
    found, said = np.linalg.norm(found, axis=0), np.sqrt(np.diag(known.P))[6:]
    if part < 3:
        np.testing.assert_allclose(said[3:6], found[3:6], rtol=0.1)
        np.testing.assert_allclose(said, found, rtol=0.25, atol=2e-5)
    else:
        assert (found < 1.05 * said).all() and (said[3:6] < 0.04).all()


@pytest.mark.short
@pytest.mark.parametrize(
    "options, said",
    [
        (dict(xi_noise=0.0), "xi_noise is 0.0; it must be a finite number above 0"),
        (dict(slip=0.0), "slip is 0"),
        (dict(wind=-1.0), "wind is -1"),
        (dict(memory=-1.0), "memory is -1"),
        (dict(bias_law="xy"), "bias_law is 'xy'.*it must be one of xi, norm"),
        (dict(course="printed", bias_law="xi"), "course='printed' turns the attitude about"),
        (dict(memory=2.0), "memory is 2 s: what the fixes tell would be forgotten"),
    ],
)
def test_gains_that_the_argument_refuses(options, said):
    made = sd.simulate(
        sortie((0.82, 0.14, 800.0), 0.5, legs((10.0, 0.0)), speed=45.0), 10.0, "tactical", 908
    )
    with pytest.raises(sd.DataError, match=said):
        sd.fuse(made, "nlo", start=start(made), options=options)


@pytest.mark.short
def test_without_wind_as_an_option_none_is_learnt():
    for wind, learns in ((0.0, False), (5.0, True)):
        belief = begun(wind=wind)
        fly(belief, 10, [])
        assert belief.workspace[ADAPTIVE][WIND].any() == learns


def test_an_altitude_alone_teaches_nothing():
    belief = begun()
    kind, observe = Kind.ALTITUDE, aiding.find("altitude").observe
    compile_kernel(observe)
    fix = np.array([501.0, 0, 0]), np.ones(3), kind, observe, new_source(), np.inf
    NLO.predict(belief, np.r_[0.0, 0, 0, 0, 0, -0.196], 0.02, SILENT)
    NLO.correct(belief, *fix, np.zeros(12))
    assert np.isfinite(belief.P).all() and not belief.b_a.any()
