"""Writes the folder of an exported filter."""

import json
import os
import platform
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast

from ... import aiding, filters
from ...checks import DataError, check_choice
from ...core.compile.jit import Kernel
from ...core.loop import loop, stages
from ...core.loop.contract import Cursor, Fixes
from ...fileio.files import replacing, together
from ...fileio.locks import part_of
from ...typing import Notify
from .. import ir, object_files
from ..emit import TARGETS, Object, TargetMachine, emit
from .binding import ATTITUDE, RUN, BoundFunction, binding_ir
from .chosen import Chosen
from .glue import glue
from .header import header
from .image import image
from .layout import BYTES, ExportLayout, layout, sizes_of
from .readme import Sizes, readme
from .replay import replay
from .start_attitude import attitude
from .wasm import link_module, script

HOST = "host"
"""The machine on which it is made."""
HOSTS = {"x86_64": "x86-64-v2", "AMD64": "x86-64-v2", "aarch64": "aarch64", "arm64": "aarch64"}
KEPT, KEEP = "export-", 12
"""Beginning of the names of kept representations of kernels, and how many stay."""
OWN = 4
"""Count of numbers of strapdown_filter after those of the loop."""
COPIED = ("strapdown_delayed.h", "strapdown_delayed.c", "main.c")
"""Files that are the same in every export."""
LOOP, LOOP_NEEDS = ("loop.h", "loop.c", "desk.c"), {"position", "velocity"}
"""The example of firmware, and the sources that it calls by name."""
EVERY = 10
"""Samples between rows of the replay."""


class Exported(NamedTuple):
    """The files of an export, with target, sizes and notes."""

    files: tuple[str, ...]
    target: TargetMachine
    sizes: Sizes
    notes: tuple[str, ...]


def find_target(name: str) -> TargetMachine:
    """Return the target of that name; `host` is this machine. Raises DataError with the nearest
    name."""
    names = [HOST, *TARGETS]
    check_choice(name, "target", names)
    if name != HOST:
        return TARGETS[name]
    machine = platform.machine()
    if machine not in HOSTS:
        raise DataError(
            f"target host: {machine} is not one of the targets; choose one of {', '.join(TARGETS)}"
        )
    return TARGETS[HOSTS[machine]]


def export(
    of: Chosen, target: TargetMachine, folder: Path, notify: Notify | None = None
) -> Exported:
    """Write the object of a filter for a target, its header, its functions in C, an example with a
    replay and a README into an existing folder. Calls `notify` before steps that take long.

    Raises DataError for a filter that cannot be exported.
    """
    _refuse_plugins(of)
    made = layout(sizes_of(of.records(of.start)))
    first = image(of.filter, of.records, made, of.start, of.noise)
    run = of.replay(notify)
    if notify:
        notify(f"compiling {of.filter.name} for {target.name}, about a minute ...")
    code = compile_filter_object(of, made, target)
    sizes = Sizes(
        object_files.loaded_size(code.content),
        BYTES * (made.length + OWN),
        code.stack.get(RUN),
        code.needed,
    )
    declared = header(of, made).encode()
    format = sha256(code.content + declared).hexdigest()[:16]
    contents: dict[str, bytes] = {
        "strapdown.o": code.content,
        "strapdown.h": declared,
        "strapdown_calls.c": glue(of, first, format).encode(),
        **{
            name: (files(__package__) / "templates" / name).read_bytes()
            for name in _files_to_copy(of)
        },
        "replay.bin": replay(of, run, EVERY),
    }
    notes = list(of.notes)
    if target.name == "wasm32":
        contents["main.mjs"] = script(of, made, sizes.state).encode()
        module = link_module(contents)
        if module is None:
            notes.append("no strapdown.wasm: clang with wasm-ld, which links it, was not found")
        else:
            contents["strapdown.wasm"] = module
    contents["README.md"] = readme(of, first, target, sizes, [*contents, "README.md"]).encode()
    with together():
        for name, content in contents.items():
            with replacing(folder / name) as part:
                part.write_bytes(content)
    return Exported(tuple(contents), target, sizes, tuple(notes))


def _files_to_copy(of: Chosen) -> tuple[str, ...]:
    return (*COPIED, *LOOP) if set(of.names) >= LOOP_NEEDS else COPIED


def _refuse_plugins(of: Chosen) -> None:
    """Refuse filters and sensors of plugins, whose code exists only in this process."""
    brought = [filters.REGISTRY.brought_by(of.filter.name)]
    brought += [aiding.REGISTRY.brought_by(a.kind) for a in of.sources]
    if names := [plugin.name for plugin in brought if plugin]:
        raise DataError(
            f"filter {of.filter.name!r} cannot be exported with plugin {names[0]}: only "
            f"the library's own filters and sensors can be exported"
        )


def compile_filter_object(of: Chosen, made: ExportLayout, target: TargetMachine) -> Object:
    """The object of the filter with these sizes."""
    observers: dict[int, Kernel] = {
        aiding.number(a.kind): aiding.find(a.kind).observe  # type: ignore[misc]  # typed as functions
        for a in of.sources
    }
    run, predict, correct = cast(Any, (loop.run, of.filter.predict, of.filter.correct))
    records = of.records(of.start)
    needed = stages.needed_stages(Fixes(*records["fixes"]), Cursor(*records["cursor"]))
    bound = BoundFunction(run, predict, correct, observers, needed)
    kernels = list(dict.fromkeys((*bound.all, attitude)))
    texts = [binding_ir(made, bound, attitude), *_texts(kernels, made.sizes)]
    return emit(texts, target, (RUN, ATTITUDE), inside=[kernel.symbol for kernel in kernels])


def _texts(kernels: Sequence[Kernel], sizes: Mapping[str, int]) -> list[str]:
    """Return the intermediate representation of kernels with these sizes, from the cache if
    possible: it takes most of the time and is the same for all targets."""
    from ...core.compile import compiler, kernel_cache

    stems = [kernel.stem for kernel in kernels]
    code = list(map(kernel_cache.code_digest, kernels))
    code += [kernel_cache.closure_digest(module) for module in (compiler.__name__, ir.__name__)]
    versions = [version(package) for package in ("numba", "llvmlite")]
    digest = sha256(
        repr((stems, code, versions, sys.version, sorted(sizes.items()))).encode()
    ).hexdigest()
    folder = kernel_cache.folder()
    kept = folder and folder / f"{KEPT}{digest[:24]}"
    with suppress(OSError, ValueError):
        if kept:
            texts: list[str] = json.loads(kept.read_text(encoding="utf-8"))
            os.utime(kept)
            return texts
    with TemporaryDirectory() as place:
        symbols = list(ir.write(kernels, Path(place), small=True, sizes=sizes))
        texts = [(Path(place) / f"{symbol}.ll").read_text(encoding="utf-8") for symbol in symbols]
    with suppress(OSError):
        if kept:
            kept.parent.mkdir(parents=True, exist_ok=True)
            with part_of(kept) as part:
                part.path.write_text(json.dumps(texts), encoding="utf-8")
                part.rename(kept)
            before = sorted(kept.parent.glob(f"{KEPT}*"), key=lambda file: file.stat().st_mtime)
            for old in before[:-KEEP]:
                old.unlink(missing_ok=True)
    return texts
