"""Compiled kernels on disk: one file each, named after everything that its machine code comes from.

numba's own cache looks at the file of the outermost function alone: after an edit to a helper in
another module, or with vectorising switched off, it would go on with machine code of before. Here
the name of a kernel's file is a digest of the code of all modules that it imports (docstrings,
comments and annotations left out), of the values that this code closes over, of numba's version, of
the processor and of numba's settings. A kernel is not kept where one of these cannot be told. Files are written at once and carry a checksum, so that what a killed process or a full disk leaves
is never loaded.
"""

import ast
import hashlib
import os
import pickle
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import llvmlite
import numba

from ...fileio.locks import part_of
from .closure_values import NoWords, Words, digest, functions
from .numba_parts import config, cpu_target, rebuild_result, serialize

Import = ast.Import | ast.ImportFrom

KEEP = 6
"""Versions of one kernel that stay: of other branches, settings and processors."""
WITHOUT_EFFECT = re.compile(
    r"CACHE|CUDA|DUMP|DEBUG_(?!INFO|NRT)|THREAD|COLOR|TRACE|WARN|SHOW|GDB|HIGHLIGHT|DIFF_IR|DIAGNOSTICS|TIMINGS|DEVELOPER|DISABLE_JIT"
)
"""Settings of numba that leave machine code as it is. Any other, also one that a later numba
brings, makes another key."""
COMPILER = f"{__package__}.compiler"
"""The module that makes the C functions around kernels, which no kernel imports."""
WITHOUT_CODE = {f"{__package__}.{name}" for name in ("jit", "c_calls", "library", "closed_over")}
"""Modules that declare, find and call kernels, and put no code into them."""
HAS_DOCSTRING = 0x4000000
"""Flag of code since Python 3.13; before, the first constant is the docstring or None."""
CHECKSUM = hashlib.sha256().digest_size


def folder() -> Path | None:
    """Where kernels are kept, or None for a user without a home. Nothing is looked at or made."""
    try:
        return (
            Path(config.CACHE_DIR or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
            / "strapdown"
            / "kernels"
        )
    except RuntimeError:
        return None


class _Code(ast.NodeTransformer):
    """Leaves out what makes no machine code: docstrings and annotations of arguments."""

    def visit(self, node: Any) -> Any:
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [
                each
                for each in body
                if not (isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant))
            ]
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        return self.generic_visit(node)


class ModuleCode(NamedTuple):
    """Imports and digest of a file of code, without docstrings, comments and annotations of
    arguments."""

    at_once: tuple[Import, ...]  # import statements that run when the module is loaded
    imports: tuple[Import, ...]  # these and those inside functions
    digest: bytes


def module_code(file: Path) -> ModuleCode:
    """The code of a file as it is now. Raises OSError."""
    now = file.stat()
    return _parse_module(file, now.st_mtime_ns, now.st_size)


@cache
def _parse_module(file: Path, changed: int, size: int) -> ModuleCode:
    tree = _Code().visit(ast.parse(file.read_bytes()))
    digest = hashlib.sha256(ast.dump(tree).encode()).digest()
    return ModuleCode(tuple(_imports(tree)), tuple(_imports(tree, inside=True)), digest)


def _imports(node: ast.AST, inside: bool = False) -> Iterator[Import]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.Import, ast.ImportFrom)):
            yield child
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
            yield from (
                found for each in child.orelse for found in _imports(ast.Module([each], []), inside)
            )
        elif inside or not isinstance(child, (ast.FunctionDef, ast.Lambda)):
            yield from _imports(child, inside)


def _imported_modules(module: ModuleType, statement: Import) -> list[ModuleType]:
    """Modules that an import statement of `module` takes code from, as far as they are loaded."""
    if isinstance(statement, ast.Import):
        names = [alias.name for alias in statement.names]
    else:
        above = (module.__package__ or "").split(".")
        base = (
            ".".join(
                [
                    *above[: len(above) - statement.level + 1],
                    *([statement.module] if statement.module else []),
                ]
            )
            if statement.level
            else statement.module or ""
        )
        inside = {alias.name: f"{base}.{alias.name}" for alias in statement.names}
        names = [name for name in inside.values() if name in sys.modules]
        if len(names) < len(inside):
            # also where a package only hands a name on: then whoever defined it counts as well
            names.append(base)
            values = (
                getattr(module, alias.asname or alias.name, None) for alias in statement.names
            )
            names += [
                name
                for name in (getattr(value, "__module__", None) for value in values)
                if isinstance(name, str)
            ]
    return [sys.modules[name] for name in names if name in sys.modules]


def import_closure(module: ModuleType) -> tuple[dict[Path, str], dict[str, str]]:
    """({file: name} of the modules whose code can end up in kernels of `module`, {name: version}
    of installed packages among them)."""
    files, packages, seen, todo = {}, {}, set(), [module]
    own = {module.__name__.partition(".")[0], "strapdown"}
    while todo:
        one = todo.pop()
        top = one.__name__.partition(".")[0]
        if (
            one.__name__ in seen
            or one.__name__ in WITHOUT_CODE
            or top in sys.stdlib_module_names
            or not getattr(one, "__file__", None)
        ):
            continue
        seen.add(one.__name__)
        file, version = Path(str(one.__file__)), getattr(sys.modules.get(top), "__version__", None)
        if top not in own and version and {"site-packages", "dist-packages"} & set(file.parts):
            packages[top] = version
        elif file.suffix == ".py":
            files[file] = one.__name__
            todo += [
                other
                for statement in module_code(file).at_once
                for other in _imported_modules(one, statement)
            ]
    return files, packages


def _settings() -> str:
    """numba's settings that can change machine code, as text."""
    return repr(
        [
            (name, getattr(config, name))
            for name in sorted(vars(config))
            if name.isupper() and not WITHOUT_EFFECT.search(name)
        ]
    )


def closure_digest(name: str) -> str:
    """Digest of the code of a loaded module and of all that it imports, as the files say now."""
    files, packages = import_closure(sys.modules[name])
    digest = hashlib.sha256(repr(sorted(packages.items())).encode())
    for module, file in sorted((module, file) for file, module in files.items()):
        digest.update(module.encode() + b"\0" + module_code(file).digest)
    return digest.hexdigest()


def code_digest(kernel: Any) -> str:
    """Digest of the code of a kernel's module and of all that it imports, and of the values that the
    kernel closes over. Raises OSError, NoWords."""
    of = functions(kernel)
    _check_frozen(of)
    return closure_digest(kernel.__module__) + digest(of, _bytecode)


_FROZEN: dict[FunctionType, Words] = {}  # values that were looked up first, which numba may hold


def _check_frozen(of: dict[FunctionType, Words]) -> None:
    """Raise NoWords where a function closed over other values before: numba compiles a helper once in
    a process, with the values of then."""
    for function, words in of.items():
        if _FROZEN.setdefault(function, words) != words:
            raise NoWords(f"a value in {function.__qualname__} has changed since it was compiled")


@cache
def _bytecode(code: CodeType) -> str:
    """Digest of what a function does, of which a module may define two by one name. Its docstring,
    names of files and numbers of lines do not count."""
    documented = sys.version_info < (3, 13) or code.co_flags & HAS_DOCSTRING
    first = bool(documented and code.co_consts and isinstance(code.co_consts[0], str))
    constants = [_constant(each) for each in code.co_consts[first:]]
    said = (code.co_code, constants, code.co_names, code.co_varnames, code.co_freevars)
    return hashlib.sha256(repr(said).encode()).hexdigest()


def _constant(value: Any) -> str:
    if isinstance(value, CodeType):
        return _bytecode(value)
    return repr(sorted(map(repr, value)) if isinstance(value, frozenset) else value)


def key(kernel: Any, options: dict[str, Any]) -> str:
    """Digest of all that the machine code of a kernel comes from. Raises OSError, NoWords."""
    said = sorted(
        (name, sorted(value) if isinstance(value, set) else value)
        for name, value in options.items()
    )
    processor = cpu_target.target_context.codegen().magic_tuple()
    parts = (
        code_digest(kernel),
        closure_digest(COMPILER),
        numba.__version__,
        llvmlite.__version__,
        sys.implementation.cache_tag,
        processor,
        _settings(),
        said,
        repr(kernel.signature),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:24]


def _edited_since(name: str, declared: int) -> bool:
    """True where a file that a kernel's code comes from was written after the kernel was declared
    (ns): the code in memory then differs from that in the files."""
    return any(file.stat().st_mtime_ns > declared for file in import_closure(sys.modules[name])[0])


class KernelCache:
    """The cache of one kernel, with the methods that numba expects. Where nothing can be read or
    written, the kernel is compiled in each process."""

    def __init__(self, kernel: Any, options: dict[str, Any]) -> None:
        self._stem = kernel.stem
        # what is defined in a function or typed into a shell has no code of its own to be known by
        module = sys.modules.get(kernel.__module__)
        known = "<" not in self._stem and getattr(module, "__file__", None)
        place = folder()
        self.path: Path | None = None
        self.why_not = ""
        try:
            if known and place and not _edited_since(kernel.__module__, kernel.declared):
                self.path = place / f"{self._stem}-{key(kernel, options)}.kernel"
        except NoWords as error:
            self.why_not = str(error)
        except OSError:  # its file is gone
            pass

    @property
    def cache_path(self) -> str:
        """The folder, as numba's statistics show it."""
        return str(folder())

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled kernel, or None where there is none that is whole."""
        target_context.refresh()
        with suppress(OSError):
            if self.path is None:
                return None
            content = self.path.read_bytes()
            if content and hashlib.sha256(content[CHECKSUM:]).digest() == content[:CHECKSUM]:
                with suppress(OSError):
                    os.utime(self.path)  # the ones used last are kept
                return rebuild_result(target_context, pickle.loads(content[CHECKSUM:]))
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write the compiled kernel, whole or not at all; what killed processes left goes with it."""
        if self.path is None or compiled.library.has_dynamic_globals:
            return
        payload: bytes = serialize.dumps(compiled._reduce())
        with suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._sweep(self.path)
            self._write(self.path, hashlib.sha256(payload).digest() + payload)

    def _write(self, path: Path, content: bytes) -> None:
        """Under another name first."""
        with part_of(path) as part:
            part.path.write_bytes(content)
            part.rename(path)

    def _sweep(self, path: Path) -> None:
        """Delete all but the last versions of this kernel."""
        versions = [file for file in path.parent.glob(f"{self._stem}-*.kernel") if file != path]
        with suppress(OSError):
            for old in sorted(versions, key=lambda file: file.stat().st_mtime, reverse=True)[
                KEEP - 1 :
            ]:
                old.unlink(missing_ok=True)

    def enable(self) -> None:
        """As numba asks; there is nothing to switch."""

    disable = flush = enable
