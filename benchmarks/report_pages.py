"""How large the page of a solution is, and how long it takes to write."""

import re
import time
from dataclasses import replace

import numpy as np

import strapdown as sd
from strapdown.sim.trajectory import demo_flight

FIGURES = ("page, script", "page, the demo", "page, the demo written", "page, a day at 100 Hz")
ROUNDS = 5
DAY = 86400.0
"""s."""


def demo():
    """The recording of `strapdown demo`, and {filter: Solution}."""
    recording = sd.simulate(demo_flight(), 600.0, "tactical", 7)
    names = ("closed-loop", "open-loop")
    return recording, {name: sd.fuse(recording, name, imu="tactical") for name in names}


def pages():
    """[(value, note)] of FIGURES, in MB and s: the page without reading and fusing."""
    recording, solutions = demo()
    taken = []
    for _ in range(ROUNDS + 1):  # the first also loads plotly
        before = time.perf_counter()
        page = sd.report(solutions, recording.reference, window=(120.0, 600.0))
        taken.append(time.perf_counter() - before)
    script = re.search("id=plotly>(.*?)</script>", page.html)[1]
    whole = repeated(solutions["closed-loop"], DAY)
    before = time.perf_counter()
    day = sd.report(whole)
    taken_by_day = time.perf_counter() - before
    note = f"median of {ROUNDS}; the first page of a process takes {taken[0]:.2g} s"
    return [
        (len(script) / 1e6, ""),
        (len(page.html.encode()) / 1e6, "600 s, 2 filters"),
        (float(np.median(taken[1:])), note),
        (len(day.html.encode()) / 1e6, f"1 filter, written in {taken_by_day:.0f} s"),
    ]


def repeated(solution, seconds):
    """A Solution whose rows and fixes follow on one another for so long."""
    length = solution.t[-1]
    times = int(np.ceil(seconds / length))

    def tiled(values, t=None):
        """The values once after another, those of a time `t` later each time."""
        out = np.concatenate([values] * times)
        return out if t is None else out + np.repeat(np.arange(times) * length, len(values))

    old, fixes = solution.trajectory, solution.innovations
    trajectory = type(old)(
        tiled(old.t, True),
        *(tiled(values) for values in (old.lla, old.v_n, old.q_nb, old.std)),
    )
    again = {
        name: tiled(values, True if name == "t" else None)
        for name, values in vars(fixes).items()
        if isinstance(values, np.ndarray) and len(values) == len(fixes.t)
    }
    return replace(
        solution,
        trajectory=trajectory,
        b_a=tiled(solution.b_a),
        b_g=tiled(solution.b_g),
        status=tiled(solution.status),
        columns={name: tiled(values) for name, values in solution.columns.items()},
        innovations=replace(fixes, **again),
        recording=None,
    )
