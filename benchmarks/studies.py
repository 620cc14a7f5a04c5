"""Figures of studies: the first paper's whole study, its quick form, threads, memory, and how near
the closed loop comes to the Cramer-Rao bound.

`python benchmarks/studies.py runs COUNT`, `... threads COUNT` and `... busy` are what the child
processes run; each prints one JSON line.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from processes import child, environment, memory

TACTICAL, CLOSED = "paper1-tactical", "closed-loop-error-bias"
EVERY = 20
"""IMU samples from one row that a study keeps to the next, at 20 Hz."""
SECONDS = 6.0
"""s that a busy process counts, and about the least that a run for the threads lasts."""


def paper(*options):
    """(seconds, filter steps, worst Cramer-Rao ratio of the closed loop at tactical grade) of
    `strapdown reproduce hager-bryne`, its page included."""
    from strapdown.experiments.monte_carlo.campaign import Campaign

    with tempfile.TemporaryDirectory() as folder:
        took, _ = child("-m", "strapdown", "reproduce", "hager-bryne", "--out", folder, *options)
        found = [Campaign.open(path.parent) for path in Path(folder).rglob("manifest.json")]
        steps = sum(
            cell["scenario"]["duration_s"]
            * cell["scenario"]["rate_hz"]
            * c.manifest["runs"]
            * len(c.manifest["filters"])
            for c in found
            for cell in c.manifest["cells"]
        )
        ratios = [
            row.bound_ratio
            for c in found
            for _, row in c.summary.iterrows()
            if row.imu == TACTICAL
            and row["filter"] == CLOSED
            and not row.scenario.endswith("-offset")
        ]
        return took, steps, max(ratios, key=lambda ratio: abs(ratio - 1))


def peak(runs):
    """Largest memory, MB, of a process that does so many runs of a minute."""
    return child(__file__, "runs", runs)[1]


def threads():
    """(speed of two threads over one, the same of two independent processes that only count)."""
    one, two = child(__file__, "threads", 1)[1], child(__file__, "threads", 2)[1]
    return one / two, busy()


def busy():
    """How much two processes get done against one."""

    def counted(number):
        started = [
            subprocess.Popen(
                [sys.executable, __file__, "busy"],
                env=environment(),
                stdout=subprocess.PIPE,
                text=True,
            )
            for _ in range(number)
        ]
        return sum(json.loads(process.communicate()[0]) for process in started)

    return counted(2) / counted(1)


def minute(runs):
    """A study of so many runs of a minute at 20 Hz with a fix at each sample."""
    import strapdown as sd

    flight = sd.scenario("paper1-01").replace(name="a minute", duration=60.0)
    return sd.Study(flight, ("closed-loop",), (TACTICAL,), runs, seed=1)


def run_threads(count):
    """Seconds of a study on `count` threads, everything compiled and simulated once before."""
    import strapdown as sd

    made = sd.Study(
        "paper1-04", ("open-loop", "closed-loop"), (TACTICAL,), 400, seed=1, chunk_steps=400_000
    )
    from strapdown.experiments.monte_carlo.study import run_chunk

    run_chunk(made, made.chunks()[0])
    begin = time.perf_counter()
    made.run(threads=count)
    return time.perf_counter() - begin


def count():
    """Rounds of a sum of floats in SECONDS."""
    rounds, end, x = 0, time.perf_counter() + SECONDS, np.arange(20_000.0)
    while time.perf_counter() < end:
        x.sum()
        rounds += 1
    return rounds


if __name__ == "__main__":
    what, *rest = sys.argv[1:]
    if what == "runs":
        minute(int(rest[0])).run()
        print(json.dumps(memory()[1] / 1e6))
    else:
        print(json.dumps(run_threads(int(rest[0])) if what == "threads" else count()))
