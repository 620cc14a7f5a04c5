"""A floating body heaves about mean sea level. The waves are the noise: `std` is that of the heave,
m.

y is the height of mean sea level above the ellipsoid, m: the undulation of the geoid where heights
are ellipsoidal, 0 where heave is all that is wanted.
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..typing import Array
from .altitude import height


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """One row, down: estimated height of the point of the waterline at source.parameters[0:3] (m, body)
    - y, m."""
    return height(belief, y[0], source, innovation, H)


MEASUREMENT = MeasurementModel(
    "zero-sea-level",
    observe,
    ("length",),
    pose_axes="n",
    parameters="reference",
    recorded=False,
    reference="Fossen (2021) section 14.4.3: z = 0 aiding of surface craft",
)
