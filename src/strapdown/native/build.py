"""The library of the package's kernels, built: `python -m strapdown.native.build OUT`.

Leaves in OUT one kernels-LEVEL.so per level of processor, and kernels.json, by which `core/compile/library.py`
knows it. What did not change since the last build is taken from the cache.
"""

import argparse
import hashlib
import importlib
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import llvmlite
import numba

import strapdown

from ..checks import DataError, check_choice, did_you_mean
from ..core.compile import kernel_cache, library, signatures
from ..core.compile.jit import Kernel
from ..file_locks import part_of
from . import emit, ir, link, object_files

SLOW = ("core.loop", "xkf", "two_stage", "sigma_point", "particle", "nlo", "flight", "ekf")
"""Parts of the names of kernels that take longest: they come first, so that none of them is left over
for one core at the end."""
TASKS = 12
"""Kernels after which processes are replaced by new ones: numba keeps all that it ever compiled."""
KEEP = 3
"""Versions of one object that stay in the cache."""

Say = Callable[[str], None]


COMPILING = ("compiler", "numba_parts", "lane_types", "signatures")
"""Modules of core that decide what machine code is made of a kernel."""


def levels_here() -> tuple[str, ...]:
    """The levels of this machine's architecture, best first. Raises DataError where a library can
    be built on none."""
    levels = tuple(library.LEVELS.get(platform.machine(), {})) if sys.platform == "linux" else ()
    if not levels:
        raise DataError(
            f"a library of kernels is built on Linux, on x86-64 or aarch64; this is "
            f"{platform.system()} on {platform.machine()}"
        )
    return levels


def kernels_of_package(only: Sequence[str] = ()) -> list[Kernel]:
    """All kernels of the package, or those of these stems, the slow ones first. Raises DataError."""
    found = {
        kernel.stem: kernel for module in ir.modules(strapdown) for kernel in ir.declared(module)
    }
    for stem in only:
        if stem not in found:
            raise DataError(f"strapdown has no kernel {stem!r}{did_you_mean(stem, found)}")
    chosen = [found[stem] for stem in only or found]
    return sorted(chosen, key=lambda kernel: not any(part in kernel.stem for part in SLOW))


def build(folder: Path, levels: Sequence[str], only: Sequence[str], say: Say) -> link.Platform:
    """Build the library into a folder, all of it or nothing; where it runs.

    only: stems of kernels, for all of them none. Raises DataError with what is missing, RuntimeError
    where a kernel cannot be in a library, OSError.
    """
    if not levels:
        raise DataError(f"this processor is below {levels_here()[-1]}, the least that there is")
    for level in levels:
        check_choice(level, "--levels", levels_here())
    with tempfile.TemporaryDirectory() as temporary:  # minutes before the linker is needed
        link.link([], Path(temporary) / "nothing.so")
    kernels = kernels_of_package(only)
    sources = {kernel.stem: _sources(kernel) for kernel in kernels}
    files = _digests(sources.values())
    with tempfile.TemporaryDirectory() as temporary:
        objects = _objects(kernels, levels, _cache() or Path(temporary), say)
        made = {}
        for level in levels:
            path = Path(temporary) / f"kernels-{level}.so"
            made[level] = link.link(objects[level], path)
            if missing := {each.symbol for each in kernels} - {*object_files.defined(made[level])}:
                raise RuntimeError(f"{path.name} lacks {', '.join(sorted(missing))}")
    if edited := [
        file for file, digest in _digests(sources.values()).items() if digest != files[file]
    ]:
        raise DataError(f"{edited[0]} was edited while the library was built; build it again")
    runs = link.platform_of(made.values(), platform.machine())
    _put(folder, made, _manifest(kernels, sources, files, made, runs))
    return runs


# ---- objects


def _objects(
    kernels: Sequence[Kernel], levels: Sequence[str], place: Path, say: Say
) -> dict[str, list[Path]]:
    """Objects of all kernels by level, in a folder; in as many processes as there are cores."""
    paths = {
        kernel.stem: {level: place / _name(kernel, level) for level in levels} for kernel in kernels
    }
    todo = [
        stem for stem, by_level in paths.items() if not all(map(Path.exists, by_level.values()))
    ]
    begin, done = time.perf_counter(), len(paths) - len(todo)
    if done:
        say(f"{done} of {len(paths)} kernels did not change")
    cores = os.cpu_count() or 1
    # not max_tasks_per_child, with which Python 3.11 and 3.12 wait for ever
    for first in range(0, len(todo), TASKS * cores):
        pool = ProcessPoolExecutor(cores, mp_context=get_context("spawn"))
        try:
            batch = todo[first : first + TASKS * cores]
            running = {pool.submit(_emitted, stem, paths[stem]): stem for stem in batch}
            for each in as_completed(running):
                each.result()
                done += 1
                seconds = time.perf_counter() - begin
                say(f"{done} of {len(paths)}: {running[each]}, {seconds:.0f} s")
        finally:
            pool.shutdown(cancel_futures=True)
    for by_level in paths.values():
        for path in by_level.values():
            _sweep(path)
    return {level: [by_level[level] for by_level in paths.values()] for level in levels}


def _emitted(stem: str, paths: dict[str, Path]) -> None:
    """Write the objects of a kernel; in a process under `ir.NEUTRAL`."""
    kernel = ir.of_stem(stem)
    try:
        text = ir.text_of(kernel)
    except Exception as error:  # of numba, with all that it knows on many lines
        raise RuntimeError(f"{stem}: {' '.join(str(error).split()) or repr(error)}") from None
    for level, path in paths.items():
        made = emit.emit([text], emit.TARGETS[level], [kernel.symbol], versioned=_of_gnu())
        if path.name != _name(kernel, level):
            raise DataError(f"{stem} was edited while it was compiled; build the library again")
        with part_of(path) as part:
            part.path.write_bytes(made.content)
            part.rename(path)


def _of_gnu() -> bool:
    """Whether the C library of this machine has versions of its symbols."""
    return platform.libc_ver()[0] == "glibc"


def _cache() -> Path | None:
    """Where objects are kept between builds, or None where nothing can be written."""
    place = kernel_cache.folder()
    if place is None:
        return None
    place = place / "objects"
    with suppress(OSError):
        place.mkdir(parents=True, exist_ok=True)
        return place if os.access(place, os.W_OK) else None
    return None


def _name(kernel: Kernel, level: str) -> str:
    """File of a kernel's object, after all that it comes from."""
    importlib.import_module(kernel_cache.COMPILER)
    code = (kernel_cache.COMPILER, ir.__name__, emit.__name__)
    parts = (
        kernel_cache.code_digest(kernel),
        *map(kernel_cache.closure_digest, code),
        numba.__version__,
        llvmlite.__version__,
        sys.implementation.cache_tag,
        repr(kernel.signature),
        emit.TARGETS[level],
        _of_gnu(),
    )
    return f"{kernel.symbol}-{level}-{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}.o"


def _sweep(path: Path) -> None:
    """Delete all but the last versions of an object."""
    versions = path.parent.glob(f"{path.name.rpartition('-')[0]}-*.o")
    with suppress(OSError):
        os.utime(path)
        for old in sorted(versions, key=lambda file: file.stat().st_mtime)[:-KEEP]:
            old.unlink(missing_ok=True)


# ---- what the library says of itself


def _sources(kernel: Kernel) -> tuple[str, ...]:
    """Files of the package that a kernel's code comes from."""
    found = {
        *(library.PACKAGE / "core" / "compile" / f"{name}.py" for name in COMPILING),
        *kernel_cache.import_closure(sys.modules[kernel.__module__])[0],
    }
    return tuple(
        sorted(
            file.relative_to(library.PACKAGE).as_posix()
            for file in found
            if file.is_relative_to(library.PACKAGE)
        )
    )


def _digests(sources: Iterable[Iterable[str]]) -> dict[str, str]:
    """SHA-256 of each file, by its path below the package."""
    return {
        file: hashlib.sha256((library.PACKAGE / file).read_bytes()).hexdigest()
        for file in sorted({file for each in sources for file in each})
    }


def _manifest(
    kernels: Iterable[Kernel],
    sources: dict[str, tuple[str, ...]],
    files: dict[str, str],
    made: dict[str, bytes],
    runs: link.Platform,
) -> dict[str, Any]:
    number = {file: index for index, file in enumerate(files)}
    return {
        "abi": signatures.ABI,
        "version": strapdown.__version__,
        "arithmetic": "strict",
        "built_with": f"numba {numba.__version__}, llvmlite {llvmlite.__version__}",
        "tag": runs.tag,
        "needs": runs.needs,
        "libraries": {
            level: {
                "file": f"kernels-{level}.so",
                "sha256": hashlib.sha256(content).hexdigest(),
                "bytes": len(content),
            }
            for level, content in made.items()
        },
        "files": files,
        "kernels": {
            kernel.symbol: [number[file] for file in sources[kernel.stem]]
            for kernel in sorted(kernels, key=lambda kernel: kernel.symbol)
        },
        "values": {kernel.symbol: library.values_of(kernel) for kernel in kernels},
    }


def _put(folder: Path, made: dict[str, bytes], manifest: dict[str, Any]) -> None:
    """Write the library. Without kernels.json, which goes first and comes last, there is none."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / library.MANIFEST).unlink(missing_ok=True)
    for old in folder.glob("kernels-*.so"):
        old.unlink()
    contents = {f"kernels-{level}.so": content for level, content in made.items()}
    contents[library.MANIFEST] = json.dumps(manifest).encode() + b"\n"
    for name, content in contents.items():
        with part_of(folder / name) as part:
            part.path.write_bytes(content)
            part.rename(folder / name)


def _main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser("strapdown.native.build", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--levels", help="of processors, or `all`; this processor's if not said")
    parser.add_argument("--only", default="", help="kernels, MODULE.NAME,.. ; all if not said")
    said = parser.parse_args(arguments)
    # processes that this one starts import numba under these; here it is imported already
    os.environ.update(ir.NEUTRAL)
    begin = time.perf_counter()
    try:
        levels = levels_here() if said.levels == "all" else (said.levels or "").split(",")
        runs = build(
            said.folder,
            levels if any(levels) else library.levels()[:1],
            [stem for stem in said.only.split(",") if stem],
            lambda line: print(line, file=sys.stderr, flush=True),
        )
    except (DataError, RuntimeError, OSError) as error:
        print(f"no library of kernels: {error}", file=sys.stderr)
        return 2
    sizes = ", ".join(
        f"{file.name} {file.stat().st_size / 1000:.0f} kB"
        for file in sorted(said.folder.glob("kernels-*.so"))
    )
    print(
        f"{said.folder}: {sizes}, in {time.perf_counter() - begin:.0f} s; {runs.tag}: {runs.needs}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
