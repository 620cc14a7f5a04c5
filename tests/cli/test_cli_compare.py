"""The command compare, as a user types it: what it prints and writes, and bad input in one line
with exit code 2."""

from html import escape

import numpy as np
import pandas as pd
import pytest
import recordings
from synthetic import TRUSTED, WRONG

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.compare import labels

pytestmark = pytest.mark.short
FILES = ["growth.csv", "index.html", "paired.csv", "scores.csv", "summary.csv", "table.csv"]


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A folder with a short flight, flight.nc, and the same without its reference, bare.nc."""
    from dataclasses import replace

    folder = tmp_path_factory.mktemp("flights")
    made = recordings.flight()
    sd.write_recording(made, folder / "flight.nc")
    sd.write_recording(replace(made, reference=None), folder / "bare.nc")
    return folder


@pytest.fixture
def here(flights, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in flights.iterdir():
        (tmp_path / path.name).symlink_to(path)
    return tmp_path


def test_a_list_is_compared_printed_and_written(here, command):
    chosen = "--filters", "closed-loop,open-loop:kinematics=metres", "--filters", "fixed-gain"
    code, out, err = command(
        "compare", "flight.nc", *chosen, "--outages", "8:11,14:17", "--out", "made"
    )
    assert (code, err) == (0, []) and sorted(
        path.name for path in (here / "made").iterdir()
    ) == FILES
    lines = out.splitlines()
    assert "2 outages of a list, all in one run, without position and velocity" in lines
    at = lines.index("RMSE N E D in each outage, m")
    assert lines[at + 1].split() == [
        "outage",
        "from-to,",
        "s",
        "closed-loop",
        "open-loop:kinematics=metres",
        "fixed-gain",
    ]
    scores = pd.read_csv(here / "made" / "scores.csv")
    first = scores[(scores["filter"] == "closed-loop") & (scores["outage"] == 2)].iloc[0]
    shown = lines[at + 4].split()
    expected = [first[f"{axis}_rmse_m"] for axis in ("north", "east", "down")]
    assert shown[:2] == ["2", "14-17"] and [float(text) for text in shown[2:5]] == pytest.approx(
        expected, rel=0.01
    )
    summary = pd.read_csv(here / "made" / "summary.csv").set_index("filter")
    row = next(line for line in lines if line.startswith("closed-loop "))
    assert row.split()[1:5] == ["3", "2", "of", "2"]
    assert float(row.split()[8]) == pytest.approx(
        summary.horizontal_rmse_median_m["closed-loop"], rel=0.01
    )
    assert any(
        line.startswith(
            "fixed-gain was not scored in any of 2 outages: fixed-gain needs attitude aiding"
        )
        for line in lines
    )
    assert (
        lines[-1]
        == "wrote made/index.html, scores.csv, summary.csv, paired.csv, growth.csv, table.csv"
    )
    html = (here / "made" / "index.html").read_text()
    assert "fixed-gain was not scored in any of 2 outages" in html
    assert (
        escape(next(line for line in lines if "horizontal RMSE" in line and "2 outages" in line))
        in html
    )


def test_verdicts_come_first_and_decide_the_strict_exit_code(here, command, monkeypatch):
    """A filter that cannot run has none."""
    known = {"closed-loop": TRUSTED, "open-loop": WRONG, "mekf": TRUSTED}
    monkeypatch.setattr(
        "strapdown.verdict.judge.judge", lambda solution: known[solution.meta["filter"]]
    )
    words = "--filters", "closed-loop,open-loop,fixed-gain,mekf", "--outages", "8:11,14:17"
    code, out, err = command("compare", "flight.nc", *words, "--out", "made", "--strict")
    lines = out.splitlines()
    assert lines[0] == "verdict on open-loop: not to be trusted"
    assert lines[1].startswith("  axes of the IMU:")
    assert lines[2] == "  also: time stamps of gnss velocity, description of the IMU"
    assert lines[3:5] == ["verdict on closed-loop, mekf: trusted", "  not tested: heading"]
    assert code == 3 and "not trusted" in err[0] and (here / "made" / "table.csv").exists()
    html = (here / "made" / "index.html").read_text()
    assert html.index("Not to be trusted") < html.index("<strong>Trusted") < html.index("<section")
    known["open-loop"] = TRUSTED
    code, out, err = command("compare", "flight.nc", *words, "--out", "made", "--strict")
    assert (code, err) == (0, []) and out.startswith("verdict on all 3: trusted\n")


@pytest.mark.parametrize("outages", ["8:11,14:17", "3@8:15/2"])
def test_a_verdict_is_on_the_run_to_the_end_with_rows_by_the_second(monkeypatch, outages):
    """In one run without what is withheld, in a sweep with all fixes."""
    judged = []

    def judge(solution):
        judged.append(solution)
        return TRUSTED

    monkeypatch.setattr("strapdown.verdict.judge.judge", judge)
    recording = recordings.flight()
    found = sd.compare(recording, ["closed-loop"], outages=outages)
    ((label, verdict),), (solution,) = found.verdicts.items(), judged
    assert (label, verdict) == ("closed-loop", TRUSTED)
    seen = recording if found.sweep else recording.hidden(found.windows)
    whole = sd.fuse(seen, start=sd.InitialState(**found.settings["start"]))
    np.testing.assert_array_equal(solution.innovations.nis, whole.innovations.nis)
    assert solution.t[-1] == recording.span[1] and 0.9 < np.diff(solution.t[:-1]).max() < 1.1
    assert len(solution.recording.sources) == len(recording.sources)


def test_it_is_what_python_finds(here, command):
    command(
        "compare",
        "flight.nc",
        "--filters",
        "closed-loop",
        "--outages",
        "8:11",
        "--kinds",
        "position",
        "--out",
        "made",
    )
    found = sd.compare(sd.read("flight.nc"), ["closed-loop"], outages="8:11", kinds=("position",))
    shown = pd.read_csv(here / "made" / "scores.csv")
    np.testing.assert_allclose(
        shown["horizontal_rmse_m"], found.scores["horizontal_rmse_m"], rtol=1e-8
    )
    both = sd.compare(sd.read("flight.nc"), ["closed-loop"], outages="8:11")
    assert abs(both.scores["horizontal_rmse_m"][0] / shown["horizontal_rmse_m"][0] - 1) > 1e-3


def test_a_sweep_of_a_part_in_the_folder_of_its_name(here, command):
    others = "--outages", "2,4@8:16/1", "--to", 17, "--imu", "industrial"
    code, out, err = command("compare", "flight.nc", "--filters", "closed-loop,open-loop", *others)
    (folder,) = (path for path in here.iterdir() if path.is_dir())
    assert (
        (code, err) == (0, [])
        and folder.name == "turning-compare"
        and sorted(path.name for path in folder.iterdir()) == FILES
    )
    assert (
        "each in" not in out
        and "RMSE N E D in each outage" not in out
        and "7 outages of 2 s" in out
        and "5 outages of 4 s" in out
    )
    assert "industrial" in (folder / "index.html").read_text()


LISTED = ("flight.nc", "--outages", "8:11")


@pytest.mark.parametrize(
    "words, said",
    [
        ((*LISTED, "--filters", "closd-loop"), "did you mean 'closed-loop'"),
        ((*LISTED, "--filters", "open-loop:kind=1"), "kind"),
        ((*LISTED, "--filters", "kinematics=metres"), "belongs to no filter"),
        ((*LISTED, "--filters", ","), "names no filter"),
        ((*LISTED, "--filters", "mahony"), "mahony estimates no position"),
        ((*LISTED, "--kinds", "positron"), "positron"),
        ((*LISTED, "--kinds", ""), "kinds is empty"),
        (("flight.nc", "--outages", "8-11"), "8-11"),
        (("flight.nc",), "an outage of 30 s is longer than the recording"),
        (("flight.nc", "--outages", "8:11,10:13"), "overlap"),
        (("flight.nc", "--outages", "8:50"), "outage"),
        ((*LISTED, "--imu", "tactcal"), "did you mean 'tactical'"),
        ((*LISTED, "--from", "30"), "30"),
        (("nothing.nc",), "nothing.nc"),
        ((*LISTED, "--filters", "direct-ahrs", "--ahrs", "closed-loop"), "closed-loop"),
        ((*LISTED, "--filters", "closed-loop", "--ahrs", "nope"), "'nope', which is not an AHRS"),
        ((*LISTED, "--filters", "mekf,mekf:"), "twice"),
        (("flight.nc", "--outages", "1e-8/2e-8"), "more than 5000 windows"),
    ],
)
def test_bad_words_are_one_line_and_leave_nothing(here, command, words, said):
    before = sorted(here.iterdir())
    code, out, err = command("compare", *words)
    assert (
        (code, out) == (2, "")
        and len(err) == 1
        and err[0].startswith("strapdown: ")
        and said in err[0]
    ), err
    assert sorted(here.iterdir()) == before


def test_options_stay_with_their_filter():
    assert labels(None) is None and labels(["a, b"]) == ["a", "b"]
    assert labels(["a,b:x=1,y=2,c", "d:z=q"]) == ["a", "b:x=1,y=2", "c", "d:z=q"]
    assert labels(["a:x=1:2,y=3:4"]) == ["a:x=1:2,y=3:4"]
    for wrong in (["a,x=1"], ["b:x=1", "y=2"], [","]):
        with pytest.raises(DataError, match="--filters"):
            labels(wrong)
