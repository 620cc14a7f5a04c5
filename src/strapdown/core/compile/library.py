"""The library of compiled kernels that a wheel brings along: found by name, checked, called by
address. Imports neither numba nor LLVM.

A kernel of it is used where the library is of this ABI, whole and made for this processor, and where
the files that the kernel's code comes from and the values that it closes over are those that it was
made from. Otherwise the kernel is compiled on use.
"""

import hashlib
import json
import os
import platform
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from ...checks import DataError
from . import machine_code
from .closure_values import NoWords, digest, functions
from .signatures import ABI

PACKAGE = Path(__file__).parents[2]
OWN = PACKAGE / "lib"
"""Where a wheel has it."""
SETTING = "STRAPDOWN_LIBRARY"
"""0: no library is used. The name of a folder: the library there. Where the package is built, 1 asks
for one to be made."""
REQUIRED = "STRAPDOWN_REQUIRE_LIBRARY"
"""1: a kernel of the package that is not in the library is an error, and is not compiled."""
CONTRACTION = "STRAPDOWN_CONTRACTION"
"""1: multiplications and additions are contracted, which makes the loop a fifth faster and lets the
last bits depend on the processor and on what is inlined. The library is not made so."""
MANIFEST = "kernels.json"
LEVELS: dict[str, dict[str, str]] = {
    "linux x86_64": {
        "x86-64-v3": "avx2 bmi1 bmi2 f16c fma abm movbe",
        "x86-64-v2": "sse4_2 ssse3 popcnt cx16 lahf_lm",
    },
    "linux aarch64": {"aarch64": ""},
    "darwin arm64": {"macos-arm64": ""},
    "darwin x86_64": {"macos-x86-64": ""},
    "win32 AMD64": {"windows-x86-64": ""},
}
"""By system and machine: levels of processors, best first, and what Linux calls what they need. Those of
macOS and Windows are built, and were never run."""


class Library(NamedTuple):
    """One that was opened."""

    path: Path
    level: str
    made_with: str
    kernels: dict[str, tuple[str, ...]]  # files that its code comes from, by symbol
    values: dict[str, str]  # digest of what it closes over, by symbol
    files: dict[str, str]  # digest, by path below the package
    addresses: dict[str, int]  # of its kernels, by symbol


def is_contraction_set() -> bool:
    """Return True where the environment sets CONTRACTION."""
    return _is_set(CONTRACTION)


def find(kernel: Any) -> int | None:
    """Address of a kernel in the library, or None where it is to be compiled. Raises DataError
    where the library is REQUIRED."""
    why = why_not(kernel)
    if not why:
        return load_library().addresses[kernel.symbol]  # type: ignore[union-attr]
    if _is_set(REQUIRED) and kernel.__module__.startswith("strapdown."):
        raise DataError(
            f"the kernel {kernel.stem} would have to be compiled, which {REQUIRED} forbids: {why}"
        )
    return None


def why_not(kernel: Any) -> str:
    """Why the library is not used for a kernel; empty where it is."""
    library = load_library()
    if isinstance(library, str):
        return library
    if not kernel.__module__.startswith("strapdown.") or kernel.symbol not in library.kernels:
        return f"{kernel.stem} is not in the library of kernels"
    edited = next((file for file in library.kernels[kernel.symbol] if _is_edited(file)), None)
    if edited:
        return f"{edited} is another than the library of kernels was made from"
    if values_of(kernel) != library.values[kernel.symbol]:
        return f"{kernel.stem} closes over other values than the library of kernels was made from"
    return ""


def values_of(kernel: Any) -> str:
    """Digest of the values that a kernel of unedited files closes over, the same under every version
    of Python; empty where they cannot be told."""
    try:
        return digest(functions(kernel), lambda code: (code.co_name, code.co_firstlineno))
    except NoWords:
        return ""


def there() -> bool:
    """Return True where this installation has a library, usable or not, or the environment names
    one."""
    folder = _folder()
    return folder != OWN or os.path.exists(folder / MANIFEST)


def _folder() -> Path:
    said = os.environ.get(SETTING, "").strip()
    return Path(said) if said not in ("", "0", "1") else OWN


_NO_MANIFEST = (
    *(OSError, ValueError, RecursionError),  # what cannot be read, or is no JSON
    *(KeyError, TypeError, IndexError, AttributeError),  # what says something else
)


@cache
def load_library() -> Library | str:
    """The library of this installation, or why there is none."""
    if os.environ.get(SETTING, "").strip() == "0":
        return f"{SETTING} is 0"
    if is_contraction_set():
        return f"{CONTRACTION} is set, and the library of kernels is made without contraction"
    folder = _folder()
    manifest = folder / MANIFEST
    try:
        return _open_library(folder, json.loads(manifest.read_bytes()))
    except (FileNotFoundError, NotADirectoryError):
        return f"{folder} has no library of kernels"
    except _NO_MANIFEST as error:
        why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        return f"{manifest} is not that of a library of kernels ({why}): install strapdown again"


def _open_library(folder: Path, made: dict[str, Any]) -> Library | str:
    if made["abi"] != ABI:
        return (
            f"the library of kernels in {folder} is called by other rules (ABI {made['abi']}, this "
            f"strapdown has {ABI}): install strapdown again"
        )
    level = next((each for each in levels() if each in made["libraries"]), None)
    if level is None:
        return (
            f"the library of kernels in {folder} is for {', '.join(made['libraries'])}; this "
            f"processor is {', '.join(levels()) or platform.machine()}"
        )
    file = folder / made["libraries"][level]["file"]
    try:
        content = file.read_bytes()
    except OSError:
        return f"{file} is not there or cannot be read: install strapdown again"
    if hashlib.sha256(content).hexdigest() != made["libraries"][level]["sha256"]:
        return f"{file} is not whole or not the one that was made: install strapdown again"
    files = list(made["files"])
    kernels = {
        symbol: tuple(files[number] for number in numbers)
        for symbol, numbers in made["kernels"].items()
    }
    values = {symbol: str(made["values"][symbol]) for symbol in kernels}
    try:
        addresses = machine_code.load(file, content)
    except (OSError, ValueError, TypeError, struct.error) as error:
        return f"{file} cannot be loaded ({error}): install strapdown again"
    if missing := kernels.keys() - addresses.keys():
        return f"{file} cannot be loaded (it lacks {min(missing)}): install strapdown again"
    return Library(file, level, made["built_with"], kernels, values, made["files"], addresses)


def system() -> str:
    """This machine, as LEVELS calls it."""
    return f"{sys.platform} {platform.machine()}"


@cache
def levels() -> tuple[str, ...]:
    """Levels of this processor, best first; none where they are not known."""
    if sys.maxsize > 2**32:
        flags = set(_of_processor("flags").split())
        levels = LEVELS.get(system(), {})
        return tuple(level for level, needed in levels.items() if set(needed.split()) <= flags)
    return ()


@cache
def processor() -> str:
    """Return the model and the level of this machine's processor."""
    model = _of_processor("model name") or platform.processor() or platform.machine()
    return " ".join([model, *levels()[:1]])


def _of_processor(what: str) -> str:
    """Return a field of the first processor in Linux's /proc/cpuinfo, which may list hundreds;
    empty elsewhere."""
    if sys.platform == "linux":
        with suppress(OSError), open("/proc/cpuinfo", encoding="ascii", errors="replace") as told:
            line = next((line for line in told if line.startswith(what)), "")
            return line.partition(":")[2].strip()
    return ""


@cache
def _is_edited(file: str) -> bool:
    """True where a file of the package differs from the one that the library was made from."""
    library = load_library()
    assert isinstance(library, Library)
    return _digest(PACKAGE / file) != library.files[file]


def _digest(file: Path) -> str | None:
    """SHA-256, or None where a file cannot be read."""
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError:
        return None


def _is_set(name: str) -> bool:
    return os.environ.get(name, "").strip() not in ("", "0")


def describe_library() -> Iterator[str]:
    """Lines that say what is in use."""
    library = load_library()
    if isinstance(library, str):
        yield f"kernels: compiled on use by numba ({library})"
        return
    edited = sorted(file for file in library.files if _is_edited(file))
    yield f"kernels: {len(library.kernels)} in {library.path} (ABI {ABI}, {library.made_with})"
    yield f"processor: {library.level}"
    if edited:
        behind = sum(bool(set(edited) & set(files)) for files in library.kernels.values())
        yield (
            f"compiled on use by numba: {behind} of them, because of edits to {', '.join(edited)}"
        )
