"""The command diagnose, and --diagnose of fuse, as a user types them."""

import pytest
from installed import car, wrong

import strapdown as sd


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """A file with a drive whose GNSS is stamped 0.3 s too late."""
    path = tmp_path_factory.mktemp("drives") / "late.nc"
    sd.write_recording(wrong(car(1030, 100.0), "clock", -0.3), path)
    return path


def test_what_is_wrong_is_printed_with_what_to_change(late, command):
    code, out, err = command("diagnose", late)
    lines = out.splitlines()
    assert (code, err) == (0, [])
    assert lines[0].startswith(
        "clock of GNSS position and GNSS velocity: differs from the given value by -0.29"
    )
    assert lines[-3].startswith("to change in recording.toml (")
    assert lines[-1].startswith("  [[source]] 2 (GNSS velocity) time: add -0.")


def test_fuse_diagnoses_after_it_has_written(late, command, tmp_path):
    code, out, _ = command("fuse", late, "--diagnose", "--out", tmp_path / "made")
    lines = out.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("clock of "))
    assert code == 0 and (tmp_path / "made" / "report.html").exists()
    assert lines[at].startswith("clock of GNSS position and GNSS velocity: differs")
    assert lines[-1].startswith("wrote ")


@pytest.mark.short
def test_a_filter_that_cannot_is_refused_in_one_line(late, command):
    code, _, err = command("diagnose", late, "--filter", "ekf")
    assert code == 2 and err == [
        "strapdown: ekf cannot be used to diagnose an installation; these can: closed-loop, "
        "closed-loop-error-bias, mekf, open-loop, periodic-reset"
    ]
