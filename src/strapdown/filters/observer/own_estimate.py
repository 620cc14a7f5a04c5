"""The exogenous filter while estimate and observer agree: linearised at the estimate itself, but at
the heading of the observer where that is the better known one.

Without turns the bias of a poor gyro makes the heading uncertain by tens of degrees, and no fix
corrects it. At such a heading the model joins tilt (n) and accelerometer bias (body) wrongly, and
what it has learnt of the two no longer agrees when the heading is corrected. So it is taken at the
estimate turned back by TURN, to the observer's heading; TURN is what remains of delta. Errors are
counted from the estimate, and P is theirs: to first order its tilts lie half of TURN further about
the vertical than those about the heading of the model, log(exp(a) exp([0 0 -TURN])).
"""

from ...core.compile.jit import helper, inline
from ...core.compile.selection import any_of, where
from ...core.loop.contract import FilterState, Slots
from ...core.mathematics.elementary import arctangent2, sine_cosine
from ...core.mathematics.error_state import turn_half
from ...core.mathematics.rotation import wrap
from ...typing import Array
from .equations import MAX_COURSE_STD, SINCE_COURSE, SINCE_FIELD, SINCE_HEADING, TRUSTED

OWN = Slots()
TURN = OWN.number("TURN")  # rad, estimated heading less that of the model
DOUBT = OWN.number("DOUBT")  # forgetting mean of the NIS by rows
CERTAIN = 0.5 * MAX_COURSE_STD
"""Standard deviation of the heading, rad, below which the model is taken at it."""
SHARE = 0.05
"""Share of a fix that counts in DOUBT."""
MAX_NIS = 10.0
"""By rows, that counts in DOUBT: one outlier is no reason for it."""
LOST = 2.0
"""DOUBT, 1 for a filter that is right, beyond which the fixes speak against the estimate."""
WITHIN = 3.0
"""Standard deviations that the observer's heading may be off the estimate to be taken."""


@inline
def take_heading(belief: FilterState, bar: FilterState, own: Array, wanted: bool) -> None:
    """Decide the heading of the model, where it is taken at the estimate: the observer's where
    something tells it one, the estimate's is uncertain, and the two do not contradict each other.

    The observer's turns leave the errors about the model as they are, and with them P.
    """
    said, C, variance, before = bar.workspace, belief.C_nb, belief.P[8, 8], own[TURN]
    since = min(said[SINCE_COURSE], min(said[SINCE_HEADING], said[SINCE_FIELD]))
    better = wanted & (since <= TRUSTED) & (variance >= CERTAIN * CERTAIN)
    z = where(wanted, 0.0, before)
    if any_of(better):
        angle = wrap(arctangent2(C[1, 0], C[0, 0]) - arctangent2(bar.C_nb[1, 0], bar.C_nb[0, 0]))
        better = better & (angle * angle <= WITHIN * WITHIN * variance)
        z = where(better, angle, z)
        again = better & (before != 0)
        turn_tilts(belief.P, where(again, wrap(z - before), 0.0))
    own[TURN] = z


@helper
def turn_heading(C: Array, z: float) -> None:
    """C <- exp([0 0 z]) C, rad."""
    if any_of(z != 0):
        s, c = sine_cosine(z)
        for j in range(3):
            C[0, j], C[1, j] = c * C[0, j] - s * C[1, j], s * C[0, j] + c * C[1, j]


@helper
def turn_tilts(P: Array, z: float) -> None:
    """P of tilts that are turned by half of z (rad) about the vertical."""
    if any_of(z != 0):
        turn_half(P, 0.0, 0.0, z)


@helper
def rotate_plane(x: float, y: float, z: float) -> tuple[float, float]:
    """The vector (x, y) turned by z (rad)."""
    s, c = sine_cosine(z)
    return c * x - s * y, s * x + c * y
