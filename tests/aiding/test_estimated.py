"""Observations whose parameters are states, against a plain model of the whole measurement: a motion
that is integrated back from the belief, where each state may be off, to the instant of the fix."""

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown import aiding
from strapdown.core.compile.records import copy_row
from strapdown.core.loop.contract import (
    FilterState,
    compile_kernel,
)
from strapdown.core.loop.stages.clock import followed_back, keep
from strapdown.core.mathematics.source import new_source
from strapdown.data.solution import Source
from strapdown.data.vehicle import find
from strapdown.engine.plausible_limits import limits
from strapdown.engine.prepare import new_cursor
from strapdown.filters.ins.closed_loop import CLOSED_LOOP
from strapdown.sensor_models.imu import imu as imu_spec

pytestmark = pytest.mark.short
CLOCK, ARM, MOUNTING, SCALE, WIND, STATES = 15, 16, 19, 22, 23, 25
GIVEN = np.array([1.2, -0.7, 2.5])  # arm, m
LLA = np.array([0.8, 0.2, 500.0])
V = np.array([20.0, -9.0, 1.5])
C = Rotation.from_euler("ZYX", [0.7, -0.1, 0.25])
BA, BG = np.array([0.1, -0.2, 0.05]), np.array([0.01, 0.02, -0.005])
# of clock, arm, mounting, scale, wind: what the belief says of them
ESTIMATES = np.array([0.05, 0.3, -0.2, 0.1, 1e-3, -2e-3, 3e-3, 0.02, 3.0, -4.0])
NOW, WAIT = 1.0, 0.3  # s
KINDS = {
    "position": 3,
    "velocity": 3,
    "speed": 1,
    "zero-lateral-velocity": 1,
    "body-velocity": 3,
    "heading": 1,
    "true-airspeed": 1,
    "side-slip": 1,
    "angle-of-attack": 1,
    "zero-side-slip": 1,
}
LEFT_OUT = {
    "position": 1.0,
    "velocity": 0.6,
    "speed": 5.5,
    "zero-lateral-velocity": 5.5,
    "body-velocity": 5.5,
    "heading": 0.0,
    "true-airspeed": 5.5,
    "side-slip": 0.5,
    "angle-of-attack": 0.5,
    "zero-side-slip": 5.5,
}
"""Of the columns of the gyro bias: what it turns the arm, the force and the velocity in 0.25 s."""
STEPS = np.r_[
    np.repeat([0.1, 0.01, 1e-5, 1e-3, 1e-4], 3), 1e-4, [1e-2] * 3, [1e-5] * 3, 1e-4, 1e-2, 1e-2
]  # of each state


def rate(t):
    """As the gyro reads it, rad/s."""
    return BG + np.array([0.3 + 0.02 * t, -0.2, 0.5 - 0.02 * t])


def force(t):
    """As the accelerometer does, m/s^2: it varies little within the 0.2 s of a mean."""
    return BA + np.array([1.0 + 0.2 * t, 2.0 - 0.3 * t, -9.7 + 0.1 * t])


def back(t, v, attitude, b_a, b_g, r, step=1e-3):
    """(p, v, attitude) at a time before or after `NOW`, where p is 0, by the midpoint rule."""
    count = max(1, round(abs(t - NOW) / step))
    h, p, now = (t - NOW) / count, np.zeros(3), NOW
    for _ in range(count):
        omega = rate(now + 0.5 * h) - b_g
        middle = attitude * Rotation.from_rotvec(0.5 * h * omega)
        a = middle.apply(force(now + 0.5 * h) - b_a) + r
        p, v = p + h * v + 0.5 * h * h * a, v + h * a
        attitude, now = attitude * Rotation.from_rotvec(h * omega), now + h
    return p, v, attitude


def truth(kind, error, r):
    """What is measured where the states are `error` off the belief, rad, rad, m or m/s."""
    p0, dv, theta, b_a, b_g = error[:15].reshape(5, 3)
    own = ESTIMATES + error[15:]
    clock, arm, mounting, scale = own[0], GIVEN + own[1:4], own[4:7], own[7]
    wind = np.r_[own[8:], 0.0]
    t = NOW - WAIT + clock
    if kind == "heading":  # has no clock to be estimated, and is used when it comes
        attitude = Rotation.from_rotvec(theta) * C * Rotation.from_rotvec(mounting).inv()
        return attitude.as_euler("ZYX")[:1]
    p, v, attitude = back(t, V + dv, Rotation.from_rotvec(theta) * C, BA + b_a, BG + b_g, r)
    omega, to_body = rate(t) - BG - b_g, Rotation.from_rotvec(mounting).inv()
    if kind == "position":
        place = p0 + p + attitude.apply(to_body.apply(arm))
        return np.array(pymap3d.ned2geodetic(*place, *LLA, deg=False))
    if kind == "velocity":
        return v + attitude.apply(np.cross(omega, to_body.apply(arm)))
    at_point = attitude.inv().apply(v) + np.cross(omega, GIVEN)
    if aiding.find(kind).shared == "wind":
        air = to_body.inv().apply(at_point - attitude.inv().apply(wind))
        if kind == "zero-side-slip":
            return air[1:2]
        if kind == "true-airspeed":
            return (1 + scale) * np.linalg.norm(air, keepdims=True)
        return np.arctan2(air[[1 if kind == "side-slip" else 2]], air[0])
    axes = {"speed": [0], "zero-lateral-velocity": [1]}.get(kind, [0, 1, 2])
    return (1 + scale) * (to_body.apply(np.eye(3)[axes]) @ at_point)


def believed(change=np.zeros(STATES)):
    """The belief now, moved by `change`; rate and force are the last ones less the biases."""
    dp, dv, theta, b_a, b_g = change[:15].reshape(5, 3)
    return FilterState(
        np.array(pymap3d.ned2geodetic(*dp, *LLA, deg=False)),
        V + dv,
        (Rotation.from_rotvec(theta) * C).as_matrix(),
        BA + b_a,
        BG + b_g,
        1e-8 * np.eye(STATES),
        rate(NOW) - BG - b_g,
        force(NOW) - BA - b_a,
        np.zeros(1),
        ESTIMATES + change[15:],
    )


@pytest.fixture(scope="module")
def parameters():
    """Those of a source, as the loop leaves them before a fix: the motion of the last second went
    through `keep`."""
    row = new_source()
    row.parameters[:3], row.delay, row.estimated = GIVEN, WAIT, 1
    row.first_state = WIND
    row.clock_state, row.scale_state, row.turn[:] = CLOCK, SCALE, np.eye(3)
    row.arm_state[:], row.mounting_state[:] = ARM + np.arange(3), MOUNTING + np.arange(3)
    noise, dt = imu_spec("tactical").noise(), 0.005
    gnss = Source("position", [1.0], [LLA], [[1.0] * 3], estimate={"clock": (0.1,)})
    cursor = new_cursor(CLOSED_LOOP, 0.0, (gnss,), limits(None, noise, find(None)))
    belief = believed()
    for k in range(1, 201):
        middle = (k - 0.5) * dt
        belief.omega[:], belief.f[:] = rate(middle) - BG, force(middle) - BA
        belief.C_nb[...] = back(k * dt, V, C, BA, BG, np.zeros(3), 5e-3)[2].as_matrix()
        keep.py_func(belief, np.zeros(6), dt, cursor, np.zeros(0))
    last = believed()
    assert followed_back(last, row, cursor)
    row.gravity[:2] += (0.4, -0.6)  # as at high speeds, so that their signs show
    return row


def observed(kind, belief, y, parameters):
    kernel = aiding.find(kind).observe
    compile_kernel(kernel)
    innovation, H, row = np.full(3, np.nan), np.zeros((3, STATES)), np.full(3, np.nan)
    row[: len(y)] = y
    rows = kernel(belief, row, copy_row(parameters), innovation, H)
    assert rows == KINDS[kind]
    return innovation[:rows], H[:rows]


def scale_of(kind):
    """How exact an innovation is: m or m/s. The arm is turned to first order, and the motion kept
    each 10 ms."""
    return 2e-4 if kind == "position" else 8e-4


def around(kind, state, size):
    """How exact a column is: those of a mounting are at no mounting, 4e-3 rad of 22 m/s away."""
    turned = MOUNTING <= state < SCALE and kind not in ("position", "velocity")
    return 0.05 if turned else 0.01 * size


@pytest.mark.parametrize("kind", KINDS)
def test_a_right_belief_sees_no_innovation(kind, parameters):
    y = truth(kind, np.zeros(STATES), parameters.gravity)
    innovation, _ = observed(kind, believed(), y, parameters)
    np.testing.assert_allclose(innovation, 0.0, atol=scale_of(kind))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("state", range(STATES))
def test_columns_are_the_derivatives_of_the_measurement(kind, state, parameters):
    """By a state of the truth, the whole motion before it with it."""
    r, error = parameters.gravity, np.zeros(STATES)
    error[state] = STEPS[state]
    seen = [
        observed(kind, believed(), truth(kind, sign * error, r), parameters)[0] for sign in (1, -1)
    ]
    column = (seen[0] - seen[1]) / (2 * STEPS[state])
    _, H = observed(kind, believed(), truth(kind, 0 * error, r), parameters)
    size = max(1.0, np.abs(column).max())
    if 12 <= state < 15:
        np.testing.assert_allclose(H[:, state], column, atol=LEFT_OUT[kind])
    elif 9 <= state < 12:  # the attitude of one moment stands for that of all AGE
        np.testing.assert_allclose(H[:, state], column, atol=0.02)
    elif state == CLOCK:  # 0.03 rad/s^2 on an arm of 3 m is left out
        np.testing.assert_allclose(H[:, state], column, atol=0.1)
    else:
        np.testing.assert_allclose(H[:, state], column, atol=around(kind, state, size))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("state", range(STATES))
def test_columns_are_the_derivatives_of_the_innovation(kind, state, parameters):
    """By a state of the belief alone, as a sigma point has it: what was kept stays."""
    change = np.zeros(STATES)
    change[state] = STEPS[state]
    y = truth(kind, 0 * change, parameters.gravity)
    seen = [observed(kind, believed(sign * change), y, parameters)[0] for sign in (1, -1)]
    column = (seen[1] - seen[0]) / (2 * STEPS[state])
    _, H = observed(kind, believed(), y, parameters)
    size = max(1.0, np.abs(column).max())
    np.testing.assert_allclose(H[:, state], column, atol=around(kind, state, size))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("clock", [-0.1, 0.1])
def test_a_point_far_off_in_its_clock_sees_the_motion_of_then(kind, clock, parameters):
    change = np.zeros(STATES)
    change[CLOCK] = clock
    y = truth(kind, change, parameters.gravity)
    innovation, _ = observed(kind, believed(change), y, parameters)
    np.testing.assert_allclose(innovation, 0.0, atol=0.06)  # 0.1 s of a motion that changes


def test_without_a_rate_the_arm_has_no_part_in_a_velocity(parameters):
    """As before the first sample, when the belief has no rate yet."""
    resting, row = believed()._replace(omega=np.zeros(3)), copy_row(parameters)
    row.rate[:] = 0.0
    _, H = observed("velocity", resting, V, row)
    assert not H[:, ARM:SCALE].any() and H[0, 3] == 1.0
