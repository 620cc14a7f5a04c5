"""Cost of the page of `strapdown live`: `python benchmarks/live_page.py`.

A simulated flight at 200 Hz is replayed in real time, first alone, then with a page that nobody looks at, then
with viewers in a process of their own. Printed is the time of processor in the program, % of a core.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import strapdown as sd

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


if __name__ == "__main__":
    main()
