"""Recordings through `strapdown live`: `python benchmarks/live_replays.py`.

Each recording of the data folder goes as JSON lines through a growing file, by UDP and through a serial line (a
pseudo-terminal). Printed is whether the state at the end has the bits of a LiveStream that gets the same samples
and fixes without any port, and whether `fuse` makes the same rows of the log.
"""

import json
import os
import pty
import socket
import tempfile
import time
import tty
from copy import deepcopy
from pathlib import Path

import numpy as np
from late_fixes import arrivals

import strapdown as sd
from strapdown.cli.live.config import config_of
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS

RECORDINGS = ("thor75", "thor75-full", "drive0708")
SECONDS = 240.0
"""s of each."""
BURST = 20
"""Lines that are sent before the program reads."""
DELAY = 0.1
"""s by which fixes come late."""
PATIENCE = 2.0
"""s without anything new after which all has come."""
SAME = {True: "the bits of those", False: "NOT the bits of those"}


class _File:
    def __init__(self, folder):
        path = folder / "lines.jsonl"
        self._file = path.open("ab", buffering=0)
        self.port = f"file:{path}"

    def send(self, lines):
        self._file.write(b"".join(line + b"\n" for line in lines))


class _Udp:
    def __init__(self, _):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self._address = free.getsockname()
        self.port = f"udp:127.0.0.1:{self._address[1]}"

    def send(self, lines):
        for line in lines:
            self._socket.sendto(line, self._address)


class _Serial:
    def __init__(self, _):
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = f"serial:{os.ttyname(slave)}:921600"

    def send(self, lines):
        for line in lines:
            os.write(self._master, line + b"\n")


def source(a):
    """The table of a source in the configuration."""
    made = {"kind": a.kind, "name": a.name, "robust": a.robust, "adaptive": a.adaptive}
    if a.parameters:
        made["parameters"] = list(a.parameters)
    return made if a.gate is None else made | {"gate": a.gate}


def line(event, names):
    """The event as a JSON line."""
    table = event._asdict()
    if isinstance(event, sd.Measurement):
        table["source"] = names[int(event.source)]
        table["y"] = [value if np.isfinite(value) else None for value in event.y]
        table["std"] = [value if np.isfinite(value) else None for value in event.std]
    return json.dumps(table).encode()


def configuration(recording):
    """The configuration without ports."""
    made = {"imu": recording.meta["grade"], "lag": 1.0}
    made["source"] = [source(a) for a in recording.sources]
    return made | {key: recording.meta[key] for key in ("vehicle",) if key in recording.meta}


def through(make, recording, events, folder):
    """(Live, its state) after all lines went through a port; closed it also uses the fixes that waited."""
    way = make(folder)
    config = configuration(recording) | {"log": str(folder / "log"), "input": [{"port": way.port}]}
    names = [a.name for a in recording.sources]
    lines = [line(event, names) for event in events]
    with sd.Live(config) as live:
        live.turn()  # opens the port
        for k in range(0, len(lines), BURST):
            way.send(lines[k : k + BURST])
            live.turn()
        heard = time.monotonic()
        while (
            time.monotonic() < heard + PATIENCE
        ):  # an empty file is looked at again after a second
            if live.turn():
                heard = time.monotonic()
        newest = deepcopy(live.stream.belief)
    return live, newest


def alone(recording, events):
    """The LiveStream of the same configuration."""
    own = config_of(configuration(recording) | {"input": [{"port": "-"}]})
    stream = sd.LiveStream(
        own.filter,
        sources=own.sources,
        imu=own.imu,
        vehicle=own.vehicle,
        lag=own.lag,
        replay=own.replay,
    )
    for event in events:
        stream.step(event)
    return stream


def equal(a, b):
    """True where two beliefs have the same bits."""
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in ("lla", "v_n", "C_nb", "P")
    )


def main() -> None:
    """Print a line for each recording and port."""
    for name in RECORDINGS:
        whole = sd.read(DESCRIPTIONS / f"{name}.toml")
        recording = whole.between(whole.span[0], whole.span[0] + SECONDS)
        events = arrivals(recording, DELAY)
        wanted = alone(recording, events).belief
        for way in (_File, _Udp, _Serial):
            with tempfile.TemporaryDirectory() as folder:
                live, newest = through(way, recording, events, Path(folder))
                again = sd.fuse(sd.read(live.logs[0])).trajectory
            of_log = np.array_equal(again.lla[-1], live.stream.belief.lla)
            print(
                f"{name} through {way.__name__[1:].lower()}: {len(events)} samples and fixes; "
                f"{SAME[equal(newest, wanted)]} without a port, {SAME[of_log]} of the log; "
                f"{live.bad} bad, {live.missed} missed",
                flush=True,
            )


if __name__ == "__main__":
    main()
