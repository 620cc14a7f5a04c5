"""Receivers by name and file: what ships, where it can be named, and what is refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import Correlated
from strapdown.flight import Loop, Sensors, fly
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.receiver import receiver, receiver_grade, receivers
from strapdown.sim.scenario import scenario

DOCS = Path(__file__).parents[2] / "docs" / "how-to" / "simulate.md"
FILE = """
name = "mine"
interval_s = 0.5
position_std_m = [0.3, 0.3, 0.6]
position_correlated = { std_m = 1, time_s = 120 }
latency_s = 0.1
"""
MINE = Gnss(
    0.5, (0.3, 0.3, 0.6), None, latency=0.1, position_correlated=Correlated((1.0,) * 3, 120)
)


def test_each_shipped_receiver_is_whole_and_says_its_sources():
    assert receivers() == ["rtk-fixed", "rtk-float", "sbas", "single-point"]
    for name in receivers():
        found = receiver_grade(name)
        assert found.name == name and found.gnss == receiver(name) and found.gnss.stated
        for std_, lasting in (
            (found.gnss.position_std, found.gnss.position_correlated),
            (found.gnss.velocity_std, found.gnss.velocity_correlated),
        ):
            assert (
                std_[0] == std_[1] < std_[2] and lasting.std[0] == lasting.std[1] < lasting.std[2]
            )
        assert "judgement" in found.source + receiver_grade("rtk-float").source
    total = {
        name: np.hypot(receiver(name).position_std, receiver(name).position_correlated.std)
        for name in receivers()
    }
    # of their sources: 2.5 m CEP and twice that upwards; the upper ends of 95 % at reference
    # stations; standard deviations of float and fixed solutions
    np.testing.assert_allclose(total["single-point"], 2.5 / 1.1774 * np.array([1, 1, 2]), rtol=0.05)
    np.testing.assert_allclose(total["sbas"][::2], [1.062 / 2.4477, 1.79 / 1.96], rtol=0.05)
    assert 0.09 <= total["rtk-float"][0] <= 0.12
    np.testing.assert_allclose(total["rtk-float"][2], 0.208, rtol=0.05)
    assert 0.0085 <= total["rtk-fixed"][0] <= 0.015 and 0.015 <= total["rtk-fixed"][2] <= 0.067


def test_the_documentation_has_their_figures():
    rows = [
        [cell.strip() for cell in line.strip("| \n").split("|")]
        for line in re.findall(r"^\|.*$", DOCS.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    head = next(row for row in rows if row[0] == "term" and "`sbas`" in row)
    names = [cell.strip("`") for cell in head[1:]]
    assert sorted(names) == receivers()
    for column, name in enumerate(names, 1):
        told = {row[0]: row[column] for row in rows if row[0] in receiver_grade(name).sheet()}
        assert told == receiver_grade(name).sheet()


def test_a_name_or_a_file_serves_where_a_gnss_does(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(FILE)
    assert receiver(MINE) is MINE and receiver(str(file)) == receiver(file) == MINE
    car = scenario("car")
    mounted = receiver("sbas")._replace(lever_arm=car.gnss.lever_arm, outages=car.gnss.outages)
    assert car.gnss.outages and receiver("sbas", car.gnss) == mounted
    by_name, by_value = (
        sd.simulate("car", duration=20.0, seed=2, gnss=gnss).sources for gnss in ("sbas", mounted)
    )
    for one, other in zip(by_name, by_value, strict=True):
        np.testing.assert_array_equal(one.y, other.y)
        assert one.correlated == other.correlated is not None
    flight = fly(
        "straight",
        "closed-loop",
        duration=1.0,
        sensors=Sensors(gnss="rtk-float"),
        loop=Loop(feedback="truth"),
    )
    told = receiver("rtk-float").position_correlated
    assert (
        flight.recording.sources[0].correlated == told and len(flight.recording.sources[0].t) == 5
    )


def test_a_scenario_file_names_a_receiver_and_changes_it(tmp_path):
    (tmp_path / "mine.toml").write_text(FILE)
    text = (
        'duration_s = 20\n[motion]\nkind = "static"\n'
        "start = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }\n[gnss]\n"
    )
    for added, expected in (
        ('receiver = "rtk-fixed"', receiver("rtk-fixed")),
        ('receiver = "mine.toml"', MINE),
        (
            'receiver = "sbas"\ninterval_s = 0.2\nlever_arm_m = [1, 0, -1]\nstated = false',
            receiver("sbas")._replace(interval=0.2, lever_arm=(1.0, 0.0, -1.0), stated=False),
        ),
    ):
        (tmp_path / "flown.toml").write_text(text + added)
        assert scenario(tmp_path / "flown.toml").gnss == expected
    (tmp_path / "flown.toml").write_text(text + 'receiver = "sbass"')
    with pytest.raises(
        DataError, match="flown.toml: unknown receiver 'sbass' .did you mean 'sbas'"
    ):
        scenario(tmp_path / "flown.toml")


@pytest.mark.parametrize(
    "change, words",
    [
        (("latency_s = 0.1", "latency = 0.1"), "unknown key 'latency'"),
        (("latency_s = 0.1", "latency_s = -1"), "latency"),
        (("interval_s = 0.5", "interval_s = 0"), "interval between fixes"),
        (("position_std_m = [0.3, 0.3, 0.6]", ""), "and no white noise"),
        (("time_s = 120", ""), "time_s is missing|Invalid|invalid"),
        (("latency_s = 0.1", "outages_s = [[1, 2]]"), "unknown key 'outages_s'"),
    ],
)
def test_a_file_that_describes_none_is_refused_in_one_line(tmp_path, change, words):
    file = tmp_path / "mine.toml"
    file.write_text(FILE.replace(*change))
    with pytest.raises(DataError, match=words) as refused:
        receiver(file)
    assert "mine.toml" in str(refused.value) and "\n" not in str(refused.value)


def test_what_is_no_receiver_is_refused():
    for bad in (5, None, Gnss):
        with pytest.raises(DataError, match="it must be a Gnss, the name of a receiver"):
            receiver(bad)
    with pytest.raises(DataError, match="cannot be read"):
        sd.simulate("car", duration=5.0, gnss="nowhere/mine.toml")


def test_a_study_tells_receivers_apart():
    demo = scenario("demo")
    white, lasting = (
        replace(demo, gnss=receiver(name, demo.gnss)) for name in ("sbas", "rtk-fixed")
    )
    assert white.describe()["fingerprint"] != lasting.describe()["fingerprint"]
