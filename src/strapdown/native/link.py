"""From objects to a shared library, by the linker of a C compiler; and where that library runs."""

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from ..checks import DataError
from . import object_files

OF_C = ("libc.so.6", "libm.so.6")
"""What a library for every Linux may need: the C library of GNU."""
OLDEST = 17
"""manylinux_2_17, also known as manylinux2014, is the oldest tag that package indexes take of both
x86-64 and aarch64."""


class Platform(NamedTuple):
    """Where a library runs."""

    tag: str  # of a wheel
    needs: str


def linker() -> list[str]:
    """The command that links: $CC, cc, gcc, clang or zig. Raises DataError where there is none."""
    if said := shlex.split(os.environ.get("CC", "")):
        return said if shutil.which(said[0]) else _none(f"$CC, {said[0]}, is not found")
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if shutil.which("zig"):
        return ["zig", "cc"]
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    return _none("none of cc, gcc, clang and zig is found")


def _none(what: str) -> list[str]:
    raise DataError(
        f"no linker: {what}; install a C compiler, or `pip install ziglang`, or name one "
        f"by CC=COMMAND"
    )


def link(objects: Iterable[Path], library: Path) -> bytes:
    """Link objects into a shared library that needs C's libraries alone; its bytes. Raises DataError
    with what the linker said."""
    options = ["-shared", "-nostartfiles", "-s", "-Wl,-z,defs"]
    command = [*linker(), *options, "-o", str(library), *map(str, objects), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode or not library.exists():
        said = done.stderr.strip().splitlines()
        why = next((line for line in said if "error" in line or "undefined" in line), "")
        why = why or (said[-1] if said else f"it ended with {done.returncode}")
        raise DataError(f"{command[0]} links no library of kernels: {why}")
    return library.read_bytes()


def platform_of(libraries: Iterable[bytes], machine: str) -> Platform:
    """Where all of these shared libraries run, machine as `platform.machine` calls it."""
    needed: set[str] = set()
    versions: set[str] = set()
    for content in libraries:
        needed |= set(object_files.libraries(content))
        for each in object_files.versions(content).values():
            versions |= set(each)
    if other := sorted(needed - set(OF_C)):
        return Platform(
            f"linux_{machine}",
            f"{', '.join(other)}, which is not on every Linux: indexes refuse it",
        )
    numbers = [re.fullmatch(r"GLIBC_2\.(\d+)(?:\.\d+)?", each) for each in versions]
    if unknown := sorted(versions - {found[0] for found in numbers if found}):
        return Platform(
            f"linux_{machine}", f"{', '.join(unknown)} of the C library: indexes refuse it"
        )
    newest = max([OLDEST, *(int(found[1]) for found in numbers if found)])
    return Platform(
        f"manylinux_2_{newest}_{machine}",
        f"glibc 2.{newest} or newer, of which it asks for {', '.join(sorted(needed)) or 'nothing'}",
    )
