"""Kernels compiled by numba, each behind a C function of its signature; `kernel_cache` keeps them on
disk. Imported only where a kernel must be compiled.

What of it is private to numba comes from `numba_parts`.
"""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba.extending import intrinsic, lower_builtin, overload, register_model

from . import kernel_cache, lane_types
from .c_calls import hear_of_raised
from .kernel_cache import KernelCache
from .library import is_contraction_set
from .numba_parts import (
    c_function,
    cgutils,
    cpu_target,
    from_dtype,
    global_compiler_lock,
    helper_dispatcher,
    lower_cast,
    models,
    reference_counts_can_be_left_out,
    types,
    typing,
)
from .records import dtype_of
from .signatures import Function, Kind, Number, Numbers, Record, Row, Rows, Signature

small: list[bool] = [False]
"""True where LLVM alone decides what is inlined, for firmware. Under strict arithmetic that changes no
bit."""
fixed: dict[str, int] = {}
"""Sizes by name that are constants instead of what C says, for firmware: what they make needless is
left out."""


OPTIONS: dict[str, Any] = dict(error_model="numpy")
if is_contraction_set():
    OPTIONS["fastmath"] = {"contract", "nsz", "arcp"}
if reference_counts_can_be_left_out():
    OPTIONS["_nrt"] = False


# ---- functions that kernels call


def dispatcher(function: Any) -> Any:
    """numba's own form of a helper, or of a kernel that another kernel calls by its name."""
    if "_dispatcher" not in function.__dict__:
        inlined = getattr(function, "inlined", False)
        options = {**OPTIONS, **getattr(function, "options", {})}
        # numba hands it down to whatever an inlined function is the first to call, which makes the
        # loop fast, and large
        if inlined or small[0]:
            options["forceinline"] = inlined and not small[0]
        function.__dict__["_dispatcher"] = helper_dispatcher(function.py_func, options)
    return function.__dict__["_dispatcher"]


def type_of(function: Any) -> Any:
    """numba's type of a helper or kernel."""
    return types.Dispatcher(dispatcher(function))


# ---- kernels and their C functions


def kernel_address(kernel: Any) -> tuple[int, bool]:
    """(address, whether it was compiled just now) of a kernel's C function."""
    made = _c_function(kernel)
    made._cache = cache_of(kernel)
    made.compile()
    if not kernel.__module__.startswith("strapdown."):
        hear_of_raised()
    kernel.__dict__["_made"] = made  # which holds the machine code
    return made.address, not made._cache_hits


def warm_up() -> None:
    """Compile a trivial function, so that numba's own start-up is over before the first kernel."""
    c_function(lambda x: x + x, (types.float64,), types.float64, OPTIONS).compile()


def is_cached(kernel: Any) -> bool:
    """Return True where the kernel's machine code is on disk."""
    path = cache_of(kernel).path
    return path is not None and path.exists()


def cache_of(kernel: Any) -> KernelCache:
    """Its place on disk."""
    return KernelCache(kernel, _options(kernel))


def key(kernel: Any) -> str:
    """`kernel_cache.key` with the options that it is compiled with."""
    return kernel_cache.key(kernel, _options(kernel))


def intermediate(kernel: Any) -> tuple[str, str]:
    """(LLVM's intermediate representation of a kernel and all that it calls, name in it of the
    function that takes the arguments of C behind two pointers, to its result and to an exception)."""
    with global_compiler_lock:
        made = _c_function(kernel)._compile_uncached()
        made.library.finalize()  # which links what it calls
    return made.library.get_llvm_str(), made.fndesc.llvm_func_name


def _options(kernel: Any) -> dict[str, Any]:
    return {**OPTIONS, **kernel.options}


def _c_function(kernel: Any) -> Any:
    """numba's C function of a kernel, not compiled yet. It calls the kernel with what it makes of
    plain arguments."""
    signature: Signature = kernel.signature
    names = [f"a{i}" for i in range(len(signature.arguments) + len(signature.sizes))]
    listed = ", ".join(names)
    scope = {"kernel": kernel, "unpacked": unpack_arguments(signature), "stored": _store_lane}
    call = f"kernel(*unpacked({listed}))"
    result = numba_type(signature.result) if signature.result else types.void
    if by_address(signature):
        listed, call, result = f"{listed}, to", f"stored(to, {call})", types.void
    entry = eval(f"lambda {listed}: {call}", scope)  # numba counts arguments
    entry.__name__ = entry.__qualname__ = kernel.name
    entry.__module__ = kernel.__module__
    return c_function(entry, c_types(signature), result, _options(kernel))


def by_address(signature: Signature) -> bool:
    """True where the kernel writes its result to an address: how a vector is returned depends on
    the processor."""
    return signature.result is not None and signature.result.lanes > 1


def c_types(signature: Signature) -> tuple[Any, ...]:
    """numba's types of the C arguments of a kernel."""

    def to_type(kind: Kind) -> Any:
        if isinstance(kind, Numbers):
            return types.CPointer(numba_type(kind.item._replace(lanes=1)))
        if isinstance(kind, Record | Row | Rows):
            return types.voidptr
        return types.int64 if isinstance(kind, Function) else numba_type(kind)

    return (
        *map(to_type, signature.kinds),
        *(types.int64 for _ in signature.sizes),
        *(types.CPointer(types.float64) for _ in range(by_address(signature))),
    )


# ---- from kinds to numba's types

_I64 = ir.IntType(64)


class CFunction(types.Callable):  # type: ignore[misc]
    """A kernel of a signature, known by its address."""

    def __init__(self, signature: Signature) -> None:
        self.declared = signature
        super().__init__(f"CFunction({signature})")

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """As declared."""
        result = self.declared.result
        returned = numba_type(result) if result else types.void
        return typing.signature(returned, *map(numba_type, self.declared.kinds), recvr=self)

    def get_call_signatures(self) -> Any:
        """None to choose among."""
        return (), True

    def get_impl_key(self, signature: Any) -> Any:
        """One implementation for all."""
        return CFunction

    @property
    def key(self) -> Any:
        """Equal where their signatures are."""
        return self.name


@register_model(CFunction)
class _Address(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _I64)


@cache
def numba_type(kind: Kind) -> Any:
    """numba's type of a value of a kind."""
    if isinstance(kind, Number):
        if kind.lanes > 1:
            return lane_types.LANE if kind.real else lane_types.WORD
        return types.float64 if kind.real else types.int64
    if isinstance(kind, Numbers):
        # what others have allocated need not begin where a vector would like to
        alone = kind.item.lanes == 1
        return types.Array(numba_type(kind.item), len(kind.shape), "C", aligned=alone)
    if isinstance(kind, Row):
        return from_dtype(dtype_of(kind))
    if isinstance(kind, Rows):
        return types.Array(numba_type(kind.item), len(kind.shape), "C")
    if isinstance(kind, Function):
        return CFunction(kind.signature)
    parts = [numba_type(each) for each in kind.kinds]
    if len(set(parts)) == 1:
        return types.NamedUniTuple(parts[0], len(parts), kind.made)
    return types.NamedTuple(parts, kind.made)


@lower_cast(types.NestedArray, types.Array)  # type: ignore[untyped-decorator]
def _field_to_array(context: Any, builder: Any, kind: Any, target: Any, value: Any) -> Any:
    """An array that is a field of a row, where a kernel takes any array: numba knows no such cast,
    and both are the same struct."""
    return value


# ---- from kinds to LLVM's types and values


def _llvm_number(kind: Number) -> Any:
    return ir.DoubleType() if kind.real else _I64


def _llvm_struct(record: Record) -> Any:
    """Its fields, arrays as pointers, then its sizes: the target decides how long a pointer is."""
    return ir.LiteralStructType([*map(_llvm_type, record.kinds), *(_I64 for _ in record.sizes)])


def _llvm_type(kind: Kind) -> Any:
    """Return the LLVM type of a C argument."""
    if isinstance(kind, Number):
        return _llvm_number(kind)
    if isinstance(kind, Numbers):
        return _llvm_number(kind.item).as_pointer()
    if isinstance(kind, Row | Rows):
        return ir.IntType(8).as_pointer()
    return _I64 if isinstance(kind, Function) else _llvm_struct(kind).as_pointer()


def _array(
    context: Any, builder: Any, kind: Numbers | Rows, pointer: Any, sizes: dict[str, Any]
) -> Any:
    """numba's array of the numbers or rows at a pointer; constant sizes are constants for the compiler."""
    made = context.make_array(numba_type(kind))(context, builder)
    shape = [
        sizes[size] if isinstance(size, str) else context.get_constant(types.intp, size)
        for size in kind.shape
    ]
    strides: list[Any] = []
    item = dtype_of(kind.item).itemsize if isinstance(kind, Rows) else 8 * kind.item.lanes
    size = context.get_constant(types.intp, item)
    step = size
    for length in reversed(shape):
        strides.insert(0, step)
        step = builder.mul(step, length)
    items = shape[0]
    for length in shape[1:]:
        items = builder.mul(items, length)
    made.data = builder.bitcast(pointer, made.data.type)
    made.nitems, made.itemsize = items, size
    made.shape = cgutils.pack_array(builder, shape)
    made.strides = cgutils.pack_array(builder, strides)
    made.meminfo, made.parent = made.meminfo.type(None), made.parent.type(None)
    return made._getvalue()


@cache
def unpack_arguments(signature: Signature) -> Any:
    """An intrinsic: from the C arguments of a kernel to a tuple of those that it was written for."""
    whole = types.Tuple([numba_type(kind) for kind in signature.kinds])

    def codegen(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
        given = dict(zip(signature.sizes, arguments[len(signature.arguments) :]))
        structs = {}
        for i, kind in enumerate(signature.kinds):
            if isinstance(kind, Record):
                pointer = builder.bitcast(arguments[i], _llvm_type(kind))
                count = len(kind.kinds) + len(kind.sizes)
                parts = [
                    builder.load(cgutils.gep_inbounds(builder, pointer, 0, k)) for k in range(count)
                ]
                for k, name in enumerate(kind.sizes, len(kind.kinds)):
                    if name in fixed:
                        parts[k] = context.get_constant(types.int64, fixed[name])
                structs[i] = parts
                given |= dict(zip(kind.sizes, parts[len(kind.kinds) :]))

        def value(kind: Kind, got: Any, sizes: dict[str, Any]) -> Any:
            if isinstance(kind, Numbers | Rows):
                return _array(context, builder, kind, got, sizes)
            if isinstance(kind, Row):
                return builder.bitcast(got, context.get_value_type(numba_type(kind)))
            return got

        values = []
        for i, kind in enumerate(signature.kinds):
            if isinstance(kind, Record):
                sizes = dict(zip(kind.sizes, structs[i][len(kind.kinds) :]))
                fields = [value(each, got, sizes) for each, got in zip(kind.kinds, structs[i])]
                values.append(context.make_tuple(builder, numba_type(kind), fields))
            else:
                values.append(value(kind, arguments[i], given))
        return context.make_tuple(builder, whole, values)

    count = len(signature.arguments) + len(signature.sizes)
    return _of_arguments(count, whole, codegen)


def _of_arguments(count: int, result: Any, codegen: Callable[..., Any]) -> Any:
    """Return an intrinsic of `count` arguments of any type."""
    names = ", ".join(f"a{i}" for i in range(count))
    scope: dict[str, Any] = {"result": result, "codegen": codegen}
    return intrinsic(eval(f"lambda typing, {names}: (result({names}), codegen)", scope))


def _call(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
    """A kernel called by its address."""
    signature = call.args[0].declared
    sizes: dict[str, Any] = {}
    values = [
        _in_c(context, builder, kind, value, sizes)
        for kind, value in zip(signature.kinds, arguments[1:])
    ]
    values += [sizes[name] for name in signature.sizes]
    result, slot = ir.VoidType(), None
    if by_address(signature):
        slot = cgutils.alloca_once(builder, lane_types.LANE.vector)
        values.append(builder.bitcast(slot, ir.DoubleType().as_pointer()))
    elif signature.result:
        result = _llvm_number(signature.result)
    function = ir.FunctionType(result, [value.type for value in values])
    called = builder.call(builder.inttoptr(arguments[0], function.as_pointer()), values)
    if slot is not None:
        return builder.load(slot)
    return called if signature.result else context.get_dummy_value()


@intrinsic
def _store_lane(typing_context: Any, address: Any, value: Any) -> Any:
    """Write a lane to an address."""

    def codegen(context: Any, builder: Any, call: Any, arguments: Any) -> Any:
        pointer = builder.bitcast(arguments[0], arguments[1].type.as_pointer())
        builder.store(arguments[1], pointer, align=8)
        return context.get_dummy_value()

    return types.void(address, lane_types.LANE), codegen


lower_builtin(CFunction, types.VarArg(types.Any))(_call)  # type: ignore[no-untyped-call]


def _in_c(context: Any, builder: Any, kind: Kind, value: Any, sizes: dict[str, Any]) -> Any:
    """A value as C takes it."""
    if isinstance(kind, Row):
        return builder.bitcast(value, _llvm_type(kind))
    if isinstance(kind, Numbers | Rows):
        made = context.make_array(numba_type(kind))(context, builder, value)
        shape = cgutils.unpack_tuple(builder, made.shape, len(kind.shape))
        for name, size in zip(kind.shape, shape):
            if isinstance(name, str):
                sizes.setdefault(name, size)
        return builder.bitcast(made.data, _llvm_type(kind))
    if not isinstance(kind, Record):
        return value
    own: dict[str, Any] = {}
    parts = [
        _in_c(context, builder, each, part, own)
        for each, part in zip(
            kind.kinds, cgutils.unpack_tuple(builder, value, len(kind.kinds)), strict=True
        )
    ]
    sizes |= own
    block = cgutils.alloca_once(builder, _llvm_struct(kind))
    for k, part in enumerate([*parts, *(own[name] for name in kind.sizes)]):
        builder.store(part, cgutils.gep_inbounds(builder, block, 0, k))
    return block


# ---- intrinsics that `jit` names


def _function_at(signature: Signature) -> Any:
    """From an address to what compiled code can call."""
    made = CFunction(signature)

    @intrinsic
    def function_at(typing_context: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            return arguments[0]

        return made(types.int64), codegen

    return function_at


def _row_in(kind: Row) -> Any:
    """From an array of numbers and a place in it to a row that begins there."""
    made = numba_type(kind)

    @intrinsic
    def row_in(typing_context: Any, flat: Any, first: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            source = context.make_array(signature.args[0])(context, builder, arguments[0])
            place = context.cast(builder, arguments[1], signature.args[1], types.intp)
            pointer = builder.gep(source.data, [place])
            return builder.bitcast(pointer, context.get_value_type(made))

        return made(flat, first), codegen

    return row_in


@intrinsic
def _matrix(typing_context: Any, flat: Any, first: Any, rows: Any, columns: Any) -> Any:
    """A C-contiguous view of flat[first : first + rows*columns] without allocation."""
    view_type = types.Array(flat.dtype, 2, "C", aligned=flat.aligned)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        first, rows, columns = (
            context.cast(builder, value, kind, types.intp)
            for value, kind in zip(arguments[1:], signature.args[1:])
        )
        view = context.make_array(view_type)(context, builder)
        size = source.itemsize
        view.data = builder.gep(source.data, [first])
        view.meminfo, view.parent = source.meminfo, source.parent
        view.nitems, view.itemsize = builder.mul(rows, columns), size
        view.shape = cgutils.pack_array(builder, [rows, columns])
        view.strides = cgutils.pack_array(builder, [builder.mul(columns, size), size])
        return view._getvalue()

    return view_type(flat, first, rows, columns), codegen


@intrinsic
def _flatten(typing_context: Any, table: Any) -> Any:
    """The numbers of a C-contiguous matrix as one row, a view without allocation."""
    view_type = types.Array(table.dtype, 1, "C", aligned=table.aligned)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        view = context.make_array(view_type)(context, builder)
        view.data, view.meminfo, view.parent = source.data, source.meminfo, source.parent
        view.nitems, view.itemsize = source.nitems, source.itemsize
        view.shape = cgutils.pack_array(builder, [source.nitems])
        view.strides = cgutils.pack_array(builder, [source.itemsize])
        return view._getvalue()

    return view_type(table), codegen


def _one_or_several(one: Any, several: Any) -> Any:
    """One helper for plain numbers, another for arrays of lanes."""
    names = ", ".join(inspect.signature(one).parameters)
    scope: dict[str, Any] = {"one": one, "several": several, "LANE": lane_types.LANE}
    first = names.partition(",")[0]
    calls = (f"(lambda {names}: {which}({names}))" for which in ("several", "one"))
    wide = f"getattr({first}, 'dtype', {first}) is LANE"
    stub = eval(f"lambda {names}: None", scope)
    overload(stub)(eval(f"lambda {names}: {f' if {wide} else '.join(calls)}", scope))
    return stub


_INTRINSICS = {"matrix": _matrix, "flatten": _flatten, **lane_types.INTRINSICS}


_MADE: dict[str, Callable[..., Any]] = {
    "function_at": _function_at,
    "row_in": _row_in,
    "one_or_several": _one_or_several,
}


def type_of_intrinsic(name: str, *arguments: Any) -> Any:
    """numba's type of the intrinsic that `jit` knows by this name."""
    made = _MADE[name](*arguments) if name in _MADE else _INTRINSICS[name]
    cpu_target.typing_context.refresh()  # it may be new
    return cpu_target.typing_context.resolve_value_type(made)
