"""`level` of zero-sea-level: the height of mean sea level above the ellipsoid, and of no other
kind."""

import numpy as np
import pytest

from strapdown.checks import DataError
from strapdown.io import read
from strapdown.io.readers.netcdf import write_recording

pytestmark = pytest.mark.short
SEA = '\n[[source]]\nkind = "zero-sea-level"\nrate = 2.0\nstd = 0.8\nlever_arm = [-3.0, 0.5, 1.2]\n'


def with_more(text):
    return lambda toml: toml + text


def test_the_level_is_what_the_heave_is_about(build, tmp_path):
    for line, level in (("", 0.0), ("level = 45.5\n", 45.5), ("level = -28\n", -28.0)):
        recording = read(build(toml=with_more(SEA + line)))
        sea = recording.sources[-1]
        assert (
            sea.kind == "zero-sea-level" and sea.parameters == (-3.0, 0.5, 1.2) and len(sea.t) == 40
        )
        np.testing.assert_array_equal(sea.y, np.full((40, 1), level))
        np.testing.assert_array_equal(sea.std, np.full((40, 1), 0.8))
    write_recording(recording, tmp_path / "sea.nc")
    np.testing.assert_array_equal(read(tmp_path / "sea.nc").sources[-1].y, sea.y)


@pytest.mark.parametrize(
    "change, words",
    [
        (with_more(SEA + "level = nan\n"), "level"),
        (with_more(SEA + 'level = "mean"\n'), "level"),
        (with_more(SEA + "level = 500000.0\n"), r"zero-sea-level\) level: .*12000"),
        (
            with_more(SEA.replace("2.0", "1e6", 1)),
            r"zero-sea-level\) rate: 1e\+06 Hz is more than 10 times the rate of the IMU; give 1000 Hz or less",
        ),
        (
            with_more('\n[[source]]\nkind = "gravity"\nrate = 2.0\nstd = 0.3\nlevel = 45.0\n'),
            "level: gravity takes none; it is the height of mean sea level",
        ),
        (
            lambda toml: toml.replace("std = 0.1\n", "std = 0.1\nlevel = 3.0\n"),
            "level: velocity takes none",
        ),
    ],
)
def test_other_levels_are_refused_in_one_line(build, change, words):
    with pytest.raises(DataError, match=words) as error:
        read(build(toml=change))
    assert "\n" not in str(error.value)


def test_a_level_far_from_the_height_of_the_place_is_said(build):
    place = 'place = { latitude = 47.0, longitude = 8.0, height = 45.0, unit = "deg" }\n'
    notes = lambda level: " ".join(
        read(build(toml=lambda toml: place + toml + SEA + f"level = {level}\n")).meta["notes"]
    )
    assert (
        "zero-sea-level: its level is 0 m, but the height of place is 45 m, 56 standard deviations apart"
        in notes(0.0)
    )
    assert "its level" not in notes(44.0)
