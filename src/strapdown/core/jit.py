"""How kernels are compiled: declared at import, compiled on use, called by address; `kernel_cache`
keeps them on disk.

Everything private to numba that the package relies on is in these two files. Under
NUMBA_DISABLE_JIT=1 each part has a plain Python twin.
"""

import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core import cgutils, config, cpu
from numba.extending import intrinsic

from ..typing import Array
from .kernel_cache import KernelCache

_cgutils: Any = cgutils  # numba's own annotations are not complete
_config: Any = config

COMPILED: bool = not _config.DISABLE_JIT

Function = TypeVar("Function", bound=Callable[..., Any])
"""What is compiled keeps the type of the Python function, as its callers see it."""


def _reference_counts_can_be_left_out() -> bool:
    """Whether this numba still knows the private option; without it a sample takes 0.14 us more,
    otherwise all is the same."""
    return hasattr(getattr(cpu, "CPUTargetOptions", None), "_nrt")


OPTIONS: dict[str, Any] = dict(
    error_model="numpy", nogil=True, fastmath={"contract", "nsz", "arcp"}
)
if COMPILED and _reference_counts_can_be_left_out():
    OPTIONS["_nrt"] = False


_ONE_AT_A_TIME = threading.Lock()


def helper(function: Function) -> Function:
    """Compile `function` into the kernels that call it, whatever the argument types."""
    return numba.njit(**OPTIONS)(function)


def plain(function: Function) -> Function:
    """The Python function behind a helper, for a single call from Python: compiling it there
    would cost a second in each process."""
    return getattr(function, "py_func", function)


def inlined(function: Function) -> Function:
    """A helper that is always inlined, so that a constant argument makes loops of constant
    length."""
    return numba.njit(**OPTIONS, forceinline=True)(function)


def kernel(signature: Any, **options: Any) -> Callable[[Function], Function]:
    """Declare a kernel of one `signature`; `compile_kernel` compiles it on first use.

    `options` override the compiler's, e.g. `_nrt=True` for a filter that needs numpy.linalg.
    """

    def declare(function: Function) -> Function:
        if not COMPILED:
            function.signature = signature  # type: ignore[attr-defined]  # as of a dispatcher
            return function
        dispatcher = numba.njit(**{**OPTIONS, **options})(function)
        dispatcher.signature, dispatcher.declared = signature, time.time_ns()
        return dispatcher

    return declare


def compile_kernel(dispatcher: Any) -> bool:
    """Compile (or load from the cache) for the declared signature and refuse any other from now
    on. True when it was compiled."""
    if not COMPILED:
        return False
    # a second thread would find compilation disabled before it looks for the result
    with _ONE_AT_A_TIME:
        if dispatcher.signature.args in dispatcher.overloads:
            return False
        # here and not where it is declared: importing a module looks at no file
        dispatcher._cache = KernelCache(dispatcher)
        dispatcher.compile(dispatcher.signature.args)
        dispatcher.disable_compile()
        return not sum(dispatcher.stats.cache_hits.values())


def is_cached(dispatcher: Any) -> bool:
    """True when compiling it now would not take seconds: compiled in this process already, or on
    disk."""
    if not COMPILED or dispatcher.overloads:
        return True
    path = KernelCache(dispatcher).path
    return path is not None and path.exists()


_TWINS: dict[int, Any] = {}  # without the compiler: address -> Python function


def address(dispatcher: Any) -> int:
    """Where the compiled kernel starts, as an integer that crosses from Python in no time. The
    caller answers for its type."""
    if not COMPILED:
        _TWINS[id(dispatcher)] = dispatcher
        return id(dispatcher)
    result = dispatcher.overloads[dispatcher.signature.args]
    return result.library.get_pointer_to_function(result.fndesc.llvm_func_name)


def entry_point(dispatcher: Any) -> Any:
    """The compiled kernel as Python calls it, without numba's search for a signature (4 us).
    Arguments must have the declared types."""
    return dispatcher.overloads[dispatcher.signature.args].entry_point if COMPILED else dispatcher


def caller(signature: Any) -> Callable[[int], Any]:
    """An intrinsic that makes an address into a function of `signature`, callable in compiled
    code."""
    if not COMPILED:
        return _TWINS.__getitem__
    function_type = types.FunctionType(signature)

    @intrinsic
    def function_at(typing_context: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            pointer = _cgutils.create_struct_proxy(function_type)(context, builder)
            null = context.get_constant_null(types.voidptr)
            pointer.c_addr, pointer.py_addr = null, null
            pointer.jit_addr = builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
            return pointer._getvalue()

        return function_type(types.int64), codegen

    return cast(Any, function_at)


def _matrix_twin(flat: Array, first: int, rows: int, columns: int) -> Array:
    return flat[first : first + rows * columns].reshape(rows, columns)


@intrinsic
def _matrix(typing_context: Any, flat: Any, first: Any, rows: Any, columns: Any) -> Any:
    """A C-contiguous view of flat[first : first + rows*columns] without allocation."""
    view_type = types.Array(flat.dtype, 2, "C")

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        first, rows, columns = (
            context.cast(builder, value, kind, types.intp)
            for value, kind in zip(arguments[1:], signature.args[1:])
        )
        view = context.make_array(view_type)(context, builder)
        size = context.get_constant(types.intp, 8)
        view.data = builder.gep(source.data, [first])
        view.meminfo, view.parent = source.meminfo, source.parent
        view.nitems, view.itemsize = builder.mul(rows, columns), size
        view.shape = _cgutils.pack_array(builder, [rows, columns])
        view.strides = _cgutils.pack_array(builder, [builder.mul(columns, size), size])
        return view._getvalue()

    return view_type(flat, first, rows, columns), codegen


@intrinsic
def _flatten(typing_context: Any, table: Any) -> Any:
    """The numbers of a C-contiguous matrix as one row, a view without allocation."""
    view_type = types.Array(table.dtype, 1, "C")

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        view = context.make_array(view_type)(context, builder)
        view.data, view.meminfo, view.parent = source.data, source.meminfo, source.parent
        view.nitems, view.itemsize = source.nitems, source.itemsize
        view.shape = _cgutils.pack_array(builder, [source.nitems])
        view.strides = _cgutils.pack_array(builder, [source.itemsize])
        return view._getvalue()

    return view_type(table), codegen


def _flatten_twin(table: Array) -> Array:
    return table.reshape(-1)


matrix: Callable[[Array, int, int, int], Array] = cast(Any, _matrix) if COMPILED else _matrix_twin
flatten: Callable[[Array], Array] = cast(Any, _flatten) if COMPILED else _flatten_twin
