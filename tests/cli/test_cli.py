"""The command line as a user meets it: what it prints, what it writes, how it refuses, and what
is left after Ctrl-C."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic import DOUBTFUL, TRUSTED, WRONG

import strapdown as sd
from strapdown.cli.console import print_verdicts
from strapdown.io.solution import read_origin
from strapdown.sim.trajectory import demo_flight

COMMAND = shutil.which(
    "strapdown", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
)
RESULTS = {"solution.nc", "solution.csv", "track.kml", "report.html"}
TOML = """
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["gx", "gy", "gz"], unit = "deg/s" }
accel = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
grade = "tactical"

[[source]]
kind = "position"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "alt"]
unit = ["deg", "deg", "m"]
std = [1.0, 1.0, 1.5]

[[source]]
kind = "velocity"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn", "ve", "vd"]
unit = "m/s"
std = 0.1

[reference]
file = "truth.csv"
"""


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Folder with the tables of 30 s of flight at 50 Hz and their description."""
    folder = tmp_path_factory.mktemp("flight")
    flight = sd.simulate(demo_flight(), 30.0, "tactical", seed=1, rate=50.0)
    imu, position, velocity = flight.imu, *flight.sources
    rates = np.degrees(imu.dtheta) / imu.dt[:, None], imu.dv / imu.dt[:, None]
    pd.DataFrame(np.c_[imu.t, *rates], columns=["t", "gx", "gy", "gz", "ax", "ay", "az"]).to_csv(
        folder / "imu.csv", index=False
    )
    fixes = np.c_[position.t, np.degrees(position.y[:, :2]), position.y[:, 2], velocity.y]
    pd.DataFrame(fixes, columns=["t", "lat", "lon", "alt", "vn", "ve", "vd"]).to_csv(
        folder / "gnss.csv", index=False
    )
    flight.reference.table().to_csv(folder / "truth.csv")
    (folder / "recording.toml").write_text(TOML)
    return folder


@pytest.fixture
def flight(tables, tmp_path, monkeypatch):
    """Work in a copy of the tables; the path of the description."""
    shutil.copytree(tables, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return Path("recording.toml")


def files(folder="."):
    return {str(path): path.stat().st_mtime_ns for path in Path(folder).rglob("*")}


def test_installed_command_is_quick_and_light():
    shown = subprocess.run([COMMAND, "--version"], capture_output=True, text=True)
    assert (shown.returncode, shown.stdout, shown.stderr) == (
        0,
        f"strapdown {sd.__version__}\n",
        "",
    )
    heavy = "{'numpy', 'numba', 'pandas', 'scipy', 'plotly', 'pydantic', 'xarray'}"
    code = (
        f"import sys; sys.argv = ['strapdown', '--help']\nfrom strapdown import cli\ntry:\n    cli.main()\nfinally:\n"
        f"    print('loaded:', {heavy} & set(sys.modules))"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert shown.stdout.endswith("loaded: set()\n") and shown.stderr == ""


@pytest.mark.short
def test_help_names_every_command(good):
    for out in (good(), good("--help")):
        assert all(
            re.search(rf"^  {name} ", out, re.MULTILINE)
            for name in ("demo", "fuse", "inspect", "filters", "imus", "reproduce")
        )
    out = good("fuse", "--help")
    assert all(
        option in out
        for option in (
            "--filter",
            "--imu",
            "--from",
            "--to",
            "--hide",
            "--heading",
            "--option",
            "--every",
            "--out",
        )
    )


@pytest.mark.short
def test_lists(good):
    out = good("filters")
    assert max(map(len, out.splitlines())) <= 100
    closed_loop = "closed-loop             first choice"
    assert re.search(rf"^Kalman filters of .*\n{closed_loop}", out, re.MULTILINE)
    assert out.index("Attitude without a position\n") < out.index("\nvru ")
    told = good("filters", "periodic-reset")
    assert all(
        part in told
        for part in (
            "interval     60.0",
            "interval: seconds between resets",
            "not for: ",
            "Bryne",
        )
    )
    assert "estimates: position down, velocity down, attitude roll pitch" in good("filters", "vru")
    out = good("imus")
    listed = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()}
    assert {*sd.imus(), "MPU-6050", "STIM300"} <= set(listed)
    assert float(listed["tactical"][1]) == 0.15 and "6012" in listed["consumer"]
    assert "PS-MPU-6000A-00" in good("imus", "mpu6050")


def test_receivers_are_listed(good):
    header, _, *rows = good("receivers").splitlines()
    assert header.split() == sd.receivers()
    (white,) = [row for row in rows if row.startswith("position, white, m")]
    assert "0.15 0.15 0.3" in white and len(rows) == 7


def test_demo_writes_a_page(good, tmp_path):
    out = good("demo", "--out", tmp_path / "new" / "page.html", "--seed", "3")
    rows = {
        line.split()[0]: np.array(line.split()[1:4], float)
        for line in out.splitlines()
        if line.startswith(("closed-loop", "open-loop"))
    }
    assert np.all(rows["closed-loop"] < 1.0) and rows.keys() == {"closed-loop", "open-loop"}
    page = (tmp_path / "new" / "page.html").read_text(encoding="utf-8")
    assert "strapdown demo" in page and "open-loop" in page and len(page) > 1e6
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["page.html"]


@pytest.mark.short
def test_inspect_a_recording(good, command, flight):
    out = good("inspect", flight)
    assert (
        "1500 samples" in out
        and "position: 30 fixes" in out
        and "\nno mistakes found\ninconclusive: " in out
    )
    flight.write_text(TOML.replace('unit = "deg/s"', 'unit = "rad/s"'))
    code, out, err = command("inspect", flight)
    assert (code, err) == (3, []) and re.search(r"problem: .*\[imu\].*deg/s", out)


@pytest.mark.short
def test_inspect_drafts_a_description(good, command, flight):
    out = good("inspect", "imu.csv", "--write", "drafted.toml")
    assert "wrote drafted.toml" in out
    draft = Path("drafted.toml").read_text()
    assert 'columns = ["gx", "gy", "gz"]' in draft and "check" in draft
    assert "1500 samples" in good("inspect", "drafted.toml")
    for words, reason in (
        ("imu.csv", "such a file already"),
        ("recording.toml", "is a recording already"),
    ):
        code, _, (line,) = command("inspect", words, "--write", "drafted.toml")
        assert code == 2 and reason in line
    assert Path("drafted.toml").read_text() == draft


def test_fuse_writes_what_python_gets(good, flight):
    out = good("fuse", flight, "--out", "deep/result")
    assert (
        "position: 29 fixes accepted, 0 rejected" in out
        and "heading from the course" in out
        and "rms error against the reference" in out
    )
    folder = Path("deep/result")
    assert {path.name for path in folder.iterdir()} == RESULTS
    expected, found = sd.fuse(sd.read(flight)), sd.read_solution(folder / "solution.nc")
    np.testing.assert_allclose(found.trajectory.lla, expected.trajectory.lla, rtol=1e-15)
    np.testing.assert_array_equal(found.innovations.nis, expected.innovations.nis)
    np.testing.assert_allclose(
        sd.read_solution(folder / "solution.csv").table(), expected.table(), rtol=0, atol=1e-9
    )
    assert "<coordinates>" in (folder / "track.kml").read_text() and "closed-loop" in (
        folder / "report.html"
    ).read_text(encoding="utf-8")
    first = sd.rms(sd.errors(expected, sd.read(flight).reference)).position[0]
    assert f"{first:.3g}" in out


def test_fuse_writes_further_files_with_utc(good, command, flight):
    text = flight.read_text()
    flight.write_text('epoch = "2024-05-01T12:00:00Z"\n' + text)
    good("fuse", flight, "--also", "gpx, tum,.geojson,csv.gz", "--utc", "--out", "a")
    further = {"track.gpx", "track.tum", "track.geojson", "solution.csv.gz"}
    assert {path.name for path in Path("a").iterdir()} == RESULTS | further
    assert sd.read_solution("a/solution.csv").meta["epoch"] == "2024-05-01T12:00:00Z"
    assert "2024-05-01 12:00:" in Path("a/report.html").read_text(encoding="utf-8")
    flight.write_text(text)
    good("fuse", flight, "--also", "tum", "--origin", "47.63,9.35,400", "--out", "c")
    place = np.r_[np.degrees(read_origin("c/track.tum")[:2]), read_origin("c/track.tum")[2]]
    assert place == pytest.approx([47.63, 9.35, 400.0], abs=1e-9)
    for words, said in (
        (["--origin", "47.63,9.35,400"], "only track.tum has positions from it; add --also tum"),
        (["--also", "tum", "--origin", "here"], "write latitude,longitude,height in deg and m"),
        (
            ["--also", "tum", "--origin", "147,9,0"],
            "the limit of the latitude is 1.571 rad (90 deg)",
        ),
        (["--utc"], "--utc: the recording has no absolute clock"),
        (["--also", "gpz"], "did you mean 'gpx'?"),
        (["--write", "b.toml"], "is a recording already"),
    ):
        code, _, err = command("fuse", flight, *words, "--out", "b")
        assert code == 2 and len(err) == 1 and said in err[0], err
    assert not Path("b").exists() and not Path("b.toml").exists()


def test_fuse_names_its_folder_and_reads_netcdf(good, flight):
    sd.write_recording(sd.read(flight), "flight.nc")
    out = good("fuse", "flight.nc", "--filter", "open-loop")
    assert "wrote recording-open-loop/solution.nc" in out
    assert set(sd.read_solution("recording-open-loop/solution.nc").columns) == {
        f"ins_error_{axis} [m]" for axis in ("north", "east", "down")
    }


def judged(monkeypatch, *verdicts):
    """What is judged has these verdicts, one after the other, the last one again and again."""
    given = [*reversed(verdicts)]

    def judge(_):
        return given.pop() if len(given) > 1 else given[0]

    monkeypatch.setattr("strapdown.verdict.judge.judge", judge)


def test_the_verdict_is_the_first_line_and_goes_into_the_files(good, flight, monkeypatch):
    judged(monkeypatch, WRONG)
    for more in ([], ["--smooth"]):
        first, second, *rest = good(
            "fuse", flight, "--hide", "10:15", "--out", "a", *more
        ).splitlines()
        assert first == "verdict: not to be trusted"
        assert second.startswith("  1. axes of the IMU: the course is 89.7")
        assert rest[0].startswith("  2. time stamps of gnss velocity:") and "note" not in rest[1]
        assert sd.read_solution("a/solution.nc").verdict == WRONG
        assert sd.read_solution("a/solution.csv").verdict == WRONG
        assert "Not to be trusted" in Path("a/report.html").read_text()
    judged(monkeypatch, TRUSTED)
    assert good("fuse", flight, "--out", "a").startswith(
        "verdict: trusted\n  not tested: heading: no turns"
    )


def test_on_a_terminal_the_verdict_is_wrapped(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "60")
    print_verdicts({"": WRONG})
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 60
    assert "not to be trusted" in lines[0] and "\x1b[31m" in lines[0]
    assert lines[1].startswith("  1. axes") and lines[2].startswith("      ")
    monkeypatch.setenv("NO_COLOR", "1")
    print_verdicts({"": WRONG})
    assert capsys.readouterr().out.startswith("verdict: not to be trusted\n")


def test_strict_exits_with_3_unless_trusted(command, flight, monkeypatch):
    for verdict, expected in ((TRUSTED, 0), (DOUBTFUL, 3), (WRONG, 3)):
        shutil.rmtree("a", ignore_errors=True)
        judged(monkeypatch, verdict)
        code, _, err = command("fuse", flight, "--strict", "--out", "a")
        assert code == expected and {path.name for path in Path("a").iterdir()} == RESULTS
        assert len(err) == (1 if expected else 0)
        assert command("fuse", flight, "--out", "a")[0] == 0


def test_from_to_and_every(good, flight):
    good("fuse", flight, "--from", 5, "--to", 25, "--every", 7, "--out", "a")
    t = sd.read_solution("a/solution.nc").t
    assert t[0] >= 5 and t[-1] == 25 and np.allclose(np.diff(t), 0.14)


def test_hide(good, flight):
    out = good("fuse", flight, "--hide", "10:15, 20:22.5", "--out", "a")
    assert (
        "16 fixes withheld" in out
        and re.search(r"^10-15 +\d", out, re.MULTILINE)
        and re.search(r"^20-22.5 +\d", out, re.MULTILINE)
    )
    made, page = sd.read_solution("a/solution.nc"), Path("a/report.html").read_text()
    t = made.innovations.t
    assert [tuple(window) for window in made.meta["withheld"]] == [
        (10, 15),
        (20, 22.5),
    ] and "<td>20 to 22.5</td>" in page
    assert not ((t >= 10) & (t < 15) | (t >= 20) & (t < 22.5)).any() and len(t) == 2 * 29 - 16
    assert "not scored: outage 100-110 s" in good("fuse", flight, "--hide", "100:110", "--out", "a")


def test_heading(good, flight):
    assert "heading given" in good("fuse", flight, "--heading", -304.5, "--out", "a")
    start = sd.read_solution("a/solution.nc").meta["start"]
    np.testing.assert_allclose(np.degrees([start["rph"][2], start["std"][8]]), [-304.5, 2.0])


def test_options_of_a_filter(good, flight):
    good("fuse", flight, "--out", "open", "--filter", "open-loop")
    good(
        "fuse",
        flight,
        "--out",
        "never",
        "--filter",
        "periodic-reset",
        "--option",
        "interval=inf",
        "--option",
        "error_model=corrected",
    )
    good(
        "fuse",
        flight,
        "--out",
        "literal",
        "--filter",
        "open-loop",
        "--option",
        "error_model=literal",
    )
    position = {
        name: sd.read_solution(f"{name}/solution.nc").trajectory.lla
        for name in ("open", "never", "literal")
    }
    np.testing.assert_array_equal(position["never"], position["open"])
    assert np.any(position["literal"] != position["open"])


def test_imu_of_ones_own(good, flight):
    sd.imu("consumer").to_toml("mine.toml")
    good("fuse", flight, "--imu", "mine.toml", "--out", "a")
    good("fuse", flight, "--imu", "consumer", "--out", "b")
    mine, consumer = (sd.read_solution(f"{folder}/solution.nc") for folder in "ab")
    np.testing.assert_allclose(mine.trajectory.lla, consumer.trajectory.lla, rtol=1e-12)
    assert mine.meta["noise"]["gyro"] == pytest.approx(sd.imu("consumer").noise().gyro)


def change(old, new):
    """A description with one thing changed."""
    assert old in TOML
    return TOML.replace(old, new)


FUSE = ["fuse", "recording.toml", "--out", "result/deep"]
BAD = [
    (["fuse", "nothing.toml", "--out", "result"], TOML, "nothing.toml: cannot be read"),
    (["fuse", ".", "--out", "result"], TOML, "is a folder without files that a reader recognises"),
    (["fuse", "imu.csv"], TOML, "no position fix to start from"),
    (["inspect", "imu.csv", "--imu", "tactical"], TOML, "a grade into a draft; add --write FILE"),
    (["allan", "imu.csv", "--imu", "tactical"], TOML, "allan finds the noise itself"),
    (["fuse"], TOML, "Missing argument 'RECORDING'. See `strapdown fuse --help`."),
    ([*FUSE, "--filter", "closed-lop"], TOML, "did you mean 'closed-loop'?"),
    ([*FUSE, "--option", "intervall=3"], TOML, "no option 'intervall'; it has error_model"),
    ([*FUSE, "--option", "interval"], TOML, "write NAME=VALUE"),
    (
        [*FUSE, "--filter", "periodic-reset", "--option", "interval=soon"],
        TOML,
        "interval is 'soon'; it must be a number",
    ),
    (
        [*FUSE, "--filter", "periodic-reset", "--option", "interval=-1"],
        TOML,
        "interval is -1.0 s; it must be a number, 0 or more",
    ),
    ([*FUSE, "--option", "error_model=printed"], TOML, "one of corrected, literal, printed-signs"),
    ([*FUSE, "--hide", "3-4"], TOML, "a window is START:STOP"),
    ([*FUSE, "--hide", "4:3"], TOML, "ends before it starts"),
    ([*FUSE, "--hide", "3:4:5"], TOML, "a window is START:STOP"),
    (
        [*FUSE, "--from", "1000"],
        TOML,
        "no IMU samples between 1000 and inf s; the recording covers 0.000 to 30.000 s",
    ),
    (
        [*FUSE, "--from", "20", "--to", "10"],
        TOML,
        "20 s is after 10 s; write the earlier time first",
    ),
    ([*FUSE, "--from", "soon"], TOML, "--from"),
    ([*FUSE, "--every", "0"], TOML, "every is 0"),
    ([*FUSE, "--heading", "900"], TOML, "clockwise from true north"),
    ([*FUSE, "--heading", "nan"], TOML, "it must be a number"),
    ([*FUSE, "--imu", "tactica"], TOML, "did you mean 'tactical'?"),
    ([*FUSE, "--imu", "missing.toml"], TOML, "missing.toml: cannot be read"),
    ([*FUSE, "--bogus"], TOML, "No such option: --bogus"),
    (FUSE, change('grade = "tactical"\n', ""), "give --imu, one of consumer"),
    ([*FUSE, "--heading", "50"], change('grade = "tactical"\n', ""), "give --imu, one of consumer"),
    (
        FUSE,
        change('kind = "velocity"', 'kind = "velocity"\nlever_arms = [0, 0, 0]'),
        "did you mean 'lever_arm'?",
    ),
    (FUSE, change('kind = "velocity"', 'kind = "velocty"'), "velocity"),
    (FUSE, change('unit = "m/s"', 'unit = "mph"'), "unit"),
    (FUSE, change('columns = ["lat",', 'columns = ["latt",'), "latt"),
    (FUSE, change('unit = "deg/s"', 'unit = "rad/s"'), "deg/s"),
    (FUSE, TOML.replace('unit = "s" }\ncolumns', 'unit = "s", offset = 1e4 }\ncolumns'), "offset"),
    (
        FUSE,
        change(
            'columns = ["lat", "lon", "alt"]',
            'scale = [1.875, 1.0, 1.0]\ncolumns = ["lat", "lon", "alt"]',
        ),
        "89 deg",
    ),
    (
        FUSE,
        change(
            'columns = ["lat", "lon", "alt"]',
            'scale = [2.0, 1.0, 1.0]\ncolumns = ["lat", "lon", "alt"]',
        ),
        "the limit is 90",
    ),
    (FUSE, TOML.split("[[source]]")[0], "no position fix to start from"),
    (FUSE, "", "is empty"),
    (["fuse", "recording.toml", "--out", "imu.csv"], TOML, "choose another folder"),
    (["fuse", "recording.toml", "--out", "imu.csv/result"], TOML, "choose another folder"),
    (["fuse", "recording.toml", "--out", "/proc/strapdown/result"], TOML, "choose another folder"),
    (["inspect", "nothing.csv"], TOML, "nothing.csv: cannot be read"),
    (["inspect", "imu.csv", "--write", "nowhere/drafted.toml"], TOML, "cannot be written"),
    (
        ["reproduce", "nonsense", "--out", "result"],
        TOML,
        "there is: alam, bias-decay, broad, consistency, faults",
    ),
    (["reproduce", "recordings", "--recordings", ".", "--out", "result"], TOML, "thor75.toml"),
    (["demo", "--imu", "bogus", "--out", "result/page.html"], TOML, "unknown IMU 'bogus'"),
    (["fus"], TOML, "No such command 'fus'"),
    (["imus", "more"], TOML, "more"),
    (["receivers", "more"], TOML, "more"),
]


@pytest.mark.short
@pytest.mark.parametrize(
    "words, description, expected",
    BAD,
    ids=[f"{number}-{expected[:30]}" for number, (_, _, expected) in enumerate(BAD)],
)
def test_bad_input_is_refused_in_one_line(command, flight, words, description, expected):
    flight.write_text(description)
    before = files()
    code, _, err = command(*words)
    assert code == 2 and len(err) == 1, (code, err)
    assert err[0].startswith("strapdown: ") and expected in err[0]
    assert files() == before


def test_what_cannot_be_written_leaves_what_was_there(command, flight):
    Path("result/solution.csv").mkdir(parents=True)
    before = Path("result/solution.nc")
    before.write_bytes(b"of before")
    code, _, (line,) = command("fuse", flight, "--out", "result")
    assert code == 2 and line.startswith("strapdown: result/solution.csv: cannot be written")
    assert {path.name for path in Path("result").iterdir()} == {"solution.nc", "solution.csv"}
    assert before.read_bytes() == b"of before"


@pytest.mark.short
@pytest.mark.parametrize("interrupted", ["strapdown.fuse", "strapdown.report"])
def test_ctrl_c_at_an_awkward_moment(command, flight, monkeypatch, interrupted):
    """Also behind a written solution: its files appear together with the report."""

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(interrupted, interrupt)
    code, _, err = command("fuse", flight, "--out", "result/deep", "--every", 10)
    assert code == 130 and len(err) == 1 and err[0].startswith("strapdown: interrupted")
    assert not Path("result").exists()


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_during_a_long_run(tmp_path):
    """Without the compiler 200 s of flight take ten seconds and more: time enough to interrupt
    the loop itself."""
    recording = sd.simulate(demo_flight(), 200.0, "tactical", seed=1)
    sd.write_recording(recording, tmp_path / "long.nc")
    process = subprocess.Popen(
        [COMMAND, "fuse", "long.nc", "--hide", "1:2", "--out", "result"],
        cwd=tmp_path,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONUNBUFFERED": "1"},
    )
    try:
        while not (tmp_path / "result").exists():  # read, and about to fuse
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        time.sleep(2.0)
        assert process.poll() is None, process.communicate()
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 130
    assert err.splitlines() == [
        "strapdown: interrupted; files written so far are whole, nothing is half-written"
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["long.nc"]


def test_ctrl_c_in_the_clean_up_of_an_object_comes_again():
    """There Python only reports exceptions and goes on."""
    code = """import sys, time
from strapdown.cli import app as cli
sys.unraisablehook = cli._again
class Cleaned:
    def __del__(self):
        raise KeyboardInterrupt
Cleaned()
try:
    for _ in range(2000):   # not one sleep: it would be slept to its end first
        time.sleep(0.01)
except KeyboardInterrupt:
    print("again")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "again\n" and done.stderr == ""


def test_a_terminal_is_shown_the_time_that_is_left_and_a_pipe_nothing(monkeypatch, capsys):
    from strapdown.cli import console

    def shown(terminal):
        monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
        monkeypatch.setenv("TERM", "xterm" if terminal else "dumb")
        monkeypatch.setenv("FORCE_COLOR" if terminal else "NO_COLOR", "1")
        with console.Progress() as progress:
            done = progress.track("study")
            for fraction in (0.1, 0.2, 0.4):
                done(fraction)
                if progress.bar:
                    progress.bar.refresh()
        return capsys.readouterr().err

    assert shown(False) == ""
    bar = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown(True))
    assert re.search(r"study.*40%.*\d:\d\d:\d\d.*left", bar)
