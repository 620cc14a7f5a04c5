"""The files of a Tuning: what is written gives what was found, and nothing is overwritten."""

from dataclasses import replace

import numpy as np
import pytest
from described import TOML, described
from installed import car
from tuned import of, tuning

import strapdown as sd
from strapdown.io.noise_file import with_noise


def same_noise(made, wanted):
    for one, other in zip(made.sources, wanted.sources, strict=True):
        np.testing.assert_allclose(one.std, other.std, rtol=1e-3)
        if other.correlated is None:
            assert one.correlated is None
        else:
            assert one.correlated.std == pytest.approx(other.correlated.std, rel=1e-3)
            assert one.correlated[1:] == pytest.approx(other.correlated[1:])


@pytest.fixture(scope="module")
def drive():
    return car(1080, 80.0, vehicle=False)


@pytest.fixture
def read(drive, tmp_path):
    """(recording.toml, what `tune` found in it)."""
    path = described(drive, tmp_path)
    return path, of(sd.read(path), (2.0, 2.0, 2.4))


def test_the_files_give_the_noise_back(tmp_path):
    found = tuning()
    imu, sources = found.write(tmp_path)
    assert [imu.name, sources.name] == ["drive-imu.toml", "drive-sources.toml"]
    assert sd.imu(imu).noise() == found.imu.noise()
    assert "in drive, 0.0 to 80.0 s" in sd.imu(imu).source
    same_noise(with_noise(found.recording, sources), found.tuned)
    assert "std_factor = [2, 2, 2.4]  # 95 % horizontal 1.84 to 2.24 times" in sources.read_text()


def test_they_serve_recordings_of_other_formats(tmp_path):
    found = tuning()
    _, sources = found.write(tmp_path)
    sd.write_recording(found.recording, tmp_path / "drive.nc")
    same_noise(sd.with_noise(sd.read(tmp_path / "drive.nc"), sources), found.tuned)


def test_nothing_is_overwritten_and_nothing_written_in_part(tmp_path):
    found = tuning()
    (tmp_path / "drive-sources.toml").write_text("mine")
    with pytest.raises(sd.DataError, match=r"drive-sources.toml: exists already and is not"):
        found.write(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["drive-sources.toml"]
    assert (tmp_path / "drive-sources.toml").read_text() == "mine"


def test_two_sources_of_one_name_cannot_be_told_apart(tmp_path):
    found = tuning()
    twice = [replace(r, sources=r.sources + r.sources[:1]) for r in (found.recording, found.tuned)]
    with pytest.raises(sd.DataError, match="two sources are called GNSS position"):
        replace(found, recording=twice[0], tuned=twice[1]).write(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_recording_toml_that_was_changed_reads_as_what_was_found(read, tmp_path):
    path, found = read
    shown = found.diff(path)
    assert path.read_text() == TOML
    imu, kept = found.change(path)
    assert (imu, kept.read_text()) == (tmp_path / "recording-imu.toml", TOML)
    again = sd.read(path)
    same_noise(again, found.tuned)
    assert sd.imu(again.meta["grade"]).noise() == found.imu.noise()
    assert "# A drive, with comments that must stay." in path.read_text()
    assert [line[7:] for line in shown if " + " in line[:8]] == [
        line for line in path.read_text().splitlines() if line not in TOML.splitlines()
    ]


def test_a_recording_toml_is_changed_once(read):
    path, found = read
    found.change(path)
    text = path.read_text()
    with pytest.raises(sd.DataError, match="recording-imu.toml: exists already"):
        found.change(path)
    path.with_name("recording-imu.toml").unlink()
    with pytest.raises(
        sd.DataError, match=r"std is .* but the recording was read with .*; read that file"
    ):
        found.change(path)
    assert path.read_text() == text


def test_other_formats_and_other_files_are_refused(read, tmp_path):
    path, found = read
    sd.write_recording(found.recording, tmp_path / "a.nc")
    with pytest.raises(sd.DataError, match=r"a.nc: only a recording.toml can be changed"):
        found.change(tmp_path / "a.nc")
    bare = replace(found, recording=replace(found.recording, meta={"name": "recording"}))
    with pytest.raises(sd.DataError, match="was not read from a recording.toml"):
        bare.change(path)
    path.chmod(0o444)
    with pytest.raises(sd.DataError, match="is read-only"):
        found.change(path)
    assert path.read_text() == TOML and not list(tmp_path.glob("*imu.toml"))
