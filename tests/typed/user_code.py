"""What a user writes, as a strict type checker sees it: `make lint` checks this file, nothing runs it.

A line with `type: ignore` must be an error of that kind: an ignore that is not needed is one itself.
"""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import strapdown as sd
from strapdown.evaluation.metrics import Errors
from strapdown.sim.trajectory import demo_flight


def from_a_file() -> sd.Solution:
    """Read, fuse, look, write."""
    recording = sd.read("recording.toml")
    assert_type(recording, sd.Recording)
    solution = sd.fuse(recording, "closed-loop", every=10, options={"error_model": "literal"})
    assert_type(solution, sd.Solution)
    assert_type(solution.trajectory, sd.Trajectory)
    assert_type(solution.trajectory.lla, NDArray[np.float64])
    assert_type(solution.b_a, NDArray[np.float64])
    assert_type(solution.events, tuple[tuple[float, str], ...])
    print(solution.table().tail())
    sd.write_solution(solution, "solution.nc")
    if recording.reference is not None:
        assert_type(sd.errors(solution, recording.reference), Errors)
        sd.report(solution, recording.reference).save("report.html")
    return sd.smooth(recording)


def simulated() -> float:
    """Simulate, align, stream."""
    recording = sd.simulate(demo_flight(), 60.0, "tactical", seed=1)
    start = sd.align(recording, sd.grade("tactical"))
    assert_type(start, sd.InitialState)
    stream = sd.Stream("closed-loop", start=start, imu="tactical", aidings=recording.aidings)
    print(stream)
    campaign = sd.Study(("demo",), ("closed-loop",), runs=2).run("study")
    assert_type(campaign, sd.Campaign)
    return float(recording.imu.dt.sum())


def wrong(recording: sd.Recording, start: sd.InitialState) -> None:
    """Each of these is an error before anything runs."""
    sd.fuse(42)  # type: ignore[arg-type]
    sd.fuse(recording, filtre=3)  # type: ignore[call-arg]
    sd.tune(recording, every=2)  # type: ignore[call-arg]
    sd.fuse(recording, every="2")  # type: ignore[arg-type]
    sd.fuse(recording).trajectorie  # type: ignore[attr-defined]
    sd.fuze(recording)  # type: ignore[attr-defined]
    sd.read(3)  # type: ignore[arg-type]
    sd.smooth(recording, start=3.0)  # type: ignore[arg-type]
    sd.simulate(demo_flight(), "60 s", "tactical", seed=1)  # type: ignore[arg-type]
    start.heading  # type: ignore[attr-defined]
