"""Magnetometer and barometer in scenarios and simulations: streams apart, files as they are
read, the two motions for attitude, and the filters' view."""

import json
from datetime import date

import numpy as np
import pytest
from scipy.stats import chi2

from strapdown import aiding
from strapdown.checks import DataError
from strapdown.core.mathematics.source import new_source
from strapdown.io import read
from strapdown.io.readers.netcdf import write_recording
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.geomagnetism import geomagnetic_field
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.motions import hand_held, moored_vessel
from strapdown.sim.scenario import Scenario, scenario
from strapdown.sim.synthesis import Simulator, draw_start, simulate
from strapdown.sim.trajectory import DEG, demo_flight, gravity, normal_gravity, rates, sample

PLACE = (48 * DEG, 11 * DEG, 500.0)
FIELD = (21e-6, 1.5e-6, 43e-6)
NOTHING = Gnss(position_std=None, velocity_std=None)
MAGNETOMETER, BAROMETER = (
    Magnetometer(rate=20.0, field=FIELD, hard_iron=(1e-6, 0, 0)),
    Barometer(rate=5.0, drift=100.0, drift_time=500.0),
)
FLIGHT = Scenario("flight", demo_flight(), 20.0, 50.0)
FILE = """
name = "on deck"
duration_s = 30
date = 2025-06-01

[motion]
kind = "moored"
start = { latitude_deg = 60, longitude_deg = 5, height_m = 45 }
heave_m = 0.5
wave_period_s = 6
roll_deg = 4

[gnss]

[magnetometer]
rate_hz = 25
std_uT = [0.3, 0.3, 0.5]
hard_iron_uT = [10, -5, 2]
soft_iron = [[1.1, 0, 0], [0, 0.9, 0.02], [0, 0.02, 1]]
scale = [0.01, 0, -0.01]
saturation_uT = 4900
field_uT = [15, 1, 48]
disturbances = [{ start_s = 5, stop_s = 8, field_uT = [20, 0, 5] }, { start_s = 12, stop_s = 14, field_uT = [0, 30, 0], frame = "b" }]

[barometer]
rate_hz = 10
std_Pa = 3
bias_Pa = -40
drift_Pa = 200
drift_time_s = 7200
zero_m = 45
lever_arm_m = [0.1, 0, -2]
quantity = "height"
"""


def written(folder, text):
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def same(one, other):
    """Whether two recordings have the IMU, and the fixes of GNSS, bit for bit."""
    pairs = [
        *zip(one.imu, other.imu),
        *((a.y, b.y) for a, b in zip(receiver(one), receiver(other), strict=True)),
    ]
    return all(np.array_equal(a, b) for a, b in pairs)


def receiver(recording):
    return [a for a in recording.sources if a.kind in ("position", "velocity")]


def test_further_sensors_change_no_draw_of_the_others():
    bare, magnetic, both = (
        FLIGHT,
        FLIGHT.replace(magnetometer=MAGNETOMETER),
        FLIGHT.replace(magnetometer=MAGNETOMETER, barometer=BAROMETER),
    )
    runs = [
        Simulator(made).run("consumer", np.random.SeedSequence(4))
        for made in (bare, magnetic, both, FLIGHT.replace(barometer=BAROMETER))
    ]
    assert all(same(runs[0][0], recording) and start == runs[0][1] for recording, start in runs[1:])
    kinds = [[a.kind for a in recording.sources[2:]] for recording, _ in runs]
    assert kinds == [[], ["magnetic-field"], ["magnetic-field", "pressure"], ["pressure"]]
    np.testing.assert_array_equal(runs[1][0].sources[2].y, runs[2][0].sources[2].y)
    np.testing.assert_array_equal(runs[2][0].sources[3].y, runs[3][0].sources[2].y)


def test_imu_and_receiver_have_the_streams_of_their_names():
    """Whatever other sensors there are."""
    made = simulate("demo", duration=10.0, seed=5, magnetometer=MAGNETOMETER, barometer=BAROMETER)
    simulator = Simulator(scenario("demo").replace(duration=10.0))
    of_imu, of_gnss = map(RandomStream.of(5).child, ("imu", "gnss"))
    np.testing.assert_array_equal(
        imu_spec("tactical").corrupt(simulator.ideal, of_imu)[0].dv, made.imu.dv
    )
    for fixes, expected in zip(
        receiver(made), scenario("demo").gnss.fixes(simulator.truth, of_gnss), strict=True
    ):
        np.testing.assert_array_equal(fixes.y, expected.y)


def test_the_fingerprint_is_of_the_sensors_too_and_without_them_of_the_old_keys():
    """Of the old keys alone, so that campaigns of scenarios without them go on."""
    assert not {"magnetometer", "barometer", "date"} & FLIGHT.describe().keys()
    changes = [
        {},
        {"magnetometer": MAGNETOMETER},
        {"magnetometer": Magnetometer(field=FIELD)},
        {"barometer": BAROMETER},
        {"barometer": Barometer()},
        {"date": "2025-01-01"},
    ]
    prints = [FLIGHT.replace(**change).describe()["fingerprint"] for change in changes]
    assert len(set(prints)) == len(prints)
    described = FLIGHT.replace(magnetometer=MAGNETOMETER, barometer=BAROMETER).describe()
    assert (
        json.loads(json.dumps(described, allow_nan=False)) == described
        and described["barometer"]["drift"] == 100.0
    )
    assert isinstance(hash(FLIGHT.replace(magnetometer=MAGNETOMETER, barometer=BAROMETER)), int)


@pytest.mark.short
def test_a_recording_says_place_date_and_notes():
    made = simulate(
        hand_held(PLACE),
        5.0,
        "consumer",
        gnss=NOTHING,
        date="2025-06-01",
        barometer=Barometer(rate=0.1),
        magnetometer=Magnetometer(rate=10.0, field=FIELD, saturation=45e-6),
    )
    assert (
        made.meta["place"] == list(made.reference.lla[0]) == pytest.approx(PLACE)
        and made.meta["date"] == "2025-06-01"
    )
    assert [a.kind for a in made.sources] == ["magnetic-field", "pressure"]
    magnetic, barometric = made.meta["notes"][-2:]
    assert magnetic.startswith("magnetometer: ") and "of 50 samples saturated at 45 uT" in magnetic
    assert barometric == "barometer: not one sample falls into the recording; its rate is too low"
    assert "date" not in simulate(hand_held(PLACE), 5.0, "consumer").meta


def test_the_field_is_that_of_the_model_where_the_motion_begins():
    made = simulate(
        hand_held(PLACE), 2.0, "consumer", magnetometer=Magnetometer(), date="2023-03-01"
    )
    assert made.sources[-1].parameters == pytest.approx(
        geomagnetic_field("2023-03-01", *PLACE).field, rel=1e-12
    )
    assert 45e-6 < np.linalg.norm(made.sources[-1].parameters) < 52e-6
    with pytest.raises(DataError, match="1066"):
        simulate(hand_held(PLACE), 2.0, "consumer", magnetometer=Magnetometer(), date="1066-10-14")


@pytest.mark.parametrize(
    "kind, change",
    [
        ("magnetic-field", {"magnetometer": Magnetometer(field=FIELD)}),
        ("pressure", {"barometer": Barometer(zero=20.0, lever_arm=(1.0, 0.5, -2.0))}),
        (
            "pressure-altitude",
            {"barometer": Barometer(zero=20.0, lever_arm=(1.0, 0.5, -2.0), quantity="height")},
        ),
    ],
)
def test_at_the_truth_the_filters_innovation_is_the_noise_stated(kind, change):
    """The observer of the source at the true state: innovations are N(0, std^2), chi-square in a
    99.9 % band."""
    made = simulate(hand_held(PLACE), 20.0, "navigation", seed=2, gnss=NOTHING, **change)
    fixes, sensor, truth = made.sources[0], aiding.find(kind), made.reference
    assert fixes.kind == kind
    belief = scenario_belief(made)
    nis = []
    for y, std, lla, C in zip(fixes.y, fixes.std, truth.lla[1:], truth.rotation.as_matrix()[1:]):
        belief.lla[:], belief.C_nb[:], belief.augmented[:] = lla, C, -20.0
        innovation, source = np.zeros(3), new_source(first_state=15)
        source.parameters[:3] = fixes.parameters
        rows = sensor.observe.py_func(belief, y, source, innovation, np.zeros((3, 16)))
        nis.append(np.sum((innovation[:rows] / std[:rows]) ** 2))
    low, high = chi2.ppf([0.0005, 0.9995], rows * len(nis))
    assert rows == (3 if kind == "magnetic-field" else 1) and low < sum(nis) < high


def scenario_belief(made):
    """A FilterState with one further state, to be filled with the truth."""
    start = draw_start(made.reference, np.ones(15), np.random.default_rng(0))
    return start._replace(std=(*start.std, 1.0)).belief(np.zeros(1))


def test_the_run_without_errors_has_the_sensors_without_errors():
    simulator = Simulator(
        FLIGHT.replace(magnetometer=MAGNETOMETER, barometer=BAROMETER, gate=np.inf)
    )
    _, _, magnetic, barometric = simulator.ideal_recording().sources
    assert (
        np.linalg.norm(magnetic.y, axis=1) == pytest.approx(np.linalg.norm(FIELD), rel=1e-9)
        and magnetic.gate == barometric.gate == np.inf
    )
    assert simulator.recording("tactical", np.random.default_rng(1)).sources[2].y.mean(
        axis=0
    ) != pytest.approx(magnetic.y.mean(axis=0), abs=5e-7)


def test_a_recording_is_written_and_read(tmp_path):
    made = simulate(scenario(written(tmp_path, FILE)), duration=5.0, seed=1, barometer=BAROMETER)
    write_recording(made, tmp_path / "deck.nc")
    again = read(tmp_path / "deck.nc")
    assert [a.kind for a in again.sources] == ["magnetic-field", "pressure"] and again.meta[
        "place"
    ] == made.meta["place"]
    for one, other in zip(made.sources, again.sources):
        np.testing.assert_array_equal(one.y, other.y)
        np.testing.assert_array_equal(one.std, other.std)
        assert one.parameters == other.parameters
    np.testing.assert_array_equal(again.meta["b_baro"], made.meta["b_baro"])


@pytest.mark.short
def test_a_file_is_read_as_it_is_written(tmp_path):
    deck = scenario(written(tmp_path, FILE))
    assert deck.date == "2025-06-01" and deck.gnss == NOTHING and deck.motion.end == np.inf
    uT = lambda *values: pytest.approx(tuple(value * 1e-6 for value in values), rel=1e-12)
    magnetometer = deck.magnetometer
    assert (
        magnetometer.rate == 25
        and magnetometer.std == uT(0.3, 0.3, 0.5)
        and magnetometer.hard_iron == uT(10, -5, 2)
        and magnetometer.field == uT(15, 1, 48)
    )
    assert magnetometer.soft_iron == (
        (1.1, 0, 0),
        (0, 0.9, 0.02),
        (0, 0.02, 1),
    ) and magnetometer.scale == (0.01, 0, -0.01)
    assert magnetometer.saturation == pytest.approx(4.9e-3)
    assert [each[:2] + each[3:] for each in magnetometer.disturbances] == [
        (5, 8, "n"),
        (12, 14, "b"),
    ] and magnetometer.disturbances[1].field == uT(0, 30, 0)
    assert deck.barometer == Barometer(
        10.0, 3.0, -40.0, 200.0, 7200.0, 45.0, (0.1, 0.0, -2.0), "height"
    )
    assert deck.magnetic_field() == uT(15, 1, 48)
    quoted = scenario(written(tmp_path, FILE.replace("2025-06-01", '"2025-06-01"')))
    assert quoted.describe()["fingerprint"] == deck.describe()["fingerprint"]


@pytest.mark.short
@pytest.mark.parametrize(
    "old, new, words",
    [
        ("std_uT", "std_ut", r"\[magnetometer\]: unknown key 'std_ut' .did you mean 'std_uT'"),
        ("std_Pa", "std_m", r"\[barometer\]: unknown key 'std_m'"),
        ("rate_hz = 25", "rate_hz = 0", "rate is 0.0 Hz; it must be a finite number above 0"),
        (
            "rate_hz = 25",
            "rate_hz = 101",
            "magnetometer: 101 a second come faster than the IMU's samples, 100",
        ),
        ("rate_hz = 10", "rate_hz = 200", "barometer: 200 a second come faster"),
        ("std_uT = [0.3, 0.3, 0.5]", 'std_uT = "low"', "it must be a finite number"),
        ("hard_iron_uT = [10, -5, 2]", "hard_iron_uT = 10", "square brackets"),
        ("field_uT = [15, 1, 48]", "field_uT = [15000, 1, 48]", "in tesla, .* at most 0.0001"),
        ("field_uT = [15, 1, 48]", "field_uT = [15, 1]", "has 2 numbers"),
        ("[0, 0.02, 1]]", "[0, 0.02]]", "soft_iron 3 has 2 numbers"),
        ("[[1.1, 0, 0]", "[[-1.1, 0, 0]", "mirrors"),
        ("start_s = 5, ", "", "disturbances 1, start_s is missing"),
        ("stop_s = 8", "stop_s = 4", "start must come before its stop"),
        ('frame = "b"', 'frame = "i"', "frame is 'i'"),
        ('frame = "b"', "axis = 1", "disturbances 2: unknown key 'axis'"),
        ("disturbances = [", "disturbances = [3,", "disturbances 1 is 3"),
        ("saturation_uT = 4900", "saturation_uT = -1", "saturation is"),
        ("std_Pa = 3", "std_Pa = 0", "std is 0.0 Pa; it must be a finite number above 0"),
        ('"height"', '"altitude"', "one of pressure, height"),
        ("zero_m = 45", "zero_m = 30000", "m above its zero"),
        ("date = 2025-06-01", 'date = "June"', "date is 'June'; write it as 2025-06-01"),
        ("date = 2025-06-01", "date = 2025", "date is 2025; it must be text"),
        ("[barometer]", "[[barometer]]", r"write a section \[barometer\]"),
        ("[gnss]", "[gps]", "unknown key 'gps'"),
        (
            "heave_m = 0.5",
            "heave_m = -1",
            "heave of a swell is -1.0 m; it must be a finite number, 0 or more",
        ),
        ('"moored"', '"hand-held"', "unknown key 'heave_m'"),
    ],
)
def test_files_with_mistakes_are_refused_in_one_line(tmp_path, old, new, words):
    assert old in FILE
    path = written(tmp_path, FILE.replace(old, new))
    with pytest.raises(DataError, match=words) as error:
        Simulator(scenario(path))
    assert "\n" not in str(error.value)


@pytest.mark.short
def test_impossible_scenarios_are_refused():
    for change, words in (
        ({"magnetometer": 3}, "magnetometer must be a Magnetometer or None, not int"),
        ({"barometer": MAGNETOMETER}, "barometer must be a Barometer or None"),
        ({"magnetometer": Magnetometer()}, "needs the Earth's field"),
        ({"date": date(2025, 1, 1)}, "write it as 2025-06-01"),
    ):
        with pytest.raises(DataError, match=words):
            FLIGHT.replace(**change)
    for build, change, words in (
        (hand_held, {"turning": 2.0}, "pitches beyond the vertical"),
        (hand_held, {"rest": -1.0}, "rest is -1.0 s; it must be a finite number, 0 or more"),
        (
            moored_vessel,
            {"wave_period": 0.0},
            "period of a swell is 0.0 s; it must be a finite number above 0",
        ),
    ):
        with pytest.raises(DataError, match=words):
            build(PLACE, **change)


def test_the_hand_turns_and_shakes_as_it_should():
    hand = scenario("hand-held")
    truth = sample(hand.motion, np.arange(6001) / 100)
    omega, force = rates(hand.motion, truth.t, truth.lla.T, normal_gravity)
    acceleration = np.linalg.norm(np.gradient(truth.v_n, 0.01, axis=0), axis=1)
    still, moving = truth.t < 4, truth.t > 6
    assert (
        np.linalg.norm(omega, axis=0)[still].max() < 0.01
        and acceleration[still].max() < 0.005
        and np.abs(truth.rph[still, :2]).max() < 1e-3
    )
    assert 2.5 < np.linalg.norm(omega, axis=0).max() < 3.5 and np.all(
        np.abs(omega[:, moving]).max(axis=1) > 1
    )
    assert (
        np.percentile(acceleration[moving], 10) > 0.8
        and 1.5 < np.median(acceleration[moving]) < 2.5
        and np.percentile(acceleration[moving], 95) < 3.2
    )
    assert (
        np.ptp((truth.lla - truth.lla[0]) * [6.37e6, 4.3e6, 1], axis=0).max() < 0.6
        and np.ptp(np.unwrap(truth.rph[:, 2])) > 5
    )
    still_hand = hand_held(PLACE, travel=0.0)
    _, felt = rates(still_hand, truth.t, np.tile(np.array(PLACE)[:, None], 6001), normal_gravity)
    assert np.linalg.norm(felt, axis=0) == pytest.approx(gravity(PLACE[0], PLACE[2]), rel=1e-12)


def test_the_hand_held_recording_has_what_an_ahrs_has():
    made = simulate("hand-held", seed=3)
    assert (
        [a.kind for a in made.sources] == ["magnetic-field"]
        and len(made.sources[0].t) == len(made.imu.t) == 6000
        and made.meta["notes"] == []
    )
    start = draw_start(made.reference, np.full(15, 0.01), np.random.default_rng(1))
    assert start.t == 0 and start.rph[2] == pytest.approx(70 * DEG, abs=0.1)
    hand = scenario("hand-held")
    # rounded in the file
    assert hand.magnetic_field() == pytest.approx(
        geomagnetic_field(hand.date, *hand.motion.lla).field, abs=0.06e-6
    )


def test_the_vessel_heaves_about_its_mean_level():
    vessel = scenario("ship-heave")
    made = simulate("ship-heave", seed=3)
    height = made.reference.lla[:, 2] - 45
    assert abs(height.mean()) < 0.02 and height.std() == pytest.approx(
        np.sqrt((1 + 0.3**2 + 0.25**2 + 0.15**2 + 0.1**2) / 2), rel=0.02
    )
    spectrum = np.abs(np.fft.rfft(height[:-1] * np.hanning(30000)))
    assert np.fft.rfftfreq(30000, 1 / 50)[spectrum.argmax()] == pytest.approx(1 / 8, abs=0.002)
    assert [a.kind for a in made.sources] == ["magnetic-field", "pressure"] and [
        len(a.t) for a in made.sources
    ] == [6000, 6000]
    assert (
        5 * DEG < np.abs(made.reference.rph[:, 0]).max() < 12 * DEG
        and np.abs(made.reference.v_n.mean(axis=0)).max() < 0.01
    )
    assert made.sources[0].parameters == pytest.approx(
        geomagnetic_field(vessel.date, *vessel.motion.lla).field, rel=1e-12
    )
