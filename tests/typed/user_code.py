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
    assert_type(recording, sd.SimulatedRecording)
    assert_type(recording.reference, sd.Trajectory)
    assert_type(recording.between(10.0, 20.0).between(12.0, 18.0), sd.SimulatedRecording)
    assert_type(sd.flight.fly("straight").recording.reference, sd.Trajectory)
    found = sd.fuse(recording).errors()
    assert_type(found.rms().position, NDArray[np.float64])
    assert_type(found.outages([(20.0, 30.0)])[0].horizontal_max, float)
    start = sd.align(recording, "tactical")
    assert_type(start, sd.InitialState)
    stream = sd.Stream("closed-loop", start=start, imu="tactical", sources=recording.sources)
    print(stream)
    study = sd.Study("demo", "closed-loop", runs=2)
    assert_type(study.scenarios, tuple[str | sd.Scenario, ...])
    sd.Study([sd.scenario("demo"), "car"], imus=["tactical", sd.imu("consumer")])
    campaign = study.run("study")
    assert_type(campaign, sd.Campaign)
    return float(recording.imu.dt.sum())


def wrong(recording: sd.Recording, start: sd.InitialState) -> None:
    """Each of these is an error before anything runs."""
    sd.fuse(42)  # type: ignore[arg-type]
    sd.fuse(recording, filtre=3)  # type: ignore[call-arg]
    sd.tune(recording, every=2)  # type: ignore[call-arg]
    sd.fuse(recording, every="2")  # type: ignore[arg-type]
    sd.errors(recording, recording.reference)  # type: ignore[arg-type]
    sd.report("x")  # type: ignore[arg-type]
    sd.Study(3)  # type: ignore[arg-type]
    sd.fuse(recording).trajectorie  # type: ignore[attr-defined]
    sd.fuze(recording)  # type: ignore[attr-defined]
    sd.read(3)  # type: ignore[arg-type]
    sd.smooth(recording, start=3.0)  # type: ignore[arg-type]
    sd.simulate(demo_flight(), "60 s", "tactical", seed=1)  # type: ignore[arg-type]
    start.heading  # type: ignore[attr-defined]
