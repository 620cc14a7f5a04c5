"""A stream that replays: it shows the newest state at once, takes late fixes into the past, and is at any
moment what a stream that waits would find by going through everything again."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from around import recording as recorded_flight
from recordings import OPTIONS, flight, start
from test_ahrs import FED
from test_stream import WITH_POSITION, equal, eventful, events_of, play, shuffled, stream_of
from test_stream_installation import ASKED, with_wheel
from test_stream_saved import assert_alike
from test_stream_start import own

import strapdown as sd
from strapdown.checks import DataError
from strapdown.engine.stream import Measurement, Sample, Stream

pytestmark = pytest.mark.short


def late_fixes(recording, by):
    """Its events as they arrive: samples at once, fixes of source k by[k] s late."""
    return sorted(
        events_of(recording),
        key=lambda event: event.t + (by[event.source] if type(event) is Measurement else 0.0),
    )


def assert_newest(replaying, waiting):
    """The state of a stream that replays is what another one finds that goes through all that
    waits."""
    now = waiting.now
    for a, b in zip(replaying.belief[:8], now[:8]):
        assert np.array_equal(a, b, equal_nan=True)


def both(events, new, every=7):
    """(a stream that replays, one that waits) after these events, compared every few of them."""
    replaying, waiting = new(replay=True), new()
    for k, event in enumerate(events):
        belief = replaying.step(event)
        waiting.step(event)
        assert belief is replaying.belief
        if k % every == 0:
            assert_newest(replaying, waiting)
            if type(event) is Sample and waiting.started:
                assert replaying.t >= event.t
    assert (replaying.events, replaying.counts(), replaying.dropped_by) == (
        waiting.events,
        waiting.counts(),
        waiting.dropped_by,
    )
    replaying.finish()
    waiting.finish()
    assert_newest(replaying, waiting)
    assert_alike(replaying, waiting)
    return replaying, waiting


@pytest.mark.parametrize("name", WITH_POSITION)
def test_late_fixes_are_used_at_their_time_and_the_end_is_the_batch(name):
    recording, begin, options = eventful(name), start(flight()), OPTIONS.get(name, {})
    solution = sd.fuse(recording, name, start=begin, covariance=True, options=options)

    def new(**more):
        return stream_of(recording, begin, name, lag=2.0, options=options, **more)

    replaying, _ = both(late_fixes(recording, (0.35, 1.2, 0.1)), new, 11)
    assert equal(replaying.belief, solution) and replaying.dropped == 0
    assert replaying.t == solution.t[-1] and replaying.status == solution.status[-1]


def test_latency_is_that_of_the_samples():
    recording = flight()
    stream = stream_of(recording, lag=2.0, replay=True)
    for event in late_fixes(recording, (0.5, 0.5)):
        stream.step(event)
        if type(event) is Sample:
            assert stream.t == event.t
    assert stream.counts() == [(18, 0), (18, 0)]  # the last 2 s still wait
    stream.finish()
    assert stream.counts() == [(20, 0), (20, 0)]


@pytest.mark.parametrize("seed", range(3))
def test_samples_too_may_come_in_any_order_and_twice(seed):
    recording, begin = eventful(), start(flight())
    events = shuffled([e for e in events_of(recording) for _ in range(2)], 0.39, seed)
    both(events, lambda **more: stream_of(recording, begin, lag=0.4, **more), 3)


def test_fixes_that_are_later_than_the_lag_are_dropped():
    recording = flight()
    replaying, _ = both(
        late_fixes(recording, (0.3, 1.5)), lambda **more: stream_of(recording, lag=1.0, **more)
    )
    assert replaying.dropped_by["late"] > 10


def test_estimated_clocks_and_other_parameters():
    recording, begin = with_wheel(eventful()), start(flight())

    def new(**more):
        asked = {"estimate": ASKED, "adaptive": 5.0, "robust": ["wheel"]}
        return stream_of(recording, begin, lag=1.0, **asked, **more)

    both(late_fixes(recording, (0.35, 0.8, 0.06)), new, 5)


@pytest.mark.parametrize("lag", [0.5, 2.0])
def test_an_ahrs_beside_the_filter(lag):
    flown = recorded_flight()
    by = [0.4, 0.2, 0.3][: len(flown.sources)]

    def new(**more):
        return Stream(FED, imu="tactical", sources=flown.sources, lag=lag, ahrs_rate=5.0, **more)

    both(late_fixes(flown, by), new, 5)


def test_an_ahrs_that_stops():
    flown = recorded_flight()
    begin = sd.align(flown, sd.imu("tactical"))

    def new(**more):
        return Stream(FED, start=begin, imu="tactical", sources=flown.sources, lag=0.5, **more)

    streams, events = (new(replay=True), new()), events_of(flown)
    for stream in streams:
        play(stream, events[:300])
        stream._ahrs.stream._live.belief.C_nb[...] = np.nan
        if stream._replay:
            stream._renew_front()
        play(stream, events[300:])
        (text,) = [text for _, text in stream.events if text.startswith("attitude-mekf")]
        assert text.endswith("no attitude from here on")
    assert_newest(*streams)


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony"])
def test_filters_of_attitude_alone(name):
    hand = sd.simulate("hand-held", seed=3, duration=12.0)

    def new(**more):
        return Stream(name, imu="consumer", sources=hand.sources, lag=0.5, **more)

    both(late_fixes(hand, [0.2] * len(hand.sources)), new)


def test_it_starts_by_itself():
    recording = flight()
    replaying, waiting = both(
        late_fixes(recording, (0.3, 0.3)), lambda **more: own(recording, lag=1.0, **more)
    )
    assert replaying.start == waiting.start


def test_it_goes_on_after_its_end_from_a_file_and_as_a_copy(tmp_path):
    recording, begin = eventful(), start(flight())

    def new(**more):
        return stream_of(recording, begin, lag=1.0, replay=True, **more)

    events = late_fixes(recording, (0.3, 0.4))
    whole, parts = new(), new()
    play(parts, events[:150])
    parts.save(tmp_path / "state")
    restored = new()
    play(restored, events[:10])  # of another life
    restored.restore(tmp_path / "state")
    copied = copy.deepcopy(parts)
    play(whole, events[:150])
    for event in events[150:]:
        for stream in (whole, parts, restored, copied):
            stream.step(event)
        for stream in (parts, restored, copied):
            assert np.array_equal(stream.belief.P, whole.belief.P) and stream.t == whole.t
            assert stream.status == whole.status
    waiting = stream_of(recording, begin, lag=1.0)
    waiting.restore(tmp_path / "state")  # one that waits goes on from it too
    play(waiting, events[150:])
    assert np.array_equal(waiting.now.P, whole.belief.P)
    waiting.finish()
    for stream in (whole, parts, restored, copied):
        stream.finish()
        assert_alike(stream, waiting)
    finished = new()
    play(finished, events[:200])
    assert np.array_equal(finished.finish().P, finished.belief.P)
    late = [event for event in events[200:] if event.t > finished.t]
    play(finished, late)
    assert finished.finish().P.shape == (15, 15)


def test_what_is_shown_is_a_state_of_its_own():
    recording = flight()
    stream = stream_of(recording, lag=1.0, replay=True)
    play(stream, events_of(recording)[:100])
    now = stream.now
    assert not np.shares_memory(now.P, stream.belief.P)
    assert not np.shares_memory(stream._live.belief.P, stream.belief.P)
    assert stream._live.t == pytest.approx(stream.t - 1.0, abs=0.06)


def test_the_states_to_go_back_to_take_little_room():
    recording = flight()
    stream = stream_of(recording, lag=1.0, replay=True)
    for event in events_of(recording):
        stream.step(event)
        assert len(stream._front._marks) <= 11


def test_a_filter_that_stops_says_so_and_the_stream_too():
    recording = flight()
    stream = stream_of(recording, lag=0.5, replay=True)
    events = events_of(recording)
    play(stream, events[:100])
    stream.belief.lla[0] = np.nan
    with pytest.raises(DataError, match="^stream stopped at"):
        play(stream, events[100:110])
    play(stream, events[110:])  # from the state that waits, which is sound
    assert np.isfinite(stream.finish().P).all()


def test_it_needs_a_lag():
    with pytest.raises(DataError, match="^replay needs a lag: .* such as lag=2$"):
        stream_of(flight(), replay=True)
    with pytest.raises(DataError, match="^replay is 1; it must be True or False$"):
        stream_of(flight(), lag=1.0, replay=1)


def test_a_jump_that_comes_late_moves_the_newest_state():
    recording = flight()
    fix = recording.sources[0]
    y = fix.y.copy()
    y[10, 2] += 5.0
    recording = replace(recording, sources=(replace(fix, y=y), recording.sources[1]))
    stream = stream_of(recording, lag=1.0, replay=True)
    for event in late_fixes(recording, (0.6, 0.6)):
        before = stream.belief.lla[2]
        stream.step(event)
        if type(event) is Measurement and event.source == 0 and event.t == fix.t[10]:
            assert abs(stream.belief.lla[2] - before) > 0.1
