"""Latency of `strapdown live`: `python benchmarks/live_latency.py`.

A process of the command takes JSON lines by UDP, the first 12 s of a simulated flight at once and then 60 s of it
in real time at 200 Hz, with fixes that come 0.2 s late. It keeps a log and a state. After each sample it sends
its newest state back. Printed are quantiles of the time from the datagram of a sample to that of its state, beside
those of a plain program that reads each JSON line and sends it back as one: the floor of machine and interpreter.

Then the first steps, of programs that begin anew: how long the first step takes after the constructor has
returned, and the processor time of the longest steps that come later, which other programs do not lengthen.
`... live_latency.py steps` is what each of them runs.
"""

import gc
import json
import select
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from late_fixes import arrivals
from processes import child

import strapdown as sd

RATE, GATHERED, SECONDS, DELAY = 200.0, 12.0, 60.0, 0.2
LATE = 20.0
"""s from which on fixes come late in the measured steps."""
STARTS = 5
"""Programs of which the median counts."""
FIGURES = ["live, latency", "live, latency of 99.9 %", "live, first step"]
QUANTILES = {"median": 0.5, "99 %": 0.99, "99.9 %": 0.999}
CONFIG = """
imu = "tactical"
lag = 1.0
log = "drive.jsonl"
state = "drive.state"
[[source]]
kind = "position"
name = "GNSS position"
[[source]]
kind = "velocity"
name = "GNSS velocity"
[[input]]
port = "udp:127.0.0.1:{input}"
[[output]]
port = "udp:127.0.0.1:{output}"
"""
ECHO = """
import json, select, socket, sys
own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
own.bind(("127.0.0.1", int(sys.argv[1])))
while True:
    select.select([own], [], [])
    line = own.recv(65536).strip()
    if line and "dtheta" in (table := json.loads(line)):
        own.sendto(json.dumps(table).encode(), ("127.0.0.1", int(sys.argv[2])))
"""
EVENTS = {
    "first": "the first step after the constructor",
    "first turn": "the same of `Live`: the ports are opened, a datagram used",
    "until it aligns": "the longest step until it aligns",
    "aligns": "the step that aligns",
    "sample": "the first sample after it",
    "fix": "the first fix",
    "late fix": "the first late fix",
    "later": "the longest one after these",
}
"""{step: what it is}."""


def line(event: sd.Sample | sd.Measurement, recording: sd.Recording) -> bytes:
    """The event as a JSON line."""
    table = event._asdict()
    if isinstance(event, sd.Measurement):
        table["source"] = recording.sources[int(event.source)].name
    return json.dumps(table).encode()


def free_port() -> int:
    """A port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


# ---- latency


def latencies(echo: bool) -> np.ndarray:
    """Latencies of the samples in real time (n,), s, of the command, or of the plain program."""
    recording = sd.simulate("demo", GATHERED + SECONDS, seed=1, rate=RATE)
    output, sender = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    output.bind(("127.0.0.1", 0))
    ports = free_port(), output.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "live.toml").write_text(CONFIG.format(input=ports[0], output=ports[1]))
        words = ["-m", "strapdown", "live", "live.toml", "--json"]
        process = subprocess.Popen(
            [sys.executable, *(["-c", ECHO, *map(str, ports)] if echo else words)],
            cwd=folder,
            stdout=subprocess.DEVNULL,
        )
        try:
            wait_for(ports[0])
            sender.connect(("127.0.0.1", ports[0]))
            return np.array(measured(recording, arrivals(recording, DELAY), sender, output))
        finally:
            process.terminate()
            process.wait()


def wait_for(port: int, seconds: float = 120.0) -> None:
    """Wait until a program reads the port: until then the system refuses datagrams, of which each empty line
    is passed over. Raises TimeoutError."""
    end = time.monotonic() + seconds
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("127.0.0.1", port))
        while time.monotonic() < end:
            try:
                probe.send(b"\n")
                time.sleep(0.1)
                probe.send(b"\n")
                return
            except ConnectionRefusedError:
                continue
    raise TimeoutError(f"nobody reads port {port}")


def measured(
    recording: sd.Recording,
    events: list[sd.Sample | sd.Measurement],
    sender: socket.socket,
    output: socket.socket,
) -> list[float]:
    """Latencies of the samples, s, each sent when it is due and its state awaited."""
    found: list[float] = []
    begin = 0.0
    output.settimeout(1.0)
    for event in events:
        data = line(event, recording)
        if event.t > GATHERED and isinstance(event, sd.Sample):
            begin = begin or time.perf_counter() - event.t + 0.5
            while time.perf_counter() < begin + event.t:
                time.sleep(0.0002)
        sent = time.perf_counter()
        sender.send(data)
        if event.t > GATHERED + 1.0 and isinstance(event, sd.Sample):
            found.append(time_of_state(event.t, output) - sent)
            continue
        if not isinstance(event, sd.Sample) or event.t < GATHERED:
            time.sleep(0.0005)
        while select.select([output], [], [], 0.0)[0]:  # or the system drops the states that wait
            output.recv(65536)
    return found


def time_of_state(t: float, output: socket.socket) -> float:
    """Time at which the state at t s came, s of time.perf_counter."""
    while True:
        data, came = output.recv(65536), time.perf_counter()
        if json.loads(data)["t"] >= t - 1e-6:
            return came


def quantiles(found: np.ndarray) -> dict[str, float]:
    """{name: ms}"""
    return {name: 1e3 * float(np.quantile(found, q)) for name, q in QUANTILES.items()}


# ---- the first steps


def run_steps() -> None:
    """What the process of `steps` does: print {one of EVENTS: ms} as JSON."""
    recording = sd.simulate("demo", LATE + 20.0, seed=1, rate=RATE)
    events = [event for event in arrivals(recording, 0.0) if event.t <= LATE]
    late = len(events)
    events += [event for event in arrivals(recording, DELAY) if event.t > LATE]
    first_turn = turn_of(line(events[1], recording))
    stream = sd.LiveStream(
        "closed-loop", imu="tactical", sources=recording.sources, lag=1.0, replay=True
    )
    took, started = [], 0
    for k, event in enumerate(events):
        clock = time.thread_time if k else time.perf_counter
        begin = clock()
        stream.step(event)
        took.append(1e3 * (clock() - begin))
        if not k:
            gc.freeze()  # as the command does
        started = started or (k if stream.started else 0)
    own = [
        next(k for k in range(begin, len(events)) if isinstance(events[k], kind))
        for kind, begin in (
            (sd.Sample, started + 1),
            (sd.Measurement, started + 1),
            (sd.Measurement, late),
        )
    ]
    later = max(took[k] for k in range(started + 1, len(events)) if k not in own)
    until = max(took[1:started])
    steps = took[0], first_turn, until, took[started], *(took[k] for k in own), later
    print(json.dumps(dict(zip(EVENTS, steps))))


def turn_of(data: bytes) -> float:
    """ms that a new `Live` takes to open its ports and use a datagram."""
    ports = free_port(), free_port()
    table = {
        "imu": "tactical",
        "input": [{"port": f"udp:127.0.0.1:{ports[0]}"}],
        "output": [{"port": f"udp:127.0.0.1:{ports[1]}"}],
    }
    with (
        sd.Live(table | {"source": [{"kind": "position"}, {"kind": "velocity"}]}) as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        begin = time.perf_counter()
        live.turn()
        opened = time.perf_counter()
        sender.sendto(data, ("127.0.0.1", ports[0]))
        sent = time.perf_counter()
        assert live.turn(), "the datagram did not come"
        return 1e3 * (opened - begin + time.perf_counter() - sent)


def first_steps() -> dict[str, float]:
    """{one of EVENTS: ms}, the median of programs that begin anew."""
    found = [child(__file__, "steps")[1] for _ in range(STARTS)]
    return {name: float(np.median([each[name] for each in found])) for name in EVENTS}


def results() -> list[tuple[float, str]]:
    """[(value, note)] of FIGURES."""
    floor, own, steps = quantiles(latencies(True)), quantiles(latencies(False)), first_steps()
    of = [(own[name], f"a plain echo takes {floor[name]:.3g} ms") for name in ("median", "99.9 %")]
    return [*of, (steps["first"], f"the step that aligns takes {steps['aligns']:.0f} ms")]


def main() -> None:
    """Print the quantiles and the first steps."""
    for name, echo in (("a plain echo", True), ("strapdown live", False)):
        found = latencies(echo)
        shown = ", ".join(f"{each}: {ms:.3f} ms" for each, ms in quantiles(found).items())
        print(f"{name}, {len(found)} samples at {RATE:g} Hz: {shown}", flush=True)
    for name, ms in first_steps().items():
        print(f"{EVENTS[name]}: {ms:.3f} ms")


if __name__ == "__main__":
    run_steps() if sys.argv[1:] == ["steps"] else main()
