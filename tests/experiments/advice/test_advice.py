"""Advice on open loop, resets and closed loop: durations and missions, the rule on made-up
numbers, and small ones from end to end."""

import json
import re
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import strapdown as sd
from strapdown import DataError, filters
from strapdown.evaluation.consistency import Interval, proportion
from strapdown.experiments.advice import advise as advising
from strapdown.experiments.advice.advise import _map_imus, _map_scenarios, advise, durations
from strapdown.experiments.advice.mission import kinds, mission, seconds
from strapdown.experiments.advice.page import sentences
from strapdown.experiments.advice.verdicts import (
    CLOSED,
    OPEN,
    RESET,
    UNDECIDED,
    FilterEvidence,
    Rules,
    Runs,
    decide,
    evidence,
    guess,
    interval_of,
    judge,
    variants,
)
from strapdown.sensor_models.barometer import Barometer
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sensor_models.magnetometer import Magnetometer
from strapdown.sim.scenario import scenario

MINE = replace(
    imu_spec("navigation"),
    name="my IMU",
    gyro=replace(imu_spec("navigation").gyro, scale_factor=1e-3),
)
"""Further arguments of `advise`, the last one the alignment."""
GOOD = Interval(1.05, 0.98, 1.12)
LEVEL = Interval(1.0, 0.99, 1.01)


@pytest.mark.short
@pytest.mark.parametrize(
    "text, expected",
    [
        ("90min", 5400),
        ("2h", 7200),
        ("600", 600),
        ("1h30min", 5400),
        ("1.5 h", 5400),
        (" 45 S ", 45),
        (600, 600),
        (12.5, 12.5),
    ],
)
def test_durations_are_read(text, expected):
    assert seconds(text) == expected


@pytest.mark.short
@pytest.mark.parametrize(
    "text",
    [
        "",
        "abc",
        "5 parsec",
        "-5min",
        "nan",
        "inf",
        "5 6",
        "1..2h",
        "min",
        "1h30",
        0,
        -3,
        float("nan"),
        float("inf"),
        None,
        True,
        "0s",
        "9s",
        "30h",
        [60],
    ],
)
def test_bad_durations_are_refused_in_one_line(text):
    with pytest.raises(DataError, match="duration") as caught:
        seconds(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "kind",
    [
        kind
        for kind in kinds()
        if not kind.startswith("paper1") or kind in ("paper1-08", "paper1-11")
    ],
)
def test_every_kind_is_cut_and_extended(kind):
    for duration in (60.0, 7000.0):
        made = mission(kind, duration)
        assert (
            made.duration == duration <= made.motion.end and made.rate <= 20 and kind in made.name
        )


@pytest.mark.short
def test_the_flights_of_the_map_have_every_sensor_of_the_mission():
    given = mission("straight", 600.0).replace(
        gnss=Gnss(interval=2.0),
        magnetometer=Magnetometer(rate=5.0),
        barometer=Barometer(rate=4.0),
        date="2024-05-01",
    )
    sensors = [
        each.name
        for each in fields(given)
        if isinstance(getattr(given, each.name), (Gnss, Magnetometer, Barometer))
    ]
    assert sensors == ["gnss", "magnetometer", "barometer"]
    for flight in _map_scenarios(given):
        for name in [*sensors, "date", "gate", "gravity", "start_std"]:
            assert getattr(flight, name) == getattr(given, name), name


@pytest.mark.short
def test_an_extended_circuit_flies_its_legs_again():
    made = mission("dynamic", 3000.0)
    truth = made.glance(3001)
    rounds = np.unwrap(truth.rph[:, 2])[[500, 1500, 2500]]
    assert abs(np.diff(rounds)).min() > 2 * np.pi  # turns go on
    assert np.ptp(truth.lla[:, 2]) < 150  # climb and descent cancel


def test_a_scenario_file_is_extended(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'duration_s = 50\nrate_hz = 10\n[motion]\nkind = "car"\nstart = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }\ncourse_deg = 0\n'
        "legs = [{ duration_s = 20, speed_m_s = 10 }, { duration_s = 20, turn_deg = 90, speed_m_s = 5 }, { duration_s = 20, speed_m_s = 0 }]\n"
        "[gnss]\nposition_std_m = 2\n"
    )
    made = mission(str(path), 130.0)
    assert (made.duration, made.rate, made.gnss.velocity_std, made.name) == (
        130.0,
        10.0,
        None,
        "mine-130s",
    )
    assert np.linalg.norm(made.glance(131).v_n[80]) > 2  # the second round drives off again


def test_impossible_missions_are_refused_in_one_line(tmp_path):
    path = tmp_path / "fast.toml"
    path.write_text(
        '[motion]\nkind = "flight"\nstart = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }\ncourse_deg = 0\nspeed_m_s = 50\n'
        "legs = [{ duration_s = 60, climb_m_s = -10 }]\n"
    )
    for flight, duration, said in (
        ("dynamik", 60.0, "did you mean 'dynamic'"),
        (tmp_path / "none.toml", 60.0, "cannot be read"),
        ("paper1-01", 36000.0, "lower than"),
        (path, 3600.0, "lower than"),
        (scenario("car"), 9000.0, "its motion ends at"),
    ):
        with pytest.raises(DataError, match=said) as caught:
            mission(flight, duration)
        assert "\n" not in str(caught.value)


def seen(label, lived=40, count=40, nees=GOOD, ratio=LEVEL):
    return FilterEvidence(
        label,
        count,
        lived,
        proportion(lived, count),
        nees,
        ratio if label != CLOSED else Interval(1.0, 1.0, 1.0),
        20,
        0.5,
        0.1,
    )


def asked(**changes):
    """Evidence of an open loop, two resets and a closed loop, all admissible but for `changes`
    (open, slow, fast, closed: dicts)."""
    labels = {"open": OPEN, "slow": f"{RESET}300", "fast": f"{RESET}60", "closed": CLOSED}
    return {label: seen(label, **changes.get(name, {})) for name, label in labels.items()}


BAD = {"lived": 3}
DRIFTING = {"ratio": Interval(1.5, 1.3, 1.7)}
LYING = {"nees": Interval(9.0, 5.0, 13.0)}


@pytest.mark.short
@pytest.mark.parametrize(
    "changes, answer, filter",
    [
        ({}, "open", OPEN),
        ({"open": BAD}, "reset", f"{RESET}300"),
        ({"open": DRIFTING, "slow": LYING}, "reset", f"{RESET}60"),
        ({"open": BAD, "slow": BAD, "fast": LYING}, "closed", CLOSED),
        (dict.fromkeys(("open", "slow", "fast", "closed"), LYING), "none", None),
        ({"open": {"nees": Interval(0.2, 0.1, 0.3)}}, "reset", f"{RESET}300"),
    ],
)
def test_each_answer_is_reached(changes, answer, filter):
    decision = decide(asked(**changes))
    assert (decision.answer, decision.filter, decision.doubtful) == (answer, filter, None)


@pytest.mark.short
def test_an_open_question_is_said_where_it_could_change_the_kind_of_answer():
    wide = {"nees": Interval(1.8, 1.5, 2.1)}
    first = decide(asked(open=wide))
    assert (first.answer, first.filter, first.doubtful) == ("undecided", f"{RESET}300", OPEN)
    assert decide(asked(open=BAD, slow=wide)).answer == "reset"  # 60 s or 300 s: a reset either way
    last = decide(asked(open=BAD, slow=BAD, fast=BAD, closed=wide))
    assert (last.answer, last.filter, last.doubtful) == ("undecided", None, CLOSED)
    assert decide(asked(open=wide), judged=guess).answer == "open"  # by the estimate alone


@pytest.mark.short
def test_needed_runs_follow_from_the_width_of_the_intervals():
    verdict = judge(seen(OPEN, nees=Interval(1.8, 1.4, 2.2)))
    # half a width of 0.4, room of 0.2: four times the runs
    assert (verdict.belief, verdict.runs) == (
        UNDECIDED,
        160,
    )
    few = judge(seen(OPEN, lived=10, count=10))
    # Wilson: n / (n + 1.96^2) >= 0.9 from n = 35 on
    assert few.survival == UNDECIDED and 35 <= few.runs <= 36
    assert (
        judge(seen(OPEN, lived=40)).survival == "yes"
        and judge(seen(OPEN, lived=39)).survival == UNDECIDED
    )
    assert (
        judge(
            seen(
                OPEN,
                count=1,
                lived=1,
                nees=Interval(1.0, np.nan, np.nan),
                ratio=Interval(1.0, np.nan, np.nan),
            )
        ).admissible
        == UNDECIDED
    )


@pytest.mark.short
def test_thresholds_move_the_answer():
    found = asked(open={"ratio": Interval(1.15, 1.12, 1.18)})
    assert decide(found).answer == "reset" and decide(found, Rules(worse=0.25)).answer == "open"
    answers = {name: decide(found, rules).answer for name, rules in variants().items()}
    assert (
        len(answers) == 6
        and answers["RMSE up to 25 % worse"] == "open"
        and answers["RMSE up to 5 % worse"] == "reset"
    )


@pytest.mark.short
def test_evidence_follows_its_definitions():
    rng = np.random.default_rng(3)
    filters, runs, n = (CLOSED, OPEN, f"{RESET}60"), 30, 50
    nees = rng.chisquare(15, (3, runs, n)) / 15
    nees[1, :, -5:] *= 4  # the open loop lies in its last tenth
    squares = (
        np.broadcast_to(rng.chisquare(3, (1, runs, n)), (3, runs, n))
        * np.array([1.0, 1.44, 1.0])[:, None, None]
    )
    lasted = np.full((3, runs), np.inf)
    lasted[1, :6] = 30.0
    found = evidence(
        Runs(filters, np.arange(1.0, n + 1), squares, nees, np.full_like(nees, 0.01), lasted)
    )
    assert list(found) == [OPEN, f"{RESET}60", CLOSED] and [
        interval_of(label) for label in found
    ] == [np.inf, 60.0, 0.0]
    assert found[OPEN].lived == 24 and found[CLOSED].lived == 30
    # every run alike: an interval without width
    assert np.allclose(found[OPEN].ratio, 1.2) and found[OPEN].ahead == 0
    assert 3.5 < found[OPEN].nees.value < 4.5 and 0.85 < found[CLOSED].nees.value < 1.15
    assert np.isclose(found[CLOSED].heading, np.degrees(0.01))


@pytest.mark.short
def test_runs_cut_short_forget_what_came_later():
    runs = Runs(
        (CLOSED, OPEN),
        np.arange(1.0, 11.0),
        np.ones((2, 4, 10)),
        np.ones((2, 4, 10)),
        np.zeros((2, 4, 10)),
        np.array([[np.inf] * 4, [3.0, 8.0, np.inf, np.inf]]),
    )
    cut = runs.until(5.0)
    assert len(cut.t) == 5 and cut.squares.shape == (2, 4, 5)
    assert evidence(runs)[OPEN].lived == 2 and evidence(cut)[OPEN].lived == 3


@pytest.mark.short
def test_the_grid_of_durations_ends_at_the_mission():
    assert (
        list(durations(60.0)) == [60.0]
        and durations(7200.0)[-1] == 7200.0
        and durations(30.0).tolist() == [30.0]
    )
    for duration in (61.0, 300.0, 5400.0, 86400.0):
        grid = durations(duration)
        assert len(grid) <= 9 and np.all(np.diff(grid) > 0) and grid[-1] == duration


@pytest.mark.short
def test_the_users_imu_has_its_own_row_in_the_map():
    from dataclasses import replace

    assert [spec.name for spec in _map_imus(imu_spec("tactical"))] == [
        "consumer",
        "industrial",
        "tactical",
        "navigation",
    ]
    other = replace(imu_spec("tactical"), accel=replace(imu_spec("tactical").accel, noise=1e-3))
    assert [spec.name for spec in _map_imus(other)][-1] == "own tactical" and _map_imus(
        imu_spec("paper1-tactical")
    )[-1].name == "paper1-tactical"


@pytest.mark.short
@pytest.mark.parametrize(
    "changes, said",
    [
        ({}, "Open loop"),
        ({"open": BAD}, "Reset every 300 s"),
        (dict.fromkeys(("open", "slow", "fast"), BAD), "Closed loop"),
        (
            dict.fromkeys(("open", "slow", "fast", "closed"), LYING),
            "None is trustworthy here, not even the closed loop: NEES",
        ),
        (
            {"open": {"nees": Interval(1.8, 1.4, 2.2)}},
            "Not decided by 40 runs: to tell whether the answer is open loop takes about 160",
        ),
        (
            {"open": BAD, "slow": BAD, "fast": BAD, "closed": {"lived": 38}},
            "Not decided by 40 runs: closed loop, if any",
        ),
    ],
)
def test_sentences_begin_with_the_condition_and_the_answer(changes, said):
    found = asked(**changes)
    others = {name: decide(found, rules) for name, rules in variants().items()}
    decision = decide(found)
    lines = sentences(
        SimpleNamespace(
            found=found,
            decision=decision,
            answer=decision.answer,
            others=others,
            through=[(60.0, decision)],
            seed=1,
            imu=MINE,
            scenario=mission("static", 60.0),
            rules=Rules(),
            alignment="given",
        )
    )
    assert lines.pop(0) == (
        "If at the start roll and pitch are known to 0.11 deg and heading to 0.57 deg:"
    )
    assert lines[0].startswith(said) and any(line.startswith("How sure") for line in lines)
    assert len([line for line in lines if line.startswith("  ")]) == 4 and lines[1].startswith(
        "my IMU, static"
    )
    assert any(line.startswith("Likely cause") and "scale factor" in line for line in lines) == (
        decision.answer == "none"
    )
    assert any(
        line.startswith(("The open loop is not", "By the estimates the open")) for line in lines
    ) == (decision.answer not in ("open", "undecided"))


def test_a_navigation_grade_in_a_short_mission_may_run_open_loop():
    advice = advise("navigation", "dynamic", "60s", quick=True, seed=1)
    assert (advice.answer, advice.decision.filter) == ("open", OPEN)
    assert str(advice).splitlines()[1].startswith("Open loop")
    assert "--alignment moving" in str(advice)


def test_after_an_alignment_in_motion_runs_begin_with_its_errors():
    """Those that `align` claims on the first seconds: heading from the course."""
    advice = advise("navigation", "dynamic", "60s", runs=20, quick=True, seed=1, alignment="moving")
    recording = sd.simulate(mission("dynamic", 60.0), imu="navigation", seed=0)
    claimed = np.degrees(sd.align(recording, imu_spec("navigation")).std[6:9])
    assert claimed[2] > 3.0
    written = advice.as_dict()
    assert written["alignment"] == "moving"
    assert written["start_attitude_std_deg"] == pytest.approx(claimed)
    first, second, *_ = str(advice).splitlines()
    assert first.startswith("If after an alignment in motion roll and pitch are known to")
    assert f"heading to {claimed[2]:.2g} deg:" in first and "--alignment" not in str(advice)
    # of 20 normal errors the root mean square is within 0.6 and 1.4 of it, 99 % of the time
    (error,) = (
        part["error"] for part in advice.campaign.read(advice.campaign.cells[0], ("error",))
    )
    begun = np.degrees(np.sqrt(np.mean(error[:, :, 0, 8].astype(float) ** 2)))
    assert 0.3 * claimed[2] < begun < 1.4 * claimed[2]  # a second of fixes has been used
    given = advise("navigation", "dynamic", "60s", runs=2, quick=True, seed=1)
    assert "If at the start" in given._repr_html_() and "<script" not in given._repr_html_()
    assert given.as_dict()["start_attitude_std_deg"] == pytest.approx(
        [0.115, 0.115, 0.573], abs=1e-3
    )


def test_the_cost_is_told_before_and_after(tmp_path):
    said = []
    given = dict(runs=3, seed=1, out=tmp_path / "a", map=False, notify=said.append)
    advise("tactical", "straight", 60, **given)
    before, after = said[-2:]  # before them there may be lines on compiling
    # 3 runs of 3 filters over 60 s at 20 Hz
    assert before.startswith("3 runs of 3 filters: 0.0108 million filter steps, about 0.31 s")
    elapsed = float(re.match(r"it took ([0-9.]+) s, with", after)[1])
    assert 0 < elapsed < 60
    advise("tactical", "straight", 60, **given)
    assert "0 to do of 0.0108 million filter steps" in said[-2]
    assert "compiling" not in said[-2]


def test_the_cost_counts_compiling(monkeypatch):
    """That of all kernels of the study."""
    asked, said = [], []
    monkeypatch.setattr(
        advising, "seconds_to_compile", lambda kernels: asked.append(kernels) or 118.0
    )
    advise("tactical", "straight", 60, runs=2, seed=1, quick=True, notify=said.append)
    (kernels,) = asked
    for name in ("closed-loop", "open-loop"):
        assert filters.find(name).predict in kernels, name
    told = next(line for line in said if "million filter steps" in line)
    assert told.endswith("s of processor time, after about 118 s of compiling, this time alone")


def test_a_consumer_grade_may_not():
    advice = advise("consumer", "dynamic", "2min", runs=12, quick=True, seed=1)
    assert advice.decision.verdicts[OPEN].admissible == "no" and advice.answer != "open"


@pytest.mark.deep
def test_an_advice_is_written_and_the_same_again(tmp_path):
    said, fractions = [], []
    first = advise(
        "tactical",
        "straight",
        90,
        runs=4,
        seed=5,
        out=tmp_path / "a",
        rate=10.0,
        threads=2,
        notify=said.append,
        progress=fractions.append,
    )
    again = advise("tactical", "straight", 90, runs=4, seed=5, rate=10.0, threads=1)
    assert (
        first.found == again.found and first.decision == again.decision and first.map == again.map
    )
    assert first.answer == "undecided"  # 4 runs show no survival of 90 %
    written = json.loads((tmp_path / "a" / "advice.json").read_text())
    assert (
        written["answer"] == "undecided"
        and 35 <= written["runs_needed"] <= 40
        and len(written["filters"]) == 3
    )
    page = (tmp_path / "a" / "index.html").read_text(encoding="utf-8")
    assert (
        page.count("class=plot") == 5
        and "Not decided by 4 runs" in page
        and not re.search(r"(src|href)=['\"]?https?:", page[: page.index("<footer>")])
    )
    assert len((tmp_path / "a" / "map.csv").read_text().splitlines()) == 1 + 2 * 4 * len(
        durations(90.0)
    )
    assert len((tmp_path / "a" / "summary.csv").read_text().splitlines()) == 1 + 3
    with pytest.raises(DataError, match="seed is 5 there and 6 here"):
        advise(
            "tactical",
            "straight",
            90,
            runs=4,
            seed=6,
            out=tmp_path / "a",
            rate=10.0,
            threads=2,
            notify=pytest.fail,
        )
    assert (
        any("million filter steps" in line for line in said)
        and fractions == sorted(fractions)
        and fractions[-1] == pytest.approx(1.0)
    )
    cut = {(row["motion"], row["imu"]) for row in first.map}
    assert cut == {
        (motion, imu)
        for motion in ("straight", "dynamic")
        for imu in ("consumer", "industrial", "tactical", "navigation")
    }


def test_bad_requests_end_in_one_line(tmp_path):
    bad = tmp_path / "imu.toml"
    bad.write_text("name = 3\n")
    (tmp_path / "file").write_text("")
    for arguments, said in (
        (("tactical", "static", "1min", {"runs": 0}), "runs is 0"),
        (("tacticle", "static", "1min"), "tactical"),
        ((str(bad), "static", "1min"), "imu.toml"),
        (("tactical", "flying", "1min"), "unknown flight"),
        (("tactical", "static", "soon"), "duration"),
        (("tactical", "static", "10s", {"runs": 2, "map": True, "quick": True}), "leave out one"),
        (("tactical", "static", "10s", {"runs": 2, "seed": -1}), "seed is -1"),
        (
            ("tactical", "static", "60s", {"runs": 2, "map": False, "alignment": "moving"}),
            "finds no heading",
        ),
        (
            ("tactical", "static", "10s", {"runs": 2, "out": tmp_path / "file" / "sub"}),
            "cannot be made",
        ),
    ):
        with pytest.raises(DataError, match=said) as caught:
            positional = [each for each in arguments if not isinstance(each, dict)]
            advise(*positional, **(arguments[3] if len(arguments) > 3 else {}))
        assert "\n" not in str(caught.value)
