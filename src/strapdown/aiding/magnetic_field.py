"""The magnetic field in body axes, T, calibrated; its reference vector in n is that of a field
model at date and place, or of the record.

h = C' m_n; with true C = exp(theta) C its derivative by theta is C' S(m_n). Needs the whole vector
right: where only its direction in the horizontal plane is to be trusted, the attitude filters take
that.
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: y - field in the body, T; source.parameters[0:3] is the reference, T NED."""
    C, m0, m1, m2 = belief.C_nb, source.parameters[0], source.parameters[1], source.parameters[2]
    for i in range(3):
        innovation[i] = y[i] - C[0, i] * m0 - C[1, i] * m1 - C[2, i] * m2
        H[i, 6] = C[1, i] * m2 - C[2, i] * m1
        H[i, 7] = C[2, i] * m0 - C[0, i] * m2
        H[i, 8] = C[0, i] * m1 - C[1, i] * m0
    return 3


MEASUREMENT = MeasurementModel(
    "magnetic-field",
    observe,
    ("magnetic field", "magnetic field", "magnetic field"),
    parameters="field",
    vector="b",
    reference="Fossen (2021) eq. 14.2.1 and section 14.4.3, magnetic reference vector",
    lanes=True,
)
