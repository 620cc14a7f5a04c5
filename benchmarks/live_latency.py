"""Latency of `strapdown live`: `python benchmarks/live_latency.py`.

A process of the command takes JSON lines by UDP, the first 12 s of a simulated flight at once and
then 20 s of it in real time at 200 Hz, with fixes that come 0.2 s late. After each sample it sends
its newest state back. Printed are quantiles of the time from the datagram of a sample to that of
its state, ms.
"""

import json
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from late_fixes import arrivals

import strapdown as sd

RATE, GATHERED, SECONDS = 200.0, 12.0, 20.0
CONFIG = """
imu = "tactical"
lag = 1.0
[[source]]
kind = "position"
name = "GNSS position"
[[source]]
kind = "velocity"
name = "GNSS velocity"
[[input]]
port = "udp:{input}"
[[output]]
port = "udp:127.0.0.1:{output}"
"""


def line(event: sd.Sample | sd.Measurement, recording: sd.Recording) -> bytes:
    """The event as a JSON line."""
    table = event._asdict()
    if isinstance(event, sd.Measurement):
        table["source"] = recording.sources[int(event.source)].name
    return json.dumps(table).encode()


def latencies(folder: Path) -> np.ndarray:
    """Latencies of the samples in real time (n,), s."""
    recording = sd.simulate("demo", GATHERED + SECONDS, seed=1, rate=RATE)
    events = arrivals(recording, 0.2)
    output, sender = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    output.bind(("127.0.0.1", 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = free.getsockname()
    text = CONFIG.format(input=address[1], output=output.getsockname()[1])
    (folder / "live.toml").write_text(text)
    words = [sys.executable, "-m", "strapdown", "live", "live.toml", "--json"]
    process = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL)
    time.sleep(10.0)  # until its kernels are loaded
    try:
        return np.array(_measured(recording, events, sender, address, output))
    finally:
        process.terminate()
        process.wait()


def _measured(
    recording: sd.Recording,
    events: list[sd.Sample | sd.Measurement],
    sender: socket.socket,
    address: tuple[str, int],
    output: socket.socket,
) -> list[float]:
    """Latencies of the samples, s, each sent when it is due and its state awaited."""
    found: list[float] = []
    begin = 0.0
    for event in events:
        if event.t > GATHERED and isinstance(event, sd.Sample):
            begin = begin or time.perf_counter() - event.t + 0.5
            while time.perf_counter() < begin + event.t:
                time.sleep(0.0002)
        sent = time.perf_counter()
        sender.sendto(line(event, recording), address)
        if event.t > GATHERED + 1.0 and isinstance(event, sd.Sample):
            output.settimeout(1.0)
            while json.loads(output.recv(65536))["t"] < event.t - 1e-6:
                pass
            found.append(time.perf_counter() - sent)
        elif not isinstance(event, sd.Sample) or event.t < GATHERED:
            time.sleep(0.0005)
    return found


def main() -> None:
    """Print the quantiles."""
    with tempfile.TemporaryDirectory() as folder:
        found = 1e3 * latencies(Path(folder))
    shown = ", ".join(f"{100 * q:g} %: {np.quantile(found, q):.2f} ms" for q in (0.5, 0.99, 0.999))
    print(f"{len(found)} samples at {RATE:g} Hz: {shown}")


if __name__ == "__main__":
    main()
