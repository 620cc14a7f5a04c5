"""The magnetic field in body axes, T; its reference vector m in n is that of a field model at date and
place, or of the record.

h = C' m; with true C = exp(theta) C its derivative by theta is C' S(m). Needs the whole vector right:
where only its direction in the horizontal plane is to be trusted, the attitude filters take that.

What a calibration would have found may be states instead: h = (I + S) C' R (m + d) + b with the hard
iron b, the soft iron S (symmetric), the error d of the field's model, and R, which turns about the
vertical by the error of the declination.
"""

import math

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, helper, kernel
from ..core.mathematics.rotation import Three, axis, cross
from ..typing import Array
from . import augmented

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Rows and columns of the components of a symmetric matrix."""


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: y - field in the body, T; source.parameters[0:3] is the reference, T NED."""
    if augmented.any_of(belief, source):
        observe_uncalibrated(belief, y, source, innovation, H)
        return 3
    C, m0, m1, m2 = belief.C_nb, source.parameters[0], source.parameters[1], source.parameters[2]
    for i in range(3):
        innovation[i] = y[i] - C[0, i] * m0 - C[1, i] * m1 - C[2, i] * m2
        H[i, 6] = C[1, i] * m2 - C[2, i] * m1
        H[i, 7] = C[2, i] * m0 - C[0, i] * m2
        H[i, 8] = C[0, i] * m1 - C[1, i] * m0
    return 3


@helper
def observe_uncalibrated(
    belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array
) -> None:
    """Three rows with the states of a magnetometer that nobody calibrated. Columns of soft iron and field
    are at the reference as given: strength of the field and common scale of the sensor are one to the
    data, and columns that move with the estimates would make two of them."""
    C, p, m = belief.C_nb, source.parameters, earth_field(belief, source)
    iron = augmented.errors(belief, source.iron_state)
    seen = soft_iron_field(belief, source, augmented.turned_back(C, m))
    for i in range(3):
        innovation[i] = y[i] - seen[i] - iron[i]
    for k in range(3):
        unit = axis(k)
        turned = augmented.turned_back(C, cross(m, unit))
        by = soft_iron_field(belief, source, turned)
        H[0, 6 + k], H[1, 6 + k], H[2, 6 + k] = by
        augmented.column(H, source.iron_state[k], unit)
        augmented.column(H, source.field_state[k], augmented.turned_back(C, unit))
    about = augmented.turned_back(C, cross(axis(2), m))
    augmented.column(H, source.declination_state, soft_iron_field(belief, source, about))
    given = augmented.turned_back(C, (p[0], p[1], p[2]))
    for k in range(6):
        state, (i, j) = source.soft_state[k], PAIRS[k]
        if state > 0:
            H[i, state] = given[j]
            H[j, state] = given[i]


@helper
def earth_field(belief: FilterState, source: SourceRow) -> Three:
    """The reference with its errors, T NED."""
    d, p = augmented.errors(belief, source.field_state), source.parameters
    return turned_by_declination(belief, source, (p[0] + d[0], p[1] + d[1], p[2] + d[2]))


@helper
def turned_by_declination(belief: FilterState, source: SourceRow, m: Three) -> Three:
    """A vector in n, turned about the vertical by the error of the declination."""
    angle = augmented.error(belief, source.declination_state)
    c, s = math.cos(angle), math.sin(angle)
    return c * m[0] - s * m[1], s * m[0] + c * m[1], m[2]


@helper
def soft_iron_field(belief: FilterState, source: SourceRow, m: Three) -> Three:
    """(I + S) m of a vector in the body."""
    by = source.soft_state
    xx, yy, zz = (
        augmented.error(belief, by[0]),
        augmented.error(belief, by[1]),
        augmented.error(belief, by[2]),
    )
    xy, xz, yz = (
        augmented.error(belief, by[3]),
        augmented.error(belief, by[4]),
        augmented.error(belief, by[5]),
    )
    return (
        (1.0 + xx) * m[0] + xy * m[1] + xz * m[2],
        xy * m[0] + (1.0 + yy) * m[1] + yz * m[2],
        xz * m[0] + yz * m[1] + (1.0 + zz) * m[2],
    )


MEASUREMENT = MeasurementModel(
    "magnetic-field",
    observe,
    ("magnetic field", "magnetic field", "magnetic field"),
    pose_axes="b",
    parameters="field",
    vector="b",
    calibration_parameters=("hard-iron", "soft-iron", "field", "declination"),
    reference="Fossen (2021) sections 14.1.3 and 14.4.3, magnetic reference vector; hard and soft "
    "iron: Gebre-Egziabher et al. (2006), J. Aerospace Engineering 19(2)",
    lanes=True,
)
