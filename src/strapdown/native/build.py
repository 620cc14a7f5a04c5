"""Build the library of the package's kernels: `python -m strapdown.native.build OUT`.

It writes to OUT one kernels-LEVEL.bin per processor level, and kernels.json, which
`core/compile/library.py` reads. Any system can build it for any other. Unchanged kernels come from
the cache of the last build.
"""

import argparse
import hashlib
import importlib
import json
import os
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
from ..core.compile import kernel_cache, library, machine_code, signatures
from ..core.compile.jit import Kernel
from ..fileio.locks import part_of
from . import emit, ir, relocation

SLOW = ("core.loop", "xkf", "two_stage", "sigma_point", "particle", "nlo", "flight", "ekf")
"""Parts of the names of the slowest kernels: they are compiled first, so that none of them occupies
a single core at the end."""
TASKS = 60
"""Number of kernels after which a process is replaced by a new one: numba keeps everything that it
compiles, 1.4 GB for so many. With fewer, each process would compile the shared helpers again."""
KEEP = 3
"""Versions of one object that stay in the cache."""

Notify = Callable[[str], None]


COMPILING = ("compiler", "numba_parts", "records", "lane_types", "signatures")
"""Modules of core/compile that determine the machine code of a kernel."""


TAGS = {
    "linux x86_64": "manylinux_2_17_x86_64",
    "linux aarch64": "manylinux_2_17_aarch64",
    "darwin arm64": "macosx_11_0_arm64",
    "darwin x86_64": "macosx_10_13_x86_64",
    "win32 AMD64": "win_amd64",
}
"""Tags of wheels by system. manylinux_2_17 is the oldest that package indexes accept for both
processors."""


def levels_here() -> tuple[str, ...]:
    """Return the levels of this system, best first. Raises DataError where there are none."""
    if not (levels := tuple(library.LEVELS.get(library.system(), ()))):
        raise DataError(
            f"libraries of kernels exist for {', '.join(library.LEVELS)}, but this system is {library.system()}"
        )
    return levels


def tag(levels: Sequence[str]) -> str:
    """Return the platform in the tag of a wheel with these levels: `any` for several systems."""
    systems = [system for system, of in library.LEVELS.items() if {*of} & {*levels}]
    return TAGS[systems[0]] if len(systems) == 1 else "any"


def kernels_of_package(only: Sequence[str] = ()) -> list[Kernel]:
    """Return all kernels of the package, or those of these stems, the slow ones first. Raises
    DataError."""
    found = {
        kernel.stem: kernel
        for module in ir.modules(strapdown)
        for kernel in ir.declared_kernels(module)
    }
    for stem in only:
        if stem not in found:
            raise DataError(f"strapdown has no kernel {stem!r}{did_you_mean(stem, found)}")
    chosen = [found[stem] for stem in only or found]
    return sorted(chosen, key=lambda kernel: not any(part in kernel.stem for part in SLOW))


def build(folder: Path, levels: Sequence[str], only: Sequence[str], notify: Notify) -> str:
    """Build the complete library into a folder, or nothing, and return its platform.

    only: stems of kernels, empty for all. Raises DataError for missing requirements, RuntimeError
    where a kernel cannot be in a library, and OSError.
    """
    if not levels:
        raise DataError(f"this processor is below {levels_here()[-1]}, the lowest supported level")
    for level in levels:
        check_choice(level, "--levels", emit.LIBRARY)
    kernels = kernels_of_package(only)
    sources = {kernel.stem: _sources(kernel) for kernel in kernels}
    files = _digests(sources.values())
    with tempfile.TemporaryDirectory() as temporary:
        objects = _objects(kernels, levels, _cache() or Path(temporary), notify)
        made = {
            level: machine_code.file_content(
                *relocation.place([path.read_bytes() for path in paths])
            )
            for level, paths in objects.items()
        }
    if edited := [
        file for file, digest in _digests(sources.values()).items() if digest != files[file]
    ]:
        raise DataError(f"{edited[0]} was edited while the library was built; build it again")
    _put_library(folder, made, _manifest(kernels, sources, files, made))
    return tag(levels)


# ---- objects


def _objects(
    kernels: Sequence[Kernel], levels: Sequence[str], place: Path, notify: Notify
) -> dict[str, list[Path]]:
    """Write the objects of all kernels by level to a folder, with one process per core."""
    paths = {
        kernel.stem: {level: place / _name(kernel, level) for level in levels} for kernel in kernels
    }
    todo = [
        stem for stem, by_level in paths.items() if not all(map(Path.exists, by_level.values()))
    ]
    begin, done = time.perf_counter(), len(paths) - len(todo)
    if done:
        notify(f"{done} of {len(paths)} kernels did not change")
    cores = os.cpu_count() or 1
    # max_tasks_per_child would make Python 3.11 and 3.12 wait forever
    for first in range(0, len(todo), TASKS * cores):
        pool = ProcessPoolExecutor(cores, mp_context=get_context("spawn"))
        try:
            batch = todo[first : first + TASKS * cores]
            running = {pool.submit(_emit_objects, stem, paths[stem]): stem for stem in batch}
            for each in as_completed(running):
                each.result()
                done += 1
                seconds = time.perf_counter() - begin
                notify(f"{done} of {len(paths)}: {running[each]}, {seconds:.0f} s")
        finally:
            pool.shutdown(cancel_futures=True)
    for by_level in paths.values():
        for path in by_level.values():
            _sweep(path)
    return {level: [by_level[level] for by_level in paths.values()] for level in levels}


def _emit_objects(stem: str, paths: dict[str, Path]) -> None:
    """Write the objects of a kernel; in a process under `ir.NEUTRAL`."""
    kernel = ir.of_stem(stem)
    try:
        text = ir.text_of(kernel)
    except Exception as error:  # numba's messages have many lines
        raise RuntimeError(f"{stem}: {' '.join(str(error).split()) or repr(error)}") from None
    for level, path in paths.items():
        made = emit.emit([text], emit.LIBRARY[level], [kernel.symbol])
        if path.name != _name(kernel, level):
            raise DataError(f"{stem} was edited while it was compiled; build the library again")
        with part_of(path) as part:
            part.path.write_bytes(made.content)
            part.rename(path)


def _cache() -> Path | None:
    """Return the cache of objects between builds, or None where it cannot be written."""
    place = kernel_cache.folder()
    if place is None:
        return None
    place = place / "objects"
    with suppress(OSError):
        place.mkdir(parents=True, exist_ok=True)
        return place if os.access(place, os.W_OK) else None
    return None


def _name(kernel: Kernel, level: str) -> str:
    """Return the file of a kernel's object, named by a hash of everything that determines it."""
    importlib.import_module(kernel_cache.COMPILER)
    code = (kernel_cache.COMPILER, ir.__name__, emit.__name__)
    parts = (
        kernel_cache.code_digest(kernel),
        *map(kernel_cache.closure_digest, code),
        numba.__version__,
        llvmlite.__version__,
        sys.implementation.cache_tag,
        repr(kernel.signature),
        emit.LIBRARY[level],
    )
    return f"{kernel.symbol}-{level}-{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}.o"


def _sweep(path: Path) -> None:
    """Delete all but the last versions of an object."""
    versions = path.parent.glob(f"{path.name.rpartition('-')[0]}-*.o")
    with suppress(OSError):
        os.utime(path)
        for old in sorted(versions, key=lambda file: file.stat().st_mtime)[:-KEEP]:
            old.unlink(missing_ok=True)


# ---- the manifest of the library


def _sources(kernel: Kernel) -> tuple[str, ...]:
    """Files of the package that a kernel's code comes from."""
    found = {
        *(library.PACKAGE / "core/compile" / f"{name}.py" for name in COMPILING),
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
) -> dict[str, Any]:
    number = {file: index for index, file in enumerate(files)}
    return {
        "abi": signatures.ABI,
        "version": strapdown.__version__,
        "arithmetic": "strict",
        "built_with": f"numba {numba.__version__}, llvmlite {llvmlite.__version__}",
        "tag": tag(tuple(made)),
        "libraries": {
            level: {
                "file": f"kernels-{level}.bin",
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


def _put_library(folder: Path, made: dict[str, bytes], manifest: dict[str, Any]) -> None:
    """Write the library. kernels.json is removed first and written last: without it, the library
    does not count as present."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / library.MANIFEST).unlink(missing_ok=True)
    for old in folder.glob("kernels-*.bin"):
        old.unlink()
    contents = {f"kernels-{level}.bin": content for level, content in made.items()}
    contents[library.MANIFEST] = json.dumps(manifest).encode() + b"\n"
    for name, content in contents.items():
        with part_of(folder / name) as part:
            part.path.write_bytes(content)
            part.rename(folder / name)


def _main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser("strapdown.native.build", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--levels", help="processor levels, or `all` of this system; default: this processor's"
    )
    parser.add_argument("--only", default="", help="kernels, MODULE.NAME,.. ; default: all")
    said = parser.parse_args(arguments)
    # child processes import numba with these settings; in this process it is already imported
    os.environ.update(ir.NEUTRAL)
    begin = time.perf_counter()
    try:
        levels = levels_here() if said.levels == "all" else (said.levels or "").split(",")
        platform = build(
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
        for file in sorted(said.folder.glob("kernels-*.bin"))
    )
    print(f"{said.folder}: {sizes}, in {time.perf_counter() - begin:.0f} s, for {platform}")
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
