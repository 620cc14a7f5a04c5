"""The vector between two antennas of a vehicle, as a section of a description: left until it is asked for,
because no log says how it lies in the vehicle."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...typing import Array
from ..reader import Section

ASSUMED = "forward, and as long as measured: the file does not say how it lies"


def baseline_section(
    keys: Mapping[str, Any], vectors: Array, title: str, instance: int = 0
) -> Section:
    """The section of measured vectors.

    Parameters
    ----------
    keys : dict
        Table, time, columns and standard deviations of the vectors.
    vectors : (n, 3) array
        From the first to the second antenna, m NED.
    title : str
        The name of the table.
    instance : int
        Number of the pair, from 0.

    Returns
    -------
    Section
        With a `baseline` that points forward and has their median length.
    """
    length = round(float(np.median(np.linalg.norm(vectors, axis=1))), 3)
    every = {"kind": "baseline", **keys, "unit": "m", "baseline": [length, 0.0, 0.0]}
    return Section(
        "source",
        "baseline",
        every,
        instance,
        f"{title}, {len(vectors)} vectors of {length:g} m",
        {"baseline": ASSUMED},
        f"how it lies in the vehicle is not in the file; --take baseline={instance} takes it as "
        "forward",
    )
