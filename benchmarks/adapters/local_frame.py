"""Metres of a plane tangent at the start, for packages that know no Earth."""

import math

import numpy as np


def radii(lat, alt):
    """Metres per radian of latitude and of longitude at `alt`."""
    x = 1 - 6.6943799901413e-3 * math.sin(lat) ** 2
    normal = 6378137.0 / math.sqrt(x)
    return normal * (1 - 6.6943799901413e-3) / x + alt, (normal + alt) * math.cos(lat)


def scale(workload):
    """(3,) metres north, east and down per radian, radian and metre of lla at the start."""
    lat, _, alt = workload.start[0]
    return np.array([*radii(lat, alt), -1.0])
