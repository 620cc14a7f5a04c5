"""Kernels compiled side by side, in processes that leave them in the cache on disk.

numba compiles one function at a time in a process. So that the cores of a machine are used, other
processes compile the kernels that a run needs, and this one waits and tells how far they are. A
kernel that they do not leave behind is compiled where it is called, as if nobody had tried: one that
cannot be imported elsewhere, that no cache can hold, that does not compile, or whose process died.
"""

import importlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from ...fileio.locks import part_of
from . import compiler
from .closure_values import NoWords, functions
from .other_process import answers, start_process
from .signatures import Signature

ENOUGH = 5e5
"""Work of `work` for which a process of its own is not worth its start of a second."""
TURN = 0.5
"""s after which a Ctrl-C is heard on systems where waiting does not hear it."""
TELLING = 0.1
"""Share of the work that tells the pace: a small kernel takes mostly what a process begins with."""
PACE = "pace"
"""File beside the kernels: seconds that a unit of `work` took on this machine the last time."""


USUAL_PACE = 9e-6
"""s that a unit of `work` takes where this machine has compiled nothing yet: a server core of 2026."""


class Job(NamedTuple):
    """A kernel as another process finds it: the variable of a module, or what `for_runs` makes of that
    for a signature; and the file that it belongs in."""

    module: str
    variable: str
    signature: Signature | None
    path: Path


class CompileProgress(NamedTuple):
    """Progress of compiling."""

    done: int
    kernels: int
    seconds: float | None  # left, by the pace of this machine; None where that is not known yet


def work(kernel: Any) -> float:
    """Time to compile a kernel, in a unit of the machine: bytes of Python's code of all
    functions that it can call, to the power of 1.5, as was measured."""
    try:
        return float(sum(len(each.__code__.co_code) for each in functions(kernel))) ** 1.5
    except NoWords:
        return 0.0


def fill(kernels: Sequence[Any], tell: Callable[[CompileProgress], None]) -> None:
    """Compile kernels that are not at hand into the cache, as far as that goes. `tell` hears how far
    it is, at the beginning and after each kernel."""
    jobs = {kernel: job for kernel in kernels if (job := _job(kernel))}
    spread = sorted(jobs, key=work, reverse=True)
    count = _processes(spread)
    clock = _Clock(kernels, max(count, 1))
    tell(clock.now())
    if count < 2:
        spread = []
    with _Workers(count if spread else 0) as workers:
        # the least first, so that progress shows soon
        workers.take([jobs[kernel] for kernel in (*spread[-1:], *spread[:-1])])
        for kernel in kernels:
            if kernel not in spread:
                begin, seconds = time.perf_counter(), 0.0
                with suppress(Exception):  # which its caller will hear of
                    kernel.ready()
                    seconds = time.perf_counter() - begin
                clock.took(kernel, seconds)
                tell(clock.now())
        by_path = {job.path: kernel for kernel, job in jobs.items()}
        for job, seconds in workers.results(len(spread)):
            clock.took(by_path[job.path], seconds)
            tell(clock.now())
    clock.keep()


def _processes(spread: Sequence[Any]) -> int:
    """The number of processes in which these kernels are compiled."""
    return min(_cores(), len(spread), int(sum(map(work, spread)) / ENOUGH))


def seconds_to_compile(kernels: Iterable[Any]) -> float:
    """s that `fill` takes, about, for those kernels that are not at hand; 0 where all are."""
    slow = [kernel for kernel in dict.fromkeys(kernels) if not kernel.at_hand]
    if not slow:
        return 0.0
    clock = _Clock(slow, max(_processes(slow), 1), USUAL_PACE)
    return clock.now().seconds or 0.0


def _job(kernel: Any) -> Job | None:
    """The words by which another process finds a kernel, or None where none can compile it for this
    one."""
    path = compiler.cache_of(kernel).path
    module: Any = sys.modules.get(kernel.__module__)
    if path is None or module is None or kernel.__module__ == "__main__" or not _writable(path):
        return None
    signature: Signature = kernel.signature
    for variable, value in [*vars(module).items()]:
        if value is kernel:
            return Job(module.__name__, variable, None, path)
        if getattr(value, "_for_runs", None) is kernel:
            return Job(module.__name__, variable, signature, path)
    return None


def _writable(path: Path) -> bool:
    """True where the folder of a path can be written and Python can be started."""
    python = Path(sys.executable or "").name.lower().startswith(("python", "pypy"))
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return python and os.access(path.parent, os.W_OK | os.X_OK)
    return False


def _cores() -> int:
    """Those that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# ---- how long it takes


class _Clock:
    """The time left to compile kernels in several processes."""

    def __init__(self, kernels: Sequence[Any], processes: int, pace: float | None = None) -> None:
        """`pace`: where this machine has shown none."""
        self._left = {kernel: work(kernel) for kernel in kernels}
        self._count, self._processes = len(kernels), processes
        self._work, self._seconds, self._begun = 0.0, 0.0, time.perf_counter()
        self._path = _pace_file(kernels)
        self._before = _stored_pace(self._path) or pace

    def took(self, kernel: Any, seconds: float) -> None:
        """A kernel is done; 0 s where it did not compile, which says nothing of the pace."""
        size = self._left.pop(kernel, 0.0)
        self._work += size if seconds else 0.0
        self._seconds += seconds

    def now(self) -> CompileProgress:
        """The longest kernel, or all of them on all cores, less what is done of them."""
        whole = self._work + sum(self._left.values())
        known = self._work > TELLING * whole
        pace, rest = self._seconds / self._work if known else self._before, None
        if pace:
            longest = max(self._left.values(), default=0.0)
            at_best = pace * max(longest, whole / self._processes)
            rest = max(at_best - (time.perf_counter() - self._begun), 0.0)
        return CompileProgress(self._count - len(self._left), self._count, rest)

    def keep(self) -> None:
        """Leave the pace to the next time."""
        if self._path and self._work and self._seconds:
            with suppress(OSError), part_of(self._path) as part:
                part.path.write_text(repr(self._seconds / self._work), encoding="ascii")
                part.rename(self._path)


def _pace_file(kernels: Sequence[Any]) -> Path | None:
    paths = (compiler.cache_of(kernel).path for kernel in kernels)
    return next((path.with_name(PACE) for path in paths if path), None)


def _stored_pace(path: Path | None) -> float | None:
    with suppress(OSError, ValueError):
        pace = float(path.read_text(encoding="ascii")) if path else 0.0
        return pace if 0 < pace < 1 else None
    return None


# ---- the other processes


class _Workers:
    """So many processes that compile, for as long as the block lasts."""

    def __init__(self, count: int) -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[Job | None, float]] = queue.SimpleQueue()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._threads: list[threading.Thread] = []
        self._count = count

    def __enter__(self) -> "_Workers":
        for _ in range(self._count):
            try:
                self._begin()
            except OSError:
                pass
            except BaseException:  # Ctrl-C, which leaves none of them behind
                self.__exit__()
                raise
        return self

    def _begin(self) -> None:
        """Start one. Raises OSError."""
        process = start_process(__name__)
        self._processes.append(process)
        thread = threading.Thread(target=self._feed, args=(process,), daemon=True)
        thread.start()
        self._threads.append(thread)

    def __exit__(self, *raised: Any) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
            self._jobs.put(None)
        for process, thread in zip(self._processes, self._threads):
            thread.join()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError):  # what could not be written to the dead
                    assert pipe
                    pipe.close()

    def take(self, jobs: Sequence[Job]) -> None:
        """Give them work."""
        for each in (*jobs, *(None for _ in self._processes)):
            self._jobs.put(each)

    def results(self, count: int) -> Any:
        """Yield (job, seconds) of those of `count` jobs that were compiled, as they end."""
        running = len(self._processes)
        while count and running:
            try:
                job, seconds = self._done.get(timeout=TURN)
            except queue.Empty:
                continue
            if job is None:
                running -= 1
            else:
                count -= 1
                if seconds:
                    yield job, seconds

    def _feed(self, process: "subprocess.Popen[bytes]") -> None:
        """Hand one job after the other to a process, until it dies or there are none."""
        assert process.stdin and process.stdout
        while job := self._jobs.get():
            seconds = None
            # ValueError: of a closed pipe, or of an invalid answer
            with suppress(OSError, ValueError, pickle.PicklingError, AttributeError):
                pickle.dump(job, process.stdin)
                process.stdin.flush()
                seconds = float(process.stdout.readline())
            self._done.put((job, seconds or 0.0))
            if seconds is None:
                break
        self._done.put((None, 0.0))


def main() -> None:
    """Run a worker process: compile the jobs that arrive on stdin, and answer each with the seconds
    that it took, 0 where it failed."""
    with answers() as pipe:
        compiler.warm_up()
        while True:
            try:
                job = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            begin, seconds = time.perf_counter(), 0.0
            with suppress(Exception):
                if _compile_job(job):
                    seconds = time.perf_counter() - begin
            pipe.write(f"{seconds}\n".encode())
            pipe.flush()


def _compile_job(job: Job) -> bool:
    """Compile a kernel; False where this process would make another one of it than that which asked."""
    kernel = getattr(importlib.import_module(job.module), job.variable)
    if job.signature:
        kernel = kernel.for_runs(job.signature)
    if compiler.cache_of(kernel).path != job.path:
        return False
    kernel.ready()
    return job.path.exists()
