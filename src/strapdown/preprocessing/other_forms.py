"""Fixes in other forms than the library's: velocities as speed and course, and positions,
velocities and attitudes in ECEF."""

import numpy as np

from ..geometry import geodesy
from ..geometry.rotations import Rotation
from ..typing import Array
from ..units.wording import count_text
from .origin import Origin

STANDSTILL = 0.5
"""m/s: without a course, a vehicle up to this speed, or up to the speed's std if larger, counts as
standing still."""
RADIUS = (6.33e6, 6.87e6)
"""Smallest and largest distance of a position from the centre of the Earth, m: from 12 km below the
ellipsoid to 500 km above it."""


def over_ground(values: Array, std: Array, origin: Origin) -> tuple[Array, Array, list[str]]:
    """(v_n (m, 3) m/s NED, its standard deviations (m, 3), notes) from a speed over ground, a
    course and, if there is a third column, the velocity down.

    values: (m, 2 or 3) m/s, rad, m/s; std (m, k) of these, or of the speed alone (m, 1), which then
    also applies across and down. The std across the track is that of the course times the speed,
    and at least the speed's, because the course of a slow vehicle is uncertain. Along and across
    are independent; their correlation after the rotation to north and east is left out. Without a
    course the velocity is missing, except at a standstill, where it is zero with the speed as
    standard deviation. Without a third column the velocity down is missing.
    """
    speed, course = values[:, 0], values[:, 1]
    notes = []
    negative = speed < 0
    if negative.any():
        row = origin.line(int(np.argmax(negative)))
        notes.append(
            f"{origin.name}: {count_text(int(negative.sum()), 'row')} with a negative speed left out, "
            f"the first in {row}"
        )
    along = std[:, 0]
    across = np.maximum(along, speed * std[:, 1]) if std.shape[1] > 1 else along
    lost = np.isnan(course)
    resting = lost & (speed <= np.maximum(STANDSTILL, along))
    if lost.any():
        notes.append(
            f"{origin.name}: {count_text(int(lost.sum()), 'row')} without a course, of which "
            f"{int(resting.sum())} at a standstill count as velocity zero; the others have no "
            f"horizontal velocity"
        )
    north, east = np.cos(course), np.sin(course)
    rest_std = np.hypot(along, speed)
    v_n = np.full((len(values), 3), np.nan)
    turned = np.empty((len(values), 3))
    for axis, (one, other) in enumerate(((north, east), (east, north))):
        v_n[:, axis] = np.where(resting, 0.0, speed * one)
        turned[:, axis] = np.where(resting, rest_std, np.hypot(along * one, across * other))
    v_n[negative, :2] = np.nan
    if values.shape[1] == 3:
        v_n[:, 2] = values[:, 2]
    turned[:, 2] = std[:, 2] if std.shape[1] == 3 else along
    return v_n, turned, notes


def positions(xyz: Array, origin: Origin) -> Array:
    """Return geodetic positions (m, 3) from x, y, z in ECEF, m; NaN where one of them is. Raises
    DataError naming the row of an impossible one."""
    radius = np.linalg.norm(xyz, axis=1)
    origin.refuse(
        (radius < RADIUS[0]) | (radius > RADIUS[1]),
        lambda row: (
            f"x, y, z are {radius[row] / 1e3:.6g} km from the centre of the Earth, but a vehicle is at "
            f"{RADIUS[0] / 1e3:.0f} to {RADIUS[1] / 1e3:.0f} km; check columns and unit, and leave out "
            f"rows without a fix with the key `where`"
        ),
    )
    return geodesy.from_ecef(np.where(np.isfinite(radius)[:, None], xyz, np.nan))


def vectors(values: Array, lla: Array) -> Array:
    """Return vectors in ECEF at geodetic positions (m, 3) in NED (m, 3); NaN where a component
    is."""
    return np.einsum("nij,nj->ni", geodesy.ned_axes(lla), values)


def deviations(std: Array, lla: Array) -> Array:
    """Return standard deviations north, east, down (m, 3) from those in ECEF at geodetic positions:
    x, y, z (m, 3), or these with the signed roots of the covariances xy, yz, zx (m, 6)."""
    P = np.zeros((len(std), 3, 3))
    P[:, range(3), range(3)] = std[:, :3] ** 2
    if std.shape[1] == 6:
        for entry, (i, j) in zip(std[:, 3:].T, ((0, 1), (1, 2), (2, 0))):
            P[:, i, j] = P[:, j, i] = entry * np.abs(entry)
    R = geodesy.ned_axes(lla)
    return np.sqrt(np.maximum(np.einsum("nij,njk,nik->ni", R, P, R), 0.0))


def attitudes(q: Array, lla: Array) -> Array:
    """Return the attitude of the body in NED (m, 4), scalar first, from that in ECEF at geodetic
    positions; NaN where one of them is."""
    known = np.isfinite(q).all(axis=1) & np.isfinite(lla[:, :2]).all(axis=1)
    found = np.full(q.shape, np.nan)
    if known.any():
        turn = Rotation.from_matrix(geodesy.ned_axes(lla[known]))
        body = Rotation.from_wxyz(q[known])
        found[known] = (turn * body).as_wxyz()
    return found


def places(t: Array, known: Array, lla: Array) -> Array:
    """Interpolate the positions lla (k, 3) at the times `known` (k,), in order, linearly to the
    times t (m,), s, and return them (m, 3); beyond these the nearest one. A missing height counts
    as 0."""
    lla = np.where(np.isfinite(lla), lla, 0.0)
    xyz = np.stack([np.interp(t, known, each) for each in geodesy.to_ecef(lla).T], axis=1)
    return geodesy.from_ecef(xyz)
