"""The track of a Solution as GeoJSON (RFC 7946): one line of longitude, latitude and height above
the ellipsoid, as the RFC defines height, cut at the antimeridian (section 3.1.9)."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...data.solution import Solution
from ...data.verdict import NOT_JUDGED
from .track import track_of


def geojson(solution: Solution, path: Path) -> bytes:
    """Return the GeoJSON document of a Solution for `path`. Besides the geometry it has, nested
    like the positions, the times `t` in s and, with an absolute clock, `coordTimes` in UTC.

    Raises DataError where there is no position.
    """
    track = track_of(solution, path)
    place = np.c_[
        np.round(np.c_[track.longitude, track.latitude], 9), np.round(track.height, 3)
    ].tolist()
    times = np.round(track.t, 6).tolist()
    pieces = track.pieces

    def nest(values: list[Any]) -> list[Any]:
        # a line needs at least two positions
        lines = [values[piece] * (2 if piece.stop - piece.start == 1 else 1) for piece in pieces]
        return lines[0] if len(lines) == 1 else lines

    properties: dict[str, Any] = {"name": track.name, "description": track.said.strip()}
    if solution.verdict.word != NOT_JUDGED:
        properties["verdict"] = solution.verdict.word
    properties["t"] = nest(times)
    if track.stamps:
        properties["coordTimes"] = nest(track.stamps)
    kind = "LineString" if len(pieces) == 1 else "MultiLineString"
    feature = {
        "type": "Feature",
        "geometry": {"type": kind, "coordinates": nest(place)},
        "properties": properties,
    }
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()
