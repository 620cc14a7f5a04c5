"""Kernels and helpers as they are declared: Python functions that become machine code when a run
needs them, and are called by their C address.

The machine code comes from the `library` of kernels where that fits, else from the `compiler`, which
alone imports numba. Under NUMBA_DISABLE_JIT=1 the Python functions run themselves.
"""

import os
import struct
import threading
import time
from collections.abc import Callable, Iterable
from functools import cached_property, partial, update_wrapper
from typing import Any, TypeVar, cast

import numpy as np

from ...extras import optional_import
from ...typing import Array
from . import c_calls, library
from .records import check_names, dtype_of
from .signatures import LANES, Row, Signature

COMPILED: bool = os.environ.get("NUMBA_DISABLE_JIT", "0").strip() in ("", "0")

Function = TypeVar("Function", bound=Callable[..., Any])
"""A compiled function keeps the type of the Python function, as its callers see it."""

_ONE_AT_A_TIME = threading.RLock()


class Helper:
    """A function that kernels call; from Python it is called as it is written."""

    def __init__(self, function: Callable[..., Any], inlined: bool) -> None:
        update_wrapper(self, function)
        self.py_func, self.inlined = function, inlined

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """The Python function."""
        return self.py_func(*arguments, **named)

    @property
    def closes_over(self) -> tuple[Any, ...]:
        """Its part in the machine code of a kernel that calls it (`closed_over`)."""
        return "helper", self.py_func, self.inlined

    @property
    def _numba_type_(self) -> Any:
        from . import compiler

        return compiler.type_of(self)


class Kernel:
    """A function of one signature with a C address."""

    def __init__(
        self, function: Callable[..., Any], signature: Signature, name: str, options: dict[str, Any]
    ) -> None:
        update_wrapper(self, function)
        self.__qualname__: str
        self.py_func, self.signature, self.name, self.options = function, signature, name, options
        self.declared = time.time_ns()
        self._address = 0  # not known yet
        self._for_runs: Kernel | None = None

    @property
    def stem(self) -> str:
        """Module and name."""
        inside = self.__qualname__.removesuffix(self.py_func.__name__)
        return f"{self.__module__}.{inside}{self.name}"

    @property
    def symbol(self) -> str:
        """Its name in a library."""
        return self.stem.replace(".", "_")

    @property
    def address(self) -> int:
        """Where its machine code begins. The caller answers for what it calls it with."""
        if not self._address:
            self.ready()
        return self._address

    def ready(self) -> bool:
        """Find its machine code, or make it; True where it was compiled just now. Raises what the
        compiler does."""
        with _ONE_AT_A_TIME:
            if self._address:
                return False
            if not COMPILED:
                self._address = id(self)
                _TWINS[self._address] = self.py_func
                return False
            if found := library.find(self):
                self._address = found
                return False
            self._address, new = _compiler(self).kernel_address(self)
            return new

    @property
    def at_hand(self) -> bool:
        """True where `ready` returns at once: the machine code is in the library or in the
        cache."""
        if not self._address and COMPILED:
            self._address = library.find(self) or 0
        if self._address or not COMPILED:
            return True
        return bool(_compiler(self).is_cached(self))

    @property
    def why_not_kept(self) -> str:
        """The value for which it is compiled in each process; empty where there is none."""
        return str(_compiler(self).cache_of(self).why_not)

    @property
    def closes_over(self) -> tuple[Any, ...]:
        """Its part in the machine code of a kernel that calls it by name (`closed_over`)."""
        return "kernel", self.py_func, self.options

    def bind(self, *arguments: Any) -> Callable[[], Any]:
        """The call with these arguments, checked once; arrays may change, but not move. Raises
        TypeError where one is of another type or size than declared."""
        if not COMPILED:
            return partial(self.py_func, *arguments)
        return c_calls.kernel_call(self.address, self.signature, arguments)

    def __call__(self, *arguments: Any) -> Any:
        """Once; `bind` is for many calls."""
        return self.bind(*arguments)()

    def for_runs(self, signature: Signature) -> "Kernel":
        """The kernel of the same source for several runs at once, of a signature that `in_lanes`
        made."""
        if self._for_runs is None:
            self._for_runs = Kernel(self.py_func, signature, f"{self.name}_in_lanes", self.options)
        return self._for_runs

    @property
    def _numba_type_(self) -> Any:
        from . import compiler

        return compiler.type_of(self)


def _compiler(kernel: Kernel) -> Any:
    """The module that compiles kernels. Raises DataError where numba is not installed."""
    why = library.why_not(kernel)
    with optional_import(f"{kernel.stem} must be compiled ({why}), which"):
        from . import compiler
    return compiler


_TWINS: dict[int, Callable[..., Any]] = {}  # without the compiler: address -> Python function


def helper(function: Function) -> Function:
    """Compile `function` into the kernels that call it, whatever the argument types."""
    return cast(Any, Helper(function, False)) if COMPILED else function


def inline(function: Function) -> Function:
    """A helper that is always inlined, so that a constant argument makes loops of constant
    length."""
    return cast(Any, Helper(function, True)) if COMPILED else function


def kernel(
    signature: Signature, name: str | None = None, **options: Any
) -> Callable[[Function], Function]:
    """Declare a kernel of one `signature`, which is compiled on first use.

    name: where it is not that of the function. `options` override the compiler's, e.g. `_nrt=True`
    for a filter that needs numpy.linalg. Raises TypeError where the function reads a row with named
    fields by number.
    """

    def declare(function: Function) -> Function:
        plain: Any = function
        check_names(plain, signature)
        return cast(Any, Kernel(function, signature, name or plain.__name__, options))

    return declare


def compile_kernel(kernel: Any) -> bool:
    """`Kernel.ready`."""
    return bool(kernel.ready())


def compile_together(
    kernels: Iterable[Any], what: str, notify: Callable[[str], None] | None = None
) -> None:
    """Compile those kernels that are not at hand, on all cores. `notify` gets a line where that takes
    seconds: how many, as far as this machine has shown it, and the progress. A kernel that does not
    compile is left to whoever calls it."""
    slow = [kernel for kernel in dict.fromkeys(kernels) if not kernel.at_hand]
    if slow:
        from . import side_by_side

        first = said_first(slow[0], what)

        def tell(progress: Any) -> None:
            done, count, seconds = progress
            left = (
                ""
                if seconds is None
                else f", about {_round_seconds(seconds)} s{' left' * (done > 0)}"
            )
            if notify and not done:
                notify(f"compiling {first.format(left)}")
            elif notify and done < count:
                notify(f"compiling {what}: {done} of {count} kernels{left}")

        side_by_side.fill(slow, tell)


def said_first(kernel: Any, what: str) -> str:
    """Why a kernel is compiled, with a place for the time that it takes."""
    why = library.why_not(kernel) if library.there() else ""
    unkept = kernel.why_not_kept
    when = f"in each process, since {unkept}" if unkept else "for the first time on this machine"
    texts = (what, when, f" ({why})" if why else "")
    what, when, why = (text.replace("{", "{{").replace("}", "}}") for text in texts)
    return f"{what} {when}{{}} ...{why}"


def _round_seconds(seconds: float) -> int:
    """To what an estimate is worth."""
    return max(round(seconds), 1) if seconds < 20 else 5 * round(seconds / 5)


def address(kernel: Any) -> int:
    """`Kernel.address`, as an integer that crosses from Python in no time."""
    return int(kernel.address)


def bind_kernel(kernel: Any, *arguments: Any) -> Callable[[], Any]:
    """`Kernel.bind`."""
    return cast(Callable[[], Any], kernel.bind(*arguments))


class Intrinsic:
    """An operation with a compiler intrinsic for compiled code, and a twin for Python."""

    def __init__(self, twin: Callable[..., Any], name: str, *arguments: Any) -> None:
        self._twin, self._name, self._arguments = twin, name, arguments

    def __call__(self, *arguments: Any) -> Any:
        """The twin."""
        return self._twin(*arguments)

    @property
    def closes_over(self) -> tuple[Any, ...]:
        """Its part in the machine code of a kernel that calls it (`closed_over`)."""
        return "intrinsic", self._name, self._arguments

    @cached_property
    def _numba_type_(self) -> Any:
        from . import compiler

        return compiler.type_of_intrinsic(self._name, *self._arguments)


def caller(signature: Signature) -> Callable[[int], Any]:
    """Return the intrinsic that turns an address into a function of `signature`, callable in
    compiled code."""
    return cast(Any, Intrinsic(_TWINS.__getitem__, "function_at", signature))


def row_in(kind: Row) -> Callable[[Array, int], Any]:
    """Return the view of an array's numbers from a place on as a row, whose fields are all real: a
    function (flat, first) -> row, without allocation."""

    def twin(flat: Array, first: int) -> Any:
        dtype = dtype_of(kind)
        own = flat[first : first + dtype.itemsize // flat.itemsize]
        return own.view(dtype).view(np.recarray)[0]

    return cast(Any, Intrinsic(twin, "row_in", kind))


def _matrix_twin(flat: Array, first: int, rows: int, columns: int) -> Array:
    return flat[first : first + rows * columns].reshape(rows, columns)


def _flatten_twin(table: Array) -> Array:
    return table.reshape(-1)


def _sides_twin() -> tuple[int, ...]:
    return tuple(range(LANES))


def _lanes_of_twin(flat: Array, first: int, count: int, side: int) -> Array:
    return flat[first + side : first + LANES * count : LANES]


def _bits_twin(x: float) -> int:
    return int(struct.unpack("<q", struct.pack("<d", x))[0])


def _from_bits_twin(i: int) -> float:
    return float(struct.unpack("<d", struct.pack("<Q", int(i) & (1 << 64) - 1))[0])


matrix: Callable[[Array, int, int, int], Array] = cast(Any, Intrinsic(_matrix_twin, "matrix"))
"""A C-contiguous view of flat[first : first + rows*columns] without allocation."""
flatten: Callable[[Array], Array] = cast(Any, Intrinsic(_flatten_twin, "flatten"))
"""The numbers of a C-contiguous matrix as one row, a view without allocation."""
sides: Callable[[], tuple[int, ...]] = cast(Any, Intrinsic(_sides_twin, "sides"))
"""`for side in sides():` is gone through once by compiled code, where `lanes_of` shows eight numbers at
a time, and by plain Python once for each of the eight."""
lanes_of: Callable[[Array, int, int, int], Array] = cast(Any, Intrinsic(_lanes_of_twin, "lanes_of"))
"""(flat, first, count, side): flat[first : first + 8 count], eight and eight numbers side by side, as
`count` lanes without allocation; in plain Python the numbers of one side."""
bits: Callable[[float], int] = cast(Any, Intrinsic(_bits_twin, "bits"))
"""The bits of a float64 as an int64."""
from_bits: Callable[[int], float] = cast(Any, Intrinsic(_from_bits_twin, "from_bits"))
"""The float64 of the last 64 bits of an integer."""
