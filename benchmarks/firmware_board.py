"""Memory and instructions of the loop of an export on emulated boards: `python benchmarks/firmware_board.py`.

A simulated drive with an IMU of 100 Hz and fixes five times a second, 0.12 s late, through loop.c as
firmware in qemu-system-arm, which counts instructions of the Cortex-M7; the table of
docs/how-to/firmware.md. It needs arm-none-eabi-gcc.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / part) for part in ("src", "tests/support")]

from boards import BOARDS, TICK, build_firmware, run_board  # noqa: E402
from loop_streams import arrivals, drive, stream  # noqa: E402
from written_ubx import GPS  # noqa: E402

from strapdown.native.export.chosen import choose_export  # noqa: E402
from strapdown.native.export.folder import export, find_target  # noqa: E402

COUNTED = "cortex-m7"
"""Counting takes the emulator too long where doubles are computed in software."""
SECONDS = 12.0
"""s of the drive."""


def measured(target: str) -> list[float]:
    """kB of flash, RAM and stack, and 1000 instructions at most of a sample, and of one after a fix."""
    recording = drive(SECONDS)
    of = choose_export("closed-loop", ["position", "velocity"], recording)
    with TemporaryDirectory() as place:
        folder = Path(place)
        export(of, find_target(target), folder)
        size = build_firmware(folder, target)
        data = stream(arrivals(recording, GPS))
        _, told = run_board(folder, target, data, counted=target == COUNTED)
    bytes_of = (size[".text"] + size[".data"], size[".data"] + size[".bss"], told["stack"])
    counted = ("sample", "sample after a fix") if target == COUNTED else ()
    return [*(each / 1e3 for each in bytes_of), *(TICK * told[name] / 1e3 for name in counted)]


def main() -> None:
    print("| target | flash, kB | RAM, kB | stack, kB | a sample | a sample after a late fix |")
    print("|---|---|---|---|---|---|")
    for target in BOARDS:
        found = [f"{each:.3g}" for each in measured(target)]
        print(f"| `{target}` |", " | ".join(found + [""] * (5 - len(found))), "|")


if __name__ == "__main__":
    main()
