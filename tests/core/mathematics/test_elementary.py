"""Elementary functions against those of the C library in long double, and the same bits from
compiled code and from plain Python."""

import ast
import inspect
import math

import numpy as np
import pytest

from strapdown.core.compile.signatures import reals, signature
from strapdown.core.loop.contract import kernel
from strapdown.core.mathematics import elementary
from strapdown.core.mathematics.elementary import (
    MAX_ANGLE,
    arctangent,
    arctangent2,
    cosine,
    exponential,
    exponential_less_one,
    logarithm,
    sine,
    sine_cosine_of_turns,
    tangent,
)

pytestmark = pytest.mark.short
TABLE = signature("of_table", None, x=reals("n", 2), out=reals("n", 10))


@kernel(TABLE)
def of_table(x, out):
    for k in range(len(x)):
        a, b = x[k, 0], x[k, 1]
        out[k, 0], out[k, 1] = sine(a), cosine(a)
        out[k, 2], out[k, 3] = sine_cosine_of_turns(b)
        out[k, 4], out[k, 5] = logarithm(a), exponential(a)
        out[k, 6], out[k, 7] = arctangent(a), arctangent2(a, b)
        out[k, 8], out[k, 9] = tangent(a), exponential_less_one(b)


def spread(seed, lowest, highest, count=4000):
    """Numbers of both signs and of all powers of two between."""
    rng = np.random.default_rng(seed)
    return rng.choice([-1.0, 1.0], count) * 2.0 ** rng.uniform(lowest, highest, count)


def units(found, exact):
    """Largest error in units in the last place of the result."""
    exact = np.asarray(exact, np.longdouble)
    size = np.spacing(np.abs(exact.astype(float)))
    return float(np.max(np.abs(np.asarray(found, np.longdouble) - exact) / size))


def each(function, *columns):
    return [function(*map(float, row)) for row in zip(*columns)]


def test_sine_and_cosine_are_right_to_the_last_place():
    multiples = np.arange(1, 400_000, 997) * (np.pi / 2)  # next to a zero of one of them
    near = np.r_[multiples, np.nextafter(multiples, 0), np.arange(1, 9) * np.pi / 4]
    x = np.r_[spread(1, -40, np.log2(MAX_ANGLE)), near]
    long = x.astype(np.longdouble)
    assert units(each(sine, x), np.sin(long)) < 1
    assert units(each(cosine, x), np.cos(long)) < 1


def test_turns_are_reduced_exactly():
    x = np.r_[spread(2, -40, 0), np.arange(-16, 17) / 8]
    quarters = np.round(4 * x)
    part = 8 * np.arctan(np.longdouble(1)) * (x - quarters / 4)
    c, s = np.cos(part), np.sin(part)
    turned = np.stack([[s, c], [c, -s], [-s, -c], [-c, s]])  # by so many quarters
    exact = turned[quarters.astype(int) % 4, :, np.arange(len(x))]
    assert units(each(sine_cosine_of_turns, x), exact) < 2
    whole = np.round(spread(3, 0, 40))
    assert np.array_equal(
        each(sine_cosine_of_turns, whole + 0.375), [sine_cosine_of_turns(0.375)] * len(whole)
    )


def test_logarithm_and_exponential_are_right_to_the_last_place():
    x = np.r_[np.abs(spread(4, -1074, 1023.9)), np.abs(1 + spread(5, -50, -1)), 5e-324]
    assert units(each(logarithm, x), np.log(x.astype(np.longdouble))) < 1
    x = np.r_[spread(6, -60, 9.46), np.linspace(-745.1, -708, 200)]
    assert units(each(exponential, x), np.exp(x.astype(np.longdouble))) < 1
    less = each(exponential_less_one, x[x < 709])
    assert units(less, np.expm1(x[x < 709].astype(np.longdouble))) < 4


def test_tangents_are_right_to_the_last_places():
    x = np.r_[spread(15, -40, np.log2(MAX_ANGLE)), np.arange(1, 4000) * (np.pi / 2)]
    assert units(each(tangent, x), np.tan(x.astype(np.longdouble))) < 3


def test_arctangents_are_right_to_the_last_place():
    x, y = spread(7, -60, 60), spread(8, -60, 60)
    assert units(each(arctangent, x), np.arctan(x.astype(np.longdouble))) < 1
    x[:2000] = y[:2000] * np.abs(spread(9, -3, 3, 2000))
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert units(each(arctangent2, y, x), exact) < 2


SPECIAL = (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, -1e300)


@pytest.mark.parametrize("a", SPECIAL)
def test_special_values_are_those_of_the_standard(a):
    def same(found, expected):
        assert found == pytest.approx(expected, rel=3e-16, abs=0, nan_ok=True)
        assert math.isnan(expected) or math.copysign(1, found) == math.copysign(1, expected)

    for b in SPECIAL:
        same(arctangent2(a, b), math.atan2(a, b))
    same(arctangent(a), math.atan(a))
    with np.errstate(all="ignore"):
        same(exponential(a), float(np.exp(a)))
        same(exponential_less_one(a), float(np.expm1(a)))
        if not (a == 0 and math.copysign(1, a) < 0):
            same(logarithm(a), float(np.log(a)))
    inside = abs(a) <= MAX_ANGLE
    same(sine(a), math.sin(a) if inside else math.nan)
    same(cosine(a), math.cos(a) if inside else math.nan)


def test_the_exponential_ends_where_float64_does():
    assert exponential(709.78) < math.inf == exponential(709.79)
    assert exponential(-745.14) == 0.0 < exponential(-745.13)


def test_compiled_code_and_plain_python_give_the_same_bits():
    some = np.array([math.inf, -math.inf, 0.0, -0.0, *spread(10, -1070, 1020, 300)])
    x = np.c_[
        np.r_[some, spread(11, -30, 21, 600), spread(12, 0, 9.6, 100)],
        np.r_[spread(13, -30, 40, 804), spread(14, -1000, 1000, 200)],
    ]
    compiled, plain = np.empty((2, len(x), 10))
    with np.errstate(all="ignore"):  # of numpy's numbers, in plain Python
        of_table(x, compiled)
    for into, (a, b) in zip(plain, x.tolist()):
        into[:4] = sine(a), cosine(a), *sine_cosine_of_turns(b)
        into[4:8] = logarithm(a), exponential(a), arctangent(a), arctangent2(a, b)
        into[8:] = tangent(a), exponential_less_one(b)
    assert np.array_equal(np.isnan(compiled), np.isnan(plain))
    known = ~np.isnan(plain)
    assert np.array_equal(compiled[known].view(np.int64), plain[known].view(np.int64))


def test_no_choice_is_made_by_a_statement():
    """For lanes of eight runs both ways must be computed."""
    tree = ast.parse(inspect.getsource(elementary))
    branches = (ast.If, ast.IfExp, ast.While, ast.BoolOp)
    assert not any(isinstance(node, branches) for node in ast.walk(tree))
