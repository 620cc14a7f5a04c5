"""Compilation: wrong types refused, kernels called by address, imports cheap, views right."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numba
import numpy as np
import pytest

import strapdown
from strapdown.core import jit
from strapdown.core.jit import (
    OPTIONS,
    compile_kernel,
    flatten,
    helper,
    is_cached,
    kernel,
    matrix,
)

PACKAGE = Path(strapdown.__file__).parent
needs_compiler = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")


def python(code, path=PACKAGE.parent, **environment):
    """What a new process prints for `code`; it must print nothing on standard error. The package
    is taken from `path`."""
    environment = {**os.environ, "PYTHONPATH": str(path), "PYTHONWARNINGS": "error", **environment}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env=environment,
        capture_output=True,
        text=True,
        cwd="/",
    )
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return done.stdout.split()


@needs_compiler
def test_reference_counts_can_be_left_out_in_this_numba(monkeypatch):
    """A private option: without it everything works, 0.14 us a sample slower. Where it holds an
    allocation is a compile error."""
    assert OPTIONS.get("_nrt") is False
    # numba refuses an option it does not know only when it compiles
    assert numba.njit(_nrt=False)(lambda x: x + 1)(1) == 2
    with pytest.raises(numba.TypingError):
        helper(lambda: np.zeros(3))()
    monkeypatch.setattr(jit.cpu, "CPUTargetOptions", object)
    assert not jit._reference_counts_can_be_left_out()


@needs_compiler
def test_another_type_is_refused_once_compiled():
    add = kernel(numba.float64(numba.float64[::1]))(lambda x: x[0] + 1)
    assert compile_kernel(add) and not compile_kernel(add) and is_cached(add)
    assert add(np.zeros(4)) == 1
    for wrong in (np.zeros(4)[::2], np.zeros(4, np.float32), 3.0):
        with pytest.raises(TypeError, match="No matching definition"):
            add(wrong)


def test_plain_is_the_function_behind_a_helper():
    double = lambda x: 2 * x
    assert plain(helper(double)) is double and plain(double) is double


@pytest.mark.short
def test_views_equal_their_python_twins():
    @helper
    def write(flat, square):
        view, line = matrix(flat, 3, 2, 4), flatten(square)
        view[1, 2] = 7.0
        line[4] = 9.0
        return view[0, 0] + view.shape[0] + 10 * view.shape[1] + 100 * line.size + line[3]

    flat, square = np.arange(20.0), np.arange(9.0).reshape(3, 3)
    assert write(flat, square) == 3 + 2 + 40 + 900 + 3
    assert flat[3 + 4 + 2] == 7 and square[1, 1] == 9
    np.testing.assert_array_equal(np.delete(flat, 9), np.delete(np.arange(20.0), 9))
    twin = jit._matrix_twin(flat, 3, 2, 4)
    assert np.shares_memory(twin, flat) and twin[1, 2] == 7 and twin.shape == (2, 4)


@pytest.mark.short
def test_a_kernel_is_called_by_its_address():
    """That is how predict, correct and observers cross into `run`."""
    signature = numba.float64(numba.float64) if jit.COMPILED else "a signature"
    function_at = jit.caller(signature)
    triple = kernel(signature)(lambda x: 3 * x)
    compile_kernel(triple)

    @helper
    def through(address, x):
        return function_at(address)(x)

    assert through(jit.address(triple), 2.0) == 6.0
    assert jit.entry_point(triple)(2.0) == 6.0


@pytest.mark.parametrize(
    "code", ["import strapdown", "import strapdown; dir(strapdown); strapdown.__version__"]
)
def test_importing_the_package_imports_nothing_heavy(code):
    assert (
        python(
            f"{code}; import sys; print(*{{'numba', 'numpy', 'pandas', 'scipy', 'xarray', 'pydantic', 'typer'}} & set(sys.modules))"
        )
        == []
    )


def test_help_does_not_import_numba():
    code = """
        import contextlib, io, sys
        sys.argv = ["strapdown", "--help"]
        from strapdown.cli.app import main
        text = io.StringIO()
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            main()
        assert "fuse" in text.getvalue()
        print(*{"numba", "pandas", "scipy", "xarray", "pydantic", "plotly"} & set(sys.modules))
        """
    assert python(code) == []
