"""Wrong set-ups: what each mistake does to a recording by hand, when it is harmful, which are said
to be hidden, and the files of a run."""

import json

import numpy as np
import pandas as pd
import pytest

from strapdown.aiding import names
from strapdown.core.loop.contract import Imu
from strapdown.data.recording import Recording
from strapdown.data.solution import Source
from strapdown.data.verdict import CAUSES, DOUBTFUL, Reason
from strapdown.geometry.geodesy import displacement
from strapdown.io.locate import data_folder
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS
from strapdown_reproductions.wrong_setups import cells, main
from strapdown_reproductions.wrong_setups.cases import (
    MOTIONS,
    SetUpCase,
    heading_to,
    recorded_cases,
    simulate_case,
)
from strapdown_reproductions.wrong_setups.cells import Heard
from strapdown_reproductions.wrong_setups.harm import Harm, HarmScore, compare_scores
from strapdown_reproductions.wrong_setups.mistakes import MISTAKES
from strapdown_reproductions.wrong_setups.not_showable import NOT_SHOWABLE, why_hidden

OF = {mistake.name: mistake for mistake in MISTAKES}
GRADE = "industrial"


def case(**more):
    """Four seconds at rest, body level, with a position, a velocity and an odometer."""
    n = 400
    t = np.arange(1, n + 1) * 0.01
    imu = Imu(
        t, np.full(n, 0.01), np.tile([0.01, 0.02, 0.03], (n, 1)), np.tile([0.0, 0.0, -0.1], (n, 1))
    )
    fixes = np.arange(5) * 0.8
    one = lambda value: np.tile(value, (5, 1))
    sources = (
        Source("position", fixes, one((0.8, 0.2, 500.0)), one((1.0, 1.0, 2.0)), (0.1, 0.2, -0.3)),
        Source("velocity", fixes, one((3.0, 4.0, 0.5)), one((0.1, 0.1, 0.2)), (0.1, 0.2, -0.3)),
        Source("speed", fixes, one((5.0,)), one((0.1,)), (0.0, 0.0, 0.0)),
    )
    recording = Recording(imu, sources, None, {"name": "made up", "grade": GRADE})
    return SetUpCase("car", recording, ((1.0, 4.0),), False, "navigation")._replace(**more)


def made(name, of=None):
    """The recording of a mistake: its IMU and its sources by kind."""
    recording = OF[name].make(of or case())
    return recording.imu, {a.kind: a for a in recording.sources}


RIGHT, SOURCES = case().recording.imu, {a.kind: a for a in case().recording.sources}


@pytest.mark.short
@pytest.mark.parametrize("kinds", [("position", "velocity"), ("position",), ("velocity",)])
def test_a_clock_moves_the_stamps_of_its_sources_alone(kinds):
    whose = "GNSS" if len(kinds) == 2 else kinds[0]
    _, sources = made(f"clock of {whose} +0.25 s")
    for kind, right in SOURCES.items():
        late = 0.25 if kind in kinds else 0.0
        expected = right.t + late
        np.testing.assert_allclose(sources[kind].t, expected[expected < 4.0], atol=1e-12)
    _, early = made(f"clock of {whose} -1 s")
    assert early[kinds[0]].t[0] == pytest.approx(0.6)  # those before the recording are gone


@pytest.mark.short
def test_one_source_alone_has_no_clock_of_its_own():
    alone = case(recording=Recording(RIGHT, (SOURCES["position"],), None, {"grade": GRADE}))
    assert OF["clock of position +1 s"].make(alone) is None
    assert OF["clock of GNSS +1 s"].make(alone) is not None


@pytest.mark.short
def test_turned_axes_read_what_lies_along_them():
    """Sensor axes turned to the right: their x reads what the body has along its y."""
    imu, _ = made("axes turned 90 deg")
    np.testing.assert_allclose(imu.dtheta[0], [0.02, -0.01, 0.03], atol=1e-15)
    imu, _ = made("axes turned 270 deg")
    np.testing.assert_allclose(imu.dtheta[0], [-0.02, 0.01, 0.03], atol=1e-15)
    imu, _ = made("axes mirrored")
    np.testing.assert_allclose(imu.dtheta[0], [0.01, -0.02, 0.03], atol=1e-15)


@pytest.mark.short
def test_an_imu_mounted_nose_up_reads_its_own_pitch():
    imu, _ = made("mounting 5 deg off in pitch")
    f = imu.dv[0]
    assert np.degrees(np.arctan2(f[0], -f[2])) == pytest.approx(5.0)
    imu, _ = made("mounting 10 deg off in heading")
    np.testing.assert_allclose(imu.dv, RIGHT.dv, atol=1e-15)


@pytest.mark.short
def test_a_box_that_is_mounted_turned_has_its_magnetometer_turned():
    field = Source(
        "magnetic-field", np.array([1.0]), np.array([[2e-5, 0.0, 4e-5]]), np.full((1, 3), 1e-7)
    )
    own = case(recording=Recording(RIGHT, (field,), None, {"grade": GRADE}))
    _, sources = made("mounting 10 deg off in heading", own)
    y = sources["magnetic-field"].y[0]
    assert np.degrees(np.arctan2(-y[1], y[0])) == pytest.approx(10.0)
    _, sources = made("axes turned 90 deg", own)
    np.testing.assert_array_equal(sources["magnetic-field"].y, field.y)


@pytest.mark.short
@pytest.mark.parametrize(
    "name, velocity",
    [
        ("ENU taken for NED", (4.0, 3.0, -0.5)),
        ("km/h taken for m/s", (10.8, 14.4, 1.8)),
        ("knots taken for m/s", (3 * 1.943844, 4 * 1.943844, 0.5 * 1.943844)),
        ("mm/s taken for m/s", (3000.0, 4000.0, 500.0)),
        # course 0.9272952 rad, read as so many degrees
        (
            "course in rad taken for deg",
            (5 * np.cos(np.radians(0.9272952)), 5 * np.sin(np.radians(0.9272952)), 0.5),
        ),
    ],
)
def test_velocities_as_they_are_misread(name, velocity):
    _, sources = made(name)
    np.testing.assert_allclose(sources["velocity"].y[0], velocity, rtol=1e-6)
    np.testing.assert_array_equal(sources["position"].y, SOURCES["position"].y)


@pytest.mark.short
def test_installation_heights_and_standard_deviations():
    _, sources = made("antenna arm 3 m off, forward")
    assert sources["position"].parameters == pytest.approx((3.1, 0.2, -0.3))
    assert sources["velocity"].parameters == pytest.approx((3.1, 0.2, -0.3))
    _, sources = made("antenna arm 1 m off, up")
    assert sources["position"].parameters == pytest.approx((0.1, 0.2, -1.3))
    _, sources = made("height above the geoid")
    np.testing.assert_allclose(sources["position"].y[:, 2], 453.0)
    for name, factor in (("small", 0.2), ("large", 5.0)):
        _, sources = made(f"stated std 5 times too {name}")
        np.testing.assert_allclose(sources["velocity"].std, factor * SOURCES["velocity"].std)
        np.testing.assert_array_equal(sources["speed"].std, SOURCES["speed"].std)
    _, sources = made("odometer 2 % off")
    np.testing.assert_allclose(sources["speed"].y, 5.1)


@pytest.mark.short
def test_errors_of_the_imu():
    imu, _ = made("accelerometer bias of 10 std")
    bias = 10 * 3e-3 * 9.80665  # industrial: 3 mg of turn-on bias, 15 ug in run
    np.testing.assert_allclose((imu.dv - RIGHT.dv)[0] / 0.01, [bias, 0, 0], rtol=1e-4)
    imu, _ = made("gyros 2 % off")
    np.testing.assert_allclose(imu.dtheta, 1.02 * RIGHT.dtheta)
    np.testing.assert_array_equal(imu.dv, RIGHT.dv)
    assert OF["IMU two grades too good"].make(case()).meta["grade"] == "navigation"


@pytest.mark.short
def test_repeated_and_drifting_fixes():
    _, sources = made("each fix four times")
    a = sources["position"]
    np.testing.assert_allclose(a.t[:5], [0.0, 0.2, 0.4, 0.6, 0.8])
    assert len(a.t) == 17 and a.t[-1] == pytest.approx(3.2)  # nothing after the last fix
    _, sources = made("position drifts by 0.1 m/s")
    away = displacement(sources["position"].y, SOURCES["position"].y)
    np.testing.assert_allclose(away[:, 0], 0.1 * SOURCES["position"].t, atol=1e-8)
    np.testing.assert_allclose(away[:, 1:], 0.0, atol=1e-8)


def test_swisslog_as_logged_has_its_course_in_degrees_and_its_own_stamps():
    own = recorded_cases(DESCRIPTIONS)["swisslog"]()
    _, sources = made("as logged", own)
    data = pd.read_csv(data_folder(DESCRIPTIONS) / "swisslog" / "gps.csv.xz")
    y = heading_to(data["GndSpd"], np.radians(data["CourseDeg"]), data["VelD"])
    np.testing.assert_allclose(sources["velocity"].y, y, atol=1e-9)
    np.testing.assert_allclose(sources["velocity"].t, data["GPStime"], atol=1e-9)
    assert OF["as logged"].make(case()) is None


@pytest.mark.short
def test_a_mistake_is_harmful_where_an_error_doubles_or_leaves_what_is_claimed():
    right = {"height": HarmScore(1.0, 0.0), "velocity": HarmScore(0.1, 0.2)}
    judged = lambda **wrong: compare_scores(right, {**right, **wrong})
    assert judged() == Harm((), 1.0, 0.2)
    assert judged(height=HarmScore(1.99, 0.05)).harmful == ()
    assert judged(height=HarmScore(2.0, 0.0)).harmful == ("height",)
    assert judged(height=HarmScore(1.0, 0.051)).harmful == ("height",)
    assert judged(velocity=HarmScore(0.15, 0.9)).harmful == ()  # the right one is beyond too
    assert compare_scores({}, {"height": HarmScore(9.0, 0.04)}).harmful == ()
    assert compare_scores({}, {"height": HarmScore(9.0, 0.06)}).harmful == ("height",)
    assert compare_scores(right, {}).harmful == ("no solution",)


@pytest.mark.short
def test_the_table_names_what_exists():
    groups = {mistake.group for mistake in MISTAKES}
    known = {*MOTIONS, *recorded_cases(DESCRIPTIONS)}
    assert len(OF) == len(MISTAKES)
    for mistake in MISTAKES:
        assert set(mistake.causes) <= set(CAUSES)
    for each in NOT_SHOWABLE:
        assert set(each.groups) <= groups and set(each.recordings) <= known
        assert each.cause in CAUSES
    assert why_hidden(OF["mounting 2 deg off in pitch"], "car").cause == "mounting"
    assert why_hidden(OF["mounting 2 deg off in pitch"], "car with odometer") is None
    assert why_hidden(OF["clock of position -0.25 s"], "ship") and why_hidden(
        OF["clock of GNSS +0.1 s"], "ship"
    )
    assert why_hidden(OF["clock of GNSS +0.25 s"], "ship") is None
    assert why_hidden(OF["antenna arm 3 m off, forward"], "ship") is None
    assert {a.kind for a in simulate_case("car with odometer", 1).recording.sources} <= set(names())


@pytest.mark.short
def test_who_finds_and_who_names():
    reason = lambda cause, weight=2.0: Reason(cause, "seen", "do", weight=weight)
    done, mistake = Harm(("height",), 3.0, 0.5), OF["clock of GNSS +1 s"]

    def verdict(inspect, own, refusal=""):
        found = Heard(
            inspect, DOUBTFUL if own else "trusted", own, (), refusal, None, 1.0, 0.1, 0.1
        )
        row = cells.row(mistake.name, mistake.group, case(), 1, found)
        row |= cells.judge_cell(mistake, case(), found, done)
        return row["by_inspect"], row["by_verdict"], row["named"]

    assert verdict((), ()) == (False, False, False)
    assert verdict((reason("clock"),), (reason("gyro"),)) == (True, True, True)
    assert verdict((reason("unit"),), (reason("clock"),)) == (True, True, False)
    assert verdict((), (reason("clock"),)) == (False, True, True)
    assert verdict((), (), "the time of imu and GNSS do not overlap") == (False, False, True)


def test_a_run_writes_its_files(tmp_path, monkeypatch):
    few = [OF[name] for name in ("km/h taken for m/s", "gyros 2 % off")]
    monkeypatch.setattr(cells, "MISTAKES", few)
    claims = main.reproduce(tmp_path, quick=True, seed=1001, workers=1)
    rows = pd.read_csv(tmp_path / "cells.csv")
    assert rows["mistake"].tolist() == [cells.RIGHT, *(m.name for m in few)]
    assert rows["harmful"].tolist()[:2] == [False, True]
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    text = (tmp_path / "table.md").read_text()
    assert "km/h taken for m/s" in text and claims[0]["claim"] in text
    assert (tmp_path / "index.html").exists()
