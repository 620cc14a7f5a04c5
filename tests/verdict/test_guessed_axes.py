"""Axes that a draft guessed: the motion confirms them, contradicts them, or leaves the solution
doubtful until the user does."""

import re
from dataclasses import replace

import numpy as np
import pytest
from walking import RTK, robot, tables

import strapdown as sd
from strapdown.data.verdict import DOUBTFUL
from strapdown.io.inspection import draft, inspect


@pytest.fixture(scope="module")
def dim():
    """Its fixes are too noisy, 1.5 m once a second, for a course at its speed."""
    return robot(4101, RTK._replace(position_std=1.5, interval=1.0))


def drafted(paths, folder):
    """The description that a draft of the tables is, of a consumer IMU."""
    path = folder / "recording.toml"
    path.write_text(draft(paths, {}, folder).replace('# grade = "consumer"', 'grade = "consumer"'))
    return path


def written_in(path, line):
    """The description with this line in place of that of its axes."""
    path.write_text(re.sub(r"(?m)^axes = .*$", line, path.read_text(), count=1))
    return path


def line_of(text):
    """The line of recording.toml that a message names."""
    return re.search(r'in \[imu\] of recording\.toml: (axes = "\w+")$', text)[1]


@pytest.mark.parametrize("seed", [4102, 4103])
def test_a_guess_that_the_motion_contradicts_is_named_with_the_line_that_mends_it(tmp_path, seed):
    recording = robot(seed)
    path = drafted(tables(recording, "RFU", tmp_path), tmp_path)
    assert 'axes = "FLU?"' in path.read_text()
    verdict = sd.fuse(sd.read(path)).verdict
    assert not verdict.trusted and verdict.reasons[0].cause == "axes", str(verdict)
    assert any("axes of the IMU" in problem for problem in inspect(path).problems)
    line = line_of(verdict.reasons[0].remedy)
    assert line == 'axes = "RFU"'
    solution = sd.fuse(sd.read(written_in(path, line)))
    assert solution.verdict.trusted, str(solution.verdict)
    off = sd.errors(solution, recording.reference).attitude[-1, 2]
    assert abs(np.degrees(off)) < 5.0


@pytest.mark.parametrize("seed", [4104, 4105])
def test_a_guess_that_the_motion_confirms_is_trusted(tmp_path, seed):
    path = drafted(tables(robot(seed), "FLU", tmp_path), tmp_path)
    verdict = sd.fuse(sd.read(path)).verdict
    assert verdict.trusted, str(verdict)
    assert not any(
        "axes" in line for line in (*inspect(path).problems, *inspect(path).inconclusive)
    )


def test_a_guess_that_no_motion_tests_is_doubtful_until_confirmed(tmp_path, dim):
    paths = tables(dim, "FLU", tmp_path)
    path = drafted(paths, tmp_path)
    for given in (sd.read(path), sd.read(*paths)):
        verdict = sd.fuse(given, imu="consumer").verdict
        assert verdict.word == DOUBTFUL, str(verdict)
        (reason,) = verdict.reasons
        assert "only the position can be trusted" in reason.seen
        assert line_of(reason.remedy) == 'axes = "FLU"'
    assert any("is a guess" in line for line in inspect(path).inconclusive)
    stated = sd.fuse(sd.read(written_in(path, line_of(reason.remedy)))).verdict
    assert stated.trusted, str(stated)


def test_a_guess_survives_its_file(tmp_path, dim):
    recording = sd.read(*tables(dim, "FLU", tmp_path))
    sd.write_recording(recording, tmp_path / "kept.nc")
    assert sd.read(tmp_path / "kept.nc").meta["guessed_axes"] == "FLU"


def test_a_multicopter_cannot_test_its_axes(dim):
    guessed = {**dim.meta, "guessed_axes": "RFU", "vehicle": "multicopter"}
    verdict = sd.fuse(replace(dim, meta=guessed)).verdict
    assert verdict.word == DOUBTFUL and line_of(verdict.reasons[0].remedy) == 'axes = "RFU"'
