"""Zero angular rate over ground while the vehicle is at rest: what the gyro reads then is its bias
and the Earth's rate. y = its mean reading over the step before, rad/s, body."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.earth import RATE
from ..core.mathematics.elementary import cosine, sine
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: y - (b_g + C' w), w the Earth's rate in n; with true C = exp(theta) C the
    derivative by theta is C' [w x]."""
    north, down = RATE * cosine(belief.lla[0]), -RATE * sine(belief.lla[0])
    for i in range(3):
        a, b, c = belief.C_nb[0, i], belief.C_nb[1, i], belief.C_nb[2, i]
        innovation[i] = y[i] - belief.b_g[i] - a * north - c * down
        H[i, 6], H[i, 7], H[i, 8] = b * down, c * north - a * down, -b * north
        H[i, 12 + i] = 1.0
    return 3


MEASUREMENT = MeasurementModel(
    "zero-angular-rate",
    observe,
    ("angular rate", "angular rate", "angular rate"),
    recorded=False,
    when="at rest",
    mean_of="gyro",
    reference="Groves (2013) section 15.3",
)
