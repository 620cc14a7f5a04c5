"""The command `tune`, and `--sources`, as a user types them; the estimation has tests of its own."""

import pytest
from described import TOML, described
from installed import car
from tuned import of

import strapdown as sd


@pytest.fixture(autouse=True)
def asked(monkeypatch):
    """What `tune` was asked for; its answer is made up."""
    words = {}

    def tune(recording, filter, **others):
        words.update(others, filter=filter, span=recording.span)
        return of(recording, (2.0, 2.0, 2.4))

    monkeypatch.setattr(sd, "tune", tune, raising=False)
    return words


@pytest.fixture(scope="module")
def drive():
    return car(1080, 80.0, vehicle=False)


@pytest.fixture
def plain(drive, tmp_path, monkeypatch):
    """A recording of another format, in the folder where the commands run."""
    monkeypatch.chdir(tmp_path)
    sd.write_recording(drive, tmp_path / "drive.nc")
    return sd.read("drive.nc").meta["name"]


@pytest.mark.short
def test_help_lists_the_command_among_those_on_sensors(command):
    code, out, _ = command("--help")
    names = [line.split()[0] for line in out.splitlines() if line.startswith("  ")]
    assert code == 0 and names.index("tune") == names.index("calibrate") + 1
    code, out, _ = command("tune", "--help")
    assert code == 0 and all(word in out for word in ("--no-correlated", "--write", "--out"))


def test_files_are_written_and_serve(plain, command, asked, tmp_path):
    code, out, err = command(
        "tune", "drive.nc", "--to", "60", "--no-correlated", "--imu", "consumer"
    )
    folder = f"{plain}-tune"
    assert (code, err) == (0, []) and "3 of 7 numbers are determined by the data" in out
    assert (
        asked["correlated"] is False and asked["span"][1] <= 60 and asked["filter"] == "closed-loop"
    )
    assert out.splitlines()[-2:] == [
        f"to use them: strapdown fuse drive.nc --imu {folder}/{plain}-imu.toml --sources "
        f"{folder}/{plain}-sources.toml",
        f"wrote {folder}/{plain}-imu.toml, {plain}-sources.toml, tune.html",
    ]
    assert (tmp_path / folder / "tune.html").stat().st_size > 3e5


def test_a_file_that_exists_is_refused_before_the_work(plain, command, asked, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / f"{plain}-imu.toml").write_text("mine")
    code, _, err = command("tune", "drive.nc", "--imu", "consumer", "--out", "out")
    assert code == 2 and asked == {}
    assert err == [
        f"strapdown: out/{plain}-imu.toml: exists already and is not overwritten; move it away, or "
        "choose another folder"
    ]
    assert [each.name for each in (tmp_path / "out").iterdir()] == [f"{plain}-imu.toml"]


def test_a_recording_toml_is_changed_in_place(drive, command, tmp_path):
    path = described(drive, tmp_path)
    code, out, err = command("tune", path, "--write")
    assert (code, err) == (0, []) and f"changed in {path}:" in out
    assert out.splitlines()[-3:] == [
        f"the old file is {path}.before",
        f"it names {tmp_path}/recording-imu.toml as grade",
        f"wrote {tmp_path}/recording.toml, recording-imu.toml",
    ]
    assert 'grade = "recording-imu.toml"  # 95 % intervals in that file' in path.read_text()
    assert (tmp_path / "recording.toml.before").read_text() == TOML
    assert not list(tmp_path.glob("*-tune"))


@pytest.mark.parametrize("broken", ["format", "read-only", "imu"])
def test_what_cannot_be_written_is_refused_before_the_work(
    broken, plain, drive, command, asked, tmp_path
):
    path = described(drive, tmp_path)
    if broken == "format":
        path, said = "drive.nc", "only a recording.toml can be changed"
    elif broken == "read-only":
        path.chmod(0o444)
        said = "is read-only"
    else:
        (tmp_path / "recording-imu.toml").write_text("mine")
        said = "exists already"
    code, _, (err,) = command("tune", path, "--write", "--imu", "consumer")
    assert code == 2 and said in err and asked == {}
    assert (tmp_path / "recording.toml").read_text() == TOML
    assert not list(tmp_path.glob("*.before"))


def test_the_noise_of_sources_is_taken_from_a_file(plain, command, tmp_path):
    file = tmp_path / "a-sources.toml"
    words = ["fuse", "drive.nc", "--imu", "consumer", "--to", "40", "--sources", file]
    file.write_text('["GNSS position"]\nstd_factor = 10\n')
    code, _, _ = command(*words, "--out", "wide")
    wide = sd.read_solution("wide/solution.nc").trajectory.std[-1, 0]
    file.write_text('["GNSS position"]\nstd_factor = 1\n')
    assert (code, command(*words, "--out", "same")[0]) == (0, 0)
    assert wide > 3 * sd.read_solution("same/solution.nc").trajectory.std[-1, 0]
    file.write_text('["GPS position"]\nstd_factor = 1\n')
    code, _, (err,) = command(*words, "--out", "none")
    assert code == 2 and "no source of that name (did you mean 'GNSS position'?)" in err
    assert not (tmp_path / "none").exists()


def test_what_tune_refuses_leaves_nothing(plain, command, monkeypatch, tmp_path):
    def refuse(*_, **others):
        raise sd.DataError("the record is too short")

    monkeypatch.setattr(sd, "tune", refuse, raising=False)
    code, _, err = command("tune", "drive.nc", "--imu", "consumer")
    assert (code, err) == (2, ["strapdown: the record is too short"])
    assert [each.name for each in tmp_path.iterdir()] == ["drive.nc"]
