"""Motions against pyins' IMU, pyproj's geodesics, and what aircraft, cars and ships can do."""

import numpy as np
import pyproj
import pytest
from pyins import earth, sim

from strapdown.checks import DataError
from strapdown.geometry.geodesy import displacement
from strapdown.sim.motions import G, car, flight, multicopter, ship, static, straight
from strapdown.sim.sortie import sortie
from strapdown.sim.trajectory import DEG, gravity, gravity_north, increments, sample
from strapdown.sim.waypoints import waypoints

TURNS = [
    {"duration": 20.0},
    {"turn": 180 * DEG, "bank": 25 * DEG},
    {"duration": 15.0, "climb": 3.0, "speed": 35.0},
    {
        "repeat": 3,
        "legs": [{"turn": -200 * DEG, "bank": 30 * DEG, "climb": -1.0}, {"duration": 10.0}],
    },
]
STREET = [
    {"duration": 5.0},
    {"duration": 6.0, "speed": 12.0},
    {"duration": 10.0, "gradient": 0.05},
    {"duration": 3.0, "speed": 6.0},
    {"duration": 5.0, "turn": 90 * DEG},
    {"duration": 4.0, "speed": 0.0},
    {"duration": 10.0},
]
PLACES = [
    (47.000, 9.000, 900.0),
    (47.020, 9.010, 1100.0),
    (47.020, 9.060, 1000.0),
    (46.995, 9.050, 1000.0),
    (47.010, 9.020, 1250.0),
    (47.030, 9.015, 900.0),
]
PLACES = [(lat * DEG, lon * DEG, alt) for lat, lon, alt in PLACES]
MOTIONS = {
    "static": static((50 * DEG, 8 * DEG, 300.0), 0.1, -0.2, 2.5),
    "straight": straight((-63 * DEG, 10 * DEG, 2500.0), 200 * DEG, 97.2, 300.0),
    "flight": flight((69 * DEG, 19 * DEG, 900.0), 0.4, 28.0, TURNS),
    "waypoints": waypoints(PLACES, 30.0),
    "car": car((48 * DEG, 11 * DEG, 500.0), 0.3, STREET),
    "multicopter": multicopter((47 * DEG, 8 * DEG, 500.0), 0.7, 8.0, 9.0),
    "sortie": sortie(
        (50 * DEG, 14 * DEG, 450.0),
        2.0,
        [{"duration": 4.0}, {"duration": 14.0, "speed": 40.0}, {"duration": 20.0, "turn": 1.5}],
        wind=7.0,
    ),
    "ship": ship(
        (60 * DEG, 5 * DEG, 45.0),
        5.0,
        6.0,
        [{"duration": 60.0}, {"duration": 60.0, "turn": 1.0, "speed": 4.0}],
    ),
}
ids = pytest.mark.parametrize("name", MOTIONS)


@ids
def test_increments_agree_with_pyins(name):
    """To 1e-12 rad and 3e-9 m/s per sample of 5 ms, what its splines are good for: the shaking
    car differs by 4e-13 rad, others by 2e-14."""
    motion = MOTIONS[name]
    t = np.arange(0, 30, 0.005)
    truth, ours = sample(motion, t), increments(motion, t)
    lla = np.c_[np.degrees(truth.lla[:, :2]), truth.lla[:, 2]]
    _, theirs = sim.generate_imu(t, lla, np.degrees(truth.rph), truth.v_n, "increment")
    # pyins is of first order in height, and its gravity points straight down
    lacking = gravity(truth.lla[:, 0], truth.lla[:, 2]) - earth.gravity(lla[:, 0], lla[:, 2])
    north = gravity_north(truth.lla[:, 0], truth.lla[:, 2])
    correction = truth.rotation.inv().apply(np.c_[north, 0 * t, lacking])[1:] * ours.dt[:, None]
    inner = slice(10, -10)  # its splines are worst at the ends
    for mine, other, tolerance in (
        (ours.dtheta, theirs.iloc[1:, :3], 1e-12),
        (ours.dv + correction, theirs.iloc[1:, 3:], 3e-9),
    ):
        difference = (mine - other.to_numpy())[inner]
        assert np.abs(difference).max() < tolerance
        assert np.abs(difference.sum(axis=0)).max() < 100 * tolerance  # rounding, not drift


@pytest.mark.parametrize(
    "start, azimuth, speed, seconds",
    [
        ((47.6, -101.5, 2800.0), 60.0, 97.2, 5400.0),
        ((-63.4, 179.0, 3000.0), 110.0, 97.2, 1800.0),
        ((0.5, 30.0, 100.0), 181.0, 280.0, 1800.0),
        ((80.0, 10.0, 11000.0), 40.0, 250.0, 3600.0),
    ],
)
def test_a_straight_flight_follows_the_geodesic(start, azimuth, speed, seconds):
    """Within 1 mm across and 1 mm along it, over up to 900 km; pyproj's own accuracy is some
    nanometres."""
    lat, lon, height = start
    motion = straight((lat * DEG, lon * DEG, height), azimuth * DEG, speed, seconds)
    truth = sample(motion, np.linspace(0, seconds, 19)[1:], longest=1.0)
    there, _, distance = pyproj.Geod(ellps="WGS84").inv(
        np.full(18, lon), np.full(18, lat), np.degrees(truth.lla[:, 1]), np.degrees(truth.lla[:, 0])
    )
    across = np.sin((there - azimuth) * DEG) * distance
    assert np.abs(across).max() < 1e-3
    assert np.all(truth.lla[:, 2] == height) and np.linalg.norm(truth.v_n, axis=1) == pytest.approx(
        speed, rel=1e-12
    )
    # the foot is slower, by the height over the radius
    assert 0.998 < distance[-1] / (speed * seconds) < 1.0
    assert np.diff(distance, prepend=0.0) == pytest.approx(
        np.diff(truth.t, prepend=0.0) * distance[-1] / seconds, rel=1e-5
    )


def test_a_straight_flight_swings_as_asked():
    motion = straight((0.8, 0.2, 3000.0), 1.0, 97.2, 400.0, amplitude=0.1, period=100.0)
    t = np.arange(0, 400.0, 0.1)
    roll, pitch, heading = motion.attitude(t)
    north, east, _ = motion.velocity(t)
    off = heading - np.arctan2(east, north)
    for values in (roll, pitch, off):
        assert (values.min(), values.max()) == pytest.approx((-0.1, 0.1), rel=1e-3) and values[
            :1000
        ] == pytest.approx(values[1000:2000], abs=1e-12)
    assert np.abs(roll + pitch + off).max() < 1e-12  # a third of a period apart


@pytest.mark.parametrize(
    "change, words",
    [
        ({"start": (89.5 * DEG, 0.0, 0.0)}, "below 89"),
        ({"speed": 0.0}, "above 0"),
        ({"start": (85 * DEG, 0.0, 0.0), "azimuth": 0.0, "duration": 9000.0}, "a pole"),
    ],
)
def test_impossible_straight_flights_are_refused(change, words):
    with pytest.raises(DataError, match=words):
        straight(
            **{"start": (0.8, 0.2, 0.0), "azimuth": 1.0, "speed": 100.0, "duration": 60.0, **change}
        )


@pytest.mark.parametrize(
    "speed, bank, roughness, horizontal, vertical",
    [(30.0, 25.0, 0.0, 0.5, 0.5), (20.0, 15.0, 0.0, 0.5, 0.5), (30.0, 25.0, 1.0, 5.0, 2.0)],
)
def test_a_waypoint_flight_passes_its_waypoints(speed, bank, roughness, horizontal, vertical):
    motion = waypoints(PLACES, speed, bank * DEG, roughness=roughness)
    t = np.arange(0, motion.end, 0.05)
    truth = sample(motion, t)
    passed = []
    for place in PLACES:
        miss = displacement(truth.lla, np.array(place))
        row = int(np.argmin(np.hypot(*miss[:, :2].T)))
        assert (
            np.hypot(*miss[row, :2]) < horizontal + speed * 0.025 and abs(miss[row, 2]) < vertical
        )
        passed.append(t[row])
    assert passed == sorted(passed) and passed[0] == 0 and passed[-1] > motion.end - 1
    assert np.abs(truth.rph[:, 0]).max() < (bank + 2.5 * roughness + 0.1) * DEG


def test_a_waypoint_beside_the_course_is_reached_the_long_way_round():
    places = [*PLACES[:2], (47.010 * DEG, 9.012 * DEG, 900.0)]
    motion = waypoints(places, 30.0, roughness=0.0)
    assert displacement(sample(motion, [motion.end]).lla[0], places[2]) == pytest.approx(
        [0, 0, 0], abs=0.5
    )


def test_waypoints_out_of_reach_are_named():
    with pytest.raises(DataError, match="waypoint 3 follows too soon"):
        waypoints([*PLACES[:2], (47.020 * DEG, 9.0120 * DEG, 900.0)], 60.0)
    with pytest.raises(DataError, match="waypoint 3 follows too soon"):
        waypoints([*PLACES[:2], (47.0225 * DEG, 9.011 * DEG, 900.0)], 30.0)
    with pytest.raises(DataError, match="two or more"):
        waypoints(PLACES[:1], 30.0)


@pytest.mark.short
@pytest.mark.parametrize(
    "places, speed, words",
    [
        ([(47, 9), (47, 9)], 50.0, "waypoints 1 and 2 are at the same place"),
        ([(47, 9), (47.2, 9), (47.2, 9)], 50.0, "waypoints 2 and 3 are at the same place"),
        ([(47, 9), (89.5, 9)], 50.0, "waypoint 2 is at 89.5 deg of latitude"),
        ([(-60, 0), (60, 170)], 0.1, "10 days"),
        ([(47, np.nan), (47.2, 9)], 50.0, "not finite"),
        ([(47, 9), (47.2, 9)], 0.0, "speed and smoothing above 0"),
    ],
)
def test_waypoints_that_cannot_be_flown_are_refused_at_once(places, speed, words):
    with pytest.raises(DataError, match=words):
        waypoints([(lat * DEG, lon * DEG, 900.0) for lat, lon in places], speed)


def test_an_aircraft_climbs_slower_than_it_flies():
    with pytest.raises(DataError, match="waypoint 2 needs a climb of .* at a speed of 30 m/s"):
        waypoints([PLACES[0], (*PLACES[1][:2], 9000.0)], 30.0)


def test_a_flight_does_what_its_legs_say():
    motion = flight((0.8, 0.2, 900.0), 0.4, 28.0, TURNS, roughness=0.0)
    turned = (180 - 3 * 200) * DEG
    t = np.arange(0, motion.end, 0.1)
    truth, f = sample(motion, t), increments(motion, t).dv / 0.1
    roll, pitch, heading = motion.attitude(t)
    assert heading[0] == pytest.approx(0.4, abs=1e-6) and heading[-1] == pytest.approx(
        0.4 + turned, abs=1e-4
    )
    assert np.hypot(*truth.v_n[:, :2].T)[[0, -1]] == pytest.approx([28.0, 35.0], abs=0.01)
    assert roll.max() == pytest.approx(25 * DEG, abs=0.1 * DEG) and roll.min() == pytest.approx(
        -30 * DEG, abs=0.1 * DEG
    )
    # coordinated, but for the moments in which the climb changes
    assert np.abs(f[:, 1]).max() < 0.05 * G
    turning = (
        motion.end - 20 - 15 - 30 - np.pi / (G * np.tan(25 * DEG) / 28)
    ) / 3  # s, each of the three long turns
    assert turning == pytest.approx(200 * DEG / (G * np.tan(30 * DEG) / 35), rel=1e-9)
    assert truth.lla[-1, 2] == pytest.approx(900 + 3 * 15 - 3 * turning, abs=0.5)


def test_a_car_stands_still_at_a_stop_and_climbs_with_the_road():
    motion = car((0.8, 0.2, 500.0), 0.3, STREET)
    t = np.arange(0, motion.end, 0.01)
    truth = sample(motion, t)
    speed = np.hypot(*truth.v_n[:, :2].T)
    assert speed.min() >= 0 and speed.max() == pytest.approx(12.0, abs=0.05)
    assert np.abs(truth.v_n[(t < 1) | (t > 42)]).max() < 1e-4
    on_hill = (t > 14) & (t < 18)
    assert -truth.v_n[on_hill, 2] / speed[on_hill] == pytest.approx(0.05, abs=0.004) and truth.lla[
        -1, 2
    ] == pytest.approx(506.0, abs=0.2)
    assert truth.rph[-1, 2] == pytest.approx(0.3 + np.pi / 2, abs=1e-6)
    f = increments(motion, t).dv / 0.01
    assert np.hypot(*f[:, :2].T).max() < 5.0  # tyres


def test_a_ship_heaves_and_rolls_about_its_course():
    motion = ship((1.0, 0.1, 45.0), 1.0, 6.0, [{"duration": 600.0}], wave_height=2.0)
    truth = sample(motion, np.arange(0, 600.0, 0.2))
    heave = truth.lla[:, 2] - truth.lla[:, 2].mean()
    assert 0.2 < heave.std() < 0.8 and np.abs(heave).max() < 2.0
    assert truth.rph[:, 0].std() / DEG == pytest.approx(
        2.5 * 2 * np.sqrt(0.5 * (0.75**2 + 0.45**2 + 0.35**2 + 0.25**2 + 0.2**2)), rel=0.1
    )
    assert truth.v_n.mean(axis=0) == pytest.approx(
        [6 * np.cos(1.0), 6 * np.sin(1.0), 0.0], abs=0.05
    )
    calm = ship((1.0, 0.1, 45.0), 1.0, 6.0, [{"duration": 600.0}], wave_height=0.0)
    assert not np.any(calm.attitude(np.arange(9.0))[0])


@pytest.mark.parametrize(
    "legs, words",
    [
        ([], "a leg or more"),
        ([{"duration": 0.0}], "leg 1 .* duration above 0"),
        ([{"duration": 3.0}, {"turn": 1.0}], "leg 2 .* duration above 0"),
        ([{"turn": 1.0, "bank": 1.5}], "bank between 0 and 80"),
        ([{"duration": 3.0, "turn": 1.0, "bank": 0.3}], "leg 1"),
        ([{"duration": 5.0, "speed": -1.0}], "speed is -1.0"),
        ([{"duration": 5.0, "speed": 0.0}], "speed is 0.0; an aircraft's must be above 0"),
        ([{"turn": 1.0, "bank": 0.0}], "bank between 0 and 80"),
        (
            [{"duration": 5.0, "speed": 10.0, "climb": 12.0}],
            "a climb of 12 m/s at a speed of 10 m/s",
        ),
        ([{"duration": 1e9}], "10 days"),
        ([{"repeat": 10**9, "legs": [{"duration": 1.0}]}], "1000000000 legs"),
        ([{"repeat": 3000, "legs": [{"duration": 1.0}]}] * 2, "6000 legs"),
        ([{"duration": 5.0, "gradient": 0.1}], "unknown key 'gradient'"),
        ([{"repeat": 0, "legs": []}], "whole number from 1"),
        ([3], "leg 1 is 3"),
    ],
)
def test_impossible_legs_are_refused(legs, words):
    with pytest.raises(DataError, match=words):
        flight((0.8, 0.2, 900.0), 0.4, 28.0, legs)


def test_motions_end_where_their_plan_does():
    with pytest.raises(DataError, match="'ship' ends at 120 s"):
        sample(MOTIONS["ship"], [0.0, 121.0])


def test_the_thrust_alone_accelerates_a_multicopter():
    """Its accelerometers feel the thrust along z, and across it what Coriolis and centrifugal
    accelerations add, below 0.02 m/s^2."""
    t = np.arange(0.0, 60.0, 0.01)
    moved, force = (
        sample(MOTIONS["multicopter"], t),
        increments(MOTIONS["multicopter"], t).dv / 0.01,
    )
    assert np.abs(force[:, :2]).max() < 0.1 and force[:, 2].max() < -0.5 * G
    assert np.degrees(np.abs(moved.rph[:, :2]).max()) > 25


def test_a_multicopter_that_would_fall_is_refused():
    with pytest.raises(DataError, match="would fall; choose a smaller speed"):
        multicopter((0.8, 0.1, 500.0), speed=30.0, period=2.0)
