"""Link the objects of kernels to one block of code that runs at any address.

Code and constants of all objects are concatenated. Position-independent code refers to both by
their distance, so every relocation is resolved here and none is left for the loader. Functions of
the C library are called by a jump at the beginning of the block through a table of their addresses
in front of it (`core/compile/machine_code.py`).
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ..core.compile.machine_code import TABLE, Index
from . import object_files
from .object_files import Flag, ObjectSection, Relocation, RelocationKind

JUMP = 16
"""Bytes for a jump through the table."""
ALIGN = 64
"""Alignment of the code of an object: a line of the processor's cache."""
X86_64, AARCH64 = 62, 183
"""Numbers of the processors in ELF."""


class Block(NamedTuple):
    """Code of several kernels."""

    code: bytes
    kernels: Index


def place(objects: Sequence[bytes]) -> Block:
    """Return the block of these objects, all for one processor. Raises RuntimeError where one has
    variables, or a relocation that depends on the address of the block."""
    processor = PROCESSORS[_processor(objects[0])]
    needed = sorted({name for each in objects for name in object_files.undefined_symbols(each)})
    code = bytearray(
        b"".join(processor.jump(_slot(i) - i * JUMP).ljust(JUMP, b"\0") for i in range(len(needed)))
    )
    outside = {name: i * JUMP for i, name in enumerate(needed)}
    kernels: dict[str, int] = {}
    for content in objects:
        listed = object_files.sections(content)
        first = _append(code, listed)
        for one in object_files.symbols(content, listed):
            if one.is_global and one.section:
                kernels[one.name] = first[one.section] + one.value
        for each in object_files.relocations(content, listed):
            if each.section in first:
                symbol = each.symbol
                inside = symbol.section in first
                to = first[symbol.section] + symbol.value if inside else outside[symbol.name]
                _relocate(code, each, first[each.section] + each.offset, to, processor)
    return Block(bytes(code), Index(tuple(needed), kernels))


def _slot(i: int) -> int:
    """Where an address stands in the table, from the beginning of the block."""
    return 8 * i - TABLE


def _processor(content: bytes) -> int:
    return int(struct.unpack_from("<H", content, 18)[0])


def _append(code: bytearray, listed: list[ObjectSection]) -> dict[int, int]:
    """Append the loaded sections of an object; return the beginning of each."""
    first = {}
    code += bytes(-len(code) % ALIGN)
    for number, one in enumerate(listed):
        if one.flags & Flag.LOADED and one.content:
            if one.flags & Flag.WRITABLE or one.kind == RelocationKind.NO_CONTENT:
                raise RuntimeError("a kernel has variables, which several threads would share")
            code += bytes(-len(code) % one.align)
            first[number] = len(code)
            code += one.content
    return first


# ---- relocations: `to` and `at` are bytes from the beginning of the block


class Processor(NamedTuple):
    """The jumps and relocations of a processor's code."""

    jump: Callable[[int], bytes]  # to the address that many bytes away
    relocate: Mapping[int, Callable[[int, int, int], int]]  # (word, to, at) -> word, by kind


def _relocate(code: bytearray, one: Relocation, at: int, to: int, processor: Processor) -> None:
    if one.kind not in processor.relocate:
        raise RuntimeError(f"relocation {one.kind} of {one.symbol.name} depends on the address")
    (word,) = struct.unpack_from("<I", code, at)
    struct.pack_into("<I", code, at, processor.relocate[one.kind](word, to + one.addend, at))


def _bits(value: int, count: int) -> int:
    """Return a signed number in `count` bits. Raises RuntimeError where it does not fit."""
    if not -(1 << count - 1) <= value < 1 << count - 1:
        raise RuntimeError("the block of kernels is too large for its processor")
    return value & (1 << count) - 1


def _distance(word: int, to: int, at: int) -> int:
    return _bits(to - at, 32)


def _branch(word: int, to: int, at: int) -> int:
    """B and BL: words of 4 bytes, in 26 bits."""
    return word | _bits(to - at >> 2, 26)


def _page(word: int, to: int, at: int) -> int:
    """ADRP: pages of 4096 bytes, the lowest two bits apart from the other 19."""
    pages = _bits((to >> 12) - (at >> 12), 21)
    return word | (pages & 3) << 29 | pages >> 2 << 5


def _in_page(scale: int) -> Callable[[int, int, int], int]:
    """ADD, LDR and STR of 2**scale bytes: where in its page, in 12 bits."""
    return lambda word, to, at: word | (to & 0xFFF) >> scale << 10


def _jump_x86_64(distance: int) -> bytes:
    """jmp *distance(%rip), which counts from the end of its 6 bytes."""
    return b"\xff\x25" + struct.pack("<i", distance - 6)


def _jump_aarch64(distance: int) -> bytes:
    """ldr x16, distance; br x16."""
    return struct.pack("<II", 0x58000010 | _bits(distance >> 2, 19) << 5, 0xD61F0200)


PROCESSORS = {
    # R_X86_64_PC32, R_X86_64_PLT32
    X86_64: Processor(_jump_x86_64, {2: _distance, 4: _distance}),
    AARCH64: Processor(
        _jump_aarch64,
        {
            261: _distance,  # R_AARCH64_PREL32
            275: _page,  # R_AARCH64_ADR_PREL_PG_HI21
            277: _in_page(0),  # R_AARCH64_ADD_ABS_LO12_NC
            278: _in_page(0),  # R_AARCH64_LDST8_ABS_LO12_NC
            282: _branch,  # R_AARCH64_JUMP26
            283: _branch,  # R_AARCH64_CALL26
            284: _in_page(1),  # R_AARCH64_LDST16_ABS_LO12_NC
            285: _in_page(2),  # R_AARCH64_LDST32_ABS_LO12_NC
            286: _in_page(3),  # R_AARCH64_LDST64_ABS_LO12_NC
            299: _in_page(4),  # R_AARCH64_LDST128_ABS_LO12_NC
        },
    ),
}
