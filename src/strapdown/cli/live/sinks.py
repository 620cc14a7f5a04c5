"""Places where states go to, none of which ever waits: those of `ports`. What cannot be written is
dropped and counted, and half a message never stays."""

import os
import select
import socket
import stat
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from .ports import RETRY, Address, serial_line, tcp_socket

ATOMIC = 512
"""Bytes that a pipe takes without waiting, once it takes any: the least of POSIX."""
MAX_QUEUE = 100
"""Messages that wait until a reader takes them, at most."""
LAST_WAIT = 1.0
"""s that they may take at the end, at most."""


class Sink:
    """An address to write to. `error` says why it cannot be written now, `dropped` counts the
    messages that were lost."""

    def __init__(self, address: Address) -> None:
        self.address, self.dropped, self.error = address, 0, ""
        self._tried = -RETRY
        self._queue: deque[bytes] = deque()  # of the first one, what is still to be written
        self._write: Callable[[bytes], int] | None = None
        self._close: Callable[[], None] = lambda: None

    def write(self, data: bytes) -> None:
        """Write what makes one message."""
        if self._write is None and time.monotonic() >= self._tried + RETRY:
            self._tried = time.monotonic()
            try:
                self._open()
                self.error = ""
            except OSError as error:
                self.error = error.strerror or str(error)
        if self._write is None:
            self.dropped += 1
        elif len(self._queue) == MAX_QUEUE:
            self.error, self.dropped = "its reader is too slow", self.dropped + 1
            self._send(self._write)
        else:
            self._queue.append(data)
            self._send(self._write)

    def _send(self, write: Callable[[bytes], int]) -> None:
        """Write what waits, as far as it is taken."""
        try:
            while self._queue:
                data = self._queue[0]
                self._queue[0] = data = data[write(data) :]
                if data:
                    return
                self._queue.popleft()
            self.error = ""
        except BlockingIOError:
            pass
        except OSError as error:
            self._lose(error.strerror or str(error))

    def _lose(self, why: str) -> None:
        self.dropped, self.error = self.dropped + len(self._queue), why
        self._queue.clear()
        if self.address.kind != "udp":  # where nobody may listen yet
            self._shut()
            self._write, self._tried = None, time.monotonic()

    def close(self) -> None:
        """Write what waits, and close it."""
        end = time.monotonic() + LAST_WAIT
        while self._queue and self._write is not None and time.monotonic() < end:
            self._send(self._write)
            time.sleep(0.001)
        self.dropped += len(self._queue)
        self._queue.clear()
        self._shut()
        self._write = None

    def _shut(self) -> None:
        with suppress(OSError):
            self._close()
        self._close = lambda: None

    def _open(self) -> None:
        kind, place, number = self.address
        if kind == "-":
            self._write = _standard_output()
        elif kind == "udp":
            udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            udp.setblocking(False)
            self._close, self._write = udp.close, lambda data: udp.sendto(data, (place, number))
        elif kind == "tcp":
            tcp = tcp_socket(self.address)
            self._close, self._write = tcp.close, tcp.send
        elif kind == "serial":
            line = serial_line(self.address)
            self._close, self._write = lambda: os.close(line), lambda data: os.write(line, data)
        else:
            self._open_file(Path(place))

    def _open_file(self, path: Path) -> None:
        # a pipe that nobody reads is no file to wait for
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NONBLOCK", 0)
        file = os.open(path, flags | getattr(os, "O_BINARY", 0), 0o666)
        self._close = lambda: os.close(file)
        if stat.S_ISREG(os.fstat(file).st_mode):
            self._write = lambda data: _write_whole(file, data)
            _end_line(path, file)
        else:
            self._write = lambda data: os.write(file, data)


def _write_whole(file: int, data: bytes) -> int:
    """Append to a file, whole or not at all: of a full disk it may take a part. Raises OSError."""
    done = os.write(file, data)
    try:
        while done < len(data):  # the next call says why it takes no more
            done += os.write(file, data[done:])
    except OSError:
        os.ftruncate(file, os.fstat(file).st_size - done)
        raise
    return done


def _end_line(path: Path, file: int) -> None:
    """End the last line of a file where a program that was killed left half of one."""
    with path.open("rb") as written:
        size = written.seek(0, os.SEEK_END)
        written.seek(max(size - 1, 0))
        if size and written.read(1) != b"\n":
            os.write(file, b"\n")


def _standard_output() -> Callable[[bytes], int]:
    """Return what writes to standard output as much as it takes at once. Raises OSError where it is
    closed."""
    if sys.stdout is None:
        raise OSError("it is closed")
    try:
        sys.stdout.flush()
        number = sys.stdout.fileno()
    except OSError:  # it is no file, as in a notebook
        return _to_text
    if sys.platform == "win32":  # whose pipes do not say what they take
        return lambda data: os.write(number, data)

    def write(data: bytes) -> int:
        done = 0
        while done < len(data) and select.select([], [number], [], 0.0)[1]:
            done += os.write(number, data[done : done + ATOMIC])
        return done

    return write


def _to_text(data: bytes) -> int:
    sys.stdout.write(data.decode())
    return len(data)
