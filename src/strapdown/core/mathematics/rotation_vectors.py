"""Many rotation vectors at once, as numpy's arrays; those of kernels are in `rotation.py`."""

import numpy as np

from ...typing import Array


def exponentials(vectors: Array) -> Array:
    """Rotation matrices (n, 3, 3) of rotation vectors r (n, 3), rad, by Rodrigues' formula:
    I + sin(a)/a [r x] + (1 - cos(a))/a^2 [r x]^2, a = |r|."""
    angle, S = np.linalg.norm(vectors, axis=1)[:, None, None], np.zeros((len(vectors), 3, 3))
    S[:, 0, 1], S[:, 0, 2], S[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    S -= S.transpose(0, 2, 1)
    return np.asarray(
        np.eye(3) + np.sinc(angle / np.pi) * S + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (S @ S)
    )
