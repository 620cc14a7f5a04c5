"""The geoid EGM96: its height above the WGS-84 ellipsoid.

The file `egm96.xz` is the grid WW15MGH.DAC of the NGA, 15' in latitude and longitude, of the model
complete to degree 360 (Lemoine et al. 1998, NASA/TP-1998-206861), in cm. It is a work of the US
government and in the public domain. It was packed by `Path("egm96.xz").write_bytes(pack(Path(
"WW15MGH.DAC").read_bytes()))`; SHA256 is that of the file before.
"""

import lzma
from functools import cache
from importlib.resources import files

import numpy as np

from ..typing import Array

STEPS = 4
"""Points of the grid in a degree."""
ROWS, COLUMNS = 180 * STEPS + 1, 360 * STEPS
MARGIN = 8
"""Points that are added beyond each edge, so that the spline goes on around the Earth."""
HORIZON = 40
"""Points beyond which nothing is left of one in the coefficients of a spline."""


SHA256 = "9dcaf4efd6857aaa2e1e2e2c574d3f5264eacf47024cdcd5291c40ddad5e5acc"


def pack(dac: bytes) -> bytes:
    """The content of `egm96.xz` from that of WW15MGH.DAC, whose numbers are big-endian: from the
    north pole south, and in a row from longitude 0 east. Steps along a row pack better."""
    centimetres = np.frombuffer(dac, ">i2").reshape(ROWS, COLUMNS)
    steps = np.diff(centimetres, axis=1, prepend=0).astype("<i2")
    return lzma.compress(steps.tobytes(), preset=9 | lzma.PRESET_EXTREME)


@cache
def grid() -> Array:
    """(721, 1440) height of the geoid in m: from the north pole south, from longitude 0 east."""
    packed = files(__package__).joinpath("egm96.xz").read_bytes()
    steps = np.frombuffer(lzma.decompress(packed), "<i2").reshape(ROWS, COLUMNS)
    return np.cumsum(steps, axis=1, dtype=np.int16) / 100.0


@cache
def _spline() -> Array:
    """Coefficients of the cubic spline through the grid and its margins."""
    beyond = np.roll(
        grid(), COLUMNS // 2, axis=1
    )  # across a pole the meridian goes on at the other side
    tall = np.vstack([beyond[MARGIN:0:-1], grid(), beyond[-2 : -2 - MARGIN : -1]])
    wide = np.pad(tall, ((0, 0), (MARGIN, MARGIN)), mode="wrap")
    return np.ascontiguousarray(_coefficients(_coefficients(wide).T).T)


def _coefficients(values: Array) -> Array:
    """(n, m) coefficients of the cubic B-splines along the columns of values (n, m), mirrored at both
    ends (Unser 1999, box 2)."""
    pole, found = np.sqrt(3.0) - 2.0, 6.0 * values
    found[0] = pole ** np.arange(HORIZON) @ found[:HORIZON]
    for row in range(1, len(found)):
        found[row] += pole * found[row - 1]
    found[-1] = pole / (pole**2 - 1) * (found[-1] + pole * found[-2])
    for row in range(len(found) - 2, -1, -1):
        found[row] = pole * (found[row + 1] - found[row])
    return found


def _weights(x: Array) -> Array:
    """(4, n) cubic B-splines about the four points around a place that is x (n,) beyond the second."""
    y = 1 - x
    return np.array([y**3, 4 - 3 * x**2 * (2 - x), 4 - 3 * y**2 * (2 - y), x**3]) / 6


def undulation(lat: Array, lon: Array) -> Array:
    """(n,) height of the geoid EGM96 above the ellipsoid, m, at latitudes and longitudes (n,) in
    rad; NaN where one of these is.

    By cubic interpolation, which on this grid is off the model by 7 mm (rms) and 0.17 m at most
    (Karney, GeographicLib, "Geoid height"); the model is off the mean sea level by some 0.5 m.
    """
    known = np.isfinite(lat) & np.isfinite(lon)
    row = (90.0 - np.degrees(np.clip(lat[known], -np.pi / 2, np.pi / 2))) * STEPS + MARGIN
    column = np.degrees(lon[known]) % 360.0 * STEPS + MARGIN
    found = np.full(np.shape(known), np.nan)
    (i, x), (j, y) = ((at.astype(int), at % 1.0) for at in (row, column))
    around = np.arange(-1, 3)[:, None]
    points = _spline()[(i + around)[:, None], (j + around)[None]]
    found[known] = np.einsum("in,ijn,jn->n", _weights(x), points, _weights(y))
    return found
