"""A stream that is saved and restored goes on bit for bit, whatever it was at; files that it cannot go on
from; copies."""

import copy
import pickle
import zlib
from dataclasses import replace

import numpy as np
import pytest
from around import recording as recorded_flight
from recordings import OPTIONS, flight, start, without_samples
from test_ahrs import FED
from test_stream import WITH_POSITION, eventful, events_of, play, shuffled, stream_of
from test_stream_installation import ASKED, with_wheel
from test_stream_start import own

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.data.solution import INVALID, VALID
from strapdown.engine.stream import Measurement, Sample, Stream
from strapdown.evaluation.metrics import errors
from strapdown.fileio.checksum import append_checksum

pytestmark = pytest.mark.short


def everything(stream):
    """All that a stream holds, as arrays, and what it says; not the rows of its history."""
    said = stream.events, stream.counts(), stream.dropped_by, stream.status, stream.notes
    arrays = [*stream.belief]
    if stream._live is not None:
        state, work, limits, axes, books, _, *others = (
            stream._live.cursor
        )  # `events` has read the log
        state = state.copy()
        for name in ("row", "stop", "fix", "fixes", "out"):
            state[name] = 0
        arrays += [table.view(np.int64) for table in (state, work, limits, axes, books, *others)]
    return arrays, said


def assert_alike(one, other):
    (arrays, said), (others, also) = everything(one), everything(other)
    assert len(arrays) == len(others) and said == also
    for a, b in zip(arrays, others):
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def through_file(stream, path, new):
    """The stream that goes on from a file."""
    stream.save(path)
    new.restore(path)
    return new


@pytest.mark.parametrize("name", WITH_POSITION)
def test_a_restored_stream_goes_on_bit_for_bit(name, tmp_path):
    """With fixes that come late and wait, gaps, and a rejected fix; saved three times at random."""
    recording, begin, options = eventful(name), start(flight()), OPTIONS.get(name, {})

    def new():
        return stream_of(recording, begin, name, lag=0.4, options=options)

    events = shuffled(events_of(recording), 0.39)
    whole, parts = new(), new()
    cuts = sorted(np.random.default_rng(11).choice(len(events), 3, replace=False).tolist())
    for k, event in enumerate(events):
        if k in cuts:
            parts = through_file(parts, tmp_path / "state", new())
        assert parts.step(event) is parts.belief and whole.step(event) is whole.belief
        assert np.array_equal(parts.belief.lla, whole.belief.lla)
        assert np.array_equal(parts.belief.P, whole.belief.P)
    assert parts.finish() is not None and whole.finish() is not None
    assert_alike(parts, whole)
    size = (tmp_path / "state").stat().st_size
    assert size < 100e3, size


@pytest.mark.parametrize("cut", [4.83, 12.63, 13.4, 14.99, 15.12])
def test_it_may_be_saved_in_the_middle_of_a_gap(cut, tmp_path):
    recording, begin = eventful(), start(flight())
    whole, parts = (stream_of(recording, begin) for _ in range(2))
    events = events_of(recording)
    play(whole, events)
    play(parts, [event for event in events if event.t <= cut])
    parts = through_file(parts, tmp_path / "state", stream_of(recording, begin))
    play(parts, [event for event in events if event.t > cut])
    assert_alike(parts, whole)


@pytest.mark.parametrize("name", ["attitude-mekf", "mahony", "vru"])
def test_filters_of_attitude_alone_go_on_too(name, tmp_path):
    hand = without_samples(sd.simulate("hand-held", seed=3, duration=12.0), (5.0, 5.3), (6.0, 7.2))
    whole, parts, again = (
        Stream(name, imu="consumer", sources=hand.sources, lag=0.2) for _ in range(3)
    )
    events = shuffled(events_of(hand), 0.19)
    play(whole, events)
    cut = len(events) * 95 // 100
    play(parts, events[:cut])
    assert parts.started
    again = through_file(parts, tmp_path / "state", again)
    play(again, events[cut:])
    assert_alike(again, whole)


@pytest.mark.parametrize("cut", [0.1, 0.37, 0.8])
def test_clocks_and_other_parameters_that_are_states_go_on(cut, tmp_path):
    """Their fixes wait, and the motion of the last seconds is kept."""
    recording, begin = with_wheel(eventful()), start(flight())

    def new():
        more = {"estimate": ASKED, "adaptive": 5.0, "robust": ["wheel"]}
        return stream_of(recording, begin, lag=0.4, **more)

    whole, parts, events = new(), new(), shuffled(events_of(recording), 0.39)
    cut = int(cut * len(events))
    play(whole, events)
    play(parts, events[:cut])
    assert parts._waiting
    parts = through_file(parts, tmp_path / "state", new())
    play(parts, events[cut:])
    whole.finish()
    parts.finish()
    assert_alike(parts, whole)


@pytest.mark.parametrize("cut", [0, 3, 150])
def test_it_may_be_saved_before_its_start(cut, tmp_path):
    recording = flight()
    whole, parts, again = (own(recording, lag=0.1) for _ in range(3))
    events = events_of(recording)
    play(whole, events)
    play(parts, events[:cut])
    assert not parts.started
    again = through_file(parts, tmp_path / "state", again)
    assert not again.started and np.isnan(again.belief.lla).all()
    play(again, events[cut:])
    assert again.start == whole.start
    assert_alike(again, whole)


@pytest.mark.parametrize("cut", [0.3, 0.71])
def test_an_ahrs_beside_the_filter_goes_on_too(cut, tmp_path):
    flown = recorded_flight()

    def new():
        return Stream(FED, imu="tactical", sources=flown.sources, lag=0.3, ahrs_rate=5.0)

    whole, parts, events = new(), new(), shuffled(events_of(flown), 0.27)
    cut = int(cut * len(events))
    play(whole, events)
    play(parts, events[:cut])
    assert parts.started == (cut > len(events) // 2)
    parts = through_file(parts, tmp_path / "state", new())
    play(parts, events[cut:])
    assert_alike(parts, whole)
    assert_alike(parts._ahrs.stream, whole._ahrs.stream)


def test_rejections_that_go_on_over_a_restart_are_one_event(tmp_path):
    recording = flight()
    p, v = recording.sources
    y = p.y.copy()
    y[8:16, 0] += 5e-5
    recording = replace(recording, sources=(replace(p, y=y), v))
    begin, events = start(recording), events_of(recording)
    whole = stream_of(recording, begin)
    play(whole, events)
    said = [text for _, text in whole.finish() and whole.events if "rejected" in text]
    assert said
    for cut in (8.5, 11.0, 14.5, 18.0):
        parts = stream_of(recording, begin)
        play(parts, [event for event in events if event.t <= cut])
        parts = through_file(parts, tmp_path / "state", stream_of(recording, begin))
        play(parts, [event for event in events if event.t > cut])
        parts.finish()
        assert_alike(parts, whole)


def test_a_fix_that_comes_again_after_a_restart_is_known(tmp_path):
    recording, begin = flight(), start(flight())
    events = events_of(recording)
    parts = stream_of(recording, begin)
    play(parts, events[:100])
    fix = [event for event in events[:100] if type(event) is Measurement and event.source == 0][-1]
    restarted = through_file(parts, tmp_path / "state", stream_of(recording, begin))
    restarted.step(fix)
    assert restarted.dropped_by["twice"] == 1 and restarted.dropped_by["late"] == 0


def test_a_stream_that_has_dropped_its_history_goes_on(tmp_path):
    recording, begin = eventful(), start(flight())
    whole, parts = (stream_of(recording, begin, history=100) for _ in range(2))
    events = events_of(recording)
    play(whole, events)
    play(parts, events[:330])
    parts = through_file(parts, tmp_path / "state", stream_of(recording, begin, history=100))
    play(parts, events[330:])
    for a, b in zip(parts.belief, whole.belief):
        assert np.array_equal(a, b)
    assert parts.counts() == whole.counts() and parts.status == whole.status


def test_the_history_begins_at_the_save(tmp_path):
    recording, begin = eventful(), start(flight())
    parts = stream_of(recording, begin)
    events = events_of(recording)
    play(parts, [event for event in events if event.t <= 8.0])
    t, lla = parts.t, parts.belief.lla.copy()
    again = through_file(parts, tmp_path / "state", stream_of(recording, begin))
    assert again.t == t and again.start.t == t and np.array_equal(again.start.lla, lla)
    with pytest.raises(DataError, match="has used no sample yet"):
        again.solution
    play(again, [event for event in events if event.t > 8.0])
    solution = again.solution
    assert solution.t[0] > t and solution.t[-1] == again.t and again.verdict.line
    assert len(parts.solution.t) == np.sum(recording.imu.t <= 8.0)  # saving takes nothing away


# ---- a restart after a time without the program


def absent(recording, begin, stop, path, restart=True):
    """(NEES of 9 states, status, events) at the end of a stream that is away from `begin` to
    `stop` s: restarted from a file, or without samples and fixes meanwhile."""

    def new():
        return stream_of(recording, start(recording))

    stream, events = new(), events_of(recording)
    play(stream, [event for event in events if event.t <= begin])
    if restart:
        stream = through_file(stream, path, new())
    shown = []
    for event in [event for event in events if event.t > stop]:
        stream.step(event)
        shown += [stream.status]
    off = errors(stream.solution, recording.reference)
    e = np.r_[off.position[-1], off.velocity[-1], off.attitude[-1]]
    return float(e @ np.linalg.solve(stream.belief.P[:9, :9], e)), shown, stream.events


def test_a_restart_after_ten_seconds_is_a_gap_like_any_other(tmp_path):
    """NEES, status and events are those of a stream that ran on without samples."""
    for seed in range(30, 36):
        recording = flight(40.0, seed=seed)
        restarted = absent(recording, 15.0, 25.0, tmp_path / "state")
        assert restarted == absent(recording, 15.0, 25.0, None, restart=False)
        _, shown, events = restarted
        assert shown[0] == INVALID and VALID in shown
        text = "IMU gap of 10 s: velocity and attitude held, invalid until the next position fix"
        assert text in [said for _, said in events]


# ---- files that it cannot go on from


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """(path of a file, function that makes streams that it fits)."""
    recording, begin = eventful(), start(flight())
    path = tmp_path_factory.mktemp("saved") / "state"

    def new(name="closed-loop", sources=recording.sources, **more):
        return Stream(name, **{"start": begin, "imu": "tactical", "sources": sources} | more)

    stream = new(lag=0.3)
    play(stream, events_of(recording)[:250])
    stream.save(path)
    return path, new


def refused(stream, path):
    """The line with which a stream refuses a file; it must be as before."""
    before = everything(stream)
    with pytest.raises(DataError) as error:
        stream.restore(path)
    after = everything(stream)
    assert before[1] == after[1]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before[0], after[0]))
    text = str(error.value)
    assert text.startswith(str(path)) and "\n" not in text
    return text


def test_a_damaged_file_is_refused_in_one_line(saved, tmp_path):
    path, new = saved
    content, stream, bad = path.read_bytes(), new(), tmp_path / "bad"
    play(stream, events_of(eventful())[:30])
    generator = np.random.default_rng(5)
    for k in generator.integers(0, len(content), 60).tolist():
        other = bytearray(content)
        other[k] ^= 1 << int(generator.integers(8))
        bad.write_bytes(other)
        refused(stream, bad)
    for k in (0, 1, 30, 1000, len(content) - 60, len(content) - 1):
        bad.write_bytes(content[:k])
        refused(stream, bad)
    stream.restore(path)


def test_foreign_files_are_refused_in_one_line(saved, tmp_path):
    path, new = saved
    stream, bad = new(), tmp_path / "bad"
    assert "cannot be read (No such file or directory)" in refused(stream, tmp_path / "none")
    bad.write_text("t,x,y\n1,2,3\n")
    assert "is no saved stream" in refused(stream, bad)
    first, _, rest = path.read_bytes().partition(b"\n")
    bad.write_bytes(first[:-1] + b"99\n" + rest)
    assert "is of format 99, this version reads 2" in refused(stream, bad)
    for made in (b"{}", b"[1, 2]", b"nothing", b'{"set-up": 3}', b"[" * 10000):
        bad.write_bytes(first + b"\n" + zlib.compress(made))
        append_checksum(bad)
        assert "does not hold what a saved stream holds" in refused(stream, bad)


def rewritten(path, into, change):
    """The file with its JSON changed, and the right checksum."""
    first, _, packed = path.read_bytes().partition(b"\n")
    text = zlib.decompress(packed).decode()
    assert (other := change(text)) != text
    into.write_bytes(first + b"\n" + zlib.compress(other.encode()))
    append_checksum(into)


@pytest.mark.parametrize(
    "old, new_text",
    [
        ('"shape":[15,15]', '"shape":[225]'),
        ('"shape":[3]', '"shape":[4]'),
        ('"<f8"', '"<f4"'),
        ('"begun":[', '"begun":[null,'),
        ('"waiting":[', '"waiting":[[1,[1,77,[0,0,0],[1,1,1]]],'),
        ('"times":[', '"times":["now",'),
        ('"gathered":{', '"gone":{'),
    ],
)
def test_a_file_that_contradicts_itself_is_refused(saved, tmp_path, old, new_text):
    path, new = saved
    bad = tmp_path / "bad"
    rewritten(path, bad, lambda text: text.replace(old, new_text, 1))
    assert "does not hold what a saved stream holds" in refused(new(), bad)


def test_a_file_of_another_set_up_is_refused(saved, tmp_path):
    path, new = saved
    sources = eventful().sources
    other = replace(sources[0], gate=3.0)
    for stream, part in (
        (new("ekf"), "filter: closed-loop, not ekf"),
        (new(sources=sources[:1]), "sources"),
        (new(sources=(other, sources[1])), "sources"),
        (new(estimate=["clock"]), "sources"),
        (new(imu="navigation"), "IMU"),
        (new(vehicle="car"), "vehicle"),
        (new(options={"bias": "held"}), "options"),
    ):
        assert f"saved by a stream with another {part}" in refused(stream, path)
    bad = tmp_path / "bad"
    rewritten(path, bad, lambda text: text.replace(sd.__version__, "0.0.1", 1))
    assert f"another strapdown: 0.0.1, not {sd.__version__};" in refused(new(), bad)
    new(lag=1.0, history=1000, on_event=print, every=5, start=None).restore(path)


def test_a_stream_that_has_stopped_is_not_saved(tmp_path):
    recording = flight()
    stream = stream_of(recording)
    play(stream, events_of(recording)[:50])
    stream.belief.lla[0] = np.nan
    with pytest.raises(DataError, match="stopped"):
        play(stream, events_of(recording)[50:60])
    with pytest.raises(DataError, match="there is nothing to go on from: begin a new stream$"):
        stream.save(tmp_path / "state")
    assert not (tmp_path / "state").exists()


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    stream = stream_of(flight())
    with pytest.raises(DataError, match="cannot be written"):
        stream.save(tmp_path / "none" / "state")


# ---- copies


@pytest.mark.parametrize("name", ["closed-loop", "ukf" if "ukf" in WITH_POSITION else "mekf"])
def test_a_deep_copy_is_a_stream_of_its_own(name):
    recording, begin, said = eventful(name), start(flight()), []
    options = {"lag": 0.4, "on_event": lambda t, text: said.append(text)}
    stream, events = stream_of(recording, begin, name, **options), events_of(recording)
    play(stream, events[:200])
    before, mine = everything(stream), stream.solution
    other = copy.deepcopy(stream)
    play(other, events[200:])
    assert len(said) >= 2  # both tell the same callback
    after = everything(stream)
    assert all(np.array_equal(a, b) for a, b in zip(before[0], after[0]))
    assert before[1] == after[1] and np.array_equal(stream.solution.t, mine.t)
    play(stream, events[200:])
    stream.finish()
    other.finish()
    assert_alike(other, stream)
    assert np.array_equal(other.solution.trajectory.lla, stream.solution.trajectory.lla)


def test_a_deep_copy_has_an_ahrs_of_its_own():
    flown = recorded_flight()
    stream, events = Stream(FED, imu="tactical", sources=flown.sources), events_of(flown)
    play(stream, events[:300])
    other = copy.deepcopy(stream)
    assert other._ahrs.stream._row.__self__ is other
    assert other._ahrs.stream._notifier._on_event.__self__ is other
    play(other, events[300:])
    play(stream, events[300:])
    assert_alike(other, stream)


def test_other_copies_are_refused():
    stream = stream_of(flight())
    with pytest.raises(TypeError, match="^a copy of a Stream would share its state: use copy.deep"):
        copy.copy(stream)
    with pytest.raises(TypeError, match="^a Stream cannot be pickled: use its methods save and r"):
        pickle.dumps(stream)


def test_every_filter_saves_what_json_can_hold(tmp_path):
    """The options that its sources decide, too."""
    for name in filters.names():
        if name in WITH_POSITION:
            recording = eventful(name)
            stream = stream_of(recording, start(flight()), name, options=OPTIONS.get(name, {}))
            play(stream, events_of(recording)[:5])
            stream.save(tmp_path / name)


def test_samples_and_fixes_of_other_number_types_are_saved(tmp_path):
    recording = flight()
    whole, parts = (stream_of(recording, lag=0.5) for _ in range(2))
    for stream in (whole, parts):
        for event in events_of(recording)[:40]:
            if type(event) is Sample:
                stream.step(Sample(np.float64(event.t), event.dt, np.array(event.dtheta), event.dv))
            else:
                stream.step(
                    Measurement(event.t, np.int64(event.source), np.array(event.y), event.std)
                )
    parts = through_file(parts, tmp_path / "state", stream_of(recording, lag=0.5))
    whole.finish()
    parts.finish()
    assert_alike(parts, whole)
