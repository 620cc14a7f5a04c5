"""The track of a Solution as KML 2.2 for a map viewer: a line at absolute altitude and points
with time stamps."""

import re
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from ..data import Solution, Trajectory
from ..typing import Array, Ints

MOST_VERTICES, MOST_STAMPS = 10000, 500
"""At most this many vertices of the line and points with a time stamp, taken at even steps."""


def kml(solution: Solution) -> bytes:
    """The KML document of a Solution, as bytes."""
    root = ElementTree.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = _add(root, "Document")
    name = (
        " ".join(
            str(solution.meta[key]) for key in ("recording", "filter") if solution.meta.get(key)
        )
        or "strapdown solution"
    )
    midnight, dated = _midnight(solution.meta.get("date"))
    _add(document, "name", name)
    _add(document, "description", _description(solution, midnight, dated))
    line = _add(_add(document, "Style", id="track"), "LineStyle")
    _add(line, "color", "ff2060ff")
    _add(line, "width", "3")
    known = np.flatnonzero(np.isfinite(solution.trajectory.lla).all(axis=1))
    _line(document, name, solution.trajectory.lla[_every(known, MOST_VERTICES)])
    _points(document, solution.trajectory, _every(known, MOST_STAMPS), midnight)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def _add(parent: Element, tag: str, text: str | None = None, **attributes: str) -> Element:
    child = ElementTree.SubElement(parent, tag, attributes)
    if text is not None:
        # what XML 1.0 cannot hold
        child.text = re.sub(
            r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", str(text)
        )
    return child


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


def _line(document: Element, name: str, lla: Array) -> None:
    """The track, cut where it crosses the antimeridian: a viewer would draw the missing step
    around the Earth."""
    placemark = _add(document, "Placemark")
    _add(placemark, "name", name)
    _add(placemark, "styleUrl", "#track")
    pieces = _add(placemark, "MultiGeometry")
    for piece in np.split(lla, np.flatnonzero(np.abs(np.diff(lla[:, 1])) > np.pi) + 1):
        line = _add(pieces, "LineString")
        _add(line, "altitudeMode", "absolute")
        _add(line, "coordinates", " ".join(_coordinates(row) for row in piece))


def _points(
    document: Element, trajectory: Trajectory, rows: Iterable[int], midnight: datetime
) -> None:
    folder = _add(document, "Folder")
    _add(folder, "name", "time")
    for row in rows:
        t = trajectory.t[row]
        placemark = _add(folder, "Placemark")
        _add(placemark, "name", f"{t:.1f} s")
        stamp = midnight + timedelta(seconds=float(t - trajectory.t[0]))
        _add(
            _add(placemark, "TimeStamp"),
            "when",
            stamp.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        )
        point = _add(placemark, "Point")
        _add(point, "altitudeMode", "absolute")
        _add(point, "coordinates", _coordinates(trajectory.lla[row]))


def _coordinates(lla: Array) -> str:
    return f"{np.degrees(lla[1]):.8f},{np.degrees(lla[0]):.8f},{lla[2]:.3f}"
