"""The command fly: what it prints and writes, that the page shows the flight, and bad input in
one line with exit code 2."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown.cli import fly as cli_fly
from strapdown.flight import Loop, Sensors, World, figures, plan
from strapdown.flight.run_flight import LOG, fly
from strapdown.geometry.geodesy import displacement
from strapdown.pages.drawing import together
from strapdown.pages.page import Added
from strapdown.pages.shell import Page

FILES = ["log.csv", "recording.nc", "report.html", "solution.nc"]
SHORT = "--duration", 5, "--outage", "3:4", "--seed", 3


@pytest.fixture(scope="module")
def flight():
    return fly("straight", duration=5.0, seed=3, sensors=Sensors(outage="3:4"))


@pytest.mark.short
def test_a_flight_is_flown_printed_and_written(flight, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = command("fly", *SHORT)
    made = tmp_path / "fly-straight-closed-loop"
    assert (code, err) == (0, []) and sorted(path.name for path in made.iterdir()) == FILES
    log = pd.read_csv(made / "log.csv")
    assert list(log.columns) == ["t, s", *LOG] and len(log) == 500
    assert np.allclose(log["Fz, N"], flight.log["Fz, N"], rtol=1e-8)
    recording, solution = sd.read(made / "recording.nc"), sd.read_solution(made / "solution.nc")
    assert np.array_equal(recording.imu.dv, flight.recording.imu.dv) and np.allclose(
        recording.reference.lla, flight.recording.reference.lla, rtol=0, atol=1e-12
    )
    assert np.allclose(
        solution.trajectory.v_n, flight.solution.trajectory.v_n, rtol=0, atol=1e-12
    ) and solution.meta["withheld"] == [[3.0, 3.99]]
    row = next(line for line in out.splitlines() if line.startswith("above its route"))
    expected = (
        np.sqrt(np.mean(log["above route, m"] ** 2)),
        log["above route, m"][log["above route, m"].abs().idxmax()],
        log["above route, m"].iloc[-1],
    )
    assert [float(text) for text in row.split()[-3:]] == pytest.approx(expected, rel=0.01)
    assert "rms error against the reference" in out and "3-3.99 " in out
    assert (
        out.splitlines()[-1]
        == "wrote fly-straight-closed-loop/recording.nc, solution.nc, log.csv, report.html"
    )


@pytest.mark.short
def test_the_drift_is_what_the_outage_added(flight):
    (window,) = cli_fly.withheld_outages(flight)
    # a fix at 4 s ends it, and the sample at 4 s has it
    assert window == pytest.approx((3.0, 3.99))
    said = re.fullmatch(
        r"drift in 3-3.99 s: (\S+) m in 0.99 s, (\S+)% of (\d+) m flown",
        cli_fly.drift(flight, *window),
    )
    e = sd.errors(flight.solution, flight.recording.reference)
    at = lambda t: e.position[np.argmin(np.abs(e.t - t)), :2]
    assert float(said[1]) == pytest.approx(np.hypot(*(at(3.99) - at(3.0))), rel=0.01, abs=1e-3)
    assert 20 < float(said[3]) < 30 and float(said[2]) == pytest.approx(
        100 * float(said[1]) / float(said[3]), rel=0.15
    )
    assert "ended before" in cli_fly.drift(flight, 9.0, 10.0)


@pytest.mark.deep
def test_options_reach_the_flight(flight, command, tmp_path, monkeypatch):
    # a page takes longer than its flight
    monkeypatch.setattr("strapdown.pages.page.report", lambda *_, **__: Page(""))
    said = {}
    for name, words in (
        ("model", ("--prediction", "model")),
        ("truth", ("--feedback", "truth")),
        ("windy", ("--wind", "-3,2")),
        ("rough", ("--turbulence", "moderate")),
        ("high", ("--barometer",)),
        ("optioned", ("--option", "error_model=literal")),
    ):
        code, out, err = command("fly", *SHORT, *words, "--out", tmp_path / name)
        assert (code, err) == (0, []), name
        said[name] = pd.read_csv(tmp_path / name / "log.csv")
        meta = sd.read(tmp_path / name / "recording.nc").meta
        assert meta["prediction"] == ("model" if name == "model" else "imu") and meta[
            "feedback"
        ] == ("truth" if name == "truth" else "estimate")
        assert ("model, not measured" in out) == (name == "model")
    assert [a.kind for a in sd.read(tmp_path / "high" / "recording.nc").sources] == [
        "position",
        "velocity",
        "pressure",
    ]
    assert (
        said["windy"]["wind north, m/s"].eq(-3).all()
        and said["windy"]["wind east, m/s"].eq(2).all()
    )
    for name, log in said.items():
        assert not np.allclose(
            log["elevator, rad"], flight.log["elevator, rad"], rtol=0, atol=1e-9
        ), name


@pytest.mark.short
def test_the_page_shows_the_flight(flight):
    page = sd.report(
        flight.solution, flight.recording.reference, added=Added(figures.sections(flight))
    ).html
    assert [
        heading for heading in ("Flight", "Controls", "Forces") if f"<h2>{heading}</h2>" in page
    ] == ["Flight", "Controls", "Forces"]
    drawn = {
        trace["name"]: trace
        for trace in json.loads(figures.loads(flight, "F", "N").to_json())["data"]
    }
    assert len(drawn) == 1
    figure = figures.controls(flight)
    assert [trace.name for trace in figure.data] == ["command", "position"] * 4
    assert np.allclose(
        figure.data[1].y, np.degrees(flight.log["elevator, rad"]), atol=1e-4
    ) and np.allclose(figure.data[7].y, 100 * flight.log["throttle"], atol=1e-4)


@pytest.mark.short
def test_the_route_is_drawn_along_its_lines_and_arcs():
    turning = fly("turning", duration=1.0)
    points = figures.route_points(turning.route)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    # no jump between the parts, no part missing
    assert gaps.sum() == pytest.approx(turning.route.length.sum(), rel=2e-3)
    corner = np.array(turning.plan.waypoints[1][:2])
    assert 20 < np.hypot(*(points - corner).T).min() < 100  # an arc cuts it


@pytest.mark.short
def test_the_map_ends_with_the_flight_and_shows_where_the_receiver_was_cut():
    turning = fly("turning", duration=14.0, sensors=Sensors(outage="3:9"))
    figure = figures.route(turning)
    drawn = {trace.name: np.c_[trace.y, trace.x] for trace in figure.data}
    assert list(drawn) == [
        "flown without GNSS",
        "route",
        "flown",
        "estimate",
        "end of the estimate",
        "start",
        "end",
    ]
    assert np.allclose(drawn["end"], drawn["flown"][-1]) and np.allclose(
        drawn["end of the estimate"], drawn["estimate"][-1]
    )
    # in the first arc, not at its end
    assert (
        np.hypot(*(drawn["route"][-1] - drawn["end"][0])) < 10
        and int(turning.log["segment"][-1]) == 1
    )
    cut = displacement(turning.recording.reference.lla[[300, 900]], turning.plan.place)[:, :2]
    assert np.allclose(drawn["flown without GNSS"][[0, -1]], cut, atol=0.3)
    last = figures.flown_route(turning, np.array([[-50.0, 0.0], [np.nan, 0.0]]))[-1]
    assert last.length == 0.0  # before the begin of the arc


@pytest.mark.short
def test_the_map_holds_the_end_of_an_estimate_that_went_astray(flight):
    inside = lambda figure, point: all(
        low <= value <= high
        for value, (low, high) in zip(point, (figure.layout.yaxis.range, figure.layout.xaxis.range))
    )
    flown = np.array([[0.0, 0.0], [1380.0, 0.0]])
    for north, seen in ((2110.0, True), (5000.0, True), (90_000.0, False)):
        figure = figures.finish(figures.go.Figure(), 400)
        figures._frame(figure, flown, np.array([[0.0, 0.0], [north, 5.0]]))
        assert (
            inside(figure, (1380.0, 0.0))
            and inside(figure, (north, 5.0)) == seen
            and bool(figure.layout.meta["notes"]) != seen
        )


@pytest.mark.short
def test_the_page_says_what_was_flown_and_shades_outages(flight):
    windy = fly(
        "straight",
        duration=4.0,
        seed=5,
        world=World(wind=(3.0, -2.0, 0.0), turbulence="light"),
        sensors=Sensors(outage="3:9"),
        loop=Loop(feedback="truth"),
    )
    head = sd.report(
        windy.solution, windy.recording.reference, added=Added(facts=figures.facts(windy))
    ).html.split("</header>")[0]
    for said in (
        "aerosonde",
        "straight",
        "4.0 s",
        "3, -2, 0 m/s",
        "light",
        "geodetic",
        "3 to 4 s",
        "truth",
        "IMU",
        "<dd>5</dd>",
        "every 0.2 s, std 1 1 1.5 m",
    ):
        assert said in head, said
    assert figures.wind_figure(flight) is None and len(figures.wind_figure(windy).data) == 3
    titles = [heading for _, shown in figures.sections(windy) for _, heading, _ in shown]
    assert "Wind" in titles and "Wind" not in [
        heading for _, shown in figures.sections(flight) for _, heading, _ in shown
    ]
    figure = figures.command_figure(windy)
    assert [trace.name for trace in figure.data] == ["asked", "flown", "estimate"] * 4
    assert np.allclose(figure.data[2].y, np.degrees(windy.solution.trajectory.rph[:, 0]), atol=1e-3)
    assert np.allclose(
        figure.data[11].y,
        np.linalg.norm(windy.solution.trajectory.v_n - [3, -2, 0], axis=1),
        atol=1e-4,
    )
    (shaded,) = [shape for shape in figure.layout.shapes if shape.type == "rect"]
    assert (shaded.x0, shaded.x1) == (3.0, 4.0) and cli_fly.withheld_outages(windy) == [(3.0, 4.0)]


@pytest.mark.short
def test_the_largest_has_its_sign(flight):
    rows = {what: largest for what, (_, largest, _) in cli_fly.path_errors(flight).items()}
    assert rows["above its route, m"] < 0 and rows["above its route, m"] == pytest.approx(
        flight.log["above route, m"].min(), rel=0.01
    )


@pytest.mark.short
def test_headings_around_north_are_drawn_together():
    heading, beside = together(np.array([358.0, 359.5, 1.0, np.nan, 3.0]), np.array([357.0, 2.0]))
    assert heading == pytest.approx(
        [-2.0, -0.5, 1.0, np.nan, 3.0], nan_ok=True
    ) and beside == pytest.approx([-3.0, 2.0])
    # not torn: as it is
    assert together(np.array([268.0, 272.0]), np.array([269.0]))[1] == pytest.approx([269.0])
    assert together(np.array([1.0, 2.0]), np.array([359.0]))[1] == pytest.approx([-1.0])
    everywhere = np.arange(0.0, 360.0, 10)
    assert together(everywhere)[0] is everywhere


@pytest.mark.short
def test_a_flight_into_the_ground_keeps_its_results(command, tmp_path, monkeypatch):
    monkeypatch.setitem(plan.PLANS, "low", lambda: plan.straight(higher=-60.0, clearance=5.0))
    code, out, err = command(
        "fly", "low", "--duration", 20, "--outage", "15:", "--out", tmp_path / "low"
    )
    assert (code, err) == (0, []) and sorted(
        path.name for path in (tmp_path / "low").iterdir()
    ) == FILES
    assert "hit the ground" in out and "drift in 15-20 s: none" in out
    assert "hit the ground" in (tmp_path / "low" / "report.html").read_text()


@pytest.mark.short
def test_a_filter_without_position_flies_on_the_truth(command, tmp_path):
    code, out, err = command(
        "fly", *SHORT, "--filter", "mahony", "--feedback", "truth", "--out", tmp_path / "made"
    )
    assert (
        (code, err) == (0, [])
        and "drift in" not in out
        and sorted(path.name for path in (tmp_path / "made").iterdir()) == FILES
    )


@pytest.mark.short
@pytest.mark.parametrize(
    "words, said",
    [
        (("nowhere",), "nowhere"),
        (("--wind", "3"), "north,east"),
        (("--wind", "a,b"), "north,east"),
        (("--outage", "15"), "outage"),
        (("--feedback", "hope"), "feedback is 'hope'"),
        (("--prediction", "none"), "prediction is 'none'"),
        (("--turbulence", "bad"), "turbulence"),
        (("--duration", -1), "-1"),
        (("--filter", "kallman"), "closed-loop"),
        (("--filter", "mahony"), "estimates no position"),
        (("--imu", "gold"), "gold"),
        (("--seed", -1), "seed is -1"),
        (("--aircraft", "kite"), "kite"),
        (("--option", "colour=red"), "colour"),
        (("--option", "colour"), "NAME=VALUE"),
        (("--option", "seed=3"), "--option seed: the flight decides"),
        (("no/such.toml",), "no/such.toml: cannot"),
    ],
)
def test_bad_input_ends_in_one_line(command, tmp_path, words, said):
    code, out, err = command("fly", *words, "--out", tmp_path / "made")
    assert code == 2 and len(err) == 1 and said in err[0] and not (tmp_path / "made").exists()
