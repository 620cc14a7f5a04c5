"""Verdicts of another process: the same as the stream's own, of the span that they name; a process that dies
or hangs, a history that moves and a program that is killed end in a message, never in the filter."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from recordings import events_of, flight

import strapdown as sd
from strapdown.engine import verdict_process
from strapdown.engine.verdict_process import TORN, WHOLE, VerdictProcess
from strapdown.filters import find

pytestmark = pytest.mark.short
LATE = 300.0
"""s that a test waits for another process, at most."""
SECONDS = 60.0


def fed(recording, filter="closed-loop", history=65536):
    """A stream that has used a recording."""
    sources = tuple(a._where(np.zeros(len(a.t), bool)) for a in recording.sources)
    stream = sd.Stream(filter, sources=sources, imu="tactical", history=history)
    for event in events_of(recording):
        stream.step(event)
    _ = stream.verdict  # compiles what the other process needs, which has a low priority
    return stream


def late_fixes():
    """A flight whose positions have stamps that are half a second late."""
    recording = flight(SECONDS)
    position, *others = recording.sources
    return replace(recording, sources=(replace(position, t=position.t + 0.5), *others))


@pytest.fixture(scope="module")
def stream():
    return fed(flight(SECONDS))


@pytest.fixture
def process():
    made = VerdictProcess(every=0.0)
    yield made
    made.close()


def until(is_so):
    end = time.monotonic() + LATE
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def judged(process, stream):
    """The newest verdict after one more attempt."""
    process._due = -inf
    process.look(stream)
    until(lambda: process._given == inf)
    return process.newest


@pytest.mark.parametrize("recording", [flight(SECONDS), late_fixes()])
def test_a_verdict_is_that_of_the_stream(recording, process):
    stream = fed(recording)
    newest = judged(process, stream)
    assert process.error == "" and newest.verdict == stream.verdict
    assert (newest.start, newest.stop) == (stream.start.t, stream.t)
    assert 0 < newest.age < 2 * LATE and newest.seconds > 0
    assert process._due == newest.taken + newest.seconds / verdict_process.SHARE
    assert newest.span.startswith(f"{stream.start.t:.1f} to 60.0 s, ")
    # the stream goes on with the same process
    number = process._process.pid
    again = judged(process, stream)
    assert again is not newest and again.verdict == newest.verdict
    assert process._process.pid == number


def test_a_correct_flight_and_a_late_clock_are_told_apart(stream):
    """So that the test above compares verdicts that differ."""
    assert stream.verdict.trusted and not fed(late_fixes()).verdict.trusted


def test_every_nth_row_is_judged_as_the_stream_does(process):
    recording = flight(SECONDS)
    stream = sd.Stream("closed-loop", sources=recording.sources, imu="tactical", every=7)
    for event in events_of(recording):
        stream.step(event)
    assert judged(process, stream).verdict == stream.verdict


def test_before_the_first_sample_there_is_none(process):
    process.look(sd.Stream("closed-loop", imu="tactical"))
    assert (process.newest, process.error, process._thread) == (None, "", None)


def test_the_next_one_waits(stream, process):
    process._every = 1000.0
    newest = judged(process, stream)
    assert process._due == newest.taken + 1000.0
    process.look(stream)
    assert process._given == inf


def test_a_process_that_dies_is_said_and_replaced(stream, process):
    newest = judged(process, stream)
    process._process.kill()
    assert judged(process, stream) is newest
    assert process.error.startswith("its process has ended, exit code ")
    assert process._due == pytest.approx(time.monotonic() + 120.0, abs=LATE)
    assert judged(process, stream) is not newest
    assert process.error == ""


def silent_process(code):
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe)


@pytest.mark.parametrize("code", ["import time; time.sleep(1000)", "import sys; sys.stdin.read()"])
def test_a_process_that_hangs_never_keeps_the_stream_waiting(code, stream, process, monkeypatch):
    monkeypatch.setattr(verdict_process, "start_process", lambda module: silent_process(code))
    process.look(stream)
    until(lambda: process._process)
    for _ in range(100):
        process.look(stream)
    assert process.error == "" and process._process.poll() is None
    monkeypatch.setattr(verdict_process, "LIMIT", 0.01)
    time.sleep(0.02)
    process.look(stream)
    until(lambda: process._given == inf)
    assert process.error == "its process did not answer within 0.01 s" and process._process is None


@pytest.mark.parametrize(
    "answer",
    ["", "no JSON", '{"error": "a fault"}', "3", '{"verdict": {}}', '{"verdict": {"word": "x"}}'],
)
def test_what_is_no_verdict_is_none(answer, stream, process, monkeypatch):
    code = f"import sys; print({answer!r}, flush=True); sys.stdin.read()"
    monkeypatch.setattr(verdict_process, "start_process", lambda module: silent_process(code))
    assert judged(process, stream) is None
    assert process.error and (process.error == "a fault") == ("fault" in answer)


def test_where_no_process_can_be_started_that_is_said(stream, process, monkeypatch):
    monkeypatch.setattr(verdict_process.sys, "executable", "/nowhere/python")
    assert judged(process, stream) is None
    assert process.error == "no process could be started"


def test_a_filter_that_no_other_process_knows_is_said(process):
    stream = fed(flight(), find("closed-loop")._replace(name="own"))
    process.look(stream)
    assert process.newest is None and process.error.startswith("DataError: filter 'own' is known")


def test_a_history_that_has_moved_is_not_judged(process):
    stream = fed(flight(), history=400)
    job = verdict_process._job(stream, time.monotonic())
    assert job.is_whole()
    process._stream, process._given = (lambda: stream), job.taken
    for event in events_of(flight(30.0)):
        if event.t > 20.0:
            stream.step(event)
    assert not job.is_whole()  # the older half was dropped
    process._serve(job)
    assert (process.newest, process.error) == (None, "")
    assert process._due == job.taken + verdict_process.AGAIN
    assert judged(process, stream).verdict == stream.verdict


def test_what_is_handed_over_stays_as_it_was():
    """Steps while the thread writes it."""
    stream = fed(flight())
    job = verdict_process._job(stream, time.monotonic())
    before = [bytes(part) for part in job.parts]
    for event in events_of(flight(30.0)):
        if event.t > 20.0:
            stream.step(event)
    assert job.is_whole() and [bytes(part) for part in job.parts] == before


def test_no_stream_is_kept_while_nobody_looks(process):
    stream = sd.Stream("closed-loop", imu="tactical")
    process.look(stream)
    kept = weakref.ref(stream)
    del stream
    gc.collect()
    assert kept() is None


def test_looking_does_not_wait_for_a_process_that_starts(stream, process, monkeypatch):
    starts, goes_on = threading.Event(), threading.Event()

    def start(module):
        starts.set()
        assert goes_on.wait(LATE)
        raise OSError

    monkeypatch.setattr(verdict_process, "start_process", start)
    process.look(stream)
    assert starts.wait(LATE) and process._lock.acquire(blocking=False)
    process._lock.release()
    goes_on.set()
    until(lambda: process._given == inf)


def test_the_last_byte_tells_whether_it_has_moved(stream, monkeypatch):
    written = []

    def start(module):
        code = "import sys; print(1, flush=True); sys.stdout.buffer.write(sys.stdin.buffer.read())"
        return silent_process(code)

    monkeypatch.setattr(verdict_process, "start_process", start)
    for moved in (False, True):
        process = VerdictProcess()
        job = verdict_process._job(stream, 0.0)._replace(is_whole=lambda moved=moved: not moved)
        assert process._ask(job) == 1
        process._process.stdin.close()
        written.append(process._process.stdout.read()[-1:])
        process._end()
    assert written == [WHOLE, TORN]


def test_a_verdict_on_an_earlier_stream_is_dropped(stream, process):
    newest = judged(process, stream)
    job = verdict_process._job(stream, time.monotonic())
    process.look(other := sd.Stream("closed-loop", imu="tactical"))
    assert newest is not None and process.newest is None
    process._serve(job)  # which was on its way
    assert process.newest is None and process._stream() is other and process._due == -inf


def test_closing_ends_process_and_thread_while_they_work(stream):
    process = VerdictProcess()
    process.look(stream)
    until(lambda: process._process)
    other = process._process
    process.close()
    process._thread.join(LATE)
    assert not process._thread.is_alive() and other.poll() is not None
    process.close()
    process._due = -inf
    process.look(stream)  # and afterwards nothing begins
    assert process._process is None


def test_without_work_the_process_ends(stream, process, monkeypatch):
    monkeypatch.setattr(verdict_process, "IDLE", 0.01)
    newest = judged(process, stream)
    until(lambda: process._process is None)
    assert newest is not None and process.error == ""


PROGRAM = """
import sys, time
sys.path[:0] = {path!r}
from test_verdict_process import fed, flight, judged, VerdictProcess
stream, process = fed(flight()), VerdictProcess(0.0)
if {finishes}:
    judged(process, stream)
else:
    process.look(stream)
while process._process is None:
    time.sleep(0.01)
print(process._process.pid, flush=True)
time.sleep(1000)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc is Linux")
@pytest.mark.parametrize("finishes", [False, True])
def test_kill_9_of_the_program_leaves_no_process(finishes, tmp_path):
    code = PROGRAM.format(path=sys.path, finishes=finishes)
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as program:
        other = int(program.stdout.readline())
        assert runs(other)
        os.kill(program.pid, signal.SIGKILL)
    until(lambda: not runs(other))


def runs(number):
    """True for a process that is there and no zombie."""
    try:
        with open(f"/proc/{number}/stat", encoding="ascii", errors="replace") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
