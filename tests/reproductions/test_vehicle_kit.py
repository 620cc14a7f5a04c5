"""The vehicle kit measured: drives that are what they say, rates counted by hand, and the windows."""

import numpy as np
import pandas as pd
import pytest

from strapdown.preprocessing.stationary import stretches
from strapdown_reproductions.common.write_docs import DOCS, PAGES, mark
from strapdown_reproductions.vehicle_kit import on_drive, rest, slips
from strapdown_reproductions.vehicle_kit.drives import add_slips, drive, wheel_of


@pytest.fixture(scope="module")
def driven():
    return drive(1000, 200.0)


def test_a_drive_stands_moves_and_shakes(driven):
    truth = driven.reference
    speed = np.linalg.norm(truth.v_n, axis=1)
    assert 0.05 < (speed < 0.02).mean() < 0.6 and speed.max() > 8
    wheel = wheel_of(driven)
    off = wheel.y[:, 0] - np.interp(wheel.t, truth.t, speed)
    assert off.std() == pytest.approx(0.05, rel=0.1)
    still = driven.imu.t < 8
    shaking = (driven.imu.dv[still] / driven.imu.dt[still, None]).std(axis=0)
    assert np.linalg.norm(shaking) == pytest.approx(0.15, rel=0.25)


def test_slips_are_where_they_are_said_and_of_their_size(driven):
    bad, found = add_slips(driven, 7, 0.5)
    ratio = (wheel_of(bad).y / wheel_of(driven).y)[:, 0]
    wrong, t = ratio != 1.0, wheel_of(driven).t
    assert len(found) == len(stretches(wrong)) >= 3
    for slip in found:
        its = (t >= slip.start) & (t < slip.stop)
        assert np.allclose(ratio[its], 1 + slip.share) and abs(slip.share) == 0.5
        assert 0.5 <= slip.stop - slip.start <= 5


def test_detection_and_false_alarms(driven):
    large = slips.detection([driven], [7]).iloc[-1]
    assert large["slip"] == "100%" and large["noticed, %"] == large["its fixes left out, %"] == 100
    assert slips.false_alarms([driven], "clean")[2] == 0


def test_rates_of_rest(driven):
    """The detector as it is, and what it would be if the wheels were never asked."""
    alone, with_wheels = (
        rest._rates([driven], [sources], 0.02) for sources in ((), (wheel_of(driven),))
    )
    assert alone[0] == with_wheels[0] > 10 and alone[1] < 5 and with_wheels[1] < 5
    assert with_wheels[3] <= alone[3]
    # of rest, at most a few seconds per hour are taken for it above a creep
    assert with_wheels[3] == 0 or with_wheels[4] == 100


def test_the_kit_was_chosen_on_other_windows_than_those_of_the_figures(data_folder):
    import strapdown as sd
    from strapdown_reproductions.common.example_recordings import DESCRIPTIONS, windows_of

    figures = windows_of(sd.read(DESCRIPTIONS / "drive0708.toml")) + on_drive.OTHERS
    for start, stop in sum(on_drive.CHOSEN_ON, []):
        assert all(stop <= a or start >= b for a, b in figures)


def test_paired_differences_by_hand():
    each = pd.DataFrame(
        [
            ("w", case, start, start + 15, error)
            for case, errors in (("constraints", (2.0, 4.0, 9.0)), ("kit", (1.0, 3.5, 7.0)))
            for start, error in zip((0.0, 50.0, 100.0), errors)
        ],
        columns=["windows", "set-up", "from, s", "to, s", "largest horizontal, m"],
    )
    kit = on_drive.summary(each).set_index("set-up").loc["kit"]
    assert kit["median, m"] == 3.5 and kit["against constraints, m"] == -1.0
    assert kit["from"] == -2.0 and kit["to"] == -0.5


def test_the_page_shows_a_run():
    assert mark("vehicle-kit") in (DOCS / PAGES["vehicle-kit"][1]).read_text(encoding="utf-8")
