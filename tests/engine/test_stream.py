"""Stream: equal to fuse bit for bit, whatever the order of arrival within the lag; late, missing
and impossible events."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import (
    OPTIONS,
    SWIFT,
    ahrs,
    alike,
    events_of,
    flight,
    position,
    start,
    without_samples,
)

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.core.loop.loop import SAME_TIME
from strapdown.data.solution import BRIDGED, INVALID, VALID
from strapdown.engine import stream as live
from strapdown.engine.prepare import has_position
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.geometry.geodesy import displace_lla

pytestmark = pytest.mark.short


WITH_POSITION = [name for name in SWIFT if has_position(filters.find(name))]


def eventful(name="closed-loop"):
    """Two sources with fixes between samples, two gaps with fixes inside, a rejected fix, a missing
    component and a missing fix.

    With an AHRS where the filter of that `name` needs one.
    """
    recording = without_samples(flight(), (4.8, 5.3), (12.6, 15.1))
    p, v = recording.sources
    y = p.y.copy()
    y[7], y[9, 2] = displace_lla(y[7:8], [[60.0, 0, 0]])[0], np.nan
    p = replace(p, t=p.t - 0.013, y=y)._where(np.arange(len(p.t)) != 16)
    attitude = (ahrs(recording.reference, 2.0),) if filters.find(name).needs else ()
    return replace(recording, sources=(p, replace(v, t=v.t - 0.02), *attitude))


def play(stream, events):
    """Step `stream` through `events`."""
    for event in events:
        stream.step(event)


def stream_of(recording, begin=None, name="closed-loop", **more):
    return Stream(
        name, start=begin or start(recording), imu="tactical", sources=recording.sources, **more
    )


def snapshot(belief):
    return [column.copy() for column in belief[:8]]  # workspace is workspace too


def last_row(solution):
    path = solution.trajectory
    return [path.lla[-1], path.v_n[-1], solution.b_a[-1], solution.b_g[-1]]


def equal(belief, solution):
    """Whether a belief is the last row of a Solution (with covariance) bit for bit, but for what
    the filter does not estimate."""
    return all(
        np.array_equal(a, b) or np.isnan(b).all()
        for a, b in zip([belief.lla, belief.v_n, belief.b_a, belief.b_g], last_row(solution))
    ) and np.array_equal(belief.P, solution.covariance[-1])


def shuffled(events, lag, seed=5):
    """The events in the order in which they arrive when each is late by up to `lag` s."""
    late = np.random.default_rng(seed).uniform(0, lag, len(events))
    return [
        events[i]
        for i in np.argsort([event.t + d for event, d in zip(events, late)], kind="stable")
    ]


@pytest.mark.parametrize("name", WITH_POSITION)
def test_a_stream_is_the_batch_bit_for_bit(name):
    recording, begin, options = eventful(name), start(flight()), OPTIONS.get(name, {})
    solution = sd.fuse(recording, name, start=begin, covariance=True, options=options)
    gated = bool(filters.find(name).states)
    counts = {"GNSS position": (18 + (not gated), int(gated)), "GNSS velocity": (20, 0)} | (
        {"ahrs": (40, 0)} if filters.find(name).needs else {}
    )
    # two gaps, and the wild fix where the filter gates
    assert len(solution.events) == 2 + gated and solution.counts() == counts
    stream = stream_of(recording, begin, name, lag=0.4, options=options)
    for event in shuffled(events_of(recording), 0.39):
        stream.step(event)
    assert equal(stream.finish(), solution)
    assert (
        stream.dropped == 0
        and stream.t == solution.t[-1]
        and stream.counts() == list(counts.values())
    )


@pytest.mark.parametrize("name", sorted(set(SWIFT) - set(WITH_POSITION)))
def test_an_attitude_stream_is_the_batch_and_leaves_other_sources_alone(name):
    hand = sd.simulate("hand-held", seed=3, duration=8.0)
    recording = without_samples(
        replace(hand, sources=(position([3.0, 4.0], (0.9, 0.2, 50.0)), *hand.sources)),
        (5.0, 5.3),
        (6.0, 7.2),
    )
    begin = sd.align(recording, sd.imu("consumer"), position=False)
    solution = sd.fuse(recording, name, imu="consumer", start=begin, covariance=True)
    stream = Stream(name, start=begin, imu="consumer", sources=recording.sources, lag=0.2)
    for event in shuffled(events_of(recording), 0.19):
        stream.step(event)
    belief = stream.finish()
    assert np.array_equal(belief.b_g, solution.b_g[-1]) and np.array_equal(
        belief.P, solution.covariance[-1]
    )
    assert np.allclose(belief.C_nb, solution.trajectory.rotation.as_matrix()[-1], atol=1e-12)
    counts = solution.counts()
    assert stream.dropped == 0 and stream.counts() == [(0, 0), counts.get("magnetometer", (0, 0))]
    assert [event for _, event in solution.events][1].endswith("attitude held")
    assert set(solution.status) >= {BRIDGED, INVALID} and stream.events == list(solution.events)


def test_every_belief_on_the_way_is_a_row_of_the_batch():
    recording, begin = eventful(), start(flight())
    solution = sd.fuse(recording, start=begin)
    stream, k = stream_of(recording, begin), 0
    for event in events_of(recording):
        belief = stream.step(event)
        if type(event) is Sample:
            assert np.array_equal(belief.lla, solution.trajectory.lla[k]) and np.array_equal(
                belief.v_n, solution.trajectory.v_n[k]
            )
            assert stream.t == solution.t[k] and stream.status == solution.status[k]
            k += 1
    assert k == len(solution.t) and {BRIDGED, INVALID, VALID} == set(solution.status)


def test_a_start_in_the_middle():
    recording = flight()
    begin = start(recording, 10.0)
    solution, stream = sd.fuse(recording, start=begin, covariance=True), stream_of(recording, begin)
    play(stream, events_of(recording))
    # samples and fixes up to the start, which the batch leaves out too
    assert equal(stream.finish(), solution) and stream.dropped == 200 + 20


def test_a_start_inside_a_sample():
    recording, begin = alike()
    begin = begin._replace(t=1.03)
    solution, stream = sd.fuse(recording, start=begin, covariance=True), stream_of(recording, begin)
    play(stream, events_of(recording))
    assert equal(stream.finish(), solution) and stream.dropped == 20


def test_late_events_are_dropped_and_counted():
    recording = flight()
    events = events_of(recording)
    on_time, stream = stream_of(recording, lag=0.2), stream_of(recording, lag=0.2)
    for event in events:
        on_time.step(event)
        stream.step(event)
        if type(event) is Sample and 5 < stream.t:
            stream.step(Measurement(stream.t - 0.01, 0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
            stream.step(Sample(stream.t, 0.05, (9.0,) * 3, (9.0,) * 3))
    assert stream.dropped > 500 and on_time.dropped == 0
    assert all(
        np.array_equal(a, b) for a, b in zip(snapshot(stream.finish()), snapshot(on_time.finish()))
    )


def test_a_fix_may_be_late_until_a_sample_has_passed_it():
    """With lag 0 a fix at the very time of the last sample is still used, at the beginning of
    the next one."""
    recording, begin = alike()
    fix = position([2.0], (0.8, 0.20001, 310.0))
    recording = replace(recording, sources=(fix,))
    solution = sd.fuse(recording, start=begin, covariance=True)
    for late in (0.0, -0.5 * SAME_TIME, 0.5 * SAME_TIME):
        stream = stream_of(recording, begin)
        events = [event for event in events_of(recording) if type(event) is Sample]
        for event in events[:40]:
            stream.step(event)
        assert stream.t == pytest.approx(2.0)
        stream.step(Measurement(events[39].t + late, 0, tuple(fix.y[0]), tuple(fix.std[0])))
        for event in events[40:]:
            stream.step(event)
        assert (
            stream.dropped == 0 and stream.counts() == [(1, 0)] and equal(stream.finish(), solution)
        )
    stream.step(Measurement(events[-1].t - 1.5 * SAME_TIME, 0, (0.8, 0.2, 300.0), (1.0, 1.0, 1.0)))
    assert stream.dropped == 1


@pytest.mark.parametrize("off", [-0.9, 0.0, 0.9, 3.0, -3.0])
def test_fixes_about_the_end_of_a_sample_are_used_as_in_the_batch(off):
    recording, begin = alike()
    recording = replace(
        recording,
        sources=(
            position([2.0 + off * SAME_TIME], (0.8, 0.20001, 310.0)),
            position([2.0], (0.8, 0.2, 301.0)),
        ),
    )
    solution, stream = (
        sd.fuse(recording, start=begin, covariance=True),
        stream_of(recording, begin, lag=0.1),
    )
    # a fix after the sample that ends with it
    for event in sorted(
        events_of(recording), key=lambda event: (event.t, type(event) is Measurement)
    ):
        stream.step(event)
    assert equal(stream.finish(), solution)
    one_by_one = stream_of(recording, begin)
    # the fixes first
    for event in sorted(events_of(recording), key=lambda event: type(event) is Sample):
        belief = one_by_one.step(event)
        row = int(np.argmin(abs(solution.t - event.t)))
        assert type(event) is Measurement or np.array_equal(
            belief.lla, solution.trajectory.lla[row]
        )


def test_simultaneous_fixes_are_used_in_the_order_of_their_sources():
    recording, begin = alike()
    t = recording.imu.t[19::20]
    recording = replace(
        recording,
        sources=(position(t, (0.8, 0.20001, 310.0), 0.5), position(t, (0.8, 0.20002, 320.0), 5.0)),
    )
    solution, stream = sd.fuse(recording, start=begin, covariance=True), stream_of(recording, begin)
    for event in sorted(
        events_of(recording),
        key=lambda event: (event.t, type(event) is Sample, -getattr(event, "source", 0)),
    ):
        stream.step(event)
    assert equal(stream.finish(), solution)


def test_fixes_before_the_first_sample_wait_for_it():
    recording, begin = alike()
    begin = begin._replace(t=-0.9)
    recording = replace(recording, sources=(position([-0.5, -0.2, 0.03], (0.8, 0.20001, 310.0)),))
    solution, stream = sd.fuse(recording, start=begin, covariance=True), stream_of(recording, begin)
    before = snapshot(stream.belief)
    events = sorted(events_of(recording), key=lambda event: type(event) is Sample)
    play(stream, events[:3])
    assert all(np.array_equal(a, b) for a, b in zip(before, snapshot(stream.belief)))
    play(stream, events[3:])
    assert equal(stream.finish(), solution) and stream.counts() == [(3, 0)]


def test_fixes_ahead_of_the_samples_wait_and_keep_their_order():
    """A fix with a clock that runs ahead neither hastens the samples nor blocks the other
    source."""
    recording, begin = alike()
    recording = replace(
        recording,
        sources=(
            position([2.0, 2.1], (0.8, 0.20001, 310.0)),
            position([2.05, 9e9], (0.8, 0.20002, 310.0)),
        ),
    )
    solution = sd.fuse(recording, start=begin, covariance=True)
    stream, events = stream_of(recording, begin, lag=0.3), events_of(recording)
    for event in [e for e in events if type(e) is Measurement][::-1] + [
        e for e in events if type(e) is Sample
    ]:
        stream.step(event)
    assert (
        equal(stream.finish(), solution)
        and stream.dropped == stream.dropped_by["after the last sample"] == 1
        and stream.counts() == [(2, 0), (1, 0)]
    )
    (event,) = stream.events  # not before there was a sample
    assert event[0] == 10.0 and event[1].startswith("position: fixes are up to 8999999990 s ahead")


@pytest.mark.parametrize("name", WITH_POSITION)
def test_now_looks_ahead_and_leaves_the_stream_as_it_was(name):
    recording, begin, options = eventful(name), start(flight()), OPTIONS.get(name, {})
    solution = sd.fuse(recording, name, start=begin, covariance=True, options=options)
    stream, events = (
        stream_of(recording, begin, name, lag=0.5, options=options),
        events_of(recording),
    )
    for k, event in enumerate(events):
        stream.step(event)
        if k % 40 == 7:
            before, t = snapshot(stream.belief), stream.t
            ahead = stream.now
            assert ahead is not stream.belief and not np.shares_memory(ahead.P, stream.belief.P)
            assert stream.t == t and all(
                np.array_equal(a, b) for a, b in zip(before, snapshot(stream.belief))
            )
            newest = max((e for e in events[: k + 1] if type(e) is Sample), key=lambda e: e.t)
            row = int(np.argmin(abs(solution.t - newest.t)))
            if not any(newest.t - 0.06 < e.t <= newest.t for e in events[k + 1 :]):
                assert np.array_equal(ahead.lla, solution.trajectory.lla[row]) and np.array_equal(
                    ahead.P, solution.covariance[row]
                )
    assert stream.t < events[-1].t - 0.4
    assert (
        equal(stream.now, solution)
        and equal(stream.finish(), solution)
        and equal(stream.now, solution)
    )


def test_finish_and_go_on():
    recording, begin = eventful(), start(flight())
    solution, stream, events = (
        sd.fuse(recording, start=begin, covariance=True),
        stream_of(recording, begin, lag=3.0),
        events_of(recording),
    )
    play(stream, events[:200])
    stream.finish()
    assert stream.t == max(event.t for event in events[:200] if type(event) is Sample)
    play(stream, events[200:])
    assert equal(stream.finish(), solution) and stream.dropped == 0


def test_repeated_samples_are_dropped():
    recording, begin = alike()
    solution = sd.fuse(recording, start=begin, covariance=True)
    for lag in (0.0, 0.5):
        stream = stream_of(recording, begin, lag=lag)
        for event in events_of(recording):
            stream.step(event)
            stream.step(event)
        assert equal(stream.finish(), solution) and stream.dropped == 200


@pytest.mark.parametrize(
    "bad",
    [
        {"t": np.nan},
        {"dtheta": (0.0, np.nan, 0.0)},
        {"dv": (np.inf, 0.0, 0.0)},
        {"dt": np.nan},
    ],
)
def test_impossible_samples_are_dropped_and_leave_a_gap(bad):
    recording, begin = alike()
    stream, events = stream_of(recording, begin), events_of(recording)
    for k, event in enumerate(events):
        stream.step(event._replace(**bad) if k == 100 else event)
    assert (
        equal(
            stream.finish(),
            sd.fuse(
                without_samples(recording, (events[99].t, events[100].t)),
                start=begin,
                covariance=True,
            ),
        )
        and stream.dropped == 1
    )


def test_a_fix_that_is_not_finite_is_not_measured():
    recording, begin = alike()
    recording = replace(recording, sources=(position([], (0.8, 0.2, 300.0)),))
    stream = stream_of(recording, begin)
    play(stream, events_of(recording)[:10])
    stream.step(Measurement(0.52, 0, (float("nan"), float("inf"), 301.0), (1.0, float("nan"), 1.0)))
    stream.step(Measurement(float("nan"), 0, (0.8, 0.2, 300.0), (1.0, 1.0, 1.0)))
    play(stream, events_of(recording)[10:])
    assert (
        stream.counts() == [(1, 0)]
        and stream.dropped == 1
        and np.isfinite(stream.finish().lla).all()
    )


def test_a_measurement_names_its_source_or_says_its_place():
    recording = eventful()
    names = [a.name or a.kind for a in recording.sources]
    solutions = []
    for named in (False, True):
        stream = stream_of(recording)
        for event in events_of(recording):
            if named and isinstance(event, Measurement):
                event = event._replace(source=names[event.source])
            stream.step(event)
        stream.finish()
        solutions.append(stream.solution)
    assert np.array_equal(*(s.trajectory.lla for s in solutions))
    alike = Stream(
        "closed-loop", start=start(recording), imu="tactical", sources=[recording.sources[0]] * 2
    )
    with pytest.raises(DataError, match="2 have that name: give its index"):
        alike.step(Measurement(1.0, names[0], (0.8, 0.2, 300.0), (1.0,) * 3))


@pytest.mark.parametrize(
    "fix, words",
    [
        (
            Measurement(1.0, 2, (0.8, 0.2, 300.0), (1.0,) * 3),
            "source is 2; the stream has 2, counted from 0",
        ),
        (Measurement(1.0, -1, (0.8, 0.2, 300.0), (1.0,) * 3), "source is -1"),
        (Measurement(1.0, "gnss", (0.8, 0.2, 300.0), (1.0,) * 3), "source is 'gnss'"),
        (
            Measurement(1.0, 0, (0.8, 0.2), (1.0,) * 3),
            "y has 2 and std 3 numbers; source 0 needs 3",
        ),
        (
            Measurement(1.0, 0, (0.8, 0.2, 300.0), 1.0),
            "y is (0.8, 0.2, 300.0) and std 1.0; each must be a tuple, source 0 needs 3 numbers",
        ),
        (Measurement(1.0, 0, 0.8, (1.0,) * 3), "y is 0.8 and std"),
        (Measurement(1.0, 0, (0.8, 0.2, None), (1.0,) * 3), "y is (0.8, 0.2, None)"),
        (
            Measurement(1.0, 0, (0.8, 0.2, 300.0), (1.0, 0.0, 1.0)),
            "standard deviations are (1.0, 0.0, 1.0); they must be above zero",
        ),
        (
            Measurement(1.0, 1, (0.8, 0.2, 300.0), (1.0, float("nan"), 1.0)),
            "they must be above zero",
        ),
    ],
)
def test_fixes_that_no_source_delivers_are_refused(fix, words):
    stream = stream_of(flight())
    with pytest.raises(DataError) as error:
        stream.step(fix)
    assert words in str(error.value) and "\n" not in str(error.value)
    for event in events_of(flight()):  # and the stream goes on as if nothing had been
        stream.step(event)
    assert equal(stream.finish(), sd.fuse(flight(), start=start(flight()), covariance=True))


def test_fixes_without_samples_are_refused_when_the_room_is_full():
    recording = flight()
    stream = stream_of(recording)
    for k in range(live.MAX_WAITING_FIXES):
        stream.step(Measurement(1 + 1e-3 * k, 0, tuple(recording.sources[0].y[0]), (1e3,) * 3))
    with pytest.raises(
        DataError,
        match="1024 fixes wait for an IMU sample, the first at 1.000 s; the stream needs samples to go on",
    ):
        stream.step(Measurement(9.0, 0, tuple(recording.sources[0].y[0]), (1.0,) * 3))
    for event in events_of(recording):
        if type(event) is Sample:
            stream.step(event)
    assert sum(stream.counts()[0]) == live.MAX_WAITING_FIXES


@pytest.mark.parametrize("lag", [-0.1, float("nan")])
def test_lag_must_not_be_negative(lag):
    with pytest.raises(DataError, match="lag is .* s; it must be a finite number, 0 or more"):
        stream_of(flight(), lag=lag)


def test_what_else_is_refused():
    recording = flight()
    with pytest.raises(DataError, match="no filter is called 'closed'"):
        stream_of(recording, name="closed")
    with pytest.raises(DataError, match="has no option 'interval'"):
        stream_of(recording, options={"interval": 3})
    with pytest.raises(DataError, match="give imu="):
        Stream("closed-loop", start=start(recording), sources=recording.sources)
    stream = stream_of(recording)
    stream.step(events_of(recording)[0])
    with pytest.raises(
        DataError,
        match="IMU sample at 1700000000.000 s: time jumps by 1700000000 s; begin a new stream there",
    ):
        stream.step(events_of(recording)[1]._replace(t=1.7e9))


def test_the_latitude_limit_ends_a_stream_with_its_reason():
    recording, begin = alike()
    begin = begin._replace(
        lla=(np.radians(89) - 50 / 6.4e6, 0.2, 300.0), v_n=(10.0, 0.0, 0.0), rph=(0.0, 0.0, 0.0)
    )
    stream = stream_of(recording, begin, lag=100.0)
    play(stream, events_of(recording))
    before = snapshot(stream.belief)
    with pytest.raises(DataError, match="stream stopped at .* s: the latitude left"):
        stream.now
    # looking ahead has done no harm
    assert stream.t == 0 and all(
        np.array_equal(a, b) for a, b in zip(before, snapshot(stream.belief))
    )
    with pytest.raises(DataError, match="stream stopped at"):
        stream.finish()


def test_the_sources_of_a_stream_need_no_fixes():
    recording = flight()
    empty = [a.between(1e6, 2e6) for a in recording.sources]
    stream = Stream("closed-loop", start=start(recording), imu="tactical", sources=empty)
    play(stream, events_of(recording))
    assert equal(stream.finish(), sd.fuse(recording, start=start(recording), covariance=True))
