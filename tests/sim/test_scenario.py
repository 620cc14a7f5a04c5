"""Scenarios: the built-in ones and what they promise, files of one's own, what is refused, and
fingerprints."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sim.motions import G
from strapdown.sim.scenario import Scenario, scenario, scenarios
from strapdown.sim.synthesis import Simulator
from strapdown.sim.trajectory import DEG, Motion, demo_flight, normal_gravity, rates, static

PAPER = [f"paper1-{number:02d}" for number in range(1, 12)]
STRAIGHT = ("paper1-07", "paper1-10")
DOCS = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "simulate.md"
FILE = """
name = "my flight"
rate_hz = 50
imu = "industrial"
accel_offset_m_s2 = [0.1, 0, 0]
gate = inf
gravity = "latitude"

[motion]
kind = "flight"
start = { latitude_deg = 47, longitude_deg = 9, height_m = 900 }
course_deg = 30
speed_m_s = 40
legs = [
    { duration_s = 30 },
    { repeat = 2, legs = [{ turn_deg = 90, bank_deg = 25 }, { duration_s = 20, climb_m_s = 2, speed_m_s = 45 }] },
]

[gnss]
interval_s = 0.5
position_std_m = [1, 1, 2]
lever_arm_m = [0.5, 0, -1]
outages_s = [[10, 20]]
latency_s = 0.1

[start]
attitude_std_deg = [0.1, 0.1, 1]
accel_bias_std_m_s2 = 0.05
gyro_bias_std_deg_h = 3600
"""


def written(folder, text):
    path = folder / "mine.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", scenarios())
def test_built_in_scenarios_simulate(name):
    whole = scenario(name)
    assert whole.name == name and whole.about and whole.motion.name == name
    made = Simulator(whole.replace(duration=2.0)).recording(whole.imu, np.random.default_rng(1))
    assert len(made.imu.t) == 2 * whole.rate and made.sources
    assert np.isfinite(np.c_[made.imu.dv, made.imu.dtheta]).all()


def test_the_names_are_those_promised():
    assert set(scenarios()) == {
        "alam",
        "demo",
        "static",
        "straight",
        "car",
        "ship",
        "hand-held",
        "ship-heave",
        "underwater",
        "multicopter",
        "robot",
        "hover",
        *PAPER,
    }
    assert (
        scenario("demo").describe()["fingerprint"]
        == Scenario("demo", demo_flight(), 600.0).describe()["fingerprint"]
    )


@pytest.mark.parametrize("name", PAPER)
def test_the_flights_of_paper_1_are_what_they_should_be(name):
    flown = scenario(name)
    assert (
        flown.rate == 20
        and flown.gnss == Gnss(0.05, (1.0,) * 3, None)
        and flown.gate == np.inf
        and flown.imu == "paper1-tactical"
    )
    for imu in ("consumer", "tactical", "navigation"):
        spec = imu_spec(f"paper1-{imu}")
        assert flown.start_deviations(spec) == pytest.approx(
            [1] * 3
            + [0.1] * 3
            + [0.1 * DEG, 0.1 * DEG, 0.2 * DEG]
            + [0.1] * 3
            + [spec.bias_std()[1]] * 3
        )
    truth = flown.glance(int(flown.duration) + 1)
    speed, height = 3.6 * np.hypot(*truth.v_n[:, :2].T), truth.lla[:, 2]
    assert 0 < height.min() and height.max() <= 3000
    omega, f = rates(flown.motion, truth.t, truth.lla.T, normal_gravity)
    if name in STRAIGHT:
        assert (
            speed == pytest.approx(350, abs=1e-6)
            and flown.duration == {"paper1-07": 1800, "paper1-10": 5400}[name]
        )
        assert np.abs(truth.rph[:, :2]).max() == pytest.approx(5 * DEG, rel=1e-3)
        return
    assert speed.mean() == pytest.approx(100, rel=0.03) and speed.min() > 85 and speed.max() < 120
    assert (
        15 * DEG < np.abs(truth.rph[:, 0]).max() < 45 * DEG
        and np.abs(truth.rph[:, 1]).max() < 15 * DEG
    )
    load = np.linalg.norm(f, axis=0) / G
    assert 0.6 < load.min() and load.max() < 2 and np.abs(f[1]).max() < 0.2 * G
    assert (flown.duration < 1800) == (name < "paper1-07")


def test_the_flights_of_paper_1_lie_apart():
    starts = np.array([scenario(name).motion.lla[0] / DEG for name in PAPER])
    assert starts.min() < -30 and starts.max() > 75 and len(set(np.round(starts))) == 11
    assert [scenario(name).duration / 60 for name in PAPER] == [
        5,
        8,
        10,
        14,
        18,
        24,
        30,
        40,
        60,
        90,
        95,
    ]


def row(name):
    """A flight's line in the table of docs/how-to/simulate.md."""
    flown = scenario(name)
    truth = flown.glance(int(flown.duration) + 1)
    speed, lat, alt = (
        3.6 * np.hypot(*truth.v_n[:, :2].T).mean(),
        truth.lla[:, 0] / DEG,
        truth.lla[:, 2],
    )
    return (
        f"| `{name}` | {flown.about} | {flown.duration / 60:.0f} | {speed:.1f} | {lat.min():.2f} to {lat.max():.2f} | "
        f"{alt.min():.0f} to {alt.max():.0f} | {np.abs(truth.rph[:, 0]).max() / DEG:.0f} |"
    )


def test_the_documentation_shows_the_flights_as_they_are():
    shown = re.findall(r"^\| `paper1-\d\d` \|.*$", DOCS.read_text(encoding="utf-8"), re.MULTILINE)
    assert shown == [row(name) for name in PAPER]


def test_the_documentation_names_every_scenario():
    text = DOCS.read_text(encoding="utf-8")
    assert not [name for name in scenarios() if f"`{name}`" not in text]


def test_a_file_is_read_as_it_is_written(tmp_path):
    mine = scenario(written(tmp_path, FILE))
    assert (mine.name, mine.rate, mine.imu, mine.gate, mine.gravity) == (
        "my flight",
        50.0,
        "industrial",
        np.inf,
        "latitude",
    )
    assert mine.accel_offset == (0.1, 0.0, 0.0) and mine.motion.lla == pytest.approx(
        (47 * DEG, 9 * DEG, 900.0)
    )
    assert mine.gnss == Gnss(0.5, (1.0, 1.0, 2.0), None, (0.5, 0.0, -1.0), ((10.0, 20.0),), 0.1)
    assert mine.start_std == pytest.approx(
        (1, 1, 1.5, 0.1, 0.1, 0.1, 0.1 * DEG, 0.1 * DEG, DEG, 0.05, 0.05, 0.05, DEG, DEG, DEG)
    )
    truth = mine.glance(500)
    assert mine.duration == pytest.approx(mine.motion.end, abs=0.02) and truth.lla[
        -1, 2
    ] == pytest.approx(980, abs=2)
    assert truth.rph[-1, 2] / DEG == pytest.approx(210, abs=1) and np.hypot(
        *truth.v_n[-1, :2]
    ) == pytest.approx(45, abs=0.7)
    assert (
        scenario(mine) is mine
        and scenario(str(tmp_path / "mine.toml")).describe() == mine.describe()
    )


def test_an_imu_file_is_found_beside_the_scenario(tmp_path):
    imu_spec("tactical").to_toml(tmp_path / "imu.toml")
    mine = scenario(written(tmp_path, FILE.replace('"industrial"', '"imu.toml"')))
    assert imu_spec(mine.imu).gyro == imu_spec("tactical").gyro


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("rate_hz", "rate_Hz", "unknown key 'rate_Hz' .did you mean 'rate_hz'"),
        ('kind = "flight"', 'kind = "fligth"', "kind is 'fligth' .did you mean 'flight'"),
        ("course_deg = 30", "", "course_deg is missing"),
        ("course_deg", "course", r"\[motion\]: unknown key 'course' .did you mean 'course_deg'"),
        (
            "turn_deg = 90",
            "turn = 90",
            r"legs 2, legs 1: unknown key 'turn' .did you mean 'turn_deg'",
        ),
        ("latitude_deg = 47", "latitude_deg = 470", "is not a position"),
        (", height_m = 900", "", "height_m is missing"),
        ("interval_s = 0.5", "interval_s = 0", "interval between fixes"),
        ("outages_s = [[10, 20]]", "outages_s = [10, 20]", "square brackets"),
        ("outages_s = [[10, 20]]", "outages_s = [[20, 10]]", "start before the stop"),
        ("latency_s", "delay_s", r"\[gnss\]: unknown key 'delay_s'"),
        ("position_std_m = [1, 1, 2]", "position_std_m = [1, 2]", "one or three"),
        ("[start]", "[begin]", "unknown key 'begin'"),
        ("accel_bias_std_m_s2 = 0.05", "accel_bias_std_m_s2 = -1", "0 or more"),
        ("bank_deg = 25", "bank_deg = 95", "bank between"),
        ('imu = "industrial"', 'imu = "industrail"', "did you mean 'industrial'"),
        ("rate_hz = 50", 'rate_hz = "fast"', "it must be a finite number"),
        ('gravity = "latitude"', 'gravity = "flat"', "height, latitude"),
        ("gate = inf", "gate = 0", "gate is 0.0; it must be a number above 0"),
        ("rate_hz = 50", "rate_hz = ", "is not TOML"),
        ("repeat = 2", "repeat = 2.5", "whole number"),
        ("[motion]", "[[motion]]", r"write a section \[motion\]"),
        ("speed_m_s = 40", "speed_m_s = 4000", "faster than 3000"),
        ('name = "my flight"', "name = 3", "text in quotes"),
        ("rate_hz = 50", "rate_hz = 50\nduration_s = 9999", "ends at"),
        ("rate_hz = 50", "rate_hz = 0", "rate_hz is 0; it must be larger than 0"),
        ("rate_hz = 50", "rate_hz = nan", "rate_hz is nan; it must be a finite number"),
        ("rate_hz = 50", "rate_hz = 1" + "0" * 400, "rate_hz is a whole number of more than"),
        (
            "turn_deg = 90",
            "gradient = 1",
            "unknown key 'gradient'; known: duration_s, turn_deg, bank_deg, speed_m_s, climb_m_s,",
        ),
        ("[start]", "[start]\nbiases_known = 1", "true or false"),
        ("legs = [", "legs = [ 3,", "legs 1 is 3"),
    ],
)
def test_files_with_mistakes_are_refused_in_one_line(tmp_path, old, new, words):
    assert old in FILE
    path = written(tmp_path, FILE.replace(old, new))
    with pytest.raises(DataError, match=words) as error:
        scenario(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(DataError, match="unknown scenario 'paper1-1' .did you mean 'paper1-11'"):
        scenario("paper1-1")
    with pytest.raises(DataError, match="cannot be read"):
        scenario(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="UTF-8"):
        scenario(tmp_path / "binary.toml")
    with pytest.raises(DataError, match="duration_s is missing"):
        scenario(
            written(
                tmp_path,
                '[motion]\nkind = "static"\nstart = { latitude_deg = 1, longitude_deg = 2, height_m = 3 }\n',
            )
        )


BASE = Scenario("base", demo_flight(), 100.0)
MOVING = lambda velocity: Motion("m", (0.8, 0.1, 100.0), velocity, lambda t: (0 * t, 0 * t, 0 * t))


@pytest.mark.parametrize(
    "change, words",
    [
        ({"duration": 0.0}, "duration is 0.0 s; it must be a finite number above 0"),
        ({"rate": -1.0}, "rate is -1.0 Hz; it must be"),
        ({"rate": np.nan}, "rate is nan Hz; it must be"),
        ({"duration": "long"}, "duration is .long. s; it must be"),
        ({"motion": 3}, "must be a Motion"),
        ({"gate": -1.0}, "gate is -1"),
        ({"gate": np.nan}, "gate is nan"),
        ({"gravity": "none"}, "gravity is 'none'"),
        ({"accel_offset": (0.0, np.nan, 0.0)}, "accel_offset"),
        ({"start_std": (1.0,) * 9}, "15 finite numbers"),
        ({"start_std": (None,) * 15}, "15 finite numbers"),
        ({"imu": "none"}, "unknown IMU"),
        ({"duration": 1e12}, "at most 50 million in 10 days"),
        ({"rate": 1e6}, "1e.08 IMU samples; at most 50 million"),
        ({"duration": 1e6, "rate": 1.0}, "10 days"),
        ({"accel_offset": (0.0, 1001.0, 0.0)}, "in m/s.2, each -1000 or more and at most 1000"),
        (
            {"start_std": (1.0,) * 6 + (4.0,) * 3 + (None,) * 6},
            "229.183 deg; it must be at most 180",
        ),
        ({"gnss": Gnss(0.005)}, "come faster than the IMU's samples"),
        ({"gnss": Gnss(-1.0)}, "interval"),
        ({"gnss": Gnss(np.nan)}, "interval"),
        ({"gnss": Gnss("x")}, "interval"),
        ({"gnss": Gnss(latency=-1.0)}, "latency"),
        (
            {"gnss": Gnss(position_std="x")},
            "standard deviations is 'x'; it must be 3 finite numbers",
        ),
        ({"motion": static((0.5, 0.0, 0.0), (0.0, 89.5 * DEG, 0.0))}, "pitch of 89 deg"),
        ({"gnss": Gnss(0.0)}, "interval"),
        ({"motion": static((89.5 * DEG, 0.0, 0.0))}, "89 deg of latitude"),
        ({"motion": static((0.5, 0.0, -2000.0))}, "lower than -1000 m"),
        ({"motion": MOVING(lambda t: (0 * t, 0 * t, -2000.0 + 0 * t))}, "higher than 100 km at 50"),
        ({"motion": MOVING(lambda t: (0 * t, 4000.0 + 0 * t, 0 * t))}, "faster than 3000"),
        ({"motion": MOVING(lambda t: (0 * t, np.nan * t, 0 * t))}, "not finite"),
    ],
)
def test_impossible_scenarios_are_refused(change, words):
    with pytest.raises(DataError, match=words) as error:
        BASE.replace(**change)
    assert "\n" not in str(error.value)


def test_the_fingerprint_changes_when_anything_does():
    slower = demo_flight()._replace(
        velocity=lambda t: tuple(0.999999 * v for v in demo_flight().velocity(t))
    )
    leaning = demo_flight()._replace(
        attitude=lambda t: tuple(angle + 1e-6 for angle in demo_flight().attitude(t))
    )
    changes = [
        {"motion": slower},
        {"motion": leaning},
        {"duration": 101.0},
        {"rate": 50.0},
        {"gnss": Gnss(0.5)},
        {"gnss": Gnss(latency=0.1)},
        {"imu": "consumer"},
        {"start_std": (2.0, *BASE.start_std[1:])},
        {"accel_offset": (0.0, 0.1, 0.0)},
        {"biases_known": True},
        {"gate": 9.0},
        {"gate": np.inf},
        {"gravity": "latitude"},
    ]
    prints = [
        BASE.describe()["fingerprint"],
        *(BASE.replace(**change).describe()["fingerprint"] for change in changes),
    ]
    assert len(set(prints)) == len(prints)
    again = Scenario(
        "renamed", demo_flight()._replace(name="other"), 100.0, about="the same flight"
    ).describe()
    assert again["fingerprint"] == prints[0] and again["name"] == "renamed"
    assert json.loads(json.dumps(again, allow_nan=False)) == again
    assert hash(BASE) == hash(BASE.replace(duration=100.0))


def test_the_file_in_the_documentation_works(tmp_path):
    text, *_ = re.findall(
        r"^```toml\n(.*?)^```", DOCS.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    valley = scenario(written(tmp_path, text))
    assert (
        valley.name == "valley" and valley.duration > 120 and valley.gnss.outages == ((60.0, 90.0),)
    )


def test_the_documentation_names_every_key():
    import inspect

    from strapdown.sim import scenario_file

    text = DOCS.read_text(encoding="utf-8")
    parameters = {
        name
        for build in scenario_file.MOTION_KINDS.values()
        for name in inspect.signature(build).parameters
    } - {"name", "duration"}
    keys = {scenario_file._key(name) for name in (*parameters, *scenario_file.motions.LEG_KEYS)}
    keys |= {
        *scenario_file.TOP_KEYS,
        *scenario_file.START_KEYS,
        *scenario_file.GNSS_KEYS,
        *(f'"{kind}"' for kind in scenario_file.MOTION_KINDS),
    }
    keys |= {
        *scenario_file.MAGNETOMETER_KEYS,
        *scenario_file.DISTURBANCE_KEYS,
        *scenario_file.BAROMETER_KEYS,
        *scenario_file.TARGET_KEYS,
    }
    assert not [key for key in keys if key not in text]
