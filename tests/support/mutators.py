"""Ways of bending the content of a file, whatever it is: bytes, lines, cells and numbers. Each is a
function of a random generator and the content, and gives the new content."""

import re


def _run(rng, content):
    """(start, stop) of a run of bytes, mostly a short one."""
    start = int(rng.integers(len(content)))
    return start, min(len(content), start + int(2 ** rng.uniform(0, 11)))


def truncated(rng, content):
    return content[: int(rng.integers(len(content)))]


def flipped(rng, content):
    out = bytearray(content)
    for at in rng.integers(len(out), size=rng.integers(1, 9)):
        out[at] ^= 1 << rng.integers(8)
    return bytes(out)


def overwritten(rng, content):
    start, stop = _run(rng, content)
    n = stop - start
    fill = (rng.bytes(n), b"\0" * n, b"\xff" * n)[rng.integers(3)]
    return content[:start] + fill + content[stop:]


def removed(rng, content):
    start, stop = _run(rng, content)
    return content[:start] + content[stop:]


def repeated(rng, content):
    start, stop = _run(rng, content)
    return content[:stop] + content[start:stop] * int(rng.integers(1, 5)) + content[stop:]


def swapped(rng, content):
    a, b, c = sorted(rng.integers(len(content) + 1, size=3))
    return content[:a] + content[b:c] + content[a:b] + content[c:]


def inserted(rng, content):
    at = int(rng.integers(len(content) + 1))
    return content[:at] + rng.bytes(int(rng.integers(1, 64))) + content[at:]


def blown_up(rng, content):
    """A number somewhere, such as a length or a count, is made huge or negative."""
    width = (1, 2, 4, 8)[rng.integers(4)]
    bits = 8 * width
    value = (2**bits - 1, 2 ** (bits - 1) - 1, 2 ** (bits - 1), 2 ** (bits - 2), 0)[rng.integers(5)]
    order = ("little", "big")[rng.integers(2)]
    at = int(rng.integers(len(content)))
    return content[:at] + value.to_bytes(width, order) + content[at + width :]


BYTES = (
    truncated,
    flipped,
    flipped,
    overwritten,
    removed,
    repeated,
    swapped,
    inserted,
    blown_up,
    blown_up,
)


def _lines(change):
    def bend(rng, content):
        lines = content.split(b"\n")
        change(rng, lines)
        return b"\n".join(lines)

    return bend


@_lines
def shuffled(rng, lines):
    some = rng.choice(len(lines), min(len(lines), int(rng.integers(2, 20))), replace=False)
    held = [lines[k] for k in some]
    for k, line in zip(rng.permutation(some), held):
        lines[k] = line


@_lines
def without_lines(rng, lines):
    start = int(rng.integers(len(lines)))
    del lines[start : start + int(2 ** rng.uniform(0, 6))]


@_lines
def lines_again(rng, lines):
    start = int(rng.integers(len(lines)))
    lines[start:start] = lines[start : start + int(2 ** rng.uniform(0, 5))]


@_lines
def other_cells(rng, lines):
    """Cells are added to or taken from a line."""
    k = int(rng.integers(len(lines)))
    cells = lines[k].split(b",")
    lines[k] = b",".join(
        cells[: int(rng.integers(len(cells) + 1))] if rng.integers(2) else cells * 2
    )


NUMBERS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"99999999999999999999", b"", b"-1", b"0")
NUMBERS += (b"1e-320", b"0x1f", b"1,5", b"text", b"None", b"9223372036854775807", b"\xff\xfe")


def other_numbers(rng, content):
    """Some numbers in the text are made huge, missing or no numbers at all."""
    found = list(re.finditer(rb"-?\d+(\.\d*)?", content))
    if not found:
        return content
    new = NUMBERS[rng.integers(len(NUMBERS))]
    picked = sorted(rng.choice(len(found), min(len(found), int(2 ** rng.uniform(0, 5))), False))
    parts, last = [], 0
    for k in picked:
        parts += [content[last : found[k].start()], new]
        last = found[k].end()
    return b"".join(parts) + content[last:]


TEXT = (shuffled, without_lines, lines_again, other_cells, other_numbers, other_numbers)


def is_text(content: bytes) -> bool:
    """Whether it is lines of readable characters."""
    head = content[:2000]
    return b"\0" not in head and head.count(b"\n") > 2
