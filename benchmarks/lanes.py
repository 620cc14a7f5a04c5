"""Runs side by side: the closed loop on lanes with its noise beside the scalar loop, and what bounds it.

`python benchmarks/lanes.py` prints the table of docs/lanes.md: parts of a run-step, cost by number of
runs, and the distance to what the processor can do.
"""

import time
from statistics import median

import strapdown as sd
from strapdown.core import loop
from strapdown.core.signatures import LANES
from strapdown.engine.batch import begin
from strapdown.engine.prepare import Asked
from strapdown.engine.side_by_side import SideBySide
from strapdown.experiments.monte_carlo import lane_scoring, lanes
from strapdown.experiments.monte_carlo.scoring import epochs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import grade
from strapdown.sensor_models.streams import Stream
from strapdown.sim.synthesis import Simulator

SECONDS, RATE, KEPT = 60.0, 100.0, 20
"""Of a flight, Hz, and IMU samples from one row that is kept to the next, as in the first paper's
study."""
TIMES = 15
FIGURES = ["lanes, a fix each 20th step", "lanes, a fix each step"]


class Flight:
    """Eight runs of a minute with a position and a velocity fix every so many steps."""

    def __init__(self, every, filter="closed-loop"):
        gnss = Gnss(interval=every / RATE, position_sd=(1.0,) * 3, velocity_sd=(0.05,) * 3)
        demo = sd.scenario("demo")
        self.made = Simulator(demo.replace(duration=SECONDS, rate=RATE, gnss=gnss))
        self.spec, self.filter = grade(self.made.scenario.imu), filter
        self.at = epochs(self.made.truth, KEPT)
        self.shared = self.spec.shared(self.made.felt(self.spec))
        self.streams = [Stream.of(1).numbered(run) for run in range(LANES)]
        self.records = [self.made.run(self.spec, stream) for stream in self.streams]
        self.steps = len(self.made.ideal.t) * LANES

    def asked(self, run=0):
        return Asked({}, self.spec, self.records[run][1], every=KEPT, covariance=True)

    def side(self):
        """(simulation, filter) of the runs in lanes, before their first sample."""
        simulated = lanes.Simulated(self.made, self.spec, self.shared, self.streams, self.at)
        recordings = [recording for recording, _ in self.records]
        side = SideBySide(
            begin(recordings[0], self.filter, self.asked()),
            [start for _, start in self.records],
            recordings,
            lane_scoring.keep_errors_in_lanes,
            lane_scoring.known(self.at),
            simulated.biases,
            lane_scoring.SCRATCH,
            lane_scoring.NUMBERS,
        )
        return simulated, side

    def in_lanes(self):
        """Processor seconds of (noise, filter with its score) of the eight runs."""
        simulated, side = self.side()
        advance, filter_took = side.calls(simulated.increments), 0.0
        begin_at = time.thread_time()
        for first, stop in simulated.blocks():
            before = time.thread_time()
            advance(first, stop)
            filter_took += time.thread_time() - before
        return time.thread_time() - begin_at - filter_took, filter_took

    def alone(self):
        """Processor seconds of the one loop over one of the runs, rows and covariances kept."""
        run = begin(self.records[0][0], self.filter, self.asked())
        run.cursor.at[1] = len(run.samples.t)
        go = loop.run.bound(
            *run.kernels, run.belief, run.samples, run.fixes, run.noise, run.cursor, run.out
        )
        before = time.thread_time()
        go()
        return time.thread_time() - before


def measured(every):
    """(us per run-step in lanes: noise, filter; of the one loop; median of the ratio), in turns."""
    flight, found = Flight(every), []
    flight.in_lanes(), flight.alone()
    for _ in range(TIMES):
        noise, filter_took = flight.in_lanes()
        alone = flight.alone() * LANES
        found.append((noise, filter_took, alone, (noise + filter_took) / alone))
    noise, filter_took, alone, ratio = (median(each) for each in zip(*found))
    return *(each / flight.steps * 1e6 for each in (noise, filter_took, alone)), ratio


def figures():
    """(ratio, what it is made of) with a fix at each 20th step and at each step."""
    for every in (20, 1):
        noise, filter_took, alone, ratio = measured(every)
        yield (
            ratio,
            f"{noise + filter_took:.3f} us per run-step, of it noise {noise:.3f}; one loop {alone:.3f}",
        )


def by_runs(counts=(10, 100, 1000, 10_000)):
    """[(runs, wall us per filter step)] of studies of a minute at 20 Hz with a fix at each sample."""
    found = []
    flight = sd.scenario("paper1-01").replace(name="a minute", duration=60.0)
    for runs in counts:
        study = sd.Study(flight, ("closed-loop",), ("paper1-tactical",), runs, seed=1)
        study.run()
        before = time.perf_counter()
        study.run()
        found.append((runs, (time.perf_counter() - before) / study.steps() * 1e6))
    return found


if __name__ == "__main__":
    for every in (20, 1):
        noise, filter_took, alone, ratio = measured(every)
        print(
            f"a fix each {every} steps: noise {noise:.3f}, filter {filter_took:.3f}, "
            f"one loop {alone:.3f} us per run-step; ratio {ratio:.3f}"
        )
    for runs, took in by_runs():
        print(f"{runs:>6} runs of a minute: {took:.3f} us of wall time per filter step")
