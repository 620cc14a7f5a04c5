"""A test that would wait without end fails instead."""

import signal
from contextlib import contextmanager

import pytest


@contextmanager
def at_most(seconds):
    """The block fails where it stands after so many seconds; on Windows, which has no such timer,
    it does not."""

    def stop(*_):
        pytest.fail(f"takes more than {seconds} s")

    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
