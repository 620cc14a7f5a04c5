"""Attitude filters where the body accelerates, and where what they measure cannot be: errors stay
within five standard deviations, and what is refused is said."""

import math
from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown import aiding
from strapdown.core.loop.contract import (
    Filter,
    FilterState,
    InitialState,
    Noise,
    compile_kernel,
)
from strapdown.core.mathematics.source import new_source
from strapdown.data.solution import DOUBTFUL
from strapdown.filters import find
from strapdown.filters.attitude.attitude_error_state import SIX, count_bias, gain_update
from strapdown.filters.attitude.attitude_mekf import (
    ASIDE,
    CONTRADICTED,
    DIPPING,
    STRONG,
    STUCK,
)
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.trajectory import Motion, demo_flight, ramp, ramp_rate, static
from strapdown.typing import Array

G, DEG = 9.80665, math.pi / 180
FIELD = np.array([21e-6, 1.4e-6, 43.5e-6])
NOISE = Noise(5e-5, 1e-3, 1e-7, 1e-5, 0.0, 0.0)


def aerobatics() -> Motion:
    """Turns of 50 to 60 deg of bank, changes of speed by 3 m/s^2, pull-ups."""
    turns = [(30, 180, 10), (60, -270, 14), (95, 360, 20), (140, -90, 5)]  # s, deg, s
    speeds = [(20, 20, 7), (80, -15, 6), (125, 25, 9)]  # s, m/s, s

    def course(t):
        return 10 * DEG + sum(DEG * angle * ramp(t, at, width) for at, angle, width in turns)

    def rate(t):
        return sum(DEG * angle * ramp_rate(t, at, width) for at, angle, width in turns)

    def speed(t):
        return 45 + sum(by * ramp(t, at, width) for at, by, width in speeds)

    def climb(t):
        return 8 * np.sin(2 * np.pi * t / 40)

    def velocity(t):
        return speed(t) * np.cos(course(t)), speed(t) * np.sin(course(t)), -climb(t)

    def attitude(t):
        roll = np.arctan(speed(t) * rate(t) / G) + 2 * DEG * np.sin(2 * np.pi * t / 5.3)
        pitch = 3 * DEG + climb(t) / speed(t) + DEG * np.sin(2 * np.pi * t / 4.1)
        return roll, pitch, course(t)

    return Motion("aerobatics", (47 * DEG, 9 * DEG, 900.0), velocity, attitude)


def flown(motion, grade, seed, rate=50.0):
    recording = sd.simulate(
        motion,
        160.0,
        grade,
        seed,
        rate=rate,
        magnetometer=Magnetometer(rate=10.0),
        date="2025-06-01",
    )
    field = tuple(a for a in recording.sources if a.kind == "magnetic-field")
    return replace(recording, sources=field)


def ratio(name, recording, **options):
    """(n, 3) errors over standard deviations after 60 s."""
    solution = sd.fuse(recording, name, every=5, options=options)
    e = sd.errors(solution, recording.reference)
    return np.abs(e.attitude / e.std[:, 6:9])[e.t > 60]


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony", "vru"])
@pytest.mark.parametrize(
    "motion, grade",
    [(demo_flight, "tactical"), (aerobatics, "tactical"), (lambda: AT_REST, "consumer")],
    ids=["gentle", "hard", "rest"],
)
def test_errors_stay_within_five_standard_deviations(name, motion, grade):
    """The accelerations of the flight last, and the accelerometers of the MEMS at rest are off."""
    recording = flown(motion(), grade, 1)
    assert np.nanmax(ratio(name, recording)) < 5


AT_REST = static((48 * DEG, 11 * DEG, 500.0), (3 * DEG, -2 * DEG, 70 * DEG))


def test_without_looking_for_accelerations_they_do_not():
    """What the test above would see of a filter that takes the force for gravity and white noise."""
    assert ratio("attitude-mekf", flown(aerobatics(), "tactical", 1), disturbance=0.0).max() > 10


# ------------------------------------------------------------------ kernels by hand


def begun(filter: Filter, rph=(0.0, 0.0, 0.0), std_attitude=0.01, accel_std=0.0) -> FilterState:
    for each in (filter.predict, filter.correct, aiding.find("magnetic-field").observe):
        compile_kernel(each)
    all_std = (10.0,) * 6 + (std_attitude,) * 3 + (accel_std,) * 3 + (1e-4,) * 3
    start = InitialState(0.0, (0.8, 0.2, 0.0), (0.0,) * 3, rph, (0.0,) * 3, (0.0,) * 3, all_std)
    return filter.start(start, NOISE)


def holding(filter: Filter, belief: FilterState) -> int:
    return int(belief.workspace[filter.condition])


def measure(
    filter: Filter, belief: FilterState, y: Array, magnetometer: int = 0
) -> tuple[float, Array]:
    sensor = aiding.find("magnetic-field")
    innovation, source = np.zeros(12), new_source()
    source.parameters[:3], source.of_kind = FIELD, magnetometer
    nis = filter.correct(
        belief,
        np.array(y, float),
        np.full(3, 3e-7),
        aiding.number(sensor.name),
        sensor.observe,
        source,
        math.inf,
        innovation,
    )
    return nis, innovation


def still(
    filter: Filter,
    belief: FilterState,
    seconds: float,
    force=(0.0, 0.0, -9.81),
    field=None,
    dt=0.02,
):
    """Let the filter run over so many seconds of that specific force and field, 10 Hz."""
    u = np.r_[np.zeros(3), force] * dt
    used = 0
    for k in range(round(seconds / dt)):
        filter.predict(belief, u, dt, NOISE)
        if field is not None and k % 5 == 4:
            used += np.isfinite(measure(filter, belief, field(k * dt))[1][0])
    return used


WRONG = {
    "sign": (-FIELD, DIPPING),
    "z sign": (FIELD * [1, 1, -1], DIPPING),
    "scale": (1.5 * FIELD, STRONG),
    "hard iron": (FIELD + [0, 0, 20e-6], STRONG),
    "x and z swapped": (FIELD[[2, 1, 0]], DIPPING),
}


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
@pytest.mark.parametrize("what", WRONG)
def test_a_field_that_cannot_be_the_known_one_is_not_used_and_said(name, what):
    y, reason = WRONG[what]
    filter = find(name)
    belief = begun(filter)
    noise = np.random.default_rng(5).normal(0, 3e-7, (100, 3))
    assert still(filter, belief, 3.0, field=lambda t: FIELD + noise[int(10 * t)]) == 30
    assert holding(filter, belief) == 0
    aided = begun(filter)
    still(filter, aided, 6.0, field=lambda t: FIELD + noise[int(10 * t)])
    assert still(filter, belief, 3.0, field=lambda t: y + noise[int(10 * t)]) == 0
    assert holding(filter, belief) == reason
    assert filter.conditions[int(reason) - 1].doubtful
    assert belief.P[8, 8] > aided.P[8, 8]  # the heading is no longer measured
    # and trusted again
    assert still(filter, belief, 6.0, field=lambda t: FIELD + noise[int(10 * t)]) == 60
    assert holding(filter, belief) == 0


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_a_field_that_stays_while_the_body_turns_is_said(name):
    """0.2 rad/s about the vertical: half a radian in 2.5 s. A body at rest may repeat itself."""
    filter = find(name)
    belief = begun(filter)
    assert still(filter, belief, 10.0, field=lambda t: FIELD) == 100
    u = np.array([0, 0, 0.2, 0, 0, -9.81]) * 0.02
    found = []
    for k in range(250):
        filter.predict(belief, u, 0.02, NOISE)
        if k % 5 == 4:
            found.append(np.isfinite(measure(filter, belief, FIELD)[1][0]))
    assert sum(found) == pytest.approx(25, abs=2) and not any(found[27:])
    assert holding(filter, belief) == STUCK


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_a_field_that_stays_at_rest_is_not_stuck(name):
    """A coarse magnetometer repeats itself at rest, where gyro noise of 0.5 deg/s goes to and fro
    by 29 deg within a minute, and turns the body by none."""
    filter, rng = find(name), np.random.default_rng(6)
    belief = begun(filter)
    for k in range(6000):
        u = np.r_[rng.normal(0, 0.5 * DEG, 3), 0, 0, -9.81] * 0.02
        filter.predict(belief, u, 0.02, NOISE)
        if k % 5 == 4:
            assert np.isfinite(measure(filter, belief, FIELD)[1][0])
    assert holding(filter, belief) == 0


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
@pytest.mark.parametrize("every", [5, 50], ids=["both at 10 Hz", "the stuck one at 1 Hz"])
def test_one_magnetometer_that_is_stuck_beside_a_good_one(name, every):
    """Each has books of its own, so that the stuck one is found although the other changes. The
    heading goes on being measured, and rows stay valid."""
    filter, rate = find(name), 0.2
    belief = begun(filter)
    u = np.array([0, 0, rate, 0, 0, -9.81]) * 0.02
    for k in range(1000):
        filter.predict(belief, u, 0.02, NOISE)
        t = 0.02 * (k + 1)
        c, s = math.cos(rate * t), math.sin(rate * t)
        if k % 5 == 4:
            good = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ FIELD
            assert np.isfinite(measure(filter, belief, good, 1)[1][0])
        if k % every == every - 1:
            used = np.isfinite(measure(filter, belief, FIELD)[1][0])
            assert not (used and t > 4.0)
    heading = math.atan2(belief.C_nb[1, 0], belief.C_nb[0, 0])
    assert abs(math.remainder(heading - rate * t, math.tau)) < 3 * math.sqrt(belief.P[8, 8])
    assert holding(filter, belief) == STUCK + ASIDE
    assert not filter.conditions[int(STUCK + ASIDE) - 1].doubtful


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_what_is_refused_is_forgotten_when_its_source_is_gone(name):
    filter = find(name)
    belief = begun(filter)
    still(filter, belief, 9.0, field=lambda t: 2 * FIELD)
    assert holding(filter, belief) == STRONG
    still(filter, belief, 11.0)
    assert holding(filter, belief) == 0
    assert still(filter, belief, 1.0, field=lambda t: FIELD) == 10 and holding(filter, belief) == 0


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_a_field_that_is_refused_beside_a_heading_makes_nothing_doubtful(name):
    """While headings are used; 10 s after the last one the heading does drift with the gyros."""
    filter, compass = find(name), aiding.find("heading")
    compile_kernel(compass.observe)
    belief, kind = begun(filter), aiding.number("heading")
    y, std_y, innovation = np.zeros(3), np.full(3, 0.02), np.zeros(12)
    for _ in range(20):
        still(filter, belief, 0.5, field=lambda t: 2 * FIELD)
        filter.correct(belief, y, std_y, kind, compass.observe, new_source(), math.inf, innovation)
    still(filter, belief, 0.5, field=lambda t: 2 * FIELD)
    assert holding(filter, belief) == STRONG + ASIDE
    still(filter, belief, 11.0, field=lambda t: 2 * FIELD)
    assert holding(filter, belief) == STRONG


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony", "vru"])
def test_a_force_that_no_vertical_acceleration_explains_is_said(name):
    """30 deg of bank for a minute, at which the filter began as if it were level: the force is
    1.15 g along what it takes for the vertical. Its standard deviation grows."""
    filter = find(name)
    belief = begun(filter)
    still(filter, belief, 10.0)
    level = math.sqrt(belief.P[6, 6])
    assert holding(filter, belief) == 0
    still(filter, belief, 60.0, force=(0.0, 0.0, -9.81 / math.cos(30 * DEG)))
    assert holding(filter, belief) == CONTRADICTED
    assert math.sqrt(belief.P[6, 6]) > max(5 * level, 10 * DEG)
    still(filter, belief, 60.0)
    assert holding(filter, belief) == 0 and math.sqrt(belief.P[6, 6]) < 10 * DEG


def test_the_innovation_of_a_field_is_whitened():
    """Divided by its standard deviation, which NIS tells: N(0, 1), with the sign of the angle."""
    filter = find("attitude-mekf")
    for angle in (-0.02, 0.03):
        belief = begun(filter)
        still(filter, belief, 1.0)
        c, s = math.cos(angle), math.sin(angle)
        y = np.array([c * FIELD[0] - s * FIELD[1], s * FIELD[0] + c * FIELD[1], FIELD[2]])
        nis, innovation = measure(filter, belief, y)
        assert innovation[3] ** 2 == pytest.approx(nis)
        assert innovation[3] * innovation[0] > 0 and np.isnan(innovation[4:6]).all()


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_an_accelerometer_bias_ends_in_the_covariance(name):
    """At rest the tilt is the bias over gravity, and so is its standard deviation, however long;
    the heading by the dip as much more in attitude-mekf, whose field sees the tilt."""
    filter, bias = find(name), 0.2
    without, belief = (begun(filter, accel_std=std_) for std_ in (0.0, bias))
    for each in (without, belief):
        still(filter, each, 120.0, force=(bias, 0.0, -9.81))
    assert np.allclose(without.C_nb, belief.C_nb, atol=1e-12)  # the gains do not know it
    tilt = math.asin(abs(belief.C_nb[2, 0]))
    assert tilt == pytest.approx(bias / 9.81, rel=0.2)
    grown = math.sqrt(belief.P[7, 7] - without.P[7, 7])
    assert grown == pytest.approx(bias / 9.78, rel=0.2)


@pytest.mark.short
def test_a_correction_by_any_gain_is_josephs():
    rng = np.random.default_rng(3)
    B = rng.standard_normal((6, 12))
    P = np.zeros((15, 15))
    P[np.ix_(SIX, SIX)] = B @ B.T
    K, h, R = rng.standard_normal(6), np.r_[rng.standard_normal(3), 0, 0, 0], 0.3
    keep = np.eye(6) - np.outer(K, h)
    expected = keep @ (B @ B.T) @ keep.T + R * np.outer(K, K)
    total = gain_update(P, K, *h[:3], R)
    np.testing.assert_allclose(P[np.ix_(SIX, SIX)], expected, rtol=1e-12, atol=1e-12)
    assert total == pytest.approx(h @ (B @ B.T) @ h + R)


@pytest.mark.short
def test_biases_are_counted_and_taken_out_again():
    rng = np.random.default_rng(4)
    P, S, variance = np.zeros((15, 15)), rng.standard_normal((6, 3)), np.array([1.0, 4.0, 9.0])
    count_bias(P, S, variance, 1.0)
    np.testing.assert_allclose(P[np.ix_(SIX, SIX)], S @ np.diag(variance) @ S.T, rtol=1e-12)
    count_bias(P, S, variance, -1.0)
    assert np.abs(P).max() < 1e-12


def test_headings_that_stay_off_are_said():
    """Half a second in which the gyro reads 60 deg/s too much, 30 deg in all."""
    hand = sd.simulate("hand-held", seed=1)
    wrong = (hand.imu.t > 40) & (hand.imu.t < 40.5)
    dtheta = hand.imu.dtheta.copy()
    dtheta[wrong, 2] += np.radians(60) * hand.imu.dt[wrong]
    right = sd.fuse(hand, "attitude-mekf")
    thrown = sd.fuse(replace(hand, imu=hand.imu._replace(dtheta=dtheta)), "attitude-mekf")
    assert not right.events and (right.status == 0).all()
    ((t, text),) = thrown.events
    assert 40 < t < 46 and text.startswith("headings measured stay more than 5 deg off")
    assert thrown.seconds(DOUBTFUL) > 10
