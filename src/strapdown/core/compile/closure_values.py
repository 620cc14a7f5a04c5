"""Values that a kernel closes over: globals, closure cells and defaults of its function and of every
function that it can call. The compiler freezes them into the machine code. Imports no compiler.

Each value is put into words that are equal in two processes only where the values are equal bit for
bit. An object without such words, such as one of a class of one's own, raises NoWords.
"""

import dis
import hashlib
import struct
import sys
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeAlias

import numpy as np

Words: TypeAlias = tuple[Any, ...]
"""Nested tuples of text; a function that is compiled as well stands for itself."""
KNOWN_BY_VERSION = sys.stdlib_module_names | {"numpy", "numba", "llvmlite"}
"""Packages whose values do not change while their versions stay."""
BUILT_IN = (bool, int, str, bytes, type(None), type(...))
READS = {"LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF"}
ATTRIBUTES = {"LOAD_ATTR", "LOAD_METHOD"}


class NoWords(RuntimeError):
    """A value that nothing identifies in another process; the message names it."""


def functions(kernel: Any) -> dict[FunctionType, Words]:
    """The function of a kernel and all that it can call, as they are met, each with the words of the
    values that it reads. Raises NoWords."""
    found: dict[FunctionType, Words] = {}
    todo: list[FunctionType] = [kernel.py_func]
    while todo:
        function = todo.pop()
        if function not in found:
            found[function] = tuple(_read_by(function))
            todo += _functions_in(found[function])
    return found


def digest(of: dict[FunctionType, Words], identity: Callable[[CodeType], Any]) -> str:
    """Digest of `functions`: of what `identity` makes of the code of each, and of its values."""
    number = {function: f"function {index}" for index, function in enumerate(of)}
    words = [
        (identity(function.__code__), _number_functions(each, number))
        for function, each in of.items()
    ]
    return hashlib.sha256(repr(words).encode()).hexdigest()


def _functions_in(words: Words) -> Iterator[FunctionType]:
    for word in words:
        if isinstance(word, FunctionType):
            yield word
        elif isinstance(word, tuple):
            yield from _functions_in(word)


def _number_functions(words: Any, number: dict[FunctionType, str]) -> Any:
    """The words with numbers in place of functions, whose addresses differ between processes."""
    if isinstance(words, tuple):
        return tuple(_number_functions(word, number) for word in words)
    return number[words] if isinstance(words, FunctionType) else words


# ---- what a function reads


def _read_by(function: FunctionType) -> Iterator[Words]:
    """Words of the defaults of a function, and of each global and closure cell that it reads."""
    defaults = (function.__defaults__, function.__kwdefaults__)
    yield _words(defaults, f"a default of {function.__qualname__}")
    scope = _scope(function)
    for path in _reads(function.__code__, scope):
        value, taken = scope[path[0]], 1
        # of anything but a module of one's own the whole value counts
        while taken < len(path) and isinstance(value, ModuleType) and not _is_plain(value):
            value, taken = getattr(value, path[taken], None), taken + 1
        yield (*path[:taken], _words(value, f"{'.'.join(path)} in {function.__qualname__}"))


def _scope(function: FunctionType) -> dict[str, Any]:
    """Globals and closure cells of a function by name."""
    if function.__closure__ is None:
        return function.__globals__
    cells = zip(function.__code__.co_freevars, function.__closure__)
    try:
        return function.__globals__ | {name: cell.cell_contents for name, cell in cells}
    except ValueError:
        raise NoWords(f"a closure cell of {function.__qualname__} is empty") from None


def _reads(code: CodeType, scope: dict[str, Any]) -> list[tuple[str, ...]]:
    """Paths of what code reads of its scope: (math,), or (module, NAME). To take instructions apart
    takes most of the time, and is needed only where a name may be that of an attribute."""
    names = sorted(name for name in _names(code) if name in scope)
    if all(_is_plain(scope[name]) for name in names):
        return [(name,) for name in names]
    return sorted(path for path in _paths(code) if path[0] in scope)


def _is_plain(value: Any) -> bool:
    """True for a value that is identified as a whole, and that does no harm where code does not
    read it."""
    if isinstance(value, ModuleType):
        return _known_by_version(value.__name__)
    return type(value) in (int, float, slice) or hasattr(value, "closes_over")


@cache
def _names(code: CodeType) -> frozenset[str]:
    """Names in code: of globals, of closure cells and of attributes."""
    return frozenset(code.co_names + code.co_freevars).union(*map(_names, _inner(code)))


@cache
def _paths(code: CodeType) -> frozenset[tuple[str, ...]]:
    """Globals and closure cells that code reads, each with the attributes taken of it."""
    found: set[tuple[str, ...]] = set()
    path: tuple[str, ...] = ()
    for each in dis.get_instructions(code):
        if each.opname in READS:
            path = (each.argval,)
        elif each.opname in ATTRIBUTES and path:
            path = (*path, each.argval)
        elif path:
            found.add(path)
            path = ()
    return frozenset(found).union(*map(_paths, _inner(code)))


def _inner(code: CodeType) -> list[CodeType]:
    """Code of the functions that are defined inside."""
    return [each for each in code.co_consts if isinstance(each, CodeType)]


# ---- values in words


def _words(value: Any, what: str) -> Words:
    """A value in words. `what` names it where it has none."""
    kind = type(value)
    if kind in BUILT_IN:
        return kind.__name__, hex(value) if kind is int else repr(value)
    if kind in (float, complex):
        parts = (value.real, value.imag)
        return kind.__name__, *(struct.pack("<d", part).hex() for part in parts)
    if isinstance(value, np.generic) or kind is np.ndarray:
        return _numbers(value, what)
    if isinstance(value, Enum):
        return _name(kind), value.name, _words(value.value, what)
    if isinstance(value, tuple) or kind in (list, set, frozenset, dict, slice):
        return (_name(kind), *_parts(value, what))
    if isinstance(value, ModuleType | type):
        return _of_namespace(value, what)
    return _of_callable(value, what)


def _numbers(value: Any, what: str) -> Words:
    """Words of an array, or a number, of numpy."""
    array = np.asarray(value)
    if array.dtype.hasobject:
        raise NoWords(f"{what} holds objects of Python")
    flags = array.flags
    order = (flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable)
    layout = (_name(type(value)), array.dtype.descr, array.shape, order)
    return "numbers", repr(layout), hashlib.sha256(array.tobytes()).hexdigest()


def _parts(value: Any, what: str) -> Iterator[Words]:
    """Words of what a value holds, in an order that is the same in every process."""
    if isinstance(value, slice):
        value = (value.start, value.stop, value.step)
    elif isinstance(value, dict):
        value = list(value.items())
    parts = [_words(each, what) for each in value]
    yield from sorted(parts, key=repr) if isinstance(value, set | frozenset) else parts


def _of_namespace(value: Any, what: str) -> Words:
    """Words of a module, or of a class that compiled code can call or read members of."""
    if isinstance(value, ModuleType):
        if _known_by_version(value.__name__):
            return "module", value.__name__
        raise NoWords(f"{what} is a module")
    if issubclass(value, Enum):
        return _name(value), *(_words(member, what) for member in value)
    if issubclass(value, tuple) and hasattr(value, "_fields"):
        return _name(value), *value._fields, _words(value._field_defaults, what)
    if issubclass(value, BaseException) or _known_by_version(value.__module__):
        return "class", _name(value)
    raise NoWords(f"{what} is the class {_name(value)}")


def _of_callable(value: Any, what: str) -> Words:
    """Words of a function that kernels call."""
    if hasattr(value, "closes_over"):  # one of `jit`
        return tuple(
            each if isinstance(each, FunctionType) else _words(each, what)
            for each in value.closes_over
        )
    if type(value).__module__.startswith("numba.") and hasattr(value, "py_func"):
        return "njit", value.py_func, _words(value.targetoptions, what)
    # of the C library, a ufunc or a function that numba knows by its name
    name, module = getattr(value, "__name__", ""), getattr(value, "__module__", None)
    home = sys.modules.get(module or "numpy")
    if name and home and _known_by_version(home.__name__) and getattr(home, name, None) is value:
        return home.__name__, name
    raise NoWords(f"{what} is {_article(type(value).__name__)}")


def _known_by_version(module: str) -> bool:
    return module.partition(".")[0] in KNOWN_BY_VERSION


def _name(kind: type[Any]) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _article(noun: str) -> str:
    return f"{'an' if noun[0].lower() in 'aeiou' else 'a'} {noun}"
