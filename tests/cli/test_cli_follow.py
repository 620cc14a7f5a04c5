"""`strapdown fuse --follow`: what it applies, shows and writes, and what it leaves alone."""

from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd


def late_by(seconds, drive):
    changed = (
        replace(a, t=a.t + seconds).between(*drive.span) if a.kind == "velocity" else a
        for a in drive.sources
    )
    return replace(drive, sources=tuple(changed))


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("follow")
    drive = sd.simulate("car", 150.0, "industrial", seed=1)
    drive.save(folder / "right.nc")
    late_by(0.25, drive).save(folder / "late.nc")
    return folder


def test_what_is_found_is_applied_and_the_better_solution_written(drives, command, tmp_path):
    code, out, _ = command(
        "fuse", drives / "late.nc", "--follow", "--strict", "--out", tmp_path / "made"
    )
    assert code == 0
    assert "applied: [[source]] 2 (GNSS velocity) time: add -0.26" in out
    assert (
        "verdict before: not to be trusted; now: trusted" in out
        and "this moves the position" in out
    )
    made = sd.read_solution(tmp_path / "made" / "solution.nc")
    assert made.verdict.trusted and np.isfinite(made.columns["protection horizontal [m]"]).all()


def test_a_right_set_up_is_left_alone(drives, command, tmp_path):
    _, out, _ = command("fuse", drives / "right.nc", "--follow", "--out", tmp_path / "made")
    assert "nothing applied: the diagnosis found nothing wrong with the installation" in out


def test_a_doubted_solution_has_no_protection_levels(drives, command, tmp_path):
    _, out, _ = command("fuse", drives / "late.nc", "--out", tmp_path / "made")
    assert "protection levels" not in out
    made = sd.read_solution(tmp_path / "made" / "solution.csv")
    assert not any("protection" in name for name in made.columns)
