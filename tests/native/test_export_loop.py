"""The example of firmware in an export, on this machine: UBX in, NMEA out."""

import struct
from dataclasses import replace

import numpy as np
import pynmeagps
import pytest
import written_ubx
from loop_streams import (
    BOOTED,
    COMPILER,
    arrivals,
    drive,
    fixes,
    hidden,
    restarted,
    run_desk,
    stream,
)

from strapdown.geometry.geodesy import displacement
from strapdown.native.export.chosen import choose_export
from strapdown.native.export.folder import export, find_target

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler is found")
GPS, WEEK_END = written_ubx.GPS, 604_800_000
"""ms."""


@pytest.fixture(scope="module")
def flight():
    return drive()


@pytest.fixture(scope="module")
def desk(tmp_path_factory, flight):
    folder = tmp_path_factory.mktemp("desk")
    export(
        choose_export("closed-loop", ["position", "velocity"], flight), find_target("host"), folder
    )
    return folder


def sentences(desk, data, *words):
    """Parsed GGA and RMC of the loop; each has a right checksum."""
    found = [pynmeagps.NMEAReader.parse(line) for line in run_desk(desk, data, *words)]
    return found[::2], found[1::2]


def day_seconds(gga):
    return np.array(
        [
            o.time.hour * 3600 + o.time.minute * 60 + o.time.second + o.time.microsecond * 1e-6
            for o in gga
        ]
    )


def test_late_fixes_become_sentences_near_the_truth(desk, flight):
    messages = [(0.0, b"\xb5\xb5"), *hidden(fixes(flight, GPS), 60.0, 70.0)]
    gga, rmc = sentences(desk, stream(arrivals(flight, GPS, messages)))
    assert len(gga) == len(rmc) > 400
    assert {one.msgID for one in gga} == {"GGA"} and {one.msgID for one in rmc} == {"RMC"}
    offset = GPS % WEEK_END * 1e-3 - flight.sources[0].t[0]
    t = day_seconds(gga) + 18 + 5 * 86400 - offset  # Friday; 18 leap seconds
    truth = flight.reference
    at = np.searchsorted(truth.t, t - 0.006)
    assert np.abs(truth.t[at] - t).max() < 0.011
    lla = np.array([(np.radians(o.lat), np.radians(o.lon), o.alt + o.sep) for o in gga])
    error = displacement(lla, truth.lla[at])
    settled = (t > 40.0) & (t < 60.0)
    assert np.sqrt((error[settled] ** 2).sum(axis=1).mean()) < 2.0
    assert np.linalg.norm(error, axis=1).max() < 40.0
    quality = np.array([o.quality for o in gga])
    assert set(quality[(t > 63) & (t < 69.9)]) == {6} and set(quality[settled]) == {1}
    speed = np.linalg.norm(truth.v_n[at, :2], axis=1)
    np.testing.assert_allclose([o.spd * 1852 / 3600 for o in rmc], speed, atol=2.0)
    assert all(str(o.date) == "2024-05-17" for o in rmc)
    assert gga[0].sep == 47.0


def test_the_week_may_end_and_midnight_pass_without_fixes(desk, flight):
    gps = GPS // WEEK_END * WEEK_END + WEEK_END - 20_000 - 1_000 * 4
    (usual, _), (gga, rmc) = (
        sentences(desk, stream(arrivals(flight, begins, hidden(fixes(flight, begins), 40.0, 80.0))))
        for begins in (GPS, gps)
    )
    places = [[(o.lat, o.lon, 1e-5 * o.alt) for o in found] for found in (usual, gga)]
    np.testing.assert_allclose(*places, rtol=0, atol=1e-6)  # deg; m times 1e-5
    assert len(gga) > 400 and {o.quality for o in gga} == {1, 6}
    dates = [str(o.date) for o in rmc]
    assert dates[0] == "2024-05-18" and "" in dates and dates[-1] == "2024-05-19"
    assert {o.time.hour for o in gga} == {23, 0}


def test_damage_costs_the_message_that_it_hits(desk, flight):
    messages = fixes(flight, GPS)
    arrival, whole = messages[100]
    without = run_desk(desk, stream(arrivals(flight, GPS, messages[:100] + messages[101:])))
    assert without != run_desk(desk, stream(arrivals(flight, GPS, messages)))
    flipped = [bytes([*whole[:at], whole[at] ^ 8, *whole[at + 1 :]]) for at in (2, 40, 99)]
    lost = [whole[:at] + whole[at + many :] for at, many in ((0, 1), (4, 2), (50, 1), (60, 40))]
    for damaged in (*flipped, *lost, whole[:50], b"\xb5b\x01\x07" + whole[:7]):
        messages[100] = arrival, damaged
        assert run_desk(desk, stream(arrivals(flight, GPS, messages))) == without, damaged


def test_a_fix_that_comes_twice_counts_once(desk, flight):
    messages = fixes(flight, GPS)
    twice = [(t + by, data) for t, data in messages for by in (0.0, 0.03)]
    assert run_desk(desk, stream(arrivals(flight, GPS, twice))) == (
        run_desk(desk, stream(arrivals(flight, GPS, messages)))
    )


@pytest.mark.parametrize("after_a_fix", [False, True])
def test_a_restart_is_a_gap_of_the_same_length(desk, flight, tmp_path, after_a_fix):
    at = fixes(flight, GPS)[200][0] if after_a_fix else 42.257
    first, second, both = restarted(arrivals(flight, GPS), at)
    assert (first[-1][1][:1] == b"B") == after_a_fix
    before = run_desk(desk, stream(first), tmp_path / "state")
    after = run_desk(desk, stream(second), tmp_path / "state")
    assert len(before) > 350 and len(after) > 400
    assert before + after == run_desk(desk, stream(both))
    (tmp_path / "state").write_bytes(b"damaged")
    assert len(run_desk(desk, stream(second), tmp_path / "state")) > 400  # it begins anew


def pulse(t):
    return t, b"P" + struct.pack("<d", t + BOOTED)


def test_a_stray_pulse_changes_nothing(desk, flight):
    events = arrivals(flight, GPS)
    stray = [*events, pulse(40.31), pulse(60.77)]
    stray.sort(key=lambda event: event[0])
    assert run_desk(desk, stream(stray)) == run_desk(desk, stream(events))


def shifted(events, at, by):
    """The board's clock is `by` s off from then on."""
    moved = []
    for t, data in events:
        if t > at and data[:1] != b"B":
            clock = struct.unpack("<d", data[1:9])[0] + by
            data = data[:1] + struct.pack("<d", clock) + data[9:]
        moved.append((t, data))
    return moved


@pytest.mark.parametrize("by", [-3600.0, -0.3, 0.3, 3600.0, 1e6, -1e6])
def test_after_a_jump_of_the_clock_it_goes_on(desk, flight, by):
    gga, _ = sentences(desk, stream(shifted(arrivals(flight, GPS), 40.0, by)))
    t = day_seconds(gga)
    assert t[-1] == day_seconds(sentences(desk, stream(arrivals(flight, GPS)))[0])[-1]
    assert {o.quality for o in gga[-150:]} == {1}


def test_samples_that_are_no_numbers_are_left_out(desk, flight):
    events = arrivals(flight, GPS)
    for k in (3, 900, 4000):
        at = [i for i, (_, data) in enumerate(events) if data[:1] == b"S"][k]
        t, data = events[at]
        events[at] = t, data[:1] + struct.pack("<8d", *[float("nan")] * 8)
    gga, _ = sentences(desk, stream(events))
    assert len(gga) > 400 and {o.quality for o in gga[-200:]} == {1}


def test_a_receiver_of_ten_hertz_starts_it_too(desk):
    """Its fixes are closer together than the time that levelling takes; it stands at first."""
    fast = drive(20.0, interval=0.1)
    position, velocity = fast.sources
    velocity = replace(velocity, y=velocity.y * (velocity.t > 10.0)[:, None])
    data = stream(arrivals(replace(fast, sources=(position, velocity)), GPS))
    assert 80 < len(run_desk(desk, data)) < 110


def test_a_sample_without_a_time_changes_nothing(desk, flight):
    """Its infinite clock would keep the time of week of every later fix waiting for ever."""
    events = arrivals(flight, GPS)
    at = next(k for k, (t, data) in enumerate(events) if t > 50.0 and data[:1] == b"B")
    endless = events[at][0], b"S" + struct.pack("<8d", float("inf"), 0.01, *[0.0] * 6)
    assert run_desk(desk, stream([*events[:at], endless, *events[at:]])) == (
        run_desk(desk, stream(events))
    )


def without_fix(frame):
    """A UBX-NAV-PVT that tells the time, and that there is no fix."""
    body = bytearray(frame[2:-2])
    body[4 + 20] = 0
    first = second = 0
    for byte in body:
        first = (first + byte) % 256
        second = (second + first) % 256
    return frame[:2] + bytes(body) + bytes([first, second])


def test_nothing_is_said_after_a_restart_before_a_fix_has_told_utc(desk, flight, tmp_path):
    messages = fixes(flight, GPS)
    at = messages[200][0]
    lost = [(t, without_fix(data) if at < t < at + 5.0 else data) for t, data in messages]
    first, second, _ = restarted(arrivals(flight, GPS, lost), at)
    run_desk(desk, stream(first), tmp_path / "state")
    lines = run_desk(desk, stream(second), tmp_path / "state")
    moments = [line.split(b",")[1] for line in lines if line[3:6] == b"GGA"]
    assert moments and moments == sorted(moments)  # GPS time would be ahead by 18 s
