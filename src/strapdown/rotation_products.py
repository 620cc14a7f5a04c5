"""Arithmetic of many rotations at once, as scipy Rotation; the kernels have their own in
core/rotation."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def running_products(turns: Rotation) -> Rotation:
    """Products of the first 1, 2, ... n of the Rotations `turns` (n,), in order; by doubling:
    each holds those of the 2, 4, 8 ... before it."""
    from scipy.spatial.transform import Rotation

    found, reach = turns, 1
    while reach < len(found):
        found = Rotation.concatenate([found[:reach], found[:-reach] * found[reach:]])
        reach *= 2
    return found
