"""The measuring stick itself: targets, judgement of figures, workloads, the yardstick against a
textbook step. No times are asserted."""

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(FOLDER))
import airborne  # noqa: E402
import attitude  # noqa: E402
import bench  # noqa: E402
import exogenous  # noqa: E402
import figure_pages  # noqa: E402
import figures  # noqa: E402
import library  # noqa: E402
import live_latency  # noqa: E402
import logs  # noqa: E402
import navigation  # noqa: E402
import outages  # noqa: E402
import reproduced  # noqa: E402
import smoothing  # noqa: E402
import subject  # noqa: E402
import workload  # noqa: E402
import yardstick  # noqa: E402

plain_run = getattr(yardstick.run, "py_func", yardstick.run)


@pytest.fixture(scope="module")
def short():
    """20 s of workload B with truth, 400 samples and as many fixes."""
    return workload.from_stored("B", workload.simulate(workload.RECIPES["B"], 20.0))


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.short
def test_targets_are_the_issues():
    tables = figures.targets()
    assert len(tables) == 186
    assert (
        tables["A closed loop time"]["target"] == 0.9
        and tables["B closed loop time"]["target"] == 1.0
    )
    assert tables["N open loop position"]["tolerance"] == 0.05


@pytest.mark.short
@pytest.mark.parametrize(
    "text",
    [
        '[a]\ntarget = 1\nunit = "s"\ntext = "t"',
        '[a]\ntarget = 1\ncomparison = "<"\nunit = "s"\ntext = "t"',
        '[a]\ntarget = 1\ncomparison = "within"\nunit = "s"\ntext = "t"',
    ],
)
def test_a_wrong_target_is_named(tmp_path, text):
    path = tmp_path / "targets.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match="figure 'a' needs"):
        figures.targets(path)


@pytest.mark.short
@pytest.mark.parametrize(
    "value, table, holds",
    [
        (1.0, {"comparison": "<=", "target": 1.0}, True),
        (1.001, {"comparison": "<=", "target": 1.0}, False),
        (0.335, {"comparison": "within", "target": 0.32, "tolerance": 0.05}, True),
        (0.305, {"comparison": "within", "target": 0.32, "tolerance": 0.05}, True),
        (0.337, {"comparison": "within", "target": 0.32, "tolerance": 0.05}, False),
        (0.303, {"comparison": "within", "target": 0.32, "tolerance": 0.05}, False),
        (1.6, {"comparison": ">=", "target": 1.6}, True),
        (1.59, {"comparison": ">=", "target": 1.6}, False),
        (math.nan, {"comparison": "<=", "target": 1.0}, False),
        (None, {"comparison": "<=", "target": 1.0}, False),
    ],
)
def test_judgement(value, table, holds):
    assert figures.judge(value, table) is holds


@pytest.mark.short
def test_lines_say_name_value_unit_target_and_verdict():
    tables = figures.targets()
    line = str(figures.against_target("B closed loop time", 1.25, tables, "busy machine"))
    assert (
        line.split() == "B closed loop time 1.25 x yardstick at most 1 MISSED busy machine".split()
    )
    line = str(figures.against_target("A accuracy position", 0.635, tables))
    assert line.split() == "A accuracy position 0.635 m within 1 % of 0.6344 holds".split()
    assert "not measured" in str(
        figures.against_target("first compilation", None, tables)
    ) and "no target" in str(figures.informative("x", 1, "s"))


def test_bench_measures_every_target_and_writes_it(tmp_path, monkeypatch, short, capsys):
    monkeypatch.setattr(bench, "RESULT", tmp_path / "result.json")
    monkeypatch.setattr(sys, "argv", ["bench.py"])
    monkeypatch.setattr(workload, "load", lambda name: short)
    monkeypatch.setattr(workload, "stored_period", lambda: tmp_path)
    monkeypatch.setattr(workload, "score", lambda *_: workload.Rms(0.1, 0.2, 0.3))
    monkeypatch.setattr(yardstick, "run", lambda *_: None)
    monkeypatch.setattr(subject, "accuracy", lambda w, name: workload.Rms(0.311, 1.0, 1.0))
    monkeypatch.setattr(subject, "timed_run", lambda w, name, **options: lambda: 1e9)
    monkeypatch.setattr(subject, "write_log", lambda w: tmp_path)
    monkeypatch.setattr(bench.processes, "day", lambda path: (1.0, 100.0, 40.0, 0.5))
    monkeypatch.setattr(bench.processes, "first_solution", lambda log: (3.0, 5.0, 2.0, 1.0))
    monkeypatch.setattr(bench.processes, "demo", lambda: 40.0)
    monkeypatch.setattr(bench.processes, "help_seconds", lambda: 0.2)
    monkeypatch.setattr(library, "built", lambda folder: (120.0, {"x86-64-v3": 2e6}))
    monkeypatch.setattr(library, "wheel", lambda folder, dist: dist)
    monkeypatch.setattr(library, "with_needs", lambda *_: [(200.0, ""), (4.0, "")])
    monkeypatch.setattr(library, "used", lambda *_: [(0.3, "")] * len(library.WHEEL))
    monkeypatch.setattr(library, "ratio", lambda *_: (1.01, ""))
    monkeypatch.setattr(library, "stream_step", lambda folder: [(1.5, "")])
    sizes = {target: (46e3, "") for target in library.TARGETS}
    monkeypatch.setattr(library, "sizes", lambda: sizes)
    monkeypatch.setattr(library, "in_c", lambda: 0.5)
    monkeypatch.setattr(library, "in_python", lambda: 1.5)
    claims = [{"value": 0.45}] * 13
    monkeypatch.setattr(bench.recordings, "score_recordings", lambda *_: (claims, {}, []))
    worth = [(0.05, "")] * len(outages.AIR_DATA)
    monkeypatch.setattr(outages, "air_data", lambda: worth)
    monkeypatch.setattr(reproduced, "read", lambda study: [(9.0, "")] * len(study.figures))
    for name in ("calibrate_installation", "tune"):
        monkeypatch.setattr(bench.sd, name, lambda *_: SimpleNamespace(runs=3))
    monkeypatch.setattr(bench, "CAR", 61.0)
    monkeypatch.setattr(bench.studies, "threads", lambda: (1.7, 1.9))
    monkeypatch.setattr(bench.studies, "peak", lambda runs: 300.0)
    monkeypatch.setattr(bench.studies, "paper", lambda *options: (50.0, 1e8, 1.0))
    for name, lines in (
        ("accuracy", attitude.ACCURACY),
        ("times", attitude.TIMES),
        ("simulated", attitude.SIMULATED),
    ):
        monkeypatch.setattr(attitude, name, lambda lines=lines: [(0.3, "")] * len(lines))
    monkeypatch.setattr(navigation, "times", lambda *_: [(0.3, "")] * len(navigation.TIMES))
    monkeypatch.setattr(
        navigation, "consistency", lambda: [(0.95, "")] * len(navigation.CONSISTENT)
    )
    for name, lines in (
        ("times", exogenous.TIMES),
        ("starts", exogenous.STARTS),
        ("drifts", exogenous.DRIFTS),
        ("compared", exogenous.COMPARED),
    ):
        monkeypatch.setattr(exogenous, name, lambda *_, lines=lines: [(0.3, "")] * len(lines))
    for name in ("ukf", "pkf", "aircraft", "flown", "study"):
        monkeypatch.setattr(
            airborne,
            name,
            lambda *_, lines=getattr(airborne, "FLOWN" if name == "flown" else name.upper()): (
                [(0.3, "")] * len(lines)
            ),
        )
    monkeypatch.setattr(live_latency, "results", lambda: [(0.3, "")] * len(live_latency.FIGURES))
    monkeypatch.setattr(logs, "tables", lambda: [(0.3, "")] * len(logs.TABLES))
    monkeypatch.setattr(logs, "slowest", lambda: [(0.3, "")] * len(logs.HOURS_READ))
    monkeypatch.setattr(
        bench.report_pages, "pages", lambda: [(0.3, "")] * len(bench.report_pages.FIGURES)
    )
    monkeypatch.setattr(smoothing, "smoothing", lambda: [(0.3, "")] * len(smoothing.FIGURES))
    monkeypatch.setattr(
        attitude, "peer_figures", lambda: [figures.informative("attitude, BROAD vqf", 2.6, "deg")]
    )
    monkeypatch.setattr(
        bench.peers,
        "RUNS",
        (
            ("fast", lambda w, s: bench.peers.Result(2.0, None), "smsfusion", {"A": 1.0}),
            ("absent", None, "no such package", {"A": 1.0}),
        ),
    )
    monkeypatch.setattr(
        bench.peers, "versions", lambda: {"smsfusion": "1.0", "no such package": None}
    )

    def broken(w):
        raise RuntimeError("no stream today\nmore")

    monkeypatch.setattr(subject, "stream_times", broken)
    parts = bench.PARTS | {"pages": ("Pages of a solution", lambda book: broken(None))}
    monkeypatch.setattr(bench, "PARTS", parts)
    bench.main()
    about, found = figures.read(bench.RESULT)
    written = {figure.name: figure for figure in found}
    assert figures.apart(found, figures.targets()) == []
    assert len(written) == len(found) and set(figures.targets()) <= set(written)
    assert [part["name"] for part in about["parts"]] == list(bench.PARTS)
    assert about["commit"] == figures.git("rev-parse", "HEAD") == figures.commit(bench.RESULT)
    assert written["N closed loop position"].holds is True
    assert written["A accuracy position"].holds is False
    assert written["A closed loop time"].holds is False
    assert written["export, four sources on cortex-m7"].value == 46.0
    assert written["export, a sample in C"].note == "a step of a stream 3.0 x as long"
    broke = "RuntimeError: no stream today"
    fix = written["stream step, fix"]
    assert (fix.value, fix.holds, fix.note, fix.part) == (None, False, broke, "speed")
    assert about["broken"] == {"pages": broke} and written["page, script"].note == f"pages: {broke}"
    assert written["A absent time"].note == "no such package is not installed"
    lines = capsys.readouterr().out.splitlines()
    assert len([line for line in lines if line.startswith("-- part ")]) == len(bench.PARTS)
    assert f"{broke} (2)" in lines[-2] and "no such package is not installed (1)" in lines[-2]
    assert lines[-1] == f"part pages ended early: {broke}"


@pytest.mark.short
def test_a_part_alone_writes_nothing_and_a_wrong_name_is_refused(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(bench, "RESULT", tmp_path / "result.json")
    monkeypatch.setattr(bench, "PARTS", {"none": ("Nothing", lambda book: None)})
    monkeypatch.setattr(sys, "argv", ["bench.py", "none"])
    bench.main()
    assert "0 figures hold, 0 missed" in capsys.readouterr().out and not bench.RESULT.exists()
    monkeypatch.setattr(sys, "argv", ["bench.py", "nil"])
    with pytest.raises(SystemExit, match="2"):
        bench.main()
    assert "no part 'nil'; there are none" in capsys.readouterr().err


@pytest.mark.short
def test_pages_alone_are_renewed(monkeypatch, tmp_path):
    """Other figures, and the commit that they were measured at, stay."""
    path = tmp_path / "result.json"
    of = lambda name, value, part: figures.informative(name, value, "", "")._replace(part=part)
    about = {"commit": "c0ffee"}
    old = [of("a time", 3.0, "speed"), of("of a page", 1.0, "evidence")]
    figures.write(path, old, about, [{"name": "speed"}], {})
    renew = lambda book: book.add(figures.informative("of a page", 2.0, "", "page.md as of now"))
    monkeypatch.setattr(bench, "RESULT", path)
    monkeypatch.setattr(bench, "PARTS", {"evidence": ("Pages", renew)})
    monkeypatch.setattr(sys, "argv", ["bench.py", "--pages"])
    bench.main()
    found, written = figures.read(path)
    assert found["commit"] == "c0ffee" and found["parts"] == [{"name": "speed"}]
    assert [(each.name, each.value) for each in written[:2]] == [
        ("a time", 3.0),
        ("of a page", 2.0),
    ]
    assert {each.name for each in written[2:]} == set(figures.targets())
    assert {each.value for each in written[2:]} == {None}


@pytest.mark.short
def test_without_the_data_folder_all_figures_say_the_same(monkeypatch, tmp_path):
    monkeypatch.setenv("STRAPDOWN_DATA", str(tmp_path / "absent"))
    book = bench.Book()
    book.measure(
        ["thor75 roll"],
        lambda: bench.recordings.score_recordings(bench.recordings.DESCRIPTIONS, tmp_path),
    )
    book.measure(["attitude, BROAD MEKF mean"], attitude.accuracy)
    book.run("attitude", "Attitude", lambda book: attitude.trial())
    assert bench.summary(book)[1:] == [
        "not measured: no data folder; set STRAPDOWN_DATA (2)",
        "part attitude ended early: no data folder; set STRAPDOWN_DATA",
    ]


@pytest.mark.short
def test_two_threads_on_one_core_are_not_measurable(monkeypatch):
    monkeypatch.setattr(bench.os, "cpu_count", lambda: 1)
    assert bench.two_threads() == [(None, "not measurable on one core")]


@pytest.mark.short
def test_studies_are_read_from_their_pages():
    for study in reproduced.STUDIES:
        found = reproduced.read(study)
        assert len(found) == len(study.figures)
        assert all(
            math.isfinite(value) and study.name.rpartition(" of ")[2] in note
            for value, note in found
        )


@pytest.mark.short
def test_a_page_without_a_figure_is_named(monkeypatch):
    study = reproduced.Study("noise", {"gone": lambda text: text[10**9]})
    with pytest.raises(ValueError, match=r"noise.md: holds no 'gone'.*strapdown reproduce noise"):
        reproduced.read(study)


@pytest.mark.short
def test_targets_without_figure_and_figures_without_target_are_named():
    tables = dict(list(figures.targets().items())[:3])
    names = list(tables)
    found = [figures.against_target(name, 1.0, tables) for name in names]
    assert figures.apart([*found, figures.informative("x", 1, "s")], tables) == []
    changed = tables | {names[1]: tables[names[1]] | {"target": 7.0}}
    del changed[names[2]]
    assert figures.apart(found[1:], changed) == [
        f"{names[0]}: no figure",
        f"{names[2]}: no target",
        f"{names[1]}: judged by another target",
    ]


@pytest.mark.short
def test_a_damaged_result_is_named(tmp_path):
    for text in ("", "[]", "{}", '{"figures": [{"nonsense": 1}]}'):
        (tmp_path / "result.json").write_text(text)
        with pytest.raises(ValueError, match="no result of a bench .* run `make bench`"):
            figures.read(tmp_path / "result.json")
        assert figures.commit(tmp_path / "result.json") == ""


@pytest.mark.short
def test_a_stale_page_of_figures_is_named(monkeypatch):
    assert figure_pages.stale() == []
    monkeypatch.setattr(figures, "targets", lambda: {})
    lines = figure_pages.stale()
    assert "benchmarks/result.json: A closed loop time: no target; run `make bench`" in lines
    monkeypatch.undo()
    text = figure_pages.PAGE.read_text(encoding="utf-8")
    monkeypatch.setattr(figure_pages, "tables", lambda: "other")
    assert figure_pages.stale() == [
        "docs/reference/figures.md: is not what `python docs/_site/figure_pages.py` writes; run it"
    ]
    assert figure_pages.PAGE.read_text(encoding="utf-8") == text


@pytest.mark.short
def test_score_measures_known_errors():
    w = workload.from_stored("B", workload.simulate(workload.RECIPES["B"], 121.0))
    from scipy.spatial.transform import Rotation

    C = Rotation.from_euler("xyz", w.rph).as_matrix()
    shift = np.array([3 / 6370e3, 4 / (6390e3 * math.cos(w.lla[0, 0])), 0])
    wrong = Rotation.from_rotvec([0, 0, 0.5], degrees=True).as_matrix() @ C
    rms = workload.score(w, w.t, w.lla + shift, w.v + [0, 0, -0.25], wrong)
    assert rms.position == pytest.approx(5, rel=3e-3)
    assert rms[1:] == (pytest.approx(0.25), pytest.approx(0.5))
    with pytest.raises(ValueError, match="120 s"):
        workload.score(w, w.t[:5], w.lla[:5], w.v[:5], C[:5])


@pytest.mark.short
def test_a_day_is_rounds_of_one_piece():
    piece = workload.period(30, 100)
    w = workload.repeated(piece, 75.0)
    assert len(w.t) == 7501 and len(w.fix) == 75 and w.t[-1] == 75
    noise = w.dtheta[3001:6001] - w.dtheta[1:3001]
    assert np.std(noise) == pytest.approx(math.sqrt(2 / 100) * w.parameters["gyro_noise"], rel=0.05)
    error = (w.fix - workload.round_position(piece, w.fix_t)) * [*workload.round_scale(piece), 1.0]
    assert np.std(error) == pytest.approx(1.0, abs=0.15)


@pytest.mark.short
def test_yardstick_mechanisation_follows_the_simulator(short):
    truth = workload.simulate(workload.RECIPES["B"], 20.0)
    w = short._replace(
        dtheta=truth["dtheta_true"],
        dv=truth["dvel_true"],
        fix_t=short.fix_t[:0],
        fix=short.fix[:0],
        start=(short.lla[0], short.v[0], short.rph[0]),
    )
    inputs, (lla, v, C, _) = yardstick.arguments(w)
    plain_run(*inputs, lla, v, C, _)
    assert np.abs((lla - w.lla[1:]) * [6.37e6, 4.5e6, 1]).max() < 0.05
    assert np.abs(v - w.v[1:]).max() < 0.01


@pytest.mark.short
def test_yardstick_step_is_the_textbook_one(short):
    w, std = short.first(short.dt), short.std
    correlation = np.corrcoef(np.random.default_rng(3).standard_normal((15, 40)))
    arguments = lambda w: (
        *yardstick.arguments(w)[0][:-2],
        correlation * np.outer(std, std),
        yardstick.arguments(w)[0][-1],
    )
    (dtheta, dv, dt, _, fix, r, lla, v, C, P, q), outputs = arguments(w), yardstick.arguments(w)[1]
    plain_run(*arguments(w), *outputs)
    x = 1 - yardstick.E2 * math.sin(lla[0]) ** 2
    north, east = (
        yardstick.A * (1 - yardstick.E2) / x**1.5 + lla[2],
        yardstick.A / math.sqrt(x) + lla[2],
    )
    earth = yardstick.OMEGA * np.array([math.cos(lla[0]), 0, -math.sin(lla[0])])
    transport = np.array([v[1] / east, -v[0] / north, -v[1] * math.tan(lla[0]) / east])
    Phi = np.eye(15)
    Phi[0:3, 3:6] = np.eye(3) * dt
    Phi[3:6, 3:6] -= skew(2 * earth + transport) * dt
    Phi[3:6, 6:9] = -skew(C @ (dv[0] + np.cross(dtheta[0], dv[0]) / 2))
    Phi[3:6, 9:12] = Phi[6:9, 12:15] = -C * dt
    Phi[6:9, 6:9] -= skew(earth + transport) * dt
    P = Phi @ P @ Phi.T + np.diag(q)
    H = np.eye(3, 15)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + r * np.eye(3))
    P = (np.eye(15) - K @ H) @ P @ (np.eye(15) - K @ H).T + r * K @ K.T
    assert len(dtheta) == 1 and np.allclose(outputs[3][0], np.diag(P), rtol=1e-9)
    free, without = w._replace(fix_t=w.fix_t[:0], fix=w.fix[:0]), yardstick.arguments(w)[1]
    plain_run(*arguments(free), *without)
    scale = np.array([north, east * math.cos(lla[0]), -1])
    correction = K @ ((fix[0] - without[0][0]) * scale)
    assert np.allclose(
        (outputs[0][0] - without[0][0]) * scale, correction[:3], rtol=1e-5, atol=1e-9
    )
    assert np.allclose(outputs[1][0] - without[1][0], correction[3:6], rtol=1e-6, atol=1e-12)


@pytest.mark.short
def test_yardstick_and_closed_loop_agree(short):
    inputs, outputs = yardstick.arguments(short)
    plain_run(*inputs, *outputs)
    ours = subject.fuse(short, "closed-loop").trajectory
    apart = (ours.lla - outputs[0]) * [6.37e6, 4.5e6, 1]
    assert np.abs(apart).max() < 0.02
    assert np.allclose(ours.std[-1, :6], np.sqrt(outputs[3][-1, :6]), rtol=0.02)
