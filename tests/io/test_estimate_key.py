"""`estimate` in a description: names with their own priors, or priors in the units of tables."""

from math import radians

import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data import calibration_parameters
from strapdown.io import read

pytestmark = pytest.mark.short

WHEEL = """
[[source]]
kind = "speed"
file = "gnss.csv"
time = { column = "t", unit = "s" }
columns = ["vn"]
unit = "m/s"
std = 0.1
estimate = ["scale", "clock"]
"""


def asking(source="", imu="", more=""):
    """The change of a description that adds lines to its first source and to [imu]."""
    return lambda text: (
        text.replace('"std", "std"]\n', f'"std", "std"]\n{source}\n').replace(
            'kind = "rate"\n', f'kind = "rate"\n{imu}\n'
        )
        + more
    )


def test_names_have_their_own_priors(build):
    asked = asking('estimate = ["clock", "lever-arm"]', 'estimate = ["mounting", "scale"]', WHEEL)
    recording = read(build(toml=asked))
    position, velocity, wheel = (dict(a.estimate) for a in recording.sources)
    assert position == {"clock": (0.1,), "lever-arm": (0.5, 0.5, 0.5)} and velocity == {}
    assert wheel == {"scale": calibration_parameters.SCALE.std, "clock": (0.1,)}
    assert recording.meta["estimate"] == {
        "mounting": (0.0, radians(2), radians(2)),
        "gyro-scale": (0.01,) * 3,
        "accel-scale": (0.01,) * 3,
    }


def test_priors_are_in_the_units_of_tables(build):
    source = "estimate = { clock = 0.2, lever-arm = [0.5, 0.0, 1] }"
    recording = read(build(toml=asking(source, "estimate = { mounting = [0, 1, 2.5] }")))
    assert recording.sources[0].estimate == {"clock": (0.2,), "lever-arm": (0.5, 0.0, 1.0)}
    assert recording.meta["estimate"]["mounting"] == pytest.approx((0, radians(1), radians(2.5)))


def test_nothing_is_noted_where_nothing_is_asked_for(build):
    recording = read(build(toml=asking("estimate = []")))
    assert recording.sources[0].estimate == {} and "estimate" not in recording.meta


def test_a_file_of_ones_own_keeps_it(build, tmp_path):
    asked = asking("estimate = { clock = 0.2 }", 'estimate = ["mounting"]')
    recording = read(build(toml=asked))
    sd.write_recording(recording, tmp_path / "kept.nc")
    again = sd.read(tmp_path / "kept.nc")
    assert [a.estimate for a in again.sources] == [{"clock": (0.2,)}, {}]
    assert {name: tuple(prior) for name, prior in again.meta["estimate"].items()} == (
        recording.meta["estimate"]
    )


@pytest.mark.parametrize(
    "source, said",
    [
        (
            '["clok"]',
            "a name is 'clok' (did you mean 'clock'?); it must be one of clock, lever-arm",
        ),
        ('["scale"]', "a name is 'scale'; it must be one of clock, lever-arm"),
        ('["mounting"]', "mounting is of the IMU; name it in the estimate of [imu]"),
        ('"clock"', "'clock'; write a list of names, such as [\"clock\"], or a table"),
        ("[1]", "[1]; write a list of names"),
        ("{ lever-arm = [1, 2] }", "lever-arm has 3 components (forward, right, down), and 2 "),
        ("{ clock = -1 }", "standard deviation of clock is -1 s; it must be a finite number, 0 or"),
        ("{ clock = 3 }", "standard deviation of clock is 3 s; it must be a finite number, 0 or"),
        ("{ clock = true }", "standard deviation of clock is True s"),
        ('{ clock = "x" }', "standard deviation of clock is 'x' s"),
        ("{ lever-arm = 0 }", "all standard deviations of lever-arm are 0; leave it out"),
    ],
)
def test_refusals_at_a_source(build, source, said):
    path = build(toml=asking(f"estimate = {source}"))
    with pytest.raises(DataError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: [[source]] 1 (position) estimate: {said}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "imu, said",
    [
        ('["clock"]', "a name is 'clock'; it must be one of mounting, gyro-scale, accel-scale"),
        ("{ mounting = 60 }", "standard deviation of mounting is 60 deg; it must be a finite"),
        ("{ scale = [0.1, 0.1] }", "gyro-scale has 3 components (forward, right, down), and 2 "),
    ],
)
def test_refusals_at_the_imu(build, imu, said):
    path = build(toml=asking(imu=f"estimate = {imu}"))
    with pytest.raises(DataError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: [imu] estimate: {said}")


def test_a_source_of_which_nothing_can_be_estimated(build):
    more = WHEEL.replace('kind = "speed"', 'kind = "altitude"').replace('"m/s"', '"m"')
    with pytest.raises(DataError, match=r"\(altitude\) estimate: nothing of this source can be"):
        read(build(toml=asking(more=more)))
