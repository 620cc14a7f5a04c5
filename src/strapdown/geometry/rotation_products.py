"""Arithmetic of many rotations at once, as arrays; `rotations.py` has them as objects. The kernels
have their own in core/mathematics/rotation."""

from __future__ import annotations

import operator
from collections.abc import Callable

import numpy as np

from ..core.mathematics.rotation_vectors import exponentials
from ..typing import Array, Ints


def running_quaternions(turns: Array) -> Array:
    """Products of the first 1, 2, ... n of unit quaternions (n, 4), scalar first, in order."""
    return _running_products(turns, quaternion_products)


def running_matrices(vectors: Array) -> Array:
    """Those of rotation vectors (n, 3), rad, as matrices (n, 3, 3)."""
    return _running_products(exponentials(vectors), operator.matmul)


def _running_products(found: Array, product: Callable[[Array, Array], Array]) -> Array:
    """In blocks: the products within each, all blocks at once, then of those with the blocks
    before it."""
    n, shape = len(found), found.shape[1:]
    size = max(1, int(np.ceil(np.sqrt(n))))
    filled = np.concatenate([found, np.repeat(found[-1:], -n % size, axis=0)])
    blocks = filled.reshape(-1, size, *shape)
    for k in range(1, size):
        blocks[:, k] = product(blocks[:, k - 1], blocks[:, k])
    if len(blocks) > 1:
        blocks[1:] = product(_running_products(blocks[:-1, -1], product)[:, None], blocks[1:])
    return blocks.reshape(-1, *shape)[:n]


def quaternion_products(p: Array, q: Array) -> Array:
    """Products of quaternions (..., 4), scalar first."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * w - px * x - py * y - pz * z,
            pw * x + px * w + py * z - pz * y,
            pw * y - px * z + py * w + pz * x,
            pw * z + px * y - py * x + pz * w,
        ],
        axis=-1,
    )


def unit(q: Array) -> Array:
    """The quaternions (n, 4) divided by their norms; NaN where that is zero."""
    size = np.sqrt(np.einsum("ij,ij->i", q, q))
    return np.asarray(q / np.where(size > 0, size, np.nan)[:, None])


def slerp(q: Array, left: Ints, share: Array) -> Array:
    """(m, 4) unit quaternions, a `share` (m,) of the shorter way from those of the rows `left` (m,)
    of q (n, 4) to the rows after them, at constant rate (Shoemake 1985)."""
    first, second = q[left], q[left + 1]
    second = np.where(np.einsum("ij,ij->i", first, second)[:, None] < 0, -second, second)
    between = 2 * np.arctan2(*(np.linalg.norm(first + sign * second, axis=1) for sign in (-1, 1)))
    parts = [part * np.sinc(part * between / np.pi) for part in (1 - share, share)]
    whole = np.sinc(between / np.pi)
    turned: Array = (parts[0] / whole)[:, None] * first + (parts[1] / whole)[:, None] * second
    return turned


def turns_between(p: Array, q: Array) -> Array:
    """(n, 3) rotation vectors of p (x) q*, rad, of at most half a turn: from the attitudes q to the
    attitudes p, unit quaternions (n, 4), in the frame that both lead to."""
    (pw, px, py, pz), (w, x, y, z) = np.ascontiguousarray(p.T), np.ascontiguousarray(q.T)
    scalar = pw * w + px * x + py * y + pz * z
    vector = np.array(
        [
            px * w - pw * x - py * z + pz * y,
            py * w - pw * y - pz * x + px * z,
            pz * w - pw * z - px * y + py * x,
        ]
    ) * np.where(scalar < 0, -1.0, 1.0)
    half = np.arctan2(np.sqrt((vector**2).sum(axis=0)), np.abs(scalar))
    return (2 * vector / np.sinc(half / np.pi)).T
