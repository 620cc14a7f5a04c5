"""Zero velocity over ground while the vehicle is at rest;
`strapdown.preprocessing.stationary.at_rest` finds when."""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: 0 - velocity, m/s NED."""
    for i in range(3):
        innovation[i] = -belief.v_n[i]
        H[i, 3 + i] = 1.0
    return 3


MEASUREMENT = MeasurementModel(
    "zero-velocity",
    observe,
    ("speed", "speed", "speed"),
    pose_axes="n",
    recorded=False,
    when="at rest",
    reference="Groves (2013) section 15.3",
    lanes=True,
)
