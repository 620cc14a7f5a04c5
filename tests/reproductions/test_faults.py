"""Sensor faults: what "silently wrong" means by hand, what faults do to data, which filters they
concern, and the reduced table, in which nothing may get worse."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.contract import BRIDGED, DOUBTFUL, INVALID, VALID
from strapdown.data.solution import Trajectory
from strapdown.geometry.geodesy import displace_lla, displacement
from strapdown_reproductions.common.runner import StudyTables
from strapdown_reproductions.faults import cells as of_cells, jumps, summary
from strapdown_reproductions.faults.catalogue import EVERY, FAULTS
from strapdown_reproductions.faults.cells import CellTask, cells
from strapdown_reproductions.faults.fault import (
    AHRS,
    GNSS,
    HEIGHT,
    IMU,
    LIVE,
    MAGNETOMETER,
    START,
)
from strapdown_reproductions.faults.judging import (
    CRASH,
    OK,
    ORDER,
    REFUSED,
    SAID,
    SILENT,
    FaultOutcome,
    Nominal,
    judge_error,
    judge_run,
    nominal,
)
from strapdown_reproductions.faults.not_showable import NOT_SHOWABLE, why_hidden
from strapdown_reproductions.faults.raw import BEGINS, raw
from strapdown_reproductions.faults.runs import (
    SMOOTHED,
    STREAM,
    FaultSubject,
    family,
    kinds,
    kinds_with,
    subjects,
)
from strapdown_reproductions.faults.worlds import GENTLE, MOTIONS, WORLDS, simulate_world

T = np.arange(0.0, 100.0, 0.2)
STD = 0.5


def trajectory(north=0.0, std=STD):
    """At rest on the equator's height 0, or `north` (n,) m off; its std is that of every component."""
    n = len(T)
    away = np.zeros((n, 3))
    away[:, 0] = north
    lla = displace_lla(np.tile([0.8, 0.2, 100.0], (n, 1)), away)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return Trajectory(T, lla, np.zeros((n, 3)), q, None if std is None else np.full((n, 15), std))


TRUTH = trajectory()


def off(by, start, lasting):
    """(n,) m: `by` for so many seconds from `start` on."""
    return np.where((T >= start - 1e-9) & (T < start + lasting - 1e-9), by, 0.0)


def outcome(north=0.0, status=VALID, notes=(), events=(), std=STD):
    told = tuple((71.5, text) for text in events)
    return FaultOutcome(trajectory(north, std), np.full(len(T), status), notes, told)


RIGHT = Nominal(np.full(9, 0.1), frozenset({"nothing of note at # s"}))


def verdict(*of, **more):
    return judge_run(outcome(*of, **more), TRUTH, RIGHT).verdict


@pytest.mark.short
def test_a_second_beyond_five_std_is_wrong_and_less_is_not():
    assert verdict(off(5.1 * STD, 70, 1.0)) == SILENT
    assert verdict(off(4.9 * STD, 70, 20.0)) == OK
    assert verdict(off(5.1 * STD, 70, 0.8)) == OK
    assert verdict(off(5.1 * STD, 70, 0.4) + off(5.1 * STD, 80, 0.6)) == SILENT
    assert verdict(off(100.0, 30, 30.0)) == OK  # before it has settled
    one = judge_run(outcome(off(5.1 * STD, 70, 2.0)), TRUTH, RIGHT)
    assert one.wrong_s == pytest.approx(2.0) and one.largest == pytest.approx(5.1, rel=1e-3)
    assert one.position_m == pytest.approx(5.1 * STD, rel=1e-3)


@pytest.mark.short
def test_an_event_a_note_or_a_status_says_it():
    wrong = off(6 * STD, 70, 10.0)
    assert verdict(wrong, events=("something is off",)) == SAID
    assert verdict(wrong, notes=("rows dropped",)) == SAID
    assert verdict(wrong, events=("nothing of note at 71.5 s",)) == SILENT
    assert verdict(wrong, status=DOUBTFUL) == SAID and verdict(wrong, status=INVALID) == SAID
    assert verdict(wrong, status=BRIDGED) == SILENT
    late = outcome(wrong)
    late.status[T >= 70.8] = DOUBTFUL
    assert judge_run(late, TRUTH, RIGHT).verdict == SAID  # believed for less than a second
    late.status[(T >= 72) & (T < 73)] = VALID
    assert judge_run(late, TRUTH, RIGHT).verdict == SILENT


@pytest.mark.short
def test_without_std_twice_the_nominal_error_is_allowed():
    assert verdict(off(0.19, 70, 20.0), std=None) == OK
    assert verdict(off(0.21, 70, 20.0), std=None) == SILENT
    missing = outcome()
    path = missing.trajectory
    lla = np.where((T > 90)[:, None], np.nan, path.lla)
    missing = missing._replace(trajectory=replace(path, lla=lla))
    assert judge_run(missing, TRUTH, RIGHT).verdict == SILENT
    unknown = RIGHT._replace(largest=np.r_[np.full(3, np.nan), np.full(6, 0.1)])
    assert judge_run(missing, TRUTH, unknown).verdict == OK


@pytest.mark.short
def test_what_a_right_run_says_is_no_news_and_what_a_wrong_one_says_is():
    right, own = nominal(outcome(off(0.3, 70, 1.0), events=("quiet, 3 of 5",)), TRUTH)
    assert own.verdict == OK and right.says == {"quiet, # of #"}
    assert right.largest[0] == pytest.approx(0.3, rel=1e-3) and right.largest[1] == pytest.approx(0)
    right, own = nominal(outcome(off(9.0, 70, 5.0), events=("astray",), notes=("set up",)), TRUTH)
    assert own.verdict == SAID and right.says == {"set up"}


@pytest.mark.short
def test_how_a_run_ends():
    assert judge_error(DataError("no")).verdict == REFUSED
    assert (
        judge_error(ValueError("what")).verdict == CRASH
        and "ValueError" in judge_error(ValueError()).says
    )
    assert ORDER == (OK, REFUSED, SAID, SILENT, CRASH)


GIVEN = ("position", "velocity", "attitude", "magnetic-field", "altitude")


@pytest.fixture(scope="module")
def recording():
    return simulate_world(MOTIONS[GENTLE]._replace(duration=190.0, rate=5.0), 1001)


def faulted(recording, name):
    made = raw(recording, GIVEN, 7, name)
    FAULTS[name].change(made)
    return made


def same(one, other):
    """Whether two Raw hold the same."""
    columns = lambda r: (
        [r.t, r.gyro, r.accel, r.arrival]
        + [
            column
            for s in r.sources.values()
            for column in (s.t, s.y, s.std, s.arrival, np.array(s.parameters))
        ]
    )
    a, b = columns(one), columns(other)
    alike = lambda x, y: x.shape == y.shape and np.array_equal(x, y, equal_nan=True)
    return len(a) == len(b) and all(map(alike, a, b)) and one.start is other.start is None


def test_every_fault_changes_something_and_the_same_thing_twice(recording):
    right = raw(recording, GIVEN, 7, "")
    with np.errstate(all="ignore"):
        for name in FAULTS:
            one, again = faulted(recording, name), faulted(recording, name)
            assert not same(one, right), name
            assert one.start or same(one, again), name
    assert len(FAULTS) == len(EVERY) and len(FAULTS) + len(WORLDS) >= 125


def test_what_faults_do_by_hand(recording):
    right = raw(recording, GIVEN, 7, "")
    after = right.sources["position"].t >= BEGINS
    position = lambda name: faulted(recording, name).sources["position"]
    moved = displacement(position("position jumps by 20 m for good").y, right.sources["position"].y)
    np.testing.assert_allclose(moved[after], [20, 0, 0] + 0 * moved[after], atol=1e-6)
    np.testing.assert_allclose(moved[~after], 0, atol=1e-6)
    moved = displacement(position("one position 10 m off").y, right.sources["position"].y)
    assert (np.abs(moved[:, 0]) > 1).sum() == 1
    drift = displacement(position("position drifts by 1 m/s").y, right.sources["position"].y)
    assert drift[-1, 0] == pytest.approx(right.sources["position"].t[-1] - BEGINS, abs=1e-5)
    late = position("fixes late by 0.5 s")
    np.testing.assert_allclose(late.t - right.sources["position"].t, 0.5)
    np.testing.assert_array_equal(late.arrival, right.sources["position"].arrival)
    ten = position("each fix ten times, with new stamps")
    np.testing.assert_allclose(np.diff(ten.t), 0.1, atol=1e-9)
    stuck = faulted(recording, "gyro stuck for 5 s")
    during = (right.t >= BEGINS) & (right.t < BEGINS + 5)
    assert len(np.unique(stuck.gyro[during], axis=0)) == 1
    np.testing.assert_array_equal(stuck.gyro[~during], right.gyro[~during])
    gap = faulted(recording, "IMU missing for 5 s")
    assert np.diff(gap.t).max() == pytest.approx(5.2)
    turned = faulted(recording, "mounted 5 deg off in heading")
    # sensor axes turned to the right see what points forward to their left
    x, y, _ = turned.accel[0]
    assert np.hypot(x, y) == pytest.approx(np.hypot(*right.accel[0, :2]))
    angle = np.arctan2(y, x) - np.arctan2(*right.accel[0, 1::-1])
    assert np.degrees(angle) == pytest.approx(-5.0)


@pytest.mark.short
def test_whom_a_fault_concerns():
    of = lambda sensor: next(f for f in FAULTS.values() if f.of == sensor)
    with_fault = lambda sensor, *subject: kinds_with(of(sensor), FaultSubject(*subject))
    assert with_fault(IMU, "closed-loop") == ("position", "velocity")
    assert with_fault(MAGNETOMETER, "closed-loop") == ("position", "velocity", "magnetic-field")
    assert with_fault(HEIGHT, "nlo") == ("position", "velocity", "altitude")
    assert with_fault(AHRS, "closed-loop") is None
    assert with_fault(AHRS, "mekf") == ("position", "velocity", "attitude")
    assert with_fault(GNSS, "mahony") is None and with_fault(START, "mahony") is None
    assert with_fault(MAGNETOMETER, "mahony") == ("magnetic-field",)
    assert with_fault(LIVE, "closed-loop") is None and with_fault(LIVE, "closed-loop", STREAM)
    for name in filters.own_names():
        filter = filters.find(name)
        assert any(family(filter) in world.families for world in MOTIONS.values())
        assert set(filter.needs) <= set(kinds(filter))
    for one in subjects():
        assert one.way != SMOOTHED or filters.find(one.filter).smoother


@pytest.mark.short
def test_what_cannot_be_shown_names_what_there_is():
    for each in NOT_SHOWABLE:
        assert set(each.faults) <= set(FAULTS) and set(each.motions) <= set(MOTIONS)
        assert each.reason
    own = ("position", "velocity")
    assert why_hidden("mounted 5 deg off in heading", "navigation", GENTLE, own)
    assert not why_hidden("mounted 5 deg off in heading", "navigation", GENTLE, (*own, "attitude"))
    assert not why_hidden("position drifts by 0.1 m/s", "navigation", GENTLE, own)


REDUCED = Path(__file__).with_name("faults_reduced.csv")
TASKS = (
    CellTask(GENTLE, FaultSubject("closed-loop"), 1),
    CellTask("in a hand", FaultSubject("attitude-mekf"), 1),
)


def reduced():
    """The reduced table: a row per cell, with what became of it."""
    rows = pd.DataFrame([row for task in TASKS for row in cells(task, tuple(FAULTS))])
    return rows[["fault", "filter", "way", "motion", "verdict"]]


def test_no_cell_of_the_reduced_table_is_worse_than_it_was():
    """What is wanted is written anew by `python tests/reproductions/test_faults.py`."""
    keys = ["fault", "filter", "way", "motion"]
    kept = pd.read_csv(REDUCED).set_index(keys)["verdict"]
    now = reduced().set_index(keys)["verdict"]
    assert list(now.index) == list(kept.index)
    worse = {
        cell: (before, now[cell])
        for cell, before in kept.items()
        if ORDER.index(now[cell]) > ORDER.index(before)
    }
    assert not worse


@pytest.mark.deep
def test_a_stream_says_what_the_batch_says():
    """Where all arrives in time, what is silent live is silent in batch."""
    names = tuple(name for name, fault in FAULTS.items() if fault.of in (GNSS, IMU))
    batch, live = (
        {r["fault"]: r for r in cells(CellTask(GENTLE, FaultSubject("closed-loop", way), 1), names)}
        for way in ("batch", STREAM)
    )
    alone = [n for n, r in live.items() if r["verdict"] == SILENT and batch[n]["verdict"] == SAID]
    assert len(alone) <= 1, alone


@pytest.mark.deep
def test_a_run_writes_its_files(tmp_path, monkeypatch):
    few = {name: FAULTS[name] for name in ("velocity in knots", "height above the geoid")}
    monkeypatch.setattr(of_cells, "FAULTS", few)
    monkeypatch.setattr(of_cells, "WORLDS", {})
    task = CellTask(GENTLE, FaultSubject("closed-loop"), 1001)
    rows = pd.DataFrame(cells(task))
    assert rows["fault"].tolist() == ["nominal", *few]
    assert rows["showable"].tolist() == [True, True, False]
    found = StudyTables(cells=rows, trials=pd.DataFrame(jumps.trial(1001)))
    claims = summary.STUDY.write(tmp_path, found)
    assert json.loads((tmp_path / "claims.json").read_text()) == claims
    assert claims[0]["claim"] in (tmp_path / "table.md").read_text()
    assert "velocity in knots" in (tmp_path / "each.md").read_text()
    assert (tmp_path / "index.html").exists() and len(pd.read_csv(tmp_path / "cells.csv")) == 3
    assert summary.figures(found)["50 m"] == 1000.0


if __name__ == "__main__":
    reduced().to_csv(REDUCED, index=False)


def test_a_filter_runs_with_the_options_of_the_study():
    """pkf gets a tenth of its components."""
    task = CellTask(GENTLE, FaultSubject("pkf"), 1)
    rows = {row["fault"]: row["verdict"] for row in cells(task, ("one position 50 m off",))}
    assert rows["nominal"] == "ok" and rows["one position 50 m off"] in ("ok", "said")
