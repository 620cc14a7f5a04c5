"""Geodesy of arrays at the edge (numpy): displacements in metres NED between geodetic positions. The kernels have their own in core/earth."""
import numpy as np

from .core.earth import A, E2


def radii(lat):
    """Meridian and normal radius of curvature R_M, R_N, m, of an array of latitudes in rad; Groves (2013) eq. 2.105, 2.106."""
    x = 1 - E2 * np.sin(lat) ** 2
    R_N = A / np.sqrt(x)
    return R_N * (1 - E2) / x, R_N


def wrap(angle):
    """The angle in [-pi, pi), rad."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def displacement(lla, origin):
    """(n, 3) metres NED from `origin` to `lla`, radii at the middle of the two as in pyins; longitudes may straddle the antimeridian."""
    lla, origin = np.asarray(lla), np.asarray(origin)
    middle = (lla + origin) / 2
    R_M, R_N = radii(middle[..., 0])
    return np.stack([(lla[..., 0] - origin[..., 0]) * (R_M + middle[..., 2]),
                     wrap(lla[..., 1] - origin[..., 1]) * (R_N + middle[..., 2]) * np.cos(middle[..., 0]),
                     origin[..., 2] - lla[..., 2]], axis=-1)


def displaced(lla, ned):
    """Geodetic positions (n, 3) moved by a few metres north, east, down (n, 3); first order, error about d^2/R."""
    lat, lon, alt = np.moveaxis(np.asarray(lla, float), -1, 0)
    north, east, down = np.moveaxis(np.asarray(ned, float), -1, 0)
    R_M, R_N = radii(lat)
    return np.stack([lat + north / (R_M + alt), wrap(lon + east / ((R_N + alt) * np.cos(lat))), alt - down], axis=-1)
