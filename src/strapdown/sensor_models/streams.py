"""Where the chance of a simulation comes from: random numbers that are a function of a key and of
their place, without a state (core/mathematics/threefry.py).

A run has a key, each of its sensors and terms another one that follows from it by a name. So no
sensor or term changes what another one draws, and sample r of a table is the same however long the
table is, in whatever pieces and on however many threads it is made.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, Union

import numpy as np

from ..core.mathematics.threefry import fill_normals, fill_uniforms
from ..typing import Array

SeedLike: TypeAlias = Union[
    int, Sequence[int], np.random.SeedSequence, np.random.Generator, "RandomStream"
]
"""Seeds that a RandomStream can be made of. A Generator gives its next numbers for the key, so that
it makes another Stream each time; all others make the same one always."""


@dataclass(frozen=True)
class RandomStream:
    """Random numbers of one key. It has no state: what is drawn twice is the same twice, so each
    use takes a stream of its own name or number."""

    key: tuple[int, int]  # two words below 2^32

    @classmethod
    def of(cls, seed: SeedLike) -> "RandomStream":
        """The stream of a seed."""
        if isinstance(seed, RandomStream):
            return seed
        if isinstance(seed, np.random.Generator):
            low, high = seed.integers(0, 1 << 32, 2).tolist()
            return cls((low, high))
        if not isinstance(seed, np.random.SeedSequence):
            seed = np.random.SeedSequence(seed)
        low, high = seed.generate_state(2).tolist()
        return cls((low, high))

    def child(self, name: str) -> "RandomStream":
        """The stream of that name below this one, the same whatever others there are."""
        return self._below(b"name " + name.encode())

    def numbered_child(self, number: int) -> "RandomStream":
        """The stream of that number below this one, such as that of a run."""
        return self._below(b"number %d" % number)

    def spawn(self, count: int) -> "list[RandomStream]":
        """Those of the first numbers."""
        return [self.numbered_child(number) for number in range(count)]

    def standard_normal(self, shape: int | tuple[int, ...]) -> Array:
        """Standard normals; those of a table by rows, the same as of a longer one."""
        out = np.empty(shape)
        fill_normals(*self.key, out.reshape(-1))
        return out

    def random(self, shape: int | tuple[int, ...]) -> Array:
        """Numbers between 0 and 1, neither of them; as above. They are not independent of the
        normals of the same stream."""
        out = np.empty(shape)
        fill_uniforms(*self.key, out.reshape(-1))
        return out

    def _below(self, path: bytes) -> "RandomStream":
        digest = hashlib.sha256(b"%d %d " % self.key + path).digest()
        return RandomStream(
            (int.from_bytes(digest[:4], "little"), int.from_bytes(digest[4:8], "little"))
        )
