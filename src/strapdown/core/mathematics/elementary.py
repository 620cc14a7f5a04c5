"""Elementary functions in plain arithmetic: sine, cosine, tangent, logarithm, exponential, arctangent.

Each is the same sequence of roundings for a float in plain Python, in compiled code and in each of
eight lanes, so that all give the same bits, which the C library's functions do not promise. There is
no `if` on a value: both ways are computed, and `where` chooses (`core/compile/selection.py`). Integers are read
and made by `bits` and `from_bits`, with shifts and masks that never see a sign.

Reduction of arguments: Cody & Waite (1980), "Software manual for the elementary functions".
Polynomials and their coefficients: FDLIBM 5.3 (Sun Microsystems 1993). Errors stay below 1 unit in
the last place, of `sine_cosine_of_turns` and `arctangent2` below 2, of `tangent` below 3 and of
`exponential_less_one` below 4.
"""

import math

import numpy as np

from ..compile.jit import bits, from_bits, helper
from ..compile.lane_functions import stands_for
from ..compile.selection import where

SIGN = -(1 << 63)  # the sign of a float64
MAGNITUDE = (1 << 63) - 1  # all bits but that
ROUNDS = 1.5 * 2.0**52
"""A number to which others below 2^51 can be added to round them to whole ones, the last bits of the
sum being those of the whole number."""
ROUNDS_BITS = 0x4338000000000000
INFINITY, NAN = math.inf, math.nan


@helper
def floor(x: float) -> float:
    """The next whole number below, |x| < 2^51."""
    near = (x + ROUNDS) - ROUNDS
    return where(near > x, near - 1.0, near)


# ---- sine and cosine

QUARTERS = 6.36619772367581382433e-01  # 2/pi
PI_2 = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624871116645580e-21)
"""Pieces of pi/2 of 33 bits each, so that their products with a whole number below 2^20 are exact."""
PI_2_REST = 8.47842766036889956997e-32
MAX_ANGLE = 2.0**20
"""Rad: sine and cosine of a larger one are NaN."""
TWO_PI, TWO_PI_LOW = 6.28318530717958623200, 2.44929359829470641435e-16
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


@stands_for(math.sin, np.sin)
@helper
def sine(x: float) -> float:
    """Return the sine of an angle in rad; NaN beyond `MAX_ANGLE`."""
    return sine_cosine(x)[0]


@stands_for(math.cos, np.cos)
@helper
def cosine(x: float) -> float:
    """Return the cosine of an angle in rad; NaN beyond `MAX_ANGLE`."""
    return sine_cosine(x)[1]


@stands_for(math.tan, np.tan)
@helper
def tangent(x: float) -> float:
    """Return the tangent of an angle in rad; NaN beyond `MAX_ANGLE`."""
    s, c = sine_cosine(x)
    return s / c


@helper
def sine_cosine(x: float) -> tuple[float, float]:
    """(sine, cosine) of an angle in rad; NaN beyond `MAX_ANGLE`."""
    x = where(_magnitude(x) <= MAX_ANGLE, x, NAN)
    rounded = x * QUARTERS + ROUNDS
    n = rounded - ROUNDS
    first, lost = _difference(x - n * PI_2[0], n * PI_2[1])
    second, also_lost = _difference(first, n * PI_2[2])
    beyond = n * PI_2_REST - (lost + also_lost)
    angle = second - beyond
    return _of_quarter(angle, (second - angle) - beyond, bits(rounded) & 3)


@helper
def sine_cosine_of_turns(u: float) -> tuple[float, float]:
    """(sine, cosine) of 2 pi u, with u exactly as it is, below 2^48."""
    rounded = 4.0 * u + ROUNDS
    part = u - 0.25 * (rounded - ROUNDS)
    return _of_quarter(TWO_PI * part, TWO_PI_LOW * part, bits(rounded) & 3)


@helper
def _difference(a: float, b: float) -> tuple[float, float]:
    """(a - b as rounded, what rounding lost); Knuth's two-sum."""
    rounded = a - b
    taken = rounded - a
    return rounded, (a - (rounded - taken)) - (b + taken)


@helper
def _of_quarter(x: float, rest: float, quarter: int) -> tuple[float, float]:
    """Return sine and cosine of x + rest and `quarter` quarter turns, |x| <= pi/4."""
    z = x * x
    w = z * z
    r = S2 + z * (S3 + z * S4) + z * w * (S5 + z * S6)
    v = z * x
    s = x - ((z * (0.5 * rest - v * r) - rest) - v * S1)
    r = z * (C1 + z * (C2 + z * C3)) + w * w * (C4 + z * (C5 + z * C6))
    half = 0.5 * z
    w = 1.0 - half
    c = w + (((1.0 - w) - half) + (z * r - x * rest))
    turned = (quarter & 1) == 1
    sine, cosine = where(turned, c, s), where(turned, s, c)
    back = (quarter >> 1) << 63
    other = ((quarter ^ (quarter >> 1)) & 1) << 63
    return from_bits(bits(sine) ^ back), from_bits(bits(cosine) ^ other)


# ---- logarithm and exponential

LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
PER_LN2 = 1.44269504088896338700
L1, L2, L3 = 6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01
L4, L5, L6 = 2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01
L7 = 1.479819860511658591e-01
E1, E2, E3 = 1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05
E4, E5 = -1.65339022054652515390e-06, 4.13813679705723846039e-08
ONE_BITS, ROOT_HALF_BITS = 0x3FF0000000000000, 0x3FE6A09E00000000  # of 1 and, cut, of sqrt(1/2)
FRACTION = (1 << 52) - 1
WHOLE_BITS, WHOLE = 0x4330000000000000, 2.0**52
"""With the bits of a whole number below 2^52 in the place of its zeros it is 2^52 larger than that."""
MIN_NORMAL, RAISED = (
    2.0**-1022,
    54.0,
)  # the smallest normal number; 2^54 times a smaller one is normal


@stands_for(math.log, np.log)
@helper
def logarithm(x: float) -> float:
    """Natural; -inf of 0, NaN below it."""
    small = x < MIN_NORMAL
    found = logarithm_of_normal(where(small, x * 2.0**RAISED, x))
    far, near = -RAISED * LN2_HIGH, -RAISED * LN2_LOW
    found = where(small, (found + near) + far, found)
    found = where(x == INFINITY, x, found)
    return where(x > 0.0, found, where(x == 0.0, -INFINITY, NAN))


@helper
def logarithm_of_normal(x: float) -> float:
    """Natural logarithm of a finite number that is at least 2^-1022, without looking."""
    raised = bits(x) + (ONE_BITS - ROOT_HALF_BITS)
    k = from_bits(WHOLE_BITS | ((raised >> 52) & 0x7FF)) - (WHOLE + 1023.0)
    f = from_bits((raised & FRACTION) + ROOT_HALF_BITS) - 1.0
    half = 0.5 * f * f
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    r = w * (L2 + w * (L4 + w * L6)) + z * (L1 + w * (L3 + w * (L5 + w * L7)))
    return k * LN2_HIGH - ((half - (s * (half + r) + k * LN2_LOW)) - f)


@stands_for(math.exp, np.exp)
@helper
def exponential(x: float) -> float:
    """e^x; inf and 0 where float64 ends."""
    x = where(x > 710.0, 710.0, where(x < -746.0, -746.0, x))
    rounded = x * PER_LN2 + ROUNDS
    k = rounded - ROUNDS
    high, low = x - k * LN2_HIGH, k * LN2_LOW
    r = high - low
    z = r * r
    c = r - z * (E1 + z * (E2 + z * (E3 + z * (E4 + z * E5))))
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    # 2^k in two factors, because 2^k itself need not be a normal number
    power = (bits(rounded) - ROUNDS_BITS + 2 * 1023) & 0xFFF
    first = power >> 1
    return y * from_bits(first << 52) * from_bits((power - first) << 52)


@stands_for(math.expm1, np.expm1)
@helper
def exponential_less_one(x: float) -> float:
    """e^x - 1, also of a small x: corrected for the rounding of e^x, as Kahan does."""
    e = exponential(x)
    less = e - 1.0
    near = (e != 1.0) & (less != -1.0) & (e < INFINITY)
    return where(near, less * (x / logarithm(where(near, e, 2.0))), where(e == 1.0, x, less))


# ---- arctangent

ATAN_1_2, ATAN_1_2_LOW = 4.63647609000806093515e-01, 2.26987774529616870924e-17
ATAN_3_2, ATAN_3_2_LOW = 9.82793723247329054082e-01, 1.39033110312309984516e-17
PI_HALF, PI_HALF_LOW = 1.57079632679489655800, 6.12323399573676603587e-17
A0, A1, A2 = 3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01
A3, A4, A5 = -1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02
A6, A7, A8 = 6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02
A9, A10 = -3.65315727442169155270e-02, 1.62858201153657823623e-02


@stands_for(math.atan, np.arctan)
@helper
def arctangent(x: float) -> float:
    """Between -pi/2 and pi/2, rad."""
    return _copy_sign(_of_slope(_magnitude(x)), x)


@stands_for(math.atan2, np.arctan2)
@helper
def arctangent2(y: float, x: float) -> float:
    """Angle of the point (x, y), from -pi to pi, rad; zeros and infinities as in math.atan2."""
    across, along = _magnitude(y), _magnitude(x)
    steep, left = across > along, bits(x) < 0
    small, large = where(steep, along, across), where(steep, across, along)
    slope = small / where(large == 0.0, 1.0, large)
    slope = where(across == along, where(large == 0.0, 0.0, 1.0), slope)  # also of infinities
    angle = _of_slope(slope)
    angle = where(steep, where(left, angle, -angle), where(left, -angle, angle))
    high = where(steep, PI_HALF, where(left, 2.0 * PI_HALF, 0.0))
    low = where(steep, PI_HALF_LOW, where(left, 2.0 * PI_HALF_LOW, 0.0))
    return _copy_sign(high + (angle + low), y)


@helper
def _of_slope(x: float) -> float:
    """Arctangent of x >= 0: of the nearest of 0, 1/2, 1, 3/2 and infinity, and what is left."""
    up = where(x < 2.4375, x - 1.5, -1.0)
    up = where(x < 1.1875, x - 1.0, up)
    up = where(x < 0.6875, 2.0 * x - 1.0, up)
    up = where(x < 0.4375, x, up)
    by = where(x < 2.4375, 1.0 + 1.5 * x, x)
    by = where(x < 1.1875, x + 1.0, by)
    by = where(x < 0.6875, 2.0 + x, by)
    by = where(x < 0.4375, 1.0, by)
    high = where(x < 2.4375, ATAN_3_2, PI_HALF)
    high = where(x < 1.1875, 0.5 * PI_HALF, high)
    high = where(x < 0.6875, ATAN_1_2, high)
    high = where(x < 0.4375, 0.0, high)
    low = where(x < 2.4375, ATAN_3_2_LOW, PI_HALF_LOW)
    low = where(x < 1.1875, 0.5 * PI_HALF_LOW, low)
    low = where(x < 0.6875, ATAN_1_2_LOW, low)
    low = where(x < 0.4375, 0.0, low)
    t = up / by
    z = t * t
    w = z * z
    odd = z * (A0 + w * (A2 + w * (A4 + w * (A6 + w * (A8 + w * A10)))))
    even = w * (A1 + w * (A3 + w * (A5 + w * (A7 + w * A9))))
    return high - ((t * (odd + even) - low) - t)


@helper
def _magnitude(x: float) -> float:
    return from_bits(bits(x) & MAGNITUDE)


@helper
def _copy_sign(x: float, like: float) -> float:
    """x >= 0 with the sign of another number, zeros included."""
    return from_bits(bits(x) | (bits(like) & SIGN))


@stands_for(math.hypot)
@helper
def hypotenuse(x: float, y: float) -> float:
    """Return the hypotenuse of a right-angled triangle with these sides."""
    return math.sqrt(x * x + y * y)
