"""Clocks of devices against arrival: offset and drift from the smallest delays, whatever the others are."""

import json
import socket
import time

import numpy as np
import pytest
from recordings import events_of, flight
from test_live_program import config, free_port, ubx_bytes

import strapdown as sd
from strapdown.cli.live.arrival_clock import BIN, MAX_DRIFT, ArrivalClock
from strapdown.cli.live.clocked_events import ClockedEvents
from strapdown.cli.live.input_formats import Clock
from strapdown.engine.stream import Sample
from strapdown.units.time_scales import gps_from_unix, unix_from_gps

pytestmark = pytest.mark.short

LEAST = 0.002
"""s, the smallest delay."""
ZERO = 0.0, 0.0, 0.0


def stamped(seconds, rate=100.0, offset=5000.0, drift=40e-6, jitter=0.004, seed=1):
    """(stamps, times of arrival, times at which the fastest would have arrived), s."""
    generator = np.random.default_rng(seed)
    true = 1.7e9 + np.arange(round(seconds * rate)) / rate
    stamps = (true - true[0]) / (1 + drift) + offset
    arrived = true + LEAST + generator.exponential(jitter, len(true))
    return stamps, np.maximum.accumulate(arrived), true + LEAST


def mapped(clock, stamps, arrived, steady=False):
    """Times that the clock gives, NaN before it is ready."""
    found = []
    for stamp, at in zip(stamps.tolist(), arrived.tolist()):
        taken = clock.take(stamp, at)
        found.append(clock.time(stamp, steady) if taken and clock.ready else np.nan)
    return np.array(found)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("drift", [0.0, 40e-6, -200e-6])
def test_offset_and_drift_come_from_the_smallest_delays(drift, seed):
    clock = ArrivalClock()
    stamps, arrived, best = stamped(200.0, drift=drift, seed=seed)
    found = mapped(clock, stamps, arrived)
    off = found - best
    assert np.isnan(off[:90]).all() and np.isfinite(off[110:]).all()
    assert np.abs(off[stamps > stamps[0] + 60.0]).max() < 0.6e-3
    assert clock.estimate.drift == pytest.approx(drift, abs=5e-6)
    assert 0.002 < clock.estimate.delay < 0.004 < clock.estimate.worst_delay < 0.03


def test_intervals_keep_their_length():
    clock = ArrivalClock()
    stamps, arrived, _ = stamped(120.0, jitter=0.01)
    steps = np.diff(mapped(clock, stamps, arrived, steady=True)[110:])
    assert np.abs(steps / np.diff(stamps[110:]) - 1).max() <= MAX_DRIFT * 1.05


def test_two_measurements_of_each_epoch_at_1_hz():
    """The first one completes a second, and the other begins the next one with the same stamp."""
    clock = ArrivalClock()
    stamps, arrived, best = stamped(200.0, rate=1.0, drift=0.0)
    arrived[[0, 2]] += 0.1  # so that the fastest of the first two seconds is the same epoch
    found = mapped(clock, np.repeat(stamps, 2), np.repeat(arrived, 2))[::2]
    assert np.abs((found - best)[100:]).max() < 2e-3


def test_messages_that_come_late_together_move_nothing():
    """A second in which the system was busy."""
    clock, other = ArrivalClock(), ArrivalClock()
    stamps, arrived, _ = stamped(100.0)
    late = np.where((stamps > stamps[5000]) & (stamps < stamps[5150]), arrived[5150], arrived)
    a, b = mapped(clock, stamps, arrived), mapped(other, stamps, late)
    assert np.nanmax(np.abs(a - b)) < 0.2e-3


@pytest.mark.parametrize("drift", [0.0, 40e-6])
@pytest.mark.parametrize("late, first", [(1.5, 0.4), (20.0, 0.4), (80.0, 0.9), (80.0, 0.03)])
def test_a_smaller_delay_counts_at_once(late, first, drift):
    """Delays are longer until `late` s."""
    clock = ArrivalClock()
    stamps, arrived, best = stamped(200.0, drift=drift)
    behind = stamps - stamps[0]
    found = []
    delayed = np.maximum.accumulate(arrived + first * (behind < late))
    for stamp, at in zip(stamps.tolist(), delayed.tolist()):
        assert clock.take(stamp, at)
        found.append(clock.time(stamp) if clock.ready else np.nan)
        if clock.ready:
            assert clock.estimate.offset == pytest.approx(found[-1] - stamp, abs=1e-3)
    off = np.abs(np.array(found) - best)
    assert np.nanmax(off[behind > late + first + 0.2]) < 6e-3
    assert np.nanmax(off[behind > late + 60.0]) < 1.5e-3
    assert len(clock.news) == (first > 0.1)


def test_samples_catch_up_and_no_motion_is_lost():
    """The first 1.5 s come 0.4 s late, the others as they should; the stream ends in the same attitude and
    velocity."""
    recording = flight(20.0)
    begin = sd.align(recording, "tactical")
    samples = [each for each in events_of(recording) if type(each) is Sample and each.t > begin.t]
    said, states, off = [], [], []
    for delay in (0.4, 0.0):
        clock = ArrivalClock()
        events = ClockedEvents(clock, Clock(gps_from_unix(1.7e9)))
        start = begin._replace(t=begin.t + LEAST + delay)
        live = sd.LiveStream(
            "closed-loop", imu="tactical", start=start, on_event=lambda *told: said.append(told)
        )
        stamps = iter(samples)
        for each in samples:
            late = LEAST + delay * (each.t < samples[0].t + 1.5)
            for event in events.take([each], 1.7e9 + each.t + late):
                live.step(event)
                off.append(event.t - next(stamps).t - LEAST)
            if clock.ready:
                assert clock.estimate.offset == pytest.approx(1.7e9 + off[-1] + LEAST, abs=1e-5)
        states.append(live.belief)
        assert not sum(live.dropped_by.values())
    n = len(off) // 2
    assert max(off[:20]) > 0.39 and max(map(abs, off[80:n])) < 0.006
    assert max(map(abs, off[200:n])) < 1e-5 and max(map(abs, off[n:])) < 1e-5
    assert said == []
    late, plain = states
    assert np.abs(late.C_nb - plain.C_nb).max() < 1e-6
    assert np.abs(late.v_n - plain.v_n).max() < 1e-3


def test_that_times_were_late_is_said(tmp_path, monkeypatch):
    from strapdown.cli.live import program

    port, said, now = free_port(), [], [0.0]
    monkeypatch.setattr(program, "time_of_arrival", lambda *_: 1.7e9 + now[0])
    monkeypatch.setattr(program, "LOOK", 0.0)
    part = {"port": f"udp:{port}", "clock": "arrival"}
    with (
        sd.Live(config(tmp_path, part), on_event=lambda t, text: said.append(text)) as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        live.turn()
        for k in range(300):
            now[0] = max(0.01 * k + (0.4 if k < 150 else 0.002), now[0])
            table = {"t": 0.01 * k, "dt": 0.01, "dtheta": [0, 0, 0], "dv": [0, 0, -0.098]}
            sender.sendto(json.dumps(table).encode(), ("127.0.0.1", port))
            live.turn()
    assert [text for text in said if " ms earlier than all before" in text] == [
        f"udp:127.0.0.1:{port}: messages come 398 ms earlier than all before, whose delays were longer; the "
        "smallest delay is that of these"
    ]


def test_delays_that_are_longer_for_long_move_nothing():
    """For 100 s, soon after the start."""
    clock = ArrivalClock()
    stamps, arrived, best = stamped(200.0, drift=0.0)
    behind = stamps - stamps[0]
    found = mapped(clock, stamps, arrived + 0.4 * ((behind > 10.0) & (behind < 110.0)))
    assert np.nanmax(np.abs(found - best)) < 2e-3


def test_a_device_that_restarts_is_another_clock():
    clock = ArrivalClock()
    stamps, arrived, best = stamped(60.0)
    stamps[3000:] -= stamps[3000] - 1.0
    found = mapped(clock, stamps, arrived)
    assert clock.restarts == 1
    assert np.nanmax(np.abs(found - best)[3200:]) < 5e-3
    assert (np.diff(stamps[3000:]) > 0).all() and BIN == 1.0


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e300, -1e6, 100.0, -100.0])
@pytest.mark.parametrize("first", [True, False])
def test_a_single_wrong_stamp_moves_nothing(wrong, first):
    """The first one, then one in each second."""
    stamps, arrived, _ = stamped(20.0)
    bad = stamps.copy()
    bad[0 if first else 50 :: 100] += wrong
    clock = ArrivalClock()
    found = mapped(clock, bad, arrived)
    assert np.isnan(found[110:]).sum() == (18 if first else 19)
    plain = mapped(ArrivalClock(), stamps, arrived)
    assert np.nanmax(np.abs(found - plain)) < 0.5e-3
    # the second message off by as much as the first is of another clock
    assert clock.restarts == int(first and np.isfinite(wrong))


@pytest.mark.parametrize(
    "stamps, bad, text",
    [
        (
            [*range(300), 9e7],
            1,
            "1 line or piece, the first: a stamp of 900000 s is of another clock",
        ),
        (range(50), 50, "50 lines or pieces, the first: its clock was not known in time"),
    ],
)
def test_why_stamps_are_of_no_use_is_said(tmp_path, stamps, bad, text):
    path, said = tmp_path / "lines", []
    table = {"dt": 0.01, "dtheta": [0, 0, 0], "dv": [0, 0, -0.098]}
    path.write_text("".join(json.dumps(table | {"t": 0.01 * k}) + "\n" for k in stamps))
    part = {"port": f"file:{path}", "clock": "arrival"}
    with sd.Live(config(tmp_path, part), on_event=lambda t, text: said.append(text)) as live:
        for _ in range(20):
            live.turn()
    assert live.bad == bad and f"file:{path}: not read: {text}" in said


def test_what_waits_for_a_clock_is_bounded_and_counted(tmp_path, monkeypatch):
    from strapdown.cli.live import clocked_events

    monkeypatch.setattr(clocked_events, "MAX_HELD", 100)
    path = tmp_path / "lines"
    live = sd.Live(config(tmp_path, {"port": f"file:{path}", "clock": "arrival"}))
    table = {"t": 5.0, "dt": 0.01, "dtheta": [0, 0, 0], "dv": [0, 0, 0]}
    odd = [json.dumps(table | {"t": t}) for t in (float("nan"), 1e300, -1e300)]
    stuck = [json.dumps(table)] * 50
    for _ in range(10):
        with path.open("a") as file:
            file.write("\n".join(odd + stuck) + "\n")
        live.turn()
    assert len(live.inputs[0].clocked._held) <= 151 and live.bad >= 30 + 10 * 50 - 151
    live.close()
    assert live.bad == 30 + 10 * 50


def test_a_clock_that_restarts_within_a_batch_gets_no_stamps_of_the_one_before():
    events = ClockedEvents(ArrivalClock(), Clock())
    for k in range(200):
        events.take([Sample(1000 + 0.01 * k, 0.01, ZERO, ZERO)], 1.7e9 + 0.01 * k)
    stamps = [1002.0, 0.0, 0.01]
    assert not events.take([Sample(t, 0.01, ZERO, ZERO) for t in stamps], 1.7e9 + 2.0)
    assert events.bad == 2  # that of the clock before, and the first one of the new clock
    found = []
    for k in range(2, 150):
        found += events.take([Sample(0.01 * k, 0.01, ZERO, ZERO)], 1.7e9 + 1.99 + 0.01 * k)
    assert len(found) == 149
    assert max(abs(np.diff([each.t for each in found]) - 0.01)) < 1e-4


def test_a_latency_is_taken_off():
    stamps, arrived, _ = stamped(20.0)
    plain, late = (mapped(ArrivalClock(known), stamps, arrived) for known in (0.0, 0.1))
    assert np.nanmax(np.abs(plain - late - 0.1)) < 1e-6


def test_an_imu_and_a_receiver_with_clocks_of_their_own(tmp_path, monkeypatch):
    """Each by UDP with its own offset and drift; on one clock by their arrival."""
    from strapdown.cli.live import program

    recording, ports, now = flight(60.0), (free_port(), free_port()), [0.0]
    monkeypatch.setattr(program, "time_of_arrival", lambda *_: 1.7e9 + now[0])
    inputs = [{"port": f"udp:{port}", "clock": "arrival"} for port in ports]
    inputs[1]["latency"] = 0.1
    live = sd.Live(config(tmp_path, *inputs))
    live.turn()
    generator = np.random.default_rng(2)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sent = []
    for event in events_of(recording):
        is_sample = type(event) is Sample
        delay = LEAST + generator.exponential(0.003) + (0.0 if is_sample else 0.1)
        sent.append((event.t + delay, event))
    for arrived, event in sorted(sent, key=lambda each: each[0]):
        now[0] = arrived
        if type(event) is Sample:
            table = event._asdict() | {"t": 300.0 + event.t * (1 - 50e-6)}
        else:
            name = recording.sources[event.source].name
            table = event._asdict() | {"t": 9e6 + event.t * (1 + 20e-6), "source": name}
        sender.sendto(json.dumps(table).encode(), ("127.0.0.1", ports[type(event) is not Sample]))
        live.turn()
    sender.close()
    live.close()
    assert live.stream.started and live.stream.counts()[0][0] >= 45
    imu, receiver = live.clocks.values()
    assert imu.drift == pytest.approx(50e-6, abs=20e-6)
    assert receiver.delay < 0.02
    off = (live.stream.belief.lla - recording.reference.lla[-1]) * [6.4e6, 4.3e6, 1.0]
    assert np.abs(off).max() < 6.0, off
    assert "ppm" in str(imu)


def test_a_receiver_by_its_arrival(tmp_path, monkeypatch):
    """Epochs count as they come, not as they are decoded."""
    from strapdown.cli.live import program

    monkeypatch.setattr(program, "STARTED", 1.7e9)
    path = tmp_path / "gnss.ubx"
    part = {"port": f"file:{path}", "format": "ubx", "clock": "arrival"}
    live, taken = sd.Live(config(tmp_path, part)), []
    live.stream.step = taken.append
    data = ubx_bytes(12)
    size = len(data) // 12
    for k in range(12):
        with path.open("ab") as file:
            file.write(data[k * size : (k + 1) * size])
        end = time.monotonic() + 0.2
        while time.monotonic() < end:
            live.turn()
            time.sleep(0.002)
    live.close()
    (estimate,) = live.clocks.values()
    # decoded they are 0.2 s later, on a machine with other work some ms
    assert estimate.delay < 0.1 and len(taken) >= 20
    # on the clock of this machine, though the receiver says 2024-05-17
    unix = unix_from_gps(live.clock.epoch + taken[-1].t)
    assert abs(unix - (1.7e9 + time.monotonic())) < 1.0
    position = [event.t for event in taken if event.source == 0]
    assert np.diff(position) == pytest.approx(0.2, abs=0.05)


def test_a_source_without_stamps_counts_at_its_arrival(tmp_path, monkeypatch):
    """Positions 0.1 s late, up to 5 ms more; the IMU has UNIX times."""
    from strapdown.cli.live import program

    recording, ports, now = flight(30.0), (free_port(), free_port()), [0.0]
    monkeypatch.setattr(program, "time_of_arrival", lambda *_: 1.7e9 + now[0])
    inputs = [
        {"port": f"udp:{ports[0]}", "clock": "unix"},
        {"port": f"udp:{ports[1]}", "clock": "none", "latency": 0.1},
    ]
    live = sd.Live(config(tmp_path, *inputs))
    live.turn()
    generator = np.random.default_rng(2)
    sent = []
    for event in events_of(recording):
        is_sample = type(event) is Sample
        delay = 0.0 if is_sample else 0.1 + generator.uniform(0.0, 0.005)
        sent.append((event.t + delay, event))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for arrived, event in sorted(sent, key=lambda each: each[0]):
            now[0], table = arrived, event._asdict()
            if type(event) is Sample:
                table["t"] += 1.7e9
            else:
                del table["t"]
            port = ports[type(event) is not Sample]
            sender.sendto(json.dumps(table).encode(), ("127.0.0.1", port))
            live.turn()
        sample = json.dumps({"gyro": [0.0] * 3, "accel": [0.0] * 3})
        sender.sendto(sample.encode(), ("127.0.0.1", ports[1]))
        live.turn()
    live.close()
    assert live.stream.counts()[0][0] >= 18 and live.bad == 1
    assert "a sample needs a time" in live.inputs[1].decoder.why
    (found,) = live.clocks.values()
    assert found.interval == pytest.approx(0.5, abs=0.02) and 0.4 < found.jitter < 0.6
    assert "by arrival, each 0." in str(found)
    off = (live.stream.belief.lla - recording.reference.lla[-1]) * [6.4e6, 4.3e6, 1.0]
    assert np.abs(off).max() < 6.0, off
