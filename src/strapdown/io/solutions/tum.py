"""The poses of a Solution as TUM text (the format of the RGB-D benchmark of TU Munich, Sturm et al.
2012), which evo and other tools compare: `t x y z qx qy qz qw` per line.

Positions are east, north and up, m, in the tangent plane at an origin, by default the first
position. The quaternion rotates body axes forward, left, up to these axes, as in ROS (REP 103).
"""

import math
import re
from pathlib import Path

import numpy as np

from ...checks import DataError, check_array, locate_errors
from ...data.solution import Solution, attitude_of
from ...fileio.file_access import open_file
from ...geometry.geodesy import ned_axes, to_ecef
from ...geometry.rotations import Rotation
from ...typing import Array, ArrayLike, File
from .track import track_of

HEAD = """# {name}
# t x y z qx qy qz qw; t in s{clock}
# x, y, z: east, north, up in m from {origin} (latitude, longitude in deg, height above the WGS-84 ellipsoid in m)
# quaternion: body axes forward, left, up to east, north, up there
"""
ORIGIN = re.compile(rb"^# x, y, z: .* from (-?\d+\.\d+), (-?\d+\.\d+), (-?\d+\.\d+) \(", re.M)
"""The line of HEAD with the origin."""
MAX_HEAD = 4096
"""Number of bytes that contain the head of a file."""
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From north, east, down to east, north, up, and back."""
FLU = np.array([1.0, -1.0, -1.0])
"""Signs of the columns of a matrix: from forward, right, down to forward, left, up."""


def tum(solution: Solution, path: Path, origin: ArrayLike | None = None) -> bytes:
    """Return the text of a Solution for `path`, with positions from an origin (latitude and
    longitude, rad, and height, m; None: the first position). Rows without position or attitude are
    left out. Raises DataError where no row has both."""
    track, trajectory = track_of(solution, path), solution.trajectory
    known = trajectory.q_nb is not None and np.isfinite(trajectory.q_nb[track.rows]).all(axis=1)
    rows = track.rows[known]
    if not len(rows):
        raise DataError(
            f"{path}: TUM needs an attitude, which the solution lacks; use .gpx, .geojson, .nc or .csv"
        )
    part = trajectory.take(rows)
    zero = part.lla[0] if origin is None else _check_origin(origin, path)
    axes = ned_axes(part.lla)
    here = TURN @ ned_axes(zero)
    place = (to_ecef(part.lla) - to_ecef(zero)) @ here.T
    turned = here @ axes.transpose(0, 2, 1) @ (attitude_of(part).as_matrix() * FLU)
    q = Rotation.from_matrix(turned).as_wxyz()
    quaternion = q[:, [1, 2, 3, 0]] * np.where(q[:, :1] < 0, -1.0, 1.0)
    latitude, longitude = np.degrees(zero[:2])
    head = HEAD.format(
        name=" ".join(track.name.split()),
        clock=", POSIX (UTC)" if track.stamps else " of the recording",
        origin=f"{latitude:.12f}, {longitude:.12f}, {zero[2]:.6f}",
    )
    row = "{} {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n".format
    values = np.c_[place, quaternion].tolist()
    times = _times(solution)[rows].tolist()
    return (head + "".join(row(t, *each) for t, each in zip(times, values))).encode()


def read_origin(path: File) -> tuple[float, float, float]:
    """Return the origin of the positions in a .tum file: latitude and longitude in rad, height
    above the ellipsoid in m. Pass it to `write_solution` to give two files the same frame. Raises
    DataError."""
    with locate_errors(path):
        try:
            with open_file(path) as file:
                head = file.read(MAX_HEAD)
        except OSError as error:
            raise DataError(f"cannot be read ({error.strerror})") from None
        if (found := ORIGIN.search(head)) is None:
            raise DataError("no line has its origin; give a .tum file that strapdown wrote")
        latitude, longitude, height = map(float, found.groups())
    return math.radians(latitude), math.radians(longitude), height


def _check_origin(origin: ArrayLike, path: Path) -> Array:
    """Return an origin (3,). Raises DataError where it is not a place on Earth."""
    with locate_errors(path):
        place = check_array(
            origin, "origin", (3,), what="numbers: latitude and longitude in rad, height in m"
        )
        if abs(place[0]) > np.pi / 2 or abs(place[1]) > 2 * np.pi:
            raise DataError(
                f"origin is ({place[0]:g} rad, {place[1]:g} rad, {place[2]:g} m); the limit of the latitude "
                f"is 1.571 rad (90 deg): is it in deg?"
            )
    return place


def _times(solution: Solution) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    """Return the times of all rows as text, s to the nanosecond: POSIX seconds with an absolute
    clock, beyond the precision of a float."""
    if solution.utc is None:
        return np.char.mod("%.9f", solution.t)
    nanoseconds = solution.utc.astype(np.int64)
    whole, rest = np.divmod(nanoseconds, 10**9)
    return np.char.add(np.char.mod("%d.", whole), np.char.mod("%09d", rest))
