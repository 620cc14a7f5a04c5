"""Streams for the example of firmware in an export: samples, pulses and bytes of a receiver as they come."""

import shutil
import struct
import subprocess

import numpy as np
import written_ubx
from exports import STRICT, run

import strapdown as sd
from strapdown.sensor_models.gnss import Gnss

COMPILER = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
BOOTED = 3.25
"""s of the board's clock at the beginning of a flight."""
DELAY = 0.12
"""s between a fix and its last byte."""


def drive(seconds=90.0, seed=4, interval=0.2):
    """A simulated drive with fixes at that interval, s."""
    world = sd.scenario("demo").replace(
        gnss=Gnss(interval=interval),
        duration=seconds,
        imu="industrial",
        magnetometer=None,
        barometer=None,
    )
    return sd.simulate(world, seed=seed)


def run_desk(folder, data, *words):
    """Lines that the loop of an export in a folder writes on this machine; compiled at the first use."""
    if not (folder / "desk").exists():
        sources = "desk.c", "loop.c", "strapdown_delayed.c", "strapdown_calls.c", "strapdown.o"
        code, said = run(COMPILER, *STRICT, *sources, "-lm", "-o", "desk", folder=folder)
        assert code == 0, said
    done = subprocess.run([folder / "desk", *words], input=data, capture_output=True, timeout=100)
    assert done.returncode == 0
    return done.stdout.splitlines(keepends=True)


def fixes(drive, gps_ms):
    """[(arrival, bytes)] of a receiver whose first fix is at that GPS time, ms."""
    position, velocity = drive.sources
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


def received(data):
    """Bytes of the receiver as records of a stream."""
    return b"".join(b"B" + data[i : i + 1] for i in range(len(data)))


def arrivals(drive, gps_ms, messages=None):
    """[(time, record)] of a drive as they come; `messages` (arrival, bytes) are those of `fixes` where
    none are given."""
    first = drive.sources[0].t[0]
    events = [
        (t, b"S" + struct.pack("<8d", t + BOOTED, dt, *a, *f)) for t, dt, a, f in zip(*drive.imu)
    ]
    seconds = np.arange(-gps_ms % 1000 * 1e-3 + first, drive.imu.t[-1], 1.0)
    events += [(t, b"P" + struct.pack("<d", t + BOOTED)) for t in seconds]
    messages = fixes(drive, gps_ms) if messages is None else messages
    events += [(t, received(data)) for t, data in messages]
    return sorted(events, key=lambda event: event[0])


def stream(events):
    return b"".join(data for _, data in events)


def hidden(messages, start, stop):
    """Without the fixes that hold in between."""
    return [(t, data) for t, data in messages if not start < t - DELAY < stop]


def restarted(events, at):
    """(the events until then, those after it, all without those of the restart): what comes after it
    and before the first message after a pulse is lost."""
    first = [event for event in events if event[0] <= at]
    second = events[len(first) :]
    kinds = [data[:1] for _, data in second]
    told = kinds.index(b"B", kinds.index(b"P"))
    return first, second, first + second[told:]


def damaged(messages, seed=7, share=0.15):
    """Messages of which some have a wrong byte, end early, or lack bytes, as on a bad line."""
    rng = np.random.default_rng(seed)
    found = []
    for t, data in messages:
        at, kind = int(rng.integers(len(data))), rng.random() / share
        if kind < 1 / 3:
            data = data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :]
        elif kind < 2 / 3:
            data = data[:at]
        elif kind < 1:
            data = data[:at] + data[at + int(rng.integers(1, 30)) :]
        found.append((t, data))
    return found


def without_samples(events, start, stop):
    """A gap of the IMU."""
    return [(t, data) for t, data in events if data[:1] != b"S" or not start < t < stop]
