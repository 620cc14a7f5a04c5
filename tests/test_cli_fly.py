"""The command fly: what it prints and writes, that the page shows the flight, and bad input in one line with exit code 2."""
import json
import re

import numpy as np
import pandas as pd
import pytest

import strapdown as sd
from strapdown import cli_fly
from strapdown.reports import flight_figures
from strapdown.reports.shell import Page
from strapdown.sim import flight_plan
from strapdown.sim.flight import LOG, fly

FILES = ["log.csv", "recording.nc", "report.html", "solution.nc"]
SHORT = "--duration", 5, "--outage", "3:4", "--seed", 3


@pytest.fixture(scope="module")
def flight():
    return fly("straight", duration=5.0, outage="3:4", seed=3)


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
    assert np.array_equal(recording.imu.dv, flight.recording.imu.dv) and np.allclose(recording.reference.lla, flight.recording.reference.lla, rtol=0, atol=1e-12)
    assert np.allclose(solution.trajectory.v_n, flight.solution.trajectory.v_n, rtol=0, atol=1e-12) and solution.meta["withheld"] == [[3.0, 3.99]]
    row = next(line for line in out.splitlines() if line.startswith("above its route"))
    expected = np.sqrt(np.mean(log["above route, m"] ** 2)), log["above route, m"].abs().max(), log["above route, m"].iloc[-1]
    assert [float(text) for text in row.split()[-3:]] == pytest.approx(expected, rel=0.01)
    assert "rms error against the reference" in out and "3-3.99 " in out
    assert out.splitlines()[-1] == "wrote fly-straight-closed-loop/recording.nc, solution.nc, log.csv, report.html"


@pytest.mark.short
def test_the_drift_is_what_the_outage_added(flight):
    window, = cli_fly.withheld(flight)
    assert window == pytest.approx((3.0, 3.99))      # a fix at 4 s ends it, and the sample at 4 s has it
    said = re.fullmatch(r"drift in 3-3.99 s: (\S+) m in 0.99 s, (\S+)% of (\d+) m flown", cli_fly.drift(flight, *window))
    e = sd.errors(flight.solution, flight.recording.reference)
    at = lambda t: e.position[np.argmin(np.abs(e.t - t)), :2]
    assert float(said[1]) == pytest.approx(np.hypot(*(at(3.99) - at(3.0))), rel=0.01, abs=1e-3)
    assert 20 < float(said[3]) < 30 and float(said[2]) == pytest.approx(100 * float(said[1]) / float(said[3]), rel=0.15)
    assert "ended before" in cli_fly.drift(flight, 9.0, 10.0)


def test_options_reach_the_flight(flight, command, tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown.reports.page.report", lambda *_, **__: Page(""))     # a page takes longer than its flight
    said = {}
    for name, words in (("model", ("--prediction", "model")), ("truth", ("--feedback", "truth")), ("windy", ("--wind", "-3,2")),
                        ("rough", ("--turbulence", "moderate")), ("high", ("--barometer",)), ("optioned", ("--option", "error_model=literal"))):
        code, out, err = command("fly", *SHORT, *words, "--out", tmp_path / name)
        assert (code, err) == (0, []), name
        said[name] = pd.read_csv(tmp_path / name / "log.csv")
        meta = sd.read(tmp_path / name / "recording.nc").meta
        assert meta["prediction"] == ("model" if name == "model" else "imu") and meta["feedback"] == ("truth" if name == "truth" else "estimate")
        assert ("model, not measured" in out) == (name == "model")
    assert [a.kind for a in sd.read(tmp_path / "high" / "recording.nc").aidings] == ["position", "velocity", "pressure"]
    assert said["windy"]["wind north, m/s"].eq(-3).all() and said["windy"]["wind east, m/s"].eq(2).all()
    for name, log in said.items():
        assert not np.allclose(log["elevator, rad"], flight.log["elevator, rad"], rtol=0, atol=1e-9), name


@pytest.mark.short
def test_the_page_shows_the_flight(flight):
    page = sd.report(flight.solution, flight.recording.reference, more=flight_figures.sections(flight)).html
    assert [heading for heading in ("Flight", "Controls", "Forces") if f"<h2>{heading}</h2>" in page] == ["Flight", "Controls", "Forces"]
    drawn = {trace["name"]: trace for trace in json.loads(flight_figures.loads(flight, "F", "N").to_json())["data"]}
    assert len(drawn) == 1
    figure = flight_figures.controls(flight)
    assert [trace.name for trace in figure.data] == ["command", "position"] * 4
    assert np.allclose(figure.data[1].y, np.degrees(flight.log["elevator, rad"]), atol=1e-4) and np.allclose(figure.data[7].y, 100 * flight.log["throttle"], atol=1e-4)


@pytest.mark.short
def test_the_route_is_drawn_along_its_lines_and_arcs():
    turning = fly("turning", duration=1.0)
    points = flight_figures.route_points(turning)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    assert gaps.sum() == pytest.approx(turning.route[:, 6].sum(), rel=2e-3)         # no jump between the parts, no part missing
    corner = np.array(turning.plan.waypoints[1][:2])
    assert 20 < np.hypot(*(points - corner).T).min() < 100                          # an arc cuts it


@pytest.mark.short
def test_a_flight_into_the_ground_keeps_its_results(command, tmp_path, monkeypatch):
    monkeypatch.setitem(flight_plan.PLANS, "low", lambda: flight_plan.straight(higher=-60.0, clearance=5.0))
    code, out, err = command("fly", "low", "--duration", 20, "--outage", "15:", "--out", tmp_path / "low")
    assert (code, err) == (0, []) and sorted(path.name for path in (tmp_path / "low").iterdir()) == FILES
    assert "hit the ground" in out and "drift in 15-20 s: none" in out
    assert "hit the ground" in (tmp_path / "low" / "report.html").read_text()


@pytest.mark.short
def test_a_filter_without_position_flies_on_the_truth(command, tmp_path):
    code, out, err = command("fly", *SHORT, "--filter", "mahony", "--feedback", "truth", "--out", tmp_path / "made")
    assert (code, err) == (0, []) and "drift in" not in out and sorted(path.name for path in (tmp_path / "made").iterdir()) == FILES


@pytest.mark.short
@pytest.mark.parametrize("words, said", [
    (("nowhere",), "nowhere"), (("--wind", "3"), "north,east"), (("--wind", "a,b"), "north,east"), (("--outage", "15"), "outage"),
    (("--feedback", "hope"), "feedback is 'hope'"), (("--prediction", "none"), "prediction is 'none'"), (("--turbulence", "bad"), "turbulence"),
    (("--duration", -1), "-1"), (("--filter", "kallman"), "closed-loop"), (("--filter", "mahony"), "estimates no position"),
    (("--imu", "gold"), "gold"), (("--seed", -1), "seed is -1"), (("--aircraft", "kite"), "kite"), (("--option", "colour=red"), "colour"),
    (("--option", "colour"), "NAME=VALUE"), (("--option", "seed=3"), "--option seed: the flight decides"), (("no/such.toml",), "no/such.toml: cannot")])
def test_bad_input_ends_in_one_line(command, tmp_path, words, said):
    code, out, err = command("fly", *words, "--out", tmp_path / "made")
    assert code == 2 and len(err) == 1 and said in err[0] and not (tmp_path / "made").exists()
