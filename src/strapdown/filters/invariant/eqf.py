"""Equivariant filter with biases in the symmetry: errors on the right of SE_2(3), those of biases turned into
n, with the velocity as in the semi-direct product SE_2(3) x se(3), outputs linearised as the group
has them.

A position in n is no function of the pose that this symmetry leaves alone; as in the literature it is
taken as a zero that is measured in the body, C' (y - p) = 0, which gives the same H.
"""

from ...core.loop.contract import (
    CORRECT,
    DECAYING,
    Filter,
    FilterState,
    InitialState,
    Noise,
    Observe,
    SourceRow,
    kernel,
)
from ...typing import Array
from ..ins.closed_loop import predict
from .adjoint_change import SMOOTHER
from .composed import FIRST, SECOND_ORDER, SLOTS, compose
from .group_errors import IN_GROUP, RIGHT
from .iekf import on_group, say_usual
from .second_order import measure_to_second_order


def start(start: InitialState, noise: Noise, form: str = SECOND_ORDER) -> FilterState:
    """The filter state at `start`. form: "second-order", which is `iekf`, whose errors on either side give
    one filter; "published", with fixes linearised by the whole innovation, biases in the symmetry and no
    reset."""
    return on_group(start, form, IN_GROUP)


@kernel(CORRECT)
def correct(
    belief: FilterState,
    y: Array,
    std: Array,
    kind: int,
    observe: Observe,
    source: SourceRow,
    gate: float,
    innovation: Array,
) -> float:
    """Correct P; compose the correction along the group, on the right."""
    whole = belief.workspace[FIRST]
    nis = measure_to_second_order(belief, y, std, observe, source, gate, innovation, whole)
    if nis <= gate:
        compose(belief, RIGHT)
    return nis


EQF = Filter(
    "eqf",
    "Fornasier, Ge, van Goor, Mahony & Weiss (2023), arXiv:2309.03765",
    start,
    predict,
    correct,
    slots=SLOTS,
    configure=say_usual,
    smoother=SMOOTHER,
    installation=True,
    bias=DECAYING,
    good_for="comparisons with the literature on symmetries",
    poor_for="other uses: to second order it is iekf",
)
