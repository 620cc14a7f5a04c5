"""README.md of an export: its files, and how to compile and call them."""

from collections.abc import Sequence
from typing import NamedTuple

from ... import aiding
from ..emit import TargetMachine
from .chosen import Chosen
from .header import identifier, source_text, template
from .image import Image

CORTEX = (
    "arm-none-eabi-gcc -std=c99 -O2 -ffp-contract=off -mthumb -mfloat-abi=hard -mcpu={cpu} -mfpu={fpu} "
    "-c {{sources}}"
)
COMPILE = {
    "wasm32": "clang --target=wasm32 -std=c99 -O2 -mbulk-memory -nostdlib -Wl,--no-entry \\\n"
    "    -Wl,--allow-undefined -Wl,--export-all strapdown_calls.c strapdown.o -o strapdown.wasm\n"
    "node main.mjs",
    "cortex-m4f": CORTEX.format(cpu="cortex-m4", fpu="fpv4-sp-d16"),
    "cortex-m7": CORTEX.format(cpu="cortex-m7", fpu="fpv5-d16"),
    "aarch64": "aarch64-linux-gnu-gcc -std=c99 -O2 -ffp-contract=off main.c strapdown_calls.c strapdown.o -lm -o main\n"
    "./main",
}
"""Commands that compile, by target."""
USUAL = "cc -std=c99 -O2 -ffp-contract=off main.c strapdown_calls.c strapdown.o -lm -o main\n./main"
ABOUT = {
    "strapdown.o": "the loop, the filter and the observations of its sources",
    "strapdown.h": "its structs, constants and functions; each with units, frames and shapes",
    "strapdown_calls.c": "the functions that pass samples and fixes to the loop",
    "strapdown_delayed.h": "a filter that takes late fixes into the past",
    "strapdown_delayed.c": "its functions",
    "main.c": "an example that replays replay.bin and compares",
    "loop.h": "a navigation system on a microcontroller: what your board calls, and what it has",
    "loop.c": "its functions: UBX of a receiver in, NMEA out",
    "desk.c": "its board on a desk, which reads a recorded stream",
    "main.mjs": "the same for node, with strapdown.wasm",
    "strapdown.wasm": "strapdown_calls.c and strapdown.o, linked",
    "replay.bin": "samples and fixes of a recording, and the results in Python",
    "README.md": "this page",
}
FIXED = {
    "noise": "the noise of the IMU",
    "lla": "latitude, longitude and height",
}


class Sizes(NamedTuple):
    """The sizes of an export on its target."""

    code: int  # bytes of code and constants of strapdown.o
    state: int  # bytes of strapdown_filter
    stack: int | None  # largest stack of strapdown_run in bytes, without the C library's own
    needed: tuple[str, ...]  # functions from outside

    @property
    def text(self) -> str:
        """Return one line of text."""
        stack = "not known" if self.stack is None else f"{self.stack} bytes"
        return (
            f"{self.code} bytes of code and constants, {self.state} of state, stack at most {stack} "
            f"beside that of {', '.join(self.needed) or 'nothing'}"
        )


def _firmware_sources(files: Sequence[str]) -> list[str]:
    """The files of C that firmware compiles as they are."""
    return [name for name in files if name.endswith(".c") and name not in ("main.c", "desk.c")]


def readme(
    of: Chosen, made: Image, target: TargetMachine, sizes: Sizes, files: Sequence[str]
) -> str:
    """The text of README.md."""
    sources = "\n".join(
        f"| {i} | `STRAPDOWN_SOURCE_{identifier(name)}` | {source_text(aiding.find(a.kind))} |"
        for i, (a, name) in enumerate(zip(of.sources, of.names))
    )
    fixed = "".join(
        f"\nWith this filter {FIXED[part]} of `strapdown_values` must be those of "
        f"`strapdown_example`: its start is computed from them at export. "
        for part in made.fixed
    )
    return template("README.md").substitute(
        filter=of.filter.name,
        reference=of.filter.reference,
        target=target.name,
        about=target.about,
        compile=COMPILE.get(target.name, USUAL).format(sources=" ".join(_firmware_sources(files))),
        files="\n".join(f"| `{name}` | {ABOUT[name]} |" for name in ABOUT if name in files),
        sources=sources,
        first=identifier(of.names[0]),
        fixed=fixed,
        imu=of.spec.name,
        vehicle=str(of.vehicle),
        options=", ".join(f"{name} = {value}" for name, value in of.options.items())
        or "as they are",
        code=sizes.code,
        state=sizes.state,
        stack="not known" if sizes.stack is None else f"{sizes.stack} bytes",
        needed=", ".join(f"`{name}`" for name in sizes.needed) or "nothing",
        waiting=of.waiting,
        notes="".join(f"- {note}\n" for note in of.notes),
        recording=of.recording.meta.get("name", "a recording"),
    )
