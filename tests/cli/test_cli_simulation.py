"""The commands that simulate, as a user types them: what they print and write, and bad input in
one line with exit code 2."""

import json

import numpy as np
import pytest
from hop import SCENARIO

import strapdown as sd


@pytest.fixture
def hop(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hop.toml").write_text(SCENARIO)
    return tmp_path


def test_a_simulated_recording_is_read_and_fused(hop, command):
    code, out, _ = command("simulate", "hop.toml", "--seed", 4, "--out", "made/hop.nc")
    assert (
        code == 0
        and "simulated 30 s: 600 IMU samples, 30 GNSS position, the truth as reference\n" in out
        and out.endswith("wrote made/hop.nc\n")
    )
    assert len(sd.read("made/hop.nc").reference.t) == 601
    np.testing.assert_array_equal(
        sd.read("made/hop.nc").imu.dv, sd.simulate("hop.toml", seed=4).imu.dv
    )
    code, out, _ = command(
        "fuse", "made/hop.nc", "--imu", "tactical", "--heading", 30, "--out", "fused"
    )
    assert code == 0 and "rms error against the reference" in out
    command("simulate", "hop.toml", "--duration", 10, "--imu", "consumer", "--out", "short.nc")
    assert len(sd.read("short.nc").imu.t) == 200 and sd.read("short.nc").meta["grade"] == "consumer"


def test_a_receiver_by_name_rides_on_the_scenario(hop, command):
    (hop / "mine.toml").write_text("interval_s = 2\nposition_std_m = 0.3\n")
    for gnss, fixes in (("rtk-float", 50), ("mine.toml", 5)):
        code, out, err = command(
            "simulate", "hop.toml", "--gnss", gnss, "--duration", 10, "--out", "short.nc"
        )
        assert code == 0 and f"{fixes} GNSS position" in out
        made = sd.read("short.nc").sources[0]
        assert made.correlated == sd.receiver(gnss).position_correlated
    words = "study", "hop.toml", "--gnss", "sbas", "--filter", "closed-loop", "--runs", 1
    assert command(*words, "--out", "table", "--workers", 1)[0] == 0
    told = json.loads((hop / "table" / "manifest.json").read_text())["cells"][0]["scenario"]["gnss"]
    assert told["position_correlated"] == [[0.4, 0.4, 0.85], 120.0, True]
    code, _, err = command("simulate", "hop.toml", "--gnss", "sbass", "--out", "no.nc")
    assert (code, len(err)) == (2, 1) and "did you mean 'sbas'" in err[0]


def test_what_a_recording_notes_is_printed(hop, command):
    (hop / "silent.toml").write_text(SCENARIO.replace("interval_s = 1", "interval_s = 60"))
    code, out, err = command("simulate", "silent.toml", "--out", "silent.nc")
    assert (code, err) == (
        0,
        [],
    ) and "note: GNSS position: not one fix falls into the recording" in out
    assert sd.read("silent.nc").meta["notes"] == [
        "GNSS position: not one fix falls into the recording; outages, interval and latency leave none"
    ]


def test_a_study_prints_its_table_and_goes_on_where_it_was(hop, command):
    words = (
        "study",
        "hop.toml",
        "--imu",
        "tactical",
        "--filter",
        "closed-loop",
        "--filter",
        "periodic-reset:interval=5",
        "--runs",
        3,
        "--seed",
        2,
        "--out",
        "done",
    )
    code, out, _ = command(*words)
    assert (
        code == 0
        and "1 cell, 2 filters, 3 runs: 0.0036 million filter steps" in out
        and "periodic-reset:interval=5" in out
    )
    table = (hop / "done" / "summary.csv").read_bytes()
    code, again, _ = command(*words)
    assert code == 0 and again == out and (hop / "done" / "summary.csv").read_bytes() == table
    assert json.loads((hop / "done" / "manifest.json").read_text())["seed"] == 2
    assert "<p class=headline>" in (hop / "done" / "index.html").read_text(encoding="utf-8")


def test_figures_are_written_beside_the_page_or_refused_without_a_browser(
    hop, command, monkeypatch
):
    import shutil

    words = "study", "hop.toml", "--runs", 1, "--filter", "closed-loop", "--out", "drawn"
    with monkeypatch.context() as patched:
        patched.setattr(shutil, "which", lambda name: None)
        code, _, err = command(*words, "--figures", "pictures")
        assert code == 2 and "no browser draws them" in err[0] and not (hop / "drawn").exists()
    if shutil.which("chromium"):
        code, out, _ = command(*words, "--figures", "pictures")
        assert code == 0 and "pictures" in out.splitlines()[-1]
        assert (hop / "pictures" / "position-error-hop-tactical.svg").exists()


def test_a_study_draws_an_installation_in_the_units_of_a_user(hop, command):
    label = "closed-loop:estimate=clock+lever-arm"
    given = "clock=0.1, lever-arm=0.5,mounting=0 2 1"
    code, out, _ = command(
        "study",
        "hop.toml",
        "--filter",
        label,
        "--installation",
        given,
        "--runs",
        1,
        "--out",
        "wrong",
    )
    assert code == 0 and label in out
    drawn = json.loads((hop / "wrong" / "manifest.json").read_text())["installation"]
    assert drawn == {
        "clock": [0.1],
        "lever-arm": [0.5] * 3,
        "mounting": pytest.approx([0.0, np.radians(2), np.radians(1)]),
    }
    for given, said in (
        ("clock=", "write clock=STD, a standard deviation in s"),
        ("clock=9", "standard deviation of clock is 9.0 s; it must be"),
        ("", "--installation is empty"),
    ):
        code, _, err = command("study", "hop.toml", "--installation", given, "--out", "x")
        assert code == 2 and said in err[0]


TOML = {
    "negative rate": ("rate_hz = 20", "rate_hz = -20"),
    "too fast": ("speed_m_s = 40", "speed_m_s = 4000"),
    "pole": ("latitude_deg = 48", "latitude_deg = 89.5"),
    "endless": ("duration_s = 30", "duration_s = inf"),
    "unknown key": ("rate_hz", "ratehz"),
}


@pytest.mark.parametrize(
    "name, words",
    [
        ("negative rate", "-20"),
        ("too fast", "faster than 3000 m/s"),
        ("pole", "89.5 deg of latitude"),
        ("endless", "inf"),
        ("unknown key", "did you mean 'rate_hz'"),
    ],
)
def test_impossible_scenarios_are_one_line(hop, command, name, words):
    (hop / "bad.toml").write_text(SCENARIO.replace(*TOML[name]))
    for given in (
        ("simulate", "bad.toml", "--out", "bad.nc"),
        ("study", "bad.toml", "--out", "bad"),
    ):
        code, _, err = command(*given)
        assert code == 2 and len(err) == 1 and err[0].startswith("strapdown: ") and words in err[0]
    assert sorted(path.name for path in hop.iterdir()) == ["bad.toml", "hop.toml"]


@pytest.mark.parametrize(
    "words, said",
    [
        (("simulate", "hopp", "--out", "x.nc"), "'hopp'"),
        (("simulate", "hop.toml", "--out", "x.csv"), "name a file that ends in .nc"),
        (("simulate", "hop.toml", "--imu", "tactcal", "--out", "x.nc"), "did you mean 'tactical'"),
        (("simulate", "hop.toml", "--duration", "0", "--out", "x.nc"), "0.0"),
        (("study", "hop.toml", "--runs", "0", "--out", "x"), "runs is 0"),
        (("reproduce", "hager-bryne", "--runs", "0", "--out", "x"), "runs is 0"),
        (
            ("study", "hop.toml", "--filter", "closd-loop", "--out", "x"),
            "did you mean 'closed-loop'",
        ),
        (("study", "hop.toml", "--workers", "-2", "--runs", "2", "--out", "x"), "workers is -2"),
        (("simulate", "static", "--seed", "-1", "--out", "x.nc"), "seed is -1"),
        (("demo", "--seed", "-1", "--out", "x.html"), "seed is -1"),
        (("simulate", "static", "--duration", "1e12", "--out", "x.nc"), "at most 50 million"),
        (
            (
                "advise",
                "--imu",
                "tactical",
                "--flight",
                "hop.toml",
                "--duration",
                "1min",
                "--quick",
                "--map",
                "--out",
                "x",
            ),
            "leave out one of the two",
        ),
        (
            (
                "advise",
                "--imu",
                "tactical",
                "--flight",
                "hop.toml",
                "--duration",
                "1min",
                "--workers",
                "-2",
                "--out",
                "x",
            ),
            "workers is -2",
        ),
        (("advise", "--imu", "tactical", "--flight", "hop.toml", "--duration", "soon"), "soon"),
        (("advise", "--imu", "tactical", "--flight", "hopp", "--duration", "1h"), "hopp"),
        (
            ("reproduce", "hager", "--out", "x"),
            "nothing to reproduce is called 'hager'; there is: alam, bias-decay, broad, consistency, faults, fossen",
        ),
        (
            ("reproduce", "recordings", "--quick", "--out", "x"),
            "reproduce recordings has no option --quick",
        ),
        (
            ("reproduce", "broad", "--runs", "3", "--out", "x"),
            "reproduce broad has no option --runs",
        ),
        (("reproduce", "broad", "--recordings", ".", "--out", "x"), "no BROAD trials (.npz) there"),
        (
            ("reproduce", "hager-bryne", "--recordings", "x", "--out", "x"),
            "has no option --recordings",
        ),
        (("reproduce", "hager-bryne", "--runs", "-1", "--out", "x"), "-1"),
        (("allan", "nothing.nc"), "nothing.nc"),
        (("allan", "hop.toml"), "hop.toml"),
    ],
)
def test_bad_words_are_one_line_and_leave_nothing(hop, command, words, said):
    code, _, err = command(*words)
    assert code == 2 and len(err) == 1 and said in err[0]
    assert [path.name for path in hop.iterdir()] == ["hop.toml"]


def test_a_folder_keeps_the_study_it_holds(hop, command):
    command("study", "hop.toml", "--runs", 2, "--out", "done")
    code, _, err = command("study", "hop.toml", "--runs", 3, "--out", "done")
    assert code == 2 and "runs is 2 there and 3 here; choose another folder" in err[0]


def test_allan_of_a_record_at_rest(hop, command):
    command("simulate", "static", "--imu", "consumer", "--duration", 120, "--out", "parked.nc")
    code, out, _ = command("allan", "parked.nc", "--from", 5, "--to", 115, "--out", "found")
    assert code == 0 and "white noise" in out and "nearest grade: consumer" in out
    assert sorted(path.name for path in (hop / "found").iterdir()) == [
        "allan-imu.toml",
        "allan.csv",
        "allan.html",
    ]
    assert sd.imu("found/allan-imu.toml").gyro.noise > 0


def test_advice_in_a_few_lines(hop, command):
    code, out, _ = command(
        "advise",
        "--imu",
        "tactical",
        "--flight",
        "hop.toml",
        "--duration",
        "1min",
        "--runs",
        2,
        "--quick",
        "--out",
        "advice",
    )
    words = (
        "advise",
        "--imu",
        "tactical",
        "--flight",
        "hop.toml",
        "--duration",
        "1min",
        "--runs",
        2,
        "--quick",
        "--seed",
        3,
        "--out",
        "advice",
    )
    refused, nothing, err = command(*words)
    assert (
        refused == 2 and nothing == "" and len(err) == 1 and "seed is 0 there and 3 here" in err[0]
    )
    assert (
        code == 0
        and "wrote advice/index.html" in out
        and json.loads((hop / "advice" / "advice.json").read_text())["duration_s"] == 60
    )
