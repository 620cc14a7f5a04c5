"""What a stream says: events as of fuse, as a list and to a callback; what was dropped; solution and
verdict of its history."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import alike, flight, position, start, without_samples
from test_stream import eventful, events_of, play, shuffled, stream_of

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import INVALID, VALID
from strapdown.engine.events import MAX_OF_A_KIND
from strapdown.engine.stream import Measurement, Sample, Stream

pytestmark = pytest.mark.short


def same_solution(first, second):
    """Whether two Solutions have the same rows, fixes, status and events, bit for bit."""
    parts = [
        (s.t, s.trajectory.lla, s.trajectory.v_n, s.trajectory.q_nb, s.trajectory.std, s.b_a, s.b_g)
        + (s.status, *fixes_of(s))
        for s in (first, second)
    ]
    return first.events == second.events and all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in zip(*parts)
    )


def fixes_of(solution):
    i = solution.innovations
    return (i.t, i.source, i.innovation, i.nis, i.accepted)


def jumped(recording, after, metres):
    """The recording whose positions are so far north from a time on."""
    p, *others = recording.sources
    y = p.y.copy()
    y[p.t > after, 0] += metres / 6.37e6
    return replace(recording, sources=(replace(p, y=y), *others))


def knocked(recording, row):
    """The recording with an impossible sample."""
    dv = recording.imu.dv.copy()
    dv[row, 1] = 1e4
    return replace(recording, imu=recording.imu._replace(dv=dv))


def overconfident(recording):
    p, *others = recording.sources
    return replace(recording, sources=(replace(p, std=np.full_like(p.std, 1e-9)), *others))


FAULTS = {
    "gaps": lambda: eventful(),
    "a jump of 1000 m": lambda: jumped(flight(), 8.0, 1000.0),
    "an impossible sample": lambda: knocked(flight(), 150),
    "stated deviations of nm": lambda: overconfident(flight()),
    "no fix at latitude 0": lambda: replace(
        flight(), sources=(position([9.0], (0.0, 0.0, 0.0)), *flight().sources)
    ),
    "many gaps": lambda: without_samples(
        flight(), *[(k / 2 + 1.0, k / 2 + 1.2) for k in range(30)]
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_by_fault_a_stream_says_what_the_batch_says(fault):
    recording, begin, told = FAULTS[fault](), start(flight()), []
    batch = sd.fuse(recording, start=begin, every=7, covariance=True)
    stream = stream_of(
        recording,
        begin,
        lag=0.4,
        every=7,
        covariance=True,
        on_event=lambda t, text: told.append((t, text)),
    )
    play(stream, shuffled(events_of(recording), 0.39))
    stream.finish()
    assert batch.events and tuple(stream.events) == batch.events
    # rejections are told once their cause can be seen
    assert sorted(t for t, _ in told) == [t for t, _ in sorted(stream.events)]
    assert same_solution(stream.solution, batch)
    assert np.array_equal(stream.solution.covariance, batch.covariance)
    assert stream.solution.verdict == batch.verdict
    for mine, its in zip(stream.solution.recording.sources, batch.recording.sources):
        assert np.array_equal(mine.std, its.std) and np.array_equal(mine.y, its.y, equal_nan=True)


def test_a_verdict_tells_of_a_fault():
    stream = stream_of(FAULTS["gaps"](), start(flight()))
    play(stream, events_of(FAULTS["gaps"]()))
    assert not stream.verdict.trusted
    assert any("samples are missing" in reason.seen for reason in stream.verdict.reasons)


def test_a_stopped_stream_has_its_reason_among_its_events():
    recording, begin = alike()
    begin = begin._replace(
        lla=(np.radians(89) - 50 / 6.4e6, 0.2, 300.0), v_n=(10.0, 0.0, 0.0), rph=(0.0, 0.0, 0.0)
    )
    told, batch = [], sd.fuse(recording, start=begin)
    stream = stream_of(recording, begin, on_event=lambda *event: told.append(event))
    with pytest.raises(DataError, match="^stream stopped at .* s: the latitude left"):
        play(stream, events_of(recording))
    assert "stopped" in batch.meta and batch.events == stream.solution.events
    assert told == stream.events == list(batch.events)
    with pytest.raises(DataError, match="^stream stopped at"):
        stream.step(events_of(recording)[-1])


def test_an_event_is_told_once_when_it_begins():
    recording, told = FAULTS["many gaps"](), []
    stream = stream_of(recording, on_event=lambda t, text: told.append((stream.t, t, text)))
    play(stream, events_of(recording))
    (then, t, text), ((t_end, text_end),) = told[0], stream.events
    assert len(told) == 1 and t == t_end == pytest.approx(1.0) and then == pytest.approx(1.25)
    assert text == "IMU gap of 0.2 s: bridged" and "30 IMU gaps" in text_end


def test_a_callback_that_raises_costs_nothing():
    recording, begin, calls = FAULTS["gaps"](), start(flight()), []

    def fails(t, text):
        calls.append(t)
        raise RuntimeError("the display\nis gone")

    stream, quiet = stream_of(recording, begin, on_event=fails), stream_of(recording, begin)
    play(stream, events_of(recording))
    play(quiet, events_of(recording))
    assert len(calls) == 1 and stream.dropped == 0
    assert all(np.array_equal(a, b) for a, b in zip(stream.belief, quiet.belief))
    said = [event for event in stream.events if event not in quiet.events]
    (_, text), *more = said
    assert not more and "\n" not in text
    said = "on_event raised RuntimeError: the display; the callback is not called again"
    assert text == f"{said} (2 events since)"  # a gap, and a fix that was rejected


def test_a_callback_may_ask_and_step():
    recording, seen = FAULTS["gaps"](), []
    rows = iter(events_of(recording))

    def asks(t, text):
        seen.append((stream.status, stream.counts(), len(stream.events)))
        stream.step(next(rows))

    stream = stream_of(recording, on_event=asks)
    for event in rows:
        stream.step(event)
    assert len(seen) == 3 and stream.dropped == 0  # two gaps and a fix that was rejected
    assert np.array_equal(
        stream.belief.lla, sd.fuse(recording, start=start(flight())).trajectory.lla[-1]
    )


def test_what_is_dropped_is_counted_by_its_reason_and_said():
    recording = flight()
    samples = [e for e in events_of(recording) if type(e) is Sample]
    stream = stream_of(recording)
    play(stream, [samples[0]._replace(t=-1.0), *samples[:100]])
    stream.step(samples[99])
    stream.step(samples[60]._replace(t=3.01))
    stream.step(samples[100]._replace(dv=(np.nan, 0.0, 0.0)))
    fix = Measurement(5.02, 0, tuple(recording.sources[0].y[4]), (1.0,) * 3)
    play(stream, [fix, fix, samples[101], fix, fix._replace(t=4.0), fix._replace(t=np.nan)])
    play(stream, [fix._replace(t=5.04, y=(value,) * 3) for value in (np.nan, np.inf)])
    assert [*stream.dropped_by.values()] == [1, 2, 3, 4, 0, 0]
    assert stream.dropped == 10 and stream.counts()[0] == (1, 0)
    texts = [text for _, text in stream.events if "gap" not in text]
    assert texts == [
        "IMU: 1 late sample dropped, up to 1.99 s behind: set a longer lag",
        "GNSS position: 1 late row dropped, up to 1.1 s behind: set a longer lag",
        "IMU: 1 repeated time dropped",
        "GNSS position: 2 repeated rows dropped",
        "IMU: 1 sample with NaN or infinite values dropped",
        "GNSS position: 3 rows without time or value dropped",
    ]


def far_ahead(stream, recording, seconds=345600.0):
    """Step through the recording with fixes of another epoch."""
    for event in events_of(recording):
        stream.step(event._replace(t=event.t + seconds) if type(event) is Measurement else event)


def test_fixes_of_another_epoch_are_said_at_once_and_counted_at_the_end():
    recording, told = flight(), []
    stream = stream_of(recording, on_event=lambda t, text: told.append((stream.t, text)))
    far_ahead(stream, recording)
    stream.finish()
    text = "fixes are up to 345600 s ahead of the IMU: check both clocks"
    assert [text for _, text in stream.events if "ahead" in text] == [
        f"GNSS position: {text}",
        f"GNSS velocity: {text}",
    ]
    assert [t for t, text in told if "ahead" in text] == pytest.approx([0.95] * 2)
    assert stream.dropped_by["after the last sample"] == stream.dropped == 40
    assert stream.finish() is stream.belief and stream.dropped == 40


def test_no_lag_is_asked_for_where_the_clock_is_wrong():
    recording, stream = flight(), stream_of(flight())
    samples = [e for e in events_of(recording) if type(e) is Sample]
    play(stream, [*samples[:21], samples[21]._replace(t=90.0)])
    for t, remedy in ((2.0, "check both clocks"), (45.0, "set a longer lag")):
        play(stream, [Measurement(t, 0, tuple(recording.sources[0].y[4]), (1.0,) * 3)])
        assert any(text.endswith(f" {90 - t:g} s behind: {remedy}") for _, text in stream.events)


def test_events_by_the_thousand_are_folded():
    recording = flight()
    samples = [e for e in events_of(recording) if type(e) is Sample]
    told = []
    stream = stream_of(recording, on_event=lambda *event: told.append(event))
    play(stream, samples[:200])
    for k in range(20_000):
        stream.step(samples[k % 100])
    assert stream.dropped == 20_000 and len(stream.events) <= 2 * MAX_OF_A_KIND
    assert sum("late" in text for _, text in told) == 1


def test_a_fix_that_comes_twice_is_used_once_in_any_order():
    recording, begin = flight(), start(flight())
    stream = stream_of(recording, begin, lag=0.5)
    events = [e for event in events_of(recording) for e in (event, event)]
    play(stream, shuffled(events, 0.45))
    stream.finish()
    assert stream.dropped_by["twice"] == stream.dropped == len(events) // 2
    assert np.array_equal(
        stream.belief.lla, sd.fuse(recording, start=begin).trajectory.lla[-1]
    ) and stream.counts() == [(20, 0), (20, 0)]


# ---- the history


def test_the_history_keeps_the_newer_half_and_begins_with_what_was_known():
    recording, begin = flight(60.0), start(flight(60.0))
    whole = sd.fuse(recording, start=begin)
    stream = stream_of(recording, begin, history=500)
    play(stream, events_of(recording))
    assert np.array_equal(stream.belief.lla, whole.trajectory.lla[-1])
    solution = stream.solution
    kept = len(solution.t)
    assert 250 <= kept <= 500 and np.array_equal(solution.t, whole.t[-kept:])
    assert np.array_equal(solution.trajectory.std, whole.trajectory.std[-kept:])
    assert np.array_equal(
        solution.innovations.nis, whole.innovations.nis[whole.innovations.t > stream.start.t + 1e-6]
    )
    row = len(whole.t) - kept - 1
    assert stream.start.t == whole.t[row] and stream.start.lla == tuple(whole.trajectory.lla[row])
    assert stream.start.std == tuple(whole.trajectory.std[row])
    assert np.allclose(stream.start.rph, (whole.trajectory.rph[row] + np.pi) % (2 * np.pi) - np.pi)
    again = sd.fuse(solution.recording, start=stream.start, imu="tactical")
    assert np.array_equal(again.t, solution.t)
    assert np.abs(again.trajectory.v_n[-1] - solution.trajectory.v_n[-1]).max() < 0.1


def test_many_fixes_fill_the_history_too():
    recording, begin = alike()
    t = np.sort(np.r_[recording.imu.t, recording.imu.t - 0.013, recording.imu.t - 0.031])
    recording = replace(recording, sources=(position(t, (0.8, 0.20001, 310.0), 50.0),))
    stream = stream_of(recording, begin, history=150)
    play(stream, events_of(recording))
    solution = stream.solution
    assert stream.counts() == [(600, 0)] and len(solution.innovations.t) < 300
    assert (solution.innovations.t > stream.start.t).all()
    assert np.array_equal(stream.belief.lla, sd.fuse(recording, start=begin).trajectory.lla[-1])


def test_looking_ahead_leaves_no_trace_in_history_and_events():
    recording, begin = eventful(), start(flight())
    stream = stream_of(recording, begin, lag=3.0)
    for event in events_of(recording):
        stream.step(event)
        stream.now
    stream.finish()
    assert same_solution(stream.solution, sd.fuse(recording, start=begin)) and stream.dropped == 0


def test_before_the_first_sample_there_is_no_solution():
    with pytest.raises(DataError, match="^the stream has used no sample yet"):
        stream_of(flight()).solution


def test_status_is_that_of_the_row():
    stream = Stream("closed-loop", imu="tactical", sources=flight().sources)
    assert stream.status == INVALID and not stream.started and np.isnan(stream.t)
    stream = stream_of(flight())
    play(stream, events_of(flight()))
    assert stream.status == VALID and stream.started


@pytest.mark.parametrize("back, said", [(0.12, True), (0.03, True), (0.0, False)])
def test_a_clock_that_steps_back_inside_the_lag_is_said(back, said):
    """Its samples come in between those before; the batch drops them as out of order."""
    stream = stream_of(flight(), lag=0.3)
    for event in events_of(flight()):
        late = isinstance(event, Sample) and event.t > 9.99
        stream.step(event._replace(t=event.t - back) if late else event)
    stream.finish()
    overlaps = [text for _, text in stream.events if "overlap the one before" in text]
    assert len(overlaps) == said and all("stepped back" in text for text in overlaps)
