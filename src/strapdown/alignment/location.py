"""The place of a recording: from its metadata, or without it from a fix."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..data.solution import Source
from ..preprocessing.receiver_classes import join_classes
from ..typing import Array, Ints, Mask

GIVEN_STD = 10.0
"""m: standard deviation of a given place, which holds for the whole recording."""


class KnownPlace(NamedTuple):
    """A position on the Earth."""

    lla: Array  # (3,) latitude, longitude (rad), ellipsoidal height (m)
    std: Array  # (3,) m
    note: str  # its origin


def place_of(
    meta: Mapping[str, Any], sources: Iterable[Source], t: float = -np.inf
) -> KnownPlace | None:
    """Return the KnownPlace of a recording at t (s): `place` of its metadata, else the nearest
    complete position fix (the first by default); None without either."""
    if meta.get("place") is not None:
        return KnownPlace(np.array(meta["place"], float), np.full(3, GIVEN_STD), "place given")
    for source in join_classes(sources):
        whole: Ints = (
            np.flatnonzero(np.isfinite(source.y).all(axis=1) & has_location(source))
            if source.kind == "position"
            else np.empty(0, int)
        )
        if len(whole):
            k = whole[np.argmin(np.abs(source.t[whole] - t))]
            return KnownPlace(source.y[k], source.std[k], "place of the nearest fix")
    return None


def has_location(source: Source) -> Mask:
    """Return True for the fixes (m,) of a source that have a position; a receiver without one
    writes latitude 0 and longitude 0."""
    if source.kind != "position":
        return np.ones(len(source.t), bool)
    return (source.y[:, :2] != 0).any(axis=1)
