"""Recordings with gaps of IMU samples in batch, live, smoothed and judged: none ends in a traceback."""

import numpy as np
import pytest
from gapped import gapped, whole, with_sources
from recordings import events_of, without_samples

import strapdown as sd

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
STARTS = [(20.0, 25.0), (16.0, 36.0), (20.5, 31.0)]
"""Gaps, s, around the instants at which a car that pulls away would be aligned."""


def in_batch_and_live(recording):
    solution = sd.fuse(recording, imu="consumer")
    assert solution.verdict.word and np.isfinite(solution.trajectory.lla).all()
    stream = sd.Stream("closed-loop", imu="consumer", sources=recording.sources)
    for event in events_of(recording):
        stream.step(event)
    stream.finish()
    assert stream.started and stream.verdict.word


@pytest.mark.parametrize("seed", range(200, 206))
def test_random_gaps_in_batch_and_live(seed):
    in_batch_and_live(with_sources(gapped(seed), seed))


@pytest.mark.parametrize("gap", STARTS)
def test_gaps_where_a_start_would_be_in_batch_and_live(gap):
    in_batch_and_live(without_samples(whole("car", 3), gap))


@pytest.mark.parametrize("gap", STARTS[:2])
def test_gaps_where_a_start_would_be_smoothed_and_diagnosed(gap):
    recording = without_samples(whole("car", 3), gap)
    assert len(sd.smooth(recording, imu="consumer").trajectory.t)
    assert sd.diagnose(recording, imu="consumer")
