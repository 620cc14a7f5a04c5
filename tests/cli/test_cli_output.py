"""Standard output of commands: text that fits the terminal, the verdict alone, one JSON document."""

import fcntl
import io
import json
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from dataclasses import replace
from pathlib import Path

import given_files
import pytest

import strapdown as sd
from strapdown.cli import console, output
from strapdown.data.verdict import Untested, Verdict

ROOT = Path(__file__).resolve().parents[2]
LISTS = {
    "imus": "grades",
    "imus tactical": "datasheet",
    "receivers": "receivers",
    "filters": "filters",
    "filters closed-loop": "options",
    "formats": "formats",
    "doctor": "installation",
}
"""{command that lists something: key of what it lists}."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A short drive as a file."""
    path = tmp_path_factory.mktemp("output") / "drive.nc"
    sd.write_recording(given_files.car().between(0.0, 60.0), path)
    return path


@pytest.fixture(scope="module")
def documented():
    """Names of the document in the page on the command line."""
    text = (ROOT / "docs/how-to/cli.md").read_text("utf-8")
    table = text[text.index("| key | of | holds |") :]
    return set(re.findall(r"`(\w+)`", table))


# ---- one document


@pytest.mark.parametrize("line, key", LISTS.items())
def test_every_list_is_a_document(line, key, good):
    document = json.loads(good(*line.split(), "--json"))
    assert document["command"] == line.split()[0] and document["strapdown"] == sd.__version__
    assert document[key]


def test_the_document_of_a_solution(drive, good, documented, tmp_path):
    out = tmp_path / "out"
    words = ("fuse", drive, "--hide", "30:40", "--out", out, "--json")
    document = json.loads(good(*words))
    assert document["verdict"]["word"] in ("trusted", "doubtful", "not judged", "not to be trusted")
    assert {"reasons", "untested", "bounds"} < document["verdict"].keys()
    solution = sd.read_solution(out / "solution.nc")
    counts = {name: list(each.values()) for name, each in document["fixes"].items()}
    assert counts == {name: list(each) for name, each in solution.counts().items()}
    assert document["fixes_withheld"] > 0
    assert document["outages"][0]["horizontal_max_m"] > 0
    (errors,) = document["rms_errors"].values()
    assert len(errors["position_ned_m"]) == 3
    assert sorted(document["written"]) == sorted(str(path) for path in out.iterdir())
    assert document.keys() <= documented


def test_the_document_of_an_inspection(drive, command, documented, tmp_path):
    """It is there with the exit code of what is wrong, too."""
    whole = sd.read(drive)
    path = tmp_path / "in-degrees.nc"
    imu = whole.imu._replace(dtheta=57.3 * whole.imu.dtheta)
    sd.write_recording(replace(whole, imu=imu), path)
    for name, ended in ((drive, 0), (path, 3)):
        code, out, _ = command("inspect", name, "--json")
        document = json.loads(out)
        assert code == ended and document["facts"] and bool(document["problems"]) == (code == 3)
        assert document.keys() - {"path"} <= documented


def test_the_document_has_what_a_simulation_wrote(good, documented, tmp_path):
    path = tmp_path / "made.nc"
    words = ("simulate", "static", "--duration", "5", "--out", path, "--json")
    document = json.loads(good(*words))
    assert document["written"] == [str(path)] and document["imu_samples"] > 100
    assert document.keys() <= documented


def test_bad_input_leaves_standard_output_empty(command, tmp_path):
    code, out, lines = command("fuse", tmp_path / "none.nc", "--json")
    assert (code, out, len(lines)) == (2, "", 1)


def test_numbers_that_are_not_known_are_null():
    import numpy as np
    import pandas as pd

    values = {"a": np.array([1.0, np.nan]), "b": float("inf"), "c": pd.DataFrame({"x_m": [np.nan]})}
    assert output.plain(values) == {"a": [1.0, None], "b": None, "c": [{"x_m": None}]}


# ---- the verdict alone


def test_quiet_leaves_the_verdict(drive, good, tmp_path):
    out = good("fuse", drive, "--quiet", "--out", tmp_path / "out")
    assert re.fullmatch(r"verdict: [a-z ]+\n", out)
    assert (
        good("simulate", "static", "--duration", "5", "--out", tmp_path / "a.nc", "--quiet") == ""
    )


def test_what_was_written_is_the_last_line(drive, good, tmp_path):
    for words in (
        ("fuse", drive, "--diagnose", "--out", tmp_path / "out"),
        ("simulate", "static", "--duration", "5", "--out", tmp_path / "a.nc"),
    ):
        lines = good(*words).splitlines()
        assert [line for line in lines if line.startswith("wrote ")] == lines[-1:]


def test_not_tested_is_said_once(capsys):
    untested = [Untested("clock", "no turns"), Untested("mounting", "no constraint")]
    console.print_verdicts({"": Verdict.of([], untested)})
    one = capsys.readouterr().out
    console.print_verdicts(
        {"a": Verdict.of([], untested[:1]), "b": Verdict.of([], untested), "c": Verdict("doubtful")}
    )
    several = capsys.readouterr().out
    for text in (one, several):
        assert text.count("not tested") == 1 and "clock" in text and "mounting" in text


# ---- what fits a terminal


class Terminal(io.StringIO):
    """Standard output that says it is a terminal."""

    def isatty(self):
        """As of a terminal."""
        return True


@pytest.fixture
def terminal(monkeypatch):
    """Function of columns -> the terminal that standard output is from then on."""

    def begin(columns):
        made = Terminal()
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setattr(sys, "stdout", made)
        return made

    return begin


HEADER = ("filter", "position N E D, m", "at the end, m (median, 90 %, largest)", "good for")
ROWS = [
    ("closed-loop", "0.689 0.701 0.0566", "12.3 45.6 78.9", "the one to begin with, of any grade"),
    ("a-filter-with-a-very-long-name", "1 2 3", "-", "comparing where biases are kept"),
]


@pytest.mark.parametrize("columns", [40, 60, 80, 120, 200])
def test_a_table_fits_and_breaks_no_word(columns, terminal):
    out = terminal(columns)
    output.table(HEADER, ROWS)
    text = out.getvalue()
    assert max(map(len, text.splitlines())) <= columns
    words = {word for row in [HEADER, *ROWS] for cell in row for word in cell.split()}
    shown = {word.strip(":") for word in text.split()}
    assert {word.strip(":") for word in words} - shown <= {HEADER[0]}  # a list has no name for it


def test_numbers_stay_in_one_line(terminal):
    for columns in (80, 120):
        out = terminal(columns)
        output.table(HEADER, ROWS)
        assert "0.689 0.701 0.0566" in out.getvalue() and "12.3 45.6 78.9" in out.getvalue()


def test_a_pipe_has_each_row_in_one_line(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    output.table(HEADER, ROWS)
    assert len(capsys.readouterr().out.splitlines()) == 2 + len(ROWS)


def test_colour_is_for_terminals_that_show_it(terminal, monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    for term, coloured in (("xterm-256color", True), ("dumb", False)):
        monkeypatch.setenv("TERM", term)
        out = terminal(80)
        console.print_verdicts({"": Verdict("trusted")})
        assert ("\x1b[" in out.getvalue()) == coloured


def on_terminal(columns, *words):
    """Lines of a command on a pseudo-terminal."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    given = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "LINES")}
    source = str(Path(sd.__file__).parents[1])
    path = f"{source}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    process = subprocess.Popen(
        [sys.executable, "-m", "strapdown", *map(str, words)],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env={**given, "PYTHONPATH": path, "NO_COLOR": "1"},
    )
    os.close(theirs)
    content = b""
    try:
        while part := os.read(ours, 65536):
            content += part
    except OSError:  # its end, on Linux
        pass
    os.close(ours)
    assert process.wait() == 0, content
    return content.decode().splitlines()


@pytest.mark.parametrize("columns", [40, 80, 120])
@pytest.mark.parametrize("line", ["imus", "filters", "formats", "receivers", "imus VN-100"])
def test_lists_fit_a_terminal(columns, line):
    lines = on_terminal(columns, *line.split())
    # a name that is longer than the terminal stays whole
    assert len(lines) > 3
    assert all(len(each) <= columns or " " not in each.strip() for each in lines)


@pytest.mark.parametrize("columns", [40, 80])
def test_an_inspection_fits_a_terminal(columns, drive, tmp_path):
    lines = on_terminal(columns, "inspect", drive)
    name = str(drive)
    assert max(len(line) for line in lines if name not in line) <= columns


# ---- an output without UTF-8


def test_signs_are_spelt_where_the_output_has_none():
    stream = io.TextIOWrapper(io.BytesIO(), "ascii")
    output.spell_for(stream)
    print("3σ ± 2°, m/s², café", file=stream, flush=True)
    assert stream.buffer.getvalue() == b"3 sigma +- 2 deg, m/s^2, caf\\xe9\n"


def test_a_solution_without_utf_8(drive, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "strapdown", "fuse", drive, "--out", tmp_path / "out"],
        env={**os.environ, "PYTHONIOENCODING": "ascii", "LC_ALL": "C"},
        capture_output=True,
    )
    assert done.returncode == 0 and b"\\" not in done.stdout and b"verdict" in done.stdout
