"""Cost of the page of `strapdown live`: `python benchmarks/live_page.py`.

A simulated flight at 200 Hz is replayed in real time, first alone, then with a page that nobody looks at, then
with viewers in a process of their own. Printed is the time of processor in the program, % of a core. Then the
verdict on all that a filter keeps, which another process makes: how long the filter takes to hand it over, and
how much time of processor the verdict takes.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.engine.stream import HISTORY
from strapdown.engine.verdict_process import EVERY, SHARE, VerdictProcess

VERDICTS = 6
RATE, GATHERED, SECONDS = 200.0, 15.0, 30.0
VIEWER = """
import sys, urllib.request
with urllib.request.urlopen(sys.argv[1] + "events") as answer:
    while answer.readline():
        pass
"""


def share(config: dict, page: int | None, viewers: int) -> float:
    """Time of processor per time, after the start of the filter."""
    with sd.Live(config, page=page) as live:
        words = [sys.executable, "-c", VIEWER, live.page]
        processes = [subprocess.Popen(words) for _ in range(viewers)]
        run(live, GATHERED)
        before, begin = time.process_time(), time.perf_counter()
        run(live, SECONDS)
        found = (time.process_time() - before) / (time.perf_counter() - begin)
    for process in processes:
        process.wait()
    return found


def judge() -> None:
    """Print what verdicts on a whole history cost."""
    recording = sd.simulate("demo", HISTORY / RATE - 10.0, seed=1, rate=RATE)
    stream, verdicts = (
        sd.Stream("closed-loop", sources=recording.sources, imu="tactical"),
        VerdictProcess(0.0),
    )
    for event in events(recording):
        stream.step(event)
    handed, found = [], []
    for _ in range(VERDICTS):
        newest, verdicts._due = verdicts.newest, 0.0
        begin = time.perf_counter()
        verdicts.look(stream)
        handed.append(1e3 * (time.perf_counter() - begin))
        while verdicts.newest is newest:
            time.sleep(0.1)
        found.append(verdicts.newest)
    verdicts.close()
    first, *later = (each.seconds for each in found)
    mean = float(np.mean(later))
    share = mean / max(EVERY, mean / SHARE)
    print(
        f"verdict on {found[-1].span.split(',')[0]}: handed over in {np.median(handed):.2f} ms, at most "
        f"{max(handed):.2f} ms; {first:.1f} s of processor with the start, then {mean:.2f} s, "
        f"{100 * share:.1f} % of a core"
    )


def events(recording: sd.Recording) -> list:
    """Samples and measurements in the order of time."""
    rows = [
        (t, 1, sd.Sample(t, dt, (*a,), (*b,)))
        for t, dt, a, b in zip(*map(np.ndarray.tolist, recording.imu))
    ]
    for k, a in enumerate(recording.sources):
        columns = map(np.ndarray.tolist, (a.t, a.y, a.std))
        rows += [(t, 0, sd.Measurement(t, k, (*y,), (*std,))) for t, y, std in zip(*columns)]
    return [event for *_, event in sorted(rows, key=lambda row: row[:2])]


def run(live: sd.Live, seconds: float) -> None:
    """Let the program go on."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if not live.turn():
            live._wait()


def main() -> None:
    """Print the shares."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.nc"
        sd.write_recording(sd.simulate("demo", GATHERED + SECONDS + 10.0, seed=1, rate=RATE), path)
        part = {"format": "recording", "path": str(path), "speed": 1.0}
        config = {"imu": "tactical", "lag": 1.0, "input": [part]}
        cases = {
            "alone": (None, 0),
            "page": (0, 0),
            "page, 1 viewer": (0, 1),
            "page, 8 viewers": (0, 8),
        }
        found = {name: share(config, *case) for name, case in cases.items()}
    more = np.array([*found.values()]) - found["alone"]
    for (name, total), extra in zip(found.items(), more):
        print(f"{name:16} {100 * total:5.1f} % of a core, {100 * extra:+.1f} %")
    judge()


if __name__ == "__main__":
    main()
