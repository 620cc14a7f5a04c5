"""The IMU of a u-blox receiver in the loop: the samples of its log, whatever the pieces of bytes."""

import numpy as np
import pytest
import written_ubx
from recordings import flight
from test_live_program import SOURCES, config

import strapdown as sd
from strapdown.checks import DataError
from strapdown.cli.live import input_formats, ports, program, receiver_imu
from strapdown.cli.live.decoders import decoder
from strapdown.cli.live.input_formats import QUIET, Clock
from strapdown.cli.live.receiver_imu import ImuMounting, ReceiverWithImu
from strapdown.engine.stream import Sample
from strapdown.units.time_scales import gps_from_unix

pytestmark = pytest.mark.short

KINDS = [14, 13, 5, 16, 17, 18]
KIND_NAMES = ["position", "velocity", "heading"]
FLAT = ImuMounting.of_axes("FLU", None)


class Times:
    """The clock of a machine, as the module `time` shows it."""

    def __init__(self):
        self.now = 1000.0

    def monotonic(self):
        return self.now


@pytest.fixture
def times(monkeypatch):
    times = Times()
    for module in (input_formats, receiver_imu, ports, program):
        monkeypatch.setattr(module, "time", times)
    return times


def counts(n, seed=3):
    """Counts of the axes (n, 6) of a gyro and an accelerometer."""
    rng = np.random.default_rng(seed)
    gyro = rng.integers(-(2**17), 2**17, (n, 3))
    return np.c_[gyro, rng.integers(-900, 900, (n, 3)) + [0, 0, 10042]]


def sent(times, data, message, size, seconds, mounting=FLAT):
    """(decoder, samples, measurements) of bytes in pieces, over a time in s."""
    reader = ReceiverWithImu(decoder("ubx", "arrival", Clock(), KIND_NAMES, "a"), message, mounting)
    events, begin = [], times.now
    for k in range(0, len(data), size):
        times.now = begin + seconds * min(k + size, len(data)) / len(data)
        events += reader.feed(data[k : k + size])
    times.now += QUIET
    events += reader.idle()
    samples = [each for each in events if type(each) is Sample]
    return reader, samples, [each for each in events if type(each) is not Sample]


def batch_imu(tmp_path, data):
    """The Imu of a log."""
    (tmp_path / "log.ubx").write_bytes(data)
    return sd.read(tmp_path / "log.ubx").imu


def columns(samples):
    """t, dt, dtheta and dv of samples, as arrays."""
    return [np.array(each) for each in zip(*samples)]


ANGLES = (9000, 500, -200)
"""Yaw, pitch and roll of ESF-ALG, 0.01 deg."""


def alignment(angles=ANGLES, status=3):
    """ESF-ALG."""
    payload = np.zeros((1, 16), np.uint8)
    payload[:, 5] = status << 1 | 1
    payload[:, 8:12] = np.array(angles[:1], "<u4").view(np.uint8)
    payload[:, 12:16] = np.array(angles[1:], "<i2").view(np.uint8)
    return written_ubx.frames(0x1014, payload).tobytes()


# ---- the samples of the log


@pytest.mark.parametrize("size", [1, 7, 64, 5000])
@pytest.mark.parametrize("mounted", [False, True])
def test_samples_are_those_of_the_log_to_the_bit(times, tmp_path, size, mounted):
    """ESF-MEAS alone, which counts ms of the sensor's clock in both; its intervals are not alike, and one is
    a gap."""
    n = 400
    tag = 5_000_000 + np.cumsum(np.random.default_rng(1).integers(9, 12, n))
    tag[250:] += 55
    data = written_ubx.esf_meas(tag, KINDS, counts(n)).tobytes() + alignment() * mounted
    angles = tuple(np.pi / 180 * each for each in (-2.0, -5.0, -90.0)) if mounted else None
    mounting = ImuMounting.of_axes("FLU", angles)
    reader, samples, _ = sent(times, data, "ESF-MEAS", size, 4.0, mounting)
    imu = batch_imu(tmp_path, data)
    assert len(samples) == n - 1 == len(imu.t) - 1  # the first one has no interval
    gap = 249
    for ours, theirs in zip(columns(samples), imu):
        assert np.array_equal(np.delete(ours, gap, 0), np.delete(theirs[1:], gap, 0))
        # there the interval is the median of the last ones, or of all
        assert np.allclose(ours[gap], theirs[1 + gap], rtol=0.3)
    assert reader.bad == 0 and not reader.news


@pytest.mark.parametrize("size", [13, 700])
def test_samples_beside_fixes_are_those_of_the_log_but_for_its_clock(times, tmp_path, size):
    """A log sets the sensor's clock to GPS time, here their rate and increments tell the same."""
    data, tag, *_ = written_ubx.drive(n=400)
    reader, samples, fixes = sent(times, data, "ESF-RAW", size, 4.0)
    imu = batch_imu(tmp_path, data)
    t, dt, dtheta, dv = columns(samples)
    assert len(t) == len(imu.t) - 1 == 399 and reader.bad == 0
    assert np.allclose(t, tag[1:] * 1e-3) and np.allclose(np.diff(t), np.diff(imu.t[1:]), atol=2e-6)
    assert np.allclose(dtheta / dt[:, None], (imu.dtheta / imu.dt[:, None])[1:], rtol=1e-12)
    assert np.allclose(dv / dt[:, None], (imu.dv / imu.dt[:, None])[1:], rtol=1e-12)
    alone = decoder("ubx", "arrival", Clock(), KIND_NAMES, "a")
    found = alone.feed(written_ubx.drive(n=400)[0])
    times.now += QUIET
    assert fixes == found + alone.idle() and len(fixes) == 80


def test_fixes_come_while_the_sensors_are_never_quiet(times):
    """ESF-RAW each 10 ms; an epoch is whole 30 ms after its own last byte."""
    data, *_ = written_ubx.drive(n=400)
    reader = ReceiverWithImu(decoder("ubx", "arrival", Clock(), KIND_NAMES, "a"), "ESF-RAW", FLAT)
    size, delays = len(data) // 40, []
    for k in range(40):
        epoch = times.now
        reader.feed(data[k * size : k * size + 100])
        for at in range(k * size + 100, (k + 1) * size, 60):
            times.now += 0.01
            reader.feed(data[at : min(at + 60, (k + 1) * size)])
            if reader.idle():
                delays.append(times.now - epoch)
                assert reader.last == epoch
    # the first epoch waits for another one, which says that its time is no error
    assert len(delays) == 39 and max(delays) < QUIET + 0.011


def test_a_gyro_and_an_accelerometer_apart_are_joined_as_in_the_log(times, tmp_path):
    """ESF-MEAS of both, with an accelerometer of twice the rate that comes later."""
    n, values = 200, counts(400)
    gyro = written_ubx.esf_meas(7_000_000 + 20 * np.arange(n), KINDS[:3], values[:n, :3])
    tag = 7_000_003 + 10 * np.arange(2 * n)
    accel = written_ubx.esf_meas(tag, KINDS[3:], values[:, 3:]).reshape(n, -1)
    data = np.concatenate([gyro, accel], axis=1).tobytes()
    reader, samples, _ = sent(times, data, "ESF-MEAS", 50, 4.0)
    imu = batch_imu(tmp_path, data)
    assert 195 <= len(samples) and reader.bad == 0
    first = int(np.searchsorted(imu.t, samples[0].t))
    for ours, theirs in zip(columns(samples), imu):
        assert np.allclose(ours, theirs[first : first + len(ours)], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("message, count, seconds", [("ESF-RAW", 289, 2.9), ("ESF-MEAS", 28, 2.9)])
def test_a_recorded_receiver(times, data_folder, tmp_path, message, count, seconds):
    """ESF-RAW in messages of ten samples with ticks of 1/25600 s, ESF-MEAS of sensors 5 ms apart."""
    data = (data_folder / "native" / "ubx" / "neo-m8u_esfraw_2s.log").read_bytes()
    reader, samples, fixes = sent(times, data, message, 300, seconds)
    t, dt, dtheta, dv = columns(samples)
    assert abs(len(t) - count) <= 2 and len(fixes) == 6
    assert np.ptp(t) == pytest.approx(seconds, abs=0.35)
    assert np.median(dt) == pytest.approx(0.01 if message == "ESF-RAW" else 0.1, rel=0.02)
    force = dv.sum(axis=0) / dt.sum()
    assert np.linalg.norm(force) == pytest.approx(9.8, abs=0.4) and force[2] < -9.5
    if message == "ESF-RAW":
        imu = sd.read(data_folder / "native" / "ubx" / "neo-m8u_esfraw_2s.log").imu
        assert np.allclose(dtheta / dt[:, None], (imu.dtheta / imu.dt[:, None])[1:], rtol=1e-9)
        assert np.allclose(dt, imu.dt[1:], atol=3e-6)


# ---- its clock


@pytest.mark.parametrize("tick", [1e-3, 1 / 25600])
def test_the_rate_of_its_clock_is_found_by_arrival(times, tick):
    n = 600
    tag = 2**32 - 5000 + np.round(0.01 * np.arange(n) / tick).astype(int)  # it overflows on the way
    values = counts(n)
    data = written_ubx.esf_raw(tag, values[:, :3], values[:, 3:]).tobytes()
    reader, samples, _ = sent(times, data, "ESF-RAW", 64, 6.0)
    t, dt, *_ = columns(samples)
    assert len(t) == n - 1 and np.allclose(np.diff(t), 0.01, atol=1e-4) and reader.bad == 0
    assert np.allclose(dt, 0.01, atol=1e-4)


def test_a_clock_of_an_unknown_rate_is_told(times):
    tag = 1000 + 9 * np.arange(600)
    values = counts(600)
    data = written_ubx.esf_raw(tag, values[:, :3], values[:, 3:]).tobytes()
    reader, samples, _ = sent(times, data, "ESF-RAW", 64, 60.0)
    assert not samples and reader.bad > 3000 and "ticks per s of arrival" in reader.why


def test_a_clock_that_begins_anew(times):
    tag = np.r_[5_000_000 + 10 * np.arange(300), 1000 + 10 * np.arange(300)]
    data = written_ubx.esf_meas(tag, KINDS, counts(600)).tobytes()
    reader, samples, _ = sent(times, data, "ESF-MEAS", 64, 6.0)
    t, dt, dtheta, _ = columns(samples)
    assert len(t) == 599 and t[299] == 1.0 and np.allclose(dt, 0.01)
    rate = counts(600)[1:, 0] / 4096 * np.pi / 180
    assert np.allclose(dtheta[:, 0], 0.01 * rate) and reader.bad == 0


def test_what_waits_for_the_rate_of_its_clock_is_counted(times):
    data = written_ubx.esf_raw(10 * np.arange(20), *np.split(counts(20), 2, axis=1)).tobytes()
    reader, samples, _ = sent(times, data, "ESF-RAW", 64, 0.5)
    assert not samples and reader.bad == 0
    reader.leave()
    assert reader.bad == 20 * 6 and reader.why


# ---- faults


def test_axes_that_are_missing_are_counted(times):
    tag = 5_000_000 + 10 * np.arange(200)
    values = counts(200)
    without_z = written_ubx.esf_meas(
        tag[:100], KINDS[:2] + KINDS[3:], np.delete(values, 2, 1)[:100]
    )
    data = without_z.tobytes() + written_ubx.esf_meas(tag[100:], KINDS, values[100:]).tobytes()
    reader, samples, _ = sent(times, data, "ESF-MEAS", 64, 2.0)
    assert len(samples) == 99 and reader.bad == 100
    reader, *_ = sent(times, without_z.tobytes(), "ESF-MEAS", 64, 2.0)
    assert reader.bad == 84 and len(reader._imu._gyro._open) == receiver_imu.MAX_OPEN
    reader.leave()
    assert reader.bad == 100 and reader.why


def test_messages_that_come_again_or_late_are_counted(times):
    tag, values = 5_000_000 + 10 * np.arange(100), counts(100)
    frames = written_ubx.esf_meas(tag, KINDS, values)
    again = [*range(51), 50, 49, 30, *range(51, 100)]
    reader, samples, _ = sent(times, frames[again].tobytes(), "ESF-MEAS", 64, 2.0)
    _, expected, _ = sent(times, frames.tobytes(), "ESF-MEAS", 64, 2.0)
    assert samples == expected and reader.bad == 18


def test_a_gyro_without_an_accelerometer_is_told(times):
    n = receiver_imu.MAX_WAITING + 50
    data = written_ubx.esf_meas(10 * np.arange(n), KINDS[:3], counts(n)[:, :3]).tobytes()
    reader, samples, _ = sent(times, data, "ESF-MEAS", 640, 10.0)
    assert not samples and reader.bad == 49 and "no accelerometer" in reader.why
    reader.leave()
    assert reader.bad == n - 1


def test_an_accelerometer_with_a_gap_costs_the_samples_there(times, tmp_path):
    n, values = 200, counts(200)
    gyro = written_ubx.esf_meas(7_000_000 + 10 * np.arange(n), KINDS[:3], values[:, :3])
    accel = written_ubx.esf_meas(7_000_003 + 10 * np.arange(n), KINDS[3:], values[:, 3:])
    both = np.stack([gyro, accel], axis=1)
    pieces = [
        both[k, j].tobytes() for k in range(n) for j in range(2) if j == 0 or not 80 < k < 100
    ]
    reader, samples, _ = sent(times, b"".join(pieces), "ESF-MEAS", 64, 2.0)
    imu = batch_imu(tmp_path, b"".join(pieces))
    assert "the accelerometer has gaps" in reader.why and reader.bad == 200 - 2 - len(samples)
    assert len(samples) == len(imu.t) - (2 if len(imu.t) > len(samples) + 1 else 1)


def test_noise_and_cut_messages_between_are_left_to_the_receiver(times):
    data, *_ = written_ubx.drive(n=200)
    size, rng = len(data) // 20, np.random.default_rng(4)
    begin = b"\xb5\x62\x10\x03\xff\x01"
    noise = [begin + rng.integers(0, 256, 90, np.uint8).tobytes() for _ in range(20)]
    dirty = b"".join(data[k * size : (k + 1) * size] + noise[k] for k in range(20))
    reader, samples, fixes = sent(times, dirty, "ESF-RAW", 50, 2.0)
    clean, expected, known = sent(times, data, "ESF-RAW", 50, 2.0)
    assert samples == expected and fixes == known
    assert clean.bad == 0 and reader.bad >= 19 and reader.unused < 1000


def test_random_bytes_never_raise(times):
    rng = np.random.default_rng(5)
    for seed in range(200):
        heads = [
            b"\xb5\x62\x10\x02",
            b"\xb5\x62\x10\x03",
            b"\xb5\x62\x10\x14",
            b"\xb5",
            b"\xb5\x62",
        ]
        payloads = rng.integers(0, 256, (4, 4 * int(rng.integers(1, 30))), np.uint8)
        frames = [written_ubx.frames(kind, payloads).tobytes() for kind in (0x1002, 0x1003, 0x1014)]
        parts = [*heads, *frames, rng.integers(0, 256, 50, np.uint8).tobytes()]
        data = b"".join(parts[k] for k in rng.integers(0, len(parts), 12))
        sent(times, data, ("ESF-RAW", "ESF-MEAS")[seed % 2], int(rng.integers(1, 400)), 3.0)


@pytest.mark.parametrize("status, known", [(3, False), (0, False), (1, False), (3, True)])
def test_a_mounting_that_the_receiver_found_is_told_once(times, status, known):
    angles = tuple(np.pi / 180 * each for each in (-2.0, -5.0, -90.0)) if known else None
    mounting = ImuMounting.of_axes("FLU", angles)
    reader, *_ = sent(times, alignment(status=status) * 3, "ESF-RAW", 5, 1.0, mounting)
    told = status != 1 and not known
    assert len(reader.news) == told
    if told:
        where = "found it" if status else "has it from its settings"
        assert reader.news[0].startswith("mounting = { roll = -2, pitch = -5, heading = -90, unit")
        assert f"as the receiver {where} (ESF-ALG)" in reader.news[0]


# ---- the program


def test_a_receiver_with_its_imu_runs_a_filter(times, tmp_path, monkeypatch):
    """Its sensors drift and come at once, its fixes 0.1 s late; after 60 s the filter is where it was."""
    monkeypatch.setattr(program, "STARTED", 1.7e9)
    recording, path, zero = flight(60.0), tmp_path / "receiver.ubx", times.now
    part = {"port": f"file:{path}", "format": "ubx", "clock": "arrival", "latency": 0.1}
    part |= {"imu": "ESF-RAW"}
    events = []
    live = sd.Live(
        config(tmp_path, part, log="", replay=True), on_event=lambda _, text: events.append(text)
    )
    imu = recording.imu
    rates = (
        np.c_[np.degrees(imu.dtheta) * 4096, imu.dv * 1024] / imu.dt[:, None] * (2 * [1, -1, -1])
    )
    tag = np.round(25600 * (5.0 + imu.t * (1 + 30e-6))).astype(int)
    values = np.round(rates).astype(int)
    raw = written_ubx.esf_raw(tag, values[:, :3], values[:, 3:])
    messages = [(t + 0.002, row.tobytes()) for t, row in zip(imu.t.tolist(), raw)]
    position, velocity = recording.sources
    ms = written_ubx.GPS + np.round(1e3 * position.t).astype(int)
    fields = {"lat": np.degrees(position.y[:, 0]) * 1e7, "lon": np.degrees(position.y[:, 1]) * 1e7}
    fields |= {"height": position.y[:, 2] * 1e3}
    fields |= {f"vel{axis}": velocity.y[:, k] * 1e3 for k, axis in enumerate("NED")}
    fixes = written_ubx.pvt(ms, **{name: np.round(each) for name, each in fields.items()})
    messages += [(t + 0.1, row.tobytes()) for t, row in zip(position.t.tolist(), fixes)]
    with path.open("ab") as growing:
        for at, data in sorted(messages):
            times.now = zero + at
            growing.write(data)
            growing.flush()
            live.turn()
    times.now += 1.0
    live.turn()
    live.close()
    assert live.bad == 0 and not [text for text in events if "not read" in text]
    own, sensors = live.clocks.items()
    assert sensors[0] == own[0] + " IMU" and sensors[1].drift == pytest.approx(-30e-6, abs=20e-6)
    assert live.stream.started and live.stream.counts()[0][0] >= 45
    moment = recording.reference.t[-1] + zero + 1.7e9
    assert live.clock.epoch + live.stream.t == pytest.approx(float(gps_from_unix(moment)), abs=0.01)
    off = (live.stream.belief.lla - recording.reference.lla[-1]) * [6.4e6, 4.3e6, 1.0]
    assert np.abs(off).max() < 6.0, off


UBX = {"format": "ubx", "clock": "arrival", "port": "udp:7001"}


@pytest.mark.parametrize(
    "part, why",
    [
        ({"imu": "ESF-INS"}, "imu is 'ESF-INS'"),
        ({"imu": True}, "imu is True"),
        ({"imu": "ESF-RAW", "clock": "gps"}, "imu is that of a receiver with its own clock"),
        ({"imu": "ESF-RAW", "format": "nmea"}, "imu is that of a receiver with its own clock"),
        ({"axes": "FLU"}, "axes is that of the IMU of a receiver; give `imu` too"),
        ({"mounting": {}}, "mounting is that of the IMU of a receiver; give `imu` too"),
        ({"imu": "ESF-RAW", "axes": "FLX"}, "unknown axes 'FLX'"),
        ({"imu": "ESF-RAW", "axes": 3}, "axes is 3; it must be text"),
        ({"imu": "ESF-RAW", "mounting": 3}, "mounting is 3; it must be"),
        ({"imu": "ESF-RAW", "mounting": {"roll": 1.0}}, "mounting: unit is missing"),
        (
            {"imu": "ESF-RAW", "mounting": {"yaw": 1.0, "unit": "deg"}},
            "mounting: unknown key 'yaw'",
        ),
        ({"imu": "ESF-RAW", "mounting": {"roll": "1", "unit": "deg"}}, "mounting: roll is '1'"),
    ],
)
def test_an_imu_that_no_receiver_has_is_refused(tmp_path, part, why):
    with pytest.raises(DataError, match=r"^configuration: \[\[input\]\] 1: ") as error:
        sd.Live(config(tmp_path, UBX | part, source=SOURCES[:1]))
    assert why in str(error.value)
