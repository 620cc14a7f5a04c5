"""Many rotations at once, as numpy computes them. scipy has the same; it takes 0.15 s to load and
140 MB, and an installation may lack it."""

from __future__ import annotations

import numpy as np

from ..typing import Array, ArrayLike, Ints, Mask
from .rotation_products import quaternion_products, running_quaternions, slerp, unit


class Rotation:
    """One rotation, or n of them: unit quaternions (4,) or (n, 4), scalar first."""

    def __init__(self, wxyz: Array) -> None:
        self._q = wxyz

    @classmethod
    def from_wxyz(cls, wxyz: ArrayLike) -> Rotation:
        """Take quaternions of any length but zero, which gives NaN."""
        q = np.asarray(wxyz, float)
        return cls(unit(q.reshape(-1, 4)).reshape(q.shape))

    @classmethod
    def from_matrix(cls, C: ArrayLike) -> Rotation:
        """Take orthogonal matrices (3, 3) or (n, 3, 3): the row of 4 q q' with the largest diagonal
        element, which no rounding spoils (Bar-Itzhack 2000)."""
        (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(np.asarray(C, float), (-2, -1), (0, 1))
        rows = np.array(
            [
                [1 + a + e + i, h - f, c - g, d - b],
                [h - f, 1 + a - e - i, b + d, c + g],
                [c - g, b + d, 1 - a + e - i, f + h],
                [d - b, c + g, f + h, 1 - a - e + i],
            ]
        )
        largest = np.argmax(np.einsum("ii...->i...", rows), axis=0)
        chosen = np.take_along_axis(rows, largest[None, None], axis=0)[0]
        return cls.from_wxyz(np.moveaxis(chosen, 0, -1))

    @classmethod
    def from_rotvec(cls, vectors: ArrayLike) -> Rotation:
        """Take rotation vectors (3,) or (n, 3), rad."""
        r = np.asarray(vectors, float)
        angle = np.linalg.norm(r, axis=-1, keepdims=True)
        half = 0.5 * np.sinc(angle / (2 * np.pi))
        return cls(np.concatenate([np.cos(0.5 * angle), half * r], axis=-1))

    @classmethod
    def from_rph(cls, rph: ArrayLike) -> Rotation:
        """Body to navigation of roll, pitch, heading (3,) or (n, 3), rad."""
        half = 0.5 * np.moveaxis(np.asarray(rph, float), -1, 0)
        (sr, sp, sh), (cr, cp, ch) = np.sin(half), np.cos(half)
        return cls(
            np.stack(
                [
                    cr * cp * ch + sr * sp * sh,
                    sr * cp * ch - cr * sp * sh,
                    cr * sp * ch + sr * cp * sh,
                    cr * cp * sh - sr * sp * ch,
                ],
                axis=-1,
            )
        )

    def __len__(self) -> int:
        return len(self._q)

    def __getitem__(self, rows: int | slice | Mask | Ints) -> Rotation:
        return Rotation(self._q[rows])

    def __mul__(self, first: Rotation) -> Rotation:
        """`first`, then this one."""
        return Rotation(quaternion_products(self._q, first._q))

    def inv(self) -> Rotation:
        """Back."""
        return Rotation(self._q * [1.0, -1.0, -1.0, -1.0])

    def apply(self, vectors: ArrayLike) -> Array:
        """Turned vectors (3,) or (n, 3)."""
        v = np.asarray(vectors, float)
        return np.asarray(np.einsum("...ij,...j->...i", self.as_matrix(), v))

    def as_wxyz(self) -> Array:
        """Unit quaternions, scalar first, of either sign."""
        return self._q

    def as_matrix(self) -> Array:
        """Matrices (3, 3) or (n, 3, 3)."""
        w, x, y, z = np.moveaxis(self._q, -1, 0)
        rows = [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
        return np.ascontiguousarray(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))

    def as_rotvec(self) -> Array:
        """Rotation vectors of at most half a turn, rad."""
        vector = self._q[..., 1:] * np.where(self._q[..., :1] < 0, -1.0, 1.0)
        size = np.linalg.norm(vector, axis=-1, keepdims=True)
        half = np.arctan2(size, np.abs(self._q[..., :1]))
        return np.asarray(2 * vector / np.sinc(half / np.pi))

    def as_rph(self) -> Array:
        """Roll, pitch, heading, rad, each in [-pi, pi], of rotations from body to navigation. Where
        the pitch is +-90 deg, roll is zero.

        Roll and heading come from their half sum and half difference, each of which is known as well
        as the pitch lets it (Bernardes and Viollet 2022).
        """
        w, x, y, z = np.moveaxis(self._q, -1, 0)
        down, up = np.hypot(w - y, x + z), np.hypot(w + y, x - z)
        total, between = np.arctan2(x + z, w - y), np.arctan2(x - z, w + y)
        roll, heading = total + between, total - between
        steep = [down < STEEP, up < STEEP]
        heading = np.select(steep, [-2 * between, 2 * total], heading)
        roll = np.where(steep[0] | steep[1], 0.0, roll)
        angles = np.stack([roll, 2 * np.arctan2(up, down) - np.pi / 2, heading], axis=-1)
        return np.asarray(angles - 2 * np.pi * np.round(angles / (2 * np.pi)))


STEEP = 1e-7
"""Size of parts of a quaternion below which roll and heading are one turn."""


def running_products(turns: Rotation) -> Rotation:
    """Products of the first 1, 2, ... n of the rotations `turns` (n,), in order."""
    return Rotation.from_wxyz(running_quaternions(turns.as_wxyz())) if len(turns) else turns


class RotationPath:
    """The rotation at any time between those (n,) at increasing times t (n,) s: from one to the
    next by the shorter way at a constant rate."""

    def __init__(self, t: Array, rotations: Rotation) -> None:
        self._t, self._q = t, rotations.as_wxyz()

    def __call__(self, t: Array) -> Rotation:
        """At times (m,) s. Raises ValueError for those outside."""
        if len(t) and not (self._t[0] <= np.min(t) and np.max(t) <= self._t[-1]):
            raise ValueError(f"times must be within {self._t[0]} and {self._t[-1]} s")
        left = np.clip(np.searchsorted(self._t, t) - 1, 0, len(self._t) - 2)
        share = (t - self._t[left]) / (self._t[left + 1] - self._t[left])
        return Rotation(slerp(self._q, left, share))
