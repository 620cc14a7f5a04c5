"""The exogenous Kalman filter against dense matrices: around the truth, any other trajectory,
and the nonlinear observer with its jumps."""

import inspect
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from affine_filter import ARM, FIX_STD, NOISE, Dense, State, copied, expected, minus, moved, plus
from recordings import flight, start
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.loop.contract import CORRECT, PREDICT, compile_kernel, kernel
from strapdown.core.mathematics.source import new_source
from strapdown.data.solution import Source
from strapdown.filters.observer import nlo, xkf
from strapdown.filters.observer.equations import embedded_observer
from strapdown.filters.observer.xkf import XKF
from strapdown.geometry.geodesy import displace_lla, displacement

pytestmark = pytest.mark.short
STEPS, EVERY = 120, 10  # samples, and samples between fixes
ROUNDED = np.r_[[3e-8] * 3, np.zeros(12)]
"""m: what latitude and longitude in double precision round to over these steps."""


def observer(belief):
    """The state of the observer inside, as views."""
    a = belief.workspace[xkf.INSIDE]
    return State(a[0:3], a[3:6], a[6:15].reshape(3, 3), a[15:18], a[18:21])


@kernel(PREDICT)
def carried(belief, u, dt, noise):
    """A prediction by the filter without that of the observer, which someone else moves."""
    xkf.carry(belief, embedded_observer(belief, xkf.INSIDE.start), u, dt, noise)


@kernel(CORRECT)
def corrected(belief, y, std, kind, observe, parameters, gate, innovation):
    """A fix by the filter without the observer taking it."""
    return xkf.correct_around(
        belief,
        embedded_observer(belief, xkf.INSIDE.start),
        y,
        std,
        kind,
        observe,
        parameters,
        gate,
        innovation,
    )


def put(belief, state):
    """Set the observer, as if it had come there by itself."""
    for own, given in zip(observer(belief), state):
        own[...] = given
    xkf.relate(belief, observer(belief))


@cache
def world():
    """(increments (n, 6), dt, true states, fixes {step: [(kind, y)]}): a turning flight without
    noise in the IMU, so that the truth is a solution."""
    imu, rng = flight().imu, np.random.default_rng(11)
    u, dt, begin = (
        np.c_[imu.dtheta, imu.dv][:STEPS],
        float(imu.dt[0]),
        copied(start(flight()).belief(np.zeros(1))),
    )
    truth = [plus(begin, rng.standard_normal(15) * start(flight()).std)]
    for row in u:
        truth.append(moved(truth[-1], row, dt))
    fixes = {}
    for k in range(EVERY, STEPS + 1, EVERY):
        fixes[k] = []
        for kind, deviation in FIX_STD.items():
            h, _ = expected(kind, truth[k], u[k - 1, :3] / dt)
            error = rng.standard_normal(3) * deviation
            fixes[k].append(
                (
                    kind,
                    plus(truth[k], np.r_[h + error, np.zeros(12)]).lla
                    if kind == "position"
                    else h + error,
                )
            )
    return u, dt, truth, fixes


def begun(**options):
    for needed in (
        XKF.predict,
        XKF.correct,
        carried,
        corrected,
        *(aiding.find(kind).observe for kind in FIX_STD),
    ):
        compile_kernel(needed)
    return XKF.start(start(flight()), NOISE, **{"near": 0.0} | options)


def fix(belief, kind, y, gate=np.inf, correct=XKF.correct):
    """(NIS, innovation) of a fix by the filter."""
    sensor, source, innovation = aiding.find(kind), new_source(), np.zeros(12)
    source.parameters[:3] = ARM
    return correct(
        belief,
        np.array(y, float),
        FIX_STD[kind],
        aiding.number(sensor.name),
        sensor.observe,
        source,
        gate,
        innovation,
    ), innovation[:3]


def together(path=None, **dense):
    """Yields (belief, Dense, the two NIS) after each step and fix, where the observer is `path`
    or, by default, itself."""
    u, dt, _, fixes = world()
    belief = begun()
    bar, predict, correct = (
        observer(belief),
        carried if path else XKF.predict,
        corrected if path else XKF.correct,
    )
    if path:
        put(belief, path[0])
    oracle = Dense(belief, copied(bar), belief.P, **dense)
    for k, row in enumerate(u, 1):
        before = copied(bar)
        predict(belief, row, dt, NOISE)
        if path:
            put(belief, path[k])
        oracle.predict(before, copied(bar), row, dt)
        yield belief, oracle, (0.0, 0.0)
        for kind, y in fixes.get(k, ()):
            before = copied(bar)
            nis, _ = fix(belief, kind, y, correct=correct)
            own = oracle.correct(before, kind, y)
            oracle.jump(before, copied(bar))
            yield belief, oracle, (nis, own)


def assert_equal(belief, oracle, nis, relative):
    """Estimate within `relative` of its standard deviations, covariance and NIS likewise."""
    scale = np.sqrt(np.diag(oracle.P))
    off = np.abs(belief.workspace[xkf.X] - oracle.x)
    assert (off <= relative * scale + ROUNDED).all(), off / scale
    assert np.abs((belief.P - oracle.P) / np.outer(scale, scale)).max() < relative
    assert nis[0] == pytest.approx(nis[1], rel=10 * relative, abs=1e-12)


def wandering(size, seed=5):
    """The true states, each off by a different error of about `size` times the start's: a
    trajectory that is no solution of anything."""
    rng, scale = np.random.default_rng(seed), size * np.array(start(flight()).std)
    slow = scale * np.cumsum(rng.standard_normal((STEPS + 1, 15)), axis=0) / 4
    slow[STEPS // 2 :] += 3 * scale  # and a jump
    return [plus(truth, x) for truth, x in zip(world()[2], slow)]


@pytest.mark.deep
def test_around_the_truth_it_is_the_linear_kalman_filter():
    """No composition, no mismatch: x <- Phi x and x <- x + K (e - H x) alone."""
    for belief, oracle, nis in together(world()[2], mismatch=False):
        assert_equal(belief, oracle, nis, 1e-9)


@pytest.mark.deep
def test_around_any_trajectory_it_is_the_affine_filter():
    """And the belief is what lies off the trajectory by the errors, its attitude but for what is
    cut of their composition."""
    for belief, oracle, nis in together(wandering(1.0)):
        assert_equal(belief, oracle, nis, 1e-9)
        off = np.abs(minus(belief, observer(belief)) - oracle.x)
        assert np.delete(off, [6, 7, 8]).max() < 1e-7 and off[6:9].max() < 1e-5


def test_around_the_observer_with_its_jumps_it_is_the_affine_filter():
    jumps, last = 0.0, None
    for belief, oracle, nis in together():
        assert_equal(belief, oracle, nis, 1e-9)
        if nis[0]:
            jumps = max(jumps, np.abs(minus(observer(belief), last))[:3].max())
        last = copied(observer(belief))
    assert jumps > 0.1


def test_with_matrix_exponentials_it_is_the_same_filter():
    for belief, oracle, nis in together(exact=True):
        assert_equal(belief, oracle, nis, 1e-3)


def test_without_the_mismatch_it_would_be_another_filter():
    """What the observer's injections and jumps do to it would then be taken for errors of the
    estimate."""
    off = 0.0
    for belief, oracle, _ in together(mismatch=False):
        off = max(
            off,
            np.abs((belief.workspace[xkf.X] - oracle.x) / np.sqrt(np.diag(oracle.P))).max(),
        )
    assert off > 3


def test_to_first_order_the_trajectory_does_not_matter():
    """Half the distance of the trajectory from the truth leaves a quarter of what it does to the
    estimate."""
    ends = [
        [minus(belief, world()[2][-1]) for belief, *_ in together(wandering(size))][-1]
        for size in (0.0, 1.0, 0.5)
    ]
    scale = np.sqrt(np.diag([belief.P for belief, *_ in together(world()[2])][-1]))
    far, near = (np.linalg.norm((end - ends[0]) / scale) for end in ends[1:])
    assert 0 < near < 0.2 and 3 < far / near < 5


def test_it_is_the_closed_loop_to_first_order():
    fused = [
        sd.fuse(
            flight(), name, start=start(flight()), noise=NOISE, covariance=True, options=options
        )
        for name, options in (("xkf", {"near": 0.0}), ("closed-loop", {}))
    ]
    own, closed = (solution.trajectory for solution in fused)
    assert (
        np.abs(displacement(own.lla, closed.lla)).max() < 0.05
        and np.abs(own.v_n - closed.v_n).max() < 0.02
    )
    assert (own.rotation * closed.rotation.inv()).magnitude().max() < 1e-3 and np.abs(
        own.std / closed.std - 1
    ).max() < 0.1


def test_the_observer_inside_is_nlo():
    """Nothing of the Kalman filter reaches it, not even a gate that rejects and is lifted."""
    recording = flight()
    strict = replace(recording, sources=tuple(replace(a, gate=0.5) for a in recording.sources))
    alone = sd.fuse(recording, "nlo", start=start(recording), noise=NOISE)
    for solution in (
        sd.fuse(r, "xkf", start=start(recording), noise=NOISE, covariance=True)
        for r in (recording, strict)
    ):
        for name in nlo.NLO.columns:
            # two kernels, compiled apart
            np.testing.assert_allclose(solution.columns[name], alone.columns[name], atol=1e-11)
        shift = np.stack([solution.columns[name] for name in xkf.SLOTS.columns[xkf.SHIFT]], axis=1)
        assert (
            np.abs(displacement(solution.trajectory.lla, alone.trajectory.lla) - shift).max() < 1e-3
            and np.abs(shift).max() > 0.1
        )
    assert min(rejected for _, rejected in solution.counts().values()) > 2


def test_where_the_observer_jumps_the_belief_stays_bit_for_bit():
    *_, (belief, _, _) = together()
    before, was, P = copied(belief), copied(observer(belief)), belief.P.copy()
    nis, _ = fix(belief, "position", displace_lla(belief.lla, [300.0, -200.0, 100.0]), gate=16.0)
    assert nis > 16 and np.linalg.norm(minus(observer(belief), was)[:3]) > 20
    assert all(np.array_equal(a, b) for a, b in zip(before, copied(belief))) and np.array_equal(
        P, belief.P
    )
    np.testing.assert_allclose(belief.workspace[:3], minus(belief, observer(belief))[:3], atol=1e-8)


def test_the_observer_takes_a_fix_once_though_the_loop_hands_it_over_again():
    *_, (belief, _, _) = together()
    y = displace_lla(belief.lla, [300.0, -200.0, 100.0])
    fix(belief, "position", y, gate=16.0)
    once = copied(observer(belief))
    nis, _ = fix(belief, "position", y)  # with the gate opened
    assert nis > 16 and all(np.array_equal(a, b) for a, b in zip(once, observer(belief)))
    XKF.predict(belief, world()[0][0], world()[1], NOISE)
    moving = copied(observer(belief))
    fix(belief, "position", y)
    assert not np.array_equal(moving.lla, observer(belief).lla)


@pytest.mark.parametrize("gate", [np.inf, 16.0])
def test_the_observer_takes_equal_fixes_of_two_sources(gate):
    """As many times as they come, accepted or rejected."""
    *_, (belief, _, _) = together()
    y = displace_lla(belief.lla, [300.0, -200.0, 100.0])
    for _ in range(2):
        before = copied(observer(belief))
        fix(belief, "position", y, gate=gate)
        assert np.linalg.norm(minus(observer(belief), before)[:3]) > 1


def test_a_heading_across_the_turn_of_the_compass():
    """Observer 178 deg to one side, estimate 4 deg to the other side of what is measured: the
    innovation is those 4 deg."""
    belief, compass = begun(), aiding.find("heading")
    compile_kernel(compass.observe)
    heading, innovation = float(start(flight()).rph[2]), np.zeros(12)
    away = Rotation.from_rotvec([0, 0, np.radians(178.0)]).as_matrix() @ belief.C_nb
    put(belief, State(belief.lla, belief.v_n, away, belief.b_a, belief.b_g))
    y = np.array([(heading - np.radians(4.0) + np.pi) % (2 * np.pi) - np.pi, np.nan, np.nan])
    XKF.correct(
        belief,
        y,
        np.full(3, 0.01),
        aiding.number(compass.name),
        compass.observe,
        new_source(),
        1e-12,
        innovation,
    )
    assert np.degrees(innovation[0]) == pytest.approx(-4.0, abs=0.1)


@pytest.mark.parametrize(
    "near, off, itself",
    [(np.inf, 2.0, True), (0.5, 0.3, True), (0.5, 0.7, False), (0.0, 0.3, False)],
)
def test_a_mean_through_the_model_itself_where_the_observer_is_near(near, off, itself):
    """An INS without fixes, and the innovation that of the belief; the affine mean is some way
    off both."""
    u, dt, _, _ = world()
    belief = begun(near=near, jacobian="observer")
    ins = copied(belief)
    put(belief, plus(ins, np.r_[np.zeros(6), 0.05, -0.05, off, np.zeros(6)]))
    for row in u[:20]:
        XKF.predict(belief, row, dt, NOISE)
        ins = moved(ins, row, dt)
    h, _ = expected("position", ins, u[19, :3] / dt)
    _, innovation = fix(
        belief, "position", plus(ins, np.r_[h + [1.0, 2.0, 3.0], np.zeros(12)]).lla, gate=1e-12
    )
    errors = np.abs(minus(belief, ins)).max(), np.abs(innovation - [1.0, 2.0, 3.0]).max()
    assert max(errors) < 1e-6 if itself else min(errors) > 0.01


def test_states_that_sources_bring_along_are_estimated():
    """A barometer that reads 40 m too high, which the observer has no use for."""
    recording = flight(60.0)
    truth = recording.reference
    rows, rng = slice(10, None, 20), np.random.default_rng(2)
    height = truth.lla[rows, 2] + 40.0 + rng.standard_normal(len(truth.lla[rows])) * 0.5
    barometer = Source(
        "pressure-altitude", truth.t[rows], height, np.full((len(height), 1), 0.5), name="baro"
    )
    run = lambda sources: sd.fuse(
        replace(recording, sources=sources), "xkf", start=start(recording), noise=NOISE
    )
    solution, alone = run((*recording.sources, barometer)), run(recording.sources)
    bias, deviation = (
        solution.columns["baro bias [m]"][-1],
        solution.columns["std of baro bias [m]"][-1],
    )
    assert abs(bias - 40) < 3 * deviation < 3 and solution.counts()["baro"][0] == len(height)
    np.testing.assert_allclose(
        solution.columns["xi_down [m/s^2]"], alone.columns["xi_down [m/s^2]"], atol=1e-11
    )


def test_options_are_those_of_the_observer_and_one_more():
    names = lambda filter: list(inspect.signature(filter.start).parameters)
    assert names(XKF) == [*names(nlo.NLO)[:2], "near", "jacobian", *names(nlo.NLO)[3:]]
    with pytest.raises(DataError, match="near is -1.0 rad; it must be a number, 0 or more"):
        sd.fuse(flight(), "xkf", start=start(flight()), noise=NOISE, options={"near": -1.0})
    with pytest.raises(DataError, match="jacobian is 'truth'"):
        sd.fuse(flight(), "xkf", start=start(flight()), noise=NOISE, options={"jacobian": "truth"})
    with pytest.raises(DataError, match="k1 is -1"):
        sd.fuse(flight(), "xkf", start=start(flight()), noise=NOISE, options={"k1": -1.0})
    with pytest.raises(DataError, match="nothing measures heading or course"):
        sd.fuse(
            replace(flight(), sources=flight().sources[:1]),
            "xkf",
            start=start(flight()),
            noise=NOISE,
            options={"near": 0.5},
        )
    assert any(
        "spectral radius" in note
        for note in sd.fuse(
            flight(), "xkf", start=start(flight()), noise=NOISE, options={"near": 0.5}
        ).meta["notes"]
    )
