"""Recordings through `strapdown live`: `python benchmarks/live_replays.py`.

Each recording of the data folder that a filter can start on goes as JSON lines through a growing file, by UDP and
through a serial line (a pseudo-terminal). Printed is whether the state at the end has the bits of a LiveStream that
gets the same samples and fixes without any port, whether `fuse` makes the same rows of the log, and whether `fuse` of
the recording itself does, from the start that the stream found.
"""

import json
import os
import pty
import socket
import sys
import tempfile
import time
import tty
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
from late_fixes import arrivals
from ranking_cases import walked

import strapdown as sd
from strapdown.cli.live.config import config_of
from strapdown.engine.live_run import start_of
from strapdown.io.locate import data_folder
from strapdown_reproductions.common.example_recordings import DESCRIPTIONS
from strapdown_reproductions.wrong_setups.cases import swisslog

RECORDINGS = ("thor75", "thor75-full", "drive0708")
LOGS = (
    "broad/*.npz",
    "gait/*.csv.xz",
    "lasergyro/*.imu.xz",
    "native/dataflash/*.BIN.xz",
    "native/gnss_imu_txt/IMU.txt.xz",
    "native/imu_csv/*.csv.xz",
    "native/parquet/*.parquet",
    "native/px4_*.ulg.xz",
    "native/rosbag1/*.bag.xz",
    "native/rosbag2/*.xz",
    "native/ubx/neo-m8u_esfraw_2s.log",
    "native/ulog/*.ulg.xz",
)
"""Those of the data folder that have an IMU and can be read as they are."""
FILTERS = ("closed-loop", "attitude-mekf", "vru")
"""The first one that starts on a recording is used."""
SECONDS, SHORTER = 240.0, 60.0
"""s of the RECORDINGS, and of the others."""
BURST = 10
"""Lines that are sent before the program reads, fewer than the 4 kB that a serial line keeps."""
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


def configuration(recording, filter):
    """The configuration without ports."""
    grade = recording.meta.get("grade") or "navigation"  # of lasergyro, whose file does not say it
    made = {"imu": grade, "lag": 1.0, "filter": filter, "align_within": 10.0}
    made["source"] = [source(a) for a in recording.sources]
    return made | {key: recording.meta[key] for key in ("vehicle",) if key in recording.meta}


def through(make, config, events, names, folder):
    """(Live, its state) after all lines went through a port; closed it also uses the fixes that waited."""
    way = make(folder)
    config = config | {"log": str(folder / "log"), "input": [{"port": way.port}]}
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


def alone(config, events):
    """The LiveStream of a configuration."""
    own = config_of(config | {"input": [{"port": "-"}]})
    stream = sd.LiveStream(
        own.filter,
        sources=own.sources,
        imu=own.imu,
        vehicle=own.vehicle,
        lag=own.lag,
        replay=own.replay,
        align_within=own.align_within,
    )
    for event in events:
        stream.step(event)
    return stream


def started(recording, events):
    """(configuration, LiveStream) of the first filter that starts; None where none does."""
    for filter in FILTERS:
        config = configuration(recording, filter)
        try:
            stream = alone(config, events)
        except sd.DataError:  # it needs other sources
            continue
        if stream.started:
            return config, stream
    return None


def equal(a, b):
    """True where two beliefs have the same bits."""
    return all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)
        for name in ("lla", "v_n", "C_nb", "P")
    )


def ends_alike(solution, belief):
    """True where a solution ends with the bits of a belief, in what its filter estimates."""
    path = solution.trajectory
    pairs = (
        (path.lla, belief.lla),
        (path.v_n, belief.v_n),
        (solution.b_a, belief.b_a),
        (solution.b_g, belief.b_g),
    )
    return all(np.isnan(rows[-1]).all() or np.array_equal(rows[-1], now) for rows, now in pairs)


def recordings(folder):
    """(name, Recording) of each."""
    data = data_folder(DESCRIPTIONS)
    for name in RECORDINGS:
        yield name, part(sd.read(DESCRIPTIONS / f"{name}.toml"), SECONDS)
    yield "walk0827", part(walked(folder), SHORTER)
    yield "swisslog", part(swisslog(data / "swisslog"), SHORTER)
    for pattern in LOGS:
        for path in sorted(data.glob(pattern)):
            yield str(path.relative_to(data)), part(sd.read(path), SHORTER)


def part(recording, seconds):
    """The beginning of a recording, with a name for each source and without what a configuration cannot say
    of it: lasting errors, and which sources are of one receiver."""
    own = recording.between(recording.span[0], recording.span[0] + seconds)
    sources = (
        replace(a, name=f"{k} {a.name or a.kind}", correlated=None, estimate={}, receiver="")
        for k, a in enumerate(own.sources)
    )
    return replace(own, sources=tuple(sources))


def replayed(name, recording):
    """Print a line for each port."""
    events = arrivals(recording, DELAY)
    if (found := started(recording, events)) is None:
        print(f"{name}: no filter starts on its {np.ptp(recording.span):.0f} s", flush=True)
        return
    config, wanted = found
    names = [a.name for a in recording.sources]
    for way in (_File, _Udp, _Serial):
        with tempfile.TemporaryDirectory() as folder:
            live, newest = through(way, config, events, names, Path(folder))
            log = sd.read(live.logs[0])
        again, end = sd.fuse(log, config["filter"]), live.stream.belief
        batch = sd.fuse(
            recording,
            config["filter"],
            start=start_of(log.meta["start"].values()),
            imu=config["imu"],
        )
        print(
            f"{name}, {config['filter']}, through {way.__name__[1:].lower()}: {len(events)} samples and fixes; "
            f"{SAME[equal(newest, wanted.belief)]} without a port, {SAME[ends_alike(again, end)]} of the log, "
            f"{SAME[ends_alike(batch, end)]} of the batch; {live.bad} bad, {live.missed} missed",
            flush=True,
        )


def main() -> None:
    """Replay those whose names contain one of the arguments; all without any."""
    asked = sys.argv[1:] or [""]
    with tempfile.TemporaryDirectory() as folder:
        for name, recording in recordings(Path(folder)):
            if any(word in name for word in asked):
                replayed(name, recording)


if __name__ == "__main__":
    main()
