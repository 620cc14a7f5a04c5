"""Geodesy of arrays at the edge (numpy): displacements in metres NED between geodetic positions.
The kernels have their own in core/mathematics/earth."""

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ..core.mathematics.earth import (
    E2,
    FAR_HEIGHT,
    GRAVITY_EQUATOR,
    GRAVITY_NORTH_GRADIENT,
    M_RATIO,
    MU,
    SOMIGLIANA,
    A,
    F,
)
from ..typing import Array, ArrayLike, Vector
from ..units.constants import STANDARD_GRAVITY


def radii(lat: ArrayLike) -> tuple[Array, Array]:
    """Meridian and normal radius of curvature R_M, R_N, m, of an array of latitudes in rad;
    Groves (2013) eq. 2.105, 2.106."""
    x = 1 - E2 * np.sin(lat) ** 2
    R_N = A / np.sqrt(x)
    return R_N * (1 - E2) / x, R_N


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: Vector | NDArray[Any]) -> Array: ...
def wrap(angle: ArrayLike) -> Any:
    """The angle in [-pi, pi), rad."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def displacement(lla: ArrayLike, origin: ArrayLike) -> Array:
    """(n, 3) metres NED from `origin` to `lla`, radii at the middle of the two as in pyins;
    longitudes may straddle the antimeridian."""
    lla, origin = np.asarray(lla), np.asarray(origin)
    middle = (lla + origin) / 2
    R_M, R_N = radii(middle[..., 0])
    return np.stack(
        [
            (lla[..., 0] - origin[..., 0]) * (R_M + middle[..., 2]),
            wrap(lla[..., 1] - origin[..., 1]) * (R_N + middle[..., 2]) * np.cos(middle[..., 0]),
            origin[..., 2] - lla[..., 2],
        ],
        axis=-1,
    )


def displace_lla(lla: ArrayLike, ned: ArrayLike) -> Array:
    """Geodetic positions (n, 3) moved by a few metres north, east, down (n, 3); first order,
    error about d^2/R."""
    lat, lon, alt = np.moveaxis(np.asarray(lla, float), -1, 0)
    north, east, down = np.moveaxis(np.asarray(ned, float), -1, 0)
    R_M, R_N = radii(lat)
    return np.stack(
        [lat + north / (R_M + alt), wrap(lon + east / ((R_N + alt) * np.cos(lat))), alt - down],
        axis=-1,
    )


@overload
def gravity(lat: float, h: float = 0.0, model: str = "wgs84") -> float: ...
@overload
def gravity(lat: Vector | NDArray[Any], h: ArrayLike = 0.0, model: str = "wgs84") -> Array: ...
def gravity(lat: ArrayLike, h: ArrayLike = 0.0, model: str = "wgs84") -> Any:
    """Gravity (m/s^2, downwards), of latitudes (rad) and ellipsoidal heights (m).

    model: "wgs84", normal gravity of the ellipsoid, Somigliana's formula with the second-order term
    in height (Heiskanen & Moritz 1967, 2-123), which every filter here uses; "constant", 9.80665
    everywhere, up to 0.3 % off at sea level. Raises ValueError for another model. `gravity_ned`
    has the north component too.
    """
    lat, h = np.broadcast_arrays(np.asarray(lat, float), np.asarray(h, float))
    if model == "constant":
        return np.full(lat.shape, STANDARD_GRAVITY)[()]
    if model != "wgs84":
        raise ValueError(f"no gravity model {model!r}; there is: wgs84, constant")
    square = np.sin(lat) ** 2
    surface = GRAVITY_EQUATOR * (1 + SOMIGLIANA * square) / np.sqrt(1 - E2 * square)
    near = surface * (1 - 2 / A * (1 + F + M_RATIO - 2 * F * square) * h + 3 / (A * A) * h * h)
    return np.where(np.abs(h) > FAR_HEIGHT, MU / np.maximum(A + h, 0.1 * A) ** 2, near)[()]


def gravity_ned(lat: ArrayLike, h: ArrayLike = 0.0) -> Array:
    """Gravity (..., 3) in m/s^2, north, east, down, of latitudes (rad) and ellipsoidal heights
    (m), as the INS filters here compute it.

    Down is `gravity`. North is -1.63e-8 h sin L cos L: above the ellipsoid gravity leans towards
    the equator, by 8.3e-6 rad at 45 deg and 10 km (`core.mathematics.earth.gravity_north`).
    """
    lat, h = np.broadcast_arrays(np.asarray(lat, float), np.asarray(h, float))
    north = np.where(
        np.abs(h) > FAR_HEIGHT, 0.0, -GRAVITY_NORTH_GRADIENT * np.sin(lat) * np.cos(lat) * h
    )
    return np.stack([north, np.zeros(lat.shape), gravity(lat, h)], axis=-1)


def to_ecef(lla: ArrayLike) -> Array:
    """(..., 3) x, y, z in ECEF, m, of geodetic positions (rad, rad, m)."""
    lat, lon, h = np.moveaxis(np.asarray(lla, float), -1, 0)
    R_N = radii(lat)[1]
    across = (R_N + h) * np.cos(lat)
    return np.stack(
        [across * np.cos(lon), across * np.sin(lon), (R_N * (1 - E2) + h) * np.sin(lat)], axis=-1
    )


def from_ecef(xyz: ArrayLike) -> Array:
    """(..., 3) latitude, longitude (rad) and ellipsoidal height (m) of positions in ECEF, m, exact
    from 50 km off the centre of the Earth on; Vermeille (2002), J. Geodesy 76:451-454."""
    x, y, z = np.moveaxis(np.asarray(xyz, float), -1, 0)
    across = np.hypot(x, y)
    p, q = (across / A) ** 2, (1 - E2) * (z / A) ** 2
    r = (p + q - E2 * E2) / 6
    s = E2 * E2 * p * q / (4 * r**3)
    t = np.cbrt(1 + s + np.sqrt(s * (2 + s)))
    u = r * (1 + t + 1 / t)
    v = np.sqrt(u * u + E2 * E2 * q)
    w = E2 * (u + v - q) / (2 * v)
    k = np.sqrt(u + v + w * w) - w
    d = k * across / (k + E2)
    foot = np.hypot(d, z)
    return np.stack(
        [2 * np.arctan2(z, d + foot), np.arctan2(y, x), (k + E2 - 1) / k * foot], axis=-1
    )


def ned_axes(lla: ArrayLike) -> Array:
    """(..., 3, 3) C_ne: its rows are north, east and down at geodetic positions in ECEF; Groves
    (2013) eq. 2.150."""
    lat, lon, _ = np.moveaxis(np.asarray(lla, float), -1, 0)
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    north = np.stack([-sl * co, -sl * so, cl], axis=-1)
    east = np.stack([-so, co, np.zeros(np.shape(so))], axis=-1)
    down = np.stack([-cl * co, -cl * so, -sl], axis=-1)
    return np.stack([north, east, down], axis=-2)
