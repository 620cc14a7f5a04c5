"""JSBSim's own aircraft as truth of a simulation: it holds what it is told, repeats itself, is
silent, and its motion is what JSBSim itself says."""

import sys
from threading import Thread

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.sim.jsbsim import (
    FOOT,
    JsbsimTarget,
    _fly,
    _load,
    _trim,
    flown_by_jsbsim,
    jsbsim_motion,
    session,
)
from strapdown.sim.splined import residual, spline_motion
from strapdown.sim.trajectory import DEG, normal_gravity, rates

START, EAST = (47.6 * DEG, 9.3 * DEG, 1200.0), 90 * DEG
TARGETS = (JsbsimTarget(5.0, heading=150 * DEG, height=1230.0),)
SCENARIO = """
name = "cessna"
duration_s = 20
rate_hz = 50
[motion]
kind = "jsbsim"
start = { latitude_deg = 47.6, longitude_deg = 9.3, height_m = 1200 }
heading_deg = 90
speed_m_s = 52
targets = [{ at_s = 5, heading_deg = 150, height_m = 1230 }]
"""


@pytest.fixture(scope="module")
def flown():
    pytest.importorskip("jsbsim")
    return flown_by_jsbsim(START, EAST, 52.0, 60.0, targets=TARGETS)


def test_it_begins_where_it_is_told_in_level_flight(flown):
    assert np.abs((flown.lla[0] - START) * [6.4e6, 6.4e6, 1]).max() < 1e-3
    assert np.linalg.norm(flown.v_n[0]) == pytest.approx(52.0, abs=1e-3)
    assert flown.rph[0, 2] == pytest.approx(EAST, abs=1e-6)
    assert (
        np.abs(flown.lla[:100, 2] - START[2]).max() < 0.05
        and np.abs(flown.rph[:100, 2] - EAST).max() < 2e-3
    )


def test_the_autopilot_holds_its_targets(flown):
    assert flown.rph[-1, 2] == pytest.approx(150 * DEG, abs=2 * DEG)
    assert flown.lla[-1, 2] == pytest.approx(1230.0, abs=15.0)
    assert np.abs(flown.rph[:, 0]).max() > 20 * DEG  # it turned by banking


def test_it_repeats_bit_for_bit_prints_nothing_and_leaves_no_file(
    flown, capfd, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    again = flown_by_jsbsim(START, EAST, 52.0, 60.0, targets=TARGETS)
    assert np.array_equal(again.lla, flown.lla) and np.array_equal(again.q_nb, flown.q_nb)
    # the Cessna's own definition asks for a log
    assert capfd.readouterr() == ("", "") and not list(tmp_path.iterdir())


def test_the_motion_keeps_to_the_positions_of_jsbsim_and_to_rows_held_back():
    pytest.importorskip("jsbsim")
    dense = flown_by_jsbsim(START, EAST, 52.0, 30.0, targets=TARGETS, row=0.01)
    half = sd.Trajectory(dense.t[::2], dense.lla[::2], dense.v_n[::2], dense.q_nb[::2])
    position, velocity, turn = residual(spline_motion(half), dense)
    assert (
        np.abs(position).max() < 1e-5
        and np.abs(velocity).max() < 2e-4
        and np.abs(turn).max() < 2e-5
    )
    assert np.sqrt(np.mean(velocity**2)) < 1e-5 and np.sqrt(np.mean(turn**2)) < 1e-6


def test_its_specific_force_and_rate_are_those_of_jsbsim():
    """Total force over mass and inertial rate, asked of JSBSim at the rows, against what an
    ideal IMU of the splined motion feels there."""
    pytest.importorskip("jsbsim")
    said = []
    force, rate = (
        [f"forces/fb{axis}-total-lbs" for axis in "xyz"],
        [f"velocities/{axis}i-rad_sec" for axis in "pqr"],
    )
    with session() as (executive, _):
        _load(executive, "c172x")
        _trim(executive, "c172x", START, EAST, 52.0)
        flown = _fly(
            executive,
            "c172x",
            TARGETS,
            1000,
            4,
            lambda: said.append(
                [executive[key] / executive["inertia/mass-slugs"] * FOOT for key in force]
                + [executive[key] for key in rate]
            ),
        )
    omega, f = rates(spline_motion(flown), flown.t[5:-5], flown.lla[5:-5].T, normal_gravity)
    said = np.array(said)[5:-5]
    # m/s^2: a kink when the target comes
    assert (
        np.sqrt(np.mean((f.T - said[:, :3]) ** 2)) < 3e-4 and np.abs(f.T - said[:, :3]).max() < 0.02
    )
    assert (
        np.sqrt(np.mean((omega.T - said[:, 3:]) ** 2)) < 1e-3
        and np.abs(omega.T - said[:, 3:]).max() < 0.02
    )


def test_it_is_a_motion_for_simulate_and_a_kind_of_scenario_file(flown, tmp_path):
    path = tmp_path / "cessna.toml"
    path.write_text(SCENARIO)
    recording = sd.simulate(path, seed=2)
    direct = sd.simulate(
        jsbsim_motion(START, EAST, 52.0, 20.0, targets=TARGETS), 20.0, "tactical", seed=2, rate=50.0
    )
    assert np.array_equal(recording.imu.dv, direct.imu.dv) and recording.meta["name"] == "cessna"
    # m: rows every 0.02 s in both
    assert np.abs((recording.reference.lla - flown.lla[:1001]) * [6.4e6, 4.3e6, 1]).max() < 1e-3


def test_nothing_is_flown_after_the_last_row():
    pytest.importorskip("jsbsim")
    with session() as (executive, _):
        _load(executive, "c172x")
        _trim(executive, "c172x", START, EAST, 52.0)
        begun = executive["simulation/sim-time-sec"]
        _fly(executive, "c172x", (), 10, 4)
        assert executive["simulation/sim-time-sec"] - begun == pytest.approx(40 / 200)


def test_a_session_waits_for_that_of_another_thread():
    pytest.importorskip("jsbsim")
    order = []

    def other():
        with session():
            order.append("other")

    with session(), session():  # of one thread two may be alive
        thread = Thread(target=other)
        thread.start()
        thread.join(0.2)
        order.append("one")
    thread.join(20)
    assert order == ["one", "other"]


def test_properties_of_jsbsim_may_be_set(flown):
    still, windy = (
        flown,
        flown_by_jsbsim(START, EAST, 52.0, 20.0, properties={"atmosphere/wind-north-fps": 20.0}),
    )
    assert np.abs(windy.v_n[100, 0] - still.v_n[100, 0]) > 0.3


def test_without_jsbsim_the_extra_is_named(monkeypatch, tmp_path, command):
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    path = tmp_path / "cessna.toml"
    path.write_text(SCENARIO)
    code, _, said = command("simulate", path, "--out", tmp_path / "made.nc")
    assert code == 2 and len(said) == 1 and 'pip install "strapdown[jsbsim]"' in said[0]
    assert not (tmp_path / "made.nc").exists()


@pytest.mark.parametrize(
    "change, words",
    [
        ({"aircraft": "c172xx"}, "did you mean 'c172x'"),
        ({"aircraft": "ball"}, "no autopilot"),
        ({"speed": 12.0}, "cannot trim c172x .* 12 m/s"),
        ({"speed": -1.0}, "above 0"),
        ({"start": (0.8, 0.1, np.nan)}, "start is"),
        ({"targets": (JsbsimTarget(99.0, heading=1.0),)}, "its time is 99.0 s; .* at most 20"),
        ({"targets": (JsbsimTarget(1.0, throttle=1.5),)}, "throttle is 1.5; .* at most 1"),
        ({"targets": ((1.0, 2.0),)}, "a list of .*Target"),
        ({"properties": {"atmosphere/wind-fps": 1.0}}, "no property"),
        ({"rate": -5.0}, "rate is -5.0 steps per second"),
        ({"rate": 0}, "rate is 0 steps per second"),
        ({"rate": 1e6}, "at most 100000"),
        ({"row": np.nan}, "row is nan s"),
        ({"row": 1e300}, "no longer than the flight"),
        ({"duration": 1e12}, "steps are the most"),
        ({"start": "abc"}, "start is 'abc'; it must be 3 finite numbers: latitude"),
        ({"start": (47.6, 9.3, 1200)}, "within 89 deg"),
        ({"speed": "a"}, "speed is 'a' m/s"),
        ({"heading": None}, "heading is None rad"),
        ({"targets": (JsbsimTarget(1.0, heading="a"),)}, "it must be a finite number"),
        ({"targets": (JsbsimTarget(None),)}, "it must be a finite number"),
        ({"targets": JsbsimTarget(1.0, heading=1.0)}, "a list of"),
        ({"aircraft": 172}, "no aircraft 172"),
        (
            {"properties": {"atmosphere/wind-north-fps": "a"}},
            "property 'atmosphere/wind-north-fps' of JSBSim, .*, is 'a'",
        ),
        (
            {"properties": {"atmosphere/wind-north-fps": np.nan}},
            "is nan; it must be a finite number",
        ),
        ({"properties": 3}, "properties are 3"),
        (
            {
                "start": (0.8, 0.1, 30.0),
                "targets": (JsbsimTarget(0.0, height=-500.0, throttle=0.0),),
            },
            "hit the ground",
        ),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(change, words, capfd):
    pytest.importorskip("jsbsim")
    given = {"start": START, "heading": EAST, "speed": 52.0, "duration": 20.0} | change
    with pytest.raises(DataError, match=words) as raised:
        flown_by_jsbsim(**given)
    assert "\n" not in str(raised.value) and capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("at_s = 5, ", "at = 5, ", "did you mean 'at_s'"),
        ("[{ at_s", "{ at_s", "list"),
        ('kind = "jsbsim"', 'kind = "jsbsim"\naircraft = 172', "text"),
        ('kind = "jsbsim"', 'kind = "jsbsim"\nproperties = 3', "table"),
        ("duration_s = 20\n", "", "duration_s is missing"),
    ],
)
def test_mistakes_in_the_file_are_named(old, new, words, tmp_path):
    text = SCENARIO.replace(old, new)
    path = tmp_path / "cessna.toml"
    path.write_text(text.replace("1230 }]", "1230 }") if "= { at_s" in text else text)
    with pytest.raises(DataError, match=words):
        sd.scenario(path)
