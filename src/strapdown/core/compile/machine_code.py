"""Machine code from a file in memory, ready to be called; without LLVM and without a linker.

A file has code that runs at any address, then an index in JSON, then the length of the code in 8
bytes. In front of the code in memory stands a table of the addresses of the functions of the C library
that it calls. The table can be written and not run, the code can be run and not written.

On Linux the code is mapped from its file, as a shared library is: also where memory that was written may
never be run (SELinux, `MemoryDenyWriteExecute` of systemd). macOS and Windows take a copy that is then
made executable, as LLVM does it there; neither was run.
"""

import ctypes
import json
import os
import struct
import sys
from pathlib import Path
from typing import Any, NamedTuple

TABLE = 1 << 16
"""Bytes in front of the code: a whole number of pages on every system."""
READ, WRITE, RUN = 1, 2, 4
"""Flags of mmap and mprotect."""
PRIVATE, FIXED, ANONYMOUS = 0x02, 0x10, 0x1000 if sys.platform == "darwin" else 0x20
COMMIT, WINDOWS_READ_WRITE, WINDOWS_READ_RUN = 0x3000, 0x04, 0x20
"""Flags of VirtualAlloc and VirtualProtect."""


class Index(NamedTuple):
    """The index of a file of machine code."""

    needed: tuple[str, ...]  # functions of the C library, in the order of the table
    kernels: dict[str, int]  # where each begins in the code, by symbol


def file_content(code: bytes, index: Index) -> bytes:
    """The content of a file."""
    return code + json.dumps(index).encode() + struct.pack("<Q", len(code))


def load(file: Path, content: bytes) -> dict[str, int]:
    """Address of each kernel of a file with this content, which was checked. Raises OSError where the
    system refuses, or its C library lacks a function."""
    (length,) = struct.unpack_from("<Q", content, len(content) - 8)
    index = Index(*json.loads(content[length:-8]))
    table = b"".join(struct.pack("<Q", _of_c(name)) for name in index.needed)
    place = {"darwin": _copy_code, "win32": _windows}.get(sys.platform, _map_code)
    first = place(file, content[:length], table) + TABLE
    return {symbol: first + offset for symbol, offset in index.kernels.items()}


def _of_c(name: str) -> int:
    """Address of a function of the C library."""
    try:
        if sys.platform == "win32":
            library = ctypes.CDLL("ntdll" if name == "__chkstk" else "ucrtbase")
        else:
            library = ctypes.CDLL(None)
        return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0
    except AttributeError:
        raise OSError(f"the C library has no {name}") from None


def _map_code(file: Path, code: bytes, table: bytes) -> int:
    """Address of a table with the code of a file mapped behind it."""
    c = _posix()
    with open(file, "rb") as opened:
        both = TABLE + len(code)
        first = _check_mmap(c.mmap(None, both, READ | WRITE, PRIVATE | ANONYMOUS, -1, 0))
        ctypes.memmove(first, table, len(table))
        of_file = PRIVATE | FIXED
        _check_mmap(c.mmap(first + TABLE, len(code), READ | RUN, of_file, opened.fileno(), 0))
    return first


def _copy_code(file: Path, code: bytes, table: bytes) -> int:
    """Address of a table with a copy of the code behind it, on macOS."""
    c, both = _posix(), table.ljust(TABLE, b"\0") + code
    first = _check_mmap(c.mmap(None, len(both), READ | WRITE, PRIVATE | ANONYMOUS, -1, 0))
    ctypes.memmove(first, both, len(both))
    if c.mprotect(first + TABLE, len(code), READ | RUN):
        _check_mmap(-1)
    if sys.platform == "darwin":
        c.sys_icache_invalidate(ctypes.c_void_p(first + TABLE), ctypes.c_size_t(len(code)))
    return first


def _windows(file: Path, code: bytes, table: bytes) -> int:
    """As `_copy_code`, on Windows."""
    if sys.platform != "win32":
        raise OSError("this is not Windows")
    both, before = table.ljust(TABLE, b"\0") + code, ctypes.c_uint32()
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    size, number, pointer = ctypes.c_size_t, ctypes.c_uint32, ctypes.c_void_p
    kernel.VirtualAlloc.restype = pointer
    kernel.VirtualAlloc.argtypes = (pointer, size, number, number)
    kernel.VirtualProtect.argtypes = (pointer, size, number, pointer)
    first = kernel.VirtualAlloc(None, len(both), COMMIT, WINDOWS_READ_WRITE)
    if not first:
        raise ctypes.WinError(ctypes.get_last_error())
    ctypes.memmove(first, both, len(both))
    place, run = first + TABLE, WINDOWS_READ_RUN
    if not kernel.VirtualProtect(place, len(code), run, ctypes.byref(before)):
        raise ctypes.WinError(ctypes.get_last_error())
    return int(first)


def _posix() -> Any:
    """The C library, with what is called of it."""
    c = ctypes.CDLL(None, use_errno=True)
    size, number, pointer = ctypes.c_size_t, ctypes.c_int, ctypes.c_void_p
    c.mmap.restype, c.mmap.argtypes = (
        pointer,
        (pointer, size, number, number, number, ctypes.c_long),
    )
    c.mprotect.argtypes = (pointer, size, number)
    return c


def _check_mmap(address: int | None) -> int:
    """The address that mmap gave, where it is no failure."""
    if address is None or address in (-1, ctypes.c_void_p(-1).value):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return address
