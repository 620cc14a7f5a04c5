"""What is kept of the last seconds against closed forms: an acceleration that is constant or swings
in n, of a body that turns at a constant rate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.core.loop.body_motion import ROWS
from strapdown.core.loop.contract import FilterState
from strapdown.core.loop.stages.clock import AHEAD, BEHIND, followed_back, keep
from strapdown.core.mathematics.earth import gravity
from strapdown.core.mathematics.source import new_source
from strapdown.data.solution import Source
from strapdown.data.vehicle import find
from strapdown.engine.plausible_limits import limits
from strapdown.engine.prepare import new_cursor
from strapdown.filters.ins.closed_loop import CLOSED_LOOP
from strapdown.sensor_models.imu import imu as imu_spec

pytestmark = pytest.mark.short
LLA = np.array([0.7, 0.2, 300.0])
G = np.array([0.0, 0.0, gravity(np.sin(LLA[0]), LLA[2])])
TURNING = np.array([0.3, -0.4, 0.8])  # rad/s, body
C0 = Rotation.from_euler("ZYX", [1.0, 0.1, -0.3])
V0 = np.array([12.0, -5.0, 0.5])


class Constant:
    """v and p from the start of a constant acceleration."""

    a = np.array([1.5, -2.0, 0.3])

    def v(self, t):
        return V0 + self.a * t

    def p(self, t):
        return V0 * t + 0.5 * self.a * t * t


class Swinging:
    """The same of one that swings at 1 rad/s."""

    a = np.array([1.5, -2.0, 0.3])

    def v(self, t):
        return V0 + self.a * np.sin(t)

    def p(self, t):
        return V0 * t + self.a * (1 - np.cos(t))


def attitude(t):
    return C0 * Rotation.from_rotvec(TURNING * t)


def belief_of(motion, t):
    return FilterState(
        LLA.copy(),
        motion.v(t),
        attitude(t).as_matrix(),
        np.array([0.1, 0.2, 0.3]),
        np.zeros(3),
        1e-8 * np.eye(16),
        TURNING.copy(),
        np.zeros(3),
        np.zeros(1),
        np.zeros(1),
    )


def moved_through(motion, times):
    """(cursor, the belief at the last time) after predictions from each time to the next; the
    force of each is the mean in n as the body stands in the middle. Coriolis is left out: it is
    given to the motion by a force of its own."""
    gnss = Source("position", [1.0], [LLA], [[1.0] * 3], estimate={"clock": (0.1,)})
    noise = imu_spec("tactical").noise()
    cursor = new_cursor(CLOSED_LOOP, times[0], (gnss,), limits(None, noise, find(None)))
    belief = belief_of(motion, times[0])
    for begin, end in zip(times, times[1:]):
        belief = belief_of(motion, end)
        mean = (motion.v(end) - motion.v(begin)) / (end - begin) - G
        belief.f[:] = attitude(0.5 * (begin + end)).inv().apply(mean)
        keep.py_func(belief, np.zeros(6), end - begin, cursor, np.zeros(0))
    return cursor, belief


def looked_back(cursor, belief, age, delay=0.3):
    """(whether it can be told, parameters): the clock is such that the fix held `age` s ago."""
    source = new_source(clock_state=15, delay=delay, gate=1.0)
    belief.augmented[0] = delay - age
    return followed_back(belief, source, cursor), source


def check(motion, times, age, tolerance):
    """Position and velocity `age` s before the last time, rate and attitude then."""
    cursor, belief = moved_through(motion, times)
    told, found = looked_back(cursor, belief, age)
    now, C = times[-1], belief.C_nb
    assert told and found.age == pytest.approx(age) and found.clock == pytest.approx(0.3 - age)
    coriolis = found.gravity - G
    # 2 omega v: known to the filter, not to this motion
    assert np.abs(coriolis).max() < 2e-4 * np.linalg.norm(belief.v_n)
    back = motion.v(now) - C @ found.force - age * G
    np.testing.assert_allclose(back, motion.v(now - age), atol=tolerance)
    there = motion.p(now) - age * motion.v(now) + C @ found.lag + 0.5 * age**2 * G
    np.testing.assert_allclose(there, motion.p(now - age), atol=tolerance)
    np.testing.assert_allclose(found.rate + belief.omega, TURNING, atol=1e-9)
    turn = attitude(now).inv() * attitude(now - age)
    np.testing.assert_allclose(found.turn, turn.as_matrix(), atol=1e-9)
    np.testing.assert_array_equal(found.bias_then, belief.b_a)
    return found


EVEN = np.arange(0, 1.0 + 1e-9, 0.01)


@pytest.mark.parametrize("age", [0.0, 0.004, 0.05, 0.123, 0.3, 0.987])
def test_a_fix_inside_what_was_kept(age):
    check(Constant(), EVEN, age, 2e-4)
    check(Swinging(), EVEN, age, 3e-4)


@pytest.mark.parametrize("age", [-0.005, -0.1, -0.4])
def test_a_fix_that_has_not_happened_yet_goes_on_as_before(age):
    check(Constant(), EVEN, age, 1e-3)


@pytest.mark.parametrize("kept", [0.02, 0.1, 0.25])
@pytest.mark.parametrize("age", [0.3, 0.45])
def test_a_fix_before_the_first_row_goes_back_as_it_went_on(age, kept):
    """Gravity alone would make 0.4 m of 0.3 s."""
    check(Constant(), np.arange(0, kept + 1e-9, 0.01), age, 2e-3)


@pytest.mark.parametrize("step", [0.004, 0.01, 0.05])
def test_the_ring_wraps_around(step):
    times = np.arange(0, 3.5 * ROWS * max(step, 0.01), step)
    for age in (0.2, 1.0, 2.45):
        check(Constant(), times, age, 3e-4 if step < 0.02 else 4e-3)


def test_the_steps_of_a_gap():
    uneven = np.r_[EVEN, 1.0 + 0.1 * np.arange(1, 8), 1.71, 1.72]
    for age in (0.01, 0.3, 0.68, 1.5):
        check(Constant(), uneven, age, 6e-3)  # 0.1 s of turning is not in one force


def test_the_mean_force_is_that_about_the_instant():
    found = check(Swinging(), np.arange(0, 2.0, 0.005), 0.5, 3e-4)
    cursor, belief = moved_through(Swinging(), np.arange(0, 2.0, 0.005))
    mean = (Swinging().v(1.495 + 0.1) - Swinging().v(1.495 - 0.1)) / 0.2 - G
    np.testing.assert_allclose(belief.C_nb @ found.force_then, mean, atol=2e-3)


@pytest.mark.parametrize("age", [BEHIND + 2, 1e6, -AHEAD - 0.5, -1e9])
def test_a_clock_that_ran_away_stays_at_the_limit(age):
    cursor, belief = moved_through(Constant(), np.arange(0, 6.0, 0.01))
    told, found = looked_back(cursor, belief, age)
    assert not told and found.age == (BEHIND if age > 0 else -AHEAD)
    assert all(np.isfinite(number).all() for number in found.tolist())
    limit, _ = looked_back(cursor, belief, found.age)
    assert limit


def line_left(path, s, sigma):
    """(3,) mean square distance of a motion from its line, with weights of two sigma about s."""
    u = 0.5 * (EVEN[1:] + EVEN[:-1]) - s
    u = u[np.abs(u) < 6 * sigma]
    w = np.exp(-0.5 * (u / (2 * sigma)) ** 2)
    y = np.array([path(s + each) for each in u])
    slope, value = np.polyfit(u, y, 1, w=np.sqrt(w))
    return w @ (y - value - u[:, None] * slope) ** 2 / w.sum(), value


@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_what_an_uncertain_clock_bends_is_what_a_line_leaves(sigma):
    """Of position and velocity, without a lever arm."""
    motion, s = Swinging(), EVEN[-1] - 0.3
    cursor, belief = moved_through(motion, EVEN)
    belief.P[15, 15] = sigma**2
    _, found = looked_back(cursor, belief, 0.3)
    left, _ = line_left(motion.v, s, sigma)
    np.testing.assert_allclose(found.bent_velocity, np.sqrt(left), atol=2e-4, rtol=0.03)
    left, value = line_left(motion.p, s, sigma)
    left += (value - motion.p(s)) ** 2
    np.testing.assert_allclose(found.bent_position, np.sqrt(left), atol=2e-4, rtol=0.03)


class Shaking(Swinging):
    """A velocity that swings within 0.3 s."""

    rate = 2 * np.pi / 0.3

    def v(self, t):
        return V0 + self.a * np.sin(self.rate * t)

    def p(self, t):
        return V0 * t + self.a * (1 - np.cos(self.rate * t)) / self.rate


def test_a_swing_that_repeats_within_an_uncertain_clock_is_noise():
    """By its slope the clock would settle at another of the swings."""
    times = np.arange(0, 2.0, 0.005)
    cursor, belief = moved_through(Shaking(), times)
    belief.P[15, 15] = 0.1**2
    _, found = looked_back(cursor, belief, 0.5)  # where the velocity changes fastest
    swing = Shaking.a * Shaking.rate
    assert np.abs(belief.C_nb @ found.force_then + G).max() < 0.02 * np.abs(swing).max()
    np.testing.assert_allclose(
        found.bent_velocity, np.abs(Shaking.a) / np.sqrt(2), rtol=0.1, atol=0.02
    )
