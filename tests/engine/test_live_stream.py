"""A stream that must go on: it equals a Stream on sound data, aligns anew after long gaps, jumps of its clock and
a filter that stops, counts what it drops, and says which sources are silent."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from recordings import at_rest, flight, start, turning
from test_stream import WITH_POSITION, equal, eventful, events_of, play, shuffled

import strapdown as sd
from strapdown.checks import DataError
from strapdown.data.solution import INVALID, VALID
from strapdown.engine.arrivals import sample_of
from strapdown.engine.live_stream import LiveStream
from strapdown.engine.stream import Measurement, Sample

pytestmark = pytest.mark.short


def live_of(recording, **more):
    return LiveStream(
        "closed-loop", **{"imu": "tactical", "sources": recording.sources, "lag": 0.2} | more
    )


def shifted(events, seconds):
    return [event._replace(t=event.t + seconds) for event in events]


def texts(stream, word):
    return [text for _, text in stream.events if word in text]


@pytest.mark.parametrize("replays", [False, True])
@pytest.mark.parametrize("name", ["closed-loop", "mekf" if "mekf" in WITH_POSITION else "ekf"])
def test_on_sound_data_it_is_a_stream_and_so_the_batch(name, replays):
    recording, begin = eventful(name), start(flight())
    solution = sd.fuse(recording, name, start=begin, covariance=True)
    live = LiveStream(
        name, start=begin, imu="tactical", sources=recording.sources, lag=0.4, replay=replays
    )
    play(live, shuffled(events_of(recording), 0.39))
    assert equal(live.finish(), solution) and sum(live.dropped_by.values()) == 0
    assert live.counts() == list(solution.counts().values()) and live.alignments == 0
    assert live.events == list(solution.events) and live.t == solution.t[-1]


def test_it_says_what_it_waits_for():
    recording, asked = flight(), []
    live = live_of(recording, lag=0.0)
    assert live.waits_for == "the first IMU sample"
    for event in events_of(recording):
        live.step(event)
        asked.append(live.waits_for)
    assert "5 s of samples" in asked and asked[-1] == "" and live.started
    without = live_of(replace(recording, sources=()), lag=0.0)
    play(without, events_of(replace(recording, sources=())))
    assert without.waits_for.startswith("a position fix to start from: add a source of positions")
    assert without.waits_for.endswith("; the next attempt is in 10 s of samples")
    refused = live_of(recording, lag=0.0)
    for event in events_of(recording)[:260]:
        refused.step(event._replace(std=(0.0,) * 3) if type(event) is Measurement else event)
    assert refused.waits_for.startswith(
        "a position fix to start from: none that can be used came from GNSS position; the next"
    )
    count = refused.dropped_by["invalid"] // 2
    assert refused.waits_for.endswith(
        f"(dropped: GNSS position {count} invalid, GNSS velocity {count} invalid)"
    )
    ((_, text),) = [event for event in refused.events if "GNSS position" in event[1]]
    assert text.startswith("GNSS position: none of the measurements of the last 10.")
    assert text.endswith(" s could be used: 10 invalid")
    still = live_of(at_rest(), lag=0.0)
    play(still, events_of(at_rest())[:500])
    assert still.waits_for.startswith("a better start than this one: ")
    assert "heading unknown" in still.waits_for
    gap = live_of(recording, lag=0.0)
    events = events_of(recording)
    play(gap, [event for event in events if event.t < 12.0 or event.t > 15.05])
    assert gap.waits_for == "" and gap.status == VALID
    gap = live_of(recording, lag=0.0)
    play(gap, [e for e in events if e.t < 12.0 or (e.t > 15.05 and type(e) is Sample)])
    assert gap.status == INVALID and gap.waits_for == "a position fix that ends the gap"


# ---- gaps and clocks


@pytest.mark.parametrize("away", [61.0, 4000.0, 1e6, -500.0])
def test_after_a_long_gap_or_another_clock_it_aligns_anew(away):
    first, second, told = flight(), flight(seed=8), []
    live = live_of(first, on_event=lambda t, text: told.append(text))
    play(live, events_of(first))
    ended = copy.deepcopy(live)
    ended.finish()
    used = ended.counts()
    assert live.started
    play(live, shifted(events_of(second), 20.0 + away))
    assert live.alignments == 1 and live.started
    where = "without samples" if away > 0 else "back in the time of the samples"
    assert any(where in text and text.endswith("aligning anew") for text in told)
    # as a stream that saw nothing before; fixes that came before the second clock was believed, too
    alone = live_of(second)
    play(alone, shifted(events_of(second), 20.0 + away))
    assert np.array_equal(live.belief.lla, alone.belief.lla)
    assert np.array_equal(live.belief.P, alone.belief.P) and live.t == alone.t
    summed = [(a + c, b + d) for (a, b), (c, d) in zip(used, alone.counts())]
    assert live.counts() == summed
    off = second.reference.lla[-1] - live.now.lla
    assert np.abs(off[:2] * 6.4e6).max() < 10.0


@pytest.mark.parametrize("back", [0.8, 5.0, 40.0])
@pytest.mark.parametrize("lag", [0.0, 0.2, 1.0])
def test_after_a_short_step_back_of_the_clock_it_aligns_anew_within_a_second(back, lag):
    first, second, told = flight(), flight(seed=8), []
    live = live_of(first, lag=lag, on_event=lambda t, text: told.append((t, text)))
    play(live, events_of(first))
    for event in shifted(events_of(second), 20.0 - back):
        live.step(event)
        if event.t > 21.0 - back:
            assert live.alignments == 1 and live.stream.newest == pytest.approx(event.t, abs=0.1)
    assert live.started and live.status == VALID
    ((t, text),) = [event for event in told if "aligning anew" in event[1]]
    assert text.endswith("s back in the time of the samples: aligning anew")
    assert float(text.split()[0]) == pytest.approx(back, abs=0.1) and t < 20.1 - back
    assert np.abs((second.reference.lla[-1] - live.now.lla)[:2] * 6.4e6).max() < 10.0


@pytest.mark.parametrize("started", [False, True])
def test_a_sender_that_repeats_what_it_sent_has_no_other_clock(started):
    recording, begin = flight(), start(flight())
    more = {"start": begin} if started else {}
    live, plain = live_of(recording, **more), live_of(recording, **more)
    events = events_of(recording)
    play(plain, events)
    play(live, events[: len(events) // 3])
    play(live, events)
    live.finish(), plain.finish()
    if started:  # an alignment may use a fix twice
        assert np.array_equal(live.belief.P, plain.belief.P)
    assert live.t == plain.t and live.alignments == 0 and sum(live.dropped_by.values()) > 100
    assert live.dropped_by["at another time"] == live.dropped_by["invalid"] == 0


def test_samples_that_were_missing_and_come_late_have_no_other_clock():
    """Two seconds were held back while 3 s went on."""
    recording, begin = flight(), start(flight())
    live, plain = live_of(recording, start=begin), live_of(recording, start=begin)
    held = []
    for event in events_of(recording):
        if 8.0 < event.t <= 10.0 and type(event) is Sample:
            held.append(event)
            continue
        live.step(event)
        plain.step(event)
        if held and event.t > 13.0:
            play(live, held)
            held.clear()
    assert np.array_equal(live.finish().P, plain.finish().P) and live.alignments == 0
    assert live.dropped_by["late"] == 40


def test_samples_within_the_lag_come_in_any_order():
    """Half a second of them after the newest one, as by another line."""
    recording, begin = flight(), start(flight())
    live = live_of(recording, start=begin, lag=1.0)
    plain = live_of(recording, start=begin, lag=1.0)
    events = events_of(recording)
    play(plain, events)
    for k in range(0, len(events), 16):
        some = events[k : k + 16]
        play(live, [some[-1], *some[:-1]])
    assert np.array_equal(live.finish().P, plain.finish().P) and live.alignments == 0
    assert sum(live.dropped_by.values()) == 0


def test_a_few_late_samples_are_late():
    recording, begin = flight(), start(flight())
    live, plain = live_of(recording, start=begin), live_of(recording, start=begin)
    late = []
    for event in events_of(recording):
        plain.step(event)
        live.step(event)
        late += [event._replace(dt=0.04)] if type(event) is Sample else []
        if len(late) == 40:  # eight of them, 2 s late
            play(live, late[:8])
            late.clear()
    assert np.array_equal(live.finish().P, plain.finish().P) and live.alignments == 0
    assert live.dropped_by["late"] == 80 and texts(live, "late samples dropped, up to 1.")


def test_a_shorter_gap_is_one_of_the_batch():
    recording, begin = eventful(), start(flight())
    events = [event for event in events_of(recording) if not 6.0 < event.t <= 9.0]
    live, plain = (
        live_of(recording, start=begin),
        sd.Stream("closed-loop", imu="tactical", sources=recording.sources, lag=0.2, start=begin),
    )
    play(live, events)
    play(plain, events)
    assert np.array_equal(live.finish().P, plain.finish().P)
    assert live.events == plain.events and live.alignments == 0


@pytest.mark.parametrize("wild", [2.0, 50.0, 1e5, -1e5, 1e17])
def test_single_samples_at_another_time_are_dropped(wild):
    recording, begin = flight(), start(flight())
    live, plain = live_of(recording, start=begin), live_of(recording, start=begin)
    for k, event in enumerate(events_of(recording)):
        plain.step(event)
        live.step(event)
        if k % 50 == 20:
            live.step(Sample(event.t + wild, 0.05, (0.1, 0.2, 0.3), (9.0, 9.0, 9.0)))
    assert np.array_equal(live.finish().P, plain.finish().P) and live.alignments == 0
    assert live.dropped_by["at another time"] == 9
    assert texts(live, "at another time dropped")


def test_of_two_senders_with_two_clocks_the_first_is_used():
    recording, begin = flight(), start(flight())
    live, plain = live_of(recording, start=begin), live_of(recording, start=begin)
    for event in events_of(recording):
        plain.step(event)
        live.step(event)
        if type(event) is Sample:
            live.step(event._replace(t=event.t + 3600.0))
    assert np.array_equal(live.finish().P, plain.finish().P) and live.alignments == 0
    assert live.dropped_by["at another time"] == 400 and len(live._suspects) <= 1


def test_samples_that_creep_take_no_room():
    live = live_of(flight())
    play(live, events_of(flight())[:30])
    for k in range(50_000):
        live.step(Sample(1e4 + k * 1e-6, 1e-6, (0.0,) * 3, (0.0,) * 3))
    assert len(live._suspects) <= 20_000 and live.dropped_by["at another time"] >= 20_000


# ---- a filter that stops


def test_a_filter_that_stops_aligns_anew():
    recording = sd.simulate(turning(), 60.0, "tactical", 5, 20.0)
    live = live_of(recording)
    events = events_of(recording)
    play(live, [event for event in events if event.t <= 20.0])
    live.stream._live.belief.lla[0] = np.nan
    belief = None
    for event in events:
        if 20.0 < event.t <= 25.0:
            belief = live.step(event)
    assert live.alignments == 1 and not live.started and np.isnan(belief.lla).all()
    assert live.status == INVALID and live.waits_for
    assert texts(live, "stopped at") and texts(live, "aligning anew")
    play(live, [event for event in events if event.t > 25.0])
    assert live.started and live.status == VALID
    off = recording.reference.lla[-1] - live.finish().lla
    assert np.abs(off[:2] * 6.4e6).max() < 10.0


@pytest.mark.parametrize("spikes", [1, 4])
def test_samples_that_were_bridged_do_not_count_where_samples_are_compared_with_gravity(spikes):
    recording = flight(75.0)
    live, wild = live_of(recording), {30.0 + 5.0 * k for k in range(spikes)}
    for event in events_of(recording):
        if type(event) is Sample and round(event.t, 3) in wild:
            event = event._replace(dtheta=(150.0, 0.0, 0.0))
        live.step(event)
    assert live.alignments == 0 and [text for text in texts(live, "out of range")]
    assert np.abs(live.belief.v_n - live_of_all(recording).belief.v_n).max() < 1.0


def live_of_all(recording):
    """The stream after all events."""
    live = live_of(recording)
    for event in events_of(recording):
        live.step(event)
    return live


def test_samples_that_contradict_gravity_are_said_until_they_do_not():
    recording = flight(60.0)
    wrong = [
        event._replace(dv=tuple(v / 9.81 for v in event.dv)) if type(event) is Sample else event
        for event in events_of(recording)
        if event.t <= 20.0
    ]
    live = live_of(recording)
    play(live, wrong)
    assert not live.started and texts(live, "values in g were read as m/s^2")
    play(live, [event for event in events_of(recording) if event.t > 20.0])
    assert live.started


# ---- bad data


BAD = [
    Sample(None, 0.05, (0.0,) * 3, (0.0,) * 3),
    Sample("1", 0.05, (0.0,) * 3, (0.0,) * 3),
    Sample(5.0, -0.05, (0.0,) * 3, (0.0,) * 3),
    Sample(10**400, 0.05, (0.0,) * 3, (0.0,) * 3),
    Sample(5.0, 10**400, (0.0,) * 3, (0.0,) * 3),
    Sample(5.0, 0.05, (0.0, 10**400, 0.0), (0.0,) * 3),
    Sample(5.0, 0.05, None, (0.0,) * 3),
    Sample(5.0, 0.05, (0.0,) * 2, (0.0,) * 3),
    Sample(5.0, 0.05, ("a", "b", "c"), (0.0,) * 3),
    Sample(True, 0.05, (0.0,) * 3, (0.0,) * 3),
    Sample(np.array([1.0, 2.0]), 0.05, (0.0,) * 3, (0.0,) * 3),
    Measurement(None, 0, (0.8, 0.2, 300.0), (1.0,) * 3),
    Measurement(5.0, 7, (0.8, 0.2, 300.0), (1.0,) * 3),
    Measurement(5.0, "none", (0.8, 0.2, 300.0), (1.0,) * 3),
    Measurement(5.0, None, (0.8, 0.2, 300.0), (1.0,) * 3),
    Measurement(5.0, 0, (80.0, 0.2, 300.0), (1.0,) * 3),
    Measurement(5.0, 0, (0.8, 0.2), (1.0,) * 3),
    Measurement(5.0, 0, (0.8, 0.2, 300.0), (-1.0,) * 3),
    Measurement(5.0, 0, None, None),
    Measurement(5.0, 0, (10**400, 0.2, 300.0), (1.0,) * 3),
    Measurement(10**400, 0, (0.8, 0.2, 300.0), (1.0,) * 3),
]


def test_invalid_data_are_counted_and_change_nothing():
    recording, begin = flight(), start(flight())
    live, plain = live_of(recording, start=begin), live_of(recording, start=begin)
    for k, event in enumerate(events_of(recording)):
        plain.step(event)
        live.step(event)
        if k % 10 == 5:
            bad = BAD[k // 10 % len(BAD)]
            live.step(bad._replace(t=event.t) if isinstance(bad.t, float) else bad)
    assert np.array_equal(live.finish().P, plain.finish().P)
    assert live.dropped_by["invalid"] == 44 and live.alignments == 0
    live.step(Sample(1e6, 0.05, (0.0,) * 3, (0.0,) * 3))  # one at another time waits
    live.step(Sample(None, 0.05, (0.0,) * 3, (0.0,) * 3))
    assert live.dropped_by["invalid"] == 45
    assert texts(live, "invalid data dropped, the first: ")
    with pytest.raises(TypeError, match="^step is given a str, neither Sample nor Measurement$"):
        live.step("nothing")


# without the compiler, numpy tells of what compiled code takes as infinite
@pytest.mark.filterwarnings("ignore:.* encountered in scalar:RuntimeWarning")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("replays", [False, True])
def test_whatever_comes_it_does_not_raise(seed, replays):
    """Numbers of any size, order and kind among sound data."""
    recording = flight()
    generator = np.random.default_rng(seed)
    live = live_of(recording, replay=replays)
    sizes = [0.0, 1.0, -1.0, 1e-30, 1e30, 1e300, np.inf, -np.inf, np.nan, 5.0, 1e5]

    def number(about):
        scale = sizes[generator.integers(len(sizes))]
        return about + scale if generator.random() < 0.5 else about * scale

    for event in events_of(recording):
        if generator.random() < 0.2:
            part = generator.integers(4)
            values = list(event)
            if part in (0,) or (part == 1 and type(event) is Sample):
                values[part] = number(values[part])
            else:
                part = max(part, 2)
                values[part] = tuple(number(value) for value in values[part])
            event = type(event)(*values)
        live.step(event)
        assert live.status in (0, 1, 2, 3) and isinstance(live.waits_for, str)
    play(live, shifted(events_of(flight(40.0)), 100.0))
    assert live.started and np.isfinite(live.belief.P).all()


def test_a_callback_that_raises_is_called_once():
    calls = []

    def callback(t, text):
        calls.append(text)
        raise RuntimeError("no disk")

    live = live_of(flight(), on_event=callback)
    for event in events_of(flight()):
        live.step(event)
        live.step(BAD[0])
    assert len(calls) == 1 and texts(live, "on_event raised RuntimeError: no disk")


# ---- the watchdog


def test_a_source_that_falls_silent_is_said_once_and_that_it_is_back():
    recording, told = flight(60.0), []
    live = live_of(
        recording, on_event=lambda t, text: told.append((t, text)), start=start(flight())
    )
    for event in events_of(recording):
        away = type(event) is Measurement and event.source == 1 and 20.0 < event.t < 45.0
        if not away:
            live.step(event)
        if event.t < 29.0 or event.t > 46.0:
            assert live.silent == {}
        elif 32.0 < event.t < 44.9:
            assert live.silent == {"GNSS velocity": pytest.approx(event.t - 20.0, abs=0.1)}
    ((t, text),) = [(t, text) for t, text in told if "silent" in text]
    ((back, again),) = [(t, text) for t, text in told if "come again" in text]
    assert again == "GNSS velocity: its measurements come again" and 45.0 < back < 46.3
    assert 30.0 < t < 31.2  # ten intervals of 1 s
    assert text.startswith("GNSS velocity: silent for ") and text.endswith("check its connection")


def test_a_source_that_always_comes_too_late_is_said_again_and_when_that_ends():
    recording, told = flight(120.0), []
    live = live_of(
        recording, lag=0.5, on_event=lambda t, text: told.append((t, text)), start=start(flight())
    )

    def arrival(event):
        late = type(event) is Measurement and event.source == 0 and 20.0 < event.t < 100.0
        return event.t + 2.0 * late

    for event in sorted(events_of(recording), key=arrival):
        live.step(event)
        if 33.0 < event.t < 95.0:
            assert [*live.silent] == ["GNSS position"]
    first, again = [(t, text) for t, text in told if "too late" in text]
    assert 30.0 < first[0] < 33.0 and again[0] == pytest.approx(first[0] + 60.0, abs=1.5)
    seconds = first[0] - 20.0
    assert first[1] == (
        f"GNSS position: all measurements of the last {seconds:.1f} s came too late, by up to 1.45 s "
        "more than the lag of 0.5 s: set a longer lag"
    )
    ((back, text),) = [(t, text) for t, text in told if "used again" in text]
    assert text == "GNSS position: its measurements are used again" and 100.0 <= back < 103.0
    assert not texts(live, "check its connection")


@pytest.mark.parametrize("cause", ["not finite", "twice"])
def test_a_source_of_which_all_is_dropped_is_silent(cause):
    recording, kept = flight(60.0), None
    live = live_of(recording, start=start(flight()))
    for event in events_of(recording):
        if type(event) is Measurement and event.source == 0 and event.t > 20.0:
            kept = kept or event
            event = kept if cause == "twice" else event._replace(y=(np.nan,) * 3)
        live.step(event)
    assert [*live.silent] == ["GNSS position"] and live.dropped_by[cause] > 30
    (text,) = texts(live, "could be used")
    assert text.startswith("GNSS position: none of the") and text.endswith(f" {cause}")


def test_a_source_that_never_comes_is_said():
    recording = flight(60.0)
    live = live_of(recording, start=start(flight()))
    play(live, [e for e in events_of(recording) if type(e) is Sample or e.source == 0])
    ((t, text),) = [event for event in live.events if "silent" in event[1]]
    assert 30.0 < t < 31.2 and text.startswith("GNSS velocity: silent for 3")


# ---- files and copies


def test_it_goes_on_from_a_file(tmp_path):
    first, second = flight(), flight(40.0, seed=8)
    whole, restored = live_of(first), live_of(first)
    events = events_of(first) + shifted(events_of(second), 500.0)
    play(whole, events[:-300])
    whole.step(BAD[0])
    assert whole.alignments == 1
    whole.save(tmp_path / "state")
    restored.restore(tmp_path / "state")
    for stream in (whole, restored):
        play(stream, events[-300:])
        stream.finish()
    assert np.array_equal(whole.belief.P, restored.belief.P)
    for name in ("events", "dropped_by", "alignments", "t", "status"):
        assert getattr(whole, name) == getattr(restored, name), name
    assert whole.counts() == restored.counts()
    plain = sd.Stream("closed-loop", imu="tactical", sources=first.sources)
    plain.save(tmp_path / "plain")
    with pytest.raises(DataError, match="does not hold what a saved stream holds"):
        restored.restore(tmp_path / "plain")
    assert whole.counts() == restored.counts()
    plain.restore(tmp_path / "state")  # the other way round nothing is missing


@pytest.mark.parametrize("replays", [False, True])
@pytest.mark.parametrize("away", [5.0, 100.0, -300.0])
def test_a_restart_at_any_event_of_a_jump_changes_nothing(away, replays, tmp_path):
    """Saved and restored after each event, from before the jump until the time has been confirmed."""
    first, second = flight(), flight(seed=8)
    events = [event for event in events_of(first) if event.t <= 16.0]
    events += [events[-1]._replace(t=70.0)]  # a single one at another time, and a fix meanwhile
    events += [event for event in events_of(first) if 16.0 < event.t <= 17.5]
    begin = len(events) - 45
    later = shifted([e for e in events_of(second) if 1.0 < e.t <= 3.5], 16.5 + away)
    fix = next(event for event in later if type(event) is Measurement)
    events += [*later[:8], fix._replace(source=np.int64(1), y=(0.1, 0.2, 0.3)), *later[8:]]
    whole, parts = (live_of(first, replay=replays) for _ in range(2))
    held = 0
    play(parts, events[:begin])
    play(whole, events[:begin])
    for event in events[begin:]:
        whole.step(event)
        parts.step(event)
        held = max(held, len(parts._suspects)) if parts._suspect_fixes else held
        parts.save(tmp_path / "state")
        parts = live_of(first, replay=replays)
        parts.restore(tmp_path / "state")
        for a, b in zip(parts.belief, whole.belief):
            assert np.array_equal(a, b, equal_nan=True)
        assert parts.counts() == whole.counts() and parts.dropped_by == whole.dropped_by
    assert held >= 10 and whole.alignments == parts.alignments == (away != 5.0)
    assert whole.dropped_by["at another time"] == 1
    assert [text for _, text in parts.events] == [text for _, text in whole.events]


def test_a_restart_costs_what_the_missing_data_cost(tmp_path):
    """Bits, counts and events after 10 s without the program are those of a stream that ran on without data."""
    for seed in range(30, 33):
        recording = flight(40.0, seed=seed)
        events = shuffled(events_of(recording), 0.19)
        times = np.maximum.accumulate([event.t for event in events])
        first, last = np.searchsorted(times, (17.0, 27.0)).tolist()
        gapped, restarted = (live_of(recording, replay=True) for _ in range(2))
        play(gapped, events[:first])
        gapped.save(tmp_path / "state")
        restarted.restore(tmp_path / "state")
        for stream in (gapped, restarted):
            play(stream, events[last:])
            stream.finish()
        assert np.array_equal(gapped.belief.P, restarted.belief.P)
        for name in ("events", "status", "dropped_by", "alignments", "t"):
            assert getattr(gapped, name) == getattr(restarted, name), name
        assert gapped.counts() == restarted.counts()


def test_whatever_waits_can_be_saved(tmp_path):
    """Of suspects, too, only numbers wait."""
    live, again = live_of(flight()), live_of(flight())
    play(live, events_of(flight())[:200])
    live.step(Sample(100, np.float64(0.05), [0, 0, 0], np.zeros(3)))
    for bad in BAD:
        live.step(bad)
        live.step(bad._replace(t=100.05))
    assert live._suspects and not live._suspect_fixes == []
    live.save(tmp_path / "state")
    again.restore(tmp_path / "state")
    assert again._suspects == [sample_of(each) for each in live._suspects]
    assert again._suspect_fixes == live._suspect_fixes


@pytest.mark.parametrize("lag", [0.0, 0.2, 1.0])
def test_all_that_came_is_used_or_counted(lag):
    """With gaps, jumps, repeats, senders of two times, a start that comes late and a filter that stops."""
    first, second, used = flight(), flight(40.0, seed=8), []
    live = live_of(
        first, lag=lag, on_use=lambda sample, fixes: used.append(1 + len(fixes)), history=100
    )
    generator, given = np.random.default_rng(3), 0
    parts = [
        [event for event in events_of(first) if type(event) is Sample],  # which make no start
        shifted(events_of(first), 100.0),
        shifted(events_of(second), 40.0),
        shifted(events_of(first), 500.0),
        shifted(events_of(first), 490.0),
        shifted(events_of(second), 525.0),
    ]
    for number, events in enumerate(parts):
        for k, event in enumerate(events):
            for each in {
                2: [event, event],
                3: [event, event._replace(t=event.t + 30.0)],
                5: [event, BAD[generator.integers(len(BAD))]],
            }.get(int(generator.integers(40)), [event]):
                live.step(each)
                given += 1
            if number == 3 and k == 300:
                live.stream._live.belief.lla[0] = np.nan
    assert live.alignments > 3 and live.started
    live.finish()
    assert sum(used) + sum(live.dropped_by.values()) == given
    assert live.dropped_by["before a new alignment"] > 100


@pytest.mark.parametrize("change", ["g", "ms", "no fixes"])
def test_what_waits_for_a_start_in_vain_is_counted(change):
    live, given = live_of(flight()), 0
    for event in events_of(flight()):
        if change == "g" and type(event) is Sample:
            event = event._replace(dv=tuple(v / 9.81 for v in event.dv))
        elif change == "ms":
            event = event._replace(t=1e3 * event.t)
        elif change == "no fixes" and type(event) is Measurement:
            continue
        live.step(event)
        given += 1
    assert sum(live.dropped_by.values()) < given
    live.leave()
    assert sum(live.dropped_by.values()) == given and not live.started


def test_copies_are_its_own_or_refused():
    recording, told = flight(), []
    live = live_of(recording, on_event=lambda t, text: told.append(text))
    events = events_of(recording)
    play(live, events[:300])
    other = copy.deepcopy(live)
    play(other, events[300:])
    before = live.t
    play(live, events[300:])
    assert before < live.t == other.t and np.array_equal(live.belief.P, other.belief.P)
    with pytest.raises(TypeError, match="would share its state"):
        copy.copy(live)
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(live)


def test_it_needs_the_imu_and_refuses_what_a_stream_refuses():
    with pytest.raises(DataError, match="IMU|imu"):
        LiveStream("closed-loop", noise=sd.imu("tactical").noise(), start=start(flight()))
    with pytest.raises(DataError, match="^LiveStream has no option 'lags'"):
        LiveStream("closed-loop", imu="tactical", lags=3)
