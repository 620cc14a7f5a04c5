"""The magnetometer: its equation term by term against matrices written out, its noise, its
times, its full scale, and what no magnetometer is."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from strapdown.checks import DataError
from strapdown.data.solution import Trajectory
from strapdown.sensor_models.magnetometer import Disturbance, Magnetometer
from strapdown.sim.motions import hand_held
from strapdown.sim.trajectory import DEG, sample, static

pytestmark = pytest.mark.short
FIELD = (21e-6, 1.5e-6, 43e-6)  # T NED
PLACE = (48 * DEG, 11 * DEG, 500.0)
HAND = sample(hand_held(PLACE), np.arange(2001) / 100)
QUIET = 1e-15  # T: noise that no comparison sees


def to_body(roll, pitch, heading):
    """C_bn = R_x(roll)' R_y(pitch)' R_z(heading)', entry by entry."""
    (cr, sr), (cp, sp), (ch, sh) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, heading))
    about_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    return about_x @ about_y @ np.array([[ch, sh, 0], [-sh, ch, 0], [0, 0, 1]])


def read(truth=HAND, seed=0, **changes):
    return Magnetometer(**{"std": QUIET, "field": FIELD, **changes}).measure(
        truth, np.random.default_rng(seed)
    )


@pytest.mark.parametrize(
    "rph", [(0, 0, 0), (0, 0, 180), (30, -20, 250), (-170, 60, 91), (90, 0, 359)]
)
def test_the_field_at_rest_is_the_one_turned_into_the_body(rph):
    angles = np.array(rph) * DEG
    source = read(sample(static(PLACE, tuple(angles)), [0.0, 1.0, 2.0]))
    assert (
        source.kind == "magnetic-field"
        and source.name == "magnetometer"
        and source.parameters == FIELD
    )
    assert source.y.shape == source.std.shape == (2, 3) and np.array_equal(source.t, [1, 2])
    np.testing.assert_allclose(source.y, [to_body(*angles) @ FIELD] * 2, atol=1e-13)


@pytest.mark.parametrize("heading", range(0, 360, 45))
def test_level_heading_is_minus_the_angle_of_the_horizontal_field_plus_declination(heading):
    x, y, _ = read(sample(static(PLACE, (0, 0, heading * DEG)), [0.0, 1.0])).y[0]
    assert np.angle(
        np.exp(1j * (-np.arctan2(y, x) + np.arctan2(FIELD[1], FIELD[0]) - heading * DEG))
    ) == pytest.approx(0, abs=1e-8)


def test_every_distortion_enters_where_the_equation_says():
    iron, hard, scale = (
        ((1.1, 0.05, -0.02), (0.03, 0.9, 0.04), (-0.06, 0.01, 1.05)),
        (12e-6, -7e-6, 30e-6),
        (0.02, -0.03, 0.01),
    )
    windows = (
        Disturbance(5.0, 7.0, (3e-6, -4e-6, 5e-6)),
        Disturbance(6.0, 9.0, (-8e-6, 2e-6, 1e-6), "b"),
        Disturbance(6.5, 6.75, (1e-6, 0, 0), "n"),
    )
    source = read(hard_iron=hard, soft_iron=iron, scale=scale, disturbances=windows)
    for t, y in zip(source.t, source.y):
        around = (
            np.array(FIELD)
            + np.array([3e-6, -4e-6, 5e-6]) * (5 <= t < 7)
            + np.array([1e-6, 0, 0]) * (6.5 <= t < 6.75)
        )
        felt = to_body(*HAND.rph[round(100 * t)]) @ around + np.array([-8e-6, 2e-6, 1e-6]) * (
            6 <= t < 9
        )
        expected = [
            sum((1 + scale[i]) * iron[i][j] * felt[j] for j in range(3)) + hard[i] for i in range(3)
        ]
        assert y == pytest.approx(expected, abs=1e-13)


def test_the_noise_is_white_and_as_stated():
    """Chi-square of the variance, normal of mean and of neighbours' correlation: nine checks,
    together 0.1 % false alarms."""
    std, side = np.array([0.2e-6, 0.4e-6, 0.9e-6]), 0.001 / 9 / 2
    noise = (read(std=tuple(std), seed=11).y - read().y) / std
    n = len(noise)
    low, high = chi2.ppf([side, 1 - side], n)
    assert np.all((low < (noise**2).sum(axis=0)) & ((noise**2).sum(axis=0) < high))
    bound = norm.ppf(1 - side) / np.sqrt(n)
    assert (
        np.abs(noise.mean(axis=0)).max() < bound
        and np.abs((noise[1:] * noise[:-1]).mean(axis=0)).max() < bound
    )
    assert np.array_equal(read(std=tuple(std)).std, np.tile(std, (n, 1)))


def test_a_seed_repeats_and_another_does_not():
    one, same, other = (read(std=1e-6, seed=seed).y for seed in (1, 1, 2))
    assert np.array_equal(one, same) and not np.any(one == other)


@pytest.mark.parametrize("rate", [10.0, 40.0, 100.0])
def test_samples_come_at_their_rate_and_belong_to_their_times(rate):
    source = read(rate=rate)
    np.testing.assert_allclose(source.t, np.arange(1, 20 * rate + 1) / rate, rtol=1e-12)
    exact = sample(hand_held(PLACE), source.t)
    expected = [to_body(*angles) @ FIELD for angles in exact.rph]
    # T: a constant rate over 10 ms misses angular accelerations, here below 20 rad/s^2
    between = 20 * 0.01**2 / 8 * 50e-6
    np.testing.assert_allclose(source.y, expected, rtol=0, atol=between if rate == 40 else 1e-13)


def test_without_a_rate_there_is_one_with_every_imu_sample():
    assert np.array_equal(read().t, HAND.t[1:])


def test_full_scale_clips_and_is_counted():
    sensor = Magnetometer(std=1e-6, field=FIELD, saturation=40e-6)
    plan = sensor.plan(HAND)
    source = plan.fixes(np.random.default_rng(3))
    free = Magnetometer(std=1e-6, field=FIELD).measure(HAND, np.random.default_rng(3)).y
    np.testing.assert_array_equal(source.y, np.clip(free, -40e-6, 40e-6))
    beyond = int((np.abs(free) >= 40e-6).any(axis=1).sum())
    assert 0 < beyond < 2000 and plan.notes(source) == [
        f"magnetometer: {beyond} of 2000 samples saturated at 40 uT"
    ]
    assert Magnetometer(field=FIELD, saturation=1e-3).plan(HAND).notes(source) == []


def test_a_field_given_at_the_measurement_stands_before_the_sensors_own():
    source = Magnetometer(std=QUIET).measure(HAND, np.random.default_rng(0), (18e-6, 0, 50e-6))
    assert source.parameters == (18e-6, 0.0, 50e-6)
    assert np.linalg.norm(source.y, axis=1) == pytest.approx(np.hypot(18e-6, 50e-6), abs=1e-12)
    own = Magnetometer(std=QUIET, field=FIELD).measure(
        HAND, np.random.default_rng(0), (18e-6, 0, 50e-6)
    )
    np.testing.assert_array_equal(own.y, source.y)


def test_the_exact_reading_has_no_error_but_states_the_noise():
    plan = Magnetometer(
        std=2e-6,
        hard_iron=(1e-5,) * 3,
        scale=0.1,
        field=FIELD,
        disturbances=((0.0, 9.0, (1e-6,) * 3),),
    ).plan(HAND, gate=np.inf)
    np.testing.assert_array_equal(plan.exact().y, plan.ideal)
    np.testing.assert_allclose(plan.exact().y, read().y, atol=1e-13)
    assert plan.exact().gate == np.inf and set(plan.exact().std.ravel()) == {2e-6}


def test_a_rate_that_leaves_no_sample_is_noted():
    plan = Magnetometer(rate=0.01, field=FIELD).plan(HAND)
    assert plan.notes(plan.fixes(np.random.default_rng(0))) == [
        "magnetometer: not one sample falls into the recording; its rate is too low"
    ]


@pytest.mark.parametrize(
    "change, words",
    [
        ({"rate": 0}, "rate is 0 Hz; it must be a finite number above 0"),
        ({"rate": True}, "rate is True"),
        ({"std": (1e-6, 0, 1e-6)}, "in tesla, each above 0"),
        ({"std": 0.5}, "in tesla, .* at most 0.1"),
        ({"std": (1e-6, 1e-6)}, "std is .*; it must be 3 finite numbers"),
        ({"hard_iron": 1e-6}, "hard_iron is 1e-06; it must be 3"),
        ({"hard_iron": (12, 0, 0)}, "in tesla, .* at most 0.1"),
        ({"hard_iron": (np.nan, 0, 0)}, "3 finite numbers"),
        ({"scale": (-1, 0, 0)}, "each above -1"),
        ({"scale": "x"}, "3 finite numbers"),
        ({"soft_iron": np.eye(2)}, "3 x 3 finite numbers"),
        ({"soft_iron": "iron"}, "3 x 3 finite numbers"),
        ({"soft_iron": np.diag([1, 1, -1])}, "mirrors the field"),
        ({"soft_iron": np.diag([1, 1, 0])}, "leaves nothing of it"),
        ({"saturation": -1e-4}, "saturation is -0.0001"),
        ({"saturation": True}, "saturation is True"),
        ({"field": (48, 0, 0)}, "in tesla, .* at most 0.0001"),
        ({"field": (0, 0, 0)}, "field is 0; give the Earth's"),
        ({"field": (1e-6, 2e-6)}, "field is .*3 finite numbers"),
        ({"disturbances": ((3.0, 2.0, (1e-6,) * 3),)}, "start must come before its stop"),
        (
            {"disturbances": ((1.0, 2.0, 1e-6),)},
            "field of a disturbance is 1e-06; it must be 3",
        ),
        ({"disturbances": ((1.0, 2.0, (1e-6,) * 3, "e"),)}, "frame is 'e'"),
        ({"disturbances": ((1.0,),)}, "give start and stop"),
        ({"disturbances": (3,)}, "give start and stop"),
        ({"disturbances": 3}, "disturbances is 3; it must be a list"),
        ({"hard_iron": np.eye(3)}, "hard_iron is .*3 finite numbers"),
    ],
)
def test_what_no_magnetometer_is_is_refused_in_one_line(change, words):
    with pytest.raises(DataError, match=words) as error:
        Magnetometer(**change)
    assert str(error.value).startswith("magnetometer: ") and "\n" not in str(error.value)


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(DataError, match="it has no field of its own"):
        Magnetometer().measure(HAND, np.random.default_rng(0))
    with pytest.raises(DataError, match="has no attitude"):
        Magnetometer(field=FIELD).plan(Trajectory(HAND.t, HAND.lla))
