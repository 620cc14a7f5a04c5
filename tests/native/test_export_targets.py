"""Exported filters on other machines, as far as those are found here, and all filters on this one."""

import shutil
from functools import cache

import pytest
from boards import BOARDS, RESTART, build_firmware, gcc, run_board
from body_speeds import recording as body_speeds
from exports import STRICT, build_example, rough_flight, run
from loop_streams import (
    arrivals,
    damaged,
    drive,
    fixes,
    hidden,
    restarted,
    run_desk,
    stream,
    without_samples,
)
from test_export import REFUSED, SOURCES
from written_ubx import GPS

import strapdown as sd
from strapdown import filters
from strapdown.native.export.chosen import choose_export
from strapdown.native.export.folder import export, find_target
from strapdown.sensor_models.ahrs import Ahrs

pytestmark = pytest.mark.deep
KINDS = ("position", "velocity", "altitude", "zero-velocity")
MAX_CODE = 60_000
"""Bytes of the closed loop with four sources on a Cortex-M7."""
EMULATED = ("-nographic", "-monitor", "none", "-serial", "none")
SEMIHOSTING = ("-semihosting-config", "enable=on,target=native")


def needed(*commands):
    if missing := [command for command in commands if not shutil.which(command)]:
        pytest.skip(f"not found: {', '.join(missing)}")


@cache
def flight(seconds):
    return rough_flight(seconds)


def exported(target, folder, seconds=120.0):
    of = choose_export("closed-loop", KINDS, flight(seconds))
    return export(of, find_target(target), folder)


@pytest.mark.parametrize("target", BOARDS)
def test_a_cortex_gives_what_python_gives(target, tmp_path, request):
    needed("arm-none-eabi-gcc", "qemu-system-arm", "arm-none-eabi-size")
    made = exported(target, tmp_path)
    cpu, _, board = BOARDS[target]
    code, said = run(
        *gcc(target), *STRICT, "-ffp-contract=off", "-c", "strapdown_calls.c", folder=tmp_path
    )
    assert code == 0, said
    code, said = run("arm-none-eabi-size", "strapdown.o", folder=tmp_path)
    # which counts neither alignment nor notes
    assert 0.98 * made.sizes.code < int(said.splitlines()[1].split()[3]) <= made.sizes.code
    if target == "cortex-m7":
        assert made.sizes.code <= MAX_CODE and made.sizes.stack < 4096
    here = request.path.parent.parent / "support" / "cortex"
    _, start = run(*gcc(target), "-print-file-name=rdimon-crt0.o", folder=tmp_path)
    code, said = run(
        *gcc(target),
        "-std=gnu99",
        "-O2",
        "-ffp-contract=off",
        "--specs=rdimon.specs",
        "-nostartfiles",
        here / "start.c",
        "main.c",
        "strapdown_calls.c",
        "strapdown.o",
        start.strip(),
        "-T",
        here / "memory.ld",
        "-lm",
        "-Wl,--gc-sections",
        "-o",
        "main.elf",
        folder=tmp_path,
    )
    assert code == 0, said
    code, said = run(
        "qemu-system-arm",
        "-M",
        board,
        "-cpu",
        cpu,
        *EMULATED,
        *SEMIHOSTING,
        "-kernel",
        "main.elf",
        folder=tmp_path,
    )
    assert code == 0 and "rows the same" in said, said


@pytest.mark.parametrize("target, seconds", [("cortex-m7", 45.0), ("cortex-m4f", 15.0)])
def test_the_loop_on_a_board_writes_what_it_writes_on_a_desk(target, seconds, tmp_path):
    """A bad line of the receiver, a gap of its fixes and of samples, and a restart, by way of a UART."""
    needed("cc", "arm-none-eabi-gcc", "qemu-system-arm", "arm-none-eabi-size")
    recording = drive(seconds)
    of = choose_export("closed-loop", ["position", "velocity"], recording)
    for name in ("host", target):
        (tmp_path / name).mkdir()
        export(of, find_target(name), tmp_path / name)
    messages = hidden(damaged(fixes(recording, GPS)), seconds - 5.0, seconds - 2.5)
    events = without_samples(arrivals(recording, GPS, messages), 5.0, 5.3)
    before, after, both = restarted(events, seconds - 8.257)
    sizes = build_firmware(tmp_path / target, target)
    data = stream(before) + RESTART + stream(after)
    lines, told = run_board(tmp_path / target, target, data)
    assert lines == run_desk(tmp_path / "host", stream(both))
    qualities = [line.split(b",")[6] for line in lines[::2]]
    assert len(lines) > 9 * (seconds - 4.0) and {b"1", b"6"} <= set(qualities)
    assert told["stack"] < 6144 and sizes[".text"] + sizes[".data"] < 100_000


def test_an_aarch64_gives_what_python_gives(tmp_path):
    needed("aarch64-linux-gnu-gcc", "qemu-aarch64")
    exported("aarch64", tmp_path)
    code, said = run(
        "aarch64-linux-gnu-gcc",
        *STRICT,
        "-ffp-contract=off",
        "-static",
        "main.c",
        "strapdown_calls.c",
        "strapdown.o",
        "-lm",
        "-o",
        "main",
        folder=tmp_path,
    )
    assert code == 0, said
    code, said = run("qemu-aarch64", "./main", folder=tmp_path)
    assert code == 0 and "rows the same" in said, said  # the sine of its C library is another


def test_webassembly_gives_what_python_gives(tmp_path):
    needed("clang", "wasm-ld", "node")
    made = exported("wasm32", tmp_path)
    assert "strapdown.wasm" in made.files
    code, said = run("node", "main.mjs", folder=tmp_path)
    assert code == 0 and "accepted" in said, said


def test_without_a_linker_of_webassembly_a_note_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    made = exported("wasm32", tmp_path)
    assert "strapdown.wasm" not in made.files and "clang" in made.notes[-1]


def compiled(name, kinds, recording, folder, **options):
    export(choose_export(name, kinds, recording, **options), find_target("host"), folder)
    build_example("cc", folder)
    return run("./main", "replay.bin", "0", folder=folder)


def test_an_hour_has_the_bits_of_python(tmp_path):
    needed("cc")
    code, said = compiled("closed-loop", KINDS, flight(3600.0), tmp_path)
    assert code == 0 and "difference 0 standard" in said, said


@pytest.mark.parametrize("name", [name for name in filters.own_names() if name not in REFUSED])
def test_every_filter_has_the_bits_of_python(name, tmp_path):
    needed("cc")
    recording = sd.simulate("ship", 60.0, seed=4, attitude=Ahrs())
    kinds = [a.kind for a in recording.sources]
    use = filters.find(name).uses
    kinds = SOURCES.get(name) or [kind for kind in kinds if use is None or kind in use]
    kinds = list(dict.fromkeys([*kinds, *filters.find(name).needs]))
    code, said = compiled(name, kinds, recording, tmp_path)
    assert code == 0 and "difference 0 standard" in said, said


def test_speeds_depths_and_ranges_have_the_bits_of_python(tmp_path):
    recording = body_speeds(tmp_path)
    code, said = compiled("closed-loop", [a.kind for a in recording.sources], recording, tmp_path)
    assert code == 0 and "source 6: 58 accepted" in said, said
