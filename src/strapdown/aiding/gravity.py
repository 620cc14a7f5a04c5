"""The body does not accelerate: its specific force is the reaction to gravity. A constraint, for
bodies that stand, float or move steadily.

With true C = exp(theta) C and f = f_measured - b_a, -(C f + g) = theta x (C f) - C delta b_a for
the estimated C and f, m/s^2 in n: three rows, the third for the bias alone. An acceleration of the
body goes into the attitude as its angle against g; its standard deviation is what `std` must say.
"""

from ..core.loop.contract import OBSERVE, FilterState, MeasurementModel, SourceRow, kernel
from ..core.mathematics.earth import gravity, gravity_north, place
from ..core.mathematics.rotation import rotate_vector
from ..typing import Array


@kernel(OBSERVE)
def observe(belief: FilterState, y: Array, source: SourceRow, innovation: Array, H: Array) -> int:
    """Three rows: - gravity - specific force, m/s^2 NED, of the last sample."""
    C, f = belief.C_nb, belief.f
    n0, n1, n2 = rotate_vector(C, f[0], f[1], f[2])
    h = belief.lla[2]
    sine, cosine, _, _ = place(belief.lla[0], h)
    innovation[0], innovation[1], innovation[2] = (
        -n0 - gravity_north(sine, cosine, h),
        -n1,
        -n2 - gravity(sine, h),
    )
    H[0, 7], H[0, 8] = n2, -n1
    H[1, 6], H[1, 8] = -n2, n0
    H[2, 6], H[2, 7] = n1, -n0
    for i in range(3):
        for j in range(3):
            H[i, 9 + j] = -C[i, j]
    return 3


MEASUREMENT = MeasurementModel(
    "gravity",
    observe,
    ("acceleration", "acceleration", "acceleration"),
    pose_axes="n",
    recorded=False,
    reference="Fossen (2021) section 14.4.3, reference vector of gravity",
)
