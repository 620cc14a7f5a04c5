"""Kernels called from Python by their C address: arguments are checked and laid out once, after which
a call costs a fraction of a microsecond."""

import ctypes
import math
import sys
import threading
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .records import dtype_of
from .signatures import Function, Kind, Number, Numbers, Record, Row, Rows, Signature

_raised: dict[int, BaseException] = {}  # what a kernel raised, by thread


def kernel_call(address: int, signature: Signature, arguments: Sequence[Any]) -> Callable[[], Any]:
    """The call of the kernel at `address` with these arguments, which it keeps. Raises TypeError
    where one is not of its kind, or sizes of one name differ."""
    if len(arguments) != len(signature.arguments):
        raise TypeError(f"{signature.name} takes {len(signature.arguments)} arguments")
    sizes: dict[str, int] = {}
    kept = [
        _in_c(kind, value, f"{signature.name}: {name}", sizes)
        for (name, kind), value in zip(signature.arguments, arguments)
    ]
    # as ctypes passes them, so that no call has to make them
    words = (
        *(ctypes.byref(one) if isinstance(one, ctypes.Structure) else one for one in kept),
        *(ctypes.c_int64.from_param(sizes[name]) for name in signature.sizes),
    )
    kind, lanes = _number(signature.result) if signature.result else None, None
    if signature.result and signature.result.lanes > 1:
        kind, lanes = None, aligned_zeros(signature.result.lanes)
        words = (*words, ctypes.c_void_p(lanes.ctypes.data))
    # no types of arguments: they are of ctypes already, and are passed as they are
    function = ctypes.CFUNCTYPE(kind)(address)

    def call() -> Any:
        result = function(*words)
        if _raised:
            _hand_on()
        return result if lanes is None else lanes

    # a closure keeps what it names: the structs of `kept`, and the arrays behind their addresses
    call.__dict__["kept"] = kept, arguments
    return call


@cache
def struct(record: Record) -> type[ctypes.Structure]:
    """The struct of a record: its fields, then its sizes."""
    fields: list[tuple[str, Any]] = [
        (name, _number(kind) if isinstance(kind, Number) else ctypes.c_void_p)
        for name, kind in record.fields
    ]
    fields += [(f"{name}_size", ctypes.c_int64) for name in record.sizes]
    return type(record.made.__name__, (ctypes.Structure,), {"_fields_": fields})


def aligned_zeros(*shape: int, dtype: type[Any] = np.float64) -> NDArray[Any]:
    """Zeros that begin at a multiple of 64 bytes, where the processor reads eight at once."""
    count = math.prod(shape) * np.dtype(dtype).itemsize
    block = np.zeros(count + 64, np.uint8)
    first = -block.ctypes.data % 64
    return block[first : first + count].view(dtype).reshape(shape)


def _number(kind: Number) -> Any:
    return ctypes.c_double if kind.real else ctypes.c_int64


def _in_c(kind: Kind, value: Any, what: str, sizes: dict[str, int]) -> Any:
    """A value as C takes it."""
    if isinstance(kind, Number):
        return _number(kind).from_param(value)
    if isinstance(kind, Function):
        return ctypes.c_int64.from_param(value if isinstance(value, int) else value.address)
    if isinstance(kind, Numbers | Rows):
        return ctypes.c_void_p.from_param(_address(kind, value, what, sizes))
    if isinstance(kind, Row):
        return ctypes.c_void_p.from_param(_row_address(kind, value, what))
    if len(value) != len(kind.kinds):
        raise TypeError(f"{what} is no {kind.made.__name__}")
    words = [
        _address(each, part, f"{what}.{name}", sizes) if isinstance(each, Numbers | Rows) else part
        for (name, each), part in zip(kind.fields, value)
    ]
    return struct(kind)(*words, *(sizes[name] for name in kind.sizes))


def _address(kind: Numbers | Rows, array: Any, what: str, sizes: dict[str, int]) -> int:
    """Address of the numbers of an array, whose sizes must be those declared; one that is declared
    with a number may be longer where it has one dimension."""
    shape, dtype = kind.shape, _dtype(kind)
    if isinstance(kind, Numbers) and kind.item.lanes > 1:
        shape = (*shape, kind.item.lanes)
    fits = (
        isinstance(array, np.ndarray)
        and array.dtype == dtype
        and array.ndim == len(shape)
        and array.flags.c_contiguous
    )
    if fits:
        for place, (size, declared) in enumerate(zip(array.shape, shape)):
            if isinstance(declared, str):
                fits &= sizes.setdefault(declared, size) == size
            else:
                longer = size > declared and place == 0 and len(kind.shape) == 1
                fits &= size == declared or longer
    if not fits:
        named = ", ".join(
            f"{size} = {sizes[size]}" if size in sizes else str(size) for size in shape
        )
        got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array)
        raise TypeError(
            f"{what} is {got}; it must be {kind.item.name if isinstance(kind, Rows) else dtype} ({named}) "
            f"without gaps"
        )
    return int(array.__array_interface__["data"][0])


def _dtype(kind: Numbers | Rows) -> Any:
    """numpy's type of what an array holds."""
    if isinstance(kind, Rows):
        return dtype_of(kind.item)
    return np.dtype(np.float64 if kind.item.real else np.int64)


def _row_address(kind: Row, value: Any, what: str) -> int:
    """Address of a row, which must be one of an array: a row by itself is a copy that nobody sees."""
    if not (
        isinstance(value, np.void) and value.dtype == dtype_of(kind) and value.base is not None
    ):
        raise TypeError(f"{what} is {type(value)}; it must be a row of an array of {kind.name}")
    return int(value.__array_interface__["data"][0])


# ---- what a kernel raises


def hear_of_raised() -> None:
    """From now on what a compiled kernel raises, which C cannot hand on, is raised behind its call.
    numba tells the interpreter of it as an exception that nobody can catch."""
    before = sys.unraisablehook
    if getattr(before, "of_kernels", False):
        return

    def notice(raised: Any) -> None:
        if "CPUContext" in str(raised.object) and raised.exc_value is not None:
            _raised.setdefault(threading.get_ident(), raised.exc_value)
        else:
            before(raised)

    notice.__dict__["of_kernels"] = True
    sys.unraisablehook = notice


def _hand_on() -> None:
    error = _raised.pop(threading.get_ident(), None)
    if error is not None:
        raise error
