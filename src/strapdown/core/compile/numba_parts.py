"""Everything private to numba that the package relies on, in one place.

`compiler`, `kernel_cache` and `lane_types` take from here what numba gives extensions without a
promise. What goes deeper, into how numba lowers, links and optimises a function, is written for the
versions KNOWN: under any other a helper is compiled as `numba.njit` does it, which takes twice as long
and gives the same results.

Helpers are only ever linked into kernels. numba would make of each a function that Python can call
and one that C can call, optimise it and all that it calls, and make machine code of it. Here a helper
is LLVM's text of itself alone, as it was lowered. A kernel links each helper that it reaches once,
and is optimised as a whole. Only functions that `helper_dispatcher` and `c_function` make are compiled
so; other code of numba in the process never meets these classes, unless it calls a helper.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba import types as numba_types
from numba.core import (
    ccallback as numba_ccallback,
    cgutils as numba_cgutils,
    codegen as numba_codegen,
    compiler as numba_compiler,
    compiler_lock,
    config as numba_config,
    cpu,
    dispatcher as numba_dispatcher,
    registry as numba_registry,
    serialize as numba_serialize,
    typeconv as numba_typeconv,
    typing as numba_typing,
)
from numba.core.datamodel import models as numba_models
from numba.extending import lower_cast as numba_lower_cast

# numba's own annotations are not complete
types: Any = numba_types
ccallback: Any = numba_ccallback
cgutils: Any = numba_cgutils
codegen: Any = numba_codegen
compiler: Any = numba_compiler
config: Any = numba_config
cpu_target: Any = numba_registry.cpu_target
dispatcher: Any = numba_dispatcher
global_compiler_lock: Any = compiler_lock.global_compiler_lock
from_dtype: Any = numba.from_dtype
lower_cast: Any = numba_lower_cast
models: Any = numba_models
registry: Any = numba_registry
serialize: Any = numba_serialize
typeconv: Any = numba_typeconv
typing: Any = numba_typing

KNOWN = ("0.68",)
"""Versions of numba under which helpers are linked as they were lowered."""


def is_known_numba() -> bool:
    """Return True where the installed numba is one of KNOWN."""
    return ".".join(numba.__version__.split(".")[:2]) in KNOWN


def reference_counts_can_be_left_out() -> bool:
    """Return True where this numba has the option `_nrt`; without it a sample takes 0.14 us longer,
    and nothing else changes."""
    return hasattr(getattr(cpu, "CPUTargetOptions", None), "_nrt")


def helper_dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """numba's form of a function that kernels call."""
    plain: Any = numba.njit(**options)(function)
    return _Dispatcher(plain) if is_known_numba() else plain


def c_function(
    function: Callable[..., Any], arguments: tuple[Any, ...], result: Any, options: dict[str, Any]
) -> Any:
    """numba's C function of these types, not compiled yet."""
    pipeline = _KernelCompiler if is_known_numba() else compiler.Compiler
    return ccallback.CFunc(function, (arguments, result), {}, options, pipeline_class=pipeline)


def rebuild_result(target_context: Any, reduced: Any) -> Any:
    """The result of a compilation, of what its `_reduce` gave."""
    return compiler.CompileResult._rebuild(target_context, *reduced)


# ---- helpers


class _Library(codegen.JITCodeLibrary):  # type: ignore[misc]
    """The library of a helper: its LLVM code as lowered, not optimised, without machine code and
    without its callees."""

    _complete: Any = None

    def add_llvm_module(self, module: Any) -> None:
        """Take LLVM's module of the function as it is."""
        self._final_module.link_in(module)

    def finalize(self) -> None:
        """Nothing is added from now on. Functions may be defined by several modules that are linked,
        and are left out where all calls were inlined."""
        self._raise_if_finalized()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == codegen.ll.Linkage.external:
                function.linkage = "linkonce_odr"
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """With all that it calls, for a library of numba's own."""
        if self._complete is None:
            self._ensure_finalized()
            self._complete = self._final_module.clone()
            _link(self, self._complete)
            for library in _others(self):
                self._complete.link_in(library._get_module_for_linking(), preserve=True)
        return self._complete


def _reachable_libraries(library: Any) -> list[Any]:
    """Libraries that one links, and those that helpers among them link, each once."""
    found: dict[Any, None] = {}
    todo = [*library._linking_libraries]
    while todo:
        one = todo.pop()
        if one not in found:
            found[one] = None
            todo += one._linking_libraries if isinstance(one, _Library) else ()
    return list(found)


def _others(library: Any) -> list[Any]:
    """Those of numba's own."""
    return [one for one in _reachable_libraries(library) if not isinstance(one, _Library)]


def _link(library: Any, module: Any) -> None:
    """Link all helpers that a library reaches into a module."""
    for one in _reachable_libraries(library):
        if isinstance(one, _Library) and one is not library:
            library._reload_init.update(one._reload_init)
            module.link_in(one._final_module, preserve=True)
    mark = codegen.RuntimeLinker.PREFIX
    for variable in module.global_variables:
        # functions that call each other in a circle are called by an address that numba looks up
        if variable.name.startswith(mark):
            called = module.get_function(variable.name.removeprefix(mark))
            called.linkage = "weak_odr"  # stays where all other calls are inlined


class _HelperCompiler(compiler.Compiler):  # type: ignore[misc]
    """Lowers into a `_Library`."""

    def compile_extra(self, function: Any) -> Any:
        """As numba, but for the library."""
        self.state.library = _Library(self.state.targetctx.codegen(), function.__qualname__)
        return super().compile_extra(function)


class _FunctionCompiler(dispatcher._FunctionCompiler):  # type: ignore[misc]
    """Stops when the function is lowered."""

    def _customize_flags(self, flags: Any) -> Any:
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        return flags


class _Dispatcher(registry.CPUDispatcher):  # type: ignore[misc]
    """A function that compiled code alone can call."""

    def __init__(self, plain: Any) -> None:
        super().__init__(plain.py_func, plain.locals, plain.targetoptions)
        self._compiler = _FunctionCompiler(
            plain.py_func, self.targetdescr, plain.targetoptions, plain.locals, _HelperCompiler
        )

    def add_overload(self, made: Any) -> None:
        """Let numba find the function by its library, in place of one that Python can call."""
        self.targetctx.insert_user_function(made.library, made.fndesc, [made.library])
        self.overloads[tuple(made.signature.args)] = made._replace(entry_point=made.library)


# ---- kernels


class _KernelLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """The library of a kernel: optimised as a whole, with all helpers that it reaches."""

    def finalize(self) -> None:
        """Link, optimise and make machine code."""
        _link(self, self._final_module)
        self._linking_libraries = _others(self)
        super().finalize()


class _KernelCompiler(compiler.Compiler):  # type: ignore[misc]
    """Lowers into a `_KernelLibrary`."""

    def compile_extra(self, function: Any) -> Any:
        """As numba, but for the library."""
        library = _KernelLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.enable_object_caching()  # so that it can be kept on disk
        self.state.library = library
        return super().compile_extra(function)
