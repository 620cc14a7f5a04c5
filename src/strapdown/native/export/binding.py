"""The function that an exported object shows: one argument, the struct with everything in it. All
sizes are constants for the compiler, which leaves out what they make needless."""

from collections.abc import Mapping, Sequence

from ...core.jit import Kernel
from ...core.signatures import Numbers
from .layout import BYTES, RECORDS, Layout

RUN = "strapdown_run"
"""Its symbol."""


def binding(
    made: Layout, run: Kernel, predict: Kernel, correct: Kernel, observers: Mapping[int, Kernel]
) -> str:
    """LLVM's intermediate representation of it. observers: by the number of their kind."""
    kinds = max(observers, default=0) + 1
    lines = [
        line for record in RECORDS for line in _record(record, made)
    ] + [f"  %observers = alloca [{kinds} x i64]"]
    for number in range(kinds):
        given = f"ptrtoint (ptr @{observers[number].symbol} to i64)" if number in observers else "0"
        lines += [
            f"  %observer{number} = getelementptr i64, ptr %observers, i64 {number}",
            f"  store i64 {given}, ptr %observer{number}",
        ]
    arguments = [f"i64 ptrtoint (ptr @{one.symbol} to i64)" for one in (predict, correct)]
    arguments += ["ptr %observers", *(f"ptr %{record}" for record in RECORDS), f"i64 {kinds}"]
    outside = dict.fromkeys((predict, correct, *observers.values()))
    return "\n".join(
        [
            'target datalayout = ""',
            'target triple = ""',
            f"define void @{RUN}(ptr %filter) {{",
            *lines,
            f"  call void @{run.symbol}({', '.join(arguments)})",
            "  ret void",
            "}",
            f"declare void @{run.symbol}({', '.join(one.split()[0] for one in arguments)})",
            *(_declared(kernel) for kernel in outside),
            "",
        ]
    )


def _record(record: str, made: Layout) -> list[str]:
    """The struct of a record as C has it, on the stack: what one compiler builds and takes apart
    costs nothing."""
    kinds = RECORDS[record]
    types = ["ptr" if isinstance(kind, Numbers) else "double" for kind in kinds.kinds]
    whole = "{" + ", ".join([*types, *("i64" for _ in kinds.sizes)]) + "}"
    lines, values = [f"  %{record} = alloca {whole}"], list[str]()
    for place, type in zip(made.of(record), types, strict=True):
        name = f"%{record}.{place.name}"
        lines.append(f"  {name} = getelementptr i8, ptr %filter, i64 {BYTES * place.first}")
        if type == "double":
            lines.append(f"  {name}.value = load double, ptr {name}")
            name += ".value"
        values.append(f"{type} {name}")
    values += [f"i64 {made.sizes[size]}" for size in kinds.sizes]
    for i, value in enumerate(values):
        lines += [
            f"  %{record}.at{i} = getelementptr {whole}, ptr %{record}, i32 0, i32 {i}",
            f"  store {value}, ptr %{record}.at{i}",
        ]
    return lines


def _declared(kernel: Kernel) -> str:
    kinds = [
        "ptr" if hasattr(kind, "shape") or hasattr(kind, "made") else "double" if getattr(kind, "real", False) else "i64"
        for kind in kernel.signature.kinds
    ]
    result = kernel.signature.result
    returned = "void" if result is None else "double" if result.real else "i64"
    return f"declare {returned} @{kernel.symbol}({', '.join([*kinds, *('i64' for _ in kernel.signature.sizes)])})"
