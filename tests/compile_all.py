"""Compile every kernel into the cache, on all cores, before the tests run: each of their processes would compile what it needs by itself."""
import importlib
import os
import sys
import time
from multiprocessing import get_context

from strapdown.core import jit


SLOW = ("xkf", "two_stage", "ins_points", "pkf", "six", "ekf")
"""Parts of the names of modules whose kernels take longest: they come first, so that none of them is left over for one core at the end."""


def kernels():
    """(module, name) of every kernel, in the order in which to compile them."""
    files = {file for pattern in jit.KERNEL_SOURCES for file in jit.PACKAGE.glob(pattern)}
    found = []
    for file in sorted(files):
        module = importlib.import_module(".".join(file.resolve().relative_to(jit.PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"))
        for name, value in vars(module).items():
            if hasattr(value, "signature") and hasattr(value, "py_func") and value.py_func.__module__ == module.__name__:
                found.append((module.__name__, name))
    return sorted(found, key=lambda place: not any(part in place[0] for part in SLOW))


def compiled(place):
    """Compile one kernel (module, name)."""
    return jit.compile_kernel(getattr(importlib.import_module(place[0]), place[1]))


if __name__ == "__main__" and jit.COMPILED and jit.CACHE is not None:
    begin, places = time.perf_counter(), kernels()
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        new = sum(pool.imap_unordered(compiled, places))
    print(f"{new} of {len(places)} kernels compiled in {time.perf_counter() - begin:.0f} s", file=sys.stderr)
