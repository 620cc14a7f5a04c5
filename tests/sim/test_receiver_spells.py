"""A scenario whose receiver goes fixed, float, wrongly fixed and back."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.checks import DataError
from strapdown.geometry.geodesy import displacement

pytestmark = pytest.mark.short
SCENARIO = """duration_s = 120
rate_hz = 20
imu = "consumer"

[motion]
kind = "car"
start = { latitude_deg = 48, longitude_deg = 11, height_m = 500 }
course_deg = 30
legs = [{ duration_s = 6, speed_m_s = 10 }, { duration_s = 120 }]

[gnss]
receiver = "rtk-fixed"
class = "fixed"
spells = [
  { start_s = 20, stop_s = 50, class = "float", receiver = "rtk-float" },
  { start_s = 60, stop_s = 80, off_m = [0.3, -0.4, 0.0] },
  { start_s = 90, stop_s = 100, class = "single", position_std_m = 2.0 },
  { start_s = 105, stop_s = 110, class = "float", receiver = "rtk-float" },
]
"""


def simulated(tmp_path, seed=1, text=SCENARIO):
    (tmp_path / "rtk.toml").write_text(text)
    return sd.simulate(str(tmp_path / "rtk.toml"), seed=seed)


def errors_of(source, recording):
    """(n, 3) m NED, of the antenna, which is the IMU."""
    truth = recording.reference
    rows = np.searchsorted(truth.t, source.t - 1e-6)
    return displacement(source.y, truth.lla[rows])


def test_each_class_is_a_source_with_its_errors(tmp_path):
    recording = simulated(tmp_path)
    found = {a.name: a for a in recording.sources}
    assert list(found) == [
        "GNSS position fixed",
        "GNSS velocity",
        "GNSS position float",
        "GNSS position single",
    ]
    fixed, float_, single = (found[f"GNSS position {n}"] for n in ("fixed", "float", "single"))
    assert {a.receiver for a in (fixed, float_, single)} == {"GNSS"}
    assert (((float_.t >= 20) & (float_.t < 50)) | ((float_.t >= 105) & (float_.t < 110))).all()
    assert len(float_.t) == 175 and len(single.t) == 50 and len(fixed.t) == 600 - 225
    rtk = sd.receiver("rtk-float")
    assert float_.correlated == rtk.position_correlated
    np.testing.assert_allclose(float_.std[0], rtk.position_std)
    assert fixed.correlated == sd.receiver("rtk-fixed").position_correlated
    wrong = (fixed.t >= 60) & (fixed.t < 80)
    off = errors_of(fixed, recording)
    np.testing.assert_allclose(off[wrong].mean(axis=0), [0.3, -0.4, 0.0], atol=0.08)
    assert np.abs(off[~wrong]).max() < 0.15
    assert 1.0 < errors_of(single, recording).std() < 3.0


def test_the_other_sensors_are_as_without_spells(tmp_path):
    """Their random numbers do not depend on the states of the receiver."""
    one, plain = simulated(tmp_path), simulated(tmp_path, text=SCENARIO.partition("class =")[0])
    assert np.array_equal(one.imu.dv, plain.imu.dv)
    velocity = next(a for a in one.sources if a.kind == "velocity")
    assert np.array_equal(velocity.y, plain.sources[1].y)
    fixed, position = one.sources[0], plain.sources[0]
    usual = np.isin(position.t, fixed.t) & ~((position.t >= 60) & (position.t < 80))
    assert np.array_equal(position.y[usual], fixed.y[~((fixed.t >= 60) & (fixed.t < 80))])


def test_a_wrong_fix_is_said(tmp_path):
    solution = sd.fuse(simulated(tmp_path))
    assert any("GNSS position fixed" in text and 60 <= t <= 75 for t, text in solution.events)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('class = "single", position_std_m = 2.0', 'class = "single"', "has no position_std"),
        (", off_m = [0.3, -0.4, 0.0]", "", "name of a class, or how far"),
        ("stop_s = 50", "stop_s = 10", "its end"),
        ('receiver = "rtk-float"', 'receiver = "rtk-floot"', "rtk-float"),
    ],
)
def test_states_that_cannot_be_are_one_line(tmp_path, old, new, words):
    with pytest.raises(DataError) as error:
        simulated(tmp_path, text=SCENARIO.replace(old, new, 1))
    assert words in str(error.value) and "\n" not in str(error.value)
