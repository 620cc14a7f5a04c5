"""Where a recording was taken: what its meta says, else a fix."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..data.solution import Source
from ..preprocessing.receiver_classes import join_classes
from ..typing import Array, Ints, Mask

GIVEN_STD = 10.0
"""m: standard deviation of a place that was given; it is one for all of the recording."""


class KnownPlace(NamedTuple):
    """A position on the Earth."""

    lla: Array  # (3,) latitude, longitude (rad), ellipsoidal height (m)
    std: Array  # (3,) m
    note: str  # where it is from


def place_of(
    meta: Mapping[str, Any], sources: Iterable[Source], t: float = -np.inf
) -> KnownPlace | None:
    """The KnownPlace of a recording at t (s): `place` of its meta, else the nearest complete position
    fix (the first by default); None without either."""
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
    """Which fixes (m,) of a source are some: latitude 0 with longitude 0 is what receivers write
    that know no position."""
    if source.kind != "position":
        return np.ones(len(source.t), bool)
    return (source.y[:, :2] != 0).any(axis=1)
