"""Robust and adaptive sources over whole recordings: alike live, smoothed and in batch, in every
filter, and what each costs and saves."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import OPTIONS, ahrs, events_of, flight, same, start

import strapdown as sd
from strapdown import filters
from strapdown.checks import DataError
from strapdown.engine.stream import Stream
from strapdown.geometry.geodesy import displace_lla
from strapdown.sim.trajectory import demo_flight

BOTH = dict(robust=True, adaptive=60.0)


def with_outliers(recording, share=0.1, size=20.0, seed=4):
    """(recording with this share of its positions and velocities off by `size` std, which ones)."""
    rng, changed, wrong = np.random.default_rng(seed), [], []
    for a in recording.sources:
        bad = rng.random(len(a.t)) < share
        error = rng.normal(size=(len(a.t), 3))
        error *= size * 3**0.5 / np.linalg.norm(error, axis=1)[:, None] * bad[:, None]
        if a.kind == "position":
            a = replace(a, y=displace_lla(a.y, error * a.std))
        elif a.kind == "velocity":
            a = replace(a, y=a.y + error * a.std)
        else:
            bad[:] = False
        changed.append(a)
        wrong.append(bad)
    return replace(recording, sources=tuple(changed)), wrong


def live(recording, name, begin, **options):
    """The finished Stream of a recording's events in time order."""
    stream = Stream(name, start=begin, imu="tactical", sources=recording.sources, **options)
    for event in events_of(recording):
        stream.step(event)
    stream.finish()
    return stream


def weighed(recording, **options):
    return replace(recording, sources=tuple(replace(a, **options) for a in recording.sources))


@pytest.mark.parametrize(
    "name", [name for name in filters.own_names() if 0 in filters.find(name).estimates]
)
def test_every_filter_weighs_or_says_that_it_cannot(name):
    recording, wrong = with_outliers(flight())
    recording = weighed(recording, **BOTH)
    if filters.find(name).needs:
        recording = replace(recording, sources=(*recording.sources, ahrs(recording.reference, 2.0)))
    options = OPTIONS.get(name, {})
    found = sd.fuse(recording, name, imu="tactical", start=start(flight()), options=options)
    fixes, notes = found.innovations, " ".join(found.meta["notes"])
    if not filters.find(name).weighs:
        assert "it ignores robust and adaptive of GNSS position, GNSS velocity" in notes
        assert set(fixes.weight) <= {0.0, 1.0} and (fixes.followed == 1).all()
        return
    assert "it ignores" not in notes
    for source, bad in enumerate(wrong):
        own = fixes.source == source
        bad = np.isin(fixes.t[own], recording.sources[source].t[bad])
        # all but one that stands beside what the filter itself does not know
        assert bad.any() and np.median(fixes.weight[own][bad]) < 0.1
        assert np.median(fixes.weight[own][~bad]) == 1
        assert not fixes.accepted[own][bad].any() and fixes.accepted[own][~bad].mean() > 0.85
    assert (fixes.followed != 1).any() and found.status.max() < 3 + len(wrong)


@pytest.mark.parametrize("name", ["closed-loop", "xkf"])
def test_live_it_is_the_batch_bit_for_bit(name):
    recording = weighed(with_outliers(flight())[0], **BOTH)
    begin = start(flight())
    first = sd.fuse(recording, name, imu="tactical", start=begin)
    second = live(recording, name, begin).solution
    assert same(first, second)
    for part in ("weight", "followed", "root", "whitened"):
        a, b = (getattr(each.innovations, part) for each in (first, second))
        assert np.array_equal(a, b, equal_nan=True)


def test_smoothing_goes_back_over_what_was_used():
    """Against itself with the outliers left out, and with the weights that a robust source found
    stated as standard deviations."""
    recording, _ = with_outliers(flight())
    begin = start(flight())
    found = sd.smooth(recording, imu="tactical", start=begin, robust=True)
    stated = []
    for k, a in enumerate(recording.sources):
        own = found.innovations.source == k
        used = a._where(np.isin(a.t, found.innovations.t[own]))
        weight = found.innovations.weight[own]
        stated.append(replace(used, std=used.std / np.sqrt(weight)[:, None], gate=np.inf))
    again = sd.smooth(replace(recording, sources=tuple(stated)), imu="tactical", start=begin)
    np.testing.assert_allclose(again.trajectory.lla, found.trajectory.lla, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.trajectory.std, found.trajectory.std, rtol=1e-6, atol=1e-12)


def position_rms(recording, **options):
    found = sd.errors(sd.fuse(recording, imu="tactical", **options), recording.reference)
    return np.sqrt(np.mean(np.sum(found.position[found.t > 20] ** 2, axis=1)))


def test_price_on_clean_data_and_with_outliers():
    plain, robust, adaptive, outliers = np.zeros((4, 4))
    for k, seed in enumerate((31, 32, 33, 34)):
        clean = sd.simulate(demo_flight(), 120.0, "tactical", seed, rate=20.0)
        plain[k] = position_rms(clean)
        robust[k] = position_rms(clean, robust=True)
        adaptive[k] = position_rms(clean, adaptive=60.0)
        outliers[k] = position_rms(with_outliers(clean, seed=seed)[0], robust=True)
    whole = np.sqrt(np.mean(plain**2))
    ratio = lambda rms: np.sqrt(np.mean(rms**2)) / whole
    assert ratio(robust) < 1.02 and ratio(adaptive) < 1.03 and ratio(outliers) < 1.15


@pytest.mark.parametrize("wrong", [1 / 3, 3.0])
def test_a_standard_deviation_stated_wrong_is_found(wrong):
    recording = sd.simulate(demo_flight(), 360.0, "tactical", 8, rate=20.0)
    stated = replace(
        recording, sources=tuple(replace(a, std=a.std * wrong) for a in recording.sources)
    )
    found = sd.fuse(stated, imu="tactical", adaptive=60.0).innovations
    late = found.t > found.t[0] + 270  # 4.5 memories
    for source in range(2):
        ratio = found.followed[late & (found.source == source)].mean()
        assert ratio * wrong == pytest.approx(1, rel=0.15)


def test_a_lasting_jump_is_taken_in_the_end():
    recording = flight()
    p, v = recording.sources
    y = p.y.copy()
    y[8:] = displace_lla(y[8:], np.tile([40.0, 0.0, 0.0], (len(y) - 8, 1)))
    jumped = replace(recording, sources=(replace(p, y=y), v))
    found = sd.fuse(jumped, imu="tactical", start=start(recording), robust=True)
    own = found.innovations.source == 0
    assert (found.innovations.weight[own][8:13] < 0.02).all()
    assert found.innovations.accepted[own][-3:].all()
    assert any("opened" in text for _, text in found.events)


def test_sources_by_name_and_what_is_refused():
    recording, begin = flight(), start(flight())
    found = sd.fuse(
        recording, imu="tactical", start=begin, robust="position", adaptive={"GNSS velocity": 30}
    )
    p, v = found.recording.sources
    assert (p.robust, p.adaptive, v.robust, v.adaptive) == (True, 0.0, False, 30.0)
    off = sd.fuse(weighed(recording, **BOTH), imu="tactical", start=begin, robust=False, adaptive=0)
    assert same(off, sd.fuse(recording, imu="tactical", start=begin))
    for options, words in (
        (dict(robust="odometer"), "no source 'odometer'; the recording has GNSS position"),
        (dict(robust=3), "must be True, False, or names"),
        (dict(adaptive=-1), "adaptive is -1 s"),
        (dict(adaptive={"GNSS velocity": np.nan}), "adaptive of GNSS velocity is nan"),
    ):
        with pytest.raises(DataError, match=words):
            sd.fuse(recording, imu="tactical", start=begin, **options)


def test_a_stream_takes_the_same_words_as_a_batch():
    recording, begin = flight(), start(flight())
    live_run = live(recording, "closed-loop", begin, **BOTH).solution
    batch = sd.fuse(recording, imu="tactical", start=begin, **BOTH)
    assert np.array_equal(live_run.trajectory.lla, batch.trajectory.lla)
    assert np.array_equal(live_run.innovations.weight, batch.innovations.weight)
    assert not np.array_equal(
        batch.trajectory.lla, sd.fuse(recording, imu="tactical", start=begin).trajectory.lla
    )
    with pytest.raises(DataError, match="no source 'odometer'"):
        live(recording, "closed-loop", begin, robust="odometer")
