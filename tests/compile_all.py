"""Compile every kernel of the library into the cache, on all cores, before the tests run: each of
their processes would compile what it needs by itself. With `--deep` also those of the reproductions.
"""

import os
import sys
import time
from multiprocessing import get_context

import strapdown
import strapdown_reproductions
from strapdown.core.compile import jit, kernel_cache
from strapdown.native import ir

SLOW = ("xkf", "two_stage", "ins_sigma_points", "pkf", "six_state", "ekf")
"""Parts of the names of modules whose kernels take longest: they come first, so that none of
them is left over for one core at the end."""


DEEP = ("ekf", "xkf", "nlo", "mekf", "course", "magnetic_field")
"""Parts of the names of modules whose kernels for eight runs only deep tests need."""


def kernels(packages=(strapdown, strapdown_reproductions)):
    """Every kernel, in the order in which to compile them."""
    found = [
        kernel
        for package in packages
        for module in ir.modules(package)
        for kernel in ir.declared_kernels(module)
    ]
    return sorted(found, key=lambda kernel: not any(part in kernel.stem for part in SLOW))


def _deep(stem):
    module, _, name = stem.rpartition(".")
    return name.endswith("_in_lanes") and module.rpartition(".")[2] in DEEP


def compiled(stem):
    """Compile one kernel."""
    return jit.compile_kernel(ir.of_stem(stem))


if __name__ == "__main__" and jit.COMPILED and kernel_cache.folder():
    packages = (strapdown, strapdown_reproductions) if "--deep" in sys.argv else (strapdown,)
    begin = time.perf_counter()
    wanted = [kernel.stem for kernel in kernels(packages)]
    places = [stem for stem in wanted if "--deep" in sys.argv or not _deep(stem)]
    with get_context("spawn").Pool(os.cpu_count()) as pool:
        new = sum(pool.imap_unordered(compiled, places))
    print(
        f"{new} of {len(places)} kernels compiled in {time.perf_counter() - begin:.0f} s",
        file=sys.stderr,
    )
