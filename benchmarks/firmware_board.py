"""Memory and instructions of the loop of an export on emulated boards: `python benchmarks/firmware_board.py`.

A simulated drive with an IMU of 100 Hz and fixes five times a second, 0.12 s late, through loop.c as
firmware in qemu-system-arm, which counts instructions; the table of docs/how-to/firmware.md. It needs
arm-none-eabi-gcc.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / part) for part in ("src", "tests/support")]

from boards import TICK, build_firmware, run_board  # noqa: E402
from loop_streams import arrivals, drive, stream  # noqa: E402
from written_ubx import GPS  # noqa: E402

from strapdown.native.export.chosen import choose_export  # noqa: E402
from strapdown.native.export.folder import export, find_target  # noqa: E402

SECONDS = {"cortex-m7": 12.0, "cortex-m4f": 3.0}
"""s of the drive: doubles in software take the emulator long."""


def measured(target: str) -> tuple[float, ...]:
    """kB of flash, RAM and stack, and 1000 instructions at most of a sample, and of one after a fix."""
    recording = drive(SECONDS[target])
    of = choose_export("closed-loop", ["position", "velocity"], recording)
    with TemporaryDirectory() as place:
        folder = Path(place)
        export(of, find_target(target), folder)
        size = build_firmware(folder, target)
        data = stream(arrivals(recording, GPS))
        _, told = run_board(folder, target, data, counted=True, timeout=3000)
    thousands = [TICK * told[name] / 1e3 for name in ("sample", "sample after a fix")]
    bytes_of = (size[".text"] + size[".data"], size[".data"] + size[".bss"], told["stack"])
    return *(each / 1e3 for each in bytes_of), *thousands


def main() -> None:
    print("| target | flash, kB | RAM, kB | stack, kB | a sample | a sample after a late fix |")
    print("|---|---|---|---|---|---|")
    for target in SECONDS:
        print(f"| `{target}` |", " | ".join(f"{each:.3g}" for each in measured(target)), "|")


if __name__ == "__main__":
    main()
