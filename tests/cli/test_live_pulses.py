"""A receiver's pulses per second: its times within microseconds, and whatever is wrong with pulses ends in arrival
and an event."""

import heapq
import time

import numpy as np
import pytest
import written_nmea
import written_ubx
from test_live_program import FIRST, SOURCES, config

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.live import input_formats, ports, program, pulse_file
from strapdown.cli.live.arrival_clock import ArrivalClock
from strapdown.cli.live.input_formats import Clock
from strapdown.cli.live.pulse_clock import PATIENCE, STEADY, STOPPED, PulseClock
from strapdown.cli.live.pulse_file import PulseFile
from strapdown.units.time_scales import unix_from_gps

pytestmark = pytest.mark.short

OFFSET = 1.7e9
"""s, time of the machine less that of the receiver at its stamp 0."""


class Receiver:
    """Stamps, moments and arrivals of messages and pulses of a receiver whose clock drifts against the machine."""

    def __init__(self, seconds, drift=30e-6, part=0.0, delay=0.08, seed=1):
        self.random, self.drift = np.random.default_rng(seed), drift
        self.stamps = np.arange(1.0, seconds, 0.2) + 400.0 - part
        spread = self.random.uniform(0.0, 0.12, len(self.stamps))
        self.arrived = np.maximum.accumulate(self.moment(self.stamps) + delay + spread)
        self.seconds = np.arange(1.0, seconds) + 400.0 - part
        late = self.random.exponential(4e-6, len(self.seconds))
        self.pulses = self.moment(self.seconds) + late

    def moment(self, stamps):
        """Time of the machine at stamps."""
        return OFFSET + stamps * (1 + self.drift)

    def run(self, clock, pulses=None, arrived=None):
        """Errors of the times of the messages as they come (n,), NaN where there is none yet."""
        pulses = self.pulses if pulses is None else pulses
        arrived = self.arrived if arrived is None else arrived
        messages = zip(arrived.tolist(), self.stamps.tolist())
        errors = []
        for at, stamp in heapq.merge(((at, np.nan) for at in np.sort(pulses).tolist()), messages):
            if np.isnan(stamp):
                clock.take_pulse(at)
            else:
                taken = clock.take(stamp, at)
                clock.look(at)
                known = taken and clock.ready
                errors.append(clock.time(stamp) - self.moment(stamp) if known else np.nan)
        return np.array(errors)


# ---- times


@pytest.mark.parametrize("drift", [0.0, 30e-6, -80e-6])
@pytest.mark.parametrize("seed", range(3))
def test_pulses_give_times_within_microseconds(drift, seed):
    receiver = Receiver(120.0, drift=drift, seed=seed)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock)
    since = receiver.stamps - receiver.stamps[0]
    assert (
        np.isnan(errors[since < STEADY - 1.5]).all() and np.isfinite(errors[since > STEADY]).all()
    )
    assert np.abs(errors[since > 15.0]).max() < 20e-6
    assert np.abs(errors[since > STEADY]).max() < 100e-6
    it = clock.estimate
    assert it.counts and it.left_out == 0 and it.used == len(receiver.pulses)
    assert it.drift == pytest.approx(drift, abs=0.5e-6)
    assert it.latency == pytest.approx(0.08, abs=0.005) and it.jitter < 10e-6
    assert it.delay == pytest.approx(0.06, abs=0.02)
    assert "by pulses" in str(it)
    # arrival alone is off by the smallest delay
    alone = ArrivalClock()
    for stamp, at in zip(receiver.stamps.tolist(), receiver.arrived.tolist()):
        alone.take(stamp, at)
    assert 0.07 < alone.time(stamp) - receiver.moment(stamp) < 0.09


def test_times_that_begin_within_a_second_are_on_the_whole_seconds_of_gps():
    receiver = Receiver(60.0, part=0.25)
    errors = receiver.run(PulseClock(0.0, Clock(1e9 + 0.25)))
    assert np.abs(errors[-100:]).max() < 20e-6


@pytest.mark.parametrize("delay, latency", [(0.02, 0.0), (0.8, 0.0), (1.3, 1.2), (1.3, 1.6)])
def test_latency_tells_the_second_of_messages_that_come_late(delay, latency):
    receiver = Receiver(60.0, delay=delay)
    clock = PulseClock(latency, Clock(0.0))
    assert np.abs(receiver.run(clock)[-100:]).max() < 20e-6
    assert clock.estimate.latency == pytest.approx(delay, abs=0.005)


def test_pulses_of_the_other_edge_are_told():
    """Then they come 0.1 s late, after the messages; it looks as if those were nearly a second late."""
    receiver = Receiver(30.0, delay=0.05)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, receiver.pulses + 0.1)
    assert np.abs(errors[-50:] + 0.9).max() < 1e-3
    assert "may be a second off" in clock.news[1] and "`clear`" in clock.news[1]


# ---- faults


def test_without_pulses_arrival_counts():
    receiver = Receiver(30.0)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, np.empty(0))
    since = receiver.stamps - receiver.stamps[0]
    assert np.isnan(errors[since < PATIENCE]).all()
    assert np.abs(errors[since > PATIENCE + 1.5] - 0.08).max() < 0.01
    assert clock.news == ["no pulse came; arrival less 0.0000 s counts"]
    assert "delays beyond the smallest" in str(clock.estimate)


def test_pulses_that_stop_leave_the_latency_they_measured():
    receiver = Receiver(200.0)
    clock = PulseClock(0.0, Clock(0.0))
    since = receiver.seconds - receiver.seconds[0]
    come = (since < 60.0) | (since > 150.0)
    errors = receiver.run(clock, receiver.pulses[come])
    since = receiver.stamps - receiver.stamps[0]
    assert np.abs(errors[(since > 15.0) & (since < 60.0)]).max() < 20e-6
    off = errors[(since > 60.0 + STOPPED) & (since < 150.0)]
    assert 20e-6 < np.abs(off).max() < 3e-3
    assert np.abs(errors[since > 165.0]).max() < 20e-6
    assert [text.split(";")[0] for text in clock.news] == [
        "pulses count",
        "no pulse for 5 s",
        "pulses count",
    ]
    assert clock.estimate.counts


def test_the_estimate_says_that_pulses_stopped():
    receiver = Receiver(60.0)
    clock = PulseClock(0.0, Clock(0.0))
    receiver.run(clock, receiver.pulses[:30])
    assert not clock.estimate.counts and "since pulses stopped" in str(clock.estimate)
    assert clock.estimate.latency == pytest.approx(0.08, abs=0.005)
    moment = receiver.moment(receiver.stamps[-1]) - receiver.stamps[-1]
    assert clock.estimate.offset == pytest.approx(moment, abs=3e-3)


def test_noise_between_pulses_is_left_out():
    receiver = Receiver(120.0)
    noise = receiver.random.uniform(receiver.pulses[0], receiver.pulses[-1], 150)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, np.r_[receiver.pulses, noise])
    assert np.abs(errors[-450:]).max() < 20e-6
    assert clock.left_out > 140 and clock.used >= len(receiver.pulses) - 10


def test_pulses_that_are_missing_or_late_move_nothing():
    """Every second one is missing, and some are 0.5 ms late."""
    receiver = Receiver(120.0)
    late = receiver.random.random(len(receiver.pulses)) < 0.2
    come = (receiver.pulses + 0.5e-3 * late)[::2]
    errors = receiver.run(PulseClock(0.0, Clock(0.0)), come)
    assert np.abs(errors[-400:]).max() < 50e-6


def test_two_pulses_in_a_second_tell_no_second():
    receiver = Receiver(60.0)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, np.r_[receiver.pulses, receiver.pulses + 0.5])
    assert np.abs(errors[-200:] - 0.08).max() < 0.01
    assert "pulses come, but not one in each second" in clock.news[0]
    # once the second is known they do not matter
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, np.r_[receiver.pulses, receiver.pulses[20:] + 0.5])
    assert np.abs(errors[-200:]).max() < 20e-6 and clock.left_out == len(receiver.pulses) - 20


def test_pulses_that_move_within_the_second_begin_anew():
    """As after a change of the receiver's settings."""
    receiver = Receiver(120.0)
    moved = receiver.pulses + np.where(np.arange(len(receiver.pulses)) > 60, 0.02, 0.0)
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, moved)
    assert np.abs(errors[-100:] - 0.02).max() < 20e-6 and len(clock.news) == 3


@pytest.mark.parametrize("step", [1, -1, 1000, -1000])
@pytest.mark.parametrize("at", [75, 300])
def test_times_of_messages_that_step_begin_anew(step, at):
    """A receiver learns of a leap second, or restarts, after 15 s or 60 s."""
    receiver = Receiver(120.0)
    arrived = receiver.arrived.copy()
    true, receiver.stamps = receiver.stamps.copy(), receiver.stamps.copy()
    receiver.stamps[at:] += step
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, arrived=arrived) + receiver.moment(receiver.stamps)
    assert np.abs((errors - receiver.moment(true))[-200:]).max() < 25e-6
    assert clock.restarts == 1
    assert any(f"stepped by {step} s" in text for text in clock.news) == (abs(step) == 1)


def test_a_busy_machine_moves_nothing():
    receiver = Receiver(120.0)
    since = receiver.stamps - receiver.stamps[0]
    busy = (since > 60.0) & (since < 64.0)
    late = np.where(
        busy, np.maximum(receiver.arrived, receiver.moment(receiver.stamps[0] + 64.1)), 0
    )
    clock = PulseClock(0.0, Clock(0.0))
    errors = receiver.run(clock, arrived=np.maximum(receiver.arrived, late))
    assert np.abs(errors[since > 15.0]).max() < 20e-6 and clock.restarts == 0


# ---- the file of the kernel


class Times:
    """The clocks of a machine, as the module `time` shows them."""

    def __init__(self):
        self.now, self.ahead = 1000.0, 1_700_000_000 * 10**9

    def monotonic(self):
        return self.now

    def monotonic_ns(self):
        return round(self.now * 1e9)

    def time_ns(self):
        return self.monotonic_ns() + self.ahead

    def text(self, moment, number):
        """A pulse at a time of `monotonic` as the kernel writes it."""
        ns = round(moment * 1e9) + self.ahead
        return f"{ns // 10**9}.{ns % 10**9:09d}#{number}\n"


@pytest.fixture
def times(monkeypatch):
    times = Times()
    monkeypatch.setattr(pulse_file, "time", times)
    return times


@pytest.fixture
def pulses(times, tmp_path):
    """A function that writes a pulse of 0.1 s ago, or a text, and returns what is read 1 s later."""
    file = PulseFile(str(tmp_path / "assert"))

    def read(number, text=None):
        times.now += 1.0
        shown = times.text(times.now - 0.1, number) if text is None else text
        (tmp_path / "assert").write_text(shown)
        return file.read()

    read.file = file
    return read


def test_each_new_pulse_is_read_once(pulses, times):
    assert pulses(7) is None  # it may be of long ago
    assert pulses(8) == pytest.approx(times.now - 0.1, abs=1e-7)
    assert pulses(8) is None
    assert pulses(12) is not None and pulses.file.missed == 3
    # int of C: after 2^31 - 1 comes -2^31
    assert pulses(2**31 - 1) is not None and pulses(-(2**31)) is not None
    missed = pulses.file.missed
    assert pulses(1) is not None and pulses(2) is not None  # the module was loaded again
    assert pulses.file.missed == missed and not pulses.file.error and not pulses.file.bad


def test_pulses_by_the_clocks_of_this_machine(tmp_path, monkeypatch):
    monkeypatch.setattr(pulse_file, "EVERY", 0.0)
    path, ages = tmp_path / "assert", []
    file = PulseFile(str(path))
    for number in range(6):
        ns = time.time_ns() - 250_000_000
        path.write_text(f"{ns // 10**9}.{ns % 10**9:09d}#{number}\n")
        came = file.read()
        ages += [time.monotonic() - came] if came is not None else []
    assert len(ages) >= 4 and min(ages) == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize("step", [3600.0, -3600.0, 0.01, -1e-3])
def test_a_step_of_the_system_clock_costs_a_pulse(pulses, times, step):
    """One pulse can be from before the step or after it."""
    pulses(1), pulses(2)
    times.ahead += round(step * 1e9)
    assert pulses(3) is None
    assert pulses.file.stepped == pytest.approx(step) and pulses.file.bad == 1
    assert pulses(4) == pytest.approx(times.now - 0.1, abs=1e-7)


def test_a_step_between_pulses_costs_none(pulses, times):
    pulses(1), pulses(2)
    times.ahead += 10**9
    assert pulses(2) is None and pulses(3) is not None and pulses.file.bad == 0
    assert pulses.file.stepped == 1.0


@pytest.mark.parametrize("age", [10.0, -1.0])
def test_a_pulse_of_another_time_is_bad(pulses, times, age):
    pulses(1)
    assert pulses(2, times.text(times.now + 1.0 - age, 2)) is None and pulses.file.bad == 1


@pytest.mark.parametrize("text, why", [
    ("", "it has no pulse"),
    ("1700000000.5#3", "is no pulse"),
    ("1700000000.500000000", "is no pulse"),
    ("nan#1", "is no pulse"),
    ("9" * 300, "is no pulse"),
    ("\0\xff", "is no pulse"),
])  # fmt: skip
def test_a_file_without_pulses_is_told(pulses, text, why):
    pulses(1)
    assert pulses(1, text) is None and why in pulses.file.error
    assert "/sys/class/pps" in pulses.file.error and len(pulses.file.error) < 200
    assert pulses(2) is None and not pulses.file.error
    assert pulses(3) is not None


def test_a_file_that_is_none_or_goes_is_tried_again(pulses, times, tmp_path):
    for place, why in ((tmp_path / "none", "No such file"), (tmp_path, "no regular file")):
        file = PulseFile(str(place))
        assert file.read() is None and why in file.error
    pulses(1)
    (tmp_path / "assert").unlink()
    times.now += 1.0
    assert pulses.file.read() is None and "No such file" in pulses.file.error
    times.now += 0.1  # the second of a pulse that is not looked for is not long ago
    assert pulses(2) is None and pulses(3) is not None and not pulses.file.error


def test_messages_that_come_earlier_are_told():
    receiver, clock = Receiver(60.0), PulseClock(0.0, Clock(0.0))
    arrived = receiver.arrived + 0.5 * (receiver.stamps < 430.0)
    receiver.run(clock, pulses=np.empty(0), arrived=arrived)
    assert sum("earlier than all before" in text for text in clock.news) == 1


# ---- the program


def sent_receiver(tmp_path, monkeypatch, receiver, pulses, step=0.0, **more):
    """(times of positions, events, program) of UBX at the arrivals of a receiver, and of pulses (time at which
    the file shows it, time of the pulse, number); in the middle the system clock steps."""
    times, events, taken = Times(), [], []
    for module in (program, input_formats, ports, pulse_file):
        monkeypatch.setattr(module, "time", times)
    monkeypatch.setattr(program, "STARTED", OFFSET)
    path, file = tmp_path / "gnss", tmp_path / "assert"
    part = {"port": f"file:{path}", "format": "ubx", "clock": "arrival", "pps": str(file)}
    asked = config(tmp_path, part | more, source=SOURCES[:1], log="")
    times.now = receiver.arrived[0] - OFFSET
    live = sd.Live(asked, on_event=lambda _, text: events.append(text))
    live.stream.step = taken.append
    rows = rows_of(np.round(receiver.stamps * 1e3).astype(int))[more.get("format", "ubx")]
    sent = [(at, row, 0) for at, row in zip(receiver.arrived.tolist(), rows)]
    for k, (at, what, number) in enumerate(sorted([*sent, *pulses], key=lambda each: each[0])):
        if step and k > len(sent) // 2:
            times.ahead, step = times.ahead + round(step * 1e9), 0.0
        times.now = max(at - OFFSET, times.now)
        if type(what) is bytes:
            with path.open("ab") as growing:
                growing.write(what)
        else:
            file.write_text(times.text(what - OFFSET, number))
        live.turn()
        times.now += input_formats.QUIET  # the epoch is whole
        live.turn()
    live.close()
    return unix_from_gps([live.clock.epoch + event.t for event in taken]), events, live


def rows_of(ms):
    """{format: bytes of each epoch} of moments in ms since the whole second of the first one."""
    moments = np.datetime64("2024-05-17T16:53:12", "ms") + ms.astype("m8[ms]")
    nmea = [
        written_nmea.rmc(each, 47.0, 8.0, 18.0, 54.0) + written_nmea.gga(each, 47.0, 8.0, 500.0)
        for each in moments
    ]
    ubx = written_ubx.pvt(FIRST - FIRST % 1000 + ms)
    return {"nmea": [each.encode() for each in nmea], "ubx": [each.tobytes() for each in ubx]}


def shown_pulses(receiver):
    """Pulses, which the file shows 1 ms later."""
    return [(at + 1e-3, at, k) for k, at in enumerate(receiver.pulses.tolist())]


@pytest.mark.parametrize("format", ["ubx", "nmea"])
def test_a_receiver_with_pulses_in_the_program(tmp_path, monkeypatch, format):
    """GPS time in UBX, UTC in NMEA: seconds begin together."""
    receiver = Receiver(40.0)
    pulses = shown_pulses(receiver)
    found, events, live = sent_receiver(tmp_path, monkeypatch, receiver, pulses, format=format)
    moments = receiver.moment(receiver.stamps)[: len(found)]
    assert len(found) >= len(receiver.stamps) - 1
    assert np.abs(found - moments)[75:].max() < 20e-6
    (estimate,) = live.clocks.values()
    assert estimate.counts and estimate.latency == pytest.approx(0.08, abs=0.006)
    assert any("pulses count; messages come 0.08" in text for text in events)


def test_a_pulse_file_that_is_not_there_leaves_arrival(tmp_path, monkeypatch):
    receiver = Receiver(40.0)
    found, events, live = sent_receiver(tmp_path, monkeypatch, receiver, [], latency=0.08)
    moments = receiver.moment(receiver.stamps)[: len(found)]
    assert np.abs(found - moments)[75:].max() < 0.01
    assert any("assert: No such file or directory; it is tried again" in text for text in events)
    assert "No such file" in live.ports[f"file:{tmp_path / 'assert'}"]
    assert any("no pulse came; arrival less 0.0800 s counts" in text for text in events)


def test_events_of_pulses_are_told_once(tmp_path, monkeypatch):
    """Pulses that are missing, noise, and a step of the system clock."""
    receiver = Receiver(40.0)

    pulses = [(shown, at, 3 * k) for shown, at, k in shown_pulses(receiver)]
    noise = [(at + 0.301, at + 0.3, k + 1) for _, at, k in pulses[10:]]
    found, events, _ = sent_receiver(tmp_path, monkeypatch, receiver, pulses + noise, -5.0)
    assert np.abs(found - receiver.moment(receiver.stamps)[: len(found)])[75:].max() < 20e-6
    said = [
        text.split(": ", 1)[1] for text in events if text.startswith(f"file:{tmp_path / 'assert'}")
    ]
    assert sum("off the second are left out" in text for text in said) == 1
    assert sum("pulses came between two looks" in text for text in said) == 1
    assert sum("the system clock stepped by -5 s" in text for text in said) == 1
    assert len(said) == 3 and sum("pulses count; messages come" in text for text in events) == 1


@pytest.mark.parametrize(
    "part, why",
    [
        ({"format": "json", "clock": "arrival", "pps": "x"}, "pps is that of a receiver"),
        (
            {"format": "ubx", "pps": "x"},
            "ubx or nmea with the clock \"arrival\", not of ubx with 'gps'",
        ),
        ({"format": "nmea", "clock": "arrival", "pps": 3}, "pps is 3; it must be text"),
        ({"format": "nmea", "clock": "arrival", "pps": ""}, "it must be text"),
    ],
)
def test_pulses_of_what_has_none_are_refused(tmp_path, part, why):
    with pytest.raises(DataError, match=r"^configuration: \[\[input\]\] 1: ") as error:
        sd.Live(config(tmp_path, {"port": "udp:7001"} | part))
    assert why in str(error.value)
