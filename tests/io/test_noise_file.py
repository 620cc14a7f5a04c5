"""Files that change the noise of sources: what they say, and what is refused."""

import numpy as np
import pytest
from flat_noise import RECORDING
from mutated_own import NOISE

import strapdown as sd
from strapdown.data.solution import Correlated
from strapdown.io.noise_file import SourceNoise, read_noise, write_noise

pytestmark = pytest.mark.short


@pytest.fixture
def file(tmp_path):
    return tmp_path / "x-sources.toml"


def test_deviations_are_multiplied_and_errors_that_last_added(file):
    file.write_text(NOISE)
    position, heading = sd.with_noise(RECORDING, file).sources
    np.testing.assert_allclose(position.std, np.tile([1.9, 1.9, 4.8], (2, 1)))
    assert position.correlated == Correlated((1.5, 1.5, 3.0), 30.0, False)
    np.testing.assert_allclose(heading.std, 0.01)
    assert heading.correlated.std == pytest.approx([np.radians(2)])  # deg in the file


def test_sources_that_are_not_named_stay_and_the_file_of_before_is_forgotten(file):
    file.write_text('["heading"]\nstd_factor = 3')
    read = sd.Recording(RECORDING.imu, RECORDING.sources, None, RECORDING.meta | {"installed": {}})
    made = sd.with_noise(read, file)
    assert made.sources[0] is RECORDING.sources[0] and "installed" not in made.meta
    np.testing.assert_allclose(made.sources[1].std, 0.06)


def test_what_is_written_is_read(file):
    noises = {
        'a "b" \\ c': SourceNoise((1.5,), Correlated((0.5,), 20.0), "95 % 1 to 2"),
        "GNSS": SourceNoise((1.0, 1.0, 2.5)),
    }
    write_noise(file, noises, ["by hand"])
    assert file.read_text().startswith("# by hand\n")
    assert read_noise(file) == {name: each._replace(said="") for name, each in noises.items()}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[gnss]\nstd_factor = 2",
            "[gnss]: the recording has no source of that name (did you mean",
        ),
        ("[GNSS]\nstd_factor = 0", "[GNSS] std_factor is 0; it must be a finite number above 0"),
        ("[GNSS]\nstd_factor = [1, 2]", "std_factor: 2 given; position has 3"),
        ("[GNSS]\nfactor = 2", "unknown key 'factor' (did you mean 'std_factor'?)"),
        ("GNSS = 2", "GNSS is 2; write a section [GNSS]"),
        ("[GNSS]\ncorrelated = 3", "write a table of its keys"),
        ("[GNSS]\ncorrelated = { std = 1 }", "time is missing; write time = 30.0, in s"),
        (
            "[GNSS]\ncorrelated = { std = [0], time = 3 }",
            "none is above zero; leave correlated out",
        ),
        ("[GNSS]\ncorrelated = { std = -1, time = 3 }", "std is -1; it must be"),
        ("[GNSS]\ncorrelated = { std = 1, time = 0 }", "time is 0 s; it must be"),
        ("[GNSS", "is not TOML"),
    ],
)
def test_what_is_wrong_is_one_line_that_names_the_file(file, text, said):
    file.write_text(text)
    with pytest.raises(sd.DataError) as caught:
        sd.with_noise(RECORDING, file)
    assert str(caught.value).startswith(f"{file}: ") and said in str(caught.value)


def test_a_name_that_two_sources_have_is_refused(file):
    file.write_text("[GNSS]\nstd_factor = 2")
    twice = sd.Recording(RECORDING.imu, RECORDING.sources[:1] * 2, None, {})
    with pytest.raises(sd.DataError, match="several sources of that name"):
        sd.with_noise(twice, file)
