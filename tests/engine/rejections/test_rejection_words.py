"""What is said of rejected fixes: in words, in files, live, in the verdict and on the page."""

from dataclasses import replace

import numpy as np
import pytest
from golden.replay import DESCRIPTIONS
from refused_fixes import changed, simulated, solved

import strapdown as sd
from strapdown.data.solution import Rejected, Source
from strapdown.engine.rejections import causes
from strapdown.engine.rejections.causes import CauseFound
from strapdown.engine.rejections.contradictions import RejectedRun
from strapdown.engine.rejections.runs import join_runs
from strapdown.engine.rejections.texts import rejection_texts
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.geometry.geodesy import displace_lla
from strapdown.pages import fix_figures, summary

EMPTY = np.empty((0, 3))
POSITION = Source("position", EMPTY[:, 0], EMPTY, EMPTY, name="GNSS")
SPEED = Source("speed", EMPTY[:, 0], EMPTY[:, :1], EMPTY[:, :1])


def run(shape, size=(), since=118.0, until=np.inf, source=0, start=120.0, **more):
    found = CauseFound(shape, np.array(size), since, until, 3.1, 50.0)
    return RejectedRun(source, start, start + 7.0, 34, 36, 8.25, found, **more)


@pytest.mark.parametrize(
    "made, cause, seen",
    [
        (run("jump", (0.0, 12.0, 1.0)), "jump", "they jumped by 12 m to the east and stayed"),
        (
            run("jump", (-8.0, -8.0, 9.0), until=122.5),
            "jump",
            "they jumped by 11.3 m to the south-west and 9 m down for 4.5 s",
        ),
        (run("drift", (0.4, 0, 0)), "drift", "they drift by 0.4 m/s to the north from 118.0 s on"),
        (
            run("clock", (-0.23,)),
            "clock",
            "their errors follow the velocity, as with time stamps about 0.23 s late",
        ),
        (
            run("scale", (-0.05,), source=1),
            "other sources disagree",
            "their errors are -5 % of the speed, fixes of other sources were not: the sources contradict "
            "each other",
        ),
        (
            run(causes.DISAGREE, others=(1,)),
            "other sources disagree",
            "fixes of speed were also rejected: the sources contradict each other",
        ),
        (
            run("noise too small"),
            "noise too small",
            "all of them scatter by 3.1 times their standard ",
        ),
        (
            run("single outliers"),
            "single outliers",
            "single outliers, up to 8.25 standard deviations",
        ),
        (
            run("start"),
            "not known",
            "up to 8.25 standard deviations off, while the filter converged",
        ),
    ],
)
def test_a_run_in_words(made, cause, seen):
    (said,) = rejection_texts([made], [POSITION, SPEED])
    assert said.cause == cause and said.seen.startswith(seen)
    assert str(said).startswith(
        f"{said.source}: 34 of 36 fixes rejected from 120.0 to 127.0 s: {seen}"
    )
    assert str(said).endswith(f"; {said.remedy}")


def test_runs_found_in_pieces_are_bounded_in_number():
    many = [run("jump", (9.0, 0, 0), start=100.0 * k) for k in range(40)]
    singles = [run("single outliers", start=100.0 * k + 50) for k in range(40)]
    found = join_runs(
        sorted(many[:20] + singles[:20], key=lambda r: r.start), many[20:] + singles[20:]
    )
    assert len(found) <= 12 and sum(each.number for each in found) == 80 * 34
    (outliers,) = [each for each in found if each.found.shape == "single outliers"]
    assert outliers.start == 50.0 and outliers.stop == 3957.0


def test_a_jump_is_an_event_in_the_verdict_and_on_the_page(tmp_path):
    solution = solved("flight", "jump that stays", seed=1)
    (found,) = solution.rejected
    assert str(found) == (
        "GNSS position: 5 fixes rejected from 158.0 to 162.0 s: they jumped by 20 m to the "
        "south-east and stayed; check whether the fixes before or after the jump are "
        "correct, and leave out the others"
    )
    assert found.seen in solution.verdict.line and found.remedy in solution.verdict.line
    assert "<td>jump</td>" in summary.rejection_table({"": solution})
    assert not summary.rejection_table({"": sd.fuse(simulated("flight", 1))})
    for figure in (fix_figures.innovations(solution), fix_figures.nis(solution)):
        assert "rejected: jump" in {trace.name for trace in figure.data}
    sd.write_solution(solution, tmp_path / "kept.nc")
    kept = sd.read_solution(tmp_path / "kept.nc")
    assert kept.rejected == (found,) and isinstance(kept.rejected[0], Rejected)
    assert kept.events == solution.events


def events_of(recording):
    imu = recording.imu
    rows = zip(imu.t.tolist(), imu.dt.tolist(), imu.dtheta.tolist(), imu.dv.tolist())
    samples = [Sample(t, dt, tuple(a), tuple(b)) for t, dt, a, b in rows]
    fixes = [
        Measurement(t, k, tuple(y), tuple(d))
        for k, a in enumerate(recording.sources)
        for t, y, d in zip(a.t.tolist(), a.y.tolist(), a.std.tolist())
    ]
    return sorted(samples + fixes, key=lambda event: (event.t, type(event) is Sample))


def test_a_stream_says_it_while_it_goes_on_and_once():
    moved = lambda a: replace(a, y=displace_lla(a.y, (a.t >= 158.0)[:, None] * [0.0, 30.0, 0.0]))
    recording = changed(simulated("flight", 1), "position", moved)
    begin = sd.align(recording, sd.imu("industrial"))
    batch, told = sd.fuse(recording, start=begin), []
    streams = [
        Stream(
            "closed-loop",
            start=begin,
            imu="industrial",
            sources=recording.sources,
            history=history,
            on_event=lambda *event: told.append((stream.t, *event)),
        )
        for history in (65536, 4000)
    ]
    for stream in streams:
        told.clear()
        for event in events_of(recording):
            stream.step(event)
        stream.finish()
        ((when, t, text),) = [each for each in told if "rejected" in each[2]]
        assert 168.0 < when < 170.0 and "they jumped by 30.1 m to the east" in text
        assert (t, text) in stream.events and stream.events == list(batch.events)


def test_a_recorded_drive_with_wrong_fixes(data_folder):
    drive = sd.read(DESCRIPTIONS / "drive0708.toml").between(stop=330.0)
    (right,) = sd.fuse(drive).rejected
    assert right.cause == "single outliers" and right.number < 20
    off = lambda a: replace(a, y=displace_lla(a.y, (a.t >= 250.0)[:, None] * [0.0, 15.0, 0.0]))
    found = {r.source: r for r in sd.fuse(changed(drive, "position", off)).rejected}["position"]
    assert (found.cause, found.start) == ("jump", pytest.approx(250.0, abs=0.5))
    assert found.seen == "they jumped by 15 m to the east and stayed"
    small = changed(drive, "velocity", lambda a: replace(a, std=a.std / 5))
    both = changed(small, "position", lambda a: replace(a, std=a.std / 5))
    for recording in (small, both):
        found = {r.source: r for r in sd.fuse(recording).rejected}["velocity"]
        assert found.cause == "noise too small" and found.number > 100
