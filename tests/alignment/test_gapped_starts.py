"""Starts of recordings with gaps of IMU samples: an empty window says nothing, and nothing is carried
across a gap."""

import numpy as np
import pytest
from gapped import gapped, whole, with_sources
from recordings import at_rest, without_samples

import strapdown as sd
from strapdown.alignment.course_heading import courses, heading_of
from strapdown.alignment.first_fixes import position_and_velocity
from strapdown.alignment.initial_heading import mean_force
from strapdown.alignment.rest import rests
from strapdown.geometry.geodesy import wrap
from strapdown.preprocessing.unbroken import (
    is_covered,
    is_unbroken,
    nearest_felt,
    unbroken_stretches,
)

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


@pytest.mark.parametrize("seed", range(40))
def test_random_gaps_leave_a_start_that_is_honest(seed):
    """Of a tactical IMU. Angles off by more than 4.5 of their standard deviations are one in 1.5e5 of
    a consistent start; 40 starts have 120 angles, so a false alarm is one in 1200 runs."""
    recording = gapped(seed, "tactical")
    start = sd.align(recording, sd.imu("tactical"))
    assert is_covered(recording.imu, np.array([start.t])).all()
    k = int(np.argmin(np.abs(recording.reference.t - start.t)))
    off = np.abs(wrap(np.array(start.rph) - recording.reference.rph[k]))
    assert (off < 4.5 * np.array(start.std[6:9])).all()


@pytest.mark.parametrize("grade", ["consumer", "navigation"])
@pytest.mark.parametrize("seed", range(100, 124))
def test_random_gaps_and_sources_leave_a_start(seed, grade):
    """With positions, a magnetometer or an altimeter, with and without a position, at any instant."""
    recording, spec = with_sources(gapped(seed), seed), sd.imu(grade)
    at = float(np.random.default_rng(seed).uniform(*recording.span))
    for moment in (None, at):
        for position in (True, False):
            try:
                start = sd.align(recording, spec, at=moment, position=position)
            except sd.DataError as error:
                in_gap = moment is not None and not is_covered(recording.imu, np.array([at])).all()
                assert in_gap and f"cannot start at {at:g} s, in a gap of the IMU" in str(error)
            else:
                assert np.isfinite([*start.lla, *start.v_n, *start.rph, *start.std]).all()


def test_stretches_end_at_gaps_and_not_at_single_lost_samples():
    made = without_samples(at_rest(20.0, 20.0), (3.0, 3.05), (5.0, 7.0), (11.0, 11.45))
    assert made.imu.t[unbroken_stretches(made.imu)[:, 0]].tolist() == [0.05, 7.05]
    inside = is_covered(
        made.imu, np.array([-1.0, 0.0, 3.02, 5.0, 5.01, 6.99, 7.0, 11.2, 20.0, 20.1])
    )
    assert inside.tolist() == [False, True, True, True, False, False, True, True, True, False]
    assert nearest_felt(made.imu, 5.6)[1] == 5.0 and nearest_felt(made.imu, 6.4)[1] == 7.0
    assert is_unbroken(made.imu, 3.0, 5.0) and not is_unbroken(made.imu, 4.0, 8.0)


def test_an_empty_window_has_no_mean_force():
    """Nor has one that samples cover by less than four fifths."""
    made = without_samples(at_rest(20.0, 20.0), (5.0, 7.0))
    found = [mean_force(made, 6.0, np.zeros(3), (6.5 - w, 6.5 + w)) for w in (0.4, 2.0, 4.0, 5.5)]
    assert [force is None for force in found] == [True, True, True, False]
    assert np.linalg.norm(found[-1].f) == pytest.approx(9.81, abs=0.01)


def test_the_level_of_a_rest_is_not_carried_across_a_gap():
    """A car that stood until 19 s drives on a slope when samples come back."""
    recording, spec = whole("car", 0, "tactical"), sd.imu("tactical")
    assert "level from the standstill" in sd.align(recording, spec, at=26.0).note
    made = without_samples(recording, (19.0, 24.0))
    start = sd.align(made, spec, at=26.0)
    assert "level from the standstill" not in start.note and start.std[6] > np.radians(2.0)
    # the rest tells the bias of the gyros all the same
    assert rests(made, 26.0).before


def test_a_rest_ends_where_samples_do():
    made = without_samples(at_rest(40.0, 20.0), (10.0, 25.0))
    found = rests(made, 30.0)
    assert [made.imu.t[run[[0, -1]]].tolist() for run in found.before] == [
        [0.05, 10.0],
        [25.05, 40.0],
    ]
    assert found.until(made.imu, 30.0) == 40.0 and rests(made, 9.0).until(made.imu, 9.0) == 10.0


def test_a_course_before_a_gap_is_no_heading_after_it():
    recording = whole("car", 0, "tactical")
    position, velocity = position_and_velocity(recording)
    found, late = courses(recording.imu, position, velocity), 60.02
    alone = found._replace(**{n: c[found.t < 50.0] for n, c in found._asdict().items()})
    made = without_samples(recording, (50.0, 60.0))
    assert heading_of(alone, recording.imu, late) and heading_of(alone, made.imu, late) is None


@pytest.mark.parametrize("gap", [(20.0, 25.0), (16.0, 36.0), (0.4, 30.0)])
def test_a_start_lies_in_no_gap(gap):
    """Where the first fix, or the best course, does."""
    made = without_samples(whole("car", 3), gap)
    start = sd.align(made, sd.imu("consumer"))
    assert not gap[0] < start.t < gap[1] - 0.01
