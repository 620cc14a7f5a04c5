"""The example of firmware in an export, on this machine: UBX in, NMEA out."""

import shutil
import struct
import subprocess

import numpy as np
import pynmeagps
import pytest
import written_ubx
from exports import STRICT, run

import strapdown as sd
from strapdown.geometry.geodesy import displacement
from strapdown.native.export.chosen import choose_export
from strapdown.native.export.folder import export, find_target
from strapdown.sensor_models.gnss import Gnss

COMPILER = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler is found")
WEEK_END = 604_800_000
"""ms."""
DELAY = 0.12
"""s between a fix and its last byte."""


@pytest.fixture(scope="module")
def flight():
    world = sd.scenario("demo").replace(
        gnss=Gnss(interval=0.2), duration=90.0, imu="industrial", magnetometer=None, barometer=None
    )
    return sd.simulate(world, seed=4)


@pytest.fixture(scope="module")
def loop(tmp_path_factory, flight):
    folder = tmp_path_factory.mktemp("loop")
    export(
        choose_export("closed-loop", ["position", "velocity"], flight), find_target("host"), folder
    )
    sources = "loop.c", "strapdown_delayed.c", "strapdown_calls.c", "strapdown.o"
    code, said = run(COMPILER, *STRICT, "-DON_A_DESK", *sources, "-lm", "-o", "loop", folder=folder)
    assert code == 0, said
    return folder / "loop"


def fixes(flight, gps_ms):
    """[(arrival, bytes)] of a receiver whose first fix is at that GPS time, ms."""
    position, velocity = flight.sources
    begins = position.t[0]
    degrees = np.rint(np.rad2deg(position.y[:, :2]) * 1e7)
    moments = gps_ms + np.rint((position.t - begins) * 1000).astype(int)
    mm = np.rint(position.y[:, 2] * 1000)
    v = np.rint(velocity.y * 1000)
    frames = written_ubx.pvt(
        moments, lat=degrees[:, 0], lon=degrees[:, 1], height=mm, hMSL=mm - 47_000,
        velN=v[:, 0], velE=v[:, 1], velD=v[:, 2], nano=moments % 1000 * 1_000_000,
        hAcc=position.std[:, 0] * 1e3, vAcc=position.std[:, 2] * 1e3,
        sAcc=velocity.std[:, 0] * 1e3,
    )  # fmt: skip
    return [(t + DELAY, frame.tobytes()) for t, frame in zip(position.t, frames)]


def stream(flight, gps_ms, hidden=()):
    """Its samples and bytes as they come; fixes that hold in a `hidden` (start, stop) are left out."""
    offset = gps_ms % WEEK_END * 1e-3 - flight.sources[0].t[0]
    events = [
        (t, b"S" + struct.pack("<8d", t + offset, dt, *a, *f)) for t, dt, a, f in zip(*flight.imu)
    ]
    for t, frame in fixes(flight, gps_ms):
        if not any(start < t < stop for start, stop in hidden):
            events.append((t, b"".join(b"B" + frame[i : i + 1] for i in range(len(frame)))))
    return b"".join(data for _, data in sorted(events, key=lambda event: event[0])), offset


def sentences(loop, data):
    """Parsed GGA and RMC of the loop; each has a right checksum."""
    done = subprocess.run([loop], input=data, capture_output=True, timeout=100)
    assert done.returncode == 0
    found = [pynmeagps.NMEAReader.parse(line + b"\r\n") for line in done.stdout.splitlines()]
    return found[::2], found[1::2]


def test_late_fixes_become_sentences_near_the_truth(loop, flight):
    gps = written_ubx.GPS
    data, offset = stream(flight, gps, hidden=[(60.0, 70.0)])
    gga, rmc = sentences(loop, b"B\xb5B\xb5" + data)
    assert len(gga) == len(rmc) > 400
    assert {one.msgID for one in gga} == {"GGA"} and {one.msgID for one in rmc} == {"RMC"}
    seconds = np.array(
        [
            o.time.hour * 3600 + o.time.minute * 60 + o.time.second + o.time.microsecond * 1e-6
            for o in gga
        ]
    )
    t = seconds + 18 + 5 * 86400 - offset  # Friday; 18 leap seconds
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


def test_the_week_may_end_and_midnight_pass_without_fixes(loop, flight):
    gps = written_ubx.GPS // WEEK_END * WEEK_END + WEEK_END - 20_000 - 1_000 * 4
    data, offset = stream(flight, gps, hidden=[(40.0, 80.0)])
    gga, rmc = sentences(loop, data)
    assert len(gga) > 400 and {o.quality for o in gga} == {1, 6}
    dates = [str(o.date) for o in rmc]
    assert dates[0] == "2024-05-18" and "" in dates and dates[-1] == "2024-05-19"
    times = np.array([o.time.hour for o in gga])
    assert set(times) == {23, 0}


def test_a_damaged_fix_is_left_out(loop, flight):
    data, _ = stream(flight, written_ubx.GPS)
    frames = fixes(flight, written_ubx.GPS)
    for damaged in (2, 40, 99):
        frame = frames[100][1]
        bytes_in = b"".join(b"B" + frame[i : i + 1] for i in range(len(frame)))
        broken = bytearray(bytes_in)
        broken[2 * damaged + 1] ^= 8
        without = data.replace(bytes_in, b"")
        assert sentences(loop, data.replace(bytes_in, bytes(broken)))[0][-1].lat == (
            sentences(loop, without)[0][-1].lat
        )
