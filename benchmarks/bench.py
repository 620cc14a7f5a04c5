"""`python benchmarks/bench.py`: the library against the yardstick and its peers, every figure as one
line and in result.json beside this file, which is committed and from which docs/reference/figures.md
is made.

Times are measured alternating in one process and compared as ratios: absolute times on shared machines say little.
Names of parts run those alone and write nothing; --pages renews the figures that are read from pages; --full also scores the slow peers on the whole 30 minutes (minutes of work).
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "src"), str(HERE.parent / "tests")]
# threads over 15 x 15 matrices only slow the peers down
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import airborne  # noqa: E402
import attitude  # noqa: E402
import exogenous  # noqa: E402
import figures  # noqa: E402
import house  # noqa: E402
import lanes  # noqa: E402
import library  # noqa: E402
import live_latency  # noqa: E402
import logs  # noqa: E402
import navigation  # noqa: E402
import numpy as np  # noqa: E402
import outages  # noqa: E402
import peers  # noqa: E402
import processes  # noqa: E402
import report_pages  # noqa: E402
import reproduced  # noqa: E402
import sensors  # noqa: E402
import smoothing  # noqa: E402
import studies  # noqa: E402
import subject  # noqa: E402
import workload  # noqa: E402
import yardstick  # noqa: E402

import strapdown as sd  # noqa: E402
from strapdown.io.locate import VARIABLE  # noqa: E402
from strapdown.sim.scenario import scenario  # noqa: E402
from strapdown.sim.synthesis import Simulator  # noqa: E402
from strapdown_reproductions.recordings import main as recordings  # noqa: E402

RESULT = figures.RESULT
ROOT = HERE.parent
FIVE_STATES = {"clock": None, "lever-arm": None, "mounting": (0.0, 0.03, 0.0)}
WITH_SCALE = {"clock": None, "lever-arm": None, "gyro-scale": (0.0, 0.0, 0.01)}
"""Parameters of the installation that become states: {name: prior standard deviations}."""
FIRST = [
    "first compilation",
    "first compilation, processor",
    "further filter",
    "first solution, warm cache",
]
ERRORS = (("position", "m"), ("velocity", "m/s"), ("attitude", "deg"))


class Book:
    """The figures so far; each is printed when it is known. `parts` has a line for each part that
    ran, `broken` {name of a part: why it ended early}."""

    def __init__(self):
        self.tables, self.figures = figures.targets(), []
        self.parts, self.broken = [], {}

    def run(self, name, title, function):
        """Run one part; one that fails must not hide the others."""
        before, (begin, busy) = len(self.figures), (time.perf_counter(), processor_seconds())
        try:
            function(self)
        except Exception as error:
            self.broken[name] = first_line(error)
        own = [figure._replace(part=name) for figure in self.figures[before:]]
        self.figures[before:] = own
        took, used = time.perf_counter() - begin, processor_seconds() - busy
        self.parts.append(
            {"name": name, "title": title, "seconds": round(took), "processor_s": round(used)}
        )

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
            found = [(None, first_line(error))] * len(names)
        for name, (value, note) in zip(names, found):
            self.target(name, value, note)

    def missing(self):
        """Add the targets that no part measured."""
        known = {figure.name for figure in self.figures}
        why = "; ".join(f"{part}: {reason}" for part, reason in self.broken.items())
        for name in self.tables:
            if name not in known:
                self.target(name, None, why or "no part measures it")


def first_line(error):
    """Of an error, with its kind, without the path of this checkout."""
    text = f"{type(error).__name__}: {error}".splitlines()[0]
    if VARIABLE in text:
        return f"no data folder; set {VARIABLE}"
    return text.replace(f"{HERE.parent}{os.sep}", "")


def processor_seconds():
    """Of this process and of those that it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


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


def speed_figures(book, times=15):
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
    book.measure(FIRST, first_solutions)
    book.measure(["make demo"], lambda: [(processes.demo(), "a new clone, nothing compiled")])
    book.measure(["strapdown --help"], lambda: [(processes.help_seconds(), "whole process")])


def first_solutions():
    """[(seconds, note)] for `FIRST`."""
    log = subject.write_log(workload.load("A").first(600))
    wall, busy, further, warm = processes.first_solution(log)
    after = f"{processes.FURTHER} after the closed loop"
    return [(wall, "whole process"), (busy, ""), (further, after), (warm, "whole process")]


def house_figures(book):
    """Of the code: the longest function of the core, and integers for places."""
    found = house.modules(house.PACKAGE, house.REPRODUCTIONS)
    count, name = house.longest(found, "strapdown.core")
    book.measure(["core, longest function"], lambda: [(count, name)])
    book.measure(["places imported as integers"], lambda: [(len(house.places(found)), "")])


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
            note = f"{os.cpu_count()} cores; kernels that did not change come from the cache"
            book.add(figures.informative("library, build", took, "s", note))
            for level, size in levels.items():
                book.add(figures.informative(f"library, {level}", size / 1e3, "kB"))
        log = subject.write_log(workload.load("A").first(600))
        book.measure(library.WHEEL, lambda: library.used(library.wheel(folder, dist), log))
        book.measure(
            library.NEEDS,
            lambda: library.with_needs(library.wheel(folder, dist), Path(place, "new")),
        )
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
    if os.cpu_count() == 1:
        return [(None, "not measurable on one core")]
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


def sensor_figures(book):
    """Of sensors that need no calibration run."""
    book.measure(sensors.IRON, sensors.iron)


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
            claims, _, _ = recordings.score_recordings(recordings.DESCRIPTIONS, Path(folder))
        return [(claim["value"], "as strapdown reproduce recordings") for claim in claims]

    book.measure(RECORDED, measured)
    book.measure(outages.AIR_DATA, outages.air_data)


def study_pages(book):
    """Of studies that take hours, from the pages that they wrote."""
    for study in reproduced.STUDIES:
        own = [name for name in study.figures if name in book.tables]
        try:
            found = dict(zip(study.figures, reproduced.read(study)))
        except Exception as error:  # one page must not hide the others
            found = dict.fromkeys(own, (None, first_line(error)))
        for name, (value, note) in found.items():
            if name in book.tables:
                book.target(name, value, note)
            else:
                book.add(figures.informative(name, value, "", note))
    words_of_pages(book)


OPENED = "Open `result/report.html`"
"""What the tutorial says where a page is there: first of a device's log, then of own tables."""


def words_of_pages(book):
    """Words that a newcomer reads before the page of a log, and in README."""
    text = (ROOT / "docs/tutorials/your-log.md").read_text()
    words = lambda text: len(text.split())
    of_device, of_tables, _ = text.split(OPENED)
    to_page = words(of_device + of_tables)
    book.measure(["words in README"], lambda: [(words((ROOT / "README.md").read_text()), "")])
    book.measure(
        ["words before the page of a log"],
        lambda: [(to_page, f"{words(of_device)} where the log is read as it is")],
    )


CAR = 600.0
"""s at 100 Hz."""
TOOLS = (
    "calibrate installation, 10 minutes at 100 Hz",
    "tune, 10 minutes at 100 Hz",
)


def tool_figures(book):
    """Of the time of calibrating the installation of a log, of tuning its noise."""
    car = scenario("car").replace(duration=CAR, imu="industrial")
    recording = Simulator(car).recording("industrial", np.random.default_rng(1))
    note = f"{CAR / 60:.0f} min, 100 Hz"

    def calibrated():
        sd.calibrate_installation(recording)  # compiles
        return [(seconds_of(lambda: sd.calibrate_installation(recording)), note)]

    def tuned():
        sd.tune(recording.between(0, 180))  # compiles
        begin = time.perf_counter()
        found = sd.tune(recording)
        return [(time.perf_counter() - begin, f"{note}; {found.runs} runs of the filter")]

    for name, function in zip(TOOLS, (calibrated, tuned)):
        book.measure([name], function)


def live_figures(book):
    """Of a filter on live data: from a datagram to its state, and its first step."""
    book.measure(live_latency.FIGURES, live_latency.results)


def peer_figures(book, full=False):
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


PARTS = {
    "accuracy": ("Accuracy on the workloads", accuracy_figures),
    "speed": ("Time of the loop", speed_figures),
    "processes": ("A day, the first solution, the command line", process_figures),
    "house": ("The code", house_figures),
    "library": ("Library of kernels, export as C", library_figures),
    "studies": ("Studies of many runs", study_figures),
    "files": ("Logs and tables", file_figures),
    "pages": ("Pages of a solution", page_figures),
    "recorded": ("Recorded flight and drive", recorded_figures),
    "sensors": ("Sensors and their worth", sensor_figures),
    "tools": ("Calibration and tuning of a log", tool_figures),
    "live": ("Live data", live_figures),
    "attitude": ("Attitude alone", attitude_figures),
    "navigation": ("Other filters, smoothing", navigation_figures),
    "observers": ("Observers", exogenous_figures),
    "flight": ("Sigma points, particles, aircraft", airborne_figures),
    "peers": ("Peers", peer_figures),
    "evidence": ("Studies that take hours, and words, from their pages", study_pages),
}
"""{name of a part: (title, function of a Book)}, in order."""
PAGES = "evidence"
"""The part that measures nothing, but reads pages."""


def measured(names, full):
    """The Book of these parts, each with a line before it: which of how many, and the seconds so
    far."""
    book, begin = Book(), time.perf_counter()
    for number, name in enumerate(names, 1):
        title, function = PARTS[name]
        if name == "peers" and full:
            function = lambda book: peer_figures(book, full=True)
        so_far = time.perf_counter() - begin
        print(
            f"-- part {number} of {len(names)}, after {so_far:.0f} s: {name}: {title}", flush=True
        )
        book.run(name, title, function)
    return book


def summary(book):
    """Lines: how many figures hold; in one line why some are not measured; what parts broke."""
    judged = Counter(figure.holds for figure in book.figures if figure.target is not None)
    took = sum(part["seconds"] for part in book.parts)
    lines = [f"{judged[True]} figures hold, {judged[False]} missed, in {took} s"]
    if why := Counter(figure.note for figure in book.figures if figure.value is None):
        said = "; ".join(f"{note} ({count})" for note, count in why.items())
        lines.append(f"not measured: {said}")
    return lines + [f"part {name} ended early: {why}" for name, why in book.broken.items()]


def judged_again(figure, tables):
    """A figure as it was measured, against its target of today."""
    if figure.name not in tables:
        return figure
    again = figures.against_target(figure.name, figure.value, tables, figure.note)
    return again._replace(part=figure.part)


def renew_pages(path):
    """Put the figures of pages as they are now into a result."""
    about, old = figures.read(path)
    parts, broken = about.pop("parts"), about.pop("broken")
    new = measured([PAGES], False)
    if new.broken:
        raise SystemExit(f"part {PAGES}: {new.broken[PAGES]}; {path} stays as it was")
    kept = [judged_again(figure, new.tables) for figure in old if figure.part != PAGES]
    known = {figure.name for figure in (*kept, *new.figures)}
    for name in new.tables:
        if name not in known:
            new.target(name, None, "added since the last `make bench`")
    figures.write(path, [*kept, *new.figures], about, parts, broken)
    print("\n".join(summary(new)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument(
        "--full", action="store_true", help="score the slow peers on the whole workloads, too"
    )
    parser.add_argument(
        "--pages",
        action="store_true",
        help="read the part `evidence` again into result.json, whose other figures stay as they were "
        "measured: each of its figures names the page and the commit that it is from",
    )
    options = parser.parse_args()
    if options.pages:
        return renew_pages(RESULT)
    if unknown := [name for name in options.parts if name not in PARTS]:
        parser.error(f"no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    about = figures.about() | {"peers": peers.versions()}  # of the code as it is when it begins
    print(json.dumps(about))
    book = measured(options.parts or list(PARTS), options.full)
    if not options.parts:
        book.missing()
        figures.write(RESULT, book.figures, about, book.parts, book.broken)
    print("\n".join(summary(book)))


if __name__ == "__main__":
    main()
