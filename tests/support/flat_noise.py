"""A recording of a few samples with two sources, whose noise a file may change."""

import numpy as np

import strapdown as sd
from strapdown.data.solution import Source

T = np.arange(1, 11) / 10
PLACE = np.tile([0.8, 0.2, 300.0], (2, 1))
RECORDING = sd.Recording.from_arrays(
    T,
    np.zeros((10, 3)),
    np.tile([0.0, 0.0, -9.8], (10, 1)),
    [
        Source(
            "position", T[[2, 6]], PLACE, np.tile([1.0, 1.0, 2.0], (2, 1)), (0.0,) * 3, name="GNSS"
        ),
        Source("heading", T[[3, 7]], np.zeros((2, 1)), np.full((2, 1), 0.02)),
    ],
)
