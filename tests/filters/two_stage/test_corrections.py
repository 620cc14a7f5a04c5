"""What stage 1 makes of gravity and of a course: closed forms of each row, numeric derivatives, and
the conditions under which there is none. Plain Python: the parts are not compiled one by one."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import filters
from strapdown.core.compile.jit import COMPILED, matrix
from strapdown.core.loop.contract import InitialState, Noise
from strapdown.core.mathematics.earth import RATE, gravity
from strapdown.core.mathematics.error_state import JACOBIAN
from strapdown.filters.observer.equations import LONG_HELD
from strapdown.filters.two_stage import corrections, model

pytestmark = [
    pytest.mark.short,
    pytest.mark.skipif(COMPILED, reason="parts of kernels, without the compiler"),
]
NOISE = Noise(1e-3, 0.02, 1e-5, 1e-4, 1e-3, 1e-3)
LAT, RPH, V = 0.9, (0.3, -0.4, 2.0), np.array([30.0, -40.0, 7.0])
G = gravity(math.sin(LAT), 500.0)
DOWN = np.array([0.0, 0.0, 1.0])
SPIN = RATE * np.array([math.cos(LAT), 0.0, -math.sin(LAT)])


def begun(rph=RPH, **options):
    filter = filters.find("two-stage-ekf")
    std = np.linspace(0.01, 0.15, 15)
    start = InitialState(
        0.0, (LAT, 0.2, 500.0), tuple(V), rph, (0.1, 0.2, -0.1), (0.0,) * 3, tuple(std)
    )
    return filter.start(start, NOISE, **options)


def rows(belief, n):
    """(H, innovation, deviation) of the first n rows that stage 1 made."""
    workspace = belief.workspace
    H = matrix(workspace, JACOBIAN, 3, belief.P.shape[0])
    return H[:n], workspace[model.INNOVATION][:n], workspace[model.DEVIATION][:n]


def by_turns(function, C, step=1e-6):
    """Columns d function(exp(theta) C) / d theta."""
    turned = lambda e: function(Rotation.from_rotvec(e).as_matrix() @ C)
    return np.column_stack([(turned(e) - turned(-e)) / (2 * step) for e in step * np.eye(3)])


# ---- means over a window


def test_means_are_those_of_vectors_that_the_gyros_carry_along():
    belief, rng, dt = begun(correlation=0.0), np.random.default_rng(1), 0.01
    r = np.array([0.02, -0.03, 0.05]) * dt
    C, forces, turns = belief.C_nb.copy(), [], []
    belief.b_g[:], belief.workspace[model.RAW] = 0.0, 0.0
    for _ in range(40):
        f = rng.standard_normal(3)
        middle = belief.C_nb @ Rotation.from_rotvec(r / 2).as_matrix()
        forces.append(middle @ f)
        turns.append(middle @ np.cross(r / dt, belief.C_nb.T @ belief.v_n))
        u = np.r_[r, (f + belief.b_a) * dt]
        corrections.gather(belief, belief, belief.b_a, u, *r, dt, False)
        belief.C_nb[:] = belief.C_nb @ Rotation.from_rotvec(r).as_matrix()
    workspace = belief.workspace
    assert workspace[model.SECONDS] == pytest.approx(40 * dt)
    np.testing.assert_allclose(
        belief.C_nb @ workspace[model.FORCE], np.mean(forces, axis=0), atol=1e-6
    )
    np.testing.assert_allclose(
        belief.C_nb @ workspace[model.CENTRIFUGAL], np.mean(turns, axis=0), rtol=1e-4, atol=1e-4
    )
    assert not np.array_equal(C, belief.C_nb)
    since = workspace[model.SINCE_VELOCITY]
    workspace[model.KNOWN] = 1.0
    corrections.gather(belief, belief, belief.b_a, u, *r, dt, True)
    assert workspace[model.SECONDS] == workspace[model.KNOWN] == 0.0
    assert workspace[model.SINCE_VELOCITY] == pytest.approx(since + dt)


@pytest.mark.parametrize("raw", [0.0, 1.0])
def test_a_raw_force_keeps_its_bias(raw):
    belief = begun()
    belief.workspace[model.RAW] = raw
    corrections.gather(
        belief, belief, belief.b_a, np.r_[0, 0, 0, 0.1, 0.2, 0.3], 0.0, 0.0, 0.0, 0.1, False
    )
    bias = (1 - raw) * belief.b_a
    np.testing.assert_allclose(belief.workspace[model.FORCE], [1.0, 2.0, 3.0] - bias, atol=1e-12)


# ---- gravity


def moved(belief, T):
    """Velocity at the end of T seconds; the force that a body feels which went there steadily."""
    end = V + np.array([1.0, -2.0, 0.5]) * T
    workspace = belief.workspace
    workspace[model.SECONDS], workspace[model.KNOWN], workspace[model.VELOCITY_THEN] = T, 1.0, V
    force = (end - V) / T + 2 * np.cross(SPIN, end) - G * DOWN
    workspace[model.FORCE] = belief.C_nb.T @ force
    return end


def test_a_change_of_velocity_leaves_gravity():
    belief, T = begun(window=1.0), 2.0
    end, workspace = moved(belief, T), belief.workspace
    acceleration = (end - V) / T + 2 * np.cross(SPIN, end)
    assert corrections.level_by_velocity(belief, belief, *end, 0.04) == 3
    H, e, deviation = rows(belief, 3)
    np.testing.assert_allclose(e, 0.0, atol=1e-12)
    felt = by_turns(lambda C: -G * C.T @ DOWN, belief.C_nb)
    np.testing.assert_allclose(H[:, 6:9], felt, atol=1e-6)
    assert not np.delete(H, (6, 7, 8), axis=1).any()
    across = (acceleration[0] ** 2 + acceleration[1] ** 2) * belief.P[8, 8]
    known = workspace[model.ACCELERATION] / T + 2 * 0.04 / T**2 + across
    biases = (1 - workspace[model.RAW]) * np.diag(belief.P)[9:12]
    np.testing.assert_allclose(deviation, np.sqrt(known + biases), rtol=1e-6)
    # the next window begins with this fix
    assert (workspace[model.SECONDS], workspace[model.KNOWN]) == (0.0, 1.0)
    np.testing.assert_array_equal(workspace[model.VELOCITY_THEN], end)


def test_what_differs_from_gravity_in_size_is_noise():
    belief = begun(window=1.0)
    end = moved(belief, 2.0)
    corrections.level_by_velocity(belief, belief, *end, 0.0)
    before = rows(belief, 3)[2].copy()
    end = moved(belief, 2.0)
    belief.workspace[model.FORCE] -= 0.7 * belief.C_nb.T @ DOWN  # stronger than gravity by 0.7
    corrections.level_by_velocity(belief, belief, *end, 0.0)
    _, e, after = rows(belief, 3)
    np.testing.assert_allclose(e, -0.7 * belief.C_nb[2], atol=1e-9)
    np.testing.assert_allclose(after**2 - before**2, 0.49, rtol=1e-6)


@pytest.mark.parametrize("share, rows_of", [(0.89, 0), (0.9, 3), (0.91, 3)])
def test_a_window_is_not_cut_short(share, rows_of):
    belief = begun(window=2.0)
    end = moved(belief, 2.0 * share)
    belief.workspace[model.SINCE_VELOCITY] = 1.0
    assert corrections.level_by_velocity(belief, belief, *end, 0.04) == rows_of
    assert belief.workspace[model.SINCE_VELOCITY] == 0.0
    kept = V if rows_of == 0 else end
    np.testing.assert_array_equal(belief.workspace[model.VELOCITY_THEN], kept)


def test_the_first_velocity_only_begins_a_window():
    belief = begun()
    assert corrections.level_by_velocity(belief, belief, *V, 0.04) == 0
    assert belief.workspace[model.KNOWN] == 1.0
    np.testing.assert_array_equal(belief.workspace[model.VELOCITY_THEN], V)


@pytest.mark.parametrize("since, T, made", [(3.0, 1.0, 3), (2.9, 1.0, 0), (3.0, 0.9, 0)])
def test_without_velocities_the_turn_alone_is_taken_off(since, T, made):
    belief = begun(window=1.0)
    workspace, spin = belief.workspace, np.array([0.1, 0.2, -0.3])
    belief.omega[:] = spin
    workspace[model.SINCE_VELOCITY], workspace[model.SECONDS] = since, T
    workspace[model.KNOWN] = 1.0
    workspace[model.CENTRIFUGAL] = [0.5, -0.6, 0.7]
    workspace[model.FORCE] = -G * belief.C_nb[2] + [0.5, -0.6, 0.7]
    assert corrections.level_alone(belief, belief, NOISE) == made
    assert (workspace[model.SECONDS] == 0) == (workspace[model.KNOWN] == 0) == bool(made)
    if made:
        _, e, deviation = rows(belief, 3)
        np.testing.assert_allclose(e, 0.0, atol=1e-12)
        swing = spin @ spin * np.trace(belief.P[3:6, 3:6])
        known = (workspace[model.ACCELERATION] + NOISE.accel**2) / T + swing
        biases = (1 - workspace[model.RAW]) * np.diag(belief.P)[9:12]
        np.testing.assert_allclose(deviation**2, known + biases, rtol=1e-9)


# ---- the course


def coursed(rph=RPH, v=V, std=0.1, since=1.0, **options):
    belief = begun(rph, **options)
    belief.workspace[model.SINCE_HEADING] = 100.0
    return belief, corrections.course(belief, belief, v[0], v[1], std, since)


def test_a_course_is_a_heading():
    belief, made = coursed(correlation=10.0, crab=5.0)
    (H,), (e,), (deviation,) = rows(belief, 1)
    assert made == 1
    expected = by_turns(lambda C: np.array([math.atan2(C[1, 0], C[0, 0])]), belief.C_nb)[0]
    np.testing.assert_allclose(H[6:9], expected, atol=1e-8)
    assert not np.delete(H, (6, 7, 8)).any()
    off = math.atan2(V[1], V[0]) - RPH[2]
    assert e == pytest.approx(math.remainder(off, 2 * math.pi)) and abs(off) > 2.9
    # of an angle that lasts 10 s, twenty fixes of 1 s are one
    noise = (0.1 / 50.0) ** 2 + math.radians(5.0) ** 2 * 20.0
    assert deviation == pytest.approx(math.sqrt(noise), rel=1e-9)
    assert belief.workspace[model.HELD] == 0.0


def test_fixes_further_apart_than_the_angle_lasts_are_independent():
    belief, _ = coursed(since=60.0, correlation=10.0, crab=5.0)
    assert rows(belief, 1)[2][0] == pytest.approx(
        math.hypot(0.1 / 50.0, math.radians(5.0)), rel=1e-9
    )


@pytest.mark.parametrize(
    "changes",
    [dict(v=np.array([2.0, 2.0, 0.0])), dict(rph=(1.2, 0.0, 0.5)), dict(rph=(-1.2, 0, 0))],
)
def test_slow_or_banked_the_heading_is_held_and_the_time_counted(changes):
    belief, made = coursed(since=2.0, min_speed=3.0, **changes)
    workspace = belief.workspace
    assert made == 0 and workspace[model.HELD] == workspace[model.SLOW] == 2.0
    assert workspace[model.CONDITION] == 0.0
    v = changes.get("v", V)
    for _ in range(math.ceil(LONG_HELD / 3)):  # a pause counts as 3 s at most
        before = workspace[model.HELD]
        assert corrections.course(belief, belief, v[0], v[1], 0.1, 50.0) == 0
        assert workspace[model.HELD] == before + model.MAX_WITHOUT_VELOCITY
    assert workspace[model.CONDITION] == 1.0


def test_a_course_ends_the_condition_but_not_the_count():
    belief, _ = coursed(v=np.array([1.0, 0.0, 0.0]), since=2.0, min_speed=3.0)
    belief.workspace[model.CONDITION] = 1.0
    assert corrections.course(belief, belief, V[0], V[1], 0.1, 1.0) == 1
    assert belief.workspace[model.SLOW] == belief.workspace[model.CONDITION] == 0.0
    assert belief.workspace[model.HELD] == 2.0


@pytest.mark.parametrize("since, made", [(model.TRUSTED - 0.1, 0), (model.TRUSTED, 1)])
def test_a_heading_measured_lately_takes_its_place(since, made):
    belief = begun()
    belief.workspace[model.SINCE_HEADING] = since
    assert corrections.course(belief, belief, V[0], V[1], 0.1, 1.0) == made
    assert belief.workspace[model.HELD] == 0.0


# ---- the correction


@pytest.mark.parametrize("nis, bound, factor", [(2.0, 1.0, 2.0), (0.5, 1.0, 1.0)])
def test_rows_far_off_count_for_less(nis, bound, factor):
    """One row with H = e8: K = P/(P + R) with R grown by how far it is beyond."""
    belief = begun()
    P, workspace = belief.P, belief.workspace
    H, innovation, deviation = rows(belief, 1)
    H[:], H[0, 8] = 0.0, 1.0
    variance, R = P[8, 8], 0.01
    innovation[0] = math.sqrt(nis * (variance + R))
    deviation[0] = math.sqrt(R)
    workspace[model.ERROR] = 0.0
    corrections.correct_rows(P, workspace, innovation, deviation, 1, math.inf, bound)
    gain = variance / (variance + R * factor)
    assert workspace[model.ERROR][8] == pytest.approx(gain * math.sqrt(nis * (variance + R)))
    assert P[8, 8] == pytest.approx(variance * (1 - gain))
    assert workspace[model.FAR_COURSES] == (factor > 1) and workspace[model.FAR_VECTORS] == 0


def test_many_far_in_a_row_let_stage_one_grow():
    belief = begun()
    P, workspace = belief.P, belief.workspace
    workspace[model.FAR_COURSES] = corrections.MANY_FAR - 1
    H, innovation, deviation = rows(belief, 1)
    H[:], H[0, 8] = 0.0, 1.0
    before, R = P.copy(), 1e-4
    innovation[0], deviation[0] = math.sqrt(4.0 * (P[8, 8] + R)), math.sqrt(R)
    corrections.correct_rows(P, workspace, innovation, deviation, 1, math.inf, 1.0)
    grown = np.diag(P) / np.diag(before)
    np.testing.assert_allclose(grown[[6, 7, 12, 13, 14]], 4.0, rtol=1e-9)
    np.testing.assert_allclose(grown[[0, 1, 2, 3, 4, 5, 9, 10, 11]], 1.0, rtol=1e-9)
    assert P[8, 8] == pytest.approx(4 * before[8, 8] * R / (4 * before[8, 8] + R))


@pytest.mark.parametrize("gate, used", [(1.1, True), (0.9, False)])
def test_a_fix_beyond_its_gate_changes_nothing(gate, used):
    belief = begun()
    P, workspace = belief.P, belief.workspace
    H, innovation, deviation = rows(belief, 1)
    H[:], H[0, 3] = 0.0, 1.0
    innovation[0], deviation[0] = math.sqrt(P[3, 3] + 1e-4), 1e-2
    before = P.copy()
    nis = corrections.correct_rows(P, workspace, innovation, deviation, 1, gate, math.inf)
    assert nis == pytest.approx(1.0)
    assert (workspace[model.ERROR][3] != 0) == used == (not np.array_equal(P, before))
