"""Trajectory, Recording and Solution: tables and their units, cutting and hiding, another point
of the body."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pymap3d
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import BIAS_COLUMNS, NAV_COLUMNS, OF_WHOLE, STD_COLUMNS, UNITS
from strapdown.data.verdict import Reason, Verdict
from strapdown.sim.trajectory import demo_flight, sample

pytestmark = pytest.mark.short


@pytest.fixture(scope="module")
def recording():
    return sd.simulate(demo_flight(), 8.0, "tactical", seed=1, rate=50.0)


@pytest.fixture(scope="module")
def solution(recording):
    return sd.fuse(recording)


def test_every_column_of_the_table_has_a_unit(solution):
    table = solution.table()
    assert set(NAV_COLUMNS + BIAS_COLUMNS + STD_COLUMNS) <= set(table.columns) and set(
        UNITS
    ) >= set(table.columns) - {"status"}
    assert table["lat"].iloc[0] == pytest.approx(np.degrees(solution.trajectory.lla[0, 0]))
    assert table["std_gyro_bias_x"].iloc[0] == pytest.approx(
        np.degrees(solution.trajectory.std[0, 12]) * 3600
    )
    assert table["heading"].between(0, 360).all()


def test_another_point_of_the_body_moves_as_the_body_turns():
    t = np.arange(0, 10, 0.01)
    truth = sample(demo_flight(), t)
    lever = np.array([3.0, -1.0, 0.5])
    turns = truth.rotation
    omega = np.array([0.1, -0.2, 0.3])
    moved = truth.displaced(lever, omega)
    offset = np.array(
        pymap3d.geodetic2ned(
            *np.degrees(moved.lla[:, :2]).T,
            moved.lla[:, 2],
            *np.degrees(truth.lla[:, :2]).T,
            truth.lla[:, 2],
        )
    ).T
    assert np.allclose(offset, turns.apply(lever), atol=1e-4)
    assert np.allclose(moved.v_n - truth.v_n, turns.apply(np.cross(omega, lever)))


def test_tables_describe_the_reference_point_where_the_recording_asks_for_it(recording, solution):
    lever = [1.0, 0.5, -2.0]
    there = sd.fuse(
        replace(recording, meta={**recording.meta, "point": "reference", "imu_lever_arm": lever})
    )
    back = there.trajectory.displaced(
        lever, (recording.imu.dtheta / recording.imu.dt[:, None])[-len(there.t) :] - there.b_g
    )
    assert np.allclose(back.lla[:, :2], solution.trajectory.lla[:, :2], atol=1e-12) and np.allclose(
        back.lla[:, 2], solution.trajectory.lla[:, 2]
    )
    assert np.allclose(back.v_n, solution.trajectory.v_n, atol=1e-9)
    assert np.linalg.norm(there.trajectory.lla[:, 2] - solution.trajectory.lla[:, 2]) > 1


def test_cutting_keeps_fixes_inside_and_refuses_an_empty_part(recording):
    part = recording.between(2.0, 5.0)
    assert (
        part.imu.t[0] > 2.0
        and part.imu.t[-1] <= 5.0
        and all((2 <= a.t).all() and (a.t <= 5).all() for a in part.sources)
    )
    with pytest.raises(DataError, match="covers"):
        recording.between(100.0, 200.0)


def test_between_cuts_all_parts_of_a_recording(recording):
    part = recording.between(2, 5)
    assert len(recording) == 400 and len(part) == 150
    assert part.imu.t[0] == pytest.approx(2.02) and part.imu.t[-1] == pytest.approx(5.0)
    assert all(a.t.min() >= 2 and a.t.max() <= 5 for a in part.sources)
    assert part.reference.t[0] <= 2 < 5 <= part.reference.t[-1] and len(part.reference) < 155
    assert len(recording.between()) == 400 and len(recording.between(6.0)) == 100
    assert recording.between() == recording


def test_between_cuts_rows_fixes_and_events_of_a_solution(recording):
    whole = sd.fuse(recording, covariance=True)
    whole = replace(whole, events=((1.0, "early"), (3.0, "within")), columns={"x [m]": whole.t})
    part = whole.between(2, 5)
    assert len(part) == 151 and (part.t[0], part.t[-1]) == pytest.approx((2.0, 5.0))
    assert part.covariance.shape == (151, 15, 15) and (part.columns["x [m]"] == part.t).all()
    assert len(part.b_a) == len(part.b_g) == len(part.status) == 151
    assert 2 <= part.innovations.t.min() and part.innovations.t.max() <= 5
    assert len(part.innovations.whitened) == len(part.innovations.t) < len(whole.innovations.t)
    assert part.events == ((3.0, "within"),)
    assert part.verdict.word == whole.verdict.word and OF_WHOLE in part.verdict.untested
    assert part.between(3, 4).verdict.untested.count(OF_WHOLE) == 1
    assert len(whole.trajectory.between(2, 5)) == 151 and len(part.between(2, 2)) == 1


def test_between_takes_dates_where_the_clock_is_absolute(recording, solution):
    epoch = {"epoch": "2016-12-31T23:59:55Z"}  # five seconds before a leap second
    dated, made = (replace(each, meta=each.meta | epoch) for each in (recording, solution))
    for start in (
        "2017-01-01T00:00:00Z",
        datetime(2017, 1, 1),
        np.datetime64("2017-01-01T00:00:00"),
    ):
        assert made.between(start).t[0] == pytest.approx(6.0)
        assert dated.between(start).imu.t[0] == pytest.approx(6.02)
    with pytest.raises(DataError, match="'2017-01-01' is a date, and the clock is not absolute"):
        solution.between("2017-01-01")
    with pytest.raises(DataError, match="solution: 'noon' is no time"):
        made.between("noon")


@pytest.mark.parametrize(
    "part, said",
    [
        ((5, 2), "5 s is after 2 s; write the earlier time first"),
        ((100, 200), "no rows from 100 to 200 s; it covers 1.020 to 8.000 s"),
        ((float("nan"), 2), "nan is no time"),
        (([1], 2), r".1. is no time; give seconds, or a date"),
    ],
)
def test_what_is_no_part_by_time_is_told_in_a_line(solution, part, said):
    with pytest.raises(DataError, match=f"^solution: {said}") as refused:
        solution.between(*part)
    assert "\n" not in str(refused.value)


def test_an_index_is_refused_and_between_named(recording, solution):
    for value in (recording, solution, solution.trajectory):
        for part in (0, slice(10, 20), slice("2017-01-01", None)):
            with pytest.raises(TypeError, match=r"has no index; .* with .between\(10.0, 20.0\)"):
                value[part]


def test_hiding_withholds_recorded_fixes_only(recording):
    rows = np.arange(0, 8, 0.5)
    constraint = sd.Source(
        "zero-lateral-velocity",
        rows,
        np.zeros((len(rows), 1)),
        np.full((len(rows), 1), 0.1),
        (0.0, 0.0, 0.0),
    )
    hidden = replace(recording, sources=(*recording.sources, constraint)).hidden([(3.0, 5.0)])
    assert not any(((a.t >= 3) & (a.t < 5)).any() for a in hidden.sources[:2]) and len(
        hidden.sources[2].t
    ) == len(rows)


def test_arrays_and_frames_give_the_same_recording(recording):
    import pandas as pd

    imu = recording.imu
    frame = pd.DataFrame(
        np.c_[imu.dtheta, imu.dv],
        index=imu.t,
        columns=[f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"],
    )
    a = sd.Recording.from_frames(frame, recording.sources, kind="increment")
    b = sd.Recording.from_arrays(imu.t, imu.dtheta, imu.dv, recording.sources, kind="increment")
    assert all(np.array_equal(x, y) for x, y in zip(a.imu, b.imu))
    with pytest.raises(DataError, match="gyro_z"):
        sd.Recording.from_frames(frame.drop(columns="gyro_z"))


def test_short_words_for_people(recording, solution):
    assert (
        "IMU samples" in repr(recording)
        and "closed-loop" in repr(solution)
        and "<table" in solution._repr_html_()
    )


def test_a_notebook_shows_the_verdict_first_and_repr_asks_for_none(solution, monkeypatch):
    judged = []

    def judge(solution):
        judged.append(solution)
        return Verdict.of([Reason("clock", "0.25 s < 1 s", "set it", "gnss", 2.0)])

    monkeypatch.setattr("strapdown.verdict.judge.judge", judge)
    fresh = replace(solution)
    assert "closed-loop" in repr(fresh) and not judged
    shown = fresh._repr_html_()
    shown = shown.partition("</style>")[2]
    assert (
        shown.index("doubtful")
        < shown.index("time stamps of gnss: 0.25 s &lt;")
        < shown.index("<dl>")
    )
    assert fresh.verdict.word == "doubtful" and len(judged) == 1  # found once
    bare = replace(solution, recording=None)
    assert bare.verdict.word == "not judged" and len(judged) == 1
