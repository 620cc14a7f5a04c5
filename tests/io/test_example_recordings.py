"""The recording that comes with the package."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.io.example_recordings import FOLDER, example_description
from strapdown.pages.summary import contradictions


def test_the_drive_is_whole_and_has_its_licence():
    drive = sd.example("drive")
    assert sd.examples() == ["drive"] and np.diff(drive.span)[0] == pytest.approx(552, abs=5)
    assert {a.kind for a in drive.sources} == {"position", "velocity"} and drive.reference
    assert "BSD 3-Clause" in (example_description("drive").parent / "LICENSE.txt").read_text()


def test_all_examples_are_small():
    """2 MB at most in the wheel."""
    assert sum(path.stat().st_size for path in FOLDER.rglob("*") if path.is_file()) < 2e6


def test_an_unknown_example_is_named():
    with pytest.raises(sd.DataError, match="name"):
        sd.example("flight")


def test_the_reference_does_not_contradict_the_solution_of_the_drive():
    """Both are of the antenna: a point 5 cm beside it would be beyond three standard deviations."""
    solution = sd.fuse(sd.example("drive"))
    assert not contradictions({"closed-loop": solution.errors()})
