"""Firmware of an export on an emulated board: built as the pages say, its UART fed, its output read."""

import subprocess
from pathlib import Path

from exports import run

BOARDS = {
    "cortex-m7": ("cortex-m7", "fpv5-d16", "mps2-an500"),
    "cortex-m4f": ("cortex-m4", "fpv4-sp-d16", "mps2-an386"),
}
"""Processor, floating-point unit and board of qemu-system-arm, by target."""
HERE = Path(__file__).parent / "cortex"
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "firmware.md"
RESTART = b"VR" + b"\n" * 5000
"""The power fails, and what the queue holds then is lost."""
TICK = 40 / 2**4
"""Instructions of a tick of the timer of 25 MHz, with -icount shift=4."""


def gcc(target):
    cpu, fpu, _ = BOARDS[target]
    return ("arm-none-eabi-gcc", f"-mcpu={cpu}", f"-mfpu={fpu}", "-mfloat-abi=hard", "-mthumb")


def build_firmware(folder, target):
    """Compile the files of an export by the command of its README, and link them to the main loop of the
    page on firmware and the emulated board, as firmware.elf. Returns {section: bytes}."""
    main = PAGE.read_text("utf-8").split("```c\n")[1].split("```")[0]
    (folder / "board_main.c").write_text(main)
    command = (folder / "README.md").read_text("utf-8").split("```text\n")[1].split("```")[0]
    code, said = run(*command.split(), folder=folder)
    assert code == 0, said
    objects = [f"{Path(name).stem}.o" for name in command.split() if name.endswith(".c")]
    code, said = run(
        *gcc(target),
        *("-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-nostartfiles", "-I", HERE, "-I."),
        *(HERE / "board.c", "board_main.c", *objects, "strapdown.o"),
        *("-T", HERE / "board.ld", "-lm", "-Wl,--gc-sections", "-o", "firmware.elf"),
        folder=folder,
    )
    assert code == 0, said
    _, said = run("arm-none-eabi-size", "-A", "firmware.elf", folder=folder)
    rows = [line.split() for line in said.splitlines() if line.startswith(".")]
    return {row[0]: int(row[1]) for row in rows}


def run_board(folder, target, data, counted=False, timeout=500):
    """(lines that leave its UART, {what the board tells: number}) after a stream; `counted`: times are
    instructions."""
    cpu, _, board = BOARDS[target]
    (folder / "stream").write_bytes(data + b"E")
    with (folder / "stream").open("rb") as stream:
        done = subprocess.run(
            [
                *("qemu-system-arm", "-M", board, "-cpu", cpu, "-nographic", "-monitor", "none"),
                *("-serial", "stdio", "-semihosting-config", "enable=on,target=native"),
                *(("-icount", "shift=4") if counted else ()),
                *("-kernel", "firmware.elf"),
            ],
            cwd=folder,
            stdin=stream,
            capture_output=True,
            timeout=timeout,
        )
    assert done.returncode == 0, done.stderr
    told = [line.rpartition(" ") for line in done.stderr.decode().splitlines()]
    return done.stdout.splitlines(keepends=True), {name: int(number) for name, _, number in told}
