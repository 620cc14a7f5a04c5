"""`python benchmarks/bench.py [--quick] [--full]`: the library against the yardstick and its peers,
every figure as one line and in build/bench.json.

Times are measured alternating in one process and compared as ratios: absolute times on shared machines say little.
--quick leaves out the day, the processes and the peers; --full also scores the slow peers on the whole 30 minutes (minutes of work).
"""

import argparse
import os
import platform
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "src")]
# threads over 15 x 15 matrices only slow the peers down
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import airborne  # noqa: E402
import attitude  # noqa: E402
import exogenous  # noqa: E402
import figures  # noqa: E402
import lanes  # noqa: E402
import library  # noqa: E402
import logs  # noqa: E402
import navigation  # noqa: E402
import numpy as np  # noqa: E402
import peers  # noqa: E402
import processes  # noqa: E402
import report_pages  # noqa: E402
import smoothing  # noqa: E402
import studies  # noqa: E402
import subject  # noqa: E402
import workload  # noqa: E402
import yardstick  # noqa: E402

import strapdown as sd  # noqa: E402
from strapdown.sim.scenario import scenario  # noqa: E402
from strapdown.sim.synthesis import Simulator  # noqa: E402
from strapdown_reproductions.consistency import main as consistency  # noqa: E402
from strapdown_reproductions.consistency.summary import TARGETS as CONSISTENCY_TARGETS  # noqa: E402
from strapdown_reproductions.faults import main as faults  # noqa: E402
from strapdown_reproductions.faults.summary import TARGETS as FAULT_TARGETS  # noqa: E402
from strapdown_reproductions.installation import main as installation  # noqa: E402
from strapdown_reproductions.installation.summary import (  # noqa: E402
    TARGETS as INSTALLATION_TARGETS,
)
from strapdown_reproductions.noise import main as noise  # noqa: E402
from strapdown_reproductions.noise.summary import TARGETS as NOISE_TARGETS  # noqa: E402
from strapdown_reproductions.recordings import main as recordings  # noqa: E402
from strapdown_reproductions.vehicle_kit import on_drive  # noqa: E402
from strapdown_reproductions.wrong_setups import main as wrong_setups  # noqa: E402
from strapdown_reproductions.wrong_setups.summary import TARGETS as SETUP_TARGETS  # noqa: E402

OUT = HERE.parent / "build" / "bench.json"
FIVE_STATES = {"clock": None, "lever-arm": None, "mounting": (0.0, 0.03, 0.0)}
WITH_SCALE = {"clock": None, "lever-arm": None, "gyro-scale": (0.0, 0.0, 0.01)}
"""Parameters of the installation that become states: {name: prior standard deviations}."""
ERRORS = (("position", "m"), ("velocity", "m/s"), ("attitude", "deg"))


class Book:
    """The figures so far; each is printed when it is known."""

    def __init__(self):
        self.tables, self.figures = figures.targets(), []

    def add(self, figure):
        self.figures.append(figure)
        print(figure, flush=True)

    def target(self, name, value, note=""):
        self.add(figures.against_target(name, value, self.tables, note))

    def measure(self, names, function):
        """Add `names` with what `function` gives for them, (value, note) each; one that fails is
        a missed figure and says why."""
        try:
            found = function()
        except Exception as error:  # a broken part must not hide the other figures
            found = [(None, f"{type(error).__name__}: {error}".splitlines()[0])] * len(names)
        for name, (value, note) in zip(names, found):
            self.target(name, value, note)

    def skip(self, names):
        for name in names:
            self.add(
                figures.against_target(name, None, self.tables, "left out by --quick")._replace(
                    holds=None
                )
            )


def seconds_of(function):
    """Seconds that one call takes."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def alternating(first, second, times):
    """Medians of (first, second, second / first) of two functions that return seconds, called in
    turns after one call each."""
    first(), second()
    pairs = np.array([(first(), second()) for _ in range(times)])
    return (*np.median(pairs, axis=0), float(np.median(pairs[:, 1] / pairs[:, 0])))


def yardstick_figures(book, name):
    """Accuracy of the yardstick itself: it must reproduce the targets that it set."""
    w = workload.load(name)
    inputs, outputs = yardstick.arguments(w)
    yardstick.run(*inputs, *outputs)
    rms = workload.score(w, w.t[1:], *outputs[:3])
    for value, (what, unit) in zip(rms, ERRORS):
        book.add(figures.informative(f"{name} yardstick {what}", value, unit))


def accuracy_figures(book):
    for name in "AB":
        yardstick_figures(book, name)
        book.measure(
            [f"{name} accuracy {what}" for what, _ in ERRORS],
            lambda: [(value, "") for value in subject.accuracy(workload.load(name), "closed-loop")],
        )
    for loop in ("open", "closed"):
        book.measure(
            [f"N {loop} loop position"],
            lambda: [(subject.accuracy(workload.load("N"), f"{loop}-loop").position, "")],
        )


def ratio(name, times, filter="closed-loop", **options):
    """[(time of a filter over the yardstick's, note)] on a workload."""
    w = workload.load(name)
    inputs, outputs = yardstick.arguments(w)
    theirs, own, value = alternating(
        lambda: seconds_of(lambda: yardstick.run(*inputs, *outputs)),
        subject.timed_run(w, filter, **options),
        times,
    )
    samples = len(w.t) - 1
    return [
        (value, f"{own / samples * 1e6:.3f} against {theirs / samples * 1e6:.3f} us per IMU sample")
    ]


def more_states(times, estimate=FIVE_STATES):
    """[(time of the closed loop with these states more over that without, note)] on A. A clock keeps
    the motion of the last seconds too, and a scale of the IMU acts on each prediction."""
    w = workload.load("A")
    plain, own, value = alternating(
        subject.timed_run(w, "closed-loop"),
        subject.timed_run(w, "closed-loop", estimate=estimate),
        times,
    )
    samples = len(w.t) - 1
    return [
        (value, f"{own / samples * 1e6:.3f} against {plain / samples * 1e6:.3f} us per IMU sample")
    ]


def speed_figures(book, times):
    book.measure(["A closed loop time"], lambda: ratio("A", times))
    book.measure(["B closed loop time"], lambda: ratio("B", 2 * times))
    book.measure(["five more states"], lambda: more_states(times))
    ((value, _),) = more_states(times, WITH_SCALE)
    book.add(figures.informative("five more states, one of the IMU", value, "x 15 states"))
    book.measure(
        ["stream step, IMU sample", "stream step, fix"],
        lambda: [(us, "") for us in subject.stream_times(workload.load("A").first(300))],
    )


def process_figures(book):
    book.measure(["day at 100 Hz, time", "day at 100 Hz, memory"], lambda: day(book))
    book.measure(
        ["first compilation", "first solution, warm cache"],
        lambda: [
            (seconds, "whole process")
            for seconds in processes.first_solution(
                subject.write_log(workload.load("A").first(600))
            )
        ],
    )
    book.measure(["strapdown --help"], lambda: [(processes.help_seconds(), "whole process")])


def day(book):
    took, above, interpreter, position = processes.day(workload.stored_period())
    book.add(figures.informative("day at 100 Hz, position", position, "m", "rms of the last hour"))
    return [
        (took, ""),
        (
            above,
            f"all that comes after building them with numpy; python and numpy take {interpreter:.0f} MB more",
        ),
    ]


def library_figures(book):
    """Of the library of kernels: its wheel, its kernels beside the compiler's, exports as C."""
    with tempfile.TemporaryDirectory() as place:
        folder, dist = Path(place, "library"), Path(place, "dist")
        try:
            took, levels = library.built(folder)
        except RuntimeError as error:  # nothing of it can be measured then
            book.add(figures.informative("library, build", None, "s", str(error)))
        else:
            book.add(figures.informative("library, build", took, "s", f"{os.cpu_count()} cores"))
            for level, size in levels.items():
                book.add(figures.informative(f"library, {level}", size / 1e3, "kB"))
        log = subject.write_log(workload.load("A").first(600))
        book.measure(library.WHEEL, lambda: library.used(library.wheel(folder, dist), log))
        for name, filter in zip(library.RATIOS, library.FILTERS):
            book.measure([name], lambda: [library.ratio(alternating, filter, folder, 15)])
        book.measure(library.STREAM, lambda: library.stream_step(folder))
    book.measure(library.EXPORTED, lambda: exports(book))


def exports(book):
    """[(kB, note)] for `library.EXPORTED`; what has no target is added."""
    sizes = library.sizes()
    for target in library.TARGETS[1:]:
        size, note = sizes[target]
        book.add(figures.informative(f"export, four sources on {target}", size / 1e3, "kB", note))
    in_c, in_python = library.in_c(), library.in_python()
    note = f"a step of a stream {in_python / in_c:.1f} x as long"
    book.add(figures.informative("export, a sample in C", in_c, "us", note))
    size, note = sizes[library.TARGETS[0]]
    return [(size / 1e3, note)]


def study_figures(book):
    """Of the first paper's study and of studies as such."""
    book.measure(
        ["study, open loop alone"],
        lambda: ratio("B", 15, "open-loop", every=studies.EVERY, kinematics="geodetic"),
    )
    book.measure(
        ["study, closed loop alone"], lambda: ratio("B", 15, studies.CLOSED, every=studies.EVERY)
    )
    book.measure(lanes.FIGURES, lambda: list(lanes.figures()))
    book.measure(["study, two threads"], two_threads)
    book.measure(
        ["study, memory of 10 000 runs", "study, memory of 10 000 runs over that of 1000"],
        many_runs,
    )
    book.measure(
        ["study, quick form"], lambda: [(studies.paper("--quick")[0], "the whole command")]
    )
    book.measure(["study, wall time per filter step", "study, Cramer-Rao ratio"], whole_study)


def two_threads():
    ours, processes_alone = studies.threads()
    if processes_alone < 1.8:
        return [
            (
                None,
                f"not measurable: two independent processes reach {processes_alone:.2f} x one; threads {ours:.2f} x",
            )
        ]
    return [(ours, f"two independent processes {processes_alone:.2f} x one")]


def many_runs():
    few, many = studies.peak(1000), studies.peak(10_000)
    return [(many, f"{few:.0f} MB for 1000 runs of a minute"), (many / few, "")]


def whole_study():
    took, steps, ratio = studies.paper()
    return [
        (took / steps * 1e6, f"{steps / 1e6:.4g} million filter steps in {took:.0f} s"),
        (ratio, "the flight furthest from 1, 50 runs"),
    ]


RECORDED = [
    "thor75 roll",
    "thor75 pitch",
    "thor75 heading",
    "thor75 position N",
    "thor75 position E",
    "thor75 position D",
    "drive0708 outages, GNSS alone",
    "drive0708 outages, vehicle constraints",
    "thor75 magnetometer residual",
    "thor75 magnetic heading",
]
"""The first claims of `strapdown reproduce recordings`, in its order."""


def attitude_figures(book):
    """Of the attitude estimators: on the BROAD trials, in time beside vqf, in consistency and
    from far-off starts."""
    book.measure(attitude.ACCURACY, attitude.accuracy)
    book.measure(list(attitude.TIMES), attitude.times)
    book.measure(attitude.SIMULATED, attitude.simulated)
    for figure in attitude.peer_figures():
        book.add(figure)


def navigation_figures(book):
    """Of the navigation filters: in time beside the closed loop, in consistency; and of
    smoothing."""
    book.measure(list(navigation.TIMES), lambda: navigation.times(alternating, 15))
    book.measure(navigation.CONSISTENT, navigation.consistency)
    book.measure(smoothing.FIGURES, smoothing.smoothing)


def exogenous_figures(book):
    """Of the observer, the exogenous Kalman filter and the comparison of outages."""
    book.measure(exogenous.TIMES, lambda: exogenous.times(alternating, 15))
    book.measure(exogenous.STARTS, exogenous.starts)
    book.measure(exogenous.DRIFTS, exogenous.drifts)
    book.measure(exogenous.COMPARED, exogenous.compared)


def airborne_figures(book):
    """Of the sigma-point and particle filters and of the aircraft in the loop."""
    book.measure(airborne.UKF, lambda: airborne.ukf(alternating, 5))
    book.measure(airborne.PKF, lambda: airborne.pkf(alternating, 5))
    book.measure(airborne.AIRCRAFT, lambda: airborne.aircraft(15))
    book.measure(airborne.FLOWN, lambda: airborne.flown(3))
    book.measure(airborne.STUDY, airborne.study)


def file_figures(book):
    """Of files read and written: tables, and an hour of each format."""
    book.measure(logs.TABLES, logs.tables)
    book.measure(logs.HOURS_READ, logs.slowest)


def page_figures(book):
    book.measure(list(report_pages.FIGURES), report_pages.pages)


def recorded_figures(book):
    def measured():
        with tempfile.TemporaryDirectory() as folder:
            return [
                (claim["value"], "strapdown reproduce recordings")
                for claim in recordings.reproduce(Path(folder))
            ]

    book.measure(RECORDED, measured)


SETUPS = {
    "wrong set-ups, found": "found",
    "wrong set-ups, named": "named",
    "right set-ups, doubted": "alarms",
    "verdict, time over filter": "cost",
    "diagnose, filter runs": "runs",
}
"""{figure: name of its target in `strapdown reproduce wrong-setups`}."""
SETUP_SEEDS = 2
"""Of its 20."""


def setup_figures(book):
    """Of the mistakes of set-ups that inspect and the verdict find."""
    claimed(
        book,
        SETUPS,
        SETUP_TARGETS,
        lambda out: wrong_setups.reproduce(out, runs=SETUP_SEEDS),
        f"strapdown reproduce wrong-setups --runs {SETUP_SEEDS}",
    )


FAULTS = {
    "faults, silently wrong": "silent",
    "faults, jumps of 50 m refused": "50 m",
    "faults, jumps of 20 m refused": "20 m",
    "faults, jumps of 10 m refused": "10 m",
    "faults, lasting jump of 5 m said": "lasting",
    "faults, right flights doubted": "alarms",
}
"""{figure: name of its target in `strapdown reproduce faults`}."""
FAULT_FILTERS = ("closed-loop", "closed-loop live", "closed-loop smoothed")


def fault_figures(book):
    """Of the faults of sensors that the closed loop is silent about, one seed."""
    claimed(
        book,
        FAULTS,
        FAULT_TARGETS,
        lambda out: faults.reproduce(out, runs=1, names=FAULT_FILTERS),
        f"strapdown reproduce faults, {FAULT_FILTERS[0]} alone, one seed",
    )


CONSISTENCY = {
    "consistency, epochs in the band": "inside",
    "consistency, survival": "survived",
    "consistency, cells refused": "refused",
}
"""{figure: name of its target in `strapdown reproduce consistency`}."""
CONSISTENT_FILTERS = ("closed-loop",)


def consistency_figures(book):
    """Of the closed loop at every grade in every scenario, 60 runs."""
    claimed(
        book,
        CONSISTENCY,
        CONSISTENCY_TARGETS,
        lambda out: consistency.reproduce(out, filter=CONSISTENT_FILTERS),
        f"strapdown reproduce consistency --filter {CONSISTENT_FILTERS[0]}",
    )


INSTALLATION = {
    "drive0708 from wrong set-ups, clock": "drive clock",
    "drive0708 from wrong set-ups, arm": "drive lever-arm",
    "drive0708 from wrong set-ups, mounting": "drive mounting",
    "drive0708 calibrated, alone": "drive alone",
    "drive0708 calibrated, constrained": "drive constrained",
    "installation, NEES from a known start": "nees, known start",
    "installation, NEES from own alignment": "nees, own alignment",
    "installation, found though not shown": "unseen",
    "odometer scale after five minutes": "scale",
    "thor75 roll, installation found": "thor75 roll",
    "thor75 D, installation found": "thor75 position D",
    "drive0708 alone, installation found": "drive0708 alone",
}
"""{figure: name of its target in `strapdown reproduce installation`}. Intervals need its 100
seeds."""
INSTALLATION_SEEDS = 10


def installation_figures(book):
    """Of clocks, lever arms, mounting and scale as states."""
    claimed(
        book,
        INSTALLATION,
        INSTALLATION_TARGETS,
        lambda out: installation.reproduce(out, runs=INSTALLATION_SEEDS),
        f"strapdown reproduce installation --runs {INSTALLATION_SEEDS}",
    )


CAR = 600.0
"""s at 100 Hz."""


def calibration_figures(book):
    """The drive with the vehicle kit, and what it costs to calibrate the installation of a log."""
    kit = "drive0708, vehicle kit with clock and arm as states"

    def drive():
        folder = Path(__file__).resolve().parents[1] / "examples" / "recordings"
        _, table = on_drive.outage_errors(folder)
        row = (table["windows"] == "README") & table["set-up"].str.contains("states too")
        return [(float(table.loc[row, "median, m"].iloc[0]), "strapdown reproduce vehicle-kit")]

    def log():
        car = scenario("car").replace(duration=CAR, imu="industrial")
        recording = Simulator(car).recording("industrial", np.random.default_rng(1))
        sd.calibrate_installation(recording)  # compiles
        before = time.perf_counter()
        sd.calibrate_installation(recording)
        return [(time.perf_counter() - before, f"{CAR / 60:.0f} min, 100 Hz")]

    book.measure([kit], drive)
    book.measure(["calibrate installation, 10 minutes at 100 Hz"], log)


NOISE = {
    "correlated errors as states, lowest": "correlated low, states",
    "correlated errors as states, highest": "correlated high, states",
    "correlated errors tuned, lowest": "correlated low, tuned",
    "correlated errors tuned, highest": "correlated high, tuned",
    "white errors tuned": "white, tuned",
    "noise stated wrongly, tuned": "misstated rms",
    "noise stated wrongly, NIS lowest": "misstated NIS low",
    "noise stated wrongly, NIS highest": "misstated NIS high",
    "robust, a tenth of the fixes wrong": "robust outliers",
    "robust, clean fixes": "robust clean",
    "adaptive, clean fixes": "adaptive clean",
    "hidden fixes within 1 sd, tuned": "coverage 1",
    "hidden fixes within 3 sd, tuned": "coverage 3",
}
"""{figure: name of its target in `strapdown reproduce noise`}."""
NOISE_SEEDS = 2
TUNE_FIGURE = "tune, 10 minutes at 100 Hz"


def noise_figures(book):
    """Of correlated errors, tune, robust and adaptive sources."""
    claimed(
        book,
        NOISE,
        NOISE_TARGETS,
        lambda out: noise.reproduce(out, runs=NOISE_SEEDS),
        f"strapdown reproduce noise --runs {NOISE_SEEDS}",
    )

    def log():
        car = scenario("car").replace(duration=CAR, imu="industrial")
        recording = Simulator(car).recording("industrial", np.random.default_rng(1))
        sd.tune(recording.between(0, 60))  # compiles
        before = time.perf_counter()
        found = sd.tune(recording)
        return [(time.perf_counter() - before, f"{found.runs} runs of the filter")]

    book.measure([TUNE_FIGURE], log)


def claimed(book, figures, targets, reproduce, note):
    """The values of a reproduction's claims; figures: {figure: name of its target}."""

    def measured():
        with tempfile.TemporaryDirectory() as folder:
            values = {claim["claim"]: claim["value"] for claim in reproduce(Path(folder))}
        return [(values[targets[name].text], note) for name in figures.values()]

    book.measure(list(figures), measured)


def peer_figures(book, full):
    """Times of the peers over strapdown's on the same workload, strapdown run before and after
    each."""
    versions = peers.versions()
    for title, function, package, pieces in peers.RUNS:
        for name, enough in pieces.items():
            if versions[package] is None:
                book.add(
                    figures.informative(
                        f"{name} {title} time", None, "x strapdown", f"{package} is not installed"
                    )
                )
                continue
            try:
                book.add(
                    peer_figure(
                        name, title, function, 1800.0 if full else enough, versions[package]
                    )
                )
            except Exception as error:  # a peer that fails is worth a line, not the end
                book.add(
                    figures.informative(
                        f"{name} {title} time",
                        None,
                        "x strapdown",
                        f"{package} {versions[package]}: {error}".splitlines()[0],
                    )
                )


def peer_figure(name, title, function, seconds, release):
    w = workload.load(name)
    ours = subject.timed_run(w, "open-loop" if "feedforward" in title else "closed-loop")
    ours()
    before = ours()
    us, rms, _ = function(w, seconds)
    own = (before + ours()) / 2 / (len(w.t) - 1) * 1e6
    note = f"{release}: {us:.1f} us per IMU sample over {seconds:g} s" + (f"; {rms}" if rms else "")
    return figures.informative(f"{name} {title} time", us / own, "x strapdown", note)


def machine():
    """What was measured on and with."""
    packages = {name: version(name) for name in ("numpy", "scipy", "numba")}
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        **packages,
        **peers.versions(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="accuracy, ratios and stream only")
    parser.add_argument(
        "--full", action="store_true", help="score the slow peers on the whole workloads, too"
    )
    options = parser.parse_args()
    print(", ".join(f"{key} {value}" for key, value in machine().items()))
    book = Book()
    accuracy_figures(book)
    speed_figures(book, 5 if options.quick else 15)
    if options.quick:
        book.skip(
            [name for name in book.tables if name not in {figure.name for figure in book.figures}]
        )
    else:
        process_figures(book)
        library_figures(book)
        study_figures(book)
        file_figures(book)
        page_figures(book)
        recorded_figures(book)
        setup_figures(book)
        fault_figures(book)
        consistency_figures(book)
        installation_figures(book)
        calibration_figures(book)
        noise_figures(book)
        attitude_figures(book)
        navigation_figures(book)
        exogenous_figures(book)
        airborne_figures(book)
        peer_figures(book, options.full)
    figures.write(OUT, book.figures, machine())
    judged = [figure.holds for figure in book.figures if figure.target is not None]
    print(
        f"{judged.count(True)} figures hold, {judged.count(False)} missed, {judged.count(None)} left out; {OUT}"
    )


if __name__ == "__main__":
    main()
