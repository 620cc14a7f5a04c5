"""An AHRS that runs beside a stream: its attitudes are those of its own batch, and what they feed is
the batch on them, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from around import recorded, recording
from test_ahrs import FED
from test_stream import events_of, play, shuffled

import strapdown as sd
from strapdown.checks import DataError
from strapdown.engine.options import run_options
from strapdown.engine.stream import Stream
from strapdown.engine.with_ahrs import source

pytestmark = pytest.mark.short


def fed(stream):
    """(the Source that the AHRS of a stream made, its stream)."""
    made = [a for a in stream.solution.recording.sources if a.kind == "attitude"]
    return made[0], stream._ahrs.stream


@pytest.mark.parametrize("lag", [0.0, 0.3])
@pytest.mark.parametrize("ahrs", [None, "mahony", "vru"])
def test_a_fed_stream_is_the_batch_on_the_attitudes_of_its_ahrs(ahrs, lag):
    flown = recording()
    stream = Stream(FED, imu="tactical", sources=flown.sources, lag=lag, ahrs=ahrs, ahrs_rate=5.0)
    play(stream, shuffled(events_of(flown), 0.9 * lag) if lag else events_of(flown))
    stream.finish()
    made, inner = fed(stream)
    alone = sd.fuse(flown, inner._filter, start=inner.start, every=4, imu="tactical")
    late = alone.t > stream.start.t + 1e-6
    assert np.array_equal(made.t, alone.t[late])
    heading = slice(0, 2 if ahrs == "vru" else 3)
    assert np.array_equal(made.y[:, heading], alone.trajectory.rph[late][:, heading])
    batch = sd.fuse(
        replace(stream.solution.recording, imu=flown.imu), FED, imu="tactical", start=stream.start
    )
    assert np.array_equal(stream.belief.lla, batch.trajectory.lla[-1])
    assert dict(zip(batch.innovations.names, [c for c in stream.counts() if sum(c)])) == (
        batch.counts()
    )
    assert stream.notes[0].startswith(f"attitude from {made.name} at 5 Hz")


def test_it_is_close_to_what_fuse_makes():
    """Alignment sees the whole recording there and its first 10 s here."""
    flown = recording()
    stream = Stream(FED, imu="tactical", sources=flown.sources)
    play(stream, events_of(flown))
    batch = sd.fuse(flown, FED)
    assert stream.start.t == batch.meta["start"]["t"]
    assert np.abs(stream.solution.trajectory.lla[-1] - batch.trajectory.lla[-1]).max() < 1e-6
    made, _ = fed(stream)
    whole, _ = source(flown, stream._ahrs.stream._filter, run_options())
    assert np.array_equal(whole.t[-len(made.t) :], made.t)
    assert np.abs(whole.y[-len(made.t) :] - made.y).max() < 1e-6
    assert np.abs(whole.std[-len(made.t) :] - made.std).max() < 1e-6


def test_looking_ahead_looks_ahead_in_the_ahrs_too():
    flown = recording()
    ahead, at_once = (
        Stream(FED, imu="tactical", sources=flown.sources, lag=lag) for lag in (1.0, 0.0)
    )
    for event in events_of(flown):
        ahead.step(event)
        at_once.step(event)
        if at_once.started and ahead.started and type(event) is sd.Sample:
            assert np.array_equal(ahead.now.lla, at_once.belief.lla)
    assert np.array_equal(ahead.finish().P, at_once.finish().P) and ahead.dropped == at_once.dropped


def test_a_given_start_begins_both_at_once():
    flown = recording()
    begin = sd.align(flown, sd.imu("tactical"), position=True)
    stream = Stream(FED, start=begin, imu="tactical", sources=flown.sources)
    play(stream, events_of(flown))
    assert stream.start == begin and fed(stream)[1].start == begin
    assert stream.counts()[2] == (0, 0) and sum(stream.counts()[3]) > 150


def test_an_ahrs_that_is_asked_for_takes_the_place_of_recorded_attitude():
    flown = replace(recording(), sources=(*recording().sources, recorded()))
    begin = sd.align(recording(), sd.imu("tactical"))
    plain = Stream(FED, start=begin, imu="tactical", sources=flown.sources)
    asked = Stream(FED, start=begin, imu="tactical", sources=flown.sources, ahrs="attitude-mekf")
    for stream in (plain, asked):
        play(stream, events_of(flown))
    assert plain.counts()[3][0] > 0 and len(plain.counts()) == 4
    assert asked.counts()[3] == (0, 0) and asked.counts()[4][0] > 0


def test_a_rate_beyond_that_of_the_imu_is_refused():
    flown = recording()
    begin = sd.align(flown, sd.imu("tactical"))
    stream = Stream(FED, start=begin, imu="tactical", sources=flown.sources, ahrs_rate=50.0)
    with pytest.raises(DataError, match="^ahrs_rate is 50 Hz; it must be at most the IMU's 20 Hz"):
        play(stream, events_of(flown))


def test_an_ahrs_that_stops_is_said_once():
    flown = recording()
    begin = sd.align(flown, sd.imu("tactical"))
    stream = Stream(FED, start=begin, imu="tactical", sources=flown.sources)
    play(stream, events_of(flown)[:300])
    stream._ahrs.stream.belief.C_nb[...] = np.nan
    play(stream, events_of(flown)[300:])
    (text,) = [text for _, text in stream.events if text.startswith("attitude-mekf")]
    assert "stopped at" in text and text.endswith("no attitude from here on")
    assert np.isfinite(stream.finish().lla).all()


def test_what_the_ahrs_says_of_itself_the_stream_says_too():
    flown = recording()
    heavy = replace(flown, imu=flown.imu._replace(dv=flown.imu.dv * 1.2))
    stream = Stream(FED, imu="tactical", sources=heavy.sources)
    play(stream, events_of(heavy))
    said = {text for _, text in stream.events if text.startswith("attitude-mekf: ")}
    alone = sd.fuse(heavy, "attitude-mekf", start=stream._ahrs.stream.start, imu="tactical")
    own = {condition.text for condition in stream._ahrs.stream._filter.conditions}
    assert said and said == {f"attitude-mekf: {text}" for _, text in alone.events if text in own}
