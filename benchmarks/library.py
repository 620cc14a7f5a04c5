"""The library of kernels under measurement: a wheel with it in a new environment, its kernels beside
those of the compiler, filters exported as C.

`python benchmarks/library.py stream` is what the process of `stream_step` runs; it prints one JSON line.
"""

import json
import os
import resource
import site
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import attitude
import exogenous
import numpy as np
import processes
import subject
import workload

from strapdown import aiding, filters
from strapdown.core.compile import library, machine_code
from strapdown.core.loop import loop

CHECKOUT = Path(__file__).resolve().parents[1]
WHEEL = [
    *("wheel, first use ever, NetCDF", "wheel, first use ever, CSV"),
    *("wheel, later, NetCDF", "wheel, later, CSV"),
    *("wheel, strapdown fuse with page", "wheel, import strapdown"),
]
FILTERS = {
    "open-loop": 600,
    "closed-loop": 600,
    "mekf": 600,
    "ekf": 600,
    "ukf": 60,
    "xkf": 600,
    "nlo": 600,
    "attitude-mekf": 0,
    "mahony": 0,
    "pkf": 20,
}
"""Seconds of workload A; the attitude filters run on a trial of BROAD."""
NEEDS = ["wheel with its needs", "wheel, first page ever"]
RATIOS = [f"library over compiler, {name}" for name in FILTERS]
VELOCITIES = ("xkf", "nlo")
"""Filters that run with a velocity at each fix."""
COMPONENTS = 100
"""Of the particle filter."""
STREAM = ["stream step without the compiler"]
EXPORTED = ["export, four sources on cortex-m7"]
SOURCES = ("position", "velocity", "altitude", "zero-velocity")
TARGETS = ("cortex-m7", "cortex-m4f", "host", "aarch64", "wasm32")
"""The first has a target of ours."""
LOADED = "import strapdown"
SOLUTION = """
import sys, strapdown as sd
sd.fuse(sd.read(sys.argv[1]), "closed-loop")
assert "numba" not in sys.modules
"""


# ---- the library and its wheel


def built(folder):
    """(seconds, {level: bytes}) of building the library for this processor's level; kernels that did
    not change since the last build come from the cache."""
    took, _ = processes.child("-m", "strapdown.native.build", folder)
    made = json.loads((folder / library.MANIFEST).read_bytes())["libraries"]
    return took, {level: each["bytes"] for level, each in made.items()}


def wheel(folder, dist):
    """Path of a wheel with the library of a folder. Raises RuntimeError where it comes without."""
    command = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--disable-pip-version-check"]
    processes.child(*command, "--wheel-dir", dist, CHECKOUT, STRAPDOWN_LIBRARY=str(folder))
    (made,) = dist.glob("strapdown-*.whl")
    if made.stem.endswith("-any"):
        raise RuntimeError(f"{made.name} is without the library")
    return made


def installed(wheel, folder):
    """Folder of a new virtual environment with the wheel, and the dependencies of this one."""
    processes.child("-m", "venv", "--without-pip", folder)
    words = ("install", "--quiet", "--no-deps", "--no-index", "--disable-pip-version-check")
    here = ("-m", "pip", "--python", folder / "bin" / "python")
    processes.child(*here, *words, wheel, PYTHONPATH="")
    (packages,) = folder.glob("lib/python*/site-packages")
    # folders alone: what .pth files in them add, such as this checkout, is not followed
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))
    return folder


def with_needs(wheel, folder):
    """[(MB or s, note)] for NEEDS: the wheel and what it needs in a new environment, and the page of the
    recorded drive there."""
    processes.child("-m", "venv", "--without-pip", folder)
    words = ("--python", folder / "bin" / "python", "install", "--quiet", "--no-compile", wheel)
    processes.child("-m", "pip", "--disable-pip-version-check", *words, PYTHONPATH="")
    (packages,) = folder.glob("lib/python*/site-packages")
    size = sum(file.stat().st_size for file in packages.rglob("*") if file.is_file())
    took = seconds_in(folder, "strapdown", "demo", "--recorded", "--out", "page.html")
    return [(size / 1e6, "as pip installs them, without bytecode"), (took, "a recorded drive")]


def seconds_in(environment, *words):
    """Of a process of a new environment, whose caches are empty before its first."""
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "TMPDIR") if name in os.environ}
    caches = {"HOME": str(environment), "STRAPDOWN_REQUIRE_LIBRARY": "1"}
    begin = time.perf_counter()
    done = subprocess.run(
        [environment / "bin" / words[0], *map(str, words[1:])],
        env=kept | caches,
        cwd=environment,
        capture_output=True,
        text=True,
    )
    took = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError((done.stderr.strip() or "no output").splitlines()[-1])
    return took


def used(wheel, log, times=5):
    """[(s or ms, note)] for WHEEL: whole processes that read and fuse `log`
    (recording.toml and CSV), or the same as NetCDF."""
    with TemporaryDirectory() as place:
        place, first, later = Path(place), [], []
        processes.child(
            "-c",
            "import sys, strapdown as sd; sd.write_recording(sd.read(sys.argv[1]), sys.argv[2])",
            *(log, place / "recording.nc"),
        )
        for number, file in enumerate((place / "recording.nc", log)):
            environment = installed(wheel, place / str(number))
            taken = [
                seconds_in(environment, "python", "-c", SOLUTION, file) for _ in range(times + 1)
            ]
            first.append((taken[0], "the first process after installing"))
            later.append((float(np.median(taken[1:])), "whole process"))
        page = [
            seconds_in(environment, "strapdown", "fuse", log, "--out", place / f"out{number}")
            for number in range(times)
        ]
        later.append((float(np.median(page)), f"the first {page[0]:.2f} s"))
        bare, whole = np.median(
            [
                [seconds_in(environment, "python", "-c", code) for code in ("pass", LOADED)]
                for _ in range(3 * times)
            ],
            axis=0,
        )
        more = [((whole - bare) * 1e3, f"the interpreter alone {bare * 1e3:.0f} ms")]
    return first + later + more


# ---- its kernels beside the compiler's


class Kernels:
    """What a run of a filter calls, by the library of a folder and by the compiler."""

    def __init__(self, name, kinds, folder):
        from strapdown.core.compile import compiler

        filter = filters.find(name)
        observers = (aiding.find(kind).observe for kind in kinds)
        self.kernels = [loop.run, filter.predict, filter.correct, *observers]
        made = json.loads((folder / library.MANIFEST).read_bytes())["libraries"]
        level = next(level for level in library.levels() if level in made)
        file = folder / made[level]["file"]
        addresses = machine_code.load(file, file.read_bytes())
        of_library = [addresses[kernel.symbol] for kernel in self.kernels]
        self.addresses = {
            "library": of_library,
            "compiler": [compiler.kernel_address(kernel)[0] for kernel in self.kernels],
        }

    @contextmanager
    def of(self, whose):
        """Runs that begin inside call these."""
        before = [kernel._address for kernel in self.kernels]
        try:
            self._use(self.addresses[whose])
            yield
        finally:
            self._use(before)

    def _use(self, addresses):
        for kernel, address in zip(self.kernels, addresses):
            kernel._address = address


def run_of(name):
    """(function that runs a filter and returns the seconds of its loop, kinds of its sources)."""
    if not FILTERS[name]:
        recording = attitude.trial().recording
        return attitude.timed_run(recording, name), [a.kind for a in recording.sources]
    w = workload.load("A").first(FILTERS[name])
    sources = (exogenous.velocity(w),) if name in VELOCITIES else ()
    options = {"components": COMPONENTS} if name == "pkf" else {}
    run = subject.timed_run(w, name, sources=sources, **options)
    return run, ["position", *(a.kind for a in sources)]


def ratio(alternating, name, folder, turns):
    """(time with the library over that with the compiler, note): medians of runs in turns."""
    run, kinds = run_of(name)
    kernels = Kernels(name, kinds, folder)

    def by(whose):
        def seconds():
            with kernels.of(whose):
                return run()

        return seconds

    theirs, own, value = alternating(by("compiler"), by("library"), turns)
    return value, f"{own * 1e3:.1f} against {theirs * 1e3:.1f} ms"


def stream_step(folder):
    """[(us, note)] for STREAM: the median of a process that never loads the compiler."""
    required = {library.SETTING: str(folder), library.REQUIRED: "1"}
    _, (plain, fix) = processes.child(__file__, "stream", **required)
    return [(plain, f"{fix:.1f} us per fix")]


def run_stream():
    """What the process of `stream_step` does."""
    found = subject.stream_times(workload.load("A").first(300))
    if "numba" in sys.modules:
        raise RuntimeError("numba is loaded")
    print(json.dumps(found))


# ---- exported filters


@cache
def flight(seconds):
    """A recording to replay."""
    import strapdown as sd
    from strapdown.sim.trajectory import demo_flight

    return sd.simulate(demo_flight(), seconds, "tactical", 1)


def export(target, folder, seconds=10.0):
    """Sizes of the closed loop with SOURCES for a target, exported into a folder."""
    from strapdown.native.export import chosen, folder as exported

    of = chosen.choose_export("closed-loop", SOURCES, flight(seconds))
    return exported.export(of, exported.find_target(target), folder).sizes


def sizes():
    """{target: (bytes of code and constants, note)}."""
    found = {}
    for target in TARGETS:
        with TemporaryDirectory() as folder:
            made = export(target, Path(folder))
        stack = "not known" if made.stack is None else f"{made.stack} bytes"
        found[target] = made.code, f"{made.state} bytes of state, stack {stack}"
    return found


def in_c(times=5, seconds=(60.0, 600.0)):
    """us per sample of the exported closed loop replaying a file in C: of the longer of two
    flights what it takes more than the shorter."""
    least = []
    for each in seconds:
        with TemporaryDirectory() as folder:
            export("host", Path(folder), each)
            sources = [file.name for file in Path(folder).glob("*.c")]
            command = ["cc", "-std=c99", "-O2", "-o", "main", *sources, "strapdown.o", "-lm"]
            subprocess.run(command, cwd=folder, check=True)
            taken = []
            for _ in range(times):
                before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
                subprocess.run(["./main"], cwd=folder, check=True, capture_output=True)
                taken.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
            least.append(min(taken))
    samples = len(flight(seconds[1]).imu.t) - len(flight(seconds[0]).imu.t)
    return (least[1] - least[0]) / samples * 1e6


def in_python():
    """us per sample of a step of a stream."""
    return subject.stream_times(workload.load("A").first(300))[0]


if __name__ == "__main__":
    run_stream()
