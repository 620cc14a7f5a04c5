"""What object files and libraries need from outside: ELF (little-endian) and WebAssembly."""

import struct
from collections.abc import Iterator
from typing import NamedTuple

DYNAMIC, DYNAMIC_SYMBOLS, SYMBOLS, VERSIONS_NEEDED = 6, 11, 2, 0x6FFFFFFE
"""Kinds of ELF sections."""
NEEDED = 1
"""Tag of the dynamic section: name of a library."""
WASM_IMPORTS = 2
WASM_FUNCTION = 0


LOADED = 2
"""Flag of a section that is in memory when the code runs."""


class Section(NamedTuple):
    """Of an ELF file."""

    kind: int
    flags: int
    link: int
    info: int
    content: bytes


def undefined(content: bytes) -> tuple[str, ...]:
    """Names of the functions and variables that an object or library asks for, sorted. Raises
    ValueError where it is neither ELF nor WebAssembly."""
    if content[:4] == b"\0asm":
        return tuple(sorted(_wasm_imports(content)))
    found = set()
    sections = _sections(content)
    dynamic = any(one.kind == DYNAMIC_SYMBOLS for one in sections)
    for one in sections:
        if one.kind == (DYNAMIC_SYMBOLS if dynamic else SYMBOLS):
            found |= {name for name, at in _symbols(content, sections, one) if at == 0}
    return tuple(sorted(found))


def defined(content: bytes) -> tuple[str, ...]:
    """Names that an ELF library offers, sorted. Raises ValueError."""
    sections = _sections(content)
    return tuple(
        sorted(
            name
            for one in sections
            if one.kind == DYNAMIC_SYMBOLS
            for name, at in _symbols(content, sections, one)
            if at
        )
    )


def libraries(content: bytes) -> tuple[str, ...]:
    """Names of the libraries that an ELF library needs. Raises ValueError."""
    sections = _sections(content)
    return tuple(
        _text(sections[one.link].content, value)
        for one in sections
        if one.kind == DYNAMIC
        for tag, value in struct.iter_unpack("<qq" if _wide(content) else "<ii", one.content)
        if tag == NEEDED
    )


def versions(content: bytes) -> dict[str, tuple[str, ...]]:
    """{library: versions of its symbols that an ELF library needs}. Raises ValueError."""
    sections = _sections(content)
    found: dict[str, tuple[str, ...]] = {}
    for one in sections:
        if one.kind != VERSIONS_NEEDED:
            continue
        names, at = sections[one.link].content, 0
        for _ in range(one.info):
            _, count, file, first, after = struct.unpack_from("<HHIII", one.content, at)
            each, listed = at + first, []
            for _ in range(count):
                _, _, _, name, further = struct.unpack_from("<IHHII", one.content, each)
                listed.append(_text(names, name))
                each += further
            found[_text(names, file)] = tuple(sorted(listed))
            at += after
    return found


def loaded(content: bytes) -> int:
    """Bytes of code and constants of an ELF object; of WebAssembly those of the file. Raises
    ValueError."""
    if content[:4] == b"\0asm":
        return len(content)
    return sum(len(one.content) for one in _sections(content) if one.flags & LOADED)


def _wide(content: bytes) -> bool:
    """Whether an ELF file is one of 64 bits. Raises ValueError."""
    if content[:4] != b"\x7fELF" or len(content) < 64 or content[5] != 1:
        raise ValueError("neither an ELF file nor WebAssembly")
    return content[4] == 2


def _sections(content: bytes) -> list[Section]:
    wide = _wide(content)
    (at,) = struct.unpack_from("<Q" if wide else "<I", content, 40 if wide else 32)
    size, count = struct.unpack_from("<HH", content, 58 if wide else 46)
    made = []
    for index in range(count):
        head = struct.unpack_from("<IIQQQQII" if wide else "<8I", content, at + index * size)
        _, kind, flags, _, offset, length, link, info = head
        made.append(Section(kind, flags, link, info, content[offset : offset + length]))
    return made


def _symbols(content: bytes, sections: list[Section], table: Section) -> Iterator[tuple[str, int]]:
    """(name, section) of the global symbols; section 0 is outside."""
    names = sections[table.link].content
    if _wide(content):
        rows = ((row[0], row[3]) for row in struct.iter_unpack("<IBBHQQ", table.content))
    else:
        rows = ((row[0], row[5]) for row in struct.iter_unpack("<IIIBBH", table.content))
    for index, (name, section) in enumerate(rows):
        if index >= table.info and name:
            yield _text(names, name), section


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
