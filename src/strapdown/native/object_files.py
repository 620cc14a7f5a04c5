"""Reads object files: ELF (little-endian) and WebAssembly."""

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

WASM_IMPORTS = 2
WASM_FUNCTION = 0


class RelocationKind(IntEnum):
    """Types of sections of an ELF file (gABI, sh_type)."""

    SYMBOLS = 2
    RELOCATIONS = 4
    NO_CONTENT = 8


class Flag(IntEnum):
    """Flags of sections of an ELF file (gABI, sh_flags)."""

    WRITABLE = 1
    LOADED = 2


class ObjectSection(NamedTuple):
    """A section of an ELF file."""

    kind: int
    flags: int
    link: int  # section with its names, or its symbols
    info: int  # of symbols the first global one, of relocations the section to change
    align: int
    content: bytes


class Symbol(NamedTuple):
    """A symbol of an ELF file."""

    name: str
    section: int  # 0: defined elsewhere
    value: int  # bytes from the beginning of the section
    is_global: bool


class Relocation(NamedTuple):
    """A place in a section that depends on where a symbol is."""

    section: int
    offset: int  # bytes from the beginning of the section
    kind: int
    symbol: Symbol
    addend: int


def undefined_symbols(content: bytes) -> tuple[str, ...]:
    """Names of the functions and variables that an object uses and does not define, sorted. Raises
    ValueError where it is neither ELF nor WebAssembly."""
    if content[:4] == b"\0asm":
        return tuple(sorted(_wasm_imports(content)))
    listed = sections(content)
    names = {one.name for one in symbols(content, listed) if one.is_global and one.section == 0}
    return tuple(sorted(names))


def loaded_size(content: bytes) -> int:
    """Bytes of code and constants of an ELF object; of WebAssembly those of the file. Raises
    ValueError."""
    if content[:4] == b"\0asm":
        return len(content)
    return sum(len(one.content) for one in sections(content) if one.flags & Flag.LOADED)


def sections(content: bytes) -> list[ObjectSection]:
    """All sections of an ELF file. Raises ValueError."""
    wide = _wide(content)
    (at,) = struct.unpack_from("<Q" if wide else "<I", content, 40 if wide else 32)
    size, count = struct.unpack_from("<HH", content, 58 if wide else 46)
    made = []
    for index in range(count):
        head = struct.unpack_from("<IIQQQQIIQ" if wide else "<9I", content, at + index * size)
        _, kind, flags, _, offset, length, link, info, align = head
        made.append(
            ObjectSection(kind, flags, link, info, align, content[offset : offset + length])
        )
    return made


def symbols(content: bytes, listed: list[ObjectSection]) -> list[Symbol]:
    """The symbols of an ELF object, in their order."""
    for table in listed:
        if table.kind == RelocationKind.SYMBOLS:
            names = listed[table.link].content
            if _wide(content):
                rows = [
                    (row[0], row[3], row[4]) for row in struct.iter_unpack("<IBBHQQ", table.content)
                ]
            else:
                rows = [
                    (row[0], row[5], row[1]) for row in struct.iter_unpack("<IIIBBH", table.content)
                ]
            return [
                Symbol(_text(names, name), section, value, index >= table.info)
                for index, (name, section, value) in enumerate(rows)
            ]
    return []


def relocations(content: bytes, listed: list[ObjectSection]) -> Iterator[Relocation]:
    """The relocations of an ELF object of 64 bits."""
    named = symbols(content, listed)
    for one in listed:
        if one.kind == RelocationKind.RELOCATIONS:
            for offset, info, addend in struct.iter_unpack("<QQq", one.content):
                symbol = named[info >> 32]
                yield Relocation(one.info, offset, info & 0xFFFFFFFF, symbol, addend)


def _wide(content: bytes) -> bool:
    """True for an ELF file of 64 bits. Raises ValueError."""
    if content[:4] != b"\x7fELF" or len(content) < 64 or content[5] != 1:
        raise ValueError("neither an ELF file nor WebAssembly")
    return content[4] == 2


def _text(names: bytes, at: int) -> str:
    return names[at : names.index(b"\0", at)].decode()


# ---- WebAssembly


def _wasm_imports(content: bytes) -> Iterator[str]:
    """Names of the functions that a module imports."""
    at = 8
    while at < len(content):
        section, length, at = content[at], *_number(content, at + 1)
        if section == WASM_IMPORTS:
            yield from _imports(content, at)
        at += length


def _imports(content: bytes, at: int) -> Iterator[str]:
    count, at = _number(content, at)
    for _ in range(count):
        for _ in range(2):  # module, name
            length, at = _number(content, at)
            name, at = content[at : at + length], at + length
        kind, at = content[at], at + 1
        if kind == WASM_FUNCTION:
            yield name.decode()
            _, at = _number(content, at)
        else:
            at += 1 if kind != 2 else 0  # type of a table or a global; memory has limits alone
            if kind == 3:
                at += 1  # whether it changes
            else:
                flags, at = _number(content, at)
                for _ in range(1 + (flags & 1)):
                    _, at = _number(content, at)


def _number(content: bytes, at: int) -> tuple[int, int]:
    """(value, place behind it) of a number of as many bytes as it needs."""
    value = shift = 0
    while True:
        byte = content[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
