"""Work that is killed again and again, at random times."""

import os
import random
import signal
import time


def killed(work, times, longest, seed, begun=None):
    """Run `work` in a forked child `times` times, and kill each child up to `longest` seconds after
    it began, or after `begun()` was true; yields after each. What the caller loaded and compiled is
    there in the child at once."""
    rng = random.Random(seed)
    for _ in range(times):
        child = os.fork()
        if child == 0:
            try:
                silence = os.open(os.devnull, os.O_WRONLY)
                os.dup2(silence, 1)
                os.dup2(silence, 2)
                work()
            finally:
                os._exit(0)
        deadline = time.monotonic() + 60
        while begun and not begun() and time.monotonic() < deadline and _runs(child):
            time.sleep(0.001)
        time.sleep(rng.uniform(0, longest))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        yield


def _runs(child):
    """Whether it does; one that ended waits to be asked."""
    return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
