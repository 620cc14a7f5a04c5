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
    from scipy.ndimage import spline_filter

    beyond = np.roll(
        grid(), COLUMNS // 2, axis=1
    )  # across a pole the meridian goes on at the other side
    tall = np.vstack([beyond[MARGIN:0:-1], grid(), beyond[-2 : -2 - MARGIN : -1]])
    return spline_filter(np.pad(tall, ((0, 0), (MARGIN, MARGIN)), mode="wrap"), 3)


def undulation(lat: Array, lon: Array) -> Array:
    """(n,) height of the geoid EGM96 above the ellipsoid, m, at latitudes and longitudes (n,) in
    rad; NaN where one of these is.

    By cubic interpolation, which on this grid is off the model by 7 mm (rms) and 0.17 m at most
    (Karney, GeographicLib, "Geoid height"); the model is off the mean sea level by some 0.5 m.
    """
    from scipy.ndimage import map_coordinates

    known = np.isfinite(lat) & np.isfinite(lon)
    row = (90.0 - np.degrees(np.clip(lat[known], -np.pi / 2, np.pi / 2))) * STEPS + MARGIN
    column = np.degrees(lon[known]) % 360.0 * STEPS + MARGIN
    found = np.full(np.shape(known), np.nan)
    found[known] = map_coordinates(
        _spline(), [row, column], order=3, prefilter=False, mode="nearest"
    )
    return found
