"""A Python process that works for this one: how it starts, and its pipe for answers."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

START = "import sys; sys.path[:] = {path!r}; from {module} import main; main()"


def start_process(module: str) -> "subprocess.Popen[bytes]":
    """Start the `main` of a module in a process of its own, with pipes from and to it. Raises
    OSError."""
    path = [each for each in sys.path if isinstance(each, str)]
    return subprocess.Popen(
        [sys.executable, "-c", START.format(path=path, module=module)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )


@contextmanager
def answers() -> Iterator[BinaryIO]:
    """The pipe to the process that started this one, which alone ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with os.fdopen(os.dup(1), "wb") as pipe:
        os.dup2(2, 1)  # what is printed meanwhile, as numba does when it is told to, is no answer
        yield pipe
