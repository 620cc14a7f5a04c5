"""Smoothing under measurement: accuracy and time on workload A against the filter, and the memory
of a day at 100 Hz.

`python benchmarks/smoothing.py day PERIOD SECONDS EVERY` is what the process of the day runs; it
prints one JSON line.
"""

import json
import sys
import time

import numpy as np
import processes
import subject
import workload

FIGURES = ["A smoothed position", "A smoothing time over filter", "day at 100 Hz smoothed, memory"]
FILTER = "closed-loop"
TURNS = 15
"""Runs of filter and smoother, in turns; the median counts."""


def smoothing():
    """[(value, note)] for `FIGURES`: m rms, ratio, MB."""
    own, filters, ratio = times()
    all_rows, (peak, took, position) = day(1), day(100)
    return [
        (accuracy(), f"filter {subject.accuracy(workload.load('A'), FILTER).position:.4f} m"),
        (ratio, f"{own:.3f} against {filters:.3f} us per IMU sample, every row kept"),
        (
            peak,
            f"every 100th row kept, in {took:.0f} s, {position:.3f} m rms in the last hour; {all_rows[0]:.0f} MB with every row; all of the process, "
            "the input of 1.1 GB with it",
        ),
    ]


def accuracy(name=FILTER):
    """Rms of the smoothed position over workload A, m."""
    import strapdown as sd

    w = workload.load("A")
    path = sd.smooth(
        subject.recording(w), name, start=subject.start(w), noise=subject.noise(w.parameters)
    ).trajectory
    return workload.score(w, path.t, path.lla, path.v_n, path.rotation.as_matrix()).position


def times(name=FILTER, turns=TURNS, **more):
    """(us per sample of both ways of the smoother, of the filter's loop, ratio): medians of runs
    in turns; arrays and kernels are there before."""
    from strapdown.core.loop import loop
    from strapdown.core.loop.contract import compile_kernel
    from strapdown.engine import batch
    from strapdown.engine.options import run_options
    from strapdown.engine.smoothing import both_ways, run_back
    from strapdown.filters import find

    w = workload.load("A")
    log, start, noise = subject.recording(w), subject.start(w), subject.noise(w.parameters)
    made = lambda begin: begin(log, name, run_options(options=more, start=start, noise=noise))
    smoother = find(name).smoother
    for kernel in (run_back, loop.run, smoother.adjoint_step, smoother.save_step):
        compile_kernel(kernel)
    forward, out = subject.timed(made), made(batch.begin).out
    for part in out[:3]:
        part[...] = 0.0  # its pages are there

    def smooth():
        run = made(batch.begin)._replace(out=out)
        begin = time.perf_counter()
        both_ways(run, lambda done: None)
        return time.perf_counter() - begin

    forward(), smooth()
    pairs = np.array([(forward(), smooth()) for _ in range(turns)])
    us = np.median(pairs, axis=0) / (len(w.t) - 1) * 1e6
    return us[1], us[0], float(np.median(pairs[:, 1] / pairs[:, 0]))


def day(every, seconds=processes.DAY):
    """(MB at most in the process, seconds of `smooth`, rms position error in m of the last hour)
    of a synthetic day, each `every`-th row kept."""
    period = workload.stored_period()
    processes.child(__file__, "day", period, 20, every)  # compiles
    return processes.child(__file__, "day", period, seconds, every)[1]


def run_day(path, seconds, every):
    """What the process of `day` does."""
    import strapdown as sd

    with np.load(path) as piece:
        piece = dict(piece)
    w = workload.repeated(piece, seconds)
    log, start, noise = subject.recording(w), subject.start(w), subject.noise(w.parameters)
    begin = time.perf_counter()
    solution = sd.smooth(log, FILTER, start=start, noise=noise, every=every)
    took = time.perf_counter() - begin
    late = np.flatnonzero(solution.t > solution.t[-1] - 3600)[:: max(100 // every, 1)]
    error = (solution.trajectory.lla[late] - workload.round_position(piece, solution.t[late])) * [
        *workload.round_scale(piece),
        1.0,
    ]
    print(
        json.dumps(
            [processes.memory()[1] / 1e6, took, float(np.sqrt((error**2).sum(axis=1).mean()))]
        )
    )


if __name__ == "__main__":
    run_day(sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))
