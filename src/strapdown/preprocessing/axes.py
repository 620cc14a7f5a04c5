"""Axes of sensors and of vectors in files, as matrices from them to body FRD or navigation NED
axes."""

from collections.abc import Iterator, Mapping
from itertools import permutations, product

import numpy as np

from ..checks import DataError
from ..typing import Array

BODY_AXES = {"FRD": "+x +y +z", "FLU": "+x -y -z", "RFU": "+y +x -z"}
"""Body axes by name: forward, right and down in terms of the file's x, y and z."""
NAVIGATION_AXES = {"NED": "+x +y +z", "ENU": "+y +x -z"}
"""Navigation axes by name: north, east and down in terms of the file's first, second and third
column."""


def axes_matrix(text: str, named: Mapping[str, str], right_handed: bool = True) -> Array:
    """Matrix (3, 3) that takes columns with the axes `text` (a name of `named`, or signed axes such
    as "+y +x -z") to FRD or NED. Raises DataError."""
    signed = named.get(text, text).split()
    if len(signed) != 3 or any(
        len(part) != 2 or part[0] not in "+-" or part[1] not in "xyz" for part in signed
    ):
        raise DataError(
            f'unknown axes {text!r}; give {", ".join(named)}, or three signed axes such as "+y +x '
            f'-z"'
        )
    matrix = np.zeros((3, 3))
    for row, part in zip(matrix, signed):
        row["xyz".index(part[1])] = 1.0 if part[0] == "+" else -1.0
    determinant = np.linalg.det(matrix)
    if abs(determinant) < 0.5:
        raise DataError(f"axes {text!r} use an axis twice; use each of x, y and z once")
    if right_handed and determinant < 0:
        raise DataError(
            f"axes {text!r} are left-handed, so no rotated sensor has them; change one sign or swap "
            f"two axes"
        )
    return matrix


def rotation_matrix(roll: float, pitch: float, heading: float) -> Array:
    """(3, 3) C = Rz(heading) Ry(pitch) Rx(roll), angles in rad; Groves (2013) eq. 2.22
    transposed."""
    (cr, cp, ch), (sr, sp, sh) = np.cos([roll, pitch, heading]), np.sin([roll, pitch, heading])
    return np.array(
        [
            [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
            [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotate_rows(vectors: Array, matrix: Array) -> Array:
    """Return the vectors (n, 3) in the axes to which a matrix (3, 3) leads. A row has the same bits
    alone and among others, which a matrix product does not promise: a stream equals a batch."""
    x, y, z = vectors.T
    return np.stack([a * x + b * y + c * z for a, b, c in matrix.tolist()], axis=1)


def signed_permutations() -> Iterator[Array]:
    """The 48 matrices (3, 3) that swap axes and change signs, right-handed and left-handed."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            yield matrix


def named_permutation(matrix: Array) -> str:
    """Return its text in the form of `axes_matrix`, such as "+y +x -z"."""
    source = np.abs(matrix).argmax(axis=1)
    return " ".join(("+" if matrix[i, j] > 0 else "-") + "xyz"[j] for i, j in enumerate(source))


def permute_axes(vectors: Array, matrix: Array) -> Array:
    """Return the vectors (n, 3) in the axes of a signed permutation (3, 3). A NaN stays in its
    component (a matrix product would spread it)."""
    found = np.empty(vectors.shape)
    for k, source in enumerate(np.abs(matrix).argmax(axis=1)):
        np.multiply(vectors[:, source], matrix[k, source], out=found[:, k])
    found += 0.0  # removes the sign of zeros, as a matrix product does
    return found
