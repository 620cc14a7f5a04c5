"""A magnetic field is compared with the Earth's by strength and dip, which no turn about the vertical
changes. Iron or a current near by changes the direction of the field's horizontal part as much as it
changes these two, so that a heading from such a field is none.
"""

import math

from ...typing import Array
from ..compile.jit import helper
from .belief import STATES, FilterState
from .source import SourceRow

STRENGTH_ALLOWED, DIP_ALLOWED = 0.15, math.radians(8.0)
"""Share of the known strength, and rad, by which a field may be off besides its noise and the tilt's
uncertainty. A room bends it by as much (the BROAD trials without a magnet: 12 % and 8 deg)."""
SURELY = 3.0
"""Standard deviations of noise, tilt and hard iron that are allowed besides."""


@helper
def is_disturbed(belief: FilterState, y: Array, std: Array, source: SourceRow) -> bool:
    """True where a field y (T, body, std its three standard deviations) is off the strength or the
    downward part of the reference, `source.parameters[0:3]`, T NED, by more than an undisturbed one."""
    C, m, P = belief.C_nb, source.parameters, belief.P
    a, b, c = (
        _without_iron(0, belief, y, source),
        _without_iron(1, belief, y, source),
        _without_iron(2, belief, y, source),
    )
    strength = math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
    variance = (std[0] * std[0] + std[1] * std[1] + std[2] * std[2]) / 3 + iron_variance(
        belief, source
    )
    noise, tilt = SURELY * math.sqrt(variance), SURELY * math.sqrt(P[6, 6] + P[7, 7])
    size, down = math.sqrt(a * a + b * b + c * c), C[2, 0] * a + C[2, 1] * b + C[2, 2] * c
    strong = abs(size - strength) > STRENGTH_ALLOWED * strength + noise
    dips = abs(down - m[2]) > (DIP_ALLOWED + tilt) * strength + noise
    return (strong | dips) & (strength > 0)


@helper
def _without_iron(i: int, belief: FilterState, y: Array, source: SourceRow) -> float:
    """Component i of the field less the hard iron, where that is a state."""
    state = source.iron_state[i]
    return y[i] - belief.augmented[state - STATES] if state > 0 else y[i]


@helper
def iron_variance(belief: FilterState, source: SourceRow) -> float:
    """That of the hard iron, of all components that are states, T^2."""
    variance = 0.0 * belief.P[0, 0]
    for i in range(3):
        state = source.iron_state[i]
        if state > 0:
            variance = variance + belief.P[state, state]
    return variance
