"""Runs side by side: the closed loop on lanes with its noise beside the scalar loop, and what bounds it.

`python benchmarks/lanes.py` prints the table of docs/explanation/lanes.md: parts of a run-step, cost by number of
runs, and the distance to what the processor can do.
"""

import time
from statistics import median

import numpy as np

import strapdown as sd
from strapdown.aiding import find
from strapdown.core.compile.c_calls import aligned_zeros
from strapdown.core.compile.jit import kernel
from strapdown.core.compile.signatures import LANES, WHOLE, in_lanes, reals, signature
from strapdown.core.loop import loop
from strapdown.engine.batch import begin
from strapdown.engine.options import run_options
from strapdown.engine.run_batch import Keeper, RunBatch
from strapdown.experiments.monte_carlo import batch_scoring, run_batch
from strapdown.experiments.monte_carlo.scoring import epochs
from strapdown.sensor_models.gnss import Gnss
from strapdown.sensor_models.imu import imu as imu_spec
from strapdown.sensor_models.streams import RandomStream
from strapdown.sim.synthesis import Simulator

SECONDS, RATE, KEPT = 60.0, 100.0, 20
"""Of a flight, Hz, and IMU samples from one row that is kept to the next, as in the first paper's
study."""
TIMES = 15
FIGURES = ["lanes, a fix each 20th step", "lanes, a fix each step"]


class Flight:
    """Eight runs of a minute with a position and a velocity fix every so many steps."""

    def __init__(self, every, filter="closed-loop"):
        gnss = Gnss(interval=every / RATE, position_std=(1.0,) * 3, velocity_std=(0.05,) * 3)
        demo = sd.scenario("demo")
        self.made = Simulator(demo.replace(duration=SECONDS, rate=RATE, gnss=gnss))
        self.spec, self.filter = imu_spec(self.made.scenario.imu), filter
        self.at = epochs(self.made.truth, KEPT)
        self.shared = self.spec.shared_errors(self.made.ideal_samples(self.spec))
        self.streams = [RandomStream.of(1).numbered_child(run) for run in range(LANES)]
        self.records = [self.made.run(self.spec, stream) for stream in self.streams]
        self.steps = len(self.made.ideal.t) * LANES

    def asked_for(self):
        """Arguments of `begin` for the first of the runs."""
        return self.records[0][0], self.filter, self.asked()

    def asked(self, run=0):
        return run_options(imu=self.spec, start=self.records[run][1], every=KEPT, covariance=True)

    def side(self):
        """(simulation, filter) of the runs in lanes, before their first sample."""
        simulated = run_batch.SimulatedSamples(
            self.made, self.spec, self.shared, self.streams, self.at
        )
        recordings = [recording for recording, _ in self.records]
        side = RunBatch(
            begin(*self.asked_for()),
            [start for _, start in self.records],
            recordings,
            Keeper(
                batch_scoring.keep_errors_in_lanes,
                batch_scoring.truth_array(self.at),
                simulated.biases,
                batch_scoring.SCRATCH,
                batch_scoring.NUMBERS,
            ),
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
        run = begin(*self.asked_for())
        run.cursor.state[0].stop = len(run.samples.t)
        go = loop.run.bind(
            run.kernels, run.belief, run.samples, run.fixes, run.noise, run.cursor, run.out
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


def by_runs(counts=(10, 100, 1000, 10_000, 100_000)):
    """[(runs, wall us per filter step, MB of results)] of studies of a minute at 20 Hz with a fix at
    each sample, of the closed loop, with all that a study does."""
    flight, found = sd.scenario("paper1-01").replace(name="a minute", duration=60.0), []
    for runs in counts:
        study = sd.Study(flight, ("closed-loop",), ("paper1-tactical",), runs, seed=1)
        study.run()
        before = time.perf_counter()
        campaign = study.run()
        took = time.perf_counter() - before
        stored = sum(file.stat().st_size for file in campaign.folder.rglob("*.nc"))
        found.append((runs, took / study.steps() * 1e6, stored / 1e6))
    return found


SUMS = 12
"""Sums that do not wait for each other, so that the processor always has one to do."""
PEAK = signature("peak", count=WHOLE, x=reals(2 * SUMS))


@kernel(PEAK)
def multiply_and_add(count, x):
    """x[i] <- 0.999 x[i] + 0.001, as many times."""
    a, b, c, d, e, f = x[0], x[1], x[2], x[3], x[4], x[5]
    g, h, i, j, k, m = x[6], x[7], x[8], x[9], x[10], x[11]
    for _ in range(count):
        a, b, c = 0.999 * a + 0.001, 0.999 * b + 0.001, 0.999 * c + 0.001
        d, e, f = 0.999 * d + 0.001, 0.999 * e + 0.001, 0.999 * f + 0.001
        g, h, i = 0.999 * g + 0.001, 0.999 * h + 0.001, 0.999 * i + 0.001
        j, k, m = 0.999 * j + 0.001, 0.999 * k + 0.001, 0.999 * m + 0.001
    x[0], x[1], x[2], x[3], x[4], x[5] = a, b, c, d, e, f
    x[6], x[7], x[8], x[9], x[10], x[11] = g, h, i, j, k, m


def peak():
    """Multiplications and additions a microsecond that a core does at most, in lanes, each rounded."""
    x, count = aligned_zeros(2 * SUMS, LANES), 20_000
    go = multiply_and_add.for_runs(in_lanes(PEAK)).bind(count, x)
    best = min(_timed(go) for _ in range(50))
    return 2 * SUMS * LANES * count / best / 1e6


def _timed(function):
    before = time.perf_counter()
    function()
    return time.perf_counter() - before


class Counted:
    """A number that counts what is done with it."""

    done = 0

    def __init__(self, value):
        self.value = float(value)

    def __float__(self):
        return self.value

    def __int__(self):
        return int(self.value)

    def __floor__(self):
        return Counted(np.floor(self.value))

    floor = __floor__  # as numpy asks for it


def _counting(name):
    def operation(self, *others):
        Counted.done += 1
        return Counted(getattr(self.value, name)(*map(float, others)))

    return operation


def _comparing(name):
    return lambda self, other: getattr(self.value, name)(float(other))


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "neg", "abs"):
    setattr(Counted, f"__{_name}__", _counting(f"__{_name}__"))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Counted, f"__{_name}__", _comparing(f"__{_name}__"))


def operations(every):
    """Sums, products and quotients of a run-step of the closed loop alone, counted in plain Python."""
    run = begin(*Flight(20).asked_for())

    def counted(array):
        return np.array([Counted(x) for x in array.ravel()], object).reshape(array.shape)

    belief = type(run.belief)(*map(counted, run.belief))
    u = counted(np.r_[run.samples.dtheta[0], run.samples.dv[0]])
    filter, counts = run.filter, []
    noise, dt = run.noise, run.samples.dt[0]
    for source in (None, 0, 1):
        Counted.done = 0
        if source is None:
            filter.predict.py_func(belief, u, dt, noise)
        else:
            k = int(np.flatnonzero(run.fixes.source == source)[0])
            kind = run.fixes.sources[source].kind
            observe = find(("position", "velocity")[source]).observe.py_func
            given = run.fixes.sources[source], np.inf, counted(np.zeros(12))
            y = counted(run.fixes.y[k])
            filter.correct.py_func(belief, y, run.fixes.std[k], kind, observe, *given)
        counts.append(Counted.done)
    return counts[0] + (counts[1] + counts[2]) / every


if __name__ == "__main__":
    print(
        "| a fix | noise | filter with its score | together | the one loop | ratio | "
        "operations of the filter | of what the core does at most |"
    )
    print("|---|---|---|---|---|---|---|---|")
    most = peak()
    for every in (20, 1):
        (noise, filter_took, alone, ratio), count = measured(every), operations(every)
        print(
            f"| each {f'{every}th ' if every > 1 else ''}step | {noise:.3f} | {filter_took:.3f} | "
            f"{noise + filter_took:.3f} | {alone:.3f} | {ratio:.2f} | {count:.0f} | "
            f"{count / filter_took / most:.0%} |"
        )
    print(f"\nAt most: {most:.0f} operations a microsecond.\n")
    print("| runs of a minute | us of wall time per filter step | MB of results |")
    print("|---|---|---|")
    for runs, took, stored in by_runs():
        print(f"| {runs} | {took:.2f} | {stored:.1f} |")
