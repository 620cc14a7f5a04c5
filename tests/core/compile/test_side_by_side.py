"""Kernels compiled in other processes land in the cache; what cannot is compiled where it is called."""

import os

import pytest

from strapdown.aiding import heading, velocity
from strapdown.core.compile import jit
from strapdown.core.compile.jit import kernel
from strapdown.core.compile.signatures import REAL, signature

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")
ONE = signature("one", REAL, x=REAL)


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """Nothing compiled, two cores, and no kernel too small for a process of its own."""
    import numba

    from strapdown.core.compile import side_by_side

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(side_by_side, "ENOUGH", 1.0)
    monkeypatch.setattr(side_by_side, "_cores", lambda: 2)
    for each in (heading.observe, velocity.observe):
        monkeypatch.setattr(each, "_address", 0)
        monkeypatch.setattr(jit.library, "find", lambda kernel: None)
    return tmp_path


def test_other_processes_leave_kernels_in_the_cache(cold):
    said = []
    jit.compile_together([heading.observe, velocity.observe], "two", said.append)
    assert not heading.observe._address and heading.observe.at_hand and velocity.observe.at_hand
    assert not heading.observe.ready() and not velocity.observe.ready()  # loaded
    assert said[0] == "compiling two for the first time on this machine ..."
    assert len(said) == 2 and said[1].startswith("compiling two: 1 of 2 kernels, about ")
    assert list(cold.rglob("pace"))


def test_a_kernel_of_no_module_is_compiled_here(cold):
    own = kernel(ONE)(lambda x: x + 1.0)
    jit.compile_together([own, heading.observe, velocity.observe], "three")
    assert own._address and own(1.0) == 2.0


@pytest.mark.parametrize("broken", ["no python", "dies"])
def test_without_other_processes_kernels_are_left_to_their_callers(cold, monkeypatch, broken):
    from strapdown.core.compile import side_by_side

    if broken == "no python":
        monkeypatch.setattr(side_by_side.sys, "executable", os.devnull)
    else:
        monkeypatch.setattr(side_by_side, "START", "raise SystemExit(1) # {path} {module}")
    jit.compile_together([heading.observe, velocity.observe], "two")
    assert heading.observe.address and velocity.observe.address
