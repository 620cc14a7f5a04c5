"""Where a recording was taken: what its meta says, else a fix."""

from typing import NamedTuple

import numpy as np

GIVEN_SD = 10.0
"""m: standard deviation of a place that was given; it is one for all of the recording."""


class Place(NamedTuple):
    """A position on the Earth."""

    lla: np.ndarray  # (3,) latitude, longitude (rad), ellipsoidal height (m)
    sd: np.ndarray  # (3,) m
    note: str  # where it is from


def place_of(meta, aidings, t=-np.inf):
    """The Place of a recording at t (s): `place` of its meta, else the nearest complete position
    fix (the first by default); None without either."""
    if meta.get("place") is not None:
        return Place(np.array(meta["place"], float), np.full(3, GIVEN_SD), "place given")
    for aiding in aidings:
        whole = (
            np.flatnonzero(np.isfinite(aiding.y).all(axis=1)) if aiding.kind == "position" else []
        )
        if len(whole):
            k = whole[np.argmin(np.abs(aiding.t[whole] - t))]
            return Place(aiding.y[k], aiding.sd[k], "place of the nearest fix")
    return None
