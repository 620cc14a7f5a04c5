"""Compile every kernel of the library into the cache, on all cores, before the tests run: each of
their processes would compile what it needs by itself. With `--deep` also those of the reproductions.
"""

import importlib
import os
import re
import sys
import time
from multiprocessing import get_context
from pathlib import Path

import strapdown
import strapdown_reproductions
from strapdown.core import jit, kernel_cache

SLOW = ("xkf", "two_stage", "ins_sigma_points", "pkf", "six_state", "ekf")
"""Parts of the names of modules whose kernels take longest: they come first, so that none of
them is left over for one core at the end."""


def modules(packages):
    """Names of all modules of these packages that declare kernels."""
    for package in packages:
        root = Path(package.__file__).parent
        for file in sorted(root.rglob("*.py")):
            if re.search(r"^@kernel\b", file.read_text(encoding="utf-8"), re.MULTILINE):
                yield ".".join(
                    (package.__name__, *file.relative_to(root).with_suffix("").parts)
                ).removesuffix(".__init__")


def kernels(packages=(strapdown, strapdown_reproductions)):
    """(module, name) of every kernel, in the order in which to compile them."""
    found = [
        (module, name)
        for module in modules(packages)
        for name, value in vars(importlib.import_module(module)).items()
        if hasattr(value, "signature")
        and hasattr(value, "py_func")
        and value.py_func.__module__ == module
    ]
    return sorted(found, key=lambda place: not any(part in place[0] for part in SLOW))


def compiled(place):
    """Compile one kernel (module, name)."""
    return jit.compile_kernel(getattr(importlib.import_module(place[0]), place[1]))


if __name__ == "__main__" and jit.COMPILED and kernel_cache.folder():
    packages = (strapdown, strapdown_reproductions) if "--deep" in sys.argv else (strapdown,)
    begin, places = time.perf_counter(), kernels(packages)
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        new = sum(pool.imap_unordered(compiled, places))
    print(
        f"{new} of {len(places)} kernels compiled in {time.perf_counter() - begin:.0f} s",
        file=sys.stderr,
    )
