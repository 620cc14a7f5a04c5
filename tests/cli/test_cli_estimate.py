"""--estimate of the commands that run filters: what is asked for, and bad input in one line with
exit code 2."""

import numpy as np
import pytest
import recordings

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.console import estimates

pytestmark = pytest.mark.short


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sd.write_recording(recordings.flight(), tmp_path / "flight.nc")
    return tmp_path


def test_names_and_priors_in_the_units_of_tables():
    assert estimates(None) is None and estimates(["none"]) == {}
    assert estimates(["clock, lever-arm", "imu scale"]) == dict.fromkeys(
        ["clock", "lever-arm", "imu scale"]
    )
    found = estimates(["position clock=0.05,mounting=0 1 2", "misalignment=0.5"])
    assert found["position clock"] == 0.05
    assert found["mounting"] == pytest.approx([0, np.radians(1), np.radians(2)])
    assert estimates(["mounting=0/1/2"])["mounting"] == found["mounting"]
    assert estimates(["imu scale=0.05"]) == {"imu scale": 0.05}
    assert found["misalignment"] == pytest.approx(np.radians(0.5))


@pytest.mark.parametrize("smooth", [[], ["--smooth"]])
def test_fuse_estimates_what_is_asked_for(here, command, smooth):
    asked = ["--estimate", "clock=0.05", "--estimate", "gnss Position lever-arm"]
    code, out, err = command("fuse", "flight.nc", *asked, *smooth, "--out", "made")
    assert (code, err) == (0, [])
    assert "clock of GNSS position and GNSS velocity: " in out and ", prior 0.5 m)" in out
    table = sd.read_solution("made/solution.nc").table()
    run = sd.smooth if smooth else sd.fuse
    solution = run(recordings.flight(), estimate={"clock": 0.05, "GNSS position lever-arm": None})
    states = [name for name in solution.columns if "error of" in name]
    assert len(states) == 8
    for name in states:
        np.testing.assert_allclose(table[name], solution.columns[name], rtol=1e-6, atol=1e-9)


def test_what_the_recording_names_is_switched_off(here, command):
    from strapdown.engine.installation import with_estimates

    sd.write_recording(with_estimates(recordings.flight(), ["clock"]), "named.nc")
    for more, there in (([], True), (["--estimate", "none"], False)):
        assert command("fuse", "named.nc", *more, "--out", "made")[0] == 0
        names = sd.read_solution("made/solution.nc").columns
        assert ("clock error of GNSS position [s]" in names) == there


def test_compare_estimates_too(here, command):
    wanted = ["--filters", "closed-loop", "--outages", "8:11,14:17"]
    scores = []
    for more in [], ["--estimate", "clock,lever-arm"]:
        code, out, err = command("compare", "flight.nc", *wanted, *more, "--out", "made")
        assert (code, err) == (0, [])
        scores.append((here / "made" / "scores.csv").read_text())
    assert scores[0] != scores[1]


@pytest.mark.parametrize(
    "asked, said",
    [
        ("clok", "--estimate is 'clok' (did you mean 'clock'?); it must be one of"),
        ("clock=", "--estimate 'clock=': write clock=STD, a standard deviation in s"),
        ("scale=x", "--estimate 'scale=x': write scale=STD, a standard deviation"),
        ("clock=-1", "--estimate: standard deviation of clock is -1.0 s; it must be"),
        ("mounting=0/90/0", "--estimate: standard deviation of mounting is 90.0 deg; it must be"),
        ("lever-arm=1,2,3", "--estimate: 'lever-arm=1' and '2': between the components of one"),
        ("", "--estimate is empty; write names"),
        ("clock,none", "--estimate: none stands alone"),
        ("scale", "estimate: no source of the recording has a scale to estimate"),
        ("roof clock", "estimate: roof has no clock to estimate; these have: GNSS position, GNSS"),
        ("lever-arm=1 2", "--estimate: lever-arm has 3 components (forward, right, down), and 2 "),
    ],
)
def test_bad_input_is_refused_in_one_line(here, command, asked, said):
    code, out, err = command("fuse", "flight.nc", "--estimate", asked)
    assert (code, out, len(err)) == (2, "", 1) and err[0].startswith(f"strapdown: {said}")


def test_a_filter_that_cannot_is_refused(here, command):
    code, _, err = command("fuse", "flight.nc", "--estimate", "clock", "--filter", "pkf")
    assert code == 2 and err[0].startswith("strapdown: pkf cannot estimate clock; these can: ")


def test_priors_are_numbers():
    with pytest.raises(DataError, match="write clock=STD"):
        estimates(["clock=0.1 x"])
