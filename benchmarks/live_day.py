"""A simulated day at 50 times speed through `strapdown live`: `python benchmarks/live_day.py`.

A process sends a closed figure again and again as JSON lines by UDP, with noise and faults as in life: bursts;
samples twice, out of order, cut and at another time; fixes that are late, wrong or missing; in each hour some
seconds without anything. The command takes them, writes a log, a state and states by UDP, and shows its page to a
viewer. Printed after each simulated hour are the memory of its process, and what became of the lines that were
sent: used, dropped for a reason, unreadable, dropped by the system, or waiting for the next sample.
"""

import argparse
import json
import multiprocessing
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from heapq import heappop, heappush
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import workload

from strapdown.cli.live.ports import Port, address_of
from strapdown.engine.live_stream import CONFIRMED
from strapdown_reproductions.common import markdown

PAGE = Path(__file__).resolve().parents[1] / "docs" / "how-to" / "live.md"
MARK = "<!-- begin: day of python benchmarks/live_day.py -->"

HOUR = 3600
TICK = 0.05
"""Simulated s whose lines are sent at once."""
STATES = 10.0
"""Hz of the states, in simulated time."""
ROW = 250
"""Bytes of a sample in the log, at most."""
PIECE = 1 << 24
"""Bytes of it that are read at a time."""
WARM = 1
"""Hours after which memory is to stay as it is."""
SETTLED = 2.5
"""s without a new state after which all has been read, written and shown, after each hour."""
READY = 60.0
"""s for the process to load its kernels."""
CONFIG = """
imu = "tactical"
lag = 1.0
log = "day.jsonl"
state = "day.state"
[[source]]
kind = "position"
[[source]]
kind = "velocity"
[[input]]
port = "udp:127.0.0.1:{input}"
[[output]]
port = "udp:127.0.0.1:{output}"
rate = {rate}
"""
TWICE, SWAPPED, CUT, ELSEWHEN = 5e-4, 1e-3, 5e-5, 2e-5
"""Shares of the samples that come twice, after the next one, cut in half, and once more 40 s ahead."""
BURSTS = 1 / 60
"""Share of the seconds whose samples come all at their end."""
LOST, TOO_LATE, WRONG = 0.02, 0.02, 0.005
"""Shares of the fixes that do not come, come after the lag, and are 50 m or 5 m/s off."""
DELAYS = (0.1, 0.4)
"""s by which the others come after their samples."""
GAP = (3.0, 8.0)
"""s without anything, once in an hour."""


class Sent(NamedTuple):
    """Numbers of the lines so far, and the gaps between samples, s."""

    lines: int
    samples: int
    fixes: int
    gaps: list[tuple[float, float]]
    faults: dict[str, int]
    behind: float  # s of real time, most that the sender was behind its clock


class Day:
    """The lines of a day, made second by second."""

    def __init__(self, rate: int, seed: int = 1) -> None:
        self._rate, self._random, p = rate, np.random.default_rng(seed), workload.TACTICAL
        self._piece = workload.period(rate=rate)
        self._noise, self._bias = (
            {
                "dtheta": factors("gyro"),
                "dv": factors("accel"),
            }
            for factors in (
                lambda sensor: p[f"{sensor}_noise"] / rate**0.5,
                lambda sensor: self._random.standard_normal(3) * p[f"{sensor}_bias_std"] / rate,
            )
        )
        self._metre = np.array([*(1 / each for each in workload.round_scale(self._piece)), 1.0])
        self._fixes: list[tuple[float, bytes]] = []  # by their arrival
        self._held: list[bytes] = []
        self._gap = (0.0, 0.0)
        self.samples = self.fixes = 0
        self.gaps: list[tuple[float, float]] = []
        self.faults = Counter[str]()

    def second(self, k: int) -> list[list[bytes]]:
        """The lines of each tick of the second from k s on."""
        if k % HOUR == 0:
            begin = float(k + self._random.integers(HOUR // 4, HOUR // 2))
            self._gap = begin, begin + float(self._random.uniform(*GAP))
            self.gaps.append(self._gap)
        ticks: list[list[bytes]] = [[] for _ in range(round(1 / TICK))]
        is_burst = self._random.random() < BURSTS
        self.faults["bursts"] += is_burst
        for j, lines in enumerate(self._samples(k)):
            ticks[-1 if is_burst else j * len(ticks) // self._rate] += lines
        self._take_fixes(k + 1)
        for n, tick in enumerate(ticks):
            while self._fixes and self._fixes[0][0] <= k + (n + 1) * TICK:
                tick.append(heappop(self._fixes)[1])
        return ticks

    def _is_silent(self, t: float) -> bool:
        return self._gap[0] < t <= self._gap[1]

    def _samples(self, k: int) -> Iterator[list[bytes]]:
        """Lines in the place of each sample of a second."""
        first = k * self._rate
        rows = np.arange(first, first + self._rate) % len(self._piece["dtheta"])
        columns = []
        for name in ("dtheta", "dv"):
            noise = self._random.standard_normal((self._rate, 3)) * self._noise[name]
            columns.append((self._piece[name][rows] + self._bias[name] + noise).tolist())
        chances = self._random.random(self._rate).tolist()
        for j, (dtheta, dv, chance) in enumerate(zip(*columns, chances)):
            t = (first + j + 1) / self._rate
            yield [] if self._is_silent(t) else self._with_faults(t, dtheta, dv, chance)

    def _with_faults(
        self, t: float, dtheta: list[float], dv: list[float], chance: float
    ) -> list[bytes]:
        self.samples += 1
        line = self._line(t, dtheta, dv)
        held, self._held = self._held, []
        for name, share in (
            ("twice", TWICE),
            ("out of order", SWAPPED),
            ("cut", CUT),
            ("at another time", ELSEWHEN),
        ):
            chance -= share
            if chance < 0:
                self.faults[name] += 1
                break
        else:
            return [line, *held]
        self.samples += name in ("twice", "at another time")
        if name == "twice":
            return [line, line, *held]
        if name == "out of order":
            self._held = [line]
            return held
        if name == "cut":
            return [line[: len(line) // 2], *held]
        return [line, self._line(t + 40.0, dtheta, dv), *held]

    def _line(self, t: float, dtheta: list[float], dv: list[float]) -> bytes:
        text = f'{{"t":{t!r},"dt":{1 / self._rate!r},"dtheta":{dtheta!r},"dv":{dv!r}}}'
        return text.encode()

    def _take_fixes(self, t: int) -> None:
        """Make the fixes of a second, to come later."""
        place = workload.round_position(self._piece, np.array([t]))[0]
        row = t * self._rate % len(self._piece["dtheta"])
        sources = (
            ("position", place, self._metre, 1.0),
            ("velocity", self._piece["v_n"][row], np.ones(3), 0.1),
        )
        delay = float(self._random.uniform(*DELAYS))
        for name, y, unit, std in sources:
            chance = self._random.random()
            off = std * self._random.standard_normal(3)
            if self._is_silent(t) or chance < LOST:
                self.faults["lost fixes"] += 1
                continue
            if chance < LOST + TOO_LATE:
                self.faults["late fixes"] += 1
            elif chance < LOST + TOO_LATE + WRONG:
                self.faults["wrong fixes"] += 1
                off[0] += 50 * std
            self.fixes += 1
            later = 1.5 if chance < LOST + TOO_LATE else delay
            table = {"t": t, "source": name, "y": [*(y + off * unit)], "std": [std] * 3}
            heappush(self._fixes, (t + later, json.dumps(table).encode()))


def send(pipe, port: int, seconds: int, rate: int, speed: float) -> None:
    """What the sender does: an hour at a time, then it waits for an answer."""
    udp, day = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), Day(rate)
    lines, behind = 0, 0.0
    pipe.send("ready")
    pipe.recv()
    for first in range(0, seconds, HOUR):
        begin = time.perf_counter()
        for k in range(first, min(first + HOUR, seconds)):
            for n, tick in enumerate(day.second(k)):
                for line in tick:
                    udp.sendto(line, ("127.0.0.1", port))
                lines += len(tick)
                early = begin + (k - first + (n + 1) * TICK) / speed - time.perf_counter()
                behind = max(behind, -early)
                if early > 0:
                    time.sleep(early)
        pipe.send(Sent(lines, day.samples, day.fixes, day.gaps, dict(day.faults), behind))
        pipe.recv()


class States:
    """States that come by UDP, in a thread of its own."""

    def __init__(self, port: int) -> None:
        self._port = Port(address_of(f"udp:127.0.0.1:{port}", ""))
        self.count, self.newest = 0, -1.0
        self.steps: list[tuple[float, float]] = []  # times of neighbours that are farther apart
        self._port.read()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            for line in self._port.read():
                t = json.loads(line)["t"]
                if self.count and t > self.newest + 1.5 / STATES:
                    self.steps.append((self.newest, t))
                self.count, self.newest = self.count + 1, t
            time.sleep(0.01)

    @property
    def missed(self) -> int:
        """Number of datagrams that the system dropped here."""
        return self._port.missed

    def lacking(self, gaps: list[tuple[float, float]]) -> int:
        """Number of states that are not there, outside gaps."""
        found = 0
        for begin, end in self.steps:
            length = end - begin
            for first, last in gaps:
                # the samples after a gap are used once they have confirmed their time
                if begin <= first + 1 / STATES and last - 1 / STATES <= end:
                    length -= last - first + CONFIRMED
            found += max(round(length * STATES) - 1, 0)
        return found


class Viewer:
    """A viewer of the page, in a thread of its own."""

    def __init__(self, url: str) -> None:
        self._url, self.newest, self.looks = url, dict[str, Any](), 0
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        with suppress(OSError), urllib.request.urlopen(self._url + "events") as answer:
            for line in answer:
                if line.startswith(b"data:"):
                    self.newest, self.looks = json.loads(line[5:]), self.looks + 1

    def settle(self) -> None:
        """Wait until no newer state comes."""
        t, since = None, time.monotonic()
        while time.monotonic() < since + SETTLED:
            if self.newest.get("t") != t:
                t, since = self.newest["t"], time.monotonic()
            time.sleep(0.1)


class Logs:
    """Counts of what stands in the logs, of which each start of the filter has one."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._read = folder, Counter[Path]()
        self.samples = self.fixes = 0

    def count(self) -> None:
        """Count what was added."""
        for path in self._folder.glob("day*.jsonl"):
            with path.open("rb") as file:
                file.seek(self._read[path])
                while piece := file.read(PIECE):
                    whole = piece[: piece.rfind(b"\n") + 1]
                    if not whole:
                        break
                    self._read[path] += len(whole)
                    file.seek(self._read[path])
                    self.samples += whole.count(b"],[")
                    self.fixes += whole.count(b"], [")


class Program:
    """The process of the command, and what it says."""

    def __init__(self, folder: Path, ports: tuple[int, int]) -> None:
        text = CONFIG.format(input=ports[0], output=ports[1], rate=STATES)
        (folder / "day.toml").write_text(text)
        words = [sys.executable, "-m", "strapdown", "live", "day.toml", "--page", "0", "--json"]
        self._events = folder / "events"
        with self._events.open("wb") as events:
            self._process = subprocess.Popen(
                words, cwd=folder, stdout=subprocess.PIPE, stderr=events
            )
        end = time.monotonic() + READY
        while not self.events and time.monotonic() < end:
            time.sleep(0.1)
        self.page = self.events[0].split()[-1]

    @property
    def events(self) -> list[str]:
        """Lines on standard error."""
        return self._events.read_text().splitlines()

    @property
    def memory(self) -> float:
        """MB that the process has in memory."""
        status = Path(f"/proc/{self._process.pid}/status").read_text()
        return int(status.partition("VmRSS:")[2].split()[0]) * 1024 / 1e6

    @property
    def busy(self) -> float:
        """s of a processor that the process took."""
        fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def end(self) -> dict:
        """What it says at its end."""
        self._process.send_signal(signal.SIGTERM)
        return json.loads(self._process.communicate()[0])


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def fates(said: dict, logs: Logs) -> dict[str, int]:
    """Numbers of the lines by what became of them: as the logs have it, and the program says."""
    dropped = {f"dropped {cause}": count for cause, count in said["dropped"].items()}
    return {
        "samples used": logs.samples,
        "measurements used": logs.fixes,
        **dropped,
        "not readable": said["bad"],
        "dropped by the system": sum(said["missed"].values()),
    }


def run(seconds: int, rate: int, speed: float, folder: Path) -> str:
    """Send it, print a line for each hour, and return the text of the page."""
    ports = free_port(), free_port()
    states, program = States(ports[1]), Program(folder, ports)
    viewer, logs = Viewer(program.page), Logs(folder)
    context = multiprocessing.get_context("spawn")
    own, theirs = context.Pipe()
    context.Process(
        target=send, args=(theirs, *ports[:1], seconds, rate, speed), daemon=True
    ).start()
    own.recv()
    memory: list[float] = []
    shares: list[float] = []
    for hour in range(1, -(-seconds // HOUR) + 1):
        begin, busy = time.monotonic(), program.busy
        own.send("go on")
        sent: Sent = own.recv()
        took = time.monotonic() - begin
        shares.append((program.busy - busy) / took)
        viewer.settle()
        logs.count()
        memory.append(program.memory)
        found = fates(viewer.newest, logs)
        waits = sent.lines - sum(found.values())
        shown = ", ".join(f"{count} {fate}" for fate, count in found.items())
        print(
            f"hour {hour} in {took:.1f} s, {100 * shares[-1]:.0f} % of a core: {memory[-1]:.1f} MB; {sent.lines} sent: {shown}, {waits} wait",
            flush=True,
        )
    own.send("end")
    said = program.end()
    logs.count()
    print("\n".join(program.events[-20:]))
    print(sent, said, f"{viewer.looks} looks of the viewer")
    used = sum(map(sum, said["counts"].values()))
    if used != logs.fixes:
        print(f"{used} measurements counted as used, {logs.fixes} in the logs")
    about = Run(seconds, rate, speed, memory, float(np.median(shares)))
    return text_of(about, sent, fates(said, logs), states, sum(said["unsent"].values()))


class Run(NamedTuple):
    """What was asked, and what it took."""

    seconds: int
    rate: int
    speed: float
    memory: list[float]  # MB after each hour
    share: float  # of a core


def text_of(about: Run, sent: Sent, found: dict[str, int], states: States, unsent: int) -> str:
    """Return the sentences on a run."""
    lost, untaken = sent.lines - sum(found.values()), unsent + states.missed
    before, after = about.memory[:WARM], about.memory[WARM:]
    growth = max(after, default=before[-1]) - before[-1]
    shown = ", ".join(f"{count} {fate}" for fate, count in found.items())
    return (
        f"{about.seconds / HOUR:g} simulated hours at {about.speed:g} times speed, {about.rate} Hz, take "
        f"{100 * about.share:.0f} % of a core. Of {sent.lines} lines {lost} were lost uncounted ({shown}); of "
        f"{states.count + untaken} states {untaken} were not taken and {states.lacking(sent.gaps) - untaken} are "
        f"missing outside gaps. Memory grew by {growth:.1f} MB after the first hour, to {about.memory[-1]:.0f} MB.\n"
    )


def main() -> None:
    """Run it; a whole day goes into the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rate", type=int, default=200, help="Hz of the samples")
    parser.add_argument("--speed", type=float, default=50.0)
    options = parser.parse_args()
    seconds = round(options.hours * HOUR)
    with tempfile.TemporaryDirectory() as folder:
        needed, free = seconds * options.rate * ROW / 1e9, shutil.disk_usage(folder).free / 1e9
        if needed > 0.8 * free:
            parser.error(f"the log takes {needed:.1f} GB, {folder} has {free:.1f} GB; set TMPDIR")
        text = run(seconds, options.rate, options.speed, Path(folder))
    print(text)
    if options.hours == 24.0:
        markdown.insert(PAGE, text, MARK)


if __name__ == "__main__":
    main()
