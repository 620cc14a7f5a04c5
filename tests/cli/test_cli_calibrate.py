"""The commands `calibrate` and `calibrate installation`, as a user types them."""

import re

import pytest
from described import TOML, described
from installed import car, wrong

import strapdown as sd


@pytest.fixture(scope="module")
def late():
    return wrong(car(1080, 100.0, vehicle=False), "clock", 0.3)


@pytest.fixture
def drive(late, tmp_path):
    """A recording.toml whose fixes are stamped 0.3 s too early."""
    return described(late, tmp_path)


@pytest.mark.short
def test_help_shows_both(command):
    code, out, err = command("calibrate", "--help")
    assert (code, err) == (0, [])
    assert "--sensor" in out
    assert out.startswith("Usage: strapdown calibrate [OPTIONS] ")
    assert out.splitlines()[1] == ("       strapdown calibrate installation [OPTIONS] RECORDING")
    code, out, _ = command("calibrate", "installation", "--help")
    assert code == 0 and "--write" in out and "--imu-clock" in out


@pytest.mark.short
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "Missing argument 'RECORDING'. See `strapdown calibrate --help`."),
        (["none.toml"], "none.toml: "),
        (["--sensor", "magnetometer", "none.toml"], "none.toml: "),
        (["./installation"], "installation: "),
        (
            ["installation"],
            "Missing argument 'RECORDING'. See `strapdown calibrate installation --help`.",
        ),
    ],
)
def test_every_other_word_is_a_recording(words, said, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, (err,) = command("calibrate", *words)
    assert code == 2 and err.startswith(f"strapdown: {said}")


def test_a_file_is_shown_what_changes_then_changed_then_left(drive, command):
    code, out, err = command("calibrate", "installation", drive)
    lines = out.splitlines()
    assert (code, err) == (0, []) and drive.read_text() == TOML
    said = re.match(
        r"clock of position and velocity: differs from the given value by (\S+) \+- 0.01", lines[0]
    )
    assert said and float(said[1]) == pytest.approx(0.3, abs=0.03)  # 3 of its sigmas
    assert lines[-5] == f"to change in {drive} (--write does it):"
    assert lines[-4].startswith("    14 - time = {") and lines[-3].startswith("    14 + time = {")
    written = re.search(r"offset = (\S+?)[, ]", lines[-1])
    assert written and float(written[1]) == pytest.approx(0.3, abs=0.03)
    code, out, _ = command("calibrate", "installation", drive, "--write")
    kept = drive.with_name("recording.toml.before")
    assert code == 0 and out.splitlines()[-2:] == [f"the old file is {kept}", f"wrote {drive}"]
    assert kept.read_text() == TOML and drive.read_text() != TOML
    written = drive.read_text()
    code, out, _ = command("calibrate", "installation", drive, "--write")
    assert code == 0 and out.splitlines()[-1] == f"nothing to change in {drive}"
    assert drive.read_text() == written


def test_the_clock_of_the_imu_is_changed_where_one_says_so(drive, command):
    code, _, _ = command("calibrate", "installation", drive, "--write", "--imu-clock")
    (line,) = [each for each in drive.read_text().splitlines() if "calibrate inst" in each]
    assert code == 0 and line.startswith('time = { column = "t", unit = "s", offset = -0.')
    assert "# of the logger; offset +- 0.0" in line


def test_what_cannot_be_written_is_said_in_one_line(late, drive, command, tmp_path):
    plain = tmp_path / "late.nc"
    sd.write_recording(late, plain)
    code, out, err = command("calibrate", "installation", plain, "--write")
    assert code == 2 and "  [[source]] 1 (GNSS position) time: add +0." in out
    assert err == [
        f"strapdown: {plain}: only a recording.toml can be changed; change the file that it was made from"
    ]
    drive.chmod(0o444)
    code, out, err = command("calibrate", "installation", drive, "--write")
    assert code == 2 and err == [
        f"strapdown: {drive}: is read-only; make it writable, or change it by hand"
    ]
    assert drive.read_text() == TOML and not list(tmp_path.glob("*.before"))
    code, out, err = command("calibrate", "installation", plain)
    assert (code, err) == (0, [])


def test_an_imu_that_is_missing_is_asked_for_as_an_option(drive, command):
    drive.write_text(TOML.replace('grade = "consumer"\n', ""))
    for words in (["calibrate", "installation"], ["diagnose"]):
        code, _, (err,) = command(*words, drive)
        assert code == 2 and "does not name its IMU: give --imu, one of" in err


def test_a_page_is_written(drive, command, tmp_path):
    code, out, _ = command(
        "calibrate", "installation", drive, "--write", "--out", tmp_path / "page"
    )
    assert code == 0 and f"wrote {drive}; {tmp_path}/page/installation.html" in out
    page = (tmp_path / "page" / "installation.html").read_text()
    assert f"Written: {drive}; the old file is {drive}.before." in page
    assert "To change in recording.toml" not in page and len(page) > 3e5
