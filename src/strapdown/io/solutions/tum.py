"""The poses of a Solution as TUM text (the format of the RGB-D benchmark of TU Munich, Sturm et al.
2012), which evo and others compare: `t x y z qx qy qz qw` a line.

Positions are east, north and up in the plane that touches the ellipsoid at the first position, m;
the quaternion turns body axes forward, left, up into these, as ROS has it (REP 103).
"""

from pathlib import Path

import numpy as np

from ...checks import DataError
from ...data.solution import Solution
from ...geometry.geodesy import ned_axes, to_ecef
from .track import track_of

HEAD = """# {name}
# t x y z qx qy qz qw; t in s{clock}
# x, y, z: east, north, up in m from {origin} (latitude, longitude in deg, height above the WGS-84 ellipsoid in m)
# quaternion: body axes forward, left, up to east, north, up there
"""
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From north, east, down to east, north, up, and back."""
FLU = np.array([1.0, -1.0, -1.0])
"""Of the columns of a matrix: from forward, right, down to forward, left, up."""


def tum(solution: Solution, path: Path) -> bytes:
    """The text of a Solution that is written to `path`; rows without position or attitude are left
    out. Raises DataError where there is none of these."""
    from scipy.spatial.transform import Rotation

    track, trajectory = track_of(solution, path), solution.trajectory
    known = trajectory.q_nb is not None and np.isfinite(trajectory.q_nb[track.rows]).all(axis=1)
    rows = track.rows[known]
    if not len(rows):
        raise DataError(
            f"{path}: the solution has no attitude, which TUM needs; use .gpx, .geojson, .nc or .csv"
        )
    part = trajectory.taking(rows)
    axes = ned_axes(part.lla)
    here = TURN @ axes[0]
    place = (to_ecef(part.lla) - to_ecef(part.lla[0])) @ here.T
    turned = here @ axes.transpose(0, 2, 1) @ (part.rotation.as_matrix() * FLU)
    quaternion = Rotation.from_matrix(turned).as_quat(canonical=True)
    latitude, longitude = np.degrees(part.lla[0, :2])
    head = HEAD.format(
        name=" ".join(track.name.split()),
        clock=", POSIX (UTC)" if track.stamps else " of the recording",
        origin=f"{latitude:.9f}, {longitude:.9f}, {part.lla[0, 2]:.3f}",
    )
    row = "{} {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n".format
    values = np.c_[place, quaternion].tolist()
    times = _times(solution)[rows].tolist()
    return (head + "".join(row(t, *each) for t, each in zip(times, values))).encode()


def _times(solution: Solution) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    """The times of all rows as text, s to the nanosecond: POSIX seconds with an absolute clock,
    which a float would not hold."""
    if solution.utc is None:
        return np.char.mod("%.9f", solution.t)
    nanoseconds = solution.utc.astype(np.int64)
    whole, rest = np.divmod(nanoseconds, 10**9)
    return np.char.add(np.char.mod("%d.", whole), np.char.mod("%09d", rest))
