"""Kernels compiled in other processes land in the cache; what cannot is compiled where it is called."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import strapdown
from strapdown.aiding import heading, velocity
from strapdown.core.compile import jit
from strapdown.core.compile.jit import kernel
from strapdown.core.compile.signatures import REAL, signature
from strapdown.core.loop import contract
from strapdown.core.loop.contract import IN_LANES, OBSERVE, FilterState
from strapdown.core.mathematics.source import new_source

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")
ONE = signature("one", REAL, x=REAL)
PATIENCE = 120
"""s after which a process is taken to wait for ever."""
TWO_CORES = """
    import signal
    from strapdown.aiding import heading, velocity
    from strapdown.core.compile import jit, side_by_side
    side_by_side.ENOUGH, side_by_side._cores = 1.0, lambda: 2
    """
BOTH = f"""{TWO_CORES}
    import numpy as np
    from strapdown.core.loop.contract import FilterState
    from strapdown.core.mathematics.source import new_source
    both = heading.observe, velocity.observe
    print("ready", flush=True)
    input()
    said, zero, seen = [], np.zeros(3), np.zeros(3)
    jit.compile_together(both, "two", said.append)
    print(*(each.at_hand for each in both), len(said) > 0)
    belief = FilterState(*(zero, zero, np.eye(3), zero, zero, np.eye(15), zero, zero, zero, zero[:0]))
    for each in both:
        seen[:] = 0
        each(belief, np.array([0.25, 0.5, 0.75]), new_source(), seen, np.zeros((3, 15)))
        print(*seen)
    """
INTERRUPTED = f"""{TWO_CORES}
    from strapdown.core.loop import loop
    from strapdown.filters.ins import closed_loop
    signal.signal(signal.SIGINT, signal.default_int_handler)  # also in a job of the background
    slow = loop.run, closed_loop.correct
    jit.compile_together([heading.observe, *slow], "three", lambda text: print(text, flush=True))
    """


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """Nothing compiled, two cores, and no kernel too small for a process of its own."""
    import numba

    from strapdown.core.compile import side_by_side

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(side_by_side, "ENOUGH", 1.0)
    monkeypatch.setattr(side_by_side, "_cores", lambda: 2)
    for each in (heading.observe, velocity.observe):
        monkeypatch.setattr(each, "_address", 0)
        monkeypatch.setattr(jit.library, "find", lambda kernel: None)
    return tmp_path


def started(code, cache):
    """A new process for `code` with its kernels in the folder `cache`."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(strapdown.__file__).parents[1]),
        "NUMBA_CACHE_DIR": str(cache),
        "STRAPDOWN_LIBRARY": "0",
    }
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    command = [sys.executable, "-c", textwrap.dedent(code)]
    return subprocess.Popen(command, env=environment, cwd="/", text=True, **pipes)


def all_at_once(code, cache, count):
    """Standard output of so many processes that go on together when all of them have started."""
    with ExitStack() as stack:
        processes = [stack.enter_context(started(code, cache)) for _ in range(count)]
        for each in processes:
            stack.callback(each.kill)
        assert [each.stdout.readline() for each in processes] == ["ready\n"] * count
        for each in processes:
            each.stdin.write("\n")
            each.stdin.flush()
        ends = [each.communicate(timeout=PATIENCE) for each in processes]
    assert [(each.returncode, err) for each, (_, err) in zip(processes, ends)] == [(0, "")] * count
    return [out for out, _ in ends]


def names_in(cache):
    """Kernels in a folder of them, by their modules, and whatever else is there but the pace."""
    files = [each for each in cache.rglob("*") if each.is_file() and each.name != "pace"]
    return sorted(each.name.split("-")[0] for each in files)


def innovation_of(observe):
    """The innovation of a fix, of a body at rest that points to the north."""
    zero, innovation = np.zeros(3), np.zeros(3)
    belief = FilterState(
        *(zero, zero, np.eye(3), zero, zero, np.eye(15), zero, zero, zero, zero[:0])
    )
    observe(belief, np.array([0.25, 0.5, 0.75]), new_source(), innovation, np.zeros((3, 15)))
    return innovation.tolist()


def children(process):
    """Ids of the processes that a process of Linux has started."""
    tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
    return [int(each) for task in tasks for each in task.read_text().split()]


def runs(pid):
    """True for a process that has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_other_processes_leave_kernels_in_the_cache(cold):
    said = []
    jit.compile_together([heading.observe, velocity.observe], "two", said.append)
    assert not heading.observe._address and heading.observe.at_hand and velocity.observe.at_hand
    assert not heading.observe.ready() and not velocity.observe.ready()  # loaded
    assert said[0] == "compiling two for the first time on this machine ..."
    assert len(said) == 2 and said[1].startswith("compiling two: 1 of 2 kernels, about ")
    assert list(cold.rglob("pace"))


def test_the_time_that_compiling_takes_is_told_before(cold):
    from strapdown.core.compile.side_by_side import seconds_to_compile

    both = [heading.observe, velocity.observe]
    one, two = seconds_to_compile(both[:1]), seconds_to_compile(both)
    assert 0 < one < PATIENCE and 0 < two < PATIENCE
    jit.compile_together(both, "two")
    assert seconds_to_compile(both) == 0.0


def test_a_kernel_of_no_module_is_compiled_here(cold):
    own = kernel(ONE)(lambda x: x + 1.0)
    jit.compile_together([own, heading.observe, velocity.observe], "three")
    assert own._address and own(1.0) == 2.0


@pytest.mark.parametrize("broken", ["no python", "dies", "babbles"])
def test_without_other_processes_kernels_are_left_to_their_callers(cold, monkeypatch, broken):
    from strapdown.core.compile import other_process, side_by_side

    starts = {"dies": "raise SystemExit(1)", "babbles": "print('no number', flush=True); input()"}
    if broken == "no python":
        monkeypatch.setattr(side_by_side.sys, "executable", os.devnull)
    else:
        monkeypatch.setattr(other_process, "START", starts[broken])
    jit.compile_together([heading.observe, velocity.observe], "two")
    assert heading.observe.address and velocity.observe.address


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_an_interrupt_ends_compiling_at_once_and_leaves_nothing_behind(tmp_path):
    with started(INTERRUPTED, tmp_path) as process:
        try:
            said = [process.stdout.readline() for _ in range(2)]
            assert said[1].startswith("compiling three: 1 of 3 kernels"), said
            workers = children(process)
            begin = time.perf_counter()
            process.send_signal(signal.SIGINT)
            errors = process.communicate(timeout=PATIENCE)[1]
            seconds = time.perf_counter() - begin
        finally:
            process.kill()
    assert process.returncode == -signal.SIGINT and errors.endswith("KeyboardInterrupt\n"), errors
    assert len(workers) == 2 and not any(map(runs, workers))
    assert seconds < 5  # the kernels take longer
    assert names_in(tmp_path) == ["strapdown.aiding.heading.observe"]


def test_an_interrupt_while_processes_are_started_ends_those_that_were(cold, monkeypatch):
    from strapdown.core.compile import side_by_side

    begun, popen = [], subprocess.Popen

    def interrupted(*arguments, **named):
        if begun:
            raise KeyboardInterrupt
        begun.append(popen(*arguments, **named))
        return begun[0]

    monkeypatch.setattr(side_by_side.subprocess, "Popen", interrupted)
    with pytest.raises(KeyboardInterrupt):
        jit.compile_together([heading.observe, velocity.observe], "two")
    try:
        assert begun[0].returncode is not None and begun[0].stdin.closed
    finally:
        begun[0].kill()


def test_processes_that_compile_the_same_at_once_do_not_disturb_each_other(cold):
    expected = "True True True\n0.25 0.0 0.0\n0.25 0.5 0.75\n"
    assert all_at_once(BOTH, cold, 3) == [expected] * 3
    assert names_in(cold) == [
        "strapdown.aiding.heading.observe",
        "strapdown.aiding.velocity.observe",
    ]
    # one more has nothing to compile
    said = []
    jit.compile_together([heading.observe, velocity.observe], "two", said.append)
    assert not said and not heading.observe.ready() and not velocity.observe.ready()


def test_without_a_folder_that_can_be_written_kernels_are_compiled_here(cold, monkeypatch):
    import numba

    file = cold / "file"
    file.touch()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(file / "below"))
    said = []
    jit.compile_together([heading.observe, velocity.observe], "two", said.append)
    assert heading.observe._address and velocity.observe._address
    assert innovation_of(heading.observe) == [0.25, 0.0, 0.0]
    assert innovation_of(velocity.observe) == [0.25, 0.5, 0.75]
    assert said[0] == "compiling two for the first time on this machine ..." and len(said) == 2


def test_kernels_for_eight_runs_are_compiled_in_other_processes(cold, monkeypatch):
    from strapdown.core.compile import side_by_side

    monkeypatch.setattr(heading.observe, "_for_runs", None)
    wide = contract.side_by_side(heading.observe)
    job = side_by_side._job(wide)
    assert job[:3] == ("strapdown.aiding.heading", "observe", IN_LANES[OBSERVE])
    jit.compile_together([wide, heading.observe], "both")
    assert not wide._address and not heading.observe._address
    assert wide.at_hand and job.path.exists() and not wide.ready()  # loaded
    assert names_in(cold) == [
        "strapdown.aiding.heading.observe",
        "strapdown.aiding.heading.observe_in_lanes",
    ]
    # another process may make another kernel of it, which is of no use to this one
    other = job.path.with_name("other")
    other.touch()
    assert side_by_side._compile_job(job) and not side_by_side._compile_job(
        job._replace(path=other)
    )


def test_what_the_compiler_prints_in_other_processes_is_no_answer(cold, monkeypatch):
    monkeypatch.setenv("NUMBA_DEBUG_TYPEINFER", "1")
    jit.compile_together([heading.observe, velocity.observe], "two")
    assert heading.observe.at_hand and velocity.observe.at_hand
