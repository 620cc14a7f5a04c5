"""Compilation: wrong types refused, kernels called by address, imports cheap, views right."""

import math
import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

import strapdown
from strapdown.core.compile import jit
from strapdown.core.compile.jit import bind_kernel, compile_kernel, flatten, kernel, matrix
from strapdown.core.compile.records import row_of
from strapdown.core.compile.signatures import REAL, WHOLE, reals, record, signature, wholes
from strapdown.typing import Array

ONE = signature("one", REAL, x=REAL)
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


@pytest.mark.parametrize(
    "wrong",
    [np.zeros(8)[::2], np.zeros(4, np.float32), np.zeros(3), np.zeros((4, 1)), 3.0],
    ids=["with gaps", "float32", "too short", "a matrix", "a number"],
)
@needs_compiler
def test_another_type_is_refused(wrong):
    add = kernel(signature("of_four", REAL, x=reals(4)))(lambda x: x[0] + 1)
    assert compile_kernel(add) and not compile_kernel(add) and add.at_hand
    assert add(np.zeros(4)) == 1 and add(np.zeros(5)) == 1
    with pytest.raises(TypeError, match=r"of_four: x is .*; it must be float64 \(4\) without gaps"):
        add(wrong)


@needs_compiler
def test_sizes_of_one_name_must_be_the_same():
    size = kernel(signature("sized", WHOLE, a=reals("n"), b=reals(2, "n")))(lambda a, b: b.shape[1])
    assert size(np.zeros(5), np.zeros((2, 5))) == 5
    with pytest.raises(TypeError, match=r"sized: b is float64 \(2, 4\); it must be .*n = 5"):
        size(np.zeros(5), np.zeros((2, 4)))
    with pytest.raises(TypeError, match="sized takes 2 arguments"):
        size(np.zeros(5))


@needs_compiler
def test_what_a_kernel_raises_is_raised_behind_its_call():
    def root(x):
        if x < 0:
            raise ValueError("below zero")
        return math.sqrt(x)

    made = kernel(ONE)(root)
    assert made(4.0) == 2.0
    with pytest.raises(ValueError, match="below zero"):
        made(-1.0)
    assert made(9.0) == 3.0


@needs_compiler
def test_a_bound_call_sees_its_arrays_as_they_are_when_it_is_made():
    add = kernel(signature("total", REAL, x=reals("n")))(lambda x: x[0] + x[1])
    x = np.array([1.0, 2.0])
    call = bind_kernel(add, x)
    assert call() == 3.0
    x[0] = 5.0
    del x
    assert call() == 7.0


@pytest.mark.short
def test_views_equal_their_python_twins():
    @kernel(signature("write", REAL, flat=reals(20), square=reals(3, 3)))
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


class Place:
    """Numbers of a place."""

    height: float
    level: Annotated[Array, 2]


place_in = jit.row_in(row_of(Place))


@pytest.mark.short
def test_numbers_of_an_array_are_a_row_by_name():
    def raised(flat):
        place = place_in(flat, 3)
        place.height += 1.0
        place.level[1] = 10 * place.level[0]
        return place.height

    flat = np.arange(8.0)
    assert kernel(signature("raised", REAL, flat=reals("n")))(raised)(flat) == 4.0
    np.testing.assert_array_equal(flat, [0, 1, 2, 4, 4, 40, 6, 7])
    seen = place_in(flat, 3)
    assert seen.height == 4 and np.shares_memory(seen.level, flat)


@pytest.mark.short
def test_a_kernel_is_called_by_its_address():
    """That is how predict, correct and observers cross into `run`."""
    function_at = jit.caller(ONE)
    triple = kernel(ONE)(lambda x: 3 * x)
    through = kernel(signature("through", REAL, at=WHOLE, x=REAL))(lambda at, x: function_at(at)(x))
    assert through(jit.address(triple), 2.0) == 6.0


class Pair(NamedTuple):
    number: float
    table: Any
    counts: Any


PAIR = record(Pair, number=REAL, table=reals("rows", 2), counts=wholes("some"))
TAKE = signature("take", REAL, pair=PAIR, of=reals("rows"), more=wholes("extra"))


@pytest.mark.short
def test_records_and_sizes_cross_into_a_kernel_and_out_of_one():
    """Numbers, arrays and sizes of records, and sizes that only the call says, by name."""
    take = kernel(TAKE)(
        lambda pair, of, more: (
            pair.number
            + 10 * pair.table.shape[0]
            + 100 * pair.counts.size
            + 1000 * more.size
            + pair.table[1, 1] * of[1]
            + pair.counts[2]
        )
    )
    take_at = jit.caller(TAKE)
    through = kernel(signature("through", REAL, at=WHOLE, **dict(TAKE.arguments)))(
        lambda at, pair, of, more: take_at(at)(pair, of, more)
    )
    pair = Pair(0.5, np.arange(4.0).reshape(2, 2), np.array([7, 8, 9]))
    rest = np.array([1.0, 2.0]), np.zeros(4, np.int64)
    expected = 0.5 + 20 + 300 + 4000 + 3 * 2 + 9
    assert take(pair, *rest) == expected and TAKE.sizes == ("extra",)
    assert through(jit.address(take), pair, *rest) == expected


def test_a_record_has_the_fields_of_its_class():
    with pytest.raises(TypeError, match="Pair has the fields number, table, counts"):
        record(Pair, number=REAL, counts=wholes("some"), table=reals("rows", 2))


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
