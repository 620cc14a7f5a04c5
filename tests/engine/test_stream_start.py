"""Where a stream starts: by itself from its first samples and fixes, from an InitialState with few fields, as
does fuse."""

import numpy as np
import pytest
from recordings import at_rest, flight, start
from test_stream import events_of, play, stream_of

import strapdown as sd
from strapdown.alignment.missing_fields import missing_fields
from strapdown.checks import DataError
from strapdown.core.loop.contract import InitialState
from strapdown.data.solution import INVALID
from strapdown.engine.stream import Measurement, Stream

pytestmark = pytest.mark.short


def own(recording, name="closed-loop", **more):
    return Stream(name, imu="tactical", sources=recording.sources, **more)


@pytest.mark.parametrize("lag", [0.0, 0.4])
def test_it_starts_by_itself_and_nothing_is_lost(lag):
    recording = flight()
    stream = own(recording, lag=lag)
    for event in events_of(recording):
        belief = stream.step(event)
        if not stream.started:
            assert np.isnan(belief.lla).all() and np.isnan(belief.P).all()
            assert (
                stream.status == INVALID and np.isnan(stream.t) and np.isnan(stream.now.v_n).all()
            )
            assert stream.counts() == [(0, 0), (0, 0)] and stream.start is None
        elif stream.t <= 10.0 + lag:
            assert stream.align() == stream.start
    belief = stream.finish()
    begin = sd.align(recording.between(stop=10.0), sd.imu("tactical"))
    assert stream.start == begin
    batch = sd.fuse(recording, start=begin, covariance=True)
    assert np.array_equal(belief.P, batch.covariance[-1])
    assert np.array_equal(stream.solution.t, batch.t) and stream.solution.events == batch.events
    times = [recording.imu.t, *(a.t for a in recording.sources)]
    before = sum((t <= begin.t + 1e-6).sum() for t in times)
    assert stream.dropped_by["before the start"] == before
    given, used = sum(map(len, times)), len(batch.t) + sum(map(sum, stream.counts()))
    assert sum(stream.dropped_by.values()) == given - used


def test_fixes_of_no_use_are_not_counted_before_the_start():
    """An attitude filter uses no position, and a buffer of 100 samples forgets 50 at a time."""
    recording = flight()
    stream = sd.Stream("attitude-mekf", sources=recording.sources, imu="tactical", history=100)
    for event in events_of(recording):
        stream.step(event)
    assert {why: count for why, count in stream.dropped_by.items() if count} == {
        "before the start": 100
    }


def test_the_source_of_the_heading_need_not_be_one_of_the_filter():
    hand = sd.simulate("hand-held", seed=3, duration=15.0)
    stream = Stream("attitude-mekf", imu="consumer", sources=hand.sources)
    play(stream, events_of(hand))
    assert stream.started and stream.start.t == pytest.approx(0.0, abs=1e-9)
    batch = sd.fuse(hand, "attitude-mekf", imu="consumer", start=stream.start)
    assert np.array_equal(stream.belief.b_g, batch.b_g[-1])


def test_where_nothing_tells_the_heading_it_waits_and_says_what_it_does():
    recording, begun = at_rest(), []
    stream = own(recording, align_within=25.0)
    for event in events_of(recording):
        stream.step(event)
        begun += [event.t] if stream.started and not begun else []
    assert begun == [pytest.approx(30.0)]
    ((t, text),) = [event for event in stream.events if "started" in event[1]]
    assert t == pytest.approx(30.0)
    assert text.startswith("started with incomplete data: ") and "heading unknown" in text


def test_without_a_fix_it_says_that_it_cannot_start_and_goes_on_gathering():
    recording = flight()
    stream = own(recording, align_within=10.0)
    for event in events_of(recording):
        if not (isinstance(event, Measurement) and event.t < 15.0):
            stream.step(event)
    ((t, text),) = stream.events
    assert t == pytest.approx(10.0) and text.startswith("no start yet: no position fix to start")
    assert stream.started and stream.start.t > 14.9
    with pytest.raises(DataError, match="^no position fix to start from"):
        silent = own(recording)
        play(
            silent, [event for event in events_of(recording) if not isinstance(event, Measurement)]
        )
        silent.finish()


def test_gathering_needs_no_more_room_than_the_history():
    recording = at_rest()
    stream = own(recording, align_within=np.inf, history=100)
    play(stream, events_of(recording))
    assert not stream.started and len(stream._gathered.samples) <= 100
    assert len(stream._gathered.fixes) <= 6


def test_it_starts_when_told_to():
    recording = flight()
    stream = own(recording)
    play(stream, events_of(recording)[:120])
    begin = stream.align()
    belief = stream.begin(begin._replace(b_a=(0.01, 0.0, 0.0)))
    assert belief is stream.belief and stream.started and stream.start.b_a == (0.01, 0.0, 0.0)
    play(stream, events_of(recording)[120:])
    batch = sd.fuse(recording, start=stream.start)
    assert np.array_equal(stream.belief.lla, batch.trajectory.lla[-1])
    with pytest.raises(DataError, match="^the stream has started at 1.000 s; begin a new one"):
        stream.begin()
    with pytest.raises(DataError, match="^0 IMU samples are too few to find a start"):
        own(recording).align()


def test_a_short_stream_starts_where_it_is_finished():
    recording = flight()
    stream = own(recording)
    play(stream, events_of(recording)[:160])
    assert not stream.started
    assert np.isfinite(stream.finish().lla).all() and stream.started


# ---- an InitialState with few fields


def test_a_stream_waits_for_what_is_left_open():
    recording = flight()
    truth = start(recording, 5.0)
    few = InitialState(truth.t, lla=truth.lla, rph=truth.rph)
    stream = stream_of(recording, few)
    for event in events_of(recording):
        stream.step(event)
        assert stream.started == (event.t >= 15.0 - 1e-6 and type(event) is sd.Sample) or (
            stream.started and event.t > 15.0
        )
    assert missing_fields(stream.start) == [] and stream.start.t == truth.t
    batch = sd.fuse(recording.between(stop=15.0), start=few)
    assert stream.start == InitialState(**batch.meta["start"])
    whole = sd.fuse(recording, start=stream.start)
    assert np.array_equal(stream.belief.lla, whole.trajectory.lla[-1])


@pytest.mark.parametrize(
    "wrong, text",
    [
        ({"lla": (45.0, 7.0, 300.0)}, r"start: lla is \(45.0, 7.0, 300.0\), in rad; is it in deg"),
        ({"lla": (0.8, 12.0, 300.0)}, "start: lla is .*, in rad; is it in degrees"),
        ({"rph": (1.0, 2.0, 80.0)}, "start: rph is .*, in rad; is it in degrees"),
        ({"rph": (np.nan, np.nan, 54.9)}, "start: heading is 54.9 rad; is it in degrees[?]$"),
        ({"rph": (np.nan, np.nan, np.nan)}, "start: rph is .*; it must be 3 finite numbers"),
        (
            {"lla": tuple(np.array([47.6, 9.3, 500.0]))},
            r"start: lla is \(47.6, 9.3, 500.0\), in rad",
        ),
        (
            {"v_n": (1e9, 0, 0)},
            r"start: v_n is .*; each number is at most 10000 m/s: is it in mm/s[?]",
        ),
        (
            {"b_a": (0, 0, 9.8)},
            r"start: b_a is \(0, 0, 9.8\); each .* at most 5 m/s\^2: does it include gravity",
        ),
        (
            {"b_g": (5, 0, 0)},
            r"start: b_g is \(5, 0, 0\); each number is at most 1 rad/s: is it in d",
        ),
        ({"v_n": ("1", "2", "3")}, "start: v_n is .*; it must be 3 finite numbers"),
        ({"rph": (0.1, np.nan, 1.0)}, "start: rph is .*; it must be 3 finite numbers"),
        ({"v_n": (1.0, 2.0)}, "start: v_n is .*; it must be 3 finite numbers"),
        ({"v_n": "fast"}, "start: v_n is 'fast'; it must be 3 finite numbers"),
        ({"v_n": None}, "start: v_n is None; it must be 3 finite numbers"),
        ({"std": (-1.0,) * 15}, "start: std has -1"),
        ({"t": 99.0}, "cannot start at 99 s; the IMU record covers 0.000 to 20.000 s"),
    ],
)
def test_parts_that_no_filter_can_begin_with_are_refused(wrong, text):
    few = InitialState(2.0)._replace(**wrong)
    with pytest.raises(DataError, match=f"^{text}"):
        sd.fuse(flight(), start=few)
    if "t" not in wrong:
        with pytest.raises(DataError, match=f"^{text}"):
            stream_of(flight(), few)


def test_an_open_start_needs_the_imu():
    with pytest.raises(DataError, match="give imu="):
        Stream("closed-loop", noise=sd.imu("tactical").noise(), sources=flight().sources)


def test_where_the_fixes_have_another_epoch_it_names_the_clock():
    recording = flight()
    stream = own(recording)
    with pytest.raises(DataError) as error:
        for event in events_of(recording):
            stream.step(event._replace(t=event.t + 3600.0) if type(event) is Measurement else event)
        stream.finish()
    text = "GNSS position: fixes are up to 3600 s ahead of the IMU: check both clocks"
    assert str(error.value) == text
    assert stream.dropped_by["after the last sample"] == 40


@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_before_the_start_no_fix_is_late(lag):
    """Fixes come 1 s after their time: the start is that of fixes in time, and only those after
    it that the lag does not wait for are lost."""
    recording, first = flight(), flight().between(stop=9.0)

    def late(whole):
        return sorted(
            events_of(whole), key=lambda e: e.t + (1.02 if type(e) is Measurement else 0.0)
        )

    stream = own(recording, lag=lag)
    play(stream, late(first))
    assert not stream.started and stream.dropped == 0
    stream.finish()
    batch = sd.fuse(first, start=sd.align(first, sd.imu("tactical")))
    assert np.array_equal(stream.belief.lla, batch.trajectory.lla[-1])
    stream = own(recording, lag=lag)
    play(stream, late(recording))
    assert stream.started and stream.dropped_by["late"] > 0
    assert stream.events[-1][1].endswith("set a longer lag")
