"""Objects placed in one block: called here, and for other processors the addresses that instructions
refer to, decoded by hand."""

import ctypes
import struct

import pytest

from strapdown.core.compile import library, machine_code
from strapdown.native.emit import LIBRARY, emit
from strapdown.native.relocation import AARCH64, PROCESSORS, X86_64, place

HEAD = 'target datalayout = "e"\ntarget triple = "x86_64-unknown-linux-gnu"\n'
CODE = """
declare double @{function}(double)
@table = internal constant [4 x double] [double 1.5, double 2.5, double {number}, double 4.5]
define double @{name}(double %x, i64 %k) {{
  %y = call double @{function}(double %x)
  %p = getelementptr double, ptr @table, i64 %k
  %t = load double, ptr %p
  %u = fadd double %y, {number}
  %z = fadd double %u, %t
  ret double %z
}}
"""
"""The function plus a constant of the code plus one of four of a table."""
TABLE = machine_code.TABLE


def made(level, name="one", function="exp", number=7.25):
    text = HEAD + CODE.format(name=name, function=function, number=number)
    return emit([text], LIBRARY[level], [name]).content


def test_kernels_of_a_file_run(tmp_path):
    if not library.levels():
        pytest.skip("no library runs on this processor")
    for level in library.levels():
        both = [made(level), made(level, "two", "log", 11.75)]
        block = place(both)
        assert block.kernels.needed == ("exp", "log")
        file = tmp_path / f"{level}.bin"
        file.write_bytes(machine_code.file_content(*block))
        addresses = machine_code.load(file, file.read_bytes())
        assert set(addresses) == {"one", "two"}
        call = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_int64)
        assert call(addresses["one"])(0.0, 2) == 1.0 + 7.25 + 7.25
        assert call(addresses["two"])(1.0, 3) == 0.0 + 11.75 + 4.5


def signed(value, bits):
    return value - (1 << bits) if value >> bits - 1 & 1 else value


def words(code):
    return [
        (at, word) for at, (word,) in zip(range(0, len(code), 4), struct.iter_unpack("<I", code))
    ]


@pytest.mark.parametrize(
    "level", [name for name in LIBRARY if "arm64" in name or name == "aarch64"]
)
def test_instructions_of_aarch64_reach_constants_and_the_table(level):
    """Arm ARM C6.2: ADRP, ADD (immediate), LDR (immediate and literal), BL, BR."""
    code, index = place([made(level, "zero", "log"), made(level)])
    found, pages = set(), {}
    for at, word in words(code[: len(code) // 4 * 4])[index.kernels["one"] // 4 :]:
        if word >> 26 == 0b100101:  # BL
            jump = at + 4 * signed(word & 0x3FFFFFF, 26)
            load, branch = struct.unpack_from("<II", code, jump)
            assert (load >> 24, load & 31, branch) == (0x58, 16, 0xD61F0000 | 16 << 5)
            slot = jump + 4 * signed(load >> 5 & 0x7FFFF, 19)
            assert index.needed[(slot + TABLE) // 8] == "exp"
            found.add("call")
        elif word >> 31 and word >> 24 & 31 == 0b10000:  # ADRP
            pages[word & 31] = (at >> 12) + signed((word >> 5 & 0x7FFFF) << 2 | word >> 29 & 3, 21)
        elif word >> 22 == 0b1001000100 and word >> 5 & 31 in pages:  # ADD
            table = (pages[word >> 5 & 31] << 12) + (word >> 10 & 0xFFF)
            assert struct.unpack_from("<4d", code, table) == (1.5, 2.5, 7.25, 4.5)
            found.add("table")
    assert found == {"call", "table"}


@pytest.mark.parametrize("level", [name for name in LIBRARY if "x86" in name])
def test_instructions_of_x86_64_reach_constants_and_the_table(level):
    """Intel SDM volume 2: CALL rel32 (e8), JMP r/m64 (ff /4 with RIP), ADDSD (f2 0f 58, VEX 58)."""
    code, index = place([made(level, "zero", "log"), made(level)])
    body = code[index.kernels["one"] :]
    at = index.kernels["one"] + body.index(b"\xe8")
    jump = at + 5 + struct.unpack_from("<i", code, at + 1)[0]
    assert code[jump : jump + 2] == b"\xff\x25"
    slot = jump + 6 + struct.unpack_from("<i", code, jump + 2)[0]
    assert index.needed[(slot + TABLE) // 8] == "exp"
    at = index.kernels["one"] + body.index(b"\x58\x05") + 2
    to = at + 4 + struct.unpack_from("<i", code, at)[0]
    assert struct.unpack_from("<d", code, to) == (7.25,)


def test_a_part_of_a_page_is_counted_in_units_of_what_is_loaded():
    page = PROCESSORS[AARCH64].relocate
    for kind, scale in ((277, 1), (278, 1), (284, 2), (285, 4), (286, 8), (299, 16)):
        word = page[kind](0, 0x5000 + 32 * scale, 0)
        assert word >> 10 & 0xFFF == 32 and word & 0x3FF == 0
    assert page[275](0, 0x7123, 0xFFC) == 3 << 29 | 1 << 5  # seven pages
    assert page[261](0, 0x100, 0x180) == 2**32 - 0x80
    assert page[282](0x14000000, 0, 8) == 0x14000000 | 2**26 - 2
    for processor, kind in ((AARCH64, 283), (AARCH64, 275), (X86_64, 4)):
        with pytest.raises(RuntimeError, match="too large"):
            PROCESSORS[processor].relocate[kind](0, 1 << 40, 0)


VARIABLE = """
@count = internal global i64 0
define i64 @one() {
  %x = load i64, ptr @count
  %y = add i64 %x, 1
  store i64 %y, ptr @count
  ret i64 %y
}
"""
ADDRESS = """
@one_at = constant ptr @one
define ptr @one() {
  ret ptr @one_at
}
"""


@pytest.mark.parametrize("text", [VARIABLE, ADDRESS])
def test_variables_and_addresses_are_refused(text):
    names = ["one", "one_at"] if "one_at" in text else ["one"]
    content = emit([HEAD + text], LIBRARY["x86-64-v2"], names[:1], inside=()).content
    with pytest.raises(RuntimeError, match="variables|depends on the address"):
        place([content])
