"""Stream with parameters of the installation as states: equal to fuse bit for bit, though fixes whose
clock is a state are used later than they hold."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import flight, start
from test_stream import equal, eventful, events_of, play, shuffled

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import Source
from strapdown.engine.installation import with_estimates
from strapdown.engine.stream import Measurement, Sample, Stream

pytestmark = pytest.mark.short

ASKED = {
    "clock": 0.1,
    "GNSS position lever-arm": 0.5,
    "mounting": (0.0, 0.03, 0.03),
    "wheel scale": 0.02,
    "gyro-scale": 0.01,
    "accel-scale": 0.01,
}


def with_wheel(recording):
    """The recording with a wheel that reads 3 % too much, five times a second."""
    truth = recording.reference
    t = np.arange(0.1, truth.t[-1], 0.2)
    forward = truth.rotation.inv().apply(truth.v_n.copy())[np.searchsorted(truth.t, t), 0]
    wheel = Source(
        "speed", t, 1.03 * forward[:, None], np.full((len(t), 1), 0.1), (0.0,) * 3, name="wheel"
    )
    return replace(recording, sources=(*recording.sources, wheel))


def stream_of(recording, begin, **more):
    return Stream("closed-loop", start=begin, imu="tactical", sources=recording.sources, **more)


def test_a_stream_that_estimates_the_installation_is_the_batch_bit_for_bit():
    recording, begin = with_wheel(eventful()), start(flight())
    solution = sd.fuse(recording, start=begin, covariance=True, estimate=ASKED)
    assert solution.covariance.shape[1] == 15 + 2 + 3 + 2 + 1 + 6
    stream = stream_of(recording, begin, lag=0.4, estimate=ASKED)
    play(stream, shuffled(events_of(recording), 0.39))
    assert equal(stream.finish(), solution)
    assert np.array_equal(stream.belief.augmented[:2] != 0, [True, True])
    live = stream.solution
    assert live.columns.keys() == solution.columns.keys()
    for name, values in solution.columns.items():
        assert np.array_equal(live.columns[name], values)
    assert np.array_equal(live.innovations.t, solution.innovations.t)
    assert live.meta["installation"] == solution.meta["installation"]
    assert stream.counts() == list(solution.counts().values())
    # what waits at the end is used by neither
    late = {"late": 0, "twice": 0}
    assert late.items() <= stream.dropped_by.items() | late.items()
    assert stream.dropped == solution.meta["fixes_outside"] > 0


def test_its_recording_has_the_stamps_and_gives_the_same_again():
    recording, begin = with_wheel(eventful()), start(flight())
    stream = stream_of(recording, begin, estimate=ASKED)
    play(stream, events_of(recording))
    live = stream.solution
    for given, kept in zip(recording.sources, live.recording.sources):
        assert np.isin(kept.t, given.t).all() and len(kept.t) >= len(given.t) - 3
    again = sd.fuse(live.recording, imu="tactical", start=begin)
    assert np.array_equal(again.trajectory.lla, live.trajectory.lla)
    assert again.columns.keys() == live.columns.keys()


def test_a_short_history_keeps_stamps_and_values_together():
    recording, begin = with_wheel(eventful()), start(flight())
    short, whole = (stream_of(recording, begin, history=n, estimate=ASKED) for n in (100, 1000))
    for stream in (short, whole):
        play(stream, events_of(recording))
    assert np.array_equal(short.belief.P, whole.belief.P)
    for given, kept in zip(whole.solution.recording.sources, short.solution.recording.sources):
        assert 0 < len(kept.t) < len(given.t)
        assert np.array_equal(kept.t, given.t[-len(kept.t) :])
        assert np.array_equal(kept.y, given.y[-len(kept.t) :], equal_nan=True)


def test_what_aidings_name_themselves_is_estimated_and_an_empty_list_switches_it_off():
    recording, begin = flight(), start(flight())
    asked = with_estimates(recording, ["clock", "lever-arm"])
    for estimate, states in ((None, 1 + 3), ([], 0)):
        stream = stream_of(asked, begin, estimate=estimate)
        play(stream, events_of(recording))
        assert len(stream.belief.augmented) == states


def test_through_its_own_alignment():
    """Fixes that came before the start, and those that still wait at it, are used as in a batch."""
    recording = with_wheel(flight(seconds=25.0))
    stream = stream_of(recording, None, lag=0.2, align_within=5.05, estimate=ASKED)
    play(stream, shuffled(events_of(recording), 0.19))
    belief = stream.finish()
    solution = sd.fuse(
        recording, imu="tactical", start=stream.start, covariance=True, estimate=ASKED
    )
    assert 0 < stream.start.t < 20 and equal(belief, solution)


def test_a_fix_that_belongs_to_the_start_is_not_used_though_it_still_waits():
    recording, begin = flight(), start(flight(), 5.0)
    stream = stream_of(recording, None, align_within=np.inf, estimate=["clock"])
    for event in events_of(recording):
        if stream.newest >= 5.0 and not stream.started:
            stream.begin(begin)
        stream.step(event)
    solution = sd.fuse(recording, start=begin, covariance=True, estimate=["clock"])
    assert stream.counts()[0] == (14, 0) and equal(stream.finish(), solution)


def test_a_look_ahead_leaves_no_trace():
    recording, begin = with_wheel(eventful()), start(flight())
    asked = dict(lag=0.4, estimate=ASKED)
    looking, plain = (stream_of(recording, begin, **asked) for _ in range(2))
    for event in events_of(recording):
        looking.step(event)
        plain.step(event)
        looking.now
    assert np.array_equal(looking.finish().P, plain.finish().P)


def test_a_fix_may_come_as_late_as_it_waits():
    """A fix that comes 0.25 s after its stamp is used where it waits 0.3 s, and one of 0.35 s is
    late, of its stamp."""
    recording, begin = flight(), start(flight())
    position = recording.sources[0]
    for delay, used in ((0.25, True), (0.35, False)):
        stream = Stream(
            "closed-loop", start=begin, imu="tactical", sources=[position], estimate={"clock": 0.1}
        )
        fix = Measurement(3.0, 0, tuple(position.y[2]), tuple(position.std[2]))
        for event in events_of(recording):
            if isinstance(event, Sample) and event.t < 4:
                stream.step(event)
                if abs(event.t - 3.0 - delay) < 1e-6:
                    stream.step(fix)
        assert stream.counts()[0][0] == used
        assert [text for _, text in stream.events if "late row dropped" in text] == [
            "GNSS position: 1 late row dropped, up to 0.35 s behind: set a longer lag"
        ] * (not used)


def test_an_attitude_from_an_ahrs_goes_with_estimates():
    """The AHRS itself estimates nothing; the batch is on the attitudes that it made."""
    recording, begin = flight(), start(flight())
    more = dict(ahrs="attitude-mekf", estimate=["clock"])
    stream = stream_of(recording, begin, **more)
    play(stream, events_of(recording))
    fed = stream.solution.recording
    assert equal(stream.belief, sd.fuse(fed, start=begin, imu="tactical", covariance=True))
    assert "clock error of GNSS position [s]" in sd.fuse(recording, start=begin, **more).columns


def test_refusals_of_a_stream():
    recording, begin = flight(), start(flight())
    for estimate, name, said in (
        (["scale"], "closed-loop", "estimate: no source of the recording has a scale to estimate"),
        (["clock"], "pkf", "pkf cannot estimate clock; these can: "),
        ({"clock": -1}, "closed-loop", "estimate: standard deviation of clock is -1"),
        ({"clock": "large"}, "closed-loop", "estimate: standard deviation of clock is 'large'"),
        ({1: 0.1}, "closed-loop", "estimate is {1: 0.1}; it must be names"),
    ):
        with pytest.raises(DataError, match=said.replace("{", r"\{")):
            Stream(name, start=begin, imu="tactical", sources=recording.sources, estimate=estimate)


def test_what_a_grade_states_of_its_axes_are_states_live_too():
    recording, begin = eventful(), start(flight())
    solution = sd.fuse(recording, imu="dmu10", start=begin, covariance=True)
    assert solution.covariance.shape[1] == 15 + 18
    stream = Stream("closed-loop", start=begin, imu="dmu10", sources=recording.sources, lag=0.4)
    play(stream, shuffled(events_of(recording), 0.39))
    assert equal(stream.finish(), solution)
    assert stream.solution.meta["notes"] == solution.meta["notes"]
