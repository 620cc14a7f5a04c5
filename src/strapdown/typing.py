"""Names of types that annotations share. Shapes and units stand in the docstrings, since no type
says them."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "ArrayLike", "File", "Ints", "Mask", "Notify", "Progress", "Vector"]

Array: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Mask: TypeAlias = NDArray[np.bool_]
Vector: TypeAlias = Sequence[float] | NDArray[np.float64]
"""A few numbers, such as a lever arm: a tuple, a list or an array (k,)."""
File: TypeAlias = str | PathLike[str]
Notify: TypeAlias = Callable[[str], None]
"""Told of what takes long, one line at a time."""
Progress: TypeAlias = Callable[[float], None]
"""Called with the fraction done, 0 to 1."""
