"""Sensors of any kind of measurement, simulated through the kind's own observation."""

import numpy as np
import pytest

import strapdown as sd
from strapdown import aiding
from strapdown.aiding.more_parameters import placeholder
from strapdown.checks import DataError
from strapdown.sensor_models.any_sensor import Simulated
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.gnss import Gnss
from strapdown.sim.scenario import Scenario
from strapdown.sim.scenario_file import read
from strapdown.sim.synthesis import Simulator, simulate
from strapdown.sim.trajectory import demo_flight, normal_gravity, ramp, rates

ARM = (0.5, -1.0, 2.0)
FIELD = (21e-6, 1.5e-6, 43e-6)
FLIGHT = Scenario("flight", demo_flight(), 40.0, 50.0)
RECORDED = [name for name in aiding.names() if aiding.find(name).recorded]


def exact(*sensors, **changes):
    """({name: exact fixes}, truth at them), of sensors with one fix per second."""
    simulator = Simulator(FLIGHT.replace(sensors=sensors, **changes))
    own = simulator.ideal_recording().sources[-len(sensors) :]
    rows = np.searchsorted(simulator.truth.t, own[0].t)
    return {a.name: a.y for a in own}, simulator.truth, rows


def test_altitude_speed_and_heading_are_those_of_the_truth():
    y, truth, rows = exact(
        Simulated("altitude", 2.0, parameters=ARM),
        Simulated("speed", 0.1, parameters=ARM),
        Simulated("heading", 0.01),
    )
    C = truth.rotation.as_matrix()[rows]
    omega = rates(FLIGHT.motion, truth.t[rows], truth.lla[rows].T, normal_gravity)[0].T
    np.testing.assert_allclose(y["altitude"][:, 0], truth.lla[rows, 2] - (C @ ARM)[:, 2], atol=1e-9)
    moved = np.einsum("nji,nj->ni", C, truth.v_n[rows]) + np.cross(omega, ARM)
    np.testing.assert_allclose(y["speed"][:, 0], moved[:, 0], atol=5e-4)
    apart = y["heading"][:, 0] - truth.rph[rows, 2]
    np.testing.assert_allclose(np.sin(apart / 2), 0, atol=1e-9)


def test_a_course_is_that_of_the_antenna_and_none_at_a_standstill():
    course, velocity = (Simulated(kind, 0.1, parameters=ARM) for kind in ("course", "velocity"))
    y, _, _ = exact(course, velocity)
    v = y["velocity"]
    apart = y["course"][:, 0] - np.arctan2(v[:, 1], v[:, 0])
    np.testing.assert_allclose(np.sin(apart / 2), 0, atol=1e-9)
    still = FLIGHT.motion._replace(attitude=lambda t: (0 * t, 0 * t, 0 * t))
    starts = still._replace(velocity=lambda t: (-8 * ramp(t, 20.0, 1.0), 0 * t, 0 * t))
    made = simulate(FLIGHT.replace(motion=starts), sensors=[course])
    source = made.sources[-1]
    assert 19 < source.t[0] < 23 and len(source.t) < 22
    assert np.abs(np.sin((source.y[5:, 0] - np.pi) / 2)).max() < 0.3
    assert any("course: reads nothing" in note for note in made.meta["notes"])
    stands = still._replace(velocity=lambda t: (0 * t, 0 * t, 0 * t))
    with pytest.raises(DataError, match="course: no reading of kind course was found"):
        simulate(FLIGHT.replace(motion=stands), sensors=[course])


def test_the_kinds_with_equations_of_their_own_agree_with_these():
    """The observation of each kind is inverted, also where it is not y - h: the receiver and the
    barometer of the simulator share nothing with it."""
    simulator = Simulator(
        FLIGHT.replace(
            gnss=Gnss(lever_arm=ARM),
            barometer=Barometer(rate=1.0, lever_arm=ARM),
            sensors=tuple(
                Simulated(kind, 0.1, parameters=ARM)
                for kind in ("position", "velocity", "pressure")
            ),
        )
    )
    position, velocity, pressure, *own = simulator.ideal_recording().sources
    for theirs, mine, close in zip(
        (position, velocity, pressure), own, ([1e-11, 1e-11, 1e-4], 5e-3, 1e-3)
    ):
        assert np.all(np.abs(theirs.y - mine.y) < close)


@pytest.mark.parametrize("kind", RECORDED)
def test_every_recorded_kind_can_be_simulated(kind):
    model = aiding.find(kind)
    given = {"field": FIELD, "baseline": (1.0, 0.2, -0.1)}
    parameters = given.get(model.parameters, placeholder(model))
    sensor = Simulated(kind, 1e-3, rate=2.0, parameters=parameters)
    [mine] = simulate(
        FLIGHT, duration=5.0, gnss=Gnss(position_std=None, velocity_std=None), sensors=[sensor]
    ).sources
    assert mine.kind == mine.name == kind and mine.y.shape == (
        10,
        len(aiding.find(kind).quantities),
    )
    assert np.isfinite(mine.y).all() and np.all(mine.std == 1e-3)


def test_the_noise_is_that_of_its_std_and_a_filter_takes_the_fixes():
    sensor = Simulated("altitude", 3.0, rate=None)
    recording = simulate(FLIGHT, sensors=[sensor])
    error = recording.sources[-1].y[:, 0] - recording.reference.lla[1:, 2]
    assert len(error) == 2000 and 2.8 < error.std() < 3.2 and abs(error.mean()) < 0.3
    solution = sd.fuse(recording)
    assert "altitude" in solution.innovations.names


def test_each_has_the_stream_of_its_name_and_changes_no_other_draw():
    one, two = Simulated("altitude", 2.0), Simulated("altitude", 2.0, name="second")
    runs = [
        simulate(FLIGHT, barometer=Barometer(rate=1.0), seed=3, sensors=sensors)
        for sensors in ((), (one,), (two, one))
    ]
    for run in runs[1:]:
        for mine, before in zip(run.imu, runs[0].imu):
            np.testing.assert_array_equal(mine, before)
        for mine, before in zip(run.sources[:3], runs[0].sources, strict=True):
            np.testing.assert_array_equal(mine.y, before.y)
    second, again = runs[2].sources[3:]
    np.testing.assert_array_equal(again.y, runs[1].sources[3].y)
    assert not np.any(again.y == second.y)
    other = simulate(FLIGHT, barometer=Barometer(rate=1.0), seed=4, sensors=(one,))
    assert not np.any(other.sources[3].y == again.y)


def test_the_fingerprint_is_of_the_sensors_too():
    prints = {
        FLIGHT.replace(sensors=sensors).describe()["fingerprint"]
        for sensors in ((), (Simulated("altitude", 2.0),), (Simulated("altitude", 3.0),))
    }
    assert len(prints) == 3 and "sensors" not in FLIGHT.describe()


@pytest.mark.parametrize(
    "arguments, text",
    [
        (("altitud", 1.0), "did you mean 'altitude'"),
        (("zero-velocity", 1.0), "zero-velocity is a constraint"),
        (("altitude", 0.0), r"altitude: std is .0.0.; it must be .*, each above 0"),
        (("altitude", -1), "altitude: std is .-1.; it must be"),
        (("velocity", (1.0, 2.0)), r"velocity: std is \(1.0, 2.0\); it must be 3 finite numbers"),
        (("altitude", "much"), "altitude: std is"),
        (("altitude", 1.0, 0.0), "altitude: rate is 0.0 Hz; it must be a finite number above 0"),
        (("altitude", 1.0, 1.0, (1.0,)), "1 parameters; kind altitude takes three: antenna"),
        (("magnetic-field", 1.0), "0 parameters; kind magnetic-field takes three: field"),
    ],
)
def test_what_none_can_be_is_refused(arguments, text):
    with pytest.raises(DataError, match=text) as refused:
        Simulated(*arguments)
    assert "\n" not in str(refused.value)


def test_two_of_one_name_and_faster_ones_than_the_imu_are_refused():
    one = Simulated("altitude", 1.0)
    for sensors, text in (
        ((one, one), "a name of its own"),
        (("altitude",), "must be a Simulated"),
        (
            (Simulated("altitude", 1.0, rate=60.0),),
            "altitude: 60 a second come faster than the IMU's samples, 50",
        ),
    ):
        with pytest.raises(DataError, match=text):
            FLIGHT.replace(sensors=sensors)


FILE = """
duration_s = 10
[motion]
kind = "demo"
[[sensors]]
kind = "altitude"
std = 2
rate_hz = 5
parameters = [0, 0, -1]
[[sensors]]
name = "log"
kind = "speed"
std = 0.1
"""


def test_a_scenario_file_has_them(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    altitude, log = read(path).sensors
    assert altitude == Simulated("altitude", 2.0, 5.0, (0.0, 0.0, -1.0))
    assert log == Simulated("speed", 0.1, name="log")
    assert [a.name for a in simulate(path).sources[2:]] == ["altitude", "log"]


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("std = 2", "", "sensors 1, std is missing"),
        ("rate_hz", "rate", r"sensors 1: unknown key 'rate' \(did you mean 'rate_hz'\?\)"),
        ('"speed"', '"sped"', "did you mean 'speed'"),
        ('"speed"', "4", r"sensors 2, kind is 4; it must be text"),
    ],
)
def test_mistakes_in_a_file_are_refused(tmp_path, old, new, text):
    path = tmp_path / "mine.toml"
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(DataError, match=text):
        read(path)
