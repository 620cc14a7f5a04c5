"""Where a recording was taken: what its meta says, else a fix."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..data.solution import Aiding
from ..typing import Array, Ints, Mask

GIVEN_SD = 10.0
"""m: standard deviation of a place that was given; it is one for all of the recording."""


class KnownPlace(NamedTuple):
    """A position on the Earth."""

    lla: Array  # (3,) latitude, longitude (rad), ellipsoidal height (m)
    sd: Array  # (3,) m
    note: str  # where it is from


def place_of(
    meta: Mapping[str, Any], aidings: Iterable[Aiding], t: float = -np.inf
) -> KnownPlace | None:
    """The KnownPlace of a recording at t (s): `place` of its meta, else the nearest complete position
    fix (the first by default); None without either."""
    if meta.get("place") is not None:
        return KnownPlace(np.array(meta["place"], float), np.full(3, GIVEN_SD), "place given")
    for aiding in aidings:
        whole: Ints = (
            np.flatnonzero(np.isfinite(aiding.y).all(axis=1) & has_location(aiding))
            if aiding.kind == "position"
            else np.empty(0, int)
        )
        if len(whole):
            k = whole[np.argmin(np.abs(aiding.t[whole] - t))]
            return KnownPlace(aiding.y[k], aiding.sd[k], "place of the nearest fix")
    return None


def has_location(aiding: Aiding) -> Mask:
    """Which fixes (m,) of an aiding are some: latitude 0 with longitude 0 is what receivers write
    that know no position."""
    if aiding.kind != "position":
        return np.ones(len(aiding.t), bool)
    return (aiding.y[:, :2] != 0).any(axis=1)
