"""The track of a Solution as GPX 1.1 (topografix.com/GPX/1/1): every row with a known position, and
a new segment after rows without one."""

from collections.abc import Iterator
from pathlib import Path

from ...data.solution import Solution
from .track import HEIGHTS, Track, track_of, xml

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="strapdown" xmlns="http://www.topografix.com/GPX/1/1">
<metadata>
<name>{name}</name>
<desc>{desc}</desc>
{time}</metadata>
<trk>
<name>{name}</name>
"""
POINT = '<trkpt lat="{:.9f}" lon="{:.9f}"><ele>{:.3f}</ele>{}</trkpt>\n'


def gpx(solution: Solution, path: Path) -> bytes:
    """The GPX document of a Solution that is written to `path`. Raises DataError where there is no
    position."""
    track = track_of(solution, path)
    times = [f"<time>{stamp}</time>" for stamp in track.stamps] or [""] * len(track.t)
    desc = f"{track.said}{HEIGHTS}, not above mean sea level."
    head = HEAD.format(name=xml(track.name), desc=xml(desc), time=times[0] and times[0] + "\n")
    return "".join([head, *_segments(track, times), "</trk>\n</gpx>\n"]).encode()


def _segments(track: Track, times: list[str]) -> Iterator[str]:
    columns = track.latitude.tolist(), track.longitude.tolist(), track.height.tolist(), times
    for part in track.segments:
        yield "<trkseg>\n"
        yield from (POINT.format(*row) for row in zip(*(each[part] for each in columns)))
        yield "</trkseg>\n"
