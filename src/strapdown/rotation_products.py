"""Arithmetic of many rotations at once: as scipy Rotation, or as matrices where scipy alone would
take 0.2 s to load. The kernels have their own in core/rotation."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .typing import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def running_products(turns: Rotation) -> Rotation:
    """Products of the first 1, 2, ... n of the Rotations `turns` (n,), in order."""
    from scipy.spatial.transform import Rotation

    found: Rotation = _running(turns, operator.mul, Rotation.concatenate)
    return found


def running_matrices(vectors: Array) -> Array:
    """The same of rotation vectors (n, 3), rad, as matrices (n, 3, 3)."""
    found: Array = _running(exponentials(vectors), operator.matmul, np.concatenate)
    return found


def exponentials(vectors: Array) -> Array:
    """The matrices (n, 3, 3) of rotation vectors (n, 3), rad: I + a K + b K K with K x = vector x x."""
    x, y, z = vectors.T
    zero, angle = np.zeros(len(vectors)), np.sqrt(x * x + y * y + z * z)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    # sin(angle)/angle and (1 - cos(angle))/angle^2, also of 0
    a, b = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + a[:, None, None] * K + b[:, None, None] * (K @ K)


def _running(found: Any, product: Callable[[Any, Any], Any], joined: Callable[[Any], Any]) -> Any:
    """By doubling: each holds those of the 2, 4, 8 ... before it."""
    reach = 1
    while reach < len(found):
        found = joined([found[:reach], product(found[:-reach], found[reach:])])
        reach *= 2
    return found
