"""Random numbers without a state but a counter: Threefry-2x32 (20 rounds), uniforms and normals
from it.

The n-th number is a function of n and a key, so that a run that keeps its counter in the belief
repeats bit for bit, wherever it is stopped and taken up again. Source: Salmon, Moraes, Dror & Shaw
(2011), "Parallel random numbers: as easy as 1, 2, 3", with the known answers of Random123. The
32-bit arithmetic is done in int64; plain Python, compiled code and lanes agree to the bit.
"""

import math

import numpy as np

from ...typing import Array
from ..compile.jit import from_bits, helper, kernel
from ..compile.signatures import WHOLE, reals, signature
from .elementary import ONE_BITS, logarithm_of_normal, sine_cosine_of_turns

KEY, COUNTER, STREAM = 0, 2, 3
"""Places in a stream kept as float64 numbers: its key (two numbers below 2^32), how many blocks were
drawn (exact below 2^53), its size."""
MAX_SEED = 2**53 - 1
MASK, PARITY = 0xFFFFFFFF, 0x1BD11BDA
TURNS = (13, 15, 26, 6, 17, 29, 16, 24)  # bits by which the rounds turn the second word
FILL = signature("fill", k0=WHOLE, k1=WHOLE, out=reals("n"))
HALF_WORD, HALF_FRACTION = 1 << 19, 2.0**-53


@helper
def threefry(k0: int, k1: int, c0: int, c1: int) -> tuple[int, int]:
    """Two words below 2^32 from two words of key and two of counter, int64."""
    k2 = PARITY ^ k0 ^ k1
    x, y, a, b, c = (c0 + k0) & MASK, (c1 + k1) & MASK, k0, k1, k2
    for block in range(5):
        for round in range(4):
            turn = TURNS[4 * (block % 2) + round]
            x = (x + y) & MASK
            y = (((y << turn) | (y >> (32 - turn))) & MASK) ^ x
        a, b, c = b, c, a
        x, y = (x + a) & MASK, (y + b + block + 1) & MASK
    return x, y


@helper
def box_muller(x: int, y: int) -> tuple[float, float]:
    """Two independent standard normals from two words; Box & Muller (1958). None is further out
    than 6.8."""
    # a word w behind the point of 1.0 is 1 + w 2^-32; (w + 1/2) 2^-32 lies between 0 and 1
    radius = math.sqrt(
        -2.0 * logarithm_of_normal(from_bits(ONE_BITS | (x << 20) | HALF_WORD) - 1.0)
    )
    sine, cosine = sine_cosine_of_turns(from_bits(ONE_BITS | (y << 20) | HALF_WORD) - 1.0)
    return radius * cosine, radius * sine


@helper
def normal_pair(k0: int, k1: int, block: int) -> tuple[float, float]:
    """The standard normals 2 block and 2 block + 1 of a key."""
    x, y = threefry(k0, k1, block & MASK, block >> 32)
    return box_muller(x, y)


@kernel(FILL)
def fill_normals(k0: int, k1: int, out: Array) -> None:
    """The first standard normals of a key."""
    size = out.shape[0]
    for block in range(size // 2):
        out[2 * block], out[2 * block + 1] = normal_pair(k0, k1, block)
    if size & 1:
        out[size - 1], _ = normal_pair(k0, k1, size // 2)


@kernel(FILL)
def fill_uniforms(k0: int, k1: int, out: Array) -> None:
    """The first numbers between 0 and 1 of a key."""
    for block in range(out.shape[0]):
        x, y = threefry(k0, k1, block & MASK, block >> 32)
        out[block] = between(x, y)


@helper
def between(x: int, y: int) -> float:
    """A number between 0 and 1, neither of them, of 52 bits of two words."""
    return from_bits(ONE_BITS | (x << 20) | (y >> 12)) - (1.0 - HALF_FRACTION)


@helper
def uniform(stream: Array) -> float:
    """The next number between 0 and 1, neither of them, of 52 bits; advances the stream."""
    count = int(stream[COUNTER])
    x, y = threefry(int(stream[KEY]), int(stream[KEY + 1]), count & MASK, count >> 32)
    stream[COUNTER] += 1
    return between(x, y)


@helper
def normals(stream: Array, out: Array, size: int) -> None:
    """The next standard normals into out[0:size]; of an odd number the last is half a pair.
    Advances the stream."""
    k0, k1, count = int(stream[KEY]), int(stream[KEY + 1]), int(stream[COUNTER])
    for pair in range((size + 1) // 2):
        x, y = threefry(k0, k1, (count + pair) & MASK, (count + pair) >> 32)
        first, second = box_muller(x, y)
        out[2 * pair] = first
        if 2 * pair + 1 < size:
            out[2 * pair + 1] = second
    stream[COUNTER] += (size + 1) // 2


@kernel(signature("normal_rows", stream=reals(STREAM), out=reals("rows", "size")))
def normal_rows(stream: Array, out: Array) -> None:
    """The next rows of `normals`; advances the stream."""
    for row in range(out.shape[0]):
        normals(stream, out[row], out.shape[1])


def new_stream(seed: float) -> Array:
    """A stream (STREAM,) that begins at the first number of a seed. Raises ValueError where it
    is no whole number from 0 to 2^53 - 1."""
    if not (0 <= seed <= MAX_SEED and seed == int(seed)):
        raise ValueError(f"seed is {seed}; it must be a whole number, at least 0 and below 2^53")
    return np.array([int(seed) & MASK, int(seed) >> 32, 0.0])
