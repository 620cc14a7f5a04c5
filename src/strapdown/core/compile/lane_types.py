"""Values of eight runs side by side, as numba and LLVM have them: a Lane of real numbers, a Word of
whole ones, a Mask of truth values. `compiler` imports it; kernels for eight runs are made of them.

Kernels and helpers are compiled for lanes from the source that they have for one run. What they may
do to a number is here, each a vector instruction of its own: LLVM splits eight numbers into what the
processor has, so that results do not depend on it. A truth value of a Mask there is none: numba
names the line of an `if` that would go both ways; `choosing` has what stands in its place.
"""

import inspect
import math
import operator
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from llvmlite import ir
from numba.extending import intrinsic, overload, register_model

from .lane_functions import for_each_helper
from .numba_parts import cgutils, lower_cast, models, typeconv, types
from .signatures import LANES

_INDEX = ir.IntType(32)
Given: TypeAlias = tuple[Callable[..., Any], ...]
"""Functions that mean the same."""


class BatchType(types.Type):  # type: ignore[misc]
    """The numba type of a batch: one item for each run. One number or truth value can stand for all
    items."""

    def __init__(self, name: str, one: Any, item: Any) -> None:
        super().__init__(name)
        self.one, self.vector = one, ir.VectorType(item, LANES)

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """From one for all."""
        return typeconv.Conversion.safe if isinstance(other, self.one) else None

    def unify(self, context: Any, other: Any) -> Any:
        """A variable that begins as one number for all."""
        return self if isinstance(other, self.one) else None


class LaneType(BatchType):
    """A batch of real numbers."""

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """From one for all, and from whole numbers."""
        return (
            typeconv.Conversion.safe if other is WORD else super().can_convert_from(context, other)
        )


class MaskType(BatchType):
    """A batch of truth values."""


class WordType(BatchType):
    """A batch of 64-bit integers; a shift to the right fills with zeros."""


LANE = LaneType(f"Lane{LANES}", types.Number, ir.DoubleType())
MASK = MaskType(f"Mask{LANES}", types.Boolean, ir.IntType(1))
WORD = WordType(f"Word{LANES}", types.Integer, ir.IntType(64))


def _model(of: BatchType) -> None:
    class Model(models.PrimitiveModel):  # type: ignore[misc]
        def __init__(self, manager: Any, kind: Any) -> None:
            super().__init__(manager, kind, of.vector)

    register_model(type(of))(Model)


def _of_one(of: BatchType, single: Any, item: Any) -> None:
    """Broadcast of one number to all runs."""

    def cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
        one = context.cast(builder, value, fromty, item)
        if of is MASK and one.type.width > 1:
            one = builder.trunc(one, ir.IntType(1))
        none = ir.Constant(of.vector, ir.Undefined)
        first = builder.insert_element(none, one, _INDEX(0))
        every = ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES)
        return builder.shuffle_vector(first, none, every)

    lower_cast(single, type(of))(cast)


for _each, _single, _item in (
    (LANE, types.Number, types.float64),
    (MASK, types.Boolean, types.boolean),
    (WORD, types.Integer, types.int64),
):
    _model(_each)
    _of_one(_each, _single, _item)


def _real(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return builder.sitofp(value, LANE.vector)


lower_cast(WordType, LaneType)(_real)


# ---- operators


def _both(of: BatchType, *given: Any) -> bool:
    """True where at least one of these types is `of` and all others are `of` or its scalar."""
    return any(one is of for one in given) and all(
        one is of or isinstance(one, of.one) for one in given
    )


def _operator(
    of: BatchType, result: Any, count: int, emit: Callable[..., Any], *functions: Any
) -> Any:
    """Implement numba's functions of `count` arguments for `of`, by `emit` of a builder and
    vectors."""
    names = ("a", "b", "c")[:count]

    def declare(context: Any, *given: Any) -> Any:
        def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
            wide = [context.cast(builder, v, t, of) for v, t in zip(values, call.args)]
            return emit(builder, *wide)

        return result(*given), codegen

    listed = ", ".join(names)
    scope = {"declared": declare, "_both": _both, "of": of}
    made = intrinsic(eval(f"lambda typing, {listed}: declared(typing, {listed})", scope))
    scope["made"] = made
    chosen = eval(
        f"lambda {listed}: (lambda {listed}: made({listed})) if _both(of, {listed}) else None",
        scope,
    )
    for function in functions:
        overload(function)(chosen)
    return made


def _instruction(name: str) -> Callable[..., Any]:
    return lambda builder, *values: getattr(builder, name)(*values)


def _comparison(kind: str, sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: getattr(builder, kind)(sign, a, b)


def _of_llvm(name: str) -> Callable[..., Any]:
    """One of LLVM's own functions of vectors of doubles."""

    def emit(builder: Any, *values: Any) -> Any:
        kind = ir.FunctionType(LANE.vector, [LANE.vector] * len(values))
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return builder.call(function, values)

    return emit


_o: Any = operator
_functions: Given
for _name, _functions in {
    "fadd": (_o.add, _o.iadd),
    "fsub": (_o.sub, _o.isub),
    "fmul": (_o.mul, _o.imul),
    "fdiv": (_o.truediv, _o.itruediv),
}.items():
    _operator(LANE, LANE, 2, _instruction(_name), *_functions)
for _name, _functions in {
    "add": (_o.add, _o.iadd),
    "sub": (_o.sub, _o.isub),
    "and_": (_o.and_, _o.iand),
    "or_": (_o.or_, _o.ior),
    "xor": (_o.xor, _o.ixor),
    "shl": (_o.lshift, _o.ilshift),
    "lshr": (_o.rshift, _o.irshift),
}.items():
    _operator(WORD, WORD, 2, _instruction(_name), *_functions)
for _name, _functions in {
    "and_": (_o.and_, _o.iand),
    "or_": (_o.or_, _o.ior),
    "xor": (_o.ne,),
}.items():
    _operator(MASK, MASK, 2, _instruction(_name), *_functions)
for _sign, _function in {
    "<": _o.lt,
    "<=": _o.le,
    ">": _o.gt,
    ">=": _o.ge,
    "==": _o.eq,
}.items():
    _operator(LANE, MASK, 2, _comparison("fcmp_ordered", _sign), _function)
    _operator(WORD, MASK, 2, _comparison("icmp_signed", _sign), _function)
_operator(LANE, MASK, 2, _comparison("fcmp_unordered", "!="), _o.ne)
_operator(WORD, MASK, 2, _comparison("icmp_signed", "!="), _o.ne)
_operator(LANE, LANE, 1, _instruction("fneg"), _o.neg)
_operator(MASK, MASK, 1, _instruction("not_"), _o.invert, _o.not_)


# ---- functions of numbers, as math and Python have them

_operator(LANE, LANE, 1, _of_llvm("sqrt"), math.sqrt, np.sqrt)
_operator(LANE, LANE, 1, _of_llvm("fabs"), abs, math.fabs, np.abs)
_floor = _operator(LANE, LANE, 1, _of_llvm("floor"), np.floor, math.floor)
_operator(LANE, LANE, 2, _of_llvm("copysign"), math.copysign)
_operator(LANE, MASK, 1, lambda builder, a: builder.fcmp_unordered("uno", a, a), math.isnan)
# as Python has them: the first where the second is not less, or more
_operator(
    LANE, LANE, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a), min
)
_operator(
    LANE, LANE, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a), max
)


def _first(builder: Any, a: Any) -> Any:
    return builder.extract_element(a, _INDEX(0))


_first_of_lane = _operator(LANE, types.float64, 1, _first)


# what is the same in all runs: a mode, a count; an option, a time
overload(int)(lambda x: (lambda x: int(_first_of_lane(x))) if x is LANE else None)
overload(float)(lambda x: (lambda x: _first_of_lane(x)) if x is LANE else None)


def _overload(function: Callable[..., Any], helper: Callable[..., Any]) -> None:
    """Let calls of a function with lanes be calls of its helper."""
    listed = ", ".join(("a", "b")[: len(inspect.signature(helper).parameters)])
    scope: dict[str, Any] = {"helper": helper, "_both": _both, "LANE": LANE}
    chosen = (
        f"lambda {listed}: (lambda {listed}: helper({listed})) if _both(LANE, {listed}) else None"
    )
    overload(function)(eval(chosen, scope))


for_each_helper(_overload)


# ---- choices, and the bits of a number: the intrinsics of `choosing` and `elementary`


@intrinsic
def _where(typing: Any, condition: Any, this: Any, that: Any) -> Any:
    """One of two values, by a truth value or by those of each run."""
    result = typing.unify_types(this, that)
    if condition is MASK and not isinstance(result, BatchType):
        result = LANE if isinstance(result, types.Float) else WORD

    def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
        chosen = values[0]
        if condition is not MASK:
            chosen = context.cast(builder, chosen, condition, types.boolean)
        a, b = (context.cast(builder, v, t, result) for v, t in zip(values[1:], call.args[1:]))
        return builder.select(chosen, a, b)

    return result(condition, this, that), codegen


def _over_runs(of_every: bool) -> Any:
    """An intrinsic: whether a truth value holds in any run, or in every one."""

    def over_runs(typing: Any, condition: Any) -> Any:
        def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
            if condition is not MASK:
                return context.cast(builder, values[0], condition, types.boolean)
            bits = ir.IntType(LANES)
            found = builder.bitcast(values[0], bits)
            none = bits(2**LANES - 1 if of_every else 0)
            return builder.icmp_unsigned("==" if of_every else "!=", found, none)

        return types.boolean(condition), codegen

    return intrinsic(over_runs)


@intrinsic
def _bits(typing: Any, x: Any) -> Any:
    """The bits of a number of 64 as a whole number."""

    def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
        if x is LANE:
            return builder.bitcast(values[0], WORD.vector)
        return builder.bitcast(context.cast(builder, values[0], x, types.float64), ir.IntType(64))

    return (WORD if x is LANE else types.int64)(x), codegen


@intrinsic
def _from_bits(typing: Any, i: Any) -> Any:
    """The number of the bits of a whole one."""

    def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
        if i is WORD:
            return builder.bitcast(values[0], LANE.vector)
        return builder.bitcast(context.cast(builder, values[0], i, types.int64), ir.DoubleType())

    return (LANE if i is WORD else types.float64)(i), codegen


@intrinsic
def _sides(typing: Any) -> Any:
    """All lanes at once."""
    once = types.UniTuple(types.intp, 1)

    def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
        return context.make_tuple(builder, once, [context.get_constant(types.intp, 0)])

    return once(), codegen


@intrinsic
def _lanes_of(typing: Any, flat: Any, first: Any, count: Any, side: Any) -> Any:
    """Numbers side by side as lanes."""
    view_type = types.Array(LANE, 1, "C", aligned=False)

    def codegen(context: Any, builder: Any, call: Any, values: Any) -> Any:
        source = context.make_array(call.args[0])(context, builder, values[0])
        first, count = (
            context.cast(builder, value, kind, types.intp)
            for value, kind in zip(values[1:3], call.args[1:3])
        )
        view = context.make_array(view_type)(context, builder)
        size = context.get_constant(types.intp, 8 * LANES)
        view.data = builder.bitcast(builder.gep(source.data, [first]), view.data.type)
        view.meminfo, view.parent = source.meminfo, source.parent
        view.nitems, view.itemsize = count, size
        view.shape = cgutils.pack_array(builder, [count])
        view.strides = cgutils.pack_array(builder, [size])
        return view._getvalue()

    return view_type(flat, first, count, side), codegen


INTRINSICS = {
    "sides": _sides,
    "lanes_of": _lanes_of,
    "bits": _bits,
    "from_bits": _from_bits,
    "where": _where,
    "any_of": _over_runs(False),
    "all_of": _over_runs(True),
}
"""Intrinsics of compiled code, by the names that `jit` knows."""
