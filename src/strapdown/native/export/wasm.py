"""strapdown.wasm and the script that runs it, where the target is WebAssembly."""

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from ...checks import DataError
from ...core.compile.records import place, row_of
from ...core.loop.cursor import Books
from ...core.mathematics import solution_row
from .chosen import Chosen
from .header import template
from .layout import BYTES, ExportLayout, words

FUNCTIONS = (
    "strapdown_start",
    "strapdown_source",
    "strapdown_fix",
    "strapdown_sample",
    "strapdown_next_event",
    "strapdown_example",
    "__heap_base",
)
"""Functions that a module exports."""
OPTIONS = ("--target=wasm32", "-std=c99", "-O2", "-mbulk-memory", "-nostdlib", "-Wl,--no-entry")


def link_module(contents: Mapping[str, bytes]) -> bytes | None:
    """Return the module from these files of an export; None where clang and wasm-ld are not found.
    Raises DataError with their message."""
    if not (shutil.which("clang") and shutil.which("wasm-ld")):
        return None
    shown = [f"-Wl,--export={name}" for name in FUNCTIONS]
    with TemporaryDirectory() as place:
        for name in ("strapdown.o", "strapdown.h", "strapdown_calls.c"):
            (Path(place) / name).write_bytes(contents[name])
        done = subprocess.run(
            ["clang", *OPTIONS, *shown, "-Wl,--allow-undefined", "strapdown_calls.c", "strapdown.o"]
            + ["-o", "strapdown.wasm"],
            cwd=place,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            said = " ".join(done.stderr.split())[:500]
            raise DataError(f"clang could not link strapdown.wasm: {said}")
        return (Path(place) / "strapdown.wasm").read_bytes()


def script(of: Chosen, made: ExportLayout, bytes_of_filter: int) -> str:
    """The text of main.mjs."""
    (nav,) = (one for one in made.of("out") if one.name == "nav")
    (books,) = (one for one in made.of("cursor") if one.name == "books")
    return template("main.mjs").substitute(
        filter=bytes_of_filter,
        nav=BYTES * nav.first,
        books=BYTES * words(row_of(Books)),
        accepted=BYTES * (books.first + place(Books, "accepted")),
        rejected=BYTES * (books.first + place(Books, "rejected")),
        sources=len(of.sources),
        columns=made.sizes["columns"],
        std=solution_row.STD,
    )
