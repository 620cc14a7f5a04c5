"""Verdicts on a stream that goes on, made by another process: the stream loses about a millisecond to
hand its history over, and a thread writes it to that process while the stream goes on."""

import json
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Any, BinaryIO, NamedTuple

from ..core.compile.other_process import answers, start_process
from ..data.verdict import Verdict
from ..plugins import one_line
from .live_run import solution_of
from .stream import Stream

EVERY = 30.0
"""s between two verdicts, at least."""
SHARE = 0.02
"""Share of a core that verdicts may take; the next one waits accordingly."""
AGAIN = 1.0
"""s after which the history is handed over again where the stream dropped its older half meanwhile."""
AFTER_FAILURE = 120.0
"""s after a failure until it tries again."""
LIMIT = 300.0
"""s after which a process that does not answer is ended."""
IDLE = 300.0
"""s without work after which the process is ended, which frees the memory of its modules."""
NICE = 10
"""Steps by which its priority is lower, on POSIX."""
WHOLE, TORN = b"w", b"t"
"""Last byte of a history: the stream has not moved it meanwhile, or has."""


class SpanVerdict(NamedTuple):
    """A verdict on a part of a running filter's results.

    Attributes
    ----------
    verdict : Verdict
        The word, reasons and limits.
    start : float
        Time of the first sample that was judged, s.
    stop : float
        Time of the last one, s.
    taken : float
        Time of `time.monotonic` when these samples were taken, s.
    seconds : float
        Time of a processor that it took, s; the first one with the start of the process.
    """

    verdict: Verdict
    start: float
    stop: float
    taken: float
    seconds: float

    @property
    def age(self) -> float:
        """s since these samples were taken."""
        return time.monotonic() - self.taken

    @property
    def span(self) -> str:
        """The time of these samples, and how old they are, as text."""
        return f"{self.start:.1f} to {self.stop:.1f} s, {self.age:.0f} s ago"


class _Job(NamedTuple):
    """A history for the other process."""

    parts: list[Any]  # pickled, and its arrays, which are views
    is_whole: Callable[[], bool]
    stream: Stream
    start: float
    stop: float
    taken: float


class VerdictProcess:
    """Judges the history of a stream again and again, in a process of its own.

    Attributes
    ----------
    newest : SpanVerdict or None
        None before there is one of this stream.
    error : str
        Why the last attempt failed; empty where it did not.
    """

    def __init__(self, every: float = EVERY) -> None:
        self.newest: SpanVerdict | None = None
        self.error = ""
        self._every, self._due, self._given = every, -inf, inf
        # it keeps no stream alive while nobody looks
        self._stream: Callable[[], Stream | None] = lambda: None
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._lock, self._closed = threading.Lock(), False
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen[bytes] | None = None

    # ---- the thread of the stream

    def look(self, stream: Stream) -> None:
        """Hand the history of a stream over where a verdict is due. It never waits and never raises."""
        now = time.monotonic()
        if stream is not self._stream():
            with self._lock:
                self._stream, self.newest, self._due = weakref.ref(stream), None, -inf
        if self._given < inf:
            if now > self._given + LIMIT:
                self._kill()
        elif now >= self._due and not self._closed:
            try:
                job = _job(stream, now)
            except Exception as error:  # such as a filter that no other process knows
                self.error, self._due = one_line(error), now + AFTER_FAILURE
                return
            if job is not None:
                self._give(job)

    def _give(self, job: _Job) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, daemon=True)
            self._thread.start()
        self._given = job.taken
        self._jobs.put(job)

    def _kill(self) -> None:
        with self._lock:
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        """End the process. A second call does nothing."""
        with self._lock:
            self._closed = True
        self._kill()
        self._jobs.put(None)
        if self._thread is not None:
            self._thread.join(1.0)

    # ---- the thread that waits for the other process

    def _work(self) -> None:
        while not self._closed:
            try:
                job = self._jobs.get(timeout=IDLE)
            except queue.Empty:
                self._end()
                continue
            if job is not None:
                self._serve(job)
                del job  # and so the arrays
        self._end()

    def _serve(self, job: _Job) -> None:
        """Have a history judged, and keep the verdict or why there is none."""
        wait, found, failure = AFTER_FAILURE, None, ""
        try:
            answer = self._ask(job)
            failure = answer.get("error", "")
            if "torn" in answer:
                wait = AGAIN
            elif "verdict" in answer:
                verdict, seconds = Verdict.from_dict(answer["verdict"]), float(answer["seconds"])
                wait = max(self._every, seconds / SHARE)
                found = SpanVerdict(verdict, job.start, job.stop, job.taken, seconds)
        except (OSError, ValueError):  # ValueError: no whole line
            failure = self._end()
        except Exception as error:  # what is no verdict
            self._end()
            failure = one_line(error)
        with self._lock:
            if job.stream is self._stream():  # no other one has begun meanwhile
                self.newest, self._due = found or self.newest, job.taken + wait
            self.error, self._given = failure, inf

    def _ask(self, job: _Job) -> dict[str, Any]:
        """Return what the other process answers. Raises OSError and ValueError where it cannot be started
        or has ended."""
        process = self._process or start_process(__name__)  # without the lock: that takes long
        with self._lock:
            self._process, is_closed = process, self._closed
        if is_closed:
            raise OSError("closed")
        assert process.stdin and process.stdout
        pickle.dump([len(part) for part in job.parts], process.stdin)
        for part in job.parts:
            process.stdin.write(part)
        process.stdin.write(WHOLE if job.is_whole() else TORN)
        process.stdin.flush()
        answer: dict[str, Any] = json.loads(process.stdout.readline())
        return answer

    def _end(self) -> str:
        """End the process, and say how it ended."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return "no process could be started"
        late = self._given + LIMIT < time.monotonic()
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):  # what could not be written to the dead
                assert pipe
                pipe.close()
        if late:
            return f"its process did not answer within {LIMIT:g} s"
        return f"its process has ended, exit code {process.returncode}"


def _job(stream: Stream, now: float) -> _Job | None:
    """Return the history of a stream with its arrays as views; None before the first sample is used."""
    history = stream.history()
    if history is None:
        return None
    run, every, is_whole = history
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps((run, every), protocol=5, buffer_callback=arrays.append)
    parts = [head, *(array.raw() for array in arrays)]
    return _Job(parts, is_whole, stream, run.start.t, float(run.samples.t[-1]), now)


# ---- the other process


def main() -> None:
    """Run the other process: judge the histories that arrive on stdin, and answer each with a line of
    JSON."""
    if sys.platform != "win32":
        os.nice(NICE)
    before = 0.0
    with answers() as pipe, suppress(EOFError, BrokenPipeError):
        while True:
            answer = _answer(sys.stdin.buffer)
            now = time.process_time()
            pipe.write(json.dumps({**answer, "seconds": now - before}).encode() + b"\n")
            pipe.flush()
            before = now


def _answer(pipe: BinaryIO) -> dict[str, Any]:
    """Return the verdict on the next history, or why there is none. Raises EOFError at the end."""
    head, *arrays = [pipe.read(size) for size in pickle.load(pipe)]
    if pipe.read(1) != WHOLE:
        return {"torn": True}
    try:
        run, every = pickle.loads(head, buffers=arrays)
        return {"verdict": solution_of(run, every).verdict.as_dict()}
    except Exception as error:
        return {"error": one_line(error)}
