"""Lanes against numpy and against the same source for one run: every operation, every choice, and what
may not compile."""

import math

import numpy as np
import pytest

from strapdown.core.compile.c_calls import aligned_zeros
from strapdown.core.compile.jit import (
    COMPILED,
    bits,
    from_bits,
    helper,
    kernel,
    lanes_of,
    matrix,
    sides,
)
from strapdown.core.compile.selection import all_of, any_of, where
from strapdown.core.compile.signatures import LANES, REAL, in_lanes, reals, signature, wholes
from strapdown.core.mathematics import elementary

pytestmark = pytest.mark.skipif(not COMPILED, reason="lanes are compiled")

EACH = signature("each", x=reals("n"), y=reals("n"), out=reals("rows", "n"))
"""Of two numbers of every element as many results as there are rows."""
ODD = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 1.0, -1.0, 5e-324])


def operands():
    """(x, y) of 64 elements and LANES runs, the odd ones with each other among them."""
    rng = np.random.default_rng(3)
    x, y = aligned_zeros(64, LANES), aligned_zeros(64, LANES)
    x[:], y[:] = rng.uniform(-4, 4, (2, 64, LANES))
    x[:8], y[:8] = ODD[:, None], ODD
    return x, y


def wide(one, rows):
    """(what a kernel makes of the operands in lanes, the same run by run)."""
    (x, y), made = operands(), aligned_zeros(rows, 64, LANES)
    one.for_runs(in_lanes(EACH))(x, y, made)
    alone = np.zeros((LANES, rows, 64))
    for lane in range(LANES):
        one(x[:, lane].copy(), y[:, lane].copy(), alone[lane])
    return made, np.moveaxis(alone, 0, 2)


@kernel(EACH)
def arithmetic(x, y, out):
    for i in range(x.size):
        a, b = x[i], y[i]
        out[0, i], out[1, i], out[2, i], out[3, i] = a + b, a - b, a * b, a / b
        out[4, i], out[5, i], out[6, i] = -a, 2 * a, 1 - b
        c = a
        c += b
        c *= 3
        out[7, i] = c
        out[8, i], out[9, i] = math.sqrt(abs(a)), abs(b)
        out[10, i], out[11, i] = min(a, b), max(a, b)
        out[12, i], out[13, i] = np.floor(a), math.copysign(a, b)
        out[14, i], out[15, i] = min(a, 1.0), max(0.5, b)


@kernel(EACH)
def choices(x, y, out):
    for i in range(x.size):
        a, b = x[i], y[i]
        out[0, i], out[1, i] = where(a < b, 1.0, 0.0), where(a <= b, a, b)
        out[2, i], out[3, i] = where(a > b, a, 0.0), where(a >= b, 0.0, b)
        out[4, i], out[5, i] = where(a == b, 1, 0), where(a != b, 1, 0)
        out[6, i] = where((a < 1) & (b < 1) | (a != a), a, -a)
        out[7, i] = where(math.isnan(a), 7.0, a)
        out[8, i] = where(~(a < b), 1.0, 0.0)
        out[9, i] = from_bits(bits(a) ^ (1 << 63))


@kernel(EACH)
def functions(x, y, out):
    for i in range(x.size):
        a, b = x[i], y[i]
        out[0, i], out[1, i] = elementary.sine(a), elementary.cosine(b)
        out[2, i], out[3, i] = elementary.logarithm(a), elementary.exponential(b)
        out[4, i], out[5, i] = elementary.arctangent(a), elementary.arctangent2(a, b)


@kernel(EACH)
def of_math(x, y, out):
    for i in range(x.size):
        a, b = x[i], y[i]
        out[0, i], out[1, i] = math.sin(min(max(a, -4.0), 4.0)), math.cos(min(max(a, -4.0), 4.0))
        out[2, i], out[3, i] = math.log(abs(a) + 1e-9), math.exp(min(max(b, -4.0), 4.0))
        out[4, i], out[5, i] = math.atan(a), math.atan2(a, b)
        out[6, i] = math.hypot(a, b)
        out[7, i], out[8, i] = math.tan(min(max(a, -1.0), 1.0)), math.expm1(min(max(b, -1.0), 1.0))


@pytest.mark.parametrize("one, rows", [(arithmetic, 16), (choices, 10), (functions, 6)])
def test_lanes_have_the_bits_of_runs_alone(one, rows):
    made, alone = wide(one, rows)
    both_nan = np.isnan(made) & np.isnan(alone)  # whose signs may differ
    assert ((made.view(np.int64) == alone.view(np.int64)) | both_nan).all()


def test_functions_of_math_are_those_of_the_c_library_to_rounding():
    made, alone = wide(of_math, 9)
    finite = np.isfinite(alone)
    np.testing.assert_allclose(made[finite], alone[finite], rtol=1e-15, atol=1e-300)
    assert (np.isfinite(made) | ~finite).all()


CALLS = signature("calls", REAL, x=reals("n"), out=reals("n"), counts=wholes("n"))


@helper
def _half(x):
    return 0.5 * x


@kernel(CALLS)
def reduced(x, out, counts):
    total, largest = 0.0, 0.0
    table = matrix(out, 0, 2, out.size // 2)
    for i in range(x.size):
        if any_of(x[i] > 3.9):
            counts[0] += 1
        if all_of(x[i] > -5):
            counts[1] += 1
        counts[2] += int(x[i] - x[i] + 2.5)
        counts[3] += 1 if float(x[i] - x[i] + 2.5) > 2 else 0
        total += _half(x[i])
        largest = max(largest, x[i])
        out[i] = 2 * x[i]
    table[1, 0] = largest
    return total


def test_arguments_results_and_views():
    rng, out, counts = np.random.default_rng(1), aligned_zeros(64, LANES), np.zeros(64, np.int64)
    x = aligned_zeros(64, LANES)
    x[:] = rng.uniform(-4, 4, x.shape)
    one = reduced.for_runs(in_lanes(CALLS))
    total = one(x, out, counts)
    np.testing.assert_allclose(total, 0.5 * x.sum(axis=0), rtol=1e-13)
    assert counts[0] == (x > 3.9).any(axis=1).sum() and counts[1] == 64
    assert counts[2] == 2 * 64 and counts[3] == 64  # of the first run
    np.testing.assert_array_equal(out[32], np.maximum(x.max(axis=0), 0))
    np.testing.assert_array_equal(out[:32], 2 * x[:32])


def test_numbers_that_begin_anywhere():
    """Vectors of arrays that are not aligned to 64 bytes."""
    x, y = operands()
    made, expected = (
        np.zeros(16 * 64 * LANES + 1)[1:].reshape(16, 64, LANES),
        aligned_zeros(16, 64, LANES),
    )
    one = arithmetic.for_runs(in_lanes(EACH))
    one(x, y, expected)
    begin = np.zeros(64 * LANES + 1)[1:].reshape(64, LANES)
    begin[:] = x
    one(begin, y, made)
    np.testing.assert_array_equal(made, expected)


def test_another_number_of_lanes_is_refused():
    one = arithmetic.for_runs(in_lanes(EACH))
    for width in (LANES - 1, LANES + 1):
        with pytest.raises(TypeError, match=f"float64 .n = 64, {LANES}."):
            one(np.zeros((64, width)), *operands())


@kernel(EACH)
def branches(x, y, out):
    for i in range(x.size):
        if x[i] > 0:
            out[0, i] = y[i]


def test_a_branch_on_a_value_does_not_compile():
    with pytest.raises(Exception, match="(?s)Mask8.*x\\[i\\] > 0"):
        branches.for_runs(in_lanes(EACH)).ready()


GROUPS = signature("groups", x=reals("n"), out=reals("m"))


@kernel(GROUPS)
def grouped(x, out):
    for side in sides():
        numbers, made = lanes_of(x, 3, x.size // 8, side), lanes_of(out, 0, out.size // 8, side)
        table = matrix(made, 1, 2, 2)
        total = 0.0
        for i in range(numbers.size):
            total += math.sqrt(numbers[i])
            made[i] = numbers[i] * x[0]
        table[1, 1] = where(total > 9.0, total, -total)


def test_one_source_runs_over_lanes_and_in_plain_python_over_sides():
    x, made, plain = np.random.default_rng(2).uniform(0, 9, 35), np.zeros(48), np.zeros(48)
    grouped(x, made)
    grouped.py_func(x, plain)
    assert np.array_equal(made, plain) and made[:32].all() and not made[40:].any()
    for k in range(8):
        total = np.sqrt(x[3 + k :: 8][:4]).sum()
        assert made[32 + k] == pytest.approx(total if total > 9 else -total, rel=1e-14)
