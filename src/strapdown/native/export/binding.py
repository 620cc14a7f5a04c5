"""The functions that an exported object shows, around kernels: the run of a sample, of one argument,
the struct with everything in it, and the attitude of a start. All sizes are constants for the
compiler, which leaves out what they make needless."""

from collections.abc import Iterator, Mapping

from ...core.compile.jit import Kernel
from ...core.compile.signatures import Number, Numbers
from ..ir import c_types
from .layout import BYTES, RECORDS, Layout

RUN, ATTITUDE = "strapdown_run", "strapdown_attitude"
"""Their symbols."""
HEAD = 'target datalayout = ""\ntarget triple = ""'
"""What the target fills in."""


def binding(
    made: Layout,
    run: Kernel,
    predict: Kernel,
    correct: Kernel,
    observers: Mapping[int, Kernel],
    attitude: Kernel,
) -> str:
    """LLVM's intermediate representation of them. observers: by the number of their kind."""
    kinds = max(observers, default=0) + 1
    addresses = [f"i64 ptrtoint (ptr @{one.symbol} to i64)" for one in (predict, correct)]
    called = [
        *addresses,
        "ptr %observers",
        *(f"ptr %{record}" for record in RECORDS),
        f"i64 {kinds}",
    ]
    return "\n".join(
        [
            HEAD,
            f"define void @{RUN}(ptr %filter) {{",
            *(line for record in RECORDS for line in _struct(record, made)),
            *_table(kinds, observers),
            f"  call void @{run.symbol}({', '.join(called)})",
            "  ret void",
            "}",
            f"define void @{ATTITUDE}(ptr %rph, ptr %C) {{",
            f"  call void @{attitude.symbol}(ptr %rph, ptr %C)",
            "  ret void",
            "}",
            *(
                f"declare {result} @{kernel.symbol}({', '.join(types)})"
                for kernel in dict.fromkeys((run, predict, correct, *observers.values(), attitude))
                for result, types in [c_types(kernel.signature)]
            ),
            "",
        ]
    )


def _table(kinds: int, observers: Mapping[int, Kernel]) -> Iterator[str]:
    """The observers' addresses. On the stack, because on processors of 32 bits an address of 64 is
    no constant to a linker."""
    yield f"  %observers = alloca [{kinds} x i64]"
    for number in range(kinds):
        symbol = observers[number].symbol if number in observers else None
        yield f"  %observer{number} = getelementptr i64, ptr %observers, i64 {number}"
        address = f"ptrtoint (ptr @{symbol} to i64)" if symbol else "0"
        yield f"  store i64 {address}, ptr %observer{number}"


def _struct(record: str, made: Layout) -> Iterator[str]:
    """A record as C has it, on the stack: what one compiler builds and takes apart costs nothing."""
    kinds, values = RECORDS[record], list[str]()
    yield f"  %{record} = alloca {_type_of(record)}"
    for place, kind in zip(made.of(record), kinds.kinds, strict=True):
        name = f"%{record}.{place.name}"
        yield f"  {name} = getelementptr i8, ptr %filter, i64 {BYTES * place.first}"
        if isinstance(kind, Number):
            yield f"  {name}.value = load double, ptr {name}"
            values.append(f"double {name}.value")
        else:
            values.append(f"ptr {name}")
    values += [f"i64 {made.sizes[size]}" for size in kinds.sizes]
    for i, value in enumerate(values):
        yield f"  %{record}.at{i} = getelementptr {_type_of(record)}, ptr %{record}, i32 0, i32 {i}"
        yield f"  store {value}, ptr %{record}.at{i}"


def _type_of(record: str) -> str:
    kinds = RECORDS[record]
    types = ["ptr" if isinstance(kind, Numbers) else "double" for kind in kinds.kinds]
    return "{" + ", ".join([*types, *("i64" for _ in kinds.sizes)]) + "}"
