"""The track of a Solution as KML 2.2 for a map viewer: a line at absolute altitude and points
with time stamps."""

import re
from datetime import UTC, datetime, timedelta
from xml.sax.saxutils import escape

import numpy as np

from ..data import Solution
from ..typing import Array, Ints
from ..verdict import NOT_JUDGED, TRUSTED

MOST_VERTICES, MOST_STAMPS = 10000, 500
"""At most this many vertices of the line and points with a time stamp, taken at even steps."""
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
        <name>{:.1f} s</name>
        <TimeStamp>
          <when>{}Z</when>
        </TimeStamp>
        <Point>
          <altitudeMode>absolute</altitudeMode>
          <coordinates>{}</coordinates>
        </Point>
      </Placemark>"""


def kml(solution: Solution) -> bytes:
    """The KML document of a Solution, as bytes."""
    t, lla = solution.t, solution.trajectory.lla
    words = [str(solution.meta[key]) for key in ("recording", "filter") if solution.meta.get(key)]
    verdict, (midnight, dated) = solution.verdict, _midnight(solution.meta.get("date"))
    doubt = "" if verdict.word in (TRUSTED, NOT_JUDGED) else f" ({verdict.word})"
    said = "" if verdict.word == NOT_JUDGED else f"Verdict: {verdict.line}. "
    known = np.flatnonzero(np.isfinite(lla).all(axis=1))
    track = lla[_every(known, MOST_VERTICES)]
    # cut at the antimeridian: a viewer would draw the missing step around the Earth
    pieces = np.split(track, np.flatnonzero(np.abs(np.diff(track[:, 1])) > np.pi) + 1)
    stamps = [
        (row, midnight + timedelta(seconds=float(t[row] - t[0])))
        for row in _every(known, MOST_STAMPS)
    ]
    return DOCUMENT.format(
        name=_text((" ".join(words) or "strapdown solution") + doubt),
        description=_text(said + _description(solution, midnight, dated)),
        lines="\n".join(LINE.format(" ".join(map(_coordinates, piece))) for piece in pieces),
        points="\n".join(
            POINT.format(
                t[row],
                when.replace(tzinfo=None).isoformat(timespec="milliseconds"),
                _coordinates(lla[row]),
            )
            for row, when in stamps
        ),
    ).encode()


def _text(text: str) -> str:
    """Fit for XML 1.0, with ? for what it cannot hold."""
    return escape(re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text))


def _every(rows: Ints, most: int) -> Ints:
    """At most `most` of the rows at even steps, the last one included."""
    step = -(-len(rows) // most) if len(rows) else 1
    return rows if step == 1 else np.r_[rows[::step][: most - 1], rows[-1]]


def _midnight(date: str | None) -> tuple[datetime, bool]:
    """Midnight, UTC, of the day of an ISO text, and whether there is one; else that of 1970."""
    try:
        return datetime.fromisoformat(str(date)[:10]).replace(tzinfo=UTC), True
    except ValueError:
        return datetime(1970, 1, 1, tzinfo=UTC), False


def _description(solution: Solution, midnight: datetime, dated: bool) -> str:
    t = solution.t
    span = f"{t[0]:.3f} to {t[-1]:.3f} s" if len(t) else "no rows"
    remark = "." if dated else ": the recording has no date."
    return (
        f"Solution of strapdown, {span} of the recording. Altitudes are heights above the WGS-84 "
        f"ellipsoid; map viewers take them as "
        "heights above mean sea level, so that the track may appear too high or too low by the "
        "geoid undulation (-107 to +86 m). "
        f"Time stamps are {midnight:%Y-%m-%d} 00:00:00 UTC plus the seconds since the first "
        f"row{remark}"
    )


def _coordinates(lla: Array) -> str:
    return f"{np.degrees(lla[1]):.8f},{np.degrees(lla[0]):.8f},{lla[2]:.3f}"
