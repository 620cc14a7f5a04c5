"""The track of a Solution as KML 2.2 for a map viewer: a line at absolute altitude and points, with
time stamps where the clock is absolute."""

from pathlib import Path

import numpy as np

from ...data.solution import Solution
from ...typing import Ints
from .track import HEIGHTS, Track, track_of, xml

MAX_VERTICES, MAX_POINTS = 10000, 500
"""Largest numbers of vertices of the line and of points with their time, at even steps."""
DOCUMENT = """<?xml version='1.0' encoding='UTF-8'?>
<kml xmlns="http://www.opengis.net/kml/2.2">
  <Document>
    <name>{name}</name>
    <description>{description}</description>
    <Style id="track">
      <LineStyle>
        <color>ff2060ff</color>
        <width>3</width>
      </LineStyle>
    </Style>
    <Placemark>
      <name>{name}</name>
      <styleUrl>#track</styleUrl>
      <MultiGeometry>
{lines}
      </MultiGeometry>
    </Placemark>
    <Folder>
      <name>time</name>
{points}
    </Folder>
  </Document>
</kml>"""
LINE = """        <LineString>
          <altitudeMode>absolute</altitudeMode>
          <coordinates>{}</coordinates>
        </LineString>"""
POINT = """      <Placemark>
        <name>{} s</name>{}
        <Point>
          <altitudeMode>absolute</altitudeMode>
          <coordinates>{}</coordinates>
        </Point>
      </Placemark>"""

STAMP = """
        <TimeStamp>
          <when>{}</when>
        </TimeStamp>"""


def kml(solution: Solution, path: Path) -> bytes:
    """Return the KML document of a Solution for `path`. Raises DataError where there is no
    position."""
    track = track_of(solution, path)
    vertices = _every(len(track.t), MAX_VERTICES)
    # cut at the antimeridian, where a viewer would draw a line around the Earth
    cuts = np.flatnonzero(np.abs(np.diff(track.longitude[vertices])) > 180) + 1
    description = (
        f"{track.said}{HEIGHTS}; map viewers treat them as heights above mean sea level, so the "
        f"track may appear too high or too low by the geoid undulation (-107 to +86 m)."
    )
    return DOCUMENT.format(
        name=xml(track.name),
        description=xml(description),
        lines="\n".join(
            LINE.format(" ".join(_coordinates(track, row) for row in piece))
            for piece in np.split(vertices, cuts)
        ),
        points="\n".join(_point(track, row) for row in _every(len(track.t), MAX_POINTS)),
    ).encode()


def _every(many: int, most: int) -> Ints:
    """Return at most `most` of `many` rows at even steps, with the last one."""
    rows, step = np.arange(many), -(-many // most)
    return rows if step <= 1 else np.r_[rows[::step][: most - 1], rows[-1]]


def _point(track: Track, row: int) -> str:
    stamp = STAMP.format(track.stamps[row]) if track.stamps else ""
    return POINT.format(f"{track.t[row]:.1f}", stamp, _coordinates(track, row))


def _coordinates(track: Track, row: int) -> str:
    return f"{track.longitude[row]:.8f},{track.latitude[row]:.8f},{track.height[row]:.3f}"
