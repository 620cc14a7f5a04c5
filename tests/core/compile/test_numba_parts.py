"""numba's private parts: in one file, for versions that it names, with a slower way under any other;
other code of numba in the process is as it was."""

import re
from pathlib import Path

import numba
import numpy as np
import pytest

import strapdown
from strapdown.core.compile import jit
from strapdown.core.compile.jit import helper, inline, kernel
from strapdown.core.compile.signatures import REAL, WHOLE, reals, signature

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="the compiler is off")
PACKAGE = Path(strapdown.__file__).parent
ONE = signature("one", REAL, x=REAL)
COUNT = signature("count", WHOLE, n=WHOLE)
NAMED = signature("named", REAL, x=reals(3))


@pytest.fixture(params=["known", "another numba"])
def version(request, monkeypatch):
    """With the installed numba, and with one that nobody has tried."""
    from strapdown.core.compile import numba_parts

    if request.param != "known":
        monkeypatch.setattr(numba_parts.numba, "__version__", "99.0.1")
    assert numba_parts.is_known_numba() == (request.param == "known")
    return request.param


def dispatcher(function):
    from strapdown.core.compile import compiler

    return compiler.dispatcher(function)


def test_the_installed_numba_is_one_that_the_private_parts_are_written_for():
    """With another version everything works, and compiling takes twice as long. Run the tests of this
    folder and the golden replays with it, then add it to KNOWN."""
    from strapdown.core.compile import numba_parts

    assert numba_parts.is_known_numba(), f"numba {numba.__version__}, known: {numba_parts.KNOWN}"


def test_reference_counts_can_be_left_out_in_this_numba(monkeypatch):
    """A private option: without it everything works, 0.14 us a sample slower. Where it holds an
    allocation is a compile error."""
    from strapdown.core.compile import compiler, numba_parts

    assert compiler.OPTIONS.get("_nrt") is False
    # numba refuses an option it does not know only when it compiles
    assert numba.njit(_nrt=False)(lambda x: x + 1)(1) == 2
    with pytest.raises(numba.TypingError):
        kernel(ONE)(lambda x: np.zeros(3)[0] + x).ready()
    monkeypatch.setattr(numba_parts.cpu, "CPUTargetOptions", object)
    assert not numba_parts.reference_counts_can_be_left_out()


def test_private_parts_of_numba_stand_in_one_file():
    private = re.compile(r"\bnumba\.(?!extending\b|njit\b|__version__)\w+|from numba import")
    users = [
        file.name
        for file in PACKAGE.rglob("*.py")
        for line in file.read_text(encoding="utf-8").splitlines()
        if re.match(r"\s*(from|import) ", line) and private.search(line)
    ]
    assert set(users) == {"numba_parts.py"}


def test_helpers_are_called_with_the_same_results(version):
    @inline
    def scaled(x, factor=2.0):
        return factor * x

    @helper
    def norm(x):
        return np.sqrt(scaled(x[0]) ** 2 + scaled(x[1], factor=3.0) ** 2) + x[-1]

    @kernel(NAMED)
    def through(x):
        return norm(x) + norm(x)

    x = np.array([2.0, 1.0, 0.5])
    assert through(x) == 2 * (np.sqrt(4.0**2 + 3.0**2) + 0.5)
    (made,) = dispatcher(norm).overloads.values()
    assert callable(made.entry_point) == (version != "known")


def test_a_kernel_calls_a_kernel_and_helpers_of_both(version):
    @helper
    def third(x):
        return x / 3

    @kernel(ONE)
    def inner(x):
        return third(x) + 1

    @kernel(ONE)
    def outer(x):
        return inner(x) * third(x)

    assert outer(6.0) == 6.0 and inner(6.0) == 3.0


def test_a_helper_may_call_itself_and_one_that_calls_it(version):
    @helper
    def factorial(n):
        if n < 2:
            return 1
        return n * factorial(n - 1)

    scope = {"factorial": factorial}
    exec(
        "def even(n):\n    if n == 0:\n        return 1\n    return odd(n - 1)\n"
        "def odd(n):\n    if n == 0:\n        return 0\n    return even(n - 1)\n",
        scope,
    )
    scope["even"], scope["odd"] = even, _ = helper(scope["even"]), helper(scope["odd"])
    made = kernel(COUNT)(lambda n: factorial(n) + even(n))
    assert made(5) == 120 and made(4) == 25


def test_what_a_helper_raises_is_raised_behind_the_call(version):
    @helper
    def root(x):
        if x < 0:
            raise ValueError("below zero")
        return x**0.5

    made = kernel(ONE)(lambda x: root(x))
    assert made(4.0) == 2.0
    with pytest.raises(ValueError, match="below zero"):
        made(-1.0)


def test_a_kernel_may_allocate(version):
    @helper
    def doubled(x):
        return 2 * x

    made = kernel(ONE, _nrt=True)(lambda x: np.linspace(0.0, doubled(x), 5).sum())
    assert made(2.0) == 10.0


def test_code_of_numba_beside_it_is_compiled_as_ever(version):
    """By numba's own classes, called from Python, also where it calls a helper or what kernels
    brought numba to compile first."""

    @helper
    def clipped(x):
        return min(max(x, 0.0), 1.0) + round(x)

    made = kernel(ONE)(lambda x: clipped(x))
    assert made(3.0) == 4.0
    plain = numba.njit(lambda x: round(x) + min(x, 5.0))
    both = numba.njit(lambda x: clipped(x) + plain(x))
    assert plain(3.0) == 6.0 and both(3.0) == 10.0
    assert type(plain).__module__ == "numba.core.registry"
    (library,) = [each.library for each in plain.overloads.values()]
    assert type(library).__module__ == "numba.core.codegen"
    assert [*plain.inspect_asm().values()] and [*both.inspect_llvm().values()]
