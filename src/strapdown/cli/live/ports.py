"""Places where bytes come from, none of which ever waits: UDP, TCP, serial lines, files that grow,
standard input. One that vanishes is opened again each second."""

import os
import select
import socket
import sys
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from math import log
from pathlib import Path
from typing import BinaryIO, NamedTuple

from ...checks import DataError, check_number, locate_errors
from ...fileio.file_access import open_file

RETRY = 1.0
"""s between two attempts to open a port."""
PIECE = 1 << 16
"""Bytes that are read at a time, at most."""
MAX_DATAGRAMS = 256
"""Datagrams that are read at a time, at most; the system drops those that its buffer cannot hold."""
BUFFER = 1 << 22
"""Bytes of datagrams that the system is asked to keep."""
SO_MEMINFO, DROPS = 55, 8
"""Option of Linux (asm-generic/socket.h), and the place of dropped datagrams in it, of 4 bytes each
(linux/sock_diag.h)."""
TAIL = 4096
"""Bytes by which a file is known to be the one of before."""
KINDS = ("udp", "tcp", "serial", "file", "-")


class Address(NamedTuple):
    """The text of a port, such as `udp:127.0.0.1:7001`, taken apart."""

    kind: str  # one of KINDS
    place: str  # host, device or path
    number: int  # port, or bits per second

    def __str__(self) -> str:
        more = f":{self.number}" if self.number else ""
        return self.kind if self.kind == "-" else f"{self.kind}:{self.place}{more}"


def address_of(text: object, where: str) -> Address:
    """Return the Address of a text. Raises DataError, which begins with `where`."""
    kind, _, rest = str(text).partition(":")
    forms = "udp:HOST:PORT, tcp:HOST:PORT, serial:DEVICE:BAUD, file:PATH or -"
    fits = isinstance(text, str) and kind in KINDS and bool(rest) != (kind == "-")
    if not fits or not _is_name(rest, kind):
        raise DataError(f"{where}: port is {text!r}; it must be {forms}")
    if kind in ("file", "-"):
        return Address(kind, rest, 0)
    place, _, number = rest.rpartition(":")
    if not number.isdecimal() or not (place or kind == "udp"):
        raise DataError(f"{where}: port is {text!r}; it must be {forms}")
    most = 65535 if kind != "serial" else 10_000_000
    what = f"{where}: port {text!r}: its number"
    check_number(int(number), what, least=1, most=most, whole=True)
    if kind == "serial":
        with locate_errors(f"{where}: port {text!r}"):
            check_rate(int(number))
    return Address(kind, place or "127.0.0.1", int(number))


def _is_name(text: str, kind: str) -> bool:
    """Return True where the system can take a text as the name of a file or host."""
    try:
        text.encode("idna" if kind in ("udp", "tcp") else "utf-8")
    except UnicodeError:
        return False
    return "\0" not in text


class Mark(NamedTuple):
    """A place in a file, and what stands before it."""

    size: int  # bytes before it
    unused: int  # of these, the last ones that are to be read again
    checksum: int  # of the last TAIL bytes before it


def _mark(file: BinaryIO, size: int, unused: int) -> Mark:
    """Return the mark after so many bytes of a file."""
    file.seek(max(size - TAIL, 0))
    return Mark(size, unused, zlib.crc32(file.read(min(size, TAIL))))


class Port:
    """An address to read from. `error` says why it cannot be read now; `lost` counts how often it
    went. `senders` has those of the datagrams that were read last."""

    def __init__(self, address: Address) -> None:
        self.address = address
        self.error = ""
        self.lost = 0
        self._missed: Callable[[], int] = lambda: 0
        self.senders: list[object] = []
        # where the file was left before a restart, and what to call where it is still the same
        self._left: tuple[Mark, Callable[[], None]] | None = None
        self._at = 0
        self.ended = False  # nothing more will come
        self._tried = -RETRY
        self.number: int | None = None  # descriptor on which to wait for bytes
        self._close: Callable[[], None] = lambda: None
        self._read: Callable[[], list[bytes]] | None = None

    def read(self) -> list[bytes]:
        """Return the pieces that are there now; one for each datagram of UDP."""
        if self.ended or not self._is_open():
            return []
        assert self._read is not None  # it is open
        try:
            return self._read()
        except BlockingIOError:
            return []
        except OSError as error:
            self._lose(error.strerror or str(error))
            return []

    def _is_open(self) -> bool:
        if self._read is None and time.monotonic() >= self._tried + RETRY:
            self._tried = time.monotonic()
            try:
                self._open()
                self.error = ""
            except (OSError, DataError) as error:
                self.error = getattr(error, "strerror", None) or str(error)
        return self._read is not None

    def _lose(self, why: str) -> None:
        self.close()
        self.error, self._read, self._tried = why, None, time.monotonic()
        self.lost += 1

    @property
    def missed(self) -> int:
        """Number of datagrams that the system dropped, because nobody read them in time."""
        return self._missed()

    def mark(self, unused: int) -> "Mark | None":
        """Return how far its file was read, and how many of the last bytes were not used; None of other
        ports and where the file is gone."""
        with suppress(OSError, DataError):
            if self.address.kind == "file" and self._at:
                with open_file(self.address.place) as file:
                    return _mark(file, self._at, unused)
        return None

    def resume(self, left: "Mark", then: Callable[[], None]) -> None:
        """Go on where the file was left, and call `then`, if it is still the same; else at its
        beginning."""
        self._left = left, then

    def close(self) -> None:
        """Close it."""
        missed = self.missed
        with suppress(OSError):
            self._close()
        self._close, self.number, self._missed = lambda: None, None, lambda: missed

    def _open(self) -> None:
        kind = self.address.kind
        if kind == "udp":
            self._open_udp()
        elif kind == "tcp":
            self._open_tcp()
        elif kind == "file":
            self._open_file()
        elif kind == "serial":
            self._open_descriptor(serial_line(self.address))
        elif sys.stdin is None:
            raise OSError("it is closed")
        else:
            self._open_descriptor(sys.stdin.fileno())

    def _open_udp(self) -> None:
        udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        udp.setblocking(False)
        self._close = udp.close
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        udp.bind((self.address.place, self.address.number))
        self.number, before = udp.fileno(), self.missed
        self._missed = lambda: before + _missed_by(udp)

        def read() -> list[bytes]:
            found: list[bytes] = []
            self.senders = []
            with suppress(BlockingIOError):
                while len(found) < MAX_DATAGRAMS:
                    piece, sender = udp.recvfrom(PIECE)
                    found.append(piece)
                    self.senders.append(sender)
            return found

        self._read = read

    def _open_tcp(self) -> None:
        tcp = tcp_socket(self.address)
        self._close, self.number = tcp.close, tcp.fileno()

        def read() -> list[bytes]:
            piece = tcp.recv(PIECE)
            if not piece:
                raise OSError("the other side closed the connection")
            return [piece]

        self._read = read

    def _open_file(self) -> None:
        path = Path(self.address.place)
        if path.exists() and not path.is_file():
            raise OSError("it is no regular file")
        if not path.stat().st_size:
            raise OSError("it is still empty")
        file: BinaryIO = open_file(path)
        self._close, known = file.close, path.stat().st_ino
        left, self._left, self._at = self._left, None, 0
        if left is not None and _mark(file, left[0].size, left[0].unused) == left[0]:
            self._at = left[0].size - left[0].unused
            left[1]()
        file.seek(self._at)

        def read() -> list[bytes]:
            piece = file.read(PIECE)
            self._at += len(piece)
            if not piece:
                now = path.stat()
                if now.st_ino != known or now.st_size < file.tell():
                    raise OSError("another file took its place")
            return [piece] if piece else []

        self._read = read

    def _open_descriptor(self, number: int) -> None:
        is_standard, self.number = self.address.kind == "-", number
        self._close = (lambda: None) if is_standard else (lambda: os.close(number))

        def read() -> list[bytes]:
            if not select.select([number], [], [], 0.0)[0]:
                return []
            piece = os.read(number, PIECE)
            if not piece and is_standard:
                self.ended, self.number = True, None  # or waiting for bytes would never wait
            elif not piece:
                raise OSError("the device is gone")
            return [piece] if piece else []

        self._read = read


def _missed_by(udp: socket.socket) -> int:
    """Return the number of datagrams that the system has dropped; only Linux tells it."""
    if sys.platform != "linux":
        return 0
    found = udp.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 4 * (DROPS + 1))
    return int.from_bytes(found[4 * DROPS :], sys.byteorder)


def tcp_socket(address: Address) -> socket.socket:
    """Return a socket that connects meanwhile; until then reading and writing raise
    BlockingIOError. Raises OSError."""
    tcp = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    tcp.setblocking(False)
    with suppress(BlockingIOError):
        tcp.connect((address.place, address.number))
    return tcp


def check_rate(number: int) -> int | None:
    """Return the system's number of a rate of serial lines in bit/s; None where it has no such lines.
    Raises DataError for a rate that it does not have."""
    if sys.platform == "win32":
        return None
    else:
        import termios

        known = {
            int(name[1:]): value
            for name, value in vars(termios).items()
            if name[0] == "B" and name[1:].isdecimal() and name != "B0"
        }
        if number not in known:
            near = sorted(sorted(known, key=lambda rate: abs(log(rate / number)))[:3])
            raise DataError(
                f"{number} bit/s is no rate of this system; the nearest are "
                f"{', '.join(map(str, near))}"
            )
        return known[number]


def serial_line(address: Address) -> int:
    """Return the descriptor of a serial line that passes bytes on as they are. Raises OSError."""
    if sys.platform == "win32":
        raise OSError("serial lines are read on POSIX systems alone; send them by UDP or TCP")
    else:
        import termios
        import tty

        speed = check_rate(address.number)
        line = os.open(address.place, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(line)
            settings = termios.tcgetattr(line)
            settings[4] = settings[5] = speed
            termios.tcsetattr(line, termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            os.close(line)
            raise OSError(f"is no serial line ({error.args[-1]})") from None
        return line
