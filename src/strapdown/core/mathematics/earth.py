"""WGS-84: radii of curvature, Earth rate, transport rate, normal gravity with height. NED, SI and
radians.

Source: Groves (2013) sections 2.4 and 5.4; gravity down is Somigliana's formula with the
second-order height term (Heiskanen & Moritz 1967, 2-123), gravity north what follows from it
because gravity has no curl.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from ..compile.selection import any_of, where
from .elementary import cosine, sine
from .rotation import wrap

A = 6378137.0
"""Equatorial radius, m."""
F = 1 / 298.257223563
"""Flattening."""
E2 = F * (2 - F)
"""First eccentricity squared."""
RATE = 7.292115e-5
"""Earth rate, rad/s."""
MU = 3.986004418e14
"""Gravitational constant times mass, m^3/s^2."""
GRAVITY_EQUATOR, SOMIGLIANA = 9.7803253359, 0.00193185265241
M_RATIO = RATE**2 * A**3 * (1 - F) / MU
"""Centrifugal over gravitational acceleration at the equator."""
GRAVITY_NORTH_GRADIENT = 2 * GRAVITY_EQUATOR * (SOMIGLIANA + E2 / 2) / (A * (1 - E2))
"""By how much gravity's north component falls with height, over sin L cos L, 1/s^2: see
`gravity_north`."""
FAR_HEIGHT = 500e3
"""Height beyond which gravity is inverse-square instead of a series in height, m."""
LATITUDE_LIMIT = math.radians(89.0)
"""Results hold up to this latitude: beyond it the azimuth of the north axis turns too fast for a
metre of position error."""
SINE = tuple((-1) ** (k + 1) / math.factorial(2 * k + 3) for k in range(11))
"""Coefficients of x^3, x^5 ... in the series of the sine, as many as an angle up to pi/2 needs."""


@helper
def sine_of_latitude(lat: float) -> float:
    """Sine of an angle from -pi/2 to pi/2: of the same bits for one number and for lanes, to 2.5
    units in the last place, and sooner there than `elementary.sine`."""
    x = lat * lat
    xx = x * x
    low = (SINE[0] + x * SINE[1]) + xx * (SINE[2] + x * SINE[3])
    middle = (SINE[4] + x * SINE[5]) + xx * (SINE[6] + x * SINE[7])
    high = (SINE[8] + x * SINE[9]) + xx * SINE[10]
    return lat + lat * x * (low + xx * xx * (middle + xx * xx * high))


@helper
def radii(lat: float) -> tuple[float, float]:
    """Meridian and normal radius of curvature R_M, R_N, m."""
    return curvature(sine_of_latitude(lat))


@helper
def curvature(sine: float) -> tuple[float, float]:
    """`radii` at the sine of a latitude."""
    x = 1 - E2 * sine * sine
    R_N = A / math.sqrt(x)
    return R_N * (1 - E2) / x, R_N


@helper
def place(lat: float, h: float) -> tuple[float, float, float, float]:
    """Return the terms that every equation at a position needs: sine and cosine of latitude, M =
    R_M + h and N = R_N + h in m.

    The cosine comes from the sine, at half the price and 1e-13 of itself at 89 deg. It is kept
    above 1e-3, its value 6 km from a pole, so that a raw INS that crosses a pole stays finite.
    """
    sine = sine_of_latitude(lat)
    R_M, R_N = curvature(sine)
    return sine, max(math.sqrt(1 - sine * sine), 1e-3), R_M + h, R_N + h


@helper
def rotation_rates(
    v_n: float, v_e: float, sine: float, cosine: float, M: float, N: float
) -> tuple[float, float, float, float, float]:
    """omega_ie_n (north, down; east is zero) and omega_in_n = omega_ie_n + omega_en_n (north,
    east, down), rad/s."""
    ie_n, ie_d = RATE * cosine, -RATE * sine
    return ie_n, ie_d, ie_n + v_e / N, -v_n / M, ie_d - v_e * sine / (cosine * N)


@helper
def gravity(sine: float, h: float) -> float:
    """Down component of normal gravity, m/s^2, from the sine of latitude; inverse-square beyond
    `FAR_HEIGHT`, where only a raw INS gets."""
    square = sine * sine
    surface = GRAVITY_EQUATOR * (1 + SOMIGLIANA * square) / math.sqrt(1 - E2 * square)
    g = surface * (1 - 2 / A * (1 + F + M_RATIO - 2 * F * square) * h + 3 / (A * A) * h * h)
    far = abs(h) > FAR_HEIGHT
    if any_of(far):
        r = max(A + h, 0.1 * A)
        g = where(far, MU / (r * r), g)
    return g


@helper
def gravity_north(sine: float, cosine: float, h: float) -> float:
    """North component of normal gravity, m/s^2, from sine and cosine of latitude: towards the
    equator above the ellipsoid, 0 on it and, as of a point mass, beyond `FAR_HEIGHT`.

    In a meridian plane gravity g (down) and n (north) has no curl: d(n (R_M + h))/dh = -dg/dL. As n
    is 0 on the ellipsoid, n = -h/(R_M + h) times the mean of dg/dL over the heights below. To first
    order that is -h/R_M times the slope of Somigliana's formula, and of this 2 sin L cos L times
    its constant at the equator: what both grow by towards the poles is 0.9 % and cancels to 0.1 %.
    Groves (2013) 2.140 has the same form, with a constant 0.9 % smaller. Against the exact
    potential, 8.14e-5 m/s^2 at 45 deg and 10 km, it is off by 0.3 % of the largest at a height, or
    less, up to 20 km.
    """
    return where(abs(h) <= FAR_HEIGHT, -GRAVITY_NORTH_GRADIENT * sine * cosine * h, 0.0)


@helper
def gravity_gradient(sine: float, cosine: float, h: float) -> tuple[float, float]:
    """d gravity / d lat (m/s^2/rad) and d gravity / d h (1/s^2) of the down component, both with
    the second-order term."""
    square = sine * sine
    root = math.sqrt(1 - E2 * square)
    surface = GRAVITY_EQUATOR * (1 + SOMIGLIANA * square) / root
    linear = 2 / A * (1 + F + M_RATIO - 2 * F * square)
    height = 1 - linear * h + 3 / (A * A) * h * h
    surface_lat = (
        GRAVITY_EQUATOR
        * 2
        * sine
        * cosine
        * (SOMIGLIANA / root + 0.5 * E2 * (1 + SOMIGLIANA * square) / (root * root * root))
    )
    return surface_lat * height + surface * 8 * F / A * sine * cosine * h, surface * (
        -linear + 6 / (A * A) * h
    )


@helper
def vector_to(lla: Array, lat: float, lon: float, h: float) -> tuple[float, float, float]:
    """The straight vector from a geodetic position to another (rad, rad, m), m NED at the first:
    the difference of both in ECEF, with x in the meridian of the first."""
    here, there = sine_of_latitude(lla[0]), sine_of_latitude(lat)
    _, N = curvature(here)
    _, N_there = curvature(there)
    level, turn = cosine(lla[0]), wrap(lon - lla[1])
    out = (N_there + h) * cosine(lat)
    x = out * cosine(turn) - (N + lla[2]) * level
    z = (N_there * (1 - E2) + h) * there - (N * (1 - E2) + lla[2]) * here
    return level * z - here * x, out * sine(turn), -level * x - here * z


@helper
def displace(lla: Array, north: float, east: float, down: float) -> None:
    """Move a geodetic position by metres NED, in place; longitude stays in [-pi, pi], and a pole
    is crossed, not passed."""
    lla[0], lla[1] = displaced_lat_lon(lla, north, east)
    lla[2] -= down


@helper
def displaced_lat_lon(lla: Array, north: float, east: float) -> tuple[float, float]:
    """Return latitude and longitude (rad) of a geodetic position moved by `north` and `east` (m),
    as by `displace`."""
    sine = sine_of_latitude(lla[0])
    R_M, R_N = curvature(sine)
    lon = lla[1] + east / ((R_N + lla[2]) * max(math.sqrt(1 - sine * sine), 1e-6))
    lat = lla[0] + north / (R_M + lla[2])
    across = abs(lat) > 0.5 * math.pi
    if any_of(across):
        lat = where(across, math.copysign(math.pi, lat) - lat, lat)
        lon = where(across, lon + math.pi, lon)
    beyond = abs(lon) > math.pi
    if any_of(beyond):
        lon = where(beyond, wrap(lon), lon)
    return lat, lon
