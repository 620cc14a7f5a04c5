"""Arithmetic of many rotations at once: as scipy Rotation, or as matrices where scipy alone would
take 0.2 s to load. The kernels have their own in core/rotation."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .core.rotation_vectors import exponentials
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


def _running(found: Any, product: Callable[[Any, Any], Any], joined: Callable[[Any], Any]) -> Any:
    """By doubling: each holds those of the 2, 4, 8 ... before it."""
    reach = 1
    while reach < len(found):
        found = joined([found[:reach], product(found[:-reach], found[reach:])])
        reach *= 2
    return found
