"""The recording that comes with the package."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.io.example_recordings import FOLDER, example_description


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
