"""A flight from standing to standing: the ground, the air, the wind; and the envelope of the
simulated flight of Alam et al."""

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.motions import G
from strapdown.sim.scenario import scenario
from strapdown.sim.sortie import LIFT_OFF, airborne, sortie
from strapdown.sim.trajectory import DEG, normal_gravity, rates, sample

PLACE = (50 * DEG, 14 * DEG, 450.0)
ROLL_AND_FLY = [
    {"duration": 10.0},
    {"duration": 16.0, "speed": 40.0},
    {"duration": 30.0},
    {"duration": 20.0, "turn": 120 * DEG, "climb": 2.0},
    {"duration": 30.0},
    {"duration": 16.0, "speed": 5.0},
    {"duration": 10.0, "turn": 90 * DEG},
    {"duration": 4.0, "speed": 0.0},
    {"duration": 30.0},
]


def test_the_flight_of_alam_has_the_stated_envelope():
    """33 min, 450 to 1040 m, rates to 50 deg/s, specific force along z from -5.2 to +2.3 g; a
    DMU-10 at 200 Hz, GNSS at 5 Hz."""
    flown = scenario("alam")
    assert flown.duration == 33 * 60 and flown.rate == 200 and flown.imu == "dmu10"
    assert flown.gnss == Gnss(0.2, (2.1, 2.1, 3.5), (0.1, 0.1, 0.15), (0.4, 0.0, -0.5))
    t = np.arange(0.0, flown.duration, 0.02)
    truth = sample(flown.motion, t)
    height, speed = truth.lla[:, 2], np.linalg.norm(truth.v_n, axis=1)
    assert (height.min(), height.max()) == pytest.approx((450, 1040), abs=1.0) and height[
        [0, -1]
    ] == pytest.approx([450, 450], abs=1.0)
    omega, f = rates(flown.motion, t, truth.lla.T, normal_gravity)
    assert (omega.min() / DEG, omega.max() / DEG) == pytest.approx((-50, 50), abs=3.0)
    assert (f[2].min() / G, f[2].max() / G) == pytest.approx((-5.2, 2.3), abs=0.05)
    assert np.abs(f[1]).max() < 0.2 * G  # turns are coordinated
    parked = (t < 55) | (t > 1970)
    assert speed[parked].max() < 1e-3 and np.abs(truth.rph[parked, :2]).max() < 1e-6
    assert (speed > 35).sum() * 0.02 == pytest.approx(26 * 60, abs=60)  # in the air
    dive = np.convolve(-truth.v_n[:, 2], np.ones(500) / 500, "valid")
    assert dive.min() < -20 and dive.max() > 3.5  # m/s over 10 s
    spec = imu_spec("dmu10")
    assert spec.gyro.saturation > np.abs(omega).max() and spec.accel.saturation > np.abs(f).max()


def test_every_outage_of_the_protocol_is_in_the_air():
    truth = scenario("alam").glance(1981)
    for stop in (600, 900, 1200, 1500, 1800):
        own = (truth.t >= stop - 30) & (truth.t <= stop)
        assert np.linalg.norm(truth.v_n[own], axis=1).min() > 35 and truth.lla[own, 2].min() > 500


def test_it_stands_and_rolls_level_and_flies_with_the_wind():
    speed, out_of = 8.0, 200 * DEG
    motion = sortie(PLACE, 30 * DEG, ROLL_AND_FLY, wind=speed, wind_from=out_of, roughness=0.0)
    truth = sample(motion, np.arange(0.0, motion.end, 0.1))
    roll, pitch, heading = truth.rph.T
    still = (truth.t < 1) | (truth.t > motion.end - 8)
    assert np.abs(truth.v_n[still]).max() < 1e-3 and np.abs(truth.rph[still, :2]).max() < 1e-6
    taxi = (truth.t > 126) & (truth.t < 129)  # a turn on the wheels
    assert np.abs(roll[taxi]).max() < 1e-6 and np.hypot(*truth.v_n[taxi, :2].T) == pytest.approx(
        5.0, abs=0.1
    )
    straight = (truth.t > 36) & (truth.t < 46)
    air = truth.v_n[straight, :2] - speed * np.array(
        [np.cos(out_of + np.pi), np.sin(out_of + np.pi)]
    )
    assert np.hypot(*air.T) == pytest.approx(40.0, abs=1e-3)
    assert np.arctan2(air[:, 1], air[:, 0]) == pytest.approx(heading[straight], abs=1e-6)
    crab = np.arctan2(truth.v_n[straight, 1], truth.v_n[straight, 0]) - heading[straight]
    assert np.sin(crab) == pytest.approx(
        speed / np.hypot(*truth.v_n[straight, :2].T) * np.sin(out_of + np.pi - 30 * DEG), abs=1e-6
    )
    turn = (truth.t > 64) & (truth.t < 68)
    rate = 120 * DEG / 20.0
    assert np.tan(roll[turn]) == pytest.approx(40.0 * rate / G, rel=1e-2) and pitch[
        turn
    ] == pytest.approx(2.5 * DEG + 2.0 / 40.0, abs=1e-3)


@pytest.mark.short
def test_the_share_of_the_weight_on_the_wings():
    assert (
        airborne(LIFT_OFF) == 0.5
        and airborne(0.0) < 1e-11
        and airborne(40.0) == pytest.approx(1.0, abs=1e-5)
    )
    step = 1e-20
    assert airborne(np.array([26.0 + 1j * step])).imag / step == pytest.approx(
        (airborne(26.001) - airborne(25.999)) / 0.002, rel=1e-6
    )


@pytest.mark.short
@pytest.mark.parametrize(
    "change, words",
    [
        (
            {"legs": [{"duration": 10.0, "climb": 2.0}]},
            "leg 1 .*climb of 2 m/s at a speed of 0 m/s; it must fly at 27 m/s",
        ),
        (
            {"legs": [{"duration": 10.0}, {"duration": 9.0, "climb": -40.0}], "speed": 39.0},
            "leg 2 .*not slower than it climbs",
        ),
        ({"wind": -1.0}, "wind must be 0 m/s or more"),
        ({"wind": np.inf}, "wind must be"),
        ({"wind_from": np.nan}, "wind must be"),
        ({"legs": []}, "a leg or more"),
    ],
)
def test_impossible_sorties_are_refused(change, words):
    with pytest.raises(DataError, match=words):
        sortie(**{"start": PLACE, "course": 0.0, "legs": ROLL_AND_FLY, **change})
