"""The public functions of an exported object, around kernels: the run of a sample, with the struct
as its only argument, and the attitude of a start. All sizes are constants, so that the compiler
removes unnecessary code."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ...core.compile.jit import Kernel
from ...core.compile.signatures import Number, Numbers, Record
from ...core.loop.kernels import KERNELS
from ...core.loop.stages import Needed
from ..ir import c_types
from .layout import BYTES, RECORDS, ExportLayout

RUN, ATTITUDE = "strapdown_run", "strapdown_attitude"
"""Their symbols."""
HEAD = 'target datalayout = ""\ntarget triple = ""'
"""Lines that the target fills in."""


class BoundFunction(NamedTuple):
    """The kernels of an exported filter."""

    run: Kernel
    predict: Kernel
    correct: Kernel
    observers: Mapping[int, Kernel]  # by the number of their kind
    stages: Needed

    @property
    def all(self) -> list[Kernel]:
        """All of them, each once."""
        own = (self.run, self.predict, self.correct, *self.observers.values())
        return list(dict.fromkeys((*own, *self.stages.kernels)))


def binding_ir(made: ExportLayout, kernels: BoundFunction, attitude: Kernel) -> str:
    """LLVM's intermediate representation of the functions."""
    called = [f"ptr %{record}" for record in ("kernels", *RECORDS)]
    return "\n".join(
        [
            HEAD,
            f"define void @{RUN}(ptr %filter) {{",
            *(line for record in RECORDS for line in _struct(record, made)),
            *_kernels(kernels),
            f"  call void @{kernels.run.symbol}({', '.join(called)})",
            "  ret void",
            "}",
            f"define void @{ATTITUDE}(ptr %rph, ptr %C) {{",
            f"  call void @{attitude.symbol}(ptr %rph, ptr %C)",
            "  ret void",
            "}",
            *(
                f"declare {result} @{kernel.symbol}({', '.join(types)})"
                for kernel in dict.fromkeys((*kernels.all, attitude))
                for result, types in [c_types(kernel.signature)]
            ),
            "",
        ]
    )


def _kernels(kernels: BoundFunction) -> Iterator[str]:
    """Return the struct of addresses for the loop."""
    count, stages = max(kernels.observers, default=-1) + 1, kernels.stages
    tables = {
        "observers": [kernels.observers.get(number) for number in range(count)],
        "prepare": list(stages.prepare),
        "after_step": list(stages.after_step),
    }
    single = {"predict": kernels.predict, "correct": kernels.correct} | stages._asdict()
    values = []
    for name, kind in KERNELS.fields:
        if isinstance(kind, Numbers):
            yield from _table(name, tables[name])
            values.append(f"ptr %{name}")
        else:
            values.append(f"i64 {_address(single[name])}")
    sizes = dict(zip(KERNELS.sizes, map(len, tables.values()), strict=True))
    values += [f"i64 {size}" for size in sizes.values()]
    yield from _store_struct("kernels", _struct_type(KERNELS), values)


def _table(name: str, kernels: Sequence[Kernel | None]) -> Iterator[str]:
    """Addresses of kernels. On the stack, because on processors of 32 bits an address of 64 is
    no constant to a linker."""
    yield f"  %{name} = alloca [{len(kernels)} x i64]"
    for number, kernel in enumerate(kernels):
        yield f"  %{name}{number} = getelementptr i64, ptr %{name}, i64 {number}"
        yield f"  store i64 {_address(kernel)}, ptr %{name}{number}"


def _address(kernel: Kernel | None) -> str:
    return f"ptrtoint (ptr @{kernel.symbol} to i64)" if kernel else "0"


def _struct(record: str, made: ExportLayout) -> Iterator[str]:
    """Return a record in C's layout on the stack; the compiler removes its cost."""
    kinds, values = RECORDS[record], list[str]()
    for place, kind in zip(made.of(record), kinds.kinds, strict=True):
        name = f"%{record}.{place.name}"
        yield f"  {name} = getelementptr i8, ptr %filter, i64 {BYTES * place.first}"
        if isinstance(kind, Number):
            yield f"  {name}.value = load double, ptr {name}"
            values.append(f"double {name}.value")
        else:
            values.append(f"ptr {name}")
    values += [f"i64 {made.sizes[size]}" for size in kinds.sizes]
    yield from _store_struct(record, _struct_type(kinds), values)


def _store_struct(name: str, types: str, values: Sequence[str]) -> Iterator[str]:
    """A struct on the stack, filled."""
    yield f"  %{name} = alloca {types}"
    for i, value in enumerate(values):
        yield f"  %{name}.at{i} = getelementptr {types}, ptr %{name}, i32 0, i32 {i}"
        yield f"  store {value}, ptr %{name}.at{i}"


def _struct_type(kinds: Record) -> str:
    """The type of the struct of a record."""
    types = [
        "ptr" if not isinstance(kind, Number) else "double" if kind.real else "i64"
        for kind in kinds.kinds
    ]
    return "{" + ", ".join([*types, *("i64" for _ in kinds.sizes)]) + "}"
