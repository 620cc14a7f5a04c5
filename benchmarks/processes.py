"""Figures that need a process of their own: a day in bounded memory, the first solution, the first
compilation, that of a further filter, `make demo` in a new clone, `--help`.

`python benchmarks/processes.py day PERIOD SECONDS` and `... first LOG [FILTER]` are what those processes
run; each prints one JSON line.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent / "src"
DAY = 86400.0
FURTHER = "mekf"
"""Filter of the closed loop's family whose first run is timed after that of the closed loop."""


def environment(**changes):
    """This process' environment with strapdown importable from the checkout, and its bytecode kept
    as that of an installed package is."""
    path = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "", **changes}


def child(*arguments, **changes):
    """(seconds of the whole process, its last line of output as JSON or text). Raises
    RuntimeError with its last words."""
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=environment(**changes),
        capture_output=True,
        text=True,
    )
    seconds = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(
            f"{' '.join(map(str, arguments))[:80]}: {(done.stderr.strip() or done.stdout.strip() or 'no output').splitlines()[-1]}"
        )
    last = (done.stdout.strip().splitlines() or ["null"])[-1]
    try:
        return seconds, json.loads(last)
    except ValueError:
        return seconds, last


COMMAND = "import sys; from strapdown.cli.app import main; sys.exit(main())"
"""What the console script `strapdown` runs."""


def median(times, *arguments):
    """Median seconds of a process that runs `times` times, after once that does not count."""
    child(*arguments)
    return sorted(child(*arguments)[0] for _ in range(times))[times // 2]


def help_seconds(times=5):
    """Median time of `strapdown --help`."""
    return median(times, "-c", COMMAND, "--help")


def first_solution(log, times=3):
    """With nothing cached and kernels of the compiler: (wall seconds, processor seconds) of a process
    that reads and fuses `log`, seconds of a further filter in it; and with a warm cache the median
    seconds of a process."""
    with tempfile.TemporaryDirectory() as empty:
        compiled = {"XDG_CACHE_HOME": empty, "NUMBA_CACHE_DIR": "", "STRAPDOWN_LIBRARY": "0"}
        before = processor_seconds()
        cold, _ = child(__file__, "first", log, **compiled)
        busy = processor_seconds() - before
        further = child(__file__, "first", log, FURTHER, **compiled)[1]
        runs = sorted(child(__file__, "first", log, **compiled)[0] for _ in range(times))
    return cold, busy, further, runs[times // 2]


def processor_seconds():
    """Of processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def demo():
    """Seconds of `make demo` in a new clone, no kernel cached, packages from the cache of pip."""
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder, "clone")
        subprocess.run(["git", "clone", "-q", HERE.parent, clone], check=True)
        packages = subprocess.run(
            [sys.executable, "-m", "pip", "cache", "dir"], capture_output=True, text=True
        ).stdout.strip()
        changes = {"XDG_CACHE_HOME": folder, "NUMBA_CACHE_DIR": "", "PIP_CACHE_DIR": packages}
        begin = time.perf_counter()
        done = subprocess.run(
            ["make", "demo", f"PYTHON={sys._base_executable}"],
            cwd=clone,
            env={**os.environ, **changes},
            capture_output=True,
            text=True,
        )
        if done.returncode or not (clone / "report.html").exists():
            raise RuntimeError(f"make demo: {(done.stderr or done.stdout).strip()[-80:]}")
        return time.perf_counter() - begin


def day(period, seconds=DAY):
    """Of a closed loop over a synthetic day: (seconds, MB above the input arrays, MB of python
    and numpy, rms position error in m of the last hour)."""
    child(__file__, "day", period, 20)  # compiles
    return child(__file__, "day", period, seconds)[1]


def memory():
    """(bytes now, largest so far) that this process has in memory."""
    try:
        lines = dict(
            line.split(":", 1)
            for line in Path("/proc/self/status").read_text().splitlines()
            if ":" in line
        )
        return tuple(1024 * int(lines[key].split()[0]) for key in ("VmRSS", "VmHWM"))
    except OSError:  # not Linux: the largest stands for both
        largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (
            1 if sys.platform == "darwin" else 1024
        )
        return largest, largest


def run_day(path, seconds):
    """What the process of `day` does. All but the input arrays and numpy itself counts as
    memory: strapdown, its libraries, compiled code."""
    import numpy as np
    import workload

    with np.load(path) as piece:
        piece = dict(piece)
    w = workload.repeated(piece, seconds)
    before = memory()[0]
    interpreter = before - sum(array.nbytes for array in (w.t, w.dtheta, w.dv, w.fix_t, w.fix))
    import subject

    begin = time.perf_counter()
    solution = subject.fuse(w, "closed-loop", every=100)
    took, above = time.perf_counter() - begin, memory()[1] - before
    late = solution.t > solution.t[-1] - 3600
    error = (solution.trajectory.lla[late] - workload.round_position(piece, solution.t[late])) * [
        *workload.round_scale(piece),
        1.0,
    ]
    print(
        json.dumps(
            [took, above / 1e6, interpreter / 1e6, float(np.sqrt((error**2).sum(axis=1).mean()))]
        )
    )


def run_first(log, further=None):
    """What the process of `first_solution` does: the user's three lines. Prints the seconds that the
    filter `further` takes after them, if one is named."""
    import strapdown as sd

    recording = sd.read(log)
    sd.fuse(recording, "closed-loop")
    begin = time.perf_counter()
    if further:
        sd.fuse(recording, further)
    print(json.dumps(time.perf_counter() - begin))


if __name__ == "__main__":
    what, *rest = sys.argv[1:]
    if what == "day":
        run_day(rest[0], float(rest[1]))
    else:
        run_first(*rest)
