"""LLVM's intermediate representation of kernels, not optimised and equal for all processors, each
behind one C function.

numba reads its settings on import, so this is a separate program, which `write` runs:
`python -m strapdown.native.ir OUT SMALL SIZES STEM..`.
"""

import importlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from ..core.compile.jit import Kernel
from ..core.compile.signatures import Function, Number, Signature
from ..core.loop.contract import Filter, MeasurementModel, side_by_side

NEUTRAL = {
    "NUMBA_OPT": "0",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NUMBA_LOOP_VECTORIZE": "0",
    "NUMBA_SLP_VECTORIZE": "0",
    "NUMBA_DISABLE_JIT": "0",
}
"""Settings with which numba leaves optimisation and the choice of the processor to later steps."""
C_FUNCTION = """
define {result} @{symbol}({parameters}) {{
  %ret = alloca {slot}
  %exc = alloca ptr
  %status = call i32 @{inner}(ptr %ret, ptr %exc, {parameters})
{end}
}}
"""


def modules(package: ModuleType) -> Iterator[str]:
    """Names of the modules of a package that declare kernels."""
    root = Path(str(package.__file__)).parent
    for file in sorted(root.rglob("*.py")):
        if re.search(r"^@kernel\b", file.read_text(encoding="utf-8"), re.MULTILINE):
            yield ".".join((package.__name__, *file.relative_to(root).with_suffix("").parts))


def declared_kernels(module: str) -> Iterator[Kernel]:
    """Kernels that a module declares, those for eight runs at once among them."""
    values = vars(importlib.import_module(module)).values()
    found = [value for value in values if isinstance(value, Kernel)]
    for value in values:
        if isinstance(value, Filter) and value.lanes:
            found += map(side_by_side, (value.predict, value.correct))
        if isinstance(value, MeasurementModel) and value.lanes:
            found.append(side_by_side(value.observe))
    yield from (kernel for kernel in dict.fromkeys(found) if kernel.__module__ == module)


def of_stem(stem: str) -> Kernel:
    """The kernel of this module and name."""
    return next(one for one in declared_kernels(stem.rpartition(".")[0]) if one.stem == stem)


def write(
    kernels: Iterable[Kernel],
    folder: Path,
    small: bool = False,
    sizes: Mapping[str, int] | None = None,
) -> Iterator[str]:
    """Write SYMBOL.ll of each kernel into a folder in a separate process, and yield the finished
    symbols. small: leave all inlining to LLVM; sizes: constant sizes by name. Raises RuntimeError
    with the compiler's message."""
    folder.mkdir(parents=True, exist_ok=True)
    constants = json.dumps(dict(sizes or {}))
    command = [sys.executable, "-m", __name__, str(folder), str(int(small)), constants]
    with subprocess.Popen(
        [*command, *(kernel.stem for kernel in kernels)],
        env={**os.environ, **NEUTRAL},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout and process.stderr
        for line in process.stdout:
            yield line.strip()
        said = process.stderr.read().strip()
    if process.returncode:
        raise RuntimeError(
            said.splitlines()[-1] if said else "the compiler ended without a message"
        )


def c_types(signature: Signature) -> tuple[str, list[str]]:
    """LLVM's types of the result and of the arguments of a kernel in C."""
    kinds = [
        ("double" if kind.real else "i64")
        if isinstance(kind, Number)
        else "i64"
        if isinstance(kind, Function)
        else "ptr"
        for kind in signature.kinds
    ]
    kinds += ["i64"] * len(signature.sizes)
    if signature.result is not None and signature.result.lanes > 1:
        return "void", [*kinds, "ptr"]
    result = "void" if signature.result is None else "double" if signature.result.real else "i64"
    return result, kinds


def c_function(symbol: str, inner: str, signature: Signature) -> str:
    """The C function around numba's, which returns a status, always 0, and its result through a
    pointer."""
    result, kinds = c_types(signature)
    end = f"  %value = load {result}, ptr %ret\n  ret {result} %value"
    return C_FUNCTION.format(
        result=result,
        symbol=symbol,
        inner=inner,
        parameters=", ".join(f"{kind} %a{i}" for i, kind in enumerate(kinds)),
        slot="ptr" if result == "void" else result,
        end="  ret void" if result == "void" else end,
    )


def text_of(kernel: Any) -> str:
    """The representation of a kernel, in a process that runs under NEUTRAL."""
    from ..core.compile import compiler

    text, name = compiler.intermediate(kernel)
    inner = f'"{name}"' if not re.fullmatch(r"[\w.$]+", name) else name
    return text + c_function(kernel.symbol, inner, kernel.signature)


def _main(folder: str, small: str, sizes: str, *stems: str) -> None:
    from ..core.compile import compiler

    compiler.small[0] = small == "1"
    compiler.fixed.update(json.loads(sizes))
    for stem in stems:
        kernel = of_stem(stem)
        (Path(folder) / f"{kernel.symbol}.ll").write_text(text_of(kernel), encoding="utf-8")
        print(kernel.symbol, flush=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
