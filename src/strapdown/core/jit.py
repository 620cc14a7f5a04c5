"""How kernels are compiled: declared at import, compiled on use, called by address; `kernel_cache`
keeps them on disk.

Everything private to numba that the package relies on is in these two files. Under
NUMBA_DISABLE_JIT=1 each part has a plain Python twin.
"""

import threading

import numba
from numba import types
from numba.core import cgutils, config, cpu
from numba.extending import intrinsic

from .kernel_cache import KernelCache

COMPILED = not config.DISABLE_JIT


def _reference_counts_can_be_left_out():
    """Whether this numba still knows the private option; without it a sample takes 0.14 us more,
    otherwise all is the same."""
    return hasattr(getattr(cpu, "CPUTargetOptions", None), "_nrt")


OPTIONS = dict(error_model="numpy", nogil=True, fastmath={"contract", "nsz", "arcp"})
if COMPILED and _reference_counts_can_be_left_out():
    OPTIONS["_nrt"] = False


_ONE_AT_A_TIME = threading.Lock()


def helper(function):
    """Compile `function` into the kernels that call it, whatever the argument types."""
    return numba.njit(**OPTIONS)(function)


def plain(function):
    """The Python function behind a helper, for a single call from Python: compiling it there
    would cost a second in each process."""
    return getattr(function, "py_func", function)


def inlined(function):
    """A helper that is always inlined, so that a constant argument makes loops of constant
    length."""
    return numba.njit(**OPTIONS, forceinline=True)(function)


def kernel(signature, **options):
    """Declare a kernel of one `signature`; `compile_kernel` compiles it on first use.

    `options` override the compiler's, e.g. `_nrt=True` for a filter that needs numpy.linalg.
    """

    def declare(function):
        if not COMPILED:
            function.signature = signature
            return function
        dispatcher = numba.njit(**{**OPTIONS, **options})(function)
        dispatcher.signature = signature
        return dispatcher

    return declare


def compile_kernel(dispatcher):
    """Compile (or load from the cache) for the declared signature and refuse any other from now
    on. True when it was compiled."""
    if not COMPILED:
        return False
    with (
        _ONE_AT_A_TIME
    ):  # a second thread would find compilation disabled before it looks for the result
        if dispatcher.signature.args in dispatcher.overloads:
            return False
        dispatcher._cache = KernelCache(
            dispatcher
        )  # here and not where it is declared: importing a module looks at no file
        dispatcher.compile(dispatcher.signature.args)
        dispatcher.disable_compile()
        return not sum(dispatcher.stats.cache_hits.values())


def is_cached(dispatcher):
    """True when compiling it now would not take seconds: compiled in this process already, or on
    disk."""
    if not COMPILED or dispatcher.overloads:
        return True
    path = KernelCache(dispatcher).path
    return path is not None and path.exists()


_TWINS = {}  # without the compiler: address -> Python function


def address(dispatcher):
    """Where the compiled kernel starts, as an integer that crosses from Python in no time. The
    caller answers for its type."""
    if not COMPILED:
        _TWINS[id(dispatcher)] = dispatcher
        return id(dispatcher)
    result = dispatcher.overloads[dispatcher.signature.args]
    return result.library.get_pointer_to_function(result.fndesc.llvm_func_name)


def entry_point(dispatcher):
    """The compiled kernel as Python calls it, without numba's search for a signature (4 us).
    Arguments must have the declared types."""
    return dispatcher.overloads[dispatcher.signature.args].entry_point if COMPILED else dispatcher


def caller(signature):
    """An intrinsic that makes an address into a function of `signature`, callable in compiled
    code."""
    if not COMPILED:
        return _TWINS.__getitem__
    function_type = types.FunctionType(signature)

    @intrinsic
    def function_at(typing_context, address):
        def codegen(context, builder, _, arguments):
            pointer = cgutils.create_struct_proxy(function_type)(context, builder)
            null = context.get_constant_null(types.voidptr)
            pointer.c_addr, pointer.py_addr = null, null
            pointer.jit_addr = builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
            return pointer._getvalue()

        return function_type(types.int64), codegen

    return function_at


def _matrix_twin(flat, first, rows, columns):
    return flat[first : first + rows * columns].reshape(rows, columns)


@intrinsic
def _matrix(typing_context, flat, first, rows, columns):
    """A C-contiguous view of flat[first : first + rows*columns] without allocation."""
    view_type = types.Array(flat.dtype, 2, "C")

    def codegen(context, builder, signature, arguments):
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
        view.shape = cgutils.pack_array(builder, [rows, columns])
        view.strides = cgutils.pack_array(builder, [builder.mul(columns, size), size])
        return view._getvalue()

    return view_type(flat, first, rows, columns), codegen


@intrinsic
def _flatten(typing_context, table):
    """The numbers of a C-contiguous matrix as one row, a view without allocation."""
    view_type = types.Array(table.dtype, 1, "C")

    def codegen(context, builder, signature, arguments):
        source = context.make_array(signature.args[0])(context, builder, arguments[0])
        view = context.make_array(view_type)(context, builder)
        view.data, view.meminfo, view.parent = source.data, source.meminfo, source.parent
        view.nitems, view.itemsize = source.nitems, source.itemsize
        view.shape = cgutils.pack_array(builder, [source.nitems])
        view.strides = cgutils.pack_array(builder, [source.itemsize])
        return view._getvalue()

    return view_type(table), codegen


matrix = _matrix if COMPILED else _matrix_twin
flatten = _flatten if COMPILED else (lambda table: table.reshape(-1))
